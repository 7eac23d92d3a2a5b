//! `rprae tables`: a grid of models, trained, scored, and printed as the tables of the paper.

mod bitmaps;
mod display;

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::Args;

use self::bitmaps::Bitmaps;
use self::display::Display;
use super::evaluate::open_token_encoder;
use super::exit::{Exit, Failure, OrExit};
use super::output;
use super::progress::Steps;
use super::train::Device;
use crate::evaluation::encoder::Encoder;
use crate::evaluation::{Baseline, Panel, SentenceEncoder, TokenEncoder};
use crate::experiments::{self, Cell, CellError, Grid};
use crate::features::PreparedSet;
use crate::manifest::write_file;
use crate::model::{self, DeviceChoice, Selected};

/// Name of the settings in the folder of a grid.
const GRID_FILE: &str = "grid.toml";
/// Name of the scores there; written last, so it says that the results are whole.
const SCORES_FILE: &str = "scores.json";

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
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
    /// Folder of the encoder for BERTScore, before what the grid says
    #[arg(long, value_name = "DIR", conflicts_with = "shard")]
    pub encoder: Option<PathBuf>,
    /// Folder of the encoder for the sentence cosine, before what the grid says
    #[arg(long, value_name = "DIR", conflicts_with = "shard")]
    pub sentence_encoder: Option<PathBuf>,
    /// Replace the tables and scores that --out holds; its models are kept
    #[arg(long, conflicts_with = "shard")]
    pub overwrite: bool,
    /// Write every figure as PNG too (needs a program built with --features png)
    #[arg(long, conflicts_with = "shard")]
    pub png: bool,
    /// What computes [default: auto]
    #[arg(long, value_enum)]
    pub device: Option<Device>,
    /// Print what people wrote of the motions of Fig. 5-1 too; no file gets it
    #[arg(long, conflicts_with = "shard")]
    pub references: bool,
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
    let mut grid = Grid::read(&args.grid).or_usage()?;
    grid.encoder = args.encoder.clone().or(grid.encoder);
    grid.sentence_encoder = args.sentence_encoder.clone().or(grid.sentence_encoder);
    // Whatever would stop the scoring is found before hours of training.
    let bitmaps = Bitmaps::new(args.png).or_usage()?;
    refuse(args, &grid).or_usage()?;
    let encoders = match args.shard {
        None => Encoders::open(&grid).or_usage()?,
        Some(_) => Encoders::default(),
    };
    let set = PreparedSet::load(&grid.prepared).or_usage()?;
    let selected = model::select(args.device.map_or(DeviceChoice::Auto, DeviceChoice::from)).or_usage()?;
    check(args, &grid, &set, &selected)?;
    begin(args, &grid).or_failed()?;
    train(args, &grid, &set, &selected)?;
    let cells = grid.cells();
    let missing: Vec<&Cell> = cells.iter().filter(|cell| !experiments::is_trained(&args.out, cell)).collect();
    match (missing.first(), args.shard) {
        (None, None) => report(args, (&grid, &set), &selected, &encoders, &bitmaps),
        (None, Some(_)) => {
            let text = format!(
                "all {} models are trained; run once more without --shard, and the tables are made\n",
                cells.len()
            );
            output::print(&text).or_failed()?;
            Ok(Exit::Clean)
        }
        (Some(first), shard) => {
            let text = format!(
                "{} of {} models are not trained yet, the first {}; run the other shards, bring their {} here, and run once \
                 more without --shard\n",
                missing.len(),
                cells.len(),
                first.name(),
                experiments::CELLS
            );
            output::print(&text).or_failed()?;
            // A shard leaves the others to others; a whole run that lacks models has lost them.
            Ok(if shard.is_some() { Exit::Clean } else { Exit::Failed })
        }
    }
}

/// Refuses a folder with results that would be replaced, or with another grid.
fn refuse(args: &TablesArgs, grid: &Grid) -> anyhow::Result<()> {
    if args.shard.is_none() && args.out.join(SCORES_FILE).exists() && !args.overwrite {
        bail!(
            "use {}: it holds tables and scores; --overwrite replaces them and keeps the models, or choose another --out",
            args.out.display()
        );
    }
    let path = args.out.join(GRID_FILE);
    if path.exists() {
        let before = Grid::read(&path)?;
        // More seeds or amounts of the same runs go into the same folder; each model checks its own settings.
        if (before.folds, &before.run) != (grid.folds, &grid.run) {
            bail!(
                "use {}: it holds models of a grid with other folds or other settings of the runs; choose another --out",
                args.out.display()
            );
        }
    }
    Ok(())
}

