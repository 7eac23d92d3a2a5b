//! Scores as a table, JSON and CSV.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::Serialize;

use crate::evaluation::{Absent, Comparison, Corpus, Measurement, Signature};
use crate::manifest::{sha256_hex, write_file};
use crate::report::{Align, Column, Interval, Table, counted};

const JSON_FILE: &str = "scores.json";

/// Everything that was computed, as the JSON file has it.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub rprae: &'static str,
    pub hypotheses: InputRecord,
    pub references: Vec<InputRecord>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paired: Option<InputRecord>,
    pub num_segments: usize,
    pub num_references: usize,
    pub num_resamples: usize,
    pub seed: u64,
    pub scores: Vec<ScoreRecord>,
    pub absent: Vec<Absent>,
    pub skipped: Vec<String>,
}

/// A file that was read.
#[derive(Debug, Serialize)]
pub(super) struct InputRecord {
    pub file: String,
    pub sha256: String,
}

/// One score.
#[derive(Debug, Serialize)]
pub(super) struct ScoreRecord {
    pub key: &'static str,
    pub value: f64,
    pub interval: Option<Interval>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub paired_value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
    pub signature: Signature,
}

impl InputRecord {
    pub fn of(path: &Path) -> anyhow::Result<Self> {
        let bytes = fs::read(path).with_context(|| format!("read {}", path.display()))?;
        Ok(Self { file: path.display().to_string(), sha256: sha256_hex(&bytes) })
    }
}

impl Report {
    /// The table with its signatures, for a person.
    pub fn text(&self, folder: &Path, width: usize) -> String {
        let mut text = format!(
            "{}, {}; 95 % intervals from {} resamples, seed {}\n",
            counted(self.num_segments, "segment"),
            counted(self.num_references, "reference"),
            self.num_resamples,
            self.seed
        );
        text.push_str(&self.table().render(width));
        for record in &self.scores {
            let _ = writeln!(text, "{}", record.signature);
        }
        for absent in &self.absent {
            let _ = writeln!(text, "absent: {}: {}", absent.keys, absent.hint);
        }
        for skipped in self.skipped.iter().take(10) {
            let _ = writeln!(text, "skipped: {skipped}");
        }
        if self.skipped.len() > 10 {
            let _ = writeln!(text, "skipped: {} more, see {JSON_FILE}", self.skipped.len() - 10);
        }
        let _ = writeln!(text, "written to {}", folder.display());
        text
    }

    fn table(&self) -> Table {
        let mut columns = vec![
            self.column("score", Align::Left, |record| record.key.to_owned()),
            self.column("value", Align::Right, |record| number(record.value)),
            self.column("95 % interval", Align::Right, |record| interval(record.interval)),
        ];
        if self.paired.is_some() {
            let compared = |cell: fn(&Comparison) -> String| {
                move |record: &ScoreRecord| record.comparison.as_ref().map_or_else(|| "-".to_owned(), cell)
            };
            columns.extend([
                self.column("other", Align::Right, |record| {
                    record.paired_value.map_or_else(|| "-".to_owned(), number)
                }),
                self.column(
                    "difference",
                    Align::Right,
                    compared(|comparison| format!("{:+.4}", comparison.difference)),
                ),
                self.column(
                    "95 % interval",
                    Align::Right,
                    compared(|comparison| interval(comparison.difference_interval)),
                ),
                self.column("p boot", Align::Right, compared(|comparison| p_value(comparison.p_bootstrap))),
                self.column(
                    "p rand",
                    Align::Right,
                    compared(|comparison| p_value(Some(comparison.p_randomization))),
                ),
                self.column(
                    "relative %",
                    Align::Right,
                    compared(|comparison| {
                        comparison
                            .relative_percent
                            .map_or_else(|| "-".to_owned(), |percent| format!("{percent:.1}"))
                    }),
                ),
            ]);
        }
        Table { columns }
    }

    fn column(&self, heading: &str, align: Align, cell: impl Fn(&ScoreRecord) -> String) -> Column {
        Column {
            heading: vec![heading.to_owned()],
            align,
            min_width: None,
            cells: self.scores.iter().map(cell).collect(),
        }
    }
}

fn number(value: f64) -> String {
    format!("{value:.4}")
}

fn interval(interval: Option<Interval>) -> String {
    interval.map_or_else(|| "-".to_owned(), |ends| format!("{:.4} .. {:.4}", ends.low, ends.high))
}

/// The folder for results: the one asked for, or the next free one of this name.
pub(super) fn folder(asked: Option<&Path>, overwrite: bool, hypotheses: &Path) -> anyhow::Result<PathBuf> {
    if let Some(folder) = asked {
        if folder.join(JSON_FILE).exists() && !overwrite {
            bail!(
                "use {} for scores: it holds some; choose another --out, or replace them with --overwrite",
                folder.display()
            );
        }
        fs::create_dir_all(folder).with_context(|| format!("make {}", folder.display()))?;
        return Ok(folder.to_owned());
    }
    let stem = hypotheses
        .file_stem()
        .map_or_else(|| "sentences".to_owned(), |stem| stem.to_string_lossy().into_owned());
    let parent = Path::new("results");
    fs::create_dir_all(parent).context("make the folder results")?;
    for number in 1..1000 {
        let folder = parent.join(format!("{stem}-scores-{number:03}"));
        match fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error).with_context(|| format!("make {}", folder.display())),
        }
    }
    bail!("find a free folder results/{stem}-scores-NNN: remove some, or name one with --out")
}

/// Writes the JSON file, one row a score, and one row a segment and score.
pub(super) fn write(
    folder: &Path,
    report: &Report,
    corpus: &Corpus,
    measurements: &[Measurement],
) -> anyhow::Result<()> {
    let mut scores = csv::Writer::from_writer(Vec::new());
    scores.write_record([
        "score",
        "value",
        "low",
        "high",
        "paired_value",
        "p_bootstrap",
        "p_randomization",
        "relative_percent",
        "signature",
    ])?;
    let text = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for record in &report.scores {
        let comparison = record.comparison.as_ref();
        scores.write_record([
            record.key.to_owned(),
            record.value.to_string(),
            text(record.interval.map(|ends| ends.low)),
            text(record.interval.map(|ends| ends.high)),
            text(record.paired_value),
            text(comparison.and_then(|comparison| comparison.p_bootstrap)),
            text(comparison.map(|comparison| comparison.p_randomization)),
            text(comparison.and_then(|comparison| comparison.relative_percent)),
            record.signature.to_string(),
        ])?;
    }
    let mut segments = csv::Writer::from_writer(Vec::new());
    segments.write_record(["segment", "score", "value"])?;
    for measurement in measurements {
        for (segment, value) in corpus.segments().iter().zip(measurement.segment_scores()) {
            segments.write_record([segment.id.as_str(), measurement.key, &value.to_string()])?;
        }
    }
    write_file(&folder.join("segments.csv"), &segments.into_inner()?)?;
    write_file(&folder.join("scores.csv"), &scores.into_inner()?)?;
    let mut json = serde_json::to_vec_pretty(report)?;
    json.push(b'\n');
    // Last, since it says that the folder is whole.
    write_file(&folder.join(JSON_FILE), &json)?;
    Ok(())
}

/// A p-value as text; a dash where there are too few segments for one.
pub(super) fn p_value(p: Option<f64>) -> String {
    p.map_or_else(|| "-".to_owned(), |p| format!("{p:.3}"))
}
