//! The inner loops: blocks of a few rows by four vectors, held in registers.
//!
//! Every sum runs over its terms in one fixed order, whatever rows are computed with it, so that results depend neither on the
//! number of threads nor on the rest of the batch.

use crate::panels::WIDE;

/// Four vectors for each of `M` rows.
type Block<V, const M: usize> = [[V; WIDE]; M];

/// The most rows in a block.
const M_MAX: usize = 6;

/// Rows in a block: as many as registers hold beside the weights.
const fn block_rows(registers: usize) -> usize {
    if registers >= 32 { M_MAX } else { 2 }
}

/// How many blocks rows fall into.
fn num_blocks(rows: usize, registers: usize) -> usize {
    rows.div_ceil(block_rows(registers))
}

/// Whether so few blocks meet the weights that each must ask for two lines of the next ones at every turn, for all to come.
fn fetches_two(rows: usize, registers: usize) -> bool {
    num_blocks(rows, registers) < WIDE
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

mod outer;
mod product;
mod step;
mod tanh;

pub(crate) use outer::{Outer, Right, Run, groups};
pub(crate) use product::{Operand, Product, Start, Target};
pub(crate) use step::{Ahead, Step, StepBack};
pub(crate) use tanh::Tanh;

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
