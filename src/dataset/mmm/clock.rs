//! From time stamps to a sampling rate.

/// Largest accepted distance of a time stamp from the even grid, as a share of the frame interval.
///
/// A lost or repeated frame moves some stamp by at least half an interval.
const JITTER: f64 = 0.2;

/// Files print six significant digits, so a stamp is off by up to half a unit in the sixth: this share of its size.
const ROUNDING: f64 = 5e-6;

/// Why time stamps give no rate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ClockError {
    /// One frame has no rate.
    #[error("the motion has a single frame, so it has no rate")]
    SingleFrame,
    /// A stamp is not a finite number.
    #[error("frame {frame}: the time stamp is {found}, expected seconds")]
    NotFinite {
        /// Index of the frame.
        frame: usize,
        /// Stamp found.
        found: f64,
    },
    /// A stamp is not later than the one before.
    #[error("frame {frame}: the time stamp {found} s does not come after {before} s")]
    NotIncreasing {
        /// Index of the frame.
        frame: usize,
        /// Stamp of this frame, seconds.
        found: f64,
        /// Stamp of the frame before, seconds.
        before: f64,
    },
    /// The stamps are not evenly spaced.
    #[error(
        "frame {frame}: the time stamp {found} s is {off:.1} frames from where even spacing at {rate_hz:.6} Hz puts it; \
         resample the motion to a constant rate"
    )]
    Uneven {
        /// Index of the frame that is farthest off.
        frame: usize,
        /// Its stamp, seconds.
        found: f64,
        /// Distance from the even grid in frames.
        off: f64,
        /// Rate of the even grid, hertz.
        rate_hz: f64,
    },
}

/// Frames per second of evenly spaced time stamps in seconds.
///
/// The rate is the mean over the motion, or the whole number next to it where the rounding of the stamps covers the
/// difference: 120 Hz is stored as 0, 0.00833333, 0.0166667, ...
pub(super) fn rate_from_stamps(stamps_secs: &[f64]) -> Result<f64, ClockError> {
    if let Some(frame) = stamps_secs.iter().position(|stamp| !stamp.is_finite()) {
        return Err(ClockError::NotFinite { frame, found: stamps_secs[frame] });
    }
    for (index, pair) in stamps_secs.windows(2).enumerate() {
        if pair[1] <= pair[0] {
            return Err(ClockError::NotIncreasing { frame: index + 1, found: pair[1], before: pair[0] });
        }
    }
    let [first, .., last] = *stamps_secs else { return Err(ClockError::SingleFrame) };

    let span = last - first;
    let intervals = (stamps_secs.len() - 1) as f64;
    let rounding = |stamp: f64| ROUNDING * stamp.abs();
    let mean_rate = intervals / span;
    let covered = mean_rate * (rounding(first) + rounding(last)) / span;
    let whole = mean_rate.round();
    let rate_hz = if whole > 0.0 && (whole - mean_rate).abs() <= covered { whole } else { mean_rate };

    let off = |frame: usize| {
        let grid = first + frame as f64 / rate_hz;
        let allowed_secs = rounding(stamps_secs[frame]) + rounding(first);
        ((stamps_secs[frame] - grid).abs() - allowed_secs).max(0.0) * rate_hz
    };
    let (frame, off) = (0..stamps_secs.len())
        .map(|frame| (frame, off(frame)))
        .fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst });
    if off > JITTER {
        return Err(ClockError::Uneven { frame, found: stamps_secs[frame], off, rate_hz });
    }
    Ok(rate_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a file holds them: six significant digits.
    fn stamps(rate_hz: f64, num_frames: usize, start_secs: f64) -> Vec<f64> {
        (0..num_frames)
            .map(|i| {
                let stamp = start_secs + i as f64 / rate_hz;
                let decimals = 5 - stamp.max(1e-4).log10().floor() as i32;
                let scale = 10_f64.powi(decimals);
                (stamp * scale).round() / scale
            })
            .collect()
    }

    #[test]
    fn finds_the_rates_of_motion_files() {
        for rate_hz in [10.0, 30.0, 60.0, 100.0, 120.0, 1000.0] {
            for (num_frames, start) in [(2, 0.0), (3, 0.0), (378, 0.0), (378, 12.5), (5000, 0.0)] {
                assert_eq!(
                    rate_from_stamps(&stamps(rate_hz, num_frames, start)),
                    Ok(rate_hz),
                    "{rate_hz} Hz, {num_frames} frames from {start} s"
                );
            }
        }
        let film = rate_from_stamps(&stamps(23.976, 500, 0.0)).unwrap();
        assert!((film - 23.976).abs() < 1e-3, "{film}");
    }

    #[test]
    fn refuses_stamps_without_a_rate() {
        assert_eq!(rate_from_stamps(&[0.0]), Err(ClockError::SingleFrame));
        assert_eq!(rate_from_stamps(&[]), Err(ClockError::SingleFrame));
        assert!(matches!(rate_from_stamps(&[0.0, f64::NAN]), Err(ClockError::NotFinite { frame: 1, .. })));
        let mut repeated = stamps(100.0, 50, 0.0);
        repeated[20] = repeated[19];
        assert!(matches!(rate_from_stamps(&repeated), Err(ClockError::NotIncreasing { frame: 20, .. })));
        repeated[20] = 0.0;
        assert!(matches!(rate_from_stamps(&repeated), Err(ClockError::NotIncreasing { frame: 20, .. })));
        assert!(rate_from_stamps(&[0.0, 1e-320]).is_err());
    }

    #[test]
    fn a_single_lost_frame_is_seen_anywhere() {
        for lost in 1..199 {
            let mut stamps = stamps(100.0, 200, 0.0);
            stamps.remove(lost);
            let found = rate_from_stamps(&stamps);
            assert!(matches!(found, Err(ClockError::Uneven { .. })), "{lost}: {found:?}");
        }
    }
}
