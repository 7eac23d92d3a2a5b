//! Motions between their frames: sampling at any time and at another rate.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{Frame, Motion, MotionError};
use std::f64::consts::{PI, TAU};

impl Motion {
    /// Pose at `time_secs` after the first frame, held at the first and last frame outside the motion.
    ///
    /// Joint angles and root position are linear between frames; the root rotation follows the shortest arc at constant
    /// speed.
    /// At the time of a frame the frame is returned as it is; between frames the root angles are those of the turned
    /// root that lie closest to the frame before, so none of them wraps within an interval.
    #[must_use]
    pub fn sample(&self, time_secs: f64) -> Frame {
        let last = self.frames.len() - 1;
        let position = time_secs * self.rate_hz;
        // A NaN time compares false and lands on the first frame.
        if position >= last as f64 {
            return self.frames[last];
        }
        if position > 0.0 {
            let index = position as usize;
            between(&self.frames[index], &self.frames[index + 1], position - index as f64)
        } else {
            self.frames[0]
        }
    }

    /// The same movement at another rate; it starts at the first frame and lasts no longer than the original.
    ///
    /// The root angles of neighbouring frames differ by less than half a turn wherever the root does, so yaw passes
    /// through +-pi without a jump.
    ///
    /// # Errors
    /// [`MotionError::Rate`] or [`MotionError::TooLong`] when the rate cannot be that of a motion, and
    /// [`MotionError::Value`] when the root turns so often that its continuous yaw leaves the accepted range.
    pub fn resampled(&self, rate_hz: f64) -> Result<Self, MotionError> {
        if !super::bounds::RATE_HZ.contains(&rate_hz) {
            return Err(MotionError::Rate { found: rate_hz });
        }
        // Rates such as 100 to 30 Hz give times a rounding error beyond the end, which must not lose the last frame.
        let num_frames = (self.duration_secs() * rate_hz + 1e-9).floor() as usize + 1;
        if num_frames > super::bounds::MAX_FRAMES {
            return Err(MotionError::TooLong { found: num_frames });
        }
        let mut frames: Vec<Frame> = Vec::with_capacity(num_frames);
        for index in 0..num_frames {
            let mut frame = self.sample(index as f64 / rate_hz);
            if let Some(before) = frames.last() {
                frame.root_rotation_rad = closest_turns(frame.root_rotation_rad, before.root_rotation_rad);
            }
            frames.push(frame);
        }
        Self::new(self.body, rate_hz, frames)
    }
}

/// Pose at the fraction `share` of the way from one frame to the next.
fn between(from: &Frame, to: &Frame, share: f64) -> Frame {
    if share <= 0.0 {
        return *from;
    }
    let mix = |a: f64, b: f64| a + share * (b - a);
    let mut frame = Frame::ZERO;
    for (angle, (a, b)) in
        frame.joint_angles_rad.iter_mut().zip(from.joint_angles_rad.iter().zip(&to.joint_angles_rad))
    {
        *angle = mix(*a, *b);
    }
    let position = Vector3::from_fn(|axis, _| mix(from.root_position_m[axis], to.root_position_m[axis]));
    let rotation = shortest_arc(&from.world_from_root_rotation(), &to.world_from_root_rotation(), share);
    frame.set_world_from_root(&Isometry3::from_parts(Translation3::from(position), rotation));
    frame.root_rotation_rad = closest_turns(frame.root_rotation_rad, from.root_rotation_rad);
    frame
}

/// Spherical interpolation; between opposite rotations, where no arc is shortest, the first is kept.
fn shortest_arc(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>, share: f64) -> UnitQuaternion<f64> {
    from.try_slerp(to, share, 1e-9).unwrap_or(*from)
}

