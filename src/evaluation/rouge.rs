//! ROUGE-L: the longest common subsequence of words (Lin 2004).
//!
//! With `P = L / hypothesis length` and `R = L / reference length`, `F = (1 + b^2) P R / (R + b^2 P)`.
//! A ratio in 0..1; an empty sentence scores 0.

use super::corpus::Corpus;
use super::measurement::Measurement;
use super::ngrams::Numbered;
use super::signature::Signature;
use super::tokens::Tokenization;

/// Which program's reading of ROUGE-L.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RougeVariant {
    /// The image-captioning tools (pycocoevalcap, nlg-eval): b = 1.2, P and R each the best over the references, which
    /// need not be the same reference.
    Captioning,
    /// The package rouge-score: b = 1, F of the best reference.
    RougeScore,
}

/// Settings of ROUGE-L.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RougeL {
    /// What a word is.
    pub tokenization: Tokenization,
    /// Whose reading.
    pub variant: RougeVariant,
}

impl RougeL {
    /// As motion captioning reports it.
    pub const CAPTIONING: Self =
        Self { tokenization: Tokenization::LOWER_WORDS, variant: RougeVariant::Captioning };
    /// As the package rouge-score computes it.
    pub const ROUGE_SCORE: Self =
        Self { tokenization: Tokenization::ROUGE, variant: RougeVariant::RougeScore };

    /// ROUGE-L of a corpus: the mean over segments.
    #[must_use]
    pub fn measure(self, corpus: &Corpus) -> Measurement {
        let (beta, best) = match self.variant {
            RougeVariant::Captioning => ("1.2", "each"),
            RougeVariant::RougeScore => ("1", "f"),
        };
        let signature = Signature::new("rouge-l")
            .with("nrefs", corpus.num_references())
            .with("tok", self.tokenization.name())
            .with("case", self.tokenization.case())
            .with("beta", beta)
            .with("best", best)
            .with("v", 1);
        let values = Numbered::new(corpus, self.tokenization)
            .segments
            .iter()
            .map(|segment| {
                let shares =
                    segment.references.iter().map(|reference| shares(&segment.hypothesis, reference));
                match self.variant {
                    RougeVariant::Captioning => {
                        let (precision, recall) = shares
                            .fold((0.0_f64, 0.0_f64), |best, now| (best.0.max(now.0), best.1.max(now.1)));
                        f_measure(precision, recall, 1.2)
                    }
                    RougeVariant::RougeScore => shares
                        .map(|(precision, recall)| f_measure(precision, recall, 1.0))
                        .fold(0.0, f64::max),
                }
            })
            .collect();
        Measurement::of_values("rouge-l", signature, values)
    }
}

/// Shares of hypothesis and reference that their longest common subsequence covers.
fn shares(hypothesis: &[u32], reference: &[u32]) -> (f64, f64) {
    if hypothesis.is_empty() || reference.is_empty() {
        return (0.0, 0.0);
    }
    let common = common_length(hypothesis, reference) as f64;
    (common / hypothesis.len() as f64, common / reference.len() as f64)
}

fn f_measure(precision: f64, recall: f64, beta: f64) -> f64 {
    if precision == 0.0 || recall == 0.0 {
        return 0.0;
    }
    (1.0 + beta * beta) * precision * recall / (recall + beta * beta * precision)
}

/// Length of the longest common subsequence, one row of the table at a time.
fn common_length(a: &[u32], b: &[u32]) -> usize {
    let mut row = vec![0; b.len() + 1];
    for word in a {
        let mut diagonal = 0;
        for (index, other) in b.iter().enumerate() {
            let above = row[index + 1];
            row[index + 1] = if word == other { diagonal + 1 } else { above.max(row[index]) };
            diagonal = above;
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::super::corpus::Segment;
    use super::*;

    fn score(rouge: RougeL, hypothesis: &str, references: &[&str]) -> f64 {
        let references = references.iter().map(|&text| text.to_owned()).collect();
        let segment = Segment { id: String::new(), hypothesis: hypothesis.to_owned(), references };
        rouge.measure(&Corpus::new(vec![segment]).unwrap()).score()
    }

    #[test]
    fn subsequences_need_not_be_adjacent() {
        assert_eq!(common_length(&[1, 9, 2, 8, 3], &[1, 2, 3, 4]), 3);
        assert_eq!(common_length(&[], &[1]), 0);
    }

    #[test]
    fn precision_and_recall_may_come_from_two_references() {
        // P = 2/2 from the second, R = 1/1 from the first.
        let references = ["walks", "a person walks far away"];
        assert_eq!(score(RougeL::CAPTIONING, "person walks", &references), 1.0);
        let best = 2.0 * (0.5 * 1.0) / 1.5;
        assert!((score(RougeL::ROUGE_SCORE, "person walks", &references) - best).abs() < 1e-12);
    }

    #[test]
    fn empty_sentences_score_zero() {
        assert_eq!(score(RougeL::CAPTIONING, "", &["a"]), 0.0);
        assert_eq!(score(RougeL::ROUGE_SCORE, "a", &[""]), 0.0);
    }
}
