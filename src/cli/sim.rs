//! `eval-sim`, which is also `rprae sim`.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;

use super::exit::{Exit, Failure, Inputs, OrExit};
use super::progress::Display;
use super::{language, motions, number, output, resolve, summary};
use crate::dataset::{Dataset, Unstated};
use crate::harness::{self, Generated, RunFolder, RunSettings, Selection, Source};
use crate::simulation::{JointForm, Level};

/// Where runs without `--out` go.
const RESULTS: &str = "results";

/// Arguments of a run. What is not given comes from `--config`, and from the defaults where that is silent.
#[derive(Debug, Default, Args)]
#[expect(clippy::struct_excessive_bools, reason = "switches of a command line")]
pub(super) struct SimArgs {
    /// Motions to run: an MMM XML file, a folder or zip in the KIT-ML layout, a .npy, .npz or .csv table of
    /// frames x 50, or motion capture (.bvh, .amc beside its .asf, joint positions); the bundled suite when absent
    #[arg(long, value_name = "PATH")]
    pub motions: Option<PathBuf>,
    /// Model that makes motions of sentences and reads captions back from motions, as rprae train leaves it; the bundled
    /// one when only --captions is given
    #[arg(long, value_name = "DIR")]
    pub bundle: Option<PathBuf>,
    /// Sentences to make motions of (.txt, .tsv, .jsonl, .json), run beside --motions if those are given; the bundled
    /// sentences when neither is
    #[arg(long, value_name = "FILE")]
    pub captions: Option<PathBuf>,
    /// Motions made of every sentence; the most plausible by levels 0 and 1 is run, and the gain reported [default: 1]
    #[arg(long, value_name = "N", value_parser = number::count)]
    pub n_best: Option<usize>,
    /// Noise on the latent from the second of --n-best on, as a share of its spread over the vocabulary [default: 0.5]
    #[arg(long, value_name = "SHARE")]
    pub noise: Option<f64>,
    /// Length in seconds of motions made [default: what the model predicts]
    #[arg(long, value_name = "SECONDS")]
    pub length: Option<f64>,
    /// Seconds made and left out at the beginning, while the model finds into the movement [default: 0.5]
    #[arg(long, value_name = "SECONDS")]
    pub settle: Option<f64>,
    /// Word vectors for words the model was not trained on
    #[arg(long, value_name = "FILE")]
    pub vectors: Option<PathBuf>,
    /// Folder of a sentence encoder, for the cosine between captions; rprae encoders says how to get one
    #[arg(long, value_name = "DIR")]
    pub sentence_encoder: Option<PathBuf>,
    /// Make no motions and read no captions back, even where a model is bundled
    #[arg(long, conflicts_with_all = ["bundle", "captions", "n_best", "noise", "length", "settle", "vectors", "sentence_encoder"])]
    pub no_language: bool,
    /// Run folder; an unfinished run with the same settings there is continued. Default: results/NAME-NNN, a new one
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Levels to run, comma-separated: L0 kinematic, L1 inverse dynamics, L2 assisted tracking, L3 unassisted
    /// tracking [default: all four]
    #[arg(long, value_name = "LEVELS", value_delimiter = ',', value_parser = resolve::level)]
    pub levels: Option<Vec<Level>>,
    /// Length of a simulation step in seconds, also as a fraction [default: 1/480]; longer is faster and less stable
    #[arg(long, value_name = "SECONDS", value_parser = number::fraction, allow_hyphen_values = true)]
    pub dt: Option<f64>,
    /// Largest assist force at the root at L2, as a share of body weight (0.2) or in percent of it (20%) [default: 0.2]
    #[arg(long, value_name = "SHARE", value_parser = number::share_of_weight, allow_hyphen_values = true)]
    pub assist_limit: Option<f64>,
    /// How joints are represented: balls is fast, multibody ten times slower and the reference [default: balls]
    #[arg(long, value_name = "FORM", value_parser = resolve::joint_form)]
    pub joint_form: Option<JointForm>,
    /// Worker threads [default: one a core]; results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Run at most this many motions, the first by id
    #[arg(long, value_name = "N", value_parser = number::count)]
    pub limit: Option<usize>,
    /// Run only these motions, comma-separated
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub ids: Option<Vec<String>>,
    /// Seed of the bootstrap intervals and of the noise of --n-best, the only randomness of a run [default: 0]
    #[arg(long, value_name = "N", value_parser = number::seed)]
    pub seed: Option<u64>,
    /// Settings file (TOML); the settings.toml of a run repeats it. Flags override it, unknown keys are refused
    #[arg(long, value_name = "TOML")]
    pub config: Option<PathBuf>,
    /// Frames per second of number tables, which do not say it themselves
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Correspondence file (TOML) for motion capture whose joint names are not recognised
    #[arg(long, value_name = "TOML")]
    pub skeleton: Option<PathBuf>,
    /// Body height in metres for number tables, and of the motions made of sentences
    #[arg(long, value_name = "METRES")]
    pub height: Option<f64>,
    /// Body mass in kilograms for all motions [default: what the file says, or 22.5 times the squared height]
    #[arg(long, value_name = "KG")]
    pub mass: Option<f64>,
    /// Do not record the rollouts as MCAP files
    #[arg(long)]
    pub no_recordings: bool,
    /// Replace the run that --out holds
    #[arg(long, requires = "out")]
    pub overwrite: bool,
    /// Print nothing but errors, and what was skipped or failed
    #[arg(long, short)]
    pub quiet: bool,
}

