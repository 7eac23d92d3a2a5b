//! What a simulation runs with; every field is recorded with its results.

use serde::{Deserialize, Serialize};

/// How much physics stands behind a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Level {
    /// Kinematic: the motion alone, no physics.
    L0,
    /// Inverse dynamics: forces that would explain the motion.
    L1,
    /// Assisted tracking: free body, springs at the joints, a bounded wrench at the root.
    L2,
    /// Unassisted tracking: as L2 without the wrench.
    L3,
}

impl std::fmt::Display for Level {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}

/// How joints are represented in the engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JointForm {
    /// Maximal coordinates: one ball per anatomical joint, solved by projected Gauss-Seidel. Fast.
    Balls,
    /// Reduced coordinates: a multibody of chained revolute joints. Ten times slower, without joint drift; the reference.
    Multibody,
}

/// Settings of one rollout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulationSettings {
    /// Length of a step, seconds. Default 1/480; a longer step is faster and less stable.
    pub dt_secs: f64,
    /// Internal projected Gauss-Seidel iterations a step. Default 8; more converge tighter and cost time.
    pub pgs_iterations: usize,
    /// How joints are represented. Default balls.
    pub joint_form: JointForm,
    /// Largest assist force at the root at L2, as a share of body weight. Default 0.2; zero leaves no assist.
    pub assist_limit: f64,
    /// Largest assist moment at L2 is the force limit times this arm, metres. Default 0.5.
    pub assist_arm_m: f64,
    /// Coulomb friction between sole and ground. Default 0.8.
    pub friction: f64,
    /// Samples recorded per second; rounded to a whole number of steps. Default 120.
    pub record_rate_hz: f64,
    /// Give the joints the moments that inverse dynamics finds for the motion, so that springs only correct. Default on.
    pub feed_forward: bool,
    /// Lift the swing foot of the reference (a named retarget: recorded feet scuff the floor). Default on.
    pub swing_lift: bool,
    /// Level the soles of a motion that stands by constant ankle and toe offsets (a named retarget). Default on.
    pub sole_levelling: bool,
    /// Largest vertical shift of the reference onto the floor, metres. Default 0.03; larger hides floating.
    pub ground_correction_limit_m: f64,
}

impl Default for SimulationSettings {
    fn default() -> Self {
        Self {
            dt_secs: 1.0 / 480.0,
            pgs_iterations: 8,
            joint_form: JointForm::Balls,
            assist_limit: 0.2,
            assist_arm_m: 0.5,
            friction: 0.8,
            record_rate_hz: 120.0,
            feed_forward: true,
            swing_lift: true,
            sole_levelling: true,
            ground_correction_limit_m: 0.03,
        }
    }
}

/// A setting outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("setting {name} is {found}, expected {expected}")]
pub struct SettingsError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value found.
    pub found: f64,
    /// What is accepted.
    pub expected: &'static str,
}

impl SimulationSettings {
    /// Whole number of steps between samples, at least one.
    #[must_use]
    pub fn steps_per_sample(&self) -> usize {
        (1.0 / (self.dt_secs * self.record_rate_hz)).round().max(1.0) as usize
    }

    /// Checks every setting against its range.
    ///
    /// # Errors
    /// [`SettingsError`] names the first setting outside its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let checks = [
            ("dt_secs", self.dt_secs, 1e-5..=0.02, "0.00001 to 0.02 s"),
            ("pgs_iterations", self.pgs_iterations as f64, 1.0..=1000.0, "1 to 1000"),
            ("assist_limit", self.assist_limit, 0.0..=100.0, "0 to 100 body weights"),
            ("assist_arm_m", self.assist_arm_m, 0.0..=100.0, "0 to 100 m"),
            ("friction", self.friction, 0.0..=10.0, "0 to 10"),
            ("record_rate_hz", self.record_rate_hz, 1.0..=100_000.0, "1 to 100000 Hz"),
            ("ground_correction_limit_m", self.ground_correction_limit_m, 0.0..=1.0, "0 to 1 m"),
        ];
        match checks.into_iter().find(|(_, found, range, _)| !range.contains(found)) {
            Some((name, found, _, expected)) => Err(SettingsError { name, found, expected }),
            None => Ok(()),
        }
    }
}
