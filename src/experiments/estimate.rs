//! Scores over seeds.

use serde::Serialize;

use crate::evaluation::{Measurement, Resampling};
use crate::report::Interval;

/// A score that is the mean over seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// 95 % percentile interval over samples: every draw of samples scores all seeds anew. How far seeds differ is in
    /// [`Estimate::seeds`].
    pub interval: Option<Interval>,
    /// The score of each seed.
    pub seeds: Vec<f64>,
}

/// What two systems differ by, ours minus the other's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The difference of the means over seeds.
    pub value: f64,
    /// Its 95 % interval over draws of samples that both share.
    pub interval: Option<Interval>,
    /// The difference at each seed.
    pub seeds: Vec<f64>,
}

impl Difference {
    /// Whether the interval excludes 0.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.interval.is_some_and(|ends| ends.low > 0.0 || ends.high < 0.0)
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let num = values.len();
    values.sum::<f64>() / num as f64
}

/// The score over seeds of one system, a measurement for each; all have the same samples.
///
/// # Panics
/// If there is no seed.
#[must_use]
pub fn estimate(seeds: &[&Measurement], resampling: Resampling) -> Estimate {
    let scores: Vec<f64> = seeds.iter().map(|seed| seed.score()).collect();
    let interval = resampling.interval_of(seeds[0].statistics.len(), |chosen| {
        mean(seeds.iter().map(|seed| seed.score_of(chosen.iter().copied())))
    });
    Estimate { value: mean(scores.iter().copied()), interval, seeds: scores }
}

/// What two systems differ by; seeds are paired by place.
///
/// # Panics
/// If there is no seed, or a system has other samples.
#[must_use]
pub fn difference(ours: &[&Measurement], others: &[&Measurement], resampling: Resampling) -> Difference {
    let num = ours[0].statistics.len();
    assert!(ours.iter().chain(others).all(|seed| seed.statistics.len() == num), "the same samples");
    let of = |seeds: &[&Measurement], chosen: &[usize]| {
        mean(seeds.iter().map(|seed| seed.score_of(chosen.iter().copied())))
    };
    let all: Vec<usize> = (0..num).collect();
    Difference {
        value: of(ours, &all) - of(others, &all),
        interval: resampling.interval_of(num, |chosen| of(ours, chosen) - of(others, chosen)),
        seeds: ours.iter().zip(others).map(|(ours, other)| ours.score() - other.score()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::Signature;

    fn seed(shift: f64) -> Measurement {
        let values = (0..60).map(|index| f64::from(index * 17 % 60) / 60.0 + shift).collect();
        Measurement::of_values("k", Signature::new("k"), values)
    }

    #[test]
    fn seeds_are_averaged() {
        let (a, b) = (seed(0.0), seed(0.2));
        let found = estimate(&[&a, &b], Resampling::default());
        assert!((found.value - a.score() - 0.1).abs() < 1e-12);
        let alone = estimate(&[&a], Resampling::default()).interval.unwrap();
        let both = found.interval.unwrap();
        // A shift moves the interval and does not widen it.
        assert!((both.high - both.low - (alone.high - alone.low)).abs() < 1e-9);
    }

    #[test]
    fn a_shift_is_significant_and_nothing_is_not() {
        let (a, b) = (seed(0.0), seed(0.01));
        assert!(difference(&[&b], &[&a], Resampling::default()).is_significant());
        assert!(!difference(&[&a], &[&a], Resampling::default()).is_significant());
    }
}
