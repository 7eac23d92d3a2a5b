//! Levels 2 and 3: how far a rollout got, and when the body fell.

use nalgebra::Isometry3;

use super::metric::{Better, Metric, PerLevel, Score};
use super::tracking;
use crate::humanoid::Humanoid;
use crate::simulation::{FallCause, FallRule, LOST_TRACK_M, Level, Outcome, Rollout, RolloutSample};

const SUCCESS_REFERENCE: &str = "UHC and PHC (ZhengyiLuo/PHC: phc/env/tasks/humanoid_im.py, \
                                 phc/learning/im_amp_players.py: mean over bodies, 0.5 m)";
const FALL_SIGNATURE: &str = "fall:mean21>0.5m|body-on-floor,unless-reference<=50mm|failed|v:1";

/// Share of the motion that was simulated.
pub(super) static COMPLETED: PerLevel = PerLevel::new(
    "l2/completed",
    "l3/completed",
    Metric {
        key: "",
        title: "completed",
        unit: "",
        level: Level::L2,
        better: Better::Higher,
        formula: "1 when the whole motion was simulated, upright or not; \
                  else the time at which the state became unusable / duration of the motion",
        empty: "1, or 0 when failed",
        reference: "this project",
        signature: "failed:outcome-or-nonfinite-sample|v:1",
    },
);

/// Time that was simulated.
pub(super) static COMPLETED_TIME: PerLevel = PerLevel::new(
    "l2/completed_time",
    "l3/completed_time",
    Metric {
        key: "",
        title: "completed time",
        unit: "s",
        level: Level::L2,
        better: Better::Neither,
        formula: "duration of the motion when all of it was simulated, else the time at which the state became unusable",
        empty: "0",
        reference: "this project",
        signature: "failed:outcome-or-nonfinite-sample|v:1",
    },
);

/// Time of the first fall.
pub(super) static TIME_TO_FALL: PerLevel = PerLevel::new(
    "l2/time_to_fall",
    "l3/time_to_fall",
    Metric {
        key: "",
        title: "time to fall",
        unit: "s",
        level: Level::L2,
        better: Better::Higher,
        formula: "time of the first sample with mean distance of the 21 segment origins from the reference > 0.5 m, or \
                  with an upward floor force on a segment other than the feet whose reference is over 50 mm high, or \
                  of the failure; the motion's duration, censored, when there is none (survived = 1)",
        empty: "0",
        reference: "contact rule: DeepMimic (Peng et al. 2018); distance rule: UHC and PHC",
        signature: FALL_SIGNATURE,
    },
);

/// Whether the body never fell.
pub(super) static SURVIVED: PerLevel = PerLevel::new(
    "l2/survived",
    "l3/survived",
    Metric {
        key: "",
        title: "survived",
        unit: "",
        level: Level::L2,
        better: Better::Higher,
        formula: "1 when there is no fall in the sense of time_to_fall, which is then censored; else 0",
        empty: "1, or 0 when failed",
        reference: "contact rule: DeepMimic (Peng et al. 2018); distance rule: UHC and PHC",
        signature: FALL_SIGNATURE,
    },
);

/// Share of the motion before the fall.
pub(super) static SURVIVAL_FRACTION: PerLevel = PerLevel::new(
    "l2/survival_fraction",
    "l3/survival_fraction",
    Metric {
        key: "",
        title: "survival fraction",
        unit: "",
        level: Level::L2,
        better: Better::Higher,
        formula: "time_to_fall / duration of the motion",
        empty: "1, or 0 when failed",
        reference: "contact rule: DeepMimic (Peng et al. 2018); distance rule: UHC and PHC",
        signature: FALL_SIGNATURE,
    },
);

/// Whether tracking succeeded by the 0.5 m rule.
pub(super) static SUCCESS: PerLevel = PerLevel::new(
    "l2/success",
    "l3/success",
    Metric {
        key: "",
        title: "success 0.5 m",
        unit: "",
        level: Level::L2,
        better: Better::Higher,
        formula: "1 when the mean distance of the 21 segment origins from the reference, in the world, is <= 0.5 m in \
                  every sample and the rollout did not fail; else 0",
        empty: "1, or 0 when failed",
        reference: SUCCESS_REFERENCE,
        signature: "mean21>0.5m|frame:world|any-sample|v:1",
    },
);

/// Tracking error before the fall.
pub(super) static MPJPE_BEFORE_FALL: PerLevel = PerLevel::new(
    "l2/mpjpe_before_fall",
    "l3/mpjpe_before_fall",
    Metric {
        key: "",
        title: "MPJPE before fall",
        unit: "mm",
        level: Level::L2,
        better: Better::Lower,
        formula: "mpjpe_world over the samples after the start state and before time_to_fall",
        empty: "absent without such a sample",
        reference: SUCCESS_REFERENCE,
        signature: "points:21-segment-origins|frame:world|samples:after-start,before-fall|\
                    fall:mean21>0.5m|body-on-floor,unless-reference<=50mm|failed|v:1",
    },
);

