//! What to prepare and how.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::features::{Root, TokenRule};
use crate::motion::bounds;

/// Settings of a preparation; the defaults are the paper's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PrepareSettings {
    /// File of pretrained word vectors; without one every word's vector is trained.
    pub vectors: Option<PathBuf>,
    /// Frames a second of the features. Default 10, a tenth of KIT's rate.
    pub rate_hz: f64,
    /// What the root channels are relative to. Default `absolute`, as in the paper.
    pub root: Root,
    /// Shortest motion kept, seconds. Default 1: the paper's 100 steps at 100 Hz, whatever the rate.
    pub min_secs: f64,
    /// Longest motion kept, seconds. Default 30: the paper's 3000 steps at 100 Hz, whatever the rate.
    pub max_secs: f64,
    /// Words that need no pretrained vector; theirs is trained. Default `a`, `and`, `of`, `to`, which `GoogleNews` lacks.
    pub special_words: Vec<String>,
    /// Punctuation marks and words with digits need no pretrained vector either. Default true.
    pub special_marks: bool,
    /// Keep captions with words that have no pretrained vector, and train one. Default false: they are left out, as in the
    /// paper.
    pub keep_all_captions: bool,
    /// Leave captions out that have a word which occurs less often in all captions: a small model spends itself on rare words
    /// and misspelt ones. Default 1: none, as in the paper.
    pub min_word_count: usize,
    /// Learn stage 1 from motions without captions and captions without motions too. Default true; the paper has none.
    pub extras: bool,
    /// Pairs of the training split that stage 1 sees (unpaired); all when absent.
    pub non_paired: Option<usize>,
    /// Pairs that stage 2 sees, drawn from those of stage 1; all when absent.
    pub paired: Option<usize>,
    /// Seed of the split and the draws.
    pub seed: u64,
    /// What counts as a word.
    pub tokens: TokenRule,
    /// Lists of motion ids, one a line, instead of a split by seed; all three or none.
    pub split: SplitLists,
    /// Motions, with the captions beside them.
    pub motions: Vec<MotionSource>,
    /// Captions apart from motions.
    pub captions: Vec<CaptionSource>,
}

impl Default for PrepareSettings {
    fn default() -> Self {
        Self {
            vectors: None,
            rate_hz: 10.0,
            root: Root::Absolute,
            min_secs: 1.0,
            max_secs: 30.0,
            special_words: ["a", "and", "of", "to"].map(str::to_owned).to_vec(),
            special_marks: true,
            keep_all_captions: false,
            min_word_count: 1,
            extras: true,
            non_paired: None,
            paired: None,
            seed: 0,
            tokens: TokenRule::default(),
            split: SplitLists::default(),
            motions: Vec::new(),
            captions: Vec::new(),
        }
    }
}

/// Id files of a split.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SplitLists {
    /// Ids to learn from.
    pub train: Option<PathBuf>,
    /// Ids to watch while learning.
    pub validation: Option<PathBuf>,
    /// Ids to score at the end.
    pub test: Option<PathBuf>,
}

/// A dataset of motions.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionSource {
    /// Folder, zip, manifest or file, as [`crate::dataset::Dataset::open`] takes it.
    pub path: PathBuf,
    /// Short name, put before the ids where there are several sources; the file name when absent.
    pub name: Option<String>,
    /// Leave the captions beside the motions unread. Default false.
    #[serde(default)]
    pub without_captions: bool,
    /// Rate of number tables, hertz.
    pub rate_hz: Option<f64>,
    /// Body height for number tables, metres.
    pub height_m: Option<f64>,
}

/// A file of captions.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaptionSource {
    /// File, folder or zip, as [`crate::dataset::CaptionFile::read`] takes it.
    pub path: PathBuf,
    /// Name of the motion source it describes; the first that has a motion of the id when absent.
    pub motions: Option<String>,
}

/// Why settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PrepareSettingsError {
    /// The file cannot be read.
    #[error("read the settings {}: {source}", .path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not one of settings.
    #[error("read the settings {}: {reason}", .path.display())]
    Syntax {
        /// File.
        path: PathBuf,
        /// One line with the place.
        reason: String,
    },
    /// A value that makes no sense.
    #[error("use the setting {name}: {reason}")]
    Value {
        /// Setting.
        name: &'static str,
        /// Why not.
        reason: String,
    },
}

