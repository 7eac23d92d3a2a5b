//! The metrics that other programs print, on motions and rollouts built to have values worked out by hand.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::LazyLock;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, Motion, NUM_JOINTS, joint_index};
use rprae::plausibility::{METRICS, kinematic_scores, kinematic_windows, rollout_scores};
use rprae::simulation::{Contact, GRAVITY_M_S2, Level, Outcome, Rollout, RolloutSample, SimulationSettings};

const BODY: Body = Body { height_m: 1.75, mass_kg: 70.0 };
static HUMANOID: LazyLock<Humanoid> = LazyLock::new(|| Humanoid::new(BODY).unwrap());
const RATE_HZ: f64 = 100.0;
/// The sole lies within 0.05 mm of flat, from nine-digit numbers in the URDF.
const SOLE_MM: f64 = 0.05;

type Scores = BTreeMap<&'static str, f64>;

fn standing_motion(change: impl Fn(f64, &mut Frame)) -> Motion {
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = HUMANOID.standing_root_height_m();
    Motion::new(BODY, RATE_HZ, vec![frame; 201])
        .unwrap()
        .map_frames(|index, frame| change(index as f64 / RATE_HZ, frame))
        .unwrap()
}

fn standing(change: impl Fn(f64, &mut Frame)) -> Scores {
    let scores = kinematic_scores(&HUMANOID, &standing_motion(change));
    scores.iter().map(|score| (score.metric.key, score.value)).collect()
}

#[track_caller]
fn close(scores: &Scores, key: &str, expected: f64, tolerance: f64) {
    let found = scores[key];
    assert!((found - expected).abs() <= tolerance, "{key} is {found}, expected {expected}");
}

#[test]
fn standing_has_every_metric_and_no_fault() {
    let scores = standing(|_, _| {});
    let all: Vec<_> = METRICS.iter().map(|metric| metric.key).filter(|key| key.starts_with("l0/")).collect();
    assert_eq!(scores.keys().copied().collect::<Vec<_>>(), all);
    for (key, value) in scores {
        let (least, most) = match key {
            "l0/com_in_support" | "l0/contact_humor" => (1.0, 1.0),
            // The ankle is 40 mm before the heel and 112 mm behind the toe tips at 1 m height.
            "l0/com_margin" | "l0/zmp_margin" => (60.0, 75.0),
            "l0/cop_error" => (0.0, 80.0),
            _ if key.contains("lowest_point") => (-SOLE_MM, SOLE_MM),
            "l0/sole_tilt" => (0.0, 0.05),
            "l0/penetrate_humor_00cm" => (0.0, 1.0),
            _ => (-SOLE_MM, SOLE_MM),
        };
        assert!((least..=most).contains(&value), "{key} is {value}");
    }
}

#[test]
fn penetrations_of_one_sunk_body_differ_by_their_definitions() {
    let scores = standing(|_, frame| frame.root_position_m[2] -= 0.030);
    close(&scores, "l0/penetration", 30.0, SOLE_MM);
    close(&scores, "l0/penetration_max", 30.0, SOLE_MM);
    close(&scores, "l0/penetrate_closd", 25.0, SOLE_MM);
    close(&scores, "l0/penetrate_mbench", 30.0, SOLE_MM);
    close(&scores, "l0/penetrate_omniretarget", 1.0, 0.0);
    close(&scores, "l0/penetrate_humor_00cm", 1.0, 0.0);
    close(&scores, "l0/penetrate_humor_depth", 30.0, SOLE_MM);
    // Of the boxes only what is below: edges and faces at several depths.
    assert!((5.0..30.0).contains(&scores["l0/penetrate_uhc"]), "{}", scores["l0/penetrate_uhc"]);
    close(&scores, "l0/phys_err", 30.0, SOLE_MM);
    close(&standing(|_, frame| frame.root_position_m[2] -= 0.0301), "l0/penetrate_humor_03cm", 1.0, 0.0);
    close(&standing(|_, frame| frame.root_position_m[2] -= 0.0299), "l0/penetrate_humor_03cm", 0.0, 0.0);
}

