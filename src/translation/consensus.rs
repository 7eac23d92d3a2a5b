//! The sentence that says most of what the others say.

use std::collections::BTreeMap;

use super::search::Sentence;

/// Longest n-gram that is compared.
const MAX_ORDER: usize = 4;

/// Puts the sentence of the highest expected similarity first, and that similarity into its score (0 to 1).
///
/// The decision of minimum Bayes risk (Kumar and Byrne 2004): each sentence is compared with all, itself included, as if one
/// of them were what a person would write, and the comparisons are weighted by how probable that is. `weights` are their
/// probabilities, of any sum above 0. Of equals the more probable one comes first.
pub(super) fn rank(sentences: &mut [Sentence], weights: &[f64]) {
    let sum: f64 = weights.iter().sum();
    let expected = |hypothesis: &Sentence| -> f64 {
        let all = sentences.iter().zip(weights);
        all.map(|(other, weight)| weight / sum * similarity(&hypothesis.words, &other.words)).sum()
    };
    let scores: Vec<f64> = sentences.iter().map(expected).collect();
    for (sentence, score) in sentences.iter_mut().zip(scores) {
        sentence.score = score;
    }
    sentences.sort_by(|a, b| {
        b.score
            .total_cmp(&a.score)
            .then_with(|| b.log_probability.total_cmp(&a.log_probability))
            .then_with(|| a.words.cmp(&b.words))
    });
}

/// How much of one sentence another one says, 0 to 1: BLEU-4 of single sentences.
///
/// The geometric mean of the precisions of n-grams of 1 to 4 words times the brevity penalty (Papineni et al. 2002), with
/// one added to the matches and to the n-grams of two words and more (Lin and Och 2004). No common word: 0; two sentences
/// without a word: 1.
fn similarity(hypothesis: &[u32], reference: &[u32]) -> f64 {
    if hypothesis == reference {
        return 1.0;
    }
    let mut logarithm = 0.0;
    for order in 1..=MAX_ORDER {
        let found = counts(hypothesis, order);
        let wanted = counts(reference, order);
        let matches: usize =
            found.iter().map(|(words, &count)| count.min(wanted.get(words).copied().unwrap_or(0))).sum();
        let total: usize = found.values().sum();
        if order == 1 && matches == 0 {
            return 0.0;
        }
        let smooth = if order == 1 { 0.0 } else { 1.0 };
        logarithm += ((matches as f64 + smooth) / (total as f64 + smooth)).ln() / MAX_ORDER as f64;
    }
    let penalty = 1.0 - reference.len() as f64 / hypothesis.len() as f64;
    (logarithm + penalty.min(0.0)).exp()
}

fn counts(words: &[u32], order: usize) -> BTreeMap<&[u32], usize> {
    let mut counts = BTreeMap::new();
    for gram in words.windows(order) {
        *counts.entry(gram).or_default() += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentence(words: &[u32], log_probability: f64) -> Sentence {
        Sentence { text: String::new(), words: words.to_vec(), log_probability, score: 0.0, has_ended: true }
    }

    #[test]
    fn similarity_is_smoothed_sentence_bleu() {
        assert_eq!(similarity(&[5, 6, 7], &[5, 6, 7]), 1.0);
        assert_eq!(similarity(&[], &[]), 1.0);
        assert_eq!((similarity(&[1], &[2]), similarity(&[], &[2]), similarity(&[2], &[])), (0.0, 0.0, 0.0));
        // Precisions 3/4, (1 + 1)/(3 + 1), (0 + 1)/(2 + 1), (0 + 1)/(1 + 1); one word shorter than the other.
        let by_hand = (0.75_f64 * 0.5 / 3.0 * 0.5).powf(0.25) * (1.0_f64 - 5.0 / 4.0).exp();
        assert!((similarity(&[1, 2, 9, 3], &[1, 2, 4, 3, 5]) - by_hand).abs() < 1e-12);
        // A word counts as often as it is in the other: 1/2, (0 + 1)/(1 + 1), and nothing longer.
        let by_hand = (0.5_f64 * 0.5).powf(0.25);
        assert!((similarity(&[1, 1], &[1, 2]) - by_hand).abs() < 1e-12);
    }

    #[test]
    fn the_one_most_like_the_others_comes_first() {
        // The first is the most probable, but the other three agree on most words.
        let (odd, most) = (vec![9, 8, 7], vec![1, 2, 3, 4]);
        let mut sentences = vec![
            sentence(&odd, -1.0),
            sentence(&[1, 2, 3, 5], -1.3),
            sentence(&most, -1.2),
            sentence(&[6, 2, 3, 4], -1.3),
        ];
        rank(&mut sentences, &[0.31, 0.22, 0.25, 0.22]);
        assert_eq!(sentences[0].words, most);
        assert_eq!(sentences[3].words, odd);
        assert!((sentences[3].score - 0.31).abs() < 1e-12);
        // With most of the probability the odd one wins; only the ratio of the weights matters.
        let weights: Vec<f64> = sentences.iter().map(|it| if it.words == odd { 12.0 } else { 1.0 }).collect();
        rank(&mut sentences, &weights);
        assert_eq!(sentences[0].words, odd);
    }
}
