//! The inner loops: blocks of a few rows by four vectors, held in registers.
//!
//! Every sum runs over its terms in one fixed order, whatever rows are computed with it, so that results depend neither on the
//! number of threads nor on the rest of the batch.

use crate::lanes::{Kernel, Lanes, Number};
use crate::memory::LINE;
use crate::panels::{Panels, WIDE};

/// Four vectors for each of `M` rows.
type Block<V, const M: usize> = [[V; WIDE]; M];

/// The most rows in a block.
const M_MAX: usize = 6;

/// One factor of a product: rows of a matrix, and the packed weights they meet.
#[derive(Clone, Copy)]
pub(crate) struct Operand<'a, T: Number> {
    pub(crate) left: &'a Panels<T>,
    pub(crate) first_row: usize,
    /// `[left column, 4 vectors]`, without the padding of the last panel.
    pub(crate) weights: &'a [T],
    /// Weights that this thread is likely to need next, as many as `weights`.
    pub(crate) next: &'a [T],
}

/// Asks for the line of memory at `number`, up to the second cache.
#[inline(always)]
#[expect(unsafe_code, reason = "there is no other way to name memory that is needed soon")]
fn fetch<T>(number: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a hint, which reads nothing and cannot fault whatever the address.
    unsafe {
        std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T1 }>(number.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = number;
}

/// Rows in a block: as many as registers hold beside the weights.
const fn block_rows(registers: usize) -> usize {
    if registers >= 32 { M_MAX } else { 2 }
}

/// How many blocks rows fall into.
fn num_blocks(rows: usize, registers: usize) -> usize {
    rows.div_ceil(block_rows(registers))
}

/// Calls `$body` with `$m` the number of rows of each block, blocks as even as they can be.
macro_rules! blocks {
    ($s:ty, $t:ty, $rows:expr, |$row:ident, $m:ident| $body:expr) => {{
        let largest = block_rows(<$s as Lanes<$t>>::REGISTERS);
        let rows: usize = $rows;
        let count = num_blocks(rows, <$s as Lanes<$t>>::REGISTERS);
        let mut $row = 0;
        for block in 0..count {
            let size = rows / count + usize::from(block < rows % count);
            match size {
                1 => {
                    const $m: usize = 1;
                    $body
                }
                2 => {
                    const $m: usize = 2;
                    $body
                }
                3 if largest > 2 => {
                    const $m: usize = 3;
                    $body
                }
                4 if largest > 2 => {
                    const $m: usize = 4;
                    $body
                }
                5 if largest > 2 => {
                    const $m: usize = 5;
                    $body
                }
                _ if largest > 2 => {
                    const $m: usize = 6;
                    $body
                }
                _ => {}
            }
            $row += size;
        }
    }};
}

// A block lives in registers only if every place in it is named by a constant: these loops are short enough to be unrolled.

#[inline(always)]
fn load<V: Copy, const M: usize>(from: &[V]) -> Block<V, M> {
    let from = &from[..M * WIDE];
    let mut block = [[from[0]; WIDE]; M];
    for m in 0..M {
        for v in 0..WIDE {
            block[m][v] = from[m * WIDE + v];
        }
    }
    block
}

#[inline(always)]
fn store<V: Copy, const M: usize>(block: &Block<V, M>, to: &mut [V]) {
    let to = &mut to[..M * WIDE];
    for m in 0..M {
        for v in 0..WIDE {
            to[m * WIDE + v] = block[m][v];
        }
    }
}

/// Adds the product of `M` rows of `left` (panels of `WIDTH` vectors) with the weights.
#[inline(always)]
fn add_product<T: Number, S: Lanes<T>, const M: usize, const WIDTH: usize, const LINES: usize>(
    s: S,
    mut sums: Block<S::V, M>,
    operand: Operand<'_, T>,
    row: usize,
) -> Block<S::V, M> {
    let width = WIDTH * S::LANES;
    let line = LINE / size_of::<T>();
    // A block asks for so many lines of the next weights at every turn, until all are on their way.
    let block = row / M;
    let (mut next, step) = match operand.next.get(operand.next.len() / WIDE * LINES * block..) {
        Some(next) if LINES * block < WIDE => (next.as_ptr(), LINES * line),
        _ => (operand.weights.as_ptr(), 0),
    };
    let weights = S::vectors(operand.weights);
    // Plain slices: an iterator over panels is a call that the compiler does not always put in place, and around a call it
    // stores all sums.
    let (numbers, stride) = operand.left.panels.numbers();
    let mut at = (operand.first_row + row) * width;
    for weights in weights.chunks(WIDE * width) {
        let left = &numbers[at..][..M * width];
        at += stride;
        // Bounded by a constant on one side and by the iterator on the other, the loop needs no checks; with any, the
        // compiler would store all sums at every turn.
        for (k, weights) in (0..width).zip(weights.chunks_exact(WIDE)) {
            for ahead in 0..LINES {
                fetch(next.wrapping_add(ahead * line));
            }
            next = next.wrapping_add(step);
            for m in 0..M {
                let factor = s.splat(left[m * width + k]);
                for v in 0..WIDE {
                    sums[m][v] = s.mul_add(factor, weights[v], sums[m][v]);
                }
            }
        }
    }
    sums
}

#[inline(always)]
fn add_operand<T: Number, S: Lanes<T>, const M: usize, const LINES: usize>(
    s: S,
    sums: Block<S::V, M>,
    operand: Operand<'_, T>,
    row: usize,
) -> Block<S::V, M> {
    if operand.left.width == S::LANES {
        add_product::<T, S, M, 1, LINES>(s, sums, operand, row)
    } else {
        add_product::<T, S, M, WIDE, LINES>(s, sums, operand, row)
    }
}

/// Where the sums of a product begin.
#[derive(Clone, Copy)]
pub(crate) enum Start<'a, T> {
    Zero,
    /// `[4 vectors]`, the same for all rows.
    Bias(&'a [T]),
}

/// Where a product goes.
pub(crate) enum Target<'a, 'b, T> {
    /// Rows of one wide panel.
    Wide(&'a mut [T]),
    /// The same rows of up to four narrow panels.
    Narrow(&'a mut [&'b mut [T]]),
}

/// Four vectors of columns of a product, all rows.
pub(crate) struct Product<'a, 'b, T: Number> {
    pub(crate) start: Start<'a, T>,
    pub(crate) operand: Operand<'a, T>,
    pub(crate) rows: usize,
    pub(crate) target: Target<'a, 'b, T>,
}

impl<T: Number> Product<'_, '_, T> {
    /// Asks for so many lines of the next weights at every turn of a block.
    #[inline(always)]
    fn ahead<S: Lanes<T>, const LINES: usize>(self, s: S) {
        let start: [S::V; WIDE] = match self.start {
            Start::Zero => [s.splat(T::default()); WIDE],
            Start::Bias(bias) => std::array::from_fn(|v| S::vectors(bias)[v]),
        };
        let operand = self.operand;
        match self.target {
            Target::Wide(out) => {
                let out = S::vectors_mut(out);
                blocks!(S, T, self.rows, |row, M| {
                    let sums = add_operand::<T, S, M, LINES>(s, [start; M], operand, row);
                    store(&sums, &mut out[row * WIDE..]);
                });
            }
            Target::Narrow(panels) => {
                blocks!(S, T, self.rows, |row, M| {
                    let sums = add_operand::<T, S, M, LINES>(s, [start; M], operand, row);
                    let mut block = [sums[0][0]; WIDE * M_MAX];
                    store(&sums, &mut block);
                    for (v, panel) in panels.iter_mut().enumerate() {
                        let panel = &mut S::vectors_mut(panel)[row..][..M];
                        for (out, sums) in panel.iter_mut().zip(block.chunks_exact(WIDE)) {
                            *out = sums[v];
                        }
                    }
                });
            }
        }
    }
}

impl<T: Number> Kernel<T> for Product<'_, '_, T> {
    #[inline(always)]
    fn run<S: Lanes<T>>(self, s: S) {
        if num_blocks(self.rows, S::REGISTERS) < WIDE { self.ahead::<S, 2>(s) } else { self.ahead::<S, 1>(s) }
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
}

impl<T: Number> Step<'_, T> {
    /// The gates before their activations; asks for so many lines of the next weights at every turn of a block.
    #[inline(always)]
    fn sum<S: Lanes<T>, const LINES: usize>(&mut self, s: S) {
        let gates = S::vectors_mut(self.gates);
        blocks!(S, T, self.rows, |row, M| {
            let gates = &mut gates[row * WIDE..][..M * WIDE];
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
        if num_blocks(self.rows, S::REGISTERS) < WIDE {
            self.sum::<S, 2>(s)
        } else {
            self.sum::<S, 1>(s)
        }
        let gates = S::vectors_mut(self.gates);
        let (previous, cells) = S::vectors_mut(self.cells).split_at_mut(self.row);
        let (hidden, next) = (S::vectors_mut(self.hidden), S::vectors_mut(self.next));
        let states = hidden.iter_mut().zip(next).zip(cells.iter_mut().zip(previous));
        for (gates, ((hidden, next), (cell, previous))) in gates.chunks_exact_mut(WIDE).zip(states) {
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

/// Rows of the left and of the right matrix that belong together.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    pub(crate) left: usize,
    pub(crate) right: usize,
    pub(crate) rows: usize,
}

/// Rows that are multiplied before the sums go back to memory: the right panel's then stay in the first cache.
const OUTER_ROWS: usize = 96;

/// Cuts runs into groups of at most [`OUTER_ROWS`] rows.
pub(crate) fn groups(runs: &[Run]) -> Vec<Vec<Run>> {
    let (mut groups, mut group, mut filled) = (Vec::new(), Vec::new(), 0);
    for &run in runs {
        let mut run = run;
        while run.rows > 0 {
            let rows = run.rows.min(OUTER_ROWS - filled);
            group.push(Run { rows, ..run });
            filled += rows;
            run = Run { left: run.left + rows, right: run.right + rows, rows: run.rows - rows };
            if filled == OUTER_ROWS {
                groups.push(std::mem::take(&mut group));
                filled = 0;
            }
        }
    }
    groups.push(group);
    groups
}

/// The sum over rows of left row times right row, for a few wide panels of the right; adds to what is there.
///
/// The left matrix does not fit into the second cache: the more panels meet it at once, the less often it is fetched.
pub(crate) struct Outer<'a, 'b, T: Number> {
    pub(crate) left: &'a Panels<T>,
    pub(crate) groups: &'a [Vec<Run>],
    pub(crate) rights: &'a mut [Right<'b, T>],
}

/// A wide panel of the right and what becomes of it.
pub(crate) struct Right<'a, T> {
    pub(crate) panel: &'a [T],
    /// `[left column, 4 vectors]`.
    pub(crate) sums: &'a mut [T],
    /// `[4 vectors]`: the sum of the rows alone.
    pub(crate) total: Option<&'a mut [T]>,
}

impl<T: Number> Outer<'_, '_, T> {
    #[inline(always)]
    fn columns<S: Lanes<T>, const M: usize, const WIDTH: usize>(
        s: S,
        left: &[T],
        column: usize,
        right: &[S::V],
        group: &[Run],
        next: &[T],
        sums: &mut [S::V],
    ) {
        let width = WIDTH * S::LANES;
        // Blocks of columns share the lines of a row of the next panel.
        let ahead = column / M % WIDTH * (LINE / size_of::<T>());
        let mut block: Block<S::V, M> = std::array::from_fn(|m| std::array::from_fn(|v| sums[m * WIDE + v]));
        for run in group {
            let left = left[run.left * width..][..run.rows * width].chunks_exact(width);
            let right = right[run.right * WIDE..][..run.rows * WIDE].chunks_exact(WIDE);
            let mut next = next.as_ptr().wrapping_add(run.left * width + ahead);
            for (left, right) in left.zip(right) {
                fetch(next);
                next = next.wrapping_add(width);
                let left = &left[column..column + M];
                for m in 0..M {
                    let factor = s.splat(left[m]);
                    for v in 0..WIDE {
                        block[m][v] = s.mul_add(factor, right[v], block[m][v]);
                    }
                }
            }
        }
        store(&block, sums);
    }
}

impl<T: Number> Kernel<T> for Outer<'_, '_, T> {
    #[inline(always)]
    fn run<S: Lanes<T>>(self, s: S) {
        let narrow = self.left.width == S::LANES;
        let ranges: Vec<_> = self.left.column_ranges().collect();
        for group in self.groups {
            for (index, (panel, range)) in self.left.panels.iter().zip(&ranges).enumerate() {
                let next = self.left.panels.get(index + 1).unwrap_or(panel);
                for right in &mut *self.rights {
                    let sums = &mut S::vectors_mut(right.sums)[range.start * WIDE..range.end * WIDE];
                    let right = S::vectors(right.panel);
                    blocks!(S, T, range.len(), |column, M| {
                        let sums = &mut sums[column * WIDE..][..M * WIDE];
                        if narrow {
                            Self::columns::<S, M, 1>(s, panel, column, right, group, next, sums);
                        } else {
                            Self::columns::<S, M, WIDE>(s, panel, column, right, group, next, sums);
                        }
                    });
                }
            }
        }
        for Right { panel, total, .. } in self.rights {
            let Some(total) = total else { continue };
            let (panel, total) = (S::vectors(panel), S::vectors_mut(total));
            let mut sum: [S::V; WIDE] = std::array::from_fn(|v| total[v]);
            for run in self.groups.iter().flatten() {
                for right in panel[run.right * WIDE..][..run.rows * WIDE].chunks_exact(WIDE) {
                    for v in 0..WIDE {
                        sum[v] = s.add(sum[v], right[v]);
                    }
                }
            }
            total.copy_from_slice(&sum);
        }
    }
}
