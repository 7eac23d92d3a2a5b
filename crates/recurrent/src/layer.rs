//! One layer: its packed weights, what it remembers of a batch, and the steps through it in both directions.

use rayon::prelude::*;

use crate::kernel::{Operand, Outer, Product, Run, Start, Step, StepBack, Target, groups};
use crate::lanes::Number;
use crate::panels::{Buffer, Panels, WIDE};
use crate::plan::Plan;
use crate::weights::{
    LayerGradients, LayerWeights, Packed, pack_gates, pack_gates_transposed, unpack_columns, unpack_gates,
};
use rprae_lanes::Instructions;

/// Hidden states and cells of a layer, `[batch, hidden]` each.
#[derive(Debug, Clone, PartialEq)]
pub struct State<T> {
    /// Hidden states.
    pub hidden: Vec<T>,
    /// Cells.
    pub cell: Vec<T>,
}

impl<T: Number> State<T> {
    pub(crate) fn zeros(batch: usize, hidden: usize) -> Self {
        Self { hidden: vec![T::default(); batch * hidden], cell: vec![T::default(); batch * hidden] }
    }
}

/// Multiplications worth sending to another thread.
const WORTH_SHARING: usize = 1 << 16;

/// Portions of a shared step for each thread: the one that is done first takes from the other.
const PORTIONS: usize = 4;

/// The fewest of `tasks` equal tasks that one thread should take.
pub(crate) fn share(tasks: usize, multiplications: usize) -> usize {
    if multiplications < WORTH_SHARING {
        tasks.max(1)
    } else {
        tasks.div_ceil(PORTIONS * rayon::current_num_threads()).max(1)
    }
}

/// The panel after this one, empty after the last.
fn following<T>(packed: &Packed<T>, panel: usize) -> &[T] {
    packed.get(panel + 1).map_or(&[], |next| &next[..])
}

/// Runs on a thread of the pool, where sharing a step costs no more than waking a neighbour.
pub(crate) fn in_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    rayon::scope(|_| work())
}

/// Weights of a layer packed for steps forward.
#[derive(Debug)]
pub(crate) struct Forward<T> {
    input: Packed<T>,
    recurrent: Packed<T>,
    bias: Packed<T>,
    feature: usize,
    hidden: usize,
}

impl<T: Number> Forward<T> {
    pub(crate) fn new(weights: &LayerWeights<'_, T>, lanes: usize) -> Self {
        weights.check();
        let hidden = weights.hidden();
        Self {
            input: pack_gates(weights.input, hidden, lanes),
            recurrent: pack_gates(weights.recurrent, hidden, lanes),
            bias: pack_gates(weights.bias, hidden, lanes),
            feature: weights.feature(),
            hidden,
        }
    }
}

/// Weights of a layer packed for steps back.
#[derive(Debug)]
pub(crate) struct Backward<T> {
    pub(crate) input: Packed<T>,
    pub(crate) recurrent: Packed<T>,
}

impl<T: Number> Backward<T> {
    pub(crate) fn new(weights: &LayerWeights<'_, T>, lanes: usize) -> Self {
        let hidden = weights.hidden();
        Self {
            input: pack_gates_transposed(weights.input, hidden, lanes),
            recurrent: pack_gates_transposed(weights.recurrent, hidden, lanes),
        }
    }
}

/// What a layer hears in one step.
pub(crate) enum Hears<'a, T> {
    /// Rows of a matrix.
    Rows { left: &'a Panels<T>, first_row: usize },
    /// The gates already hold the input's share and the bias.
    Gates,
}

/// All a layer remembers of a batch. Cells and hidden states begin with the initial ones, one row for each sequence.
#[derive(Debug, Clone)]
pub(crate) struct History<T> {
    /// Activated gates; gradients before the activations after the way back. `[frame, gate of unit]`, wide panels of units.
    pub(crate) gates: Panels<T>,
    pub(crate) cells: Panels<T>,
    pub(crate) hidden: Panels<T>,
    /// Hidden states of the latest step and room for the next, `[batch, hidden]`.
    pub(crate) latest: Panels<T>,
    next: Panels<T>,
    hidden_units: usize,
}

