//! What results must not depend on: padding, the rest of the batch, and the number of threads, all to the last bit.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use rprae_recurrent::{
    ClosedLoop, Decoder, Direction, Feedback, Instructions, LayerWeights, Plan, Projection, Sequence, State,
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

fn closed_loop(lengths: &[usize], width: usize, words: bool, instructions: Instructions) -> Vec<Vec<f32>> {
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
        feedback: if words { Feedback::ArgMax { table: &table } } else { Feedback::Tanh },
    };
    let plan = Plan::new(lengths, width, Direction::Forward, instructions);
    let way = ClosedLoop::<f32>::forward(plan, &numbers(batch * FEATURE, 1.0, 50), &states, &decoder);
    let output = way.output();
    let mut d_output = vec![f32::NAN; batch * width * outputs];
    let mut valid = Vec::new();
    for (sequence, &length) in lengths.iter().enumerate() {
        let range = sequence * width * outputs..(sequence * width + length) * outputs;
        d_output[range.clone()].copy_from_slice(&numbers(length * outputs, 1.0, 60 + sequence as u32));
        valid.extend_from_slice(&output[range]);
    }
    let gradients = way.backward(&decoder, &d_output);
    let mut all = vec![valid, gradients.first, gradients.projection, gradients.bias];
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

#[test]
fn padding_changes_no_bit() {
    for instructions in Instructions::all() {
        for direction in [Direction::Forward, Direction::Backward] {
            let narrow = sequence(&MANY, 12, 0.0, direction, instructions);
            let padded = sequence(&MANY, 31, f32::NAN, direction, instructions);
            assert!(narrow.iter().flatten().all(|number| number.is_finite()));
            assert_eq!(bits(&narrow), bits(&padded));
        }
        for words in [false, true] {
            let narrow = closed_loop(&MANY, 12, words, instructions);
            assert!(narrow.iter().flatten().all(|number| number.is_finite()));
            assert_eq!(bits(&narrow), bits(&closed_loop(&MANY, 20, words, instructions)));
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
        let all = closed_loop(lengths, 12, false, instructions);
        let alone = closed_loop(&LENGTHS[..1], 7, false, instructions);
        assert_eq!(bits(&[all[0][..7 * FEATURE].to_vec()]), bits(&alone[..1]));
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let run = |threads: usize, lengths: &[usize], instructions: Instructions| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            [
                bits(&sequence(lengths, 12, 0.0, Direction::Backward, instructions)),
                bits(&closed_loop(lengths, 12, false, instructions)),
                bits(&closed_loop(lengths, 12, true, instructions)),
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
        values.extend(closed_loop(&LENGTHS, 12, false, instructions));
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
