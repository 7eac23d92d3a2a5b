//! What a dataset in the layout of KIT-ML has beside its motions, and what it lacks.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;

use super::archive::Archive;
use super::caption_file::CaptionFile;
use super::captions::parse_annotations;
use super::entry::Captions;
use super::files::{Files, MAX_TEXT_BYTES};
use super::{Dataset, DatasetError, Entry, one_line};

const ANNOTATIONS: &str = "_annotations.json";
const META: &str = "_meta.json";

/// What is missing beside the motions of a dataset; ids are sorted.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Pieces {
    /// Motions without a caption file.
    pub without_captions: Vec<String>,
    /// Motions without `<id>_meta.json`.
    pub without_meta: Vec<String>,
    /// Caption files without a motion.
    pub without_motion: Vec<String>,
}

/// The part of a `<id>_meta.json` that says where a motion is from.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Meta {
    /// Institution and database.
    pub source: MetaSource,
}

/// Where a motion is from.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct MetaSource {
    /// Who recorded it: `kit`, `cmu`.
    pub institution: Named,
    /// Where it is kept.
    pub database: Named,
}

/// A thing with an identifier.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Named {
    /// Short name.
    pub identifier: String,
}

impl Dataset {
    /// What is missing beside the motions; nothing for a single file or a manifest.
    ///
    /// # Errors
    /// [`DatasetError`] when the files can no longer be listed.
    pub fn pieces(&self) -> Result<Pieces, DatasetError> {
        if !self.listed {
            return Ok(Pieces::default());
        }
        let (names, _) = self.files.names()?;
        let known: BTreeSet<&str> = names.iter().map(String::as_str).collect();
        let mut pieces = Pieces::default();
        let mut used = BTreeSet::new();
        for entry in &self.entries {
            match &entry.captions {
                Captions::File(name) => {
                    used.insert(name.as_str());
                }
                Captions::None => pieces.without_captions.push(entry.id.clone()),
                Captions::Given(_) => {}
            }
            if !known.contains(meta_name(entry).as_str()) {
                pieces.without_meta.push(entry.id.clone());
            }
        }
        pieces.without_motion = names
            .iter()
            .filter(|name| !used.contains(name.as_str()))
            .filter_map(|name| annotated_id(name))
            .map(str::to_owned)
            .collect();
        pieces.without_motion.sort();
        Ok(pieces)
    }

    /// Where a motion is from, as the `<id>_meta.json` beside it says; `None` when there is none.
    ///
    /// # Errors
    /// One line that says why the file cannot be used; the motion is not affected.
    pub fn meta(&self, entry: &Entry) -> Result<Option<Meta>, String> {
        use super::files::FileError;

        let name = meta_name(entry);
        match self.files.read(&name, MAX_TEXT_BYTES) {
            Err(FileError::Missing) => Ok(None),
            Err(FileError::Io(error)) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(format!("{name} {error}")),
            Ok(json) => serde_json::from_slice(&json)
                .map(Some)
                .map_err(|error| format!("{name}: {}", one_line(&error.to_string()))),
        }
    }

    /// Every `<id>_annotations.json` of a folder or zip.
    pub(super) fn annotations(path: &Path) -> Result<CaptionFile, DatasetError> {
        let files =
            if path.is_dir() { Files::Folder(path.to_owned()) } else { Files::Archive(Archive::open(path)?) };
        let mut file = CaptionFile::default();
        for name in files.names()?.0 {
            let Some(id) = annotated_id(&name) else { continue };
            let read = match files.read(&name, MAX_TEXT_BYTES) {
                Ok(json) => parse_annotations(&json),
                Err(error) => Err(format!("the file {error}")),
            };
            file.take_annotations(id, &files.source(&name), read);
        }
        Ok(file)
    }
}

fn meta_name(entry: &Entry) -> String {
    let folder = entry.name.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    format!("{folder}{}{META}", super::entry::Format::stem(&entry.name))
}

/// The id in the name of a caption file.
fn annotated_id(name: &str) -> Option<&str> {
    let file = name.rsplit('/').next().unwrap_or(name);
    let hidden = file.starts_with('.') || name.split('/').any(|part| part == "__MACOSX");
    file.strip_suffix(ANNOTATIONS).filter(|id| !id.is_empty() && !hidden)
}
