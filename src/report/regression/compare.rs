//! Every case and metric of a run beside its accepted value.

use std::collections::BTreeSet;

use super::super::results::Results;
use super::baseline::{Baseline, BaselineError};
use crate::manifest::signature_difference;
use crate::plausibility::Better;

/// What a pair of values says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Beyond the tolerance in the bad direction: a regression.
    Worse,
    /// The baseline has a value, the run has none: a regression.
    Missing,
    /// Beyond the tolerance in the good direction.
    Better,
    /// Beyond the tolerance for a metric that does not judge.
    Changed,
    /// The run has a value, the baseline has none.
    New,
    /// Within the tolerance.
    Same,
}

impl Verdict {
    /// Whether the verdict fails the gate.
    #[must_use]
    pub fn is_regression(self) -> bool {
        matches!(self, Self::Worse | Self::Missing)
    }

    /// One lower-case word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Worse => "worse",
            Self::Missing => "missing",
            Self::Better => "better",
            Self::Changed => "changed",
            Self::New => "new",
            Self::Same => "same",
        }
    }
}

/// One metric of one case, before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Id of the case.
    pub case: String,
    /// Key of the metric.
    pub metric: String,
    /// Accepted value.
    pub before: Option<f64>,
    /// Value of the run.
    pub after: Option<f64>,
    /// Change that counts as none, in the metric's unit.
    pub allowed: f64,
    /// What the pair says.
    pub verdict: Verdict,
}

/// What became of a case as a whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CaseFate {
    /// In both the baseline and the run.
    Compared,
    /// In the run only.
    New,
    /// In the baseline only: a regression.
    Missing {
        /// Why, where the run says so.
        reason: Option<String>,
    },
    /// The run could not finish it: a regression, in the baseline or not.
    Failed {
        /// Why.
        reason: String,
    },
}

impl CaseFate {
    /// Whether the fate fails the gate.
    #[must_use]
    pub fn is_regression(&self) -> bool {
        matches!(self, Self::Missing { .. } | Self::Failed { .. })
    }
}

/// One metric over the cases that both sides have.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricSummary {
    /// Key of the metric.
    pub metric: String,
    /// Number of cases with a value on both sides.
    pub num_pairs: usize,
    /// Pairs beyond the tolerance in the good direction.
    pub num_better: usize,
    /// Pairs beyond the tolerance in the bad direction.
    pub num_worse: usize,
    /// Pairs beyond the tolerance in either direction, also of a metric that does not judge.
    pub num_changed: usize,
    /// Mean accepted value over the pairs.
    pub mean_before: f64,
    /// Mean value of the run over the pairs.
    pub mean_after: f64,
    /// Case with the largest change.
    pub most_changed_case: String,
    /// That change, after minus before.
    pub largest_change: f64,
}

/// A run beside its baseline.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Every case of either side, by id.
    pub cases: Vec<(String, CaseFate)>,
    /// Every metric of every compared case, by case and metric key.
    pub changes: Vec<Change>,
    /// One line a metric with at least one pair, by metric key.
    pub summaries: Vec<MetricSummary>,
}

impl Comparison {
    /// Whether anything fails the gate.
    #[must_use]
    pub fn is_regression(&self) -> bool {
        self.cases.iter().any(|(_, fate)| fate.is_regression())
            || self.changes.iter().any(|change| change.verdict.is_regression())
    }

    /// Number of changes with this verdict.
    #[must_use]
    pub fn count(&self, verdict: Verdict) -> usize {
        self.changes.iter().filter(|change| change.verdict == verdict).count()
    }
}

/// Compares a run with its baseline, case by case and metric by metric.
///
/// # Errors
/// [`BaselineError::OtherKey`] and [`BaselineError::OtherDefinition`] when the numbers do not mean the same.
pub fn compare(baseline: &Baseline, results: &Results) -> Result<Comparison, BaselineError> {
    let differences = results.key.differences(&baseline.key);
    if !differences.is_empty() {
        return Err(BaselineError::OtherKey { differences });
    }
    let differences = redefined(baseline, results);
    if !differences.is_empty() {
        return Err(BaselineError::OtherDefinition { differences });
    }

    let ids: BTreeSet<&str> = baseline
        .cases
        .keys()
        .map(String::as_str)
        .chain(results.cases.iter().map(|case| case.id.as_str()))
        .collect();
    let cases: Vec<(String, CaseFate)> =
        ids.into_iter().map(|id| (id.to_owned(), fate(id, baseline, results))).collect();
    let changes: Vec<Change> = cases
        .iter()
        .filter(|(_, fate)| *fate == CaseFate::Compared)
        .flat_map(|(id, _)| case_changes(id, baseline, results))
        .collect();
    let summaries = summarize(&changes);
    Ok(Comparison { cases, changes, summaries })
}

