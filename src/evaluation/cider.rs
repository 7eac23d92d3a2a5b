//! CIDEr: agreement with the references, words that all segments share counting little (Vedantam et al. 2015).
//!
//! Every sentence becomes a vector a length n of n-gram: counts times `ln(N / df)`, with `N` the number of segments and
//! `df` the number of segments with the n-gram in any reference.
//! The score is ten times the mean over n = 1..4 and over references of the cosine between hypothesis and reference.
//! 0..10; a corpus of one segment scores 0, since every n-gram is everywhere.
//! Document frequencies are those of the whole corpus, in a bootstrap resample too.

use std::collections::HashMap;

use super::corpus::Corpus;
use super::measurement::Measurement;
use super::ngrams::{MAX_ORDER, Ngram, Numbered, NumberedSegment, count_of, counts, ngrams};
use super::signature::Signature;
use super::tokens::Tokenization;

/// Width of the length penalty of CIDEr-D, in words.
const SIGMA: f64 = 6.0;

/// Which of the two scores.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CiderVariant {
    /// CIDEr as first defined.
    Plain,
    /// CIDEr-D: counts of the hypothesis are clipped by those of the reference, and sentences of other length lose by a
    /// Gaussian. What pycocoevalcap and nlg-eval call CIDEr is this one.
    D,
}

/// Settings of CIDEr.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cider {
    /// What a word is.
    pub tokenization: Tokenization,
    /// Which of the two scores.
    pub variant: CiderVariant,
}

impl Cider {
    /// The score that motion captioning reports as CIDEr.
    pub const CAPTIONING: Self = Self { tokenization: Tokenization::LOWER_WORDS, variant: CiderVariant::D };
    /// CIDEr as first defined.
    pub const PLAIN: Self = Self { tokenization: Tokenization::LOWER_WORDS, variant: CiderVariant::Plain };

    /// CIDEr of a corpus: the mean over segments.
    #[must_use]
    pub fn measure(self, corpus: &Corpus) -> Measurement {
        let key = match self.variant {
            CiderVariant::Plain => "cider",
            CiderVariant::D => "cider-d",
        };
        let mut signature = Signature::new(key)
            .with("nrefs", corpus.num_references())
            .with("tok", self.tokenization.name())
            .with("case", self.tokenization.case())
            .with("n", MAX_ORDER)
            .with("df", "corpus");
        if self.variant == CiderVariant::D {
            signature = signature.with("sigma", SIGMA);
        }
        let numbered = Numbered::new(corpus, self.tokenization);
        let frequencies = Frequencies::new(&numbered);
        let values = numbered.segments.iter().map(|segment| self.segment(segment, &frequencies)).collect();
        Measurement::of_values(key, signature.with("v", 1), values)
    }

    fn segment(self, segment: &NumberedSegment, frequencies: &Frequencies) -> f64 {
        let hypothesis = frequencies.sentence(&segment.hypothesis);
        let sum: f64 = segment
            .references
            .iter()
            .map(|reference| self.similarity(&hypothesis, &frequencies.sentence(reference)))
            .sum();
        10.0 * sum / (MAX_ORDER * segment.references.len()) as f64
    }

    /// Sum over n of the cosine between two sentences.
    fn similarity(self, hypothesis: &[Vector; MAX_ORDER], reference: &[Vector; MAX_ORDER]) -> f64 {
        let cosines = hypothesis.iter().zip(reference).map(|(ours, theirs)| {
            let dot: f64 = ours
                .counts
                .iter()
                .zip(&ours.weights)
                .map(|(&(ngram, count), idf)| {
                    let other = f64::from(count_of(&theirs.counts, ngram));
                    let count = match self.variant {
                        CiderVariant::Plain => f64::from(count),
                        CiderVariant::D => f64::from(count).min(other),
                    };
                    count * other * idf * idf
                })
                .sum();
            let norms = ours.norm * theirs.norm;
            if norms > 0.0 { dot / norms } else { 0.0 }
        });
        let sum: f64 = cosines.sum();
        match self.variant {
            CiderVariant::Plain => sum,
            CiderVariant::D => {
                // The reference program measures lengths in bigrams, which differ as words do, except below one word.
                let delta = hypothesis[1].num_ngrams() - reference[1].num_ngrams();
                sum * (-(delta * delta) / (2.0 * SIGMA * SIGMA)).exp()
            }
        }
    }
}