/// Checks the data and the folder of every model.
fn check(args: &TablesArgs, grid: &Grid, set: &PreparedSet, selected: &Selected) -> Result<(), Failure> {
    let cells = grid.cells();
    let steps = Steps::new(args.quiet, cells.len());
    for cell in &cells {
        experiments::check_cell(grid, cell, set, &args.out, selected).map_err(failure)?;
        steps.step(&format!("check {}", cell.name()), None);
    }
    steps.finish();
    Ok(())
}

/// Saves the grid.
fn begin(args: &TablesArgs, grid: &Grid) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.out).with_context(|| format!("make {}", args.out.display()))?;
    let text = toml::to_string_pretty(grid)?;
    Ok(write_file(&args.out.join(GRID_FILE), text.as_bytes())?)
}

/// The encoders of a grid, loaded.
#[derive(Default)]
struct Encoders {
    token: Option<(Encoder, Option<Baseline>)>,
    sentence: Option<Encoder>,
}

impl Encoders {
    fn open(grid: &Grid) -> anyhow::Result<Self> {
        let token = grid.encoder.as_ref().map(|folder| open_token_encoder(folder, None, None)).transpose()?;
        let sentence =
            grid.sentence_encoder.as_ref().map(|folder| Encoder::open(folder, None)).transpose()?;
        Ok(Self { token, sentence })
    }

    fn panel(&self) -> Panel<'_> {
        Panel {
            token_encoder: self.token.as_ref().map(|(encoder, baseline)| TokenEncoder {
                encoder,
                prefix_space: true,
                baseline: baseline.clone(),
            }),
            sentence_encoder: self
                .sentence
                .as_ref()
                .map(|encoder| SentenceEncoder { encoder, pooling: encoder.pooling() }),
        }
    }
}

fn train(args: &TablesArgs, grid: &Grid, set: &PreparedSet, selected: &Selected) -> Result<(), Failure> {
    let (part, of) = args.shard.unwrap_or((1, 1));
    let cells: Vec<Cell> = grid
        .cells()
        .into_iter()
        .enumerate()
        .filter(|(place, _)| place % of == part - 1)
        .map(|(_, cell)| cell)
        .collect();
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

/// Scores all models, writes everything, prints the tables.
fn report(
    args: &TablesArgs,
    (grid, set): (&Grid, &PreparedSet),
    selected: &Selected,
    encoders: &Encoders,
    bitmaps: &Bitmaps,
) -> Result<Exit, Failure> {
    let panel = encoders.panel();
    let scores = args.out.join(SCORES_FILE);
    if scores.exists() {
        std::fs::remove_file(&scores).or_failed()?;
    }
    let humanoid = experiments::humanoid().or_failed()?;
    let here = (grid, set, args.out.as_path());
    let steps = Steps::new(args.quiet, grid.cells().len());
    let rows =
        experiments::collect(here, selected, &humanoid, &panel, &mut |cell| steps.step(&cell.name(), None))
            .or_failed()?;
    steps.finish();
    let write = |name: &str, text: &str| write_file(&args.out.join(name), text.as_bytes());
    write("samples.jsonl", &experiments::samples(grid, &rows).or_failed()?).or_failed()?;
    write("captions.md", &experiments::captions(grid, set, &rows, false)).or_failed()?;
    let tables = experiments::tables(grid, &rows);
    write("tables.md", &tables).or_failed()?;
    for (name, svg) in experiments::pictures(here, &rows, selected, &humanoid).or_failed()? {
        write(name, &svg).or_failed()?;
        bitmaps.write(&args.out.join(name), &svg).or_failed()?;
    }
    let record = experiments::record((grid, set), &selected.name, &rows, panel.absent());
    write(SCORES_FILE, &serde_json::to_string_pretty(&record).or_failed()?).or_failed()?;
    output::print(&tables).or_failed()?;
    if args.references {
        output::print(&experiments::captions(grid, set, &rows, true)).or_failed()?;
    }
    for absent in panel.absent() {
        eprintln!("not scored: {} ({})", absent.keys, absent.hint);
    }
    Ok(Exit::Clean)
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
