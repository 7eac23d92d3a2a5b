//! Everything that decides what a training run learns.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::decay::Decay;
use crate::manifest::{SettingsFile, SettingsFileError};
use crate::model::{DeviceChoice, InvalidSetting, LossSettings, ModelSettings};

/// Which stages a run has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// Stage 1 on non-paired data, then stage 2 on pairs (Algorithm 1).
    TwoStage,
    /// Stage 2 alone, for as many epochs as it has in [`Schedule::TwoStage`].
    VanillaEqualEpochs,
    /// Stage 2 alone, for as many iterations as [`Schedule::TwoStage`] has in both stages.
    VanillaEqualUpdates,
}

/// The model a run leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Keep {
    /// That of the lowest validation loss of the last stage.
    Best,
    /// The last one: the loss, of words heard in closed loop above all, may rise while translations still get better.
    Last,
}

/// Sizes to begin from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The sizes of the paper: 15.8 million parameters.
    Paper,
    /// Sizes a CPU trains in hours.
    Compact,
}

/// How long and in which steps a model is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainingSettings {
    /// Which stages there are.
    pub schedule: Schedule,
    /// Sequences in a batch (B); the last batch of an epoch may have fewer.
    pub batch_size: usize,
    /// Epochs of stage 1.
    pub stage1_epochs: usize,
    /// Epochs of stage 2.
    pub stage2_epochs: usize,
    /// Iterations of stage 1 (`N_1`), instead of its epochs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stage1_iterations: Option<usize>,
    /// Iterations of stage 2 (`N_2`), instead of its epochs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stage2_iterations: Option<usize>,
    /// Iterations until the other part learns (`n_ch`); 0 lets both learn at every iteration.
    pub alternate_every: usize,
    /// Step size of Adam.
    pub learning_rate: f64,
    /// How it goes on through stage 2. Default constant, as in the paper.
    pub learning_rate_decay: Decay,
    /// Memory of Adam for the slope.
    pub beta_1: f32,
    /// Memory of Adam for its square.
    pub beta_2: f32,
    /// What keeps Adam from dividing by 0.
    pub epsilon: f32,
    /// Largest norm of the gradient of a part; longer ones are scaled down.
    pub clip_norm: f64,
    /// Iterations between validations; 0 validates at the end of each stage only.
    pub validate_every: usize,
    /// Iterations between checkpoints.
    pub checkpoint_every: usize,
    /// The model to keep at the end.
    pub keep: Keep,
    /// Learn from the mirror image of every pair and non-paired sample too, with left and right exchanged in its words.
    ///
    /// An epoch is about twice as long then. Ranges are widened to hold the images; nothing held out has one. A caption with
    /// a word whose image is not in the vocabulary has none. Default false.
    ///
    /// `Deviation:` the paper learns from what was recorded alone.
    pub mirror: bool,
    /// Stop stage 2 after this many validations without a better one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early_stop: Option<usize>,
}

impl Default for TrainingSettings {
    fn default() -> Self {
        Self {
            schedule: Schedule::TwoStage,
            batch_size: 80,
            stage1_epochs: 200,
            stage2_epochs: 400,
            stage1_iterations: None,
            stage2_iterations: None,
            alternate_every: 100,
            learning_rate: 1e-3,
            learning_rate_decay: Decay::Constant,
            beta_1: 0.9,
            beta_2: 0.999,
            epsilon: 1e-8,
            clip_norm: 5.0,
            validate_every: 500,
            checkpoint_every: 500,
            keep: Keep::Best,
            mirror: false,
            early_stop: None,
        }
    }
}

