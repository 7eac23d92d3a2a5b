//! Which motions of a source a run is of.

use super::Source;
use crate::manifest::SkippedInput;

/// The motions of a source that are asked for, all of which exist.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selection {
    /// Their places in [`Source::ids`], ascending.
    pub(super) indices: Vec<usize>,
    /// Inputs that are asked for and were refused when the source was listed.
    pub(super) skipped: Vec<SkippedInput>,
}

/// Why nothing can be selected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SelectionError {
    /// There are no motions of these ids.
    #[error("select motions: {dataset} has none called {}", .ids.join(", "))]
    UnknownIds {
        /// Where the motions should have come from.
        dataset: String,
        /// Ids that do not exist.
        ids: Vec<String>,
    },
    /// There is nothing to select.
    #[error("select motions: {dataset} holds none")]
    NoMotions {
        /// Where the motions should have come from.
        dataset: String,
    },
}

impl Selection {
    /// The motions of these ids, of all when there are none; at most `limit`, the first by id.
    ///
    /// # Errors
    /// [`SelectionError`] names the ids that do not exist, or says that there are no motions.
    pub fn of(source: &dyn Source, ids: &[String], limit: Option<usize>) -> Result<Self, SelectionError> {
        let known = source.ids();
        let is_wanted = |id: &String| ids.is_empty() || ids.contains(id);
        let skipped: Vec<SkippedInput> =
            source.skipped().into_iter().filter(|input| is_wanted(&input.id)).collect();
        let is_unknown = |id: &&String| !known.contains(id) && skipped.iter().all(|input| input.id != **id);
        let unknown: Vec<String> = ids.iter().filter(is_unknown).cloned().collect();
        if !unknown.is_empty() {
            return Err(SelectionError::UnknownIds { dataset: source.name(), ids: unknown });
        }
        let wanted = (0..known.len()).filter(|&index| is_wanted(&known[index]));
        let indices: Vec<usize> = wanted.take(limit.unwrap_or(usize::MAX)).collect();
        if indices.is_empty() && skipped.is_empty() {
            return Err(SelectionError::NoMotions { dataset: source.name() });
        }
        Ok(Self { indices, skipped })
    }

    /// Places of the motions in [`Source::ids`], ascending.
    pub fn indices(&self) -> impl Iterator<Item = usize> {
        self.indices.iter().copied()
    }

    /// Inputs that are asked for and were refused when the source was listed.
    #[must_use]
    pub fn skipped(&self) -> &[SkippedInput] {
        &self.skipped
    }
}
