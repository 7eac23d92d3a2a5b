//! Motions at a higher rate than a model makes them.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::motion::{Frame, Motion, MotionError, NUM_JOINTS, bounds, closest_turns};

/// Joint angles, root position, and the root rotation as a quaternion.
const NUM_CURVES: usize = NUM_JOINTS + 3 + 4;

/// The same movement at a higher rate, with continuous accelerations.
///
/// Every joint angle and coordinate of the root follows the natural cubic spline through its frames; the root rotation
/// follows that through its quaternions, normalised, so that no angle wraps and no axis locks.
/// The frames of the motion stay as they are wherever the new rate has a frame at their time.
/// A rate below that of the motion, or a single frame, is resampled without a spline.
///
/// # Errors
/// [`MotionError`] when the rate cannot be that of a motion, or a curve leaves the bounds of one.
pub fn upsampled(motion: &Motion, rate_hz: f64) -> Result<Motion, MotionError> {
    if !bounds::RATE_HZ.contains(&rate_hz) {
        return Err(MotionError::Rate { found: rate_hz });
    }
    if rate_hz <= motion.rate_hz() || motion.num_frames() < 3 {
        return motion.resampled(rate_hz);
    }
    // As in `Motion::resampled`: rounding must not lose the last frame.
    let num_frames = (motion.duration_secs() * rate_hz + 1e-9).floor() as usize + 1;
    if num_frames > bounds::MAX_FRAMES {
        return Err(MotionError::TooLong { found: num_frames });
    }
    let knots = knots(motion);
    let bends = bends(&knots);
    let mut frames: Vec<Frame> = Vec::with_capacity(num_frames);
    for index in 0..num_frames {
        let position = index as f64 * motion.rate_hz() / rate_hz;
        let before = (position as usize).min(knots.len() - 2);
        let values = between(&knots, &bends, before, position - before as f64);
        let mut frame = frame_of(&values);
        let near = frames.last().unwrap_or(&motion.frames()[0]).root_rotation_rad;
        frame.root_rotation_rad = closest_turns(frame.root_rotation_rad, near);
        frames.push(frame);
    }
    Motion::new(motion.body(), rate_hz, frames)
}

fn knots(motion: &Motion) -> Vec<[f64; NUM_CURVES]> {
    let mut last: Option<Quaternion<f64>> = None;
    motion
        .frames()
        .iter()
        .map(|frame| {
            let rotation = frame.world_from_root_rotation().into_inner();
            // A quaternion and its negative are the same rotation; keep to one side.
            let rotation =
                if last.is_some_and(|last| last.dot(&rotation) < 0.0) { -rotation } else { rotation };
            last = Some(rotation);
            let mut values = [0.0; NUM_CURVES];
            values[..NUM_JOINTS].copy_from_slice(&frame.joint_angles_rad);
            values[NUM_JOINTS..NUM_JOINTS + 3].copy_from_slice(&frame.root_position_m);
            values[NUM_JOINTS + 3..].copy_from_slice(rotation.coords.as_slice());
            values
        })
        .collect()
}

/// Second derivatives at the knots, one step apart; zero at both ends.
///
/// `m[i-1] + 4 m[i] + m[i+1] = 6 (y[i-1] - 2 y[i] + y[i+1])`, solved by elimination; every row is dominated by its diagonal.
fn bends(knots: &[[f64; NUM_CURVES]]) -> Vec<[f64; NUM_CURVES]> {
    let num_knots = knots.len();
    let mut bends = vec![[0.0; NUM_CURVES]; num_knots];
    let mut pivots = vec![0.0; num_knots];
    for i in 1..num_knots - 1 {
        pivots[i] = 1.0 / (4.0 - pivots[i - 1]);
        bends[i] = std::array::from_fn(|curve| {
            let bend = 6.0 * (knots[i - 1][curve] - 2.0 * knots[i][curve] + knots[i + 1][curve]);
            (bend - bends[i - 1][curve]) * pivots[i]
        });
    }
    for i in (1..num_knots - 1).rev() {
        bends[i] = std::array::from_fn(|curve| bends[i][curve] - pivots[i] * bends[i + 1][curve]);
    }
    bends
}

