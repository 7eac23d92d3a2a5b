//! Every possible motion obeys the body and the ground.

use rprae::humanoid::Side;
use rprae::motion::JOINTS;
use rprae::synthesis::{Contact, Feasibility, GRAVITY_M_S2, GroundReaction, SuiteMotion};

use crate::SUITE;
use crate::measure::{HUMANOID, largest_joint_rates, loaded, lowest_m, margin_m, poses};

fn possible() -> impl Iterator<Item = &'static SuiteMotion> {
    SUITE.iter().filter(|motion| motion.feasibility == Feasibility::Possible)
}

/// Runs of frames in the air: one foot, or both for `None`.
fn airborne(contacts: &[[Contact; 2]], side: Option<Side>) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for (frame, pair) in contacts.iter().enumerate() {
        let up = match side {
            Some(side) => pair[side as usize] == Contact::None,
            None => *pair == [Contact::None; 2],
        };
        match runs.last_mut() {
            Some(run) if up && run.end == frame => run.end += 1,
            _ if up => runs.push(frame..frame + 1),
            _ => {}
        }
    }
    runs
}

#[test]
fn there_are_twelve_possible_motions_of_four_to_eight_seconds() {
    assert_eq!(possible().count(), 12);
    for motion in possible() {
        let duration = motion.performance.motion.duration_secs();
        assert!((4.0..=8.0).contains(&duration), "{}: {duration} s", motion.name);
    }
}

#[test]
fn joints_stay_within_their_limits_of_angle_and_speed() {
    for motion in SUITE.iter() {
        for frame in motion.performance.motion.frames() {
            for (joint, angle) in JOINTS.iter().zip(frame.joint_angles_rad) {
                assert!(
                    (joint.lower_rad..=joint.upper_rad).contains(&angle),
                    "{}: {}",
                    motion.name,
                    joint.name
                );
            }
            for knee in [20, 36] {
                assert!(frame.joint_angles_rad[knee] < -0.0698, "{}: a straight knee", motion.name);
            }
        }
        let (speeds, acceleration) = largest_joint_rates(&motion.performance);
        for (angle, &joint) in HUMANOID.kit_of_angle().iter().enumerate() {
            let (speed, frame) = speeds[joint];
            let limit = HUMANOID.robot.limits[angle].velocity_rad_s;
            assert!(speed < limit, "{}: {} at {speed} rad/s, frame {frame}", motion.name, JOINTS[joint].name);
        }
        assert!(acceleration < 600.0, "{}: a joint jerks with {acceleration} rad/s^2", motion.name);
    }
}

#[test]
fn motions_start_and_end_at_rest() {
    for motion in possible() {
        let frames = motion.performance.motion.frames();
        let n = frames.len();
        for (a, b) in [(0, 1), (n - 2, n - 1)] {
            for (a, b) in frames[a].to_channels().iter().zip(frames[b].to_channels()) {
                assert!((a - b).abs() * 100.0 < 0.01, "{}: {a} and {b}", motion.name);
            }
        }
    }
}

#[test]
fn loaded_soles_lie_on_the_floor_and_do_not_slip() {
    for motion in possible() {
        let poses = poses(&motion.performance);
        let contacts = &motion.performance.contacts;
        for i in 0..poses.len() {
            let now = loaded(&poses[i], contacts[i]);
            for side in [Side::Left, Side::Right] {
                let lowest = lowest_m(&poses[i], side);
                assert!(lowest > -1e-3, "{}: a foot {lowest} m deep at frame {i}", motion.name);
                let corners = &now[side as usize];
                for corner in corners {
                    assert!(corner.z.abs() < 1e-3, "{}: sole at {} m, frame {i}", motion.name, corner.z);
                }
                if i > 0 && contacts[i - 1][side as usize] == contacts[i][side as usize] {
                    let before = &loaded(&poses[i - 1], contacts[i - 1])[side as usize];
                    for (before, now) in before.iter().zip(corners) {
                        let speed = (now - before).norm() * 100.0;
                        assert!(speed < 2e-3, "{}: slips at {speed} m/s, frame {i}", motion.name);
                    }
                }
            }
        }
    }
}

#[test]
fn swinging_feet_clear_the_floor() {
    for motion in possible() {
        let poses = poses(&motion.performance);
        for side in [Side::Left, Side::Right] {
            for swing in airborne(&motion.performance.contacts, Some(side)) {
                let heights: Vec<f64> = swing.clone().map(|frame| lowest_m(&poses[frame], side)).collect();
                let n = heights.len();
                let middle = heights[n / 3..n - n / 3].iter().copied().fold(f64::INFINITY, f64::min);
                let peak = heights.iter().copied().fold(0.0, f64::max);
                assert!(middle > 0.03 && peak > 0.04, "{} {swing:?}: {middle} m, {peak} m", motion.name);
            }
        }
    }
}

#[test]
fn the_zero_moment_point_stays_inside_the_loaded_soles() {
    for motion in possible() {
        let reaction = GroundReaction::of(&HUMANOID, &motion.performance.motion);
        let poses = poses(&motion.performance);
        let mut least = f64::INFINITY;
        for (i, contacts) in motion.performance.contacts.iter().enumerate() {
            let corners = loaded(&poses[i], *contacts).concat();
            let Some(point) = reaction.zero_moment_point_m(i).filter(|_| !corners.is_empty()) else {
                continue;
            };
            let margin = margin_m(&corners, point);
            assert!(margin > 2e-3, "{}: {margin} m inside at frame {i}", motion.name);
            least = least.min(margin);
        }
        let wanted = match motion.name {
            "squat" | "bow" | "wave-left" | "wave-right" | "sit" => 0.10,
            "kick" | "turn" | "balance" => 0.03,
            _ => 0.002,
        };
        assert!(least > wanted, "{}: {least} m", motion.name);
    }
}

#[test]
fn the_ground_can_give_the_forces() {
    for motion in possible() {
        let reaction = GroundReaction::of(&HUMANOID, &motion.performance.motion);
        let weight = HUMANOID.body.mass_kg * GRAVITY_M_S2;
        for (i, contacts) in motion.performance.contacts.iter().enumerate() {
            let vertical = reaction.vertical_force_n(i);
            assert!((-0.01..3.0).contains(&(vertical / weight)), "{}: {vertical} N at {i}", motion.name);
            if *contacts != [Contact::None; 2] && vertical > 0.3 * weight {
                let horizontal = reaction.com_acceleration_m_s2[i].xy().norm() * HUMANOID.body.mass_kg;
                assert!(horizontal < 0.65 * vertical, "{}: {horizontal} N at {i}", motion.name);
            }
        }
    }
}

#[test]
fn flight_is_ballistic() {
    for motion in possible() {
        let flights = airborne(&motion.performance.contacts, None);
        let expected = match motion.name {
            "jump" => 1,
            "jog" => 6,
            _ => 0,
        };
        assert_eq!(flights.len(), expected, "{}", motion.name);
        let reaction = GroundReaction::of(&HUMANOID, &motion.performance.motion);
        for flight in flights {
            // A second difference needs three frames in the air.
            for i in flight.start + 1..flight.end - 1 {
                let acceleration = reaction.com_acceleration_m_s2[i];
                assert!((acceleration.z + GRAVITY_M_S2).abs() < 0.02 * GRAVITY_M_S2, "{acceleration}");
                assert!(acceleration.xy().norm() < 0.02 * GRAVITY_M_S2, "{acceleration}");
                let moment = reaction.angular_momentum_rate_nm[i].norm();
                assert!(moment < 100.0, "{}: {moment} N m in the air at frame {i}", motion.name);
            }
        }
    }
}
