//! BLEU: shared n-grams, with a penalty for short output.
//!
//! Papineni et al. 2002; smoothing after Chen and Cherry 2014.
//! `BLEU = BP exp(1/N sum_n ln p_n)`, `p_n` = clipped matches / n-grams of the hypotheses, `BP = min(1, exp(1 - r/c))` with
//! `c` the length of the hypotheses and `r` that of the references closest in length.
//! The two programs everyone uses differ in more than smoothing: NLTK counts at least one n-gram for every sentence,
//! however short, and sacrebleu does not. The choice of [`Smoothing`] decides whose rules hold, to the last digit.
//! A ratio in 0..1; sacrebleu prints a hundred times this.

mod precision;

use rayon::prelude::*;

use super::corpus::Corpus;
use super::measurement::{Combine, Measurement, Statistics};
use super::ngrams::{MAX_ORDER, Numbered, NumberedSegment, count_of, counts};
use super::signature::Signature;
use super::tokens::Tokenization;

/// Length of a row of statistics: both lengths, then matches and totals of every order.
const WIDTH: usize = 2 + 2 * MAX_ORDER;

/// What is done about an order without a match, and whose counting rules hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Smoothing {
    /// sacrebleu `none`: the score is zero.
    None,
    /// sacrebleu `exp`, its default: the first such order counts 1/2 match, the next 1/4, and so on.
    Exp,
    /// sacrebleu `floor`: such an order counts this many matches; the default is 0.1.
    Floor(f64),
    /// sacrebleu `add-k`: this many more matches and n-grams for every order above the first; the default is 1.
    AddK(f64),
    /// NLTK `method0`: the smallest normal number instead of zero, so that the score nearly vanishes.
    NltkNone,
    /// NLTK `method1`: such an order counts this many matches; the default is 0.1.
    NltkEpsilon(f64),
    /// NLTK `method4`: matches as `exp`, times ln(length) / k; the default k is 5.
    NltkLength(f64),
}

impl Smoothing {
    /// Name with its value, as in signatures.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::None => "none".to_owned(),
            Self::Exp => "exp".to_owned(),
            Self::Floor(value) => format!("floor[{value}]"),
            Self::AddK(k) => format!("add-k[{k}]"),
            Self::NltkNone => "nltk0".to_owned(),
            Self::NltkEpsilon(epsilon) => format!("nltk1[{epsilon}]"),
            Self::NltkLength(k) => format!("nltk4[{k}]"),
        }
    }

    /// The smoothing of this name, with its default value.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Some(match name {
            "none" => Self::None,
            "exp" => Self::Exp,
            "floor" => Self::Floor(0.1),
            "add-k" => Self::AddK(1.0),
            "nltk0" => Self::NltkNone,
            "nltk1" => Self::NltkEpsilon(0.1),
            "nltk4" => Self::NltkLength(5.0),
            _ => return None,
        })
    }

    /// Whether sacrebleu's rules hold, rather than NLTK's.
    #[must_use]
    pub fn is_sacrebleu(self) -> bool {
        matches!(self, Self::None | Self::Exp | Self::Floor(_) | Self::AddK(_))
    }
}

/// Settings of BLEU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bleu {
    /// What a word is.
    pub tokenization: Tokenization,
    /// What an order without matches counts.
    pub smoothing: Smoothing,
    /// Leave out the orders that are longer than all hypotheses; sacrebleu's rules only. Meant for single sentences.
    pub effective_order: bool,
}

