//! Where bytes come from: a folder, a zip read in place, or files built into the program.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::archive::Archive;
use super::{DatasetError, Skipped};

/// Largest motion file read, bytes; an hour of MMM XML at 100 Hz has about 330 MB.
pub(super) const MAX_MOTION_BYTES: u64 = 512 << 20;

/// Largest caption file or manifest read, bytes.
pub(super) const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Most files a folder or archive may hold; the whole KIT-ML archive has about 16 thousand.
pub(super) const MAX_FILES: usize = 1_000_000;

/// A flat or nested set of named files; names use `/` and are relative.
#[derive(Debug)]
pub(super) enum Files {
    /// The files directly in a folder.
    Folder(PathBuf),
    /// The entries of a zip.
    Archive(Archive),
    /// Files built into the program.
    Memory(&'static [(&'static str, &'static [u8])]),
}

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum FileError {
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    #[error("is larger than the {limit} bytes accepted")]
    TooLarge { limit: u64 },
    #[error("cannot be unpacked: {reason}")]
    Unpack { reason: String },
    #[error("is not there")]
    Missing,
}

impl Files {
    /// Sorted names of all files, and those whose names cannot be used.
    pub(super) fn names(&self) -> Result<(Vec<String>, Vec<Skipped>), DatasetError> {
        let (mut names, skipped) = match self {
            Self::Folder(folder) => list_folder(folder)?,
            Self::Archive(archive) => archive.names(),
            Self::Memory(files) => (files.iter().map(|(name, _)| (*name).to_owned()).collect(), Vec::new()),
        };
        names.sort();
        Ok((names, skipped))
    }

    /// The bytes of a file of at most `limit` bytes.
    pub(super) fn read(&self, name: &str, limit: u64) -> Result<Cow<'static, [u8]>, FileError> {
        match self {
            Self::Folder(folder) => {
                let file = std::fs::File::open(folder.join(name))?;
                let expected = file.metadata()?.len();
                Ok(Cow::Owned(read_bounded(file, expected, limit)?))
            }
            Self::Archive(archive) => Ok(Cow::Owned(archive.read(name, limit)?)),
            Self::Memory(files) => files
                .iter()
                .find(|(file, _)| *file == name)
                .map(|(_, bytes)| Cow::Borrowed(*bytes))
                .ok_or(FileError::Missing),
        }
    }

    /// Size and times of a file, which change when it does; of an archive those of the whole archive.
    ///
    /// The status-change time, where the system keeps one, cannot be set back by a program.
    pub(super) fn stamp(&self, name: &str) -> Stamp {
        match self {
            Self::Folder(folder) => stamp_of(&folder.join(name)),
            Self::Archive(archive) => stamp_of(archive.path()),
            Self::Memory(_) => None,
        }
    }

    /// How messages name a file.
    pub(super) fn source(&self, name: &str) -> PathBuf {
        match self {
            Self::Folder(folder) => folder.join(name),
            Self::Archive(archive) => {
                let mut source = archive.path().as_os_str().to_owned();
                source.push("!/");
                source.push(name);
                source.into()
            }
            Self::Memory(_) => Path::new("bundled").join(name),
        }
    }
}

/// Size, modification and status-change time (nanoseconds); `None` where they cannot be had.
pub(super) type Stamp = Option<(u64, u128, i128)>;

fn stamp_of(path: &Path) -> Stamp {
    let data = std::fs::metadata(path).ok()?;
    let modified = data.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?.as_nanos();
    #[cfg(unix)]
    let changed = {
        use std::os::unix::fs::MetadataExt as _;
        i128::from(data.ctime()) * 1_000_000_000 + i128::from(data.ctime_nsec())
    };
    #[cfg(not(unix))]
    let changed = 0;
    Some((data.len(), modified, changed))
}

/// Reads to the end, trusting neither the size announced nor that there is an end.
pub(super) fn read_bounded(reader: impl Read, expected: u64, limit: u64) -> Result<Vec<u8>, FileError> {
    if expected > limit {
        return Err(FileError::TooLarge { limit });
    }
    // A size that a file only claims must not reserve memory beyond a modest first guess.
    let mut bytes = Vec::with_capacity(expected.min(16 << 20) as usize);
    reader.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(FileError::TooLarge { limit });
    }
    Ok(bytes)
}

fn list_folder(folder: &Path) -> Result<(Vec<String>, Vec<Skipped>), DatasetError> {
    let io_error = |source| DatasetError::Io { path: folder.to_owned(), source };
    let (mut names, mut skipped) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(io_error)? {
        let entry = entry.map_err(io_error)?;
        // Links count as what they point to; devices and pipes, which may never end, are no files.
        if !entry.path().is_file() {
            continue;
        }
        match entry.file_name().into_string() {
            Ok(name) => names.push(name),
            Err(name) => skipped.push(Skipped {
                id: name.to_string_lossy().into_owned(),
                source: entry.path(),
                reason: "the file name is not UTF-8".to_owned(),
            }),
        }
        if names.len() > MAX_FILES {
            return Err(DatasetError::TooMany { path: folder.to_owned(), limit: MAX_FILES });
        }
    }
    Ok((names, skipped))
}
