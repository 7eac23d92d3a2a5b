//! Scores of a motion (levels 0 and 1) and of a rollout (levels 2 and 3).
//!
//! In: a [`Motion`] or a [`Rollout`], with its humanoid. Out: [`Score`]s, sorted by key.
//! Nothing here steps the world or writes a file.
//!
//! Published metrics of one name differ in thresholds, points and units. Each [`Metric`] here therefore carries its
//! formula, the paper or code it follows, and a signature that names everything which changes the number.
//! A score that cannot be computed is absent; it is never NaN, and a failed rollout is never averaged over its good part.

mod fall;
mod forces;
mod ground;
mod inverse;
mod joints;
mod metric;
mod skate;
mod solids;
mod trace;
mod tracking;
mod travel;

pub use fall::{Fall, FallCause, first_fall};
pub use metric::{Better, Metric, Score, explain};

use crate::humanoid::Humanoid;
use crate::motion::Motion;
use crate::simulation::{Level, Rollout};
use fall::Observed;
use trace::Trace;

/// Every metric, sorted by key.
pub static METRICS: &[&Metric] = &[
    &travel::DYNAMIC_DEGREE,
    &ground::FLOAT,
    &ground::FLOAT_INTEGRAL,
    &skate::RATIO,
    &travel::JERK,
    &joints::JERK,
    &joints::LIMIT_EXCESS,
    &joints::LIMIT_SHARE,
    &joints::SPEED_LIMIT_SHARE,
    &joints::SPEED_P95,
    &joints::SPEED_PEAK,
    &ground::LOWEST_MEDIAN,
    &ground::LOWEST_MIN,
    &ground::PENETRATION,
    &ground::PENETRATION_INTEGRAL,
    &travel::ROOT_SPEED_PEAK,
    &travel::ROOT_TURN_PEAK,
    &skate::PER_SECOND,
    &skate::PER_FRAME,
    &skate::SLOWEST_CONTACT,
    &inverse::FORCE_MEAN,
    &inverse::FORCE_GATED,
    &inverse::FORCE_P95,
    &inverse::MOMENT_MEAN,
    &inverse::TORQUE_LIMIT_SHARE,
    &forces::ASSIST_IMPULSE,
    &forces::ASSIST_MEAN,
    &forces::ASSIST_MOMENT_IMPULSE,
    &fall::COMPLETED.l2,
    &fall::COMPLETED_TIME.l2,
    &forces::CONTACT_SHARE.l2,
    &tracking::JOINT_RMS.l2,
    &fall::MPJPE_BEFORE_FALL.l2,
    &tracking::MPJPE_ROOT.l2,
    &tracking::MPJPE_WORLD.l2,
    &fall::SUCCESS.l2,
    &fall::SURVIVAL_FRACTION.l2,
    &fall::SURVIVED.l2,
    &fall::TIME_TO_FALL.l2,
    &forces::TORQUE_LIMIT_SHARE.l2,
    &forces::VERTICAL_FORCE_MEAN.l2,
    &forces::VERTICAL_FORCE_PEAK.l2,
    &fall::COMPLETED.l3,
    &fall::COMPLETED_TIME.l3,
    &forces::CONTACT_SHARE.l3,
    &tracking::JOINT_RMS.l3,
    &fall::MPJPE_BEFORE_FALL.l3,
    &tracking::MPJPE_ROOT.l3,
    &tracking::MPJPE_WORLD.l3,
    &fall::SUCCESS.l3,
    &fall::SURVIVAL_FRACTION.l3,
    &fall::SURVIVED.l3,
    &fall::TIME_TO_FALL.l3,
    &forces::TORQUE_LIMIT_SHARE.l3,
    &forces::VERTICAL_FORCE_MEAN.l3,
    &forces::VERTICAL_FORCE_PEAK.l3,
];

/// The metric with this key.
#[must_use]
pub fn find_metric(key: &str) -> Option<&'static Metric> {
    METRICS.binary_search_by(|metric| metric.key.cmp(key)).ok().map(|index| METRICS[index])
}

/// Level 0: what the motion alone shows, as this body performs it; the floor is the plane z = 0.
#[must_use]
pub fn kinematic_scores(humanoid: &Humanoid, motion: &Motion) -> Vec<Score> {
    let trace = Trace::new(humanoid, motion);
    let mut scores = joints::scores(humanoid, motion);
    scores.extend(travel::scores(motion, &trace));
    scores.extend(ground::scores(&trace));
    scores.extend(skate::scores(&trace));
    sorted(scores)
}

/// Level 1: what inverse dynamics cannot explain of a motion.
///
/// The floor is the plane z = 0; give it the motion of [`crate::simulation::Simulation::reference_motion`], which stands
/// there.
#[must_use]
pub fn inverse_scores(humanoid: &Humanoid, motion: &Motion) -> Vec<Score> {
    sorted(inverse::scores(humanoid, motion))
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
    scores.extend(forces::scores(humanoid, rollout, &observed));
    sorted(scores)
}

fn sorted(mut scores: Vec<Score>) -> Vec<Score> {
    scores.sort_by_key(|score| score.metric.key);
    scores
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_registry_is_sorted_and_every_entry_is_complete() {
        assert!(METRICS.is_sorted_by(|a, b| a.key < b.key), "sorted, no key twice");
        for metric in METRICS {
            let Metric { key, title, formula, empty, reference, signature, .. } = **metric;
            let level = metric.level.to_string().to_lowercase();
            assert!(
                key.strip_prefix(&level).is_some_and(|rest| rest.starts_with('/')),
                "{key} is at {level}"
            );
            assert!([title, formula, empty, reference].iter().all(|text| !text.is_empty()), "{key}");
            assert!(signature.split('|').next_back().is_some_and(|last| last.starts_with("v:")), "{key}");
            assert!(!signature.contains(char::is_whitespace), "{key}");
            assert_eq!(find_metric(key).map(|found| found.key), Some(key));
        }
        assert!(find_metric("l0/nothing").is_none());
    }
}
