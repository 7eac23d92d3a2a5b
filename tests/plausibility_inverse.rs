//! Level 1 scores on motions whose unexplained forces are known.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;

use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, Motion, joint_index};
use rprae::plausibility::inverse_scores;
use rprae::simulation::GRAVITY_M_S2;

const BODY: Body = Body { height_m: 1.75, mass_kg: 70.0 };

fn score(duration_secs: f64, change: impl Fn(f64, &mut Frame)) -> BTreeMap<&'static str, f64> {
    let humanoid = Humanoid::new(BODY).unwrap();
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = humanoid.standing_root_height_m();
    let motion = Motion::new(BODY, 100.0, vec![frame; (duration_secs * 100.0) as usize + 1])
        .unwrap()
        .map_frames(|index, frame| change(index as f64 / 100.0, frame))
        .unwrap();
    inverse_scores(&humanoid, &motion).iter().map(|score| (score.metric.key, score.value)).collect()
}

#[test]
fn standing_is_explained() {
    let scores = score(1.0, |_, _| {});
    for key in ["l1/residual_force", "l1/residual_force_p95", "l1/residual_force_gated", "l1/residual_moment"]
    {
        assert!(scores[key] < 0.02, "{key} is {}", scores[key]);
    }
    assert_eq!(scores["l1/torque_limit_share"], 0.0);
}

#[test]
fn hanging_in_the_air_is_one_body_weight() {
    let scores = score(1.0, |_, frame| frame.root_position_m[2] += 0.2);
    for key in ["l1/residual_force", "l1/residual_force_p95", "l1/residual_force_gated"] {
        // The frames between joint axes weigh a few milligrams on top of the body.
        assert!((scores[key] - 100.0).abs() < 1e-4, "{key} is {}", scores[key]);
    }
}

#[test]
fn falling_freely_is_explained() {
    let scores = score(1.0, |t, frame| frame.root_position_m[2] += 6.0 - 0.5 * GRAVITY_M_S2 * t * t);
    // The filter bends the parabola at its ends only.
    assert!(scores["l1/residual_force"] < 10.0, "{scores:?}");
    let rising = score(1.0, |t, frame| frame.root_position_m[2] += 1.0 + 6.0 * t);
    assert!((rising["l1/residual_force"] - 100.0).abs() < 1.0, "a steady climb hangs on nothing: {rising:?}");
}

#[test]
fn a_steady_slide_shows_only_behind_the_speed_gate() {
    let scores = score(2.0, |t, frame| frame.root_position_m[1] = 0.6 * t);
    assert!(scores["l1/residual_force"] < 0.1, "{scores:?}");
    assert!((scores["l1/residual_force_gated"] - 100.0).abs() < 0.1, "{scores:?}");
}

#[test]
fn leaning_past_the_toes_needs_a_hand() {
    // The whole body tilts about the ankles until its centre of mass is in front of the toes.
    let ankles = ["LAx", "RAx"].map(|name| joint_index(name).unwrap());
    let lean = |angle: f64| {
        score(1.0, move |_, frame| {
            let height = frame.root_position_m[2] - 0.039 * BODY.height_m;
            frame.root_rotation_rad[0] = -angle;
            frame.root_position_m[1] = height * angle.sin();
            frame.root_position_m[2] += height * (angle.cos() - 1.0);
            for joint in ankles {
                frame.joint_angles_rad[joint] = angle;
            }
        })
    };
    let (little, far) = (lean(0.1), lean(0.4));
    assert!(little["l1/residual_moment"] < 0.01 && little["l1/residual_force"] < 0.05, "{little:?}");
    // The best the ground can do is to give up part of the weight for some of the moment.
    assert!(far["l1/residual_moment"] > 0.2 && far["l1/residual_force"] > 5.0, "{far:?}");
}

#[test]
fn a_torque_beyond_human_strength_is_counted() {
    // Both shoulders shake at 8 Hz with half a radian; the filter leaves some of it.
    let shoulders = ["LSx", "RSx"].map(|name| joint_index(name).unwrap());
    let scores = score(2.0, |t, frame| {
        for joint in shoulders {
            frame.joint_angles_rad[joint] = 1.0 + 1.2 * (std::f64::consts::TAU * 5.0 * t).sin();
        }
    });
    assert!(scores["l1/torque_limit_share"] > 0.002, "{scores:?}");
}

#[test]
fn a_body_that_hangs_in_the_air_is_in_flight_but_not_in_free_fall() {
    let hanging = score(1.0, |_, frame| frame.root_position_m[2] += 0.2);
    assert_eq!(hanging["l1/flight_share"], 1.0);
    assert!((hanging["l1/flight_error"] - GRAVITY_M_S2).abs() < 1e-4, "{hanging:?}");
    assert_eq!((hanging["l1/hicks_pass"], hanging["l1/opensim_grade"]), (0.0, 0.0));
    let falling = score(1.0, |t, frame| frame.root_position_m[2] += 6.0 - 0.5 * GRAVITY_M_S2 * t * t);
    assert!(falling["l1/flight_error"] < 0.1 && falling["l1/residual_force"] < 1.0, "{falling:?}");
    let standing = score(1.0, |_, _| {});
    assert_eq!((standing["l1/hicks_pass"], standing["l1/opensim_grade"]), (1.0, 2.0));
    assert!(!standing.contains_key("l1/flight_error"));
}

#[test]
fn the_ends_of_a_recording_are_left_out_and_counted() {
    // A body that starts in mid-movement: the filter bends its first frames only.
    let scores = score(2.0, |t, frame| {
        frame.root_position_m[1] += 0.05 * (-t / 0.03).exp();
    });
    assert!(scores["l1/residual_force_edges"] > 20.0 * scores["l1/residual_force"], "{scores:?}");
    // 17 of 201 frames at either end, every other one explained: 9 of 101 at the start, 8 at the end.
    assert!((scores["l1/edge_share"] - 17.0 / 101.0).abs() < 0.02, "{scores:?}");
    let short = score(0.2, |_, _| {});
    assert!((short["l1/edge_share"] - 0.5).abs() < 0.1, "never more than half: {short:?}");
}

#[test]
fn power_is_torque_times_speed_in_both_directions() {
    let shoulders = ["LSx", "RSx"].map(|name| joint_index(name).unwrap());
    let swing = |hertz: f64| {
        score(4.0, |t, frame| {
            for joint in shoulders {
                frame.joint_angles_rad[joint] = 1.0 + 0.5 * (std::f64::consts::TAU * hertz * t).sin();
            }
        })
    };
    let (slow, fast) = (swing(0.5), swing(2.0));
    assert!(fast["l1/power_peak"] > 5.0 * slow["l1/power_peak"] && slow["l1/power_peak"] > 0.0, "{fast:?}");
    assert!(fast["l1/torque_peak"] < 1.0 && fast["l1/power_limit_share"] == 0.0);
}
