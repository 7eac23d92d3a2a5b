//! `rprae evaluate`: sentences scored against reference sentences, and trained models against held-out pairs.

mod bundle;
mod report;
mod sentences;

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, ValueEnum};

use self::report::{Report, ScoreRecord};
use super::choose::Choose;
use super::exit::{Exit, Failure, OrExit};
use super::{number, output};
use crate::evaluation::encoder::{Encoder, KNOWN_ENCODERS, Pooling, parse_baseline};
use crate::evaluation::{Baseline, Measurement, Panel, Resampling, SentenceEncoder, TokenEncoder};

#[derive(Debug, Args)]
pub(super) struct EvaluateArgs {
    /// Sentences to score: a line each (.txt), or an object with an "id" and a "hypothesis" a line (.jsonl)
    #[arg(long, value_name = "FILE", required_unless_present = "bundle", conflicts_with = "bundle")]
    pub hypotheses: Option<PathBuf>,
    /// What they should say: a line each, several between tabs, or an object with an "id" and a list of "references" a line; may be
    /// given several times, and the references of a segment add up
    #[arg(long, value_name = "FILE", required_unless_present = "bundle", conflicts_with = "bundle")]
    pub references: Vec<PathBuf>,
    /// Hypotheses of another system, compared segment by segment; also the reference model of relative performance
    #[arg(long, value_name = "FILE", conflicts_with = "bundle")]
    pub paired: Option<PathBuf>,
    /// Score a trained model instead: captions of held-out motions against two baselines, motions of held-out captions
    /// against chance
    #[arg(long, value_name = "DIR", requires = "prepared")]
    pub bundle: Option<PathBuf>,
    /// Folder that rprae prepare made, whose pairs the model is scored on
    #[arg(long, value_name = "DIR", requires = "bundle", conflicts_with = "hypotheses")]
    pub prepared: Option<PathBuf>,
    /// Part of the prepared data
    #[arg(long, value_enum, default_value_t = SplitArg::Test, requires = "bundle", conflicts_with = "hypotheses")]
    pub split: SplitArg,
    /// Another trained model that embeds and reads back what the model makes [default: the model itself]
    #[arg(long, value_name = "DIR", requires = "bundle", conflicts_with = "hypotheses")]
    pub judge: Option<PathBuf>,
    /// Which of the captions it finds is scored [default: that of the most probable next words]
    #[arg(long, value_enum, requires = "bundle", conflicts_with = "hypotheses")]
    pub choose: Option<Choose>,
    /// Captions followed side by side, or drawn [default: 5, and 32 for a consensus]
    #[arg(long, value_name = "N", requires = "choose", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub beam: Option<u16>,
    /// Folder of the encoder for BERTScore
    #[arg(long, value_name = "DIR")]
    pub encoder: Option<PathBuf>,
    /// Layer for BERTScore [default: 17 for an encoder of the shape of roberta-large, else the last]
    #[arg(long, value_name = "N", value_parser = number::whole, requires = "encoder")]
    pub layer: Option<usize>,
    /// Table of BERTScore baselines, LAYER,P,R,F a line [default: the published one for roberta-large, layer 17]
    #[arg(long, value_name = "FILE", requires = "encoder")]
    pub baseline: Option<PathBuf>,
    /// Give byte-pair tokenisers the first word without a space before it, unlike published BERTScore values
    #[arg(long, requires = "encoder")]
    pub no_prefix_space: bool,
    /// Folder of the encoder for the sentence cosine
    #[arg(long, value_name = "DIR")]
    pub sentence_encoder: Option<PathBuf>,
    /// How a sentence becomes one vector [default: pooler where the model has one, else cls]
    #[arg(long, value_name = "HOW", requires = "sentence_encoder")]
    pub pooling: Option<PoolingArg>,
    /// Seed of the resampling, and of captions drawn
    #[arg(long, value_name = "N", value_parser = number::seed, default_value_t = 0)]
    pub seed: u64,
    /// Draws for intervals and p-values
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    pub resamples: u32,
    /// Folder for scores.json, scores.csv and segments.csv [default: results/NAME-scores-NNN]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the scores that --out holds
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}

/// Part of prepared data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum SplitArg {
    /// What was learned from: says how well it is remembered
    Train,
    /// What was watched while learning
    Validation,
    /// What nothing was decided by
    Test,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum PoolingArg {
    /// The start token after the last layer
    Cls,
    /// The start token through the pooler
    Pooler,
    /// The mean over all tokens
    Mean,
}

impl From<PoolingArg> for Pooling {
    fn from(arg: PoolingArg) -> Self {
        match arg {
            PoolingArg::Cls => Self::Cls,
            PoolingArg::Pooler => Self::Pooler,
            PoolingArg::Mean => Self::Mean,
        }
    }
}

