//! A decoder that hears itself, step by step.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::Shape;
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::super::Activation;
use super::Pointwise;
use super::decoder::{DecoderWay, num_layers, own, weight_gradients};
use super::layer::{Back, Layer, before, place};
use super::tensors::{back, gather_packed, join, rows, scatter_packed, select, zeros};

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
    let layers = (0..num_layers::<B>(&inputs)).map(|layer| {
        let own = own::<B>(&inputs, layer);
        Layer::new(&plan, own[3].clone(), own[4].clone(), None)
    });
    let mut layers: Vec<Layer<B>> = layers.collect();
    if time == 0 {
        let way = DecoderWay { plan, layers, inputs: None, outputs: None, words: Vec::new() };
        return (zeros::<B>([0, num_outputs], &bias), way);
    }
    let activation = if words { Activation::None } else { Activation::Tanh };
    let outputs = B::room(plan.num_frames(), num_outputs, &bias);
    let first = select::<B>(inputs[0].clone(), plan.order().to_vec());
    let mut input = first.clone();
    let (mut embedded, mut heard_words) = (Vec::new(), Vec::new());
    for step in 0..time {
        let frames = plan.frames(step);
        input = rows::<B>(input, 0, frames.len());
        if words {
            embedded.push(input.clone());
        }
        let mut heard = input;
        for (index, layer) in layers.iter_mut().enumerate() {
            let own = own::<B>(&inputs, index);
            let gates = B::float_matmul(heard, own[0].clone());
            heard = layer.step(&plan, step, Some((gates, own[2].clone())), &own[1]);
        }
        let projected = B::float_matmul(heard, projection.clone());
        input = B::say(projected, bias.clone(), activation, &outputs, frames.start);
        if words && step + 1 < time {
            let count = plan.frames(step + 1).len();
            let word = B::float_argmax(rows::<B>(input, 0, count), 1, burn::tensor::IntDType::I32);
            let word = B::int_reshape(word, Shape::from([count]));
            input = B::float_select(inputs[inputs.len() - 1].clone(), 0, word.clone());
            heard_words.push(word);
        }
    }
    let heard = if words {
        join::<B>(embedded, 0)
    } else {
        select::<B>(join::<B>(vec![first, outputs.clone()], 0), before(&plan))
    };
    let said = scatter_packed::<B>(&plan, outputs.clone());
    let (inputs, outputs) = (Some(heard), Some(outputs));
    (said, DecoderWay { plan, layers, inputs, outputs, words: heard_words })
}

pub(super) fn closed_loop_backward<B: Pointwise>(
    way: DecoderWay<B>,
    inputs: Vec<FloatTensor<B>>,
    gradient: FloatTensor<B>,
    words: bool,
) -> Vec<FloatTensor<B>> {
    let plan = &way.plan;
    let (Some(heard), Some(outputs)) = (way.inputs, way.outputs) else {
        return inputs.into_iter().map(|input| B::float_mul_scalar(input, 0.0_f32.into())).collect();
    };
    let d_outputs = gather_packed::<B>(plan, gradient);
    let d_projected =
        if words { d_outputs.clone() } else { B::room(plan.num_frames(), inputs[2].shape()[0], &d_outputs) };
    let projection_transposed = B::float_transpose(inputs[1].clone());
    let transposed: Vec<[FloatTensor<B>; 2]> = (0..way.layers.len())
        .map(|layer| {
            let own = own::<B>(&inputs, layer);
            [B::float_transpose(own[0].clone()), B::float_transpose(own[1].clone())]
        })
        .collect();
    let mut backs: Vec<Back<B>> = way.layers.iter().map(|layer| Back::new(plan, layer, None)).collect();
    let mut d_embedded = Vec::new();
    // Gradients of the inputs of the step after; before there are any, anything stands for none.
    let mut d_input = d_outputs.clone();
    for step in (0..plan.num_steps()).rev() {
        let place = place(plan, step);
        let d_output = if words {
            rows::<B>(d_outputs.clone(), place.frame, place.frame + place.rows)
        } else {
            let num_heard = if step + 1 < plan.num_steps() { plan.frames(step + 1).len() } else { 0 };
            B::say_back(d_outputs.clone(), outputs.clone(), (d_input, num_heard), &d_projected, place)
        };
        let mut above = B::float_matmul(d_output, projection_transposed.clone());
        for (index, layer) in way.layers.iter().enumerate().rev() {
            let [input_transposed, recurrent_transposed] = &transposed[index];
            let gates = backs[index].step(plan, layer, step, Some((above, 0)), recurrent_transposed);
            above = B::float_matmul(gates, input_transposed.clone());
        }
        d_input = above;
        if words {
            d_embedded.push(d_input.clone());
        }
    }

    let mut all = vec![rows_to_batch::<B>(plan, d_input)];
    let backs: Vec<_> = backs.into_iter().map(|back| back.finish(plan)).collect();
    all.extend(weight_gradients(plan, heard, d_projected, way.layers.into_iter().zip(backs)));
    if words {
        let table = &inputs[inputs.len() - 1];
        let mut d_table = B::float_mul_scalar(table.clone(), 0.0_f32.into());
        for (word, d_input) in way.words.into_iter().zip(d_embedded.into_iter().rev().skip(1)) {
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
