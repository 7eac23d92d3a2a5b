//! From an entry to a checked sample.

use super::captions::{clean_captions, parse_annotations};
use super::entry::{Captions, Format};
use super::files::{FileError, MAX_MOTION_BYTES, MAX_TEXT_BYTES};
use super::mmm::{MmmError, MmmFault, read_mmm};
use super::mocap::{self, CaptureError};
use super::table::{Content, TableError, read_table};
use super::{DEFAULT_TABLE_RATE_HZ, Dataset, Entry, Sample, Skipped};
use crate::motion::{Body, Motion, MotionError};

/// Why a motion cannot be loaded.
#[derive(Debug, thiserror::Error)]
enum LoadError {
    #[error("the file {0}")]
    File(#[from] FileError),
    #[error(transparent)]
    Mmm(#[from] MmmError),
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// What kind of fault keeps a motion from being loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// The file cannot be read.
    File,
    /// It is not laid out as its format says.
    Schema,
    /// Its joints are not those of the model.
    Model,
    /// Its time stamps give no rate.
    Sampling,
    /// A number is not finite or absurdly large.
    Value,
    /// Positions or body height are in another unit.
    Units,
    /// Angles are in degrees.
    Degrees,
}

impl LoadError {
    fn kind(&self) -> FaultKind {
        let of_motion = |error: &MotionError| match error {
            MotionError::Value { .. } => FaultKind::Value,
            MotionError::Height { .. } => FaultKind::Units,
            MotionError::Rate { .. } => FaultKind::Sampling,
            _ => FaultKind::Schema,
        };
        match self {
            Self::File(_) => FaultKind::File,
            Self::Mmm(error) => match &error.fault {
                MmmFault::Joints(_) => FaultKind::Model,
                MmmFault::Clock(_) => FaultKind::Sampling,
                MmmFault::Motion(error) => of_motion(error),
                _ => FaultKind::Schema,
            },
            Self::Table(TableError::Degrees { .. }) => FaultKind::Degrees,
            Self::Table(TableError::Millimetres { .. }) => FaultKind::Units,
            Self::Table(TableError::Motion(error)) | Self::Motion(error) => of_motion(error),
            Self::Table(_) | Self::Capture(_) => FaultKind::Schema,
        }
    }
}

impl Dataset {
    /// Reads and checks one motion with its captions.
    ///
    /// # Errors
    /// [`Skipped`] names the file and, in one line, the place in it and the reason.
    pub fn load(&self, entry: &Entry) -> Result<Sample, Skipped> {
        let mut damage = None;
        let loaded = self.load_cached(entry, &mut damage).unwrap_or_else(|| self.load_source(entry));
        loaded.map(|mut sample| {
            sample.warnings.extend(damage);
            sample
        })
    }

    /// Reads and checks one motion from its source, whatever a cache holds.
    pub(super) fn load_source(&self, entry: &Entry) -> Result<Sample, Skipped> {
        self.load_or_fault(entry).map_err(|(_, skipped)| skipped)
    }

    /// Like [`Dataset::load`] without the cache, and says what kind of fault there is.
    ///
    /// # Errors
    /// The kind with [`Skipped`].
    pub fn load_or_fault(&self, entry: &Entry) -> Result<Sample, (FaultKind, Skipped)> {
        self.read(entry).map_err(|error| {
            let skipped = entry.skipped(&error);
            (error.kind(), skipped)
        })
    }

    fn read(&self, entry: &Entry) -> Result<Sample, LoadError> {
        let bytes = self.files.read(&entry.name, MAX_MOTION_BYTES)?;
        let (motion, mut warnings) = match entry.format {
            Format::Mmm => self.motion_from_mmm(entry, &bytes)?,
            Format::Npy | Format::Npz | Format::Csv => self.motion_from_table(entry, &bytes)?,
            Format::Bvh | Format::Amc => {
                let retargeted = self.retarget_capture(entry, &bytes)?;
                let warnings = mocap::warnings(&retargeted);
                (retargeted.motion, warnings)
            }
        };
        let captions = self.captions(entry, &mut warnings);
        Ok(Sample { id: entry.id.clone(), motion, captions, warnings, source: entry.source.clone() })
    }

    fn motion_from_mmm(&self, entry: &Entry, bytes: &[u8]) -> Result<(Motion, Vec<String>), LoadError> {
        let mut read = read_mmm(bytes, self.options.mass_kg)?;
        if let Some(rate_hz) = entry.rate_hz
            && (rate_hz - read.motion.rate_hz()).abs() > 1e-3 * rate_hz.abs()
        {
            read.warnings.push(format!(
                "the manifest says {rate_hz} Hz, the file's time stamps {} Hz, which hold",
                read.motion.rate_hz()
            ));
        }
        let motion = match entry.height_m {
            Some(height_m) => {
                let mass_kg = self.options.mass_kg;
                read.motion.with_body(body(height_m, mass_kg))?
            }
            None => read.motion,
        };
        Ok((motion, read.warnings))
    }

    fn motion_from_table(&self, entry: &Entry, bytes: &[u8]) -> Result<(Motion, Vec<String>), LoadError> {
        let table = read_table(bytes, entry.format)?;
        let mut warnings = table.warnings;
        let frames = match table.content {
            Content::Frames(frames) => frames,
            Content::Positions(order, centres) => {
                let clip = order.clip(centres, table.rate_hz).map_err(CaptureError::from)?;
                let retargeted = self.retarget_clip(entry, &clip, table.height_m)?;
                warnings.extend(mocap::warnings(&retargeted));
                return Ok((retargeted.motion, warnings));
            }
        };
        let stated = entry.rate_hz.or(table.rate_hz).or(self.options.rate_hz);
        let rate_hz = stated.unwrap_or_else(|| {
            warnings.push(format!(
                "no sampling rate is given; {DEFAULT_TABLE_RATE_HZ} Hz is assumed, and every speed depends on it"
            ));
            DEFAULT_TABLE_RATE_HZ
        });
        let height_m = entry.height_m.or(table.height_m).unwrap_or(self.options.height_m);
        let motion = Motion::new(body(height_m, self.options.mass_kg), rate_hz, frames)?;
        Ok((motion, warnings))
    }

    /// The captions of a motion without the motion; none where they cannot be read, of which [`Dataset::load`] warns.
    #[must_use]
    pub fn captions_of(&self, entry: &Entry) -> Vec<String> {
        self.captions(entry, &mut Vec::new())
    }

    /// Captions are worth a warning, not the motion.
    fn captions(&self, entry: &Entry, warnings: &mut Vec<String>) -> Vec<String> {
        let captions = match &entry.captions {
            Captions::None => return Vec::new(),
            Captions::Given(captions) => captions.clone(),
            Captions::File(name) => {
                let read = match self.files.read(name, MAX_TEXT_BYTES) {
                    Ok(json) => parse_annotations(&json),
                    Err(error) => Err(format!("the file {error}")),
                };
                read.unwrap_or_else(|reason| {
                    warnings.push(format!("the captions in {name} are not read: {reason}"));
                    Vec::new()
                })
            }
        };
        clean_captions(&captions, warnings)
    }
}

fn body(height_m: f64, mass_kg: Option<f64>) -> Body {
    let body = Body::with_default_mass(height_m);
    Body { mass_kg: mass_kg.unwrap_or(body.mass_kg), ..body }
}
