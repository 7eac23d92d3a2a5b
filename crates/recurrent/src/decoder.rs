//! Stacked layers and what they say, unrolled over a batch.

mod closed;
mod open;
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

/// What happens to the projection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// It is the output.
    None,
    /// Its tanh is the output.
    Tanh,
}

/// Layers from the bottom up, and what they say.
#[derive(Debug, Clone, Copy)]
pub struct Decoder<'a, T> {
    /// From the bottom up; each hears the hidden states of the one below at the same step.
    pub layers: &'a [LayerWeights<'a, T>],
    /// From the top layer to the output.
    pub projection: Projection<'a, T>,
    /// From the projection to the output.
    pub activation: Activation,
}

/// What the bottom layer hears.
#[derive(Debug, Clone, Copy)]
pub enum Hearing<'a, T> {
    /// Inputs that are known beforehand, `[batch, time, feature]`.
    Known(&'a [T]),
    /// An input for the first step, `[batch, feature]`, and then the output of the step before.
    Own(&'a [T]),
    /// An input for the first step, `[batch, feature]`, and then a row of a table.
    Words {
        /// The input of the first step.
        first: &'a [T],
        /// `[output, feature]`: the row heard is that of the greatest output of the step before, the first of equals.
        table: &'a [T],
    },
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

    fn check(&self, plan: &Plan, hearing: &Hearing<'_, T>) {
        assert!(!self.layers.is_empty(), "a decoder without layers");
        for pair in self.layers.windows(2) {
            assert_eq!(pair[1].feature(), pair[0].hidden(), "layers that do not fit together");
        }
        let (feature, outputs) = (self.feature(), self.outputs());
        assert_eq!(self.projection.weights.len(), self.top() * outputs, "weights of the projection");
        let steps = match hearing {
            Hearing::Known(_) => plan.width(),
            Hearing::Own(_) | Hearing::Words { .. } => 1,
        };
        let (Hearing::Known(inputs) | Hearing::Own(inputs) | Hearing::Words { first: inputs, .. }) = hearing;
        assert_eq!(inputs.len(), plan.whole() * steps * feature, "inputs of {feature} features");
        match hearing {
            Hearing::Known(_) => {}
            Hearing::Own(_) => assert_eq!(feature, outputs, "the output is the next input"),
            Hearing::Words { table, .. } => {
                assert_eq!(table.len(), feature * outputs, "a table of {outputs} words");
            }
        }
    }
}

/// A decoder's way through a batch, kept for the way back.
#[derive(Debug, Clone)]
pub struct Unrolled<T: Number> {
    plan: Plan,
    parts: Vec<Part<T>>,
    num_outputs: usize,
    hears: Hears,
}

/// What the bottom layer heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hears {
    Known,
    Own,
    Words,
}

/// Gradients of what [`Unrolled::forward`] was given.
#[derive(Debug, Clone)]
pub struct UnrolledGradients<T> {
    /// Of the first input, `[batch, feature]`, or of known inputs, `[batch, time, feature]`, zeros in the padding; none of known
    /// inputs unless asked for.
    pub inputs: Option<Vec<T>>,
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

impl<T: Number> Unrolled<T> {
    pub(crate) fn run(
        plan: Plan,
        hearing: Hearing<'_, T>,
        initial: &[(&[T], &[T])],
        decoder: &Decoder<'_, T>,
    ) -> Self {
        decoder.check(&plan, &hearing);
        assert_eq!(initial.len(), decoder.layers.len(), "one initial state for each layer");
        let packs = Packs::new(decoder, T::lanes(plan.instructions));
        let run = |plan| match hearing {
            Hearing::Known(inputs) => Part::run_open(plan, inputs, initial, decoder, &packs),
            Hearing::Own(first) => Part::run_closed(plan, first, None, initial, decoder, &packs),
            Hearing::Words { first, table } => {
                Part::run_closed(plan, first, Some(table), initial, decoder, &packs)
            }
        };
        let parts = plan.parts().into_par_iter().map(run).collect();
        let hears = match hearing {
            Hearing::Known(_) => Hears::Known,
            Hearing::Own(_) => Hears::Own,
            Hearing::Words { .. } => Hears::Words,
        };
        Self { plan, parts, num_outputs: decoder.outputs(), hears }
    }

    pub(crate) fn output_values(&self) -> Vec<T> {
        let mut values = vec![T::default(); self.plan.num_frames() * self.num_outputs];
        for part in &self.parts {
            part.write_outputs(&mut values);
        }
        values
    }

    pub(crate) fn run_back(
        mut self,
        decoder: &Decoder<'_, T>,
        output: &[T],
        want_inputs: bool,
    ) -> UnrolledGradients<T> {
        assert_eq!(output.len(), self.plan.num_frames() * self.num_outputs, "gradients of the output");
        let instructions = self.plan.instructions;
        let (whole, hears) = (self.plan.whole(), self.hears);
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        let packs = Transposed::new(decoder, T::lanes(instructions));
        let backs: Vec<Back<T>> = self
            .parts
            .par_iter_mut()
            .map(|part| match hears {
                Hears::Known => part.back_open(decoder, output, &packs, want_inputs),
                Hears::Own | Hears::Words => part.back_closed(decoder, output, &packs, hears == Hears::Own),
            })
            .collect();
        let steps = if hears == Hears::Known { self.plan.width() } else { 1 };
        let mut inputs =
            (want_inputs || hears != Hears::Known).then(|| vec![T::default(); whole * steps * feature]);
        let mut initial: Vec<State<T>> =
            decoder.layers.iter().map(|layer| State::zeros(whole, layer.hidden())).collect();
        let mut table = (hears == Hears::Words).then(|| vec![T::default(); outputs * feature]);
        for (part, back) in self.parts.iter().zip(&backs) {
            part.write_states(back, &mut initial);
            match (&mut inputs, hears) {
                (Some(inputs), Hears::Known) => part.write_inputs(back, inputs),
                (Some(first), Hears::Own | Hears::Words) => part.write_first(back, first),
                (None, _) => {}
            }
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
        UnrolledGradients { inputs, initial, layers, projection, bias, table }
    }
}

/// See [`crate::sequence`]: compiled here, optimised.
macro_rules! entry_points {
    ($number:ty) => {
        impl Unrolled<$number> {
            /// Runs a decoder for as many steps as each sequence has frames.
            ///
            /// `initial` holds hidden states and cells `[batch, hidden]`, from the bottom up. What stands in the padding of
            /// known inputs has no effect.
            ///
            /// # Panics
            ///
            /// If a slice is not as long as the plan and the weights say.
            #[must_use]
            pub fn forward(
                plan: Plan,
                hearing: Hearing<'_, $number>,
                initial: &[(&[$number], &[$number])],
                decoder: &Decoder<'_, $number>,
            ) -> Self {
                in_pool(|| Self::run(plan, hearing, initial, decoder))
            }

            /// Outputs `[frame, output]`, those of one sequence after those of the other.
            #[must_use]
            pub fn output(&self) -> Vec<$number> {
                self.output_values()
            }

            /// Gradients, given those of the output; of known inputs only if `want_inputs`.
            ///
            /// # Panics
            ///
            /// If a slice or the weights have other shapes than on the way forward.
            #[must_use]
            pub fn backward(
                self,
                decoder: &Decoder<'_, $number>,
                output: &[$number],
                want_inputs: bool,
            ) -> UnrolledGradients<$number> {
                in_pool(|| self.run_back(decoder, output, want_inputs))
            }
        }
    };
}

entry_points!(f32);
entry_points!(f64);
