//! One metric over many cases.

use serde::{Deserialize, Serialize};

use super::SplitMix64;
use super::case::{CaseResult, MetricRecord};

/// Resamples behind an interval; more would move its ends by less than the printed digits.
const NUM_RESAMPLES: usize = 1000;
/// Fewest cases for an interval: below, resamples repeat so much that the interval says less than it seems to.
const MIN_CASES: usize = 5;

/// Ends of an interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// One metric over the cases that have a value for it.
///
/// A failed case has no value; it is counted in `num_without` and never silently left out of a mean.
/// So is, above level 0, a case that something other than the floor held ([`CaseResult::simulable`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aggregate {
    /// Key of the metric.
    pub key: String,
    /// Number of cases with a value.
    pub num_cases: usize,
    /// Number of cases without: failed, not simulable, or the metric does not apply to them.
    pub num_without: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// 95 % percentile-bootstrap interval of the mean over cases; `None` below five cases.
    pub mean_interval: Option<Interval>,
    /// Smallest value.
    pub min: f64,
    /// First quartile, linearly interpolated.
    pub lower_quartile: f64,
    /// Median.
    pub median: f64,
    /// Third quartile, linearly interpolated.
    pub upper_quartile: f64,
    /// Largest value.
    pub max: f64,
}

/// Aggregates of all metrics that at least one case has, in metric order.
///
/// `seed` draws the bootstrap resamples; the same resamples serve every metric with as many cases.
#[must_use]
pub fn aggregate(metrics: &[MetricRecord], cases: &[CaseResult], seed: u64) -> Vec<Aggregate> {
    metrics
        .iter()
        .filter_map(|metric| {
            let values: Vec<f64> = cases
                .iter()
                .filter(|case| case.counts_at(metric.level))
                .filter_map(|case| case.score(&metric.key))
                .collect();
            summarize(&metric.key, values, cases.len(), seed)
        })
        .collect()
}

fn summarize(key: &str, mut values: Vec<f64>, num_all: usize, seed: u64) -> Option<Aggregate> {
    let (num_cases, mean_interval) = (values.len(), mean_interval(&values, seed));
    values.sort_by(f64::total_cmp);
    let (&min, &max) = (values.first()?, values.last()?);
    Some(Aggregate {
        key: key.to_owned(),
        num_cases,
        num_without: num_all - num_cases,
        mean: mean(&values),
        mean_interval,
        min,
        lower_quartile: quantile(&values, 0.25),
        median: quantile(&values, 0.5),
        upper_quartile: quantile(&values, 0.75),
        max,
    })
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Quantile of sorted values, linear between neighbours; `values` is not empty.
pub(crate) fn quantile(values: &[f64], share: f64) -> f64 {
    let position = share * (values.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = position.ceil() as usize;
    values[below] + (position - position.floor()) * (values[above] - values[below])
}

fn mean_interval(values: &[f64], seed: u64) -> Option<Interval> {
    if values.len() < MIN_CASES {
        return None;
    }
    let mut random = SplitMix64(seed);
    let mut means: Vec<f64> = (0..NUM_RESAMPLES)
        .map(|_| {
            let total: f64 = (0..values.len()).map(|_| values[random.below(values.len())]).sum();
            total / values.len() as f64
        })
        .collect();
    means.sort_by(f64::total_cmp);
    Some(Interval { low: quantile(&means, 0.025), high: quantile(&means, 0.975) })
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::{case, metric};
    use super::*;
    use crate::plausibility::Better;

    #[test]
    fn quartiles_interpolate() {
        let summary = summarize("k", vec![4.0, 1.0, 3.0, 2.0], 5, 0).unwrap();
        assert_eq!((summary.num_cases, summary.num_without), (4, 1));
        assert_eq!((summary.min, summary.max, summary.mean), (1.0, 4.0, 2.5));
        assert_eq!((summary.lower_quartile, summary.median, summary.upper_quartile), (1.75, 2.5, 3.25));
    }

    #[test]
    fn interval_of_the_mean_has_the_width_theory_gives() {
        // For 0, 1, ..., 99 the standard error of the mean is sqrt((100^2 - 1) / 12 / 100) = 2.887.
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let interval = mean_interval(&values, 7).unwrap();
        let half_width = 0.5 * (interval.high - interval.low);
        assert!((half_width - 1.96 * 2.887).abs() < 0.5, "{half_width}");
        assert!(interval.low < 49.5 && 49.5 < interval.high);
        assert_eq!(mean_interval(&values, 7), Some(interval));
        assert_eq!(mean_interval(&[1.0, 2.0, 3.0, 4.0], 7), None);
    }

    #[test]
    fn cases_without_a_value_are_counted() {
        let metrics = [metric("l0/skate", "mm/s", Better::Lower), metric("l2/mpjpe", "mm", Better::Lower)];
        let cases = [case("a", &[("l0/skate", 1.0), ("l2/mpjpe", 2.0)]), case("b", &[("l0/skate", 3.0)])];
        let aggregates = aggregate(&metrics, &cases, 0);
        assert_eq!(aggregates[0].num_without, 0);
        assert_eq!(aggregates[1].num_without, 1);
        assert!(aggregate(&metrics, &[], 0).is_empty());
    }
}
