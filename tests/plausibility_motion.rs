//! Level 0 scores on motions built to have exactly one fault, against values worked out by hand.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, TAU};
use std::sync::LazyLock;

use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, Motion, joint_index};
use rprae::plausibility::{find_metric, kinematic_scores};

const BODY: Body = Body { height_m: 1.75, mass_kg: 70.0 };
static HUMANOID: LazyLock<Humanoid> = LazyLock::new(|| Humanoid::new(BODY).unwrap());
const RATE_HZ: f64 = 100.0;
const DURATION_SECS: f64 = 2.0;
/// The sole lies within 0.05 mm of flat, from nine-digit numbers in the URDF.
const SOLE_MM: f64 = 0.05;

/// A standing motion changed by `change(time, frame)`.
fn standing_at(rate_hz: f64, change: impl Fn(f64, &mut Frame)) -> Motion {
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = HUMANOID.standing_root_height_m();
    let num_frames = (DURATION_SECS * rate_hz).round() as usize + 1;
    Motion::new(BODY, rate_hz, vec![frame; num_frames])
        .unwrap()
        .map_frames(|index, frame| change(index as f64 / rate_hz, frame))
        .unwrap()
}

fn standing(change: impl Fn(f64, &mut Frame)) -> Motion {
    standing_at(RATE_HZ, change)
}

fn joint(name: &str) -> usize {
    joint_index(name).unwrap()
}

type Scores = BTreeMap<&'static str, f64>;

/// The metrics of this file; the variants that other programs print are in `plausibility_published.rs`.
const OWN: [&str; 20] = [
    "l0/dynamic_degree",
    "l0/float",
    "l0/float_integral",
    "l0/foot_skate_ratio",
    "l0/jerk",
    "l0/joint_jerk",
    "l0/joint_limit_excess",
    "l0/joint_limit_share",
    "l0/joint_speed_limit_share",
    "l0/joint_speed_p95",
    "l0/joint_speed_peak",
    "l0/lowest_point_median",
    "l0/lowest_point_min",
    "l0/penetration",
    "l0/penetration_integral",
    "l0/root_speed_peak",
    "l0/root_turn_peak",
    "l0/skate",
    "l0/skate_per_frame",
    "l0/slowest_contact_speed",
];

fn every_score(motion: &Motion) -> Scores {
    let scores = kinematic_scores(&HUMANOID, motion);
    assert!(scores.is_sorted_by(|a, b| a.metric.key < b.metric.key));
    scores.iter().map(|score| (score.metric.key, score.value)).collect()
}

fn score(motion: &Motion) -> Scores {
    every_score(motion).into_iter().filter(|(key, _)| OWN.contains(key)).collect()
}

#[track_caller]
fn close(scores: &Scores, key: &str, expected: f64, tolerance: f64) {
    let found = scores[find_metric(key).unwrap().key];
    assert!((found - expected).abs() <= tolerance, "{key} is {found}, expected {expected}");
}

#[test]
fn standing_has_no_fault() {
    let scores = score(&standing(|_, _| {}));
    assert_eq!(scores.len(), OWN.len(), "{scores:?}");
    for (&key, &value) in &scores {
        let allowed = if key.contains("lowest_point") { SOLE_MM } else { 0.0 };
        assert!(value.abs() <= allowed, "{key} is {value}");
    }
}

#[test]
fn a_sunk_body_penetrates_by_its_depth() {
    let scores = score(&standing(|_, frame| frame.root_position_m[2] -= 0.030));
    close(&scores, "l0/penetration", 30.0, SOLE_MM);
    close(&scores, "l0/penetration_integral", 60.0, 2.0 * SOLE_MM);
    close(&scores, "l0/lowest_point_min", -30.0, SOLE_MM);
    close(&scores, "l0/lowest_point_median", -30.0, SOLE_MM);
}

#[test]
fn the_tolerance_clips_and_is_not_subtracted() {
    for (depth_m, expected) in [(0.004, 0.0), (0.006, 6.0), (-0.004, 0.0), (-0.006, 0.0)] {
        let scores = score(&standing(|_, frame| frame.root_position_m[2] -= depth_m));
        close(&scores, "l0/penetration", expected, SOLE_MM);
    }
}

#[test]
fn a_floating_body_floats_by_its_height_and_touches_nothing() {
    let scores = score(&standing(|_, frame| frame.root_position_m[2] += 0.080));
    close(&scores, "l0/float", 80.0, SOLE_MM);
    close(&scores, "l0/float_integral", 160.0, 2.0 * SOLE_MM);
    close(&scores, "l0/lowest_point_min", 80.0, SOLE_MM);
    assert!(!scores.contains_key("l0/slowest_contact_speed"));
}

