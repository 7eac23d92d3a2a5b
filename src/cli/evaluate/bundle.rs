//! A trained model on pairs it never saw, in both directions.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use super::report::p_value;
use super::{EvaluateArgs, SplitArg, report};
use crate::cli::exit::{Exit, Failure, OrExit};
use crate::cli::output;
use crate::evaluation::motion::SetScore;
use crate::evaluation::{Comparison, Measurement, Panel, Resampling, Signature};
use crate::experiments::{self, Evaluator, HeldOut, Outcome, REFERENCES};
use crate::features::PreparedSet;
use crate::manifest::{VERSION, write_file};
use crate::model::{self, Bundle};
use crate::report::{Align, Column, Interval, Table, counted};
use crate::translation::Search;

#[derive(Debug, Serialize)]
struct Record<'a> {
    rprae: &'static str,
    model: String,
    judge: &'a str,
    data: &'a str,
    /// Whether the motions were kept from the model.
    held_out: HeldOut,
    /// How the captions were looked for.
    decoding: Search,
    /// What references are.
    references: &'static str,
    num_motions: usize,
    num_captions: usize,
    /// Captions that no pair learned from has.
    num_unseen_captions: usize,
    num_resamples: usize,
    seed: u64,
    captions: Vec<Score>,
    motions: Vec<Score>,
    sets: &'a [SetScore],
}

/// A score, with what it is compared with.
#[derive(Debug, Serialize)]
struct Score {
    key: String,
    value: f64,
    interval: Option<Interval>,
    /// What guessing reaches.
    #[serde(skip_serializing_if = "Option::is_none")]
    chance: Option<f64>,
    /// Against the most frequent caption and the nearest motion in pose space.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    baselines: Vec<Against>,
    signature: Signature,
}

#[derive(Debug, Serialize)]
struct Against {
    name: &'static str,
    value: f64,
    comparison: Comparison,
}

pub(super) fn run(
    args: &EvaluateArgs,
    folder: &Path,
    prepared: &Path,
    panel: &Panel<'_>,
) -> Result<Exit, Failure> {
    let decoding = args.choose.map_or_else(Search::default, |choose| Search {
        choose: choose.into(),
        beam: usize::from(args.beam.unwrap_or(choose.default_beam())),
        seed: args.seed,
        ..Search::default()
    });
    decoding.check().or_usage()?;
    let set = PreparedSet::load(prepared).or_usage()?;
    let device = model::cpu().device;
    let bundle = Bundle::load(folder, &device).or_usage()?;
    let judge = args.judge.as_ref().map(|folder| Bundle::load(folder, &device)).transpose().or_usage()?;
    let judge = Evaluator::new(judge.as_ref().unwrap_or(&bundle));
    let pairs = match args.split {
        SplitArg::Train => &set.paired,
        SplitArg::Validation => &set.validation,
        SplitArg::Test => &set.test,
    };
    if pairs.is_empty() {
        let error = anyhow::anyhow!("score the model: {} has no pairs in that split", prepared.display());
        return Err(error).or_usage();
    }
    let held_out = HeldOut::of(&bundle, &set, pairs);
    if let (HeldOut::No { learned, scored, first }, SplitArg::Validation | SplitArg::Test) =
        (&held_out, args.split)
    {
        let error = anyhow::anyhow!(
            "score the model on held-out pairs: it learned from {learned} of the {scored} motions of that split, the first {first}; \
             give the set it was trained on, or ask for what it remembers with --split train"
        );
        return Err(error).or_usage();
    }
    let out = report::folder(args.out.as_deref(), args.overwrite, Path::new("model")).or_usage()?;
    let humanoid = experiments::humanoid().or_failed()?;
    let found = experiments::score(&bundle, &judge, &set, pairs, &humanoid, &decoding).or_usage()?;
    let resampling = Resampling { num_resamples: args.resamples as usize, seed: args.seed };
    let captions = captions(&found, panel, resampling).or_failed()?;
    let motions = motions(&found, resampling);
    let record = Record {
        rprae: VERSION,
        model: Evaluator::new(&bundle).name,
        judge: &judge.name,
        data: &set.fingerprint,
        held_out,
        decoding,
        references: REFERENCES,
        num_motions: found.described.len(),
        num_captions: found.performed.len(),
        num_unseen_captions: found.num_unseen_captions,
        num_resamples: resampling.num_resamples,
        seed: resampling.seed,
        captions,
        motions,
        sets: &found.sets,
    };
    let mut samples = String::new();
    for sample in &found.described {
        samples += &serde_json::to_string(sample).or_failed()?;
        samples.push('\n');
    }
    for sample in &found.performed {
        samples += &serde_json::to_string(sample).or_failed()?;
        samples.push('\n');
    }
    write_file(&out.join("samples.jsonl"), samples.as_bytes()).or_failed()?;
    let json = serde_json::to_vec_pretty(&record).or_failed()?;
    // Last, since it says that the folder is whole.
    write_file(&out.join("scores.json"), &json).or_failed()?;
    output::print(&record.text(&out, output::table_width())).or_failed()?;
    for absent in panel.absent() {
        eprintln!("not scored: {} ({})", absent.keys, absent.hint);
    }
    Ok(Exit::Clean)
}

