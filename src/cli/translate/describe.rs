//! From a motion to sentences.

use std::fmt::Write as _;

use serde::Serialize;

use super::Session;
use crate::dataset::Sample;
use crate::report::fixed;
use crate::translation::{Sentence, TranslationError};

/// What is written about a motion; `rprae evaluate --hypotheses` reads it.
#[derive(Debug, Serialize)]
pub(super) struct DescribedRecord {
    /// Identity of the motion.
    id: String,
    /// Where it was read.
    source: String,
    /// Time from the first to the last frame, seconds.
    duration_secs: f64,
    /// The best sentence.
    hypothesis: String,
    /// What people wrote, where that is known.
    references: Vec<String>,
    /// Best first.
    sentences: Vec<Sentence>,
    /// Doubts about the motion.
    warnings: Vec<String>,
}

impl DescribedRecord {
    pub fn new(session: &Session<'_>, sample: Sample) -> Result<Self, TranslationError> {
        let described = session.translator.describe(&sample.motion, &session.search)?;
        let mut warnings = sample.warnings;
        warnings.extend(described.warnings.iter().cloned());
        Ok(Self {
            id: sample.id,
            source: sample.source.display().to_string(),
            duration_secs: sample.motion.duration_secs(),
            hypothesis: described.best().to_owned(),
            references: sample.captions,
            sentences: described.sentences,
            warnings,
        })
    }

    /// For a person.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}  {:.1} s", self.id, self.duration_secs);
        for warning in &self.warnings {
            let _ = writeln!(text, "  note: {warning}");
        }
        for sentence in &self.sentences {
            let cut = if sentence.has_ended { "" } else { " ..." };
            let Sentence { score, log_probability, text: words, .. } = sentence;
            let _ = writeln!(
                text,
                "  score {:>6}  {words}{cut} (log p {})",
                fixed(*score, 2),
                fixed(*log_probability, 2)
            );
        }
        for reference in &self.references {
            let _ = writeln!(text, "  reference: {reference}");
        }
        text
    }
}
