//! What a simulation leaves behind.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Level, SimulationSettings};
use crate::humanoid::NUM_SEGMENTS;
use crate::motion::NUM_JOINTS;

/// Poses in the world of the rigid segments, in the order of [`crate::humanoid::Humanoid::segment_links`].
pub type SegmentPoses = [Isometry3<f64>; NUM_SEGMENTS];

/// A place where the body touches the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Index of the touching segment, in the order of [`crate::humanoid::Humanoid::segment_links`].
    pub segment: usize,
    /// Where, in the world, metres.
    pub position_m: Point3<f64>,
    /// Force of the ground on the body in the world, newtons, mean over the sample's interval.
    pub force_n: Vector3<f64>,
}

/// State at the end of a recording interval, and forces averaged over it.
///
/// The interval is [`Rollout::sample_interval_secs`] long; the first sample is the start state with zero forces.
#[derive(Debug, Clone, PartialEq)]
pub struct RolloutSample {
    /// Time since the start of the motion, seconds.
    pub time_secs: f64,
    /// Simulated pose of every segment in the world.
    pub world_from_segment: SegmentPoses,
    /// Commanded pose of every segment in the world at the same time.
    pub reference_world_from_segment: SegmentPoses,
    /// Simulated joint angles, KIT order, radians.
    pub joint_angles_rad: [f64; NUM_JOINTS],
    /// Simulated joint speeds, KIT order, rad/s.
    pub joint_velocities_rad_s: [f64; NUM_JOINTS],
    /// Mean motor torque about each joint axis, KIT order, N m (positive turns the child positively).
    pub joint_torques_nm: [f64; NUM_JOINTS],
    /// Commanded joint angles, KIT order, radians.
    pub reference_joint_angles_rad: [f64; NUM_JOINTS],
    /// Mean assist force on the root in the world, newtons.
    pub assist_force_n: Vector3<f64>,
    /// Mean assist moment on the root in the world, N m.
    pub assist_moment_nm: Vector3<f64>,
    /// Ground contacts during the interval.
    pub contacts: Vec<Contact>,
}

impl RolloutSample {
    /// Total force of the ground on the body in the world, newtons, mean over the interval.
    #[must_use]
    pub fn ground_force_n(&self) -> Vector3<f64> {
        self.contacts.iter().map(|contact| contact.force_n).sum()
    }

    /// Mean distance of the segments' origins from the reference, metres.
    #[must_use]
    pub fn mean_distance_m(&self) -> f64 {
        let pairs = self.world_from_segment.iter().zip(&self.reference_world_from_segment);
        pairs
            .map(|(pose, reference)| (pose.translation.vector - reference.translation.vector).norm())
            .sum::<f64>()
            / NUM_SEGMENTS as f64
    }
}

/// How a rollout ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Outcome {
    /// The whole motion was simulated, upright or not.
    Completed,
    /// The state stopped being a state; the rollout counts as failed.
    Failed {
        /// When, seconds since the start.
        time_secs: f64,
        /// Why: a non-finite number, or bodies the engine quarantined.
        reason: String,
    },
}

/// What kind of thing happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// The reference was changed before the simulation, by a named rule.
    Retarget,
    /// The body fell: a segment other than the feet reached the ground, or the 0.5 m rule broke.
    Fall,
    /// The state became unusable.
    Failure,
}

/// Something that happened at a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// When, seconds since the start of the motion.
    pub time_secs: f64,
    /// What kind.
    pub kind: EventKind,
    /// One sentence for a person.
    pub message: String,
}

/// A simulated motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Rollout {
    /// [`Level::L2`] or [`Level::L3`].
    pub level: Level,
    /// What it ran with.
    pub settings: SimulationSettings,
    /// Seconds between samples.
    pub sample_interval_secs: f64,
    /// Duration of the motion asked for, seconds.
    pub motion_duration_secs: f64,
    /// Samples in time order, up to the end or the failure; the first is the start state.
    pub samples: Vec<RolloutSample>,
    /// Events in time order.
    pub events: Vec<Event>,
    /// How it ended.
    pub outcome: Outcome,
    /// Largest distance between the two sides of any joint at any sample, metres.
    ///
    /// Zero in reduced coordinates; in maximal ones what the solver left, under a millimetre while it holds.
    pub max_joint_drift_m: f64,
}
