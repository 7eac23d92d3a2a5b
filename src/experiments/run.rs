//! Training the models of a grid, each in its own folder.

use std::fs;
use std::path::{Path, PathBuf};

use super::draw::{DrawError, draw};
use super::grid::{Cell, Grid, GridError};
use crate::features::{MirrorCount, PreparedSet};
use crate::manifest::{VERSION, write_file};
use crate::model::{self, Bundle, BundleError, Rprae, Selected};
use crate::training::{
    self, BUNDLE, Begin, CHECKPOINTS, CaptionScore, Event, Line, METRICS_FILE, Plan, RunFacts, RunFolder,
    RunSettings, SETTINGS_FILE, Schedule, TrainingError,
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

/// Data and settings of a model.
///
/// A model without stage 1 that is to have as many updates gets those of stage 1 as a number: its own data have none of the
/// samples they are counted by.
fn prepare(grid: &Grid, cell: &Cell, full: &PreparedSet) -> Result<(PreparedSet, RunSettings), CellError> {
    let drawn = draw(full, cell, grid.folds).map_err(|error| CellError::Draw { cell: cell.name(), error })?;
    let mut settings = grid.settings(cell)?;
    let training = &mut settings.training;
    if training.schedule == Schedule::VanillaEqualUpdates {
        let samples = if training.mirror { drawn.mirrored_stage1_samples } else { drawn.stage1_samples };
        training.stage1_iterations = Some(Plan::stage1_iterations(training, samples));
    }
    Ok((drawn.set, settings))
}

/// Checks that there are data for a model, and that its folder is free or holds a run of the same settings on the same data,
/// by this version, on this device.
///
/// # Errors
/// [`CellError`] says what is missing or what differs.
pub fn check_cell(
    grid: &Grid,
    cell: &Cell,
    full: &PreparedSet,
    out: &Path,
    selected: &Selected,
) -> Result<(), CellError> {
    let (set, settings) = prepare(grid, cell, full)?;
    let folder = cell_folder(out, cell);
    if folder.join(SETTINGS_FILE).exists() || is_trained(out, cell) {
        compare(&folder, cell, &set, &settings, selected)?;
    }
    Ok(())
}

/// Nothing when a run in a folder has these settings and data, by this version, on this device.
fn compare(
    folder: &Path,
    cell: &Cell,
    set: &PreparedSet,
    settings: &RunSettings,
    selected: &Selected,
) -> Result<(), CellError> {
    let other = |reason| Err(CellError::Other { folder: folder.to_owned(), reason });
    let before =
        RunFolder::settings(folder).map_err(|error| CellError::Training { cell: cell.name(), error })?;
    let Some(before) = before else { return other("by something that left no settings".to_owned()) };
    // Where the set lies does not matter; what is in it does, and its fingerprint says so.
    let settings = RunSettings { prepared: before.prepared.clone(), ..settings.clone() };
    let differences = settings.differences(&before);
    if !differences.is_empty() {
        return other(format!("with other settings ({})", differences.join("; ")));
    }
    let file = folder.join(training::RUN_FILE);
    let facts = match fs::read(&file) {
        Ok(facts) => facts,
        Err(error) => return other(format!("by something that left no {}: {error}", file.display())),
    };
    let facts: RunFacts = match serde_json::from_slice(&facts) {
        Ok(facts) => facts,
        Err(error) => return other(format!("by something that left no record ({error})")),
    };
    if facts.data != set.fingerprint {
        return other("on other data".to_owned());
    }
    if facts.rprae != VERSION {
        return other(format!("by version {} of this program, which is {VERSION}", facts.rprae));
    }
    if !facts.has_processor_of(&selected.name) {
        return other(format!("on {}, and {} computes now (--device)", facts.device, selected.name));
    }
    Ok(())
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
    let (set, mut settings) = prepare(grid, cell, full)?;
    let path = cell_folder(out, cell);
    let before = RunFolder::settings(&path).map_err(failed)?;
    let begin = if let Some(before) = before {
        // The set may have moved; what is in it is compared by its fingerprint.
        settings.prepared = before.prepared;
        Begin::Resume
    } else {
        Begin::New
    };
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
        mirrored: settings.training.mirror.then(|| MirrorCount::of(&set)),
    };
    drop(untrained);
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
    trained.bundle(&settings, &set).save(&path.join(BUNDLE), &card)?;
    // What it could go on from is of no use any more, and larger than the model.
    fs::remove_dir_all(path.join(CHECKPOINTS))?;
    Ok(())
}