/// The spline at the share `t` of the way from one knot to the next.
fn between(
    knots: &[[f64; NUM_CURVES]],
    bends: &[[f64; NUM_CURVES]],
    before: usize,
    t: f64,
) -> [f64; NUM_CURVES] {
    let s = 1.0 - t;
    let (from, to) = ((s * s * s - s) / 6.0, (t * t * t - t) / 6.0);
    std::array::from_fn(|curve| {
        s * knots[before][curve]
            + t * knots[before + 1][curve]
            + from * bends[before][curve]
            + to * bends[before + 1][curve]
    })
}

fn frame_of(values: &[f64; NUM_CURVES]) -> Frame {
    let mut frame = Frame::ZERO;
    frame.joint_angles_rad.copy_from_slice(&values[..NUM_JOINTS]);
    let place = NUM_JOINTS + 3;
    let position = Vector3::new(values[NUM_JOINTS], values[NUM_JOINTS + 1], values[NUM_JOINTS + 2]);
    let rotation = Quaternion::new(values[place + 3], values[place], values[place + 1], values[place + 2]);
    let rotation = UnitQuaternion::new_normalize(rotation);
    frame.set_world_from_root(&Isometry3::from_parts(Translation3::from(position), rotation));
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Body;

    fn motion(num_frames: usize, frame: impl Fn(f64) -> Frame) -> Motion {
        let frames = (0..num_frames).map(|index| frame(index as f64 / 10.0)).collect();
        Motion::new(Body::with_default_mass(1.75), 10.0, frames).unwrap()
    }

    fn swinging(t: f64) -> Frame {
        let mut frame = Frame::ZERO;
        frame.joint_angles_rad[7] = (3.0 * t).sin();
        frame.root_position_m = [t, 2.0 * t, 1.0];
        frame.root_rotation_rad = [0.2 * (2.0 * t).sin(), 0.1, 2.5 + t];
        frame
    }

    #[test]
    fn the_way_back_gives_the_frames_and_the_way_between_is_the_movement() {
        let coarse = motion(31, swinging);
        let fine = upsampled(&coarse, 100.0).unwrap();
        assert_eq!(fine.num_frames(), 301);
        let back = fine.resampled(10.0).unwrap();
        for (a, b) in coarse.frames().iter().zip(back.frames()) {
            for (a, b) in a.to_channels().iter().zip(b.to_channels()) {
                assert!((a - b).abs() < 1e-9, "{a} is not {b}");
            }
        }
        // Away from the ends, where the natural spline has no bend.
        for (index, frame) in fine.frames().iter().enumerate().take(250).skip(50) {
            for (a, b) in frame.to_channels().iter().zip(swinging(index as f64 / 100.0).to_channels()) {
                assert!((a - b).abs() < 1e-3, "frame {index}: {a} is not {b}");
            }
        }
    }

    #[test]
    fn accelerations_have_no_steps() {
        let fine = upsampled(&motion(31, swinging), 100.0).unwrap();
        let angles: Vec<f64> = fine.frames().iter().map(|frame| frame.joint_angles_rad[7]).collect();
        let accelerations: Vec<f64> = angles.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]) * 1e4).collect();
        for pair in accelerations.windows(2) {
            // The true one changes by 27 rad/s^3 at most, a hundredth of that in a frame.
            assert!((pair[1] - pair[0]).abs() < 1.0, "{pair:?}");
        }
    }

    #[test]
    fn yaw_passes_half_a_turn_without_a_wrap() {
        let wrapped = motion(21, |t| {
            let yaw = 2.0 + 1.5 * t;
            let turn = std::f64::consts::TAU;
            Frame { root_rotation_rad: [0.0, 0.0, yaw - turn * (yaw / turn).round()], ..Frame::ZERO }
        });
        let fine = upsampled(&wrapped, 100.0).unwrap();
        for pair in fine.frames().array_windows::<2>() {
            let step = pair[1].root_rotation_rad[2] - pair[0].root_rotation_rad[2];
            assert!((step - 0.015).abs() < 1e-3, "{step}");
        }
    }

    #[test]
    fn short_motions_and_lower_rates_are_resampled_plainly() {
        let two = motion(2, swinging);
        assert_eq!(upsampled(&two, 100.0).unwrap(), two.resampled(100.0).unwrap());
        let coarse = motion(31, swinging);
        assert_eq!(upsampled(&coarse, 5.0).unwrap(), coarse.resampled(5.0).unwrap());
        assert!(matches!(upsampled(&coarse, f64::NAN), Err(MotionError::Rate { .. })));
    }
}
