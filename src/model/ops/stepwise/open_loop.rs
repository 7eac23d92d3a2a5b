//! A decoder of known inputs, layer after layer.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::super::Activation;
use super::Pointwise;
use super::decoder::{DecoderWay, num_layers, own, weight_gradients};
use super::layer::{Back, Layer};
use super::tensors::{add_bias, gather, gather_packed, scatter, scatter_packed, tanh_back, zeros};

#[expect(clippy::needless_pass_by_value, reason = "tensors are handed on")]
pub(super) fn open_loop_forward<B: Pointwise>(
    inputs: Vec<FloatTensor<B>>,
    lengths: &[usize],
    activation: Activation,
) -> (FloatTensor<B>, DecoderWay<B>) {
    let [_, time, feature] = inputs[0].shape().dims();
    let (projection, bias) = (inputs[1].clone(), inputs[2].clone());
    let num_outputs = bias.shape()[0];
    let plan = Plan::new(lengths, time, Order::Forward, Instructions::best());
    let mut way =
        DecoderWay::<B> { plan, layers: Vec::new(), inputs: None, outputs: None, words: Vec::new() };
    if way.plan.num_frames() == 0 {
        return (zeros::<B>([0, num_outputs], &bias), way);
    }
    let mut heard = gather::<B>(&way.plan, inputs[0].clone(), feature);
    way.inputs = Some(heard.clone());
    for index in 0..num_layers::<B>(&inputs) {
        let own = own::<B>(&inputs, index);
        let gates = add_bias::<B>(B::float_matmul(heard, own[0].clone()), own[2].clone());
        let mut layer = Layer::new(&way.plan, own[3].clone(), own[4].clone(), Some(gates));
        for step in 0..way.plan.num_steps() {
            layer.step(&way.plan, step, None, &own[1]);
        }
        heard = layer.said(&way.plan);
        way.layers.push(layer);
    }
    let mut output = add_bias::<B>(B::float_matmul(heard, projection), bias);
    if activation == Activation::Tanh {
        output = B::float_tanh(output);
    }
    way.outputs = Some(output.clone());
    (scatter_packed::<B>(&way.plan, output), way)
}

pub(super) fn open_loop_backward<B: Pointwise>(
    way: DecoderWay<B>,
    inputs: Vec<FloatTensor<B>>,
    gradient: FloatTensor<B>,
    activation: Activation,
    want_inputs: bool,
) -> Vec<Option<FloatTensor<B>>> {
    let plan = &way.plan;
    let [batch, time, feature] = inputs[0].shape().dims();
    let (Some(heard), Some(said)) = (way.inputs, way.outputs) else {
        return inputs.into_iter().map(|input| Some(B::float_mul_scalar(input, 0.0_f32.into()))).collect();
    };
    let mut d_output = gather_packed::<B>(plan, gradient);
    if activation == Activation::Tanh {
        d_output = tanh_back::<B>(d_output, said);
    }
    let mut above = B::float_matmul(d_output.clone(), B::float_transpose(inputs[1].clone()));
    let mut gates = Vec::new();
    for (index, layer) in way.layers.iter().enumerate().rev() {
        let own = own::<B>(&inputs, index);
        let recurrent_transposed = B::float_transpose(own[1].clone());
        let mut back = Back::new(plan, layer, None);
        for step in (0..plan.num_steps()).rev() {
            let above = (above.clone(), plan.frames(step).start);
            back.step(plan, layer, step, Some(above), &recurrent_transposed);
        }
        let gradients = back.finish(plan);
        if index > 0 || want_inputs {
            above = B::float_matmul(gradients[2].clone(), B::float_transpose(own[0].clone()));
        }
        gates.push(gradients);
    }
    let d_inputs =
        want_inputs.then(|| B::float_reshape(scatter::<B>(plan, above), Shape::from([batch, time, feature])));

    let layers = way.layers.into_iter().zip(gates.into_iter().rev());
    let weights = weight_gradients(plan, heard, d_output, layers);
    std::iter::once(d_inputs).chain(weights.into_iter().map(Some)).collect()
}
