//! How sure a score is, and whether two systems differ.
//!
//! Segments, or [`Clusters`] of them, are drawn with replacement and their statistics put together anew (Efron 1979); two systems are compared over
//! the same draws (Koehn 2004), and by exchanging their outputs at random (Riezler and Maxwell 2005).
//! Every draw has its own random stream from the seed and its number, so results do not depend on the number of threads.

use rayon::prelude::*;
use thiserror::Error;

use super::clusters::Clusters;
use super::measurement::Measurement;
use crate::report::{Interval, SplitMix64, quantile};

/// Fewest segments, or groups of them, for an interval: below, draws repeat so much that it says less than it seems to.
pub const MIN_SEGMENTS: usize = 5;

/// How often and from which seed segments are drawn, those of a group together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resampling {
    /// Number of draws.
    pub num_resamples: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for Resampling {
    /// A thousand draws: more would move the ends of an interval by less than the printed digits.
    fn default() -> Self {
        Self { num_resamples: 1000, seed: 0 }
    }
}

/// Two systems on the same segments.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// Score of ours minus score of the other.
    pub difference: f64,
    /// 95 % interval of the difference; `None` below five segments.
    pub difference_interval: Option<Interval>,
    /// Score of ours in percent of the other's, the paper's relative performance; `None` when the other's is not positive.
    pub relative_percent: Option<f64>,
    /// 95 % interval of the relative performance.
    pub relative_interval: Option<Interval>,
    /// Two-sided p-value of the paired bootstrap: how often a centred difference is as large as the one found; `None` below
    /// five segments.
    pub p_bootstrap: Option<f64>,
    /// Two-sided p-value of approximate randomisation: how often exchanged outputs differ as much.
    pub p_randomization: f64,
}

/// Two measurements that say nothing about each other.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ComparisonError {
    /// Different scores or settings.
    #[error("compare two systems: {ours} is not {other}")]
    OtherSignature {
        /// Our signature.
        ours: String,
        /// The other's.
        other: String,
    },
    /// Different numbers of segments.
    #[error("compare two systems: {ours} segments are not {other}")]
    OtherLength {
        /// Number of our segments.
        ours: usize,
        /// Number of the other's.
        other: usize,
    },
    /// Different groups of segments.
    #[error("compare two systems: other segments belong together in one than in the other")]
    OtherClusters,
}

impl Resampling {
    fn stream(self, draw: usize) -> SplitMix64 {
        // Hashed starts: that two of some thousand streams overlap has a chance below 1e-9.
        let mut starts = SplitMix64(self.seed.wrapping_add(draw as u64));
        SplitMix64(starts.bits() ^ self.seed.rotate_left(32))
    }

    fn draw(self, draw: usize, clusters: &Clusters) -> Vec<usize> {
        let mut random = self.stream(draw);
        let groups = (0..clusters.len()).map(|_| random.below(clusters.len()));
        groups.flat_map(|group| clusters.members(group)).copied().collect()
    }

    /// 95 % percentile interval of a corpus score; `None` below [`MIN_SEGMENTS`] segments, or groups of them.
    #[must_use]
    pub fn interval(self, measurement: &Measurement) -> Option<Interval> {
        self.interval_of(&measurement.clusters, |segments| measurement.score_of(segments.iter().copied()))
    }

    /// 95 % percentile interval of any score of a selection of segments; `None` below [`MIN_SEGMENTS`] groups.
    #[must_use]
    pub fn interval_of(
        self,
        clusters: &Clusters,
        score: impl Fn(&[usize]) -> f64 + Sync,
    ) -> Option<Interval> {
        self.scores(clusters, score).map(percentiles)
    }

    /// Compares two systems on the same segments.
    ///
    /// # Errors
    /// A [`ComparisonError`] when signatures, numbers of segments or their groups differ.
    pub fn compare(self, ours: &Measurement, other: &Measurement) -> Result<Comparison, ComparisonError> {
        if ours.signature != other.signature {
            let (ours, other) = (ours.signature.to_string(), other.signature.to_string());
            return Err(ComparisonError::OtherSignature { ours, other });
        }
        let num_segments = ours.statistics.len();
        if num_segments != other.statistics.len() {
            return Err(ComparisonError::OtherLength { ours: num_segments, other: other.statistics.len() });
        }
        if ours.clusters != other.clusters {
            return Err(ComparisonError::OtherClusters);
        }
        let (our_score, other_score) = (ours.score(), other.score());
        let difference = our_score - other_score;
        let pairs = self.scores(&ours.clusters, |segments| {
            (ours.score_of(segments.iter().copied()), other.score_of(segments.iter().copied()))
        });
        let differences: Option<Vec<f64>> =
            pairs.as_ref().map(|pairs| pairs.iter().map(|(ours, other)| ours - other).collect());
        let ratios: Option<Vec<f64>> = pairs
            .as_ref()
            .filter(|pairs| pairs.iter().all(|&(_, other)| other > 0.0))
            .map(|pairs| pairs.iter().map(|(ours, other)| 100.0 * ours / other).collect());
        Ok(Comparison {
            difference,
            p_bootstrap: differences.as_ref().map(|all| {
                let mean = all.iter().sum::<f64>() / all.len() as f64;
                share(
                    all.iter().filter(|&&one| at_least((one - mean).abs(), difference.abs())).count(),
                    all.len(),
                )
            }),
            difference_interval: differences.map(percentiles),
            relative_percent: relative_performance(our_score, other_score),
            relative_interval: ratios.map(percentiles),
            p_randomization: self.randomization(ours, other, difference.abs()),
        })
    }

