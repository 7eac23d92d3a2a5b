//! Which models are compared.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::amounts::Amount;
use crate::manifest::{SettingsFile, SettingsFileError};
use crate::training::{Preset, RunSettings, Schedule};
use crate::translation::Search;

/// A grid of models: some numbers of pairs, each with and without stage 1, and some numbers of non-paired samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Folder that `rprae prepare` made.
    pub prepared: PathBuf,
    /// Numbers of pairs of stage 2 (the paper: 500, 250, 100, and all as the reference); `"all"` is the reference.
    pub paired: Vec<Amount>,
    /// Smaller numbers of non-paired captions and motions of stage 1, at [`Grid::sweep_paired`] pairs (Table 3).
    #[serde(default)]
    pub non_paired: Vec<usize>,
    /// Number of pairs of the rows of [`Grid::non_paired`]. Default: the largest of [`Grid::paired`] that is a number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep_paired: Option<Amount>,
    /// Train the reference with stage 1 too. Default false, as in the paper, where it has no more data.
    #[serde(default)]
    pub reference_with_stage1: bool,
    /// What models without stage 1 are given instead. Default: as many updates as both stages have.
    #[serde(default = "equal_updates")]
    pub vanilla: Schedule,
    /// Seeds: of the first weights, the order of the data, and which pairs are drawn.
    pub seeds: Vec<u64>,
    /// Parts of a cross-validation over all motions that have captions; 0 keeps the split of the set. Default 0.
    ///
    /// Of k parts one is scored, the next one watched while training, and the rest learned from.
    #[serde(default)]
    pub folds: usize,
    /// The parts that are scored, counted from 0, where there is no time for all. Default: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<Vec<usize>>,
    /// Draws for intervals. Default 1000.
    #[serde(default = "thousand")]
    pub resamples: usize,
    /// Folder of an encoder for BERTScore; the scores are absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<PathBuf>,
    /// Folder of an encoder for the sentence cosine; the score is absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sentence_encoder: Option<PathBuf>,
    /// How captions are looked for when the models are scored. Default: always the most probable next word.
    #[serde(default, skip_serializing_if = "is_default")]
    pub decoding: Search,
    /// Settings of every run, as `rprae train --config` takes them; `prepared`, `seed` and the schedule are set here.
    #[serde(default)]
    pub run: toml::Table,
}

fn equal_updates() -> Schedule {
    Schedule::VanillaEqualUpdates
}

fn is_default(decoding: &Search) -> bool {
    *decoding == Search::default()
}

fn thousand() -> usize {
    1000
}

/// Whether a model has stage 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Pairs alone.
    Vanilla,
    /// Stage 1 on non-paired data first.
    Proposed,
}

/// One model of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Cell {
    /// Pairs of stage 2.
    pub paired: Amount,
    /// With or without stage 1.
    pub role: Role,
    /// Non-paired captions and motions of stage 1; none without it.
    pub non_paired: Option<Amount>,
    /// Seed of everything.
    pub seed: u64,
    /// Part that is scored.
    pub fold: usize,
}

/// Why a grid cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// The file cannot be read, or is no grid.
    #[error(transparent)]
    File(#[from] SettingsFileError),
    /// A value that makes no sense.
    #[error("use the grid: {name} {reason}")]
    Value {
        /// Setting.
        name: &'static str,
        /// What is wrong with it.
        reason: String,
    },
}

impl Grid {
    /// Reads a grid and checks it.
    ///
    /// # Errors
    /// [`GridError`] names the file, the place and the reason.
    pub fn read(path: &Path) -> Result<Self, GridError> {
        let grid: Self = SettingsFile::open(path)?.parse()?;
        grid.check()?;
        Ok(grid)
    }

