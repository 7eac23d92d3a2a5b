//! Training in two stages: reconstruction of non-paired data, then binding of a few pairs (Algorithm 1).
//!
//! In: a [`PreparedSet`](crate::features::PreparedSet) and [`RunSettings`]. Out: a run folder with metrics, checkpoints and
//! a trained model. A run that was stopped at any moment goes on from its last checkpoint and ends with the same weights,
//! to the last bit, as one that was never stopped.

mod adam;
mod batches;
mod card;
mod checkpoint;
mod curves;
mod decay;
mod error;
mod events;
mod folder;
mod journal;
mod optimizer;
mod plan;
mod record;
mod run;
mod sampler;
mod settings;
mod validation;

pub use adam::Adam;
pub use card::card;
pub use checkpoint::Best;
pub use curves::{curves, read_metrics};
pub use decay::Decay;
pub use error::TrainingError;
pub use folder::{BUNDLE, Begin, CHECKPOINTS, RUN_FILE, RunFacts, RunFolder, SETTINGS_FILE};
pub use journal::{EVENTS_FILE, METRICS_FILE};
pub use plan::{Phase, Plan, Stage};
pub use record::{Iteration, Line, LossValues, Validation, memory_mib, peak_memory_mib};
pub use run::{Event, Trained, check, train};
pub use settings::{Keep, Preset, RunSettings, Schedule, SettingsProblem, TrainingSettings};
pub use validation::{CaptionScore, Written};

#[cfg(test)]
pub(crate) mod tests;
