//! Tilt of the pelvis that keeps the angular momentum in flight.
//!
//! Off the ground nothing turns the body: when the legs swing one way, the trunk must turn the other.
//! The feet are planned, so the trunk gives way.

use std::ops::Range;

use super::RATE_HZ;
use super::ground::{GRAVITY_M_S2, LEAST_SUPPORT};
use super::track::{Key, Track};

/// Inertia of trunk, head and arms about the hips in pitch, kg m^2, for the body of the suite.
///
/// It only scales a correction that is repeated; too small a number would overshoot.
const TRUNK_INERTIA_KGM2: f64 = 8.0;
/// Time to enter the first and to leave the last correction, seconds.
const BLEND_SECS: f64 = 0.3;

/// Runs of frames in which the ground bears too little to turn the body.
pub(super) fn unsupported(specific_force_m_s2: &[f64]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (frame, &force) in specific_force_m_s2.iter().enumerate() {
        if force >= LEAST_SUPPORT * GRAVITY_M_S2 {
            continue;
        }
        match runs.last_mut() {
            Some(run) if run.end == frame => run.end += 1,
            _ => runs.push(frame..frame + 1),
        }
    }
    // An acceleration needs a frame on either side.
    runs.retain(|run| run.len() >= 3 && run.start > 0 && run.end < specific_force_m_s2.len());
    runs
}

/// Tilt that takes up `momentum_rate_nm`, the rate of the angular momentum in pitch that remains with `tilt_rad`.
///
/// Within each run the tilt has no mean and no trend; between them it moves smoothly.
pub(super) fn tilt(runs: &[Range<usize>], momentum_rate_nm: &[f64], tilt_rad: &[f64]) -> Vec<f64> {
    let mut corrected = vec![0.0; tilt_rad.len()];
    let mut between = Track::at_rest(0.0);
    for run in runs {
        let mut values = integrate(run, momentum_rate_nm, tilt_rad);
        remove_trend(&mut values);
        let n = values.len();
        let ends = [(run.start, &values[..3]), (run.end - 1, &values[n - 3..])];
        for (frame, [a, b, c]) in ends.map(|(frame, v)| (frame, [v[0], v[1], v[2]])) {
            let ahead = if frame == run.start { -1.0 } else { 1.0 };
            let acceleration = (a - 2.0 * b + c) * RATE_HZ * RATE_HZ;
            let key = Key {
                time_secs: frame as f64 / RATE_HZ,
                value: if ahead < 0.0 { a } else { c },
                rate: (c - a) * RATE_HZ / 2.0 + ahead * acceleration / RATE_HZ,
                acceleration,
            };
            let since_last = key.time_secs - between.last().time_secs;
            if ahead < 0.0 && between.last() == Track::at_rest(0.0).last() && since_last > BLEND_SECS {
                between.move_to(key.time_secs - BLEND_SECS, key.time_secs - BLEND_SECS + 1e-3, 0.0);
            }
            between.push(key);
        }
        corrected[run.clone()].copy_from_slice(&values);
    }
    if !runs.is_empty() {
        let end_secs = between.last().time_secs + BLEND_SECS;
        between.push(Key { time_secs: end_secs, value: 0.0, rate: 0.0, acceleration: 0.0 });
    }
    for (frame, value) in corrected.iter_mut().enumerate() {
        if !runs.iter().any(|run| run.contains(&frame)) {
            *value = between.at(frame as f64 / RATE_HZ);
        }
    }
    corrected
}

/// Tilt within a run, from zero at its first two frames.
fn integrate(run: &Range<usize>, momentum_rate_nm: &[f64], tilt_rad: &[f64]) -> Vec<f64> {
    let mut values = vec![0.0; run.len()];
    for i in 2..run.len() {
        let frame = run.start + i - 1;
        let step = tilt_rad[frame + 1] - 2.0 * tilt_rad[frame] + tilt_rad[frame - 1];
        let change = step - momentum_rate_nm[frame] / (TRUNK_INERTIA_KGM2 * RATE_HZ * RATE_HZ);
        values[i] = 2.0 * values[i - 1] - values[i - 2] + change;
    }
    values
}

/// Subtracts the straight line of least squares.
fn remove_trend(values: &mut [f64]) {
    let n = values.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / n;
    let (mut product, mut square) = (0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        product += (i as f64 - middle) * value;
        square += (i as f64 - middle).powi(2);
    }
    for (i, value) in values.iter_mut().enumerate() {
        *value -= mean + product / square * (i as f64 - middle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flights_are_runs_of_little_force() {
        let mut force = vec![GRAVITY_M_S2; 40];
        force[10..20].fill(0.0);
        force[30] = 0.0;
        assert_eq!(unsupported(&force), vec![10..20], "a single frame is no flight");
    }

    #[test]
    fn the_tilt_turns_against_the_momentum() {
        let (n, run) = (100, 40..60);
        let moment: Vec<f64> = (0..n).map(|i| 80.0 * (f64::from(i) * 0.3).sin()).collect();
        let tilt = tilt(std::slice::from_ref(&run), &moment, &vec![0.0; n as usize]);
        for frame in 41..59 {
            let second = (tilt[frame + 1] - 2.0 * tilt[frame] + tilt[frame - 1]) * RATE_HZ * RATE_HZ;
            assert!((TRUNK_INERTIA_KGM2 * second + moment[frame]).abs() < 1e-9);
        }
        assert!(tilt[run].iter().sum::<f64>().abs() < 1e-12);
        assert_eq!((tilt[5], tilt[95]), (0.0, 0.0));
        // No step at the ends of the run.
        for frame in 5..95 {
            let second = tilt[frame + 1] - 2.0 * tilt[frame] + tilt[frame - 1];
            assert!(second.abs() < 0.01, "{frame}: {second}");
        }
    }
}
