//! One cache file: blocks of numbers, then an index that is sealed by its checksum.
//!
//! `magic | block | block | ... | index (sealed JSON) | offset of the index (8 bytes) | magic`
//!
//! The file is read by position, never mapped: a file that another program cuts off then gives an error, not a crash.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::codec::{Encoding, decode, encode};
use crate::dataset::{Sample, Skipped};
use crate::manifest::{seal, unseal};
use crate::motion::{Body, Motion};

/// First and last bytes; the digit is the layout.
const MAGIC: &[u8; 8] = b"rprae-c1";

/// Largest index read, bytes; that of KIT-ML has about 2 MB.
const MAX_INDEX_BYTES: u64 = 1 << 30;

/// An input as it was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum Slot {
    Motion {
        offset: u64,
        length: u64,
        crc: u32,
        encoding: Encoding,
        rate_hz: f64,
        height_m: f64,
        mass_kg: f64,
        captions: Vec<String>,
        warnings: Vec<String>,
    },
    Skipped {
        reason: String,
    },
}

/// An open cache file.
#[derive(Debug)]
pub(super) struct Store {
    pub path: PathBuf,
    file: File,
    pub slots: BTreeMap<String, Slot>,
}

/// What a cache holds of an input: the sample without identity, or why it is none.
pub(super) type Held = Result<(Motion, Vec<String>, Vec<String>), String>;

impl Store {
    /// Opens and checks a file; the reason is one line.
    pub(super) fn open(path: &Path) -> Result<Option<Self>, String> {
        let mut file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(|error| error.to_string())?,
        };
        let slots = read_index(&mut file).map_err(|error| error.to_string())?;
        Ok(Some(Self { path: path.to_owned(), file, slots }))
    }

    /// The bytes of a block, if they are those that were written.
    pub(super) fn block(&self, offset: u64, length: u64, crc: u32) -> Option<Vec<u8>> {
        let mut bytes = vec![0; usize::try_from(length).ok()?];
        read_at(&self.file, &self.path, &mut bytes, offset).ok()?;
        (checksum(&bytes) == crc).then_some(bytes)
    }

    /// What is held under a key; the outer `None` when nothing is, the inner when the file is damaged there.
    #[expect(clippy::option_option, reason = "absent and damaged are told apart")]
    pub(super) fn get(&self, key: &str) -> Option<Option<Held>> {
        Some(match self.slots.get(key)? {
            Slot::Skipped { reason } => Some(Err(reason.clone())),
            Slot::Motion {
                offset,
                length,
                crc,
                encoding,
                rate_hz,
                height_m,
                mass_kg,
                captions,
                warnings,
            } => self.block(*offset, *length, *crc).and_then(|bytes| decode(*encoding, &bytes)).and_then(
                |frames| {
                    let body = Body { height_m: *height_m, mass_kg: *mass_kg };
                    let motion = Motion::new(body, *rate_hz, frames).ok()?;
                    Some(Ok((motion, captions.clone(), warnings.clone())))
                },
            ),
        })
    }
}

fn read_index(file: &mut File) -> io::Result<BTreeMap<String, Slot>> {
    let damaged = |reason: &str| io::Error::new(io::ErrorKind::InvalidData, reason.to_owned());
    let length = file.metadata()?.len();
    let mut ends = [0; 8];
    file.read_exact(&mut ends).map_err(|_| damaged("it is cut off"))?;
    if &ends != MAGIC {
        return Err(damaged("it is of another layout"));
    }
    let end = length.checked_sub(16).ok_or_else(|| damaged("it is cut off"))?;
    file.seek(SeekFrom::Start(end))?;
    let mut offset = [0; 8];
    file.read_exact(&mut offset)?;
    file.read_exact(&mut ends)?;
    let offset = u64::from_le_bytes(offset);
    if &ends != MAGIC || offset > end || end - offset > MAX_INDEX_BYTES {
        return Err(damaged("it is cut off"));
    }
    file.seek(SeekFrom::Start(offset))?;
    let mut index = String::new();
    file.take(end - offset).read_to_string(&mut index)?;
    let slots: BTreeMap<String, Slot> = unseal(&index).map_err(|error| damaged(&error.to_string()))?;
    let inside = |slot: &Slot| match slot {
        Slot::Motion { offset: start, length, .. } => {
            start.checked_add(*length).is_some_and(|stop| stop <= offset)
        }
        Slot::Skipped { .. } => true,
    };
    if slots.values().all(inside) { Ok(slots) } else { Err(damaged("its index points outside")) }
}

/// CRC-32, which the processor computes at several gigabytes a second.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}

#[cfg(unix)]
fn read_at(file: &File, _path: &Path, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(not(unix))]
fn read_at(_file: &File, path: &Path, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    // Handles share their position with their clones, so each read takes a fresh one.
    let mut file = File::open(path)?;
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(bytes)
}

/// A cache file being written under a hidden name.
pub(super) struct Writer {
    path: PathBuf,
    part: PathBuf,
    out: BufWriter<File>,
    offset: u64,
    slots: BTreeMap<String, Slot>,
}

/// An input ready to be written.
pub(super) struct Encoded {
    pub slot: Slot,
    pub bytes: Vec<u8>,
}

impl Encoded {
    pub(super) fn of(loaded: Result<Sample, Skipped>) -> Self {
        match loaded {
            Err(skipped) => Self { slot: Slot::Skipped { reason: skipped.reason }, bytes: Vec::new() },
            Ok(sample) => {
                let (encoding, bytes) = encode(sample.motion.frames());
                let body = sample.motion.body();
                let slot = Slot::Motion {
                    offset: 0,
                    length: bytes.len() as u64,
                    crc: checksum(&bytes),
                    encoding,
                    rate_hz: sample.motion.rate_hz(),
                    height_m: body.height_m,
                    mass_kg: body.mass_kg,
                    captions: sample.captions,
                    warnings: sample.warnings,
                };
                Self { slot, bytes }
            }
        }
    }
}

impl Writer {
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // Two processes may build the same cache; each writes its own part, and the last name given holds.
        let part = folder.join(format!(".{name}.{}.part", std::process::id()));
        let mut out = BufWriter::with_capacity(1 << 20, File::create(&part)?);
        out.write_all(MAGIC)?;
        Ok(Self { path: path.to_owned(), part, out, offset: MAGIC.len() as u64, slots: BTreeMap::new() })
    }

    pub(super) fn push(&mut self, key: String, mut encoded: Encoded) -> io::Result<()> {
        if let Slot::Motion { offset, .. } = &mut encoded.slot {
            *offset = self.offset;
        }
        self.out.write_all(&encoded.bytes)?;
        self.offset += encoded.bytes.len() as u64;
        self.slots.insert(key, encoded.slot);
        Ok(())
    }

    pub(super) fn finish(mut self) -> io::Result<()> {
        let index = seal(&self.slots)?;
        self.out.write_all(index.as_bytes())?;
        self.out.write_all(&self.offset.to_le_bytes())?;
        self.out.write_all(MAGIC)?;
        self.out.flush()?;
        self.out.get_ref().sync_all()?;
        std::fs::rename(&self.part, &self.path)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        // After `finish` the part has its final name and there is nothing left to remove.
        let _ = std::fs::remove_file(&self.part);
    }
}