pub(super) fn run(args: &EvaluateArgs) -> Result<Exit, Failure> {
    let token_encoder = match &args.encoder {
        Some(folder) => Some(open_token_encoder(folder, args.layer, args.baseline.as_deref()).or_usage()?),
        None => None,
    };
    let sentence_encoder = match &args.sentence_encoder {
        Some(folder) => Some(Encoder::open(folder, None).or_usage()?),
        None => None,
    };
    let panel = Panel {
        token_encoder: token_encoder.as_ref().map(|(encoder, baseline)| TokenEncoder {
            encoder,
            prefix_space: !args.no_prefix_space,
            baseline: baseline.clone(),
        }),
        sentence_encoder: sentence_encoder.as_ref().map(|encoder| SentenceEncoder {
            encoder,
            pooling: args.pooling.map_or_else(|| encoder.pooling(), Pooling::from),
        }),
    };
    match (&args.bundle, &args.prepared, &args.hypotheses) {
        (Some(bundle), Some(prepared), _) => bundle::run(args, bundle, prepared, &panel),
        (_, _, Some(hypotheses)) => sentences(args, hypotheses, &panel),
        _ => Err(anyhow::anyhow!("find what to score: give --hypotheses, or --bundle with --prepared"))
            .or_usage(),
    }
}

fn sentences(args: &EvaluateArgs, hypotheses: &Path, panel: &Panel<'_>) -> Result<Exit, Failure> {
    let pairs = sentences::read(hypotheses, &args.references).or_usage()?;
    let other = match &args.paired {
        Some(path) => Some(sentences::read(path, &args.references).or_usage()?),
        None => None,
    };
    if let Some(other) = &other {
        let ids = |corpus: &crate::evaluation::Corpus| -> Vec<String> {
            corpus.segments().iter().map(|segment| segment.id.clone()).collect()
        };
        if ids(&pairs.corpus) != ids(&other.corpus) {
            let error = anyhow::anyhow!(
                "compare two systems: their hypotheses are not of the same segments, in the same order"
            );
            return Err(error).or_usage();
        }
    }
    // The place for the results is made before the long work.
    let folder = report::folder(args.out.as_deref(), args.overwrite, hypotheses).or_usage()?;
    if args.encoder.is_some() || args.sentence_encoder.is_some() {
        let num_sentences = pairs.corpus.sentences().count();
        eprintln!("encoding {num_sentences} sentences, each distinct one once");
    }
    let measurements = panel.measure(&pairs.corpus).or_failed()?;
    let others = other.as_ref().map(|other| panel.measure(&other.corpus)).transpose().or_failed()?;
    let resampling = Resampling { num_resamples: args.resamples as usize, seed: args.seed };
    let scores = records(&measurements, others.as_deref(), resampling).or_failed()?;
    let report = Report {
        rprae: crate::manifest::VERSION,
        hypotheses: report::InputRecord::of(hypotheses).or_failed()?,
        references: args
            .references
            .iter()
            .map(|path| report::InputRecord::of(path))
            .collect::<Result<_, _>>()
            .or_failed()?,
        paired: args.paired.as_deref().map(report::InputRecord::of).transpose().or_failed()?,
        num_segments: pairs.corpus.len(),
        num_references: pairs.corpus.references().count(),
        num_resamples: resampling.num_resamples,
        seed: resampling.seed,
        scores,
        absent: panel.absent(),
        skipped: pairs.skipped,
    };
    report::write(&folder, &report, &pairs.corpus, &measurements).or_failed()?;
    output::print(&report.text(&folder, output::table_width())).or_failed()?;
    Ok(if report.skipped.is_empty() { Exit::Clean } else { Exit::Skipped })
}

fn records(
    ours: &[Measurement],
    others: Option<&[Measurement]>,
    resampling: Resampling,
) -> anyhow::Result<Vec<ScoreRecord>> {
    ours.iter()
        .enumerate()
        .map(|(index, measurement)| {
            let other = others.and_then(|others| others.get(index));
            Ok(ScoreRecord {
                key: measurement.key,
                value: measurement.score(),
                interval: resampling.interval(measurement),
                paired_value: other.map(Measurement::score),
                comparison: other.map(|other| resampling.compare(measurement, other)).transpose()?,
                signature: measurement.signature.clone(),
            })
        })
        .collect()
}

/// The encoder for BERTScore with its baseline: those asked for, or what is known of its shape.
pub(super) fn open_token_encoder(
    folder: &Path,
    layer: Option<usize>,
    baseline: Option<&Path>,
) -> anyhow::Result<(Encoder, Option<Baseline>)> {
    let known = &KNOWN_ENCODERS[0];
    let is_known = crate::evaluation::encoder::looks_like_roberta_large(folder)?;
    let layer = layer.or(known.layer.filter(|_| is_known));
    let encoder = Encoder::open(folder, layer)?;
    let baseline = match baseline {
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| format!("read {}", path.display()))?;
            let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            let baseline = parse_baseline(&text, encoder.layer(), &name)
                .map_err(|reason| anyhow::anyhow!("understand {}: {reason}", path.display()))?;
            Some(baseline)
        }
        None => known
            .baseline
            .filter(|_| is_known && Some(encoder.layer()) == known.layer)
            .map(|values| Baseline { values, name: "roberta-large-en".to_owned() }),
    };
    Ok((encoder, baseline))
}