fn captions(found: &Outcome, panel: &Panel<'_>, resampling: Resampling) -> anyhow::Result<Vec<Score>> {
    let ours = panel.measure(&found.captions)?;
    let baselines = [
        ("most frequent", panel.measure(&found.most_frequent)?),
        ("nearest", panel.measure(&found.nearest)?),
    ];
    let score = |(place, measurement): (usize, &Measurement)| {
        let baselines = baselines.iter().map(|(name, all)| {
            let comparison = resampling.compare(measurement, &all[place])?;
            Ok(Against { name, value: all[place].score(), comparison })
        });
        Ok(Score {
            key: measurement.key.to_owned(),
            value: measurement.score(),
            interval: resampling.interval(measurement),
            chance: None,
            baselines: baselines.collect::<anyhow::Result<_>>()?,
            signature: measurement.signature.clone(),
        })
    };
    ours.iter().enumerate().map(score).collect()
}

fn motions(found: &Outcome, resampling: Resampling) -> Vec<Score> {
    let score = |key: String, measurement: &Measurement, chance| Score {
        key,
        value: measurement.score(),
        interval: resampling.interval(measurement),
        chance,
        baselines: Vec::new(),
        signature: measurement.signature.clone(),
    };
    let mut scores = Vec::new();
    for retrieval in &found.retrievals {
        let name = format!("{} by {}", retrieval.among, retrieval.query);
        for (place, measurement) in retrieval.measure().iter().enumerate() {
            let chance = (place < 3).then(|| retrieval.chance_level(place + 1));
            scores.push(score(format!("{name}, {}", measurement.key), measurement, chance));
        }
        let (median, interval) = retrieval.median_rank(resampling);
        let signature = Signature::new("median-rank")
            .with("query", retrieval.query)
            .with("among", retrieval.among)
            .with("ties", "against")
            .with("evaluator", &retrieval.evaluator)
            .with("v", 1);
        let key = format!("{name}, median-rank");
        scores.push(Score { key, value: median, interval, chance: None, baselines: Vec::new(), signature });
    }
    let [made, recorded] = &found.pair_distances;
    scores.push(score("mm-dist of generated motions".to_owned(), made, None));
    scores.push(score("mm-dist of recorded motions".to_owned(), recorded, None));
    for measurement in found.pose_measurements() {
        scores.push(score(measurement.key.to_owned(), &measurement, None));
    }
    scores
}

