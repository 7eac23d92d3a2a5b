//! One layer over known inputs.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::Shape;
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::super::Direction;
use super::super::backend::{SequenceInputs, SequenceTask};
use super::Pointwise;
use super::layer::{Back, Layer};
use super::tensors::{add_bias, columns, gather, outer, scatter, select, sum_rows, zeros};

/// A layer's way through known inputs.
#[derive(Debug, Clone)]
pub struct SequenceWay<B: Backend> {
    plan: Plan,
    input: FloatTensor<B>,
    layer: Layer<B>,
}

/// See [`crate::model::ops::backend::RecurrentBackend::sequence_forward`].
pub fn sequence_forward<B: Pointwise>(
    inputs: SequenceInputs<B>,
    task: &SequenceTask,
) -> (FloatTensor<B>, SequenceWay<B>) {
    let [input, hidden, cell, input_weights, recurrent_weights, bias] = inputs;
    let [_, time, feature] = input.shape().dims();
    let direction = match task.direction {
        Direction::Forward => Order::Forward,
        Direction::Backward => Order::Backward,
    };
    let plan = Plan::new(&task.lengths, time, direction, Instructions::best());
    let (input, gates) = if plan.num_frames() == 0 {
        (zeros::<B>([0, feature], &input), None)
    } else {
        let input = gather::<B>(&plan, input, feature);
        (input.clone(), Some(add_bias::<B>(B::float_matmul(input, input_weights), bias)))
    };
    let mut layer = Layer::<B>::new(&plan, hidden, cell, gates);
    for step in 0..plan.num_steps() {
        layer.step(&plan, step, None, &recurrent_weights);
    }
    let (last_hidden, last_cell) = layer.last(&plan);
    let mut all = vec![last_hidden, last_cell];
    if task.outputs && time > 0 {
        let units = recurrent_weights.shape()[0];
        let outputs = if plan.num_frames() == 0 {
            zeros::<B>([plan.batch(), time * units], &input)
        } else {
            scatter::<B>(&plan, layer.said(&plan))
        };
        all.insert(0, outputs);
    }
    (B::float_cat(all, 1), SequenceWay { plan, input, layer })
}

/// See [`crate::model::ops::backend::RecurrentBackend::sequence_backward`].
#[expect(clippy::needless_pass_by_value, reason = "tensors are handed on")]
pub fn sequence_backward<B: Pointwise>(
    way: SequenceWay<B>,
    inputs: SequenceInputs<B>,
    gradient: FloatTensor<B>,
    task: &SequenceTask,
    want_input: bool,
) -> [Option<FloatTensor<B>>; 6] {
    let [input, hidden, _, input_weights, recurrent_weights, bias] = inputs;
    let SequenceWay { plan, input: heard, layer } = way;
    let [batch, time, feature] = input.shape().dims();
    let units = hidden.shape()[1];
    let own = if task.outputs { time * units } else { 0 };
    let state = |first: usize| {
        select::<B>(columns::<B>(gradient.clone(), first, first + units), plan.order().to_vec())
    };
    let last = Some((state(own), state(own + units)));
    let mut back = Back::new(&plan, &layer, last);
    let frames = plan.num_frames();
    let above =
        (own > 0 && frames > 0).then(|| gather::<B>(&plan, columns::<B>(gradient.clone(), 0, own), units));
    let recurrent_transposed = B::float_transpose(recurrent_weights.clone());
    for step in (0..plan.num_steps()).rev() {
        let above = above.clone().map(|above| (above, plan.frames(step).start));
        back.step(&plan, &layer, step, above, &recurrent_transposed);
    }
    let [d_hidden, d_cell, gates] = back.finish(&plan);
    if frames == 0 {
        let none = |tensor: &FloatTensor<B>| Some(B::float_mul_scalar(tensor.clone(), 0.0_f32.into()));
        let [d_weights, d_recurrent, d_bias] = [none(&input_weights), none(&recurrent_weights), none(&bias)];
        return [none(&input), Some(d_hidden), Some(d_cell), d_weights, d_recurrent, d_bias];
    }
    let d_input = want_input.then(|| {
        let frames = B::float_matmul(gates.clone(), B::float_transpose(input_weights));
        B::float_reshape(scatter::<B>(&plan, frames), Shape::from([batch, time, feature]))
    });
    [
        d_input,
        Some(d_hidden),
        Some(d_cell),
        Some(outer::<B>(heard, gates.clone())),
        Some(outer::<B>(layer.heard(&plan), gates.clone())),
        Some(sum_rows::<B>(gates)),
    ]
}
