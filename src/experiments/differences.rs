//! What models differ by: with stage 1 and without, from captions that take no model, and from the reference.

use serde::Serialize;

use super::collect::{Row, SeedScores};
use super::estimate::{Difference, Estimate, difference, estimate, spread};
use super::grid::Role;
use crate::evaluation::{Measurement, Resampling, relative_performance};
use crate::report::Interval;

/// Scores that are compared; those of encoders only where there is one.
pub(super) const COMPARED: [&str; 5] = ["bleu-4", "rouge-l", "cider-d", "bertscore-f", "cosine"];

/// Captions written, or read back.
pub(super) type Pick = fn(&SeedScores) -> &[Measurement];

/// What is compared, and its name.
pub(super) const OF: [(&str, Pick); 2] = [CAPTIONS, ("read-back", |seed| &seed.read_back)];
const CAPTIONS: (&str, Pick) = ("captions", |seed| &seed.captions);

/// What a row with stage 1 is compared with: the one without, at equal pairs.
pub(super) const WITHOUT_STAGE_1: &str = "without-stage-1";
/// Captions that take no model.
pub(super) const BASELINES: [(&str, Pick); 2] =
    [("most-frequent", |seed| &seed.most_frequent), ("nearest", |seed| &seed.nearest)];

/// What a row differs by from another system, by one score.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Against {
    /// What was scored: `captions` or `read-back`.
    pub of: &'static str,
    /// Key of the score.
    pub key: &'static str,
    /// The other: `without-stage-1` at equal pairs, `most-frequent` or `nearest`.
    pub against: &'static str,
    /// The row's score minus the other's.
    pub difference: Difference,
}

/// All differences of a row.
#[must_use]
pub fn differences(rows: &[Row], row: &Row, resampling: Resampling) -> Vec<Against> {
    let mut all = Vec::new();
    let mut compare = |of, against, (ours, pick): (&Row, Pick), (other, pick_other): (&Row, Pick)| {
        for key in COMPARED {
            let both = ours.over_seeds(pick, key).zip(other.over_seeds(pick_other, key));
            all.extend(both.map(|(ours, others)| Against {
                of,
                key,
                against,
                difference: difference(&ours, &others, resampling),
            }));
        }
    };
    let without = rows.iter().find(|other| other.role == Role::Vanilla && other.paired == row.paired);
    if let Some(without) = without.filter(|_| row.role == Role::Proposed) {
        for (of, pick) in OF {
            compare(of, WITHOUT_STAGE_1, (row, pick), (without, pick));
        }
    }
    let (of, pick) = CAPTIONS;
    for (name, baseline) in BASELINES {
        compare(of, name, (row, pick), (row, baseline));
    }
    all
}

/// What reading back keeps of the captions of the reference, the first row, percent (Tables 5 and 7); `None` where the score
/// was not computed or that of the reference is not positive.
///
/// The interval is that of what is read back; the score of the reference is held fixed.
#[must_use]
pub fn relative(rows: &[Row], row: &Row, key: &str, resampling: Resampling) -> Option<Estimate> {
    let reference = estimate(&rows[0].over_seeds(CAPTIONS.1, key)?, resampling).value;
    let kept = estimate(&row.over_seeds(|seed| &seed.read_back, key)?, resampling);
    let percent = |value| relative_performance(value, reference);
    let interval = match kept.interval {
        Some(ends) => Some(Interval { low: percent(ends.low)?, high: percent(ends.high)? }),
        None => None,
    };
    let seeds: Vec<f64> = kept.seeds.iter().map(|&value| percent(value)).collect::<Option<_>>()?;
    Some(Estimate { value: percent(kept.value)?, interval, spread: spread(&seeds), seeds })
}
