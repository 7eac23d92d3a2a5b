//! Outer products, summed over frames.

use super::{Block, block_rows, num_blocks, store};
use crate::fetch::{fetch, fetch_near};
use crate::lanes::{Kernel, Lanes, Number};
use crate::memory::LINE;
use crate::panels::{Panels, WIDE};

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
/// The left matrix does not fit into the second cache: the more panels meet a group of its rows, one after the other, the less
/// often these are fetched.
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
        let mut next_sums = sums.as_ptr().wrapping_add(M * WIDE);
        for run in group {
            let left = left[run.left * width..][..run.rows * width].chunks_exact(width);
            let right = right[run.right * WIDE..][..run.rows * WIDE].chunks_exact(WIDE);
            let mut next = next.as_ptr().wrapping_add(run.left * width + ahead);
            for (left, right) in left.zip(right) {
                fetch(next);
                next = next.wrapping_add(width);
                fetch_near(next_sums);
                next_sums = next_sums.wrapping_add(1);
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
            for right in &mut *self.rights {
                let (right, all_sums) = (S::vectors(right.panel), S::vectors_mut(right.sums));
                for (index, (panel, range)) in self.left.panels.iter().zip(&ranges).enumerate() {
                    let next = self.left.panels.get(index + 1).unwrap_or(panel);
                    let sums = &mut all_sums[range.start * WIDE..range.end * WIDE];
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
