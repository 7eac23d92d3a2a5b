//! `rprae metrics`: what the numbers mean.

use anyhow::anyhow;
use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::output;
use crate::plausibility::{METRICS, explain, find_metric};
use crate::report::{Align, Column, Table};

#[derive(Debug, Args)]
pub(super) struct MetricsArgs {
    /// Metrics to explain by key; all are listed when none is given
    #[arg(value_name = "KEY")]
    pub keys: Vec<String>,
    /// Explain every metric
    #[arg(long)]
    pub explain: bool,
}

pub(super) fn run(args: &MetricsArgs) -> Result<Exit, Failure> {
    let chosen = if args.keys.is_empty() {
        METRICS.to_vec()
    } else {
        args.keys
            .iter()
            .map(|key| find_metric(key).ok_or_else(|| unknown(key)))
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

fn unknown(key: &str) -> anyhow::Error {
    // The nearest name is one with the same last part, at whatever level.
    let name = key.rsplit('/').next().unwrap_or(key);
    let near: Vec<&str> = METRICS
        .iter()
        .map(|metric| metric.key)
        .filter(|known| !name.is_empty() && known.contains(name))
        .collect();
    match near.as_slice() {
        [] => anyhow!("find the metric {key:?}: `rprae metrics` lists all keys"),
        near => anyhow!("find the metric {key:?}: did you mean {}?", near.join(" or ")),
    }
}
