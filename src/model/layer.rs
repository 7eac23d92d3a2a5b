//! Layers with trained weights.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use super::Draws;
use super::ops::LstmWeights;

/// A trained tensor with numbers drawn from `[-bound, bound)`.
pub(super) fn uniform<const D: usize>(
    shape: [usize; D],
    bound: f32,
    draws: &mut Draws,
    device: &Device,
) -> Param<Tensor<D>> {
    let values = draws.uniform(shape.iter().product(), bound);
    Param::from_tensor(Tensor::from_data(TensorData::new(values, shape), device))
}

/// `x W + b`.
#[derive(Module, Debug)]
pub(super) struct Linear {
    /// `[input, output]`.
    weight: Param<Tensor<2>>,
    /// `[output]`.
    bias: Param<Tensor<1>>,
}

impl Linear {
    /// A map of `input` to `output` numbers; weights drawn evenly within one over the root of `input`.
    pub(super) fn new(input: usize, output: usize, draws: &mut Draws, device: &Device) -> Self {
        let bound = 1.0 / (input as f32).sqrt();
        Self {
            weight: uniform([input, output], bound, draws, device),
            bias: uniform([output], bound, draws, device),
        }
    }

    /// `[batch, input]` to `[batch, output]`.
    pub(super) fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        input.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }

    /// The weights, for a recurrence that applies them at every step.
    pub(super) fn weights(&self) -> (Tensor<2>, Tensor<1>) {
        (self.weight.val(), self.bias.val())
    }
}

/// Weights of a long short-term memory, gates in the order input, forget, cell, output.
#[derive(Module, Debug)]
pub(super) struct Lstm {
    /// `[feature, 4 * hidden]`.
    input: Param<Tensor<2>>,
    /// `[hidden, 4 * hidden]`.
    recurrent: Param<Tensor<2>>,
    /// `[4 * hidden]`.
    bias: Param<Tensor<1>>,
}

impl Lstm {
    /// A layer of `hidden` units; weights drawn evenly within one over the root of `hidden`.
    pub(super) fn new(
        feature: usize,
        hidden: usize,
        forget_bias: f32,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        let bound = 1.0 / (hidden as f32).sqrt();
        let mut bias = draws.uniform(4 * hidden, bound);
        bias[hidden..2 * hidden].fill(forget_bias);
        Self {
            input: uniform([feature, 4 * hidden], bound, draws, device),
            recurrent: uniform([hidden, 4 * hidden], bound, draws, device),
            bias: Param::from_tensor(Tensor::from_data(TensorData::new(bias, [4 * hidden]), device)),
        }
    }

    /// The weights, as the recurrences take them.
    pub(super) fn weights(&self) -> LstmWeights {
        LstmWeights { input: self.input.val(), recurrent: self.recurrent.val(), bias: self.bias.val() }
    }
}