    /// One value a draw, in order; `None` below [`MIN_SEGMENTS`] groups.
    fn scores<T: Send>(self, clusters: &Clusters, score: impl Fn(&[usize]) -> T + Sync) -> Option<Vec<T>> {
        (clusters.len() >= MIN_SEGMENTS && self.num_resamples > 0).then(|| {
            (0..self.num_resamples).into_par_iter().map(|draw| score(&self.draw(draw, clusters))).collect()
        })
    }

    fn randomization(self, ours: &Measurement, other: &Measurement, found: f64) -> f64 {
        let num_segments = ours.statistics.len();
        let num_as_large = (0..self.num_resamples)
            .into_par_iter()
            .filter(|&draw| {
                let mut random = self.stream(draw);
                let mut exchanged = vec![false; num_segments];
                for group in 0..ours.clusters.len() {
                    let is_exchanged = random.below(2) == 1;
                    for &segment in ours.clusters.members(group) {
                        exchanged[segment] = is_exchanged;
                    }
                }
                let chosen = |first: &Measurement, second: &Measurement| {
                    let kept = (0..num_segments).filter(|&segment| !exchanged[segment]);
                    let taken = (0..num_segments).filter(|&segment| exchanged[segment]);
                    let total: Vec<f64> = first
                        .statistics
                        .sum(kept)
                        .iter()
                        .zip(second.statistics.sum(taken))
                        .map(|(kept, taken)| kept + taken)
                        .collect();
                    first.combine.score(&total, num_segments)
                };
                at_least((chosen(ours, other) - chosen(other, ours)).abs(), found)
            })
            .count();
        share(num_as_large, self.num_resamples)
    }
}

/// A score in percent of the reference model's own (Tables 5 and 7 of the paper); `None` when that is not positive.
#[must_use]
pub fn relative_performance(score: f64, reference_score: f64) -> Option<f64> {
    (reference_score > 0.0).then(|| 100.0 * score / reference_score)
}

/// Whether a difference is as large as another, up to the rounding of sums in another order.
fn at_least(difference: f64, other: f64) -> bool {
    difference >= other * (1.0 - 1e-9)
}

/// What was found itself counts as one of the draws, so that no p-value is zero.
fn share(num_as_large: usize, num_draws: usize) -> f64 {
    (num_as_large + 1) as f64 / (num_draws + 1) as f64
}

fn percentiles(mut values: Vec<f64>) -> Interval {
    values.sort_by(f64::total_cmp);
    Interval { low: quantile(&values, 0.025), high: quantile(&values, 0.975) }
}

#[cfg(test)]
mod tests {
    use super::super::signature::Signature;
    use super::*;

    fn values(values: Vec<f64>) -> Measurement {
        Measurement::of_values("k", Signature::new("k"), values)
    }

    /// Values of a fair spread that are not in order.
    fn spread(num: u32, shift: f64) -> Measurement {
        values((0..num).map(|index| f64::from(index * 37 % num) / f64::from(num) + shift).collect())
    }

    #[test]
    fn the_interval_has_the_width_theory_gives() {
        // Uniform on 0..1: standard error sqrt(1 / 12 / 400) = 0.01443.
        let interval = Resampling::default().interval(&spread(400, 0.0)).unwrap();
        let half_width = 0.5 * (interval.high - interval.low);
        assert!((half_width - 1.96 * 0.01443).abs() < 0.003, "{half_width}");
        assert!(interval.low < 0.49875 && interval.high > 0.49875);
    }

    #[test]
    fn the_seed_decides_and_threads_do_not() {
        let measurement = spread(50, 0.0);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let seeded = |seed| Resampling { seed, ..Resampling::default() };
        assert_eq!(alone.install(|| seeded(1).interval(&measurement)), seeded(1).interval(&measurement));
        assert_ne!(seeded(1).interval(&measurement), seeded(2).interval(&measurement));
    }

