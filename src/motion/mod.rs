//! Motions: a body, a rate and a sequence of 50-channel frames.
//!
//! In: checked numbers from [`crate::dataset`] or a generator.
//! Out: [`Motion`], which is finite, non-empty and in SI units and radians by construction.
//! This module reads no files and knows no geometry; positions of limbs come from [`crate::kinematics`].

mod jumps;
mod mirror;
mod resample;
pub mod skeleton;

pub use jumps::{JUMP_SPEED_RAD_S, Jump, MAX_EXCURSION_SECS, filter_jumps, find_jumps};
pub use mirror::mirrored_channels;
pub(crate) use resample::closest_turns;
pub use skeleton::{Axis, JOINTS, JointInfo, NUM_CHANNELS, NUM_JOINTS, joint_index};

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Body mass in kilograms per squared metre of body height, used where a file gives only a placeholder mass.
///
/// 22.5 kg/m^2 is the middle of the normal body mass index range (18.5 to 25 is called normal weight).
pub const DEFAULT_BODY_MASS_INDEX: f64 = 22.5;

/// Height and mass of the person who moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Body height in metres.
    pub height_m: f64,
    /// Body mass in kilograms.
    pub mass_kg: f64,
}

impl Body {
    /// A body of this height (metres) with the mass [`DEFAULT_BODY_MASS_INDEX`] gives it.
    #[must_use]
    pub fn with_default_mass(height_m: f64) -> Self {
        Self { height_m, mass_kg: DEFAULT_BODY_MASS_INDEX * height_m * height_m }
    }
}

/// Pose of the whole body at one instant: 50 numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Joint angles in radians, in the order of [`JOINTS`].
    pub joint_angles_rad: [f64; NUM_JOINTS],
    /// Root (middle of the two hip centres) in the world, metres.
    pub root_position_m: [f64; 3],
    /// Root roll, pitch and yaw in radians: `R = Rz(yaw) Ry(pitch) Rx(roll)`.
    pub root_rotation_rad: [f64; 3],
}

impl Frame {
    /// Upright pose with all joints at zero and the root at the world origin.
    pub const ZERO: Self =
        Self { joint_angles_rad: [0.0; NUM_JOINTS], root_position_m: [0.0; 3], root_rotation_rad: [0.0; 3] };

    /// The frame as 50 channels: 44 joint angles, root position, root rotation.
    #[must_use]
    pub fn to_channels(&self) -> [f64; NUM_CHANNELS] {
        let mut channels = [0.0; NUM_CHANNELS];
        channels[..NUM_JOINTS].copy_from_slice(&self.joint_angles_rad);
        channels[NUM_JOINTS..NUM_JOINTS + 3].copy_from_slice(&self.root_position_m);
        channels[NUM_JOINTS + 3..].copy_from_slice(&self.root_rotation_rad);
        channels
    }

    /// Inverse of [`Frame::to_channels`].
    #[must_use]
    pub fn from_channels(channels: &[f64; NUM_CHANNELS]) -> Self {
        let mut frame = Self::ZERO;
        frame.joint_angles_rad.copy_from_slice(&channels[..NUM_JOINTS]);
        frame.root_position_m.copy_from_slice(&channels[NUM_JOINTS..NUM_JOINTS + 3]);
        frame.root_rotation_rad.copy_from_slice(&channels[NUM_JOINTS + 3..]);
        frame
    }

    /// Rotation that takes root coordinates to world coordinates.
    #[must_use]
    pub fn world_from_root_rotation(&self) -> UnitQuaternion<f64> {
        let [roll, pitch, yaw] = self.root_rotation_rad;
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// Pose of the root in the world.
    #[must_use]
    pub fn world_from_root(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.root_position_m)),
            self.world_from_root_rotation(),
        )
    }

    /// Sets the root pose, choosing the roll, pitch and yaw that give this rotation.
    pub fn set_world_from_root(&mut self, world_from_root: &Isometry3<f64>) {
        self.root_position_m = world_from_root.translation.vector.into();
        let (roll, pitch, yaw) = Rotation3::from(world_from_root.rotation).euler_angles();
        self.root_rotation_rad = [roll, pitch, yaw];
    }
}

/// Bounds a motion must respect; beyond them a number is an error of the file, not a movement.
pub mod bounds {
    /// Largest distance of the root from the world origin per axis, metres.
    pub const MAX_ROOT_POSITION_M: f64 = 1.0e4;
    /// Largest magnitude of any angle, radians (about 160 turns; yaw may be unwrapped).
    pub const MAX_ANGLE_RAD: f64 = 1.0e3;
    /// Accepted sampling rates, hertz.
    pub const RATE_HZ: std::ops::RangeInclusive<f64> = 0.1..=10_000.0;
    /// Accepted body heights, metres.
    pub const HEIGHT_M: std::ops::RangeInclusive<f64> = 0.3..=3.0;
    /// Accepted body masses, kilograms.
    pub const MASS_KG: std::ops::RangeInclusive<f64> = 1.0..=500.0;
    /// Largest number of frames (more than an hour at 1 kHz).
    pub const MAX_FRAMES: usize = 4_000_000;
}

