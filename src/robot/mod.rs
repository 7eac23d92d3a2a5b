//! Robots: a kinematic tree with joint limits and collision shapes, read from URDF.
//!
//! In: URDF text. Out: [`Robot`], with masses, limits and shapes checked.
//! Meshes are not loaded; a mesh collision is refused with the name of its link.

#[cfg(test)]
mod tests;
mod urdf;
mod xml;

pub use urdf::{RobotError, parse_urdf};

use nalgebra::{Isometry3, Vector3};

use crate::kinematics::Tree;

/// Limits of a revolute joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Lower limit, radians; minus infinity for a continuous joint.
    pub lower_rad: f64,
    /// Upper limit, radians; infinity for a continuous joint.
    pub upper_rad: f64,
    /// Largest torque the joint can produce in either direction, N m; infinity where the file sets no limit.
    pub effort_nm: f64,
    /// Largest joint speed, rad/s; infinity where the file sets no limit.
    pub velocity_rad_s: f64,
}

/// A collision shape, centred on the origin of its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Box with these edge lengths, metres.
    Box {
        /// Edge lengths along x, y and z.
        size_m: Vector3<f64>,
    },
    /// Cylinder along z.
    Cylinder {
        /// Radius, metres.
        radius_m: f64,
        /// Length along z, metres.
        length_m: f64,
    },
    /// Cylinder along z with half a sphere on either end.
    Capsule {
        /// Radius, metres.
        radius_m: f64,
        /// Length of the cylindrical part along z, metres.
        length_m: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius, metres.
        radius_m: f64,
    },
}

/// A shape fixed to a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Collision {
    /// Pose of the shape in the link frame.
    pub link_from_shape: Isometry3<f64>,
    /// The shape.
    pub shape: Shape,
}

/// A robot: tree, limits, shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Name of the robot.
    pub name: String,
    /// Links and joints.
    pub tree: Tree,
    /// Limits per joint angle, in the order of [`crate::kinematics::Joint::angle_index`].
    pub limits: Vec<JointLimits>,
    /// Collision shapes per link, in the order of [`Tree::links`].
    pub collisions: Vec<Vec<Collision>>,
}
