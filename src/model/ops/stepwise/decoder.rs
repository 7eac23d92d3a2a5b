//! Stacked layers and what they say.

use burn::backend::Backend;
use burn::backend::tensor::{FloatTensor, IntTensor};
use rprae_recurrent::Plan;

use super::super::backend::{DecoderTask, Hears};
use super::Pointwise;
use super::closed_loop::{closed_loop_backward, closed_loop_forward};
use super::layer::Layer;
use super::open_loop::{open_loop_backward, open_loop_forward};
use super::tensors::{join, outer, sum_rows};

/// Layers' way through a decoder.
#[derive(Debug, Clone)]
pub struct DecoderWay<B: Backend> {
    pub(super) plan: Plan,
    pub(super) layers: Vec<Layer<B>>,
    /// What the bottom layer heard and what the decoder said, step by step, or all frames of an open loop at once.
    pub(super) inputs: Vec<FloatTensor<B>>,
    pub(super) outputs: Vec<FloatTensor<B>>,
    /// Rows of the table heard after each step but the last.
    pub(super) words: Vec<IntTensor<B>>,
}

impl<B: Pointwise> DecoderWay<B> {
    /// Before the first step.
    pub(super) fn new(plan: Plan, inputs: &[FloatTensor<B>]) -> Self {
        let layers = (0..(inputs.len() - 3) / 5).map(|layer| {
            let own = own::<B>(inputs, layer);
            Layer::new(&plan, own[3].clone(), own[4].clone())
        });
        let layers = layers.collect();
        Self { plan, layers, inputs: Vec::new(), outputs: Vec::new(), words: Vec::new() }
    }
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

/// The gradient before a tanh, given that after it and the tanh itself.
pub(super) fn tanh_back<B: Backend>(gradient: FloatTensor<B>, said: FloatTensor<B>) -> FloatTensor<B> {
    let slope = B::float_neg(B::float_mul(said.clone(), said));
    B::float_mul(gradient, B::float_add_scalar(slope, 1.0_f32.into()))
}

/// Gradients of the projection and of all layers in the order of a decoder's inputs, given what the bottom layer heard, the
/// gradients of the projection, and for each layer its way and those of its initial states and of its gates.
pub(super) fn weight_gradients<B: Pointwise>(
    mut heard: FloatTensor<B>,
    d_projected: FloatTensor<B>,
    layers: impl Iterator<Item = (Layer<B>, [FloatTensor<B>; 3])>,
) -> Vec<FloatTensor<B>> {
    let mut all = Vec::new();
    for (layer, [d_hidden, d_cell, gates]) in layers {
        all.extend([
            outer::<B>(heard, gates.clone()),
            outer::<B>(join::<B>(layer.heard, 0), gates.clone()),
            sum_rows::<B>(gates),
            d_hidden,
            d_cell,
        ]);
        // The next layer heard the hidden states of this one at the same step.
        heard = join::<B>(layer.said, 0);
    }
    let mut gradients = vec![outer::<B>(heard, d_projected.clone()), sum_rows::<B>(d_projected)];
    gradients.extend(all);
    gradients
}
