//! Files to checked domain types; the only place where millimetres exist.
//!
//! In: MMM XML files, folders and zips in the KIT-ML layout, JSONL manifests, plain number tables, and motion capture of
//! other skeletons, which is retargeted on the way.
//! Out: [`Sample`]s, each a [`Motion`] with its id and captions, and [`Skipped`] inputs with the reason.
//! Nothing a file says may crash, hang or exhaust memory.
//!
//! [`Dataset::open`] lists without reading; [`Dataset::load`] reads one motion and may be called from many threads.

mod archive;
mod bundled_files;
mod cache;
mod caption_file;
mod captions;
mod entry;
mod files;
mod jsonl;
mod load;
pub mod mmm;
mod mocap;
mod pieces;
mod table;
mod word_vectors;

pub use cache::default_cache_folder;
pub use caption_file::{CaptionFile, CaptionRecord};
pub use entry::{Entry, Unstated};
pub use load::FaultKind;
pub use pieces::{Meta, MetaSource, Named, Pieces};
pub use word_vectors::{Coverage, VectorError, WordVectors};

use std::path::{Path, PathBuf};

use crate::manifest::SkippedInput;
use crate::motion::{Motion, bounds};
use crate::retarget::Correspondence;
use archive::Archive;
use files::Files;

/// A motion with its identity and captions.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Identity within its source, for example `00001`; unique after loading, sorts in file order.
    pub id: String,
    /// The checked motion.
    pub motion: Motion,
    /// Captions in file order; may be empty.
    pub captions: Vec<String>,
    /// Doubts about the input that do not prevent its use, as sentences for a person.
    pub warnings: Vec<String>,
    /// Where it was read: a file, or `archive.zip!/entry`.
    pub source: PathBuf,
}

/// An input that could not be used, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skipped {
    /// Identity the sample would have had.
    pub id: String,
    /// Where it was read: a file, or `archive.zip!/entry`.
    pub source: PathBuf,
    /// One line that names the place and the reason.
    pub reason: String,
}

impl From<Skipped> for SkippedInput {
    fn from(skipped: Skipped) -> Self {
        Self { id: skipped.id, source: skipped.source.display().to_string(), reason: skipped.reason }
    }
}

/// In one line: what it is, where it is, why it is skipped.
impl std::fmt::Display for Skipped {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        SkippedInput::from(self.clone()).fmt(formatter)
    }
}

/// Rate of a table that states none and for which none is set, hertz: that of the KIT recordings.
pub const DEFAULT_TABLE_RATE_HZ: f64 = 100.0;

/// What to assume where inputs are silent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenOptions {
    /// Sampling rate of number tables, hertz; a rate in the `.npz` or manifest goes before it.
    /// `None` assumes [`DEFAULT_TABLE_RATE_HZ`] with a warning on each sample, since a wrong rate scales every speed.
    /// MMM files state their rate by time stamps.
    pub rate_hz: Option<f64>,
    /// Body height for number tables, metres; a height in the `.npz` or manifest goes before it. Default 1.75.
    pub height_m: f64,
    /// Body mass for all motions, kilograms. `None` takes that of the file, or 22.5 kg/m^2 where there is none or only
    /// a placeholder.
    pub mass_kg: Option<f64>,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self { rate_hz: None, height_m: 1.75, mass_kg: None }
    }
}

/// Why a dataset cannot be used at all.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A file or folder cannot be opened.
    #[error("read {}: {source}", .path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file cannot be read as what it is.
    #[error("read {}: {reason}", .path.display())]
    Unreadable {
        /// File.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A kind of file that holds no motions.
    #[error(
        "read {}: {reason}; expected a folder, .zip, .xml, .bvh, .amc, .npy, .npz, .csv or .jsonl",
        .path.display()
    )]
    Unsupported {
        /// File.
        path: PathBuf,
        /// Why not.
        reason: &'static str,
    },
    /// A zip that cannot be trusted or read.
    #[error("read the zip {}: {reason}", .path.display())]
    Archive {
        /// Zip file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// More files than accepted.
    #[error("read {}: more than {limit} files", .path.display())]
    TooMany {
        /// Folder, zip or manifest.
        path: PathBuf,
        /// Most accepted.
        limit: usize,
    },
    /// Nothing to load.
    #[error("find motions in {}: {reason}", .path.display())]
    Empty {
        /// Folder, zip or manifest.
        path: PathBuf,
        /// What was looked for, or why what was found cannot be used.
        reason: String,
    },
    /// A setting outside what motions can have.
    #[error("use the {name} of {found}: it is outside {low} to {high} {unit}")]
    Setting {
        /// Name of the option.
        name: &'static str,
        /// Value given.
        found: f64,
        /// Lowest accepted.
        low: f64,
        /// Highest accepted.
        high: f64,
        /// Unit of the values.
        unit: &'static str,
    },
}

/// Motions that can be loaded one by one.
#[derive(Debug)]
pub struct Dataset {
    files: Files,
    entries: Vec<Entry>,
    skipped: Vec<Skipped>,
    options: OpenOptions,
    /// Whether `files` is what the dataset consists of, rather than the folder around a file.
    listed: bool,
    cache: Option<cache::Cache>,
    /// Correspondence for motion capture; recognised by joint names when absent.
    skeleton: Option<Correspondence>,
}

