//! `metrics.jsonl` and the event file of a run, cut back to its checkpoint when it goes on.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::error::TrainingError;
use super::events;
use super::record::{Iteration, Line, Validation};

/// Name of the metrics.
pub const METRICS_FILE: &str = "metrics.jsonl";
/// Name of the event file; `TensorBoard` finds files by `tfevents` in their name.
pub const EVENTS_FILE: &str = "events.out.tfevents.rprae";

pub(super) struct Journal {
    metrics: (PathBuf, File),
    events: (PathBuf, File),
}

impl Journal {
    /// Opens both files and forgets what comes after some bytes of each.
    pub(super) fn open(folder: &Path, metrics_bytes: u64, events_bytes: u64) -> Result<Self, TrainingError> {
        let mut journal = Self {
            metrics: cut(&folder.join(METRICS_FILE), metrics_bytes)?,
            events: cut(&folder.join(EVENTS_FILE), events_bytes)?,
        };
        if events_bytes == 0 {
            append(&mut journal.events, &events::header())?;
        }
        Ok(journal)
    }

    pub(super) fn iteration(&mut self, iteration: &Iteration) -> Result<(), TrainingError> {
        let mut scalars: Vec<(String, f64)> =
            iteration.loss.named().into_iter().map(|(name, loss)| (format!("train/{name}"), loss)).collect();
        scalars.push(("train/gradient_norm".to_owned(), iteration.gradient_norm));
        append(&mut self.events, &events::scalars(iteration.iteration, &scalars))?;
        self.line(&Line::Iteration(iteration.clone()))
    }

    pub(super) fn validation(&mut self, validation: &Validation) -> Result<(), TrainingError> {
        let losses = validation.validation.named();
        let mut scalars: Vec<(String, f64)> =
            losses.into_iter().map(|(name, loss)| (format!("validation/{name}"), loss)).collect();
        scalars.push(("validation/m2t_word_accuracy".to_owned(), validation.m2t_word_accuracy));
        scalars.extend(validation.m2t_score.map(|score| ("validation/m2t_score".to_owned(), score)));
        scalars.push(("validation/t2m_error".to_owned(), validation.t2m_error));
        append(&mut self.events, &events::scalars(validation.iteration, &scalars))?;
        self.line(&Line::Validation(validation.clone()))
    }

    fn line(&mut self, line: &Line) -> Result<(), TrainingError> {
        let text = serde_json::to_string(line).map_err(|error| TrainingError::Io {
            doing: "write",
            path: self.metrics.0.clone(),
            error: std::io::Error::other(error),
        })?;
        append(&mut self.metrics, format!("{text}\n").as_bytes())
    }

    /// Brings both files to the disk; their lengths.
    pub(super) fn sync(&mut self) -> Result<(u64, u64), TrainingError> {
        let sync = |(path, file): &mut (PathBuf, File)| {
            file.sync_all().and_then(|()| file.stream_position()).map_err(|error| TrainingError::Io {
                doing: "sync",
                path: path.clone(),
                error,
            })
        };
        Ok((sync(&mut self.metrics)?, sync(&mut self.events)?))
    }
}

fn cut(path: &Path, bytes: u64) -> Result<(PathBuf, File), TrainingError> {
    let open = || -> std::io::Result<File> {
        let mut file = OpenOptions::new().create(true).truncate(false).read(true).write(true).open(path)?;
        let found = file.metadata()?.len();
        if found < bytes {
            let message = format!("it has {found} bytes, the checkpoint knows of {bytes}");
            return Err(std::io::Error::other(message));
        }
        file.set_len(bytes)?;
        file.seek(SeekFrom::End(0))?;
        Ok(file)
    };
    match open() {
        Ok(file) => Ok((path.to_owned(), file)),
        Err(error) => Err(TrainingError::Io { doing: "go on writing", path: path.to_owned(), error }),
    }
}

fn append((path, file): &mut (PathBuf, File), bytes: &[u8]) -> Result<(), TrainingError> {
    file.write_all(bytes).map_err(|error| TrainingError::Io { doing: "write", path: path.clone(), error })
}
