//! What a trained model says about the motions of a run.
//!
//! In: a [`Translator`], perhaps a sentence encoder, and motions with the sentences they should mean.
//! Out: the sentence read back from a motion, and how near it is to those sentences.
//! The score of the motion as it was given minus that of the motion as it was performed is the meaning lost to physics.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::SettingsProblem;
use super::language_metrics::{LANGUAGE_METRICS, of_encoder};
use crate::evaluation::encoder::{Encoder, EncoderError};
use crate::evaluation::{Bleu, Corpus, Segment, Smoothing, cosine};
use crate::manifest::{hex, sha256_hex};
use crate::model::BUNDLE_FILES;
use crate::motion::{Motion, bounds};
use crate::report::MetricRecord;
use crate::simulation::Level;
use crate::translation::{Choose, DEFAULT_NOISE, DEFAULT_SETTLE_SECS, Search, TranslationError, Translator};

/// Most motions of one sentence.
const MAX_N_BEST: usize = 1000;

/// How motions are read back.
const READ_BACK: Search =
    Search { choose: Choose::Probable, beam: 5, n_best: 1, length_exponent: 0.7, seed: 0, most_words: None };

/// Sentence BLEU-4 over lower-case words and those marks that the model has words for; an order without a match counts a tenth of one.
const SENTENCE_BLEU: Bleu = Bleu { smoothing: Smoothing::NltkEpsilon(0.1), ..Bleu::PAPER };

/// A model in the loop: what it is, and what motions are made with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LanguageSettings {
    /// Folder of the bundle; the bundled model when absent.
    pub bundle: Option<PathBuf>,
    /// Checksum of the bundle, as [`bundle_sha256`]; a run with another bundle is refused. Filled in when a run starts.
    pub bundle_sha256: String,
    /// Sentences to make motions of; the bundled sentences when absent and the run has no motions of its own.
    pub captions: Option<PathBuf>,
    /// Motions made of every sentence, of which the most plausible is kept.
    pub n_best: usize,
    /// Noise on the latent from the second of them on, as a share of its spread over the vocabulary.
    pub noise: f64,
    /// Length of motions made, seconds; what the model predicts when absent.
    pub length_secs: Option<f64>,
    /// Time at the beginning of motions that is made and left out, seconds; see [`crate::translation::Acting::settle_secs`].
    pub settle_secs: f64,
    /// Body height of motions made, metres.
    pub height_m: f64,
    /// Word vectors for words the model was not trained on.
    pub vectors: Option<PathBuf>,
    /// Checksum over the words that got a vector of that file, and over the vectors; empty where none did. Filled in when a
    /// run starts.
    pub vectors_sha256: String,
    /// Folder of a sentence encoder for the cosine between sentences.
    pub sentence_encoder: Option<PathBuf>,
    /// Checksum of the weights of that encoder; empty without one. Filled in when a run starts.
    pub sentence_encoder_sha256: String,
}

impl Default for LanguageSettings {
    fn default() -> Self {
        Self {
            bundle: None,
            bundle_sha256: String::new(),
            captions: None,
            n_best: 1,
            noise: DEFAULT_NOISE,
            length_secs: None,
            settle_secs: DEFAULT_SETTLE_SECS,
            height_m: 1.75,
            vectors: None,
            vectors_sha256: String::new(),
            sentence_encoder: None,
            sentence_encoder_sha256: String::new(),
        }
    }
}

impl LanguageSettings {
    /// Everything that changes a motion that is made, as `name:value` pairs joined by `|`.
    pub(super) fn signature(&self, seed: u64) -> String {
        // Taken apart field by field, so that a new setting cannot be forgotten here.
        let Self {
            bundle: _,
            bundle_sha256,
            captions: _,
            n_best,
            noise,
            length_secs,
            settle_secs,
            height_m,
            vectors: _,
            vectors_sha256,
            sentence_encoder: _,
            sentence_encoder_sha256: _,
        } = self;
        let bundle: String = bundle_sha256.chars().take(12).collect();
        let length = length_secs.map_or_else(|| "predicted".to_owned(), |secs| format!("{secs}s"));
        let chosen =
            if *n_best > 1 { format!("n-best:{n_best},{noise},seed{seed}") } else { "n-best:1".to_owned() };
        let words = vectors_part(vectors_sha256);
        format!("model:{bundle}|{chosen}|length:{length}|settle:{settle_secs}s|height:{height_m}m{words}")
    }

