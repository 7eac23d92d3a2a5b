//! The humanoid in reduced coordinates: a multibody of one revolute joint per axis.
//!
//! Joints cannot come apart and springs act on the joint coordinates themselves, solved implicitly.
//! Ten times slower than [`super::balls`]; it is what those are judged against.

use nalgebra::{UnitQuaternion, Vector3};
use rapier3d_f64::math::Pose;
use rapier3d_f64::prelude::*;

use super::articulation::Articulation;
use super::body::{AddedInertia, insert_link};
use super::chain::Chain;
use super::engine::{Engine, pose, rotation};
use super::feed_forward::SegmentMoments;
use super::gains::{Gains, gains};
use super::reference::ReferenceState;
use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::motion::{JOINTS, NUM_JOINTS};

/// Reduced coordinates need no added inertia.
const ADDED_INERTIA: AddedInertia = AddedInertia { everywhere_kgm2: 0.0, feet_kgm2: 0.0 };

struct Axis {
    kit: usize,
    /// Index of the link in the multibody.
    link: usize,
    /// Index of its coordinate.
    coordinate: usize,
    gains: Gains,
    effort_nm: f64,
    /// Rest angle of the spring in the last step, radians.
    rest_rad: f64,
    /// Torques since they were last taken, added up, N m.
    torques_nm: f64,
}

pub(super) struct Multibody {
    segments: [RigidBodyHandle; NUM_SEGMENTS],
    handle: MultibodyJointHandle,
    axes: Vec<Axis>,
    chains: Vec<Chain>,
    /// Steps since the torques were last taken.
    num_steps: usize,
}

impl Multibody {
    /// Builds the body in the state of the reference; `None` when the engine does not accept the tree.
    pub fn new(
        engine: &mut Engine,
        humanoid: &Humanoid,
        chains: &[Chain],
        start: &ReferenceState,
    ) -> Option<Self> {
        let tree = &humanoid.robot.tree;
        let neutral = tree.forward(&start.world_from_root, &[0.0; NUM_JOINTS]);
        let links: Vec<RigidBodyHandle> = (0..tree.links().len())
            .map(|link| insert_link(engine, humanoid, link, &neutral[link], ADDED_INERTIA))
            .collect();

        let mut inserted = Vec::new();
        for chain in chains {
            let mut parent = humanoid.segment_links[chain.parent_segment];
            let mut parent_from_joint = chain.parent_from_joint;
            for axis in &chain.axes {
                let basis =
                    UnitQuaternion::rotation_between(&Vector3::x(), &axis.axis).unwrap_or_else(|| {
                        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
                    });
                let basis = Pose::from_rotation(rotation(&basis));
                let joint = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
                    .local_frame1(pose(&parent_from_joint) * basis)
                    .local_frame2(basis)
                    .contacts_enabled(false);
                let handle = engine.multibodies.insert(links[parent], links[axis.link], joint, true)?;
                inserted.push((axis, links[axis.link], handle));
                parent = axis.link;
                parent_from_joint = nalgebra::Isometry3::identity();
            }
        }
        let handle = inserted.last()?.2;
        {
            let (multibody, _) = engine.multibodies.get_mut(handle)?;
            multibody.set_self_contacts_enabled(false);
            multibody.forward_kinematics(&engine.bodies, true);
            multibody.damping_mut().fill(0.0);
            multibody.armature_mut().fill(0.0);
        }
        let mut axes = Vec::with_capacity(inserted.len());
        for (axis, body, _) in inserted {
            let id = *engine.multibodies.rigid_body_link(body)?;
            let link = engine.multibodies.get_multibody(id.multibody)?.link(id.id)?;
            axes.push(Axis {
                kit: axis.kit,
                link: id.id,
                coordinate: link.assembly_id(),
                gains: gains(JOINTS[axis.kit].short_name()),
                effort_nm: axis.effort_nm,
                rest_rad: 0.0,
                torques_nm: 0.0,
            });
        }
        let multibody = Self {
            segments: humanoid.segment_links.map(|link| links[link]),
            handle,
            axes,
            chains: chains.to_vec(),
            num_steps: 0,
        };
        multibody.set_state(engine, start);
        Some(multibody)
    }

