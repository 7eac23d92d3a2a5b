//! The sentences a model finds most probable.

use std::cmp::Ordering;

use burn::tensor::Tensor;

use crate::features::{BOS, EOS};
use crate::model::Bundle;

/// How sentences are looked for.
///
/// Beam search: of all continuations of the sentences at hand by one word, the `beam` most probable go on; a sentence is
/// finished when its end is among them, and the search when `beam` are. A beam of 1 is greedy search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Sentences followed side by side; at least 1. Default 1.
    pub beam: usize,
    /// Sentences wanted; the beam is at least this wide. Default 1.
    pub n_best: usize,
    /// Exponent of the length normalisation: sentences are ranked by `log p / n^a`, with `n` words, the end included.
    /// 0 ranks by probability alone, which favours short sentences; larger values favour longer ones. Default 0.7.
    pub length_exponent: f64,
    /// Most words; `None` takes twice as many as the longest caption of the training has.
    pub most_words: Option<usize>,
}

impl Default for Search {
    fn default() -> Self {
        Self { beam: 1, n_best: 1, length_exponent: 0.7, most_words: None }
    }
}

/// A sentence with what the model thinks of it.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Sentence {
    /// The words with spaces between them.
    pub text: String,
    /// Numbers of the words, without the two ends.
    #[serde(skip)]
    pub words: Vec<u32>,
    /// Natural logarithm of its probability, the end included.
    pub log_probability: f64,
    /// What it is ranked by; see [`Search::length_exponent`].
    pub score: f64,
    /// Whether it came to its end; otherwise it was cut at the most words.
    pub has_ended: bool,
}

/// A sentence that goes on.
struct Open {
    words: Vec<u32>,
    log_probability: f64,
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
    /// The best sentences of a latent `[1, latent]`, best first, no two alike.
    pub(super) fn sentences(&self, bundle: &Bundle, latent: &Tensor<2>) -> Vec<Sentence> {
        let beam = self.beam.max(self.n_best).max(1);
        let most_words = self.most_words.unwrap_or(2 * bundle.config.longest_caption).max(1);
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
        sentences.truncate(self.n_best.max(1));
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
