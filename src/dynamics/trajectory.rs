//! A motion with speeds and accelerations.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::filter::low_pass;
use super::rnea::RootMotion;
use crate::humanoid::Humanoid;
use crate::motion::{Motion, NUM_JOINTS};

/// State of the body at one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryFrame {
    /// Joint angles in tree order, radians.
    pub angles_rad: [f64; NUM_JOINTS],
    /// Joint speeds in tree order, rad/s.
    pub speeds_rad_s: [f64; NUM_JOINTS],
    /// Joint accelerations in tree order, rad/s^2.
    pub accelerations_rad_s2: [f64; NUM_JOINTS],
    /// Pose of the root in the world.
    pub world_from_root: Isometry3<f64>,
    /// Velocities and accelerations of the root in the world.
    pub root: RootMotion,
}

/// A motion, low-pass filtered and differentiated.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Frames per second.
    pub rate_hz: f64,
    /// One entry per frame of the motion.
    pub frames: Vec<TrajectoryFrame>,
}

impl Trajectory {
    /// Filters every channel with [`low_pass`] at `cutoff_hz` and takes central differences (one-sided at the ends).
    #[must_use]
    pub fn new(humanoid: &Humanoid, motion: &Motion, cutoff_hz: f64) -> Self {
        let rate_hz = motion.rate_hz();
        let filtered = |values: &mut dyn Iterator<Item = f64>| {
            let mut values: Vec<f64> = values.collect();
            low_pass(&mut values, rate_hz, cutoff_hz);
            Derivatives::new(values, rate_hz)
        };
        let kit = humanoid.kit_of_angle();
        let angles =
            kit.map(|joint| filtered(&mut motion.frames().iter().map(|f| f.joint_angles_rad[joint])));
        let position =
            [0, 1, 2].map(|axis| filtered(&mut motion.frames().iter().map(|f| f.root_position_m[axis])));

        let mut rotations: Vec<Quaternion<f64>> = Vec::with_capacity(motion.num_frames());
        for frame in motion.frames() {
            let rotation = frame.world_from_root_rotation().into_inner();
            let flip = rotations.last().is_some_and(|last| last.dot(&rotation) < 0.0);
            rotations.push(if flip { -rotation } else { rotation });
        }
        let mut parts = [0, 1, 2, 3].map(|part| {
            let mut values: Vec<f64> = rotations.iter().map(|rotation| rotation.coords[part]).collect();
            low_pass(&mut values, rate_hz, cutoff_hz);
            values
        });
        for frame in 0..rotations.len() {
            let norm = parts.iter().map(|part| part[frame].powi(2)).sum::<f64>().sqrt();
            for part in &mut parts {
                part[frame] /= norm;
            }
        }
        let rotation = parts.map(|part| Derivatives::new(part, rate_hz));

        let frames = (0..motion.num_frames())
            .map(|frame| {
                let quaternion = |order: usize| {
                    let [x, y, z, w] = [0, 1, 2, 3].map(|part: usize| rotation[part].at(order, frame));
                    Quaternion::new(w, x, y, z)
                };
                let vector = |order: usize| {
                    Vector3::from([0, 1, 2].map(|axis: usize| position[axis].at(order, frame)))
                };
                let orientation = UnitQuaternion::new_normalize(quaternion(0));
                let inverse = orientation.conjugate().into_inner();
                TrajectoryFrame {
                    angles_rad: angles.each_ref().map(|angle| angle.at(0, frame)),
                    speeds_rad_s: angles.each_ref().map(|angle| angle.at(1, frame)),
                    accelerations_rad_s2: angles.each_ref().map(|angle| angle.at(2, frame)),
                    world_from_root: Isometry3::from_parts(Translation3::from(vector(0)), orientation),
                    root: RootMotion {
                        velocity: vector(1),
                        // omega = 2 q' q^-1, and its derivative is 2 q'' q^-1 up to a scalar part.
                        angular_velocity: (quaternion(1) * inverse).imag() * 2.0,
                        acceleration: vector(2),
                        angular_acceleration: (quaternion(2) * inverse).imag() * 2.0,
                    },
                }
            })
            .collect();
        Self { rate_hz, frames }
    }
}

/// A channel and its first two derivatives.
struct Derivatives([Vec<f64>; 3]);

impl Derivatives {
    fn new(values: Vec<f64>, rate_hz: f64) -> Self {
        let last = values.len() - 1;
        let first: Vec<f64> = (0..values.len())
            .map(|index| {
                let (before, after) = (index.saturating_sub(1), (index + 1).min(last));
                if before == after {
                    0.0
                } else {
                    (values[after] - values[before]) * rate_hz / (after - before) as f64
                }
            })
            .collect();
        let second = (0..values.len())
            .map(|index| {
                if last < 2 {
                    return 0.0;
                }
                let center = index.clamp(1, last - 1);
                (values[center + 1] - 2.0 * values[center] + values[center - 1]) * rate_hz * rate_hz
            })
            .collect();
        Self([values, first, second])
    }

    fn at(&self, order: usize, frame: usize) -> f64 {
        self.0[order][frame]
    }
}
