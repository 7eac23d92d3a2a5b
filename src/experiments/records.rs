//! The numbers of a grid for other programs, and what every model said and did.

use serde::Serialize;

use super::amounts::Amount;
use super::collect::{Row, SeedScores};
use super::differences::{Against, differences, relative};
use super::estimate::{Estimate, estimate};
use super::grid::{Cell, Grid, Role};
use super::score::{Described, Performed};
use crate::evaluation::motion::SetScore;
use crate::evaluation::{Absent, Measurement, Resampling, Signature};
use crate::features::PreparedSet;
use crate::manifest::{VERSION, platform, processor, program_sha256};

/// What models are scored against.
pub const REFERENCES: &str = "as people wrote them: marks are not cut away, and BLEU counts them as words, though a model writes \
                              those of its vocabulary only";

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
    /// The models that read back and embedded: the reference of each seed and part.
    pub judges: Vec<Judge>,
    /// What references are: as people wrote them.
    pub references: &'static str,
    /// Scores that were not computed.
    pub absent: Vec<Absent>,
    /// Its rows.
    pub rows: Vec<RowRecord>,
}

/// The judge of a seed and part.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Judge {
    /// Seed.
    pub seed: u64,
    /// Part.
    pub fold: usize,
    /// Its name in signatures of that part.
    pub name: String,
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
    /// What they differ by from the row without stage 1 and from captions that take no model.
    pub differences: Vec<Against>,
    /// Percent of the reference's captions that reading back keeps, by key.
    pub relative_percent: Vec<(&'static str, Estimate)>,
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
    /// Motions these belong to, which is what intervals are drawn over.
    pub num_motions: usize,
    /// Everything that changes the number, of the first seed; its parts together.
    pub signature: Signature,
}

/// The record of a grid.
#[must_use]
pub fn record<'a>(
    (grid, set): (&'a Grid, &'a PreparedSet),
    device: &'a str,
    rows: &[Row],
    absent: Vec<Absent>,
) -> GridRecord<'a> {
    let resampling = Resampling { num_resamples: grid.resamples, seed: 0 };
    let mut judges = Vec::new();
    for (&seed, scores) in grid.seeds.iter().zip(&rows[0].seeds) {
        let parts = grid.parts().into_iter().zip(&scores.parts);
        judges.extend(parts.map(|(fold, part)| Judge { seed, fold, name: part.evaluator.clone() }));
    }
    GridRecord {
        rprae: VERSION,
        program_sha256: program_sha256(),
        platform: platform(),
        processor: processor(),
        device,
        data: &set.fingerprint,
        grid,
        judges,
        references: REFERENCES,
        absent,
        rows: rows.iter().map(|row| row_record(rows, row, resampling)).collect(),
    }
}

fn row_record(rows: &[Row], row: &Row, resampling: Resampling) -> RowRecord {
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
                num_motions: measurements[0].clusters.len(),
                signature: measurements[0].signature.clone(),
            });
        }
    }
    let sets =
        row.seeds.iter().map(|seed| seed.parts.iter().map(|part| part.sets.clone()).collect()).collect();
    let relative_percent = row.seeds[0]
        .read_back
        .iter()
        .filter_map(|found| Some((found.key, relative(rows, row, found.key, resampling)?)));
    RowRecord {
        paired: row.paired,
        role: row.role,
        non_paired: row.non_paired,
        num_pairs: row.num_pairs,
        num_non_paired: row.num_non_paired,
        scores,
        differences: differences(rows, row, resampling),
        relative_percent: relative_percent.collect(),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::tables::tables;
    use crate::experiments::tables::tests::{grid, rows};
    use crate::training::tests::four_pairs;

    #[test]
    fn every_difference_of_the_tables_is_in_the_record() {
        let (grid, set, mut rows) = (grid("[1, 2]"), four_pairs(), rows(2));
        // Nobody trained these models, so that most scores are 0; this one gives the reference something to keep.
        for found in rows[0].seeds.iter_mut().flat_map(|seed| &mut seed.captions) {
            if found.key == "rouge-l" {
                *found = Measurement::of_values(found.key, found.signature.clone(), vec![0.5; 4]);
            }
        }
        let record = record((&grid, &set), "cpu", &rows, Vec::new());
        let json = serde_json::to_value(&record).unwrap();
        let number = |row: usize| json["rows"][row]["differences"].as_array().unwrap().len();
        // Three scores against two baselines; with stage 1 also two kinds of captions against the row without.
        assert_eq!([number(0), number(1), number(2), number(3)], [6, 6, 12, 12]);
        let text = tables(&grid, &rows);
        for found in record.rows.iter().flat_map(|row| &row.differences) {
            assert!(text.contains(&format!("{:+.3}", found.difference.value)), "{found:?}");
        }
        let kept = json["rows"][2]["relative_percent"].as_array().unwrap();
        let kept = kept.iter().find(|kept| kept[0] == "rouge-l").unwrap();
        let read_back = rows[2].over_seeds(|seed| &seed.read_back, "rouge-l").unwrap()[0].score();
        assert_eq!(kept[1]["value"].as_f64().unwrap(), 100.0 * read_back / 0.5);
        let judges = json["judges"].as_array().unwrap();
        assert_eq!((judges.len(), &judges[1]["seed"]), (2, &serde_json::json!(2)));
        assert!(judges[0]["name"].as_str().unwrap().starts_with("rae-"));
        assert!(json["references"].as_str().unwrap().contains("marks"));
    }
}