/// Everything that decides what a run learns, and nothing else.
///
/// `settings.toml` in a run folder is this; handing it back with `--config` repeats the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunSettings {
    /// Folder of the prepared data.
    pub prepared: PathBuf,
    /// Sizes that [`RunSettings::model`] began from.
    pub preset: Preset,
    /// Seed of the first weights and of the order of the data. At most 2^63 - 1, since TOML has no larger number.
    pub seed: u64,
    /// What computes.
    pub device: DeviceChoice,
    /// Source and licence of the data, for the model card of the bundle.
    pub notes: String,
    /// Sizes and decoding.
    pub model: ModelSettings,
    /// Losses.
    pub loss: LossSettings,
    /// Length and steps.
    pub training: TrainingSettings,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            prepared: PathBuf::new(),
            preset: Preset::Paper,
            seed: 1,
            device: DeviceChoice::Auto,
            notes: String::new(),
            model: ModelSettings::default(),
            loss: LossSettings::default(),
            training: TrainingSettings::default(),
        }
    }
}

/// Why settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsProblem {
    /// The file cannot be read, or is not settings.
    #[error(transparent)]
    File(#[from] SettingsFileError),
    /// A value has no TOML form, such as a path that is not text.
    #[error("write the settings: {0}")]
    Unwritable(#[from] toml::ser::Error),
    /// A setting is outside its range.
    #[error(transparent)]
    Invalid(#[from] InvalidSetting),
    /// A setting of a file is outside its range.
    #[error("use the setting {} of {}: it is {}, expected {}", .setting.name, .path.display(), .setting.found, .setting.expected)]
    InvalidIn {
        /// The file.
        path: PathBuf,
        /// The setting.
        setting: InvalidSetting,
    },
}

impl RunSettings {
    /// The settings of a preset.
    #[must_use]
    pub fn of(preset: Preset) -> Self {
        let model = match preset {
            Preset::Paper => ModelSettings::default(),
            Preset::Compact => ModelSettings::compact(),
        };
        Self { preset, model, ..Self::default() }
    }

    /// Checked settings of a file; what it leaves out is that of a preset, `preset` before the one the file names.
    ///
    /// # Errors
    /// [`SettingsProblem`] names the file, the place and the reason.
    pub fn read(path: &Path, preset: Option<Preset>) -> Result<Self, SettingsProblem> {
        let file = SettingsFile::open(path)?;
        // Once for what is wrong with the file, at its place; once more over the preset.
        let alone: Self = file.parse()?;
        let preset = preset.unwrap_or(alone.preset);
        let mut table = toml::Table::try_from(Self::of(preset))?;
        merge(&mut table, file.parse()?);
        table.insert("preset".to_owned(), toml::Value::try_from(preset)?);
        let settings: Self = table.try_into().map_err(|error| file.fault(error))?;
        settings
            .invalid()
            .map_err(|setting| SettingsProblem::InvalidIn { path: path.to_owned(), setting })?;
        Ok(settings)
    }

    /// The settings as TOML.
    ///
    /// # Errors
    /// [`SettingsProblem::Unwritable`].
    pub fn to_toml(&self) -> Result<String, SettingsProblem> {
        Ok(toml::to_string_pretty(self)?)
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`SettingsProblem::Invalid`] names the first one outside its range.
    pub fn check(&self) -> Result<(), SettingsProblem> {
        Ok(self.invalid()?)
    }

    fn invalid(&self) -> Result<(), InvalidSetting> {
        self.model.check()?;
        self.loss.check()?;
        let seed = self.seed;
        InvalidSetting::unless(i64::try_from(seed).is_ok(), "seed", seed, || "at most 2^63 - 1".to_owned())?;
        let training = &self.training;
        let most = 100_000_000;
        let counts = [
            ("training.batch_size", training.batch_size, 1, 100_000),
            ("training.stage1_epochs", training.stage1_epochs, 0, 1_000_000),
            ("training.stage2_epochs", training.stage2_epochs, 0, 1_000_000),
            ("training.stage1_iterations", training.stage1_iterations.unwrap_or(0), 0, most),
            ("training.stage2_iterations", training.stage2_iterations.unwrap_or(0), 0, most),
            ("training.alternate_every", training.alternate_every, 0, most),
            ("training.validate_every", training.validate_every, 0, most),
            ("training.checkpoint_every", training.checkpoint_every, 1, most),
            ("training.early_stop", training.early_stop.unwrap_or(1), 1, most),
        ];
        for (name, found, least, most) in counts {
            InvalidSetting::unless((least..=most).contains(&found), name, found, || {
                format!("{least} to {most}")
            })?;
        }
        let numbers = [
            ("training.learning_rate", training.learning_rate, 0.0, 1e30),
            ("training.beta_1", f64::from(training.beta_1), 0.0, 0.999_999),
            ("training.beta_2", f64::from(training.beta_2), 0.0, 0.999_999_9),
            ("training.epsilon", f64::from(training.epsilon), 1e-12, 1.0),
            ("training.clip_norm", training.clip_norm, 1e-6, 1e12),
        ];
        for (name, found, least, most) in numbers {
            InvalidSetting::unless((least..=most).contains(&found), name, found, || {
                format!("{least} to {most}")
            })?;
        }
        Ok(())
    }

    /// Settings that differ, one line each: `name: ours is not theirs`.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let flat = |settings: &Self| {
            let mut found = std::collections::BTreeMap::new();
            // Settings that were read or checked have a TOML form.
            if let Ok(table) = toml::Table::try_from(settings) {
                flatten("", &table, &mut found);
            }
            found
        };
        let (ours, theirs) = (flat(self), flat(other));
        let names: std::collections::BTreeSet<&String> = ours.keys().chain(theirs.keys()).collect();
        let show = |value: Option<&String>| value.map_or("not set", String::as_str).to_owned();
        names
            .into_iter()
            .filter(|name| ours.get(*name) != theirs.get(*name))
            .map(|name| format!("{name}: {} is not {}", show(ours.get(name)), show(theirs.get(name))))
            .collect()
    }
}

