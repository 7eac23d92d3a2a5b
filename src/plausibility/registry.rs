//! The list of all metrics.

use super::metric::Metric;
use super::{
    balance, effort, fall, forces, ground, imitation, inverse, joints, penetrate, self_contact, skate, slide,
    smoothness, success, thresholds, tracking, travel,
};

/// Every metric, sorted by key.
pub static METRICS: &[&Metric] = &[
    &smoothness::ACCEL,
    &balance::COM_INSIDE,
    &balance::COM_MARGIN,
    &slide::HUMOR_CONTACT,
    &balance::COP_ERROR,
    &travel::DYNAMIC_DEGREE,
    &ground::FLOAT,
    &penetrate::FLOAT_CLOSD,
    &ground::FLOAT_INTEGRAL,
    &penetrate::FLOAT_MBENCH,
    &skate::RATIO,
    &smoothness::HEADING_SPEED,
    &travel::JERK,
    &smoothness::JITTER,
    &smoothness::JITTER_PER_FRAME,
    &joints::JERK,
    &joints::LIMIT_EXCESS,
    &joints::LIMIT_SHARE,
    &joints::SPEED_LIMIT_SHARE,
    &joints::SPEED_P95,
    &joints::SPEED_PEAK,
    &ground::LOWEST_MEDIAN,
    &ground::LOWEST_MIN,
    &balance::NO_SUPPORT,
    &penetrate::CLOSD,
    &penetrate::HUMOR_AT[0],
    &penetrate::HUMOR_AT[1],
    &penetrate::HUMOR_AT[2],
    &penetrate::HUMOR_AT[3],
    &penetrate::HUMOR_AT[4],
    &penetrate::HUMOR_AT[5],
    &penetrate::HUMOR_DEPTH,
    &penetrate::MBENCH,
    &penetrate::OMNI_SHARE,
    &penetrate::UHC,
    &ground::PENETRATION,
    &ground::PENETRATION_INTEGRAL,
    &penetrate::OMNI_DEPTH,
    &smoothness::PFC,
    &slide::PHYS_ERR,
    &travel::ROOT_SPEED_PEAK,
    &travel::ROOT_TURN_PEAK,
    &self_contact::DEPTH,
    &self_contact::SHARE,
    &skate::PER_SECOND,
    &slide::CLOSD,
    &skate::PER_FRAME,
    &slide::UHC,
    &slide::MBENCH,
    &slide::OMNI,
    &skate::SLOWEST_CONTACT,
    &smoothness::SOLE_EDGE,
    &smoothness::SOLE_TILT,
    &balance::ZMP_MARGIN,
    &balance::ZMP_OUTSIDE,
    &inverse::EDGE_SHARE,
    &inverse::FLIGHT_ERROR,
    &inverse::FLIGHT_SHARE,
    &thresholds::HICKS_FORCE_SHARE,
    &thresholds::HICKS_MOMENT_SHARE,
    &thresholds::HICKS_PASS,
    &thresholds::OPENSIM_GRADE,
    &inverse::POWER_LIMIT_SHARE,
    &inverse::POWER_PEAK,
    &inverse::FORCE_MEAN,
    &inverse::FORCE_EDGES,
    &inverse::FORCE_GATED,
    &thresholds::FORCE_MAX,
    &inverse::FORCE_P95,
    &thresholds::FORCE_RMS,
    &inverse::MOMENT_MEAN,
    &inverse::MOMENT_GATED,
    &thresholds::MOMENT_MAX,
    &thresholds::MOMENT_RMS,
    &inverse::TORQUE_LIMIT_SHARE,
    &inverse::TORQUE_PEAK,
    &forces::ASSIST_IMPULSE,
    &forces::ASSIST_MEAN,
    &forces::ASSIST_MOMENT_IMPULSE,
    &imitation::BODY_POSITION.l2,
    &imitation::BODY_ROTATION.l2,
    &fall::COMPLETED.l2,
    &fall::COMPLETED_TIME.l2,
    &effort::CONTACT_KEPT.l2,
    &forces::CONTACT_SHARE.l2,
    &effort::TRANSPORT.l2,
    &imitation::E_ACC.l2,
    &imitation::E_ACC_FRAME.l2,
    &imitation::E_VEL.l2,
    &imitation::E_VEL_FRAME.l2,
    &effort::EDGE_CONTACT.l2,
    &effort::ENERGY.l2,
    &effort::FOOT_SLIP.l2,
    &tracking::JOINT_RMS.l2,
    &imitation::JOINT_VELOCITY.l2,
    &imitation::LOCATION_FAIL_20.l2,
    &imitation::LOCATION_FAIL_50.l2,
    &fall::MPJPE_BEFORE_FALL.l2,
    &imitation::PA_MPJPE.l2,
    &tracking::MPJPE_ROOT.l2,
    &tracking::MPJPE_WORLD.l2,
    &effort::POWER_MEAN.l2,
    &effort::POWER_PEAK.l2,
    &imitation::ROOT_POSITION.l2,
    &imitation::ROOT_ROTATION.l2,
    &imitation::ROOT_TURN.l2,
    &imitation::ROOT_VELOCITY.l2,
    &fall::SUCCESS.l2,
    &success::STRICT.l2,
    &success::BEYOND.l2,
    &success::DEEPMIMIC.l2,
    &success::MAX.l2,
    &success::MIMICKIT.l2,
    &fall::SURVIVAL_FRACTION.l2,
    &fall::SURVIVED.l2,
    &fall::TIME_TO_FALL.l2,
    &forces::TORQUE_LIMIT_SHARE.l2,
    &imitation::TRAJECTORY_ERROR.l2,
    &imitation::TRAJECTORY_FAIL_20.l2,
    &imitation::TRAJECTORY_FAIL_50.l2,
    &forces::VERTICAL_FORCE_MEAN.l2,
    &forces::VERTICAL_FORCE_PEAK.l2,
    &imitation::BODY_POSITION.l3,
    &imitation::BODY_ROTATION.l3,
    &fall::COMPLETED.l3,
    &fall::COMPLETED_TIME.l3,
    &effort::CONTACT_KEPT.l3,
    &forces::CONTACT_SHARE.l3,
    &effort::TRANSPORT.l3,
    &imitation::E_ACC.l3,
    &imitation::E_ACC_FRAME.l3,
    &imitation::E_VEL.l3,
    &imitation::E_VEL_FRAME.l3,
    &effort::EDGE_CONTACT.l3,
    &effort::ENERGY.l3,
    &effort::FOOT_SLIP.l3,
    &tracking::JOINT_RMS.l3,
    &imitation::JOINT_VELOCITY.l3,
    &imitation::LOCATION_FAIL_20.l3,
    &imitation::LOCATION_FAIL_50.l3,
    &fall::MPJPE_BEFORE_FALL.l3,
    &imitation::PA_MPJPE.l3,
    &tracking::MPJPE_ROOT.l3,
    &tracking::MPJPE_WORLD.l3,
    &effort::POWER_MEAN.l3,
    &effort::POWER_PEAK.l3,
    &imitation::ROOT_POSITION.l3,
    &imitation::ROOT_ROTATION.l3,
    &imitation::ROOT_TURN.l3,
    &imitation::ROOT_VELOCITY.l3,
    &fall::SUCCESS.l3,
    &success::STRICT.l3,
    &success::BEYOND.l3,
    &success::DEEPMIMIC.l3,
    &success::MAX.l3,
    &success::MIMICKIT.l3,
    &fall::SURVIVAL_FRACTION.l3,
    &fall::SURVIVED.l3,
    &fall::TIME_TO_FALL.l3,
    &forces::TORQUE_LIMIT_SHARE.l3,
    &imitation::TRAJECTORY_ERROR.l3,
    &imitation::TRAJECTORY_FAIL_20.l3,
    &imitation::TRAJECTORY_FAIL_50.l3,
    &forces::VERTICAL_FORCE_MEAN.l3,
    &forces::VERTICAL_FORCE_PEAK.l3,
];

