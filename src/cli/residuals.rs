//! `rprae residuals`: the table of level 1 over many motions, with reasons for the worst.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::output;
use crate::manifest::write_file;
use crate::report::{CaseResult, MetricRecord, Results, compact, counted};

/// Metrics of the distribution.
const KEYS: [&str; 9] = [
    "l1/residual_force",
    "l1/residual_force_p95",
    "l1/residual_force_gated",
    "l1/residual_force_edges",
    "l1/residual_moment",
    "l1/torque_peak",
    "l1/power_peak",
    "l1/hicks_pass",
    "l1/opensim_grade",
];
/// Shares of the distribution.
const QUANTILES: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 0.9];
const NUM_WORST: usize = 10;

#[derive(Debug, Args)]
pub(super) struct ResidualsArgs {
    /// Run folder or results.json with levels 0 and 1
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// File to write, with its folders; standard output when absent
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Replace the file that is there
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}

/// What a run without level 1 lacks.
fn check_levels(results: &Results, run: &Path) -> anyhow::Result<()> {
    if results.cases.iter().any(|case| KEYS.iter().any(|key| case.score(key).is_some())) {
        return Ok(());
    }
    bail!(
        "find what inverse dynamics cannot explain in {}: no case has scores of level 1; run the motions again with --levels L0,L1",
        run.display()
    )
}

pub(super) fn run(args: &ResidualsArgs) -> Result<Exit, Failure> {
    if let Some(path) = &args.out {
        output::check_free(path, args.overwrite).or_usage()?;
    }
    let results = Results::read(&args.run).or_usage()?;
    check_levels(&results, &args.run).or_usage()?;
    let text = text(&results);
    match &args.out {
        Some(path) => write_file(path, text.as_bytes()).or_failed()?,
        None => output::print(&text).or_failed()?,
    }
    Ok(Exit::Clean)
}

fn text(results: &Results) -> String {
    let held = results.not_simulable().count();
    let mut text = format!(
        "# Residual of inverse dynamics\n\n{} of {}, {held} of them not simulable and left out here, {} failed, {} skipped.\n\n\
         | metric | n | min | 10 % | 25 % | median | 75 % | 90 % | max |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|\n",
        counted(results.cases.len(), "motion"),
        results.dataset,
        results.num_failed(),
        results.skipped.len(),
    );
    let simulable: Vec<&CaseResult> = results.cases.iter().filter(|case| case.simulable()).collect();
    for key in KEYS {
        let mut values: Vec<f64> = simulable.iter().filter_map(|case| case.score(key)).collect();
        values.sort_by(f64::total_cmp);
        let (Some(min), Some(max)) = (values.first(), values.last()) else { continue };
        let unit = results.metric(key).map_or_else(String::new, MetricRecord::title_with_unit);
        let cells: Vec<String> = QUANTILES.map(|share| compact(quantile(&values, share))).to_vec();
        let _ = writeln!(
            text,
            "| {unit} | {} | {} | {} | {} |",
            values.len(),
            compact(*min),
            cells.join(" | "),
            compact(*max)
        );
    }
    let mut worst: Vec<(f64, &CaseResult)> =
        simulable.iter().filter_map(|case| Some((case.score("l1/residual_force")?, *case))).collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.id.cmp(&b.1.id)));
    text.push_str("\n## The worst, and what the other scores say of them\n\n| motion | length [s] | residual [% BW] | reasons |\n|---|---:|---:|---|\n");
    for (force, case) in worst.into_iter().take(NUM_WORST) {
        let _ = writeln!(
            text,
            "| {} | {:.1} | {} | {} |",
            case.id,
            case.duration_secs,
            compact(force),
            reasons(case)
        );
    }
    if held > 0 {
        text.push_str("\n## Not simulable\n\n| motion | residual [% BW] | held by |\n|---|---:|---|\n");
        for case in results.not_simulable() {
            let force = case.score("l1/residual_force").map_or_else(|| "-".to_owned(), compact);
            let props = case
                .props
                .iter()
                .map(|held| format!("{} {:.1}-{:.1} s", held.prop.word(), held.from_secs, held.to_secs));
            let _ = writeln!(text, "| {} | {force} | {} |", case.id, props.collect::<Vec<_>>().join(", "));
        }
    }
    text
}

/// Value below which a share of the sorted, non-empty values lies, linear between neighbours.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let position = share * (sorted.len() - 1) as f64;
    let (below, above) = (position.floor() as usize, position.ceil() as usize);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

/// What other scores of a motion say about its residual, the plainest first.
fn reasons(case: &CaseResult) -> String {
    let score = |key: &str| case.score(key).unwrap_or(0.0);
    let mut reasons = Vec::new();
    let (flight, error) = (score("l1/flight_share"), score("l1/flight_error"));
    if flight > 0.02 && error > 2.0 {
        reasons.push(format!(
            "no sole below 35 mm in {:.0} % of the frames, yet no free fall ({} m/s^2 off)",
            100.0 * flight,
            compact(error)
        ));
    }
    if score("l0/zmp_outside") > 0.02 {
        reasons
            .push(format!("zero-moment point outside the feet in {:.0} %", 100.0 * score("l0/zmp_outside")));
    }
    if score("l0/joint_speed_limit_share") > 0.0 {
        reasons.push(format!(
            "joints faster than people in {:.2} %",
            100.0 * score("l0/joint_speed_limit_share")
        ));
    }
    if score("l0/root_speed_peak") > 12.5 {
        reasons.push(format!("root at {} m/s", compact(score("l0/root_speed_peak"))));
    }
    if score("l0/penetration_max") > 50.0 {
        reasons.push(format!("{} mm below the floor", compact(score("l0/penetration_max"))));
    }
    if score("l1/residual_force_gated") > 2.0 * score("l1/residual_force") {
        reasons.push("feet slide under load".to_owned());
    }
    if reasons.is_empty() { "none of the other scores stands out".to_owned() } else { reasons.join("; ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[0.0, 10.0, 20.0], 0.25), 5.0);
        assert_eq!(quantile(&[7.0], 0.9), 7.0);
    }
}
