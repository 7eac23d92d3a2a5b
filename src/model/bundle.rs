//! A trained model with everything it needs, in one folder that loads without the dataset.
//!
//! ```text
//! BUNDLE/config.json           sizes, decoding, rate, start frame, lengths seen in training, what it learned from
//! BUNDLE/vocabulary.json       the words, and which of them have a vector
//! BUNDLE/vectors.safetensors   word_vectors [word, dimension], of the words that have one
//! BUNDLE/normalizer.json       between SI units and the model's range
//! BUNDLE/starts.safetensors    first frames of training motions by latent; may be missing
//! BUNDLE/weights.safetensors   the trained numbers
//! BUNDLE/README.md             the model card
//! ```

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::parameters::NamedTensor;
use super::starts::Starts;
use super::tensors::{TensorsError, read_tensors, write_tensors};
use super::{InvalidSetting, LearnedFrom, ModelSettings, Rprae, WeightsError, load_weights, weights};
use crate::features::{Normalizer, PreparedSet, Root, Split, Vocabulary};
use crate::manifest::{VERSION, write_file};
use crate::motion::{NUM_CHANNELS, bounds};

/// Layout of the folder.
const FORMAT: u32 = 1;
/// Largest JSON file read, bytes: a million words take a tenth of it.
const MAX_JSON_BYTES: u64 = 256 << 20;
/// Longest word vector accepted.
const MAX_DIMENSIONS: usize = 4096;

const CONFIG: &str = "config.json";
const VOCABULARY: &str = "vocabulary.json";
const VECTORS: &str = "vectors.safetensors";
const NORMALIZER: &str = "normalizer.json";
const STARTS: &str = "starts.safetensors";
const WEIGHTS: &str = "weights.safetensors";
const CARD: &str = "README.md";

/// Files of a bundle that change what it does, sorted; one of them may be missing, and no other is read.
pub const BUNDLE_FILES: [&str; 6] = [CONFIG, NORMALIZER, STARTS, VECTORS, VOCABULARY, WEIGHTS];

/// What a model was made for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundleConfig {
    /// Layout of the folder.
    pub format: u32,
    /// Version of the program that wrote it.
    pub rprae: String,
    /// Frames a second of the motions it reads and makes.
    pub rate_hz: f64,
    /// What the root channels of the motions it reads and makes are relative to.
    #[serde(default)]
    pub root: Root,
    /// First frame of a motion made without a reference, normalised, 50 numbers.
    ///
    /// The mean first frame of the training motions; only for a bundle without [`Bundle::with_starts`].
    pub start_frame: Vec<f32>,
    /// Frames of the shortest and longest motion of the training split; predicted lengths stay within.
    pub frames_seen: (usize, usize),
    /// Words of the longest caption of the training split, beginning and end included.
    pub longest_caption: usize,
    /// Sizes and decoding.
    pub model: ModelSettings,
    /// What it learned from; `None` in bundles of versions that did not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learned_from: Option<LearnedFrom>,
}

/// The words as they are stored.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredVocabulary {
    dimensions: usize,
    words: Vec<String>,
    has_vector: Vec<bool>,
}

/// A trained model with everything it needs.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// What it was made for.
    pub config: BundleConfig,
    /// The words it reads and writes.
    pub vocabulary: Vocabulary,
    /// Between SI units and its range.
    pub normalizer: Normalizer,
    /// The networks, without automatic differentiation.
    pub model: Rprae,
    /// Retrofitted vectors of all words, `[vocab, dimension]`.
    pub(super) table: Tensor<2>,
    /// First frames, for motions made without a reference.
    pub(super) starts: Starts,
}

