//! Every motion does what its caption says.

use nalgebra::Vector3;
use rprae::motion::{Frame, joint_index};
use rprae::synthesis::{Contact, GroundReaction};

use crate::measure::{HUMANOID, poses, position};
use crate::motion;

fn path(name: &str, link: &str) -> Vec<Vector3<f64>> {
    poses(&motion(name).performance).iter().map(|poses| position(poses, link)).collect()
}

fn highest(path: &[Vector3<f64>]) -> f64 {
    path.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max)
}

fn lowest(path: &[Vector3<f64>]) -> f64 {
    path.iter().map(|p| p.z).fold(f64::INFINITY, f64::min)
}

/// Mean forward speed of the pelvis between two times, m/s.
fn speed(name: &str, from_secs: f64, until_secs: f64) -> f64 {
    let pelvis = path(name, "pelvis");
    let at = |secs: f64| pelvis[(secs * 100.0).round() as usize].y;
    (at(until_secs) - at(from_secs)) / (until_secs - from_secs)
}

/// Number of times a foot comes down.
fn landings(name: &str) -> usize {
    let contacts = &motion(name).performance.contacts;
    (0..2)
        .map(|side| {
            contacts
                .windows(2)
                .filter(|pair| pair[0][side] == Contact::None && pair[1][side] != Contact::None)
                .count()
        })
        .sum()
}

#[test]
fn the_walks_go_forward_at_their_speeds() {
    // Two full steps in the middle.
    let walk = speed("walk", 2.16, 3.25);
    let slow = speed("slow-walk", 2.2, 3.7);
    assert!((1.0..1.2).contains(&walk), "{walk}");
    assert!((0.5..0.65).contains(&slow), "{slow}");
    assert_eq!((landings("walk"), landings("slow-walk")), (6, 5));
    let pelvis = path("walk", "pelvis");
    assert!(pelvis.iter().all(|p| p.x.abs() < 0.08), "straight ahead");
    assert!(pelvis.windows(2).all(|pair| pair[1].y > pair[0].y - 1e-3), "never back");
}

#[test]
fn arms_swing_against_the_legs() {
    for name in ["walk", "slow-walk", "jog"] {
        // How far the left arm and the left foot are ahead of the right ones.
        let lsx = joint_index("LSx").unwrap();
        let rsx = joint_index("RSx").unwrap();
        let frames = motion(name).performance.motion.frames();
        let arm: Vec<f64> =
            frames.iter().map(|frame| frame.joint_angles_rad[lsx] - frame.joint_angles_rad[rsx]).collect();
        let leg: Vec<f64> = path(name, "left_foot")
            .iter()
            .zip(path(name, "right_foot"))
            .map(|(left, right)| left.y - right.y)
            .collect();
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let correlation = product(&arm, &leg) / (product(&arm, &arm) * product(&leg, &leg)).sqrt();
        assert!(correlation < -0.7, "{name}: {correlation}");
    }
}

#[test]
fn the_jog_runs() {
    let jog = speed("jog", 2.35, 3.03);
    assert!((2.0..2.4).contains(&jog), "{jog}");
    // Duty factor of the middle step of the left foot: on the ground for 0.26 s of a stride of 0.68 s.
    let contacts = &motion("jog").performance.contacts;
    let duty = contacts[235..303].iter().filter(|pair| pair[0] != Contact::None).count() as f64 / 68.0;
    assert!((0.35..0.42).contains(&duty), "{duty}");
}

#[test]
fn the_body_goes_down_and_comes_back() {
    for (name, drop) in [("squat", 0.25), ("sit", 0.28)] {
        let pelvis = path(name, "pelvis");
        assert!(pelvis[0].z - lowest(&pelvis) > drop, "{name}: {}", lowest(&pelvis));
        assert!((pelvis[0] - pelvis[pelvis.len() - 1]).norm() < 1e-3);
    }
    let head = path("bow", "head");
    let pelvis = path("bow", "pelvis");
    assert!(head[0].z - lowest(&head) > 0.25, "the head goes down");
    assert!(pelvis[0].z - lowest(&pelvis) < 0.06, "the hips do not");
    assert!(head.iter().map(|p| p.y).fold(0.0, f64::max) > 0.3, "forward");
}

#[test]
fn the_right_hand_waves_where_the_right_hand_should() {
    for (name, hand, other, side) in
        [("wave-left", "left_hand", "right_hand", -1.0), ("wave-right", "right_hand", "left_hand", 1.0)]
    {
        let (raised, resting) = (path(name, hand), path(name, other));
        let head = path(name, "head")[0].z;
        assert!(highest(&raised) > head, "{name}");
        assert!(raised[200].x * side > 0.3, "{name}: {}", raised[200]);
        assert!(highest(&resting) < 1.0, "{name}: the other hand hangs");
        let turns =
            raised[150..390].windows(3).filter(|p| (p[1].x - p[0].x) * (p[2].x - p[1].x) < 0.0).count();
        assert!(turns >= 5, "{name}: {turns} changes of direction");
    }
}

#[test]
fn the_right_leg_kicks_forward() {
    let foot = path("kick", "right_foot");
    let highest = foot.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    assert!(highest.z > 0.45 && highest.y > 0.6, "{highest}");
    assert!(foot.iter().map(|p| p.y).fold(0.0, f64::min) < -0.2, "swings back first");
    let left = path("kick", "left_foot");
    assert!(left.iter().all(|p| (p - left[0]).norm() < 1e-3), "the other foot stays");
}

#[test]
fn the_jump_leaves_the_floor() {
    let reaction = GroundReaction::of(&HUMANOID, &motion("jump").performance.motion);
    let heights: Vec<f64> = reaction.com_m.iter().map(|com| com.z).collect();
    let top = heights.iter().copied().fold(0.0, f64::max);
    assert!(top - heights[0] > 0.1, "{}", top - heights[0]);
    let foot = path("jump", "left_foot");
    assert!((foot[0] - foot[foot.len() - 1]).norm() < 1e-3, "on the spot");
}

#[test]
fn the_turn_is_half_a_turn_to_the_left() {
    let frames = motion("turn").performance.motion.frames();
    let yaw = |frame: &Frame| frame.root_rotation_rad[2];
    assert!((yaw(&frames[frames.len() - 1]) - std::f64::consts::PI).abs() < 0.01);
    assert!(frames.windows(2).all(|pair| yaw(&pair[1]) > yaw(&pair[0]) - 1e-4));
    let pelvis = path("turn", "pelvis");
    assert!(pelvis.iter().all(|p| p.xy().norm() < 0.15), "on the spot");
    assert_eq!(landings("turn"), 5);
}

#[test]
fn the_balance_is_on_the_left_leg() {
    let contacts = &motion("balance").performance.contacts;
    let one_leg = contacts.iter().filter(|pair| **pair == [Contact::Sole, Contact::None]).count();
    assert!(one_leg > 350, "{one_leg} frames");
    assert!(highest(&path("balance", "right_foot")) > 0.3);
}
