//! The sentences a model finds most probable.

use std::cmp::Ordering;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use super::{consensus, sampling};
use crate::features::{BOS, EOS};
use crate::model::{Bundle, InvalidSetting};

/// Widest beam, and most sentences drawn.
const MAX_BEAM: usize = 1000;

/// Which of the sentences that were found is the best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choose {
    /// The most probable of a beam, by [`Search::length_exponent`].
    #[default]
    Probable,
    /// Of a beam the one most similar to all of them, weighted by their probabilities; sentences that were cut are left out,
    /// unless all were.
    ///
    /// The decision of minimum Bayes risk (Kumar and Byrne 2004); the similarity is BLEU-4 of single sentences, smoothed as
    /// by Lin and Och (2004). `Deviation:` the paper takes the most probable words.
    Consensus,
    /// Of sentences drawn word by word from the model the one most similar to all of them (Eikema and Aziz 2020).
    SampledConsensus,
}

/// How sentences are looked for.
///
/// Beam search: of all continuations of the sentences at hand by one word, the `beam` most probable go on; a sentence is
/// finished when its end is among them, and the search when `beam` are. A beam of 1 is greedy search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Search {
    /// Which sentence is the best. Default: the most probable.
    pub choose: Choose,
    /// Sentences followed side by side, or drawn; at least 1. Default 1.
    pub beam: usize,
    /// Sentences wanted; the beam is at least this wide. Default 1.
    #[serde(skip)]
    pub n_best: usize,
    /// Exponent of the length normalisation: sentences are ranked by `log p / n^a`, with `n` words, the end included.
    /// 0 ranks by probability alone, which favours short sentences; larger values favour longer ones. Default 0.7.
    pub length_exponent: f64,
    /// Seed of what is drawn. Default 0.
    pub seed: u64,
    /// Most words; `None` takes twice as many as the longest caption of the training has.
    #[serde(skip)]
    pub most_words: Option<usize>,
}

impl Default for Search {
    fn default() -> Self {
        Self { choose: Choose::Probable, beam: 1, n_best: 1, length_exponent: 0.7, seed: 0, most_words: None }
    }
}

/// A sentence with what the model thinks of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sentence {
    /// The words with spaces between them.
    pub text: String,
    /// Numbers of the words, without the two ends.
    #[serde(skip)]
    pub words: Vec<u32>,
    /// Natural logarithm of its probability, the end included.
    pub log_probability: f64,
    /// What it is ranked by; see [`Search::length_exponent`], and for a consensus the expected similarity, 0 to 1.
    pub score: f64,
    /// Whether it came to its end; otherwise it was cut at the most words.
    pub has_ended: bool,
}

/// A sentence that goes on.
pub(super) struct Open {
    pub(super) words: Vec<u32>,
    pub(super) log_probability: f64,
}

/// One more word for one of the open sentences.
#[derive(Clone, Copy)]
struct Candidate {
    row: usize,
    word: u32,
    log_probability: f64,
}

impl Candidate {
    /// More probable first; of equals the first sentence, then the first word.
    fn order(&self, other: &Self) -> Ordering {
        other
            .log_probability
            .total_cmp(&self.log_probability)
            .then(self.row.cmp(&other.row))
            .then(self.word.cmp(&other.word))
    }
}

impl Search {
    /// Whether this is the most probable next word every time, and nothing else.
    #[must_use]
    pub fn is_greedy(&self) -> bool {
        self.choose == Choose::Probable && self.beam.max(self.n_best) <= 1
    }

