//! How far physics explains a motion.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, Vector3};

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

/// Force and moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RootWrench {
    /// Force at the root, world, N.
    pub force_n: Vector3<f64>,
    /// Moment about the root's origin, world, N m.
    pub moment_nm: Vector3<f64>,
}

impl RootWrench {
    /// Point of the floor z = 0 about which the wrench has no horizontal moment, metres; `root_m` is where it acts.
    ///
    /// Where the ground force can act alone: the zero-moment point (Vukobratovic and Borovac 2004, Int. J. Humanoid
    /// Robotics 1:157), angular momentum included.
    /// `None` unless the vertical force is at least `least_force_n`, since it is arbitrary where nothing presses.
    #[must_use]
    pub fn zero_moment_point_m(&self, root_m: &Vector3<f64>, least_force_n: f64) -> Option<[f64; 2]> {
        let (force, moment) = (self.force_n, self.moment_nm);
        (force.z >= least_force_n.max(f64::MIN_POSITIVE)).then(|| {
            [
                root_m.x - (moment.y + root_m.z * force.x) / force.z,
                root_m.y + (moment.x - root_m.z * force.y) / force.z,
            ]
        })
    }
}

/// Finds for every frame (or every [`ExplanationSettings::stride`]-th, from the first) the joint torques and the contact forces that best explain the motion.
///
/// See [`Explainer`], which several explanations of one motion share.
#[must_use]
pub fn explain(
    humanoid: &Humanoid,
    motion: &Motion,
    gravity_m_s2: f64,
    settings: &ExplanationSettings,
) -> Vec<ExplainedFrame> {
    Explainer::new(humanoid, motion, gravity_m_s2, settings).explain(settings)
}

/// A motion made ready for explanations: filtered, differentiated, and with the wrench it asks of the root.
///
/// The floor is at z = 0; gravity points down.
/// What inverse dynamics cannot see: time reversal, sliding at constant speed (unless gated by speed), a feasible pose that
/// is frozen.
pub struct Explainer<'a> {
    humanoid: &'a Humanoid,
    gravity_m_s2: f64,
    /// The filtered motion, every frame of it.
    pub trajectory: Trajectory,
    /// World poses of the links, `[frame][link]`.
    pub poses: Vec<Vec<Isometry3<f64>>>,
    /// World positions of the sole points, `[frame][point]`.
    pub soles_m: Vec<Vec<Point3<f64>>>,
    /// Indices of the frames that are explained.
    pub explained_frames: Vec<usize>,
    /// Wrench from outside that the root needs in each explained frame.
    pub wanted: Vec<RootWrench>,
}

impl<'a> Explainer<'a> {
    /// Prepares a motion; of `settings`, only cutoff and stride matter here.
    #[must_use]
    pub fn new(
        humanoid: &'a Humanoid,
        motion: &Motion,
        gravity_m_s2: f64,
        settings: &ExplanationSettings,
    ) -> Self {
        let trajectory = Trajectory::new(humanoid, motion, settings.cutoff_hz);
        let tree = &humanoid.robot.tree;
        let poses: Vec<_> = trajectory
            .frames
            .iter()
            .map(|frame| tree.forward(&frame.world_from_root, &frame.angles_rad))
            .collect();
        let soles_m = poses.iter().map(|poses| humanoid.sole_points_in_world(poses).collect()).collect();
        let explained_frames = (0..poses.len()).step_by(settings.stride.max(1)).collect();
        let mut explainer =
            Self { humanoid, gravity_m_s2, trajectory, poses, soles_m, explained_frames, wanted: Vec::new() };
        let mut dynamics = InverseDynamics::default();
        explainer.wanted = explainer
            .explained_frames
            .iter()
            .map(|&frame| {
                explainer.solve(frame, &[], &mut dynamics);
                RootWrench { force_n: dynamics.root_force_n, moment_nm: dynamics.root_moment_nm }
            })
            .collect();
        explainer
    }

    /// Frames whose accelerations the ends of the file do not bend: those at least one period of the cutoff from either end.
    ///
    /// The filter has no samples beyond the ends; what it puts there shows in the accelerations for about that long.
    /// At most a quarter of a motion is left out at either end, so that a short one keeps its middle half.
    #[must_use]
    pub fn steady_frames(&self, settings: &ExplanationSettings) -> Range<usize> {
        let num_frames = self.poses.len();
        let margin = (self.trajectory.rate_hz / settings.cutoff_hz).round() as usize;
        let margin = margin.min(num_frames / 4);
        margin..num_frames - margin
    }

