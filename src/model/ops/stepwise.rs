//! Recurrences step by step with the operations of any backend, for devices without kernels of their own for whole sequences.
//!
//! What differs from a tape that records every step: no work on padding, one product for all inputs known beforehand, one product
//! for each gradient of weights, and the numbers of a cell in one launch where the backend has a kernel for them.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Slice, TensorData};
use rprae_recurrent::{Direction as Order, Instructions, Plan};

use super::backend::{DecoderTask, Hears, SequenceInputs, SequenceTask};
use super::{Activation, Direction};

/// The numbers of a cell at one step, `[row, ...]`.
#[expect(clippy::struct_field_names, reason = "the cell of a cell is its cell")]
pub struct Cell<B: Backend> {
    /// Activated gates `[row, 4 * hidden]`.
    pub gates: FloatTensor<B>,
    /// `[row, hidden]`.
    pub cell: FloatTensor<B>,
    /// `[row, hidden]`.
    pub hidden: FloatTensor<B>,
}

/// What happens to each number alone in a step and on the way back through it.
pub trait Pointwise: Backend {
    /// `input` and `recurrent` `[row, 4 * hidden]` are the two shares of the gates before their activations.
    fn cell(input: FloatTensor<Self>, recurrent: FloatTensor<Self>, before: FloatTensor<Self>) -> Cell<Self>;

    /// Gradients of the gates before their activations and of the cells before the step, given those of the hidden states and
    /// of the cells after it.
    fn cell_back(
        gates: FloatTensor<Self>,
        before: FloatTensor<Self>,
        after: FloatTensor<Self>,
        d_hidden: FloatTensor<Self>,
        d_cell: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}

fn rows<B: Backend>(tensor: FloatTensor<B>, from: usize, to: usize) -> FloatTensor<B> {
    if from == 0 && tensor.shape()[0] == to {
        return tensor;
    }
    B::float_slice(tensor, &[Slice::new(from as isize, Some(to as isize), 1), Slice::full()])
}

fn columns<B: Backend>(tensor: FloatTensor<B>, from: usize, to: usize) -> FloatTensor<B> {
    B::float_slice(tensor, &[Slice::full(), Slice::new(from as isize, Some(to as isize), 1)])
}

fn join<B: Backend>(mut tensors: Vec<FloatTensor<B>>, dim: usize) -> FloatTensor<B> {
    if tensors.len() == 1 { tensors.swap_remove(0) } else { B::float_cat(tensors, dim) }
}

fn indices<B: Backend>(indices: Vec<usize>, like: &FloatTensor<B>) -> IntTensor<B> {
    let indices: Vec<i32> = indices.into_iter().map(|index| index as i32).collect();
    let count = indices.len();
    B::int_from_data(TensorData::new(indices, [count]), &like.device())
}

fn select<B: Backend>(tensor: FloatTensor<B>, rows: Vec<usize>) -> FloatTensor<B> {
    let rows = indices::<B>(rows, &tensor);
    B::float_select(tensor, 0, rows)
}

fn zeros<B: Backend>(shape: [usize; 2], like: &FloatTensor<B>) -> FloatTensor<B> {
    B::float_from_data(TensorData::zeros::<f32, _>(shape), &like.device())
}

fn add_bias<B: Backend>(product: FloatTensor<B>, bias: FloatTensor<B>) -> FloatTensor<B> {
    let columns = bias.shape()[0];
    B::float_add(product, B::float_reshape(bias, Shape::from([1, columns])))
}

/// The transpose of `left` times `right`.
fn outer<B: Backend>(left: FloatTensor<B>, right: FloatTensor<B>) -> FloatTensor<B> {
    B::float_matmul(B::float_transpose(left), right)
}

fn sum_rows<B: Backend>(tensor: FloatTensor<B>) -> FloatTensor<B> {
    let columns = tensor.shape()[1];
    B::float_reshape(B::float_sum_dim(tensor, 0), Shape::from([columns]))
}

/// `[batch, time, column]` as one row for each frame.
fn gather<B: Backend>(plan: &Plan, values: FloatTensor<B>, columns: usize) -> FloatTensor<B> {
    let flat = B::float_reshape(values, Shape::from([plan.batch() * plan.width(), columns]));
    select::<B>(flat, plan.places().collect())
}

/// One row for each frame as `[batch, time * column]`, zeros in the padding.
fn scatter<B: Backend>(plan: &Plan, frames: FloatTensor<B>) -> FloatTensor<B> {
    let columns = frames.shape()[1];
    let mut from = vec![0; plan.batch() * plan.width()];
    for (frame, place) in plan.places().enumerate() {
        from[place] = frame + 1;
    }
    let padded = B::float_cat(vec![zeros::<B>([1, columns], &frames), frames], 0);
    B::float_reshape(select::<B>(padded, from), Shape::from([plan.batch(), plan.width() * columns]))
}

/// `[frame, column]` of sequences one after the other as one row for each frame.
fn gather_packed<B: Backend>(plan: &Plan, values: FloatTensor<B>) -> FloatTensor<B> {
    select::<B>(values, plan.packed_places().collect())
}

/// The reverse of [`gather_packed`].
fn scatter_packed<B: Backend>(plan: &Plan, frames: FloatTensor<B>) -> FloatTensor<B> {
    let mut from = vec![0; plan.num_frames()];
    for (frame, place) in plan.packed_places().enumerate() {
        from[place] = frame;
    }
    select::<B>(frames, from)
}

/// For each place in the caller's batch, its row.
fn back(plan: &Plan) -> Vec<usize> {
    let mut rows = vec![0; plan.batch()];
    for (row, &index) in plan.order().iter().enumerate() {
        rows[index] = row;
    }
    rows
}

/// One layer's way through a batch.
#[derive(Debug, Clone)]
struct Layer<B: Backend> {
    /// Of each step: activated gates, cells before and after, hidden states before and after.
    gates: Vec<FloatTensor<B>>,
    before: Vec<FloatTensor<B>>,
    after: Vec<FloatTensor<B>>,
    heard: Vec<FloatTensor<B>>,
    said: Vec<FloatTensor<B>>,
    hidden: FloatTensor<B>,
    cell: FloatTensor<B>,
    /// States of sequences that have ended, the longest ones last.
    ended: Vec<(FloatTensor<B>, FloatTensor<B>)>,
}

impl<B: Pointwise> Layer<B> {
    fn new(plan: &Plan, hidden: FloatTensor<B>, cell: FloatTensor<B>) -> Self {
        Self {
            gates: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
            heard: Vec::new(),
            said: Vec::new(),
            hidden: select::<B>(hidden, plan.order().to_vec()),
            cell: select::<B>(cell, plan.order().to_vec()),
            ended: Vec::new(),
        }
    }

