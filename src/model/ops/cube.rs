//! Recurrences on a GPU: products of the backend, and one launch for the numbers of all cells of a step.

mod kernels;

use burn::backend::TensorMetadata;
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
use burn_cubecl::tensor::CubeTensor;
use burn_cubecl::{CubeBackend, cubecl};
use cubecl::prelude::*;

use self::kernels::{cell_back_kernel, cell_kernel, say_back_kernel, say_kernel};
use super::backend::{
    DecoderTask, Hears, Layer, RecurrentBackend, RecurrentOps, SequenceInputs, SequenceTask, Stack,
    decoder_inputs,
};
use super::stepwise::{self, DecoderWay, History, Later, Place, Pointwise, SequenceWay};
use super::{Activation, Direction};

/// Threads that share a launch's cube.
const CUBE: u32 = 256;

/// Rows one after the other, as the kernels index them.
fn empty(like: &CubeTensor, rows: usize, columns: usize) -> CubeTensor {
    empty_device_contiguous_dtype(
        like.client.clone(),
        like.device.clone(),
        Shape::from([rows, columns]),
        like.dtype,
    )
}

/// As many cubes as `threads` need.
fn cubes(threads: usize) -> (CubeCount, CubeDim) {
    let count = threads.div_ceil(CUBE as usize) as u32;
    // A dimension holds 65,535 cubes on every device.
    let rows = count.div_ceil(65_535);
    (CubeCount::Static(count.div_ceil(rows), rows, 1), CubeDim::new_1d(CUBE))
}

impl Pointwise for CubeBackend {
    fn room(rows: usize, columns: usize, like: &CubeTensor) -> CubeTensor {
        empty(like, rows, columns)
    }

    fn cell(
        heard: Option<(CubeTensor, CubeTensor)>,
        recurrent: CubeTensor,
        history: &History<Self>,
        place: Place,
    ) -> CubeTensor {
        let known = heard.is_none();
        let recurrent = into_contiguous(recurrent);
        let (input, bias) = heard.unwrap_or_else(|| (recurrent.clone(), recurrent.clone()));
        let [input, bias] = [input, bias].map(into_contiguous);
        let units = history.cells.shape()[1];
        let latest = empty(&recurrent, place.rows, units);
        let (count, dim) = cubes(place.rows * units);
        cell_kernel::launch(
            &recurrent.client.clone(),
            count,
            dim,
            input.into_tensor_arg(),
            bias.into_tensor_arg(),
            recurrent.into_tensor_arg(),
            history.gates.clone().into_tensor_arg(),
            history.cells.clone().into_tensor_arg(),
            history.hidden.clone().into_tensor_arg(),
            latest.clone().into_tensor_arg(),
            place.frame,
            place.before,
            place.after,
            known,
        );
        latest
    }

    fn cell_back(
        history: &History<Self>,
        place: Place,
        later: Later<'_, Self>,
        d_gates: &CubeTensor,
    ) -> CubeTensor {
        let units = later.cells.shape()[1];
        let own = empty(d_gates, place.rows, 4 * units);
        let (count, dim) = cubes(place.rows * units);
        let (has_last, has_above) = (later.last.is_some(), later.above.is_some());
        let (above, above_row) = later.above.unwrap_or_else(|| (later.hidden.clone(), 0));
        let last = later.last.unwrap_or(later.hidden).clone();
        let [hidden, last, above] = [later.hidden.clone(), last, above].map(into_contiguous);
        cell_back_kernel::launch(
            &d_gates.client.clone(),
            count,
            dim,
            history.gates.clone().into_tensor_arg(),
            history.cells.clone().into_tensor_arg(),
            hidden.into_tensor_arg(),
            last.into_tensor_arg(),
            above.into_tensor_arg(),
            later.cells.clone().into_tensor_arg(),
            d_gates.clone().into_tensor_arg(),
            own.clone().into_tensor_arg(),
            place.frame,
            place.before,
            place.after,
            later.rows,
            above_row,
            has_last,
            has_above,
        );
        own
    }

    fn say(
        projected: CubeTensor,
        bias: CubeTensor,
        activation: Activation,
        outputs: &CubeTensor,
        frame: usize,
    ) -> CubeTensor {
        let [projected, bias] = [projected, bias].map(into_contiguous);
        let (rows, columns) = (projected.shape()[0], projected.shape()[1]);
        let own = empty(&projected, rows, columns);
        let (count, dim) = cubes(rows * columns);
        say_kernel::launch(
            &projected.client.clone(),
            count,
            dim,
            projected.into_tensor_arg(),
            bias.into_tensor_arg(),
            outputs.clone().into_tensor_arg(),
            own.clone().into_tensor_arg(),
            frame,
            activation == Activation::Tanh,
        );
        own
    }

    fn say_back(
        d_outputs: CubeTensor,
        outputs: CubeTensor,
        (d_heard, heard_rows): (CubeTensor, usize),
        d_projected: &CubeTensor,
        place: Place,
    ) -> CubeTensor {
        let [d_outputs, outputs, d_heard] = [d_outputs, outputs, d_heard].map(into_contiguous);
        let columns = outputs.shape()[1];
        let own = empty(&outputs, place.rows, columns);
        let (count, dim) = cubes(place.rows * columns);
        say_back_kernel::launch(
            &outputs.client.clone(),
            count,
            dim,
            d_outputs.into_tensor_arg(),
            outputs.into_tensor_arg(),
            d_heard.into_tensor_arg(),
            d_projected.clone().into_tensor_arg(),
            own.clone().into_tensor_arg(),
            place.frame,
            heard_rows,
        );
        own
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
