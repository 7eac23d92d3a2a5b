//! Matrix products: blocks of some rows by two vectors of columns, held in registers.

use pulp::{Simd, WithSimd};

use crate::elementwise::gelu;
use crate::layer::at_least;
use crate::packed::{Packed, WIDE};

/// The most rows in a block, with 32 registers: 28 of them hold sums.
const MOST_ROWS: usize = 14;

/// Columns of the left factor that lie together, so that the rows of a block are a constant number of bytes apart.
const CHUNK: usize = 64;

/// What happens to a sum at the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Finish {
    /// It is the result.
    Keep,
    /// Its GELU is the result.
    Gelu,
    /// It is added to what is there.
    Add,
}

/// `out = finish(left right + bias)`.
pub(crate) struct Product<'a> {
    /// `[rows, depth]`, a row every `left_stride` numbers.
    pub(crate) left: &'a [f32],
    pub(crate) left_stride: usize,
    pub(crate) rows: usize,
    pub(crate) right: &'a Packed,
    /// Whole panels; none is zero.
    pub(crate) bias: Option<&'a [f32]>,
    /// `[rows, columns]`, a row every `out_stride` numbers.
    pub(crate) out: &'a mut [f32],
    pub(crate) out_stride: usize,
    pub(crate) finish: Finish,
    /// Memory to work in, of any length.
    pub(crate) scratch: &'a mut Vec<f32>,
}

/// Rows in a block: as many as registers hold beside the weights.
const fn block_rows(registers: usize) -> usize {
    if registers >= 32 { MOST_ROWS } else { 6 }
}

/// First row and number of rows of each block, as even as they can be.
fn blocks(rows: usize, most: usize) -> impl Iterator<Item = (usize, usize)> {
    let count = rows.div_ceil(most);
    (0..count).scan(0, move |next, block| {
        let size = rows / count + usize::from(block < rows % count);
        let first = *next;
        *next += size;
        Some((first, size))
    })
}

/// Calls `$body` with `$m` the constant that `$size` is.
macro_rules! with_rows {
    ($size:expr, $most:expr, |$m:ident| $body:expr, $($n:literal)*) => {
        match $size {
            $($n if $n <= $most => {
                const $m: usize = $n;
                $body
            })*
            _ => {}
        }
    };
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let Self { left, left_stride, rows, right, bias, out, out_stride, finish, scratch } = self;
        let most = block_rows(S::REGISTER_COUNT);
        let depth = right.depth;
        // `[block, chunk of columns, row of the block, CHUNK]`.
        let padded = depth.next_multiple_of(CHUNK);
        let scratch = at_least(scratch, rows * padded);
        for (first, size) in blocks(rows, most) {
            let block = scratch[first * padded..][..size * padded].chunks_exact_mut(size * CHUNK);
            for (chunk, block) in block.enumerate() {
                let columns = chunk * CHUNK..((chunk + 1) * CHUNK).min(depth);
                for (row, to) in block.chunks_exact_mut(CHUNK).enumerate() {
                    let from = &left[(first + row) * left_stride..][columns.clone()];
                    to[..from.len()].copy_from_slice(from);
                }
            }
        }
        for (index, columns) in right.ranges().enumerate() {
            let panel = S::as_simd_f32s(right.panel(index)).0;
            let start: [S::f32s; WIDE] = match bias {
                Some(bias) => {
                    let bias = S::as_simd_f32s(&bias[columns.start..]).0;
                    std::array::from_fn(|v| bias[v])
                }
                None => [s.splat_f32s(0.0); WIDE],
            };
            for (first, size) in blocks(rows, most) {
                let left = &scratch[first * padded..][..size * padded];
                let out = &mut out[first * out_stride + columns.start..];
                with_rows!(size, most, |M| {
                    let sums = sums::<S, M>(s, left, panel, start);
                    store::<S, M>(s, &sums, out, out_stride, columns.len(), finish);
                }, 1 2 3 4 5 6 7 8 9 10 11 12 13 14);
            }
        }
    }
}

