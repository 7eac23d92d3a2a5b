//! Weights in the order in which the kernels read them, and gradients back in the caller's order.

use rayon::prelude::*;

use crate::fetch::fetch_near;
use crate::lanes::Number;
use crate::memory::LINE;
use crate::panels::{Pieces, WIDE};

/// Weights of one layer, row after row; gates in the order input, forget, cell, output.
#[derive(Debug, Clone, Copy)]
pub struct LayerWeights<'a, T> {
    /// `[feature, 4 * hidden]`.
    pub input: &'a [T],
    /// `[hidden, 4 * hidden]`.
    pub recurrent: &'a [T],
    /// `[4 * hidden]`.
    pub bias: &'a [T],
}

impl<T> LayerWeights<'_, T> {
    /// Units of the layer.
    #[must_use]
    pub fn hidden(&self) -> usize {
        self.bias.len() / WIDE
    }

    /// Numbers the layer hears at each step.
    #[must_use]
    pub fn feature(&self) -> usize {
        if self.bias.is_empty() { 0 } else { self.input.len() / self.bias.len() }
    }

    pub(crate) fn check(&self) {
        let hidden = self.hidden();
        assert!(hidden > 0 && self.bias.len() == WIDE * hidden, "a bias of {} numbers", self.bias.len());
        assert_eq!(self.recurrent.len(), WIDE * hidden * hidden, "recurrent weights of {hidden} units");
        assert_eq!(self.input.len(), WIDE * hidden * self.feature(), "input weights of {hidden} units");
    }
}

/// Gradients of [`LayerWeights`], of the same shapes.
#[derive(Debug, Clone)]
pub struct LayerGradients<T> {
    /// `[feature, 4 * hidden]`.
    pub input: Vec<T>,
    /// `[hidden, 4 * hidden]`.
    pub recurrent: Vec<T>,
    /// `[4 * hidden]`.
    pub bias: Vec<T>,
}

/// A piece for each panel of the product, `[row of the matrix, 4 vectors]`.
pub(crate) type Packed<T> = Pieces<T>;

/// Cache lines between a number of a row that is being transposed and the line that is asked for.
const LINES_AHEAD: usize = 8;

/// Panels that are packed together: neighbours in each row, so that what is read is longer than a cache line.
const TOGETHER: usize = 4;

/// Packs a matrix `[row, 4 * hidden]` for the gates of each panel of units.
pub(crate) fn pack_gates<T: Number>(matrix: &[T], hidden: usize, lanes: usize) -> Packed<T> {
    let rows = matrix.len() / (WIDE * hidden);
    let mut panels = Packed::unset(hidden.div_ceil(lanes), rows * WIDE * lanes);
    panels.par_groups_mut(TOGETHER).enumerate().for_each(|(group, panels)| {
        let mut panels: Vec<_> = panels.collect();
        let first = group * TOGETHER * lanes;
        let units = (panels.len() * lanes).min(hidden - first);
        for (index, source) in matrix.chunks_exact(hidden).enumerate() {
            let source = source[first..first + units].chunks(lanes);
            for (panel, source) in panels.iter_mut().zip(source) {
                let (packed, padding) = panel[index * lanes..][..lanes].split_at_mut(source.len());
                packed.copy_from_slice(source);
                padding.fill(T::default());
            }
        }
    });
    panels
}

/// The reverse of [`pack_gates`].
pub(crate) fn unpack_gates<T: Number>(packed: &Packed<T>, hidden: usize, lanes: usize) -> Vec<T> {
    let rows = packed.get(0).map_or(0, |panel| panel.len() / (WIDE * lanes));
    let mut matrix = vec![T::default(); rows * WIDE * hidden];
    matrix.par_chunks_exact_mut(WIDE * hidden).enumerate().for_each(|(row, matrix)| {
        for (gate, matrix) in matrix.chunks_exact_mut(hidden).enumerate() {
            for (panel, matrix) in packed.iter().zip(matrix.chunks_mut(lanes)) {
                matrix.copy_from_slice(&panel[(row * WIDE + gate) * lanes..][..matrix.len()]);
            }
        }
    });
    matrix
}

