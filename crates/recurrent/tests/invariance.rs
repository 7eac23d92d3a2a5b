//! What results must not depend on: padding, the rest of the batch, and the number of threads, all to the last bit.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use rprae_recurrent::{
    Activation, Decoder, Direction, Hearing, Instructions, LayerWeights, Plan, Projection, Sequence, State,
    Unrolled,
};

fn numbers(count: usize, scale: f32, seed: u32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            ((state >> 8) as f32 / (1 << 23) as f32 - 1.0) * scale
        })
        .collect()
}

const FEATURE: usize = 50;
const HIDDEN: usize = 70;

struct Layer {
    input: Vec<f32>,
    recurrent: Vec<f32>,
    bias: Vec<f32>,
}

impl Layer {
    fn new(feature: usize, seed: u32) -> Self {
        Self {
            input: numbers(feature * 4 * HIDDEN, 0.3, seed),
            recurrent: numbers(HIDDEN * 4 * HIDDEN, 0.3, seed + 1),
            bias: numbers(4 * HIDDEN, 0.3, seed + 2),
        }
    }

    fn weights(&self) -> LayerWeights<'_, f32> {
        LayerWeights { input: &self.input, recurrent: &self.recurrent, bias: &self.bias }
    }
}

/// Everything a sequence yields, `[batch, time, ...]` cut at `time`: output, last state, and all gradients.
fn sequence(
    lengths: &[usize],
    width: usize,
    padding: f32,
    direction: Direction,
    instructions: Instructions,
) -> Vec<Vec<f32>> {
    let batch = lengths.len();
    let layer = Layer::new(FEATURE, 1);
    let fill = |columns: usize, seed: u32| {
        let mut values = vec![padding; batch * width * columns];
        for (sequence, &length) in lengths.iter().enumerate() {
            let rows = numbers(length * columns, 1.0, seed + sequence as u32);
            values[sequence * width * columns..][..length * columns].copy_from_slice(&rows);
        }
        values
    };
    let (input, d_output) = (fill(FEATURE, 100), fill(HIDDEN, 200));
    let state = State { hidden: numbers(batch * HIDDEN, 0.5, 7), cell: numbers(batch * HIDDEN, 0.5, 8) };
    let plan = Plan::new(lengths, width, direction, instructions);
    let initial = Some((&state.hidden[..], &state.cell[..]));
    let way = Sequence::<f32>::forward(plan, &input, initial, &layer.weights());
    let (output, last) = (way.output(), way.last());
    let gradients = way.backward(&layer.weights(), Some(&d_output), Some(&state), true);
    let cut = |values: Vec<f32>, columns: usize| -> Vec<f32> {
        let mut rows = Vec::new();
        for (sequence, &length) in lengths.iter().enumerate() {
            let own = &values[sequence * width * columns..][..width * columns];
            rows.extend_from_slice(&own[..length * columns]);
            assert!(own[length * columns..].iter().all(|&number| number == 0.0), "padding is not zero");
        }
        rows
    };
    vec![
        cut(output, HIDDEN),
        last.hidden,
        last.cell,
        cut(gradients.input.unwrap(), FEATURE),
        gradients.initial.hidden,
        gradients.initial.cell,
        gradients.weights.input,
        gradients.weights.recurrent,
        gradients.weights.bias,
    ]
}

/// What a decoder in a test hears.
#[derive(Clone, Copy, PartialEq)]
enum Hears {
    Known,
    Own,
    Words,
}

/// Everything a decoder yields: outputs of valid frames, and all gradients.
fn decoder(lengths: &[usize], width: usize, hears: Hears, instructions: Instructions) -> Vec<Vec<f32>> {
    let words = hears == Hears::Words;
    let batch = lengths.len();
    let layers = [Layer::new(FEATURE, 1), Layer::new(HIDDEN, 4), Layer::new(HIDDEN, 7)];
    let layers = if words { &layers[..1] } else { &layers[..] };
    let weights: Vec<_> = layers.iter().map(Layer::weights).collect();
    let outputs = if words { 83 } else { FEATURE };
    let (projection, bias) = (numbers(HIDDEN * outputs, 0.3, 20), numbers(outputs, 0.3, 21));
    let table = numbers(outputs * FEATURE, 1.0, 22);
    let states: Vec<_> = (0..layers.len() as u32)
        .map(|l| (numbers(batch * HIDDEN, 0.5, 30 + l), numbers(batch * HIDDEN, 0.5, 40 + l)))
        .collect();
    let states: Vec<_> = states.iter().map(|(hidden, cell)| (&hidden[..], &cell[..])).collect();
    let decoder = Decoder {
        layers: &weights,
        projection: Projection { weights: &projection, bias: &bias },
        activation: if words { Activation::None } else { Activation::Tanh },
    };
    let mut inputs = numbers(batch * FEATURE, 1.0, 50);
    if hears == Hears::Known {
        inputs = vec![f32::NAN; batch * width * FEATURE];
        for (sequence, &length) in lengths.iter().enumerate() {
            let own = numbers(length * FEATURE, 1.0, 50 + sequence as u32);
            inputs[sequence * width * FEATURE..][..own.len()].copy_from_slice(&own);
        }
    }
    let hearing = match hears {
        Hears::Known => Hearing::Known(&inputs),
        Hears::Own => Hearing::Own(&inputs),
        Hears::Words => Hearing::Words { first: &inputs, table: &table },
    };
    let plan = Plan::new(lengths, width, Direction::Forward, instructions);
    let way = Unrolled::<f32>::forward(plan, hearing, &states, &decoder);
    let output = way.output();
    let rows = lengths.iter().enumerate();
    let d_output: Vec<f32> =
        rows.flat_map(|(sequence, &length)| numbers(length * outputs, 1.0, 60 + sequence as u32)).collect();
    let gradients = way.backward(&decoder, &d_output, true);
    let mut d_inputs = gradients.inputs.unwrap();
    if hears == Hears::Known {
        let rows = d_inputs.chunks_exact(width * FEATURE).zip(lengths);
        d_inputs = rows.flat_map(|(row, &length)| row[..length * FEATURE].to_vec()).collect();
    }
    let mut all = vec![output, d_inputs, gradients.projection, gradients.bias];
    all.extend(gradients.table);
    for (layer, state) in gradients.layers.into_iter().zip(gradients.initial) {
        all.extend([layer.input, layer.recurrent, layer.bias, state.hidden, state.cell]);
    }
    all
}