#[test]
fn clean_frames_enter_some_means_and_not_others() {
    // Sunk in 100 of 201 frames.
    let scores = standing(|time, frame| {
        if time < 0.995 {
            frame.root_position_m[2] -= 0.030;
        }
    });
    close(&scores, "l0/penetration", 30.0 * 100.0 / 201.0, SOLE_MM);
    close(&scores, "l0/penetrate_closd", 25.0 * 100.0 / 201.0, SOLE_MM);
    close(&scores, "l0/penetrate_mbench", 30.0, SOLE_MM);
    close(&scores, "l0/penetrate_omniretarget", 100.0 / 201.0, 1e-12);
}

#[test]
fn a_floating_body_floats_by_all_definitions_and_stands_nowhere() {
    let scores = standing(|_, frame| frame.root_position_m[2] += 0.080);
    close(&scores, "l0/float_closd", 75.0, SOLE_MM);
    // At rest the velocity rule of MBench sees resting feet in all frames but the first.
    close(&scores, "l0/float_mbench", 0.0, 0.0);
    close(&scores, "l0/no_support", 1.0, 0.0);
    close(&scores, "l0/com_in_support", 0.0, 0.0);
    assert!(!scores.contains_key("l0/com_margin") && !scores.contains_key("l0/sole_tilt"), "{scores:?}");
    let moving = standing(|time, frame| {
        frame.root_position_m[2] += 0.080;
        frame.root_position_m[1] += 1.1 * time;
    });
    close(&moving, "l0/float_mbench", 1.0, 0.0);
}

#[test]
fn a_gliding_body_skates_by_all_definitions() {
    let scores = standing(|time, frame| {
        frame.root_position_m[1] += 0.6 * time;
        frame.root_position_m[2] -= 0.001;
    });
    for key in ["l0/skate_per_frame", "l0/skate_uhc", "l0/skate_closd", "l0/slide_mbench"] {
        close(&scores, key, 6.0, 1e-6);
    }
    close(&scores, "l0/phys_err", 6.0, 1e-6);
    close(&scores, "l0/slide_omniretarget", 0.0, 0.0);
    // 6 mm a frame are 20 mm at 30 Hz: no contact by HuMoR's labels.
    close(&scores, "l0/contact_humor", 0.0, 0.0);
    close(&scores, "l0/heading_speed", 0.6, 1e-9);
    let faster = standing(|time, frame| frame.root_position_m[1] -= 1.2 * time);
    close(&faster, "l0/slide_omniretarget", 1.0, 0.0);
    close(&faster, "l0/heading_speed", -1.2, 1e-9);
    close(&standing(|time, frame| frame.root_position_m[0] += time), "l0/heading_speed", 0.0, 1e-9);
}

#[test]
fn a_swaying_body_has_the_acceleration_of_its_sway() {
    let (amplitude, omega) = (0.1, TAU);
    let scores = standing(|time, frame| frame.root_position_m[1] += amplitude * (omega * time).sin());
    let acceleration = amplitude * omega * omega * 2.0 / std::f64::consts::PI;
    // The whole body moves as one: nothing relative to the root.
    close(&scores, "l0/jitter", acceleration, 0.01 * acceleration);
    close(&scores, "l0/jitter_per_frame", acceleration / 10.0, 0.001 * acceleration);
    close(&scores, "l0/accel", acceleration, 0.03 * acceleration);
    // The zero-moment point swings by the height of the centre of mass over g times the acceleration.
    assert!(scores["l0/zmp_outside"] > 0.3, "{}", scores["l0/zmp_outside"]);
    close(&scores, "l0/com_in_support", 1.0, 0.45);
}

#[test]
fn pfc_needs_acceleration_and_two_moving_feet() {
    let sway = |time: f64, frame: &mut Frame| frame.root_position_m[1] += 0.1 * (TAU * time).sin();
    let both = standing(sway)["l0/pfc"];
    // Steps are 0.1 w cos / 30, accelerations sin: 1e4 (0.1 w / 30)^2 * mean of |sin| cos^2 = 2 / (3 pi).
    let expected = 1e4 * (0.1 * TAU / 30.0_f64).powi(2) * 2.0 / (3.0 * std::f64::consts::PI);
    assert!((both - expected).abs() < 0.05 * expected, "{both} instead of {expected}");
    close(&standing(|time, frame| frame.root_position_m[1] += time), "l0/pfc", 0.0, 0.0);
}

