//! BERTScore: every token greedily matched to the most similar one of the other sentence (Zhang et al. 2020).
//!
//! With `s_ij` the cosine of hypothesis token i and reference token j, `P = sum_i w_i max_j s_ij / sum_i w_i`, `R` the same
//! over reference tokens, `F = 2 P R / (P + R)`; over several references each of the three is the best of its own, as the
//! package bert-score has it, so F need not belong to P and R.
//! Start and end tokens carry no weight but may be matched.
//! About 0..1, often within 0.85..1 for raw values, which is what rescaling by a baseline is for: `(x - b) / (1 - b)`.
//! A sentence without words scores 0 before rescaling.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::measurement::Measurement;
use super::signature::Signature;

/// A sentence as an encoder sees it, start and end tokens included.
#[derive(Debug, Clone, PartialEq)]
pub struct EmbeddedTokens {
    /// Token ids, first and last being the start and end tokens.
    pub ids: Vec<u32>,
    /// `[token, width]`, row by row, every row of length 1.
    units: Vec<f32>,
}

impl EmbeddedTokens {
    /// From the vectors of the tokens, `[token, width]` row by row, which are divided by their lengths.
    ///
    /// `None` unless there is the same number of numbers, at least one, for every id.
    #[must_use]
    pub fn new(ids: Vec<u32>, mut vectors: Vec<f32>) -> Option<Self> {
        let width = vectors.len().checked_div(ids.len())?;
        if width == 0 || width * ids.len() != vectors.len() {
            return None;
        }
        for vector in vectors.chunks_exact_mut(width) {
            let length = vector.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt() as f32;
            if length > 0.0 {
                for x in vector {
                    *x /= length;
                }
            }
        }
        Some(Self { ids, units: vectors })
    }

    fn width(&self) -> usize {
        self.units.len() / self.ids.len()
    }

    fn tokens(&self) -> impl Iterator<Item = &[f32]> {
        self.units.chunks_exact(self.width())
    }

    /// Whether there is nothing between start and end.
    fn is_wordless(&self) -> bool {
        self.ids.len() <= 2
    }
}

/// P, R and F that random sentence pairs reach under an encoder and layer.
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    /// Precision, recall, F.
    pub values: [f64; 3],
    /// What names it in signatures.
    pub name: String,
}

/// Settings of BERTScore.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BertScore {
    /// Weigh tokens by their inverse document frequency in the references instead of equally.
    pub idf: bool,
    /// Rescale by this baseline.
    pub baseline: Option<Baseline>,
    /// Encoder and layer, as in signatures.
    pub encoder: String,
}

/// One hypothesis and its references, embedded.
#[derive(Debug, Clone)]
pub struct EmbeddedSegment<'a> {
    /// The hypothesis.
    pub hypothesis: &'a EmbeddedTokens,
    /// The references.
    pub references: Vec<&'a EmbeddedTokens>,
}

