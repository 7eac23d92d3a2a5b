//! Matrices cut into panels of columns, the form in which every kernel reads and writes.
//!
//! A panel holds all rows of a few neighbouring columns, row after row, so that a step of a sequence (some rows) is one
//! contiguous piece of each panel, threads own whole panels, and a kernel finds the factors of one multiplication side by side.
//! A panel is *narrow* (one vector wide: units of a layer) or *wide* (four vectors: the gates of as many units, or features).

use std::ops::Index;

use rayon::prelude::*;

use crate::lanes::Number;
use crate::memory::{Buffer, LINE};

/// Vectors in a wide panel: one for each gate of a unit.
pub(crate) const WIDE: usize = 4;

/// Equal pieces of numbers, one after the other.
///
/// Between them lies an odd number of cache lines: at a distance of many whole pages, equal rows of neighbouring pieces would
/// drive each other out of the first cache.
#[derive(Debug, Clone)]
pub(crate) struct Pieces<T: Number> {
    numbers: Buffer<T>,
    count: usize,
    /// Numbers in a piece.
    length: usize,
    /// Numbers from the start of a piece to that of the next.
    stride: usize,
}

impl<T: Number> Pieces<T> {
    pub(crate) fn zeros(count: usize, length: usize) -> Self {
        let stride = Self::stride_of(length);
        Self { numbers: Buffer::zeros(count * stride), count, length, stride }
    }

    /// Pieces of which nothing is read before it is written.
    pub(crate) fn unset(count: usize, length: usize) -> Self {
        let stride = Self::stride_of(length);
        Self { numbers: Buffer::unset(count * stride), count, length, stride }
    }

    fn stride_of(length: usize) -> usize {
        let line = LINE / size_of::<T>();
        (length.div_ceil(line) | 1) * line
    }

    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Numbers from the start of a piece to that of the next.
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// All numbers, and how many lie from the start of a piece to that of the next.
    #[inline(always)]
    pub(crate) fn numbers(&self) -> (&[T], usize) {
        (&self.numbers, self.stride)
    }

    pub(crate) fn get(&self, piece: usize) -> Option<&[T]> {
        (piece < self.count).then(|| &self[piece])
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &[T]> {
        (0..self.count).map(|piece| &self[piece])
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut [T]> {
        pieces(&mut self.numbers, self.length, self.stride)
    }

    pub(crate) fn par_iter_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [T]> {
        let length = self.length;
        self.numbers.par_chunks_exact_mut(self.stride).map(move |piece| &mut piece[..length])
    }

    /// Some pieces at a time, fewer at the end.
    pub(crate) fn groups_mut(
        &mut self,
        together: usize,
    ) -> impl Iterator<Item = impl Iterator<Item = &mut [T]>> {
        let (length, stride) = (self.length, self.stride);
        let groups = self.numbers.chunks_mut(together * stride);
        groups.map(move |group| pieces(group, length, stride))
    }

    /// Some pieces at a time, fewer at the end.
    pub(crate) fn par_groups_mut(
        &mut self,
        together: usize,
    ) -> impl IndexedParallelIterator<Item = impl Iterator<Item = &mut [T]>> {
        let (length, stride) = (self.length, self.stride);
        let groups = self.numbers.par_chunks_mut(together * stride);
        groups.map(move |group| pieces(group, length, stride))
    }
}

/// The first `length` of every `stride` numbers.
fn pieces<T>(numbers: &mut [T], length: usize, stride: usize) -> impl Iterator<Item = &mut [T]> {
    numbers.chunks_exact_mut(stride).map(move |piece| &mut piece[..length])
}

impl<T: Number> Index<usize> for Pieces<T> {
    type Output = [T];

    #[inline]
    fn index(&self, piece: usize) -> &[T] {
        &self.numbers[piece * self.stride..][..self.length]
    }
}

/// A matrix in panels; columns beyond the last are zero.
#[derive(Debug, Clone)]
#[expect(clippy::struct_field_names, reason = "a matrix in panels consists of panels")]
pub(crate) struct Panels<T: Number> {
    pub(crate) panels: Pieces<T>,
    /// Columns in a panel.
    pub(crate) width: usize,
    /// Columns of the matrix.
    pub(crate) columns: usize,
}

impl<T: Number> Panels<T> {
    pub(crate) fn zeros(rows: usize, columns: usize, width: usize) -> Self {
        Self { panels: Pieces::zeros(columns.div_ceil(width), rows * width), width, columns }
    }

    /// Zeros in the first rows; nothing of the others is read before it is written.
    pub(crate) fn unset(zeros: usize, rows: usize, columns: usize, width: usize) -> Self {
        let mut panels = Pieces::unset(columns.div_ceil(width), rows * width);
        panels.iter_mut().for_each(|panel| panel[..zeros * width].fill(T::default()));
        Self { panels, width, columns }
    }

    /// The columns of each panel, without padding.
    pub(crate) fn column_ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> + use<T> {
        let (width, columns) = (self.width, self.columns);
        (0..columns).step_by(width).map(move |first| first..(first + width).min(columns))
    }

    /// Copies a row of the caller's matrix into row `row`.
    pub(crate) fn set_row(&mut self, row: usize, values: &[T]) {
        let (width, ranges) = (self.width, self.column_ranges());
        for (panel, range) in self.panels.iter_mut().zip(ranges) {
            panel[row * width..][..range.len()].copy_from_slice(&values[range]);
        }
    }

    /// Copies row `row` into a row of the caller's matrix.
    pub(crate) fn get_row(&self, row: usize, values: &mut [T]) {
        for (panel, range) in self.panels.iter().zip(self.column_ranges()) {
            let length = range.len();
            values[range].copy_from_slice(&panel[row * self.width..][..length]);
        }
    }
}