impl<T: Number> History<T> {
    pub(crate) fn new(plan: &Plan, initial: Option<(&[T], &[T])>, hidden: usize, lanes: usize) -> Self {
        let (batch, frames) = (plan.batch(), plan.num_frames());
        let mut cells = Panels::zeros(batch + frames, hidden, lanes);
        let mut states = Panels::zeros(batch + frames, hidden, lanes);
        let mut latest = Panels::zeros(batch, hidden, lanes);
        if let Some((hidden_states, cell_states)) = initial {
            let whole = plan.whole();
            assert_eq!(hidden_states.len(), whole * hidden, "initial hidden states of {whole} sequences");
            assert_eq!(cell_states.len(), whole * hidden, "initial cells of {whole} sequences");
            for (row, &index) in plan.order().iter().enumerate() {
                let range = index * hidden..(index + 1) * hidden;
                cells.set_row(row, &cell_states[range.clone()]);
                states.set_row(row, &hidden_states[range.clone()]);
                latest.set_row(row, &hidden_states[range]);
            }
        }
        // Gates of a panel of units fill one wide panel, also where units are missing.
        let gates = Panels::zeros(frames, hidden.div_ceil(lanes) * WIDE * lanes, WIDE * lanes);
        let next = latest.clone();
        Self { gates, cells, hidden: states, latest, next, hidden_units: hidden }
    }

    /// First row of the states before a step.
    fn before(plan: &Plan, step: usize) -> usize {
        if step == 0 { 0 } else { plan.batch() + plan.frames(step - 1).start }
    }

    /// Fills the gates with the share of inputs known beforehand: one product over all frames.
    pub(crate) fn hear(&mut self, plan: &Plan, weights: &Forward<T>, input: &Panels<T>, first_row: usize) {
        let rows = plan.num_frames();
        self.gates.panels.par_iter_mut().zip(&weights.input).zip(&weights.bias).for_each(
            |((gates, packed), bias)| {
                let operand = Operand { left: input, first_row, weights: packed, next: &[] };
                let target = Target::Wide(gates);
                T::run(plan.instructions, Product { start: Start::Bias(bias), operand, rows, target });
            },
        );
    }

    pub(crate) fn step(&mut self, plan: &Plan, weights: &Forward<T>, step: usize, input: &Hears<'_, T>) {
        let frames = plan.frames(step);
        let rows = frames.len();
        let before = Self::before(plan, step);
        let lanes = self.hidden.width;
        let latest = &self.latest;
        let depth = weights.hidden + if matches!(input, Hears::Gates) { 0 } else { weights.feature };
        let min = share(latest.panels.len(), rows * depth * WIDE * weights.hidden);
        self.gates
            .panels
            .par_iter_mut()
            .zip(&mut self.cells.panels)
            .zip(&mut self.hidden.panels)
            .zip(&mut self.next.panels)
            .enumerate()
            .with_min_len(min)
            .for_each(|(panel, (((gates, cells), hidden), next))| {
                let (bias, input) = match *input {
                    Hears::Rows { left, first_row } => {
                        let operand = Operand {
                            left,
                            first_row,
                            weights: &weights.input[panel],
                            next: following(&weights.input, panel),
                        };
                        (Some(&weights.bias[panel][..]), Some(operand))
                    }
                    Hears::Gates => (None, None),
                };
                let row = plan.batch() + frames.start - before;
                let kernel = Step {
                    bias,
                    input,
                    recurrent: Operand {
                        left: latest,
                        first_row: 0,
                        weights: &weights.recurrent[panel],
                        next: following(&weights.recurrent, panel),
                    },
                    rows,
                    gates: &mut gates[frames.start * WIDE * lanes..frames.end * WIDE * lanes],
                    cells: &mut cells[before * lanes..][..(row + rows) * lanes],
                    row,
                    hidden: &mut hidden[(plan.batch() + frames.start) * lanes..][..rows * lanes],
                    next: &mut next[..rows * lanes],
                };
                T::run(plan.instructions, kernel);
            });
        std::mem::swap(&mut self.latest, &mut self.next);
    }

    /// Through the activations of a step; the gates then hold gradients.
    pub(crate) fn step_back(
        &mut self,
        plan: &Plan,
        step: usize,
        above: Option<(&Panels<T>, usize)>,
        gradient: &mut StateGradient<T>,
    ) {
        let frames = plan.frames(step);
        let rows = frames.len();
        let before = Self::before(plan, step);
        let lanes = self.hidden.width;
        let min = share(self.cells.panels.len(), rows * self.hidden_units * 16);
        let cells = &self.cells.panels;
        let hidden = &gradient.hidden.panels;
        self.gates
            .panels
            .par_iter_mut()
            .zip(&mut gradient.cell.panels)
            .enumerate()
            .with_min_len(min)
            .for_each(|(panel, (gates, cell))| {
                let row = plan.batch() + frames.start - before;
                let kernel = StepBack {
                    rows,
                    gates: &mut gates[frames.start * WIDE * lanes..frames.end * WIDE * lanes],
                    cells: &cells[panel][before * lanes..][..(row + rows) * lanes],
                    row,
                    above: above.map(|(above, first)| &above.panels[panel][first * lanes..][..rows * lanes]),
                    hidden: &hidden[panel][..rows * lanes],
                    cell: &mut cell[..rows * lanes],
                };
                T::run(plan.instructions, kernel);
            });
    }