/// Sums of `M` rows and the columns of a panel.
///
/// They live in registers only if every place in the array is named by a constant: these loops are short enough to be unrolled.
#[inline(always)]
fn sums<S: Simd, const M: usize>(
    s: S,
    left: &[f32],
    panel: &[S::f32s],
    start: [S::f32s; WIDE],
) -> [[S::f32s; WIDE]; M] {
    let mut sums = [start; M];
    for (left, panel) in left.chunks_exact(M * CHUNK).zip(panel.chunks(CHUNK * WIDE)) {
        let left = &left[..M * CHUNK];
        // Bounded by a constant on one side and by the iterator on the other, the loop needs no checks.
        for (k, right) in (0..CHUNK).zip(panel.chunks_exact(WIDE)) {
            for m in 0..M {
                let factor = s.splat_f32s(left[m * CHUNK + k]);
                for v in 0..WIDE {
                    sums[m][v] = s.mul_add_e_f32s(factor, right[v], sums[m][v]);
                }
            }
        }
    }
    sums
}

#[inline(always)]
fn store<S: Simd, const M: usize>(
    s: S,
    sums: &[[S::f32s; WIDE]; M],
    out: &mut [f32],
    stride: usize,
    columns: usize,
    finish: Finish,
) {
    let width = WIDE * S::F32_LANES;
    for (m, sums) in sums.iter().enumerate() {
        let out = &mut out[m * stride..][..columns];
        // The longest panel there is: two vectors of 16.
        let mut edge = [0.0; WIDE * 16];
        let full = columns == width;
        let target = if full {
            &mut *out
        } else {
            edge[..columns].copy_from_slice(out);
            &mut edge[..width]
        };
        for (target, &sum) in S::as_mut_simd_f32s(target).0.iter_mut().zip(sums) {
            *target = match finish {
                Finish::Keep => sum,
                Finish::Gelu => gelu(s, sum),
                Finish::Add => s.add_f32s(*target, sum),
            };
        }
        if !full {
            out.copy_from_slice(&edge[..columns]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rprae_lanes::Instructions;

    fn numbers(len: usize, seed: usize) -> Vec<f32> {
        (0..len).map(|k| ((k * 7919 + seed * 104_729) % 1999) as f32 / 1000.0 - 1.0).collect()
    }

    #[test]
    fn products_of_all_sizes_are_the_sums_they_should_be() {
        for instructions in Instructions::all() {
            // Every size of a block, chunks and panels that are cut off, strides beyond the rows.
            for (rows, depth, columns) in
                (1..30).map(|rows| (rows, 5 * rows, 7 * rows)).chain([(15, 200, 33)])
            {
                let (left_stride, out_stride) = (depth + 3, columns + 2);
                let left = numbers(rows * left_stride, 1);
                let right = numbers(depth * columns, 2);
                let lanes = instructions.lanes();
                let packed =
                    Packed::from_rows([depth, columns], lanes, |k, range| &right[k * columns..][range]);
                let mut bias = numbers(columns, 3);
                bias.resize(columns.next_multiple_of(packed.width), 0.0);
                for finish in [Finish::Keep, Finish::Add] {
                    let before = numbers(rows * out_stride, 4);
                    let mut out = before.clone();
                    instructions.run(Product {
                        left: &left,
                        left_stride,
                        rows,
                        right: &packed,
                        bias: Some(&bias),
                        out: &mut out,
                        out_stride,
                        finish,
                        scratch: &mut Vec::new(),
                    });
                    for (place, (&got, &before)) in out.iter().zip(&before).enumerate() {
                        let (row, column) = (place / out_stride, place % out_stride);
                        if column >= columns {
                            assert_eq!(got, before, "what lies between rows stays");
                            continue;
                        }
                        let terms = (0..depth).map(|k| {
                            f64::from(left[row * left_stride + k]) * f64::from(right[k * columns + column])
                        });
                        let kept = if finish == Finish::Add { f64::from(before) } else { 0.0 };
                        let want = terms.sum::<f64>() + f64::from(bias[column]) + kept;
                        assert!(
                            (f64::from(got) - want).abs() < 1e-4,
                            "{rows} {depth} {columns}: {got} {want}"
                        );
                    }
                }
            }
        }
    }
}
