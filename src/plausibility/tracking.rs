//! Levels 2 and 3: how far the simulated body is from the commanded one.

use nalgebra::Vector3;

use super::fall::Observed;
use super::metric::{Better, Metric, PerLevel, Score};
use super::trace::mean;
use crate::humanoid::NUM_SEGMENTS;
use crate::motion::NUM_JOINTS;
use crate::simulation::{Level, Rollout, RolloutSample};

const MM_PER_M: f64 = 1000.0;
const PHC: &str = "E_g-mpjpe and E_mpjpe of UHC and PHC (compute_metrics_lite in ZhengyiLuo/UniversalHumanoidControl: \
                   uhc/smpllib/smpl_eval.py)";

/// Mean position error in the world.
pub(super) static MPJPE_WORLD: PerLevel = PerLevel::new(
    "l2/mpjpe_world",
    "l3/mpjpe_world",
    Metric {
        key: "",
        title: "MPJPE world",
        unit: "mm",
        level: Level::L2,
        better: Better::Lower,
        formula: "mean over samples after the start state and over the 21 segment origins of |p - p_ref|",
        empty: "absent for one sample or a failed rollout",
        reference: PHC,
        signature: "points:21-segment-origins|frame:world|samples:after-start|v:1",
    },
);

/// Mean position error relative to the root.
pub(super) static MPJPE_ROOT: PerLevel = PerLevel::new(
    "l2/mpjpe_root",
    "l3/mpjpe_root",
    Metric {
        key: "",
        title: "MPJPE root",
        unit: "mm",
        level: Level::L2,
        better: Better::Lower,
        formula: "mean over samples after the start state and over the 21 segment origins, the root's zero included, of \
                  |(p - p_root) - (p_ref - p_ref,root)|; the root's translation is removed, its rotation is not",
        empty: "absent for one sample or a failed rollout",
        reference: PHC,
        signature: "points:21-segment-origins|frame:root-translation|samples:after-start|v:1",
    },
);

/// Root mean square joint error.
pub(super) static JOINT_RMS: PerLevel = PerLevel::new(
    "l2/joint_rms",
    "l3/joint_rms",
    Metric {
        key: "",
        title: "joint rms",
        unit: "rad",
        level: Level::L2,
        better: Better::Lower,
        formula: "square root of the mean over samples after the start state and the 44 joints of (q - q_ref)^2, \
                  differences taken to -pi..pi",
        empty: "absent for one sample or a failed rollout",
        reference: "this project",
        signature: "joints:44|wrap:pi|samples:after-start|v:1",
    },
);

/// Scores of a rollout's tracking; none when it failed, since the missing part cannot be averaged away.
pub(super) fn scores(rollout: &Rollout, observed: &Observed<'_>) -> Vec<Score> {
    if observed.failed_at_secs.is_some() {
        return Vec::new();
    }
    let samples = || observed.samples.iter().skip(1);
    [
        (&MPJPE_WORLD, mpjpe_world_mm(samples())),
        (&MPJPE_ROOT, mean(samples().map(|sample| mean_root_relative_distance_m(sample) * MM_PER_M))),
        (&JOINT_RMS, mean(samples().map(mean_square_joint_error)).map(f64::sqrt)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric.of(rollout.level), value?))
    .collect()
}

/// Mean distance over samples and segments, millimetres; `None` without samples.
pub(super) fn mpjpe_world_mm<'a>(samples: impl Iterator<Item = &'a RolloutSample>) -> Option<f64> {
    mean(samples.map(|sample| sample.mean_distance_m() * MM_PER_M))
}

/// As [`RolloutSample::mean_distance_m`] with both roots moved to one place, metres.
fn mean_root_relative_distance_m(sample: &RolloutSample) -> f64 {
    let errors = || {
        let pairs = sample.world_from_segment.iter().zip(&sample.reference_world_from_segment);
        pairs.map(|(pose, reference)| pose.translation.vector - reference.translation.vector)
    };
    let root_error: Vector3<f64> = errors().take(1).sum();
    errors().map(|error| (error - root_error).norm()).sum::<f64>() / NUM_SEGMENTS as f64
}

fn mean_square_joint_error(sample: &RolloutSample) -> f64 {
    let pairs = sample.joint_angles_rad.iter().zip(&sample.reference_joint_angles_rad);
    pairs.map(|(angle, reference)| wrapped_rad(angle - reference).powi(2)).sum::<f64>() / NUM_JOINTS as f64
}

/// The same angle within -pi..pi.
fn wrapped_rad(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}
