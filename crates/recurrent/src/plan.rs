//! Which sequences are at work at which step.

use std::ops::Range;

use rayon::prelude::*;

use crate::lanes::Number;
use crate::panels::Panels;
use rprae_lanes::Instructions;

/// The order in which a sequence is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the first frame to the last.
    Forward,
    /// From the last valid frame to the first.
    Backward,
}

/// A batch of sequences, the longest first, so that those still at work at any step are the first so many.
///
/// Frames are numbered step by step: all sequences at step 0, then those at work at step 1, and so on; frames of padding
/// have no number and cost nothing.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Place in the caller's batch of each row.
    order: Vec<usize>,
    /// Length of each row, not rising.
    lengths: Vec<usize>,
    /// First frame of each step, and the number of frames at the end.
    offsets: Vec<usize>,
    /// Sequences in the caller's batch.
    whole: usize,
    width: usize,
    /// For each sequence of the caller's batch, its first row where sequences stand without padding, one after the other.
    starts: Vec<usize>,
    direction: Direction,
    pub(crate) instructions: Instructions,
}

/// The fewest sequences worth a part of their own: with two blocks of them, weights are read twice for every time they are fetched.
const ROWS_OF_A_PART: usize = 12;

/// Frames worth a product of their own: the weights behind it are read a few times for all of them.
const FRAMES_OF_A_BLOCK: usize = 240;

/// First frame of each step for sequences of these lengths, not rising, and the number of frames at the end.
fn offsets(lengths: &[usize]) -> Vec<usize> {
    let mut offsets = vec![0];
    let mut frames = 0;
    for step in 0..lengths.first().copied().unwrap_or(0) {
        frames += lengths.partition_point(|&length| length > step);
        offsets.push(frames);
    }
    offsets
}