    /// Keeps the first `count` rows and puts the others aside.
    fn shrink(&mut self, count: usize) {
        let size = self.hidden.shape()[0];
        if count < size {
            let rest = |tensor: &FloatTensor<B>| rows::<B>(tensor.clone(), count, size);
            self.ended.push((rest(&self.hidden), rest(&self.cell)));
            self.hidden = rows::<B>(self.hidden.clone(), 0, count);
            self.cell = rows::<B>(self.cell.clone(), 0, count);
        }
    }

    fn step(&mut self, input: FloatTensor<B>, recurrent_weights: &FloatTensor<B>) -> FloatTensor<B> {
        self.shrink(input.shape()[0]);
        let recurrent = B::float_matmul(self.hidden.clone(), recurrent_weights.clone());
        let cell = B::cell(input, recurrent, self.cell.clone());
        self.heard.push(std::mem::replace(&mut self.hidden, cell.hidden));
        self.before.push(std::mem::replace(&mut self.cell, cell.cell));
        self.after.push(self.cell.clone());
        self.gates.push(cell.gates);
        self.said.push(self.hidden.clone());
        self.hidden.clone()
    }

    /// States after the last frame of each sequence, in the caller's order.
    fn last(&self, plan: &Plan) -> (FloatTensor<B>, FloatTensor<B>) {
        let running = (self.hidden.shape()[0] > 0).then(|| (self.hidden.clone(), self.cell.clone()));
        let (hidden, cell) = running.into_iter().chain(self.ended.iter().rev().cloned()).unzip();
        (select::<B>(join::<B>(hidden, 0), back(plan)), select::<B>(join::<B>(cell, 0), back(plan)))
    }
}

/// The gradient of a layer's states on the way back.
struct Back<B: Backend> {
    /// Of the states after the last frame, sorted.
    last: Option<(FloatTensor<B>, FloatTensor<B>)>,
    /// Of the states of the rows at work, none before the first step back.
    running: Option<(FloatTensor<B>, FloatTensor<B>)>,
    batch: usize,
    units: usize,
    /// Gradients of the gates, from the last step to the first.
    gates: Vec<FloatTensor<B>>,
}

impl<B: Pointwise> Back<B> {
    /// States of the first `count` rows; those that end here join with the gradient of their last state.
    fn grow(&mut self, count: usize, like: &FloatTensor<B>) -> (FloatTensor<B>, FloatTensor<B>) {
        let have = self.running.as_ref().map_or(0, |(hidden, _)| hidden.shape()[0]);
        let (mut hidden, mut cell): (Vec<_>, Vec<_>) = self.running.take().into_iter().unzip();
        if count > have || (count == 0 && have == 0) {
            #[expect(clippy::single_match_else, reason = "two ways of the same length")]
            let (new_hidden, new_cell) = match &self.last {
                Some((hidden, cell)) => {
                    (rows::<B>(hidden.clone(), have, count), rows::<B>(cell.clone(), have, count))
                }
                None => {
                    let new = zeros::<B>([count - have, self.units], like);
                    (new.clone(), new)
                }
            };
            hidden.push(new_hidden);
            cell.push(new_cell);
        }
        (join::<B>(hidden, 0), join::<B>(cell, 0))
    }

