//! A decoder of known inputs, layer after layer.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::super::Activation;
use super::Pointwise;
use super::decoder::{DecoderWay, own, tanh_back};
use super::layer::{Back, Layer};
use super::tensors::{
    add_bias, gather, gather_packed, join, outer, rows, scatter, scatter_packed, sum_rows, zeros,
};

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
    let count = (inputs.len() - 3) / 5;
    let layers = (0..count)
        .map(|layer| {
            let own = own::<B>(&inputs, layer);
            Layer::new(&plan, own[3].clone(), own[4].clone())
        })
        .collect();
    let mut way =
        DecoderWay::<B> { plan, layers, inputs: Vec::new(), outputs: Vec::new(), words: Vec::new() };
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
        let units = layer.cell.shape()[1];
        let mut back = Back::<B> { last: None, running: None, batch, units, gates: Vec::new() };
        for step in (0..plan.num_steps()).rev() {
            let frames = plan.frames(step);
            let above = rows::<B>(above.clone(), frames.start, frames.end);
            back.step(layer, step, Some(above), &recurrent_transposed);
        }
        let (d_hidden, d_cell, d_gates) = back.finish(plan, heard);
        if index > 0 || want_inputs {
            above = B::float_matmul(d_gates.clone(), B::float_transpose(own[0].clone()));
        }
        gates.push((d_hidden, d_cell, d_gates));
    }
    let d_inputs =
        want_inputs.then(|| B::float_reshape(scatter::<B>(plan, above), Shape::from([batch, time, feature])));

    let mut heard = heard.clone();
    let mut layers = Vec::new();
    for (layer, (d_hidden, d_cell, gates)) in way.layers.into_iter().zip(gates.into_iter().rev()) {
        layers.extend([
            outer::<B>(heard, gates.clone()),
            outer::<B>(join::<B>(layer.heard, 0), gates.clone()),
            sum_rows::<B>(gates),
            d_hidden,
            d_cell,
        ]);
        heard = join::<B>(layer.said, 0);
    }
    let projection = [outer::<B>(heard, d_output.clone()), sum_rows::<B>(d_output)];
    std::iter::once(d_inputs).chain(projection.into_iter().chain(layers).map(Some)).collect()
}
