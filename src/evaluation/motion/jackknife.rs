//! Scores that belong to a whole set, with how sure they are.

use rayon::prelude::*;
use serde::Serialize;

use crate::evaluation::resampling::MIN_SEGMENTS;
use crate::evaluation::signature::Signature;
use crate::report::Interval;

/// A score that is no mean over samples, such as a distance between distributions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetScore {
    /// Stable key such as `fid`.
    pub key: &'static str,
    /// The score.
    pub value: f64,
    /// 95 % interval of the jackknife, value +- 1.96 standard errors; `None` below five samples.
    ///
    /// The bootstrap would draw some samples twice, which makes a set look narrower than it is.
    pub interval: Option<Interval>,
    /// Everything that changes the number.
    pub signature: Signature,
}

impl SetScore {
    /// A score of `num` samples, or groups of them; `without(i)` is the score of all but one.
    pub(super) fn of(
        key: &'static str,
        signature: Signature,
        value: f64,
        num: usize,
        without: impl Fn(usize) -> f64 + Sync,
    ) -> Self {
        let interval = (num >= MIN_SEGMENTS).then(|| {
            let left_out: Vec<f64> = (0..num).into_par_iter().map(&without).collect();
            let mean = left_out.iter().sum::<f64>() / num as f64;
            let squares: f64 = left_out.iter().map(|one| (one - mean) * (one - mean)).sum();
            let half_width = 1.96 * (squares * (num - 1) as f64 / num as f64).sqrt();
            Interval { low: value - half_width, high: value + half_width }
        });
        Self { key, value, interval, signature }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_mean_it_is_the_standard_error() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 9.0];
        let mean = |skip: usize| {
            let kept = values.iter().enumerate().filter(|(index, _)| *index != skip);
            kept.map(|(_, value)| value).sum::<f64>() / (values.len() - usize::from(skip < 6)) as f64
        };
        let score = SetScore::of("mean", Signature::new("mean"), mean(6), 6, mean);
        // Standard error of the mean: sqrt(sum of squares / (n (n - 1))) = sqrt(40 / 30).
        let interval = score.interval.unwrap();
        assert!((interval.high - 4.0 - 1.96 * (40.0_f64 / 30.0).sqrt()).abs() < 1e-12, "{interval:?}");
        assert_eq!(SetScore::of("mean", Signature::new("mean"), 1.0, 4, |_| 1.0).interval, None);
    }
}