#[test]
fn half_the_time_in_the_air_halves_the_mean_and_the_integral() {
    // 100 of 201 frames at 80 mm; the trapezoid rule adds half an interval where it drops to the floor.
    let scores = score(&standing(|time, frame| {
        if time < 0.995 {
            frame.root_position_m[2] += 0.080;
        }
    }));
    close(&scores, "l0/float", 80.0 * 100.0 / 201.0, SOLE_MM);
    close(&scores, "l0/float_integral", 80.0 * 0.995, SOLE_MM);
    close(&scores, "l0/lowest_point_min", 0.0, SOLE_MM);
}

#[test]
fn a_lying_body_rests_on_its_back_not_on_its_soles() {
    // The chest is the thickest part: a capsule of 60 mm radius at 1 m height.
    let scores = score(&standing(|_, frame| {
        frame.root_rotation_rad[0] = FRAC_PI_2;
        frame.root_position_m[2] = 0.060 * BODY.height_m;
    }));
    close(&scores, "l0/lowest_point_median", 0.0, 1e-6);
    close(&scores, "l0/penetration", 0.0, 0.0);
    close(&scores, "l0/float", 0.0, 0.0);
}

#[test]
fn a_gliding_body_skates_at_its_speed() {
    let scores = score(&standing(|time, frame| frame.root_position_m[1] += 0.6 * time));
    close(&scores, "l0/skate", 600.0, 1e-6);
    close(&scores, "l0/skate_per_frame", 6.0, 1e-8);
    close(&scores, "l0/slowest_contact_speed", 600.0, 1e-6);
    close(&scores, "l0/root_speed_peak", 0.6, 1e-9);
    close(&scores, "l0/dynamic_degree", 0.6, 1e-9);
    // Of 40 pairs the two at either end see at most four fifths of 0.6 m/s in their window.
    close(&scores, "l0/foot_skate_ratio", 36.0 / 40.0, 1e-12);
}

#[test]
fn the_skating_ratio_has_its_three_thresholds() {
    let ratio = |speed: f64, height: f64| {
        let motion = standing(|time, frame| {
            frame.root_position_m[1] += speed * time;
            frame.root_position_m[2] += height;
        });
        score(&motion)["l0/foot_skate_ratio"]
    };
    assert_eq!(ratio(1.0, 0.0), 1.0, "three fifths of 1 m/s is still too fast");
    assert_eq!(ratio(0.49, 0.0), 0.0, "slower than 0.5 m/s");
    assert_eq!(ratio(1.0, 0.0499), 1.0, "just below 5 cm");
    assert_eq!(ratio(1.0, 0.0501), 0.0, "just above 5 cm");
}

#[test]
fn one_sliding_foot_is_seen_by_the_ratio_but_not_as_the_slowest_contact() {
    // Swinging the left leg sideways with its hip moves the left sole only.
    let motion = standing(|time, frame| {
        frame.joint_angles_rad[joint("LHy")] = 0.04 * (TAU * 5.0 * time).sin();
    });
    let scores = score(&motion);
    close(&scores, "l0/slowest_contact_speed", 0.0, 1e-6);
    assert!(scores["l0/skate"] > 100.0, "{scores:?}");
}

#[test]
fn either_foot_alone_makes_the_ratio() {
    // Turning about the ball of the left foot, 54 mm left of and 72 mm before the root, carries the right one around it.
    let (x, y) = (-0.054 * BODY.height_m, 0.072 * BODY.height_m);
    let motion = standing(|time, frame| {
        let yaw = 8.0 * time;
        frame.root_rotation_rad[2] = yaw;
        frame.root_position_m[0] = x - (x * yaw.cos() - y * yaw.sin());
        frame.root_position_m[1] = y - (x * yaw.sin() + y * yaw.cos());
    });
    assert!(score(&motion)["l0/foot_skate_ratio"] > 0.99);
}

#[test]
fn a_circling_arm_moves_in_the_world_and_relative_to_the_root() {
    // Elbow and wrist turn about the shoulder at 0.188 and 0.333 m (at 1 m height); the other 19 joint centres rest.
    let speed = 1.5_f64;
    let scores = score(&standing(|time, frame| frame.joint_angles_rad[joint("LSx")] = speed * time));
    let radii_m = (0.188 + 0.333) * BODY.height_m;
    let chord = 2.0 * (speed / RATE_HZ / 2.0).sin() * RATE_HZ;
    close(&scores, "l0/dynamic_degree", 2.0 * radii_m * chord / 21.0, 1e-6);
}

