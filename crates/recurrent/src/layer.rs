//! One layer: its packed weights, what it remembers of a batch, and the steps through it in both directions.

use std::ops::Range;

use rayon::prelude::*;

use crate::kernel::{Ahead, Operand, Step, StepBack};
use crate::lanes::Number;
use crate::multiply::multiply_all;
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;
use crate::weights::{LayerWeights, Packed, pack_gates, pack_gates_transposed};

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
pub(crate) fn following<T: Number>(packed: &Packed<T>, panel: usize) -> &[T] {
    packed.get(panel + 1).unwrap_or(&[])
}

/// Runs on a thread of the pool, where sharing a step costs no more than waking a neighbour.
pub(crate) fn in_pool<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    rayon::scope(|_| work())
}

/// Weights of a layer packed for steps forward.
#[derive(Debug)]
pub(crate) struct Forward<T: Number> {
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
pub(crate) struct Backward<T: Number> {
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
pub(crate) enum Hears<'a, T: Number> {
    /// Rows of a matrix.
    Rows { left: &'a Panels<T>, first_row: usize },
    /// The gates already hold the input's share and the bias.
    Gates,
}

/// All a layer remembers of a batch. Cells and hidden states begin with the initial ones, one row for each sequence.
#[derive(Debug, Clone)]
pub(crate) struct History<T: Number> {
    /// Activated gates; gradients before the activations after the way back. `[frame, gate of unit]`, wide panels of units.
    pub(crate) gates: Panels<T>,
    pub(crate) cells: Panels<T>,
    pub(crate) hidden: Panels<T>,
    /// Hidden states of the latest step and room for the next, `[batch, hidden]`.
    pub(crate) latest: Panels<T>,
    next: Panels<T>,
    pub(crate) hidden_units: usize,
}

impl<T: Number> History<T> {
    pub(crate) fn new(plan: &Plan, initial: Option<(&[T], &[T])>, hidden: usize, lanes: usize) -> Self {
        let (batch, frames) = (plan.batch(), plan.num_frames());
        let mut cells = Panels::unset(batch, batch + frames, hidden, lanes);
        let mut states = Panels::unset(batch, batch + frames, hidden, lanes);
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
        let gates = Panels::unset(0, frames, hidden.div_ceil(lanes) * WIDE * lanes, WIDE * lanes);
        let next = latest.clone();
        Self { gates, cells, hidden: states, latest, next, hidden_units: hidden }
    }

    /// From a panel to the next; cells and hidden states have the same shape.
    fn ahead(&self) -> Ahead {
        Ahead { gates: self.gates.panels.stride(), states: self.cells.panels.stride() }
    }

    /// Goes through neighbouring steps whose inputs are known beforehand: frame 0's stand in `first_row`.
    pub(crate) fn steps(
        &mut self,
        plan: &Plan,
        weights: &Forward<T>,
        steps: &Range<usize>,
        input: &Panels<T>,
        first_row: usize,
    ) {
        // A product of few features costs less than the way of the gates to memory and back.
        let few = WIDE * weights.feature <= weights.hidden;
        if !few {
            let frames = plan.frames_of(steps);
            let (packed, bias, first_row) = (&weights.input, Some(&weights.bias), first_row + frames.start);
            multiply_all(plan.instructions, input, first_row, packed, bias, &mut self.gates, frames);
        }
        for step in steps.clone() {
            let first_row = first_row + plan.frames(step).start;
            let heard = if few { Hears::Rows { left: input, first_row } } else { Hears::Gates };
            self.step(plan, weights, step, &heard);
        }
    }

    pub(crate) fn step(&mut self, plan: &Plan, weights: &Forward<T>, step: usize, input: &Hears<'_, T>) {
        let frames = plan.frames(step);
        let rows = frames.len();
        let before = plan.before(step);
        let lanes = self.hidden.width;
        let latest = &self.latest;
        let ahead = self.ahead();
        let depth = weights.hidden + if matches!(input, Hears::Gates) { 0 } else { weights.feature };
        let min = share(latest.panels.len(), rows * depth * WIDE * weights.hidden);
        self.gates
            .panels
            .par_iter_mut()
            .zip(self.cells.panels.par_iter_mut())
            .zip(self.hidden.panels.par_iter_mut())
            .zip(self.next.panels.par_iter_mut())
            .enumerate()
            .with_min_len(min)
            .for_each(|(panel, (((gates, cells), hidden), next))| {
                let (bias, input) = match *input {
                    Hears::Rows { left, first_row } => {
                        let next = following(&weights.input, panel);
                        let operand = Operand::new(left, first_row, &weights.input[panel], next);
                        (Some(&weights.bias[panel][..]), Some(operand))
                    }
                    Hears::Gates => (None, None),
                };
                let row = plan.batch() + frames.start - before;
                let kernel = Step {
                    bias,
                    input,
                    recurrent: Operand::new(
                        latest,
                        0,
                        &weights.recurrent[panel],
                        following(&weights.recurrent, panel),
                    ),
                    rows,
                    gates: &mut gates[frames.start * WIDE * lanes..frames.end * WIDE * lanes],
                    cells: &mut cells[before * lanes..][..(row + rows) * lanes],
                    row,
                    hidden: &mut hidden[(plan.batch() + frames.start) * lanes..][..rows * lanes],
                    next: &mut next[..rows * lanes],
                    ahead,
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
        let before = plan.before(step);
        let lanes = self.hidden.width;
        let min = share(self.cells.panels.len(), rows * self.hidden_units * 16);
        let cells = &self.cells.panels;
        let ahead = self.ahead();
        let hidden = &gradient.hidden.panels;
        self.gates
            .panels
            .par_iter_mut()
            .zip(gradient.cell.panels.par_iter_mut())
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
                    ahead,
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

/// Gradient of a layer's states, `[batch, hidden]` each: of those after the last frame at first, of the initial ones at last.
#[derive(Debug)]
pub(crate) struct StateGradient<T: Number> {
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
