//! Motions checked in milliseconds, without a simulator.
//!
//! In: a [`Dataset`]. Out: [`Finding`]s, each with a code, a severity, a place and a remedy, for a person, as JSON or as JUnit.
//! What is odd but possible is a warning, never an error: nothing here judges how somebody moves.

mod channels;
mod finding;
mod posture;
mod render;

pub use finding::{CHECKS, Check, Finding, Severity};
pub use render::{findings_json, findings_junit, findings_text};

use rayon::prelude::*;
use serde::Serialize;

use crate::dataset::{Dataset, FaultKind, Sample, Skipped};
use crate::humanoid::Humanoid;
use finding::{FILE, MODEL, READER, SAMPLING, SCHEMA, UNITS_LENGTH, VALUE};

/// What was found in one input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Linted {
    /// Identity of the motion.
    pub id: String,
    /// Where it was read.
    pub source: String,
    /// Findings in the order of [`CHECKS`]; empty for a clean motion.
    pub findings: Vec<Finding>,
}

impl Linted {
    /// The worst severity, if anything was found.
    #[must_use]
    pub fn worst(&self) -> Option<Severity> {
        self.findings.iter().map(|finding| finding.severity).max()
    }
}

/// Checks every motion of a dataset, on all threads; `progress` is told of each. The result is sorted as the dataset is,
/// with inputs that could not even be listed first.
#[must_use]
pub fn lint(dataset: &Dataset, progress: &(dyn Fn() + Sync)) -> Vec<Linted> {
    let mut linted: Vec<Linted> =
        dataset.skipped().iter().map(|skipped| refused(skipped.clone(), FaultKind::Schema)).collect();
    let checked: Vec<Linted> = dataset
        .entries()
        .par_iter()
        .map(|entry| {
            let linted = match dataset.load_or_fault(entry) {
                Ok(sample) => Linted {
                    findings: lint_sample(&sample),
                    source: sample.source.display().to_string(),
                    id: sample.id,
                },
                Err((kind, skipped)) => refused(skipped, kind),
            };
            progress();
            linted
        })
        .collect();
    linted.extend(checked);
    linted
}

fn refused(skipped: Skipped, kind: FaultKind) -> Linted {
    let check = match kind {
        FaultKind::File => FILE,
        FaultKind::Schema => SCHEMA,
        FaultKind::Model => MODEL,
        FaultKind::Sampling => SAMPLING,
        FaultKind::Value => VALUE,
        FaultKind::Units => UNITS_LENGTH,
        FaultKind::Degrees => finding::UNITS_ANGLE,
    };
    // The reason names the place itself.
    let finding = check.found(Severity::Error, "", skipped.reason);
    Linted { id: skipped.id, source: skipped.source.display().to_string(), findings: vec![finding] }
}

/// Checks one motion.
#[must_use]
pub fn lint_sample(sample: &Sample) -> Vec<Finding> {
    let mut findings = Vec::new();
    channels::check(&sample.motion, &mut findings);
    let scale_is_off = findings.iter().any(|finding| finding.severity == Severity::Error);
    // A body in the wrong unit stands nowhere.
    if !scale_is_off && let Ok(humanoid) = Humanoid::new(sample.motion.body()) {
        posture::check(&humanoid, &sample.motion, &mut findings);
    }
    findings.extend(sample.warnings.iter().map(|warning| READER.found(Severity::Warning, "", warning)));
    let order = |code: &str| CHECKS.iter().position(|check| check.code == code);
    findings.sort_by_key(|finding| order(finding.code));
    findings
}
