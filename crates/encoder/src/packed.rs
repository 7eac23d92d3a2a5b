//! The right factor of a product, in the order in which the kernel reads it.

use std::ops::Range;

/// Bytes of a cache line; vectors that straddle two of them load at half speed.
const LINE: usize = 64;

/// Vectors in a panel of columns.
pub(crate) const WIDE: usize = 2;

/// A matrix `[depth, columns]` cut into panels of [`WIDE`] vectors of columns, each with its rows one after the other;
/// columns beyond the last are zero.
#[derive(Debug)]
pub(crate) struct Packed {
    numbers: Vec<f32>,
    /// Where the first panel begins: at a cache line.
    start: usize,
    pub(crate) depth: usize,
    pub(crate) columns: usize,
    /// Columns in a panel.
    pub(crate) width: usize,
}

impl Packed {
    /// `row(k, columns)` are the given columns of row `k`.
    pub(crate) fn from_rows<'a>(
        shape: [usize; 2],
        lanes: usize,
        row: impl Fn(usize, Range<usize>) -> &'a [f32],
    ) -> Self {
        let mut packed = Self::zeros(shape, lanes);
        let (width, depth) = (packed.width, packed.depth);
        for (panel, range) in packed.ranges().enumerate() {
            for k in 0..depth {
                let from = row(k, range.clone());
                packed.panel_mut(panel)[k * width..][..from.len()].copy_from_slice(from);
            }
        }
        packed
    }

    /// `column(j)` is column `j`, of `depth` numbers.
    pub(crate) fn from_columns<'a>(
        shape: [usize; 2],
        lanes: usize,
        column: impl Fn(usize) -> &'a [f32],
    ) -> Self {
        let mut packed = Self::zeros(shape, lanes);
        let (width, depth) = (packed.width, packed.depth);
        for (panel, range) in packed.ranges().enumerate() {
            for (place, j) in range.enumerate() {
                let from = &column(j)[..depth];
                for (row, &number) in packed.panel_mut(panel).chunks_exact_mut(width).zip(from) {
                    row[place] = number;
                }
            }
        }
        packed
    }

    fn zeros([depth, columns]: [usize; 2], lanes: usize) -> Self {
        let width = WIDE * lanes;
        let spare = LINE / size_of::<f32>();
        let numbers = vec![0.0; columns.div_ceil(width) * width * depth + spare];
        let start = numbers.as_ptr().align_offset(LINE).min(spare);
        Self { numbers, start, depth, columns, width }
    }

    /// The columns of each panel, without padding.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (width, columns) = (self.width, self.columns);
        (0..columns).step_by(width).map(move |first| first..(first + width).min(columns))
    }

    /// `[depth, width]`.
    pub(crate) fn panel(&self, index: usize) -> &[f32] {
        let size = self.depth * self.width;
        &self.numbers[self.start + index * size..][..size]
    }

    fn panel_mut(&mut self, index: usize) -> &mut [f32] {
        let size = self.depth * self.width;
        &mut self.numbers[self.start + index * size..][..size]
    }
}
