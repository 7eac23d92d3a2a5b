//! The model that comes with the project, and the sentences.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};

use super::train::Device;
use crate::dataset::{CaptionFile, CaptionRecord};
use crate::model::{self, DeviceChoice};
use crate::translation::Translator;

/// Where the model lies in the project.
const FOLDER: &str = "assets/bundle";

/// Sentences that `eval-sim` makes motions of when none are given, one a line.
const CAPTIONS: &str = include_str!("../../assets/captions.txt");

/// Folder of the bundled model: below the working directory, else where this program was built; `None` without one.
pub(super) fn model_folder() -> Option<PathBuf> {
    let built = Path::new(env!("CARGO_MANIFEST_DIR")).join(FOLDER);
    [PathBuf::from(FOLDER), built].into_iter().find(|folder| folder.join("config.json").is_file())
}

/// The folder asked for, or that of the bundled model.
pub(super) fn model(folder: Option<&Path>) -> anyhow::Result<PathBuf> {
    let Some(folder) = folder else {
        return model_folder().ok_or_else(|| {
            anyhow!(
                "find a model: none is bundled with this build; give --bundle DIR, the folder that `rprae train` leaves"
            )
        });
    };
    if folder.is_dir() {
        return Ok(folder.to_owned());
    }
    Err(anyhow!("load the model {}: there is no such folder; `rprae train` leaves one", folder.display()))
}

/// Loads the bundle asked for, or the bundled model.
pub(super) fn load(folder: Option<&Path>, device: Option<Device>) -> anyhow::Result<Translator> {
    let folder = model(folder)?;
    let selected = model::select(device.map_or(DeviceChoice::Cpu, DeviceChoice::from))?;
    if let Some(note) = &selected.note {
        eprintln!("{note}");
    }
    let place = || format!("load the model {}", folder.display());
    Translator::load(&folder, &selected.device).with_context(place)
}

/// The bundled sentences.
pub(super) fn captions() -> CaptionFile {
    let records = CAPTIONS.lines().enumerate().map(|(index, line)| CaptionRecord {
        id: format!("line {}", index + 1),
        texts: vec![line.to_owned()],
        ..CaptionRecord::default()
    });
    CaptionFile { records: records.collect(), ..CaptionFile::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bundled_sentences_are_ten_and_none_is_empty() {
        let captions = captions();
        assert_eq!(captions.records.len(), 10);
        for text in captions.records.iter().flat_map(|record| &record.texts) {
            assert!(text.split_whitespace().count() >= 3 && text.trim() == text, "{text:?}");
        }
    }
}
