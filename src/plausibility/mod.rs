//! Scores of a motion (level 0) and of a rollout (levels 2 and 3).
//!
//! In: a [`crate::motion::Motion`] or a [`crate::simulation::Rollout`], with its humanoid. Out: [`Score`]s.
//! Nothing here steps the world or writes a file.

mod metric;

pub use metric::{Better, Metric, Score};