fn redefined(baseline: &Baseline, results: &Results) -> Vec<String> {
    baseline
        .metrics
        .iter()
        .filter_map(|(key, accepted)| {
            let now = results.metric(key)?;
            let (was, is) = ((&accepted.signature, accepted.better), (&now.signature, now.better));
            let definition =
                |(signature, better): (&String, Better)| format!("{signature}|{}", better.word());
            (was != is).then(|| format!("{key}: {}", signature_difference(&definition(is), &definition(was))))
        })
        .collect()
}

fn fate(id: &str, baseline: &Baseline, results: &Results) -> CaseFate {
    match results.cases.iter().find(|case| case.id == id) {
        Some(case) if case.failed() => CaseFate::Failed { reason: case.failures.join("; ") },
        Some(_) if baseline.cases.contains_key(id) => CaseFate::Compared,
        Some(_) => CaseFate::New,
        None => {
            let skipped = results.skipped.iter().find(|skipped| skipped.id == id);
            CaseFate::Missing { reason: skipped.map(|skipped| skipped.reason.clone()) }
        }
    }
}

fn case_changes(id: &str, baseline: &Baseline, results: &Results) -> Vec<Change> {
    let accepted = baseline.cases.get(id);
    let case = results.cases.iter().find(|case| case.id == id);
    let keys: BTreeSet<&str> = accepted
        .into_iter()
        .flat_map(|values| values.keys().map(String::as_str))
        .chain(case.into_iter().flat_map(|case| case.scores().map(|(key, _)| key)))
        .collect();
    keys.into_iter()
        .map(|key| {
            let before = accepted.and_then(|values| values.get(key)).copied();
            let after = case.and_then(|case| case.score(key));
            let metric = baseline.metrics.get(key);
            let allowed = metric.zip(before).map_or(0.0, |(metric, before)| metric.allowed(before));
            let better = metric.map_or(Better::Neither, |metric| metric.better);
            let verdict = match (before, after) {
                (Some(before), Some(after)) => judge(before, after, allowed, better),
                (Some(_), None) => Verdict::Missing,
                (None, _) => Verdict::New,
            };
            Change { case: id.to_owned(), metric: key.to_owned(), before, after, allowed, verdict }
        })
        .collect()
}

fn judge(before: f64, after: f64, allowed: f64, better: Better) -> Verdict {
    let change = after - before;
    match better {
        // A number that is none is worse than any.
        _ if !change.is_finite() => Verdict::Worse,
        _ if change.abs() <= allowed => Verdict::Same,
        Better::Neither => Verdict::Changed,
        Better::Lower if change < 0.0 => Verdict::Better,
        Better::Higher if change > 0.0 => Verdict::Better,
        Better::Lower | Better::Higher => Verdict::Worse,
    }
}