    /// Checks every setting, and those of the runs.
    ///
    /// # Errors
    /// [`GridError::Value`] names the first that makes no sense, with its place.
    pub fn check(&self) -> Result<(), GridError> {
        let wrong = |name, reason: &str| Err(GridError::Value { name, reason: reason.to_owned() });
        if !self.paired.contains(&Amount::All) {
            return wrong("paired", "has no \"all\", the reference that the others are related to");
        }
        let is_empty = |amount: &Amount| *amount == Amount::Some(0);
        if self.paired.iter().any(is_empty) || self.non_paired.contains(&0) {
            return wrong("paired and non_paired", "cannot be 0: models without stage 1 are there anyway");
        }
        self.check_amounts()?;
        if let Some(reason) = repeated(&self.seeds) {
            return wrong("seeds", &reason);
        }
        if self.seeds.is_empty() || self.seeds.iter().any(|&seed| i64::try_from(seed).is_err()) {
            return wrong("seeds", "needs at least one seed, none above 2^63 - 1");
        }
        if self.folds == 1 || self.folds == 2 || self.folds > 100 {
            return wrong("folds", "is 0 for the split of the set, or 3 to 100");
        }
        let parts = self.parts();
        if parts.is_empty() || parts.iter().any(|&part| part >= self.folds.max(1)) {
            return wrong("parts", "names none, or one that is not below folds");
        }
        if !(100..=1_000_000).contains(&self.resamples) {
            return wrong("resamples", "is outside 100 to 1000000");
        }
        if let Err(error) = self.decoding.check() {
            return wrong("decoding", &format!("is wrong: {error}"));
        }
        if self.vanilla == Schedule::TwoStage {
            return wrong("vanilla", "is two-stage, which has stage 1");
        }
        if let Some(key) = ["prepared", "seed"].into_iter().find(|key| self.run.contains_key(*key)) {
            return wrong("run", &format!("sets {key}, which the grid itself decides"));
        }
        for cell in self.cells() {
            let settings = self.settings(&cell)?;
            settings
                .check()
                .map_err(|error| GridError::Value { name: "run", reason: format!("is wrong: {error}") })?;
        }
        Ok(())
    }

    /// Each amount once, and those of [`Grid::non_paired`] at least as many as the pairs that are drawn from them.
    fn check_amounts(&self) -> Result<(), GridError> {
        let wrong = |name, reason| Err(GridError::Value { name, reason });
        if let Some(reason) = repeated(&self.paired) {
            return wrong("paired", reason);
        }
        if let Some(reason) = repeated(&self.non_paired) {
            return wrong("non_paired", reason);
        }
        let sweep = self.sweep();
        if !self.paired.contains(&sweep) {
            let paired: Vec<String> = self.paired.iter().map(Amount::to_string).collect();
            return wrong(
                "sweep_paired",
                format!("is {sweep}, which is not in paired ({})", paired.join(", ")),
            );
        }
        let Amount::Some(pairs) = sweep else { return Ok(()) };
        match self.non_paired.iter().position(|&amount| amount < pairs) {
            Some(place) => wrong(
                "non_paired",
                format!(
                    "[{place}] is {}, fewer than the {pairs} pairs of these rows (sweep_paired), which are among them",
                    self.non_paired[place]
                ),
            ),
            None => Ok(()),
        }
    }

    /// Number of pairs of the rows with fewer non-paired samples.
    #[must_use]
    pub fn sweep(&self) -> Amount {
        let largest = self.paired.iter().copied().filter(|amount| *amount != Amount::All).max();
        self.sweep_paired.or(largest).unwrap_or(Amount::All)
    }

    /// The parts that are scored, in rising order.
    #[must_use]
    pub fn parts(&self) -> Vec<usize> {
        let mut parts = self.parts.clone().unwrap_or_else(|| (0..self.folds.max(1)).collect());
        parts.sort_unstable();
        parts.dedup();
        parts
    }

