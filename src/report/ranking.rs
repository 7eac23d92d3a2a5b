//! Which cases deserve a look first.

use super::case::{CaseResult, MetricRecord};
use super::results::Results;
use crate::plausibility::Better;

/// Cases from worst to best: failed ones first, then by mean rank over the metrics in `keys`; those that cannot be simulated
/// come last.
///
/// Ranks have no unit, so metres and newtons can be mixed without weights.
/// A case gets for each metric the share of the other cases that are better; descriptive metrics do not count.
/// Equal cases stay in id order.
#[must_use]
pub fn worst_first<'a>(results: &'a Results, keys: &[&str]) -> Vec<&'a CaseResult> {
    let judged: Vec<&MetricRecord> = results
        .metrics
        .iter()
        .filter(|metric| metric.better != Better::Neither && keys.contains(&metric.key.as_str()))
        .collect();
    let mut ranked: Vec<(bool, f64, &CaseResult)> = results
        .cases
        .iter()
        .map(|case| (case.failed(), mean_badness(case, &results.cases, &judged), case))
        .collect();
    ranked.sort_by(|(failed_a, bad_a, a), (failed_b, bad_b, b)| {
        failed_b.cmp(failed_a).then(b.simulable().cmp(&a.simulable())).then(bad_b.total_cmp(bad_a))
    });
    ranked.into_iter().map(|(_, _, case)| case).collect()
}

fn mean_badness(case: &CaseResult, cases: &[CaseResult], metrics: &[&MetricRecord]) -> f64 {
    let shares: Vec<f64> = metrics
        .iter()
        .filter_map(|metric| {
            let value = case.score(&metric.key)?;
            let others: Vec<f64> = cases.iter().filter_map(|other| other.score(&metric.key)).collect();
            let num_better = others
                .iter()
                .filter(|other| match metric.better {
                    Better::Lower => **other < value,
                    Better::Higher => **other > value,
                    Better::Neither => false,
                })
                .count();
            Some(num_better as f64 / others.len() as f64)
        })
        .collect();
    if shares.is_empty() { 0.0 } else { shares.iter().sum::<f64>() / shares.len() as f64 }
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::super::results::samples::results;
    use super::*;

    #[test]
    fn failures_lead_and_directions_count() {
        let mut broken = case("z", &[]);
        broken.failures.push("not a number".to_owned());
        let all = results(vec![
            case("a", &[("l0/skate", 1.0), ("l3/upright", 9.0)]),
            case("b", &[("l0/skate", 5.0), ("l3/upright", 1.0)]),
            case("c", &[("l0/skate", 3.0), ("l3/upright", 5.0)]),
            broken,
        ]);
        let order: Vec<&str> =
            worst_first(&all, &["l0/skate", "l3/upright"]).iter().map(|case| case.id.as_str()).collect();
        assert_eq!(order, ["z", "b", "c", "a"]);
    }
}
