//! Everything that decides the results of a run.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::LanguageSettings;
use crate::manifest::{SettingsFile, SettingsFileError};
use crate::motion::bounds;
use crate::simulation::{JointForm, Level, SettingsError, SimulationSettings};

/// How to read plain number tables, which say nothing about themselves.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TableSettings {
    /// Frames per second of number tables.
    pub rate_hz: Option<f64>,
    /// Body height for number tables, metres.
    pub height_m: Option<f64>,
}

/// Everything that decides the results of a run, and nothing else.
///
/// `settings.toml` in a run folder is this; handing it back with `--config` repeats the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunSettings {
    /// File, folder or zip to read motions from, relative to the working directory; the bundled suite when absent.
    pub motions: Option<PathBuf>,
    /// Run only these motions; all when empty.
    pub ids: Vec<String>,
    /// Run at most this many motions, the first by id.
    pub limit: Option<usize>,
    /// Levels to run, in order.
    pub levels: Vec<Level>,
    /// Whether every rollout is recorded.
    pub recordings: bool,
    /// Seed of the bootstrap intervals, and of the noise when several motions are made of a sentence; nothing else in a run
    /// is random. At most 2^63 - 1, since TOML has no larger number.
    pub seed: u64,
    /// Correspondence file for motion capture whose joint names are not recognised.
    pub skeleton: Option<PathBuf>,
    /// Body mass for all motions, kilograms; when absent, what the file says or 22.5 kg/m^2 for its height.
    pub mass_kg: Option<f64>,
    /// How to read plain number tables.
    pub table: TableSettings,
    /// The model that makes motions and reads captions back; none when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub language: Option<LanguageSettings>,
    /// Settings of every rollout.
    pub simulation: SimulationSettings,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            motions: None,
            ids: Vec::new(),
            limit: None,
            levels: vec![Level::L0, Level::L1, Level::L2, Level::L3],
            recordings: true,
            seed: 0,
            skeleton: None,
            mass_kg: None,
            table: TableSettings::default(),
            language: None,
            simulation: SimulationSettings::default(),
        }
    }
}

/// Why settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsProblem {
    /// The file cannot be read, or is not settings.
    #[error(transparent)]
    File(#[from] SettingsFileError),
    /// A setting is outside its range.
    #[error("use the setting {name}{}: it is {found}, expected {expected}", of_file(.file.as_deref()))]
    Value {
        /// The file that has it; absent where it is no file's.
        file: Option<PathBuf>,
        /// Name of the setting, with its tables.
        name: String,
        /// Value found.
        found: String,
        /// What is accepted.
        expected: &'static str,
    },
}

fn of_file(file: Option<&Path>) -> String {
    file.map_or_else(String::new, |file| format!(" of {}", file.display()))
}

impl SettingsProblem {
    pub(super) fn value(name: &str, found: &str, expected: &'static str) -> Self {
        Self::Value { file: None, name: name.to_owned(), found: found.to_owned(), expected }
    }

    /// The same, of a setting that this file has.
    fn of(self, path: &Path) -> Self {
        match self {
            Self::Value { name, found, expected, .. } => {
                Self::Value { file: Some(path.to_owned()), name, found, expected }
            }
            of_file @ Self::File(_) => of_file,
        }
    }
}

impl From<SettingsError> for SettingsProblem {
    fn from(SettingsError { name, found, expected }: SettingsError) -> Self {
        Self::value(&format!("simulation.{name}"), &found.to_string(), expected)
    }
}

impl RunSettings {
    /// Reads and checks settings; what the file leaves out keeps its default, what it adds is refused.
    ///
    /// # Errors
    /// [`SettingsProblem`] names the file, the place and the reason.
    pub fn read(path: &Path) -> Result<Self, SettingsProblem> {
        let mut settings: Self = SettingsFile::open(path)?.parse()?;
        settings.check().map_err(|problem| problem.of(path))?;
        Ok(settings)
    }

    /// The settings as TOML.
    ///
    /// # Errors
    /// [`SettingsProblem::Value`] when a value has no TOML form, such as a path that is not text.
    pub fn to_toml(&self) -> Result<String, SettingsProblem> {
        toml::to_string_pretty(self)
            .map_err(|error| SettingsProblem::value("(any)", &error.to_string(), "values that TOML can hold"))
    }