/// Why a bundle cannot be loaded or saved.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// The file system refuses.
    #[error("{doing} {path}: {error}")]
    Io {
        /// What was tried.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A file is not what a bundle has.
    #[error("read {path}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A setting of the model is outside its range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// A file of tensors cannot be read.
    #[error(transparent)]
    Tensors(#[from] TensorsError),
    /// The weights do not fit the sizes.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

impl Bundle {
    /// A model, trained on a set.
    #[must_use]
    pub fn new(model: &Rprae, settings: &ModelSettings, set: &PreparedSet) -> Self {
        let motions = set.motions.iter().filter(|motion| motion.split == Split::Train);
        let lengths = motions.clone().map(|motion| motion.frames.len());
        let firsts: Vec<&[f32; NUM_CHANNELS]> = motions.filter_map(|motion| motion.frames.first()).collect();
        let mean = |channel: usize| {
            let sum: f64 = firsts.iter().map(|frame| f64::from(frame[channel])).sum();
            (sum / firsts.len().max(1) as f64) as f32
        };
        let captions = set.captions.iter().filter(|caption| caption.split == Split::Train);
        let config = BundleConfig {
            format: FORMAT,
            rprae: VERSION.to_owned(),
            rate_hz: set.rate_hz,
            root: set.root,
            start_frame: (0..NUM_CHANNELS).map(mean).collect(),
            frames_seen: (lengths.clone().min().unwrap_or(2), lengths.max().unwrap_or(2)),
            longest_caption: captions.map(|caption| caption.words.len()).max().unwrap_or(2),
            model: settings.clone(),
            learned_from: Some(LearnedFrom::of(set)),
        };
        let model = model.valid();
        let table = model.retrofit.table();
        Self {
            config,
            vocabulary: set.vocabulary.clone(),
            normalizer: set.normalizer.clone(),
            model,
            table,
            starts: Starts::default(),
        }
    }

    /// Writes the folder, whole or not at all; an earlier bundle of this name is replaced.
    ///
    /// # Errors
    /// [`BundleError::Io`].
    pub fn save(&self, folder: &Path, card: &str) -> Result<(), BundleError> {
        let io = |doing, path: &Path| {
            let path = path.to_owned();
            move |error| BundleError::Io { doing, path, error }
        };
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let part = folder.with_file_name(format!(".{name}.part"));
        if part.exists() {
            fs::remove_dir_all(&part).map_err(io("remove", &part))?;
        }
        let json = |name: &str, value: serde_json::Result<Vec<u8>>| {
            let path = part.join(name);
            let bytes = value.map_err(|error| io("write", &path)(std::io::Error::other(error)))?;
            write_file(&path, &bytes).map_err(io("write", &path))
        };
        json(CONFIG, serde_json::to_vec_pretty(&self.config))?;
        json(NORMALIZER, serde_json::to_vec_pretty(&self.normalizer))?;
        let stored = StoredVocabulary {
            dimensions: self.vocabulary.dimensions,
            words: self.vocabulary.words.clone(),
            has_vector: self.vocabulary.vectors.iter().map(Option::is_some).collect(),
        };
        json(VOCABULARY, serde_json::to_vec_pretty(&stored))?;
        let values: Vec<f32> = self.vocabulary.vectors.iter().flatten().flatten().copied().collect();
        let shape = vec![values.len() / stored.dimensions.max(1), stored.dimensions];
        let vectors = BTreeMap::from([("word_vectors".to_owned(), NamedTensor { shape, values })]);
        write_tensors(&part.join(VECTORS), &vectors).map_err(io("write", &part))?;
        if self.has_starts() {
            write_tensors(&part.join(STARTS), &self.starts.tensors()).map_err(io("write", &part))?;
        }
        write_tensors(&part.join(WEIGHTS), &weights(&self.model)).map_err(io("write", &part))?;
        write_file(&part.join(CARD), card.as_bytes()).map_err(io("write", &part))?;
        if folder.exists() {
            fs::remove_dir_all(folder).map_err(io("remove", folder))?;
        }
        fs::rename(&part, folder).map_err(io("rename", &part))
    }

    /// Reads a bundle onto a device.
    ///
    /// # Errors
    /// [`BundleError`] names the file and what is wrong with it.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, BundleError> {
        let path = |name: &str| folder.join(name);
        let wrong = |name: &str, reason: String| BundleError::Content { path: path(name), reason };
        let config: BundleConfig = read_json(&path(CONFIG))?;
        if config.format != FORMAT {
            return Err(wrong(
                CONFIG,
                format!("its format is {}, this program reads {FORMAT}", config.format),
            ));
        }
        config.model.check()?;
        let is_sound = bounds::RATE_HZ.contains(&config.rate_hz)
            && config.start_frame.len() == NUM_CHANNELS
            && config.start_frame.iter().all(|value| value.is_finite())
            && (2..=config.frames_seen.1).contains(&config.frames_seen.0)
            && config.frames_seen.1 <= 1_000_000
            && (2..=10_000).contains(&config.longest_caption);
        if !is_sound {
            let reason = "its rate, start frame or lengths are outside what this program writes";
            return Err(wrong(CONFIG, reason.to_owned()));
        }
        if !config.learned_from.as_ref().is_none_or(LearnedFrom::is_sound) {
            let reason = "the motions it learned from are not sorted, or one is there twice";
            return Err(wrong(CONFIG, reason.to_owned()));
        }
        let normalizer: Normalizer = read_json(&path(NORMALIZER))?;
        let limits = [&normalizer.minimum, &normalizer.maximum];
        if limits
            .iter()
            .any(|limit| limit.len() != NUM_CHANNELS || !limit.iter().all(|value| value.is_finite()))
        {
            return Err(wrong(NORMALIZER, format!("it does not have {NUM_CHANNELS} finite limits")));
        }
        let vectors = read_tensors(&path(VECTORS))?;
        let vocabulary =
            vocabulary(read_json(&path(VOCABULARY))?, vectors).map_err(|reason| wrong(VOCABULARY, reason))?;
        let weights = read_tensors(&path(WEIGHTS))?;
        // Compared before anything of the promised size is made.
        let found: usize = weights.values().map(|tensor| tensor.values.len()).sum();
        let expected = num_weights(&config.model, &vocabulary);
        if found != expected {
            return Err(wrong(
                WEIGHTS,
                format!("it has {found} numbers, the sizes in {CONFIG} take {expected}"),
            ));
        }
        let model = load_weights(Rprae::new(&config.model, &vocabulary, 0, device), weights)?.valid();
        let table = model.retrofit.table();
        let starts = if path(STARTS).exists() {
            let tensors = read_tensors(&path(STARTS))?;
            Starts::read(&tensors, config.model.latent).map_err(|reason| wrong(STARTS, reason))?
        } else {
            Starts::default()
        };
        Ok(Self { config, vocabulary, normalizer, model, table, starts })
    }
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, BundleError> {
    let io = |error| BundleError::Io { doing: "read", path: path.to_owned(), error };
    let content = |reason| BundleError::Content { path: path.to_owned(), reason };
    let bytes = fs::metadata(path).map_err(io)?.len();
    if bytes > MAX_JSON_BYTES {
        return Err(content(format!("it has {bytes} bytes, at most {MAX_JSON_BYTES} are read")));
    }
    let text = fs::read(path).map_err(io)?;
    serde_json::from_slice(&text).map_err(|error| content(error.to_string()))
}

/// The words with their vectors, or what is wrong with them.
fn vocabulary(
    stored: StoredVocabulary,
    mut tensors: BTreeMap<String, NamedTensor>,
) -> Result<Vocabulary, String> {
    let StoredVocabulary { dimensions, words, has_vector } = stored;
    if !(1..=MAX_DIMENSIONS).contains(&dimensions) {
        return Err(format!("its vectors have {dimensions} numbers, expected 1 to {MAX_DIMENSIONS}"));
    }
    if words.len() < 3 || words.len() != has_vector.len() || !words[2..].is_sorted_by(|a, b| a < b) {
        return Err(
            "its words are not two marks and some sorted words, each with or without a vector".to_owned()
        );
    }
    let num_vectors = has_vector.iter().filter(|has| **has).count();
    let Some(tensor) = tensors.remove("word_vectors") else {
        return Err(format!("{VECTORS} has no word_vectors"));
    };
    if tensor.shape != [num_vectors, dimensions] || !tensor.values.iter().all(|value| value.is_finite()) {
        return Err(format!("{VECTORS} does not have {num_vectors} finite vectors of {dimensions} numbers"));
    }
    let mut rows = tensor.values.chunks_exact(dimensions).map(<[f32]>::to_vec);
    let vectors = has_vector.into_iter().map(|has| if has { rows.next() } else { None }).collect();
    Ok(Vocabulary { words, dimensions, vectors })
}

/// Trained numbers of a model of some sizes.
fn num_weights(settings: &ModelSettings, vocabulary: &Vocabulary) -> usize {
    let linear = |input: usize, output: usize| (input + 1) * output;
    let lstm = |feature: usize, hidden: usize| (feature + hidden + 1) * 4 * hidden;
    let &ModelSettings {
        action_units: acts,
        action_decoder_layers: layers,
        description_units: says,
        latent,
        retrofit_units: fits,
        ..
    } = settings;
    let dimensions = vocabulary.dimensions;
    let without_vector = vocabulary.vectors.iter().filter(|vector| vector.is_none()).count().max(1);
    let retrofit = linear(dimensions, fits)
        + (settings.retrofit_layers - 1) * linear(fits, fits)
        + linear(fits, dimensions)
        + without_vector * dimensions;
    let description = 3 * lstm(dimensions, says)
        + linear(4 * says, latent)
        + linear(latent, 2 * says)
        + linear(says, vocabulary.words.len());
    let action = 2 * lstm(NUM_CHANNELS, acts)
        + (layers - 1) * lstm(acts, acts)
        + linear(2 * acts, latent)
        + linear(latent, 2 * acts * layers)
        + linear(acts, NUM_CHANNELS);
    retrofit + description + action + linear(latent, 1)
}
