//! The way of a part of a batch through a decoder, and back: what all ways have in common.

use super::{Activation, Decoder};
use crate::kernel::{Run, Tanh};
use crate::lanes::Number;
use crate::layer::{Backward, Forward, History, State, StateGradient};
use crate::panels::Panels;
use crate::plan::Plan;
use crate::weight_gradients::{Factors, Gone};
use crate::weights::{Packed, pack_columns, pack_columns_transposed};

/// A decoder's weights packed for steps forward.
pub(super) struct Packs<T: Number> {
    pub(super) layers: Vec<Forward<T>>,
    pub(super) projection: Packed<T>,
    pub(super) bias: Packed<T>,
}

impl<T: Number> Packs<T> {
    pub(super) fn new(decoder: &Decoder<'_, T>, lanes: usize) -> Self {
        let outputs = decoder.outputs();
        Self {
            layers: decoder.layers.iter().map(|layer| Forward::new(layer, lanes)).collect(),
            projection: pack_columns(decoder.projection.weights, outputs, lanes),
            bias: pack_columns(decoder.projection.bias, outputs, lanes),
        }
    }
}

/// A decoder's weights packed for steps back.
pub(super) struct Transposed<T: Number> {
    pub(super) layers: Vec<Backward<T>>,
    pub(super) projection: Packed<T>,
}

impl<T: Number> Transposed<T> {
    pub(super) fn new(decoder: &Decoder<'_, T>, lanes: usize) -> Self {
        Self {
            layers: decoder.layers.iter().map(|layer| Backward::new(layer, lanes)).collect(),
            projection: pack_columns_transposed(decoder.projection.weights, decoder.outputs(), lanes),
        }
    }
}

/// What a part of the batch remembers of its way.
#[derive(Debug, Clone)]
pub(super) struct Part<T: Number> {
    pub(super) plan: Plan,
    pub(super) layers: Vec<History<T>>,
    /// What the bottom layer heard, `[frame, feature]`.
    pub(super) inputs: Panels<T>,
    /// `[frame, output]`.
    pub(super) outputs: Panels<T>,
    /// The row of the table that was heard, for each frame after the first step.
    pub(super) words: Vec<usize>,
}

/// What the way back left beside the gates' gradients.
pub(super) struct Back<T: Number> {
    /// Of the initial states, from the bottom up.
    pub(super) states: Vec<StateGradient<T>>,
    /// Of the outputs before their activation, `[frame, output]`.
    pub(super) outputs: Panels<T>,
    /// Of the inputs, `[frame, feature]`; none where nobody asked.
    pub(super) inputs: Option<Panels<T>>,
}

impl<T: Number> Part<T> {
    /// Outputs of these frames, given their projection.
    pub(super) fn activate(&mut self, activation: Activation, frames: std::ops::Range<usize>) {
        if activation == Activation::Tanh {
            let width = self.outputs.width;
            for panel in self.outputs.panels.iter_mut() {
                T::run(self.plan.instructions, Tanh(&mut panel[frames.start * width..frames.end * width]));
            }
        }
    }

    /// The gradient of outputs becomes that before their activation.
    pub(super) fn activate_back(
        &self,
        activation: Activation,
        frames: std::ops::Range<usize>,
        gradient: &mut Panels<T>,
    ) {
        if activation == Activation::Tanh {
            let range = frames.start * gradient.width..frames.end * gradient.width;
            for (gradient, outputs) in gradient.panels.iter_mut().zip(self.outputs.panels.iter()) {
                for (gradient, &output) in gradient[range.clone()].iter_mut().zip(&outputs[range.clone()]) {
                    *gradient = *gradient * (T::ONE - output * output);
                }
            }
        }
    }

    /// Writes outputs, `[frame, output]`.
    pub(super) fn write_outputs(&self, values: &mut [T]) {
        self.plan.scatter_packed(&self.outputs, 0, values);
    }

    /// Writes gradients of the initial states.
    pub(super) fn write_states(&self, back: &Back<T>, initial: &mut [State<T>]) {
        for (gradient, state) in back.states.iter().zip(initial) {
            gradient.write(&self.plan, state);
        }
    }

    /// Writes gradients of known inputs, `[batch, time, feature]`.
    pub(super) fn write_inputs(&self, back: &Back<T>, values: &mut [T]) {
        if let Some(inputs) = &back.inputs {
            self.plan.scatter(inputs, 0, values);
        }
    }

    pub(super) fn gone(&self, layer: usize) -> Gone<'_, T> {
        let (plan, history) = (&self.plan, &self.layers[layer]);
        match layer.checked_sub(1) {
            Some(below) => Gone { plan, history, input: &self.layers[below].hidden, first_row: plan.batch() },
            None => Gone { plan, history, input: &self.inputs, first_row: 0 },
        }
    }

    pub(super) fn projection_factors<'a>(&'a self, back: &'a Back<T>) -> Factors<'a, T> {
        let run = Run { left: self.plan.batch(), right: 0, rows: self.plan.num_frames() };
        let top = &self.layers[self.layers.len() - 1].hidden;
        Factors { left: top, right: &back.outputs, runs: vec![run] }
    }
}
