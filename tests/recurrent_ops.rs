//! The recurrent operations against the same equations on a tape, and a GPU against the CPU.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

#[cfg(feature = "wgpu")]
#[path = "../benches/beside/launches.rs"]
mod launches;

use burn::tensor::{Device, Gradients, Tensor, TensorData, activation};
use rprae::model::ops::{
    Activation, Direction, LstmState, LstmWeights, lstm_closed_loop, lstm_closed_loop_words, lstm_last_state,
    lstm_open_loop, lstm_sequence,
};

#[cfg(feature = "wgpu")]
use launches::launches;

/// Numbers spread over `[-scale, scale]`, the same in every run.
fn numbers<const D: usize>(seed: usize, shape: [usize; D], scale: f32, device: &Device) -> Tensor<D> {
    let count = shape.iter().product();
    let values: Vec<f32> =
        (1..=count).map(|place| (place as f32 * (seed as f32 + 0.5) * 0.7).sin() * scale).collect();
    let tensor = Tensor::from_data(TensorData::new(values, shape), device);
    // Gradients exist on devices with a tape only.
    if device.is_autodiff() { tensor.require_grad() } else { tensor }
}

fn weights(seed: usize, feature: usize, hidden: usize, device: &Device) -> LstmWeights {
    LstmWeights {
        input: numbers(seed, [feature, 4 * hidden], 0.4, device),
        recurrent: numbers(seed + 1, [hidden, 4 * hidden], 0.4, device),
        bias: numbers(seed + 2, [4 * hidden], 0.4, device),
    }
}

fn state(seed: usize, batch: usize, hidden: usize, device: &Device) -> LstmState {
    LstmState {
        hidden: numbers(seed, [batch, hidden], 0.5, device),
        cell: numbers(seed + 1, [batch, hidden], 0.5, device),
    }
}

fn values<const D: usize>(tensor: &Tensor<D>) -> Vec<f32> {
    tensor.clone().into_data().iter().collect()
}

fn gradient<const D: usize>(tensor: &Tensor<D>, gradients: &Gradients) -> Vec<f32> {
    values(&tensor.grad(gradients).unwrap())
}

fn layer_gradients(weights: &LstmWeights, state: &LstmState, gradients: &Gradients) -> Vec<Vec<f32>> {
    vec![
        gradient(&weights.input, gradients),
        gradient(&weights.recurrent, gradients),
        gradient(&weights.bias, gradients),
        gradient(&state.hidden, gradients),
        gradient(&state.cell, gradients),
    ]
}

fn assert_close(got: &[Vec<f32>], want: &[Vec<f32>], tolerance: f32) {
    assert_eq!(got.len(), want.len());
    for (index, (got, want)) in got.iter().zip(want).enumerate() {
        assert_eq!(got.len(), want.len(), "array {index}");
        let scale = want.iter().fold(0.1_f32, |largest, number| largest.max(number.abs()));
        for (place, (got, want)) in got.iter().zip(want).enumerate() {
            assert!((got - want).abs() < tolerance * scale, "array {index}, place {place}: {got} and {want}");
        }
    }
}

/// One step of a layer, recorded on the tape.
fn plain_step(x: Tensor<2>, state: &LstmState, weights: &LstmWeights) -> LstmState {
    let sums = x.matmul(weights.input.clone())
        + state.hidden.clone().matmul(weights.recurrent.clone())
        + weights.bias.clone().unsqueeze();
    let gates = sums.chunk(4, 1);
    let [i, f, o] = [0, 1, 3].map(|gate: usize| activation::sigmoid(gates[gate].clone()));
    let cell = f * state.cell.clone() + i * gates[2].clone().tanh();
    LstmState { hidden: o * cell.clone().tanh(), cell }
}

fn row(state: &LstmState, row: usize) -> LstmState {
    LstmState { hidden: state.hidden.clone().narrow(0, row, 1), cell: state.cell.clone().narrow(0, row, 1) }
}

fn zeros(steps: usize, columns: usize, device: &Device) -> Vec<Tensor<2>> {
    if steps == 0 { Vec::new() } else { vec![Tensor::zeros([steps, columns], device)] }
}

const LENGTHS: [usize; 5] = [2, 5, 0, 3, 5];
const WIDTH: usize = 6;