    #[test]
    fn few_segments_have_no_interval() {
        assert_eq!(Resampling::default().interval(&spread(4, 0.0)), None);
        let same = Resampling::default().compare(&spread(4, 0.0), &spread(4, 0.0)).unwrap();
        assert_eq!((same.difference_interval, same.p_bootstrap), (None, None));
    }

    #[test]
    fn equal_systems_do_not_differ() {
        let same = Resampling::default().compare(&spread(50, 0.1), &spread(50, 0.1)).unwrap();
        assert_eq!((same.difference, same.p_bootstrap, same.p_randomization), (0.0, Some(1.0), 1.0));
        assert_eq!(same.relative_percent, Some(100.0));
        assert_eq!(same.relative_interval, Some(Interval { low: 100.0, high: 100.0 }));
    }

    #[test]
    fn a_constant_gain_is_certain() {
        let gain = Resampling::default().compare(&spread(50, 0.2), &spread(50, 0.1)).unwrap();
        assert!((gain.difference - 0.1).abs() < 1e-12);
        assert!(gain.p_bootstrap.unwrap() < 0.002 && gain.p_randomization < 0.002, "{gain:?}");
    }

    #[test]
    fn a_gain_as_large_as_its_error_is_not() {
        // Signs alternate around a mean that is one standard error of the mean.
        let gains: Vec<f64> = (0..100).map(|index| if index % 2 == 0 { 1.1 } else { -0.9 }).collect();
        let result = Resampling::default().compare(&values(gains), &values(vec![0.0; 100])).unwrap();
        // Two-sided probability of one standard error: 0.317.
        assert!((result.p_bootstrap.unwrap() - 0.317).abs() < 0.06, "{result:?}");
        assert!((result.p_randomization - 0.317).abs() < 0.06, "{result:?}");
    }

    #[test]
    fn captions_of_one_motion_are_drawn_and_exchanged_together() {
        // Each value three times says no more than once.
        let copies = |shift: f64| {
            let once: Vec<f64> = spread(20, shift).segment_scores();
            values(once.iter().flat_map(|&value| [value; 3]).collect())
        };
        let groups = Clusters::of((0..60).map(|segment| segment / 3));
        let resampling = Resampling::default();
        let (once, thrice) = (spread(20, 0.0), copies(0.0));
        let (alone, together) = (
            resampling.interval(&once).unwrap(),
            resampling.interval(&thrice.clone().clustered(&groups)).unwrap(),
        );
        assert!((alone.low - together.low).abs() < 1e-9 && (alone.high - together.high).abs() < 1e-9);
        let apart = resampling.interval(&thrice).unwrap();
        let width = |ends: Interval| ends.high - ends.low;
        assert!(width(apart) < 0.7 * width(together), "{apart:?} {together:?}");
        // Of two systems as well.
        let other =
            |num| values((0..num).map(|index| f64::from(index * 11 % num) / f64::from(num) - 0.13).collect());
        let others: Vec<f64> = other(20).segment_scores().iter().flat_map(|&value| [value; 3]).collect();
        let alone = resampling.compare(&once, &other(20)).unwrap();
        let ours = thrice.clone().clustered(&groups);
        let together = resampling.compare(&ours, &values(others).clustered(&groups)).unwrap();
        assert_eq!(alone.p_randomization, together.p_randomization);
        assert!((alone.p_bootstrap.unwrap() - together.p_bootstrap.unwrap()).abs() < 1e-9);
        assert_eq!(resampling.compare(&ours, &thrice), Err(ComparisonError::OtherClusters));
    }

    #[test]
    fn relative_performance_is_the_papers() {
        // Tables 2, 4 and 5: BLEU .259 of a reference of .2685 (printed .269) is 96.4 %.
        let percent = relative_performance(0.259, 0.2685).unwrap();
        assert!((percent - 96.4).abs() < 0.1, "{percent}");
        assert_eq!(relative_performance(0.2, 0.0), None);
    }

    #[test]
    fn different_scores_are_not_compared() {
        let other = Measurement::of_values("k", Signature::new("k").with("v", 2), vec![1.0; 50]);
        assert!(matches!(
            Resampling::default().compare(&spread(50, 0.0), &other),
            Err(ComparisonError::OtherSignature { .. })
        ));
        assert!(matches!(
            Resampling::default().compare(&spread(50, 0.0), &spread(49, 0.0)),
            Err(ComparisonError::OtherLength { .. })
        ));
    }
}
