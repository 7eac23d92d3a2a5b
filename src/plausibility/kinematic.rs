//! Level 0 of a motion, whole or in parts.

use std::ops::Range;

use super::balance::{self, Balance};
use super::metric::Score;
use super::trace::Trace;
use super::{ground, joints, penetrate, self_contact, skate, slide, smoothness, sorted, travel};
use crate::humanoid::Humanoid;
use crate::motion::Motion;

/// A motion measured frame by frame.
pub(super) struct Kinematic<'a> {
    humanoid: &'a Humanoid,
    motion: &'a Motion,
    trace: Trace,
    balance: Vec<Balance>,
}

impl<'a> Kinematic<'a> {
    pub(super) fn new(humanoid: &'a Humanoid, motion: &'a Motion) -> Self {
        let trace = Trace::new(humanoid, motion);
        let balance = balance::balance(humanoid, motion, &trace);
        Self { humanoid, motion, trace, balance }
    }

    /// Scores over some frames in a row, at least one.
    pub(super) fn scores(&self, frames: Range<usize>) -> Vec<Score> {
        let trace = self.trace.window(frames.clone());
        let rate_hz = self.motion.rate_hz();
        let mut scores = joints::scores(self.humanoid, &self.motion.frames()[frames.clone()], rate_hz);
        scores.extend(travel::scores(&trace));
        scores.extend(ground::scores(&trace));
        scores.extend(skate::scores(&trace));
        scores.extend(penetrate::scores(&trace));
        let slides = slide::scores(&trace, &scores);
        scores.extend(slides);
        scores.extend(smoothness::scores(&trace));
        scores.extend(balance::scores(&trace, &self.balance[frames]));
        scores.extend(self_contact::scores(&trace));
        sorted(scores)
    }
}