    /// All models, the reference first, each once.
    #[must_use]
    pub fn cells(&self) -> Vec<Cell> {
        let mut kinds = Vec::new();
        let mut paired = self.paired.clone();
        paired.sort_unstable_by(|a, b| b.cmp(a));
        for &amount in &paired {
            kinds.push((amount, Role::Vanilla, None));
        }
        for &amount in &paired {
            if amount != Amount::All || self.reference_with_stage1 {
                kinds.push((amount, Role::Proposed, Some(Amount::All)));
            }
        }
        let mut fewer = self.non_paired.clone();
        fewer.sort_unstable_by(|a, b| b.cmp(a));
        kinds.extend(fewer.into_iter().map(|n| (self.sweep(), Role::Proposed, Some(Amount::Some(n)))));
        let mut cells = Vec::new();
        // Seed by seed and fold by fold, so that what is there early is a whole small grid.
        for &seed in &self.seeds {
            for fold in self.parts() {
                for &(paired, role, non_paired) in &kinds {
                    let cell = Cell { paired, role, non_paired, seed, fold };
                    if !cells.contains(&cell) {
                        cells.push(cell);
                    }
                }
            }
        }
        cells
    }

    /// Settings of the run of one model.
    ///
    /// # Errors
    /// [`GridError::Value`] when [`Grid::run`] has what no run has.
    pub fn settings(&self, cell: &Cell) -> Result<RunSettings, GridError> {
        let wrong = |reason: String| GridError::Value { name: "run", reason };
        let preset = match self.run.get("preset") {
            Some(preset) => preset
                .clone()
                .try_into::<Preset>()
                .map_err(|error| wrong(format!("has an unknown preset: {error}")))?,
            None => Preset::Compact,
        };
        let base = toml::Table::try_from(RunSettings::of(preset))
            .map_err(|error| wrong(format!("has no written form: {error}")))?;
        let mut settings: RunSettings = over(base, &self.run)
            .try_into()
            .map_err(|error| wrong(format!("has what no run has: {error}")))?;
        settings.preset = preset;
        settings.prepared.clone_from(&self.prepared);
        settings.seed = cell.seed;
        settings.training.schedule = match cell.role {
            Role::Vanilla => self.vanilla,
            Role::Proposed => Schedule::TwoStage,
        };
        Ok(settings)
    }
}

/// The first value that is there twice, with both places.
fn repeated<T: PartialEq + std::fmt::Display>(values: &[T]) -> Option<String> {
    values.iter().enumerate().find_map(|(place, value)| {
        let first = values[..place].iter().position(|before| before == value)?;
        Some(format!("[{place}] is {value}, as [{first}] is; name each once"))
    })
}

/// One table laid over another, level by level.
fn over(mut under: toml::Table, above: &toml::Table) -> toml::Table {
    for (key, value) in above {
        let merged = match (under.remove(key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(value)) => {
                toml::Value::Table(over(below, value))
            }
            (_, value) => value.clone(),
        };
        under.insert(key.clone(), merged);
    }
    under
}

