//! The figures of a grid.

use std::fmt::Write as _;
use std::path::Path;

use super::amounts::Amount;
use super::collect::{CollectError, Row};
use super::evaluator::Evaluator;
use super::figures::{CurveRow, ScatterPoint, efficiency, joint_curves, scatter, tsne, verb_label};
use super::grid::{Cell, Grid, Role};
use super::run::load_cell;
use super::score::score;
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
    let [with, without] = shown(rows, grid.sweep());
    let cell = |row: &Row| Cell {
        paired: row.paired,
        role: row.role,
        non_paired: row.non_paired,
        seed: grid.seeds[0],
        fold: grid.parts()[0],
    };
    // Latents of the model itself, not of the one that judges.
    let (bundle, set) = load_cell(grid, &cell(with), full, out, selected)?;
    let found = score(&bundle, &Evaluator::new(&bundle), &set, &set.test, humanoid)
        .map_err(|error| CollectError::Score { cell: cell(with).name(), error })?;
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

    let parts = [&with.seeds[0].parts[0], &without.seeds[0].parts[0]];
    let chosen = lively(&set);
    let rows: Vec<CurveRow<'_>> = chosen
        .iter()
        .map(|&place| {
            let motion = &set.motions[set.test[place].motion];
            let made = parts.iter().map(|part| part.motions[place].as_slice()).collect();
            (motion.id.clone(), motion.frames.as_slice(), made)
        })
        .collect();
    let systems = ["with stage 1", "without"];
    pictures.push(("joints.svg", joint_curves(&set.normalizer, set.rate_hz, &systems, &rows)));
    Ok(pictures)
}

/// The row with stage 1 at some pairs and the one without; the reference where there are none.
fn shown(rows: &[Row], paired: Amount) -> [&Row; 2] {
    let find = |role: Role| {
        rows.iter()
            .find(|row| row.role == role && row.paired == paired && row.non_paired != Some(Amount::Some(0)))
            .unwrap_or(&rows[0])
    };
    [find(Role::Proposed), find(Role::Vanilla)]
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
    let [with, without] = shown(rows, grid.sweep());
    let parts = [&with.seeds[0].parts[0], &without.seeds[0].parts[0]];
    let mut text = format!(
        "# Captions of held-out motions\n\n{} pairs, seed {}, first part.\n\n| motion | with stage 1 | without |{}\n\
         |---|---|---|{}\n",
        with.paired,
        grid.seeds[0],
        if references { " nearest in pose space | people |" } else { "" },
        if references { "---|---|" } else { "" }
    );
    for (ours, other) in parts[0].described.iter().zip(&parts[1].described) {
        let _ = write!(text, "| {} | {} | {} |", ours.id, ours.caption, other.caption);
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