    /// Writes hidden states and cells after the last frame of each sequence, in the caller's order.
    pub(crate) fn last_state(&self, plan: &Plan, state: &mut State<T>) {
        let hidden = self.hidden_units;
        for ((row, &index), last) in plan.order().iter().enumerate().zip(plan.last_frames()) {
            let from = last.map_or(row, |frame| plan.batch() + frame);
            let range = index * hidden..(index + 1) * hidden;
            self.hidden.get_row(from, &mut state.hidden[range.clone()]);
            self.cells.get_row(from, &mut state.cell[range]);
        }
    }
}

/// A layer's way through a part of a batch, once its gates hold gradients.
pub(crate) struct Gone<'a, T> {
    pub(crate) plan: &'a Plan,
    pub(crate) history: &'a History<T>,
    /// What was heard, frame 0 at `first_row`.
    pub(crate) input: &'a Panels<T>,
    pub(crate) first_row: usize,
}

/// Gradients of a layer's weights: sums over all frames, part after part.
pub(crate) fn weight_gradients<T: Number>(
    instructions: Instructions,
    parts: &[Gone<'_, T>],
) -> LayerGradients<T> {
    let lanes = T::lanes(instructions);
    let hidden = parts.first().map_or(0, |part| part.history.hidden_units);
    let mut bias = Panels::<T>::zeros(1, hidden.div_ceil(lanes) * WIDE * lanes, WIDE * lanes).panels;
    let heard: Vec<Factors<'_, T>> = parts
        .iter()
        .map(|part| {
            let run = Run { left: part.first_row, right: 0, rows: part.plan.num_frames() };
            Factors { left: part.input, right: &part.history.gates, runs: vec![run] }
        })
        .collect();
    let input = outer(instructions, &heard, Some(&mut bias));
    let before: Vec<Factors<'_, T>> = parts
        .iter()
        .map(|part| {
            let mut runs: Vec<Run> = Vec::new();
            for step in 0..part.plan.num_steps() {
                let (left, frames) = (History::<T>::before(part.plan, step), part.plan.frames(step));
                match runs.last_mut() {
                    Some(run) if run.left + run.rows == left => run.rows += frames.len(),
                    _ => runs.push(Run { left, right: frames.start, rows: frames.len() }),
                }
            }
            Factors { left: &part.history.hidden, right: &part.history.gates, runs }
        })
        .collect();
    let recurrent = outer(instructions, &before, None);
    LayerGradients {
        input: unpack_gates(&input, hidden, lanes),
        recurrent: unpack_gates(&recurrent, hidden, lanes),
        bias: unpack_gates(&bias, hidden, lanes),
    }
}

/// Two matrices and the rows of theirs that belong together.
pub(crate) struct Factors<'a, T> {
    pub(crate) left: &'a Panels<T>,
    pub(crate) right: &'a Panels<T>,
    pub(crate) runs: Vec<Run>,
}

