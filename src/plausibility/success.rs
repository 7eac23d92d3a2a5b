//! Levels 2 and 3: the success rules of published trackers.

use nalgebra::Vector3;

use super::fall::Observed;
use super::metric::{Better, Metric, PerLevel, Score};
use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::simulation::{FallRule, LOST_TRACK_M, Level, Rollout, RolloutSample};

/// Strict distance of UHC and PHC, used in training, metres.
const STRICT_M: f64 = 0.25;
/// Height error of root, ankles and wrists that ends an episode of `BeyondMimic`, metres.
const BEYOND_HEIGHT_M: f64 = 0.25;
/// Difference of the vertical part of gravity in the root's frame that does too.
const BEYOND_TILT: f64 = 0.8;
/// Distance of any segment that ends an episode of `MimicKit`'s humanoid, metres.
const MIMICKIT_M: f64 = 1.0;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    level: Level::L2,
    better: Better::Higher,
    formula: "",
    empty: "1, or 0 when failed",
    reference: "",
    signature: "",
};

/// No segment far from the reference.
pub(super) static MAX: PerLevel = PerLevel::new(
    "l2/success_max",
    "l3/success_max",
    Metric {
        title: "success max 0.5 m",
        formula: "1 when no segment origin is ever more than 0.5 m from the reference in the world and the rollout did not \
                  fail; else 0",
        reference: "PHC with use_mean=False (ZhengyiLuo/PHC: phc/env/tasks/humanoid_im.py)",
        signature: "max21>0.5m|frame:world|any-sample|v:1",
        ..SHARED
    },
);

/// Mean of the segments near the reference.
pub(super) static STRICT: PerLevel = PerLevel::new(
    "l2/success_25cm",
    "l3/success_25cm",
    Metric {
        title: "success 0.25 m",
        formula: "as success, at 0.25 m: the distance that ends an episode in training",
        reference: "UHC and PHC (ZhengyiLuo/PHC: phc/env/tasks/humanoid_im.py)",
        signature: "mean21>0.25m|frame:world|any-sample|v:1",
        ..SHARED
    },
);

/// The termination of `BeyondMimic`.
pub(super) static BEYOND: PerLevel = PerLevel::new(
    "l2/success_beyondmimic",
    "l3/success_beyondmimic",
    Metric {
        title: "success BeyondMimic",
        formula: "1 when in every sample the root's height is within 0.25 m of the reference's, the vertical part of gravity in \
                  the root's frame within 0.8, and the height of every ankle and wrist within 0.25 m; else 0",
        reference: "BeyondMimic (HybridRobotics/whole_body_tracking: tracking_env_cfg.py); its anchor is the torso there, the \
                    pelvis here",
        signature: "anchor:pelvis|dz>0.25m|gravity-z>0.8|ankles+wrists-dz>0.25m|any-sample|v:1",
        ..SHARED
    },
);

/// The termination of `MimicKit`.
pub(super) static MIMICKIT: PerLevel = PerLevel::new(
    "l2/success_mimickit",
    "l3/success_mimickit",
    Metric {
        title: "success MimicKit",
        formula: "1 when no segment origin is ever more than 1 m from the reference in the world and the rollout did not fail; \
                  else 0",
        reference: "MimicKit's humanoid (xbpeng/MimicKit: data/envs/*.yaml, pose_termination_dist)",
        signature: "max21>1.0m|frame:world|any-sample|v:1",
        ..SHARED
    },
);

/// The termination of `DeepMimic`.
pub(super) static DEEPMIMIC: PerLevel = PerLevel::new(
    "l2/success_deepmimic",
    "l3/success_deepmimic",
    Metric {
        title: "success DeepMimic",
        formula: "1 when the floor never pushes a segment that is no part of a foot and the rollout did not fail; else 0; a \
                  motion that puts a hand on the floor fails",
        reference: "DeepMimic (Peng et al. 2018; xbpeng/DeepMimic: args, fall_contact_bodies)",
        signature: "contact:upward-force>0,non-foot|any-sample|v:1",
        ..SHARED
    },
);

pub(super) fn scores(humanoid: &Humanoid, rollout: &Rollout, observed: &Observed<'_>) -> Vec<Score> {
    let rule = FallRule::new(humanoid);
    let ends: Vec<usize> = ["left_foot", "right_foot", "left_hand", "right_hand"]
        .iter()
        .filter_map(|name| segment(humanoid, name))
        .collect();
    let farthest = |sample: &RolloutSample| {
        (0..NUM_SEGMENTS).map(|segment| error(sample, segment).norm()).fold(0.0, f64::max)
    };
    let beyond = |sample: &RolloutSample| {
        let up = |poses: &crate::simulation::SegmentPoses| (poses[0].rotation.inverse() * Vector3::z()).z;
        let tilt = up(&sample.world_from_segment) - up(&sample.reference_world_from_segment);
        error(sample, 0).z.abs() <= BEYOND_HEIGHT_M
            && tilt.abs() <= BEYOND_TILT
            && ends.iter().all(|&end| error(sample, end).z.abs() <= BEYOND_HEIGHT_M)
    };
    let on_feet = |sample: &RolloutSample| {
        sample.contacts.iter().all(|contact| !contact.bears_load() || rule.is_foot(contact.segment))
    };
    let holds = |rule: &dyn Fn(&RolloutSample) -> bool| {
        let holds = observed.failed_at_secs.is_none() && observed.samples.iter().all(rule);
        f64::from(u8::from(holds))
    };
    [
        (&MAX, holds(&|sample| farthest(sample) <= LOST_TRACK_M)),
        (&STRICT, holds(&|sample| sample.mean_distance_m() <= STRICT_M)),
        (&BEYOND, holds(&beyond)),
        (&MIMICKIT, holds(&|sample| farthest(sample) <= MIMICKIT_M)),
        (&DEEPMIMIC, holds(&on_feet)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric.of(rollout.level), value))
    .collect()
}

fn error(sample: &RolloutSample, segment: usize) -> Vector3<f64> {
    let (own, reference) = (&sample.world_from_segment, &sample.reference_world_from_segment);
    own[segment].translation.vector - reference[segment].translation.vector
}

/// Index of a segment by its link's name.
pub(super) fn segment(humanoid: &Humanoid, name: &str) -> Option<usize> {
    let link = humanoid.robot.tree.link_index(name)?;
    humanoid.segment_links.iter().position(|&other| other == link)
}
