//! What a rollout is put through beyond its motion: how much help, and what goes wrong.

use nalgebra::Vector3;

use super::SimulationSettings;

/// A constant force on the pelvis for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// When it starts, seconds since the start of the motion.
    pub time_secs: f64,
    /// How long it acts, seconds.
    pub duration_secs: f64,
    /// Force at the pelvis' centre of mass in the world, newtons.
    pub force_n: Vector3<f64>,
}

/// Conditions of one rollout; the preparation of its motion does not depend on them.
///
/// The controller knows none of the disturbances: springs, feed-forward and assist stay those of the undisturbed body.
#[derive(Debug, Clone, PartialEq)]
pub struct Conditions {
    /// Largest assist force at L2, as a share of body weight; see [`SimulationSettings::assist_limit`].
    pub assist_limit: f64,
    /// A push, if any.
    pub push: Option<Push>,
    /// Factor on the friction between sole and ground.
    pub friction_factor: f64,
    /// Factor on mass and inertia of every segment.
    pub mass_factor: f64,
    /// Time by which the joints' commands come late, seconds; they start with that of time zero.
    pub latency_secs: f64,
    /// Joint angles added to the pose the body starts in, KIT order, radians; none leaves it exact.
    pub start_offsets_rad: Option<[f64; crate::motion::NUM_JOINTS]>,
}

impl Conditions {
    /// Nothing goes wrong, and the assist is that of the settings.
    #[must_use]
    pub fn undisturbed(settings: &SimulationSettings) -> Self {
        Self {
            assist_limit: settings.assist_limit,
            push: None,
            friction_factor: 1.0,
            mass_factor: 1.0,
            latency_secs: 0.0,
            start_offsets_rad: None,
        }
    }
}
