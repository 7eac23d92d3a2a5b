//! Recurrences on the CPU.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use burn::tensor::TensorData;
use burn_flex::{Flex, FlexTensor};
use rprae_recurrent as recurrent;
use rprae_recurrent::{
    Decoder, Hearing, Instructions, LayerGradients, LayerWeights, Plan, Projection, Sequence, State, Unrolled,
};

use super::backend::{
    DecoderTask, Hears, Layer, RecurrentBackend, RecurrentOps, SequenceInputs, SequenceTask, Stack,
    decoder_inputs,
};
use super::{Activation, Direction};

/// Tensors that own their numbers in one piece, so that their storage is the tensor: a part of one row is in one piece too.
fn contiguous<const N: usize>(tensors: [FlexTensor; N]) -> [FlexTensor; N] {
    tensors.map(|tensor| tensor.to_contiguous())
}

fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape))
}

fn layer<'a>(
    input: &'a FlexTensor,
    recurrent: &'a FlexTensor,
    bias: &'a FlexTensor,
) -> LayerWeights<'a, f32> {
    LayerWeights { input: input.storage(), recurrent: recurrent.storage(), bias: bias.storage() }
}

fn layer_gradients(gradients: LayerGradients<f32>, hidden: usize) -> [FlexTensor; 3] {
    let feature = gradients.input.len() / (4 * hidden);
    [
        tensor(gradients.input, [feature, 4 * hidden]),
        tensor(gradients.recurrent, [hidden, 4 * hidden]),
        tensor(gradients.bias, [4 * hidden]),
    ]
}

fn state_tensors(state: State<f32>, batch: usize) -> [FlexTensor; 2] {
    let hidden = state.hidden.len() / batch.max(1);
    [tensor(state.hidden, [batch, hidden]), tensor(state.cell, [batch, hidden])]
}

fn dims<const D: usize>(tensor: &FlexTensor) -> [usize; D] {
    tensor.shape().dims()
}

impl RecurrentBackend for Flex {
    type Sequence = Sequence<f32>;
    type Decoder = Unrolled<f32>;

    fn sequence_forward(inputs: SequenceInputs<Self>, task: &SequenceTask) -> (FlexTensor, Self::Sequence) {
        let [input, hidden, cell, input_weights, recurrent_weights, bias] = &contiguous(inputs);
        let [batch, time, _] = dims(input);
        let units = dims::<2>(hidden)[1];
        let direction = match task.direction {
            Direction::Forward => recurrent::Direction::Forward,
            Direction::Backward => recurrent::Direction::Backward,
        };
        let plan = Plan::new(&task.lengths, time, direction, Instructions::best());
        let weights = layer(input_weights, recurrent_weights, bias);
        let initial = Some((hidden.storage(), cell.storage()));
        let way = Sequence::<f32>::forward(plan, input.storage(), initial, &weights);
        let outputs = if task.outputs { way.output() } else { Vec::new() };
        let own = outputs.len() / batch.max(1);
        let last = way.last();
        let mut all = Vec::with_capacity(outputs.len() + 2 * batch * units);
        for sequence in 0..batch {
            all.extend_from_slice(&outputs[sequence * own..][..own]);
            all.extend_from_slice(&last.hidden[sequence * units..][..units]);
            all.extend_from_slice(&last.cell[sequence * units..][..units]);
        }
        (tensor(all, [batch, own + 2 * units]), way)
    }

    fn sequence_backward(
        way: Self::Sequence,
        inputs: SequenceInputs<Self>,
        gradient: FlexTensor,
        task: &SequenceTask,
        want_input: bool,
    ) -> [Option<FlexTensor>; 6] {
        let [input, hidden, _, input_weights, recurrent_weights, bias] = &contiguous(inputs);
        let [batch, time, feature] = dims(input);
        let units = dims::<2>(hidden)[1];
        let own = if task.outputs { time * units } else { 0 };
        let [gradient] = &contiguous([gradient]);
        let mut outputs = Vec::with_capacity(batch * own);
        let mut last =
            State { hidden: Vec::with_capacity(batch * units), cell: Vec::with_capacity(batch * units) };
        for sequence in gradient.storage::<f32>().chunks_exact(own + 2 * units) {
            outputs.extend_from_slice(&sequence[..own]);
            last.hidden.extend_from_slice(&sequence[own..own + units]);
            last.cell.extend_from_slice(&sequence[own + units..]);
        }
        let weights = layer(input_weights, recurrent_weights, bias);
        let outputs = task.outputs.then_some(&outputs[..]);
        let gradients = way.backward(&weights, outputs, Some(&last), want_input);
        let [d_hidden, d_cell] = state_tensors(gradients.initial, batch);
        let [d_input_weights, d_recurrent, d_bias] = layer_gradients(gradients.weights, units);
        [
            gradients.input.map(|input| tensor(input, [batch, time, feature])),
            Some(d_hidden),
            Some(d_cell),
            Some(d_input_weights),
            Some(d_recurrent),
            Some(d_bias),
        ]
    }

