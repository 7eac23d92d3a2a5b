//! What a run prints when it is done.

use std::fmt::Write as _;
use std::path::Path;

use super::output::rprae_command;
use crate::harness::Run;
use crate::report::regression::{Baseline, CaseFate, Comparison, compare};
use crate::report::{Align, Column, Results, Table, compact, counted, results_table, shorten};
use crate::simulation::Level;

/// Name of the bundled suite as a dataset.
pub(super) const BUNDLED: &str = "bundled";

/// Most lines of a list; the files have the rest.
const MAX_LISTED: usize = 10;

/// The cases as a table, the aggregates, what was skipped, where the files are, and what to type next.
pub(super) fn text(run: &Run, keys: &[&str], folder: &Path, width: usize) -> String {
    let results = &run.results;
    let mut text = String::new();
    if !results.cases.is_empty() {
        text.push('\n');
        text.push_str(&results_table(results, keys, width));
        text.push('\n');
        text.push_str(&aggregates(results, keys).render(width));
    }
    push_list(&mut text, "Read back", read_back(results), width);
    push_list(
        &mut text,
        "Failed cases",
        results.cases.iter().flat_map(|case| {
            case.failures.iter().map(|reason| format!("{}: {reason}", case.id)).collect::<Vec<_>>()
        }),
        width,
    );
    push_list(
        &mut text,
        "Not simulable, left out of the means of levels 1 to 3",
        results.not_simulable().map(|case| {
            let held = case
                .props
                .iter()
                .map(|held| format!("{} {:.1}-{:.1} s", held.prop.word(), held.from_secs, held.to_secs));
            format!("{}: held by {}", case.id, held.collect::<Vec<_>>().join(", "))
        }),
        width,
    );
    push_list(&mut text, "Skipped inputs", results.skipped.iter().map(ToString::to_string), width);
    let warnings = results.cases.iter().flat_map(|case| {
        let doubts = case.doubts().map(|(level, doubt)| format!("{}: {level} read back: {doubt}", case.id));
        let warnings = case.warnings.iter().map(|warning| format!("{}: {warning}", case.id));
        warnings.chain(doubts).collect::<Vec<_>>()
    });
    push_list(&mut text, "Warnings", warnings, width);
    push_counts(&mut text, run);
    push_next_steps(&mut text, results, folder);
    text
}

fn aggregates(results: &Results, keys: &[&str]) -> Table {
    let shown: Vec<_> = keys
        .iter()
        .filter_map(|key| results.aggregates.iter().find(|aggregate| aggregate.key == *key))
        .filter_map(|aggregate| Some((aggregate, results.metric(&aggregate.key)?)))
        .collect();
    let column = |heading: &str, align, cells: Vec<String>| Column {
        heading: vec![heading.to_owned()],
        align,
        min_width: None,
        cells,
    };
    let numbers = |heading: &str, value: fn(&crate::report::Aggregate) -> String| {
        column(heading, Align::Right, shown.iter().map(|(aggregate, _)| value(aggregate)).collect())
    };
    let interval = |aggregate: &crate::report::Aggregate| {
        aggregate
            .mean_interval
            .map_or_else(|| "-".to_owned(), |ends| format!("{} to {}", compact(ends.low), compact(ends.high)))
    };
    Table {
        columns: vec![
            column(
                "over all cases",
                Align::Left,
                shown
                    .iter()
                    .map(|(_, metric)| format!("{} {}", metric.level, metric.title_with_unit()))
                    .collect(),
            ),
            numbers("n", |aggregate| aggregate.num_cases.to_string()),
            numbers("without", |aggregate| aggregate.num_without.to_string()),
            numbers("median", |aggregate| compact(aggregate.median)),
            numbers("min", |aggregate| compact(aggregate.min)),
            numbers("max", |aggregate| compact(aggregate.max)),
            numbers("mean", |aggregate| compact(aggregate.mean)),
            numbers("95 % interval", interval),
        ],
    }
}

/// What a model says the motions are, before and after physics.
fn read_back(results: &Results) -> impl Iterator<Item = String> {
    results.cases.iter().filter_map(|case| {
        let given = case.read_back(Level::L0)?;
        let done = case.read_back(Level::L2).map_or(String::new(), |done| format!("; performed: {done:?}"));
        Some(format!("{}: {:?} is read as {given:?}{done}", case.id, case.caption()))
    })
}

fn push_list(text: &mut String, heading: &str, lines: impl Iterator<Item = String>, width: usize) {
    let lines: Vec<String> = lines.collect();
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n{heading} ({}):", lines.len());
    for line in lines.iter().take(MAX_LISTED) {
        let _ = writeln!(text, "  {}", shorten(line, width.saturating_sub(2)));
    }
    if lines.len() > MAX_LISTED {
        let _ = writeln!(text, "  and {} more, all in report.md", lines.len() - MAX_LISTED);
    }
}

fn push_counts(text: &mut String, run: &Run) {
    let (results, timings) = (&run.results, &run.timings);
    let resumed = match run.num_resumed() {
        0 => String::new(),
        count => format!(" ({count} found finished)"),
    };
    let _ = writeln!(
        text,
        "\n{}{resumed}, {} failed, {} skipped; {:.1} s of motion in {:.1} s on {}",
        counted(results.cases.len(), "case"),
        results.num_failed(),
        results.skipped.len(),
        timings.motion_secs,
        timings.total_secs,
        counted(timings.threads, "thread")
    );
    let _ = writeln!(text, "{}: {}", results.key.engine, results.key.signature);
}

fn push_next_steps(text: &mut String, results: &Results, folder: &Path) {
    let path = folder.as_os_str();
    let has_recordings =
        results.cases.iter().flat_map(|case| &case.levels).any(|level| level.recording.is_some());
    let _ = writeln!(text, "\nResults:  {}", folder.display());
    let _ = writeln!(text, "Page:     {}", folder.join("report.html").display());
    if has_recordings {
        let _ = writeln!(text, "Watch:    {}", rprae_command(&["view".as_ref(), path]));
    }
    if results.cases.is_empty() {
        return;
    }
    // The bundled suite comes with a baseline when it is run from the project's folder; it is of no use to a run of other cases
    // or settings, which may become a baseline of their own.
    let bundled = Path::new("results/baseline/bundled.json");
    let comparison = (results.dataset == BUNDLED).then(|| Baseline::read(bundled).ok()).flatten();
    let comparison = comparison.and_then(|baseline| compare(&baseline, results).ok());
    let covers = |comparison: &Comparison| {
        !comparison.cases.iter().any(|(_, fate)| matches!(fate, CaseFate::Missing { .. }))
    };
    let baseline = if comparison.is_some() { bundled } else { Path::new("baseline.json") }.as_os_str();
    if comparison.as_ref().is_none_or(covers) {
        let accept = ["regress".as_ref(), "--baseline".as_ref(), baseline, "--update".as_ref(), path];
        let _ = writeln!(text, "Accept:   {}", rprae_command(&accept));
    }
    let compare = ["regress".as_ref(), "--baseline".as_ref(), baseline, path];
    let _ = writeln!(text, "Compare:  {}", rprae_command(&compare));
}
