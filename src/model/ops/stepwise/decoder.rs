//! Stacked layers and what they say.

use burn::backend::Backend;
use burn::backend::tensor::{FloatTensor, IntTensor};
use rprae_recurrent::Plan;

use super::super::backend::{DecoderTask, Hears};
use super::Pointwise;
use super::closed_loop::{closed_loop_backward, closed_loop_forward};
use super::layer::Layer;
use super::open_loop::{open_loop_backward, open_loop_forward};
use super::tensors::{outer, sum_rows};

/// Layers' way through a decoder.
#[derive(Debug, Clone)]
pub struct DecoderWay<B: Backend> {
    pub(super) plan: Plan,
    pub(super) layers: Vec<Layer<B>>,
    /// What the bottom layer heard and what the decoder said, all frames; none where there are no frames.
    pub(super) inputs: Option<FloatTensor<B>>,
    pub(super) outputs: Option<FloatTensor<B>>,
    /// Rows of the table heard after each step but the last.
    pub(super) words: Vec<IntTensor<B>>,
}

/// The weights and the initial state of a layer among the inputs of a decoder.
pub(super) fn own<B: Backend>(inputs: &[FloatTensor<B>], layer: usize) -> &[FloatTensor<B>] {
    &inputs[3 + 5 * layer..][..5]
}

/// See [`crate::model::ops::backend::RecurrentBackend::decoder_forward`].
pub fn decoder_forward<B: Pointwise>(
    inputs: Vec<FloatTensor<B>>,
    task: &DecoderTask,
) -> (FloatTensor<B>, DecoderWay<B>) {
    match task.hears {
        Hears::Known(activation) => open_loop_forward(inputs, &task.lengths, activation),
        Hears::Own => closed_loop_forward(inputs, &task.lengths, false),
        Hears::Words => closed_loop_forward(inputs, &task.lengths, true),
    }
}

/// See [`crate::model::ops::backend::RecurrentBackend::decoder_backward`].
pub fn decoder_backward<B: Pointwise>(
    way: DecoderWay<B>,
    inputs: Vec<FloatTensor<B>>,
    gradient: FloatTensor<B>,
    task: &DecoderTask,
    want_inputs: bool,
) -> Vec<Option<FloatTensor<B>>> {
    let all = match task.hears {
        Hears::Known(activation) => {
            return open_loop_backward(way, inputs, gradient, activation, want_inputs);
        }
        Hears::Own => closed_loop_backward(way, inputs, gradient, false),
        Hears::Words => closed_loop_backward(way, inputs, gradient, true),
    };
    all.into_iter().map(Some).collect()
}

/// Gradients of the projection and of all layers in the order of a decoder's inputs, given what the bottom layer heard, the
/// gradients of the projection, and for each layer its way and those of its initial states and of its gates.
pub(super) fn weight_gradients<B: Pointwise>(
    plan: &Plan,
    mut heard: FloatTensor<B>,
    d_projected: FloatTensor<B>,
    layers: impl Iterator<Item = (Layer<B>, [FloatTensor<B>; 3])>,
) -> Vec<FloatTensor<B>> {
    let mut all = Vec::new();
    for (layer, [d_hidden, d_cell, gates]) in layers {
        all.extend([
            outer::<B>(heard, gates.clone()),
            outer::<B>(layer.heard(plan), gates.clone()),
            sum_rows::<B>(gates),
            d_hidden,
            d_cell,
        ]);
        // The next layer heard the hidden states of this one at the same step.
        heard = layer.said(plan);
    }
    let mut gradients = vec![outer::<B>(heard, d_projected.clone()), sum_rows::<B>(d_projected)];
    gradients.extend(all);
    gradients
}

/// The number of layers among the inputs of a decoder.
pub(super) fn num_layers<B: Backend>(inputs: &[FloatTensor<B>]) -> usize {
    (inputs.len() - 3) / 5
}
