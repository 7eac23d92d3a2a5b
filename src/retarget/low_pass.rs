//! Zero-phase low-pass filter of the source: recordings at high rates carry jitter that no body performs.

use nalgebra::Vector3;

use super::source::SourceFrame;

/// Cut-off, hertz. The filter runs forward and backward: half of the amplitude is left here, 98 % at 6 Hz.
pub(super) const CUTOFF_HZ: f64 = 15.0;

/// Sources below this many cut-offs a second are left as they are.
const LEAST_RATIO: f64 = 4.0;

/// Frames added on either side, mirrored through the end, so that the filter starts at rest.
const PADDING: usize = 24;

/// Second-order Butterworth coefficients by the bilinear transform: feed-forward and feedback.
fn butterworth(rate_hz: f64) -> ([f64; 3], [f64; 2]) {
    let k = (std::f64::consts::PI * CUTOFF_HZ / rate_hz).tan();
    let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
    let b = k * k * norm;
    ([b, 2.0 * b, b], [2.0 * (k * k - 1.0) * norm, (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm])
}

/// Filters all joint centres and axes; whether it did is returned.
pub(super) fn low_pass(frames: &mut [SourceFrame], rate_hz: f64) -> bool {
    if rate_hz < LEAST_RATIO * CUTOFF_HZ || frames.len() < 3 {
        return false;
    }
    let coefficients = butterworth(rate_hz);
    let mut path = Vec::with_capacity(frames.len() + 2 * PADDING);
    let mut filter = |frames: &mut [SourceFrame], get: &dyn Fn(&mut SourceFrame) -> &mut Vector3<f64>| {
        path.clear();
        path.extend(frames.iter_mut().map(|frame| *get(frame)));
        if path.iter().all(|value| value.x.is_finite()) {
            both_ways(&mut path, coefficients);
            for (frame, value) in frames.iter_mut().zip(&path) {
                *get(frame) = *value;
            }
        }
    };
    for role in 0..frames[0].centres.len() {
        filter(frames, &|frame| &mut frame.centres[role]);
    }
    for segment in 0..frames[0].axes.len() {
        for axis in 0..2 {
            filter(frames, &|frame| &mut frame.axes[segment][axis]);
        }
    }
    for frame in frames {
        // Filtered axes are shorter where they turn; only their direction is used.
        for axis in frame.axes.iter_mut().flatten() {
            *axis = axis.try_normalize(1e-6).unwrap_or(*axis);
        }
    }
    true
}

fn both_ways(path: &mut [Vector3<f64>], coefficients: ([f64; 3], [f64; 2])) {
    let count = path.len();
    let padding = PADDING.min(count - 1);
    let (first, last) = (path[0], path[count - 1]);
    let mut padded: Vec<Vector3<f64>> = (1..=padding).rev().map(|index| first * 2.0 - path[index]).collect();
    padded.extend_from_slice(path);
    padded.extend((1..=padding).map(|index| last * 2.0 - path[count - 1 - index]));
    for _ in 0..2 {
        one_way(&mut padded, coefficients);
        padded.reverse();
    }
    path.copy_from_slice(&padded[padding..padding + count]);
}

fn one_way(path: &mut [Vector3<f64>], ([b0, b1, b2], [a1, a2]): ([f64; 3], [f64; 2])) {
    let start = path[0];
    let (mut x1, mut x2, mut y1, mut y2) = (start, start, start, start);
    for value in path {
        let x0 = *value;
        let y0 = x0 * b0 + x1 * b1 + x2 * b2 - y1 * a1 - y2 * a2;
        (x2, x1, y2, y1) = (x1, x0, y1, y0);
        *value = y0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filtered(signal: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut path: Vec<Vector3<f64>> =
            (0..600).map(|i| Vector3::x() * signal(f64::from(i) / 120.0)).collect();
        both_ways(&mut path, butterworth(120.0));
        path.iter().map(|value| value.x).collect()
    }

    #[test]
    fn keeps_movement_and_removes_jitter_without_delay() {
        let wave = |hz: f64| move |t: f64| (std::f64::consts::TAU * hz * t).sin();
        for (hz, gain) in [(1.0, 1.0), (6.0, 0.976), (15.0, 0.5), (40.0, 0.003)] {
            let out = filtered(wave(hz));
            // Least squares amplitude of the same phase, away from the ends.
            let (mut dot, mut square) = (0.0, 0.0);
            for (index, value) in out.iter().enumerate().take(540).skip(60) {
                let reference = wave(hz)(index as f64 / 120.0);
                dot += value * reference;
                square += reference * reference;
            }
            assert!((dot / square - gain).abs() < 0.02, "{hz} Hz: {}", dot / square);
        }
        assert!(
            filtered(|t| 2.0 - t).iter().enumerate().all(|(i, x)| (x - 2.0 + i as f64 / 120.0).abs() < 1e-6)
        );
    }
}
