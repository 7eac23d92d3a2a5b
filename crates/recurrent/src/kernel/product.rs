//! Products of rows with packed weights.

use super::{Block, M_MAX, block_rows, fetches_two, load, num_blocks, store};
use crate::fetch::fetch;
use crate::lanes::{Kernel, Lanes, Number};
use crate::memory::LINE;
use crate::panels::{Panels, WIDE};

/// One factor of a product: rows of a matrix, and the packed weights they meet.
#[derive(Clone, Copy)]
pub(crate) struct Operand<'a, T: Number> {
    pub(crate) left: &'a Panels<T>,
    pub(crate) first_row: usize,
    /// The panel of `left` that meets the first weights.
    first_panel: usize,
    /// `[left column, 4 vectors]`, without the padding of the last panel.
    pub(crate) weights: &'a [T],
    /// Weights that this thread is likely to need next, as many as `weights`.
    pub(crate) next: &'a [T],
}

/// Columns of the left factor that all rows meet before the next: their weights stay in the second cache meanwhile.
const DEPTH: usize = 512;

impl<'a, T: Number> Operand<'a, T> {
    pub(crate) fn new(left: &'a Panels<T>, first_row: usize, weights: &'a [T], next: &'a [T]) -> Self {
        Self { left, first_row, first_panel: 0, weights, next }
    }

    /// The product in pieces of [`DEPTH`] columns, to be added up.
    #[inline(always)]
    fn pieces<S: Lanes<T>>(self) -> impl Iterator<Item = Self> {
        let panels = DEPTH / self.left.width;
        let length = panels * self.left.width * WIDE * S::LANES;
        (0..self.weights.len().div_ceil(length).max(1)).map(move |piece| {
            let weights = &self.weights[piece * length..];
            let (weights, rest) = weights.split_at(length.min(weights.len()));
            let next = if rest.is_empty() { self.next } else { rest };
            let next = &next[..next.len().min(weights.len())];
            Self { first_panel: self.first_panel + piece * panels, weights, next, ..self }
        })
    }
}

/// Adds the product of `M` rows of `left` (panels of `WIDTH` vectors) with the weights.
#[inline(always)]
pub(super) fn add_product<T: Number, S: Lanes<T>, const M: usize, const WIDTH: usize, const LINES: usize>(
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
    let mut at = operand.first_panel * stride + (operand.first_row + row) * width;
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
pub(super) fn add_operand<T: Number, S: Lanes<T>, const M: usize, const LINES: usize>(
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

impl<'a, 'b, T> Target<'a, 'b, T> {
    /// Rows of one panel, of so many numbers if it is a wide one, or of several narrow ones.
    pub(crate) fn of(panels: &'a mut [&'b mut [T]], wide_len: usize) -> Self {
        if panels[0].len() == wide_len { Self::Wide(panels[0]) } else { Self::Narrow(panels) }
    }
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
        match self.target {
            Target::Wide(out) => {
                let out = S::vectors_mut(out);
                for (piece, operand) in self.operand.pieces::<S>().enumerate() {
                    blocks!(S, T, self.rows, |row, M| {
                        let out = &mut out[row * WIDE..];
                        let sums = if piece == 0 { [start; M] } else { load(out) };
                        store(&add_operand::<T, S, M, LINES>(s, sums, operand, row), out);
                    });
                }
            }
            Target::Narrow(panels) => {
                for (piece, operand) in self.operand.pieces::<S>().enumerate() {
                    blocks!(S, T, self.rows, |row, M| {
                        let mut block = [start; M_MAX];
                        let block = block[..M].as_flattened_mut();
                        if piece > 0 {
                            for (v, panel) in panels.iter().enumerate() {
                                let panel = &S::vectors(panel)[row..][..M];
                                for (sums, &before) in block.chunks_exact_mut(WIDE).zip(panel) {
                                    sums[v] = before;
                                }
                            }
                        }
                        let sums = add_operand::<T, S, M, LINES>(s, load(block), operand, row);
                        store(&sums, block);
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
}

impl<T: Number> Kernel<T> for Product<'_, '_, T> {
    #[inline(always)]
    fn run<S: Lanes<T>>(self, s: S) {
        if fetches_two(self.rows, S::REGISTERS) { self.ahead::<S, 2>(s) } else { self.ahead::<S, 1>(s) }
    }
}
