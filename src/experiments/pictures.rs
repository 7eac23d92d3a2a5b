//! The figures of a grid.

use std::fmt::Write as _;
use std::path::Path;

use super::amounts::Amount;
use super::collect::{CollectError, Row};
use super::evaluator::Evaluator;
use super::figures::{CurveRow, ScatterPoint, efficiency, joint_curves, scatter, tsne, verb_label};
use super::grid::{Cell, Grid, Role};
use super::run::load_cell;
use super::score::{Outcome, score};
use crate::evaluation::Resampling;
use crate::evaluation::motion::Embeddings;
use crate::features::PreparedSet;
use crate::humanoid::Humanoid;
use crate::model::Selected;

/// Motions drawn as curves.
const NUM_MOTIONS: usize = 4;
/// Neighbours that count in t-SNE, where there are enough points.
const PERPLEXITY: f64 = 30.0;

/// File names and contents: Fig. 6, Fig. 5-2, and curves over the number of pairs; of the first seed and part.
///
/// # Errors
/// [`CollectError`] when a model cannot be read or scored.
pub fn pictures(
    (grid, full, out): (&Grid, &PreparedSet, &Path),
    rows: &[Row],
    selected: &Selected,
    humanoid: &Humanoid,
) -> Result<Vec<(&'static str, String)>, CollectError> {
    let resampling = Resampling { num_resamples: grid.resamples, seed: 0 };
    let mut pictures = vec![("efficiency.svg", efficiency(rows, resampling).svg())];
    let shown = shown(rows, grid.sweep());
    // Of all pairs alone there is no model with stage 1, unless it was asked for.
    let (_, first) = shown[0];
    let cell = |row: &Row| Cell {
        paired: row.paired,
        role: row.role,
        non_paired: row.non_paired,
        seed: grid.seeds[0],
        fold: grid.parts()[0],
    };
    // Latents of the model itself, not of the one that judges.
    let (bundle, set) = load_cell(grid, &cell(first), full, out, selected)?;
    let found = score(&bundle, &Evaluator::new(&bundle), &set, &set.test, humanoid, &grid.decoding)
        .map_err(|error| CollectError::Score { cell: cell(first).name(), error })?;
    let points = |latents: &Embeddings| -> Vec<ScatterPoint> {
        let places = tsne(latents, PERPLEXITY);
        let pairs = set.test.iter().zip(places);
        pairs
            .map(|(pair, place)| ScatterPoint {
                place,
                label: verb_label(&set.captions[pair.caption].text).to_owned(),
                name: set.motions[pair.motion].id.clone(),
            })
            .collect()
    };
    let panels = [
        ("a) motions".to_owned(), points(&found.latents[1])),
        ("b) captions".to_owned(), points(&found.latents[0])),
    ];
    pictures.push(("latents.svg", scatter(&panels)));

    let parts: Vec<&Outcome> = shown.iter().map(|(_, row)| &row.seeds[0].parts[0]).collect();
    let chosen = lively(&set);
    let rows: Vec<CurveRow<'_>> = chosen
        .iter()
        .map(|&place| {
            let motion = &set.motions[set.test[place].motion];
            let made = parts.iter().map(|part| part.motions[place].as_slice()).collect();
            (motion.id.clone(), motion.frames.as_slice(), made)
        })
        .collect();
    let systems: Vec<&str> = shown.iter().map(|(name, _)| *name).collect();
    pictures.push(("joints.svg", joint_curves(&set.normalizer, set.rate_hz, &systems, &rows)));
    Ok(pictures)
}

/// The rows of some pairs that are drawn, by name: with stage 1, where there is one, and without.
fn shown(rows: &[Row], paired: Amount) -> Vec<(&'static str, &Row)> {
    let find = |role: Role| {
        let is_main = |row: &&Row| row.non_paired.is_none_or(|amount| amount == Amount::All);
        rows.iter().filter(is_main).find(|row| row.role == role && row.paired == paired)
    };
    let named = [("with stage 1", find(Role::Proposed)), ("without stage 1", find(Role::Vanilla))];
    named.into_iter().filter_map(|(name, row)| Some((name, row?))).collect()
}

/// Places of test pairs with different verbs, the first of each.
fn lively(set: &PreparedSet) -> Vec<usize> {
    let mut chosen: Vec<(usize, &str)> = Vec::new();
    for (place, pair) in set.test.iter().enumerate() {
        let label = verb_label(&set.captions[pair.caption].text);
        if chosen.len() < NUM_MOTIONS && chosen.iter().all(|(_, known)| *known != label) {
            chosen.push((place, label));
        }
    }
    chosen.into_iter().map(|(place, _)| place).collect()
}

/// Fig. 5-1 as Markdown: what models with and without stage 1 write of the motions of the first part.
///
/// With `references`, also what people wrote; that text is for the eye and is not to be kept where it has no licence.
#[must_use]
pub fn captions(grid: &Grid, set: &PreparedSet, rows: &[Row], references: bool) -> String {
    let shown = shown(rows, grid.sweep());
    let mut headings: Vec<&str> = shown.iter().map(|(name, _)| *name).collect();
    if references {
        headings.extend(["nearest in pose space", "people"]);
    }
    let mut text = format!(
        "# Captions of held-out motions\n\n{} pairs, seed {}, first part.\n\n| motion | {} |\n|---|{}\n",
        grid.sweep(),
        grid.seeds[0],
        headings.join(" | "),
        "---|".repeat(headings.len())
    );
    let parts: Vec<&Outcome> = shown.iter().map(|(_, row)| &row.seeds[0].parts[0]).collect();
    for (place, ours) in parts[0].described.iter().enumerate() {
        let captions: Vec<&str> = parts.iter().map(|part| part.described[place].caption.as_str()).collect();
        // Writing to a string cannot fail.
        let _ = write!(text, "| {} | {} |", ours.id, captions.join(" | "));
        if references {
            let motion = set.motions.iter().position(|motion| motion.id == ours.id);
            let said =
                set.captions.iter().filter(|caption| caption.motion.is_some() && caption.motion == motion);
            let said: Vec<&str> = said.map(|caption| caption.text.as_str()).collect();
            let _ = write!(text, " {} | {} |", ours.nearest, said.join(" / "));
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::tables::tests::{grid, rows};
    use crate::training::tests::four_pairs;

    #[test]
    fn columns_are_named_after_the_rows_they_show() {
        let rows = rows(1);
        let names = |paired| shown(&rows, paired).iter().map(|(name, _)| *name).collect::<Vec<_>>();
        assert_eq!(names(Amount::Some(2)), ["with stage 1", "without stage 1"]);
        assert_eq!(shown(&rows, Amount::Some(2))[0].1.non_paired, Some(Amount::All));
        assert_eq!(names(Amount::All), ["without stage 1"]);
        let text = captions(&grid("[1]"), &four_pairs(), &rows, false);
        assert!(text.contains("| motion | with stage 1 | without stage 1 |\n|---|---|---|\n"), "{text}");
        assert_eq!(text.lines().filter(|line| line.starts_with("| motion")).count(), 1 + 4);
        let text = captions(&grid("[1]"), &four_pairs(), &rows, true);
        assert!(text.contains("people |\n|---|---|---|---|---|\n") && text.contains("caption 3"), "{text}");
    }
}
