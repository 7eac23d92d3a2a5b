//! Stacked layers that hear their own output.

mod part;

use rayon::prelude::*;

use crate::lanes::Number;
use crate::layer::{State, in_pool};
use crate::plan::Plan;
use crate::weight_gradients::{plain_outer, weight_gradients};
use crate::weights::{LayerGradients, LayerWeights};
use part::{Back, Packs, Part, Transposed};

/// The linear map from the top layer's hidden states to the output.
#[derive(Debug, Clone, Copy)]
pub struct Projection<'a, T> {
    /// `[hidden, output]`.
    pub weights: &'a [T],
    /// `[output]`.
    pub bias: &'a [T],
}

/// How an output becomes the next input.
#[derive(Debug, Clone, Copy)]
pub enum Feedback<'a, T> {
    /// The output is tanh of the projection, and it is the next input.
    Tanh,
    /// The output is the projection, and the next input is the row of a table `[output, feature]` at its greatest number, the
    /// first of equals.
    ArgMax {
        /// The table.
        table: &'a [T],
    },
}

/// A decoder: layers from the bottom up, what they say, and how they hear it.
#[derive(Debug, Clone, Copy)]
pub struct Decoder<'a, T> {
    /// From the bottom up; each hears the hidden states of the one below at the same step.
    pub layers: &'a [LayerWeights<'a, T>],
    /// From the top layer to the output.
    pub projection: Projection<'a, T>,
    /// From the output to the bottom layer's next input.
    pub feedback: Feedback<'a, T>,
}

impl<T> Decoder<'_, T> {
    fn feature(&self) -> usize {
        self.layers[0].feature()
    }

    fn outputs(&self) -> usize {
        self.projection.bias.len()
    }

    fn top(&self) -> usize {
        self.layers[self.layers.len() - 1].hidden()
    }

    fn check(&self) {
        assert!(!self.layers.is_empty(), "a decoder without layers");
        for pair in self.layers.windows(2) {
            assert_eq!(pair[1].feature(), pair[0].hidden(), "layers that do not fit together");
        }
        assert_eq!(self.projection.weights.len(), self.top() * self.outputs(), "weights of the projection");
        match self.feedback {
            Feedback::Tanh => assert_eq!(self.feature(), self.outputs(), "the output is the next input"),
            Feedback::ArgMax { table } => {
                assert_eq!(
                    table.len(),
                    self.feature() * self.outputs(),
                    "a table of {} words",
                    self.outputs()
                );
            }
        }
    }
}

/// A decoder's way through a batch, kept for the way back.
#[derive(Debug, Clone)]
pub struct ClosedLoop<T: Number> {
    plan: Plan,
    parts: Vec<Part<T>>,
    num_outputs: usize,
}

/// Gradients of what [`ClosedLoop::forward`] was given.
#[derive(Debug, Clone)]
pub struct ClosedLoopGradients<T> {
    /// Of the first input, `[batch, feature]`.
    pub first: Vec<T>,
    /// Of the initial states, from the bottom up.
    pub initial: Vec<State<T>>,
    /// Of the layers' weights, from the bottom up.
    pub layers: Vec<LayerGradients<T>>,
    /// Of the projection's weights, `[hidden, output]`.
    pub projection: Vec<T>,
    /// Of the projection's bias, `[output]`.
    pub bias: Vec<T>,
    /// Of the table, `[output, feature]`, if there is one.
    pub table: Option<Vec<T>>,
}

impl<T: Number> ClosedLoop<T> {
    pub(crate) fn run(plan: Plan, first: &[T], initial: &[(&[T], &[T])], decoder: &Decoder<'_, T>) -> Self {
        decoder.check();
        let feature = decoder.feature();
        assert_eq!(first.len(), plan.whole() * feature, "first inputs of {feature} features");
        assert_eq!(initial.len(), decoder.layers.len(), "one initial state for each layer");
        let packs = Packs::new(decoder, T::lanes(plan.instructions));
        let parts = plan
            .parts()
            .into_par_iter()
            .map(|plan| Part::run(plan, first, initial, decoder, &packs))
            .collect();
        Self { plan, parts, num_outputs: decoder.outputs() }
    }

    pub(crate) fn output_values(&self) -> Vec<T> {
        let mut values = vec![T::default(); self.plan.whole() * self.plan.width() * self.num_outputs];
        for part in &self.parts {
            part.write_outputs(&mut values);
        }
        values
    }

    pub(crate) fn run_back(mut self, decoder: &Decoder<'_, T>, output: &[T]) -> ClosedLoopGradients<T> {
        let instructions = self.plan.instructions;
        let whole = self.plan.whole();
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        let packs = Transposed::new(decoder, T::lanes(instructions));
        let backs: Vec<Back<T>> =
            self.parts.par_iter_mut().map(|part| part.back(decoder, output, &packs)).collect();
        let mut first = vec![T::default(); whole * feature];
        let mut initial: Vec<State<T>> =
            decoder.layers.iter().map(|layer| State::zeros(whole, layer.hidden())).collect();
        let mut table = matches!(decoder.feedback, Feedback::ArgMax { .. })
            .then(|| vec![T::default(); outputs * feature]);
        for (part, back) in self.parts.iter().zip(&backs) {
            part.write_gradients(back, &mut first, &mut initial);
            if let Some(table) = &mut table {
                part.add_table_gradient(back, table);
            }
        }
        let factors: Vec<_> =
            self.parts.iter().zip(&backs).map(|(part, back)| part.projection_factors(back)).collect();
        // All at once: a thread that is done with one layer goes on with the next.
        let ((projection, bias), layers) = rayon::join(
            || plain_outer(instructions, &factors),
            || {
                let layers = (0..decoder.layers.len()).into_par_iter().map(|layer| {
                    let gone: Vec<_> = self.parts.iter().map(|part| part.gone(layer)).collect();
                    weight_gradients(instructions, &gone)
                });
                layers.collect()
            },
        );
        ClosedLoopGradients { first, initial, layers, projection, bias, table }
    }
}

/// See [`crate::sequence`]: compiled here, optimised.
macro_rules! entry_points {
    ($number:ty) => {
        impl ClosedLoop<$number> {
            /// Runs a decoder for as many steps as each sequence has frames.
            ///
            /// `first` is the input of the first step, `[batch, feature]`; `initial` holds hidden states and cells
            /// `[batch, hidden]`, from the bottom up.
            ///
            /// # Panics
            ///
            /// If a slice is not as long as the plan and the weights say.
            #[must_use]
            pub fn forward(
                plan: Plan,
                first: &[$number],
                initial: &[(&[$number], &[$number])],
                decoder: &Decoder<'_, $number>,
            ) -> Self {
                in_pool(|| Self::run(plan, first, initial, decoder))
            }

            /// Outputs `[batch, time, output]`, zeros in the padding.
            #[must_use]
            pub fn output(&self) -> Vec<$number> {
                self.output_values()
            }

            /// Gradients, given those of the output `[batch, time, output]`.
            ///
            /// # Panics
            ///
            /// If a slice or the weights have other shapes than on the way forward.
            #[must_use]
            pub fn backward(
                self,
                decoder: &Decoder<'_, $number>,
                output: &[$number],
            ) -> ClosedLoopGradients<$number> {
                in_pool(|| self.run_back(decoder, output))
            }
        }
    };
}

entry_points!(f32);
entry_points!(f64);
