//! The humanoid in maximal coordinates: one rigid body per segment, one impulse joint per anatomical joint.
//!
//! A two- or three-axis chain is a ball whose rest orientation follows the commanded rotation; its motor is a rotational
//! spring and damper about the three axes of that orientation, solved implicitly with everything else.
//! A two-axis chain is a ball as well: the axis it lacks is held at zero by the same spring.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use rapier3d_f64::math::Pose;
use rapier3d_f64::prelude::*;

use super::articulation::Articulation;
use super::body::{AddedInertia, insert_link};
use super::chain::Chain;
use super::engine::{Engine, from_pose, from_rotation, from_vector, pose, rotation, vector};
use super::feed_forward::SegmentMoments;
use super::gains::{Gains, gains};
use super::reference::ReferenceState;
use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::motion::{JOINTS, NUM_JOINTS};

/// Inertia added to every segment but the root, and to the three parts of each foot on top of that, kg m^2.
///
/// Without it the iterative solver loses the light segments; it is part of the results' signature.
pub const ADDED_INERTIA: AddedInertia = AddedInertia { everywhere_kgm2: 0.002, feet_kgm2: 0.02 };

/// Stiffness and damping with which the two sides of a joint are held together: as hard as the step allows.
pub(super) const JOINT_SOFTNESS: SpringCoefficients<f64> =
    SpringCoefficients { natural_frequency: 1.0e6, damping_ratio: 1.0 };

const ANGULAR: [JointAxis; 3] = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ];

struct Joint {
    chain: Chain,
    handle: ImpulseJointHandle,
    gains: Gains,
    /// For one axis: rotation that takes x to the axis.
    hinge_basis: Option<UnitQuaternion<f64>>,
    /// What the motor gave the child since the torques were last taken, N m s: for one axis about it, in x; else in the
    /// frame of the parent.
    impulse_nms: Vector3<f64>,
}

pub(super) struct Balls {
    segments: [RigidBodyHandle; NUM_SEGMENTS],
    joints: Vec<Joint>,
    /// Steps since the torques were last taken.
    num_steps: usize,
    dt_secs: f64,
}

impl Balls {
    /// Builds the body in the state of the reference.
    pub fn new(engine: &mut Engine, humanoid: &Humanoid, chains: Vec<Chain>, start: &ReferenceState) -> Self {
        let world_from_link =
            humanoid.robot.tree.forward(&start.world_from_root, &humanoid.tree_angles(&start.angles));
        let segments = humanoid
            .segment_links
            .map(|link| insert_link(engine, humanoid, link, &world_from_link[link], ADDED_INERTIA));
        let joints = chains.into_iter().map(|chain| insert_joint(engine, &segments, chain)).collect();
        let balls = Self { segments, joints, num_steps: 0, dt_secs: engine.dt_secs() };
        balls.set_velocities(engine, start);
        balls
    }

    fn set_velocities(&self, engine: &mut Engine, start: &ReferenceState) {
        let root = &mut engine.bodies[self.segments[0]];
        let origin = root.position().translation;
        let omega = vector(&start.root_angular_velocity);
        let velocity = vector(&start.root_velocity) + omega.cross(root.center_of_mass() - origin);
        root.set_linvel(velocity, true);
        root.set_angvel(omega, true);
        for Joint { chain, .. } in &self.joints {
            let parent = &engine.bodies[self.segments[chain.parent_segment]];
            let (_, turning) = chain.turn(&start.angles, &start.speeds);
            let joint_rotation = parent.position().rotation * rotation(&chain.parent_from_joint.rotation);
            let omega = parent.angvel() + joint_rotation * vector(&turning);
            let child = &engine.bodies[self.segments[chain.segment]];
            let origin = child.position().translation;
            let velocity = parent.velocity_at_point(origin) + omega.cross(child.center_of_mass() - origin);
            let child = &mut engine.bodies[self.segments[chain.segment]];
            child.set_linvel(velocity, true);
            child.set_angvel(omega, true);
        }
    }
}