/// Metrics of one name and many definitions, side by side: all that call themselves penetration, float or skating.
pub const ROSETTA: &[(&str, &[&str])] = &[
    (
        "penetrate",
        &[
            "l0/penetration",
            "l0/penetrate_uhc",
            "l0/penetrate_closd",
            "l0/penetrate_mbench",
            "l0/penetrate_humor_depth",
            "l0/penetrate_humor_03cm",
            "l0/penetrate_omniretarget",
            "l0/penetration_max",
        ],
    ),
    ("float", &["l0/float", "l0/float_closd", "l0/float_mbench"]),
    (
        "skate",
        &[
            "l0/skate_per_frame",
            "l0/skate_uhc",
            "l0/skate_closd",
            "l0/foot_skate_ratio",
            "l0/slide_mbench",
            "l0/slide_omniretarget",
            "l0/slowest_contact_speed",
        ],
    ),
    ("sum", &["l0/phys_err"]),
];

/// The metric with this key.
#[must_use]
pub fn find_metric(key: &str) -> Option<&'static Metric> {
    METRICS.binary_search_by(|metric| metric.key.cmp(key)).ok().map(|index| METRICS[index])
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

    #[test]
    fn the_rosetta_names_metrics_that_exist() {
        for key in ROSETTA.iter().flat_map(|(_, keys)| *keys) {
            assert!(find_metric(key).is_some(), "{key}");
        }
    }
}