/// Output, last states and all gradients of a layer over known inputs.
fn sequence(device: &Device, direction: Direction, plain: bool, last_only: bool) -> Vec<Vec<f32>> {
    let (batch, feature, hidden) = (LENGTHS.len(), 3, 7);
    let input = numbers(1, [batch, WIDTH, feature], 1.0, device);
    let weights = weights(2, feature, hidden, device);
    let initial = state(5, batch, hidden, device);
    let (output, last) = if plain {
        let (mut rows, mut ends): (Vec<Tensor<3>>, Vec<LstmState>) = (Vec::new(), Vec::new());
        for (sequence, &length) in LENGTHS.iter().enumerate() {
            let mut state = row(&initial, sequence);
            let mut said = Vec::new();
            for step in 0..length {
                let time = if direction == Direction::Forward { step } else { length - 1 - step };
                let x = input.clone().narrow(0, sequence, 1).narrow(1, time, 1).reshape([1, feature]);
                state = plain_step(x, &state, &weights);
                said.push(state.hidden.clone());
            }
            if direction == Direction::Backward {
                said.reverse();
            }
            said.extend(zeros(WIDTH - length, hidden, device));
            rows.push(Tensor::cat(said, 0).unsqueeze());
            ends.push(state);
        }
        let last = LstmState {
            hidden: Tensor::cat(ends.iter().map(|end| end.hidden.clone()).collect(), 0),
            cell: Tensor::cat(ends.into_iter().map(|end| end.cell).collect(), 0),
        };
        (Tensor::cat(rows, 0), last)
    } else if last_only {
        let last = lstm_last_state(input.clone(), &LENGTHS, Some(initial.clone()), &weights, direction);
        (Tensor::zeros([batch, WIDTH, hidden], device), last)
    } else {
        lstm_sequence(input.clone(), &LENGTHS, Some(initial.clone()), &weights, direction)
    };
    let share = if last_only { 0.0 } else { 1.0 };
    let loss = (output.clone() * numbers(7, [batch, WIDTH, hidden], share, device)).sum()
        + (last.hidden.clone() * numbers(8, [batch, hidden], 1.0, device)).sum()
        + (last.cell.clone() * numbers(9, [batch, hidden], 1.0, device)).sum();
    let gradients = loss.backward();
    let output = if last_only { Vec::new() } else { values(&output) };
    let mut all = vec![output, values(&last.hidden), values(&last.cell), gradient(&input, &gradients)];
    all.extend(layer_gradients(&weights, &initial, &gradients));
    all
}

/// What a decoder hears.
#[derive(Clone, Copy, PartialEq)]
enum Hears {
    Known(Activation),
    Own,
    Words,
}

/// Output and all gradients of a decoder.
fn decoder(device: &Device, layers: usize, hears: Hears, plain: bool) -> Vec<Vec<f32>> {
    let (batch, feature, hidden) = (LENGTHS.len(), 4, 6);
    let outputs = match hears {
        Hears::Known(_) => 7,
        Hears::Own => feature,
        Hears::Words => 9,
    };
    let has_tanh = matches!(hears, Hears::Known(Activation::Tanh) | Hears::Own);
    // All inputs, of which a decoder that hears itself is given the first.
    let inputs = numbers(1, [batch, WIDTH, feature], 1.0, device);
    let first = numbers(1, [batch, feature], 1.0, device);
    let table = numbers(2, [outputs, feature], 1.0, device);
    let projection = (numbers(3, [hidden, outputs], 0.6, device), numbers(4, [outputs], 0.3, device));
    let stack: Vec<_> = (0..layers)
        .map(|layer| {
            let heard = if layer == 0 { feature } else { hidden };
            (weights(10 * (layer + 1), heard, hidden, device), state(10 * layer + 15, batch, hidden, device))
        })
        .collect();
    let (weights, states): (Vec<LstmWeights>, Vec<LstmState>) = stack.iter().cloned().unzip();
    let output: Tensor<2> = if plain {
        let rows = LENGTHS.iter().enumerate().flat_map(|(sequence, &length)| {
            let mut states: Vec<_> = states.iter().map(|state| row(state, sequence)).collect();
            let mut next = first.clone().narrow(0, sequence, 1);
            let mut all = Vec::new();
            for step in 0..length {
                let known = || inputs.clone().narrow(0, sequence, 1).narrow(1, step, 1);
                let mut x = if let Hears::Known(_) = hears { known().reshape([1, feature]) } else { next };
                for (state, weights) in states.iter_mut().zip(&weights) {
                    *state = plain_step(x, state, weights);
                    x = state.hidden.clone();
                }
                let said = x.matmul(projection.0.clone()) + projection.1.clone().unsqueeze();
                let said = if has_tanh { said.tanh() } else { said };
                next = match hears {
                    Hears::Words => table.clone().select(0, said.clone().argmax(1).reshape([1])),
                    Hears::Own | Hears::Known(_) => said.clone(),
                };
                all.push(said);
            }
            all
        });
        Tensor::cat(rows.collect(), 0)
    } else {
        let (first, inputs, projection) = (first.clone(), inputs.clone(), projection.clone());
        match hears {
            Hears::Known(activation) => {
                lstm_open_loop(inputs, &LENGTHS, states, &weights, projection, activation)
            }
            Hears::Own => lstm_closed_loop(first, &LENGTHS, states, &weights, projection),
            Hears::Words => {
                let state = states.into_iter().next().unwrap();
                lstm_closed_loop_words(first, table.clone(), &LENGTHS, state, &weights[0], projection)
            }
        }
    };
    let frames = LENGTHS.iter().sum();
    assert_eq!(output.dims(), [frames, outputs]);
    let gradients = (output.clone() * numbers(7, [frames, outputs], 1.0, device)).sum().backward();
    let heard = if let Hears::Known(_) = hears {
        gradient(&inputs, &gradients)
    } else {
        gradient(&first, &gradients)
    };
    let mut all = vec![
        values(&output),
        heard,
        gradient(&projection.0, &gradients),
        gradient(&projection.1, &gradients),
    ];
    if hears == Hears::Words {
        all.push(gradient(&table, &gradients));
    }
    for (weights, state) in &stack {
        all.extend(layer_gradients(weights, state, &gradients));
    }
    all
}

