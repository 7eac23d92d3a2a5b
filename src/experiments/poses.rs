//! Normalised frames as joint positions in metres.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::evaluation::motion::{Poses, PosesError};
use crate::features::Normalizer;
use crate::humanoid::Humanoid;
use crate::motion::{Body, Frame, NUM_CHANNELS};
use crate::robot::RobotError;

/// Height of the body that joint angles are compared on, metres.
///
/// Prepared motions do not know the height of their actor, and errors in mm shall not depend on it.
pub const HEIGHT_M: f64 = 1.75;

/// The body that joint angles are compared on.
///
/// # Errors
/// [`RobotError`] when it cannot be built.
pub fn humanoid() -> Result<Humanoid, RobotError> {
    Humanoid::new(Body::with_default_mass(HEIGHT_M))
}

/// Origins of the 21 segments over time, relative to the root's place and heading.
///
/// The heading is the direction of the root's y axis in the horizontal plane; where that axis is vertical there is none,
/// and the world's is taken.
///
/// # Errors
/// [`PosesError`] when there are no frames, or one is not finite.
pub fn in_heading_frame(
    humanoid: &Humanoid,
    normalizer: &Normalizer,
    rate_hz: f64,
    frames: &[[f32; NUM_CHANNELS]],
) -> Result<Poses, PosesError> {
    let positions: Vec<Vec<[f64; 3]>> = frames
        .iter()
        .map(|values| {
            let frame = Frame::from_channels(&normalizer.denormalize(values));
            let root = frame.world_from_root();
            let forward = root.rotation * Vector3::y();
            let heading = if forward.xy().norm() > 1e-9 { (-forward.x).atan2(forward.y) } else { 0.0 };
            let world_from_heading = Isometry3::from_parts(
                Translation3::from(root.translation.vector),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading),
            );
            let heading_from_world = world_from_heading.inverse();
            let world_from_link = humanoid.forward(&frame);
            humanoid
                .segment_links
                .iter()
                .map(|&link| {
                    let origin = Point3::from(world_from_link[link].translation.vector);
                    let point = heading_from_world * origin;
                    [point.x, point.y, point.z]
                })
                .collect()
        })
        .collect();
    Poses::new(rate_hz, &positions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::motion::PoseComparison;

    #[test]
    fn place_and_heading_do_not_count_and_the_lean_does() {
        let humanoid = humanoid().unwrap();
        let normalizer = Normalizer { minimum: vec![-4.0; NUM_CHANNELS], maximum: vec![4.0; NUM_CHANNELS] };
        let motion = |change: &dyn Fn(&mut Frame)| {
            let mut frame = Frame::ZERO;
            frame.joint_angles_rad[3] = 0.4;
            change(&mut frame);
            let frames = vec![normalizer.normalize(&frame.to_channels()); 2];
            in_heading_frame(&humanoid, &normalizer, 10.0, &frames).unwrap()
        };
        let still = motion(&|_| {});
        let error = |other: &Poses| PoseComparison::new(other, &still).pose_mm;
        let moved = motion(&|frame| {
            frame.root_position_m = [1.0, -2.0, 0.9];
            frame.root_rotation_rad[2] = 1.1;
        });
        assert!(error(&moved) < 0.01, "{}", error(&moved));
        let leaning = motion(&|frame| frame.root_rotation_rad[0] = 0.3);
        assert!(error(&leaning) > 50.0, "{}", error(&leaning));
    }
}
