//! Pretrained sentence encoders from a local Hugging Face folder: BERT and RoBERTa families, inference on the CPU.
//!
//! In: a folder with `config.json`, `model.safetensors`, and `tokenizer.json`, or `vocab.txt`, or `vocab.json` with
//! `merges.txt`. Nothing is ever downloaded.
//! Out: vectors of tokens after any layer, for [`BertScore`](super::BertScore), or of sentences, for
//! [`SentenceCosine`](super::SentenceCosine), and the checksum that names the model in signatures.
//! Nothing is padded and nothing of a batch shows in its results: a sentence has the same bits in any company.
//! Each sentence is computed once in the life of an encoder.

mod config;
mod error;
mod files;
mod known;
mod tokens;
mod transformer;
mod weights;

pub use config::{EncoderConfig, Family};
pub use error::EncoderError;
pub use known::{KNOWN_ENCODERS, KnownEncoder, parse_baseline};

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use self::files::checksum;
use self::tokens::SentenceTokenizer;
use self::transformer::Transformer;
use self::weights::Weights;
use super::bert_score::EmbeddedTokens;

/// The most tokens in a batch, unless a sentence has more: enough rows for matrix products to run at full rate, few enough
/// to stay in the cache and to keep all threads busy to the end.
const BATCH_TOKENS: usize = 252;

/// How a sentence becomes one vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pooling {
    /// The vector of the start token after the last layer: SimCSE without its training-time layer.
    Cls,
    /// The start token through the model's pooler and its tanh: SimCSE's supervised checkpoints as their authors run them.
    Pooler,
    /// The mean over all tokens, start and end included: sentence-transformers.
    Mean,
}

impl Pooling {
    /// Name, as in signatures and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cls => "cls",
            Self::Pooler => "pooler",
            Self::Mean => "mean",
        }
    }
}

/// What is known of sentences, by sentence and what else decides the result.
type Known<K, T> = Mutex<HashMap<(String, K), Arc<T>>>;

/// A sentence encoder, loaded up to a layer.
#[derive(Debug)]
pub struct Encoder {
    folder: PathBuf,
    config: EncoderConfig,
    layer: usize,
    tokenizer: SentenceTokenizer,
    transformer: Transformer,
    name: String,
    weights_sha256: String,
    known_tokens: Known<bool, EmbeddedTokens>,
    known_sentences: Known<Pooling, Vec<f32>>,
}

impl Encoder {
    /// Opens an encoder folder and loads its first `layer` layers, or all.
    ///
    /// Layers are counted as BERTScore does: 0 is the embeddings, 1 the output of the first layer.
    ///
    /// # Errors
    /// An [`EncoderError`] that names the file and what is wrong with it.
    pub fn open(folder: &Path, layer: Option<usize>) -> Result<Self, EncoderError> {
        let config = EncoderConfig::read(&folder.join("config.json"))?;
        let layer = layer.unwrap_or(config.num_layers);
        if layer > config.num_layers {
            return Err(EncoderError::NoSuchLayer { layer, num_layers: config.num_layers });
        }
        let tokenizer = SentenceTokenizer::open(folder, &config)?;
        let path = folder.join("model.safetensors");
        let mut weights = Weights::open(&path, config.family.name())?;
        let transformer = Transformer::load(&mut weights, &config, layer)?;
        let weights_sha256 = checksum(&[&path])?;
        let files: Vec<&Path> = tokenizer.files.iter().map(PathBuf::as_path).collect();
        let tokenizer_sha256 = checksum(&files)?;
        let name = format!(
            "{}-{}x{}@{}+{}",
            config.family.name(),
            config.width,
            config.num_layers,
            &weights_sha256[..12],
            &tokenizer_sha256[..6],
        );
        Ok(Self {
            folder: folder.to_owned(),
            config,
            layer,
            tokenizer,
            transformer,
            name,
            weights_sha256,
            known_tokens: Mutex::default(),
            known_sentences: Mutex::default(),
        })
    }

    /// Shape of the model.
    #[must_use]
    pub fn config(&self) -> &EncoderConfig {
        &self.config
    }