    /// The same without the places of files whose checksums stand beside them: what must be equal when a run goes on.
    pub(super) fn without_places(self) -> Self {
        Self { bundle: None, vectors: None, sentence_encoder: None, ..self }
    }

    /// Checks every setting.
    pub(super) fn check(&self) -> Result<(), SettingsProblem> {
        let outside = |name, found: String, expected| Err(SettingsProblem::value(name, &found, expected));
        if !(1..=MAX_N_BEST).contains(&self.n_best) {
            return outside("language.n_best", self.n_best.to_string(), "1 to 1000");
        }
        if !(0.0..=100.0).contains(&self.noise) {
            return outside("language.noise", self.noise.to_string(), "0 to 100");
        }
        if self.n_best > 1 && self.noise == 0.0 {
            return outside("language.noise", "0".to_owned(), "more, or all motions of n_best are the same");
        }
        if let Some(secs) = self.length_secs.filter(|secs| !(0.1..=600.0).contains(secs)) {
            return outside("language.length_secs", secs.to_string(), "0.1 to 600 s");
        }
        if !(0.0..=10.0).contains(&self.settle_secs) {
            return outside("language.settle_secs", self.settle_secs.to_string(), "0 to 10 s");
        }
        if !bounds::HEIGHT_M.contains(&self.height_m) {
            return outside("language.height_m", self.height_m.to_string(), "0.3 to 3 m");
        }
        Ok(())
    }
}

/// A model in the loop, loaded.
#[derive(Debug)]
pub struct Language {
    translator: Translator,
    encoder: Option<Encoder>,
    /// What the numbers depend on besides the metric.
    signature: String,
}

/// A sentence read back from a motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ReadBack {
    pub text: String,
    /// Doubts about the motion that was read.
    pub doubts: Vec<String>,
    /// Sentence BLEU-4 against the sentences it should mean, 0..1.
    pub bleu: f64,
    /// Largest cosine between the latent of the motion and those of the sentences.
    pub latent_cosine: f64,
    /// Largest cosine between the sentence and those it should mean, of the encoder.
    pub sentence_cosine: Option<f64>,
}

/// Checksum of everything in a bundle that changes a number, hexadecimal: the files of a bundle by name, without its card and
/// whatever else lies there.
///
/// # Errors
/// Any error of the file system.
pub fn bundle_sha256(folder: &Path) -> std::io::Result<String> {
    let mut digest = Sha256::new();
    for name in BUNDLE_FILES {
        let path = folder.join(name);
        if path.exists() {
            digest.update(sha256_hex(name.as_bytes()));
            digest.update(sha256_hex(&std::fs::read(path)?));
        }
    }
    Ok(hex(&digest.finalize()))
}