/// Roll, pitch and yaw of the same rotation as `angles`, as close as possible to `near`.
///
/// A rotation has two such triples, (r, p, y) and (r + pi, pi - p, y + pi), each up to whole turns.
pub(crate) fn closest_turns(angles: [f64; 3], near: [f64; 3]) -> [f64; 3] {
    let [roll, pitch, yaw] = angles;
    let [direct, flipped] = [angles, [roll + PI, PI - pitch, yaw + PI]].map(|triple| {
        std::array::from_fn(|axis| triple[axis] + TAU * ((near[axis] - triple[axis]) / TAU).round())
    });
    let distance = |triple: &[f64; 3]| -> f64 { triple.iter().zip(&near).map(|(a, b)| (a - b).abs()).sum() };
    if distance(&flipped) < distance(&direct) { flipped } else { direct }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Body;

    fn motion(rate_hz: f64, frames: Vec<Frame>) -> Motion {
        Motion::new(Body::with_default_mass(1.75), rate_hz, frames).unwrap()
    }

    fn turned(rotation: [f64; 3]) -> Frame {
        Frame { root_rotation_rad: rotation, ..Frame::ZERO }
    }

    #[test]
    fn angles_and_position_are_linear_and_the_ends_are_held() {
        let mut end = Frame::ZERO;
        end.joint_angles_rad[20] = -1.0;
        end.root_position_m = [2.0, 4.0, 1.0];
        let motion = motion(2.0, vec![Frame::ZERO, end]);
        let quarter = motion.sample(0.125);
        assert!((quarter.joint_angles_rad[20] + 0.25).abs() < 1e-15);
        assert_eq!(quarter.root_position_m, [0.5, 1.0, 0.25]);
        assert_eq!(motion.sample(-1.0), Frame::ZERO);
        assert_eq!(motion.sample(f64::NAN), Frame::ZERO);
        assert_eq!(motion.sample(0.5), end);
        assert_eq!(motion.sample(99.0), end);
    }

    #[test]
    fn yaw_passes_through_pi_by_the_short_way() {
        // From 170 to 190 degrees, the latter written as -170.
        let (from, to) = (170_f64.to_radians(), -170_f64.to_radians());
        let motion = motion(1.0, vec![turned([0.0, 0.0, from]), turned([0.0, 0.0, to])]);
        let middle = motion.sample(0.5);
        assert!((middle.root_rotation_rad[2] - PI).abs() < 1e-12, "{:?}", middle.root_rotation_rad);

        let fine = motion.resampled(10.0).unwrap();
        let yaws: Vec<f64> = fine.frames().iter().map(|frame| frame.root_rotation_rad[2]).collect();
        assert_eq!(yaws.len(), 11);
        for pair in yaws.windows(2) {
            assert!((pair[1] - pair[0] - 2_f64.to_radians()).abs() < 1e-9, "{yaws:?}");
        }
    }

    #[test]
    fn several_turns_stay_continuous() {
        // Five seconds of turning at 2 rad/s, with the yaw written into (-pi, pi].
        let frames = (0..=50)
            .map(|i| {
                let yaw = 0.2 * f64::from(i);
                turned([0.1, -0.05, yaw - TAU * (yaw / TAU).round()])
            })
            .collect();
        let fine = motion(10.0, frames).resampled(37.0).unwrap();
        let last = fine.frames().last().unwrap();
        assert!((last.root_rotation_rad[2] - 2.0 * fine.duration_secs()).abs() < 1e-3);
        for pair in fine.frames().windows(2) {
            for axis in 0..3 {
                assert!((pair[1].root_rotation_rad[axis] - pair[0].root_rotation_rad[axis]).abs() < 0.1);
            }
        }
    }

    #[test]
    fn a_somersault_keeps_its_rotation_through_the_singularity() {
        // Pitch runs through 90 degrees, where roll and yaw trade places.
        let frames = (0..=20).map(|i| turned([0.3, 0.1 * f64::from(i), -0.4])).collect();
        let motion = motion(10.0, frames);
        for step in 0..=200 {
            let time = f64::from(step) * 0.01;
            let expected = turned([0.3, time, -0.4]).world_from_root_rotation();
            let found = motion.sample(time);
            assert!(found.world_from_root_rotation().angle_to(&expected) < 1e-6, "{time}");
            assert!((found.root_rotation_rad[1] - time).abs() < 1e-5, "{time} {:?}", found.root_rotation_rad);
        }
    }

    #[test]
    fn opposite_rotations_do_not_panic() {
        let motion = motion(1.0, vec![turned([0.0; 3]), turned([0.0, 0.0, PI])]);
        assert!(motion.sample(0.3).root_rotation_rad.iter().all(|angle| angle.is_finite()));
    }

    #[test]
    fn resampling_keeps_the_end_and_refuses_absurd_rates() {
        let motion = motion(100.0, vec![Frame::ZERO; 11]);
        assert_eq!(motion.resampled(30.0).unwrap().num_frames(), 4);
        assert_eq!(motion.resampled(100.0).unwrap(), motion);
        assert_eq!(motion.resampled(10.0).unwrap().num_frames(), 2);
        assert!(matches!(motion.resampled(f64::NAN), Err(MotionError::Rate { .. })));
        assert!(matches!(motion.resampled(0.0), Err(MotionError::Rate { .. })));
    }
}
