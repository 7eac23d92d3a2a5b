//! Gradients against finite differences, and values against a plain recurrence, in double precision.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use rprae_recurrent::{
    Activation, Decoder, Direction, Hearing, Instructions, LayerWeights, Plan, Projection, Sequence, State,
    Unrolled,
};

/// Numbers spread evenly over `[-scale, scale]`, the same in every run.
fn numbers(count: usize, scale: f64, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            ((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * scale
        })
        .collect()
}

/// Named arrays that a loss depends on.
type Arrays = Vec<(&'static str, Vec<f64>)>;

fn array<'a>(arrays: &'a Arrays, name: &str) -> &'a [f64] {
    &arrays.iter().find(|(other, _)| *other == name).unwrap_or_else(|| panic!("no array {name}")).1
}

/// Compares every gradient with the slope of the loss, by central differences.
fn check(arrays: &Arrays, gradients: &Arrays, loss: impl Fn(&Arrays) -> f64) {
    const STEP: f64 = 1e-5;
    for (index, (name, values)) in arrays.iter().enumerate() {
        let gradient = array(gradients, name);
        assert_eq!(gradient.len(), values.len(), "{name}");
        for place in 0..values.len() {
            let mut moved = arrays.clone();
            moved[index].1[place] = values[place] + STEP;
            let above = loss(&moved);
            moved[index].1[place] = values[place] - STEP;
            let slope = (above - loss(&moved)) / (2.0 * STEP);
            let difference = (gradient[place] - slope).abs();
            assert!(
                difference < 1e-8 + 1e-6 * slope.abs(),
                "{name}[{place}]: gradient {} but slope {slope}",
                gradient[place]
            );
        }
    }
}