impl PrepareSettings {
    /// Reads a TOML file; unknown keys are refused.
    ///
    /// Paths in it are relative to the working directory; one that begins with `$NAME/` is in the folder that this variable
    /// of the environment names.
    ///
    /// # Errors
    /// [`PrepareSettingsError`] names the file and the place.
    pub fn read(path: &Path) -> Result<Self, PrepareSettingsError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| PrepareSettingsError::Io { path: path.to_owned(), source })?;
        let mut settings: Self = toml::from_str(&text).map_err(|error| {
            let place = error.span().map_or(String::new(), |span| {
                format!("line {}: ", 1 + text[..span.start.min(text.len())].matches('\n').count())
            });
            let reason = format!("{place}{}", error.message().replace('\n', " "));
            PrepareSettingsError::Syntax { path: path.to_owned(), reason }
        })?;
        let split = &mut settings.split;
        let lists = [&mut split.train, &mut split.validation, &mut split.test];
        let named = lists.into_iter().chain([&mut settings.vectors]).filter_map(Option::as_mut);
        let sources = settings.motions.iter_mut().map(|source| &mut source.path);
        let sources = sources.chain(settings.captions.iter_mut().map(|source| &mut source.path));
        for found in named.chain(sources) {
            *found = expanded(found, |name| std::env::var_os(name)).map_err(|name| {
                let reason = format!("{} needs the variable {name}, which is not set", found.display());
                PrepareSettingsError::Syntax { path: path.to_owned(), reason }
            })?;
        }
        Ok(settings)
    }

    /// Checks what can be checked without reading data.
    ///
    /// # Errors
    /// [`PrepareSettingsError::Value`] names the setting.
    pub fn check(&self) -> Result<(), PrepareSettingsError> {
        let refuse = |name, reason: String| Err(PrepareSettingsError::Value { name, reason });
        if !bounds::RATE_HZ.contains(&self.rate_hz) {
            return refuse("rate_hz", format!("{} Hz is no rate of a motion", self.rate_hz));
        }
        if !(self.min_secs >= 0.0 && self.max_secs >= self.min_secs) {
            return refuse("min_secs", format!("{} to {} s is no range", self.min_secs, self.max_secs));
        }
        if self.motions.is_empty() && self.captions.is_empty() {
            return refuse("motions", "there is no source of motions or captions".to_owned());
        }
        let lists = [&self.split.train, &self.split.validation, &self.split.test];
        let num_lists = lists.iter().filter(|list| list.is_some()).count();
        if num_lists != 0 && num_lists != lists.len() {
            return refuse("split", "give the id files of all three parts, or none".to_owned());
        }
        let names = self.source_names();
        for (place, name) in names.iter().enumerate() {
            if names[..place].contains(name) {
                return refuse(
                    "motions",
                    format!("two sources are called {name:?}; give one another `name`"),
                );
            }
        }
        for captions in &self.captions {
            if let Some(name) = captions.motions.as_ref().filter(|name| !names.contains(name)) {
                return refuse("captions", format!("no source of motions is called {name:?}"));
            }
        }
        Ok(())
    }

    /// Names of the motion sources, in order.
    #[must_use]
    pub fn source_names(&self) -> Vec<String> {
        self.motions
            .iter()
            .map(|source| match &source.name {
                Some(name) => name.clone(),
                None => {
                    source.path.file_stem().unwrap_or(source.path.as_os_str()).to_string_lossy().into_owned()
                }
            })
            .collect()
    }
}

/// A path whose first part, `$NAME`, is replaced by a variable; the name where that is not set.
fn expanded(path: &Path, variable: impl Fn(&str) -> Option<OsString>) -> Result<PathBuf, String> {
    let mut parts = path.components();
    let first = parts.next().and_then(|part| part.as_os_str().to_str());
    match first.and_then(|first| first.strip_prefix('$')) {
        Some(name) => {
            let folder = variable(name).ok_or_else(|| name.to_owned())?;
            Ok(PathBuf::from(folder).join(parts))
        }
        None => Ok(path.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_may_begin_with_a_variable() {
        let variable = |name: &str| (name == "DATA").then(|| OsString::from("/mnt/data"));
        let expand = |path: &str| expanded(Path::new(path), variable);
        assert_eq!(expand("$DATA/kit/x.tsv").unwrap(), Path::new("/mnt/data/kit/x.tsv"));
        assert_eq!(expand("kit/$DATA").unwrap(), Path::new("kit/$DATA"));
        assert_eq!(expand("$OTHER/x").unwrap_err(), "OTHER");
    }
}
