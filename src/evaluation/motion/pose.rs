//! How far generated poses are from recorded ones: as they come, shifted in time, and warped.
//!
//! The three together tell a wrong motion from a right one at the wrong moment.

use thiserror::Error;

use super::warp::mean_along_path;
use crate::evaluation::measurement::Measurement;
use crate::evaluation::signature::Signature;

const MM_PER_M: f64 = 1000.0;
/// Most frames of a motion: warping costs the product of both numbers.
const MAX_FRAMES: usize = 20_000;

/// Joint positions over time, in the frame of the root's place and heading, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Poses {
    rate_hz: f64,
    num_joints: usize,
    /// `[frame, joint, axis]`, row by row.
    values: Vec<f64>,
}

/// Positions that are no poses.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PosesError {
    /// No frames, or too many.
    #[error("use poses: {found} frames, and 1 to {MAX_FRAMES} are taken")]
    Frames {
        /// Number of frames.
        found: usize,
    },
    /// A frame unlike the first, or one that is not finite.
    #[error("use poses: frame {frame} has other joints than the first, or a position that is not finite")]
    Frame {
        /// Place of the frame.
        frame: usize,
    },
    /// A rate that is none.
    #[error("use poses: a rate of {rate_hz} Hz")]
    Rate {
        /// The rate.
        rate_hz: f64,
    },
}

impl Poses {
    /// Checks positions, `[frame][joint]`.
    ///
    /// # Errors
    /// A [`PosesError`] that names the first frame at fault.
    pub fn new(rate_hz: f64, frames: &[Vec<[f64; 3]>]) -> Result<Self, PosesError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(PosesError::Rate { rate_hz });
        }
        let num_joints = frames.first().map_or(0, Vec::len);
        if num_joints == 0 || frames.len() > MAX_FRAMES {
            return Err(PosesError::Frames { found: frames.len() });
        }
        let is_sound = |frame: &Vec<[f64; 3]>| {
            frame.len() == num_joints && frame.as_flattened().iter().all(|value| value.is_finite())
        };
        if let Some(frame) = frames.iter().position(|frame| !is_sound(frame)) {
            return Err(PosesError::Frame { frame });
        }
        let values = frames.iter().flat_map(|frame| frame.as_flattened().iter().copied()).collect();
        Ok(Self { rate_hz, num_joints, values })
    }

    /// Number of frames.
    #[must_use]
    pub fn num_frames(&self) -> usize {
        self.values.len() / (3 * self.num_joints)
    }

    fn frame(&self, index: usize) -> &[[f64; 3]] {
        let (points, _) = self.values.as_chunks::<3>();
        &points[index * self.num_joints..(index + 1) * self.num_joints]
    }

    /// Mean distance over joints of two frames, metres.
    #[must_use]
    pub fn distance_m(&self, index: usize, other: &Self, other_index: usize) -> f64 {
        let pairs = self.frame(index).iter().zip(other.frame(other_index));
        let length = |(a, b): (&[f64; 3], &[f64; 3])| {
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        pairs.map(length).sum::<f64>() / self.num_joints as f64
    }

    /// Mean distance at `num` moments spread evenly over both motions, however long each is, metres.
    #[must_use]
    pub fn distance_over_course_m(&self, other: &Self, num: usize) -> f64 {
        let place = |poses: &Self, moment: usize| {
            let share = moment as f64 / (num.max(2) - 1) as f64;
            (share * (poses.num_frames() - 1) as f64).round() as usize
        };
        let moments = 0..num.max(2);
        let total: f64 =
            moments.map(|moment| self.distance_m(place(self, moment), other, place(other, moment))).sum();
        total / num.max(2) as f64
    }
}

/// A generated motion beside the recorded one.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PoseComparison {
    /// Mean distance over joints and the frames both have, mm.
    pub pose_mm: f64,
    /// Mean distance along the path of dynamic time warping, mm.
    pub warped_mm: f64,
    /// By how much the generated motion is later where both agree best, seconds; negative: earlier.
    pub start_offset_secs: f64,
    /// Mean distance over the common frames after that shift, mm.
    pub shifted_mm: f64,
}

