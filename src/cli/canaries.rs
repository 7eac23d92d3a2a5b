//! `rprae canaries`: do the metrics see what they are meant to see, and nothing else?

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::path::PathBuf;

use anyhow::{Context, anyhow};
use clap::Args;
use indicatif::ProgressBar;

use super::exit::{Exit, Failure, Inputs, OrExit};
use super::{number, output, sim, summary};
use crate::canaries::{self, Clip, Fault, Kind, Report, Verdict};
use crate::dataset::{Dataset, OpenOptions};
use crate::harness::Selection;
use crate::manifest::write_file;
use crate::plausibility::METRICS;
use crate::report::{Align, Column, Table, counted};
use crate::simulation::{Level, SimulationSettings};

/// Ids of the bundled suite from which on motions are impossible on purpose.
const FIRST_IMPOSSIBLE: &str = "909";

#[derive(Debug, Args)]
pub(super) struct CanariesArgs {
    /// Clean motions to put faults into: a file, folder or zip [default: the possible motions of the bundled suite]
    #[arg(long, value_name = "PATH")]
    pub motions: Option<PathBuf>,
    /// Use only these motions, comma-separated
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub ids: Vec<String>,
    /// Leave out level 2, which takes most of the time
    #[arg(long)]
    pub no_rollouts: bool,
    /// Seed of the jitter
    #[arg(long, value_name = "N", value_parser = number::seed, default_value_t = 0)]
    pub seed: u64,
    /// Also write the whole matrix as JSON; replaces the file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Print every metric, not only those that something is required of
    #[arg(long)]
    pub all: bool,
}

pub(super) fn run(args: &CanariesArgs) -> Result<Exit, Failure> {
    let dataset = match &args.motions {
        Some(path) => Dataset::open(path, &OpenOptions::default()).or_usage()?,
        None => Dataset::bundled(),
    };
    let bundled = args.motions.is_none();
    let name = args.motions.as_deref().map_or_else(|| summary::BUNDLED.to_owned(), sim::short_name);
    let selection = Selection::of(&(name.as_str(), &dataset), &args.ids, None).or_usage()?;
    for input in selection.skipped() {
        eprintln!("skipped {input}");
    }
    let (mut clips, mut skipped) = (Vec::new(), selection.skipped().len());
    for entry in selection.indices().map(|index| &dataset.entries()[index]) {
        if bundled && entry.id.starts_with(FIRST_IMPOSSIBLE) {
            continue;
        }
        match dataset.load(entry) {
            Ok(sample) => clips.push(Clip { id: sample.id, motion: sample.motion }),
            Err(input) => {
                eprintln!("skipped {input}");
                skipped += 1;
            }
        }
    }
    if clips.is_empty() {
        return Err(anyhow!("find a clean motion: none was selected or could be read")).or_usage();
    }
    let settings = SimulationSettings::default();
    let rollouts = (!args.no_rollouts).then_some(&settings);
    let watched = std::io::stderr().is_terminal();
    let bar = if watched { ProgressBar::new(clips.len() as u64) } else { ProgressBar::hidden() };
    bar.tick();
    let observe = |id: &str| {
        bar.inc(1);
        if !watched {
            eprintln!("[{}/{}] {id}", bar.position(), clips.len());
        }
    };
    let report = canaries::run(&clips, rollouts, args.seed, &observe).or_failed()?;
    bar.finish_and_clear();
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&report).context("write the matrix").or_failed()?;
        write_file(path, (text + "\n").as_bytes()).or_failed()?;
    }
    output::print(&text(&report, args.all)).or_failed()?;
    let failed = if report.passed() { Exit::Clean } else { Exit::Failed };
    Ok(failed.or_worse(Inputs { used: clips.len(), skipped }.exit()))
}

fn text(report: &Report, all: bool) -> String {
    let mut text = format!(
        "{}, {} of them of locomotion; area under the ROC curve over windows of {} s (level 2: over motions),\n\
         then the share of motions whose mean grew. + required response, . required silence, ! requirement not met.\n\n",
        counted(report.clips.len(), "clean motion"),
        report.locomotion.len(),
        report.window_secs
    );
    text.push_str(&matrix(report, all).render(output::table_width()));
    let missed: Vec<&Verdict> = report.verdicts.iter().filter(|verdict| !verdict.holds).collect();
    let _ = writeln!(text, "\n{}, {} not met", counted(report.verdicts.len(), "requirement"), missed.len());
    for verdict in missed {
        let wanted = match verdict.requirement.kind {
            Kind::Larger { least } => format!("area and pairs >= {least}"),
            Kind::Smaller { least } => format!("area and pairs <= {:.2}", 1.0 - least),
            Kind::Silent { most } => format!("area within {most} of 0.5"),
        };
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let _ = writeln!(
            text,
            "  {} on {}: area {}, pairs {}; required: {wanted}",
            verdict.requirement.metric,
            verdict.requirement.fault.name(),
            number(verdict.area),
            number(verdict.paired)
        );
    }
    text
}

fn matrix(report: &Report, all: bool) -> Table {
    let judged = |key: &str| {
        report.verdicts.iter().any(|verdict| {
            let requirement = &verdict.requirement;
            // The controls are required of every metric; they alone make no row.
            let is_control = matches!(requirement.fault, Fault::Mirror | Fault::TimeReversal);
            requirement.metric == key && (!is_control || !verdict.holds)
        })
    };
    let shown: Vec<&str> = METRICS
        .iter()
        .filter(|metric| {
            metric.level != Level::L3 && report.cells.iter().any(|cell| cell.metric == metric.key)
        })
        .map(|metric| metric.key)
        .filter(|key| all || judged(key))
        .collect();
    let mut columns = vec![Column {
        heading: vec!["metric".to_owned()],
        align: Align::Left,
        min_width: None,
        cells: shown.iter().map(|&key| key.to_owned()).collect(),
    }];
    for fault in Fault::ALL {
        columns.push(Column {
            heading: vec![fault.name().to_owned()],
            align: Align::Right,
            min_width: None,
            cells: shown.iter().map(|key| cell(report, key, fault)).collect(),
        });
    }
    Table { columns }
}

fn cell(report: &Report, key: &str, fault: Fault) -> String {
    let verdict = report
        .verdicts
        .iter()
        .find(|verdict| verdict.requirement.metric == key && verdict.requirement.fault == fault);
    let mark = match verdict {
        Some(Verdict { holds: false, .. }) => "!",
        Some(Verdict { requirement, .. }) if matches!(requirement.kind, Kind::Silent { .. }) => ".",
        Some(_) => "+",
        None => " ",
    };
    match report.cell(key, fault) {
        Some(cell) => format!("{:.2}/{:.2}{mark}", cell.area, cell.paired),
        None => format!("-{mark}"),
    }
}
