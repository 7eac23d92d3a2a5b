//! The scores that are reported together.

use std::collections::HashMap;
use std::sync::Arc;

use super::bert_score::{Baseline, BertScore, EmbeddedSegment, EmbeddedTokens};
use super::bleu::Bleu;
use super::cider::Cider;
use super::corpus::Corpus;
use super::encoder::{Encoder, EncoderError, Pooling};
use super::measurement::Measurement;
use super::rouge::RougeL;
use super::sentence_cosine::{OverReferences, SentenceCosine, VectorSegment};

/// What BERTScore is computed with.
#[derive(Debug, Clone)]
pub struct TokenEncoder<'a> {
    /// The encoder, loaded up to the layer that counts.
    pub encoder: &'a Encoder,
    /// Whether byte-pair tokenisers see a space before the first word, as published values were made.
    pub prefix_space: bool,
    /// What to rescale by; rescaled scores are left out without it.
    pub baseline: Option<Baseline>,
}

/// What the sentence cosine is computed with.
#[derive(Debug, Clone, Copy)]
pub struct SentenceEncoder<'a> {
    /// The encoder.
    pub encoder: &'a Encoder,
    /// How a sentence becomes one vector.
    pub pooling: Pooling,
}

/// Scores of the paper and of the field, in the order they are printed.
#[derive(Debug, Clone, Default)]
pub struct Panel<'a> {
    /// For BERTScore; absent without it.
    pub token_encoder: Option<TokenEncoder<'a>>,
    /// For the cosine; absent without it.
    pub sentence_encoder: Option<SentenceEncoder<'a>>,
}

/// A score that was not computed.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Absent {
    /// Its keys.
    pub keys: &'static str,
    /// What it takes.
    pub hint: &'static str,
}

impl Panel<'_> {
    /// All scores of a corpus.
    ///
    /// # Errors
    /// An [`EncoderError`] when a sentence cannot be encoded.
    pub fn measure(&self, corpus: &Corpus) -> Result<Vec<Measurement>, EncoderError> {
        let mut all = Vec::from(Bleu::PAPER.measure(corpus));
        let [.., sacrebleu] = Bleu::SACREBLEU.measure(corpus);
        all.extend([sacrebleu, RougeL::CAPTIONING.measure(corpus), Cider::CAPTIONING.measure(corpus)]);
        if let Some(encoder) = &self.token_encoder {
            all.extend(bert_scores(encoder, corpus)?);
        }
        if let Some(encoder) = self.sentence_encoder {
            all.extend(cosines(encoder, corpus)?);
        }
        Ok(all)
    }

    /// The scores that [`Panel::measure`] leaves out, and why.
    #[must_use]
    pub fn absent(&self) -> Vec<Absent> {
        let mut absent = Vec::new();
        match &self.token_encoder {
            None => absent.push(Absent {
                keys: "bertscore-*",
                hint: "give the folder of an encoder with --encoder; `rprae encoders` says how to get one",
            }),
            Some(encoder) if encoder.baseline.is_none() => absent.push(Absent {
                keys: "bertscore-rescaled-*",
                hint: "give a table of baselines for this encoder with --baseline",
            }),
            Some(_) => {}
        }
        if self.sentence_encoder.is_none() {
            absent.push(Absent {
                keys: "cosine, cosine-best",
                hint: "give the folder of an encoder with --sentence-encoder; `rprae encoders` says how to get one",
            });
        }
        absent
    }
}

fn bert_scores(encoder: &TokenEncoder<'_>, corpus: &Corpus) -> Result<Vec<Measurement>, EncoderError> {
    let sentences: Vec<&str> = corpus.sentences().collect();
    let vectors = encoder.encoder.token_vectors(&sentences, encoder.prefix_space)?;
    let vectors: HashMap<&str, Arc<EmbeddedTokens>> = sentences.into_iter().zip(vectors).collect();
    let segments: Vec<EmbeddedSegment<'_>> = corpus
        .segments()
        .iter()
        .map(|segment| EmbeddedSegment {
            hypothesis: &vectors[segment.hypothesis.as_str()],
            references: segment.references.iter().map(|text| &*vectors[text.as_str()]).collect(),
        })
        .collect();
    let name = encoder.encoder.token_signature(encoder.prefix_space);
    let score = |idf, baseline| BertScore { idf, baseline, encoder: name.clone() }.measure(&segments);
    let mut all = Vec::from(score(false, None));
    all.extend(score(true, None));
    if let Some(baseline) = &encoder.baseline {
        all.extend(score(false, Some(baseline.clone())));
        all.extend(score(true, Some(baseline.clone())));
    }
    Ok(all)
}

fn cosines(encoder: SentenceEncoder<'_>, corpus: &Corpus) -> Result<[Measurement; 2], EncoderError> {
    let sentences: Vec<&str> = corpus.sentences().collect();
    let vectors = encoder.encoder.sentence_vectors(&sentences, encoder.pooling)?;
    let vectors: HashMap<&str, Arc<Vec<f32>>> = sentences.into_iter().zip(vectors).collect();
    let segments: Vec<VectorSegment<'_>> = corpus
        .segments()
        .iter()
        .map(|segment| VectorSegment {
            hypothesis: &vectors[segment.hypothesis.as_str()],
            references: segment.references.iter().map(|text| vectors[text.as_str()].as_slice()).collect(),
        })
        .collect();
    let name = encoder.encoder.sentence_signature(encoder.pooling);
    Ok([OverReferences::Mean, OverReferences::Best]
        .map(|over_references| SentenceCosine { over_references, encoder: name.clone() }.measure(&segments)))
}
