//! The model whose latent space and whose words judge others.

use crate::evaluation::motion::{Embeddings, EmbeddingsError};
use crate::features::{BOS, EOS, Normalizer};
use crate::manifest::sha256_hex;
use crate::model::{Bundle, weights};
use crate::motion::NUM_CHANNELS;
use crate::translation::Search;

/// Sequences encoded or decoded at a time.
pub(super) const BATCH: usize = 64;

/// Why one model cannot judge another.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum EvaluatorError {
    /// The two read different words.
    #[error("judge a model by another: their vocabularies differ; both must be trained on one prepared set")]
    OtherWords,
    /// The two work at different rates.
    #[error("judge a model by another: their motions have different rates")]
    OtherRate,
    /// The two place the root differently.
    #[error("judge a model by another: one takes the root as it is, the other from the start of a motion")]
    OtherRoot,
    /// Latents that are not finite.
    #[error(transparent)]
    Embeddings(#[from] EmbeddingsError),
}

/// A model that embeds and describes motions of any model.
#[derive(Debug)]
pub struct Evaluator<'a> {
    /// The model.
    pub bundle: &'a Bundle,
    /// What it is called in signatures: `rae-` and the beginning of the checksum of its weights.
    pub name: String,
}

impl<'a> Evaluator<'a> {
    /// A model as a judge.
    #[must_use]
    pub fn new(bundle: &'a Bundle) -> Self {
        let mut bytes = Vec::new();
        for (name, tensor) in weights(&bundle.model) {
            bytes.extend(name.into_bytes());
            bytes.extend(tensor.values.iter().flat_map(|value| value.to_le_bytes()));
        }
        let checksum = sha256_hex(&bytes);
        Self { bundle, name: format!("rae-{}", &checksum[..12]) }
    }

    /// Nothing when motions and captions of the other model mean the same here.
    pub(super) fn check(&self, other: &Bundle) -> Result<(), EvaluatorError> {
        if self.bundle.vocabulary.words != other.vocabulary.words {
            return Err(EvaluatorError::OtherWords);
        }
        if self.bundle.config.rate_hz != other.config.rate_hz {
            return Err(EvaluatorError::OtherRate);
        }
        if self.bundle.config.root != other.config.root {
            return Err(EvaluatorError::OtherRoot);
        }
        Ok(())
    }

    /// Motions as this model reads them.
    pub(super) fn renormalized(
        &self,
        motions: &[Vec<[f32; NUM_CHANNELS]>],
        normalizer: &Normalizer,
    ) -> Vec<Vec<[f32; NUM_CHANNELS]>> {
        if *normalizer == self.bundle.normalizer {
            return motions.to_vec();
        }
        let frame =
            |frame: &[f32; NUM_CHANNELS]| self.bundle.normalizer.normalize(&normalizer.denormalize(frame));
        motions.iter().map(|motion| motion.iter().map(frame).collect()).collect()
    }

    /// Latents of motions, normalised as this model has it.
    pub(super) fn embed_motions(
        &self,
        motions: &[Vec<[f32; NUM_CHANNELS]>],
    ) -> Result<Embeddings, EvaluatorError> {
        let mut rows = Vec::new();
        for motions in motions.chunks(BATCH) {
            let frames: Vec<&[[f32; NUM_CHANNELS]]> = motions.iter().map(Vec::as_slice).collect();
            let latent = self.bundle.encode_motions(&frames);
            let values: Vec<f32> = latent.clone().into_data().iter().collect();
            rows.extend(vectors(latent.dims()[1], &values));
        }
        Ok(Embeddings::new(&rows)?)
    }

    /// Latents of captions by word number, marks included.
    pub(super) fn embed_captions(&self, captions: &[&[u32]]) -> Result<Embeddings, EvaluatorError> {
        let mut rows = Vec::new();
        for captions in captions.chunks(BATCH) {
            let latent = self.bundle.encode_captions(captions);
            let values: Vec<f32> = latent.clone().into_data().iter().collect();
            rows.extend(vectors(latent.dims()[1], &values));
        }
        Ok(Embeddings::new(&rows)?)
    }
}

/// The name of judges, one a part: that of the only one, or their number and the beginning of a checksum over their names.
pub(super) fn names_joined(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [first, others @ ..] if others.iter().all(|other| other == first) => (*first).to_owned(),
        _ => format!("{}-judges-{}", names.len(), &sha256_hex(names.join(" ").as_bytes())[..12]),
    }
}

/// Captions a model writes of motions, normalised as it has it, always the most probable next word; words with one space
/// between.
pub(super) fn describe(bundle: &Bundle, motions: &[Vec<[f32; NUM_CHANNELS]>]) -> Vec<String> {
    let mut captions = Vec::new();
    for motions in motions.chunks(BATCH) {
        let frames: Vec<&[[f32; NUM_CHANNELS]]> = motions.iter().map(Vec::as_slice).collect();
        let latent = bundle.encode_motions(&frames);
        let written = bundle.decode_captions(&latent, bundle.config.longest_caption);
        captions.extend(written.iter().map(|words| sentence(&bundle.vocabulary.words, words)));
    }
    captions
}

/// Captions a model writes of motions, normalised as it has it, looked for as `decoding` says; words with one space between.
pub(super) fn describe_by(
    bundle: &Bundle,
    motions: &[Vec<[f32; NUM_CHANNELS]>],
    decoding: &Search,
) -> Vec<String> {
    if decoding.is_greedy() {
        return describe(bundle, motions);
    }
    let search = Search { n_best: 1, most_words: Some(bundle.config.longest_caption), ..*decoding };
    let best = |motion: &Vec<[f32; NUM_CHANNELS]>| {
        let latent = bundle.encode_motions(&[motion.as_slice()]);
        search.sentences(bundle, &latent).into_iter().next().map_or_else(String::new, |best| best.text)
    };
    motions.iter().map(best).collect()
}

/// Words by number as a sentence, without the two marks.
pub(super) fn sentence(vocabulary: &[String], words: &[u32]) -> String {
    let words = words.iter().filter(|word| ![BOS, EOS].contains(word));
    let words: Vec<&str> = words.map(|&word| vocabulary[word as usize].as_str()).collect();
    words.join(" ")
}

fn vectors(width: usize, values: &[f32]) -> Vec<Vec<f32>> {
    values.chunks_exact(width).map(<[f32]>::to_vec).collect()
}

#[cfg(test)]
mod tests {
    use super::names_joined;

    #[test]
    fn several_judges_have_a_name_of_their_own() {
        assert_eq!(names_joined(&["rae-a", "rae-a"]), "rae-a");
        let joined = names_joined(&["rae-a", "rae-b"]);
        assert!(joined.starts_with("2-judges-") && joined != names_joined(&["rae-b", "rae-a"]), "{joined}");
    }
}
