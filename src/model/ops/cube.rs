//! Recurrences on a GPU: products of the backend, and one launch for the numbers of all cells of a step.

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_dtype;
use burn_cubecl::tensor::CubeTensor;
use burn_cubecl::{CubeBackend, cubecl};
use cubecl::prelude::*;

use super::backend::{
    DecoderTask, Hears, Layer, RecurrentBackend, RecurrentOps, SequenceInputs, SequenceTask, Stack,
    decoder_inputs,
};
use super::stepwise::{self, Cell, DecoderWay, Pointwise, SequenceWay};
use super::{Activation, Direction};

/// Threads that share a launch's cube.
const CUBE: u32 = 256;

#[cube]
fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// One thread for each unit of each row.
#[cube(launch)]
fn cell_kernel(
    input: &Tensor<f32>,
    recurrent: &Tensor<f32>,
    before: &Tensor<f32>,
    gates: &mut Tensor<f32>,
    cell: &mut Tensor<f32>,
    hidden: &mut Tensor<f32>,
) {
    if ABSOLUTE_POS < cell.len() {
        let units = cell.shape(1);
        let at = ABSOLUTE_POS / units * 4 * units + ABSOLUTE_POS % units;
        let i = sigmoid(input[at] + recurrent[at]);
        let f = sigmoid(input[at + units] + recurrent[at + units]);
        let g = (input[at + 2 * units] + recurrent[at + 2 * units]).tanh();
        let o = sigmoid(input[at + 3 * units] + recurrent[at + 3 * units]);
        let c = f * before[ABSOLUTE_POS] + i * g;
        gates[at] = i;
        gates[at + units] = f;
        gates[at + 2 * units] = g;
        gates[at + 3 * units] = o;
        cell[ABSOLUTE_POS] = c;
        hidden[ABSOLUTE_POS] = o * c.tanh();
    }
}

/// The way back through [`cell_kernel`].
#[cube(launch)]
fn cell_back_kernel(
    gates: &Tensor<f32>,
    before: &Tensor<f32>,
    after: &Tensor<f32>,
    d_hidden: &Tensor<f32>,
    d_cell: &Tensor<f32>,
    d_gates: &mut Tensor<f32>,
    d_before: &mut Tensor<f32>,
) {
    if ABSOLUTE_POS < d_before.len() {
        let units = d_before.shape(1);
        let at = ABSOLUTE_POS / units * 4 * units + ABSOLUTE_POS % units;
        let i = gates[at];
        let f = gates[at + units];
        let g = gates[at + 2 * units];
        let o = gates[at + 3 * units];
        let c = after[ABSOLUTE_POS].tanh();
        let d = d_hidden[ABSOLUTE_POS];
        let d_c = d * o * (1.0 - c * c) + d_cell[ABSOLUTE_POS];
        d_gates[at] = d_c * g * i * (1.0 - i);
        d_gates[at + units] = d_c * before[ABSOLUTE_POS] * f * (1.0 - f);
        d_gates[at + 2 * units] = d_c * i * (1.0 - g * g);
        d_gates[at + 3 * units] = d * c * o * (1.0 - o);
        d_before[ABSOLUTE_POS] = d_c * f;
    }
}

fn empty(like: &CubeTensor, rows: usize, columns: usize) -> CubeTensor {
    empty_device_dtype(like.client.clone(), like.device.clone(), Shape::from([rows, columns]), like.dtype)
}

/// As many cubes as `threads` need.
fn cubes(threads: usize) -> (CubeCount, CubeDim) {
    let count = threads.div_ceil(CUBE as usize) as u32;
    // A dimension holds 65,535 cubes on every device.
    let rows = count.div_ceil(65_535);
    (CubeCount::Static(count.div_ceil(rows), rows, 1), CubeDim::new_1d(CUBE))
}

impl Pointwise for CubeBackend {
    fn cell(input: CubeTensor, recurrent: CubeTensor, before: CubeTensor) -> Cell<Self> {
        let [input, recurrent, before] = [input, recurrent, before].map(into_contiguous);
        let (rows, units) = (before.shape()[0], before.shape()[1]);
        let gates = empty(&input, rows, 4 * units);
        let (cell, hidden) = (empty(&input, rows, units), empty(&input, rows, units));
        let (count, dim) = cubes(rows * units);
        cell_kernel::launch(
            &input.client.clone(),
            count,
            dim,
            input.into_tensor_arg(),
            recurrent.into_tensor_arg(),
            before.into_tensor_arg(),
            gates.clone().into_tensor_arg(),
            cell.clone().into_tensor_arg(),
            hidden.clone().into_tensor_arg(),
        );
        Cell { gates, cell, hidden }
    }