impl Articulation for Balls {
    fn segments(&self) -> &[RigidBodyHandle; NUM_SEGMENTS] {
        &self.segments
    }

    fn command(&mut self, engine: &mut Engine, target: &ReferenceState, moments: &SegmentMoments) {
        for Joint { chain, handle, gains, hinge_basis, .. } in &self.joints {
            let Some(joint) = engine.joints.get_mut(*handle, false) else { continue };
            let (kp, kd) = (gains.stiffness_nm_rad, gains.damping_nms_rad);
            if hinge_basis.is_some() {
                let axis = &chain.axes[0];
                let rest = target.angles[axis.kit] + axis.axis.dot(&moments[chain.segment]) / kp;
                joint.data.set_motor(JointAxis::AngX, rest, target.speeds[axis.kit], kp, kd);
            } else {
                let (turn, omega) = chain.turn(&target.angles, &target.speeds);
                joint.data.local_frame1 =
                    pose(&chain.parent_from_joint) * Pose::from_rotation(rotation(&turn));
                let omega = turn.inverse() * omega;
                for (index, axis) in ANGULAR.into_iter().enumerate() {
                    joint.data.set_motor(axis, moments[chain.segment][index] / kp, omega[index], kp, kd);
                }
            }
        }
    }

    fn angles_and_speeds(&self, engine: &Engine) -> ([f64; NUM_JOINTS], [f64; NUM_JOINTS]) {
        let (mut angles, mut speeds) = ([0.0; NUM_JOINTS], [0.0; NUM_JOINTS]);
        for Joint { chain, .. } in &self.joints {
            let parent = &engine.bodies[self.segments[chain.parent_segment]];
            let child = &engine.bodies[self.segments[chain.segment]];
            let world_from_joint =
                from_rotation(parent.position().rotation) * chain.parent_from_joint.rotation;
            let turn = world_from_joint.inverse() * from_rotation(child.position().rotation);
            chain.read_angles(&turn, &mut angles);
            let omega = world_from_joint.inverse() * from_vector(child.angvel() - parent.angvel());
            read_speeds(chain, &angles, &omega, &mut speeds);
        }
        (angles, speeds)
    }

    fn add_step(&mut self, engine: &Engine) {
        self.num_steps += 1;
        for Joint { handle, hinge_basis, impulse_nms, .. } in &mut self.joints {
            let Some(joint) = engine.joints.get(*handle) else { continue };
            // The engine counts impulses on the parent; the child feels the opposite.
            let impulse = |index: usize| -joint.data.motors[3 + index].impulse;
            if hinge_basis.is_some() {
                impulse_nms.x += impulse(0);
            } else {
                let in_target = Vector3::new(impulse(0), impulse(1), impulse(2));
                *impulse_nms += from_rotation(joint.data.local_frame1.rotation) * in_target;
            }
        }
    }

    fn take_torques(&mut self, angles: &[f64; NUM_JOINTS]) -> [f64; NUM_JOINTS] {
        let mut torques = [0.0; NUM_JOINTS];
        let duration_secs = std::mem::take(&mut self.num_steps) as f64 * self.dt_secs;
        for Joint { chain, hinge_basis, impulse_nms, .. } in &mut self.joints {
            let impulse = std::mem::take(impulse_nms);
            if duration_secs == 0.0 {
                continue;
            }
            if hinge_basis.is_some() {
                torques[chain.axes[0].kit] = impulse.x / duration_secs;
                continue;
            }
            let in_joint = chain.parent_from_joint.rotation.inverse() * impulse;
            for (kit, axis) in chain.axes_in_joint(angles) {
                torques[kit] = axis.dot(&in_joint) / duration_secs;
            }
        }
        torques
    }

