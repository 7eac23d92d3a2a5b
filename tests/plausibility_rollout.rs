//! Level 2 and 3 scores on rollouts made by hand, against values worked out by hand.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::LazyLock;

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, NUM_JOINTS};
use rprae::plausibility::{Fall, FallCause, METRICS, first_fall, rollout_scores};
use rprae::simulation::{Contact, GRAVITY_M_S2, Level, Outcome, Rollout, RolloutSample, SimulationSettings};

const BODY: Body = Body { height_m: 1.75, mass_kg: 70.0 };
static HUMANOID: LazyLock<Humanoid> = LazyLock::new(|| Humanoid::new(BODY).unwrap());
const INTERVAL_SECS: f64 = 0.01;
const DURATION_SECS: f64 = 2.0;
const NUM_INTERVALS: usize = 200;

fn segment(name: &str) -> usize {
    let humanoid = &*HUMANOID;
    let link = humanoid.robot.tree.link_index(name).unwrap();
    humanoid.segment_links.iter().position(|&other| other == link).unwrap()
}

fn push(name: &str, newtons: f64) -> Contact {
    Contact { segment: segment(name), position_m: Point3::origin(), force_n: Vector3::new(0.0, 0.0, newtons) }
}

/// Two seconds of perfect standing on one foot, changed by `change(sample index, sample)`.
fn rollout(level: Level, change: impl Fn(usize, &mut RolloutSample)) -> Rollout {
    let humanoid = &*HUMANOID;
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = humanoid.standing_root_height_m();
    let links = humanoid.forward(&frame);
    let poses = humanoid.segment_links.map(|link| links[link]);
    let weight = push("left_foot", BODY.mass_kg * GRAVITY_M_S2);
    let samples = (0..=NUM_INTERVALS)
        .map(|index| {
            let mut sample = RolloutSample {
                time_secs: index as f64 * INTERVAL_SECS,
                world_from_segment: poses,
                reference_world_from_segment: poses,
                joint_angles_rad: [0.0; NUM_JOINTS],
                joint_velocities_rad_s: [0.0; NUM_JOINTS],
                joint_torques_nm: [0.0; NUM_JOINTS],
                reference_joint_angles_rad: [0.0; NUM_JOINTS],
                assist_force_n: Vector3::zeros(),
                assist_moment_nm: Vector3::zeros(),
                contacts: if index == 0 { Vec::new() } else { vec![weight] },
            };
            change(index, &mut sample);
            sample
        })
        .collect();
    Rollout {
        level,
        settings: SimulationSettings::default(),
        sample_interval_secs: INTERVAL_SECS,
        motion_duration_secs: DURATION_SECS,
        samples,
        events: Vec::new(),
        outcome: Outcome::Completed,
        max_joint_drift_m: 0.0,
    }
}

fn shift(pose: &mut Isometry3<f64>, by: Vector3<f64>) {
    *pose = Translation3::from(by) * *pose;
}

type Scores = BTreeMap<&'static str, f64>;

/// The metrics of this file at both levels; those that other programs print are in `plausibility_published.rs`.
const OWN: [&str; 17] = [
    "assist_impulse",
    "assist_mean",
    "assist_moment_impulse",
    "completed",
    "completed_time",
    "contact_share",
    "joint_rms",
    "mpjpe_before_fall",
    "mpjpe_root",
    "mpjpe_world",
    "success",
    "survival_fraction",
    "survived",
    "time_to_fall",
    "torque_limit_share",
    "vertical_force_mean",
    "vertical_force_peak",
];

fn is_own(key: &str) -> bool {
    key.split_once('/').is_some_and(|(_, name)| OWN.contains(&name))
}

fn score(rollout: &Rollout) -> Scores {
    let scores = rollout_scores(&HUMANOID, rollout);
    assert!(scores.is_sorted_by(|a, b| a.metric.key < b.metric.key));
    assert!(scores.iter().all(|score| score.metric.level == rollout.level && score.value.is_finite()));
    let own = scores.iter().filter(|score| is_own(score.metric.key));
    own.map(|score| (score.metric.key, score.value)).collect()
}