/// The sum over rows of left row times right row, one buffer for each wide panel of the right.
fn outer<T: Number>(
    instructions: Instructions,
    factors: &[Factors<'_, T>],
    right_sums: Option<&mut Packed<T>>,
) -> Packed<T> {
    let groups: Vec<Vec<Vec<Run>>> = factors.iter().map(|factors| groups(&factors.runs)).collect();
    let Some(Factors { left, right, .. }) = factors.first() else { return Vec::new() };
    let mut sums: Packed<T> =
        right.panels.iter().map(|_| Buffer::zeros(left.columns * right.width)).collect();
    let mut right_sums: Vec<Option<&mut Buffer<T>>> = match right_sums {
        Some(right_sums) => right_sums.iter_mut().map(Some).collect(),
        None => right.panels.iter().map(|_| None).collect(),
    };
    sums.par_iter_mut().zip(&mut right_sums).enumerate().for_each(|(panel, (sums, right_sum))| {
        for (factors, groups) in factors.iter().zip(&groups) {
            let right_sum = right_sum.as_deref_mut().map(|sum| &mut sum[..]);
            let right = &factors.right.panels[panel];
            T::run(instructions, Outer { left: factors.left, right, groups, sums, right_sum });
        }
    });
    sums
}

/// The outer product in the caller's order, `[left column, right column]`, and the sum of the right rows.
pub(crate) fn plain_outer<T: Number>(
    instructions: Instructions,
    factors: &[Factors<'_, T>],
) -> (Vec<T>, Vec<T>) {
    let (columns, width) =
        factors.first().map_or((0, 1), |factors| (factors.right.columns, factors.right.width));
    let mut sum = Panels::zeros(1, columns, width);
    let product = outer(instructions, factors, Some(&mut sum.panels));
    let mut total = vec![T::default(); columns];
    sum.get_row(0, &mut total);
    (unpack_columns(&product, columns, width / WIDE), total)
}

/// Gradient of a layer's states, `[batch, hidden]` each: of those after the last frame at first, of the initial ones at last.
#[derive(Debug)]
pub(crate) struct StateGradient<T> {
    pub(crate) hidden: Panels<T>,
    pub(crate) cell: Panels<T>,
}

impl<T: Number> StateGradient<T> {
    pub(crate) fn new(plan: &Plan, last: Option<&State<T>>, hidden: usize, lanes: usize) -> Self {
        let gather = |values: Option<&Vec<T>>| match values {
            Some(values) => plan.gather_rows(values, hidden, lanes),
            None => Panels::zeros(plan.batch(), hidden, lanes),
        };
        Self { hidden: gather(last.map(|last| &last.hidden)), cell: gather(last.map(|last| &last.cell)) }
    }

    pub(crate) fn write(&self, plan: &Plan, state: &mut State<T>) {
        plan.scatter_rows(&self.hidden, &mut state.hidden);
        plan.scatter_rows(&self.cell, &mut state.cell);
    }
}

/// Rows of a product and the packed weights behind it.
pub(crate) struct Destination<'a, T> {
    pub(crate) panels: &'a mut Panels<T>,
    pub(crate) first_row: usize,
    pub(crate) packed: &'a Packed<T>,
    /// Packed like a row of weights, if there is one.
    pub(crate) bias: Option<&'a Packed<T>>,
}

/// One task of [`multiply`].
struct Piece<'a, T> {
    target: Vec<&'a mut [T]>,
    weights: &'a [T],
    next: &'a [T],
    bias: Option<&'a [T]>,
}

/// Products of the same rows with several packed matrices, side by side.
pub(crate) fn multiply<T: Number>(
    instructions: Instructions,
    left: &Panels<T>,
    first_row: usize,
    rows: usize,
    destinations: Vec<Destination<'_, T>>,
) {
    let lanes = T::lanes(instructions);
    let mut pieces = Vec::new();
    for Destination { panels, first_row, packed, bias } in destinations {
        let width = panels.width;
        let together = WIDE * lanes / width;
        for (index, (panels, weights)) in panels.panels.chunks_mut(together).zip(packed).enumerate() {
            let target =
                panels.iter_mut().map(|panel| &mut panel[first_row * width..][..rows * width]).collect();
            pieces.push(Piece {
                target,
                weights,
                next: following(packed, index),
                bias: bias.map(|bias| &bias[index][..]),
            });
        }
    }
    let min = share(pieces.len(), pieces.len() * rows * left.columns * WIDE * lanes);
    pieces.par_iter_mut().with_min_len(min).for_each(|piece| {
        let start = piece.bias.map_or(Start::Zero, Start::Bias);
        let operand = Operand { left, first_row, weights: piece.weights, next: piece.next };
        let target = match &mut piece.target[..] {
            [wide] if wide.len() == rows * WIDE * lanes => Target::Wide(wide),
            narrow => Target::Narrow(narrow),
        };
        T::run(instructions, Product { start, operand, rows, target });
    });
}

/// [`multiply`] for many rows at once: cut into pieces of rows too, so that one panel keeps all threads busy.
pub(crate) fn multiply_all<T: Number>(
    instructions: Instructions,
    left: &Panels<T>,
    first_row: usize,
    rows: usize,
    packed: &Packed<T>,
    columns: usize,
    width: usize,
) -> Panels<T> {
    const ROWS: usize = 120;
    let lanes = T::lanes(instructions);
    let mut product = Panels::zeros(rows, columns, width);
    let together = WIDE * lanes / width;
    product.panels.par_chunks_mut(together).zip(packed).for_each(|(panels, weights)| {
        let mut chunks: Vec<Vec<&mut [T]>> = (0..rows.div_ceil(ROWS)).map(|_| Vec::new()).collect();
        for panel in panels {
            for (chunk, part) in chunks.iter_mut().zip(panel.chunks_mut(ROWS * width)) {
                chunk.push(part);
            }
        }
        chunks.par_iter_mut().enumerate().for_each(|(index, parts)| {
            let rows = ROWS.min(rows - index * ROWS);
            let operand = Operand { left, first_row: first_row + index * ROWS, weights, next: &[] };
            let target = match &mut parts[..] {
                [wide] if width == WIDE * lanes => Target::Wide(wide),
                narrow => Target::Narrow(narrow),
            };
            T::run(instructions, Product { start: Start::Zero, operand, rows, target });
        });
    });
    product
}
