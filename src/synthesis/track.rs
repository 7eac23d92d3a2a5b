//! One number over time, with continuous acceleration.

/// Value, rate and acceleration of a track at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Key {
    pub time_secs: f64,
    pub value: f64,
    /// Per second.
    pub rate: f64,
    /// Per squared second.
    pub acceleration: f64,
}

/// A curve through keys, joined by fifth-degree polynomials that meet value, rate and acceleration at both ends.
///
/// Between two keys at rest such a polynomial is the minimum-jerk movement (Flash and Hogan 1985, J. Neurosci. 5:1688).
/// Before the first and after the last key the track keeps its value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Track {
    first: Key,
    rest: Vec<Key>,
}

impl Track {
    /// At rest at this value.
    pub fn at_rest(value: f64) -> Self {
        Self { first: Key { time_secs: 0.0, value, rate: 0.0, acceleration: 0.0 }, rest: Vec::new() }
    }

    /// Starts from this key.
    pub fn from_key(first: Key) -> Self {
        Self { first, rest: Vec::new() }
    }

    /// Appends a key; keys must come in order of time.
    pub fn push(&mut self, key: Key) {
        debug_assert!(key.time_secs > self.last().time_secs, "keys in order of time: {key:?}");
        self.rest.push(key);
    }

    /// Keeps the last value until `start_secs`, then moves to `value`, at rest again at `end_secs`.
    pub fn move_to(&mut self, start_secs: f64, end_secs: f64, value: f64) {
        let last = self.last();
        if start_secs > last.time_secs {
            self.push(Key { time_secs: start_secs, ..last });
        }
        self.push(Key { time_secs: end_secs, value, rate: 0.0, acceleration: 0.0 });
    }

    /// A curve through points that does not overshoot them: at rest at both ends and wherever the direction changes.
    ///
    /// The rate at an inner point is the harmonic mean of the slopes on either side (Fritsch and Butland 1984).
    pub fn through(points: &[(f64, f64)]) -> Self {
        let mut track = Self::at_rest(points.first().map_or(0.0, |point| point.1));
        track.first.time_secs = points.first().map_or(0.0, |point| point.0);
        for (index, &(time_secs, value)) in points.iter().enumerate().skip(1) {
            let slope = |from: (f64, f64), to: (f64, f64)| (to.1 - from.1) / (to.0 - from.0);
            let rate = points.get(index + 1).map_or(0.0, |&next| {
                let before = slope(points[index - 1], (time_secs, value));
                let after = slope((time_secs, value), next);
                if before * after > 0.0 { 2.0 * before * after / (before + after) } else { 0.0 }
            });
            track.push(Key { time_secs, value, rate, acceleration: 0.0 });
        }
        track
    }

    /// The last key.
    pub fn last(&self) -> Key {
        self.rest.last().copied().unwrap_or(self.first)
    }

    /// Value at this time.
    pub fn at(&self, time_secs: f64) -> f64 {
        if time_secs <= self.first.time_secs {
            return self.first.value;
        }
        let after = self.rest.partition_point(|key| key.time_secs <= time_secs);
        match self.rest.get(after) {
            None => self.last().value,
            Some(to) => {
                let from = if after == 0 { &self.first } else { &self.rest[after - 1] };
                quintic(from, to, time_secs)
            }
        }
    }
}

fn quintic(from: &Key, to: &Key, time_secs: f64) -> f64 {
    let h = to.time_secs - from.time_secs;
    let s = (time_secs - from.time_secs) / h;
    let (a0, a1, a2) = (from.value, from.rate * h, 0.5 * from.acceleration * h * h);
    let value = to.value - (a0 + a1 + a2);
    let rate = to.rate * h - (a1 + 2.0 * a2);
    let acceleration = to.acceleration * h * h - 2.0 * a2;
    let a3 = 10.0 * value - 4.0 * rate + 0.5 * acceleration;
    let a4 = -15.0 * value + 7.0 * rate - acceleration;
    let a5 = 6.0 * value - 3.0 * rate + 0.5 * acceleration;
    a0 + s * (a1 + s * (a2 + s * (a3 + s * (a4 + s * a5))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ballistic_arc_is_reproduced_exactly() {
        // Height 1 m, up at 2 m/s, 0.3 s of flight under 9.81 m/s^2.
        let height = |t: f64| 1.0 + 2.0 * t - 0.5 * 9.81 * t * t;
        let key = |t: f64| Key { time_secs: t, value: height(t), rate: 2.0 - 9.81 * t, acceleration: -9.81 };
        let mut track = Track::from_key(key(0.0));
        track.push(key(0.3));
        for t in [0.05, 0.11, 0.2, 0.29] {
            assert!((track.at(t) - height(t)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_move_rests_at_both_ends_and_keeps_its_value_outside() {
        let mut track = Track::at_rest(1.0);
        track.move_to(1.0, 2.0, 3.0);
        assert_eq!((track.at(0.5), track.at(1.5), track.at(9.0)), (1.0, 2.0, 3.0));
        // Minimum jerk: peak rate is 15/8 of the mean rate.
        let rate = (track.at(1.5005) - track.at(1.4995)) / 0.001;
        assert!((rate - 2.0 * 15.0 / 8.0).abs() < 1e-5, "{rate}");
        assert!((track.at(1.001) - 1.0).abs() < 1e-7);
    }

    #[test]
    fn a_curve_through_points_stays_between_them() {
        let points = [(0.0, 0.0), (0.2, 0.0), (0.5, 0.1), (0.6, 0.2), (1.0, 0.1)];
        let track = Track::through(&points);
        for pair in points.windows(2) {
            let (low, high) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
            for step in 0..=20 {
                let t = pair[0].0 + (pair[1].0 - pair[0].0) * f64::from(step) / 20.0;
                assert!((low - 2e-3..=high + 2e-3).contains(&track.at(t)), "{t}: {}", track.at(t));
            }
        }
    }
}
