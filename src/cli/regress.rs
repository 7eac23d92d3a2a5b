//! `rprae regress`: a run beside an accepted one.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::output;
use crate::manifest::write_file;
use crate::report::regression::{Baseline, BaselineError, compare, comparison_junit, comparison_markdown};
use crate::report::{Results, counted};

#[derive(Debug, Args)]
pub(super) struct RegressArgs {
    /// Run folder, or its results.json
    #[arg(value_name = "RESULTS")]
    pub results: PathBuf,
    /// Accepted values with their tolerances
    #[arg(long, value_name = "FILE")]
    pub baseline: PathBuf,
    /// Accept the run: write its values into the baseline, keeping tolerances set by hand
    #[arg(long)]
    pub update: bool,
    /// Write the comparison as JUnit XML; replaces the file
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the comparison as Markdown; replaces the file
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
}

pub(super) fn run(args: &RegressArgs) -> Result<Exit, Failure> {
    let results = Results::read(&args.results).or_usage()?;
    if args.update {
        return update(args, &results);
    }
    let baseline = Baseline::read(&args.baseline).or_usage()?;
    let comparison = compare(&baseline, &results).or_usage()?;
    let markdown = comparison_markdown(&comparison);
    if let Some(path) = &args.markdown {
        write_file(path, markdown.as_bytes()).or_failed()?;
    }
    if let Some(path) = &args.junit {
        let xml = comparison_junit(&comparison).or_failed()?;
        write_file(path, xml.as_bytes()).or_failed()?;
    }
    output::print(&markdown).or_failed()?;
    Ok(if comparison.is_regression() { Exit::Regressed } else { Exit::Clean })
}

fn update(args: &RegressArgs, results: &Results) -> Result<Exit, Failure> {
    // Only a file that is not there may be missing; one that cannot be read holds tolerances worth saving.
    let previous =
        if args.baseline.exists() { Some(Baseline::read(&args.baseline).or_usage()?) } else { None };
    let comparison = previous.as_ref().and_then(|baseline| compare(baseline, results).ok());
    let accepted = match Baseline::accept(results, previous.as_ref()) {
        Err(error @ BaselineError::FailedCases { .. }) => return Err(error).or_failed(),
        other => other.or_usage()?,
    };
    accepted.write(&args.baseline).or_failed()?;
    let mut text = comparison.as_ref().map(comparison_markdown).unwrap_or_default();
    let _ = writeln!(
        text,
        "\nAccepted {} with {} into {}.",
        counted(accepted.cases.len(), "case"),
        counted(accepted.metrics.len(), "metric"),
        args.baseline.display()
    );
    if let Some(previous) = &previous {
        let lost = previous.cases.keys().filter(|id| !accepted.cases.contains_key(*id)).count();
        if lost > 0 {
            let _ = writeln!(
                text,
                "{lost} of the {} cases accepted before are not in this run and are gone.",
                previous.cases.len()
            );
        }
    }
    output::print(text.trim_start()).or_failed()?;
    Ok(Exit::Clean)
}
