//! A decoder of known inputs, layer after layer.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::super::Activation;
use super::Pointwise;
use super::decoder::{DecoderWay, own, tanh_back, weight_gradients};
use super::layer::Back;
use super::tensors::{add_bias, gather, gather_packed, join, rows, scatter, scatter_packed, zeros};

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
    let mut way = DecoderWay::<B>::new(plan, &inputs);
    if way.plan.num_frames() == 0 {
        return (zeros::<B>([0, num_outputs], &bias), way);
    }
    let mut heard = gather::<B>(&way.plan, inputs[0].clone(), feature);
    way.inputs.push(heard.clone());
    for (index, layer) in way.layers.iter_mut().enumerate() {
        let own = own::<B>(&inputs, index);
        let gates = add_bias::<B>(B::float_matmul(heard, own[0].clone()), own[2].clone());
        let said = (0..way.plan.num_steps()).map(|step| {
            let frames = way.plan.frames(step);
            layer.step(rows::<B>(gates.clone(), frames.start, frames.end), &own[1])
        });
        heard = join::<B>(said.collect(), 0);
    }
    let mut output = add_bias::<B>(B::float_matmul(heard, projection), bias);
    if activation == Activation::Tanh {
        output = B::float_tanh(output);
    }
    way.outputs.push(output.clone());
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
    let (Some(heard), Some(said)) = (way.inputs.first(), way.outputs.first()) else {
        return inputs.into_iter().map(|input| Some(B::float_mul_scalar(input, 0.0_f32.into()))).collect();
    };
    let mut d_output = gather_packed::<B>(plan, gradient);
    if activation == Activation::Tanh {
        d_output = tanh_back::<B>(d_output, said.clone());
    }
    let mut above = B::float_matmul(d_output.clone(), B::float_transpose(inputs[1].clone()));
    let mut gates = Vec::new();
    for (index, layer) in way.layers.iter().enumerate().rev() {
        let own = own::<B>(&inputs, index);
        let recurrent_transposed = B::float_transpose(own[1].clone());
        let mut back = Back::new(plan, layer, None);
        for step in (0..plan.num_steps()).rev() {
            let frames = plan.frames(step);
            let above = rows::<B>(above.clone(), frames.start, frames.end);
            back.step(layer, step, Some(above), &recurrent_transposed);
        }
        let (d_hidden, d_cell, d_gates) = back.finish(plan, heard);
        if index > 0 || want_inputs {
            above = B::float_matmul(d_gates.clone(), B::float_transpose(own[0].clone()));
        }
        gates.push([d_hidden, d_cell, d_gates]);
    }
    let d_inputs =
        want_inputs.then(|| B::float_reshape(scatter::<B>(plan, above), Shape::from([batch, time, feature])));

    let layers = way.layers.into_iter().zip(gates.into_iter().rev());
    let weights = weight_gradients(heard.clone(), d_output, layers);
    std::iter::once(d_inputs).chain(weights.into_iter().map(Some)).collect()
}
