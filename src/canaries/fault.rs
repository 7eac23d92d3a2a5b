//! Faults, each of one kind, put into clean motions.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::motion::{Frame, Motion, MotionError, joint_index};

/// How far a floating body is lifted, metres.
const FLOAT_M: f64 = 0.08;
/// How far a sinking body is lowered, metres.
const SINK_M: f64 = 0.05;
/// Speed of a sliding body, m/s.
const SLIDE_M_S: f64 = 0.6;
/// Standard deviation of the jitter of the root, metres.
const JITTER_M: f64 = 0.01;
/// Angle of a leaning body, radians.
const LEAN_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// What is done to a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The body hangs 8 cm higher.
    Float,
    /// The body is 5 cm deeper.
    Sink,
    /// The body glides sideways at 0.6 m/s on top of its movement.
    Slide,
    /// The root trembles by 1 cm in every frame.
    Jitter,
    /// The whole body leans 15 degrees forward about the floor below it.
    Lean,
    /// The pose of the middle frame is held.
    Frozen,
    /// The motion runs twice as fast.
    DoubleSpeed,
    /// Left and right knee are exchanged.
    KneeSwap,
    /// The motion runs backwards: a control, since mechanics has no direction of time.
    TimeReversal,
    /// Left and right are exchanged: a control, since nothing is wrong with it.
    Mirror,
}

impl Fault {
    /// All faults, the controls last.
    pub const ALL: [Self; 10] = [
        Self::Float,
        Self::Sink,
        Self::Slide,
        Self::Jitter,
        Self::Lean,
        Self::Frozen,
        Self::DoubleSpeed,
        Self::KneeSwap,
        Self::TimeReversal,
        Self::Mirror,
    ];

    /// A word or two for tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Sink => "sink",
            Self::Slide => "slide",
            Self::Jitter => "jitter",
            Self::Lean => "lean",
            Self::Frozen => "frozen",
            Self::DoubleSpeed => "double speed",
            Self::KneeSwap => "knee swap",
            Self::TimeReversal => "time reversal",
            Self::Mirror => "mirror",
        }
    }

    /// Which windows can show the fault: a body at rest looks the same at twice the speed.
    #[must_use]
    pub fn scope(self) -> Scope {
        match self {
            Self::Frozen => Scope::Moving,
            Self::DoubleSpeed | Self::KneeSwap | Self::TimeReversal => Scope::Travelling,
            _ => Scope::All,
        }
    }

    /// The motion with this fault; `seed` draws the jitter.
    ///
    /// # Errors
    /// [`MotionError`] when the result leaves the bounds of a motion.
    pub fn inject(self, motion: &Motion, seed: u64) -> Result<Motion, MotionError> {
        let frames = motion.frames();
        match self {
            Self::Float => motion.clone().map_frames(|_, frame| frame.root_position_m[2] += FLOAT_M),
            Self::Sink => motion.clone().map_frames(|_, frame| frame.root_position_m[2] -= SINK_M),
            Self::Slide => {
                let right = frames[0].world_from_root_rotation() * Vector3::x();
                let step = right.xy().try_normalize(1e-9).unwrap_or_else(nalgebra::Vector2::x) * SLIDE_M_S
                    / motion.rate_hz();
                motion.clone().map_frames(|index, frame| {
                    frame.root_position_m[0] += step.x * index as f64;
                    frame.root_position_m[1] += step.y * index as f64;
                })
            }
            Self::Jitter => {
                let mut noise = Noise::new(seed);
                motion.clone().map_frames(|_, frame| {
                    frame.root_position_m.iter_mut().for_each(|axis| *axis += JITTER_M * noise.normal());
                })
            }
            Self::Lean => motion.clone().map_frames(|_, frame| lean(frame)),
            Self::Frozen => {
                let held = frames[frames.len() / 2];
                motion.clone().map_frames(|_, frame| *frame = held)
            }
            Self::DoubleSpeed => {
                let frames = frames.iter().step_by(2).copied().collect();
                Motion::new(motion.body(), motion.rate_hz(), frames)
            }
            Self::KneeSwap => {
                let knees = [joint_index("LKx"), joint_index("RKx")];
                motion.clone().map_frames(|_, frame| {
                    if let [Some(left), Some(right)] = knees {
                        frame.joint_angles_rad.swap(left, right);
                    }
                })
            }
            Self::TimeReversal => {
                let frames = frames.iter().rev().copied().collect();
                Motion::new(motion.body(), motion.rate_hz(), frames)
            }
            Self::Mirror => motion.clone().map_frames(|_, frame| *frame = frame.mirrored()),
        }
    }
}

/// Which windows of a motion are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// All.
    All,
    /// Those in which the clean body moves.
    Moving,
    /// Those in which the clean body travels.
    Travelling,
}