#[test]
fn a_joint_beyond_its_limit_half_of_the_time_is_half_a_joint_too_far() {
    // A ramp through the upper limit of the wrist, which moves no joint centre: 100 of 200 frames are beyond 1 mrad.
    let upper = rprae::motion::JOINTS[joint("LWx")].upper_rad;
    let standing = standing(|_, _| {});
    let frames = standing.frames()[..200].to_vec();
    let motion = Motion::new(BODY, RATE_HZ, frames).unwrap();
    let motion = motion
        .map_frames(|index, frame| {
            frame.joint_angles_rad[joint("LWx")] = upper - 0.2 + 0.4 * index as f64 / 199.0;
        })
        .unwrap();
    let scores = score(&motion);
    close(&scores, "l0/joint_limit_share", 0.5 / 44.0, 1e-12);
    close(&scores, "l0/joint_limit_excess", 0.2, 1e-9);
    let speed = 0.4 / 199.0 * RATE_HZ;
    close(&scores, "l0/joint_speed_peak", speed, 1e-9);
    close(&scores, "l0/joint_speed_p95", speed, 1e-9);
    close(&scores, "l0/joint_jerk", 0.0, 1e-7);
    close(&scores, "l0/dynamic_degree", 0.0, 1e-9);
}

#[test]
fn an_angle_on_its_limit_is_within_it() {
    let scores = score(&standing(|_, frame| {
        frame.joint_angles_rad[joint("LWx")] = rprae::motion::JOINTS[joint("LWx")].upper_rad + 0.9e-3;
    }));
    close(&scores, "l0/joint_limit_share", 0.0, 0.0);
    close(&scores, "l0/joint_limit_excess", 0.0, 0.0);
}

#[test]
fn a_sine_has_the_speed_and_the_jerk_of_a_sine() {
    let (amplitude, hertz) = (0.5, 1.0);
    let omega = TAU * hertz;
    let half_step = omega / RATE_HZ / 2.0;
    // Shifted by half a frame, so that one pair straddles the zero crossing: its chord is the steepest.
    let motion = standing(|time, frame| {
        frame.joint_angles_rad[joint("LWy")] = amplitude * (omega * time - half_step).sin();
    });
    let scores = score(&motion);
    close(&scores, "l0/joint_speed_peak", 2.0 * amplitude * half_step.sin() * RATE_HZ, 1e-9);
    // 95 % of |cos| lies below sin(0.95 pi / 2).
    let p95 = amplitude * omega * (0.95 * FRAC_PI_2).sin();
    close(&scores, "l0/joint_speed_p95", p95, 0.005 * p95);
    let jerk = amplitude * omega.powi(3) * FRAC_2_PI;
    close(&scores, "l0/joint_jerk", jerk / 44.0, 0.02 * jerk / 44.0);
    close(&scores, "l0/jerk", 0.0, 1e-6);
}

#[test]
fn a_swaying_body_has_the_jerk_of_its_sway() {
    let (amplitude, omega) = (0.1, TAU);
    let scores = score(&standing(|time, frame| {
        frame.root_position_m[1] += amplitude * (omega * time).sin();
    }));
    let jerk = amplitude * omega.powi(3) * FRAC_2_PI;
    close(&scores, "l0/jerk", jerk, 0.02 * jerk);
    close(&scores, "l0/joint_jerk", 0.0, 0.0);
}

#[test]
fn a_joint_that_snaps_once_is_too_fast_once() {
    let angle = HUMANOID.kit_of_angle().iter().position(|&kit| kit == joint("LWy")).unwrap();
    let too_fast = 1.01 * HUMANOID.robot.limits[angle].velocity_rad_s;
    let snap = |speed: f64| {
        score(&standing(|time, frame| {
            frame.joint_angles_rad[joint("LWy")] = if time < 1.005 { 0.0 } else { speed / RATE_HZ };
        }))
    };
    let scores = snap(too_fast);
    close(&scores, "l0/joint_speed_peak", too_fast, 1e-9);
    close(&scores, "l0/joint_speed_p95", 0.0, 0.0);
    close(&scores, "l0/joint_speed_limit_share", 1.0 / (200.0 * 44.0), 1e-15);
    close(&snap(0.98 * too_fast), "l0/joint_speed_limit_share", 0.0, 0.0);
}

#[test]
fn a_teleport_is_an_impossible_speed() {
    let scores = score(&standing(|time, frame| {
        frame.root_position_m[1] += if time < 1.005 { 0.0 } else { 2.0 };
    }));
    close(&scores, "l0/root_speed_peak", 200.0, 1e-9);
    close(&scores, "l0/skate", 1000.0, 1e-6);
}

#[test]
fn turning_past_a_half_turn_is_no_jump() {
    let scores = score(&standing(|time, frame| {
        let yaw = 1.5 * time + 2.5;
        frame.root_rotation_rad[2] = if yaw > 3.0 { yaw - TAU } else { yaw };
    }));
    close(&scores, "l0/root_turn_peak", 1.5, 1e-9);
}

