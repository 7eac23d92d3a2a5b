//! `rprae lint`: what is wrong with motions, in milliseconds.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;

use super::exit::{Exit, Failure, Inputs, OrExit};
use super::progress::Counter;
use super::{motions, output};
use crate::dataset::{Dataset, OpenOptions, Unstated};
use crate::lint::{CHECKS, Severity, findings_json, findings_junit, findings_text, lint};
use crate::manifest::write_file;

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag")]
pub(super) struct LintArgs {
    /// Motions: a file, a folder, a zip in the KIT-ML layout or a manifest; the bundled suite when absent
    #[arg(value_name = "PATH")]
    pub motions: Option<PathBuf>,
    /// Write the findings as JSON; - writes them to standard output instead of the text; replaces the file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write the findings as JUnit XML, one test a motion; replaces the file
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// End with exit code 1 when there is a warning
    #[arg(long)]
    pub deny_warnings: bool,
    /// Print notes too: what is worth knowing, though nothing is wrong
    #[arg(long)]
    pub notes: bool,
    /// List the checks
    #[arg(long)]
    pub checks: bool,
    /// Frames per second of number tables, which do not say it themselves
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Body height in metres for number tables [default: 1.75]
    #[arg(long, value_name = "METRES")]
    pub height: Option<f64>,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

pub(super) fn run(args: &LintArgs) -> Result<Exit, Failure> {
    if args.checks {
        let lines: Vec<String> =
            CHECKS.iter().map(|check| format!("{:<18}{}\n", check.code, check.looks_for)).collect();
        output::print(&lines.concat()).or_failed()?;
        return Ok(Exit::Clean);
    }
    let defaults = OpenOptions::default();
    let options =
        OpenOptions { rate_hz: args.rate, height_m: args.height.unwrap_or(defaults.height_m), ..defaults };
    let dataset = match &args.motions {
        Some(path) => Dataset::open(path, &options).or_usage()?,
        None => Dataset::bundled(),
    };
    let hints = [
        ("--rate", args.rate.is_some(), Unstated::Rate),
        ("--height", args.height.is_some(), Unstated::Height),
    ];
    motions::check_hints(&hints, &[&dataset]).or_usage()?;
    let (counter, done) = (Counter::new(args.quiet), AtomicUsize::new(0));
    let total = dataset.entries().len();
    let linted = lint(&dataset, &|| counter.show("linting", 1 + done.fetch_add(1, Ordering::Relaxed), total));
    counter.finish();

    let json_to_stdout = args.json.as_deref().is_some_and(|path| path.as_os_str() == "-");
    if let Some(path) = &args.json {
        let json = findings_json(&linted).or_failed()?;
        if json_to_stdout {
            output::print(&json).or_failed()?;
        } else {
            write_file(path, json.as_bytes()).or_failed()?;
        }
    }
    if let Some(path) = &args.junit {
        write_file(path, findings_junit(&linted, args.deny_warnings).or_failed()?.as_bytes()).or_failed()?;
    }
    let least = if args.notes { Severity::Info } else { Severity::Warning };
    if !args.quiet && !json_to_stdout {
        output::print(&findings_text(&linted, least)).or_failed()?;
    }
    let worst = linted.iter().filter_map(crate::lint::Linted::worst).max();
    let denied = args.deny_warnings && worst >= Some(Severity::Warning);
    let refused = linted.iter().filter(|one| one.worst() == Some(Severity::Error)).count();
    let inputs = Inputs { used: linted.len() - refused, skipped: refused };
    Ok(inputs.exit().or_worse(if denied { Exit::Failed } else { Exit::Clean }))
}
