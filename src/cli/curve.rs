//! `rprae curve`: how motions fare as one condition gets harder.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, anyhow};
use clap::Args;

use super::exit::{Exit, Failure, Inputs, OrExit};
use super::sim::SimArgs;
use super::{number, output, resolve, sim, summary};
use crate::harness::{Condition, CurveSettings, Selection, Source, run_curve};
use crate::manifest::write_file;
use crate::simulation::Level;

#[derive(Debug, Args)]
pub(super) struct CurveArgs {
    /// What is made harder: assist (its limit, % of body weight), push (N s), friction, mass (factors), latency (ms);
    /// comma-separated
    #[arg(value_name = "CONDITION", value_delimiter = ',', value_parser = condition, required = true)]
    pub conditions: Vec<Condition>,
    /// Magnitudes instead of the usual ones, comma-separated; for one condition only
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', allow_hyphen_values = true)]
    pub points: Option<Vec<f64>>,
    /// Draws of what is random (a push's time and direction, the pose at the start) for each motion
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub draws: u16,
    /// Without assist: at L3 instead of L2
    #[arg(long)]
    pub unassisted: bool,
    /// Motions to run; the bundled suite when absent
    #[arg(long, value_name = "PATH")]
    pub motions: Option<PathBuf>,
    /// Run only these motions, comma-separated
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub ids: Option<Vec<String>>,
    /// Run at most this many motions, the first by id
    #[arg(long, value_name = "N", value_parser = number::count)]
    pub limit: Option<usize>,
    /// Settings file (TOML), as for rprae sim
    #[arg(long, value_name = "TOML")]
    pub config: Option<PathBuf>,
    /// Seed of everything random [default: 0]
    #[arg(long, value_name = "N", value_parser = number::seed)]
    pub seed: Option<u64>,
    /// Worker threads [default: one a core]; results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Folder for NAME.md, NAME.csv and NAME.svg of every condition; only the table is printed when absent
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace files that --out holds
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}

fn condition(name: &str) -> Result<Condition, String> {
    let found = Condition::ALL.into_iter().find(|condition| condition.name() == name.trim());
    found.ok_or_else(|| "expected some of assist, push, friction, mass, latency".to_owned())
}

/// Runs the curves, prints each as a table and writes its files.
pub(super) fn run(args: &CurveArgs) -> Result<Exit, Failure> {
    if args.points.is_some() && args.conditions.len() > 1 {
        return Err(anyhow!(
            "use --points for {} conditions: it says the magnitudes of one",
            args.conditions.len()
        ))
        .or_usage();
    }
    let sim_args = SimArgs {
        motions: args.motions.clone(),
        ids: args.ids.clone(),
        limit: args.limit,
        config: args.config.clone(),
        seed: args.seed,
        ..SimArgs::default()
    };
    let settings = resolve::settings(&sim_args).or_usage()?;
    let dataset = resolve::dataset(&settings).or_usage()?;
    let name = settings.motions.as_deref().map_or_else(|| summary::BUNDLED.to_owned(), sim::short_name);
    let source: &dyn Source = &(name.as_str(), &dataset);
    let selection = Selection::of(source, &settings.ids, settings.limit).or_usage()?;
    let level = if args.unassisted { Level::L3 } else { Level::L2 };
    let curves: Vec<CurveSettings> = args
        .conditions
        .iter()
        .map(|&condition| CurveSettings {
            condition,
            magnitudes: args.points.clone().unwrap_or_else(|| condition.default_magnitudes().to_vec()),
            num_draws: usize::from(args.draws),
            level,
        })
        .collect();
    for curve in &curves {
        if let Some(magnitude) = curve.bad_magnitude() {
            let name = curve.condition.name();
            return Err(anyhow!("run the {name} curve: {magnitude} is out of range")).or_usage();
        }
        free(args, curve.condition).or_usage()?;
    }
    sim::prove_physics(&sim_args, &settings)?;
    let threads = sim::threads(args.threads);
    let mut exit = Exit::Clean;
    for curve in &curves {
        let done = AtomicUsize::new(0);
        let observe = |id: &str| {
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            eprintln!("[{} {done}] {id}", curve.condition.name());
        };
        let (result, skipped) =
            run_curve(source, &selection, &settings, curve, threads, &observe).or_failed()?;
        for input in &skipped {
            eprintln!("skipped {input}");
        }
        let cases: BTreeSet<&str> = result.rollouts.iter().map(|rollout| rollout.case.as_str()).collect();
        exit = exit.or_worse(Inputs { used: cases.len(), skipped: skipped.len() }.exit());
        if result.rollouts.iter().any(|rollout| rollout.failed) {
            exit = exit.or_worse(Exit::Failed);
        }
        output::print(&format!("{}\n", result.markdown())).or_failed()?;
        if let Some(folder) = &args.out {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("create {}", folder.display()))
                .or_failed()?;
            let texts = [result.markdown(), result.csv(), result.svg()];
            for (path, text) in files(folder, curve.condition).iter().zip(texts) {
                write_file(path, text.as_bytes()).or_failed()?;
            }
        }
    }
    Ok(exit)
}

fn files(folder: &Path, condition: Condition) -> [PathBuf; 3] {
    ["md", "csv", "svg"].map(|extension| folder.join(format!("{}.{extension}", condition.name())))
}

/// Results are never overwritten unless asked.
fn free(args: &CurveArgs, condition: Condition) -> anyhow::Result<()> {
    let files = args.out.iter().flat_map(|folder| files(folder, condition));
    files.into_iter().try_for_each(|path| output::check_free(&path, args.overwrite))
}
