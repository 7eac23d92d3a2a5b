//! `rprae translate`: sentences to motions and motions to sentences.

mod act;
mod describe;
mod lines;
mod perform;
mod plot;
mod use_of;
mod vectors;
mod write;

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;

use self::act::{ActedRecord, Fault};
use self::describe::DescribedRecord;
use self::perform::Stage;
use self::vectors::Vectors;
use self::write::Target;
use super::choose::Choose;
use super::exit::{Exit, Failure, Inputs, OrExit, message};
use super::motions::check_hints;
use super::progress::Steps;
use super::train::Device;
use super::{bundled, number, output};
use crate::dataset::{CaptionFile, Dataset, OpenOptions, Skipped, Unstated};
use crate::motion::{Body, bounds};
use crate::report::counted;
use crate::translation::{Acting, DEFAULT_NOISE, DEFAULT_SETTLE_SECS, Search, TranslationError, Translator};

/// Exponent of the length normalisation.
const DEFAULT_LENGTH_NORM: f64 = 0.7;
/// Rate of the motions written, hertz.
const DEFAULT_OUT_RATE_HZ: f64 = 100.0;

const EXAMPLES: &str = "\
Examples:
  rprae translate \"a person walks forward\" --out walk.xml --out walk.svg
  rprae translate \"a person walks forward\" --round-trip --perform --out walk.mcap
  rprae translate --motions 00001_mmm.xml --n-best 5
  rprae translate --captions sentences.txt --out motions
  rprae translate --motions FOLDER --out written.jsonl
  rprae translate                                        one sentence or file a line";

/// Arguments of a translation.
#[derive(Debug, Default, Args)]
#[command(after_help = EXAMPLES)]
#[expect(clippy::struct_excessive_bools, reason = "switches of a command line")]
pub(super) struct TranslateArgs {
    /// The sentence to make a motion of; - or nothing reads sentences, or names of motion files, from standard input
    #[arg(value_name = "SENTENCE", conflicts_with_all = ["motions", "captions"])]
    pub sentence: Option<String>,
    /// Motions to describe: a file, folder or zip, as eval-sim --motions takes it
    #[arg(long, visible_alias = "motion", value_name = "PATH", conflicts_with = "captions")]
    pub motions: Option<PathBuf>,
    /// File of sentences to make motions of (.txt, .tsv, .jsonl, .json)
    #[arg(long, value_name = "FILE")]
    pub captions: Option<PathBuf>,
    /// Folder of a trained model, as rprae train leaves it [default: the bundled one]
    #[arg(long, value_name = "DIR")]
    pub bundle: Option<PathBuf>,
    /// Where the result goes, by its ending; may be given several times. Of a sentence: .xml (MMM), .npy (frames x 50),
    /// .svg (curves), .mcap (performed in the simulator). Of a file of sentences: a folder, or .jsonl. Of motions: .jsonl
    #[arg(long, value_name = "PATH")]
    pub out: Vec<PathBuf>,
    /// Motions of the sentence, the first as it says and the others varied, or sentences about a motion, best first
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub n_best: u16,
    /// Which of the sentences found about a motion is the best [default: probable]
    #[arg(long, value_enum)]
    pub choose: Option<Choose>,
    /// Sentences followed side by side, or drawn; 1 is greedy [default: 5, and 32 for a consensus]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub beam: Option<u16>,
    /// Sentences are ranked by log p / words^A: 0 favours short ones, 1 long ones [default: 0.7]
    #[arg(long, value_name = "A")]
    pub length_norm: Option<f64>,
    /// Length of the motion in seconds [default: what the model predicts]
    #[arg(long, value_name = "SECONDS")]
    pub length: Option<f64>,
    /// As long as this motion
    #[arg(long, value_name = "PATH", conflicts_with = "length")]
    pub length_of: Option<PathBuf>,
    /// Seconds made and left out at the beginning, while the model finds from the first frame of a training motion into the movement
    /// [default: 0.5]
    #[arg(long, value_name = "SECONDS")]
    pub settle: Option<f64>,
    /// Read every motion made back as a sentence
    #[arg(long)]
    pub round_trip: bool,
    /// Let the humanoid perform every motion made in the simulator (level 2), and read back what it did
    #[arg(long)]
    pub perform: bool,
    /// Word vectors for words the model was not trained on: word2vec .bin, or text as GloVe and fastText have it, also .gz
    #[arg(long, value_name = "FILE")]
    pub vectors: Option<PathBuf>,
    /// Noise on the latent from the second motion of --n-best on, as a share of its spread over the vocabulary [default: 0.5]
    #[arg(long, value_name = "SHARE")]
    pub noise: Option<f64>,
    /// Seed of that noise, and of sentences drawn [default: 0]
    #[arg(long, value_name = "N", value_parser = number::seed)]
    pub seed: Option<u64>,
    /// Frames a second of the motions written and performed; more than the model's follow a smooth curve [default: 100]
    #[arg(long, value_name = "HZ")]
    pub out_rate: Option<f64>,
    /// Body height in metres of motions made, and of number tables read [default: 1.75]
    #[arg(long, value_name = "METRES")]
    pub height: Option<f64>,
    /// Frames per second of number tables read, which do not say it themselves
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// What computes [default: cpu]
    #[arg(long, value_enum)]
    pub device: Option<Device>,
    /// Print one JSON object a translation
    #[arg(long)]
    pub json: bool,
    /// Replace files that are there already, also in a folder
    #[arg(long, requires = "out")]
    pub overwrite: bool,
    /// Print no progress
    #[arg(long, short)]
    pub quiet: bool,
}

