//! Sentences as numbers, and their n-grams.

use std::collections::HashMap;

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
    pub hypothesis: Vec<u32>,
    pub references: Vec<Vec<u32>>,
}

impl Numbered {
    pub fn new(corpus: &Corpus, tokenization: Tokenization) -> Self {
        let mut numbers: HashMap<Box<str>, u32> = HashMap::new();
        let mut number = |sentence: &str| {
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

/// The distinct n-grams of a sentence in rising order, each with how often it occurs.
pub(super) fn counts(words: &[u32], order: usize) -> Vec<(&[u32], u32)> {
    let mut ngrams: Vec<&[u32]> = words.windows(order).collect();
    ngrams.sort_unstable();
    let mut counts: Vec<(&[u32], u32)> = Vec::with_capacity(ngrams.len());
    for ngram in ngrams {
        match counts.last_mut() {
            Some((last, count)) if *last == ngram => *count += 1,
            _ => counts.push((ngram, 1)),
        }
    }
    counts
}

/// How often an n-gram occurs, from what [`counts`] gave.
pub(super) fn count_of(counts: &[(&[u32], u32)], ngram: &[u32]) -> u32 {
    counts.binary_search_by(|(other, _)| (*other).cmp(ngram)).map_or(0, |index| counts[index].1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ngrams_are_counted() {
        let words = [1, 2, 1, 2, 3];
        let bigrams = counts(&words, 2);
        assert_eq!(bigrams, [(&[1, 2][..], 2), (&[2, 1][..], 1), (&[2, 3][..], 1)]);
        assert_eq!((count_of(&bigrams, &[1, 2]), count_of(&bigrams, &[3, 1])), (2, 0));
        assert!(counts(&words[..1], 2).is_empty());
    }
}
