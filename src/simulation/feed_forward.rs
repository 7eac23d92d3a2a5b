//! Joint moments the motion takes, known before the simulation: the springs then only correct.
//!
//! Inverse dynamics of the filtered motion with the contact forces that explain it best.
//! Without feed-forward a spring must be pulled out of place to carry weight, and the body sags and leans.

use nalgebra::Vector3;

use super::chain::Chain;
use super::engine::GRAVITY_M_S2;
use crate::dynamics::{ContactSolver, ExternalForce, InverseDynamics, Trajectory, inverse_dynamics};
use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::motion::Motion;

/// Cutoff of the motion's low-pass filter, hertz.
const CUTOFF_HZ: f64 = 6.0;
/// A sole point this near the floor may carry, metres.
const CONTACT_HEIGHT_M: f64 = 0.035;

/// Moment across the joint above every segment, acting on the segment, in the segment's own frame, N m.
pub(super) type SegmentMoments = [Vector3<f64>; NUM_SEGMENTS];

/// Joint moments over a motion.
pub(super) struct FeedForward {
    rate_hz: f64,
    frames: Vec<SegmentMoments>,
}

impl FeedForward {
    pub fn new(humanoid: &Humanoid, motion: &Motion, chains: &[Chain], friction: f64) -> Self {
        let trajectory = Trajectory::new(humanoid, motion, CUTOFF_HZ);
        let solver = ContactSolver {
            friction,
            weight_n: humanoid.body.mass_kg * GRAVITY_M_S2,
            height_m: humanoid.body.height_m,
        };
        let tree = &humanoid.robot.tree;
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        let mut dynamics = InverseDynamics::default();
        let frames = trajectory
            .frames
            .iter()
            .map(|frame| {
                let poses = tree.forward(&frame.world_from_root, &frame.angles_rad);
                let mut solve = |external: &[ExternalForce]| {
                    let (speeds, accelerations) = (&frame.speeds_rad_s, &frame.accelerations_rad_s2);
                    inverse_dynamics(
                        tree,
                        &poses,
                        &frame.root,
                        speeds,
                        accelerations,
                        &gravity,
                        external,
                        &mut dynamics,
                    );
                    (dynamics.root_force_n, dynamics.root_moment_nm)
                };
                let (force, moment) = solve(&[]);
                let mut links = Vec::new();
                let mut points = Vec::new();
                for (sole, point) in humanoid.sole_points.iter().zip(humanoid.sole_points_in_world(&poses)) {
                    if point.z < CONTACT_HEIGHT_M {
                        links.push(sole.link);
                        points.push((point, point.z));
                    }
                }
                let root = frame.world_from_root.translation.vector;
                let contact = solver.solve(&points, &root, &force, &moment);
                let external: Vec<ExternalForce> = links
                    .iter()
                    .zip(&points)
                    .zip(&contact.forces_n)
                    .map(|((&link, (point, _)), &force_n)| ExternalForce {
                        link,
                        point_m: point.coords,
                        force_n,
                    })
                    .collect();
                solve(&external);
                let mut moments = [Vector3::zeros(); NUM_SEGMENTS];
                for chain in chains {
                    let link = humanoid.segment_links[chain.segment];
                    // The frames between axes sit in the joint's centre, so the moment is the same at each of them.
                    moments[chain.segment] = poses[link].rotation.inverse() * dynamics.moments_nm[link];
                }
                moments
            })
            .collect();
        Self { rate_hz: trajectory.rate_hz, frames }
    }

    /// Moments at a time, linear between frames.
    pub fn at(&self, time_secs: f64) -> SegmentMoments {
        let last = self.frames.len() - 1;
        let position = (time_secs * self.rate_hz).clamp(0.0, last as f64);
        let frame = position.floor() as usize;
        let (before, after) = (&self.frames[frame], &self.frames[(frame + 1).min(last)]);
        let share = position - frame as f64;
        std::array::from_fn(|segment| before[segment] * (1.0 - share) + after[segment] * share)
    }
}
