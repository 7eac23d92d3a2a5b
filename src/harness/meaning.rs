//! Meaning lost to physics, case by case.

use super::language::{Language, ReadBack, ReadBackError};
use super::language_metrics::{
    BLEU_L0, BLEU_L2, BLEU_LOST, COSINE_L0, COSINE_L2, COSINE_LOST, LATENT_L0, LATENT_L2, LATENT_LOST,
};
use crate::dataset::Sample;
use crate::plausibility::Metric;
use crate::report::LevelResult;
use crate::simulation::{Outcome, Rollout};
use crate::translation::performed_motion;

/// What a model reads back from the motion of a case, as it was given.
pub(super) struct Meaning<'a> {
    language: &'a Language,
    sample: &'a Sample,
    /// `None` without captions, or when the motion cannot be read.
    given: Option<ReadBack>,
}

impl<'a> Meaning<'a> {
    /// Reads the motion back; what goes wrong with the encoder fails the case, a motion the model cannot read does not.
    pub fn new(language: &'a Language, sample: &'a Sample, failures: &mut Vec<String>) -> Self {
        let given = read_back(language, &sample.motion, &sample.captions, "L0", failures);
        Self { language, sample, given }
    }

    /// Scores of the motion as it was given.
    pub fn score_given(&self, result: &mut LevelResult) {
        if let Some(given) = &self.given {
            insert(result, given, [&BLEU_L0, &LATENT_L0, &COSINE_L0]);
        }
    }

    /// Scores of what the humanoid did, and what was lost; nothing for a rollout that failed.
    pub fn score_performed(&self, result: &mut LevelResult, rollout: &Rollout, failures: &mut Vec<String>) {
        let (Some(given), Outcome::Completed) = (&self.given, &rollout.outcome) else { return };
        let performed = match performed_motion(&self.sample.motion, rollout) {
            Ok(performed) => performed,
            Err(error) => {
                failures.push(format!("L2: read back what the humanoid did: {error}"));
                return;
            }
        };
        let captions = &self.sample.captions;
        let Some(done) = read_back(self.language, &performed, captions, "L2", failures) else { return };
        insert(result, &done, [&BLEU_L2, &LATENT_L2, &COSINE_L2]);
        let mut lost = |metric: &Metric, given: f64, done: f64| {
            // Not a negative zero, which would print differently.
            result.scores.insert(metric.key.to_owned(), given - done + 0.0);
        };
        lost(&BLEU_LOST, given.bleu, done.bleu);
        lost(&LATENT_LOST, given.latent_cosine, done.latent_cosine);
        if let (Some(given), Some(done)) = (given.sentence_cosine, done.sentence_cosine) {
            lost(&COSINE_LOST, given, done);
        }
    }
}

fn read_back(
    language: &Language,
    motion: &crate::motion::Motion,
    captions: &[String],
    level: &str,
    failures: &mut Vec<String>,
) -> Option<ReadBack> {
    match language.read_back(motion, captions) {
        Ok(read) => read,
        // Too short or too long for the model, which says nothing about the case.
        Err(ReadBackError::Translation(_) | ReadBackError::Corpus(_)) => None,
        Err(error @ (ReadBackError::Encoder(_) | ReadBackError::NotFinite)) => {
            failures.push(format!("{level}: read back the caption: {error}"));
            None
        }
    }
}

fn insert(result: &mut LevelResult, read: &ReadBack, [bleu, latent, cosine]: [&Metric; 3]) {
    result.read_back = Some(read.text.clone());
    result.read_back_doubts.clone_from(&read.doubts);
    result.scores.insert(bleu.key.to_owned(), read.bleu);
    result.scores.insert(latent.key.to_owned(), read.latent_cosine);
    if let Some(value) = read.sentence_cosine {
        result.scores.insert(cosine.key.to_owned(), value);
    }
}