/// Scores at L2 of a changed rollout, after checking that those not named are as in perfect standing.
#[track_caller]
fn changed(change: impl Fn(usize, &mut RolloutSample), expected: &[(&str, f64)]) {
    let clean = score(&rollout(Level::L2, |_, _| {}));
    let scores = score(&rollout(Level::L2, change));
    assert_eq!(scores.len(), clean.len(), "{scores:?}");
    for (key, &value) in &scores {
        let expected = expected.iter().find(|(name, _)| name == key).map_or(clean[key], |found| found.1);
        assert!((value - expected).abs() < 1e-9, "{key} is {value}, expected {expected}");
    }
}

/// Metrics that are one in perfect standing.
const ONES: [&str; 7] = [
    "l2/completed",
    "l2/contact_share",
    "l2/success",
    "l2/survival_fraction",
    "l2/survived",
    "l2/vertical_force_mean",
    "l2/vertical_force_peak",
];

#[test]
fn perfect_standing_carries_one_body_weight_and_nothing_else() {
    let scores = score(&rollout(Level::L2, |_, _| {}));
    let all: Vec<_> =
        METRICS.iter().map(|metric| metric.key).filter(|key| key.starts_with("l2/") && is_own(key)).collect();
    assert_eq!(scores.keys().copied().collect::<Vec<_>>(), all);
    for (key, value) in scores {
        let expected = match key {
            "l2/completed_time" | "l2/time_to_fall" => DURATION_SECS,
            _ if ONES.contains(&key) => 1.0,
            _ => 0.0,
        };
        assert!((value - expected).abs() < 1e-12, "{key} is {value}, expected {expected}");
    }
}

#[test]
fn level_3_has_its_own_keys_and_no_assist() {
    let level_2 = score(&rollout(Level::L2, |_, _| {}));
    let level_3 = score(&rollout(Level::L3, |_, _| {}));
    let expected: Vec<_> = level_2
        .keys()
        .filter(|key| !key.contains("assist"))
        .map(|key| key.replacen("l2/", "l3/", 1))
        .collect();
    assert_eq!(level_3.keys().copied().collect::<Vec<_>>(), expected);
    assert!(rollout_scores(&HUMANOID, &rollout(Level::L0, |_, _| {})).is_empty());
}

#[test]
fn a_displaced_body_errs_in_the_world_but_not_about_its_root() {
    changed(
        |_, sample| {
            for pose in &mut sample.world_from_segment {
                shift(pose, Vector3::new(0.018, 0.024, 0.0));
            }
        },
        &[("l2/mpjpe_world", 30.0), ("l2/mpjpe_before_fall", 30.0)],
    );
}

#[test]
fn one_displaced_segment_is_one_of_twenty_one() {
    let hand = segment("left_hand");
    changed(
        |_, sample| shift(&mut sample.world_from_segment[hand], Vector3::new(0.0, 0.0, 0.042)),
        &[("l2/mpjpe_world", 2.0), ("l2/mpjpe_root", 2.0), ("l2/mpjpe_before_fall", 2.0)],
    );
}

#[test]
fn a_displaced_root_moves_all_others_relative_to_it() {
    changed(
        |_, sample| shift(&mut sample.world_from_segment[0], Vector3::new(0.021, 0.0, 0.0)),
        &[("l2/mpjpe_world", 1.0), ("l2/mpjpe_root", 20.0), ("l2/mpjpe_before_fall", 1.0)],
    );
}

#[test]
fn the_start_state_is_not_counted() {
    changed(
        |index, sample| {
            if index == 0 {
                shift(&mut sample.world_from_segment[0], Vector3::new(0.1, 0.0, 0.0));
                sample.joint_angles_rad[3] = 1.0;
            }
        },
        &[],
    );
}

#[test]
fn joint_error_is_the_root_of_the_mean_square_and_knows_full_turns() {
    changed(|_, sample| sample.joint_angles_rad = [0.1; NUM_JOINTS], &[("l2/joint_rms", 0.1)]);
    changed(|_, sample| sample.joint_angles_rad[7] = 0.1, &[("l2/joint_rms", 0.1 / 44.0_f64.sqrt())]);
    changed(|_, sample| sample.joint_angles_rad[7] = TAU, &[]);
}