#[test]
fn a_body_that_leans_stands_on_tilted_soles_outside_its_feet() {
    // 20 degrees about the sole's middle: the centre of mass leaves the toes.
    let angle = 20.0_f64.to_radians();
    let scores = standing(|_, frame| {
        let height = frame.root_position_m[2];
        frame.root_rotation_rad[0] = -angle;
        frame.root_position_m[1] = height * angle.sin();
        frame.root_position_m[2] = height * angle.cos();
    });
    close(&scores, "l0/sole_tilt", 20.0, 0.1);
    close(&scores, "l0/com_in_support", 0.0, 0.0);
    close(&scores, "l0/zmp_outside", 1.0, 0.0);
    assert!(
        scores["l0/com_margin"] < -50.0 && (scores["l0/com_margin"] - scores["l0/zmp_margin"]).abs() < 5.0
    );
    assert_eq!(scores["l0/sole_edge"], 0.0);
    let sideways = standing(|_, frame| frame.root_rotation_rad[1] = 12.0_f64.to_radians());
    assert_eq!(sideways["l0/sole_edge"], 1.0);
}

#[test]
fn an_arm_through_the_chest_is_a_self_collision() {
    let joint = |name: &str| joint_index(name).unwrap();
    let scores = standing(|time, frame| {
        if time > 0.995 {
            // The right upper arm across the body, the forearm bent back.
            frame.joint_angles_rad[joint("RSx")] = 0.3;
            frame.joint_angles_rad[joint("RSy")] = 0.6;
            frame.joint_angles_rad[joint("REx")] = 1.2;
        }
    });
    assert!(scores["l0/self_collision_depth"] > 20.0, "{}", scores["l0/self_collision_depth"]);
    close(&scores, "l0/self_collision_share", 101.0 / 201.0, 1e-12);
}

#[test]
fn windows_add_up_to_the_motion() {
    let motion =
        standing_motion(|time, frame| frame.root_position_m[2] -= if time < 0.995 { 0.03 } else { 0.0 });
    let windows = kinematic_windows(&HUMANOID, &motion, 1.0);
    assert_eq!(windows.len(), 2);
    let depth = |window: &[rprae::plausibility::Score]| {
        window.iter().find(|score| score.metric.key == "l0/penetration").unwrap().value
    };
    assert!((depth(&windows[0]) - 30.0).abs() < SOLE_MM && depth(&windows[1]) == 0.0);
}

// Rollouts.

fn segment(name: &str) -> usize {
    let link = HUMANOID.robot.tree.link_index(name).unwrap();
    HUMANOID.segment_links.iter().position(|&other| other == link).unwrap()
}

/// Two seconds of perfect standing on both feet, changed by `change(sample index, sample)`.
fn rollout(change: impl Fn(usize, &mut RolloutSample)) -> Scores {
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = HUMANOID.standing_root_height_m();
    let links = HUMANOID.forward(&frame);
    let poses = HUMANOID.segment_links.map(|link| links[link]);
    let weight_n = BODY.mass_kg * GRAVITY_M_S2;
    let mut contacts = Vec::new();
    for name in ["left_foot", "right_foot"] {
        let ankle = poses[segment(name)].translation.vector;
        for side in [-0.03, 0.03] {
            contacts.push(Contact {
                segment: segment(name),
                position_m: Point3::new(ankle.x + side, ankle.y, 0.0),
                force_n: Vector3::new(0.0, 0.0, weight_n / 4.0),
            });
        }
    }
    let samples = (0..=200)
        .map(|index| {
            let mut sample = RolloutSample {
                time_secs: f64::from(index) * 0.01,
                world_from_segment: poses,
                reference_world_from_segment: poses,
                joint_angles_rad: [0.0; NUM_JOINTS],
                joint_velocities_rad_s: [0.0; NUM_JOINTS],
                joint_torques_nm: [0.0; NUM_JOINTS],
                reference_joint_angles_rad: [0.0; NUM_JOINTS],
                assist_force_n: Vector3::zeros(),
                assist_moment_nm: Vector3::zeros(),
                contacts: contacts.clone(),
            };
            change(index as usize, &mut sample);
            sample
        })
        .collect();
    let rollout = Rollout {
        level: Level::L2,
        settings: SimulationSettings::default(),
        sample_interval_secs: 0.01,
        motion_duration_secs: 2.0,
        samples,
        events: Vec::new(),
        outcome: Outcome::Completed,
        max_joint_drift_m: 0.0,
    };
    rollout_scores(&HUMANOID, &rollout).iter().map(|score| (score.metric.key, score.value)).collect()
}

