//! What the humanoid did, as a motion that can be described.

use crate::motion::{Body, Frame, Motion, MotionError};
use crate::simulation::Rollout;

/// The simulated movement: joint angles and the pose of the pelvis at every sample of a rollout.
///
/// The root's angles are continuous, as those of motions that are learned from.
/// A rollout that failed gives the movement until then.
///
/// # Errors
/// [`MotionError`] when the body left the bounds of a motion.
pub fn performed_motion(body: Body, rollout: &Rollout) -> Result<Motion, MotionError> {
    let frames = rollout.samples.iter().map(|sample| {
        let mut frame = Frame { joint_angles_rad: sample.joint_angles_rad, ..Frame::ZERO };
        // The first segment is the pelvis, whose frame is the root.
        frame.set_world_from_root(&sample.world_from_segment[0]);
        frame
    });
    let rate_hz = 1.0 / rollout.sample_interval_secs;
    let motion = Motion::new(body, rate_hz, frames.collect())?;
    // Resampling at the same rate unwraps the root's angles and changes nothing else.
    motion.resampled(rate_hz)
}