impl Cell {
    /// Name of its folder.
    #[must_use]
    pub fn name(&self) -> String {
        let Self { paired, seed, fold, .. } = self;
        let non_paired = self.non_paired.map_or_else(|| "0".to_owned(), |amount| amount.to_string());
        format!("paired-{paired}_nonpaired-{non_paired}_seed-{seed}_fold-{fold}")
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::translation::Choose;

    pub(in crate::experiments) fn grid(text: &str) -> Grid {
        let base = "prepared = \"set\"\nseeds = [1, 2]\npaired = [100, 250, \"all\"]\n";
        toml::from_str(&format!("{base}{text}")).unwrap()
    }

    #[test]
    fn the_papers_rows_are_there_once() {
        let grid = grid("non_paired = [1000, 3000]\nfolds = 3\n");
        let cells = grid.cells();
        // Reference, two vanilla, two proposed, two with fewer non-paired; three folds, two seeds.
        assert_eq!(cells.len(), 7 * 3 * 2);
        let names: Vec<String> = cells[..7].iter().map(Cell::name).collect();
        assert_eq!(names[0], "paired-all_nonpaired-0_seed-1_fold-0");
        assert_eq!(names[3], "paired-250_nonpaired-all_seed-1_fold-0");
        assert_eq!(names[5], "paired-250_nonpaired-3000_seed-1_fold-0");
        grid.check().unwrap();
        let some = Grid { parts: Some(vec![2, 0]), ..grid };
        let folds: Vec<usize> = some.cells().iter().map(|cell| cell.fold).collect();
        assert_eq!((folds.len(), folds[0], folds[7]), (7 * 2 * 2, 0, 2));
    }

    #[test]
    fn runs_get_what_the_grid_says() {
        let grid =
            grid("[run]\npreset = \"compact\"\n[run.model]\nlatent = 33\n[run.training]\nbatch_size = 7\n");
        let [first, .., last] = grid.cells()[..] else { panic!("several cells") };
        let settings = grid.settings(&first).unwrap();
        assert_eq!((settings.model.latent, settings.training.batch_size, settings.seed), (33, 7, 1));
        assert_eq!(settings.model.action_units, RunSettings::of(Preset::Compact).model.action_units);
        assert_eq!(settings.training.schedule, Schedule::VanillaEqualUpdates);
        assert_eq!(grid.settings(&last).unwrap().training.schedule, Schedule::TwoStage);
        assert!(
            !toml::to_string_pretty(&grid).unwrap().contains("decoding"),
            "what is left out is the default"
        );
        let consensus =
            Grid { decoding: Search { choose: Choose::Consensus, beam: 9, ..grid.decoding }, ..grid };
        let again: Grid = toml::from_str(&toml::to_string_pretty(&consensus).unwrap()).unwrap();
        assert_eq!(again, consensus);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let refused = |text: &str| grid(text).check().unwrap_err().to_string();
        assert!(refused("[run]\nlatend = 3\n").contains("latend"));
        assert!(refused("[run]\nseed = 3\n").contains("seed"));
        assert!(refused("folds = 1\n").contains("folds"));
        assert!(refused("[decoding]\nchoose = \"consensus\"\n").contains("decoding.beam"));
        grid("[decoding]\nchoose = \"sampled-consensus\"\nbeam = 16\nseed = 3\n").check().unwrap();
        let refused_of = |seeds: &str, paired: &str, rest: &str| {
            let text = format!("prepared = \"set\"\nseeds = {seeds}\npaired = {paired}\n{rest}");
            toml::from_str::<Grid>(&text).unwrap().check().unwrap_err().to_string()
        };
        let message = refused_of("[1, 2, 1]", "[5, \"all\"]", "");
        assert!(message.contains("seeds [2] is 1, as [0] is"), "{message}");
        let message = refused_of("[1]", "[5, \"all\", 5]", "");
        assert!(message.contains("paired [2] is 5, as [0] is"), "{message}");
        let message = refused_of("[1]", "[5, \"all\"]", "non_paired = [9, 9]");
        assert!(message.contains("non_paired [1] is 9"), "{message}");
        let message = refused_of("[1]", "[5, \"all\"]", "non_paired = [9, 4]");
        assert!(message.contains("non_paired [1] is 4") && message.contains("5 pairs"), "{message}");
        for sweep in ["0", "7"] {
            let message = refused_of("[1]", "[5, \"all\"]", &format!("sweep_paired = {sweep}"));
            assert!(
                message.contains(&format!("sweep_paired is {sweep}, which is not in paired (5, all)")),
                "{message}"
            );
        }
        assert!(refused("folds = 3\nparts = [3]\n").contains("parts"));
        assert!(toml::from_str::<Grid>("prepared = \"set\"\nseeds = [1]\npaired = []\nfold = 3").is_err());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        std::fs::write(&path, "prepared = \"set\"\nseeds = [1]\npaired = [5]\n").unwrap();
        assert!(Grid::read(&path).unwrap_err().to_string().contains("\"all\""));
    }
}