/// Why numbers do not form a motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// No frame at all.
    #[error("the motion has no frames")]
    Empty,
    /// More frames than [`bounds::MAX_FRAMES`].
    #[error("the motion has {found} frames, more than the {limit} accepted", limit = bounds::MAX_FRAMES)]
    TooLong {
        /// Number of frames found.
        found: usize,
    },
    /// The sampling rate is not finite or outside [`bounds::RATE_HZ`].
    #[error("the sampling rate of {found} Hz is outside 0.1 to 10000 Hz")]
    Rate {
        /// Rate found, hertz.
        found: f64,
    },
    /// The body height is not finite or outside [`bounds::HEIGHT_M`].
    #[error("the body height of {found} m is outside 0.3 to 3 m (is it in millimetres?)")]
    Height {
        /// Height found, metres.
        found: f64,
    },
    /// The body mass is not finite or outside [`bounds::MASS_KG`].
    #[error("the body mass of {found} kg is outside 1 to 500 kg")]
    Mass {
        /// Mass found, kilograms.
        found: f64,
    },
    /// A channel is not a number, infinite or absurdly large.
    #[error("frame {frame}: {channel} is {found}, expected a finite number within ±{limit} {unit}")]
    Value {
        /// Index of the frame.
        frame: usize,
        /// Name of the channel.
        channel: &'static str,
        /// Value found.
        found: f64,
        /// Largest magnitude accepted.
        limit: f64,
        /// Unit of the value.
        unit: &'static str,
    },
}

/// A recorded or generated movement of one person.
///
/// Invariants, checked on construction: at least one frame, all values finite and within [`bounds`].
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    body: Body,
    rate_hz: f64,
    frames: Vec<Frame>,
}

impl Motion {
    /// Checks and wraps a frame sequence sampled at `rate_hz`.
    ///
    /// # Errors
    /// [`MotionError`] names the first thing that is not a motion.
    pub fn new(body: Body, rate_hz: f64, frames: Vec<Frame>) -> Result<Self, MotionError> {
        if frames.is_empty() {
            return Err(MotionError::Empty);
        }
        if frames.len() > bounds::MAX_FRAMES {
            return Err(MotionError::TooLong { found: frames.len() });
        }
        if !bounds::RATE_HZ.contains(&rate_hz) {
            return Err(MotionError::Rate { found: rate_hz });
        }
        if !bounds::HEIGHT_M.contains(&body.height_m) {
            return Err(MotionError::Height { found: body.height_m });
        }
        if !bounds::MASS_KG.contains(&body.mass_kg) {
            return Err(MotionError::Mass { found: body.mass_kg });
        }
        for (index, frame) in frames.iter().enumerate() {
            check_frame(index, frame)?;
        }
        Ok(Self { body, rate_hz, frames })
    }

    /// Height and mass of the person.
    #[must_use]
    pub fn body(&self) -> Body {
        self.body
    }

    /// Frames per second.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The frames; never empty.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Number of frames, at least one.
    #[must_use]
    pub fn num_frames(&self) -> usize {
        self.frames.len()
    }

    /// Time from the first to the last frame, seconds.
    #[must_use]
    pub fn duration_secs(&self) -> f64 {
        (self.frames.len() - 1) as f64 / self.rate_hz
    }

    /// The same frames performed by another body.
    ///
    /// # Errors
    /// [`MotionError::Height`] or [`MotionError::Mass`] when the body is outside [`bounds`].
    pub fn with_body(self, body: Body) -> Result<Self, MotionError> {
        Self::new(body, self.rate_hz, self.frames)
    }

    /// Applies `change` to every frame.
    ///
    /// # Errors
    /// [`MotionError::Value`] when a changed frame is outside [`bounds`].
    pub fn map_frames(mut self, mut change: impl FnMut(usize, &mut Frame)) -> Result<Self, MotionError> {
        for (index, frame) in self.frames.iter_mut().enumerate() {
            change(index, frame);
            check_frame(index, frame)?;
        }
        Ok(self)
    }
}

/// Names of the six root channels, in channel order.
pub const ROOT_CHANNEL_NAMES: [&str; 6] =
    ["root x", "root y", "root z", "root roll", "root pitch", "root yaw"];

fn check_frame(index: usize, frame: &Frame) -> Result<(), MotionError> {
    // Nearly every frame is good, and this form compares several channels at a time; NaN is within no limit.
    let within =
        |values: &[f64], limit: f64| values.iter().fold(true, |ok, value| ok & (value.abs() <= limit));
    if within(&frame.joint_angles_rad, bounds::MAX_ANGLE_RAD)
        && within(&frame.root_position_m, bounds::MAX_ROOT_POSITION_M)
        && within(&frame.root_rotation_rad, bounds::MAX_ANGLE_RAD)
    {
        return Ok(());
    }
    let channels = frame.to_channels();
    for (channel, &found) in channels.iter().enumerate() {
        let (limit, unit) = if (NUM_JOINTS..NUM_JOINTS + 3).contains(&channel) {
            (bounds::MAX_ROOT_POSITION_M, "m")
        } else {
            (bounds::MAX_ANGLE_RAD, "rad")
        };
        if !found.is_finite() || found.abs() > limit {
            let channel = match JOINTS.get(channel) {
                Some(joint) => joint.name,
                None => ROOT_CHANNEL_NAMES[channel - NUM_JOINTS],
            };
            return Err(MotionError::Value { frame: index, channel, found, limit, unit });
        }
    }
    Ok(())
}
