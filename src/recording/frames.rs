//! Coordinate frames of a recording: one per URDF link, so that a viewer's robot moves as one piece.
//!
//! A simulation with a body per segment lets the joints drift apart by fractions of a millimetre, and knows nothing of
//! the massless links between the axes of one anatomical joint.
//! Here each massless link is placed by its hinge angle, and the last link of a chain takes up the rest, so that every
//! segment lands on its simulated pose exactly, whatever the joints above it did.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::humanoid::Humanoid;
use crate::kinematics::{Joint, JointKind};
use crate::motion::NUM_JOINTS;
use crate::simulation::SegmentPoses;

/// The fixed frame all others hang from.
pub const WORLD_FRAME: &str = "world";
/// Root frame after REP-103 (x forward, y left, z up), fixed to the root link, whose own axes are x right, y forward.
pub const BASE_FRAME: &str = "base_link";
/// Frame at the root's origin with the axes of the world; forces on the whole body are given in it.
pub const ROOT_ALIGNED_FRAME: &str = "root_aligned";
/// What the names of the reference's frames begin with.
pub const REFERENCE_PREFIX: &str = "reference/";

/// A pose relative to another frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FramePose<'a> {
    pub parent: &'a str,
    pub child: &'a str,
    pub parent_from_child: Isometry3<f64>,
}

/// The link frames of one robot in a recording.
#[derive(Debug, Clone)]
pub(super) struct LinkFrames {
    /// Frame names in the order of the tree's links.
    names: Vec<String>,
    base: String,
    root_aligned: String,
    joints: Vec<Joint>,
    /// Segment index per link; `None` for a massless link.
    segment_of_link: Vec<Option<usize>>,
    /// KIT joint index of each tree angle.
    kit_of_angle: [usize; NUM_JOINTS],
}

impl LinkFrames {
    /// Frames named `prefix` followed by the link name.
    pub(super) fn new(humanoid: &Humanoid, prefix: &str) -> Self {
        let tree = &humanoid.robot.tree;
        let mut segment_of_link = vec![None; tree.links().len()];
        for (segment, &link) in humanoid.segment_links.iter().enumerate() {
            segment_of_link[link] = Some(segment);
        }
        Self {
            names: tree.links().iter().map(|link| format!("{prefix}{}", link.name)).collect(),
            base: format!("{prefix}{BASE_FRAME}"),
            root_aligned: format!("{prefix}{ROOT_ALIGNED_FRAME}"),
            joints: tree.joints().to_vec(),
            segment_of_link,
            kit_of_angle: *humanoid.kit_of_angle(),
        }
    }

    /// The frame that never moves relative to the root.
    pub(super) fn fixed(&self) -> FramePose<'_> {
        // Forward is the root's y, left its -x: a quarter turn to the left about z.
        let quarter_turn =
            UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        FramePose {
            parent: &self.names[0],
            child: &self.base,
            parent_from_child: Isometry3::from_parts(Translation3::identity(), quarter_turn),
        }
    }

    /// Name of the frame with the axes of the world at this robot's root.
    pub(super) fn root_aligned(&self) -> &str {
        &self.root_aligned
    }

    /// Pose of every moving frame in its parent: the root, the world-aligned frame at it, then the links in tree order.
    ///
    /// `angles_rad` (KIT order) place the massless links; the segments go where `world_from_segment` says.
    pub(super) fn poses(
        &self,
        world_from_segment: &SegmentPoses,
        angles_rad: &[f64; NUM_JOINTS],
    ) -> Vec<FramePose<'_>> {
        let world_from_root = world_from_segment[0];
        let at_root = Isometry3::from_parts(world_from_root.translation, UnitQuaternion::identity());
        let mut poses = Vec::with_capacity(self.names.len() + 1);
        poses.push(FramePose {
            parent: WORLD_FRAME,
            child: &self.names[0],
            parent_from_child: world_from_root,
        });
        poses.push(FramePose { parent: WORLD_FRAME, child: &self.root_aligned, parent_from_child: at_root });

        let mut world_from_link = Vec::with_capacity(self.names.len());
        world_from_link.push(world_from_root);
        for joint in &self.joints {
            let world_from_parent: Isometry3<f64> = world_from_link[joint.parent];
            let parent_from_child = match self.segment_of_link[joint.child] {
                Some(segment) => world_from_parent.inv_mul(&world_from_segment[segment]),
                None => joint.parent_from_joint * self.turn(joint, angles_rad),
            };
            world_from_link.push(world_from_parent * parent_from_child);
            let (parent, child) = (&self.names[joint.parent], &self.names[joint.child]);
            poses.push(FramePose { parent, child, parent_from_child });
        }
        for pose in &mut poses {
            pose.parent_from_child = rounded(&pose.parent_from_child);
        }
        poses
    }

    fn turn(&self, joint: &Joint, angles_rad: &[f64; NUM_JOINTS]) -> UnitQuaternion<f64> {
        match (joint.kind, joint.angle_index) {
            (JointKind::Revolute { axis }, Some(angle)) => {
                UnitQuaternion::from_axis_angle(&axis, angles_rad[self.kit_of_angle[angle]])
            }
            _ => UnitQuaternion::identity(),
        }
    }
}