/// Lays `over` over `under`, table by table.
fn merge(under: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(toml::Value::Table(under)), toml::Value::Table(over)) => merge(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}

fn flatten(prefix: &str, table: &toml::Table, found: &mut std::collections::BTreeMap<String, String>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => flatten(&format!("{prefix}{key}."), inner, found),
            value => {
                found.insert(format!("{prefix}{key}"), value.to_string());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, preset: Option<Preset>) -> Result<RunSettings, SettingsProblem> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.toml");
        std::fs::write(&path, text).unwrap();
        RunSettings::read(&path, preset)
    }

    #[test]
    fn a_file_lies_over_its_preset() {
        let text =
            "preset = \"compact\"\nseed = 9\n[model]\nlatent = 33\n[training]\nstage1_iterations = 4\n";
        let settings = read(text, None).unwrap();
        let compact = ModelSettings::compact();
        assert_eq!((settings.seed, settings.model.latent), (9, 33));
        assert_eq!(settings.model.action_units, compact.action_units);
        assert_eq!(settings.training.stage1_iterations, Some(4));
        let paper = read(text, Some(Preset::Paper)).unwrap();
        assert_eq!((paper.preset, paper.model.action_units, paper.model.latent), (Preset::Paper, 500, 33));
        // What is saved is complete: it does not lean on the preset.
        assert_eq!(read(&paper.to_toml().unwrap(), None).unwrap(), paper);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let error = read("[training]\nlearning_rat = 1.0\n", None).unwrap_err().to_string();
        assert!(error.contains("learning_rat") && error.contains("run.toml"), "{error}");
        let mut settings = RunSettings::default();
        settings.training.clip_norm = f64::NAN;
        assert!(settings.check().unwrap_err().to_string().contains("training.clip_norm"));
        settings.training.clip_norm = 1.0;
        settings.check().unwrap();
    }

    #[test]
    fn differences_are_named() {
        let ours = RunSettings::default();
        let mut theirs = ours.clone();
        assert!(ours.differences(&theirs).is_empty());
        theirs.training.early_stop = Some(3);
        theirs.model.latent = 2;
        assert_eq!(
            ours.differences(&theirs),
            ["model.latent: 500 is not 2", "training.early_stop: not set is not 3"]
        );
    }
}
