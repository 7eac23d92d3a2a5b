//! Training the models of a grid, each in its own folder.

use std::fs;
use std::path::{Path, PathBuf};

use super::draw::{DrawError, draw};
use super::grid::{Cell, Grid, GridError};
use crate::features::PreparedSet;
use crate::manifest::{VERSION, write_file};
use crate::model::{self, Bundle, BundleError, Rprae, Selected};
use crate::training::{
    self, BUNDLE, Begin, CHECKPOINTS, CaptionScore, Event, Line, METRICS_FILE, Plan, RunFacts, RunFolder,
    SETTINGS_FILE, TrainingError,
};

/// Folder of the models within that of a grid.
pub const CELLS: &str = "cells";

/// Why a model of a grid cannot be trained or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CellError {
    /// The grid has what no run has.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// There is no data for it.
    #[error("draw the data of {cell}: {error}")]
    Draw {
        /// Name of the model.
        cell: String,
        /// Why not.
        error: DrawError,
    },
    /// The run stopped.
    #[error("train {cell}: {error}")]
    Training {
        /// Name of the model.
        cell: String,
        /// Why.
        error: TrainingError,
    },
    /// Its model cannot be written or read.
    #[error(transparent)]
    Bundle(#[from] BundleError),
    /// It was trained on something else.
    #[error("use {}: it was trained {reason}; choose another --out", .folder.display())]
    Other {
        /// Folder of the run.
        folder: PathBuf,
        /// What differs.
        reason: String,
    },
    /// The file system refuses.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

/// Folder of the run of a model.
#[must_use]
pub fn cell_folder(out: &Path, cell: &Cell) -> PathBuf {
    out.join(CELLS).join(cell.name())
}

/// Whether a model is trained: its bundle is written last, whole or not at all.
#[must_use]
pub fn is_trained(out: &Path, cell: &Cell) -> bool {
    cell_folder(out, cell).join(BUNDLE).exists()
}

/// Trains a model, from its last checkpoint where it was stopped; one that is trained is left as it is.
///
/// # Errors
/// [`CellError`] says what stopped it, or that its folder holds the run of another grid.
pub fn train_cell(
    grid: &Grid,
    cell: &Cell,
    full: &PreparedSet,
    out: &Path,
    selected: &Selected,
    caption_score: Option<&CaptionScore<'_>>,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<(), CellError> {
    if is_trained(out, cell) {
        return Ok(());
    }
    let failed = |error| CellError::Training { cell: cell.name(), error };
    let set = draw(full, cell, grid.folds).map_err(|error| CellError::Draw { cell: cell.name(), error })?;
    let settings = grid.settings(cell)?;
    let device = &selected.device;
    let untrained = Rprae::new(&settings.model, &set.vocabulary, settings.seed, device);
    let facts = RunFacts {
        rprae: VERSION.to_owned(),
        data: set.fingerprint.clone(),
        device: selected.name.clone(),
        parameters: model::num_parameters(&untrained)
            .into_iter()
            .map(|(part, count)| (part.to_owned(), count))
            .collect(),
    };
    drop(untrained);
    let path = cell_folder(out, cell);
    let begin = if path.join(SETTINGS_FILE).exists() { Begin::Resume } else { Begin::New };
    let folder = RunFolder::open(&path, &settings, &facts, begin).map_err(failed)?;
    let trained =
        training::train(&set, &settings, device, &folder, caption_score, observe).map_err(failed)?;

    let lines = training::read_metrics(&path.join(METRICS_FILE)).map_err(failed)?;
    let plan = Plan::new(&settings.training, &set);
    write_file(&path.join("curves.svg"), training::curves(&lines, plan.stage1).as_bytes())?;
    let best = lines.into_iter().find_map(|line| match line {
        Line::Validation(found) if found.iteration == trained.iteration => Some(found),
        _ => None,
    });
    let card = training::card(&settings, &set, &facts, &trained, best.as_ref(), "");
    Bundle::new(&trained.model, &settings.model, &set).save(&path.join(BUNDLE), &card)?;
    // What it could go on from is of no use any more, and larger than the model.
    fs::remove_dir_all(path.join(CHECKPOINTS))?;
    Ok(())
}

/// A trained model with the data it was trained on.
///
/// # Errors
/// [`CellError`] when it cannot be read, or was trained with other settings or on other data.
pub fn load_cell(
    grid: &Grid,
    cell: &Cell,
    full: &PreparedSet,
    out: &Path,
    selected: &Selected,
) -> Result<(Bundle, PreparedSet), CellError> {
    let folder = cell_folder(out, cell);
    let failed = |error| CellError::Training { cell: cell.name(), error };
    let set = draw(full, cell, grid.folds).map_err(|error| CellError::Draw { cell: cell.name(), error })?;
    let settings = grid.settings(cell)?;
    let other = |reason| CellError::Other { folder: folder.clone(), reason };
    let before = RunFolder::settings(&folder).map_err(failed)?;
    let differences = before.map_or_else(Vec::new, |before| settings.differences(&before));
    // Where the set lies does not matter; what is in it does, and its fingerprint says so.
    let differences: Vec<String> =
        differences.into_iter().filter(|line| !line.starts_with("prepared:")).collect();
    if !differences.is_empty() {
        return Err(other(format!("with other settings ({})", differences.join("; "))));
    }
    let facts = fs::read(folder.join(training::RUN_FILE))?;
    let facts: RunFacts = serde_json::from_slice(&facts)
        .map_err(|error| other(format!("by something that left no record ({error})")))?;
    if facts.data != set.fingerprint {
        return Err(other("on other data".to_owned()));
    }
    Ok((Bundle::load(&folder.join(BUNDLE), &selected.device)?, set))
}