impl PoseComparison {
    /// Compares two motions.
    ///
    /// Shifts leave at least half of the shorter motion in common; of equally good ones the smallest is taken.
    ///
    /// # Panics
    /// If rates or numbers of joints differ.
    #[must_use]
    pub fn new(generated: &Poses, recorded: &Poses) -> Self {
        assert!(
            generated.rate_hz == recorded.rate_hz && generated.num_joints == recorded.num_joints,
            "motions of one rate and body"
        );
        let (ours, theirs) = (generated.num_frames(), recorded.num_frames());
        let mean_at = |shift: isize| {
            // Frame t of the recording against frame t + shift of the generated motion.
            let first = (-shift).max(0) as usize;
            let last = theirs.min(ours.saturating_add_signed(-shift));
            let frames = first..last;
            let num = frames.len();
            let later = |frame: usize| frame.saturating_add_signed(shift);
            frames.map(|frame| generated.distance_m(later(frame), recorded, frame)).sum::<f64>() / num as f64
        };
        let common = ours.min(theirs).div_ceil(2) as isize;
        let shifts = (common - theirs as isize)..=(ours as isize - common);
        let mut best = (0, mean_at(0));
        for shift in shifts {
            let mean = mean_at(shift);
            if mean < best.1 || mean == best.1 && shift.abs() < isize::abs(best.0) {
                best = (shift, mean);
            }
        }
        let warped = mean_along_path(ours, theirs, |row, column| generated.distance_m(row, recorded, column));
        Self {
            pose_mm: MM_PER_M * mean_at(0),
            warped_mm: MM_PER_M * warped,
            start_offset_secs: best.0 as f64 / generated.rate_hz,
            shifted_mm: MM_PER_M * best.1,
        }
    }

    /// Scores of many comparisons, each a mean. Errors: 0 and above, lower is better. The start offset is signed, and its
    /// size apart, since early and late ones would cancel.
    #[must_use]
    pub fn measure(comparisons: &[Self]) -> Vec<Measurement> {
        type Pick = fn(&PoseComparison) -> f64;
        let scores: [(&str, &str, Pick); 5] = [
            ("pose-error", "mm", |found| found.pose_mm),
            ("dtw-error", "mm", |found| found.warped_mm),
            ("shifted-error", "mm", |found| found.shifted_mm),
            ("start-offset", "s", |found| found.start_offset_secs),
            ("start-offset-size", "s", |found| found.start_offset_secs.abs()),
        ];
        let measure = |(key, unit, pick): (&'static str, &str, Pick)| {
            let signature =
                Signature::new(key).with("unit", unit).with("frame", "root-place-and-heading").with("v", 1);
            Measurement::of_values(key, signature, comparisons.iter().map(pick).collect())
        };
        scores.into_iter().map(measure).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One joint that swings along x by 100 mm.
    fn swing(frames: usize, late_secs: f64) -> Poses {
        let place = |frame: usize| {
            let time = frame as f64 / 10.0 - late_secs;
            vec![[0.1 * (1.3 * time).sin() + 0.05 * (0.4 * time).cos(), 0.0, 0.0]]
        };
        Poses::new(10.0, &(0..frames).map(place).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn the_right_motion_at_the_wrong_moment_is_told() {
        let found = PoseComparison::new(&swing(120, 0.7), &swing(120, 0.0));
        assert!((found.start_offset_secs - 0.7).abs() < 1e-12, "{found:?}");
        assert!(found.shifted_mm < 1e-9 && found.pose_mm > 40.0 && found.warped_mm < 5.0, "{found:?}");
        let early = PoseComparison::new(&swing(120, -0.7), &swing(90, 0.0));
        assert!((early.start_offset_secs + 0.7).abs() < 1e-12, "{early:?}");
    }

    #[test]
    fn a_wrong_pose_stays_wrong() {
        let still = |x: f64, frames| Poses::new(10.0, &vec![vec![[x, 0.0, 0.0]]; frames]).unwrap();
        let found = PoseComparison::new(&still(0.3, 20), &still(0.0, 31));
        let close = |found: f64| (found - 300.0).abs() < 1e-9;
        assert!(close(found.pose_mm) && close(found.warped_mm) && close(found.shifted_mm), "{found:?}");
        assert_eq!(found.start_offset_secs, 0.0);
        assert!((still(0.3, 20).distance_over_course_m(&still(0.0, 31), 8) - 0.3).abs() < 1e-12);
    }

    #[test]
    fn a_motion_of_one_frame_is_compared() {
        let found = PoseComparison::new(&swing(1, 0.0), &swing(40, 0.0));
        assert_eq!((found.pose_mm, found.shifted_mm), (0.0, 0.0));
    }

    #[test]
    fn what_is_no_pose_is_named() {
        assert_eq!(Poses::new(10.0, &[]), Err(PosesError::Frames { found: 0 }));
        assert_eq!(Poses::new(0.0, &[vec![[0.0; 3]]]), Err(PosesError::Rate { rate_hz: 0.0 }));
        let ragged = Poses::new(10.0, &[vec![[0.0; 3]], vec![[0.0; 3]; 2]]);
        assert_eq!(ragged, Err(PosesError::Frame { frame: 1 }));
    }
}
