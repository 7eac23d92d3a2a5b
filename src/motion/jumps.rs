//! Jumps: joint angles that change faster between two frames than a joint moves.
//!
//! Optical recordings hold a few, where the marker fit flips between two solutions: toes, midfoot and knees most often.
//! Kinematic scores see the recording as it is; only physics is given the filtered motion, since a torque-driven joint
//! answers a jump with an impact that nobody performed.

use super::{JOINTS, Motion, NUM_JOINTS};

/// Speed above which a change from one frame to the next is a jump, radians per second.
///
/// At 100 Hz this is 0.3 rad a frame; as a speed the rule says the same at every rate.
pub const JUMP_SPEED_RAD_S: f64 = 30.0;

/// Longest excursion that counts as an outlier, seconds: 5 frames at 100 Hz.
pub const MAX_EXCURSION_SECS: f64 = 0.05;

/// Speed that the blend of a lasting step may add to the movement, radians per second.
const BLEND_SPEED_RAD_S: f64 = 0.5 * JUMP_SPEED_RAD_S;

/// Blends of steps that follow each other closely add up, so the filter repeats until no jump is left, at most this often.
const MAX_PASSES: usize = 8;

/// One change of one joint between neighbouring frames, faster than [`JUMP_SPEED_RAD_S`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// Index of the frame after the jump.
    pub frame: usize,
    /// Index of the joint in [`JOINTS`].
    pub joint: usize,
    /// Angle after the jump minus angle before it, radians.
    pub size_rad: f64,
}

impl Jump {
    /// Name of the joint without suffix: `LFx`.
    #[must_use]
    pub fn joint_name(&self) -> &'static str {
        JOINTS[self.joint].short_name()
    }
}

/// All jumps, sorted by frame, then joint.
#[must_use]
pub fn find_jumps(motion: &Motion) -> Vec<Jump> {
    let limit_rad = JUMP_SPEED_RAD_S / motion.rate_hz();
    let mut jumps = Vec::new();
    for (index, pair) in motion.frames().windows(2).enumerate() {
        let (before, after) = (&pair[0].joint_angles_rad, &pair[1].joint_angles_rad);
        for (joint, (from, to)) in before.iter().zip(after).enumerate() {
            let size_rad = to - from;
            if size_rad.abs() > limit_rad {
                jumps.push(Jump { frame: index + 1, joint, size_rad });
            }
        }
    }
    jumps
}

/// The motion without its jumps, for physics only, and the jumps that [`find_jumps`] saw in it.
///
/// Each joint is treated by itself, and only where it jumps:
///
/// 1. Excursion: if within [`MAX_EXCURSION_SECS`] after the jump the angle is back within one jump's size
///    ([`JUMP_SPEED_RAD_S`] over the rate) of where it left, the frames between are outliers and are replaced by the
///    straight line from the frame before to the frame after them.
/// 2. Lasting step: the step is spread over the frames around it with a cubic blend just long enough that it adds at
///    most half of [`JUMP_SPEED_RAD_S`] to the movement; the movement itself stays on both sides.
///
/// The joint stays within the range it had.
/// Noise that jumps at nearly every frame may keep some jumps; ask [`find_jumps`] what is left.
/// A motion without jumps comes back unchanged.
#[must_use]
pub fn filter_jumps(motion: &Motion) -> (Motion, Vec<Jump>) {
    let jumps = find_jumps(motion);
    let mut filtered = motion.clone();
    let mut jumping = [false; NUM_JOINTS];
    for jump in &jumps {
        jumping[jump.joint] = true;
    }
    for joint in (0..NUM_JOINTS).filter(|&joint| jumping[joint]) {
        let mut angles: Vec<f64> = motion.frames.iter().map(|frame| frame.joint_angles_rad[joint]).collect();
        filter_angle(&mut angles, motion.rate_hz);
        for (frame, angle) in filtered.frames.iter_mut().zip(angles) {
            frame.joint_angles_rad[joint] = angle;
        }
    }
    (filtered, jumps)
}

fn filter_angle(angles: &mut [f64], rate_hz: f64) {
    let limit_rad = JUMP_SPEED_RAD_S / rate_hz;
    let max_outliers = (MAX_EXCURSION_SECS * rate_hz).round() as usize;
    let (lowest, highest) =
        angles.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &a| (a.min(low), a.max(high)));
    let is_jump = |angles: &[f64], frame: usize| (angles[frame] - angles[frame - 1]).abs() > limit_rad;
    for _ in 0..MAX_PASSES {
        let mut steps = Vec::new();
        let mut frame = 1;
        while frame < angles.len() {
            if is_jump(angles, frame) {
                let before = angles[frame - 1];
                let latest = (frame + max_outliers).min(angles.len() - 1);
                let back = (frame + 1..=latest).find(|&after| (angles[after] - before).abs() <= limit_rad);
                if let Some(after) = back {
                    interpolate(angles, frame - 1, after);
                    frame = after;
                } else {
                    steps.push((frame, angles[frame] - before));
                }
            }
            frame += 1;
        }
        if steps.is_empty() {
            return;
        }
        for (frame, size_rad) in steps {
            blend_step(angles, frame, size_rad, rate_hz);
        }
        for angle in angles.iter_mut() {
            *angle = angle.clamp(lowest, highest);
        }
    }
}

/// Replaces the angles strictly between two frames by a straight line.
fn interpolate(angles: &mut [f64], from: usize, to: usize) {
    let (start, slope) = (angles[from], (angles[to] - angles[from]) / (to - from) as f64);
    for (offset, angle) in angles[from..to].iter_mut().enumerate().skip(1) {
        *angle = start + slope * offset as f64;
    }
}