/// A trained model with the data it was trained on.
///
/// # Errors
/// [`CellError`] when it cannot be read, or was trained with other settings, on other data, by another version or elsewhere.
pub fn load_cell(
    grid: &Grid,
    cell: &Cell,
    full: &PreparedSet,
    out: &Path,
    selected: &Selected,
) -> Result<(Bundle, PreparedSet), CellError> {
    let (set, settings) = prepare(grid, cell, full)?;
    let folder = cell_folder(out, cell);
    compare(&folder, cell, &set, &settings, selected)?;
    let bundle = Bundle::load(&folder.join(BUNDLE), &selected.device)?;
    // Models of earlier versions were kept without the first frames of motions.
    if bundle.has_starts() {
        return Ok((bundle, set));
    }
    let learned = set.renormalized(&bundle.normalizer);
    Ok((bundle.with_starts(&learned), set))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::amounts::Amount;
    use crate::experiments::draw::tests::full;
    use crate::experiments::grid::Role;
    use crate::experiments::grid::tests::grid;

    fn cell(role: Role, fold: usize) -> Cell {
        let non_paired = (role == Role::Proposed).then_some(Amount::All);
        Cell { paired: Amount::Some(4), role, non_paired, seed: 1, fold }
    }

    #[test]
    fn models_without_stage_1_have_as_many_updates() {
        // Counted by epochs, which the data of a model without stage 1 do not show.
        let epochs =
            grid("folds = 4\n[run.training]\nbatch_size = 2\nstage1_epochs = 3\nstage2_epochs = 5\n");
        let counted = grid("folds = 4\n[run.training]\nbatch_size = 2\nstage1_iterations = 7\n");
        let mirrored = grid("folds = 4\n[run.training]\nbatch_size = 2\nstage1_epochs = 3\nmirror = true\n");
        for (grid, fold) in [(&epochs, 0), (&epochs, 2), (&counted, 1), (&mirrored, 0)] {
            let plan = |role| {
                let (set, settings) = prepare(grid, &cell(role, fold), &full()).unwrap();
                assert_eq!(set.non_paired_motions.is_empty(), role == Role::Vanilla);
                Plan::new(&settings.training, &set)
            };
            let (vanilla, proposed) = (plan(Role::Vanilla), plan(Role::Proposed));
            assert!(vanilla.stage1 == 0 && proposed.stage1 > 0);
            assert_eq!(vanilla.total(), proposed.total());
        }
    }

    #[test]
    fn what_lies_in_a_folder_is_compared_but_for_its_place() {
        let (grid, full, cell) = (grid("folds = 4\n"), full(), cell(Role::Vanilla, 0));
        let selected = model::cpu();
        let (set, settings) = prepare(&grid, &cell, &full).unwrap();
        let out = tempfile::tempdir().unwrap();
        let folder = cell_folder(out.path(), &cell);
        let facts = RunFacts {
            rprae: VERSION.to_owned(),
            data: set.fingerprint.clone(),
            device: selected.name.clone(),
            parameters: Vec::new(),
            mirrored: None,
        };
        let check = |grid: &Grid, full: &PreparedSet| check_cell(grid, &cell, full, out.path(), &selected);
        check(&grid, &full).unwrap();
        let begun = |facts: &RunFacts| {
            drop(RunFolder::open(&folder, &settings, facts, Begin::Overwrite).unwrap());
        };
        begun(&facts);
        check(&grid, &full).unwrap();
        check(&Grid { prepared: "elsewhere".into(), ..grid.clone() }, &full).unwrap();
        let mut other = full.clone();
        other.motions[3].frames[0][0] = 0.25;
        let refused = |grid: &Grid, full: &PreparedSet| check(grid, full).unwrap_err().to_string();
        assert!(refused(&grid, &other).contains("other data"));
        let longer = crate::experiments::grid::tests::grid("folds = 4\n[run.training]\nbatch_size = 9\n");
        assert!(refused(&longer, &full).contains("batch_size"));
        begun(&RunFacts { device: "cpu, 77 threads".to_owned(), ..facts.clone() });
        check(&grid, &full).unwrap();
        begun(&RunFacts { device: "another processor, 2 threads".to_owned(), ..facts.clone() });
        assert!(refused(&grid, &full).contains("another processor"));
        begun(&RunFacts { rprae: "0.0.0".to_owned(), ..facts });
        assert!(refused(&grid, &full).contains("version 0.0.0"));
    }
}
