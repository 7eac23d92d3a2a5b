//! Where a run gets its motions.

use crate::dataset::{Dataset, Sample};
use crate::manifest::SkippedInput;
use crate::report::Candidate;

/// Motions by index, read when their turn comes.
pub trait Source: Sync {
    /// Name for tables and manifests.
    fn name(&self) -> String;
    /// Ids of the motions, sorted, each once.
    fn ids(&self) -> Vec<String>;
    /// Inputs that were refused when the source was listed.
    fn skipped(&self) -> Vec<SkippedInput>;
    /// Reads the motion at an index of [`Source::ids`]; called from several threads.
    ///
    /// # Errors
    /// The input and the reason when it cannot be used.
    fn load(&self, index: usize) -> Result<Sample, SkippedInput>;

    /// As [`Source::load`], with the motions it was chosen from, where it was.
    ///
    /// # Errors
    /// As [`Source::load`].
    fn load_chosen(&self, index: usize) -> Result<(Sample, Vec<Candidate>), SkippedInput> {
        Ok((self.load(index)?, Vec::new()))
    }
}

impl Source for (&str, &Dataset) {
    fn name(&self) -> String {
        self.0.to_owned()
    }

    fn ids(&self) -> Vec<String> {
        self.1.entries().iter().map(|entry| entry.id.clone()).collect()
    }

    fn skipped(&self) -> Vec<SkippedInput> {
        self.1.skipped().iter().cloned().map(SkippedInput::from).collect()
    }

    fn load(&self, index: usize) -> Result<Sample, SkippedInput> {
        Ok(self.1.load(&self.1.entries()[index])?)
    }
}