#[test]
fn each_fault_moves_the_metrics_it_should_and_no_other() {
    type Change = fn(f64, &mut Frame);
    let ground = ["l0/lowest_point_median", "l0/lowest_point_min"];
    let slide =
        ["l0/dynamic_degree", "l0/foot_skate_ratio", "l0/root_speed_peak", "l0/skate", "l0/skate_per_frame"];
    let faults: [(&str, Change, Vec<&str>); 6] = [
        ("sunk", |_, frame| frame.root_position_m[2] -= 0.03, {
            [&["l0/penetration", "l0/penetration_integral"], ground.as_slice()].concat()
        }),
        ("floating", |_, frame| frame.root_position_m[2] += 0.08, {
            [&["l0/float", "l0/float_integral", "l0/slowest_contact_speed"], ground.as_slice()].concat()
        }),
        ("gliding", |time, frame| frame.root_position_m[0] += 0.6 * time, {
            [["l0/slowest_contact_speed"].as_slice(), slide.as_slice()].concat()
        }),
        ("teleport", |time, frame| frame.root_position_m[0] += f64::from(time > 1.005), {
            [["l0/jerk"].as_slice(), slide.as_slice()].concat()
        }),
        ("over the limit", |_, frame| frame.joint_angles_rad[joint("RWx")] = 0.6, {
            vec!["l0/joint_limit_excess", "l0/joint_limit_share"]
        }),
        (
            "wrist tremor",
            |time, frame| frame.joint_angles_rad[joint("RWy")] = 0.02 * (TAU * 12.0 * time).sin(),
            { vec!["l0/joint_jerk", "l0/joint_speed_p95", "l0/joint_speed_peak"] },
        ),
    ];
    let clean = score(&standing(|_, _| {}));
    for (name, change, mut expected) in faults {
        let scores = score(&standing(change));
        let moved = |key: &&str| scores.get(key).is_none_or(|value| (value - clean[key]).abs() > 1e-6);
        let changed: Vec<&str> = clean.keys().copied().filter(moved).collect();
        println!("{name:>15}: {}", changed.join(" "));
        expected.sort_unstable();
        assert_eq!(changed, expected, "{name}");
    }
}

#[test]
fn scores_per_second_do_not_depend_on_the_frame_rate() {
    let at = |rate_hz| {
        score(&standing_at(rate_hz, |time, frame| {
            frame.root_position_m[1] += 0.7 * time;
            frame.root_position_m[2] -= 0.010 + 0.01 * time;
            frame.joint_angles_rad[joint("LWy")] = 0.3 * time;
        }))
    };
    let (slow, fast) = (at(50.0), at(100.0));
    for (&key, &value) in &fast {
        let tolerance = if key == "l0/foot_skate_ratio" { 1e-12 } else { 1e-6 };
        if key == "l0/skate_per_frame" {
            close(&slow, key, 2.0 * value, tolerance);
        } else {
            close(&slow, key, value, tolerance);
        }
    }
}

#[test]
fn where_a_motion_stands_and_faces_changes_no_score() {
    let walk = |time: f64, frame: &mut Frame| {
        frame.root_position_m[1] += 0.3 * time;
        frame.root_rotation_rad = [0.02 * (TAU * time).sin(), 0.05 * (TAU * time).cos(), 0.2 * time];
        frame.joint_angles_rad[joint("LHx")] = 0.3 * (TAU * time).sin();
        frame.joint_angles_rad[joint("RKx")] = -0.3 - 0.3 * (TAU * time).sin();
    };
    let here = every_score(&standing(walk));
    let (sin, cos) = 2.0_f64.sin_cos();
    let elsewhere = every_score(&standing(|time, frame| {
        walk(time, frame);
        let [x, y, z] = frame.root_position_m;
        frame.root_position_m = [cos * x - sin * y + 11.0, sin * x + cos * y - 7.0, z];
        frame.root_rotation_rad[2] += 2.0;
    }));
    for (key, &value) in &here {
        close(&elsewhere, key, value, 1e-5 * value.abs().max(1e-3));
    }
}

#[test]
fn a_single_frame_has_the_scores_that_one_frame_decides() {
    let frame = standing(|_, _| {}).frames()[0];
    let scores = score(&Motion::new(BODY, RATE_HZ, vec![frame]).unwrap());
    let expected = [
        "l0/float",
        "l0/float_integral",
        "l0/joint_limit_excess",
        "l0/joint_limit_share",
        "l0/lowest_point_median",
        "l0/lowest_point_min",
        "l0/penetration",
        "l0/penetration_integral",
    ];
    assert_eq!(scores.keys().copied().collect::<Vec<_>>(), expected);
}