/// Everything translations of one call share.
struct Session<'a> {
    args: &'a TranslateArgs,
    translator: Translator,
    acting: Acting,
    search: Search,
    /// Where words the model was not trained on are looked up.
    vectors: Option<Vectors<'a>>,
    /// Where motions are performed, if they are; its physics are proved.
    stage: Option<Stage>,
}

/// Translates what was given and prints it.
pub(super) fn run(args: &TranslateArgs) -> Result<Exit, Failure> {
    check(args).or_usage()?;
    // Inputs and places for outputs are looked at before the model is loaded.
    let captions = args.captions.as_deref().map(CaptionFile::read).transpose().or_usage()?;
    let motions = args.motions.as_deref().map(|path| open(args, path)).transpose().or_usage()?;
    if let Some(dataset) = &motions {
        let hints = [
            ("--rate", args.rate.is_some(), Unstated::Rate),
            ("--height", args.height.is_some(), Unstated::Height),
        ];
        check_hints(&hints, &[dataset]).or_usage()?;
    }
    let length_of = args.length_of.as_deref().map(|path| duration(args, path)).transpose().or_usage()?;
    let targets = write::targets(args).or_usage()?;

    let translator = bundled::load(args.bundle.as_deref(), args.device).or_usage()?;
    let stage = args.performs().then(|| Stage::new(args.quiet)).transpose().or_failed()?;
    let mut session = Session {
        args,
        translator,
        acting: Acting {
            length_secs: args.length.or(length_of),
            settle_secs: args.settle(),
            body: Body::with_default_mass(args.height()),
        },
        search: Search {
            choose: args.choose().into(),
            beam: usize::from(args.beam.unwrap_or(args.choose().default_beam())),
            n_best: usize::from(args.n_best),
            length_exponent: args.length_norm(),
            seed: args.seed.unwrap_or(0),
            most_words: None,
        },
        vectors: args.vectors.as_deref().map(|path| Vectors::new(path, args.quiet)),
        stage,
    };
    match (&args.sentence, captions, motions) {
        (_, Some(file), _) => session.act_all(&file, &targets),
        (_, _, Some(dataset)) => session.describe_all(&dataset, &targets),
        (Some(sentence), ..) if sentence != "-" => session.act_one(sentence, &targets),
        _ => lines::run(&mut session),
    }
}

