//! Zips read in place: listed once, then read from any number of threads.
//!
//! Nothing is ever unpacked to disk.
//! Names that leave the archive, links, repeated names, and entries that are too large or too well compressed are refused.

use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use zip::ZipArchive;
use zip::result::ZipError;

use super::files::{FileError, MAX_FILES, read_bounded};
use super::{DatasetError, Skipped};

/// Entries that unpack to less than this may be compressed as well as they like, bytes.
const RATIO_FREE_BYTES: u64 = 16 << 20;

/// Largest accepted ratio of unpacked to packed size for larger entries; motion files reach about 10.
const MAX_RATIO: u64 = 200;

/// A zip file with its table of contents.
#[derive(Debug)]
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<SharedFile>,
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self, DatasetError> {
        let io_error = |source| DatasetError::Io { path: path.to_owned(), source };
        let archive_error = |reason: String| DatasetError::Archive { path: path.to_owned(), reason };
        let file = SharedFile::new(File::open(path).map_err(io_error)?).map_err(io_error)?;
        let zip = ZipArchive::new(file).map_err(|error| archive_error(reason(&error)))?;
        if zip.len() > MAX_FILES {
            return Err(DatasetError::TooMany { path: path.to_owned(), limit: MAX_FILES });
        }
        if zip.has_duplicate_names() {
            return Err(archive_error(
                "two entries share a name, so it is unclear which is meant".to_owned(),
            ));
        }
        Ok(Self { path: path.to_owned(), zip })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the files in it, and the entries that must not be used.
    pub(super) fn names(&self) -> (Vec<String>, Vec<Skipped>) {
        let (mut names, mut skipped) = (Vec::new(), Vec::new());
        for index in 0..self.zip.len() {
            let Ok(entry) = self.zip.by_index_data(index) else { continue };
            let name = match entry.name() {
                Ok(name) => name.into_owned(),
                Err(_) => String::from_utf8_lossy(entry.name_raw()).into_owned(),
            };
            let fault = if entry.is_dir() {
                continue;
            } else if entry.is_symlink() {
                "the entry is a link"
            } else if entry.enclosed_name().is_none() || name.contains('\\') || name.starts_with('/') {
                "the entry's name points outside the archive"
            } else {
                names.push(name);
                continue;
            };
            let name = super::one_line(&name);
            let mut source = self.path.as_os_str().to_owned();
            source.push("!/");
            source.push(&name);
            skipped.push(Skipped { id: name, source: source.into(), reason: fault.to_owned() });
        }
        (names, skipped)
    }

    pub(super) fn read(&self, name: &str, limit: u64) -> Result<Vec<u8>, FileError> {
        // The clone shares the table of contents and the file, but has its own position.
        let mut zip = self.zip.clone();
        let index = zip.index_for_name(name).ok_or(FileError::Missing)?;
        read_entry(&mut zip, index, limit)
    }
}

/// Opens a zip that is held in memory, such as an `.npz`.
pub(super) fn open_in_memory(bytes: &[u8]) -> Result<ZipArchive<Cursor<&[u8]>>, FileError> {
    ZipArchive::new(Cursor::new(bytes)).map_err(|error| FileError::Unpack { reason: reason(&error) })
}

/// The bytes of an entry, with bounds on its size and compression.
pub(super) fn read_entry<R: Read + Seek>(
    zip: &mut ZipArchive<R>,
    index: usize,
    limit: u64,
) -> Result<Vec<u8>, FileError> {
    let entry = zip.by_index(index).map_err(|error| FileError::Unpack { reason: reason(&error) })?;
    let (size, packed) = (entry.size(), entry.compressed_size());
    if size > RATIO_FREE_BYTES && size / MAX_RATIO > packed {
        return Err(FileError::Unpack { reason: format!("it is compressed more than {MAX_RATIO}:1") });
    }
    // The size in the table of contents may lie: what follows it is neither read nor believed.
    let bytes = read_bounded(entry, size, limit.min(size)).map_err(|error| match error {
        FileError::TooLarge { .. } if size <= limit => {
            FileError::Unpack { reason: "it is longer than the archive says".to_owned() }
        }
        FileError::TooLarge { .. } => FileError::TooLarge { limit },
        FileError::Io(error) => FileError::Unpack { reason: super::one_line(&error.to_string()) },
        other => other,
    })?;
    if (bytes.len() as u64) < size {
        return Err(FileError::Unpack { reason: "it is shorter than the archive says".to_owned() });
    }
    Ok(bytes)
}

fn reason(error: &ZipError) -> String {
    super::one_line(&error.to_string())
}

/// A file that several readers use, each with a position of its own.
#[derive(Debug, Clone)]
struct SharedFile {
    file: Arc<Mutex<File>>,
    position: u64,
    length: u64,
}

impl SharedFile {
    fn new(file: File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        Ok(Self { file: Arc::new(Mutex::new(file)), position: 0, length })
    }
}

impl Read for SharedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // A thread that panicked in here left nothing half done: every read seeks first.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(self.position))?;
        let count = file.read(buffer)?;
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for SharedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let target = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::End(offset) => self.length.checked_add_signed(offset),
            SeekFrom::Current(offset) => self.position.checked_add_signed(offset),
        };
        self.position = target.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}
