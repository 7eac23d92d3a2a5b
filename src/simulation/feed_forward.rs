//! Joint moments the motion takes, known before the simulation: the springs then only correct.
//!
//! Inverse dynamics of the filtered motion with the contact forces that explain it best.
//! Without feed-forward a spring must be pulled out of place to carry weight, and the body sags and leans.

use nalgebra::Vector3;

use super::engine::GRAVITY_M_S2;
use crate::dynamics::{ExplanationSettings, explain};
use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::motion::Motion;

/// Moments found per second of motion.
const FRAMES_PER_SEC: f64 = 50.0;

/// Moment across the joint above every segment, acting on the segment, in the segment's own frame, N m.
pub(super) type SegmentMoments = [Vector3<f64>; NUM_SEGMENTS];

/// Joint moments over a motion.
pub(super) struct FeedForward {
    rate_hz: f64,
    frames: Vec<SegmentMoments>,
}

impl FeedForward {
    pub fn new(humanoid: &Humanoid, motion: &Motion, friction: f64) -> Self {
        // What the filter leaves is slower than half of this rate by far; more frames would only cost time.
        let stride = (motion.rate_hz() / FRAMES_PER_SEC).round().max(1.0) as usize;
        let settings = ExplanationSettings { friction, stride, ..ExplanationSettings::default() };
        let frames = explain(humanoid, motion, GRAVITY_M_S2, &settings)
            .into_iter()
            // The frames between the axes of a chain sit in the joint's centre, so its moment is that of its last link.
            .map(|frame| humanoid.segment_links.map(|link| frame.moments_in_link_nm[link]))
            .collect();
        Self { rate_hz: motion.rate_hz() / stride as f64, frames }
    }

    /// Moments at a time, linear between frames.
    pub fn at(&self, time_secs: f64) -> SegmentMoments {
        let last = self.frames.len() - 1;
        let position = (time_secs * self.rate_hz).clamp(0.0, last as f64);
        let frame = position.floor() as usize;
        let (before, after) = (&self.frames[frame], &self.frames[(frame + 1).min(last)]);
        let share = position - frame as f64;
        std::array::from_fn(|segment| before[segment] * (1.0 - share) + after[segment] * share)
    }
}