impl Dataset {
    /// Lists the motions at a path.
    ///
    /// - A folder: `NNNNN_mmm.xml` with captions in `NNNNN_annotations.json`, any other `.xml`, `.npy`, `.npz` and `.csv`,
    ///   and motion capture as `.bvh`, or as `.amc` with its `.asf`.
    ///   Subfolders are not searched.
    /// - A `.zip`: the same within it, in any of its folders, read in place.
    /// - A single `.xml`, `.bvh`, `.amc`, `.npy`, `.npz` or `.csv`, with the captions beside it if there are any.
    /// - A `.jsonl` manifest: one object a line with `file` (relative to the manifest, never outside its folder) and
    ///   optionally `id`, `caption` or `captions`, `rate_hz`, `height_m`.
    ///
    /// # Errors
    /// [`DatasetError`] when the path cannot be read, holds nothing to load, or an option is out of range.
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Self, DatasetError> {
        check_options(options)?;
        let io_error = |source| DatasetError::Io { path: path.to_owned(), source };
        let kind = std::fs::metadata(path).map_err(io_error)?;
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let dataset = match extension.as_str() {
            _ if kind.is_dir() => Self::list(Files::Folder(path.to_owned()), *options)?,
            _ if !kind.is_file() => {
                return Err(DatasetError::Unsupported {
                    path: path.to_owned(),
                    reason: "not a regular file",
                });
            }
            "zip" => Self::list(Files::Archive(Archive::open(path)?), *options)?,
            "jsonl" => {
                let (files, entries, skipped) = jsonl::open_manifest(path)?;
                Self {
                    files,
                    entries,
                    skipped,
                    options: *options,
                    listed: false,
                    cache: None,
                    skeleton: None,
                }
            }
            _ => Self::single(path, &extension, *options)?,
        };
        dataset.sorted(path)
    }

    /// The motions built into the program.
    #[must_use]
    pub fn bundled() -> Self {
        Self::from_memory(bundled_files::FILES, OpenOptions::default())
    }

    fn from_memory(files: &'static [(&'static str, &'static [u8])], options: OpenOptions) -> Self {
        let mut names: Vec<String> = files.iter().map(|(name, _)| (*name).to_owned()).collect();
        names.sort();
        let (files, mut skipped) = (Files::Memory(files), Vec::new());
        let mut entries = entry::find_entries(&files, &names, &mut skipped);
        entries.sort_by(|a, b| a.id.cmp(&b.id));
        Self { files, entries, skipped, options, listed: true, cache: None, skeleton: None }
    }

    fn list(files: Files, options: OpenOptions) -> Result<Self, DatasetError> {
        let (names, mut skipped) = files.names()?;
        let entries = entry::find_entries(&files, &names, &mut skipped);
        Ok(Self { files, entries, skipped, options, listed: true, cache: None, skeleton: None })
    }

    fn single(path: &Path, extension: &str, options: OpenOptions) -> Result<Self, DatasetError> {
        let unsupported = |reason| DatasetError::Unsupported { path: path.to_owned(), reason };
        let reason = match extension {
            "pkl" | "pickle" | "pt" | "pth" | "ckpt" | "joblib" => {
                "pickled files can run code and are never read"
            }
            _ => "not a kind of file that holds motions",
        };
        let name = path.file_name().and_then(|name| name.to_str()).ok_or_else(|| unsupported(reason))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let files = Files::Folder(folder.to_owned());
        let entry = entry::make_entry(&files, name, |other| folder.join(other).is_file());
        let entry = entry.ok_or_else(|| unsupported(reason))?;
        Ok(Self {
            files,
            entries: vec![entry],
            skipped: Vec::new(),
            options,
            listed: false,
            cache: None,
            skeleton: None,
        })
    }

    fn sorted(mut self, path: &Path) -> Result<Self, DatasetError> {
        self.entries.sort_by(|a, b| a.id.cmp(&b.id));
        self.skipped.sort_by(|a, b| (&a.source, &a.id).cmp(&(&b.source, &b.id)));
        if self.entries.is_empty() {
            let reason = match self.skipped.first() {
                Some(first) => {
                    format!("{} inputs, none usable; the first is {first}", self.skipped.len())
                }
                None => "there is no .xml, .bvh, .amc, .npy, .npz or .csv".to_owned(),
            };
            return Err(DatasetError::Empty { path: path.to_owned(), reason });
        }
        Ok(self)
    }

    /// What can be loaded, sorted by id; ids are unique and fit to name files.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Whether there is a motion that may leave this open.
    #[must_use]
    pub fn leaves_open(&self, what: Unstated) -> bool {
        self.entries.iter().any(|entry| entry.format.leaves_open(what))
    }

    /// Inputs that turned out unusable while listing, sorted by place.
    #[must_use]
    pub fn skipped(&self) -> &[Skipped] {
        &self.skipped
    }
}

fn check_options(options: &OpenOptions) -> Result<(), DatasetError> {
    let settings = [
        ("rate", options.rate_hz, bounds::RATE_HZ, "Hz"),
        ("height", Some(options.height_m), bounds::HEIGHT_M, "m"),
        ("mass", options.mass_kg, bounds::MASS_KG, "kg"),
    ];
    for (name, value, range, unit) in settings {
        if let Some(found) = value.filter(|value| !range.contains(value)) {
            let (low, high) = (*range.start(), *range.end());
            return Err(DatasetError::Setting { name, found, low, high, unit });
        }
    }
    Ok(())
}

/// Text from a file as it may stand in a one-line message: without control characters, and of bearable length.
fn one_line(text: &str) -> String {
    const LONGEST: usize = 160;
    let mut shown: String =
        text.chars().take(LONGEST).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push_str("...");
    }
    shown
}
