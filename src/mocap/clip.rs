//! Skeleton and movement of one recording.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Axis of a channel, in the frame of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// First axis.
    X,
    /// Second axis.
    Y,
    /// Third axis.
    Z,
}

impl Axis {
    /// The axis as 0, 1 or 2.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    fn unit(self) -> nalgebra::Unit<Vector3<f64>> {
        match self {
            Self::X => Vector3::x_axis(),
            Self::Y => Vector3::y_axis(),
            Self::Z => Vector3::z_axis(),
        }
    }
}

/// What one number of a frame does to its joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Replaces the offset along an axis of the parent's frame, file units.
    Position(Axis),
    /// Turns the joint about an axis, radians; rotations of a joint multiply in the order of its channels.
    Rotation(Axis),
}

/// A joint of a source skeleton, or the end of a last bone.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name in the file; the end of the bone of joint `a` that has no child is `a_end`.
    pub name: String,
    /// Index of the parent, below that of the joint; `None` for the root.
    pub parent: Option<usize>,
    /// Position in the parent's frame at rest, file units.
    pub offset: Vector3<f64>,
    /// Frame in which the rotations act: `R = axes * R_1 * R_2 * ... * axes^-1`.
    pub axes: UnitQuaternion<f64>,
    /// Numbers of each frame that belong to the joint, in the order in which they act.
    pub channels: Vec<Channel>,
}

/// What a recording says about its frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    /// Channels of all joints, joint after joint, frame after frame; lengths in file units, angles in radians.
    Channels(Vec<f64>),
    /// Joint centres, frame after frame, file units.
    Centres(Vec<[f64; 3]>),
}

/// A recording: joints, and where they are in each frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    pub(super) joints: Vec<Joint>,
    pub(super) num_frames: usize,
    pub(super) rate_hz: Option<f64>,
    pub(super) values: Values,
}

impl Clip {
    /// The joints, parents first.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Number of frames, at least one.
    #[must_use]
    pub fn num_frames(&self) -> usize {
        self.num_frames
    }

    /// Frames per second, where the file says it.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Whether the joints have orientations, or only positions.
    #[must_use]
    pub fn has_orientations(&self) -> bool {
        matches!(self.values, Values::Channels(_))
    }

    /// Pose of every joint in the frame of the file, in the order of [`Clip::joints`], file units.
    ///
    /// At rest all joints are oriented as the file's own axes; joints known by position only always are.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn pose_into(&self, frame: usize, poses: &mut Vec<Isometry3<f64>>) {
        assert!(frame < self.num_frames, "frame {frame} of {}", self.num_frames);
        poses.clear();
        match &self.values {
            Values::Centres(centres) => {
                let count = self.joints.len();
                let centres = &centres[frame * count..][..count];
                poses.extend(
                    centres.iter().map(|&centre| Isometry3::from(Translation3::from(Vector3::from(centre)))),
                );
            }
            Values::Channels(values) => {
                let num_channels = values.len() / self.num_frames;
                let mut values = values[frame * num_channels..][..num_channels].iter();
                for joint in &self.joints {
                    let (mut position, mut rotation) = (joint.offset, joint.axes);
                    for channel in &joint.channels {
                        // Every frame has a value for every channel: the readers count them.
                        let value = values.next().copied().unwrap_or_default();
                        match channel {
                            Channel::Position(axis) => position[axis.index()] = value,
                            Channel::Rotation(axis) => {
                                rotation *= UnitQuaternion::from_axis_angle(&axis.unit(), value);
                            }
                        }
                    }
                    rotation *= joint.axes.inverse();
                    let local = Isometry3::from_parts(Translation3::from(position), rotation);
                    poses.push(match joint.parent {
                        Some(parent) => poses[parent] * local,
                        None => local,
                    });
                }
            }
        }
    }
}
