//! How far physics explains a motion.

use nalgebra::Vector3;

use super::contact_forces::ContactSolver;
use super::rnea::{ExternalForce, InverseDynamics, inverse_dynamics};
use super::trajectory::Trajectory;
use crate::humanoid::Humanoid;
use crate::motion::{Motion, NUM_JOINTS};

/// Choices of the explanation; all of them change its numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExplanationSettings {
    /// Cutoff of the low-pass filter that precedes differentiation, hertz.
    pub cutoff_hz: f64,
    /// Coulomb friction coefficient between sole and ground.
    pub friction: f64,
    /// A sole point below this height may carry force, metres.
    pub contact_height_m: f64,
    /// A sole point must also be slower than this to carry, m/s; infinite switches the condition off.
    ///
    /// With it, sliding at constant speed is unexplained; so is some of the push of rolling feet.
    pub contact_speed_m_s: f64,
    /// Explain every so many frames only; all of them are filtered and differentiated.
    pub stride: usize,
}

impl Default for ExplanationSettings {
    fn default() -> Self {
        Self {
            cutoff_hz: 6.0,
            friction: 0.8,
            contact_height_m: 0.035,
            contact_speed_m_s: f64::INFINITY,
            stride: 1,
        }
    }
}

/// Forces of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ExplainedFrame {
    /// Torque about every joint axis, KIT order, N m.
    pub torques_nm: [f64; NUM_JOINTS],
    /// Moment across the joint above every link, acting on the link, in the link's own frame, N m.
    pub moments_in_link_nm: Vec<Vector3<f64>>,
    /// Force of the ground at every sole point, world, N, in the order of [`Humanoid::sole_points`].
    pub contact_forces_n: Vec<Vector3<f64>>,
    /// Force at the root that no contact gives, world, N.
    pub residual_force_n: Vector3<f64>,
    /// Moment about the root that no contact gives, world, N m.
    pub residual_moment_nm: Vector3<f64>,
}

/// Finds for every frame (or every [`ExplanationSettings::stride`]-th, from the first) the joint torques and the contact forces that best explain the motion.
///
/// The floor is at z = 0; gravity is `gravity_m_s2` downwards.
/// What inverse dynamics cannot see: time reversal, sliding at constant speed (unless gated by speed), a feasible pose that
/// is frozen.
#[must_use]
pub fn explain(
    humanoid: &Humanoid,
    motion: &Motion,
    gravity_m_s2: f64,
    settings: &ExplanationSettings,
) -> Vec<ExplainedFrame> {
    let trajectory = Trajectory::new(humanoid, motion, settings.cutoff_hz);
    let solver = ContactSolver {
        friction: settings.friction,
        weight_n: humanoid.body.mass_kg * gravity_m_s2,
        height_m: humanoid.body.height_m,
    };
    let tree = &humanoid.robot.tree;
    let gravity = Vector3::new(0.0, 0.0, -gravity_m_s2);
    let poses: Vec<_> = trajectory
        .frames
        .iter()
        .map(|frame| tree.forward(&frame.world_from_root, &frame.angles_rad))
        .collect();
    let soles: Vec<Vec<_>> =
        poses.iter().map(|poses| humanoid.sole_points_in_world(poses).collect()).collect();
    let speed = |frame: usize, point: usize| {
        let (before, after) = (frame.saturating_sub(1), (frame + 1).min(soles.len() - 1));
        let moved = soles[after][point] - soles[before][point];
        if before == after { 0.0 } else { moved.norm() * trajectory.rate_hz / (after - before) as f64 }
    };

    let mut dynamics = InverseDynamics::default();
    let stride = settings.stride.max(1);
    let mut explained = Vec::with_capacity(trajectory.frames.len() / stride + 1);
    for (index, frame) in trajectory.frames.iter().enumerate().step_by(stride) {
        let poses = &poses[index];
        let mut solve = |external: &[ExternalForce]| {
            let (speeds, accelerations) = (&frame.speeds_rad_s, &frame.accelerations_rad_s2);
            inverse_dynamics(
                tree,
                poses,
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
        let carrying: Vec<usize> = (0..soles[index].len())
            .filter(|&point| {
                soles[index][point].z < settings.contact_height_m
                    && (settings.contact_speed_m_s.is_infinite()
                        || speed(index, point) < settings.contact_speed_m_s)
            })
            .collect();
        let points: Vec<_> =
            carrying.iter().map(|&point| (soles[index][point], soles[index][point].z)).collect();
        let contact = solver.solve(&points, &frame.world_from_root.translation.vector, &force, &moment);

        let mut contact_forces_n = vec![Vector3::zeros(); soles[index].len()];
        let mut external = Vec::with_capacity(carrying.len());
        for (&point, &force_n) in carrying.iter().zip(&contact.forces_n) {
            contact_forces_n[point] = force_n;
            let link = humanoid.sole_points[point].link;
            external.push(ExternalForce { link, point_m: soles[index][point].coords, force_n });
        }
        solve(&external);
        let mut torques_nm = [0.0; NUM_JOINTS];
        for (torque, &kit) in dynamics.torques_nm.iter().zip(humanoid.kit_of_angle()) {
            torques_nm[kit] = *torque;
        }
        let moments = dynamics.moments_nm.iter().zip(poses);
        explained.push(ExplainedFrame {
            torques_nm,
            moments_in_link_nm: moments.map(|(moment, pose)| pose.rotation.inverse() * moment).collect(),
            contact_forces_n,
            residual_force_n: contact.residual_force_n,
            residual_moment_nm: contact.residual_moment_nm,
        });
    }
    explained
}