#[test]
fn an_assist_of_ten_newtons_for_two_seconds_on_seventy_kilograms() {
    changed(
        |index, sample| {
            if index > 0 {
                sample.assist_force_n = Vector3::new(6.0, 0.0, 8.0);
                sample.assist_moment_nm = Vector3::new(0.0, -3.5, 0.0);
            }
        },
        &[
            ("l2/assist_impulse", 20.0 / 70.0),
            ("l2/assist_moment_impulse", 0.1),
            ("l2/assist_mean", 100.0 * 10.0 / (70.0 * GRAVITY_M_S2)),
        ],
    );
}

#[test]
fn an_assist_that_alternates_does_not_cancel() {
    let sign = |index: usize| if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    changed(
        |index, sample| sample.assist_force_n = Vector3::new(7.0 * sign(index), 0.0, 0.0),
        &[("l2/assist_impulse", 0.2), ("l2/assist_mean", 100.0 * 7.0 / (70.0 * GRAVITY_M_S2))],
    );
}

#[test]
fn torque_at_the_limit_for_a_quarter_of_the_time() {
    let humanoid = &*HUMANOID;
    let mut limits_nm = [0.0; NUM_JOINTS];
    for (angle, &kit) in humanoid.kit_of_angle().iter().enumerate() {
        limits_nm[kit] = humanoid.robot.limits[angle].effort_nm;
    }
    let quarter = |index: usize| index % 4 == 1;
    changed(
        |index, sample| {
            if quarter(index) {
                sample.joint_torques_nm = limits_nm.map(|limit| -0.99 * limit);
            }
        },
        &[("l2/torque_limit_share", 0.25)],
    );
    changed(
        |index, sample| {
            if quarter(index) {
                sample.joint_torques_nm[20] = limits_nm[20];
            }
        },
        &[("l2/torque_limit_share", 0.25 / 44.0)],
    );
    changed(|_, sample| sample.joint_torques_nm = limits_nm.map(|limit| 0.98 * limit), &[]);
}

#[test]
fn ground_forces_add_up_and_an_empty_contact_is_none() {
    let weight_n = BODY.mass_kg * GRAVITY_M_S2;
    changed(
        |index, sample| {
            // Half of the time two feet with 1.5 and 0.5 body weights, half of the time a touch without force.
            sample.contacts = match index {
                0 => Vec::new(),
                1..=100 => vec![push("left_toes", 1.5 * weight_n), push("right_foot", 0.5 * weight_n)],
                _ => vec![push("right_foot", 0.0)],
            };
        },
        &[("l2/contact_share", 0.5), ("l2/vertical_force_peak", 2.0)],
    );
}

fn touch_floor_with_hand(index: usize, sample: &mut RolloutSample) {
    if index >= 100 {
        sample.contacts.push(push("left_hand", 1e-3));
    }
}

#[test]
fn a_hand_on_the_floor_is_a_fall_though_tracking_succeeds() {
    let fallen = rollout(Level::L3, touch_floor_with_hand);
    let cause = FallCause::BodyOnFloor { segment: segment("left_hand") };
    assert_eq!(first_fall(&HUMANOID, &fallen), Some(Fall { time_secs: 1.0, cause }));
    let scores = score(&fallen);
    assert_eq!(scores["l3/time_to_fall"], 1.0);
    assert_eq!(scores["l3/survived"], 0.0);
    assert_eq!(scores["l3/survival_fraction"], 0.5);
    assert_eq!(scores["l3/success"], 1.0);
    assert_eq!(scores["l3/completed"], 1.0);
}

#[test]
fn a_hand_the_reference_puts_on_the_floor_is_no_fall() {
    let hand = segment("left_hand");
    let planned = rollout(Level::L3, |index, sample| {
        touch_floor_with_hand(index, sample);
        // Palm up on the floor: the hand capsule ends 105 mm below its origin at 1 m height.
        let reach_m = 0.105 * BODY.height_m;
        for poses in [&mut sample.world_from_segment, &mut sample.reference_world_from_segment] {
            poses[hand].translation.z = reach_m + 0.049;
        }
    });
    assert_eq!(first_fall(&HUMANOID, &planned), None);
    assert_eq!(score(&planned)["l3/survived"], 1.0);
}

