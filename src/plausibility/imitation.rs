//! Levels 2 and 3: tracking error as other programs print it.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::fall::Observed;
use super::metric::{Better, Metric, PerLevel, Score};
use super::trace::{horizontal_m, mean};
use crate::humanoid::NUM_SEGMENTS;
use crate::simulation::{Level, Rollout, RolloutSample, SegmentPoses};

const MM_PER_M: f64 = 1000.0;
/// Deviations of the root that fail a trajectory, metres.
const NEAR_M: f64 = 0.2;
const FAR_M: f64 = 0.5;

const PHC: &str =
    "UHC and PHC (compute_metrics_lite in ZhengyiLuo/UniversalHumanoidControl: uhc/smpllib/smpl_eval.py)";
const GMD: &str = "GMD (korrawe/guided-motion-diffusion: data_loaders/humanml/utils/metrics.py)";
const MIMICKIT: &str = "the tracking error of MimicKit (xbpeng/MimicKit: mimickit/envs/deepmimic_env.py)";

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "mm",
    level: Level::L2,
    better: Better::Lower,
    formula: "",
    empty: "absent for one sample or a failed rollout",
    reference: PHC,
    signature: "",
};

macro_rules! per_level {
    ($name:ident, $key:literal, $doc:literal, { $($field:ident: $value:expr),* $(,)? }) => {
        #[doc = $doc]
        pub(super) static $name: PerLevel = PerLevel::new(
            concat!("l2/", $key),
            concat!("l3/", $key),
            Metric { $($field: $value,)* ..SHARED },
        );
    };
}

