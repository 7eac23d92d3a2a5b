//! The assist: a bounded wrench that pulls the root towards the motion.
//!
//! It is a spring and damper between the root and its commanded pose, solved implicitly with the joints.
//! What it had to do is the price of the motion: the assist impulse.
//! Force and moment are bounded apart; an unbounded moment would let the assist carry a falling body.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::prelude::*;

use super::engine::{Engine, GRAVITY_M_S2, from_pose, from_rotation, from_vector, pose};
use super::reference::ReferenceState;

/// Stiffness and damping of the force, N/m and N s/m.
pub const ASSIST_LINEAR: (f64, f64) = (2000.0, 400.0);
/// Stiffness and damping of the moment, N m/rad and N m s/rad.
pub const ASSIST_ANGULAR: (f64, f64) = (3000.0, 300.0);
/// Share of the bound for each of the two directions across the one the spring pulls in.
const ACROSS: f64 = 0.2;

/// Force and moment of the assist on the root in the world.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Wrench {
    pub force_n: Vector3<f64>,
    pub moment_nm: Vector3<f64>,
}

pub(super) struct Assist {
    root: RigidBodyHandle,
    linear: ImpulseJointHandle,
    angular: ImpulseJointHandle,
    force_limit_n: f64,
    moment_limit_nm: f64,
}

const LINEAR_AXES: [JointAxis; 3] = [JointAxis::LinX, JointAxis::LinY, JointAxis::LinZ];
const ANGULAR_AXES: [JointAxis; 3] = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ];

impl Assist {
    /// Ties the root to the world; the bounds are a share of the weight, and that force at an arm in metres.
    pub fn new(
        engine: &mut Engine,
        root: RigidBodyHandle,
        mass_kg: f64,
        assist_limit: f64,
        assist_arm_m: f64,
    ) -> Self {
        let force_limit_n = assist_limit * mass_kg * GRAVITY_M_S2;
        let anchor = engine.bodies.insert(RigidBodyBuilder::fixed());
        let mut tie = |axes: [JointAxis; 3]| {
            let mut builder = GenericJointBuilder::new(JointAxesMask::empty()).contacts_enabled(false);
            for axis in axes {
                builder =
                    builder.motor_model(axis, MotorModel::ForceBased).set_motor(axis, 0.0, 0.0, 1.0, 1.0);
            }
            engine.joints.insert(anchor, root, builder.build(), true)
        };
        let (linear, angular) = (tie(LINEAR_AXES), tie(ANGULAR_AXES));
        Self { root, linear, angular, force_limit_n, moment_limit_nm: force_limit_n * assist_arm_m }
    }

    /// Sets the spring's rest state for the coming step.
    ///
    /// The engine bounds each axis of a joint by itself.
    /// So that the bound holds for the length of the vector, the axes are turned such that the first lies along the pull;
    /// the other two keep a small share of the bound for what the step brings.
    pub fn command(&self, engine: &mut Engine, target: &ReferenceState) {
        let body = &engine.bodies[self.root];
        let root = from_pose(body.position());
        let velocity = from_vector(body.velocity_at_point(body.position().translation));
        let omega = from_vector(body.angvel());

        let offset = target.world_from_root.translation.vector - root.translation.vector;
        let force = offset * ASSIST_LINEAR.0 + (target.root_velocity - velocity) * ASSIST_LINEAR.1;
        let axes = axes_along(&force);
        let frame = Isometry3::from_parts(target.world_from_root.translation, axes);
        let speed = axes.inverse() * target.root_velocity;
        set(
            engine,
            self.linear,
            LINEAR_AXES,
            [&frame, &Isometry3::identity()],
            &speed,
            ASSIST_LINEAR,
            self.force_limit_n,
        );

        let turn = target.world_from_root.rotation * root.rotation.inverse();
        let moment =
            turn.scaled_axis() * ASSIST_ANGULAR.0 + (target.root_angular_velocity - omega) * ASSIST_ANGULAR.1;
        let axes = axes_along(&moment);
        // Both frames turn alike, so that their difference stays the root's error.
        let local = target.world_from_root.rotation.inverse() * axes;
        let frames = [axes, local].map(|rotation| Isometry3::from_parts(Translation3::identity(), rotation));
        let speed = axes.inverse() * target.root_angular_velocity;
        set(
            engine,
            self.angular,
            ANGULAR_AXES,
            [&frames[0], &frames[1]],
            &speed,
            ASSIST_ANGULAR,
            self.moment_limit_nm,
        );
    }

    /// What the assist did in the last step.
    pub fn wrench(&self, engine: &Engine) -> Wrench {
        let vector = |handle: ImpulseJointHandle, first: usize| {
            let Some(joint) = engine.joints.get(handle) else { return Vector3::zeros() };
            let impulse = |axis: usize| -joint.data.motors[first + axis].impulse / engine.dt_secs();
            from_rotation(joint.data.local_frame1.rotation) * Vector3::new(impulse(0), impulse(1), impulse(2))
        };
        Wrench { force_n: vector(self.linear, 0), moment_nm: vector(self.angular, 3) }
    }
}

/// A rotation that takes x to this direction.
fn axes_along(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    if direction.norm() < 1e-9 {
        return UnitQuaternion::identity();
    }
    UnitQuaternion::rotation_between(&Vector3::x(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI))
}

fn set(
    engine: &mut Engine,
    handle: ImpulseJointHandle,
    axes: [JointAxis; 3],
    [frame1, frame2]: [&Isometry3<f64>; 2],
    speed: &Vector3<f64>,
    (stiffness, damping): (f64, f64),
    limit: f64,
) {
    let Some(joint) = engine.joints.get_mut(handle, false) else { return };
    joint.data.local_frame1 = pose(frame1);
    joint.data.local_frame2 = pose(frame2);
    let along = (1.0 - 2.0 * ACROSS * ACROSS).sqrt();
    for (index, axis) in axes.into_iter().enumerate() {
        joint.data.set_motor(axis, 0.0, speed[index], stiffness, damping);
        joint.data.set_motor_max_force(axis, limit * if index == 0 { along } else { ACROSS });
    }
}
