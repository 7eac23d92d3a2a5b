//! Matrices cut into panels of columns, the form in which every kernel reads and writes.
//!
//! A panel holds all rows of a few neighbouring columns, row after row, so that a step of a sequence (some rows) is one
//! contiguous piece of each panel, threads own whole panels, and a kernel finds the factors of one multiplication side by side.
//! A panel is *narrow* (one vector wide: units of a layer) or *wide* (four vectors: the gates of as many units, or features).

use std::ops::{Deref, DerefMut};

use crate::lanes::Number;

/// Bytes of a cache line; vectors that straddle two of them load at half speed.
pub(crate) const LINE: usize = 64;

/// Vectors in a wide panel: one for each gate of a unit.
pub(crate) const WIDE: usize = 4;

/// Numbers that begin at a cache line.
#[derive(Debug)]
pub(crate) struct Buffer<T> {
    data: Vec<T>,
    start: usize,
    len: usize,
}

impl<T: Copy + Default> Buffer<T> {
    pub(crate) fn zeros(len: usize) -> Self {
        let data = vec![T::default(); len + LINE / size_of::<T>()];
        let start = data.as_ptr().align_offset(LINE).min(LINE / size_of::<T>());
        Self { data, start, len }
    }
}

impl<T: Clone> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        let mut data: Vec<T> = Vec::with_capacity(self.data.len());
        let start = data.as_ptr().align_offset(LINE).min(self.data.len() - self.len);
        // What lies around the numbers does not matter.
        data.extend_from_slice(&self.data[..start]);
        data.extend_from_slice(self);
        data.extend_from_slice(&self.data[start + self.len..]);
        Self { data, start, len: self.len }
    }
}

impl<T> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.data[self.start..self.start + self.len]
    }
}

impl<T> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.data[self.start..self.start + self.len]
    }
}

/// A matrix in panels; columns beyond the last are zero.
#[derive(Debug, Clone)]
#[expect(clippy::struct_field_names, reason = "a matrix in panels consists of panels")]
pub(crate) struct Panels<T> {
    pub(crate) panels: Vec<Buffer<T>>,
    /// Columns in a panel.
    pub(crate) width: usize,
    /// Columns of the matrix.
    pub(crate) columns: usize,
}

impl<T: Number> Panels<T> {
    pub(crate) fn zeros(rows: usize, columns: usize, width: usize) -> Self {
        let panels = (0..columns.div_ceil(width)).map(|_| Buffer::zeros(rows * width)).collect();
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
