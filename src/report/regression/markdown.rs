//! A comparison as Markdown.

use std::fmt::Write as _;

use super::super::number::{compact, counted, escape_markdown, signed};
use super::compare::{CaseFate, Comparison, Verdict};

/// A comparison as Markdown: the verdict, cases that were not compared, changes beyond tolerance, one line a metric that has any.
#[must_use]
pub fn comparison_markdown(comparison: &Comparison) -> String {
    let verdict = if comparison.is_regression() { "regression" } else { "no regression" };
    let num_compared = comparison.cases.iter().filter(|(_, fate)| *fate == CaseFate::Compared).count();
    let mut text = format!(
        "# Comparison with the baseline: {verdict}\n\n{} compared; values:",
        counted(num_compared, "case")
    );
    let all =
        [Verdict::Worse, Verdict::Missing, Verdict::Better, Verdict::Changed, Verdict::New, Verdict::Same];
    let counts = all.map(|verdict| format!(" {} {}", comparison.count(verdict), verdict.word()));
    let _ = writeln!(text, "{}.", counts.join(","));
    write_cases(&mut text, comparison);
    write_changes(&mut text, comparison);
    write_summaries(&mut text, comparison);
    text
}

fn write_cases(text: &mut String, comparison: &Comparison) {
    let rows: Vec<String> = comparison
        .cases
        .iter()
        .filter_map(|(id, fate)| {
            let (word, reason) = match fate {
                CaseFate::Compared => return None,
                CaseFate::New => ("new", ""),
                CaseFate::Missing { reason } => ("missing", reason.as_deref().unwrap_or("")),
                CaseFate::Failed { reason } => ("failed", reason.as_str()),
            };
            Some(format!("| {} | {word} | {} |\n", escape_markdown(id), escape_markdown(reason)))
        })
        .collect();
    if !rows.is_empty() {
        text.push_str("\n## Cases not compared\n\n| case | fate | reason |\n|---|---|---|\n");
        text.extend(rows);
    }
}

fn write_changes(text: &mut String, comparison: &Comparison) {
    let mut changes: Vec<_> =
        comparison.changes.iter().filter(|change| change.verdict != Verdict::Same).collect();
    if changes.is_empty() {
        return;
    }
    // Stable: within a verdict the order stays that of cases and metrics.
    changes.sort_by_key(|change| change.verdict);
    text.push_str(
        "\n## Changes beyond tolerance\n\n\
         | case | metric | verdict | before | after | change | allowed |\n|---|---|---|---:|---:|---:|---:|\n",
    );
    for change in changes {
        let value = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), compact);
        let difference =
            change.before.zip(change.after).map_or_else(|| "-".to_owned(), |(a, b)| signed(b - a));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {difference} | {} |",
            escape_markdown(&change.case),
            escape_markdown(&change.metric),
            change.verdict.word(),
            value(change.before),
            value(change.after),
            compact(change.allowed)
        );
    }
}

fn write_summaries(text: &mut String, comparison: &Comparison) {
    let changed: Vec<_> = comparison.summaries.iter().filter(|summary| summary.num_changed > 0).collect();
    let num_same = comparison.summaries.len() - changed.len();
    if changed.is_empty() {
        let _ = writeln!(text, "\n{} within tolerance in all cases.", counted(num_same, "metric"));
        return;
    }
    text.push_str(
        "\n## Changed metrics, over paired cases\n\n\
         | metric | pairs | worse | better | mean before | mean after | largest change | in case |\n\
         |---|---:|---:|---:|---:|---:|---:|---|\n",
    );
    for summary in changed {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            escape_markdown(&summary.metric),
            summary.num_pairs,
            summary.num_worse,
            summary.num_better,
            compact(summary.mean_before),
            compact(summary.mean_after),
            signed(summary.largest_change),
            escape_markdown(&summary.most_changed_case)
        );
    }
    if num_same > 0 {
        let _ = writeln!(text, "\n{} more within tolerance in all cases.", counted(num_same, "metric"));
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::case::samples::case;
    use super::super::super::results::samples::results;
    use super::super::{Baseline, compare};
    use super::*;

    #[test]
    fn says_what_changed_and_what_it_means() {
        let before = results(vec![case("a", &[("l0/skate", 1.0), ("l3/upright", 2.0)]), case("gone", &[])]);
        let after = results(vec![case("a", &[("l0/skate", 9.0), ("l3/upright", 4.0)])]);
        let text = comparison_markdown(&compare(&Baseline::accept(&before, None).unwrap(), &after).unwrap());
        assert!(text.starts_with("# Comparison with the baseline: regression\n"), "{text}");
        assert!(text.contains("1 worse, 0 missing, 1 better, 0 changed, 0 new, 0 same."), "{text}");
        assert!(text.contains("| gone | missing |  |"), "{text}");
        assert!(text.contains("| a | l0/skate | worse | 1.00 | 9.00 | +8.00 | 0.520 |"), "{text}");
        let worse = text.find("| worse |").unwrap();
        assert!(worse < text.find("| better |").unwrap());
    }

    #[test]
    fn metrics_that_did_not_change_are_counted_and_not_listed() {
        let compared = |skate: f64| {
            let before = results(vec![case("a", &[("l0/skate", 1.0), ("l3/upright", 2.0)])]);
            let after = results(vec![case("a", &[("l0/skate", skate), ("l3/upright", 2.001)])]);
            comparison_markdown(&compare(&Baseline::accept(&before, None).unwrap(), &after).unwrap())
        };
        let text = compared(9.0);
        assert!(text.contains("1 case compared"), "{text}");
        assert!(text.contains("| l0/skate | 1 | 1 | 0 | 1.00 | 9.00 | +8.00 | a |"), "{text}");
        assert!(text.ends_with("\n1 metric more within tolerance in all cases.\n"), "{text}");
        assert!(!text.contains("l3/upright"), "{text}");
        let text = compared(1.0);
        assert!(
            text.ends_with("\n2 metrics within tolerance in all cases.\n") && !text.contains('|'),
            "{text}"
        );
    }
}
