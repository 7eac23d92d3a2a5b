//! A decoder that hears itself, step by step.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::Shape;
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::Pointwise;
use super::decoder::{DecoderWay, own, tanh_back, weight_gradients};
use super::layer::Back;
use super::tensors::{add_bias, back, gather_packed, join, rows, scatter_packed, select, zeros};

#[expect(clippy::needless_pass_by_value, reason = "tensors are handed on")]
pub(super) fn closed_loop_forward<B: Pointwise>(
    inputs: Vec<FloatTensor<B>>,
    lengths: &[usize],
    words: bool,
) -> (FloatTensor<B>, DecoderWay<B>) {
    let time = lengths.iter().copied().max().unwrap_or(0);
    let plan = Plan::new(lengths, time, Order::Forward, Instructions::best());
    let (projection, bias) = (inputs[1].clone(), inputs[2].clone());
    let num_outputs = bias.shape()[0];
    let mut way = DecoderWay::<B>::new(plan, &inputs);
    let mut input = select::<B>(inputs[0].clone(), way.plan.order().to_vec());
    for step in 0..time {
        let rows_now = way.plan.frames(step).len();
        input = rows::<B>(input, 0, rows_now);
        way.inputs.push(input.clone());
        let mut heard = input;
        for (index, layer) in way.layers.iter_mut().enumerate() {
            let own = own::<B>(&inputs, index);
            let gates = add_bias::<B>(B::float_matmul(heard, own[0].clone()), own[2].clone());
            heard = layer.step(gates, &own[1]);
        }
        let output = add_bias::<B>(B::float_matmul(heard, projection.clone()), bias.clone());
        if words {
            way.outputs.push(output.clone());
            input = output.clone();
            if step + 1 < time {
                let count = way.plan.frames(step + 1).len();
                let word = B::float_argmax(rows::<B>(output, 0, count), 1, burn::tensor::IntDType::I32);
                let word = B::int_reshape(word, Shape::from([count]));
                input = B::float_select(inputs[inputs.len() - 1].clone(), 0, word.clone());
                way.words.push(word);
            }
        } else {
            let output = B::float_tanh(output);
            way.outputs.push(output.clone());
            input = output;
        }
    }
    if way.outputs.is_empty() {
        return (zeros::<B>([0, num_outputs], &bias), way);
    }
    (scatter_packed::<B>(&way.plan, join::<B>(way.outputs.clone(), 0)), way)
}

pub(super) fn closed_loop_backward<B: Pointwise>(
    way: DecoderWay<B>,
    inputs: Vec<FloatTensor<B>>,
    gradient: FloatTensor<B>,
    words: bool,
) -> Vec<FloatTensor<B>> {
    let plan = &way.plan;
    let steps = plan.num_steps();
    if steps == 0 {
        return inputs.into_iter().map(|input| B::float_mul_scalar(input, 0.0_f32.into())).collect();
    }
    let num_outputs = inputs[2].shape()[0];
    let d_outputs = gather_packed::<B>(plan, gradient);
    let projection_transposed = B::float_transpose(inputs[1].clone());
    let transposed: Vec<[FloatTensor<B>; 2]> = (0..way.layers.len())
        .map(|layer| {
            let own = own::<B>(&inputs, layer);
            [B::float_transpose(own[0].clone()), B::float_transpose(own[1].clone())]
        })
        .collect();
    let mut backs: Vec<Back<B>> = way.layers.iter().map(|layer| Back::new(plan, layer, None)).collect();
    let mut d_projected = Vec::new();
    let mut d_inputs: Vec<FloatTensor<B>> = Vec::new();
    for step in (0..steps).rev() {
        let frames = plan.frames(step);
        let mut d_output = rows::<B>(d_outputs.clone(), frames.start, frames.end);
        if !words {
            if let Some(d_input) = d_inputs.last() {
                let (have, missing) = (d_input.shape()[0], frames.len() - d_input.shape()[0]);
                let mut heard = vec![d_input.clone()];
                if missing > 0 && have > 0 {
                    heard.push(zeros::<B>([missing, num_outputs], &d_output));
                }
                d_output = B::float_add(d_output, join::<B>(heard, 0));
            }
            d_output = tanh_back::<B>(d_output, way.outputs[step].clone());
        }
        d_projected.push(d_output.clone());
        let mut above = B::float_matmul(d_output, projection_transposed.clone());
        for (index, layer) in way.layers.iter().enumerate().rev() {
            let [input_transposed, recurrent_transposed] = &transposed[index];
            let gates = backs[index].step(layer, step, Some(above), recurrent_transposed);
            above = B::float_matmul(gates, input_transposed.clone());
        }
        d_inputs.push(above);
    }
    d_projected.reverse();
    d_inputs.reverse();
    let d_projected = join::<B>(d_projected, 0);

    let heard = join::<B>(way.inputs, 0);
    let mut all = vec![rows_to_batch::<B>(plan, d_inputs[0].clone())];
    let backs: Vec<_> = backs.into_iter().map(|back| back.finish(plan, &heard).into()).collect();
    all.extend(weight_gradients(heard, d_projected, way.layers.into_iter().zip(backs)));
    if words {
        let table = &inputs[inputs.len() - 1];
        let mut d_table = B::float_mul_scalar(table.clone(), 0.0_f32.into());
        for (word, d_input) in way.words.into_iter().zip(d_inputs.into_iter().skip(1)) {
            d_table = B::float_select_assign(d_table, 0, word, d_input, burn::tensor::IndexingUpdateOp::Add);
        }
        all.push(d_table);
    }
    all
}

/// Rows of the first step in the caller's order, zeros for empty sequences.
#[expect(clippy::needless_pass_by_value, reason = "tensors are handed on")]
fn rows_to_batch<B: Backend>(plan: &Plan, first: FloatTensor<B>) -> FloatTensor<B> {
    let (have, columns) = (first.shape()[0], first.shape()[1]);
    let mut all = vec![first.clone()];
    if have < plan.batch() {
        all.push(zeros::<B>([plan.batch() - have, columns], &first));
    }
    select::<B>(join::<B>(all, 0), back(plan))
}
