//! The humanoid in a physics engine, driven by a motion.
//!
//! In: a [`Humanoid`], a [`Motion`] and [`SimulationSettings`].
//! Out: a [`Rollout`]: what the body did, what it was told to do, and what forces that took.
//! All engine types stay inside this module; nothing here scores, writes or prints.
//!
//! One step: the motion at the current time sets the rest state of the joint springs and of the assist, the engine solves
//! springs, joints and contacts together, and the impulses it found are read back as torques and forces.

mod articulation;
mod assist;
mod balls;
mod body;
mod chain;
mod conditions;
mod contact;
mod engine;
mod fall;
mod feed_forward;
mod gains;
mod grounding;
mod levelling;
mod multibody;
mod reference;
mod retarget;
mod rollout;
mod run;
mod self_test;
mod settings;
mod sole;

pub use assist::{ASSIST_ANGULAR, ASSIST_LINEAR};
pub use balls::ADDED_INERTIA;
pub use body::AddedInertia;
pub use conditions::{Conditions, Push};
pub use engine::{ENGINE_VERSION, GRAVITY_M_S2};
pub use fall::{FallCause, FallRule, LOST_TRACK_M};
pub use gains::{Gains, gains};
pub use rollout::{Contact, Event, EventKind, Outcome, Rollout, RolloutSample, SegmentPoses};
pub use run::{Command, Observer, Simulation};
pub use self_test::{Check, self_test};
pub use settings::{JointForm, Level, SettingsError, SimulationSettings};

use crate::humanoid::Humanoid;
use crate::motion::{Motion, MotionError};

/// Why a simulation could not start.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// The level has no simulation.
    #[error("level {level} is not simulated, expected L2 or L3")]
    Level {
        /// Level asked for.
        level: Level,
    },
    /// A setting is outside its range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The motion leaves its bounds when it is made ready for physics.
    #[error("failed to prepare the motion: {0}")]
    Motion(#[from] MotionError),
    /// The robot has a joint the simulation cannot represent.
    #[error("the joint above link {link:?} is not a chain of one to three perpendicular hinges in one place")]
    Chain {
        /// Link below the joint.
        link: String,
    },
    /// The body could not be built.
    #[error("failed to build the body: {reason}")]
    Body {
        /// What is wrong with it.
        reason: String,
    },
    /// The engine did not accept the body in reduced coordinates.
    #[error("the physics engine refused the robot as a multibody")]
    Multibody,
}

/// Simulates a motion at one level; several levels of one motion share their preparation in [`Simulation`].
///
/// # Errors
/// [`SimulationError`] when the level, the settings or the body cannot be simulated.
pub fn simulate(
    humanoid: &Humanoid,
    motion: &Motion,
    level: Level,
    settings: &SimulationSettings,
    observer: &mut dyn FnMut(&RolloutSample),
) -> Result<Rollout, SimulationError> {
    Simulation::new(humanoid, motion, settings)?.run(level, observer)
}
