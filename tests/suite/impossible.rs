//! Each impossible motion breaks its own law and no other.

use rprae::humanoid::Side;
use rprae::synthesis::{Feasibility, GroundReaction, SuiteMotion};

use crate::measure::{HUMANOID, loaded, lowest_m, margin_m, poses};
use crate::{SUITE, motion};

/// Largest height of the lowest sole above the floor or below it, metres.
fn gap_m(motion: &SuiteMotion) -> f64 {
    let gap = |poses: &Vec<_>| lowest_m(poses, Side::Left).min(lowest_m(poses, Side::Right));
    poses(&motion.performance).iter().map(gap).fold(0.0, |worst: f64, gap| worst.max(gap.abs()))
}

/// Way of the root between neighbouring frames, metres.
fn steps_m(motion: &SuiteMotion) -> Vec<f64> {
    let frames = motion.performance.motion.frames();
    let step = |pair: &[rprae::motion::Frame]| {
        (pair[1].world_from_root().translation.vector - pair[0].world_from_root().translation.vector).norm()
    };
    frames.windows(2).map(step).collect()
}

#[test]
fn there_is_one_of_each_kind() {
    for kind in [Feasibility::Floats, Feasibility::Slides, Feasibility::Jumps] {
        assert_eq!(SUITE.iter().filter(|motion| motion.feasibility == kind).count(), 1);
    }
}

#[test]
fn the_floating_walk_is_the_walk_in_the_air() {
    let (floating, walk) = (motion("floating-walk"), motion("walk"));
    let poses = poses(&floating.performance);
    for poses in &poses {
        assert!(lowest_m(poses, Side::Left).min(lowest_m(poses, Side::Right)) > 0.08);
    }
    for (a, b) in floating.performance.motion.frames().iter().zip(walk.performance.motion.frames()) {
        let mut lowered = *a;
        lowered.root_position_m[2] = b.root_position_m[2];
        assert_eq!(lowered, *b);
    }
}

#[test]
fn the_sliding_stand_slides_steadily_in_balance() {
    let sliding = motion("sliding-stand");
    assert!(gap_m(sliding) < 1e-4);
    let steps = steps_m(sliding);
    assert!((steps.iter().sum::<f64>() - 1.0).abs() < 1e-3);
    for step in steps {
        assert!((step * 100.0 - 0.25).abs() < 1e-3, "{step}");
    }
    let reaction = GroundReaction::of(&HUMANOID, &sliding.performance.motion);
    for (i, poses) in poses(&sliding.performance).iter().enumerate() {
        let corners = loaded(poses, sliding.performance.contacts[i]).concat();
        assert!(margin_m(&corners, reaction.zero_moment_point_m(i).unwrap()) > 0.1);
    }
}

#[test]
fn the_teleport_is_at_rest_but_for_one_frame() {
    let teleport = motion("teleport");
    assert!(gap_m(teleport) < 1e-4);
    let steps = steps_m(teleport);
    let far: Vec<_> = steps.iter().filter(|step| **step > 1e-9).collect();
    assert_eq!(far.len(), 1);
    assert!((far[0] - 1.0).abs() < 1e-9);
}