    /// Body weight, N.
    #[must_use]
    pub fn weight_n(&self) -> f64 {
        self.humanoid.body.mass_kg * self.gravity_m_s2
    }

    /// World position of the root in a frame, metres.
    #[must_use]
    pub fn root_m(&self, frame: usize) -> Vector3<f64> {
        self.trajectory.frames[frame].world_from_root.translation.vector
    }

    /// Speed of a sole point in a frame by central differences, m/s.
    #[must_use]
    pub fn sole_speed_m_s(&self, frame: usize, point: usize) -> f64 {
        let (before, after) = (frame.saturating_sub(1), (frame + 1).min(self.soles_m.len() - 1));
        let moved = self.soles_m[after][point] - self.soles_m[before][point];
        if before == after { 0.0 } else { moved.norm() * self.trajectory.rate_hz / (after - before) as f64 }
    }

    /// Indices of the sole points that may carry in a frame: low enough, and slow enough.
    #[must_use]
    pub fn carrying(&self, frame: usize, settings: &ExplanationSettings) -> Vec<usize> {
        (0..self.soles_m[frame].len())
            .filter(|&point| {
                self.soles_m[frame][point].z < settings.contact_height_m
                    && (settings.contact_speed_m_s.is_infinite()
                        || self.sole_speed_m_s(frame, point) < settings.contact_speed_m_s)
            })
            .collect()
    }

    /// The solver of contact forces for this body.
    #[must_use]
    pub fn solver(&self, friction: f64) -> ContactSolver {
        ContactSolver { friction, weight_n: self.weight_n(), height_m: self.humanoid.body.height_m }
    }

    /// Explains the frames; of `settings`, friction and the two conditions of contact matter here.
    #[must_use]
    pub fn explain(&self, settings: &ExplanationSettings) -> Vec<ExplainedFrame> {
        let solver = self.solver(settings.friction);
        let mut dynamics = InverseDynamics::default();
        let frames = self.explained_frames.iter().zip(&self.wanted);
        frames
            .map(|(&frame, wanted)| {
                let carrying = self.carrying(frame, settings);
                let soles_m = &self.soles_m[frame];
                let points: Vec<_> =
                    carrying.iter().map(|&point| (soles_m[point], soles_m[point].z)).collect();
                let contact = solver.solve(&points, &self.root_m(frame), &wanted.force_n, &wanted.moment_nm);

                let mut contact_forces_n = vec![Vector3::zeros(); soles_m.len()];
                let mut external = Vec::with_capacity(carrying.len());
                for (&point, &force_n) in carrying.iter().zip(&contact.forces_n) {
                    contact_forces_n[point] = force_n;
                    let link = self.humanoid.sole_points[point].link;
                    external.push(ExternalForce { link, point_m: soles_m[point].coords, force_n });
                }
                self.solve(frame, &external, &mut dynamics);
                let mut torques_nm = [0.0; NUM_JOINTS];
                for (torque, &kit) in dynamics.torques_nm.iter().zip(self.humanoid.kit_of_angle()) {
                    torques_nm[kit] = *torque;
                }
                let moments = dynamics.moments_nm.iter().zip(&self.poses[frame]);
                ExplainedFrame {
                    torques_nm,
                    moments_in_link_nm: moments
                        .map(|(moment, pose)| pose.rotation.inverse() * moment)
                        .collect(),
                    contact_forces_n,
                    residual_force_n: contact.residual_force_n,
                    residual_moment_nm: contact.residual_moment_nm,
                }
            })
            .collect()
    }

    fn solve(&self, frame: usize, external: &[ExternalForce], dynamics: &mut InverseDynamics) {
        let gravity = Vector3::new(0.0, 0.0, -self.gravity_m_s2);
        let state = &self.trajectory.frames[frame];
        let (speeds, accelerations) = (&state.speeds_rad_s, &state.accelerations_rad_s2);
        let tree = &self.humanoid.robot.tree;
        inverse_dynamics(
            tree,
            &self.poses[frame],
            &state.root,
            speeds,
            accelerations,
            &gravity,
            external,
            dynamics,
        );
    }
}
