//! A step of a layer through time, forward and back.

use super::product::{add_operand, add_product};
use super::{Operand, block_rows, fetches_two, load, num_blocks, store};
use crate::fetch::fetch_near;
use crate::lanes::{Kernel, Lanes, Number};
use crate::panels::WIDE;

/// Numbers between equal rows of neighbouring panels: a thread at one panel asks for the next one's rows, which no cache holds.
#[derive(Clone, Copy)]
pub(crate) struct Ahead {
    pub(crate) gates: usize,
    /// Cells and hidden states.
    pub(crate) states: usize,
}

impl Ahead {
    #[inline(always)]
    fn fetch_gates<T: Number, S: Lanes<T>>(self, gates: &[S::V]) {
        let next = gates.as_ptr().cast::<T>().wrapping_add(self.gates);
        for v in 0..WIDE {
            fetch_near(next.wrapping_add(v * S::LANES));
        }
    }

    #[inline(always)]
    fn fetch_states<T: Number, S: Lanes<T>>(self, states: &S::V) {
        fetch_near(std::ptr::from_ref(states).cast::<T>().wrapping_add(self.states));
    }
}

/// One step of a layer for one panel of units: gates, cells and hidden states of the first `rows` rows.
pub(crate) struct Step<'a, T: Number> {
    /// `[4 vectors]`, or none where the gates already hold what does not depend on the step before.
    pub(crate) bias: Option<&'a [T]>,
    /// What the layer hears now, unless the gates hold its share.
    pub(crate) input: Option<Operand<'a, T>>,
    /// Hidden states of the step before.
    pub(crate) recurrent: Operand<'a, T>,
    pub(crate) rows: usize,
    /// Frames of this step, `[row, 4 vectors]`; activated gates i, f, g, o afterwards.
    pub(crate) gates: &'a mut [T],
    /// Cells from those of the step before (at 0) on; this step's begin at `row`.
    pub(crate) cells: &'a mut [T],
    pub(crate) row: usize,
    /// Hidden states of this step, as history and for the next step.
    pub(crate) hidden: &'a mut [T],
    pub(crate) next: &'a mut [T],
    pub(crate) ahead: Ahead,
}

impl<T: Number> Step<'_, T> {
    /// The gates before their activations; asks for so many lines of the next weights at every turn of a block.
    #[inline(always)]
    fn sum<S: Lanes<T>, const LINES: usize>(&mut self, s: S) {
        let gates = S::vectors_mut(self.gates);
        blocks!(S, T, self.rows, |row, M| {
            let (gates, rest) = gates[row * WIDE..].split_at_mut(M * WIDE);
            if self.bias.is_none() {
                // What the next block begins with.
                rest.iter().take(M * WIDE).for_each(|next| fetch_near(next));
            }
            let mut sums = match self.bias {
                Some(bias) => [std::array::from_fn(|v| S::vectors(bias)[v]); M],
                None => load(gates),
            };
            if let Some(input) = self.input {
                sums = add_operand::<T, S, M, LINES>(s, sums, input, row);
            }
            sums = add_product::<T, S, M, 1, LINES>(s, sums, self.recurrent, row);
            store(&sums, gates);
        });
    }
}

impl<T: Number> Kernel<T> for Step<'_, T> {
    #[inline(always)]
    fn run<S: Lanes<T>>(mut self, s: S) {
        if fetches_two(self.rows, S::REGISTERS) {
            self.sum::<S, 2>(s);
        } else {
            self.sum::<S, 1>(s);
        }
        let gates = S::vectors_mut(self.gates);
        let (previous, cells) = S::vectors_mut(self.cells).split_at_mut(self.row);
        let (hidden, next) = (S::vectors_mut(self.hidden), S::vectors_mut(self.next));
        let states = hidden.iter_mut().zip(next).zip(cells.iter_mut().zip(previous));
        for (gates, ((hidden, next), (cell, previous))) in gates.chunks_exact_mut(WIDE).zip(states) {
            self.ahead.fetch_gates::<T, S>(gates);
            self.ahead.fetch_states::<T, S>(cell);
            self.ahead.fetch_states::<T, S>(hidden);
            let (i, f) = (s.sigmoid(gates[0]), s.sigmoid(gates[1]));
            let (g, o) = (s.tanh(gates[2]), s.sigmoid(gates[3]));
            *cell = s.mul_add(f, *previous, s.mul(i, g));
            *hidden = s.mul(o, s.tanh(*cell));
            *next = *hidden;
            gates.copy_from_slice(&[i, f, g, o]);
        }
    }
}

/// The gradient through the activations of one step, for one panel of units.
pub(crate) struct StepBack<'a, T> {
    pub(crate) rows: usize,
    /// Activated gates of this step; gradients before the activations afterwards.
    pub(crate) gates: &'a mut [T],
    /// Cells from those of the step before (at 0) on; this step's begin at `row`.
    pub(crate) cells: &'a [T],
    pub(crate) row: usize,
    /// Gradient of this step's hidden states from above, if any.
    pub(crate) above: Option<&'a [T]>,
    /// Gradient of this step's hidden states from the step after.
    pub(crate) hidden: &'a [T],
    /// Gradient of this step's cells from the step after; of the step before afterwards.
    pub(crate) cell: &'a mut [T],
    pub(crate) ahead: Ahead,
}

impl<T: Number> Kernel<T> for StepBack<'_, T> {
    #[inline(always)]
    fn run<S: Lanes<T>>(self, s: S) {
        let one = s.splat(T::ONE);
        let cells = S::vectors(self.cells);
        let (previous, cells) = (&cells[..self.rows], &cells[self.row..][..self.rows]);
        let above = self.above.map(|above| &S::vectors(above)[..self.rows]);
        let hidden = &S::vectors(self.hidden)[..self.rows];
        let cell = &mut S::vectors_mut(self.cell)[..self.rows];
        for (row, gates) in S::vectors_mut(self.gates).chunks_exact_mut(WIDE).take(self.rows).enumerate() {
            self.ahead.fetch_gates::<T, S>(gates);
            self.ahead.fetch_states::<T, S>(&cells[row]);
            self.ahead.fetch_states::<T, S>(&previous[row]);
            let (i, f, g, o) = (gates[0], gates[1], gates[2], gates[3]);
            let tanh = s.tanh(cells[row]);
            let d_hidden = above.map_or(hidden[row], |above| s.add(above[row], hidden[row]));
            let d_tanh = s.mul(d_hidden, o);
            let d_cell = s.add(s.mul(d_tanh, s.sub(one, s.mul(tanh, tanh))), cell[row]);
            let gradients = [
                s.mul(s.mul(d_cell, g), s.mul(i, s.sub(one, i))),
                s.mul(s.mul(d_cell, previous[row]), s.mul(f, s.sub(one, f))),
                s.mul(s.mul(d_cell, i), s.sub(one, s.mul(g, g))),
                s.mul(s.mul(d_hidden, tanh), s.mul(o, s.sub(one, o))),
            ];
            for (gate, gradient) in gates.iter_mut().zip(gradients) {
                *gate = s.without_least(gradient);
            }
            cell[row] = s.without_least(s.mul(d_cell, f));
        }
    }
}