fn move_all(poses: &mut [Isometry3<f64>], by: &Isometry3<f64>) {
    for pose in poses {
        *pose = by * *pose;
    }
}

#[test]
fn perfect_standing_succeeds_by_every_rule_and_costs_nothing() {
    let scores = rollout(|_, _| {});
    for (key, value) in &scores {
        let is_one = ["success", "completed", "survi", "contact_share", "contact_kept", "vertical_force"]
            .iter()
            .any(|name| key.contains(name));
        let expected = if key.ends_with("_time") || key.ends_with("to_fall") {
            2.0
        } else {
            f64::from(u8::from(is_one))
        };
        assert!((value - expected).abs() < 1e-9, "{key} is {value}");
    }
    assert!(!scores.contains_key("l2/cost_of_transport"), "it goes nowhere");
}

#[test]
fn a_turned_and_displaced_body_keeps_its_pose() {
    let by = Isometry3::from_parts(
        Translation3::new(0.3, 0.1, 0.0),
        UnitQuaternion::from_euler_angles(0.0, 0.0, 0.7),
    );
    let scores = rollout(|_, sample| move_all(&mut sample.world_from_segment, &by));
    close(&scores, "l2/mpjpe_pa", 0.0, 1e-9);
    assert!(scores["l2/mpjpe_root"] > 50.0);
    close(&scores, "l2/root_rotation_error", 0.7, 1e-9);
    close(&scores, "l2/body_rotation_error", 0.7, 1e-9);
    close(&scores, "l2/root_position_error", 0.1_f64.hypot(0.3), 1e-9);
    close(&scores, "l2/trajectory_fail_20cm", 1.0, 0.0);
    close(&scores, "l2/location_fail_20cm", 1.0, 0.0);
    close(&scores, "l2/trajectory_fail_50cm", 0.0, 0.0);
    close(&scores, "l2/e_vel", 0.0, 1e-9);
    close(&scores, "l2/root_turn_error", 0.0, 1e-9);
}

#[test]
fn the_alignment_takes_size_out_but_not_a_mirror_image() {
    let scaled = rollout(|_, sample| {
        sample.world_from_segment.iter_mut().for_each(|pose| pose.translation.vector *= 1.2);
    });
    close(&scaled, "l2/mpjpe_pa", 0.0, 1e-9);
    let mirrored = rollout(|_, sample| {
        for (index, pose) in sample.world_from_segment.iter_mut().enumerate() {
            // Bent out of the plane of symmetry first, or the mirror image is the same body.
            pose.translation.vector.y += 0.01 * index as f64;
            pose.translation.vector.x *= -1.0;
        }
        for (index, pose) in sample.reference_world_from_segment.iter_mut().enumerate() {
            pose.translation.vector.y += 0.01 * index as f64;
        }
    });
    assert!(mirrored["l2/mpjpe_pa"] > 20.0, "{}", mirrored["l2/mpjpe_pa"]);
}

#[test]
fn a_drifting_body_has_the_velocity_error_of_its_drift() {
    let scores = rollout(|index, sample| {
        let by = Isometry3::translation(0.001 * index as f64, 0.0, 0.0);
        move_all(&mut sample.world_from_segment, &by);
    });
    close(&scores, "l2/e_vel", 100.0, 1e-6);
    close(&scores, "l2/e_vel_per_frame", 1.0, 1e-9);
    close(&scores, "l2/e_acc", 0.0, 1e-6);
    close(&scores, "l2/root_velocity_error", 0.1, 1e-9);
    close(&scores, "l2/trajectory_error", 0.1005, 1e-9);
    close(&scores, "l2/location_fail_20cm", 0.0, 0.0);
    // Contacts stay where they are in the world while the foot passes over them.
    close(&scores, "l2/foot_slip", 100.0, 1e-6);
}

