//! Why a run cannot start or go on.

use std::path::PathBuf;

use super::settings::SettingsProblem;
use crate::model::{TensorsError, WeightsError};

/// Why a run cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The settings cannot be used.
    #[error(transparent)]
    Settings(#[from] SettingsProblem),
    /// There is a run in the folder already.
    #[error(
        "start a run: {folder} holds one; go on with --resume, replace it with --overwrite, or use another --out"
    )]
    Exists {
        /// The folder.
        folder: PathBuf,
    },
    /// There is no run to resume.
    #[error(
        "resume the run in {folder}: there is none; name its folder with --out, or start one without --resume"
    )]
    NothingToResume {
        /// The folder.
        folder: PathBuf,
    },
    /// Another process works in the folder.
    #[error("use {folder}: another process is training there")]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// The run was started with other settings.
    #[error("resume: the run has other settings: {}; use its own, or start another run", .0.join("; "))]
    OtherSettings(Vec<String>),
    /// The run was started on something else.
    #[error("resume: {field} is {found}, the run was started with {expected}")]
    OtherRun {
        /// What differs.
        field: &'static str,
        /// What there is now.
        found: String,
        /// What there was.
        expected: String,
    },
    /// The data have too little for the plan.
    #[error("train: the prepared data have {fault}")]
    Data {
        /// What is missing.
        fault: String,
    },
    /// A loss or gradient became infinite or no number.
    #[error(
        "train: {what} is not finite at iteration {iteration}; {kept}; lower training.learning_rate or \
         training.clip_norm, or look at the batch: {batch}"
    )]
    NotFinite {
        /// Which loss, or whose gradient.
        what: String,
        /// Where.
        iteration: usize,
        /// What is left of the run.
        kept: String,
        /// Motions and captions of the batch.
        batch: String,
    },
    /// A checkpoint is damaged.
    #[error("read the checkpoint {path}: {reason}; delete its folder to go on from the one before")]
    Checkpoint {
        /// The folder or file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The tensors of a checkpoint cannot be read.
    #[error(transparent)]
    Tensors(#[from] TensorsError),
    /// The weights of a checkpoint do not fit the model.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The file system refuses.
    #[error("{doing} {path}: {error}")]
    Io {
        /// What was tried.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The file system refuses a write; the message names the path.
    #[error(transparent)]
    Write(std::io::Error),
}

impl TrainingError {
    /// Whether the user asked for something that cannot be, rather than the work having failed.
    #[must_use]
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Settings(_)
                | Self::Exists { .. }
                | Self::NothingToResume { .. }
                | Self::OtherSettings(_)
                | Self::OtherRun { .. }
                | Self::Data { .. }
        )
    }
}