    /// The same without the places of files whose checksums stand beside them.
    pub(super) fn without_places(self) -> Self {
        Self { language: self.language.map(LanguageSettings::without_places), ..self }
    }

    /// Whether the run has motions that were recorded or handed in: those named, or the bundled suite.
    #[must_use]
    pub fn has_references(&self) -> bool {
        self.motions.is_some() || self.language.as_ref().is_none_or(|language| language.captions.is_none())
    }

    /// Whether the run makes motions of sentences: those named, or the bundled ones beside the bundled suite.
    #[must_use]
    pub fn has_generated(&self) -> bool {
        self.language.as_ref().is_some_and(|language| language.captions.is_some() || self.motions.is_none())
    }

    /// Checks every setting, and sorts the levels and drops repeated ones.
    ///
    /// # Errors
    /// [`SettingsProblem`] names the first setting outside its range.
    pub fn check(&mut self) -> Result<(), SettingsProblem> {
        self.levels.sort_unstable();
        self.levels.dedup();
        let outside = SettingsProblem::value;
        if self.levels.is_empty() {
            return Err(outside("levels", "empty", "some of L0, L1, L2, L3"));
        }
        if self.limit == Some(0) {
            return Err(outside("limit", "0", "at least 1"));
        }
        if self.seed > i64::MAX as u64 {
            return Err(outside("seed", &self.seed.to_string(), "at most 9223372036854775807"));
        }
        if let Some(rate_hz) = self.table.rate_hz.filter(|rate| !bounds::RATE_HZ.contains(rate)) {
            return Err(outside("table.rate_hz", &rate_hz.to_string(), "0.1 to 10000 Hz"));
        }
        if let Some(height_m) = self.table.height_m.filter(|height| !bounds::HEIGHT_M.contains(height)) {
            return Err(outside("table.height_m", &height_m.to_string(), "0.3 to 3 m"));
        }
        if let Some(language) = &self.language {
            language.check()?;
        }
        if let Some(mass_kg) = self.mass_kg.filter(|mass| !bounds::MASS_KG.contains(mass)) {
            return Err(outside("mass_kg", &mass_kg.to_string(), "1 to 500 kg"));
        }
        Ok(self.simulation.check()?)
    }

    /// Every setting that changes a number of a case, as `name:value` pairs joined by `|`.
    #[must_use]
    pub fn signature(&self) -> String {
        // Taken apart field by field, so that a new setting cannot be forgotten here.
        let SimulationSettings {
            dt_secs,
            pgs_iterations,
            joint_form,
            assist_limit,
            assist_arm_m,
            friction,
            record_rate_hz,
            feed_forward,
            swing_lift,
            sole_levelling,
            ground_correction_limit_m,
        } = &self.simulation;
        let joints = match joint_form {
            JointForm::Balls => "balls",
            JointForm::Multibody => "multibody",
        };
        let switch = |on: bool| if on { "on" } else { "off" };
        let made = self.language.as_ref().filter(|_| self.has_generated());
        let made = made.map_or_else(String::new, |language| format!("|{}", language.signature(self.seed)));
        format!(
            "dt:{}s|pgs:{pgs_iterations}|joints:{joints}|assist:{assist_limit}bw,{assist_arm_m}m|\
             friction:{friction}|record:{record_rate_hz}hz|feed-forward:{}|swing-lift:{}|level-soles:{}|ground:{ground_correction_limit_m}m{made}",
            step(*dt_secs),
            switch(*feed_forward),
            switch(*swing_lift),
            switch(*sole_levelling)
        )
    }
}