#[test]
fn an_accelerating_body_has_the_acceleration_error_of_it() {
    let scores = rollout(|index, sample| {
        let time = 0.01 * index as f64;
        move_all(&mut sample.world_from_segment, &Isometry3::translation(0.0, 0.0, 0.5 * 2.0 * time * time));
    });
    close(&scores, "l2/e_acc", 2.0, 1e-6);
    close(&scores, "l2/e_acc_per_frame", 0.2, 1e-7);
}

#[test]
fn success_rules_differ_by_what_they_look_at() {
    let displaced = |name: &str, by: Vector3<f64>| {
        let part = segment(name);
        rollout(move |index, sample| {
            if index == 50 {
                sample.world_from_segment[part].translation.vector += by;
            }
        })
    };
    let verdict = |scores: &Scores| {
        [
            "success",
            "success_max",
            "success_25cm",
            "success_beyondmimic",
            "success_mimickit",
            "success_deepmimic",
        ]
        .map(|rule| scores[format!("l2/{rule}").as_str()])
    };
    let x = |metres: f64| Vector3::new(metres, 0.0, 0.0);
    let z = |metres: f64| Vector3::new(0.0, 0.0, metres);
    assert_eq!(verdict(&displaced("head", x(0.49))), [1.0; 6]);
    assert_eq!(verdict(&displaced("head", x(0.51))), [1.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    assert_eq!(verdict(&displaced("head", x(1.01))), [1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    assert_eq!(verdict(&displaced("left_hand", z(0.26))), [1.0, 1.0, 1.0, 0.0, 1.0, 1.0]);
    assert_eq!(verdict(&displaced("pelvis", z(-0.26))), [1.0, 1.0, 1.0, 0.0, 1.0, 1.0]);
    assert_eq!(verdict(&displaced("head", x(21.0 * 0.26))), [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
    let hand = segment("right_hand");
    let touch = Contact { segment: hand, position_m: Point3::origin(), force_n: Vector3::z() };
    let touched = rollout(|index, sample| {
        if index == 9 {
            sample.contacts.push(touch);
        }
    });
    assert_eq!(verdict(&touched), [1.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
}

#[test]
fn work_is_torque_times_speed() {
    // 70 N m at 2 rad/s in one joint and as much backwards in another: 280 W on 70 kg.
    let scores = rollout(|_, sample| {
        (sample.joint_torques_nm[3], sample.joint_velocities_rad_s[3]) = (70.0, 2.0);
        (sample.joint_torques_nm[9], sample.joint_velocities_rad_s[9]) = (70.0, -2.0);
    });
    close(&scores, "l2/power_mean", 4.0, 1e-9);
    close(&scores, "l2/power_peak", 4.0, 1e-9);
    close(&scores, "l2/energy", 8.0, 1e-9);
    let walking = rollout(|index, sample| {
        (sample.joint_torques_nm[3], sample.joint_velocities_rad_s[3]) = (70.0, 2.0);
        move_all(&mut sample.world_from_segment, &Isometry3::translation(0.0, 0.01 * index as f64, 0.0));
    });
    close(&walking, "l2/cost_of_transport", 4.0 / (GRAVITY_M_S2 * 2.0), 1e-9);
}

#[test]
fn a_foot_on_its_edge_and_a_lost_contact_are_counted() {
    let edge = rollout(|index, sample| {
        let left = &mut sample.world_from_segment[segment("left_foot")];
        left.rotation = UnitQuaternion::from_euler_angles(0.0, 5.0_f64.to_radians(), 0.0) * left.rotation;
        if index % 2 == 1 {
            // All load at one side of the left foot.
            sample.contacts.retain(|contact| {
                contact.segment != segment("left_foot")
                    || contact.position_m.x < sample.world_from_segment[contact.segment].translation.x
            });
        }
    });
    close(&edge, "l2/edge_contact", 0.25, 1e-12);
    let lost = rollout(|index, sample| {
        if index % 4 == 1 {
            sample.contacts.retain(|contact| contact.segment != segment("left_foot"));
        }
    });
    close(&lost, "l2/contact_kept", 1.0 - 0.125, 1e-12);
}