fn lean(frame: &mut Frame) {
    let forward = frame.world_from_root_rotation() * Vector3::y();
    let right = Vector3::new(forward.y, -forward.x, 0.0);
    let Some(right) = right.try_normalize(1e-9) else { return };
    // About the axis to the right a positive turn lifts the front, so forward is negative.
    let turn = UnitQuaternion::from_scaled_axis(-right * LEAN_RAD);
    let [x, y, _] = frame.root_position_m;
    let floor = Translation3::new(x, y, 0.0);
    let about_floor = Isometry3::from(floor) * turn * Isometry3::from(floor.inverse());
    let leaning = about_floor * frame.world_from_root();
    frame.set_world_from_root(&leaning);
}

/// Normally distributed numbers: Steele, Lea and Flood 2014 (`SplitMix64`), then Box and Muller 1958.
struct Noise(u64);

impl Noise {
    fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in (0, 1].
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        ((bits >> 11) as f64 + 1.0) / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::humanoid::Humanoid;
    use crate::motion::{Body, NUM_JOINTS};

    fn motion() -> Motion {
        let frames = (0..200).map(|index| {
            let mut frame = Frame::ZERO;
            frame.root_position_m = [0.1, 0.01 * f64::from(index), 0.9];
            frame.root_rotation_rad = [0.1, 0.05, 0.3 + 0.001 * f64::from(index)];
            frame.joint_angles_rad =
                std::array::from_fn(|joint| 0.1 * (joint as f64 + 0.02 * f64::from(index)).sin());
            frame
        });
        Motion::new(Body::with_default_mass(1.75), 100.0, frames.collect()).unwrap()
    }

    #[test]
    fn a_mirrored_body_is_where_a_mirror_shows_it() {
        let (clean, mirrored) = (motion(), Fault::Mirror.inject(&motion(), 0).unwrap());
        let humanoid = Humanoid::new(clean.body()).unwrap();
        let tree = &humanoid.robot.tree;
        let (here, there) = (humanoid.forward(&clean.frames()[50]), humanoid.forward(&mirrored.frames()[50]));
        for &index in &humanoid.segment_links {
            let link = &tree.links()[index];
            let twin = match link.name.split_once('_') {
                Some(("left", rest)) => tree.link_index(&format!("right_{rest}")).unwrap(),
                Some(("right", rest)) => tree.link_index(&format!("left_{rest}")).unwrap(),
                _ => index,
            };
            let mut expected = here[index].translation.vector;
            expected.x = -expected.x;
            let found = there[twin].translation.vector;
            // The published body itself has both midfeet 1 mm to the same side of their ankles.
            let in_foot = ["midfoot", "toes"].iter().any(|part| link.name.ends_with(part));
            let tolerance_m = if in_foot { 0.0025 } else { 1e-6 };
            assert!((found - expected).norm() < tolerance_m, "{}: {found} instead of {expected}", link.name);
        }
        let twice = Fault::Mirror.inject(&mirrored, 0).unwrap();
        assert_eq!(twice, clean);
    }

    #[test]
    fn faults_change_what_they_say() {
        let clean = motion();
        let with = |fault: Fault| fault.inject(&clean, 7).unwrap();
        let channel = |motion: &Motion, frame: usize| motion.frames()[frame].root_position_m;
        assert!((channel(&with(Fault::Float), 9)[2] - 0.98).abs() < 1e-12);
        assert!((channel(&with(Fault::Sink), 9)[2] - 0.85).abs() < 1e-12);
        assert_eq!(channel(&with(Fault::DoubleSpeed), 50), channel(&clean, 100));
        assert_eq!(channel(&with(Fault::TimeReversal), 0), channel(&clean, 199));
        assert!(with(Fault::Frozen).frames().windows(2).all(|pair| pair[0] == pair[1]));
        let slid = channel(&with(Fault::Slide), 100);
        let way = Vector3::from(slid) - Vector3::from(channel(&clean, 100));
        assert!((way.norm() - 0.6).abs() < 1e-9, "{way}");
        let swapped = with(Fault::KneeSwap);
        let changed = |joint: usize| {
            swapped.frames()[3].joint_angles_rad[joint] != clean.frames()[3].joint_angles_rad[joint]
        };
        assert_eq!((0..NUM_JOINTS).filter(|&joint| changed(joint)).count(), 2);
        let leaning = with(Fault::Lean).frames()[20].world_from_root_rotation();
        let turn = leaning.angle_to(&clean.frames()[20].world_from_root_rotation());
        assert!((turn - LEAN_RAD).abs() < 1e-9, "{turn}");
    }

    #[test]
    fn jitter_has_its_size_and_its_seed() {
        let clean = motion();
        let noisy = Fault::Jitter.inject(&clean, 7).unwrap();
        assert_eq!(noisy, Fault::Jitter.inject(&clean, 7).unwrap());
        let pairs = noisy.frames().iter().zip(clean.frames());
        let squares: f64 = pairs
            .map(|(a, b)| {
                (Vector3::from(a.root_position_m) - Vector3::from(b.root_position_m)).norm_squared()
            })
            .sum();
        let deviation = (squares / 600.0).sqrt();
        assert!((deviation - JITTER_M).abs() < 0.1 * JITTER_M, "{deviation}");
    }
}