    /// For a person: what a sentence is, without its first capital.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { choose, beam, length_exponent, seed, .. } = self;
        match choose {
            Choose::Probable if self.is_greedy() => "the most probable next word every time".to_owned(),
            Choose::Probable => {
                format!("the most probable of a beam of {beam}, by log p / words^{length_exponent}")
            }
            Choose::Consensus => format!("the consensus of a beam of {beam}"),
            Choose::SampledConsensus => format!("the consensus of {beam} that were drawn, seed {seed}"),
        }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`InvalidSetting`] names the first one outside its range.
    pub fn check(&self) -> Result<(), InvalidSetting> {
        let least = if self.choose == Choose::Probable { 1 } else { 2 };
        InvalidSetting::unless((least..=MAX_BEAM).contains(&self.beam), "decoding.beam", self.beam, || {
            format!("{least} to {MAX_BEAM}")
        })?;
        let (exponent, seed) = (self.length_exponent, self.seed);
        InvalidSetting::unless(
            (0.0..=5.0).contains(&exponent),
            "decoding.length_exponent",
            exponent,
            || "0 to 5".to_owned(),
        )?;
        InvalidSetting::unless(i64::try_from(seed).is_ok(), "decoding.seed", seed, || {
            "at most 2^63 - 1".to_owned()
        })
    }

    /// The best sentences of a latent `[1, latent]`, best first, no two alike; at least one.
    #[must_use]
    pub fn sentences(&self, bundle: &Bundle, latent: &Tensor<2>) -> Vec<Sentence> {
        let mut sentences = match self.choose {
            Choose::Probable => self.beam_search(bundle, latent),
            Choose::Consensus => {
                let mut found = self.beam_search(bundle, latent);
                // What was cut lacks the price of its end, so its probability is none of a sentence.
                if found.iter().any(|sentence| sentence.has_ended) {
                    found.retain(|sentence| sentence.has_ended);
                }
                let most = found.iter().map(|it| it.log_probability).fold(f64::NEG_INFINITY, f64::max);
                let weights: Vec<f64> = found.iter().map(|it| (it.log_probability - most).exp()).collect();
                consensus::rank(&mut found, &weights);
                found
            }
            Choose::SampledConsensus => {
                let (most_words, count) = (self.longest(bundle), self.beam.max(self.n_best).max(1));
                let drawn = sampling::draw(bundle, latent, count, most_words, self.seed);
                let (mut sentences, weights): (Vec<Sentence>, Vec<f64>) = drawn
                    .into_iter()
                    .map(|drawn| (self.sentence(bundle, drawn.sentence, drawn.has_ended), drawn.times as f64))
                    .unzip();
                consensus::rank(&mut sentences, &weights);
                sentences
            }
        };
        sentences.truncate(self.n_best.max(1));
        sentences
    }

    fn longest(&self, bundle: &Bundle) -> usize {
        self.most_words.unwrap_or(2 * bundle.config.longest_caption).max(1)
    }

    /// All sentences of a beam, the most probable first.
    fn beam_search(&self, bundle: &Bundle, latent: &Tensor<2>) -> Vec<Sentence> {
        let beam = self.beam.max(self.n_best).max(1);
        let most_words = self.longest(bundle);
        let mut open = vec![Open { words: Vec::new(), log_probability: 0.0 }];
        let mut finished: Vec<Open> = Vec::new();
        let mut writing = bundle.write(latent);
        let mut last_words = vec![BOS];
        for _ in 0..most_words {
            let (logarithms, next) = bundle.next_words(&last_words, &writing);
            let mut candidates: Vec<Candidate> = open
                .iter()
                .zip(&logarithms)
                .enumerate()
                .flat_map(|(row, (sentence, logarithms))| {
                    // One more than the beam, for an end among them goes nowhere.
                    most_probable(logarithms, beam + 1).into_iter().map(move |(word, logarithm)| Candidate {
                        row,
                        word,
                        log_probability: sentence.log_probability + f64::from(logarithm),
                    })
                })
                .collect();
            candidates.sort_by(Candidate::order);

            let mut going_on: Vec<Candidate> = Vec::new();
            for (rank, candidate) in candidates.into_iter().enumerate() {
                if candidate.word == EOS {
                    if rank < beam {
                        finished.push(Open {
                            words: open[candidate.row].words.clone(),
                            log_probability: candidate.log_probability,
                        });
                    }
                } else if going_on.len() < beam {
                    going_on.push(candidate);
                }
            }
            open = going_on.iter().map(|candidate| candidate.follow(&open)).collect();
            if finished.len() >= beam || open.is_empty() {
                break;
            }
            writing = next.select(&going_on.iter().map(|candidate| candidate.row).collect::<Vec<_>>());
            last_words = going_on.iter().map(|candidate| candidate.word).collect();
        }
        // What was cut off counts only where too few sentences came to an end.
        let cut = self.n_best.max(1).saturating_sub(finished.len());
        let ended = finished.into_iter().map(|sentence| (sentence, true));
        let all = ended.chain(open.into_iter().take(cut).map(|sentence| (sentence, false)));
        let mut sentences: Vec<Sentence> =
            all.map(|(sentence, has_ended)| self.sentence(bundle, sentence, has_ended)).collect();
        // A sentence that was cut lacks the price of its end, so it stands behind those that came to one.
        sentences.sort_by(|a, b| {
            b.has_ended
                .cmp(&a.has_ended)
                .then_with(|| b.score.total_cmp(&a.score))
                .then_with(|| a.words.cmp(&b.words))
        });
        sentences
    }

    fn sentence(&self, bundle: &Bundle, sentence: Open, has_ended: bool) -> Sentence {
        let Open { words, log_probability } = sentence;
        let num_words = words.len() + usize::from(has_ended);
        let texts: Vec<&str> =
            words.iter().map(|&word| bundle.vocabulary.words[word as usize].as_str()).collect();
        Sentence {
            text: texts.join(" "),
            score: log_probability / (num_words.max(1) as f64).powf(self.length_exponent),
            words,
            log_probability,
            has_ended,
        }
    }
}

impl Candidate {
    fn follow(&self, open: &[Open]) -> Open {
        let words = open[self.row].words.iter().copied().chain([self.word]).collect();
        Open { words, log_probability: self.log_probability }
    }
}

/// The most probable words, without the beginning of a sentence, which is no word; of equals the first.
fn most_probable(logarithms: &[f32], count: usize) -> Vec<(u32, f32)> {
    let mut words: Vec<(u32, f32)> =
        logarithms.iter().enumerate().map(|(word, &logarithm)| (word as u32, logarithm)).collect();
    words.swap_remove(BOS as usize);
    let order = |a: &(u32, f32), b: &(u32, f32)| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0));
    if count < words.len() {
        words.select_nth_unstable_by(count, order);
        words.truncate(count);
    }
    words.sort_by(order);
    words
}
