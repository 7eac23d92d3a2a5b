//! Scores of all models of a grid, side by side.

use std::path::Path;

use super::amounts::Amount;
use super::evaluator::{Evaluator, names_joined};
use super::grid::{Cell, Grid, Role};
use super::run::{CellError, load_cell};
use super::score::{Outcome, ScoreError, score};
use crate::evaluation::encoder::EncoderError;
use crate::evaluation::motion::Retrieval;
use crate::evaluation::{Clusters, Corpus, CorpusError, Measurement, Panel};
use crate::features::PreparedSet;
use crate::humanoid::Humanoid;
use crate::model::Selected;

/// Why a grid cannot be scored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CollectError {
    /// A model cannot be read.
    #[error(transparent)]
    Cell(#[from] CellError),
    /// A model cannot be scored.
    #[error("score {cell}: {error}")]
    Score {
        /// Name of the model.
        cell: String,
        /// Why not.
        error: ScoreError,
    },
    /// Captions of several parts that cannot be scored together.
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    /// A sentence that cannot be encoded.
    #[error(transparent)]
    Encoder(#[from] EncoderError),
}

/// What one seed is worth: every motion with captions is scored once, in the part that held it out.
#[derive(Debug, Clone)]
pub struct SeedScores {
    /// Captions of motions.
    pub captions: Vec<Measurement>,
    /// The most frequent caption of the pairs learned from.
    pub most_frequent: Vec<Measurement>,
    /// The caption of the nearest motion of the pairs learned from.
    pub nearest: Vec<Measurement>,
    /// Captions that the reference model of this seed and part reads back from motions made from captions.
    pub read_back: Vec<Measurement>,
    /// Retrieval, each with its parts joined.
    pub retrievals: Vec<Retrieval>,
    /// Distance of captions from motions made, and pose errors of these.
    pub motions: Vec<Measurement>,
    /// What was found in each part.
    pub parts: Vec<Outcome>,
}

/// Models that differ by seed and part only: a row of the tables.
#[derive(Debug, Clone)]
pub struct Row {
    /// Pairs asked for.
    pub paired: Amount,
    /// With stage 1 or without.
    pub role: Role,
    /// Non-paired samples asked for.
    pub non_paired: Option<Amount>,
    /// Pairs there were in a part, the mean.
    pub num_pairs: f64,
    /// Non-paired captions and motions there were in a part, the means.
    pub num_non_paired: [f64; 2],
    /// Scores of each seed, in the order of the grid.
    pub seeds: Vec<SeedScores>,
}

impl Row {
    /// The measurement of a key at every seed, from the scores that `pick` names.
    #[must_use]
    pub fn over_seeds(
        &self,
        pick: fn(&SeedScores) -> &[Measurement],
        key: &str,
    ) -> Option<Vec<&Measurement>> {
        self.seeds.iter().map(|seed| pick(seed).iter().find(|found| found.key == key)).collect()
    }
}

/// Scores all models of a grid, which must be trained; `observe` hears of each.
///
/// # Errors
/// [`CollectError`] names the model that cannot be scored.
pub fn collect(
    (grid, full, out): (&Grid, &PreparedSet, &Path),
    selected: &Selected,
    humanoid: &Humanoid,
    panel: &Panel<'_>,
    observe: &mut dyn FnMut(&Cell),
) -> Result<Vec<Row>, CollectError> {
    let mut kinds: Vec<(Amount, Role, Option<Amount>)> = Vec::new();
    for cell in grid.cells() {
        let kind = (cell.paired, cell.role, cell.non_paired);
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    let mut rows: Vec<Row> = kinds
        .iter()
        .map(|&(paired, role, non_paired)| Row {
            paired,
            role,
            non_paired,
            num_pairs: 0.0,
            num_non_paired: [0.0; 2],
            seeds: Vec::new(),
        })
        .collect();
    let folds = grid.parts();
    let share = 1.0 / (folds.len() * grid.seeds.len()) as f64;
    for &seed in &grid.seeds {
        let mut parts: Vec<Vec<Outcome>> = vec![Vec::new(); kinds.len()];
        for &fold in &folds {
            let reference = Cell { paired: Amount::All, role: Role::Vanilla, non_paired: None, seed, fold };
            let (reference, _) = load_cell(grid, &reference, full, out, selected)?;
            let judge = Evaluator::new(&reference);
            for (place, &(paired, role, non_paired)) in kinds.iter().enumerate() {
                let cell = Cell { paired, role, non_paired, seed, fold };
                observe(&cell);
                let (bundle, set) = load_cell(grid, &cell, full, out, selected)?;
                let outcome = score(&bundle, &judge, &set, &set.test, humanoid, &grid.decoding)
                    .map_err(|error| CollectError::Score { cell: cell.name(), error })?;
                parts[place].push(outcome);
                rows[place].num_pairs += share * set.paired.len() as f64;
                rows[place].num_non_paired[0] += share * set.non_paired_captions.len() as f64;
                rows[place].num_non_paired[1] += share * set.non_paired_motions.len() as f64;
            }
        }
        for (row, parts) in rows.iter_mut().zip(parts) {
            row.seeds.push(join(parts, panel)?);
        }
    }
    Ok(rows)
}

/// The scores of all parts of a seed together.
pub(super) fn join(parts: Vec<Outcome>, panel: &Panel<'_>) -> Result<SeedScores, CollectError> {
    let texts = |pick: fn(&Outcome) -> &Corpus| -> Result<Vec<Measurement>, CollectError> {
        let segments = parts.iter().flat_map(|part| pick(part).segments().iter().cloned()).collect();
        Ok(panel.measure(&Corpus::new(segments)?)?)
    };
    let judges: Vec<&str> = parts.iter().map(|part| part.evaluator.as_str()).collect();
    let judge = names_joined(&judges);
    let mut retrievals: Vec<Retrieval> = Vec::new();
    let mut clusters = Clusters::singles(0);
    for part in &parts {
        clusters.append(&part.clusters);
        for (place, found) in part.retrievals.iter().enumerate() {
            // Poses need no judge.
            let evaluator = if found.evaluator == part.evaluator { &judge } else { &found.evaluator };
            match retrievals.get_mut(place) {
                None => retrievals.push(Retrieval { evaluator: evaluator.clone(), ..found.clone() }),
                Some(all) => {
                    all.ranks.extend(&found.ranks);
                    all.clusters.append(&found.clusters);
                }
            }
        }
    }
    let mut motions: Vec<Measurement> = Vec::new();
    for part in &parts {
        let of_part = std::iter::once(part.pair_distances[0].clone()).chain(part.pose_measurements());
        for (place, found) in of_part.enumerate() {
            match motions.get_mut(place) {
                None => {
                    let signature = found.signature.clone().replaced("evaluator", &judge);
                    motions.push(Measurement { signature, ..found });
                }
                Some(all) => {
                    let mut values = all.segment_scores();
                    values.extend(found.segment_scores());
                    *all = Measurement::of_values(all.key, all.signature.clone(), values);
                }
            }
        }
    }
    let motions = motions.into_iter().map(|found| found.clustered(&clusters)).collect();
    let read_back = texts(|part| &part.read_back)?;
    Ok(SeedScores {
        captions: texts(|part| &part.captions)?,
        most_frequent: texts(|part| &part.most_frequent)?,
        nearest: texts(|part| &part.nearest)?,
        read_back: read_back.into_iter().map(|found| found.clustered(&clusters)).collect(),
        retrievals,
        motions,
        parts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::score::tests::outcome;

    #[test]
    fn joined_parts_keep_their_groups_and_name_their_judges() {
        let (first, mut second) = (outcome(), outcome());
        let alone = join(vec![first.clone()], &Panel::default()).unwrap();
        assert_eq!(alone.retrievals[0].evaluator, first.evaluator);
        let other = "rae-another";
        for retrieval in &mut second.retrievals {
            if retrieval.evaluator == second.evaluator {
                retrieval.evaluator = other.to_owned();
            }
        }
        second.evaluator = other.to_owned();
        let both = join(vec![first.clone(), second], &Panel::default()).unwrap();
        let name = names_joined(&[&first.evaluator, other]);
        assert_eq!(
            (both.retrievals[0].evaluator.as_str(), both.retrievals[0].ranks.len()),
            (name.as_str(), 8)
        );
        assert_eq!(both.retrievals[2].evaluator, first.retrievals[2].evaluator);
        let distance = &both.motions[0];
        assert!(distance.signature.as_str().contains(&name), "{}", distance.signature);
        assert_eq!((distance.clusters.len(), both.read_back[0].clusters.len()), (8, 8));
        // A query has the candidates of its own part.
        let recall = &both.retrievals[3].measure()[3];
        assert!(recall.signature.as_str().contains("|candidates:4|"), "{}", recall.signature);
    }
}