/// Numbers of layers, and what decoders of as many hear.
const DECODERS: [(usize, Hears); 7] = [
    (1, Hears::Own),
    (2, Hears::Own),
    (3, Hears::Own),
    (1, Hears::Words),
    (1, Hears::Known(Activation::None)),
    (2, Hears::Known(Activation::Tanh)),
    (3, Hears::Known(Activation::Tanh)),
];

#[test]
fn a_sequence_is_what_a_tape_makes_of_its_equations() {
    let device = Device::flex().autodiff();
    for direction in [Direction::Forward, Direction::Backward] {
        let want = sequence(&device, direction, true, false);
        assert_close(&sequence(&device, direction, false, false), &want, 2e-5);
    }
}

#[test]
fn the_last_state_has_the_gradients_of_a_sequence() {
    let device = Device::flex().autodiff();
    for direction in [Direction::Forward, Direction::Backward] {
        let mut want = sequence(&device, direction, true, false);
        let all = sequence(&device, direction, false, true);
        assert_close(&all[1..3], &want[1..3], 2e-5);
        // With no weight on the output, the tape's gradients are those of the last state alone.
        want = last_only_on_a_tape(&device, direction);
        assert_close(&all[3..], &want, 2e-5);
    }
}

/// Gradients of the last state alone, from the sequence operation.
fn last_only_on_a_tape(device: &Device, direction: Direction) -> Vec<Vec<f32>> {
    let (batch, feature, hidden) = (LENGTHS.len(), 3, 7);
    let input = numbers(1, [batch, WIDTH, feature], 1.0, device);
    let weights = weights(2, feature, hidden, device);
    let initial = state(5, batch, hidden, device);
    let (_, last) = lstm_sequence(input.clone(), &LENGTHS, Some(initial.clone()), &weights, direction);
    let loss = (last.hidden * numbers(8, [batch, hidden], 1.0, device)).sum()
        + (last.cell * numbers(9, [batch, hidden], 1.0, device)).sum();
    let gradients = loss.backward();
    let mut all = vec![gradient(&input, &gradients)];
    all.extend(layer_gradients(&weights, &initial, &gradients));
    all
}

#[test]
fn a_decoder_is_what_a_tape_makes_of_its_equations() {
    let device = Device::flex().autodiff();
    for (layers, hears) in DECODERS {
        let want = decoder(&device, layers, hears, true);
        assert_close(&decoder(&device, layers, hears, false), &want, 3e-5);
    }
}

#[test]
fn an_open_loop_without_frames_has_gradients_of_zero() {
    let device = Device::flex().autodiff();
    let (weights, state) = (weights(2, 3, 5, &device), state(5, 2, 5, &device));
    let projection = (numbers(3, [5, 4], 0.6, &device), numbers(4, [4], 0.3, &device));
    let inputs = numbers(1, [2, 3, 3], 1.0, &device);
    let (layers, states) = ([weights.clone()], vec![state.clone()]);
    let output = lstm_open_loop(inputs, &[0, 0], states, &layers, projection, Activation::None);
    assert_eq!(output.dims(), [0, 4]);
    let gradients = layer_gradients(&weights, &state, &output.sum().backward());
    assert!(gradients.iter().flatten().all(|&number| number == 0.0));
}

