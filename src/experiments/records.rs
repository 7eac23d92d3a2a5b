//! The numbers of a grid for other programs, and what every model said and did.

use serde::Serialize;

use super::amounts::Amount;
use super::collect::{Row, SeedScores};
use super::estimate::{Estimate, estimate};
use super::grid::{Cell, Grid, Role};
use super::score::{Described, Performed};
use crate::evaluation::motion::SetScore;
use crate::evaluation::{Measurement, Resampling, Signature};
use crate::features::PreparedSet;
use crate::manifest::{VERSION, platform, processor, program_sha256};

/// Everything the tables are made of.
#[derive(Debug, Serialize)]
pub struct GridRecord<'a> {
    /// Version of this program.
    pub rprae: &'static str,
    /// Checksum of the program.
    pub program_sha256: String,
    /// Operating system and processor family.
    pub platform: String,
    /// Name of the processor.
    pub processor: String,
    /// What computed.
    pub device: &'a str,
    /// Fingerprint of the whole prepared set.
    pub data: &'a str,
    /// The grid.
    pub grid: &'a Grid,
    /// Its rows.
    pub rows: Vec<RowRecord>,
}

/// A row.
#[derive(Debug, Serialize)]
pub struct RowRecord {
    /// Pairs asked for.
    pub paired: Amount,
    /// With stage 1 or without.
    pub role: Role,
    /// Non-paired samples asked for.
    pub non_paired: Option<Amount>,
    /// Pairs there were, the mean over parts.
    pub num_pairs: f64,
    /// Non-paired captions and motions there were, the means over parts.
    pub num_non_paired: [f64; 2],
    /// Scores that are means over samples.
    pub scores: Vec<ScoreRecord>,
    /// Scores of whole sets: of each seed, of each part.
    pub sets: Vec<Vec<Vec<SetScore>>>,
}

/// A score of a row.
#[derive(Debug, Serialize)]
pub struct ScoreRecord {
    /// What was scored: `captions`, `most-frequent`, `nearest`, `read-back`, `motions` or `retrieval`.
    pub of: &'static str,
    /// Key of the score.
    pub key: &'static str,
    /// Its value over seeds.
    pub estimate: Estimate,
    /// Samples of a seed.
    pub num: usize,
    /// Everything that changes the number, of the first seed.
    pub signature: Signature,
}

/// The record of a grid.
#[must_use]
pub fn record<'a>(grid: &'a Grid, set: &'a PreparedSet, device: &'a str, rows: &[Row]) -> GridRecord<'a> {
    let resampling = Resampling { num_resamples: grid.resamples, seed: 0 };
    GridRecord {
        rprae: VERSION,
        program_sha256: program_sha256(),
        platform: platform(),
        processor: processor(),
        device,
        data: &set.fingerprint,
        grid,
        rows: rows.iter().map(|row| row_record(row, resampling)).collect(),
    }
}

fn row_record(row: &Row, resampling: Resampling) -> RowRecord {
    type Pick = fn(&SeedScores) -> Vec<Measurement>;
    let of: [(&str, Pick); 6] = [
        ("captions", |seed| seed.captions.clone()),
        ("most-frequent", |seed| seed.most_frequent.clone()),
        ("nearest", |seed| seed.nearest.clone()),
        ("read-back", |seed| seed.read_back.clone()),
        ("motions", |seed| seed.motions.clone()),
        ("retrieval", |seed| {
            seed.retrievals.iter().flat_map(crate::evaluation::motion::Retrieval::measure).collect()
        }),
    ];
    let mut scores = Vec::new();
    for (name, pick) in of {
        let seeds: Vec<Vec<Measurement>> = row.seeds.iter().map(pick).collect();
        for place in 0..seeds[0].len() {
            let measurements: Vec<&Measurement> = seeds.iter().map(|seed| &seed[place]).collect();
            scores.push(ScoreRecord {
                of: name,
                key: measurements[0].key,
                estimate: estimate(&measurements, resampling),
                num: measurements[0].statistics.len(),
                signature: measurements[0].signature.clone(),
            });
        }
    }
    let sets =
        row.seeds.iter().map(|seed| seed.parts.iter().map(|part| part.sets.clone()).collect()).collect();
    RowRecord {
        paired: row.paired,
        role: row.role,
        non_paired: row.non_paired,
        num_pairs: row.num_pairs,
        num_non_paired: row.num_non_paired,
        scores,
        sets,
    }
}

#[derive(Serialize)]
struct Sample<'a, T> {
    model: &'a str,
    #[serde(flatten)]
    sample: &'a T,
}

/// What every model said and did, a JSON object a line; reference captions are not among it.
///
/// # Errors
/// A [`serde_json::Error`] when a number has no written form.
pub fn samples(grid: &Grid, rows: &[Row]) -> Result<String, serde_json::Error> {
    let mut text = String::new();
    for row in rows {
        for (seed, scores) in grid.seeds.iter().zip(&row.seeds) {
            for (fold, part) in grid.parts().into_iter().zip(&scores.parts) {
                let cell = Cell {
                    paired: row.paired,
                    role: row.role,
                    non_paired: row.non_paired,
                    seed: *seed,
                    fold,
                };
                let model = cell.name();
                for sample in &part.described {
                    text.push_str(&serde_json::to_string(&Sample::<Described> { model: &model, sample })?);
                    text.push('\n');
                }
                for sample in &part.performed {
                    text.push_str(&serde_json::to_string(&Sample::<Performed> { model: &model, sample })?);
                    text.push('\n');
                }
            }
        }
    }
    Ok(text)
}