    /// Through one step; yields the gradient of the gates.
    fn step(
        &mut self,
        layer: &Layer<B>,
        step: usize,
        above: Option<FloatTensor<B>>,
        recurrent_transposed: &FloatTensor<B>,
    ) -> FloatTensor<B> {
        let gates = layer.gates[step].clone();
        let (mut d_hidden, d_cell) = self.grow(gates.shape()[0], &gates);
        if let Some(above) = above {
            d_hidden = B::float_add(d_hidden, above);
        }
        let (before, after) = (layer.before[step].clone(), layer.after[step].clone());
        let (d_gates, d_cell) = B::cell_back(gates, before, after, d_hidden, d_cell);
        let d_hidden = B::float_matmul(d_gates.clone(), recurrent_transposed.clone());
        self.running = Some((d_hidden, d_cell));
        self.gates.push(d_gates.clone());
        d_gates
    }

    /// Gradients of the initial states in the caller's order, and of all gates, frame by frame.
    fn finish(
        mut self,
        plan: &Plan,
        like: &FloatTensor<B>,
    ) -> (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>) {
        let (hidden, cell) = self.grow(self.batch, like);
        self.gates.reverse();
        let gates = if self.gates.is_empty() {
            zeros::<B>([0, 4 * self.units], like)
        } else {
            join::<B>(self.gates, 0)
        };
        (select::<B>(hidden, back(plan)), select::<B>(cell, back(plan)), gates)
    }
}

/// A layer's way through known inputs.
#[derive(Debug, Clone)]
pub struct SequenceWay<B: Backend> {
    plan: Plan,
    input: FloatTensor<B>,
    layer: Layer<B>,
}

/// See [`super::backend::RecurrentBackend::sequence_forward`].
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
    let mut layer = Layer::<B>::new(&plan, hidden, cell);
    let input = if plan.num_frames() == 0 {
        zeros::<B>([0, feature], &input)
    } else {
        gather::<B>(&plan, input, feature)
    };
    let mut outputs = Vec::new();
    if plan.num_frames() > 0 {
        let gates = add_bias::<B>(B::float_matmul(input.clone(), input_weights), bias);
        for step in 0..plan.num_steps() {
            let frames = plan.frames(step);
            outputs.push(layer.step(rows::<B>(gates.clone(), frames.start, frames.end), &recurrent_weights));
        }
    }
    let (last_hidden, last_cell) = layer.last(&plan);
    let mut all = vec![last_hidden, last_cell];
    if task.outputs && time > 0 {
        let units = layer.hidden.shape()[1];
        let outputs = if outputs.is_empty() {
            zeros::<B>([plan.batch(), time * units], &input)
        } else {
            scatter::<B>(&plan, join::<B>(outputs, 0))
        };
        all.insert(0, outputs);
    }
    (B::float_cat(all, 1), SequenceWay { plan, input, layer })
}

/// See [`super::backend::RecurrentBackend::sequence_backward`].
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
    let mut back = Back::<B> { last, running: None, batch, units, gates: Vec::new() };
    let frames = plan.num_frames();
    let above =
        (own > 0 && frames > 0).then(|| gather::<B>(&plan, columns::<B>(gradient.clone(), 0, own), units));
    let recurrent_transposed = B::float_transpose(recurrent_weights.clone());
    for step in (0..plan.num_steps()).rev() {
        let frames = plan.frames(step);
        let above = above.clone().map(|above| rows::<B>(above, frames.start, frames.end));
        back.step(&layer, step, above, &recurrent_transposed);
    }
    let (d_hidden, d_cell, gates) = back.finish(&plan, &hidden);
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
        Some(outer::<B>(join::<B>(layer.heard, 0), gates.clone())),
        Some(sum_rows::<B>(gates)),
    ]
}