/// Steps per metre, or per unit of a quaternion: values are rounded to multiples of 2^-24, 60 nanometres.
const POSE_STEPS: f64 = (1 << 24) as f64;
/// Steps per unit of speeds, forces and torques: 2^-16, 15 micronewtons.
const EFFORT_STEPS: f64 = (1 << 16) as f64;

/// A length in metres, an angle in radians or a quaternion component, to 2^-24: zeros at its end compress well.
pub(super) fn rounded_pose(value: f64) -> f64 {
    // Adding zero turns a negative zero into zero.
    (value * POSE_STEPS).round() / POSE_STEPS + 0.0
}

/// A speed, force or torque, to 2^-16.
pub(super) fn rounded_effort(value: f64) -> f64 {
    (value * EFFORT_STEPS).round() / EFFORT_STEPS + 0.0
}

/// The pose with rounded numbers; of the two quaternions of a rotation the one with w >= 0.
fn rounded(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let translation = pose.translation.vector.map(rounded_pose);
    let sign = if pose.rotation.w < 0.0 { -1.0 } else { 1.0 };
    let quaternion = pose.rotation.coords.map(|component| rounded_pose(sign * component));
    Isometry3::from_parts(
        Translation3::from(translation),
        UnitQuaternion::new_unchecked(Quaternion::from(quaternion)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, Frame, JOINTS};
    use nalgebra::Vector3;
    use std::collections::BTreeMap;

    fn adult() -> Humanoid {
        Humanoid::new(Body::with_default_mass(1.75)).unwrap()
    }

    /// A pose with every joint in the middle of its range, off centre.
    fn bent() -> Frame {
        let mut frame = Frame::ZERO;
        for (angle, joint) in frame.joint_angles_rad.iter_mut().zip(&JOINTS) {
            *angle = 0.6 * joint.lower_rad + 0.4 * joint.upper_rad;
        }
        frame.root_position_m = [1.0, -2.0, 0.9];
        frame.root_rotation_rad = [0.1, -0.2, 2.5];
        frame
    }

    fn compose(poses: &[FramePose<'_>]) -> BTreeMap<String, Isometry3<f64>> {
        let mut world_from = BTreeMap::from([(WORLD_FRAME.to_owned(), Isometry3::identity())]);
        for pose in poses {
            let world_from_child = world_from[pose.parent] * pose.parent_from_child;
            assert!(world_from.insert(pose.child.to_owned(), world_from_child).is_none(), "{}", pose.child);
        }
        world_from
    }

    #[test]
    fn without_drift_every_link_lies_where_forward_kinematics_puts_it() {
        let humanoid = adult();
        let frame = bent();
        let links = humanoid.forward(&frame);
        let segments = humanoid.segment_links.map(|link| links[link]);
        let frames = LinkFrames::new(&humanoid, "");
        let world_from = compose(&frames.poses(&segments, &frame.joint_angles_rad));
        for (link, expected) in humanoid.robot.tree.links().iter().zip(&links) {
            let error = world_from[&link.name].inv_mul(expected);
            assert!(error.translation.vector.norm() < 2e-6, "{} {error}", link.name);
            assert!(error.rotation.angle() < 2e-6, "{} {error}", link.name);
        }
    }

    #[test]
    fn with_drift_every_segment_still_lands_on_its_own_pose() {
        let humanoid = adult();
        let frame = bent();
        let links = humanoid.forward(&frame);
        let mut segments = humanoid.segment_links.map(|link| links[link]);
        for (index, segment) in segments.iter_mut().enumerate().skip(1) {
            let shift = 0.001 * index as f64;
            segment.translation.vector += Vector3::new(shift, -shift, 0.5 * shift);
            segment.rotation *= UnitQuaternion::from_euler_angles(shift, 2.0 * shift, -shift);
        }
        let frames = LinkFrames::new(&humanoid, REFERENCE_PREFIX);
        let world_from = compose(&frames.poses(&segments, &frame.joint_angles_rad));
        for (&link, expected) in humanoid.segment_links.iter().zip(&segments) {
            let name = format!("{REFERENCE_PREFIX}{}", humanoid.robot.tree.links()[link].name);
            let error = world_from[&name].inv_mul(expected);
            assert!(error.translation.vector.norm() < 2e-6, "{name} {error}");
            assert!(error.rotation.angle() < 2e-6, "{name} {error}");
        }
    }

    #[test]
    fn the_base_frame_looks_forward_along_x() {
        let frames = LinkFrames::new(&adult(), "");
        let fixed = frames.fixed();
        assert_eq!((fixed.parent, fixed.child), ("pelvis", "base_link"));
        let forward_in_root = fixed.parent_from_child * Vector3::x();
        let left_in_root = fixed.parent_from_child * Vector3::y();
        assert!((forward_in_root - Vector3::y()).norm() < 1e-15);
        assert!((left_in_root + Vector3::x()).norm() < 1e-15);
    }
}