per_level!(PA_MPJPE, "mpjpe_pa", "Position error after alignment.", {
    title: "MPJPE PA",
    formula: "mean over samples after the start state and the 21 segment origins of |s R p + t - p_ref| for the s, R and t that \
              make the sum of squares least in each sample: pose alone, without place, heading and size",
    signature: "points:21-segment-origins|align:procrustes+scale|samples:after-start|v:1",
});
per_level!(E_VEL, "e_vel", "Velocity error.", {
    title: "E_vel",
    unit: "mm/s",
    formula: "mean over sample pairs and the 21 segment origins of |dp - dp_ref| / interval",
    signature: "points:21-segment-origins|frame:world|diff:backward|per:second|samples:all|v:1",
});
per_level!(E_VEL_FRAME, "e_vel_per_frame", "Velocity error per sample.", {
    title: "E_vel per frame",
    unit: "mm/frame",
    formula: "mean over sample pairs and the 21 segment origins of |dp - dp_ref|: e_vel times the interval; at the record \
              rate, so compare at equal rates only",
    signature: "points:21-segment-origins|frame:world|diff:backward|rate:record|samples:all|v:1",
});
per_level!(E_ACC, "e_acc", "Acceleration error.", {
    title: "E_acc",
    unit: "m/s^2",
    formula: "mean over samples and the 21 segment origins of |second difference of p - that of p_ref| / interval^2",
    signature: "points:21-segment-origins|frame:world|diff:second|per:second|samples:all|v:1",
});
per_level!(E_ACC_FRAME, "e_acc_per_frame", "Acceleration error per sample.", {
    title: "E_acc per frame",
    unit: "mm/frame^2",
    formula: "e_acc * interval^2 in millimetres; at the record rate, so compare at equal rates only",
    signature: "points:21-segment-origins|frame:world|diff:second|rate:record|samples:all|v:1",
});
per_level!(TRAJECTORY_ERROR, "trajectory_error", "Mean deviation of the root on the floor.", {
    title: "trajectory error",
    unit: "m",
    formula: "mean over samples after the start state of the horizontal distance of the root from the reference's",
    reference: GMD,
    signature: "point:root|plane:xy|samples:after-start|v:1",
});
per_level!(TRAJECTORY_FAIL_20, "trajectory_fail_20cm", "Whether the root was ever 20 cm off.", {
    title: "trajectory > 20 cm",
    unit: "",
    formula: "1 when the root is ever more than 0.2 m from the reference's on the floor, else 0; its mean over motions is the \
              trajectory error of the field",
    reference: GMD,
    signature: "point:root|plane:xy|any>0.2m|v:1",
});
per_level!(TRAJECTORY_FAIL_50, "trajectory_fail_50cm", "Whether the root was ever 50 cm off.", {
    title: "trajectory > 50 cm",
    unit: "",
    formula: "1 when the root is ever more than 0.5 m from the reference's on the floor, else 0",
    reference: GMD,
    signature: "point:root|plane:xy|any>0.5m|v:1",
});
per_level!(LOCATION_FAIL_20, "location_fail_20cm", "Share of samples with the root 20 cm off.", {
    title: "location > 20 cm",
    unit: "",
    formula: "share of samples with the root more than 0.2 m from the reference's on the floor; every sample is a key frame",
    reference: GMD,
    signature: "point:root|plane:xy|share>0.2m|v:1",
});
per_level!(LOCATION_FAIL_50, "location_fail_50cm", "Share of samples with the root 50 cm off.", {
    title: "location > 50 cm",
    unit: "",
    formula: "share of samples with the root more than 0.5 m from the reference's on the floor; every sample is a key frame",
    reference: GMD,
    signature: "point:root|plane:xy|share>0.5m|v:1",
});
per_level!(ROOT_POSITION, "root_position_error", "Root position error.", {
    title: "root position",
    unit: "m",
    formula: "mean over samples after the start state of |p_root - p_root,ref|",
    reference: MIMICKIT,
    signature: "point:root|frame:world|samples:after-start|v:1",
});
per_level!(ROOT_ROTATION, "root_rotation_error", "Root rotation error.", {
    title: "root rotation",
    unit: "rad",
    formula: "mean over samples after the start state of the angle between the root's rotation and the reference's",
    reference: MIMICKIT,
    signature: "root|angle:geodesic|samples:after-start|v:1",
});
per_level!(BODY_POSITION, "body_position_error", "Position error of the other segments about the root.", {
    title: "body position",
    unit: "m",
    formula: "mean over samples after the start state and the 20 segments but the root of \
              |(p - p_root) - (p_ref - p_root,ref)|",
    reference: MIMICKIT,
    signature: "points:20-segment-origins|frame:root-translation|samples:after-start|v:1",
});
per_level!(BODY_ROTATION, "body_rotation_error", "Rotation error of the other segments.", {
    title: "body rotation",
    unit: "rad",
    formula: "mean over samples after the start state and the 20 segments but the root of the angle between the segment's \
              rotation in the world and the reference's",
    reference: MIMICKIT,
    signature: "segments:20|frame:world|angle:geodesic|samples:after-start|v:1",
});
per_level!(JOINT_VELOCITY, "joint_velocity_error", "Joint speed error.", {
    title: "joint velocity",
    unit: "rad/s",
    formula: "mean over sample pairs and the 44 joints of |dq - dq_ref| / interval",
    reference: MIMICKIT,
    signature: "joints:44|diff:backward|per:second|v:1",
});
per_level!(ROOT_VELOCITY, "root_velocity_error", "Root velocity error.", {
    title: "root velocity",
    unit: "m/s",
    formula: "mean over sample pairs of |dp_root - dp_root,ref| / interval",
    reference: MIMICKIT,
    signature: "point:root|frame:world|diff:backward|per:second|v:1",
});
per_level!(ROOT_TURN, "root_turn_error", "Root angular velocity error.", {
    title: "root turn",
    unit: "rad/s",
    formula: "mean over sample pairs of |w - w_ref|, w the rotation vector of the root from one sample to the next / interval",
    reference: MIMICKIT,
    signature: "root|frame:world|diff:rotation-vector|per:second|v:1",
});