    fn cell_back(
        gates: CubeTensor,
        before: CubeTensor,
        after: CubeTensor,
        d_hidden: CubeTensor,
        d_cell: CubeTensor,
    ) -> (CubeTensor, CubeTensor) {
        let [gates, before, after, d_hidden, d_cell] =
            [gates, before, after, d_hidden, d_cell].map(into_contiguous);
        let (rows, units) = (before.shape()[0], before.shape()[1]);
        let (d_gates, d_before) = (empty(&gates, rows, 4 * units), empty(&gates, rows, units));
        let (count, dim) = cubes(rows * units);
        cell_back_kernel::launch(
            &gates.client.clone(),
            count,
            dim,
            gates.into_tensor_arg(),
            before.into_tensor_arg(),
            after.into_tensor_arg(),
            d_hidden.into_tensor_arg(),
            d_cell.into_tensor_arg(),
            d_gates.clone().into_tensor_arg(),
            d_before.clone().into_tensor_arg(),
        );
        (d_gates, d_before)
    }
}

impl RecurrentBackend for CubeBackend {
    type Sequence = SequenceWay<Self>;
    type Decoder = DecoderWay<Self>;

    fn sequence_forward(inputs: SequenceInputs<Self>, task: &SequenceTask) -> (CubeTensor, Self::Sequence) {
        stepwise::sequence_forward(inputs, task)
    }

    fn sequence_backward(
        way: Self::Sequence,
        inputs: SequenceInputs<Self>,
        gradient: CubeTensor,
        task: &SequenceTask,
        want_input: bool,
    ) -> [Option<CubeTensor>; 6] {
        stepwise::sequence_backward(way, inputs, gradient, task, want_input)
    }

    fn decoder_forward(inputs: Vec<CubeTensor>, task: &DecoderTask) -> (CubeTensor, Self::Decoder) {
        stepwise::decoder_forward(inputs, task)
    }

    fn decoder_backward(
        way: Self::Decoder,
        inputs: Vec<CubeTensor>,
        gradient: CubeTensor,
        task: &DecoderTask,
        want_inputs: bool,
    ) -> Vec<Option<CubeTensor>> {
        stepwise::decoder_backward(way, inputs, gradient, task, want_inputs)
    }
}

impl RecurrentOps for CubeBackend {
    fn recurrent_sequence(
        input: CubeTensor,
        hidden: CubeTensor,
        cell: CubeTensor,
        input_weights: CubeTensor,
        recurrent_weights: CubeTensor,
        bias: CubeTensor,
        lengths: Vec<usize>,
        direction: Direction,
        outputs: bool,
    ) -> CubeTensor {
        let inputs = [input, hidden, cell, input_weights, recurrent_weights, bias];
        Self::sequence_forward(inputs, &SequenceTask { lengths, direction, outputs }).0
    }

    fn recurrent_closed_loop(
        first: CubeTensor,
        projection: CubeTensor,
        projection_bias: CubeTensor,
        stack: Stack<Self>,
        lengths: Vec<usize>,
    ) -> CubeTensor {
        let inputs = decoder_inputs([first, projection, projection_bias], stack, None);
        Self::decoder_forward(inputs, &DecoderTask { lengths, hears: Hears::Own }).0
    }

    fn recurrent_open_loop(
        inputs: CubeTensor,
        projection: CubeTensor,
        projection_bias: CubeTensor,
        stack: Stack<Self>,
        lengths: Vec<usize>,
        activation: Activation,
    ) -> CubeTensor {
        let inputs = decoder_inputs([inputs, projection, projection_bias], stack, None);
        Self::decoder_forward(inputs, &DecoderTask { lengths, hears: Hears::Known(activation) }).0
    }

    fn recurrent_words(
        first: CubeTensor,
        projection: CubeTensor,
        projection_bias: CubeTensor,
        table: CubeTensor,
        layer: Layer<Self>,
        lengths: Vec<usize>,
    ) -> CubeTensor {
        let inputs = decoder_inputs([first, projection, projection_bias], Stack::One(layer), Some(table));
        Self::decoder_forward(inputs, &DecoderTask { lengths, hears: Hears::Words }).0
    }
}