/// Packs a matrix `[row, column]` for wide panels of columns.
pub(crate) fn pack_columns<T: Number>(matrix: &[T], columns: usize, lanes: usize) -> Packed<T> {
    let width = WIDE * lanes;
    let rows = matrix.len() / columns;
    let mut panels = Packed::zeros(columns.div_ceil(width), rows * width);
    panels.par_iter_mut().enumerate().for_each(|(panel, packed)| {
        let first = panel * width;
        let length = width.min(columns - first);
        for (packed, source) in packed.chunks_exact_mut(width).zip(matrix.chunks_exact(columns)) {
            packed[..length].copy_from_slice(&source[first..first + length]);
        }
    });
    panels
}

/// The reverse of [`pack_columns`].
pub(crate) fn unpack_columns<T: Number>(packed: &Packed<T>, columns: usize, lanes: usize) -> Vec<T> {
    let width = WIDE * lanes;
    let rows = packed.get(0).map_or(0, |panel| panel.len() / width);
    let mut matrix = vec![T::default(); rows * columns];
    for (row, matrix) in matrix.chunks_exact_mut(columns).enumerate() {
        for (panel, matrix) in packed.iter().zip(matrix.chunks_mut(width)) {
            matrix.copy_from_slice(&panel[row * width..][..matrix.len()]);
        }
    }
    matrix
}

/// Neighbouring columns of a matrix and where they come among the factors of a product.
struct Columns {
    first: usize,
    count: usize,
    factor: usize,
}

/// Packs the transpose of a matrix `[row, column]`: products with it run over `depth` factors and yield wide panels of rows.
///
/// Factors that are no columns are zeros. It is quickest to name columns in the order in which they lie in the matrix.
fn pack_transposed<T: Number>(
    matrix: &[T],
    num_columns: usize,
    lanes: usize,
    depth: usize,
    columns: &[Columns],
) -> Packed<T> {
    let width = WIDE * lanes;
    let rows: Vec<&[T]> = matrix.chunks_exact(num_columns).collect();
    let mut panels = Packed::zeros(rows.len().div_ceil(width), depth * width);
    panels.par_iter_mut().zip(rows.par_chunks(width)).for_each(|(packed, rows)| {
        for &Columns { first, count, factor } in columns {
            let target = &mut packed[factor * width..][..count * width];
            for (row, source) in rows.iter().enumerate() {
                // The rows are too many streams for the processor to see where they lead.
                fetch_near(source.as_ptr().wrapping_add(first + LINES_AHEAD * LINE / size_of::<T>()));
                let source = &source[first..first + count];
                for (target, &number) in target.chunks_exact_mut(width).zip(source) {
                    target[row] = number;
                }
            }
        }
    });
    panels
}

/// Packs the transpose of a matrix `[row, 4 * hidden]` for factors that are gates of panels of units.
pub(crate) fn pack_gates_transposed<T: Number>(matrix: &[T], hidden: usize, lanes: usize) -> Packed<T> {
    let panels = hidden.div_ceil(lanes);
    let gates = (0..WIDE).flat_map(|gate| {
        (0..panels).map(move |panel| Columns {
            first: gate * hidden + panel * lanes,
            count: lanes.min(hidden - panel * lanes),
            factor: (panel * WIDE + gate) * lanes,
        })
    });
    pack_transposed(matrix, WIDE * hidden, lanes, panels * WIDE * lanes, &gates.collect::<Vec<_>>())
}

/// Packs the transpose of a matrix `[row, column]`.
pub(crate) fn pack_columns_transposed<T: Number>(matrix: &[T], columns: usize, lanes: usize) -> Packed<T> {
    let all = Columns { first: 0, count: columns, factor: 0 };
    pack_transposed(matrix, columns, lanes, columns, &[all])
}
