//! `rprae train`.

mod display;
mod held_out;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Args, ValueEnum};

use self::display::{Display, told};
use super::exit::{Exit, Failure, OrExit};
use super::{number, output};
use crate::evaluation::{Bleu, Corpus, Segment};
use crate::features::{MirrorCount, PreparedSet};
use crate::manifest::{VERSION, write_file};
use crate::model::{self, DeviceChoice, Rprae};
use crate::training::{
    self, BUNDLE, Begin, Event, Line, METRICS_FILE, Plan, Preset, RunFacts, RunFolder, RunSettings, Trained,
    TrainingError, Validation, Written,
};

/// Arguments of a training run. What is not given comes from `--config`, and from the preset where that is silent.
#[derive(Debug, Default, Args)]
pub(super) struct TrainArgs {
    /// Settings file (TOML); the settings.toml of a run repeats it. Flags override it, unknown keys are refused
    #[arg(long, value_name = "TOML")]
    pub config: Option<PathBuf>,
    /// Folder that rprae prepare made
    #[arg(long, value_name = "DIR")]
    pub prepared: Option<PathBuf>,
    /// Run folder
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Go on from the last checkpoint in --out; the result is the same, to the last bit, as without the stop
    #[arg(long, conflicts_with = "overwrite")]
    pub resume: bool,
    /// Replace the run that --out holds
    #[arg(long)]
    pub overwrite: bool,
    /// What computes [default: auto]
    #[arg(long, value_enum)]
    pub device: Option<Device>,
    /// Sizes of the model [default: paper]
    #[arg(long, value_enum)]
    pub preset: Option<Size>,
    /// Seed of the first weights and of the order of the data [default: 1]
    #[arg(long, value_name = "N", value_parser = number::seed)]
    pub seed: Option<u64>,
    /// Iterations of stage 1, instead of its 200 epochs
    #[arg(long, value_name = "N", value_parser = number::whole)]
    pub stage1_iterations: Option<usize>,
    /// Iterations of stage 2, instead of its 400 epochs
    #[arg(long, value_name = "N", value_parser = number::whole)]
    pub stage2_iterations: Option<usize>,
    /// Iterations between looks at the validation pairs [default: 500]
    #[arg(long, value_name = "N", value_parser = number::whole)]
    pub validate_every: Option<usize>,
    /// Iterations between checkpoints [default: 500]
    #[arg(long, value_name = "N", value_parser = number::count)]
    pub checkpoint_every: Option<usize>,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// What computes.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Device {
    /// A graphics processor where there is one, else the processor
    Auto,
    /// The adapter wgpu prefers, even one that is software
    Wgpu,
    /// The processor
    Cpu,
}

impl From<Device> for DeviceChoice {
    fn from(device: Device) -> Self {
        match device {
            Device::Auto => Self::Auto,
            Device::Wgpu => Self::Wgpu,
            Device::Cpu => Self::Cpu,
        }
    }
}

/// Sizes of the model.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Size {
    /// 15.8 million trained numbers, as in the paper
    Paper,
    /// For a processor: about a fortieth of the arithmetic
    Compact,
}

impl From<Size> for Preset {
    fn from(size: Size) -> Self {
        match size {
            Size::Paper => Self::Paper,
            Size::Compact => Self::Compact,
        }
    }
}

