//! The body as anatomical joints: one chain of axes between two rigid segments.
//!
//! A URDF writes a three-axis joint as three hinges with near-massless frames between them.
//! Solvers that treat links as bodies do not converge through such frames, so the frames are folded away here:
//! each chain becomes one joint with up to three axes.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::kinematics::JointKind;
use crate::motion::NUM_JOINTS;

/// One revolute axis of a chain.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChainAxis {
    /// KIT index of its angle.
    pub kit: usize,
    /// Axis in the frame after the turns of the axes above it.
    pub axis: Unit<Vector3<f64>>,
    /// Largest torque, N m.
    pub effort_nm: f64,
    /// Tree link below this axis (a massless frame, or the segment itself for the last axis).
    pub link: usize,
}

/// The joint above one segment.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Index of the segment above.
    pub parent_segment: usize,
    /// Index of the segment below.
    pub segment: usize,
    /// Joint frame in the parent segment at zero angles.
    pub parent_from_joint: Isometry3<f64>,
    /// One to three axes, from parent to child.
    pub axes: Vec<ChainAxis>,
}

impl Chain {
    /// Rotation of the child in the joint frame, `R1 R2 R3`, and its angular velocity in the joint frame.
    pub fn turn(
        &self,
        angles: &[f64; NUM_JOINTS],
        speeds: &[f64; NUM_JOINTS],
    ) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let mut rotation = UnitQuaternion::identity();
        let mut velocity = Vector3::zeros();
        for axis in &self.axes {
            velocity += rotation * axis.axis.into_inner() * speeds[axis.kit];
            rotation *= UnitQuaternion::from_axis_angle(&axis.axis, angles[axis.kit]);
        }
        (rotation, velocity)
    }

    /// Directions of the axes in the joint frame when the chain has these angles.
    pub fn axes_in_joint(
        &self,
        angles: &[f64; NUM_JOINTS],
    ) -> impl Iterator<Item = (usize, Vector3<f64>)> + '_ {
        let mut rotation = UnitQuaternion::identity();
        let angles: Vec<f64> = self.axes.iter().map(|axis| angles[axis.kit]).collect();
        self.axes.iter().zip(angles).map(move |(axis, angle)| {
            let direction = rotation * axis.axis.into_inner();
            rotation *= UnitQuaternion::from_axis_angle(&axis.axis, angle);
            (axis.kit, direction)
        })
    }

    /// Writes the torques about the axes that a moment on the segment (in the segment's frame) amounts to.
    pub fn project(
        &self,
        angles: &[f64; NUM_JOINTS],
        moment: &Vector3<f64>,
        torques: &mut [f64; NUM_JOINTS],
    ) {
        let (joint_from_segment, _) = self.turn(angles, &[0.0; NUM_JOINTS]);
        let in_joint = joint_from_segment * moment;
        for (kit, axis) in self.axes_in_joint(angles) {
            torques[kit] = axis.dot(&in_joint);
        }
    }

    /// Writes the angles that give this rotation of the child in the joint frame.
    ///
    /// One axis: the twist about it. Two or three axes at right angles: Tait-Bryan angles in the chain's order; with two
    /// axes the third angle, which the chain cannot make, is dropped.
    pub fn read_angles(&self, joint_from_child: &UnitQuaternion<f64>, angles: &mut [f64; NUM_JOINTS]) {
        match self.axes.as_slice() {
            [only] => {
                let along = joint_from_child.imag().dot(&only.axis);
                angles[only.kit] = wrapped(2.0 * along.atan2(joint_from_child.w));
            }
            [first, second, rest @ ..] => {
                let (a, b) = (first.axis.into_inner(), second.axis.into_inner());
                let c = a.cross(&b);
                let matrix = joint_from_child.to_rotation_matrix();
                let entry = |row: &Vector3<f64>, column: &Vector3<f64>| row.dot(&(matrix * column));
                // R = Rot(a, x) Rot(b, y) Rot(c, z) with c = a x b, a right-handed triple.
                angles[first.kit] = (-entry(&b, &c)).atan2(entry(&c, &c));
                angles[second.kit] = entry(&a, &c).clamp(-1.0, 1.0).asin();
                if let [third] = rest {
                    let sign = c.dot(&third.axis).signum();
                    angles[third.kit] = sign * (-entry(&a, &b)).atan2(entry(&a, &a));
                }
            }
            [] => {}
        }
    }
}

fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    angle - TAU * ((angle + PI) / TAU).floor()
}

/// The chains of a humanoid, in segment order; segment 0 is the root and has none.
///
/// # Errors
/// The name of a link whose chain has hinges apart from each other or an unexpected form.
pub(super) fn chains(humanoid: &Humanoid) -> Result<Vec<Chain>, String> {
    let tree = &humanoid.robot.tree;
    let segment_of = |link: usize| humanoid.segment_links.iter().position(|&other| other == link);
    let mut chains = Vec::with_capacity(NUM_SEGMENTS - 1);
    for (segment, &link) in humanoid.segment_links.iter().enumerate().skip(1) {
        let name = || tree.links()[link].name.clone();
        let mut axes = Vec::new();
        let mut below = link;
        let (parent_segment, parent_from_joint) = loop {
            let joint = tree.joint_above(below).ok_or_else(name)?;
            let (JointKind::Revolute { axis }, Some(angle)) = (joint.kind, joint.angle_index) else {
                return Err(name());
            };
            let limits = humanoid.robot.limits[angle];
            axes.insert(
                0,
                ChainAxis {
                    kit: humanoid.kit_of_angle()[angle],
                    axis,
                    effort_nm: limits.effort_nm,
                    link: below,
                },
            );
            if let Some(parent) = segment_of(joint.parent) {
                break (parent, joint.parent_from_joint);
            }
            let offset = joint.parent_from_joint;
            if offset.translation.vector.norm() > 1e-9 || offset.rotation.angle() > 1e-9 {
                return Err(name());
            }
            below = joint.parent;
        };
        let orthogonal = axes.windows(2).all(|pair| pair[0].axis.dot(&pair[1].axis).abs() < 1e-9);
        let plane = axes.len() < 3 || axes[0].axis.dot(&axes[2].axis).abs() < 1e-9;
        if axes.len() > 3 || !orthogonal || !plane {
            return Err(name());
        }
        chains.push(Chain { parent_segment, segment, parent_from_joint, axes });
    }
    Ok(chains)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, JOINTS};

    #[test]
    fn angles_survive_the_way_through_rotations() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let chains = chains(&humanoid).unwrap();
        assert_eq!(chains.len(), NUM_SEGMENTS - 1);
        assert_eq!(chains.iter().map(|chain| chain.axes.len()).sum::<usize>(), NUM_JOINTS);
        let mut angles = [0.0; NUM_JOINTS];
        for (index, angle) in angles.iter_mut().enumerate() {
            // Inside the limits and away from the poles of the middle axes.
            let share = 0.5 + 0.4 * (index as f64 * 1.7).sin();
            let (lower, upper) = (JOINTS[index].lower_rad.max(-1.3), JOINTS[index].upper_rad.min(1.3));
            *angle = lower + share * (upper - lower);
        }
        let mut read = [0.0; NUM_JOINTS];
        for chain in &chains {
            let (rotation, _) = chain.turn(&angles, &[0.0; NUM_JOINTS]);
            chain.read_angles(&rotation, &mut read);
        }
        for (index, (expected, found)) in angles.iter().zip(&read).enumerate() {
            assert!((expected - found).abs() < 1e-12, "{}: {expected} {found}", JOINTS[index].name);
        }
    }

    #[test]
    fn velocity_is_the_derivative_of_the_turn() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let chain = &chains(&humanoid).unwrap()[1];
        let (angles, speeds) = ([0.3; NUM_JOINTS], [0.7; NUM_JOINTS]);
        let h = 1e-6;
        let (before, velocity) = chain.turn(&angles, &speeds);
        let (after, _) = chain.turn(&angles.map(|angle| angle + 0.7 * h), &speeds);
        let numeric = (after * before.inverse()).scaled_axis() / h;
        assert!((numeric - velocity).norm() < 1e-5, "{numeric} {velocity}");
    }
}