const LENGTHS: [usize; 9] = [7, 3, 0, 12, 12, 1, 9, 3, 2];
/// Enough sequences to be worked on in parts.
const MANY: [usize; 28] =
    [7, 3, 0, 12, 12, 1, 9, 3, 2, 5, 5, 4, 11, 8, 6, 2, 2, 10, 1, 3, 3, 4, 5, 6, 0, 1, 12, 7];

fn bits(values: &[Vec<f32>]) -> Vec<Vec<u32>> {
    values.iter().map(|values| values.iter().map(|number| number.to_bits()).collect()).collect()
}

/// Sequences of more frames than go through all layers at once.
fn long() -> Vec<usize> {
    MANY.iter().map(|length| 6 * length).collect()
}

#[test]
fn told_its_own_outputs_a_decoder_says_the_same() {
    check_told(FEATURE);
    // So few features that they are heard step by step even where they are known.
    check_told(HIDDEN / 4);
}

fn check_told(feature: usize) {
    let (lengths, width) = (long(), 72);
    let layers = [Layer::new(feature, 1), Layer::new(HIDDEN, 4)];
    let weights = layers.each_ref().map(Layer::weights);
    let (projection, bias) = (numbers(HIDDEN * feature, 0.3, 20), numbers(feature, 0.3, 21));
    let state = numbers(lengths.len() * HIDDEN, 0.5, 30);
    let states = [(&state[..], &state[..]); 2];
    let projection = Projection { weights: &projection, bias: &bias };
    let decoder = Decoder { layers: &weights, projection, activation: Activation::Tanh };
    for instructions in Instructions::all() {
        let plan = || Plan::new(&lengths, width, Direction::Forward, instructions);
        let first = numbers(lengths.len() * feature, 1.0, 50);
        let own = Unrolled::<f32>::forward(plan(), Hearing::Own(&first), &states, &decoder).output();
        let mut heard = vec![f32::NAN; lengths.len() * width * feature];
        let mut said = &own[..];
        for ((first, heard), length) in
            first.chunks_exact(feature).zip(heard.chunks_exact_mut(width * feature)).zip(&lengths)
        {
            let (own, rest) = said.split_at(length * feature);
            said = rest;
            heard[..feature].copy_from_slice(first);
            if let Some(before) = length.checked_sub(1) {
                heard[feature..][..before * feature].copy_from_slice(&own[..before * feature]);
            }
        }
        let told = Unrolled::<f32>::forward(plan(), Hearing::Known(&heard), &states, &decoder).output();
        assert_eq!(bits(&[own]), bits(&[told]), "with {}", instructions.name());
    }
}

