//! Motions that were read before, kept so that they need not be parsed again.
//!
//! In: a listed [`Dataset`]. Out: the same dataset, whose motions come from one file of exact numbers.
//! What comes from the cache is equal to the bit to what the source gives: frames, captions, warnings and refusals.
//!
//! An entry is used only if nothing it depends on has changed: version of the program and of its readers, options, the
//! entry itself, and size, modification and status-change time of its files. The index carries a checksum, each motion
//! another. Changed entries are read again, damaged files rebuilt, and both are said; a damaged motion is read from its source.

mod codec;
mod store;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::entry::Captions;
use super::{Dataset, Entry, Sample, Skipped};
use crate::manifest::{VERSION, sha256_hex};
use store::{Encoded, Slot, Store, Writer};

/// Raise this when a reader of motions or captions, or the retargeting, begins to give something else for the same file.
const READERS: u32 = 1;

/// Entries read between two writes; bounds the memory a build takes.
const CHUNK: usize = 64;

/// A cache attached to a dataset.
#[derive(Debug)]
pub(super) struct Cache {
    store: Store,
    /// Keys of the dataset's entries, in their order.
    keys: Vec<String>,
}

/// Folder for caches: `rprae` in `$XDG_CACHE_HOME`, else in `~/.cache`; on Windows in `%LOCALAPPDATA%`.
///
/// `None` where the system names no such place.
#[must_use]
pub fn default_cache_folder() -> Option<PathBuf> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = named("XDG_CACHE_HOME")
        .or_else(|| named("LOCALAPPDATA"))
        .or_else(|| named("HOME").map(|home| home.join(".cache")))?;
    Some(base.join("rprae"))
}

impl Dataset {
    /// The dataset opened at `path`, with its motions in a cache file in `folder`, which is built or renewed first where it
    /// must be.
    ///
    /// `progress` is told how many of how many motions are done while the cache is built, from several threads.
    /// The second value says, in lines for a person, what was built anew and why. A cache that cannot be written is left
    /// out, with such a line.
    #[must_use]
    pub fn cached(
        mut self,
        path: &Path,
        folder: &Path,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> (Self, Vec<String>) {
        let mut notes = Vec::new();
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let identity = sha256_hex(format!("{}|{:?}", path.display(), self.options).as_bytes());
        let file = folder.join(format!("{}-{}.motions", super::entry::portable_id(&stem), &identity[..16]));
        let keys: Vec<String> = self.entries.iter().map(|entry| self.key(entry)).collect();

        let old = Store::open(&file).unwrap_or_else(|reason| {
            notes.push(format!("the cache {} is not used ({reason}); it is built again", file.display()));
            None
        });
        let num_held = |store: &Store| keys.iter().filter(|key| store.slots.contains_key(*key)).count();
        let store = match old {
            Some(store) if num_held(&store) == keys.len() && store.slots.len() == keys.len() => Some(store),
            old => {
                let num_new = keys.len() - old.as_ref().map_or(0, num_held);
                if old.is_some() {
                    notes.push(format!(
                        "the cache {} is renewed: {num_new} of {} motions are new or changed",
                        file.display(),
                        keys.len()
                    ));
                }
                match self.build(&file, &keys, old.as_ref(), progress) {
                    Ok(store) => store,
                    Err(error) => {
                        notes.push(format!("the cache {} cannot be written: {error}", file.display()));
                        None
                    }
                }
            }
        };
        self.cache = store.map(|store| Cache { store, keys });
        (self, notes)
    }

    fn build(
        &self,
        file: &Path,
        keys: &[String],
        old: Option<&Store>,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> std::io::Result<Option<Store>> {
        let mut writer = Writer::create(file)?;
        let done = AtomicUsize::new(0);
        for (entries, keys) in self.entries.chunks(CHUNK).zip(keys.chunks(CHUNK)) {
            let encoded: Vec<Encoded> = entries
                .par_iter()
                .zip(keys)
                .map(|(entry, key)| {
                    let encoded = old
                        .and_then(|old| kept(old, key))
                        .unwrap_or_else(|| Encoded::of(self.load_source(entry)));
                    progress(1 + done.fetch_add(1, Ordering::Relaxed), self.entries.len());
                    encoded
                })
                .collect();
            for (key, encoded) in keys.iter().zip(encoded) {
                writer.push(key.clone(), encoded)?;
            }
        }
        writer.finish()?;
        Store::open(file).map_err(std::io::Error::other)
    }

    /// What the cache has of an entry; `None` when there is none, or it is damaged, which `damage` is told.
    pub(super) fn load_cached(
        &self,
        entry: &Entry,
        damage: &mut Option<String>,
    ) -> Option<Result<Sample, Skipped>> {
        let cache = self.cache.as_ref()?;
        let place = self.entries.binary_search_by(|other| other.id.cmp(&entry.id)).ok()?;
        if self.entries[place] != *entry {
            return None;
        }
        match cache.store.get(cache.keys.get(place)?)? {
            Some(Ok((motion, captions, warnings))) => Some(Ok(Sample {
                id: entry.id.clone(),
                motion,
                captions,
                warnings,
                source: entry.source.clone(),
            })),
            Some(Err(reason)) => {
                Some(Err(Skipped { id: entry.id.clone(), source: entry.source.clone(), reason }))
            }
            None => {
                // Without the file the next opening builds it again.
                let _ = std::fs::remove_file(&cache.store.path);
                *damage = Some(format!(
                    "the cache {} is damaged here, so the source was read; the cache was removed",
                    cache.store.path.display()
                ));
                None
            }
        }
    }

    /// Changes whenever anything the entry's sample depends on may have changed.
    fn key(&self, entry: &Entry) -> String {
        // Writing to a string cannot fail.
        let mut text =
            format!("{VERSION}|{READERS}|{:?}|{entry:?}|{:?}", self.options, self.files.stamp(&entry.name));
        if let Captions::File(name) = &entry.captions {
            let _ = write!(text, "|{:?}", self.files.stamp(name));
        }
        if let Some(name) = &entry.skeleton {
            let _ = write!(text, "|{:?}", self.files.stamp(name));
        }
        if let Some(skeleton) = &self.skeleton {
            let _ = write!(text, "|{skeleton:?}");
        }
        sha256_hex(text.as_bytes())[..32].to_owned()
    }
}

/// An entry of the old cache, if it is sound.
fn kept(old: &Store, key: &str) -> Option<Encoded> {
    let slot = old.slots.get(key)?.clone();
    let bytes = match &slot {
        Slot::Motion { offset, length, crc, .. } => old.block(*offset, *length, *crc)?,
        Slot::Skipped { .. } => Vec::new(),
    };
    Some(Encoded { slot, bytes })
}
