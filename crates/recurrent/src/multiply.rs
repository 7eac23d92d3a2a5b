//! Products of rows with packed weights, shared among threads.

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
    let mut product = Panels::unset(0, rows, columns, width);
    let together = WIDE * lanes / width;
    product.panels.par_groups_mut(together).zip(packed.par_iter()).for_each(|(panels, weights)| {
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