    fn set_state(&self, engine: &mut Engine, start: &ReferenceState) {
        let Some((multibody, _)) = engine.multibodies.get_mut(self.handle) else { return };
        let mut displacements = vec![0.0; multibody.ndofs()];
        let mut velocities = vec![0.0; multibody.ndofs()];
        velocities[..3].copy_from_slice(start.root_velocity.as_slice());
        velocities[3..6].copy_from_slice(start.root_angular_velocity.as_slice());
        for axis in &self.axes {
            displacements[axis.coordinate] = start.angles[axis.kit];
            velocities[axis.coordinate] = start.speeds[axis.kit];
            multibody.damping_mut()[axis.coordinate] = axis.gains.damping_nms_rad;
        }
        multibody.apply_displacements(&displacements);
        multibody.generalized_velocity_mut().copy_from_slice(&velocities);
        multibody.forward_kinematics(&engine.bodies, false);
        multibody.update_rigid_bodies(&mut engine.bodies, true);
    }
}

impl Articulation for Multibody {
    fn segments(&self) -> &[RigidBodyHandle; NUM_SEGMENTS] {
        &self.segments
    }

    fn command(&mut self, engine: &mut Engine, target: &ReferenceState, moments: &SegmentMoments) {
        let mut feed_forward = [0.0; NUM_JOINTS];
        for chain in &self.chains {
            chain.project(&target.angles, &moments[chain.segment], &mut feed_forward);
        }
        let Some((multibody, _)) = engine.multibodies.get_mut(self.handle) else { return };
        for axis in &mut self.axes {
            let speed = multibody.generalized_velocity()[axis.coordinate];
            let (kp, kd) = (axis.gains.stiffness_nm_rad, axis.gains.damping_nms_rad);
            let Some(link) = multibody.link_mut(axis.link) else { continue };
            let angle = link.joint().coords()[3];
            // The damper acts on the joint speed, so the commanded speed enters through the rest angle.
            let mut rest =
                target.angles[axis.kit] + (kd * target.speeds[axis.kit] + feed_forward[axis.kit]) / kp;
            let torque = kp * (rest - angle) - kd * speed;
            if torque.abs() > axis.effort_nm {
                rest = angle + (torque.signum() * axis.effort_nm + kd * speed) / kp;
            }
            axis.rest_rad = rest;
            link.joint.set_spring(3, kp, rest);
        }
    }

    fn angles_and_speeds(&self, engine: &Engine) -> ([f64; NUM_JOINTS], [f64; NUM_JOINTS]) {
        let (mut angles, mut speeds) = ([0.0; NUM_JOINTS], [0.0; NUM_JOINTS]);
        if let Some((multibody, _)) = engine.multibodies.get(self.handle) {
            for axis in &self.axes {
                angles[axis.kit] = multibody.link(axis.link).map_or(0.0, |link| link.joint().coords()[3]);
                speeds[axis.kit] = multibody.generalized_velocity()[axis.coordinate];
            }
        }
        (angles, speeds)
    }

    /// The springs are implicit: their torque is the law at the end of the step.
    fn add_step(&mut self, engine: &Engine) {
        self.num_steps += 1;
        let (angles, speeds) = self.angles_and_speeds(engine);
        for axis in &mut self.axes {
            let (kp, kd) = (axis.gains.stiffness_nm_rad, axis.gains.damping_nms_rad);
            axis.torques_nm += kp * (axis.rest_rad - angles[axis.kit]) - kd * speeds[axis.kit];
        }
    }

    fn take_torques(&mut self, _angles: &[f64; NUM_JOINTS]) -> [f64; NUM_JOINTS] {
        let mut torques = [0.0; NUM_JOINTS];
        let num_steps = std::mem::take(&mut self.num_steps).max(1) as f64;
        for axis in &mut self.axes {
            torques[axis.kit] = std::mem::take(&mut axis.torques_nm) / num_steps;
        }
        torques
    }

    /// Reduced coordinates cannot come apart.
    fn joint_drift_m(&self, _engine: &Engine) -> f64 {
        0.0
    }
}
