//! Scores of a motion (levels 0 and 1) and of a rollout (levels 2 and 3).
//!
//! In: a [`Motion`] or a [`Rollout`], with its humanoid. Out: [`Score`]s, sorted by key.
//! Nothing here steps the world or writes a file.
//!
//! Published metrics of one name differ in thresholds, points and units. Each [`Metric`] here therefore carries its
//! formula, the paper or code it follows, and a signature that names everything which changes the number.
//! A score that cannot be computed is absent; it is never NaN, and a failed rollout is never averaged over its good part.

mod balance;
mod effort;
mod fall;
mod forces;
mod ground;
mod imitation;
mod inverse;
mod joints;
mod kinematic;
mod metric;
mod penetrate;
mod polygon;
mod props;
mod registry;
mod self_contact;
mod skate;
mod slide;
mod smoothness;
mod success;
mod surface;
mod thresholds;
mod trace;
mod tracking;
mod travel;

pub use crate::simulation::FallCause;
pub use fall::{Fall, first_fall};
pub use metric::{Better, Metric, Score, explain};
pub use props::{Prop, PropSupport, prop_supports};
pub use registry::{METRICS, ROSETTA, find_metric};

use std::ops::Range;

use crate::humanoid::Humanoid;
use crate::motion::Motion;
use crate::simulation::{Level, Rollout};
use fall::Observed;
use inverse::Inverse;
use kinematic::Kinematic;

/// Level 0: what the motion alone shows, as this body performs it; the floor is the plane z = 0.
#[must_use]
pub fn kinematic_scores(humanoid: &Humanoid, motion: &Motion) -> Vec<Score> {
    Kinematic::new(humanoid, motion).scores(0..motion.num_frames())
}

/// Level 0 over windows of a motion, one after the other; a last shorter one is left out.
///
/// Accelerations come from the whole motion, so that a window's ends bend nothing.
#[must_use]
pub fn kinematic_windows(humanoid: &Humanoid, motion: &Motion, window_secs: f64) -> Vec<Vec<Score>> {
    let kinematic = Kinematic::new(humanoid, motion);
    windows(motion, window_secs).map(|frames| kinematic.scores(frames)).collect()
}

/// Level 1: what inverse dynamics cannot explain of a motion.
///
/// The floor is the plane z = 0; give it the motion of [`crate::simulation::Simulation::reference_motion`], which stands
/// there.
#[must_use]
pub fn inverse_scores(humanoid: &Humanoid, motion: &Motion) -> Vec<Score> {
    sorted(Inverse::new(humanoid, motion).scores(humanoid, &(0..motion.num_frames())))
}

/// Level 1 over the windows of [`kinematic_windows`]; a window of nothing but frames that are left out has few scores.
#[must_use]
pub fn inverse_windows(humanoid: &Humanoid, motion: &Motion, window_secs: f64) -> Vec<Vec<Score>> {
    let inverse = Inverse::new(humanoid, motion);
    windows(motion, window_secs).map(|frames| sorted(inverse.scores(humanoid, &frames))).collect()
}

/// Frames of whole windows.
fn windows(motion: &Motion, window_secs: f64) -> impl Iterator<Item = Range<usize>> {
    let length = ((window_secs * motion.rate_hz()).round() as usize).max(1);
    (0..motion.num_frames() / length).map(move |index| index * length..(index + 1) * length)
}

/// Levels 2 and 3: what a simulated motion shows, under the keys of the rollout's own level.
///
/// Empty for a rollout of another level. A failed rollout has only the scores that its good part decides.
#[must_use]
pub fn rollout_scores(humanoid: &Humanoid, rollout: &Rollout) -> Vec<Score> {
    if !matches!(rollout.level, Level::L2 | Level::L3) {
        return Vec::new();
    }
    let observed = Observed::new(rollout);
    let mut scores = fall::scores(humanoid, rollout);
    scores.extend(tracking::scores(rollout, &observed));
    scores.extend(imitation::scores(rollout, &observed));
    scores.extend(success::scores(humanoid, rollout, &observed));
    scores.extend(forces::scores(humanoid, rollout, &observed));
    scores.extend(effort::scores(humanoid, rollout, &observed));
    sorted(scores)
}

fn sorted(mut scores: Vec<Score>) -> Vec<Score> {
    scores.sort_by_key(|score| score.metric.key);
    scores
}