/// Why nothing can be read back.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReadBackError {
    #[error(transparent)]
    Translation(#[from] TranslationError),
    #[error(transparent)]
    Encoder(#[from] EncoderError),
    #[error(transparent)]
    Corpus(#[from] crate::evaluation::CorpusError),
    #[error("the model's latents are not finite")]
    NotFinite,
}

impl Language {
    /// A model, with the checksum of its bundle, and perhaps an encoder, which pools as it does unless told otherwise. Word
    /// vectors added to the model later are in no signature.
    #[must_use]
    pub fn new(translator: Translator, bundle_sha256: &str, encoder: Option<Encoder>) -> Self {
        let bundle: String = bundle_sha256.chars().take(12).collect();
        let vectors = vectors_part(&translator.vectors_sha256().unwrap_or_default());
        let signature =
            format!("bundle:{bundle}|beam:{}|len:{}{vectors}", READ_BACK.beam, READ_BACK.length_exponent);
        Self { translator, encoder, signature }
    }

    /// The model.
    #[must_use]
    pub fn translator(&self) -> &Translator {
        &self.translator
    }

    /// The metrics that a run at these levels adds.
    pub(super) fn metrics(&self, levels: &[Level], n_best: usize) -> Vec<MetricRecord> {
        LANGUAGE_METRICS
            .iter()
            .filter(|metric| levels.contains(&metric.level))
            .filter(|metric| n_best > 1 || !metric.key.contains("n_best"))
            .filter_map(|metric| {
                let mut record = MetricRecord::from(*metric);
                record.signature = format!("{}|{}", self.signature, metric.signature);
                if of_encoder(metric) {
                    let encoder = self.encoder.as_ref()?;
                    let encoder = encoder.sentence_signature(encoder.pooling());
                    record.signature = format!("{}|{encoder}", record.signature);
                }
                Some(record)
            })
            .collect()
    }

    /// Reads a motion back and compares it with what it should mean; `None` without a sentence the model can read.
    pub(super) fn read_back(
        &self,
        motion: &Motion,
        captions: &[String],
    ) -> Result<Option<ReadBack>, ReadBackError> {
        let latents: Vec<Vec<f32>> = captions
            .iter()
            .filter_map(|caption| self.translator.read(caption).ok())
            .map(|reading| self.translator.latent_of(&reading))
            .collect();
        if latents.is_empty() {
            return Ok(None);
        }
        let described = self.translator.describe(motion, &READ_BACK)?;
        let latent_cosine = largest(latents.iter().map(|latent| cosine(&described.latent, latent)));
        if !latent_cosine.is_finite() {
            return Err(ReadBackError::NotFinite);
        }
        let text = described.best().to_owned();
        let references = captions.iter().map(|caption| self.translator.cut(caption));
        let references = references.filter(|caption| !caption.is_empty()).collect();
        let segment = Segment { id: String::new(), hypothesis: text.clone(), references };
        let [.., bleu] = SENTENCE_BLEU.measure(&Corpus::new(vec![segment])?);
        let sentence_cosine = match &self.encoder {
            Some(encoder) => Some(nearest(encoder, &text, captions)?),
            None => None,
        };
        let doubts = described.warnings;
        Ok(Some(ReadBack { text, doubts, bleu: bleu.score(), latent_cosine, sentence_cosine }))
    }
}

/// The part of a signature that names added vectors; nothing without them.
fn vectors_part(sha256: &str) -> String {
    let short: String = sha256.chars().take(12).collect();
    if short.is_empty() { short } else { format!("|vectors:{short}") }
}

/// Largest cosine between a sentence and some others.
fn nearest(encoder: &Encoder, text: &str, captions: &[String]) -> Result<f64, EncoderError> {
    let sentences: Vec<&str> = std::iter::once(text).chain(captions.iter().map(String::as_str)).collect();
    let vectors = encoder.sentence_vectors(&sentences, encoder.pooling())?;
    Ok(largest(vectors[1..].iter().map(|other| cosine(&vectors[0], other))))
}

/// The largest cosine, NaN when one is.
fn largest(cosines: impl Iterator<Item = f64>) -> f64 {
    cosines.fold(-1.0, |largest, cosine| if largest.is_nan() || cosine <= largest { largest } else { cosine })
}

#[cfg(test)]
mod tests {
    use super::largest;

    #[test]
    fn no_number_is_larger_than_one_that_is_none() {
        assert_eq!(largest([0.2, -0.5].into_iter()), 0.2);
        assert!(
            largest([f64::NAN, 0.5].into_iter()).is_nan() && largest([0.5, f64::NAN].into_iter()).is_nan()
        );
    }
}
