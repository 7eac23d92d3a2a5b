//! Scores over seeds.

use serde::Serialize;

use crate::evaluation::{Measurement, Resampling};
use crate::report::Interval;

/// A score that is the mean over seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// 95 % percentile interval over motions, each with all its captions: every draw scores all seeds anew. How far seeds
    /// differ is not in it but in [`Estimate::spread`].
    pub interval: Option<Interval>,
    /// Standard deviation over seeds, n - 1 below; `None` for a single seed.
    pub spread: Option<f64>,
    /// The score of each seed.
    pub seeds: Vec<f64>,
}

/// What two systems differ by, ours minus the other's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The difference of the means over seeds.
    pub value: f64,
    /// Its 95 % interval over draws of motions that both share.
    pub interval: Option<Interval>,
    /// Standard deviation of the difference over seeds, n - 1 below; `None` for a single seed.
    pub spread: Option<f64>,
    /// The difference at each seed.
    pub seeds: Vec<f64>,
}

impl Difference {
    /// Whether the interval over motions excludes 0, and every seed is on the same side of it.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        let side = |above: bool| self.seeds.iter().all(|&seed| if above { seed > 0.0 } else { seed < 0.0 });
        self.interval.is_some_and(|ends| ends.low > 0.0 && side(true) || ends.high < 0.0 && side(false))
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let num = values.len();
    values.sum::<f64>() / num as f64
}

/// Standard deviation of a sample; `None` below two.
pub(super) fn spread(values: &[f64]) -> Option<f64> {
    let mean = mean(values.iter().copied());
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}

/// The score over seeds of one system, a measurement for each; all have the same samples.
///
/// # Panics
/// If there is no seed.
#[must_use]
pub fn estimate(seeds: &[&Measurement], resampling: Resampling) -> Estimate {
    let scores: Vec<f64> = seeds.iter().map(|seed| seed.score()).collect();
    let interval = resampling.interval_of(&seeds[0].clusters, |chosen| {
        mean(seeds.iter().map(|seed| seed.score_of(chosen.iter().copied())))
    });
    Estimate { value: mean(scores.iter().copied()), interval, spread: spread(&scores), seeds: scores }
}

/// What two systems differ by, over the same draws; seeds are paired by place.
///
/// # Panics
/// If there is no seed, or a system has other samples.
#[must_use]
pub fn difference(ours: &[&Measurement], others: &[&Measurement], resampling: Resampling) -> Difference {
    let clusters = &ours[0].clusters;
    assert!(ours.iter().chain(others).all(|seed| seed.clusters == *clusters), "the same samples");
    let of = |seeds: &[&Measurement], chosen: &[usize]| {
        mean(seeds.iter().map(|seed| seed.score_of(chosen.iter().copied())))
    };
    let all: Vec<usize> = (0..clusters.num_segments()).collect();
    let seeds: Vec<f64> = ours.iter().zip(others).map(|(ours, other)| ours.score() - other.score()).collect();
    Difference {
        value: of(ours, &all) - of(others, &all),
        interval: resampling.interval_of(clusters, |chosen| of(ours, chosen) - of(others, chosen)),
        spread: spread(&seeds),
        seeds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::{Clusters, Signature};

    fn seed(shift: f64) -> Measurement {
        let values = (0..60).map(|index| f64::from(index * 17 % 60) / 60.0 + shift).collect();
        Measurement::of_values("k", Signature::new("k"), values)
    }

    #[test]
    fn seeds_are_averaged_and_their_spread_stands_apart() {
        let (a, b) = (seed(0.0), seed(0.2));
        let found = estimate(&[&a, &b], Resampling::default());
        assert!((found.value - a.score() - 0.1).abs() < 1e-12);
        let alone = estimate(&[&a], Resampling::default());
        let (both, one) = (found.interval.unwrap(), alone.interval.unwrap());
        // A shift moves the interval and does not widen it; the spread tells it.
        assert!((both.high - both.low - (one.high - one.low)).abs() < 1e-9);
        // Two seeds 0.2 apart: sqrt(2) times a tenth.
        assert!((found.spread.unwrap() - 0.1 * 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(alone.spread, None);
    }

    #[test]
    fn a_shift_is_significant_and_nothing_is_not() {
        let (a, b) = (seed(0.0), seed(0.01));
        assert!(difference(&[&b], &[&a], Resampling::default()).is_significant());
        assert!(!difference(&[&a], &[&a], Resampling::default()).is_significant());
    }

    #[test]
    fn seeds_that_disagree_are_not_significant() {
        let (a, above, below) = (seed(0.0), seed(0.04), seed(-0.01));
        let found = difference(&[&above, &below], &[&a, &a], Resampling::default());
        // Over motions both shifts are certain, so the interval is that of 0.015.
        assert!(found.interval.unwrap().low > 0.0 && !found.is_significant(), "{found:?}");
        assert!((found.spread.unwrap() - 0.05 / 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn captions_of_a_motion_count_together() {
        let groups = Clusters::of((0..60).map(|segment| segment / 6));
        let sorted = Measurement::of_values("k", Signature::new("k"), (0..60).map(f64::from).collect());
        let alone = estimate(&[&sorted], Resampling::default()).interval.unwrap();
        let together =
            estimate(&[&sorted.clone().clustered(&groups)], Resampling::default()).interval.unwrap();
        let width = |ends: Interval| ends.high - ends.low;
        // Neighbours are alike, so ten groups say less than sixty numbers.
        assert!(width(together) > 2.0 * width(alone), "{together:?} {alone:?}");
    }
}