#[test]
fn a_foot_may_touch_the_floor_wherever_the_reference_has_it() {
    let stumble = rollout(Level::L3, |_, sample| {
        sample.contacts.push(push("right_toes", 100.0));
        sample.contacts.push(push("right_midfoot", 100.0));
        for part in ["right_toes", "right_midfoot", "right_foot"] {
            sample.reference_world_from_segment[segment(part)].translation.z += 0.3;
        }
    });
    assert_eq!(first_fall(&HUMANOID, &stumble), None);
}

#[test]
fn beyond_half_a_metre_the_body_is_lost() {
    let drift = |metres: f64| {
        move |index: usize, sample: &mut RolloutSample| {
            if index >= 50 {
                for pose in &mut sample.world_from_segment {
                    shift(pose, Vector3::new(metres, 0.0, 0.0));
                }
            }
        }
    };
    let near = score(&rollout(Level::L3, drift(0.499)));
    assert_eq!((near["l3/success"], near["l3/survived"]), (1.0, 1.0));
    let lost = rollout(Level::L3, drift(0.501));
    assert_eq!(first_fall(&HUMANOID, &lost), Some(Fall { time_secs: 0.5, cause: FallCause::Lost }));
    let scores = score(&lost);
    assert_eq!((scores["l3/success"], scores["l3/survived"]), (0.0, 0.0));
    assert_eq!(scores["l3/time_to_fall"], 0.5);
    assert_eq!(scores["l3/mpjpe_before_fall"], 0.0, "the error after the fall is left out");
    assert!((scores["l3/mpjpe_world"] - 501.0 * 151.0 / 200.0).abs() < 1e-9, "and stays in the whole");
}

/// The scores of a rollout that stops being one after half a second: only what its good part decides.
fn check_failed(failed: &Rollout) {
    let expected = [
        ("l3/completed", 0.25),
        ("l3/completed_time", 0.5),
        ("l3/mpjpe_before_fall", 0.0),
        ("l3/success", 0.0),
        ("l3/survival_fraction", 0.25),
        ("l3/survived", 0.0),
        ("l3/time_to_fall", 0.5),
    ];
    assert_eq!(score(failed).into_iter().collect::<Vec<_>>(), expected);
    let fall = Fall { time_secs: 0.5, cause: FallCause::Failed };
    assert_eq!(first_fall(&HUMANOID, failed), Some(fall));
}

#[test]
fn a_failed_rollout_is_not_averaged_away() {
    let mut failed = rollout(Level::L3, |_, _| {});
    failed.samples.truncate(50);
    failed.outcome = Outcome::Failed { time_secs: 0.5, reason: "quarantined".to_owned() };
    check_failed(&failed);
}

#[test]
fn a_completed_rollout_with_a_number_that_is_none_has_failed() {
    let mut failed = rollout(Level::L3, |index, sample| {
        if index >= 51 {
            sample.world_from_segment[4].translation.x = f64::NAN;
        }
    });
    check_failed(&failed);
    failed.samples[70].joint_torques_nm[0] = f64::INFINITY;
    check_failed(&failed);
}

#[test]
fn a_rollout_of_one_sample_has_no_tracking_and_no_forces() {
    let mut short = rollout(Level::L2, |_, _| {});
    short.samples.truncate(1);
    short.motion_duration_secs = 0.0;
    let expected = [
        ("l2/completed", 1.0),
        ("l2/completed_time", 0.0),
        ("l2/success", 1.0),
        ("l2/survival_fraction", 1.0),
        ("l2/survived", 1.0),
        ("l2/time_to_fall", 0.0),
    ];
    assert_eq!(score(&short).into_iter().collect::<Vec<_>>(), expected);

    short.samples.clear();
    let scores = score(&short);
    assert_eq!((scores["l2/completed"], scores["l2/success"]), (0.0, 0.0), "no sample, no success");
}