/// Layers' way through a decoder.
#[derive(Debug, Clone)]
pub struct DecoderWay<B: Backend> {
    plan: Plan,
    layers: Vec<Layer<B>>,
    /// What the bottom layer heard and what the decoder said, step by step, or all frames of an open loop at once.
    inputs: Vec<FloatTensor<B>>,
    outputs: Vec<FloatTensor<B>>,
    /// Rows of the table heard after each step but the last.
    words: Vec<IntTensor<B>>,
}

/// The six inputs of a layer among those of a closed loop begin here.
fn own<B: Backend>(inputs: &[FloatTensor<B>], layer: usize) -> &[FloatTensor<B>] {
    &inputs[3 + 5 * layer..][..5]
}

/// See [`super::backend::RecurrentBackend::decoder_forward`].
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

/// See [`super::backend::RecurrentBackend::decoder_backward`].
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

#[expect(clippy::needless_pass_by_value, reason = "tensors are handed on")]
fn open_loop_forward<B: Pointwise>(
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

fn open_loop_backward<B: Pointwise>(
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

/// The gradient before a tanh, given that after it and the tanh itself.
fn tanh_back<B: Backend>(gradient: FloatTensor<B>, said: FloatTensor<B>) -> FloatTensor<B> {
    let slope = B::float_neg(B::float_mul(said.clone(), said));
    B::float_mul(gradient, B::float_add_scalar(slope, 1.0_f32.into()))
}

#[expect(clippy::needless_pass_by_value, reason = "tensors are handed on")]
fn closed_loop_forward<B: Pointwise>(
    inputs: Vec<FloatTensor<B>>,
    lengths: &[usize],
    words: bool,
) -> (FloatTensor<B>, DecoderWay<B>) {
    let time = lengths.iter().copied().max().unwrap_or(0);
    let plan = Plan::new(lengths, time, Order::Forward, Instructions::best());
    let (projection, bias) = (inputs[1].clone(), inputs[2].clone());
    let num_outputs = bias.shape()[0];
    let count = (inputs.len() - 3) / 5;
    let layers = (0..count)
        .map(|layer| {
            let own = own::<B>(&inputs, layer);
            Layer::new(&plan, own[3].clone(), own[4].clone())
        })
        .collect();
    let mut way =
        DecoderWay::<B> { plan, layers, inputs: Vec::new(), outputs: Vec::new(), words: Vec::new() };
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

fn closed_loop_backward<B: Pointwise>(
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
    let (batch, num_outputs) = (plan.batch(), inputs[2].shape()[0]);
    let d_outputs = gather_packed::<B>(plan, gradient);
    let projection_transposed = B::float_transpose(inputs[1].clone());
    let transposed: Vec<[FloatTensor<B>; 2]> = (0..way.layers.len())
        .map(|layer| {
            let own = own::<B>(&inputs, layer);
            [B::float_transpose(own[0].clone()), B::float_transpose(own[1].clone())]
        })
        .collect();
    let mut backs: Vec<Back<B>> = way
        .layers
        .iter()
        .map(|layer| Back {
            last: None,
            running: None,
            batch,
            units: layer.cell.shape()[1],
            gates: Vec::new(),
        })
        .collect();
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

    // What each layer heard: the bottom one its inputs, the others the hidden states of the one below at the same step.
    let mut heard = join::<B>(way.inputs, 0);
    let mut layers = Vec::new();
    for (layer, back) in way.layers.into_iter().zip(backs) {
        let (d_hidden, d_cell, gates) = back.finish(plan, &heard);
        layers.extend([
            outer::<B>(heard, gates.clone()),
            outer::<B>(join::<B>(layer.heard, 0), gates.clone()),
            sum_rows::<B>(gates),
            d_hidden,
            d_cell,
        ]);
        heard = join::<B>(layer.said, 0);
    }
    let first = rows_to_batch::<B>(plan, d_inputs[0].clone());
    let mut all = vec![first, outer::<B>(heard, d_projected.clone()), sum_rows::<B>(d_projected)];
    all.extend(layers);
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