/// Scores of a rollout that did not fail.
pub(super) fn scores(rollout: &Rollout, observed: &Observed<'_>) -> Vec<Score> {
    if observed.failed_at_secs.is_some() {
        return Vec::new();
    }
    let level = rollout.level;
    let per_sec = 1.0 / rollout.sample_interval_secs;
    let samples = || observed.samples.iter().skip(1);
    let pairs = || observed.samples.windows(2);
    let root_off_m = || samples().map(|sample| horizontal_m(&error_m(sample, 0)));
    let step_m = |pair: &[RolloutSample], segment| error_m(&pair[1], segment) - error_m(&pair[0], segment);
    let e_vel = mean(pairs().map(|pair| over_segments(0, |segment| step_m(pair, segment).norm())));
    let e_acc = mean(observed.samples.windows(3).map(|triple| {
        over_segments(0, |segment| (step_m(&triple[1..], segment) - step_m(&triple[..2], segment)).norm())
    }));
    let any = |limit: f64| {
        samples().next()?;
        Some(f64::from(u8::from(root_off_m().any(|distance| distance > limit))))
    };
    let share = |limit: f64| mean(root_off_m().map(|distance| f64::from(distance > limit)));
    let angle = |sample: &RolloutSample, segment: usize| {
        let (own, reference) =
            (&sample.world_from_segment[segment], &sample.reference_world_from_segment[segment]);
        own.rotation.angle_to(&reference.rotation)
    };
    let joint_step = |pair: &[RolloutSample]| {
        let joints = 0..pair[0].joint_angles_rad.len();
        let steps = joints.map(|joint| {
            let step = pair[1].joint_angles_rad[joint] - pair[0].joint_angles_rad[joint];
            let wanted =
                pair[1].reference_joint_angles_rad[joint] - pair[0].reference_joint_angles_rad[joint];
            (step - wanted).abs()
        });
        mean(steps).unwrap_or(0.0)
    };
    let turn = |poses: fn(&RolloutSample) -> &SegmentPoses, pair: &[RolloutSample]| {
        let (before, after): (&Isometry3<f64>, &Isometry3<f64>) = (&poses(&pair[0])[0], &poses(&pair[1])[0]);
        (after.rotation * before.rotation.inverse()).scaled_axis()
    };
    [
        (&PA_MPJPE, mean(samples().map(|sample| aligned_error_m(sample) * MM_PER_M))),
        (&E_VEL, e_vel.map(|error| error * per_sec * MM_PER_M)),
        (&E_VEL_FRAME, e_vel.map(|error| error * MM_PER_M)),
        (&E_ACC, e_acc.map(|error| error * per_sec * per_sec)),
        (&E_ACC_FRAME, e_acc.map(|error| error * MM_PER_M)),
        (&TRAJECTORY_ERROR, mean(root_off_m())),
        (&TRAJECTORY_FAIL_20, any(NEAR_M)),
        (&TRAJECTORY_FAIL_50, any(FAR_M)),
        (&LOCATION_FAIL_20, share(NEAR_M)),
        (&LOCATION_FAIL_50, share(FAR_M)),
        (&ROOT_POSITION, mean(samples().map(|sample| error_m(sample, 0).norm()))),
        (&ROOT_ROTATION, mean(samples().map(|sample| angle(sample, 0)))),
        (
            &BODY_POSITION,
            mean(samples().map(|sample| {
                over_segments(1, |segment| (error_m(sample, segment) - error_m(sample, 0)).norm())
            })),
        ),
        (&BODY_ROTATION, mean(samples().map(|sample| over_segments(1, |segment| angle(sample, segment))))),
        (&JOINT_VELOCITY, mean(pairs().map(|pair| joint_step(pair) * per_sec))),
        (&ROOT_VELOCITY, mean(pairs().map(|pair| step_m(pair, 0).norm() * per_sec))),
        (
            &ROOT_TURN,
            mean(pairs().map(|pair| {
                let own = turn(|sample| &sample.world_from_segment, pair);
                let wanted = turn(|sample| &sample.reference_world_from_segment, pair);
                (own - wanted).norm() * per_sec
            })),
        ),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric.of(level), value?))
    .collect()
}

/// Distance of a segment's origin from the reference, metres.
fn error_m(sample: &RolloutSample, segment: usize) -> Vector3<f64> {
    let (own, reference) = (&sample.world_from_segment, &sample.reference_world_from_segment);
    own[segment].translation.vector - reference[segment].translation.vector
}

/// Mean over the segments from the `first` on.
fn over_segments(first: usize, value: impl Fn(usize) -> f64) -> f64 {
    (first..NUM_SEGMENTS).map(value).sum::<f64>() / (NUM_SEGMENTS - first) as f64
}

/// Mean distance after the best similarity transform (Umeyama 1991, IEEE PAMI 13:376), metres.
fn aligned_error_m(sample: &RolloutSample) -> f64 {
    let points = |poses: &SegmentPoses| poses.map(|pose| pose.translation.vector);
    let (own, reference) = (points(&sample.world_from_segment), points(&sample.reference_world_from_segment));
    let middle =
        |points: &[Vector3<f64>; NUM_SEGMENTS]| points.iter().sum::<Vector3<f64>>() / NUM_SEGMENTS as f64;
    let (own_middle, reference_middle) = (middle(&own), middle(&reference));
    let mut covariance = Matrix3::zeros();
    let mut spread = 0.0;
    for (own, reference) in own.iter().zip(&reference) {
        covariance += (reference - reference_middle) * (own - own_middle).transpose();
        spread += (own - own_middle).norm_squared();
    }
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return f64::NAN };
    // A mirror image is no rotation.
    let mut signs = Vector3::new(1.0, 1.0, 1.0);
    signs[svd.singular_values.imin()] = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&signs) * v_t;
    let scale = if spread > 0.0 { svd.singular_values.dot(&signs) / spread } else { 1.0 };
    over_segments(0, |segment| {
        let aligned = rotation * (own[segment] - own_middle) * scale + reference_middle;
        (aligned - reference[segment]).norm()
    })
}
