//! A score taken apart into its segments, so that any selection of them can be put together again.

use super::bleu::Bleu;
use super::clusters::Clusters;
use super::signature::Signature;

/// Numbers of every segment whose sums give the score of the corpus.
///
/// Computed once; a bootstrap resample is a sum over rows, not another pass over text.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistics {
    width: usize,
    /// `[segment, width]`, row by row.
    rows: Vec<f64>,
}

impl Statistics {
    /// One number a segment.
    #[must_use]
    pub fn of_values(values: Vec<f64>) -> Self {
        Self { width: 1, rows: values }
    }

    /// Rows of `N` numbers, one a segment.
    #[must_use]
    pub fn of_rows<const N: usize>(rows: &[[f64; N]]) -> Self {
        Self { width: N, rows: rows.as_flattened().to_vec() }
    }

    /// Number of segments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len().checked_div(self.width).unwrap_or(0)
    }

    /// Whether there is no segment.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The row of a segment.
    #[must_use]
    pub fn row(&self, segment: usize) -> &[f64] {
        &self.rows[segment * self.width..(segment + 1) * self.width]
    }

    /// Sum of the rows of some segments, repetitions counted.
    #[must_use]
    pub fn sum(&self, segments: impl Iterator<Item = usize>) -> Vec<f64> {
        let mut total = vec![0.0; self.width];
        for segment in segments {
            for (sum, value) in total.iter_mut().zip(self.row(segment)) {
                *sum += value;
            }
        }
        total
    }
}

/// How summed statistics become a score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Combine {
    /// The mean over segments of one value each.
    Mean,
    /// BLEU up to an order, from summed counts.
    Bleu {
        /// Its settings.
        settings: Bleu,
        /// Longest n-gram, 1 to 4.
        order: usize,
    },
}

impl Combine {
    /// The score of `num_segments` segments with these summed statistics.
    #[must_use]
    pub fn score(self, total: &[f64], num_segments: usize) -> f64 {
        match self {
            Self::Mean => total[0] / num_segments as f64,
            Self::Bleu { settings, order } => settings.score(total, order),
        }
    }

    /// The score of a single segment.
    ///
    /// BLEU in the manner of sacrebleu stops at the longest n-gram the sentence has, as that program does for sentences.
    #[must_use]
    pub fn segment_score(self, row: &[f64]) -> f64 {
        match self {
            Self::Mean => row[0],
            Self::Bleu { settings, order } => {
                Bleu { effective_order: settings.smoothing.is_sacrebleu(), ..settings }.score(row, order)
            }
        }
    }
}

/// One score of one corpus. Higher is better for every text score.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Stable key such as `bleu-4`.
    pub key: &'static str,
    /// Everything that changes the number.
    pub signature: Signature,
    /// The segments apart.
    pub statistics: Statistics,
    /// How they are put together.
    pub combine: Combine,
    /// Which of them are drawn together when the score is resampled; each on its own unless told otherwise.
    pub clusters: Clusters,
}

impl Measurement {
    /// A score of segments that are drawn one by one.
    #[must_use]
    pub fn new(key: &'static str, signature: Signature, statistics: Statistics, combine: Combine) -> Self {
        let clusters = Clusters::singles(statistics.len());
        Self { key, signature, statistics, combine, clusters }
    }

    /// A score that is the mean of one value a segment.
    #[must_use]
    pub fn of_values(key: &'static str, signature: Signature, values: Vec<f64>) -> Self {
        Self::new(key, signature, Statistics::of_values(values), Combine::Mean)
    }

    /// The same score, its segments drawn together as `clusters` says.
    ///
    /// # Panics
    /// If these are groups of another number of segments.
    #[must_use]
    pub fn clustered(self, clusters: &Clusters) -> Self {
        assert_eq!(clusters.num_segments(), self.statistics.len(), "groups of the segments of {}", self.key);
        Self { clusters: clusters.clone(), ..self }
    }

    /// The score of the whole corpus.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.score_of(0..self.statistics.len())
    }

    /// The score of a selection of segments, repetitions counted.
    #[must_use]
    pub fn score_of(&self, segments: impl ExactSizeIterator<Item = usize>) -> f64 {
        let num_segments = segments.len();
        self.combine.score(&self.statistics.sum(segments), num_segments)
    }

    /// The score of every segment on its own.
    #[must_use]
    pub fn segment_scores(&self) -> Vec<f64> {
        (0..self.statistics.len())
            .map(|segment| self.combine.segment_score(self.statistics.row(segment)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_put_together_from_any_selection() {
        let measurement = Measurement::of_values("k", Signature::new("k"), vec![1.0, 2.0, 6.0]);
        assert_eq!(measurement.score(), 3.0);
        assert_eq!(measurement.score_of([2, 2, 1].into_iter()), 14.0 / 3.0);
        assert_eq!(measurement.segment_scores(), [1.0, 2.0, 6.0]);
    }
}
