//! Feet stay where they stand: small corrections of the ankles' targets, found after a first pass.
//!
//! - While a foot stands flat, its ankle is held over the middle of where the source has it during that stance.
//! - While a foot stands, flat or on its toe, the lowest point of our sole is brought to the floor.
//!
//! Both are bounded, and fade out before and after the stance.

use nalgebra::{Isometry3, Vector3};

use super::source::Source;
use super::stance::Stance;
use crate::humanoid::{Humanoid, Side};

/// Largest horizontal correction, metres: a foot that slides further in the source slides in ours.
const LARGEST_HOLD_M: f64 = 0.03;
/// Largest vertical correction, metres.
const LARGEST_LIFT_M: f64 = 0.04;
/// Time over which a correction fades in and out, seconds.
const FADE_SECS: f64 = 0.1;

/// Corrections of both ankles by frame, metres.
pub(super) type Corrections = Vec<[Vector3<f64>; 2]>;

/// Horizontal corrections, from the source alone.
pub(super) fn hold_flat_feet(source: &Source, stance: &Stance, corrections: &mut Corrections) {
    let paths = source.foot_paths();
    for (foot, path) in paths.ankles.iter().enumerate() {
        let mut wanted = vec![None; path.len()];
        let mut start = 0;
        while start < path.len() {
            if !stance.flat[start][foot] {
                start += 1;
                continue;
            }
            let end = (start..path.len()).find(|&frame| !stance.flat[frame][foot]).unwrap_or(path.len());
            let sum: Vector3<f64> = path[start..end].iter().sum();
            let middle = sum / (end - start) as f64;
            for frame in start..end {
                let offset = (middle - path[frame]).component_mul(&Vector3::new(1.0, 1.0, 0.0));
                wanted[frame] = Some(offset.cap_magnitude(LARGEST_HOLD_M));
            }
            start = end;
        }
        fade(&wanted, source.rate_hz, |frame, offset| corrections[frame][foot] += offset);
    }
}

/// Vertical corrections that bring the soles of these poses to the floor.
pub(super) fn ground_feet(
    humanoid: &Humanoid,
    rate_hz: f64,
    stance: &Stance,
    poses: impl Iterator<Item = Vec<Isometry3<f64>>>,
    corrections: &mut Corrections,
) {
    let lowest: Vec<[f64; 2]> = poses
        .map(|poses| {
            [Side::Left, Side::Right].map(|side| {
                let points = humanoid.sole_points.iter().filter(|point| point.side == side);
                points
                    .map(|point| (poses[point.link] * point.point_in_link_m).z)
                    .fold(f64::INFINITY, f64::min)
            })
        })
        .collect();
    for foot in 0..2 {
        let wanted: Vec<Option<Vector3<f64>>> = lowest
            .iter()
            .zip(&stance.stands)
            .map(|(lowest, stands)| {
                let lift = (-lowest[foot]).clamp(-LARGEST_LIFT_M, LARGEST_LIFT_M);
                stands[foot].then(|| Vector3::z() * lift)
            })
            .collect();
        fade(&wanted, rate_hz, |frame, offset| {
            let z = &mut corrections[frame][foot].z;
            *z = (*z + offset.z).clamp(-LARGEST_LIFT_M, LARGEST_LIFT_M);
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
