//! Sentences drawn from a model word by word.

use std::collections::BTreeMap;

use burn::tensor::Tensor;

use super::search::Open;
use super::variation::own_seed;
use crate::features::{BOS, EOS};
use crate::model::{Bundle, Draws};

/// A sentence that was drawn.
pub(super) struct Drawn {
    pub(super) sentence: Open,
    /// Whether it came to its end; otherwise it was cut at the most words.
    pub(super) has_ended: bool,
    /// How often.
    pub(super) times: usize,
}

/// Draws `count` sentences of a latent `[1, latent]`, each word with its probability; sorted by words, no two alike.
///
/// Those that were cut are left out, unless all were. Equal seeds and latents give equal sentences.
pub(super) fn draw(
    bundle: &Bundle,
    latent: &Tensor<2>,
    count: usize,
    most_words: usize,
    seed: u64,
) -> Vec<Drawn> {
    let values: Vec<f32> = latent.clone().into_data().iter().collect();
    let mut draws = Draws::new(own_seed(seed, &values), "sentences", 0);
    let mut open: Vec<Open> = (0..count).map(|_| Open { words: Vec::new(), log_probability: 0.0 }).collect();
    let mut ended = Vec::new();
    let mut writing = bundle.write(latent).select(&vec![0; count]);
    let mut last_words = vec![BOS; count];
    for _ in 0..most_words {
        let (logarithms, next) = bundle.next_words(&last_words, &writing);
        let mut going_on = Vec::new();
        let (mut rows, mut words) = (Vec::new(), Vec::new());
        for (row, (mut sentence, logarithms)) in open.into_iter().zip(&logarithms).enumerate() {
            let word = next_word(logarithms, &mut draws);
            sentence.log_probability += f64::from(logarithms[word as usize]);
            if word == EOS {
                ended.push(sentence);
            } else {
                sentence.words.push(word);
                going_on.push(sentence);
                rows.push(row);
                words.push(word);
            }
        }
        open = going_on;
        if open.is_empty() {
            break;
        }
        writing = next.select(&rows);
        last_words = words;
    }
    let has_ended = !ended.is_empty();
    let mut times: BTreeMap<Vec<u32>, (f64, usize)> = BTreeMap::new();
    for sentence in if has_ended { ended } else { open } {
        times.entry(sentence.words).or_insert((sentence.log_probability, 0)).1 += 1;
    }
    times
        .into_iter()
        .map(|(words, (log_probability, times))| Drawn {
            sentence: Open { words, log_probability },
            has_ended,
            times,
        })
        .collect()
}

/// A word with its probability, given their natural logarithms `[vocab]`; never the beginning of a sentence.
fn next_word(logarithms: &[f32], draws: &mut Draws) -> u32 {
    let probability =
        |word: usize| if word == BOS as usize { 0.0 } else { f64::from(logarithms[word]).exp() };
    let sum: f64 = (0..logarithms.len()).map(probability).sum();
    let mut left = draws.unit() * sum;
    let mut last = EOS as usize;
    for word in 0..logarithms.len() {
        let share = probability(word);
        if share > 0.0 {
            last = word;
            left -= share;
            if left < 0.0 {
                break;
            }
        }
    }
    // Rounding may leave a rest behind the last word.
    last as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_as_often_as_they_are_probable() {
        let shares = [0.5_f32, 0.1, 0.3, 0.0, 0.1];
        let logarithms = shares.map(f32::ln);
        let mut draws = Draws::new(7, "test", 0);
        let mut counts = [0_usize; 5];
        for _ in 0..20_000 {
            counts[next_word(&logarithms, &mut draws) as usize] += 1;
        }
        assert_eq!((counts[BOS as usize], counts[3]), (0, 0));
        // Without the beginning of a sentence 0.2, 0.6 and 0.2; five standard errors.
        for (count, share) in [(counts[1], 0.2), (counts[2], 0.6), (counts[4], 0.2)] {
            let deviation = (count as f64 / 20_000.0 - share).abs();
            assert!(deviation < 5.0 * (share * (1.0 - share) / 20_000.0_f64).sqrt(), "{counts:?}");
        }
    }
}
