//! Recursive Newton-Euler algorithm in world coordinates.
//!
//! Reference: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 5.

use nalgebra::{Isometry3, Vector3};

use crate::kinematics::{JointKind, Tree};

/// Movement of the root link, world coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RootMotion {
    /// Velocity of the root's origin, m/s.
    pub velocity: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Acceleration of the root's origin, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Angular acceleration, rad/s^2.
    pub angular_acceleration: Vector3<f64>,
}

/// A force on a link from outside the tree, world coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExternalForce {
    /// Index of the link.
    pub link: usize,
    /// Where it acts, metres.
    pub point_m: Vector3<f64>,
    /// The force, newtons.
    pub force_n: Vector3<f64>,
}

/// Forces a movement takes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InverseDynamics {
    /// Moment that crosses the joint above each link, acting on the link, about the link's origin, world, N m.
    ///
    /// Its part along the joint axis is the torque, the rest the joint's structure carries; for the root, entry 0, it is
    /// [`InverseDynamics::root_moment_nm`].
    pub moments_nm: Vec<Vector3<f64>>,
    /// Torque about each joint axis, in the order of the tree's angles, N m.
    pub torques_nm: Vec<f64>,
    /// Force from outside the tree that the root needs, world, N.
    pub root_force_n: Vector3<f64>,
    /// Moment from outside the tree about the root's origin that the root needs, world, N m.
    pub root_moment_nm: Vector3<f64>,
    forces_n: Vec<Vector3<f64>>,
    motion: Vec<LinkMotion>,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct LinkMotion {
    angular_velocity: Vector3<f64>,
    angular_acceleration: Vector3<f64>,
    acceleration: Vector3<f64>,
}

/// Computes the forces of a movement into `result`, whose buffers are reused.
///
/// `world_from_link` is what [`Tree::forward`] gives; speeds and accelerations have one entry per tree angle.
/// `gravity` is the acceleration of free fall in the world, for example `(0, 0, -9.81)`.
///
/// # Panics
/// When a slice does not have the length the tree asks for.
#[expect(clippy::too_many_arguments, reason = "these are the arguments of the equation of motion")]
pub fn inverse_dynamics(
    tree: &Tree,
    world_from_link: &[Isometry3<f64>],
    root: &RootMotion,
    speeds: &[f64],
    accelerations: &[f64],
    gravity: &Vector3<f64>,
    external: &[ExternalForce],
    result: &mut InverseDynamics,
) {
    let num_links = tree.links().len();
    assert_eq!(world_from_link.len(), num_links, "one pose per link");
    assert_eq!(
        (speeds.len(), accelerations.len()),
        (tree.num_angles(), tree.num_angles()),
        "one entry per angle"
    );
    let InverseDynamics { moments_nm: moments, torques_nm: torques, forces_n: forces, motion, .. } = result;
    motion.clear();
    forces.clear();
    moments.clear();
    torques.clear();
    torques.resize(tree.num_angles(), 0.0);

    // Outward: velocities and accelerations, and the force each link's own movement takes.
    for (link, pose) in tree.links().iter().zip(world_from_link) {
        let index = motion.len();
        let now = match tree.joint_above(index) {
            // Gravity enters as an upward acceleration of the root.
            None => LinkMotion {
                angular_velocity: root.angular_velocity,
                angular_acceleration: root.angular_acceleration,
                acceleration: root.acceleration - gravity,
            },
            Some(joint) => {
                let parent = motion[joint.parent];
                let lever = pose.translation.vector - world_from_link[joint.parent].translation.vector;
                let omega = parent.angular_velocity;
                let mut now = LinkMotion {
                    acceleration: parent.acceleration
                        + parent.angular_acceleration.cross(&lever)
                        + omega.cross(&omega.cross(&lever)),
                    ..parent
                };
                if let (JointKind::Revolute { axis }, Some(angle)) = (joint.kind, joint.angle_index) {
                    let turn = pose.rotation * axis.into_inner();
                    let spin = turn * speeds[angle];
                    now.angular_velocity += spin;
                    now.angular_acceleration += turn * accelerations[angle] + omega.cross(&spin);
                }
                now
            }
        };
        let (force, moment) = match link.inertial {
            None => (Vector3::zeros(), Vector3::zeros()),
            Some(inertial) => {
                let (omega, alpha) = (now.angular_velocity, now.angular_acceleration);
                let com = pose.rotation * inertial.com_in_link_m;
                let acceleration = now.acceleration + alpha.cross(&com) + omega.cross(&omega.cross(&com));
                let force = acceleration * inertial.mass_kg;
                let rotation = pose.rotation.to_rotation_matrix();
                let inertia =
                    rotation.matrix() * inertial.inertia_about_com_kgm2 * rotation.matrix().transpose();
                (force, inertia * alpha + omega.cross(&(inertia * omega)) + com.cross(&force))
            }
        };
        motion.push(now);
        forces.push(force);
        moments.push(moment);
    }
    for push in external {
        let lever = push.point_m - world_from_link[push.link].translation.vector;
        forces[push.link] -= push.force_n;
        moments[push.link] -= lever.cross(&push.force_n);
    }

    // Inward: what a link needs, its parent must give.
    for joint in tree.joints().iter().rev() {
        let (force, moment) = (forces[joint.child], moments[joint.child]);
        if let (JointKind::Revolute { axis }, Some(angle)) = (joint.kind, joint.angle_index) {
            torques[angle] = (world_from_link[joint.child].rotation * axis.into_inner()).dot(&moment);
        }
        let lever = world_from_link[joint.child].translation.vector
            - world_from_link[joint.parent].translation.vector;
        forces[joint.parent] += force;
        moments[joint.parent] += moment + lever.cross(&force);
    }
    result.root_force_n = forces[0];
    result.root_moment_nm = moments[0];
}