fn check(args: &TranslateArgs) -> anyhow::Result<()> {
    let within = |name: &str, value: f64, low: f64, high: f64| {
        if (low..=high).contains(&value) {
            Ok(())
        } else {
            Err(anyhow!("use --{name} {value}: expected {low} to {high}"))
        }
    };
    within("length-norm", args.length_norm(), 0.0, 5.0)?;
    if args.choose() != Choose::Probable && args.beam == Some(1) {
        return Err(anyhow!("use --beam 1: a consensus is of two sentences at least"));
    }
    within("noise", args.noise(), 0.0, 100.0)?;
    within("settle", args.settle(), 0.0, 10.0)?;
    within("height", args.height(), *bounds::HEIGHT_M.start(), *bounds::HEIGHT_M.end())?;
    within("out-rate", args.out_rate(), *bounds::RATE_HZ.start(), *bounds::RATE_HZ.end())?;
    use_of::check(args)
}

impl TranslateArgs {
    fn choose(&self) -> Choose {
        self.choose.unwrap_or(Choose::Probable)
    }

    fn length_norm(&self) -> f64 {
        self.length_norm.unwrap_or(DEFAULT_LENGTH_NORM)
    }

    fn noise(&self) -> f64 {
        self.noise.unwrap_or(DEFAULT_NOISE)
    }

    fn settle(&self) -> f64 {
        self.settle.unwrap_or(DEFAULT_SETTLE_SECS)
    }

    fn height(&self) -> f64 {
        self.height.unwrap_or(OpenOptions::default().height_m)
    }

    fn out_rate(&self) -> f64 {
        self.out_rate.unwrap_or(DEFAULT_OUT_RATE_HZ)
    }

    /// Whether there is a sentence on the command line.
    fn has_sentence(&self) -> bool {
        self.sentence.as_ref().is_some_and(|sentence| sentence != "-")
    }

    /// Whether motions are performed: that is asked for, or a recording of it is.
    fn performs(&self) -> bool {
        self.perform || self.out.iter().any(|path| write::is_recording(path))
    }
}

fn open(args: &TranslateArgs, path: &Path) -> anyhow::Result<Dataset> {
    let options = OpenOptions { rate_hz: args.rate, height_m: args.height(), ..OpenOptions::default() };
    Ok(Dataset::open(path, &options)?)
}

/// Duration of the only motion at a path, seconds.
fn duration(args: &TranslateArgs, path: &Path) -> anyhow::Result<f64> {
    let dataset = open(args, path)?;
    let [entry] = dataset.entries() else {
        return Err(anyhow!(
            "take the length of {}: it holds {} motions, expected one",
            path.display(),
            dataset.entries().len()
        ));
    };
    check_hints(&[("--rate", args.rate.is_some(), Unstated::Rate)], &[&dataset])?;
    let sample =
        dataset.load(entry).map_err(|skipped| anyhow!("read {}: {}", path.display(), skipped.reason))?;
    Ok(sample.motion.duration_secs())
}