    fn decoder_forward(inputs: Vec<FlexTensor>, task: &DecoderTask) -> (FlexTensor, Self::Decoder) {
        let inputs: Vec<_> = inputs.into_iter().flat_map(|input| contiguous([input])).collect();
        let time = match task.hears {
            Hears::Known(_) => dims::<3>(&inputs[0])[1],
            Hears::Own | Hears::Words => task.lengths.iter().copied().max().unwrap_or(0),
        };
        let plan = Plan::new(&task.lengths, time, recurrent::Direction::Forward, Instructions::best());
        let heard = inputs[0].storage();
        let hearing = match task.hears {
            Hears::Known(_) => Hearing::Known(heard),
            Hears::Own => Hearing::Own(heard),
            Hears::Words => Hearing::Words { first: heard, table: inputs[inputs.len() - 1].storage() },
        };
        with_decoder(&inputs, task, |states, decoder| {
            let way = Unrolled::<f32>::forward(plan, hearing, states, decoder);
            let shape = [task.lengths.iter().sum(), decoder.projection.bias.len()];
            (tensor(way.output(), shape), way)
        })
    }

    fn decoder_backward(
        way: Self::Decoder,
        inputs: Vec<FlexTensor>,
        gradient: FlexTensor,
        task: &DecoderTask,
        want_inputs: bool,
    ) -> Vec<Option<FlexTensor>> {
        let inputs: Vec<_> = inputs.into_iter().flat_map(|input| contiguous([input])).collect();
        let [gradient] = contiguous([gradient]);
        let [top, outputs] = dims(&inputs[1]);
        let gradients =
            with_decoder(&inputs, task, |_, decoder| way.backward(decoder, gradient.storage(), want_inputs));
        let heard = inputs[0].shape();
        let heard = gradients.inputs.map(|values| FlexTensor::from_data(TensorData::new(values, heard)));
        let mut all = vec![
            heard,
            Some(tensor(gradients.projection, [top, outputs])),
            Some(tensor(gradients.bias, [outputs])),
        ];
        for (weights, state) in gradients.layers.into_iter().zip(gradients.initial) {
            let units = weights.bias.len() / 4;
            all.extend(layer_gradients(weights, units).map(Some));
            all.extend(state_tensors(state, task.lengths.len()).map(Some));
        }
        if let Some(table) = gradients.table {
            let feature = table.len() / outputs.max(1);
            all.push(Some(tensor(table, [outputs, feature])));
        }
        all
    }
}

/// Reads the initial states and the decoder among its inputs.
fn with_decoder<R>(
    inputs: &[FlexTensor],
    task: &DecoderTask,
    run: impl FnOnce(&[(&[f32], &[f32])], &Decoder<'_, f32>) -> R,
) -> R {
    let (layers, states): (Vec<_>, Vec<_>) = inputs[3..]
        .as_chunks::<5>()
        .0
        .iter()
        .map(|[input, recurrent, bias, hidden, cell]| {
            (layer(input, recurrent, bias), (hidden.storage(), cell.storage()))
        })
        .unzip();
    let projection = Projection { weights: inputs[1].storage(), bias: inputs[2].storage() };
    run(&states, &Decoder { layers: &layers, projection, activation: task.hears.activation() })
}

impl RecurrentOps for Flex {
    fn recurrent_sequence(
        input: FloatTensor<Self>,
        hidden: FloatTensor<Self>,
        cell: FloatTensor<Self>,
        input_weights: FloatTensor<Self>,
        recurrent_weights: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        lengths: Vec<usize>,
        direction: Direction,
        outputs: bool,
    ) -> FloatTensor<Self> {
        let inputs = [input, hidden, cell, input_weights, recurrent_weights, bias];
        Self::sequence_forward(inputs, &SequenceTask { lengths, direction, outputs }).0
    }

    fn recurrent_closed_loop(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        stack: Stack<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self> {
        let inputs = decoder_inputs([first, projection, projection_bias], stack, None);
        Self::decoder_forward(inputs, &DecoderTask { lengths, hears: Hears::Own }).0
    }

    fn recurrent_open_loop(
        inputs: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        stack: Stack<Self>,
        lengths: Vec<usize>,
        activation: Activation,
    ) -> FloatTensor<Self> {
        let inputs = decoder_inputs([inputs, projection, projection_bias], stack, None);
        Self::decoder_forward(inputs, &DecoderTask { lengths, hears: Hears::Known(activation) }).0
    }

    fn recurrent_words(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        table: FloatTensor<Self>,
        layer: Layer<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self> {
        let inputs = decoder_inputs([first, projection, projection_bias], Stack::One(layer), Some(table));
        Self::decoder_forward(inputs, &DecoderTask { lengths, hears: Hears::Words }).0
    }
}
