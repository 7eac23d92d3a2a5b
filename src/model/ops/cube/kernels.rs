//! What a step does to each number, on the way forward and back.

use burn_cubecl::cubecl;
use cubecl::prelude::*;

#[cube]
fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

/// One thread for each unit of each row; `known` if the gates hold the share of inputs and bias already.
#[cube(launch)]
pub(super) fn cell_kernel(
    input: &Tensor<f32>,
    bias: &Tensor<f32>,
    recurrent: &Tensor<f32>,
    gates: &mut Tensor<f32>,
    cells: &mut Tensor<f32>,
    hidden: &mut Tensor<f32>,
    latest: &mut Tensor<f32>,
    frame: usize,
    before: usize,
    after: usize,
    #[comptime] known: bool,
) {
    if ABSOLUTE_POS < latest.len() {
        let units = latest.shape(1);
        let (row, unit) = (ABSOLUTE_POS / units, ABSOLUTE_POS % units);
        let at = row * 4 * units + unit;
        let to = at + frame * 4 * units;
        let (second, third, fourth) = (units, 2 * units, 3 * units);
        if !known {
            gates[to] = input[at] + bias[unit];
            gates[to + second] = input[at + second] + bias[unit + second];
            gates[to + third] = input[at + third] + bias[unit + third];
            gates[to + fourth] = input[at + fourth] + bias[unit + fourth];
        }
        let i = sigmoid(gates[to] + recurrent[at]);
        let f = sigmoid(gates[to + second] + recurrent[at + second]);
        let g = (gates[to + third] + recurrent[at + third]).tanh();
        let o = sigmoid(gates[to + fourth] + recurrent[at + fourth]);
        let c = f * cells[ABSOLUTE_POS + before * units] + i * g;
        let h = o * c.tanh();
        gates[to] = i;
        gates[to + second] = f;
        gates[to + third] = g;
        gates[to + fourth] = o;
        cells[ABSOLUTE_POS + after * units] = c;
        hidden[ABSOLUTE_POS + after * units] = h;
        latest[ABSOLUTE_POS] = h;
    }
}

/// The way back through [`cell_kernel`].
///
/// Gradients of hidden states come from the step after for the first `later_rows`, from `last` for the others if `has_last`, and
/// from `above` if `has_above`.
#[cube(launch)]
pub(super) fn cell_back_kernel(
    gates: &Tensor<f32>,
    cells: &Tensor<f32>,
    later: &Tensor<f32>,
    last: &Tensor<f32>,
    above: &Tensor<f32>,
    d_cells: &mut Tensor<f32>,
    d_gates: &mut Tensor<f32>,
    own: &mut Tensor<f32>,
    frame: usize,
    before: usize,
    after: usize,
    later_rows: usize,
    above_row: usize,
    #[comptime] has_last: bool,
    #[comptime] has_above: bool,
) {
    let units = d_cells.shape(1);
    if ABSOLUTE_POS * 4 < own.len() {
        let (row, unit) = (ABSOLUTE_POS / units, ABSOLUTE_POS % units);
        let at = row * 4 * units + unit;
        let to = at + frame * 4 * units;
        let i = gates[to];
        let f = gates[to + units];
        let g = gates[to + 2 * units];
        let o = gates[to + 3 * units];
        let c = cells[ABSOLUTE_POS + after * units].tanh();
        let mut d = 0.0f32;
        if row < later_rows {
            d += later[ABSOLUTE_POS];
        } else if has_last {
            d += last[ABSOLUTE_POS];
        }
        if has_above {
            d += above[ABSOLUTE_POS + above_row * units];
        }
        let d_c = d * o * (1.0 - c * c) + d_cells[ABSOLUTE_POS];
        let d_i = d_c * g * i * (1.0 - i);
        let d_f = d_c * cells[ABSOLUTE_POS + before * units] * f * (1.0 - f);
        let d_g = d_c * i * (1.0 - g * g);
        let d_o = d * c * o * (1.0 - o);
        d_gates[to] = d_i;
        d_gates[to + units] = d_f;
        d_gates[to + 2 * units] = d_g;
        d_gates[to + 3 * units] = d_o;
        own[at] = d_i;
        own[at + units] = d_f;
        own[at + 2 * units] = d_g;
        own[at + 3 * units] = d_o;
        d_cells[ABSOLUTE_POS] = d_c * f;
    }
}

/// One thread for each output of each row.
#[cube(launch)]
pub(super) fn say_kernel(
    projected: &Tensor<f32>,
    bias: &Tensor<f32>,
    outputs: &mut Tensor<f32>,
    own: &mut Tensor<f32>,
    frame: usize,
    #[comptime] activated: bool,
) {
    if ABSOLUTE_POS < own.len() {
        let columns = own.shape(1);
        let mut said = projected[ABSOLUTE_POS] + bias[ABSOLUTE_POS % columns];
        if activated {
            said = said.tanh();
        }
        outputs[ABSOLUTE_POS + frame * columns] = said;
        own[ABSOLUTE_POS] = said;
    }
}

/// The way back through [`say_kernel`] and its tanh.
#[cube(launch)]
pub(super) fn say_back_kernel(
    d_outputs: &Tensor<f32>,
    outputs: &Tensor<f32>,
    d_heard: &Tensor<f32>,
    d_projected: &mut Tensor<f32>,
    own: &mut Tensor<f32>,
    frame: usize,
    heard_rows: usize,
) {
    if ABSOLUTE_POS < own.len() {
        let columns = own.shape(1);
        let to = ABSOLUTE_POS + frame * columns;
        let mut d = d_outputs[to];
        if ABSOLUTE_POS < heard_rows * columns {
            d += d_heard[ABSOLUTE_POS];
        }
        d *= 1.0 - outputs[to] * outputs[to];
        d_projected[to] = d;
        own[ABSOLUTE_POS] = d;
    }
}
