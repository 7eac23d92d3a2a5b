//! The humanoid in a physics engine, driven by a motion.
//!
//! In: a [`Humanoid`], a [`Motion`] and [`SimulationSettings`].
//! Out: a [`Rollout`]: what the body did, what it was told to do, and what forces that took.
//! All engine types stay inside this module; nothing here scores, writes or prints.

mod rollout;
mod settings;

pub use rollout::{Contact, Event, EventKind, Outcome, Rollout, RolloutSample, SegmentPoses};
pub use settings::{JointForm, Level, SimulationSettings};