impl Record<'_> {
    fn text(&self, out: &Path, width: usize) -> String {
        let mut text = format!(
            "{}, {}, {} of them sentences that no pair learned from has; judged by {}; 95 % intervals from {} resamples of motions with all their captions, \
             seed {}\nheld out: {}\nreferences: {}\ncaptions: {}\n\nCaptions of motions (0 to 1, CIDEr 0 to 10, higher is better; p of the difference)\n",
            counted(self.num_motions, "motion"),
            counted(self.num_captions, "caption"),
            self.num_unseen_captions,
            self.judge,
            self.num_resamples,
            self.seed,
            self.held_out.text(),
            self.references,
            self.decoding.text()
        );
        let mut columns = vec![
            column("score", Align::Left, &self.captions, |score| score.key.clone()),
            column("value", Align::Right, &self.captions, |score| number(score.value)),
            column("95 %", Align::Right, &self.captions, |score| ends(score.interval)),
        ];
        for (place, name) in ["most frequent", "nearest"].into_iter().enumerate() {
            let against = |score: &Score, show: &dyn Fn(&Against) -> String| {
                score.baselines.get(place).map_or_else(String::new, show)
            };
            columns.push(column(name, Align::Right, &self.captions, |score| {
                against(score, &|other| number(other.value))
            }));
            columns.push(column("difference", Align::Right, &self.captions, |score| {
                against(score, &|other| ends(other.comparison.difference_interval))
            }));
            columns.push(column("p", Align::Right, &self.captions, |score| {
                against(score, &|other| p_value(other.comparison.p_bootstrap))
            }));
        }
        text += &Table { columns }.render(width);
        text += "\nMotions of captions\n";
        let rows: Vec<Row<'_>> =
            self.motions.iter().map(Row::of_score).chain(self.sets.iter().map(Row::of_set)).collect();
        let columns = vec![
            column("score", Align::Left, &rows, |row| row.key.clone()),
            column("value", Align::Right, &rows, |row| number(row.value)),
            column("95 %", Align::Right, &rows, |row| ends(row.interval)),
            column("chance", Align::Right, &rows, |row| row.chance.map_or_else(|| "-".to_owned(), number)),
            column("unit", Align::Left, &rows, |row| unit(row.signature)),
        ];
        text += &Table { columns }.render(width);
        text.push('\n');
        for set in self.sets {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", set.signature);
        }
        let _ = writeln!(
            text,
            "multimodality is not scored: the model makes one motion of a caption\nscores   {}",
            out.join("scores.json").display()
        );
        text
    }
}

/// A row of the table of motions.
struct Row<'a> {
    key: String,
    value: f64,
    interval: Option<Interval>,
    chance: Option<f64>,
    signature: &'a Signature,
}

impl<'a> Row<'a> {
    fn of_score(score: &'a Score) -> Self {
        let Score { key, value, interval, chance, signature, .. } = score;
        Self { key: key.clone(), value: *value, interval: *interval, chance: *chance, signature }
    }

    fn of_set(set: &'a SetScore) -> Self {
        let of = set.signature.value("of").map_or_else(String::new, |of| format!(" of {of}"));
        let key = format!("{}{of}", set.key);
        Self { key, value: set.value, interval: set.interval, chance: None, signature: &set.signature }
    }
}

/// What a score of motions is counted in, and among how many candidates, as its signature says.
fn unit(signature: &Signature) -> String {
    let name = signature.as_str().split('|').next().unwrap_or_default();
    match (name, signature.value("unit"), signature.value("pool"), signature.value("candidates")) {
        (_, Some(unit), ..) => unit.to_owned(),
        (_, _, Some(pool), _) => format!("share of queries, in pools of {pool}"),
        (_, _, _, Some(candidates)) => format!("share of queries, among all {candidates}"),
        ("median-rank", ..) => "rank, 1 is the nearest".to_owned(),
        ("fid", ..) => "squared latent distance".to_owned(),
        _ => "latent distance".to_owned(),
    }
}

fn column<T>(heading: &str, align: Align, rows: &[T], cell: impl Fn(&T) -> String) -> Column {
    Column {
        heading: vec![heading.to_owned()],
        align,
        min_width: None,
        cells: rows.iter().map(cell).collect(),
    }
}

fn number(value: f64) -> String {
    format!("{value:.3}")
}

fn ends(interval: Option<Interval>) -> String {
    interval.map_or_else(|| "-".to_owned(), |ends| format!("{:.3} .. {:.3}", ends.low, ends.high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_score_of_motions_has_a_unit_and_every_retrieval_its_pool() {
        let of = |name: &str| Signature::new(name).with("evaluator", "e");
        assert_eq!(unit(&of("pose-error").with("unit", "mm")), "mm");
        assert_eq!(unit(&of("r-precision-1").with("pool", 32)), "share of queries, in pools of 32");
        assert_eq!(unit(&of("recall-1").with("candidates", 97)), "share of queries, among all 97");
        let rest = ["median-rank", "fid", "mm-dist", "diversity"].map(|name| unit(&of(name)));
        assert_eq!(
            rest,
            ["rank, 1 is the nearest", "squared latent distance", "latent distance", "latent distance"]
        );
    }
}
