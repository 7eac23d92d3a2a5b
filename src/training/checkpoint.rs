//! Checkpoints: everything a run needs to go on as if it had never stopped.
//!
//! Each is a folder `checkpoints/IIIIIIII` named after its iteration: `weights.safetensors`, `optimizer.safetensors` and
//! `state.json`. It is written under another name, synced and renamed, so a folder with a number is whole.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::TrainingError;
use crate::manifest::write_file;
use crate::model::{NamedTensor, read_tensors, write_tensors};

/// A validation that was the best so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Best {
    /// Iteration after which it was.
    pub iteration: usize,
    /// Its total loss.
    pub loss: f64,
}

/// What a checkpoint knows beside tensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    /// Iterations behind it. The order of the data and every other draw follow from the seed and this number.
    pub(super) iteration: usize,
    /// Best validation of the stage so far; its checkpoint is kept.
    pub(super) best: Option<Best>,
    /// Validations since.
    pub(super) validations_since_best: usize,
    /// Bytes of `metrics.jsonl` that belong to these iterations.
    pub(super) metrics_bytes: u64,
    /// Bytes of the event file that belong to these iterations.
    pub(super) events_bytes: u64,
    /// Updates of each weight.
    pub(super) updates: BTreeMap<String, usize>,
}

/// A checkpoint as read.
pub(super) struct Checkpoint {
    pub(super) state: State,
    pub(super) weights: BTreeMap<String, NamedTensor>,
    pub(super) moments: BTreeMap<String, NamedTensor>,
}

const WEIGHTS: &str = "weights.safetensors";
const MOMENTS: &str = "optimizer.safetensors";
const STATE: &str = "state.json";

fn io(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> TrainingError {
    let path = path.to_owned();
    move |error| TrainingError::Io { doing, path, error }
}

fn place(folder: &Path, iteration: usize) -> PathBuf {
    folder.join(format!("{iteration:08}"))
}

/// Iterations of the whole checkpoints in a folder, ascending; none when there is no folder.
pub(super) fn list(folder: &Path) -> Result<Vec<usize>, TrainingError> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(io("read", folder)(error)),
    };
    let mut found = Vec::new();
    for entry in entries {
        let name = entry.map_err(io("read", folder))?.file_name();
        let name = name.to_string_lossy();
        if name.len() == 8 && name.bytes().all(|byte| byte.is_ascii_digit()) {
            found.extend(name.parse::<usize>());
        }
    }
    found.sort_unstable();
    Ok(found)
}

/// Writes a checkpoint, then removes those that are neither it nor the best.
pub(super) fn write(
    folder: &Path,
    state: &State,
    weights: &BTreeMap<String, NamedTensor>,
    moments: &BTreeMap<String, NamedTensor>,
) -> Result<(), TrainingError> {
    let target = place(folder, state.iteration);
    if !target.exists() {
        let part = folder.join(format!(".{:08}.part", state.iteration));
        if part.exists() {
            fs::remove_dir_all(&part).map_err(io("remove", &part))?;
        }
        write_tensors(&part.join(WEIGHTS), weights).map_err(TrainingError::Write)?;
        write_tensors(&part.join(MOMENTS), moments).map_err(TrainingError::Write)?;
        let mut text = serde_json::to_vec_pretty(state)
            .map_err(|error| io("write", &part.join(STATE))(std::io::Error::other(error)))?;
        text.push(b'\n');
        write_file(&part.join(STATE), &text).map_err(TrainingError::Write)?;
        fs::rename(&part, &target).map_err(io("rename", &part))?;
        if cfg!(unix) {
            fs::File::open(folder).and_then(|folder| folder.sync_all()).map_err(io("sync", folder))?;
        }
    }
    tidy(folder, state)
}

/// Removes what an earlier, or a killed, process left.
pub(super) fn tidy(folder: &Path, state: &State) -> Result<(), TrainingError> {
    let kept = [Some(state.iteration), state.best.map(|best| best.iteration)];
    for iteration in list(folder)? {
        if !kept.contains(&Some(iteration)) {
            let old = place(folder, iteration);
            // Renamed first, so that a folder with a number is never half gone.
            let part = folder.join(format!(".{iteration:08}.old"));
            if part.exists() {
                fs::remove_dir_all(&part).map_err(io("remove", &part))?;
            }
            fs::rename(&old, &part).map_err(io("rename", &old))?;
        }
    }
    for entry in fs::read_dir(folder).map_err(io("read", folder))? {
        let entry = entry.map_err(io("read", folder))?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && (name.ends_with(".old") || name.ends_with(".part")) {
            fs::remove_dir_all(entry.path()).map_err(io("remove", &entry.path()))?;
        }
    }
    Ok(())
}

/// Reads a checkpoint.
pub(super) fn read(folder: &Path, iteration: usize) -> Result<Checkpoint, TrainingError> {
    let path = place(folder, iteration);
    let text = fs::read(path.join(STATE)).map_err(io("read", &path.join(STATE)))?;
    let damaged = |reason: String| TrainingError::Checkpoint { path: path.clone(), reason };
    let state: State = serde_json::from_slice(&text).map_err(|error| damaged(error.to_string()))?;
    if state.iteration != iteration {
        return Err(damaged(format!("its state is that of iteration {}", state.iteration)));
    }
    Ok(Checkpoint {
        state,
        weights: read_tensors(&path.join(WEIGHTS))?,
        moments: read_tensors(&path.join(MOMENTS))?,
    })
}

/// The weights of a checkpoint.
pub(super) fn read_weights(
    folder: &Path,
    iteration: usize,
) -> Result<BTreeMap<String, NamedTensor>, TrainingError> {
    Ok(read_tensors(&place(folder, iteration).join(WEIGHTS))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(iteration: usize, best: Option<usize>) -> State {
        State {
            iteration,
            best: best.map(|iteration| Best { iteration, loss: 0.5 }),
            validations_since_best: 0,
            metrics_bytes: 1,
            events_bytes: 2,
            updates: BTreeMap::from([("a".to_owned(), 3)]),
        }
    }

    #[test]
    fn the_last_and_the_best_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let folder = &folder.path().join("checkpoints");
        let tensor =
            |value| BTreeMap::from([("a".to_owned(), NamedTensor { shape: vec![1], values: vec![value] })]);
        assert!(list(folder).unwrap().is_empty());
        for (iteration, best) in [(5, None), (10, Some(10)), (15, Some(10)), (20, Some(10))] {
            write(folder, &state(iteration, best), &tensor(iteration as f32), &tensor(-1.0)).unwrap();
        }
        assert_eq!(list(folder).unwrap(), [10, 20]);
        let last = read(folder, 20).unwrap();
        assert_eq!(last.state, state(20, Some(10)));
        assert_eq!((last.weights, last.moments), (tensor(20.0), tensor(-1.0)));
    }

    #[test]
    fn half_a_checkpoint_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let tensors = BTreeMap::new();
        write(folder.path(), &state(5, None), &tensors, &tensors).unwrap();
        fs::create_dir(folder.path().join(".00000010.part")).unwrap();
        assert_eq!(list(folder.path()).unwrap(), [5]);
        write(folder.path(), &state(10, None), &tensors, &tensors).unwrap();
        assert_eq!(list(folder.path()).unwrap(), [10]);
        fs::write(folder.path().join("00000010").join(STATE), "{").unwrap();
        let error = read(folder.path(), 10).err().unwrap().to_string();
        assert!(error.contains("00000010"), "{error}");
    }
}
