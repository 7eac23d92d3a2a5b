//! Products of rows with packed weights, shared among threads.

use std::ops::Range;

use rayon::prelude::*;
use rprae_lanes::Instructions;

use crate::kernel::{Operand, Product, Start, Target};
use crate::lanes::Number;
use crate::layer::{following, share};
use crate::panels::{Panels, WIDE};
use crate::weights::Packed;

/// Rows of a product and the packed weights behind it.
pub(crate) struct Destination<'a, T: Number> {
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
        for (index, (panels, weights)) in panels.panels.groups_mut(together).zip(packed.iter()).enumerate() {
            let target = panels.map(|panel| &mut panel[first_row * width..][..rows * width]).collect();
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
        let operand = Operand::new(left, first_row, piece.weights, piece.next);
        let target = Target::of(&mut piece.target, rows * WIDE * lanes);
        T::run(instructions, Product { start, operand, rows, target });
    });
}

/// Rows of a left factor so wide that meet all weights before the next do: they stay in the second cache meanwhile.
///
/// All pieces have about as many rows: one of few would take as long as the way of its weights.
fn rows_of_a_piece(rows: usize, columns: usize) -> usize {
    let most = if columns > WIDE_COLUMNS { ROWS / 2 } else { ROWS };
    rows.div_ceil(rows.div_ceil(most).max(1)).max(1)
}

/// The most rows of a piece; half of them where the left factor has many columns.
const ROWS: usize = 128;
const WIDE_COLUMNS: usize = 512;

/// The product of many rows, known beforehand, with packed weights: `target = left weights + bias` for some rows of the target;
/// those of the left begin at `first_row`.
pub(crate) fn multiply_all<T: Number>(
    instructions: Instructions,
    left: &Panels<T>,
    first_row: usize,
    packed: &Packed<T>,
    bias: Option<&Packed<T>>,
    target: &mut Panels<T>,
    rows: Range<usize>,
) {
    let (lanes, width) = (T::lanes(instructions), target.width);
    let size = rows_of_a_piece(rows.len(), left.columns);
    let mut pieces: Vec<Vec<Vec<&mut [T]>>> = (0..rows.len().div_ceil(size)).map(|_| Vec::new()).collect();
    for panels in target.panels.groups_mut(WIDE * lanes / width) {
        let panels = panels.map(|panel| &mut panel[rows.start * width..rows.end * width]);
        let mut panels: Vec<_> = panels.map(|panel| panel.chunks_mut(size * width)).collect();
        for piece in &mut pieces {
            piece.push(panels.iter_mut().filter_map(Iterator::next).collect());
        }
    }
    // Few rows are shared among threads panel by panel.
    let tasks = pieces.len() * packed.len();
    let min = share(tasks, packed.len() * rows.len() * left.columns * WIDE * lanes).min(packed.len());
    pieces.par_iter_mut().enumerate().for_each(|(piece, panels)| {
        panels.par_iter_mut().enumerate().with_min_len(min).for_each(|(index, target)| {
            let (first_row, next) = (first_row + piece * size, following(packed, index));
            let operand = Operand::new(left, first_row, &packed[index], next);
            let start = bias.map_or(Start::Zero, |bias| Start::Bias(&bias[index]));
            let rows = size.min(rows.len() - piece * size);
            let target = Target::of(target, rows * WIDE * lanes);
            T::run(instructions, Product { start, operand, rows, target });
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::pack_columns;

    /// The number at a place of a matrix; small enough for exact sums.
    fn number(seed: usize, row: usize, column: usize) -> f32 {
        ((row * 31 + column * 17 + seed) % 23) as f32 - 11.0
    }

    #[test]
    fn pieces_have_about_as_many_rows() {
        assert_eq!([0, 1, 128, 129, 244].map(|rows| rows_of_a_piece(rows, 500)), [1, 1, 128, 65, 122]);
        assert_eq!(rows_of_a_piece(244, 2048), 61);
    }

    #[test]
    fn products_deeper_and_longer_than_a_piece_are_the_sums_they_should_be() {
        let (rows, depth, columns) = (ROWS + 9, 1100, 70);
        let weights: Vec<f32> =
            (0..depth * columns).map(|at| number(1, at / columns, at % columns)).collect();
        let bias: Vec<f32> = (0..columns).map(|column| number(2, 0, column)).collect();
        for instructions in Instructions::all() {
            let lanes = f32::lanes(instructions);
            let packed = pack_columns(&weights, columns, lanes);
            let bias_packed = pack_columns(&bias, columns, lanes);
            for (left_width, width) in [(lanes, WIDE * lanes), (WIDE * lanes, lanes)] {
                let mut left = Panels::zeros(rows + 1, depth, left_width);
                for row in 0..rows {
                    let values: Vec<f32> = (0..depth).map(|column| number(0, row, column)).collect();
                    left.set_row(row + 1, &values);
                }
                let mut target = Panels::zeros(rows + 4, columns, width);
                multiply_all(instructions, &left, 1, &packed, Some(&bias_packed), &mut target, 2..rows + 2);
                let mut got = vec![f32::NAN; columns];
                for row in 0..rows + 4 {
                    target.get_row(row, &mut got);
                    for (column, &got) in got.iter().enumerate() {
                        let inside = row.checked_sub(2).filter(|&row| row < rows);
                        let want = inside.map_or(0.0, |row| {
                            let terms = (0..depth).map(|k| number(0, row, k) * number(1, k, column));
                            number(2, 0, column) + terms.sum::<f32>()
                        });
                        assert_eq!(got, want, "row {row}, column {column} with {}", instructions.name());
                    }
                }
            }
        }
    }
}