    /// The layer whose vectors are given out.
    #[must_use]
    pub fn layer(&self) -> usize {
        self.layer
    }

    /// Whether [`Pooling::Pooler`] can be asked for.
    #[must_use]
    pub fn has_pooler(&self) -> bool {
        self.transformer.has_pooler()
    }

    /// How a sentence becomes one vector unless told otherwise: through the pooler where there is one, else its start token,
    /// as SimCSE does. Encoders trained for the mean, as those of sentence-transformers, must be told.
    #[must_use]
    pub fn pooling(&self) -> Pooling {
        if self.has_pooler() { Pooling::Pooler } else { Pooling::Cls }
    }

    /// SHA-256 of `model.safetensors`.
    #[must_use]
    pub fn weights_sha256(&self) -> &str {
        &self.weights_sha256
    }

    /// Family, size, and checksums of weights and tokeniser: `bert-384x6@53aa51172d14+be5a9e`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Forgets the sentences computed so far.
    pub fn forget(&mut self) {
        self.known_tokens.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
        self.known_sentences.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// What names the token vectors in a signature: the encoder, its layer, and whether the first word had a space.
    #[must_use]
    pub fn token_signature(&self, prefix_space: bool) -> String {
        let prefix = match self.config.family {
            Family::Bert => "",
            Family::Roberta if prefix_space => "-prefix",
            Family::Roberta => "-noprefix",
        };
        format!("{}-L{}{prefix}", self.name, self.layer)
    }

    /// What names the sentence vectors in a signature: the encoder, its layer, and the pooling.
    #[must_use]
    pub fn sentence_signature(&self, pooling: Pooling) -> String {
        format!("{}-L{}-{}", self.name, self.layer, pooling.name())
    }

    /// Token ids of a sentence, start and end included.
    ///
    /// # Errors
    /// [`EncoderError::Tokenise`].
    pub fn token_ids(&self, sentence: &str, prefix_space: bool) -> Result<Vec<u32>, EncoderError> {
        self.tokenizer.encode(sentence, prefix_space)
    }

    /// Token vectors of sentences, in their order.
    ///
    /// `prefix_space` puts a space before the first word for byte-pair tokenisers, as the published values of BERTScore
    /// with RoBERTa were made; newer versions of the libraries under that package silently do not. BERT ignores it.
    ///
    /// # Errors
    /// [`EncoderError::Tokenise`] and [`EncoderError::Compute`].
    pub fn token_vectors(
        &self,
        sentences: &[&str],
        prefix_space: bool,
    ) -> Result<Vec<Arc<EmbeddedTokens>>, EncoderError> {
        self.cached(&self.known_tokens, sentences, prefix_space, prefix_space, |ids, vectors| {
            EmbeddedTokens::new(ids.to_vec(), vectors.to_vec()).ok_or_else(|| failed("it gave no vectors"))
        })
    }

    /// One vector a sentence, in their order, each of the encoder's width.
    ///
    /// # Errors
    /// [`EncoderError::NoPooler`], [`EncoderError::Tokenise`] and [`EncoderError::Compute`].
    pub fn sentence_vectors(
        &self,
        sentences: &[&str],
        pooling: Pooling,
    ) -> Result<Vec<Arc<Vec<f32>>>, EncoderError> {
        if pooling == Pooling::Pooler && !self.has_pooler() {
            return Err(EncoderError::NoPooler { path: self.folder.join("model.safetensors") });
        }
        let width = self.config.width;
        self.cached(&self.known_sentences, sentences, pooling, false, |_, vectors| {
            // Every sentence has a start token.
            let start = &vectors[..width];
            match pooling {
                Pooling::Mean => Ok(mean(vectors, width)),
                Pooling::Cls => Ok(start.to_vec()),
                Pooling::Pooler => {
                    let none = || EncoderError::NoPooler { path: self.folder.join("model.safetensors") };
                    self.transformer.pool(start).ok_or_else(none)
                }
            }
        })
    }

    /// Looks sentences up, computing the new ones; `finish` takes the ids of a sentence and its vectors `[token, width]`.
    fn cached<K, T>(
        &self,
        known: &Known<K, T>,
        sentences: &[&str],
        key: K,
        prefix_space: bool,
        finish: impl Fn(&[u32], &[f32]) -> Result<T, EncoderError> + Sync,
    ) -> Result<Vec<Arc<T>>, EncoderError>
    where
        K: Copy + Eq + std::hash::Hash,
        T: Send + Sync,
    {
        // A panic elsewhere leaves whole entries behind, never half of one.
        let lock = || known.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh: BTreeSet<&str> = {
            let known = lock();
            sentences.iter().copied().filter(|&text| !known.contains_key(&(text.to_owned(), key))).collect()
        };
        let fresh: Vec<&str> = fresh.into_iter().collect();
        let mut fresh: Vec<(&str, Vec<u32>)> = fresh
            .par_iter()
            .map(|&text| Ok((text, self.tokenizer.encode(text, prefix_space)?)))
            .collect::<Result<_, EncoderError>>()?;
        // The longest first, so that no thread ends with a long one alone.
        fresh.sort_by_key(|(_, ids)| std::cmp::Reverse(ids.len()));
        let computed: Vec<Vec<T>> = batches(&fresh)
            .par_iter()
            .map(|batch| {
                let ids: Vec<&[u32]> = batch.iter().map(|(_, ids)| ids.as_slice()).collect();
                let numbers = self.transformer.forward(&ids);
                if !numbers.iter().all(|number| number.is_finite()) {
                    return Err(failed("a vector is not finite"));
                }
                let mut rest = numbers.as_slice();
                ids.iter()
                    .map(|ids| {
                        let vectors;
                        (vectors, rest) = rest.split_at(ids.len() * self.config.width);
                        finish(ids, vectors)
                    })
                    .collect()
            })
            .collect::<Result<_, EncoderError>>()?;
        let mut known = lock();
        for ((sentence, _), result) in fresh.iter().zip(computed.into_iter().flatten()) {
            known.insert(((*sentence).to_owned(), key), Arc::new(result));
        }
        let missing = || failed("it gave fewer sentences than it took");
        sentences
            .iter()
            .map(|&text| known.get(&(text.to_owned(), key)).cloned().ok_or_else(missing))
            .collect()
    }
}

/// Sentences in groups of at most [`BATCH_TOKENS`] tokens.
fn batches<'a, 'b>(sentences: &'a [(&'b str, Vec<u32>)]) -> Vec<&'a [(&'b str, Vec<u32>)]> {
    let (mut batches, mut first, mut num_tokens) = (Vec::new(), 0, 0);
    for (index, (_, ids)) in sentences.iter().enumerate() {
        num_tokens += ids.len();
        if num_tokens > BATCH_TOKENS && index > first {
            batches.push(&sentences[first..index]);
            (first, num_tokens) = (index, ids.len());
        }
    }
    if first < sentences.len() {
        batches.push(&sentences[first..]);
    }
    batches
}

/// The mean of the rows `[row, width]`.
fn mean(rows: &[f32], width: usize) -> Vec<f32> {
    let num_rows = (rows.len() / width) as f64;
    (0..width)
        .map(|column| {
            let sum: f64 = rows[column..].iter().step_by(width).map(|&number| f64::from(number)).sum();
            (sum / num_rows) as f32
        })
        .collect()
}

fn failed(reason: &str) -> EncoderError {
    EncoderError::Compute { reason: reason.to_owned() }
}

/// Whether a folder holds a model of the shape of roberta-large, the default encoder of BERTScore for English.
///
/// # Errors
/// An [`EncoderError`] when `config.json` cannot be used.
pub fn looks_like_roberta_large(folder: &Path) -> Result<bool, EncoderError> {
    let config = EncoderConfig::read(&folder.join("config.json"))?;
    let shape = (config.family, config.num_layers, config.width, config.vocab_size);
    Ok(shape == (Family::Roberta, 24, 1024, 50_265))
}
