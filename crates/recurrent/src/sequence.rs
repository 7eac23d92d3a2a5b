//! A layer over sequences that are known beforehand.

use crate::lanes::Number;
use crate::layer::{
    Backward, Destination, Forward, Hears, History, State, StateGradient, in_pool, multiply, multiply_all,
};
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;
use crate::weights::{LayerGradients, LayerWeights};

/// A layer's way through a batch, kept for the way back.
#[derive(Debug, Clone)]
pub struct Sequence<T> {
    plan: Plan,
    input: Panels<T>,
    history: History<T>,
}

/// Gradients of what [`Sequence::forward`] was given.
#[derive(Debug, Clone)]
pub struct SequenceGradients<T> {
    /// Of the input, `[batch, time, feature]`, zeros in the padding; none unless asked for.
    pub input: Option<Vec<T>>,
    /// Of the initial state.
    pub initial: State<T>,
    /// Of the weights.
    pub weights: LayerGradients<T>,
}

impl<T: Number> Sequence<T> {
    pub(crate) fn run(
        plan: Plan,
        input: &[T],
        initial: Option<(&[T], &[T])>,
        weights: &LayerWeights<'_, T>,
    ) -> Self {
        let lanes = T::lanes(plan.instructions);
        let (feature, hidden) = (weights.feature(), weights.hidden());
        assert_eq!(input.len(), plan.batch() * plan.width() * feature, "input of {feature} features");
        let packed = Forward::new(weights, lanes);
        let input = plan.gather(input, feature, WIDE * lanes);
        let mut history = History::new(&plan, initial, hidden, lanes);
        history.hear(&plan, &packed, &input, 0);
        for step in 0..plan.num_steps() {
            history.step(&plan, &packed, step, &Hears::Gates);
        }
        Self { plan, input, history }
    }

    pub(crate) fn hidden_states(&self) -> Vec<T> {
        self.plan.scatter(&self.history.hidden, self.plan.batch())
    }

    pub(crate) fn state(&self) -> State<T> {
        self.history.last_state(&self.plan)
    }

    pub(crate) fn run_back(
        mut self,
        weights: &LayerWeights<'_, T>,
        output: Option<&[T]>,
        last: Option<&State<T>>,
        want_input: bool,
    ) -> SequenceGradients<T> {
        let plan = &self.plan;
        let lanes = T::lanes(plan.instructions);
        let (feature, hidden) = (weights.feature(), weights.hidden());
        let packed = Backward::new(weights, lanes);
        let above = output.map(|output| plan.gather(output, hidden, lanes));
        let mut gradient = StateGradient::new(plan, last, hidden, lanes);
        for step in (0..plan.num_steps()).rev() {
            let frames = plan.frames(step);
            let from_above = above.as_ref().map(|above| (above, frames.start));
            self.history.step_back(plan, step, from_above, &mut gradient);
            let destination = Destination {
                panels: &mut gradient.hidden,
                first_row: 0,
                packed: &packed.recurrent,
                bias: None,
            };
            multiply(plan.instructions, &self.history.gates, frames.start, frames.len(), vec![destination]);
        }
        let input = want_input.then(|| {
            let gates = &self.history.gates;
            let rows = plan.num_frames();
            let product =
                multiply_all(plan.instructions, gates, 0, rows, &packed.input, feature, WIDE * lanes);
            plan.scatter(&product, 0)
        });
        SequenceGradients {
            input,
            weights: self.history.weight_gradients(plan, &self.input, 0),
            initial: gradient.into_state(plan),
        }
    }
}

/// The compiled kernels are reached through these, so that they are compiled here, optimised, and not where they are used.
macro_rules! entry_points {
    ($number:ty) => {
        impl Sequence<$number> {
            /// Runs a layer over `input` `[batch, time, feature]`.
            ///
            /// `initial` holds hidden states and cells `[batch, hidden]`; zeros if none.
            ///
            /// # Panics
            ///
            /// If a slice is not as long as the plan and the weights say.
            #[must_use]
            pub fn forward(
                plan: Plan,
                input: &[$number],
                initial: Option<(&[$number], &[$number])>,
                weights: &LayerWeights<'_, $number>,
            ) -> Self {
                in_pool(|| Self::run(plan, input, initial, weights))
            }

            /// Hidden states `[batch, time, hidden]`, zeros in the padding.
            #[must_use]
            pub fn output(&self) -> Vec<$number> {
                self.hidden_states()
            }

            /// The state after the last frame of each sequence; the initial one where a sequence is empty.
            #[must_use]
            pub fn last(&self) -> State<$number> {
                self.state()
            }

            /// Gradients, given those of the output `[batch, time, hidden]` and of the last state.
            ///
            /// # Panics
            ///
            /// If a slice or the weights have other shapes than on the way forward.
            #[must_use]
            pub fn backward(
                self,
                weights: &LayerWeights<'_, $number>,
                output: Option<&[$number]>,
                last: Option<&State<$number>>,
                want_input: bool,
            ) -> SequenceGradients<$number> {
                in_pool(|| self.run_back(weights, output, last, want_input))
            }
        }
    };
}

entry_points!(f32);
entry_points!(f64);
