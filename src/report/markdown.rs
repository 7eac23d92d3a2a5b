//! A run as Markdown.

use std::fmt::Write as _;

use super::aggregate::Aggregate;
use super::cell::cell;
use super::notes::{notes, remarks};
use super::number::{compact, counted, escape_markdown};
use super::ranking::worst_first;
use super::read_back::{ReadBackRow, read_back_rows};
use super::results::Results;

/// A run as Markdown: what ran, cases from worst to best with the metrics in `keys`, aggregates, skipped inputs.
#[must_use]
pub fn results_markdown(results: &Results, keys: &[&str]) -> String {
    let mut text = String::from("# Evaluation\n\n");
    let key = &results.key;
    let _ = writeln!(
        text,
        "{} of {}, {} failed, {} not simulable, {} skipped.\n\nrprae {}, {}, {}; `{}`\n",
        counted(results.cases.len(), "case"),
        escape_markdown(&results.dataset),
        results.num_failed(),
        results.not_simulable().count(),
        counted(results.skipped.len(), "input"),
        key.rprae,
        key.engine,
        key.device,
        key.signature
    );
    write_cases(&mut text, results, keys);
    write_read_back(&mut text, results);
    write_not_simulable(&mut text, results);
    write_aggregates(&mut text, results);
    write_remarks(&mut text, results);
    if !results.skipped.is_empty() {
        text.push_str("## Skipped inputs\n\n| id | source | reason |\n|---|---|---|\n");
        for skipped in &results.skipped {
            let [id, source, reason] =
                [&skipped.id, &skipped.source, &skipped.reason].map(|cell| escape_markdown(cell));
            let _ = writeln!(text, "| {id} | {source} | {reason} |");
        }
    }
    text
}

fn write_cases(text: &mut String, results: &Results, keys: &[&str]) {
    let shown: Vec<_> = results.shown_metrics(keys).collect();
    text.push_str("## Cases, worst first\n\n| case | caption | length [s] |");
    for metric in &shown {
        let _ = write!(text, " {} {} |", metric.level, escape_markdown(&metric.title_with_unit()));
    }
    text.push_str(" notes |\n|---|---|---:|");
    text.push_str(&"---:|".repeat(shown.len()));
    text.push_str("---|\n");
    for case in worst_first(results, keys) {
        let (id, caption) = (escape_markdown(&case.id), escape_markdown(case.caption()));
        let _ = write!(text, "| {id} | {caption} | {:.1} |", case.duration_secs);
        for metric in &shown {
            let _ = write!(text, " {} |", cell(case, &metric.key));
        }
        let noted: Vec<String> = notes(case).into_iter().map(|note| escape_markdown(&note.text)).collect();
        let _ = writeln!(text, " {} |", noted.join(", "));
    }
    text.push('\n');
}

fn write_read_back(text: &mut String, results: &Results) {
    let rows: Vec<ReadBackRow<'_>> = read_back_rows(results).collect();
    if rows.is_empty() {
        return;
    }
    text.push_str(
        "## Read back\n\nWhat a model says the motions are, as they were given and as the humanoid performed them with assist.\n\n\
         | case | caption | given | performed |\n|---|---|---|---|\n",
    );
    for row in rows {
        let [id, caption, given, performed] = row.cells().map(escape_markdown);
        let _ = writeln!(text, "| {id} | {caption} | {given} | {performed} |");
    }
    text.push('\n');
}

fn write_not_simulable(text: &mut String, results: &Results) {
    if results.not_simulable().next().is_none() {
        return;
    }
    text.push_str(
        "## Not simulable\n\n\
         Something other than the floor held these bodies; levels 1 to 3 of them enter no mean and no count of falls.\n\n\
         | case | held by | from [s] | to [s] | unexplained by the floor [BW] | explained by the support |\n\
         |---|---|---:|---:|---:|---:|\n",
    );
    for case in results.not_simulable() {
        for held in &case.props {
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} | {:.2} | {} | {:.0} % |",
                escape_markdown(&case.id),
                held.prop.word(),
                held.from_secs,
                held.to_secs,
                compact(held.unexplained_bw),
                100.0 * held.explained
            );
        }
    }
    text.push('\n');
}

fn write_aggregates(text: &mut String, results: &Results) {
    text.push_str(
        "## Over all cases\n\n\
         n counts the cases with a value. The interval of the mean is a 95 % bootstrap over cases.\n\n\
         | metric | better | n | median | quartiles | min to max | mean | interval |\n\
         |---|---|---:|---:|---:|---:|---:|---:|\n",
    );
    for aggregate in &results.aggregates {
        let Some(metric) = results.metric(&aggregate.key) else { continue };
        let title = escape_markdown(&metric.title_with_unit());
        let _ = writeln!(
            text,
            "| {} {title} | {} | {} | {} | {} to {} | {} to {} | {} | {} |",
            metric.level,
            metric.better.word(),
            count(aggregate),
            compact(aggregate.median),
            compact(aggregate.lower_quartile),
            compact(aggregate.upper_quartile),
            compact(aggregate.min),
            compact(aggregate.max),
            compact(aggregate.mean),
            interval(aggregate),
        );
    }
    text.push('\n');
}

fn write_remarks(text: &mut String, results: &Results) {
    let rows: Vec<String> = results
        .cases
        .iter()
        .flat_map(|case| remarks(case).into_iter().map(|(when, what)| (&case.id, when, what)))
        .map(|(id, when, what)| {
            format!("| {} | {} | {} |\n", escape_markdown(id), escape_markdown(&when), escape_markdown(&what))
        })
        .collect();
    if !rows.is_empty() {
        text.push_str("## Events and warnings\n\n| case | when | what |\n|---|---|---|\n");
        text.extend(rows);
        text.push('\n');
    }
}

/// Number of cases with a value, and of how many where some have none.
pub(super) fn count(aggregate: &Aggregate) -> String {
    match aggregate.num_without {
        0 => aggregate.num_cases.to_string(),
        without => format!("{} of {}", aggregate.num_cases, aggregate.num_cases + without),
    }
}

/// Interval of the mean, or a dash.
pub(super) fn interval(aggregate: &Aggregate) -> String {
    aggregate
        .mean_interval
        .map_or_else(|| "-".to_owned(), |ends| format!("{} to {}", compact(ends.low), compact(ends.high)))
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::super::results::samples::results;
    use super::*;
    use crate::manifest::SkippedInput;

    #[test]
    fn every_row_has_as_many_cells_as_its_heading() {
        let mut walk = case("walk|x", &[("l0/skate", 1.5), ("l2/mpjpe", 20.0)]);
        walk.captions = vec!["a | b\nc".to_owned()];
        let mut all = results(vec![walk, case("bow", &[("l0/skate", 1.0)])]);
        all.cases[0].levels[0].read_back = Some("a person | bows".to_owned());
        all.skipped.push(SkippedInput {
            id: "old".to_owned(),
            source: "old_mmm.xml".to_owned(),
            reason: "37 joints".to_owned(),
        });
        let text = results_markdown(&all, &["l0/skate", "l2/mpjpe"]);
        let cells = |line: &str| line.replace("\\|", "").matches('|').count();
        let mut previous: Option<usize> = None;
        for line in text.lines() {
            let now = line.starts_with('|').then(|| cells(line));
            if let (Some(before), Some(now)) = (previous, now) {
                assert_eq!(before, now, "{line}");
            }
            previous = now;
        }
        assert!(text.contains("| 1 of 2 |"), "{text}");
        assert!(text.contains("37 joints"));
        assert!(text.contains("| bow | a person does bow | a person \\| bows | - |"), "{text}");
    }
}
