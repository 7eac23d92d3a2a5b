//! The paper's preparation: motions and captions in, a [`PreparedSet`] and an account of it out.
//!
//! 1. Motions of 1 to 30 s (100 to 3000 steps at 100 Hz) are taken to 10 Hz.
//! 2. Captions become words; those with a word that has no pretrained vector, and is not special, are left out.
//! 3. Motions that still have captions are split 80/10/10 by action, by seed or by lists of ids.
//! 4. Channels are normalised to [-0.9, 0.9] over the training split.
//! 5. One pair per caption; of the training pairs the non-paired set is drawn, and of that the paired one (Algorithm 1).
//! 6. Motions without captions and captions without motions join the non-paired sets, unless `extras` is off.
//!
//! Nothing here writes to a terminal; [`Account::text`] is what a person reads, [`Account`] itself what a manifest holds.

mod account;
mod gather;
mod select;
mod settings;

pub use account::{
    Account, CaptionsFrom, Corpus, DivisionRow, MANIFEST_FILE, MotionsFrom, Selection, SkippedSource,
    WordCoverage,
};
pub use gather::Open;
pub use settings::{CaptionSource, MotionSource, PrepareSettings, PrepareSettingsError, SplitLists};

use super::split::SplitError;
use super::{PreparedError, PreparedSet};
use crate::dataset::{DatasetError, VectorError};

/// How far a preparation is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step<'s> {
    /// Motions of a source read so far.
    Motions {
        /// Name of the source.
        source: &'s str,
        /// Motions read.
        done: usize,
        /// Motions in all.
        total: usize,
    },
    /// Share of the file of word vectors read so far.
    Vectors {
        /// From 0 to 1.
        share: f64,
    },
}

/// Why nothing can be prepared.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// The settings make no sense.
    #[error(transparent)]
    Settings(#[from] PrepareSettingsError),
    /// A source of motions or captions cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The word vectors cannot be read.
    #[error(transparent)]
    Vectors(#[from] VectorError),
    /// The lists of ids give no split.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// The set cannot be written.
    #[error(transparent)]
    Set(#[from] PreparedError),
    /// More pairs asked for than there are.
    #[error("draw {asked} pairs for {name}: there are {available}")]
    Amount {
        /// Setting.
        name: &'static str,
        /// Pairs asked for.
        asked: usize,
        /// Pairs to draw from.
        available: usize,
    },
    /// No motion and no caption is left.
    #[error("prepare the data: no motion and no caption is left; {why}")]
    Nothing {
        /// What took them away.
        why: String,
    },
}

/// Prepares what the settings name.
///
/// `open` opens a source of motions, so that the caller may put a cache before it and has its notes reported.
/// `progress` is called from several threads.
///
/// # Errors
/// [`PrepareError`] when the settings, or a source as a whole, cannot be used. Single bad inputs are skipped and accounted
/// for.
pub fn prepare(
    settings: &PrepareSettings,
    open: &Open<'_>,
    progress: &(dyn Fn(Step<'_>) + Sync),
) -> Result<(PreparedSet, Account), PrepareError> {
    settings.check()?;
    let mut gathered = gather::gather(settings, open, progress)?;
    let mut account = Account::of(settings, &mut gathered);
    let selected = select::select(settings, gathered, progress)?;
    if selected.set.motions.is_empty() && selected.set.captions.is_empty() {
        return Err(PrepareError::Nothing { why: account.why_nothing(&selected.selection) });
    }
    account.add(selected.selection, selected.corpus, selected.coverage, selected.vector_warnings);
    account.fingerprint.clone_from(&selected.set.fingerprint);
    Ok((selected.set, account))
}