/// Replaces a step between `frame - 1` and `frame` by a cubic rise of the same size around it.
fn blend_step(angles: &mut [f64], frame: usize, size_rad: f64, rate_hz: f64) {
    // The cubic 1/2 + 3/4 u - 1/4 u^3 rises from 0 to 1 over u in [-1, 1], fastest in the middle with 3/4 per unit.
    let half_width = 0.75 * size_rad.abs() * rate_hz / BLEND_SPEED_RAD_S;
    let middle = frame as f64 - 0.5;
    let first = (middle - half_width).ceil().max(0.0) as usize;
    let end = ((middle + half_width).floor() as usize + 1).min(angles.len());
    for (index, angle) in angles[first..end].iter_mut().enumerate() {
        let index = first + index;
        let u = (index as f64 - middle) / half_width;
        let risen = 0.5 + 0.75 * u - 0.25 * u * u * u;
        *angle += size_rad * (risen - if index < frame { 0.0 } else { 1.0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, Frame, joint_index};

    const RATE_HZ: f64 = 100.0;

    /// A slow movement of all joints, with `change` applied to the left toes.
    fn motion_with(change: impl Fn(usize) -> f64) -> (Motion, usize) {
        let joint = joint_index("LFx").unwrap();
        let frames = (0..60)
            .map(|index| {
                let mut frame = Frame::ZERO;
                frame.joint_angles_rad = [0.2 * (0.1 * index as f64).sin(); NUM_JOINTS];
                frame.joint_angles_rad[joint] += change(index);
                frame
            })
            .collect();
        (Motion::new(Body::with_default_mass(1.75), RATE_HZ, frames).unwrap(), joint)
    }

    fn changed_frames(before: &Motion, after: &Motion, joint: usize) -> Vec<usize> {
        let mut changed = Vec::new();
        for (index, (a, b)) in before.frames().iter().zip(after.frames()).enumerate() {
            for other in (0..NUM_JOINTS).filter(|&other| other != joint) {
                assert_eq!(a.joint_angles_rad[other].to_bits(), b.joint_angles_rad[other].to_bits());
            }
            assert_eq!((a.root_position_m, a.root_rotation_rad), (b.root_position_m, b.root_rotation_rad));
            if a.joint_angles_rad[joint].to_bits() != b.joint_angles_rad[joint].to_bits() {
                changed.push(index);
            }
        }
        changed
    }

    #[test]
    fn a_motion_without_jumps_is_unchanged() {
        // 0.29 rad a frame is fast, but no jump.
        let (motion, _) = motion_with(|index| if index == 30 { 0.27 } else { 0.0 });
        assert!(find_jumps(&motion).is_empty());
        assert_eq!(filter_jumps(&motion), (motion, Vec::new()));
    }

    #[test]
    fn an_excursion_is_bridged_and_nothing_else_changes() {
        let (clean, joint) = motion_with(|_| 0.0);
        let (motion, _) = motion_with(|index| if (30..33).contains(&index) { 0.8 } else { 0.0 });
        let (filtered, jumps) = filter_jumps(&motion);
        let places: Vec<_> = jumps.iter().map(|jump| (jump.frame, jump.joint_name())).collect();
        assert_eq!(places, [(30, "LFx"), (33, "LFx")]);
        assert!((jumps[0].size_rad - 0.8).abs() < 0.05 && (jumps[1].size_rad + 0.8).abs() < 0.05);
        assert_eq!(changed_frames(&motion, &filtered, joint), [30, 31, 32]);
        for index in 30..33 {
            let error = filtered.frames()[index].joint_angles_rad[joint]
                - clean.frames()[index].joint_angles_rad[joint];
            assert!(error.abs() < 0.01, "{error}");
        }
        assert!(find_jumps(&filtered).is_empty());
    }

    #[test]
    fn a_lasting_step_is_blended_where_it_is() {
        let (motion, joint) = motion_with(|index| if index >= 30 { 0.6 } else { 0.0 });
        let (filtered, jumps) = filter_jumps(&motion);
        assert_eq!(jumps.len(), 1);
        assert!(find_jumps(&filtered).is_empty());
        // 0.75 * 0.6 rad / 15 rad/s: three frames on either side.
        assert_eq!(changed_frames(&motion, &filtered, joint), [27, 28, 29, 30, 31, 32]);
        let fastest = filtered
            .frames()
            .windows(2)
            .map(|pair| (pair[1].joint_angles_rad[joint] - pair[0].joint_angles_rad[joint]).abs() * RATE_HZ)
            .fold(0.0, f64::max);
        // The blend's 15 rad/s and the movement's 2 rad/s.
        assert!(fastest < 17.0, "{fastest}");
    }

    #[test]
    fn steps_at_the_ends_and_hopeless_noise_stay_bounded() {
        let (motion, _) = motion_with(|index| if index == 0 || index == 59 { 1.0 } else { 0.0 });
        let (filtered, jumps) = filter_jumps(&motion);
        assert_eq!(jumps.len(), 2);
        assert!(find_jumps(&filtered).is_empty());

        let (noise, joint) = motion_with(|index| if index % 2 == 0 { 900.0 } else { -900.0 });
        let (filtered, jumps) = filter_jumps(&noise);
        assert_eq!(jumps.len(), 59);
        assert!(filtered.frames().iter().all(|frame| frame.joint_angles_rad[joint].abs() <= 900.2));
    }

    #[test]
    fn the_rule_is_a_speed() {
        // 0.2 rad a frame: no jump at 100 Hz, 40 rad/s at 200 Hz.
        let (motion, _) = motion_with(|index| if index >= 30 { 0.2 } else { 0.0 });
        assert!(find_jumps(&motion).is_empty());
        let faster = Motion::new(motion.body(), 200.0, motion.frames().to_vec()).unwrap();
        assert_eq!(find_jumps(&faster).len(), 1);
    }
}