impl BertScore {
    /// Keys of precision, recall and F: raw, weighted by idf, rescaled, both.
    const KEYS: [[&'static str; 3]; 4] = [
        ["bertscore-p", "bertscore-r", "bertscore-f"],
        ["bertscore-idf-p", "bertscore-idf-r", "bertscore-idf-f"],
        ["bertscore-rescaled-p", "bertscore-rescaled-r", "bertscore-rescaled-f"],
        ["bertscore-rescaled-idf-p", "bertscore-rescaled-idf-r", "bertscore-rescaled-idf-f"],
    ];

    /// Precision, recall and F of a corpus, each the mean over segments.
    #[must_use]
    pub fn measure(&self, segments: &[EmbeddedSegment<'_>]) -> [Measurement; 3] {
        let weights = self.idf.then(|| Idf::new(segments));
        let values: Vec<[f64; 3]> = segments
            .par_iter()
            .map(|segment| {
                let mut best = [f64::NEG_INFINITY; 3];
                for reference in &segment.references {
                    let now = pair(segment.hypothesis, reference, weights.as_ref());
                    best = std::array::from_fn(|index| best[index].max(now[index]));
                }
                std::array::from_fn(|index| self.rescaled(best[index], index))
            })
            .collect();
        let keys = Self::KEYS[usize::from(self.idf) + 2 * usize::from(self.baseline.is_some())];
        let num_references: BTreeSet<usize> =
            segments.iter().map(|segment| segment.references.len()).collect();
        let num_references = match num_references.first() {
            Some(only) if num_references.len() == 1 => only.to_string(),
            _ => "var".to_owned(),
        };
        std::array::from_fn(|index| {
            let signature = Signature::new(keys[index])
                .with("nrefs", &num_references)
                .with("encoder", &self.encoder)
                .with("idf", if self.idf { "references" } else { "no" })
                .with("rescaled", self.baseline.as_ref().map_or("no", |baseline| &baseline.name))
                .with("best", "each")
                .with("v", 1);
            let values = values.iter().map(|triple| triple[index]).collect();
            Measurement::of_values(keys[index], signature, values)
        })
    }

    fn rescaled(&self, value: f64, index: usize) -> f64 {
        self.baseline.as_ref().map_or(value, |baseline| {
            let base = baseline.values[index];
            (value - base) / (1.0 - base)
        })
    }
}

/// ln((N + 1) / (df + 1)) of tokens, over all references, each a document.
struct Idf {
    num_documents: f64,
    frequencies: BTreeMap<u32, u32>,
}

impl Idf {
    fn new(segments: &[EmbeddedSegment<'_>]) -> Self {
        let mut frequencies: BTreeMap<u32, u32> = BTreeMap::new();
        let mut num_documents = 0.0;
        for reference in segments.iter().flat_map(|segment| &segment.references) {
            num_documents += 1.0;
            let distinct: BTreeSet<u32> = reference.ids.iter().copied().collect();
            for id in distinct {
                *frequencies.entry(id).or_default() += 1;
            }
        }
        Self { num_documents, frequencies }
    }

    fn weight(&self, id: u32) -> f64 {
        let frequency = f64::from(self.frequencies.get(&id).copied().unwrap_or(0));
        ((self.num_documents + 1.0) / (frequency + 1.0)).ln()
    }
}

/// Weights of the tokens of a sentence.
fn weights(sentence: &EmbeddedTokens, idf: Option<&Idf>) -> Vec<f64> {
    let last = sentence.ids.len() - 1;
    let weight = |(index, &id): (usize, &u32)| match idf {
        Some(idf) => idf.weight(id),
        None if index == 0 || index == last => 0.0,
        None => 1.0,
    };
    sentence.ids.iter().enumerate().map(weight).collect()
}

/// Precision, recall and F of a hypothesis against one reference, before rescaling.
fn pair(hypothesis: &EmbeddedTokens, reference: &EmbeddedTokens, idf: Option<&Idf>) -> [f64; 3] {
    if hypothesis.is_wordless() || reference.is_wordless() {
        return [0.0; 3];
    }
    let mut best_of_hypothesis = vec![f32::NEG_INFINITY; hypothesis.ids.len()];
    let mut best_of_reference = vec![f32::NEG_INFINITY; reference.ids.len()];
    for (ours, best) in hypothesis.tokens().zip(&mut best_of_hypothesis) {
        for (theirs, other_best) in reference.tokens().zip(&mut best_of_reference) {
            let cosine = dot(ours, theirs);
            *best = best.max(cosine);
            *other_best = other_best.max(cosine);
        }
    }
    let precision = weighted_mean(&best_of_hypothesis, &weights(hypothesis, idf));
    let recall = weighted_mean(&best_of_reference, &weights(reference, idf));
    let sum = precision + recall;
    let f = if sum == 0.0 { 0.0 } else { 2.0 * precision * recall / sum };
    [precision, recall, f]
}

/// Mean of the values; 0 where no value has weight.
fn weighted_mean(values: &[f32], weights: &[f64]) -> f64 {
    let total: f64 = weights.iter().sum();
    if total == 0.0 {
        return 0.0;
    }
    values.iter().zip(weights).map(|(&value, weight)| f64::from(value) * weight).sum::<f64>() / total
}

/// Scalar product in several running sums, which the compiler can put side by side.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 16;
    let mut sums = [0.0_f32; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f32 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tokens in the plane at these angles in degrees, between a start and an end token that point backwards.
    fn sentence(words: &[(u32, f32)]) -> EmbeddedTokens {
        let mut ids = vec![101];
        let mut vectors = vec![-3.0, 0.0];
        for &(id, degrees) in words {
            ids.push(id);
            vectors.extend([2.0 * degrees.to_radians().cos(), 2.0 * degrees.to_radians().sin()]);
        }
        ids.push(102);
        vectors.extend([-3.0, 0.0]);
        EmbeddedTokens::new(ids, vectors).unwrap()
    }

    fn measure(score: &BertScore, hypothesis: &EmbeddedTokens, references: &[EmbeddedTokens]) -> [f64; 3] {
        let segment = EmbeddedSegment { hypothesis, references: references.iter().collect() };
        score.measure(&[segment]).map(|measurement| measurement.score())
    }

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }

    #[test]
    fn tokens_are_matched_greedily() {
        let hypothesis = sentence(&[(1, 0.0), (2, 60.0)]);
        let reference = sentence(&[(1, 0.0)]);
        let [p, r, f] = measure(&BertScore::default(), &hypothesis, &[reference]);
        close(p, 0.75);
        close(r, 1.0);
        close(f, 2.0 * 0.75 / 1.75);
    }

    #[test]
    fn each_value_is_the_best_of_its_own() {
        let hypothesis = sentence(&[(1, 0.0), (2, 60.0)]);
        let references = [sentence(&[(1, 0.0)]), sentence(&[(1, 0.0), (2, 60.0), (3, 120.0), (4, 90.0)])];
        let [p, r, f] = measure(&BertScore::default(), &hypothesis, &references);
        close(p, 1.0);
        close(r, 1.0);
        assert!(f < 0.95, "no single reference reaches it: {f}");
    }

    #[test]
    fn common_tokens_weigh_little_with_idf() {
        // Token 1 is in all three references, token 2 in one: ln(4/4) = 0 and ln(4/2).
        let references = [sentence(&[(1, 0.0), (2, 90.0)]), sentence(&[(1, 0.0)]), sentence(&[(1, 0.0)])];
        let hypothesis = sentence(&[(1, 45.0), (2, 90.0)]);
        let segments: Vec<_> = references
            .iter()
            .map(|reference| EmbeddedSegment { hypothesis: &hypothesis, references: vec![reference] })
            .collect();
        let [p, ..] = BertScore { idf: true, ..BertScore::default() }.measure(&segments);
        close(p.segment_scores()[0], 1.0);
        close(p.segment_scores()[1], 0.0);
    }

    #[test]
    fn rescaling_moves_the_baseline_to_zero() {
        let baseline = Baseline { values: [0.5, 0.5, 0.8], name: "b".to_owned() };
        let score = BertScore { baseline: Some(baseline), ..BertScore::default() };
        let [p, r, f] = measure(&score, &sentence(&[(1, 0.0)]), &[sentence(&[(1, 60.0)])]);
        close(p, 0.0);
        close(r, 0.0);
        close(f, -1.5);
    }

    #[test]
    fn a_sentence_without_words_scores_zero() {
        assert_eq!(measure(&BertScore::default(), &sentence(&[]), &[sentence(&[(1, 0.0)])]), [0.0; 3]);
    }

    #[test]
    fn ragged_vectors_are_refused() {
        assert_eq!(EmbeddedTokens::new(vec![1, 2], vec![1.0; 3]), None);
        assert_eq!(EmbeddedTokens::new(vec![], vec![]), None);
        assert_eq!(EmbeddedTokens::new(vec![1], vec![]), None);
    }
}