/// Runs the suite and prints what came out.
pub(super) fn run(args: &SimArgs) -> Result<Exit, Failure> {
    let mut settings = resolve::settings(args).or_usage()?;
    language::resolve(args, &mut settings).or_usage()?;
    let dataset = settings.has_references().then(|| resolve::dataset(&settings)).transpose().or_usage()?;
    check_hints(args, &settings, dataset.as_ref()).or_usage()?;
    let name = name(&settings);
    let references = dataset.as_ref().map(|dataset| (name.as_str(), dataset));
    let references: Option<&dyn Source> = references.as_ref().map(|source| source as &dyn Source);
    // Sentences that cannot be read, or a model, stop the run before any work.
    let loaded = language::load(args, &mut settings, dataset.as_ref()).or_usage()?;
    let (model, sentences) = loaded.map_or((None, None), |(model, sentences)| (Some(model), sentences));
    let made = model
        .as_ref()
        .zip(sentences)
        .map(|(model, sentences)| Generated::new(references, sentences, name.clone(), model, &settings));
    let Some(source) = made.as_ref().map(|made| made as &dyn Source).or(references) else {
        // Without sentences there are references.
        return Err(anyhow!("find motions: give --motions or --captions")).or_usage();
    };
    let selection = Selection::of(source, &settings.ids, settings.limit).or_usage()?;
    prove_physics(args, &settings)?;
    let folder = open_folder(args, &settings, &name)?;

    let threads = threads(args.threads);
    let display = Display::new(args.quiet);
    let observe = |progress: harness::Progress<'_>| display.observe(progress);
    let run = harness::run(source, &selection, &settings, model.as_ref(), &folder, threads, &observe);
    display.finish();
    let run = run.or_failed()?;
    let keys = language::key_metrics(&run.results);
    harness::publish(&run, &folder, &keys).or_failed()?;
    if !args.quiet {
        output::print(&summary::text(&run, &keys, folder.path(), output::table_width())).or_failed()?;
    }
    let failed = if run.results.num_failed() > 0 { Exit::Failed } else { Exit::Clean };
    let inputs = Inputs { used: run.results.cases.len(), skipped: run.results.skipped.len() };
    Ok(failed.or_worse(inputs.exit()))
}

/// Refuses options about motions that say nothing new of any motion of this run.
fn check_hints(args: &SimArgs, settings: &RunSettings, dataset: Option<&Dataset>) -> anyhow::Result<()> {
    let hints = [
        ("--rate", args.rate.is_some(), Unstated::Rate),
        // Motions made of sentences are of a body, too.
        ("--height", args.height.is_some() && !settings.has_generated(), Unstated::Height),
        ("--skeleton", args.skeleton.is_some(), Unstated::Skeleton),
    ];
    motions::check_hints(&hints, &Vec::from_iter(dataset))
}

/// Name of a run, for tables and folders: that of its motions, else of its sentences.
fn name(settings: &RunSettings) -> String {
    let captions = settings.language.as_ref().and_then(|language| language.captions.as_deref());
    let path = settings.motions.as_deref().or(captions);
    path.map_or_else(|| summary::BUNDLED.to_owned(), short_name)
}

/// Nothing is scored by an engine that fails its self-test.
pub(super) fn prove_physics(args: &SimArgs, settings: &RunSettings) -> Result<(), Failure> {
    if !settings.levels.iter().any(|level| matches!(level, Level::L2 | Level::L3)) {
        return Ok(());
    }
    let proof = harness::prove(&settings.simulation, harness::cache_folder().as_deref()).or_failed()?;
    if let Some(check) = proof.failed().next() {
        return Err(anyhow!(
            "prove the physics engine, so nothing was run; `rprae doctor` shows all checks: {check}"
        ))
        .or_failed();
    }
    if !args.quiet {
        eprintln!("{}", proof.line());
    }
    Ok(())
}

/// Worker threads: as many as asked for, else one a core.
pub(super) fn threads(wanted: Option<u16>) -> usize {
    wanted.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from)
}

fn open_folder(args: &SimArgs, settings: &RunSettings, name: &str) -> Result<RunFolder, Failure> {
    use crate::harness::FolderError;

    let folder = match &args.out {
        Some(path) => RunFolder::open(path, settings, name, args.overwrite),
        None => RunFolder::create_next(Path::new(RESULTS), name, settings, name),
    };
    match folder {
        Err(error @ FolderError::Io(_)) => Err(error).or_failed(),
        other => other.or_usage(),
    }
}

/// A name for tables and folders: the last part of a path without its extension.
pub(super) fn short_name(path: &Path) -> String {
    path.file_stem().map_or_else(|| "motions".to_owned(), |stem| stem.to_string_lossy().into_owned())
}