impl Plan {
    /// Plans a batch of `lengths.len()` sequences stored `width` frames apart.
    ///
    /// # Panics
    ///
    /// If a length exceeds `width`.
    #[must_use]
    pub fn new(lengths: &[usize], width: usize, direction: Direction, instructions: Instructions) -> Self {
        let mut order: Vec<usize> = (0..lengths.len()).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(lengths[index]));
        let sorted: Vec<usize> = order.iter().map(|&index| lengths[index]).collect();
        let steps = sorted.first().copied().unwrap_or(0);
        assert!(steps <= width, "a sequence of {steps} frames in a batch of width {width}");
        let offsets = offsets(&sorted);
        let starts = lengths.iter().scan(0, |next, length| {
            let start = *next;
            *next += length;
            Some(start)
        });
        let starts = starts.collect();
        Self { order, lengths: sorted, offsets, whole: lengths.len(), width, starts, direction, instructions }
    }

    /// The batch in parts that share nothing but the weights: threads that work on different parts need not wait for each other
    /// at every step.
    ///
    /// The longest sequences come first, and each part has about as many frames as the other. A part of few sequences would read
    /// all weights for little work, so that small batches stay whole. Nothing here depends on the number of threads.
    pub(crate) fn parts(&self) -> Vec<Self> {
        let batch = self.batch();
        if batch < 2 * ROWS_OF_A_PART {
            return vec![self.clone()];
        }
        let mut frames = 0;
        let half = self.lengths.iter().take_while(|&length| {
            frames += length;
            2 * frames <= self.num_frames()
        });
        let cut = half.count().clamp(ROWS_OF_A_PART, batch - ROWS_OF_A_PART);
        [0..cut, cut..batch]
            .into_iter()
            .map(|rows| {
                let lengths = self.lengths[rows.clone()].to_vec();
                let offsets = offsets(&lengths);
                let order = self.order[rows].to_vec();
                Self { order, lengths, offsets, starts: self.starts.clone(), ..*self }
            })
            .collect()
    }

    /// Sequences in the batch, or in this part of it.
    #[must_use]
    pub fn batch(&self) -> usize {
        self.order.len()
    }

    /// Sequences in the caller's batch.
    pub(crate) fn whole(&self) -> usize {
        self.whole
    }

    /// Frames of all sequences together, without padding.
    #[must_use]
    pub fn num_frames(&self) -> usize {
        self.offsets[self.num_steps()]
    }

    /// Frames of the longest sequence.
    #[must_use]
    pub fn num_steps(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Frames from the start of one sequence to the next in the caller's batch.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Frames of a step.
    ///
    /// # Panics
    ///
    /// If no sequence has so many steps.
    #[must_use]
    pub fn frames(&self, step: usize) -> Range<usize> {
        self.offsets[step]..self.offsets[step + 1]
    }

    /// Frames of neighbouring steps.
    pub(crate) fn frames_of(&self, steps: &Range<usize>) -> Range<usize> {
        self.offsets[steps.start]..self.offsets[steps.end]
    }

    /// Neighbouring steps that go through all layers before the next do: what is written in between stays in the caches.
    pub(crate) fn blocks(&self) -> Vec<Range<usize>> {
        let mut blocks = Vec::new();
        let mut first = 0;
        for end in 1..=self.num_steps() {
            if end == self.num_steps() || self.frames_of(&(first..end)).len() >= FRAMES_OF_A_BLOCK {
                blocks.push(first..end);
                first = end;
            }
        }
        blocks
    }

    /// Place in the caller's batch, row by row, the longest sequence first.
    #[must_use]
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// For each frame in turn, where it stands in the caller's `[batch, time]`.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        self.frames_in_turn().map(|(row, step)| self.order[row] * self.width + self.time(row, step))
    }

    /// For each frame in turn, where it stands among the caller's sequences without padding, one after the other.
    pub fn packed_places(&self) -> impl Iterator<Item = usize> + '_ {
        self.frames_in_turn().map(|(row, step)| self.starts[self.order[row]] + self.time(row, step))
    }

    /// Row and step of each frame.
    fn frames_in_turn(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.num_steps()).flat_map(move |step| (0..self.frames(step).len()).map(move |row| (row, step)))
    }

    fn time(&self, row: usize, step: usize) -> usize {
        match self.direction {
            Direction::Forward => step,
            Direction::Backward => self.lengths[row] - 1 - step,
        }
    }

    /// First row of the states before a step, where those of all frames follow the initial one of each sequence.
    ///
    /// # Panics
    ///
    /// If no sequence has so many steps.
    #[must_use]
    pub fn before(&self, step: usize) -> usize {
        step.checked_sub(1).map_or(0, |before| self.batch() + self.frames(before).start)
    }

    /// The last frame of each row, in terms of frame numbers; none for an empty sequence.
    pub fn last_frames(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.lengths.iter().enumerate().map(|(row, &length)| Some(self.offsets[length.checked_sub(1)?] + row))
    }

    /// Values `[batch, time, column]` as one row for each frame.
    pub(crate) fn gather<T: Number>(&self, values: &[T], columns: usize, width: usize) -> Panels<T> {
        self.gather_from(values, columns, width, || self.places())
    }

    /// Values `[frame, column]` of sequences one after the other as one row for each frame.
    pub(crate) fn gather_packed<T: Number>(&self, values: &[T], columns: usize, width: usize) -> Panels<T> {
        self.gather_from(values, columns, width, || self.packed_places())
    }

    fn gather_from<T: Number, P: Iterator<Item = usize>>(
        &self,
        values: &[T],
        columns: usize,
        width: usize,
        places: impl Fn() -> P + Sync,
    ) -> Panels<T> {
        let mut panels = Panels::zeros(self.num_frames(), columns, width);
        let ranges: Vec<_> = panels.column_ranges().collect();
        panels.panels.par_iter_mut().zip(ranges).for_each(|(panel, range)| {
            for (row, place) in panel.chunks_exact_mut(width).zip(places()) {
                row[..range.len()].copy_from_slice(&values[place * columns..][range.clone()]);
            }
        });
        panels
    }

    /// The reverse of [`Plan::gather`]: rows from `first_row` on; the padding stays as it is.
    pub(crate) fn scatter<T: Number>(&self, panels: &Panels<T>, first_row: usize, values: &mut [T]) {
        if panels.columns * self.width > 0 {
            let sequences = values.chunks_exact_mut(self.width * panels.columns).collect();
            self.scatter_to(panels, first_row, sequences);
        }
    }

    /// The reverse of [`Plan::gather_packed`]: rows from `first_row` on; other sequences' stay as they are.
    pub(crate) fn scatter_packed<T: Number>(&self, panels: &Panels<T>, first_row: usize, values: &mut [T]) {
        let mut rest = values;
        let mut sequences = Vec::with_capacity(self.whole);
        for pair in self.starts.windows(2) {
            let (sequence, after) = rest.split_at_mut((pair[1] - pair[0]) * panels.columns);
            sequences.push(sequence);
            rest = after;
        }
        sequences.push(rest);
        self.scatter_to(panels, first_row, sequences);
    }

    /// Writes frames to the caller's sequences.
    fn scatter_to<T: Number>(&self, panels: &Panels<T>, first_row: usize, sequences: Vec<&mut [T]>) {
        let columns = panels.columns;
        let mut rows = vec![None; self.whole];
        for (row, &index) in self.order.iter().enumerate() {
            rows[index] = Some(row);
        }
        sequences.into_par_iter().zip(rows).for_each(|(sequence, row)| {
            let Some(row) = row else { return };
            for step in 0..self.lengths[row] {
                let frame = first_row + self.offsets[step] + row;
                panels.get_row(frame, &mut sequence[self.time(row, step) * columns..][..columns]);
            }
        });
    }

    /// Values `[batch, column]` as rows.
    pub(crate) fn gather_rows<T: Number>(&self, values: &[T], columns: usize, width: usize) -> Panels<T> {
        let mut panels = Panels::zeros(self.batch(), columns, width);
        for (row, &index) in self.order.iter().enumerate() {
            panels.set_row(row, &values[index * columns..][..columns]);
        }
        panels
    }

    /// The reverse of [`Plan::gather_rows`].
    pub(crate) fn scatter_rows<T: Number>(&self, panels: &Panels<T>, values: &mut [T]) {
        for (row, &index) in self.order.iter().enumerate() {
            panels.get_row(row, &mut values[index * panels.columns..][..panels.columns]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered_step_by_step_and_come_back_where_they_were() {
        let lengths = [2, 0, 3, 1];
        for (direction, first) in [(Direction::Forward, 60.0), (Direction::Backward, 80.0)] {
            let plan = Plan::new(&lengths, 4, direction, Instructions::best());
            assert_eq!(plan.order(), [2, 0, 3, 1]);
            assert_eq!((plan.num_frames(), plan.num_steps()), (6, 3));
            assert_eq!(plan.frames(1), 3..5);
            assert_eq!(plan.last_frames().collect::<Vec<_>>(), [Some(5), Some(4), Some(2), None]);
            // Ten times the place, plus the column.
            let values: Vec<f32> = (0..32).map(|i| (i / 2 * 10 + i % 2) as f32 - 20.0).collect();
            let panels = plan.gather(&values, 2, 16);
            assert_eq!(panels.panels[0][..2], [first, first + 1.0]);
            let mut back = vec![0.0; values.len()];
            plan.scatter(&panels, 0, &mut back);
            for (sequence, length) in lengths.into_iter().enumerate() {
                for time in 0..4 {
                    let at = (sequence * 4 + time) * 2..(sequence * 4 + time) * 2 + 2;
                    let want = if time < length { values[at.clone()].to_vec() } else { vec![0.0; 2] };
                    assert_eq!(back[at], want);
                }
            }
            // Without padding: the frames of the first sequence, of the third and of the fourth.
            let valid: Vec<f32> =
                [0, 1, 8, 9, 10, 12].iter().flat_map(|&place| values[2 * place..][..2].to_vec()).collect();
            assert_eq!(plan.gather_packed(&valid, 2, 16).panels[0], panels.panels[0]);
            let mut back = vec![0.0; valid.len()];
            plan.scatter_packed(&panels, 0, &mut back);
            assert_eq!(back, valid);
        }
    }

    #[test]
    fn a_large_batch_has_two_parts_of_about_as_many_frames() {
        let plan = |lengths: &[usize]| Plan::new(lengths, 40, Direction::Forward, Instructions::best());
        assert_eq!(plan(&[7; 23]).parts().len(), 1, "too few sequences for two parts");
        assert_eq!(plan(&[]).parts().len(), 1);
        let lengths: Vec<usize> = (0..40).collect();
        let parts = plan(&lengths).parts();
        let frames: Vec<usize> = parts.iter().map(Plan::num_frames).collect();
        assert_eq!(
            (frames.iter().sum::<usize>(), parts[0].batch()),
            (780, 12),
            "the longest twelve: 39 to 28"
        );
        assert_eq!(frames[0], 402);
        assert_eq!(parts[0].order(), (28..40).rev().collect::<Vec<_>>());
        assert_eq!(parts[1].order(), (0..28).rev().collect::<Vec<_>>());
        assert_eq!((parts[0].num_steps(), parts[1].num_steps(), parts[1].whole()), (39, 27, 40));
    }
}