/// A step as a fraction where it is exactly one, such as `1/480`.
fn step(dt_secs: f64) -> String {
    let rate = (1.0 / dt_secs).round();
    if 1.0 / rate == dt_secs { format!("1/{rate}") } else { dt_secs.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toml_returns_the_same_settings() {
        let settings = RunSettings {
            motions: Some(PathBuf::from("some/folder")),
            limit: Some(3),
            ids: vec!["00001".to_owned()],
            table: TableSettings { rate_hz: Some(12.5), height_m: None },
            ..RunSettings::default()
        };
        let text = settings.to_toml().unwrap();
        assert_eq!(toml::from_str::<RunSettings>(&text).unwrap(), settings);
        let default = RunSettings::default();
        assert_eq!(toml::from_str::<RunSettings>(&default.to_toml().unwrap()).unwrap(), default);
        let language = LanguageSettings { n_best: 4, length_secs: Some(2.5), ..LanguageSettings::default() };
        let language = RunSettings { language: Some(language), ..default };
        assert_eq!(toml::from_str::<RunSettings>(&language.to_toml().unwrap()).unwrap(), language);
    }

    #[test]
    fn files_override_defaults_and_unknown_keys_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        std::fs::write(&path, "levels = [\"L0\"]\n[simulation]\nfriction = 0.5\n").unwrap();
        let settings = RunSettings::read(&path).unwrap();
        assert_eq!((settings.levels, settings.simulation.friction), (vec![Level::L0], 0.5));
        assert_eq!(settings.simulation.pgs_iterations, 8);
        let bad =
            ["frictoin = 0.5", "[simulation]\nfrictoin = 0.5", "levels = [\"L9\"]", "levels = ", "limit = 0"];
        for text in bad {
            std::fs::write(&path, text).unwrap();
            let error = RunSettings::read(&path).unwrap_err().to_string();
            assert!(error.contains("settings.toml"), "{error}");
        }
    }

    type Change = fn(&mut RunSettings);

    #[test]
    fn bad_values_are_named() {
        let checked = |change: fn(&mut RunSettings)| {
            let mut settings = RunSettings::default();
            change(&mut settings);
            settings.check().map_err(|problem| problem.to_string())
        };
        assert_eq!(checked(|_| ()), Ok(()));
        let bad: [(&str, Change); 8] = [
            ("language.n_best", |settings| {
                settings.language = Some(LanguageSettings { n_best: 0, ..LanguageSettings::default() });
            }),
            ("language.noise", |settings| {
                settings.language = Some(LanguageSettings { noise: f64::NAN, ..LanguageSettings::default() });
            }),
            ("levels", |settings| settings.levels.clear()),
            ("limit", |settings| settings.limit = Some(0)),
            ("simulation.dt_secs", |settings| settings.simulation.dt_secs = f64::NAN),
            ("table.rate_hz", |settings| settings.table.rate_hz = Some(-1.0)),
            ("table.height_m", |settings| settings.table.height_m = Some(1750.0)),
            ("mass_kg", |settings| settings.mass_kg = Some(0.0)),
        ];
        for (name, change) in bad {
            let message = checked(change).unwrap_err();
            assert!(message.starts_with(&format!("use the setting {name}: it is ")), "{message}");
        }
    }

    #[test]
    fn sentences_alone_take_the_place_of_the_suite() {
        let of = |motions: Option<&str>, captions: Option<&str>, is_asked: bool| {
            let captions = captions.map(PathBuf::from);
            let language = LanguageSettings { captions, ..LanguageSettings::default() };
            let settings = RunSettings {
                motions: motions.map(PathBuf::from),
                language: is_asked.then_some(language),
                ..RunSettings::default()
            };
            (settings.has_references(), settings.has_generated())
        };
        assert_eq!(of(None, None, false), (true, false));
        assert_eq!(of(None, None, true), (true, true));
        assert_eq!(of(None, Some("a.txt"), true), (false, true));
        assert_eq!(of(Some("b"), None, true), (true, false));
        assert_eq!(of(Some("b"), Some("a.txt"), true), (true, true));
    }

    #[test]
    fn levels_are_sorted_once() {
        let mut settings =
            RunSettings { levels: vec![Level::L3, Level::L0, Level::L3], ..RunSettings::default() };
        settings.check().unwrap();
        assert_eq!(settings.levels, [Level::L0, Level::L3]);
    }

    #[test]
    fn the_signature_shows_every_number() {
        assert_eq!(
            RunSettings::default().signature(),
            "dt:1/480s|pgs:8|joints:balls|assist:0.2bw,0.5m|friction:0.8|record:120hz|feed-forward:on|\
             swing-lift:on|level-soles:on|ground:0.03m"
        );
        assert_eq!(step(0.003), "0.003");
    }
}