    fn joint_drift_m(&self, engine: &Engine) -> f64 {
        let gap = |Joint { chain, .. }: &Joint| {
            let parent = from_pose(engine.bodies[self.segments[chain.parent_segment]].position());
            let child = engine.bodies[self.segments[chain.segment]].position().translation;
            let socket = parent * Point3::from(chain.parent_from_joint.translation.vector);
            (socket.coords - from_vector(child)).norm()
        };
        self.joints.iter().map(gap).fold(0.0, f64::max)
    }
}

/// Angle rates of a chain whose child turns with `omega` in the joint frame: least squares over its axes.
fn read_speeds(
    chain: &Chain,
    angles: &[f64; NUM_JOINTS],
    omega: &Vector3<f64>,
    speeds: &mut [f64; NUM_JOINTS],
) {
    let axes: Vec<_> = chain.axes_in_joint(angles).collect();
    match axes.as_slice() {
        [(kit, axis)] => speeds[*kit] = axis.dot(omega),
        [(first, a), (second, b)] => (speeds[*first], speeds[*second]) = (a.dot(omega), b.dot(omega)),
        [(first, a), (second, b), (third, c)] => {
            let columns = nalgebra::Matrix3::from_columns(&[*a, *b, *c]);
            // Singular at the gimbal pole, where the first and third axis meet; their shared rate then goes to the first.
            let rates = columns
                .try_inverse()
                .filter(|_| columns.determinant().abs() > 1e-3)
                .map_or_else(|| Vector3::new(a.dot(omega), b.dot(omega), 0.0), |inverse| inverse * omega);
            (speeds[*first], speeds[*second], speeds[*third]) = (rates.x, rates.y, rates.z);
        }
        _ => {}
    }
}

fn insert_joint(engine: &mut Engine, segments: &[RigidBodyHandle; NUM_SEGMENTS], chain: Chain) -> Joint {
    let gains = gains(JOINTS[chain.axes[0].kit].short_name());
    let hinge_basis = (chain.axes.len() == 1).then(|| {
        UnitQuaternion::rotation_between(&Vector3::x(), &chain.axes[0].axis)
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI))
    });
    let (locked, motors) = match hinge_basis {
        Some(_) => (JointAxesMask::LOCKED_REVOLUTE_AXES, &ANGULAR[..1]),
        None => (JointAxesMask::LOCKED_SPHERICAL_AXES, &ANGULAR[..]),
    };
    let basis = Pose::from_rotation(rotation(&hinge_basis.unwrap_or_default()));
    let mut builder = GenericJointBuilder::new(locked)
        .local_frame1(pose(&chain.parent_from_joint) * basis)
        .local_frame2(basis)
        .softness(JOINT_SOFTNESS)
        .contacts_enabled(false);
    for (index, axis) in motors.iter().enumerate() {
        let effort =
            if hinge_basis.is_some() { chain.axes[0].effort_nm } else { effort_along(&chain, index) };
        builder = builder
            .motor_model(*axis, MotorModel::ForceBased)
            .set_motor(*axis, 0.0, 0.0, gains.stiffness_nm_rad, gains.damping_nms_rad)
            .motor_max_force(*axis, effort);
    }
    let (parent, child) = (segments[chain.parent_segment], segments[chain.segment]);
    let handle = engine.joints.insert(parent, child, builder.build(), true);
    Joint { chain, handle, gains, hinge_basis, impulse_nms: Vector3::zeros() }
}

/// Torque limit of a ball about one axis of its target frame: that of the hinge which lies along it at zero angles.
///
/// Away from zero the ball's axes turn with the target and the hinges' do not all, so the bound is that of the nearest
/// hinge only approximately.
/// An axis the chain lacks is held by the joint's structure, as strongly as its strongest hinge.
fn effort_along(chain: &Chain, index: usize) -> f64 {
    let along = chain.axes.iter().find(|axis| axis.axis[index].abs() > 0.7);
    along.map_or_else(
        || chain.axes.iter().map(|axis| axis.effort_nm).fold(0.0, f64::max),
        |axis| axis.effort_nm,
    )
}