#[test]
fn without_a_tape_the_values_are_the_same() {
    let device = Device::flex();
    let input = numbers(1, [2, 4, 3], 1.0, &device);
    let weights = weights(2, 3, 5, &device);
    let (output, last) = lstm_sequence(input, &[4, 2], None, &weights, Direction::Forward);
    assert_eq!((output.dims(), last.cell.dims()), ([2, 4, 5], [2, 5]));
    let end: Vec<f32> = values(&output)[3 * 5..4 * 5].to_vec();
    assert_eq!(values(&last.hidden)[..5], end);
}

/// A GPU for one test at a time, so that none counts another's launches.
#[cfg(feature = "wgpu")]
fn gpu() -> Option<(Device, std::sync::MutexGuard<'static, ()>)> {
    static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());
    let alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    match Device::wgpu_options().init() {
        Ok(device) => Some((device.autodiff(), alone)),
        Err(error) => {
            println!("skipped: no adapter ({error})");
            None
        }
    }
}

#[cfg(feature = "wgpu")]
#[test]
fn a_gpu_agrees_with_the_cpu() {
    let Some((gpu, _alone)) = gpu() else { return };
    let cpu = Device::flex().autodiff();
    for direction in [Direction::Forward, Direction::Backward] {
        for last_only in [false, true] {
            let want = sequence(&cpu, direction, false, last_only);
            assert_close(&sequence(&gpu, direction, false, last_only), &want, 3e-5);
        }
    }
    assert_close(&without_frames(&gpu), &without_frames(&cpu), 1e-6);
    for (layers, hears) in DECODERS {
        let want = decoder(&cpu, layers, hears, false);
        assert_close(&decoder(&gpu, layers, hears, false), &want, 5e-5);
    }
}

/// Output, last states and gradients of a layer over sequences that are all empty.
#[cfg(feature = "wgpu")]
fn without_frames(device: &Device) -> Vec<Vec<f32>> {
    let (input, weights) = (numbers(1, [2, 3, 4], 1.0, device), weights(2, 4, 5, device));
    let initial = state(5, 2, 5, device);
    let (output, last) =
        lstm_sequence(input.clone(), &[0, 0], Some(initial.clone()), &weights, Direction::Forward);
    let gradients = (output.clone().sum() + last.hidden.clone().sum() + last.cell.clone().sum()).backward();
    let mut all =
        vec![values(&output), values(&last.hidden), values(&last.cell), gradient(&input, &gradients)];
    all.extend(layer_gradients(&weights, &initial, &gradients));
    all
}

#[cfg(feature = "wgpu")]
#[test]
fn a_step_takes_few_launches_on_a_gpu() {
    const BATCH: usize = 3;
    const COLUMNS: usize = 4;
    let Some((gpu, _alone)) = gpu() else { return };
    let forward_and_back = |decoder: Option<bool>, steps: usize| {
        let lengths = [steps; BATCH];
        let input = numbers(1, [BATCH, steps, COLUMNS], 1.0, &gpu);
        let said = match decoder {
            None => {
                let last =
                    lstm_last_state(input, &lengths, None, &weights(2, COLUMNS, 5, &gpu), Direction::Forward);
                last.hidden + last.cell
            }
            Some(known) => {
                let layers = [weights(2, COLUMNS, 5, &gpu), weights(3, 5, 5, &gpu), weights(4, 5, 5, &gpu)];
                let initial = vec![state(5, BATCH, 5, &gpu); 3];
                let projection = (numbers(7, [5, COLUMNS], 1.0, &gpu), numbers(8, [COLUMNS], 1.0, &gpu));
                if known {
                    lstm_open_loop(input, &lengths, initial, &layers, projection, Activation::Tanh)
                } else {
                    let first = input.narrow(1, 0, 1).squeeze_dim(1);
                    lstm_closed_loop(first, &lengths, initial, &layers, projection)
                }
            }
        };
        drop(said.sum().backward());
    };
    // A product and the numbers of a cell, in each direction; of three layers; of three layers that hear what was said at the
    // step before.
    for (decoder, want) in [(None, 4), (Some(true), 12), (Some(false), 22)] {
        let [few, many] = [6, 12].map(|steps| {
            // The first time, products of new sizes are tried out.
            forward_and_back(decoder, steps);
            launches(|| forward_and_back(decoder, steps)).1
        });
        assert_eq!(many - few, 6 * want, "launches in 6 more steps than the {few} of 6");
    }
}
