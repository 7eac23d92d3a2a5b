//! Feet stay where they stand: small corrections of the ankles' targets, found after a first pass.
//!
//! - While a foot stands, flat or on its toe, the joint of its toes stays in one place.
//! - The lowest point of its sole is brought to the floor; a foot that does not stand is only kept out of it.
//!
//! Both are bounded, and fade out before and after the stance.

use nalgebra::{Isometry3, Vector3};

use super::stance::Stance;
use crate::humanoid::{Humanoid, Side};

/// Largest horizontal correction, metres: a foot that slides further in the source slides in ours.
const LARGEST_HOLD_M: f64 = 0.03;
/// Largest distance by which a foot is lowered to the floor, metres: one further up may stand on something,
const LARGEST_LOWERING_M: f64 = 0.04;
/// and by which it is raised, metres: nothing stands below the floor.
const LARGEST_RAISE_M: f64 = 0.1;
/// Time over which a correction fades in and out, seconds.
const FADE_SECS: f64 = 0.1;

/// Corrections of both ankles by frame, metres.
pub(super) type Corrections = Vec<[Vector3<f64>; 2]>;

/// Corrections that bring the standing soles of these poses to the floor and keep their toes where they are.
pub(super) fn hold_feet(
    humanoid: &Humanoid,
    rate_hz: f64,
    stance: &Stance,
    poses: impl Iterator<Item = Vec<Isometry3<f64>>>,
    corrections: &mut Corrections,
) {
    // The joint of the toes is where a foot turns as long as any of its front stands.
    let toes =
        ["left_toes", "right_toes"].map(|name| humanoid.robot.tree.link_index(name).unwrap_or_default());
    // Per frame and foot: the joint of the toes, and in its z the lowest point of the sole.
    let feet: Vec<[Vector3<f64>; 2]> = poses
        .map(|poses| {
            [(Side::Left, toes[0]), (Side::Right, toes[1])].map(|(side, toe)| {
                let points = humanoid.sole_points.iter().filter(|point| point.side == side);
                let lowest = points
                    .map(|point| (poses[point.link] * point.point_in_link_m).z)
                    .fold(f64::INFINITY, f64::min);
                let toe = poses[toe].translation.vector;
                Vector3::new(toe.x, toe.y, lowest)
            })
        })
        .collect();
    for foot in 0..2 {
        let path: Vec<Vector3<f64>> = feet.iter().map(|feet| feet[foot]).collect();
        let mut wanted = vec![None; path.len()];
        let mut start = 0;
        while start < path.len() {
            if !stance.stands[start][foot] {
                start += 1;
                continue;
            }
            let end = (start..path.len()).find(|&frame| !stance.stands[frame][foot]).unwrap_or(path.len());
            let middle = path[start..end].iter().sum::<Vector3<f64>>() / (end - start) as f64;
            for frame in start..end {
                let offset = middle - path[frame];
                wanted[frame] = Some(Vector3::new(offset.x, offset.y, -path[frame].z));
            }
            start = end;
        }
        fade(&wanted, rate_hz, |frame, offset| {
            let mut sum = corrections[frame][foot] + offset;
            if !stance.stands[frame][foot] {
                // Our feet are longer than most sources': what would pass through the floor is lifted.
                sum.z += (-path[frame].z).max(0.0);
            }
            let level = Vector3::new(sum.x, sum.y, 0.0).cap_magnitude(LARGEST_HOLD_M);
            corrections[frame][foot] =
                Vector3::new(level.x, level.y, sum.z.clamp(-LARGEST_LOWERING_M, LARGEST_RAISE_M));
        });
    }
}

/// Applies what is wanted, and next to it the nearest wanted value, fading with the time to it.
fn fade(wanted: &[Option<Vector3<f64>>], rate_hz: f64, mut apply: impl FnMut(usize, Vector3<f64>)) {
    let reach = (FADE_SECS * rate_hz).max(1.0);
    let nearest = |frames: &mut dyn Iterator<Item = usize>| {
        let mut nearest: Vec<Option<(usize, Vector3<f64>)>> = vec![None; wanted.len()];
        let mut last = None;
        for frame in frames {
            last = wanted[frame].map(|offset| (frame, offset)).or(last);
            nearest[frame] = last;
        }
        nearest
    };
    let before = nearest(&mut (0..wanted.len()));
    let after = nearest(&mut (0..wanted.len()).rev());
    for frame in 0..wanted.len() {
        let share = |side: Option<(usize, Vector3<f64>)>| {
            side.map_or(Vector3::zeros(), |(other, offset)| {
                let far = (frame.abs_diff(other) as f64 / reach).min(1.0);
                offset * (1.0 - far * far * (3.0 - 2.0 * far))
            })
        };
        match wanted[frame] {
            Some(offset) => apply(frame, offset),
            None => apply(frame, share(before[frame]) + share(after[frame])),
        }
    }
}
