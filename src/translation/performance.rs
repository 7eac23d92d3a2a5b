//! What the humanoid did, as a motion that can be described.

use crate::motion::{Frame, Motion, MotionError, closest_turns};
use crate::simulation::Rollout;

/// The simulated movement: joint angles and the pose of the pelvis at every sample of a rollout.
///
/// The root's angles are continuous and begin on the same turn as those of the motion that was `given`: an encoder would
/// take a whole turn for a difference. A rollout that failed gives the movement until then.
///
/// # Errors
/// [`MotionError`] when the body left the bounds of a motion.
pub fn performed_motion(given: &Motion, rollout: &Rollout) -> Result<Motion, MotionError> {
    let mut near = given.frames()[0].root_rotation_rad;
    let frames = rollout.samples.iter().map(|sample| {
        let mut frame = Frame { joint_angles_rad: sample.joint_angles_rad, ..Frame::ZERO };
        // The first segment is the pelvis, whose frame is the root.
        frame.set_world_from_root(&sample.world_from_segment[0]);
        near = closest_turns(frame.root_rotation_rad, near);
        frame.root_rotation_rad = near;
        frame
    });
    Motion::new(given.body(), 1.0 / rollout.sample_interval_secs, frames.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::humanoid::Humanoid;
    use crate::motion::Body;
    use crate::simulation::{Level, SimulationSettings, simulate};

    /// A body that stands and looks about 3.14 rad to the left, on the second turn.
    #[test]
    fn the_performed_root_begins_on_the_turn_of_the_given_one() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let mut frame = Frame::ZERO;
        frame.root_position_m[2] = humanoid.standing_root_height_m();
        frame.root_rotation_rad[2] = 3.15 + std::f64::consts::TAU;
        let given = Motion::new(humanoid.body, 100.0, vec![frame; 50]).unwrap();
        let settings = SimulationSettings::default();
        let rollout = simulate(&humanoid, &given, Level::L2, &settings, &mut |_| {}).unwrap();
        let performed = performed_motion(&given, &rollout).unwrap();
        for frame in performed.frames() {
            let [roll, pitch, yaw] = frame.root_rotation_rad;
            assert!((yaw - 3.15 - std::f64::consts::TAU).abs() < 0.1, "{yaw}");
            assert!(roll.abs() < 0.1 && pitch.abs() < 0.1);
        }
    }
}
