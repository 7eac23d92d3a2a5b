//! Forces between the body and the ground, read from the engine.

use nalgebra::{Point3, Vector3};
use rapier3d_f64::prelude::*;

use super::engine::{Engine, from_pose, from_vector};
use super::rollout::Contact;
use crate::humanoid::NUM_SEGMENTS;

/// Impulses of the ground on each segment, summed over steps.
#[derive(Debug, Clone)]
pub(super) struct ContactSum {
    impulse_ns: [Vector3<f64>; NUM_SEGMENTS],
    /// Sum of position times normal impulse, and of the normal impulse.
    weighted: [(Vector3<f64>, f64); NUM_SEGMENTS],
}

impl Default for ContactSum {
    fn default() -> Self {
        Self {
            impulse_ns: [Vector3::zeros(); NUM_SEGMENTS],
            weighted: [(Vector3::zeros(), 0.0); NUM_SEGMENTS],
        }
    }
}

impl ContactSum {
    /// Adds the impulses of the last step.
    pub fn add_step(&mut self, engine: &Engine, segment_of: impl Fn(RigidBodyHandle) -> Option<usize>) {
        for pair in engine.narrow_phase.contact_pairs_with(engine.ground) {
            let ground_first = pair.collider1 == engine.ground;
            let other = if ground_first { pair.collider2 } else { pair.collider1 };
            let Some(segment) = engine.colliders.get(other).and_then(Collider::parent).and_then(&segment_of)
            else {
                continue;
            };
            let Some(first) = engine.colliders.get(pair.collider1) else { continue };
            let world_from_first = from_pose(first.position());
            // The stored impulses act on the first collider's body; the normal points from the first to the second.
            let (normal_sign, tangent_sign) = if ground_first { (1.0, -1.0) } else { (-1.0, 1.0) };
            for manifold in pair.solver_manifolds() {
                let normal = from_vector(manifold.data.normal);
                for point in &manifold.points {
                    let push = point.data.impulse;
                    if push <= 0.0 {
                        continue;
                    }
                    let friction = from_vector(point.data.warmstart_tangent_world);
                    self.impulse_ns[segment] += normal * (push * normal_sign) + friction * tangent_sign;
                    let position = world_from_first * Point3::from(from_vector(point.local_p1));
                    self.weighted[segment].0 += position.coords * push;
                    self.weighted[segment].1 += push;
                }
            }
        }
    }

    /// Mean contacts over a time, and an empty sum again.
    pub fn take(&mut self, duration_secs: f64) -> Vec<Contact> {
        let sum = std::mem::take(self);
        (0..NUM_SEGMENTS)
            .filter(|&segment| sum.weighted[segment].1 > 0.0)
            .map(|segment| Contact {
                segment,
                position_m: Point3::from(sum.weighted[segment].0 / sum.weighted[segment].1),
                force_n: sum.impulse_ns[segment] / duration_secs,
            })
            .collect()
    }
}