#[test]
fn a_decoder_of_known_inputs_is_its_layers_one_after_the_other() {
    let (lengths, width) = (long(), 72);
    let batch = lengths.len();
    let layers = [Layer::new(FEATURE, 1), Layer::new(HIDDEN, 4)];
    let weights = layers.each_ref().map(Layer::weights);
    // It says its hidden states.
    let identity: Vec<f32> =
        (0..HIDDEN * HIDDEN).map(|at| if at % (HIDDEN + 1) == 0 { 1.0 } else { 0.0 }).collect();
    let projection = Projection { weights: &identity, bias: &[0.0; HIDDEN] };
    let decoder = Decoder { layers: &weights, projection, activation: Activation::None };
    let states = [[30, 31], [32, 33]].map(|seeds| seeds.map(|seed| numbers(batch * HIDDEN, 0.5, seed)));
    let states = states.each_ref().map(|[hidden, cell]| (&hidden[..], &cell[..]));
    let (inputs, d_output) =
        (numbers(batch * width * FEATURE, 1.0, 50), numbers(batch * width * HIDDEN, 1.0, 60));
    let valid = |padded: &[f32]| -> Vec<f32> {
        let sequences = padded.chunks_exact(width * HIDDEN).zip(&lengths);
        sequences.flat_map(|(sequence, length)| sequence[..length * HIDDEN].to_vec()).collect()
    };
    for instructions in Instructions::all() {
        let plan = || Plan::new(&lengths, width, Direction::Forward, instructions);
        let way = Unrolled::<f32>::forward(plan(), Hearing::Known(&inputs), &states, &decoder);
        let output = way.output();
        let all = way.backward(&decoder, &valid(&d_output), true);

        let below = Sequence::<f32>::forward(plan(), &inputs, Some(states[0]), &weights[0]);
        let above = Sequence::<f32>::forward(plan(), &below.output(), Some(states[1]), &weights[1]);
        assert_eq!(bits(&[output]), bits(&[valid(&above.output())]), "with {}", instructions.name());
        let above = above.backward(&weights[1], Some(&d_output), None, true);
        let below = below.backward(&weights[0], above.input.as_deref(), None, true);
        assert_eq!(bits(&[all.inputs.unwrap()]), bits(&[below.input.unwrap()]));
        for ((got, initial), want) in all
            .layers
            .into_iter()
            .zip(all.initial)
            .zip([(below.weights, below.initial), (above.weights, above.initial)])
        {
            assert_eq!(
                bits(&[got.input, got.recurrent, got.bias, initial.hidden, initial.cell]),
                bits(&[want.0.input, want.0.recurrent, want.0.bias, want.1.hidden, want.1.cell]),
                "with {}",
                instructions.name()
            );
        }
    }
}

#[test]
fn padding_changes_no_bit() {
    for instructions in Instructions::all() {
        for direction in [Direction::Forward, Direction::Backward] {
            let narrow = sequence(&MANY, 12, 0.0, direction, instructions);
            let padded = sequence(&MANY, 31, f32::NAN, direction, instructions);
            assert!(narrow.iter().flatten().all(|number| number.is_finite()));
            assert_eq!(bits(&narrow), bits(&padded));
        }
        for hears in [Hears::Known, Hears::Own, Hears::Words] {
            let narrow = decoder(&MANY, 12, hears, instructions);
            assert!(narrow.iter().flatten().all(|number| number.is_finite()));
            assert_eq!(bits(&narrow), bits(&decoder(&MANY, 20, hears, instructions)));
        }
    }
}

#[test]
fn the_rest_of_the_batch_changes_no_bit_of_a_sequence() {
    for (instructions, lengths) in
        Instructions::all().into_iter().flat_map(|i| [(i, &LENGTHS[..]), (i, &MANY)])
    {
        let all = sequence(lengths, 12, 0.0, Direction::Forward, instructions);
        // The first sequence alone: its output, last state and gradient of the input.
        let alone = sequence(&LENGTHS[..1], 7, 0.0, Direction::Forward, instructions);
        assert_eq!(bits(&[all[0][..7 * HIDDEN].to_vec()]), bits(&alone[..1]));
        assert_eq!(bits(&[all[3][..7 * FEATURE].to_vec()]), bits(&alone[3..4]));
        for hears in [Hears::Known, Hears::Own] {
            let all = decoder(lengths, 12, hears, instructions);
            let alone = decoder(&LENGTHS[..1], 7, hears, instructions);
            assert_eq!(bits(&[all[0][..7 * FEATURE].to_vec()]), bits(&alone[..1]));
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let run = |threads: usize, lengths: &[usize], instructions: Instructions| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            [
                bits(&sequence(lengths, 12, 0.0, Direction::Backward, instructions)),
                bits(&decoder(lengths, 12, Hears::Known, instructions)),
                bits(&decoder(lengths, 12, Hears::Own, instructions)),
                bits(&decoder(lengths, 12, Hears::Words, instructions)),
            ]
        })
    };
    for (instructions, lengths) in
        Instructions::all().into_iter().flat_map(|i| [(i, &LENGTHS[..]), (i, &MANY)])
    {
        let alone = run(1, lengths, instructions);
        for threads in [2, 3, 8] {
            assert_eq!(
                alone,
                run(threads, lengths, instructions),
                "{threads} threads with {}",
                instructions.name()
            );
        }
    }
}

#[test]
fn instructions_agree_within_rounding() {
    let all = Instructions::all();
    let run = |instructions| {
        let mut values = sequence(&LENGTHS, 12, 0.0, Direction::Forward, instructions);
        values.extend(decoder(&LENGTHS, 12, Hears::Known, instructions));
        values.extend(decoder(&LENGTHS, 12, Hears::Own, instructions));
        values
    };
    let best = run(all[0]);
    for &other in &all[1..] {
        for (a, b) in best.iter().zip(run(other)) {
            let scale = a.iter().fold(1e-3_f32, |largest, number| largest.max(number.abs()));
            for (a, b) in a.iter().zip(&b) {
                assert!((a - b).abs() < 2e-5 * scale, "{a} and {b} with {}", other.name());
            }
        }
    }
}
