//! `rprae metrics`: what the numbers mean.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;

use super::exit::{Exit, Failure, Inputs, OrExit};
use super::output;
use super::summary::BUNDLED;
use crate::dataset::{Dataset, OpenOptions};
use crate::harness::LANGUAGE_METRICS;
use crate::humanoid::Humanoid;
use crate::plausibility::{METRICS, ROSETTA, Score, explain, find_metric, kinematic_scores};
use crate::report::{Align, Column, Table, compact};

#[derive(Debug, Args)]
pub(super) struct MetricsArgs {
    /// Metrics to explain by key; all are listed when none is given
    #[arg(value_name = "KEY")]
    pub keys: Vec<String>,
    /// Explain every metric
    #[arg(long)]
    pub explain: bool,
    /// Print everything that calls itself penetration, float or skating side by side, for the motions of this path
    /// (bundled for the suite); per-frame values hold at the motion's own rate
    #[arg(long, value_name = "PATH", conflicts_with_all = ["keys", "explain"])]
    pub rosetta: Option<PathBuf>,
}

pub(super) fn run(args: &MetricsArgs) -> Result<Exit, Failure> {
    if let Some(path) = &args.rosetta {
        return rosetta(path);
    }
    let all = || METRICS.iter().chain(LANGUAGE_METRICS).copied();
    let chosen: Vec<_> = if args.keys.is_empty() {
        all().collect()
    } else {
        args.keys
            .iter()
            .map(|key| all().find(|metric| metric.key == key).ok_or_else(|| unknown(key)))
            .collect::<Result<_, _>>()
            .or_usage()?
    };
    let text = if args.keys.is_empty() && !args.explain {
        let column = |heading: &str, cells: Vec<String>| Column {
            heading: vec![heading.to_owned()],
            align: Align::Left,
            min_width: None,
            cells,
        };
        let cells = |value: fn(&crate::plausibility::Metric) -> &str| {
            chosen.iter().map(|metric| value(metric).to_owned()).collect()
        };
        let table = Table {
            columns: vec![
                column("key", cells(|metric| metric.key)),
                column("title", cells(|metric| metric.title)),
                column("unit", cells(|metric| metric.unit)),
                column("better", cells(|metric| metric.better.word())),
            ],
        };
        table.render(output::table_width())
    } else {
        let explained: Vec<String> = chosen.iter().map(|metric| explain(metric) + "\n").collect();
        explained.join("\n")
    };
    output::print(&text).or_failed()?;
    Ok(Exit::Clean)
}

/// Prints one table a name, a row a motion.
fn rosetta(path: &Path) -> Result<Exit, Failure> {
    let dataset = if path == Path::new(BUNDLED) {
        Dataset::bundled()
    } else {
        Dataset::open(path, &OpenOptions::default()).or_usage()?
    };
    let mut rows = Vec::new();
    let mut skipped = dataset.skipped().len();
    for entry in dataset.entries() {
        match dataset.load(entry) {
            Ok(sample) => {
                let humanoid = Humanoid::new(sample.motion.body()).or_failed()?;
                rows.push((sample.id, kinematic_scores(&humanoid, &sample.motion)));
            }
            Err(input) => {
                eprintln!("skipped {input}");
                skipped += 1;
            }
        }
    }
    for (name, keys) in ROSETTA {
        let mut columns = vec![Column {
            heading: vec![(*name).to_owned(), String::new(), String::new()],
            align: Align::Left,
            min_width: None,
            cells: rows.iter().map(|(id, _)| id.clone()).collect(),
        }];
        for metric in keys.iter().filter_map(|key| find_metric(key)) {
            let value = |scores: &[Score]| {
                let found = scores.iter().find(|score| score.metric.key == metric.key);
                found.map_or_else(|| "-".to_owned(), |score| compact(score.value))
            };
            let (above, below) = metric.title.rsplit_once(' ').unwrap_or(("", metric.title));
            columns.push(Column {
                heading: [above, below, metric.unit].map(str::to_owned).to_vec(),
                align: Align::Right,
                min_width: None,
                cells: rows.iter().map(|(_, scores)| value(scores)).collect(),
            });
        }
        let table = Table { columns }.render(output::table_width());
        output::print(&format!("{table}\n")).or_failed()?;
    }
    Ok(Inputs { used: rows.len(), skipped }.exit())
}

fn unknown(key: &str) -> anyhow::Error {
    // The nearest name is one with the same last part, at whatever level.
    let name = key.rsplit('/').next().unwrap_or(key);
    let near: Vec<&str> = METRICS
        .iter()
        .chain(LANGUAGE_METRICS)
        .map(|metric| metric.key)
        .filter(|known| !name.is_empty() && known.contains(name))
        .collect();
    match near.as_slice() {
        [] => anyhow!("find the metric {key:?}: `rprae metrics` lists all keys"),
        near => anyhow!("find the metric {key:?}: did you mean {}?", near.join(" or ")),
    }
}
