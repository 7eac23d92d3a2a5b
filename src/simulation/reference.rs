//! The motion as a smooth trajectory: angles, speeds and root velocities at any time.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::motion::{Motion, NUM_JOINTS};

/// State of the trajectory at one time.
#[derive(Debug, Clone)]
pub(super) struct ReferenceState {
    /// Joint angles, KIT order, radians.
    pub angles: [f64; NUM_JOINTS],
    /// Joint speeds, KIT order, rad/s.
    pub speeds: [f64; NUM_JOINTS],
    /// Root pose in the world.
    pub world_from_root: Isometry3<f64>,
    /// Velocity of the root origin in the world, m/s.
    pub root_velocity: Vector3<f64>,
    /// Angular velocity of the root in the world, rad/s.
    pub root_angular_velocity: Vector3<f64>,
}

/// A motion interpolated by cubic Hermite splines with central-difference slopes.
///
/// Angles and the root position are interpolated by channel; the root rotation as a quaternion, normalised after.
/// Values at the frames are the frames'; speeds are continuous.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    interval_secs: f64,
    angles: Vec<[f64; NUM_JOINTS]>,
    positions: Vec<Vector3<f64>>,
    rotations: Vec<Quaternion<f64>>,
}

impl Reference {
    pub fn new(motion: &Motion) -> Self {
        let mut rotations: Vec<Quaternion<f64>> = Vec::with_capacity(motion.num_frames());
        for frame in motion.frames() {
            let rotation = frame.world_from_root_rotation().into_inner();
            // A quaternion and its negative are the same rotation; keep to one side so that blends take the short way.
            let flip = rotations.last().is_some_and(|last| last.dot(&rotation) < 0.0);
            rotations.push(if flip { -rotation } else { rotation });
        }
        Self {
            interval_secs: 1.0 / motion.rate_hz(),
            angles: motion.frames().iter().map(|frame| frame.joint_angles_rad).collect(),
            positions: motion.frames().iter().map(|frame| frame.root_position_m.into()).collect(),
            rotations,
        }
    }

    /// State at a time in seconds, held at the ends.
    pub fn at(&self, time_secs: f64) -> ReferenceState {
        let last = self.positions.len() - 1;
        let position = (time_secs / self.interval_secs).clamp(0.0, last as f64);
        let frame = (position.floor() as usize).min(last.saturating_sub(1));
        let moving = last > 0 && time_secs >= 0.0 && time_secs <= last as f64 * self.interval_secs;
        let blend = Blend::new(
            frame,
            last,
            position - frame as f64,
            if moving { self.interval_secs } else { f64::INFINITY },
        );

        let mut angles = [0.0; NUM_JOINTS];
        let mut speeds = [0.0; NUM_JOINTS];
        for joint in 0..NUM_JOINTS {
            (angles[joint], speeds[joint]) = blend.mix(|index| self.angles[index][joint]);
        }
        let (translation, root_velocity) = blend.mix(|index| self.positions[index]);
        let (raw, rate) = blend.mix(|index| self.rotations[index]);
        let norm = raw.norm();
        let rotation = UnitQuaternion::new_normalize(raw);
        // omega = 2 q' q^-1 for a unit quaternion; the part of q' along q only changes the norm and drops out.
        let root_angular_velocity = (rate / norm * rotation.conjugate().into_inner()).imag() * 2.0;
        ReferenceState {
            angles,
            speeds,
            world_from_root: Isometry3::from_parts(Translation3::from(translation), rotation),
            root_velocity,
            root_angular_velocity,
        }
    }
}

/// Weights of a cubic Hermite segment over the four frames around it.
struct Blend {
    indices: [usize; 4],
    value: [f64; 4],
    rate: [f64; 4],
}

impl Blend {
    fn new(frame: usize, last: usize, t: f64, interval_secs: f64) -> Self {
        let (t2, t3) = (t * t, t * t * t);
        // Hermite basis: values at both ends, slopes at both ends (per frame), and their derivatives.
        let basis = [2.0 * t3 - 3.0 * t2 + 1.0, t3 - 2.0 * t2 + t, -2.0 * t3 + 3.0 * t2, t3 - t2];
        let slope = [6.0 * t2 - 6.0 * t, 3.0 * t2 - 4.0 * t + 1.0, -6.0 * t2 + 6.0 * t, 3.0 * t2 - 2.0 * t];
        let indices = [frame.saturating_sub(1), frame, (frame + 1).min(last), (frame + 2).min(last)];
        // Central differences inside, one-sided at the ends.
        let before = if frame == 0 { 1.0 } else { 0.5 };
        let after = if frame + 2 > last { 1.0 } else { 0.5 };
        let expand = |[v0, s0, v1, s1]: [f64; 4]| {
            let mut weights = [0.0, v0, v1, 0.0];
            weights[0] -= before * s0;
            weights[2] += before * s0;
            weights[1] -= after * s1;
            weights[3] += after * s1;
            weights
        };
        Self { indices, value: expand(basis), rate: expand(slope).map(|weight| weight / interval_secs) }
    }

    fn mix<T>(&self, at: impl Fn(usize) -> T) -> (T, T)
    where
        T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T> + Clone,
    {
        let points = self.indices.map(at);
        let sum = |weights: &[f64; 4]| {
            let [a, b, c, d] = &points;
            a.clone() * weights[0] + b.clone() * weights[1] + c.clone() * weights[2] + d.clone() * weights[3]
        };
        (sum(&self.value), sum(&self.rate))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, Frame};

    fn turning(num_frames: usize, rate_hz: f64) -> Motion {
        let frames = (0..num_frames)
            .map(|index| {
                let t = index as f64 / rate_hz;
                let mut frame = Frame::ZERO;
                frame.joint_angles_rad[3] = 0.4 * t * t;
                frame.root_position_m = [0.0, t * t, 1.0];
                // Turns through pi, where the yaw of a file jumps.
                frame.root_rotation_rad[2] =
                    (3.0 + t + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
                frame
            })
            .collect();
        Motion::new(Body::with_default_mass(1.75), rate_hz, frames).unwrap()
    }

    #[test]
    fn meets_quadratics_and_a_steady_turn() {
        let reference = Reference::new(&turning(101, 100.0));
        for time in [0.105, 0.333, 0.5, 0.817] {
            let state = reference.at(time);
            assert!((state.angles[3] - 0.4 * time * time).abs() < 1e-12);
            assert!((state.speeds[3] - 0.8 * time).abs() < 1e-9);
            assert!((state.root_velocity - Vector3::new(0.0, 2.0 * time, 0.0)).norm() < 1e-9);
            assert!(
                (state.root_angular_velocity - Vector3::z()).norm() < 1e-4,
                "{}",
                state.root_angular_velocity
            );
        }
    }

    #[test]
    fn holds_still_beyond_the_ends_and_for_a_single_frame() {
        let reference = Reference::new(&turning(11, 100.0));
        assert_eq!(reference.at(1.0).speeds[3], 0.0);
        assert!((reference.at(1.0).angles[3] - 0.4 * 0.01).abs() < 1e-12);
        let single = Reference::new(&turning(1, 100.0));
        assert_eq!(single.at(0.0).root_velocity, Vector3::zeros());
    }
}