impl Session<'_> {
    /// Looks up the vectors of words the model was not trained on.
    fn look_up<'c>(&mut self, captions: impl IntoIterator<Item = &'c str>) -> anyhow::Result<()> {
        match &mut self.vectors {
            Some(vectors) => vectors.look_up(&mut self.translator, captions),
            None => Ok(()),
        }
    }

    /// One sentence, given on the command line.
    fn act_one(&mut self, sentence: &str, targets: &[Target]) -> Result<Exit, Failure> {
        self.look_up([sentence]).or_usage()?;
        let acted = self.act(None, sentence).or_usage()?;
        let record = self.finish(acted, targets).or_failed()?;
        write::records(targets, std::slice::from_ref(&record), None).or_failed()?;
        self.print(&record, ActedRecord::text)?;
        Ok(if record.has_failed() { Exit::Failed } else { Exit::Clean })
    }

    /// A file of sentences. One that cannot be translated is skipped; a file that cannot be written ends the work.
    fn act_all(&mut self, file: &CaptionFile, targets: &[Target]) -> Result<Exit, Failure> {
        let texts = || file.records.iter().flat_map(|record| &record.texts).map(String::as_str);
        self.look_up(texts()).or_usage()?;
        for input in &file.skipped {
            eprintln!("skipped {input}");
        }
        let mut skipped = file.skipped.len();
        let source = self.args.captions.clone().unwrap_or_default();
        let steps = Steps::new(self.args.quiet || targets.is_empty(), file.num_captions());
        let mut records = Vec::new();
        for (number, text) in texts().enumerate() {
            let id = format!("{:05}", number + 1);
            let acted = self.act(Some(id.clone()), text).map_err(Fault::sentence);
            match acted.and_then(|acted| self.finish(acted, targets)) {
                Ok(record) => {
                    steps.step(&id, None);
                    if targets.is_empty() {
                        self.print(&record, ActedRecord::text)?;
                    }
                    records.push(record);
                }
                Err(Fault::Sentence(error)) => {
                    let input = Skipped { id, source: source.clone(), reason: message(&error) };
                    steps.step(&input.id, Some(&input.to_string()));
                    skipped += 1;
                }
                Err(fault @ Fault::Write(_)) => return Err(fault).or_failed(),
            }
        }
        steps.finish();
        write::records(targets, &records, Some(&act::manifest(&records))).or_failed()?;
        let inputs = Inputs { used: records.len(), skipped };
        self.print_counts(inputs, "sentence", targets)?;
        let failed = records.iter().any(ActedRecord::has_failed);
        Ok(inputs.exit().or_worse(if failed { Exit::Failed } else { Exit::Clean }))
    }

    /// Motions to be described.
    fn describe_all(&self, dataset: &Dataset, targets: &[Target]) -> Result<Exit, Failure> {
        let steps = Steps::new(self.args.quiet || targets.is_empty(), dataset.entries().len());
        let mut records = Vec::new();
        let inputs = self.describe_each(dataset, &steps, |record| {
            if targets.is_empty() {
                self.print(&record, DescribedRecord::text)?;
            }
            records.push(record);
            Ok(())
        })?;
        steps.finish();
        write::records(targets, &records, None).or_failed()?;
        self.print_counts(inputs, "motion", targets)?;
        Ok(inputs.exit())
    }

    /// Describes one motion of a dataset after the other; those that cannot be are told.
    fn describe_each(
        &self,
        dataset: &Dataset,
        steps: &Steps,
        mut told: impl FnMut(DescribedRecord) -> Result<(), Failure>,
    ) -> Result<Inputs, Failure> {
        for input in dataset.skipped() {
            eprintln!("skipped {input}");
        }
        let mut inputs = Inputs { used: 0, skipped: dataset.skipped().len() };
        for entry in dataset.entries() {
            let unreadable = |error: TranslationError| Skipped {
                id: entry.id.clone(),
                source: entry.source.clone(),
                reason: error.to_string(),
            };
            let described =
                dataset.load(entry).and_then(|sample| DescribedRecord::new(self, sample).map_err(unreadable));
            match described {
                Ok(record) => {
                    steps.step(&entry.id, None);
                    told(record)?;
                    inputs.used += 1;
                }
                Err(input) => {
                    steps.step(&entry.id, Some(&input.to_string()));
                    inputs.skipped += 1;
                }
            }
        }
        Ok(inputs)
    }

    fn print<T: serde::Serialize>(&self, record: &T, text: impl Fn(&T) -> String) -> Result<(), Failure> {
        let text =
            if self.args.json { serde_json::to_string(record).or_failed()? + "\n" } else { text(record) };
        output::print(&text).or_failed()
    }

    fn print_counts(&self, inputs: Inputs, what: &str, targets: &[Target]) -> Result<(), Failure> {
        if !targets.is_empty() && !self.args.quiet {
            let places: Vec<String> =
                targets.iter().map(|target| target.path().display().to_string()).collect();
            let Inputs { used, skipped } = inputs;
            let used = counted(used, what);
            let text = format!("{used} translated, {skipped} skipped: {}\n", places.join(", "));
            output::print(&text).or_failed()?;
        }
        Ok(())
    }
}