/// Trains a model and prints where it is.
pub(super) fn run(args: &TrainArgs) -> Result<Exit, Failure> {
    let settings = settings(args)?;
    settings.check().or_usage()?;
    let set = PreparedSet::load(&settings.prepared).or_usage()?;
    let plan = Plan::new(&settings.training, &set);
    training::check(&set, plan).map_err(failure)?;
    if set.validation.is_empty() && args.validate_every.is_some_and(|every| every > 0) {
        return Err(anyhow!(
            "use --validate-every: {} has no validation pairs; prepare it with some, or leave out the option",
            settings.prepared.display()
        ))
        .or_usage();
    }
    let selected = model::select(settings.device).or_usage()?;
    let untrained = Rprae::new(&settings.model, &set.vocabulary, settings.seed, &selected.device);
    let parameters = model::num_parameters(&untrained);
    let facts = RunFacts {
        rprae: VERSION.to_owned(),
        data: set.fingerprint.clone(),
        device: selected.name.clone(),
        parameters: parameters.into_iter().map(|(part, count)| (part.to_owned(), count)).collect(),
        mirrored: settings.training.mirror.then(|| MirrorCount::of(&set)),
    };
    drop(untrained);
    let begin = match (args.resume, args.overwrite) {
        (true, _) => Begin::Resume,
        (_, true) => Begin::Overwrite,
        _ => Begin::New,
    };
    let folder = RunFolder::open(&args.out, &settings, &facts, begin).map_err(failure)?;
    let mut display = Display::new(args.quiet);
    if let Some(note) = &selected.note {
        display.line(note);
    }
    let total: usize = facts.parameters.iter().map(|(_, count)| count).sum();
    display.line(&format!("{total} trained numbers on {}", facts.device));
    if set.validation.is_empty() {
        display.line("there are no validation pairs, so nothing is validated, and the model is that of the last iteration");
    }

    let metrics = args.out.join(METRICS_FILE);
    let curves = args.out.join("curves.svg");
    let outcome = training::train(&set, &settings, &selected.device, &folder, Some(&bleu), &mut |event| {
        if let Event::Validated(_) = &event {
            // A picture that cannot be drawn must not stop hours of work; the last one, below, must be.
            let _ = draw(&metrics, &curves, plan);
        }
        display.observe(&event);
    });
    display.finish();
    let trained = outcome.map_err(failure)?;
    draw(&metrics, &curves, plan).map_err(failure)?;
    let best = training::read_metrics(&metrics).map_err(failure)?.into_iter().find_map(|line| match line {
        Line::Validation(found) if found.iteration == trained.iteration => Some(found),
        _ => None,
    });
    let model = trained.bundle(&settings, &set);
    let scores = held_out::scores(&set.renormalized(&model.normalizer), &model);
    let card = training::card(&settings, &set, &facts, &trained, best.as_ref(), &scores);
    let bundle = args.out.join(BUNDLE);
    model.save(&bundle, &card).or_failed()?;
    output::print(&summary(&trained, best.as_ref(), &bundle, &curves)).or_failed()?;
    Ok(Exit::Clean)
}

/// Corpus BLEU-4 of captions against all the captions of their motions, 0 to 1.
fn bleu(written: Vec<Written>) -> Option<f64> {
    let segments = written
        .into_iter()
        .map(|Written { id, hypothesis, references }| Segment { id, hypothesis, references })
        .collect();
    let corpus = Corpus::new(segments).ok()?;
    Some(Bleu::PAPER.measure(&corpus)[3].score())
}

/// Defaults, then the preset, then the file, then flags; a resumed run without a file has its own settings.
fn settings(args: &TrainArgs) -> Result<RunSettings, Failure> {
    let preset = args.preset.map(Preset::from);
    let mut settings = match &args.config {
        Some(path) => RunSettings::read(path, preset).or_usage()?,
        None => match RunFolder::settings(&args.out).map_err(failure)? {
            None if args.resume => {
                return Err(failure(TrainingError::NothingToResume { folder: args.out.clone() }));
            }
            Some(settings) if args.resume && preset.is_none_or(|preset| preset == settings.preset) => {
                settings
            }
            _ => RunSettings::of(preset.unwrap_or(Preset::Paper)),
        },
    };
    if let Some(prepared) = &args.prepared {
        settings.prepared.clone_from(prepared);
    }
    if settings.prepared.as_os_str().is_empty() {
        return Err(anyhow!("find the data: give --prepared DIR; `rprae prepare` makes such a folder"))
            .or_usage();
    }
    settings.device = args.device.map_or(settings.device, DeviceChoice::from);
    settings.seed = args.seed.unwrap_or(settings.seed);
    let training = &mut settings.training;
    training.stage1_iterations = args.stage1_iterations.or(training.stage1_iterations);
    training.stage2_iterations = args.stage2_iterations.or(training.stage2_iterations);
    training.validate_every = args.validate_every.unwrap_or(training.validate_every);
    training.checkpoint_every = args.checkpoint_every.unwrap_or(training.checkpoint_every);
    Ok(settings)
}

fn failure(error: TrainingError) -> Failure {
    let exit = if error.is_usage() { Exit::Usage } else { Exit::Failed };
    Failure { exit, error: error.into() }
}

fn draw(metrics: &Path, curves: &Path, plan: Plan) -> Result<(), TrainingError> {
    let lines = training::read_metrics(metrics)?;
    write_file(curves, training::curves(&lines, plan.stage1).as_bytes()).map_err(TrainingError::Write)
}

fn summary(trained: &Trained, best: Option<&Validation>, bundle: &Path, curves: &Path) -> String {
    let mut text = format!(
        "trained for {} iterations; the model is that of iteration {}\n",
        trained.done, trained.iteration
    );
    if let Some(found) = best {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "validation: {}", told(found));
    }
    let _ = writeln!(text, "model   {}\ncurves  {}", bundle.display(), curves.display());
    text
}