/// A fall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fall {
    /// When, seconds since the start of the motion.
    pub time_secs: f64,
    /// Why.
    pub cause: FallCause,
}

/// The first fall of a rollout, as defined by the metric `l3/time_to_fall`; `None` when the body never fell.
#[must_use]
pub fn first_fall(humanoid: &Humanoid, rollout: &Rollout) -> Option<Fall> {
    let observed = Observed::new(rollout);
    let rule = FallRule::new(humanoid);
    let in_sample = observed.samples.iter().find_map(|sample| {
        let cause = rule.fall(sample)?;
        Some(Fall { time_secs: sample.time_secs, cause })
    });
    // Samples end where a rollout fails, so a fall seen in one came first.
    in_sample.or_else(|| Some(Fall { time_secs: observed.failed_at_secs?, cause: FallCause::Failed }))
}

/// The usable part of a rollout.
pub(super) struct Observed<'a> {
    /// Samples before the first that holds a non-finite number.
    pub samples: &'a [RolloutSample],
    /// When the state became unusable, if it did.
    pub failed_at_secs: Option<f64>,
}

impl<'a> Observed<'a> {
    pub(super) fn new(rollout: &'a Rollout) -> Self {
        let is_broken = |sample: &RolloutSample| !is_finite(sample);
        let usable = rollout.samples.iter().position(is_broken).unwrap_or(rollout.samples.len());
        let samples = &rollout.samples[..usable];
        let last_secs = samples.last().map_or(0.0, |sample| sample.time_secs);
        let duration_secs = rollout.motion_duration_secs;
        let failed_at_secs = match rollout.outcome {
            // The simulation states the time; a state that broke earlier is believed over it.
            Outcome::Failed { time_secs, .. } if usable == rollout.samples.len() => {
                Some(time_secs.clamp(0.0, duration_secs))
            }
            Outcome::Completed if usable == rollout.samples.len() && usable > 0 => None,
            Outcome::Failed { .. } | Outcome::Completed => Some(last_secs),
        };
        Self { samples, failed_at_secs }
    }
}

/// Scores of a rollout's progress.
pub(super) fn scores(humanoid: &Humanoid, rollout: &Rollout) -> Vec<Score> {
    let level = rollout.level;
    let duration_secs = rollout.motion_duration_secs;
    let observed = Observed::new(rollout);
    let fall = first_fall(humanoid, rollout);
    let share = |time_secs: Option<f64>| match time_secs {
        None => 1.0,
        Some(_) if duration_secs <= 0.0 => 0.0,
        Some(time_secs) => time_secs / duration_secs,
    };
    let flag = |holds: bool| f64::from(u8::from(holds));
    let fall_secs = fall.map(|fall| fall.time_secs);
    let is_tracked = observed.failed_at_secs.is_none()
        && observed.samples.iter().all(|sample| sample.mean_distance_m() <= LOST_TRACK_M);
    let before = observed
        .samples
        .iter()
        .skip(1)
        .filter(|sample| fall_secs.is_none_or(|fall_secs| sample.time_secs < fall_secs));
    [
        (&COMPLETED, Some(share(observed.failed_at_secs))),
        (&COMPLETED_TIME, Some(observed.failed_at_secs.unwrap_or(duration_secs))),
        (&TIME_TO_FALL, Some(fall_secs.unwrap_or(duration_secs))),
        (&SURVIVED, Some(flag(fall.is_none()))),
        (&SURVIVAL_FRACTION, Some(share(fall_secs))),
        (&SUCCESS, Some(flag(is_tracked))),
        (&MPJPE_BEFORE_FALL, tracking::mpjpe_world_mm(before)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric.of(level), value?))
    .collect()
}

fn is_finite(sample: &RolloutSample) -> bool {
    let pose_is_finite = |pose: &Isometry3<f64>| {
        pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|value| value.is_finite())
    };
    let all_finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    sample.time_secs.is_finite()
        && sample.world_from_segment.iter().all(pose_is_finite)
        && sample.reference_world_from_segment.iter().all(pose_is_finite)
        && all_finite(&sample.joint_angles_rad)
        && all_finite(&sample.reference_joint_angles_rad)
        && all_finite(&sample.joint_velocities_rad_s)
        && all_finite(&sample.joint_torques_nm)
        && all_finite(sample.assist_force_n.as_slice())
        && all_finite(sample.assist_moment_nm.as_slice())
        && sample.contacts.iter().all(|contact| {
            all_finite(contact.force_n.as_slice()) && all_finite(contact.position_m.coords.as_slice())
        })
}
