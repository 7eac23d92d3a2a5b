//! The folder of a run, and who may work in it.
//!
//! ```text
//! RUN/settings.toml     everything that decides what is learned; written first
//! RUN/run.json          version, data, device and sizes
//! RUN/metrics.jsonl     a line for every iteration and validation
//! RUN/events.out.tfevents.rprae   the same for TensorBoard
//! RUN/curves.svg        the same as a picture
//! RUN/checkpoints/      the last and the best
//! RUN/bundle/           the trained model; written last
//! ```

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::TrainingError;
use super::settings::RunSettings;
use crate::features::MirrorCount;
use crate::manifest::write_file;

/// Name of the settings in a run folder.
pub const SETTINGS_FILE: &str = "settings.toml";
/// Name of the facts in a run folder.
pub const RUN_FILE: &str = "run.json";
/// Name of the folder of checkpoints.
pub const CHECKPOINTS: &str = "checkpoints";
/// Name of the folder of the trained model.
pub const BUNDLE: &str = "bundle";

/// What a run was started on; it must be the same when the run goes on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunFacts {
    /// Version of this program.
    pub rprae: String,
    /// Fingerprint of the prepared data.
    pub data: String,
    /// What computes.
    pub device: String,
    /// Trained numbers of each part.
    pub parameters: Vec<(String, usize)>,
    /// Mirror images that were learned from; `None` where the settings ask for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mirrored: Option<MirrorCount>,
}

impl RunFacts {
    /// Nothing when the run can go on under these facts.
    fn allow(&self, now: &Self) -> Result<(), TrainingError> {
        let fields = [
            ("the version of this program", &now.rprae, &self.rprae),
            ("the fingerprint of the data", &now.data, &self.data),
        ];
        let differing = fields.into_iter().find(|(_, found, expected)| found != expected);
        let other_device =
            || (!self.has_processor_of(&now.device)).then_some(("the device", &now.device, &self.device));
        match differing.or_else(other_device) {
            Some((field, found, expected)) => {
                Err(TrainingError::OtherRun { field, found: found.clone(), expected: expected.clone() })
            }
            None => Ok(()),
        }
    }

    /// Whether this device computed, with any number of threads: no bit of a model depends on that.
    pub(crate) fn has_processor_of(&self, device: &str) -> bool {
        processor(&self.device) == processor(device)
    }
}

/// A device by its name without the number of threads.
fn processor(name: &str) -> &str {
    name.strip_suffix(" threads").and_then(|name| name.rsplit_once(", ")).map_or(name, |(name, _)| name)
}

/// How to begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Begin {
    /// A run where there is none.
    New,
    /// A run, whatever is in the folder; an earlier run there is deleted.
    Overwrite,
    /// From the last checkpoint.
    Resume,
}

/// A run folder that only this process works in, until it is dropped.
pub struct RunFolder {
    pub(super) path: PathBuf,
    _lock: File,
}

impl RunFolder {
    /// Settings of the run in a folder, if there is one.
    ///
    /// # Errors
    /// [`TrainingError::Settings`] when they cannot be read.
    pub fn settings(path: &Path) -> Result<Option<RunSettings>, TrainingError> {
        let file = path.join(SETTINGS_FILE);
        if file.exists() { Ok(Some(RunSettings::read(&file, None)?)) } else { Ok(None) }
    }

    /// Takes a folder for a run, and saves or compares what decides it.
    ///
    /// # Errors
    /// [`TrainingError`] when a run would be lost, when there is none to resume, when it was started with something else,
    /// or when the file system refuses.
    pub fn open(
        path: &Path,
        settings: &RunSettings,
        facts: &RunFacts,
        begin: Begin,
    ) -> Result<Self, TrainingError> {
        let io = |doing, path: &Path| {
            let path = path.to_owned();
            move |error| TrainingError::Io { doing, path, error }
        };
        let saved = path.join(SETTINGS_FILE);
        if begin == Begin::Resume && !saved.exists() {
            return Err(TrainingError::NothingToResume { folder: path.to_owned() });
        }
        if begin == Begin::New && saved.exists() {
            return Err(TrainingError::Exists { folder: path.to_owned() });
        }
        fs::create_dir_all(path).map_err(io("create", path))?;
        let lock_path = path.join(".lock");
        let lock = File::create(&lock_path).map_err(io("create", &lock_path))?;
        if let Err(fs::TryLockError::WouldBlock) = lock.try_lock() {
            return Err(TrainingError::Busy { folder: path.to_owned() });
        }
        let folder = Self { path: path.to_owned(), _lock: lock };
        if begin == Begin::Resume {
            // The facts are written before the settings, whose presence makes a folder a run.
            let facts_path = path.join(RUN_FILE);
            let text = fs::read(&facts_path).map_err(io("read", &facts_path))?;
            let before: RunFacts = serde_json::from_slice(&text)
                .map_err(|error| io("read", &facts_path)(std::io::Error::other(error)))?;
            let differences = match Self::settings(path)? {
                Some(before) => settings.differences(&before),
                None => Vec::new(),
            };
            if !differences.is_empty() {
                return Err(TrainingError::OtherSettings(differences));
            }
            before.allow(facts)?;
            return Ok(folder);
        }
        if saved.exists() {
            fs::remove_file(&saved).map_err(io("remove", &saved))?;
        }
        for name in [CHECKPOINTS, BUNDLE] {
            let old = path.join(name);
            if old.exists() {
                fs::remove_dir_all(&old).map_err(io("remove", &old))?;
            }
        }
        let text = serde_json::to_vec_pretty(facts)
            .map_err(|error| io("write", &path.join(RUN_FILE))(std::io::Error::other(error)))?;
        write_file(&path.join(RUN_FILE), &text).map_err(TrainingError::Write)?;
        write_file(&saved, settings.to_toml()?.as_bytes()).map_err(TrainingError::Write)?;
        Ok(folder)
    }

    /// Where the run is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_goes_on_with_any_number_of_threads_but_not_on_another_device() {
        let facts = |device: &str| RunFacts {
            rprae: "1.0.0".to_owned(),
            data: "data".to_owned(),
            device: device.to_owned(),
            parameters: Vec::new(),
            mirrored: None,
        };
        let before = facts("cpu, 2 threads");
        before.allow(&facts("cpu, 16 threads")).unwrap();
        let refused = before.allow(&facts("an adapter, Vulkan, its driver")).unwrap_err();
        assert!(refused.to_string().contains("the device"), "{refused}");
        facts("an adapter, Vulkan").allow(&facts("an adapter, Metal")).unwrap_err();
    }
}
