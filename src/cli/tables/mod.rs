//! `rprae tables`: a grid of models, trained, scored, and printed as the tables of the paper.

mod display;

use std::path::PathBuf;

use clap::Args;

use self::display::Display;
use super::exit::{Exit, Failure, OrExit};
use super::output;
use super::train::Device;
use crate::experiments::{self, Cell, CellError, Grid};
use crate::features::PreparedSet;
use crate::manifest::write_file;
use crate::model::{self, DeviceChoice, Selected};

/// Name of the settings in the folder of a grid.
const GRID_FILE: &str = "grid.toml";

#[derive(Debug, Args)]
pub(super) struct TablesArgs {
    /// Which models: data, numbers of pairs, seeds, folds, settings of the runs (TOML); unknown keys are refused
    #[arg(long, value_name = "TOML")]
    pub grid: PathBuf,
    /// Folder of the models and tables; models that are trained are kept, stopped ones go on from their last checkpoint
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Train the i-th of n parts of the models only. Folders of several machines are merged by copying their cells/ into
    /// one, and running once more without this
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
    /// What computes [default: auto]
    #[arg(long, value_enum)]
    pub device: Option<Device>,
    /// Print nothing but tables and errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// `2/5` as (2, 5), counted from 1.
fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
    match parts {
        Some((part, of)) if (1..=of).contains(&part) => Ok((part, of)),
        _ => Err("expected I/N with I from 1 to N, for example 2/5".to_owned()),
    }
}

pub(super) fn run(args: &TablesArgs) -> Result<Exit, Failure> {
    let grid = Grid::read(&args.grid).or_usage()?;
    let set = PreparedSet::load(&grid.prepared).or_usage()?;
    let selected = model::select(args.device.map_or(DeviceChoice::Auto, DeviceChoice::from)).or_usage()?;
    begin(args, &grid)?;
    train(args, &grid, &set, &selected)?;
    let missing: Vec<Cell> =
        grid.cells().into_iter().filter(|cell| !experiments::is_trained(&args.out, cell)).collect();
    if let Some(first) = missing.first() {
        output::print(&format!(
            "{} of {} models are not trained yet, the first {}; run the other shards, bring their {} here, and run once \
             more without --shard\n",
            missing.len(),
            grid.cells().len(),
            first.name(),
            experiments::CELLS
        ))
        .or_failed()?;
        return Ok(Exit::Clean);
    }
    Ok(Exit::Clean)
}

/// Saves the grid, or refuses a folder that holds another one.
fn begin(args: &TablesArgs, grid: &Grid) -> Result<(), Failure> {
    let path = args.out.join(GRID_FILE);
    if path.exists() {
        let before = Grid::read(&path).or_usage()?;
        // More seeds or amounts of the same runs go into the same folder; each model checks its own settings.
        if (before.folds, &before.run) != (grid.folds, &grid.run) {
            return Err(anyhow::anyhow!(
                "use {}: it holds models of a grid with other folds or other settings of the runs; choose another --out",
                args.out.display()
            ))
            .or_usage();
        }
    }
    std::fs::create_dir_all(&args.out).or_failed()?;
    let text = toml::to_string_pretty(grid).or_failed()?;
    write_file(&path, text.as_bytes()).or_failed()
}

fn train(args: &TablesArgs, grid: &Grid, set: &PreparedSet, selected: &Selected) -> Result<(), Failure> {
    let (part, of) = args.shard.unwrap_or((1, 1));
    let cells: Vec<Cell> =
        grid.cells().into_iter().enumerate().filter(|(place, _)| place % of == part - 1).map(|(_, cell)| cell).collect();
    let waiting: Vec<Cell> =
        cells.iter().copied().filter(|cell| !experiments::is_trained(&args.out, cell)).collect();
    let mut display = Display::new(args.quiet, cells.len(), waiting.len());
    if let Some(note) = &selected.note {
        display.line(note);
    }
    for cell in waiting {
        display.begin(&cell);
        let observe = &mut |event: crate::training::Event<'_>| display.observe(&event);
        experiments::train_cell(grid, &cell, set, &args.out, selected, None, observe).map_err(failure)?;
        display.end(&cell);
    }
    display.finish();
    Ok(())
}

fn failure(error: CellError) -> Failure {
    let exit = match &error {
        CellError::Training { error, .. } if error.is_usage() => Exit::Usage,
        CellError::Grid(_) | CellError::Draw { .. } | CellError::Other { .. } => Exit::Usage,
        _ => Exit::Failed,
    };
    Failure { exit, error: error.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_counted_from_one() {
        assert_eq!(shard("2/5"), Ok((2, 5)));
        for wrong in ["0/5", "6/5", "2", "a/b", "1/0"] {
            assert!(shard(wrong).is_err(), "{wrong}");
        }
    }
}