fn weighted(values: &[f64], weights: &[f64]) -> f64 {
    assert_eq!(values.len(), weights.len());
    values.iter().zip(weights).map(|(value, weight)| value * weight).sum()
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// One step of a layer for one sequence, straight from the equations.
fn plain_step(x: &[f64], h: &mut [f64], c: &mut [f64], w: &LayerWeights<'_, f64>) {
    let units = w.hidden();
    let before = h.to_vec();
    let sum = |column: usize| {
        let input: f64 = x.iter().enumerate().map(|(row, x)| x * w.input[row * 4 * units + column]).sum();
        let recurrent: f64 =
            before.iter().enumerate().map(|(row, h)| h * w.recurrent[row * 4 * units + column]).sum();
        input + recurrent + w.bias[column]
    };
    for unit in 0..units {
        let [i, f, g, o] = [0, 1, 2, 3].map(|gate| sum(gate * units + unit));
        c[unit] = sigmoid(f) * c[unit] + sigmoid(i) * g.tanh();
        h[unit] = sigmoid(o) * c[unit].tanh();
    }
}

/// The last is worked on in parts.
const LENGTH_MIXES: [&[usize]; 6] = [
    &[3, 3, 3],
    &[1, 4, 2, 0, 4],
    &[5],
    &[0, 0],
    &[2, 1, 1, 1, 1, 1, 1, 3],
    &[1, 2, 0, 1, 3, 1, 1, 2, 1, 2, 1, 1, 3, 1, 0, 1, 2, 1, 1, 1, 2, 1, 1, 1, 4, 1],
];

#[test]
fn a_sequence_has_the_gradients_of_its_values() {
    check_sequences(3, 5);
}

#[test]
fn a_sequence_of_few_features_has_the_gradients_of_its_values() {
    check_sequences(1, 5);
}

fn check_sequences(feature: usize, hidden: usize) {
    for lengths in LENGTH_MIXES {
        for direction in [Direction::Forward, Direction::Backward] {
            let batch = lengths.len();
            let width = lengths.iter().max().unwrap() + 1;
            let plan = || Plan::new(lengths, width, direction, Instructions::best());
            let arrays: Arrays = vec![
                ("input", numbers(batch * width * feature, 1.0, 1)),
                ("hidden", numbers(batch * hidden, 0.5, 2)),
                ("cell", numbers(batch * hidden, 0.5, 3)),
                ("input weights", numbers(feature * 4 * hidden, 0.7, 4)),
                ("recurrent weights", numbers(hidden * 4 * hidden, 0.7, 5)),
                ("bias", numbers(4 * hidden, 0.7, 6)),
            ];
            let output_weights = numbers(batch * width * hidden, 1.0, 7);
            let last =
                State { hidden: numbers(batch * hidden, 1.0, 8), cell: numbers(batch * hidden, 1.0, 9) };
            let run = |arrays: &Arrays| {
                let weights = LayerWeights {
                    input: array(arrays, "input weights"),
                    recurrent: array(arrays, "recurrent weights"),
                    bias: array(arrays, "bias"),
                };
                let initial = Some((array(arrays, "hidden"), array(arrays, "cell")));
                Sequence::<f64>::forward(plan(), array(arrays, "input"), initial, &weights)
            };
            let loss = |arrays: &Arrays| {
                let way = run(arrays);
                let end = way.last();
                weighted(&way.output(), &output_weights)
                    + weighted(&end.hidden, &last.hidden)
                    + weighted(&end.cell, &last.cell)
            };
            let weights = LayerWeights {
                input: array(&arrays, "input weights"),
                recurrent: array(&arrays, "recurrent weights"),
                bias: array(&arrays, "bias"),
            };

            // Values, sequence by sequence.
            let way = run(&arrays);
            let (output, end) = (way.output(), way.last());
            for (sequence, &length) in lengths.iter().enumerate() {
                let mut h = array(&arrays, "hidden")[sequence * hidden..][..hidden].to_vec();
                let mut c = array(&arrays, "cell")[sequence * hidden..][..hidden].to_vec();
                let mut want = vec![0.0; width * hidden];
                for step in 0..length {
                    let time = if direction == Direction::Forward { step } else { length - 1 - step };
                    let x = &array(&arrays, "input")[(sequence * width + time) * feature..][..feature];
                    plain_step(x, &mut h, &mut c, &weights);
                    want[time * hidden..][..hidden].copy_from_slice(&h);
                }
                let got = &output[sequence * width * hidden..][..width * hidden];
                for (got, want) in got.iter().zip(&want) {
                    assert!((got - want).abs() < 1e-14, "{got} instead of {want}");
                }
                for (got, want) in end.hidden[sequence * hidden..][..hidden].iter().zip(&h) {
                    assert!((got - want).abs() < 1e-14, "last hidden state {got} instead of {want}");
                }
            }

            let gradients = way.backward(&weights, Some(&output_weights), Some(&last), true);
            let gradients: Arrays = vec![
                ("input", gradients.input.unwrap()),
                ("hidden", gradients.initial.hidden),
                ("cell", gradients.initial.cell),
                ("input weights", gradients.weights.input),
                ("recurrent weights", gradients.weights.recurrent),
                ("bias", gradients.weights.bias),
            ];
            check(&arrays, &gradients, loss);
        }
    }
}

/// What a decoder in a test hears.
#[derive(Clone, Copy, PartialEq)]
enum Hears {
    Known,
    Own,
    Words,
}

/// The shapes of a decoder in a test.
struct Shape {
    hidden: Vec<usize>,
    feature: usize,
    outputs: usize,
    hears: Hears,
    activation: Activation,
}

const NAMES: [[&str; 5]; 3] = [
    ["input weights 0", "recurrent weights 0", "bias 0", "hidden 0", "cell 0"],
    ["input weights 1", "recurrent weights 1", "bias 1", "hidden 1", "cell 1"],
    ["input weights 2", "recurrent weights 2", "bias 2", "hidden 2", "cell 2"],
];

impl Shape {
    fn arrays(&self, batch: usize, width: usize) -> Arrays {
        let steps = if self.hears == Hears::Known { width } else { 1 };
        let mut arrays = vec![
            ("inputs", numbers(batch * steps * self.feature, 1.0, 1)),
            ("projection", numbers(self.hidden[self.hidden.len() - 1] * self.outputs, 0.9, 2)),
            ("projection bias", numbers(self.outputs, 0.5, 3)),
        ];
        if self.hears == Hears::Words {
            arrays.push(("table", numbers(self.outputs * self.feature, 1.0, 4)));
        }
        let mut feature = self.feature;
        for (layer, (&hidden, names)) in self.hidden.iter().zip(NAMES).enumerate() {
            let seed = 10 * (layer as u64 + 1);
            arrays.push((names[0], numbers(feature * 4 * hidden, 0.8, seed)));
            arrays.push((names[1], numbers(hidden * 4 * hidden, 0.8, seed + 1)));
            arrays.push((names[2], numbers(4 * hidden, 0.8, seed + 2)));
            arrays.push((names[3], numbers(batch * hidden, 0.8, seed + 3)));
            arrays.push((names[4], numbers(batch * hidden, 0.8, seed + 4)));
            feature = hidden;
        }
        arrays
    }

    fn layers<'a>(&self, arrays: &'a Arrays) -> Vec<LayerWeights<'a, f64>> {
        NAMES[..self.hidden.len()]
            .iter()
            .map(|[input, recurrent, bias, ..]| LayerWeights {
                input: array(arrays, input),
                recurrent: array(arrays, recurrent),
                bias: array(arrays, bias),
            })
            .collect()
    }

    fn with_decoder<R>(&self, arrays: &Arrays, run: impl FnOnce(&Decoder<'_, f64>) -> R) -> R {
        let layers = self.layers(arrays);
        let projection =
            Projection { weights: array(arrays, "projection"), bias: array(arrays, "projection bias") };
        run(&Decoder { layers: &layers, projection, activation: self.activation })
    }

    fn run(&self, plan: Plan, arrays: &Arrays) -> Unrolled<f64> {
        let states: Vec<(&[f64], &[f64])> = NAMES[..self.hidden.len()]
            .iter()
            .map(|[.., hidden, cell]| (array(arrays, hidden), array(arrays, cell)))
            .collect();
        let inputs = array(arrays, "inputs");
        let hearing = match self.hears {
            Hears::Known => Hearing::Known(inputs),
            Hears::Own => Hearing::Own(inputs),
            Hears::Words => Hearing::Words { first: inputs, table: array(arrays, "table") },
        };
        self.with_decoder(arrays, |decoder| Unrolled::<f64>::forward(plan, hearing, &states, decoder))
    }

    /// Outputs of one sequence, straight from the equations.
    fn plain(&self, arrays: &Arrays, width: usize, sequence: usize, steps: usize) -> Vec<f64> {
        let layers = self.layers(arrays);
        let row = |name, columns: usize| array(arrays, name)[sequence * columns..][..columns].to_vec();
        let mut states: Vec<_> =
            NAMES.iter().zip(&self.hidden).map(|(names, &h)| (row(names[3], h), row(names[4], h))).collect();
        let given = if self.hears == Hears::Known { width } else { 1 };
        let inputs = row("inputs", given * self.feature);
        let mut x = inputs[..self.feature].to_vec();
        let mut outputs = Vec::new();
        for step in 0..steps {
            let mut heard = x.clone();
            for ((hidden, cell), layer) in states.iter_mut().zip(&layers) {
                plain_step(&heard, hidden, cell, layer);
                heard.clone_from(hidden);
            }
            let output: Vec<f64> = (0..self.outputs)
                .map(|column| {
                    let products = heard.iter().enumerate();
                    let sum: f64 = products
                        .map(|(unit, h)| h * array(arrays, "projection")[unit * self.outputs + column])
                        .sum();
                    let sum = sum + array(arrays, "projection bias")[column];
                    if self.activation == Activation::Tanh { sum.tanh() } else { sum }
                })
                .collect();
            x = match self.hears {
                Hears::Known if step + 1 < steps => {
                    inputs[(step + 1) * self.feature..][..self.feature].to_vec()
                }
                Hears::Known => Vec::new(),
                Hears::Own => output.clone(),
                Hears::Words => {
                    let word = (0..self.outputs).max_by(|&a, &b| output[a].total_cmp(&output[b])).unwrap();
                    array(arrays, "table")[word * self.feature..][..self.feature].to_vec()
                }
            };
            outputs.extend(output);
        }
        outputs
    }

    fn check(&self, lengths: &[usize]) {
        let batch = lengths.len();
        let width = lengths.iter().max().unwrap() + 1;
        let plan = || Plan::new(lengths, width, Direction::Forward, Instructions::best());
        let arrays = self.arrays(batch, width);
        let output_weights = numbers(lengths.iter().sum::<usize>() * self.outputs, 1.0, 99);
        let loss = |arrays: &Arrays| weighted(&self.run(plan(), arrays).output(), &output_weights);

        let way = self.run(plan(), &arrays);
        let output = way.output();
        let sequences = lengths.iter().enumerate();
        let want: Vec<f64> =
            sequences.flat_map(|(sequence, &length)| self.plain(&arrays, width, sequence, length)).collect();
        assert_eq!(output.len(), want.len());
        for (got, want) in output.iter().zip(&want) {
            assert!((got - want).abs() < 1e-13, "{got} instead of {want}");
        }

        let gradients = self.with_decoder(&arrays, |decoder| way.backward(decoder, &output_weights, true));
        let mut all: Arrays = vec![
            ("inputs", gradients.inputs.unwrap()),
            ("projection", gradients.projection),
            ("projection bias", gradients.bias),
        ];
        if let Some(table) = gradients.table {
            all.push(("table", table));
        }
        for ((layer, initial), names) in gradients.layers.into_iter().zip(gradients.initial).zip(NAMES) {
            let values = [layer.input, layer.recurrent, layer.bias, initial.hidden, initial.cell];
            all.extend(names.into_iter().zip(values));
        }
        check(&arrays, &all, loss);
    }
}

fn check_all(hidden: &[usize], feature: usize, outputs: usize, hears: Hears, activation: Activation) {
    let shape = Shape { hidden: hidden.to_vec(), feature, outputs, hears, activation };
    for lengths in LENGTH_MIXES {
        shape.check(lengths);
    }
}

#[test]
fn a_decoder_that_hears_itself_has_the_gradients_of_its_values() {
    check_all(&[4, 3, 5], 2, 2, Hears::Own, Activation::Tanh);
    check_all(&[6], 5, 5, Hears::Own, Activation::Tanh);
    check_all(&[3], 2, 2, Hears::Own, Activation::None);
}

#[test]
fn a_decoder_of_words_has_the_gradients_of_its_values() {
    check_all(&[5], 3, 7, Hears::Words, Activation::None);
    check_all(&[4, 3], 3, 7, Hears::Words, Activation::None);
}

#[test]
fn a_decoder_of_known_inputs_has_the_gradients_of_its_values() {
    check_all(&[4, 3, 5], 2, 3, Hears::Known, Activation::Tanh);
    check_all(&[6], 5, 4, Hears::Known, Activation::None);
    // So few features that they are heard step by step.
    check_all(&[9, 4], 2, 3, Hears::Known, Activation::Tanh);
}
