//! A layer over sequences that are known beforehand.

use rayon::prelude::*;

use crate::lanes::Number;
use crate::layer::{Backward, Forward, History, State, StateGradient, in_pool};
use crate::multiply::{Destination, multiply, multiply_all};
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;
use crate::weight_gradients::{Gone, weight_gradients};
use crate::weights::{LayerGradients, LayerWeights};

/// A layer's way through a batch, kept for the way back.
#[derive(Debug, Clone)]
pub struct Sequence<T: Number> {
    plan: Plan,
    parts: Vec<Part<T>>,
    hidden_units: usize,
}

/// The way of a part of the batch.
#[derive(Debug, Clone)]
struct Part<T: Number> {
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
        assert_eq!(input.len(), plan.whole() * plan.width() * feature, "input of {feature} features");
        let packed = Forward::new(weights, lanes);
        let parts = plan
            .parts()
            .into_par_iter()
            .map(|plan| {
                let input = plan.gather(input, feature, WIDE * lanes);
                let mut history = History::new(&plan, initial, hidden, lanes);
                for steps in plan.blocks() {
                    history.steps(&plan, &packed, &steps, &input, 0);
                }
                Part { plan, input, history }
            })
            .collect();
        Self { plan, parts, hidden_units: hidden }
    }

    pub(crate) fn hidden_states(&self) -> Vec<T> {
        let mut states = vec![T::default(); self.plan.whole() * self.plan.width() * self.hidden_units];
        for part in &self.parts {
            part.plan.scatter(&part.history.hidden, part.plan.batch(), &mut states);
        }
        states
    }

    pub(crate) fn state(&self) -> State<T> {
        let mut state = State::zeros(self.plan.whole(), self.hidden_units);
        for part in &self.parts {
            part.history.last_state(&part.plan, &mut state);
        }
        state
    }

    pub(crate) fn run_back(
        mut self,
        weights: &LayerWeights<'_, T>,
        output: Option<&[T]>,
        last: Option<&State<T>>,
        want_input: bool,
    ) -> SequenceGradients<T> {
        let instructions = self.plan.instructions;
        let lanes = T::lanes(instructions);
        let (feature, hidden) = (weights.feature(), weights.hidden());
        let packed = Backward::new(weights, lanes);
        let states: Vec<StateGradient<T>> =
            self.parts.par_iter_mut().map(|part| part.back(&packed, output, last, hidden)).collect();
        let mut initial = State::zeros(self.plan.whole(), hidden);
        for (part, gradient) in self.parts.iter().zip(&states) {
            gradient.write(&part.plan, &mut initial);
        }
        let input = want_input.then(|| {
            let mut input = vec![T::default(); self.plan.whole() * self.plan.width() * feature];
            for Part { plan, history, .. } in &self.parts {
                let frames = plan.num_frames();
                let mut product = Panels::unset(0, frames, feature, WIDE * lanes);
                multiply_all(instructions, &history.gates, 0, &packed.input, None, &mut product, 0..frames);
                plan.scatter(&product, 0, &mut input);
            }
            input
        });
        let gone: Vec<Gone<'_, T>> = self
            .parts
            .iter()
            .map(|Part { plan, input, history }| Gone { plan, history, input, first_row: 0 })
            .collect();
        SequenceGradients { input, weights: weight_gradients(instructions, &gone), initial }
    }
}

impl<T: Number> Part<T> {
    /// Fills the gates with gradients; yields that of the initial state.
    fn back(
        &mut self,
        packed: &Backward<T>,
        output: Option<&[T]>,
        last: Option<&State<T>>,
        hidden: usize,
    ) -> StateGradient<T> {
        let Self { plan, history, .. } = self;
        let lanes = T::lanes(plan.instructions);
        let above = output.map(|output| plan.gather(output, hidden, lanes));
        let mut gradient = StateGradient::new(plan, last, hidden, lanes);
        for step in (0..plan.num_steps()).rev() {
            let frames = plan.frames(step);
            let from_above = above.as_ref().map(|above| (above, frames.start));
            history.step_back(plan, step, from_above, &mut gradient);
            let destination = Destination {
                panels: &mut gradient.hidden,
                first_row: 0,
                packed: &packed.recurrent,
                bias: None,
            };
            multiply(plan.instructions, &history.gates, frames.start, frames.len(), vec![destination]);
        }
        gradient
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