fn summarize(changes: &[Change]) -> Vec<MetricSummary> {
    let keys: BTreeSet<&str> = changes.iter().map(|change| change.metric.as_str()).collect();
    keys.into_iter()
        .filter_map(|key| {
            let pairs: Vec<(&Change, f64, f64)> = changes
                .iter()
                .filter(|change| change.metric == key)
                .filter_map(|change| Some((change, change.before?, change.after?)))
                .collect();
            let (most, before, after) =
                pairs.iter().max_by(|a, b| (a.2 - a.1).abs().total_cmp(&(b.2 - b.1).abs()))?;
            let count = |verdict| pairs.iter().filter(|(change, ..)| change.verdict == verdict).count();
            let mean = |value: fn(&(&Change, f64, f64)) -> f64| {
                pairs.iter().map(value).sum::<f64>() / pairs.len() as f64
            };
            Some(MetricSummary {
                metric: key.to_owned(),
                num_pairs: pairs.len(),
                num_better: count(Verdict::Better),
                num_worse: count(Verdict::Worse),
                num_changed: pairs.len() - count(Verdict::Same),
                mean_before: mean(|pair| pair.1),
                mean_after: mean(|pair| pair.2),
                most_changed_case: most.case.clone(),
                largest_change: after - before,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::case::CaseResult;
    use super::super::super::case::samples::{case, metric};
    use super::super::super::results::samples::results;
    use super::*;

    /// Accepts one walk; skate may change by 0.5 + 2 %, so by 0.7 at 10.
    fn accepted() -> Baseline {
        let run = results(vec![case(
            "walk",
            &[("l0/skate", 10.0), ("l2/mpjpe", 20.0), ("l2/airtime", 0.5), ("l3/upright", 5.0)],
        )]);
        Baseline::accept(&run, None).unwrap()
    }

    fn walk(skate: f64, airtime: f64, upright: f64) -> CaseResult {
        case(
            "walk",
            &[("l0/skate", skate), ("l2/mpjpe", 20.0), ("l2/airtime", airtime), ("l3/upright", upright)],
        )
    }

    fn verdict_of(cases: Vec<CaseResult>, key: &str) -> (Verdict, bool) {
        let comparison = compare(&accepted(), &results(cases)).unwrap();
        let change = comparison.changes.iter().find(|change| change.metric == key).unwrap();
        (change.verdict, comparison.is_regression())
    }

    #[test]
    fn equal_runs_are_the_same() {
        let comparison = compare(&accepted(), &results(vec![walk(10.0, 0.5, 5.0)])).unwrap();
        assert_eq!(comparison.count(Verdict::Same), 4);
        assert!(!comparison.is_regression());
    }

    #[test]
    fn worse_within_the_tolerance_passes() {
        assert_eq!(verdict_of(vec![walk(10.69, 0.5, 5.0)], "l0/skate"), (Verdict::Same, false));
    }

    #[test]
    fn worse_beyond_the_tolerance_is_a_regression_in_either_direction() {
        assert_eq!(verdict_of(vec![walk(10.71, 0.5, 5.0)], "l0/skate"), (Verdict::Worse, true));
        assert_eq!(verdict_of(vec![walk(10.0, 0.5, 4.0)], "l3/upright"), (Verdict::Worse, true));
    }

    #[test]
    fn better_is_reported_and_passes() {
        assert_eq!(verdict_of(vec![walk(1.0, 0.5, 5.0)], "l0/skate"), (Verdict::Better, false));
        assert_eq!(verdict_of(vec![walk(10.0, 0.5, 9.0)], "l3/upright"), (Verdict::Better, false));
    }

    #[test]
    fn a_descriptive_metric_never_fails() {
        assert_eq!(verdict_of(vec![walk(10.0, 9.0, 5.0)], "l2/airtime"), (Verdict::Changed, false));
    }

    #[test]
    fn a_value_that_vanished_is_a_regression() {
        let partial = case("walk", &[("l0/skate", 10.0), ("l2/mpjpe", 20.0), ("l2/airtime", 0.5)]);
        assert_eq!(verdict_of(vec![partial], "l3/upright"), (Verdict::Missing, true));
    }

    #[test]
    fn a_new_metric_is_named_and_passes() {
        let mut run = results(vec![walk(10.0, 0.5, 5.0)]);
        run.metrics.push(metric("l0/jerk", "m/s^3", Better::Lower));
        run.cases[0].levels[0].scores.insert("l0/jerk".to_owned(), 3.0);
        let comparison = compare(&accepted(), &run).unwrap();
        assert_eq!(comparison.count(Verdict::New), 1);
        assert!(!comparison.is_regression());
    }

    #[test]
    fn missing_new_and_failed_cases_are_named() {
        let missing = compare(&accepted(), &results(vec![])).unwrap();
        assert_eq!(missing.cases, [("walk".to_owned(), CaseFate::Missing { reason: None })]);
        assert!(missing.is_regression());

        let new = compare(&accepted(), &results(vec![walk(10.0, 0.5, 5.0), case("bow", &[])])).unwrap();
        assert_eq!(new.cases[0], ("bow".to_owned(), CaseFate::New));
        assert!(!new.is_regression());

        let mut broken = walk(10.0, 0.5, 5.0);
        broken.failures.push("L2: not a number at 0.5 s".to_owned());
        let failed = compare(&accepted(), &results(vec![broken])).unwrap();
        assert!(matches!(&failed.cases[0].1, CaseFate::Failed { reason } if reason.contains("0.5 s")));
        assert!(failed.is_regression());
    }

    #[test]
    fn not_a_number_is_a_regression() {
        assert_eq!(judge(1.0, f64::NAN, f64::INFINITY, Better::Neither), Verdict::Worse);
    }

    #[test]
    fn another_key_or_definition_is_refused_with_the_remedy() {
        let mut run = results(vec![walk(10.0, 0.5, 5.0)]);
        run.key.engine = "rapier 0.37.0".to_owned();
        let error = compare(&accepted(), &run).unwrap_err().to_string();
        assert!(error.contains("rapier 0.37.0") && error.contains("--update"), "{error}");

        let mut run = results(vec![walk(10.0, 0.5, 5.0)]);
        run.metrics[0].signature = "v:2".to_owned();
        let error = compare(&accepted(), &run).unwrap_err().to_string();
        assert!(error.contains("l0/skate: v:2") && error.contains("--update"), "{error}");
    }

    #[test]
    fn summaries_pair_cases() {
        let before = results(vec![case("a", &[("l0/skate", 1.0)]), case("b", &[("l0/skate", 3.0)])]);
        let after = results(vec![case("a", &[("l0/skate", 1.0)]), case("b", &[("l0/skate", 9.0)])]);
        let comparison = compare(&Baseline::accept(&before, None).unwrap(), &after).unwrap();
        let summary = &comparison.summaries[0];
        assert_eq!((summary.num_pairs, summary.num_worse, summary.num_better), (2, 1, 0));
        assert_eq!((summary.mean_before, summary.mean_after), (2.0, 5.0));
        assert_eq!((summary.most_changed_case.as_str(), summary.largest_change), ("b", 6.0));
    }
}