impl Bleu {
    /// Keys of BLEU-1 to BLEU-4, by NLTK's rules and by sacrebleu's.
    const KEYS: [[&'static str; MAX_ORDER]; 2] = [
        ["bleu-1", "bleu-2", "bleu-3", "bleu-4"],
        ["sacrebleu-1", "sacrebleu-2", "sacrebleu-3", "sacrebleu-4"],
    ];

    /// Corpus BLEU without smoothing over lower-case words and punctuation marks, all references at once: the reading
    /// of the paper's unqualified BLEU that its level fits best.
    pub const PAPER: Self = Self {
        tokenization: Tokenization::LOWER_WORDS,
        smoothing: Smoothing::NltkNone,
        effective_order: false,
    };

    /// What sacrebleu computes unless told otherwise.
    pub const SACREBLEU: Self =
        Self { tokenization: Tokenization::V13A, smoothing: Smoothing::Exp, effective_order: false };

    /// BLEU-1 to BLEU-4 of a corpus.
    #[must_use]
    pub fn measure(self, corpus: &Corpus) -> [Measurement; MAX_ORDER] {
        let nltk = !self.smoothing.is_sacrebleu();
        let rows: Vec<[f64; WIDTH]> = Numbered::new(corpus, self.tokenization)
            .segments
            .par_iter()
            .map(|segment| statistics(segment, nltk))
            .collect();
        let statistics = Statistics::of_rows(&rows);
        std::array::from_fn(|index| {
            let key = Self::KEYS[usize::from(!nltk)][index];
            let combine = Combine::Bleu { settings: self, order: index + 1 };
            Measurement::new(key, self.signature(key, corpus), statistics.clone(), combine)
        })
    }

    fn signature(self, key: &str, corpus: &Corpus) -> Signature {
        Signature::new(key)
            .with("nrefs", corpus.num_references())
            .with("tok", self.tokenization.name())
            .with("case", self.tokenization.case())
            .with("smooth", self.smoothing.name())
            .with("eff", if self.effective_order { "yes" } else { "no" })
            .with("v", 1)
    }

    /// The score from summed statistics `[hypothesis length, reference length, 4 matches, 4 totals]`.
    #[must_use]
    pub fn score(self, total: &[f64], order: usize) -> f64 {
        precision::score(total, order, self.smoothing, self.effective_order)
    }
}

/// Lengths, clipped matches and n-grams of a segment.
fn statistics(segment: &NumberedSegment, nltk: bool) -> [f64; WIDTH] {
    let length = segment.hypothesis.len();
    // Of two references equally close the shorter counts.
    let closest = segment
        .references
        .iter()
        .map(|reference| reference.len())
        .min_by_key(|&other| (other.abs_diff(length), other))
        .unwrap_or_default();
    let mut row = [0.0; WIDTH];
    row[0] = length as f64;
    row[1] = closest as f64;
    for order in 1..=MAX_ORDER {
        let ours = counts(&segment.hypothesis, order);
        let theirs: Vec<_> = segment.references.iter().map(|words| counts(words, order)).collect();
        let matches: u32 = ours
            .iter()
            .map(|&(ngram, count)| {
                let most = theirs.iter().map(|reference| count_of(reference, ngram)).max();
                count.min(most.unwrap_or(0))
            })
            .sum();
        let total = (length + 1).saturating_sub(order);
        row[1 + order] = f64::from(matches);
        row[1 + MAX_ORDER + order] = if nltk { total.max(1) } else { total } as f64;
    }
    row
}

#[cfg(test)]
mod tests {
    use super::super::corpus::Segment;
    use super::*;

    fn corpus(hypothesis: &str, references: &[&str]) -> Corpus {
        let references = references.iter().map(|&text| text.to_owned()).collect();
        let segment = Segment { id: String::new(), hypothesis: hypothesis.to_owned(), references };
        Corpus::new(vec![segment]).unwrap()
    }

    #[test]
    fn matches_are_clipped_by_the_richest_reference() {
        // Papineni et al. 2002, section 2.1: two of seven.
        let corpus =
            corpus("the the the the the the the", &["the cat is on the mat", "there is a cat on the mat"]);
        let [first, second, ..] = Bleu::PAPER.measure(&corpus);
        assert_eq!(first.statistics.row(0)[..2], [7.0, 7.0]);
        assert!((first.score() - 2.0 / 7.0).abs() < 1e-12);
        assert!(second.score() < 1e-100);
    }

    #[test]
    fn short_output_pays() {
        let corpus = corpus("a person", &["a person walks on"]);
        let [first, ..] = Bleu::SACREBLEU.measure(&corpus);
        assert!((first.score() - (-1.0_f64).exp()).abs() < 1e-12);
    }

    #[test]
    fn an_empty_hypothesis_scores_zero() {
        for smoothing in ["none", "exp", "floor", "add-k", "nltk0", "nltk1", "nltk4"] {
            let smoothing = Smoothing::by_name(smoothing).unwrap();
            for measurement in (Bleu { smoothing, ..Bleu::PAPER }).measure(&corpus("", &["a person walks"])) {
                assert_eq!(measurement.score(), 0.0, "{smoothing:?}");
                assert_eq!(measurement.segment_scores(), [0.0]);
            }
        }
    }

    #[test]
    fn the_signature_names_every_choice() {
        let [.., fourth] = Bleu::SACREBLEU.measure(&corpus("a", &["a", "b"]));
        assert_eq!(fourth.signature.as_str(), "sacrebleu-4|nrefs:2|tok:13a|case:mixed|smooth:exp|eff:no|v:1");
    }
}