/// A sentence's n-grams of one length.
struct Vector {
    counts: Vec<(Ngram, u32)>,
    /// ln(N / df) of every n-gram in `counts`.
    weights: Vec<f64>,
    norm: f64,
}

impl Vector {
    fn num_ngrams(&self) -> f64 {
        self.counts.iter().map(|&(_, count)| f64::from(count)).sum()
    }
}

/// In how many segments n-grams occur.
struct Frequencies {
    log_num_segments: f64,
    num_segments_with: HashMap<Ngram, u32>,
}

impl Frequencies {
    fn new(corpus: &Numbered) -> Self {
        let mut num_segments_with: HashMap<Ngram, u32> = HashMap::new();
        let mut present: Vec<Ngram> = Vec::new();
        for segment in &corpus.segments {
            present.clear();
            for words in &segment.references {
                present.extend((1..=MAX_ORDER).flat_map(|order| ngrams(words, order)));
            }
            present.sort_unstable();
            present.dedup();
            for ngram in &present {
                *num_segments_with.entry(*ngram).or_default() += 1;
            }
        }
        Self { log_num_segments: (corpus.segments.len() as f64).ln(), num_segments_with }
    }

    fn sentence(&self, words: &[u32]) -> [Vector; MAX_ORDER] {
        std::array::from_fn(|index| {
            let counts = counts(words, index + 1);
            let weights: Vec<f64> = counts
                .iter()
                .map(|(ngram, _)| {
                    let frequency = self.num_segments_with.get(ngram).copied().unwrap_or(1);
                    self.log_num_segments - f64::from(frequency).ln()
                })
                .collect();
            let squares =
                counts.iter().zip(&weights).map(|(&(_, count), idf)| (f64::from(count) * idf).powi(2));
            let norm = squares.sum::<f64>().sqrt();
            Vector { counts, weights, norm }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::corpus::Segment;
    use super::*;

    fn corpus(pairs: &[(&str, &str)]) -> Corpus {
        let segment = |&(hypothesis, reference): &(&str, &str)| Segment {
            id: String::new(),
            hypothesis: hypothesis.to_owned(),
            references: vec![reference.to_owned()],
        };
        Corpus::new(pairs.iter().map(segment).collect()).unwrap()
    }

    #[test]
    fn the_reference_itself_scores_ten() {
        let corpus = corpus(&[("one two three four", "one two three four"), ("x", "five six seven eight")]);
        for cider in [Cider::PLAIN, Cider::CAPTIONING] {
            let scores = cider.measure(&corpus).segment_scores();
            assert!((scores[0] - 10.0).abs() < 1e-12, "{scores:?}");
            assert_eq!(scores[1], 0.0);
        }
    }

    #[test]
    fn words_of_every_segment_count_nothing() {
        let corpus = corpus(&[("person", "person"), ("person", "person")]);
        assert_eq!(Cider::PLAIN.measure(&corpus).score(), 0.0);
    }

    #[test]
    fn repetition_gains_nothing_under_d() {
        let corpus = corpus(&[("waves waves waves", "waves"), ("a", "jumps")]);
        let plain = Cider::PLAIN.measure(&corpus).segment_scores()[0];
        let clipped = Cider::CAPTIONING.measure(&corpus).segment_scores()[0];
        assert!((plain - 2.5).abs() < 1e-12, "the cosine of unigrams does not see it: {plain}");
        // A third of the cosine, and two bigrams too many.
        assert!((clipped - 2.5 / 3.0 * (-4.0_f64 / 72.0).exp()).abs() < 1e-12, "{clipped}");
    }
}
