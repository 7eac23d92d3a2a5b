//! Values and gradients against those of `PyTorch` in double precision, `tests/golden/recurrent.json` of the workspace.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use rprae_recurrent::{
    Activation, Decoder, Direction, Hearing, Instructions, LayerWeights, Plan, Projection, Sequence, State,
    Unrolled,
};
use serde_json::Value;

/// The inputs of the golden program: `sin((place + 1) * (seed + 0.5)) * scale`.
fn numbers(seed: usize, count: usize, scale: f64) -> Vec<f64> {
    (1..=count).map(|place| (place as f64 * (seed as f64 + 0.5)).sin() * scale).collect()
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn sizes(value: &Value) -> Vec<usize> {
    value.as_array().unwrap().iter().map(|number| number.as_u64().unwrap() as usize).collect()
}

fn assert_close(what: &str, got: &[f64], want: &Value) {
    let want = floats(want);
    assert_eq!(got.len(), want.len(), "{what}");
    for (place, (got, want)) in got.iter().zip(want).enumerate() {
        assert!((got - want).abs() < 1e-11, "{what}[{place}] is {got}, PyTorch has {want}");
    }
}

struct Layer {
    input: Vec<f64>,
    recurrent: Vec<f64>,
    bias: Vec<f64>,
}

impl Layer {
    fn new(seed: usize, feature: usize, hidden: usize) -> Self {
        Self {
            input: numbers(seed, feature * 4 * hidden, 0.6),
            recurrent: numbers(seed + 1, hidden * 4 * hidden, 0.6),
            bias: numbers(seed + 2, 4 * hidden, 0.6),
        }
    }

    fn weights(&self) -> LayerWeights<'_, f64> {
        LayerWeights { input: &self.input, recurrent: &self.recurrent, bias: &self.bias }
    }
}

fn sequence(case: &Value) {
    let (lengths, hidden) = (sizes(&case["lengths"]), sizes(&case["hidden"])[0]);
    let width = case["width"].as_u64().unwrap() as usize;
    let feature = case["feature"].as_u64().unwrap() as usize;
    let batch = lengths.len();
    let direction = if case["direction"] == "forward" { Direction::Forward } else { Direction::Backward };
    let plan = Plan::new(&lengths, width, direction, Instructions::best());
    let layer = Layer::new(4, feature, hidden);
    let (h, c) = (numbers(2, batch * hidden, 0.5), numbers(3, batch * hidden, 0.5));
    let input = numbers(1, batch * width * feature, 1.0);
    let way = Sequence::<f64>::forward(plan, &input, Some((&h, &c)), &layer.weights());
    let last = way.last();
    assert_close("output", &way.output(), &case["output"]);
    assert_close("last hidden", &last.hidden, &case["last hidden"]);
    assert_close("last cell", &last.cell, &case["last cell"]);
    let d_last = State { hidden: numbers(8, batch * hidden, 1.0), cell: numbers(9, batch * hidden, 1.0) };
    let d_output = numbers(7, batch * width * hidden, 1.0);
    let gradients = way.backward(&layer.weights(), Some(&d_output), Some(&d_last), true);
    let want = &case["gradients"];
    assert_close("input", &gradients.input.unwrap(), &want["input"]);
    assert_close("hidden", &gradients.initial.hidden, &want["hidden"]);
    assert_close("cell", &gradients.initial.cell, &want["cell"]);
    assert_close("input weights", &gradients.weights.input, &want["input weights"]);
    assert_close("recurrent weights", &gradients.weights.recurrent, &want["recurrent weights"]);
    assert_close("bias", &gradients.weights.bias, &want["bias"]);
}

/// The rows of `[batch, time, column]` that are no padding.
fn valid(values: &[f64], lengths: &[usize], width: usize, columns: usize) -> Vec<f64> {
    let sequences = values.chunks_exact(width * columns).zip(lengths);
    sequences.flat_map(|(sequence, &length)| sequence[..length * columns].to_vec()).collect()
}

fn closed_loop(case: &Value) {
    let (lengths, hidden) = (sizes(&case["lengths"]), sizes(&case["hidden"]));
    let [width, feature, outputs] =
        ["width", "feature", "outputs"].map(|name| case[name].as_u64().unwrap() as usize);
    let batch = lengths.len();
    let plan = Plan::new(&lengths, width, Direction::Forward, Instructions::best());
    let mut below = feature;
    let mut layers = Vec::new();
    let mut states = Vec::new();
    for (index, &units) in hidden.iter().enumerate() {
        let seed = 10 * (index + 1);
        layers.push(Layer::new(seed, below, units));
        states.push((numbers(seed + 3, batch * units, 0.5), numbers(seed + 4, batch * units, 0.5)));
        below = units;
    }
    let weights: Vec<_> = layers.iter().map(Layer::weights).collect();
    let states: Vec<_> = states.iter().map(|(hidden, cell)| (&hidden[..], &cell[..])).collect();
    let (projection, bias) = (numbers(2, below * outputs, 1.0), numbers(3, outputs, 0.3));
    let table = numbers(4, outputs * feature, 1.0);
    let words = case["kind"] == "words";
    let decoder = Decoder {
        layers: &weights,
        projection: Projection { weights: &projection, bias: &bias },
        activation: if words { Activation::None } else { Activation::Tanh },
    };
    let first = numbers(1, batch * feature, 1.0);
    let hearing = if words { Hearing::Words { first: &first, table: &table } } else { Hearing::Own(&first) };
    let way = Unrolled::<f64>::forward(plan, hearing, &states, &decoder);
    let want = valid(&floats(&case["output"]), &lengths, width, outputs);
    assert_close("output", &way.output(), &want.into());
    let d_output = valid(&numbers(7, batch * width * outputs, 1.0), &lengths, width, outputs);
    let gradients = way.backward(&decoder, &d_output, true);
    let want = &case["gradients"];
    assert_close("first", &gradients.inputs.unwrap(), &want["first"]);
    assert_close("projection", &gradients.projection, &want["projection"]);
    assert_close("projection bias", &gradients.bias, &want["projection bias"]);
    if let Some(table) = gradients.table {
        assert_close("table", &table, &want["table"]);
    }
    for (index, (layer, state)) in gradients.layers.iter().zip(&gradients.initial).enumerate() {
        for (name, got) in [
            ("input weights", &layer.input),
            ("recurrent weights", &layer.recurrent),
            ("bias", &layer.bias),
            ("hidden", &state.hidden),
            ("cell", &state.cell),
        ] {
            let name = format!("{name} {index}");
            assert_close(&name, got, &want[&name]);
        }
    }
}

#[test]
fn values_and_gradients_are_those_of_pytorch() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/recurrent.json");
    let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let cases = golden["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 10);
    for case in cases {
        if case["kind"] == "sequence" { sequence(case) } else { closed_loop(case) }
    }
}
