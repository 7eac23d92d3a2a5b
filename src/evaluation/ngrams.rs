//! Sentences as numbers, and their n-grams.

use std::collections::HashMap;
use std::sync::Arc;

use super::corpus::Corpus;
use super::tokens::Tokenization;

/// Longest n-gram any score counts.
pub(super) const MAX_ORDER: usize = 4;

/// A corpus whose words are numbers: equal words, equal numbers.
#[derive(Debug)]
pub(super) struct Numbered {
    /// Segments in corpus order.
    pub segments: Vec<NumberedSegment>,
}

#[derive(Debug)]
pub(super) struct NumberedSegment {
    pub hypothesis: Arc<[u32]>,
    pub references: Vec<Arc<[u32]>>,
}

impl Numbered {
    pub fn new(corpus: &Corpus, tokenization: Tokenization) -> Self {
        let mut numbers: HashMap<Box<str>, u32> = HashMap::new();
        // Captions repeat: what many people wrote about many walks is cut into words once.
        let mut known: HashMap<&str, Arc<[u32]>> = HashMap::new();
        let mut number = |sentence| {
            if let Some(words) = known.get(sentence) {
                return Arc::clone(words);
            }
            let mut words = Vec::new();
            tokenization.for_each(sentence, |word| {
                if let Some(&known) = numbers.get(word) {
                    words.push(known);
                } else {
                    let fresh = numbers.len() as u32;
                    numbers.insert(word.into(), fresh);
                    words.push(fresh);
                }
            });
            let words: Arc<[u32]> = words.into();
            known.insert(sentence, Arc::clone(&words));
            words
        };
        let segments = corpus
            .segments()
            .iter()
            .map(|segment| NumberedSegment {
                hypothesis: number(&segment.hypothesis),
                references: segment.references.iter().map(|sentence| number(sentence)).collect(),
            })
            .collect();
        Self { segments }
    }
}

/// One to four words in one number, which compares and sorts faster than a slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Ngram(u128);

/// The n-grams of a sentence, `order` words each, at most [`MAX_ORDER`].
pub(super) fn ngrams(words: &[u32], order: usize) -> impl Iterator<Item = Ngram> {
    // One more than the word in 32 bits each, so that n-grams of different orders differ.
    let ngram = |words: &[u32]| words.iter().fold(0, |before, &word| (before << 32) | (u128::from(word) + 1));
    words.windows(order).map(move |words| Ngram(ngram(words)))
}

/// The distinct n-grams of a sentence in rising order, each with how often it occurs.
pub(super) fn counts(words: &[u32], order: usize) -> Vec<(Ngram, u32)> {
    let mut all: Vec<Ngram> = ngrams(words, order).collect();
    all.sort_unstable();
    let mut counts: Vec<(Ngram, u32)> = Vec::with_capacity(all.len());
    for ngram in all {
        match counts.last_mut() {
            Some((last, count)) if *last == ngram => *count += 1,
            _ => counts.push((ngram, 1)),
        }
    }
    counts
}

/// How often an n-gram occurs, from what [`counts`] gave.
pub(super) fn count_of(counts: &[(Ngram, u32)], ngram: Ngram) -> u32 {
    counts.binary_search_by_key(&ngram, |&(other, _)| other).map_or(0, |index| counts[index].1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ngrams_are_counted() {
        let words = [1, 2, 1, 2, 3];
        let bigrams = counts(&words, 2);
        let of = |words: &[u32]| ngrams(words, words.len()).next().unwrap();
        assert_eq!(bigrams, [(of(&[1, 2]), 2), (of(&[2, 1]), 1), (of(&[2, 3]), 1)]);
        assert_eq!((count_of(&bigrams, of(&[1, 2])), count_of(&bigrams, of(&[3, 1]))), (2, 0));
        assert_ne!(of(&[0]), of(&[0, 0]));
        assert!(counts(&words[..1], 2).is_empty());
    }
}
