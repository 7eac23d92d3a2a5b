//! Zero-lag low-pass filter.

/// Filters samples with a second-order Butterworth low-pass, once forward and once backward.
///
/// The two passes cancel each other's lag; together they have order four and are 3 dB down below `cutoff_hz`, so the
/// cutoff of each pass is raised by the usual factor `(2^(1/2) - 1)^(-1/4)` to put the joint 3 dB point at `cutoff_hz`.
/// The ends are extended by point reflection, which keeps the value and slope there.
/// A cutoff at or above half the rate leaves the samples as they are.
///
/// Reference: Winter, Biomechanics and Motor Control of Human Movement, section 3.4.4.
pub fn low_pass(samples: &mut [f64], rate_hz: f64, cutoff_hz: f64) {
    let two_passes = (2.0_f64.sqrt() - 1.0).powf(-0.25);
    let corner_hz = cutoff_hz * two_passes;
    if samples.len() < 2 || corner_hz >= rate_hz / 2.0 {
        return;
    }
    // Three time constants of the slowest part of the response on either side.
    let pad = ((rate_hz / cutoff_hz) as usize).clamp(1, samples.len() - 1);
    let (first, last) = (samples[0], samples[samples.len() - 1]);
    let mut extended: Vec<f64> = (1..=pad).rev().map(|index| 2.0 * first - samples[index]).collect();
    extended.extend_from_slice(samples);
    extended.extend((1..=pad).map(|index| 2.0 * last - samples[samples.len() - 1 - index]));

    let filter = Biquad::low_pass(rate_hz, corner_hz);
    filter.run(extended.iter_mut());
    filter.run(extended.iter_mut().rev());
    samples.copy_from_slice(&extended[pad..pad + samples.len()]);
}

/// Second-order section, direct form I.
struct Biquad {
    input: [f64; 3],
    feedback: [f64; 2],
}

impl Biquad {
    /// Butterworth low-pass by the bilinear transform with prewarping.
    fn low_pass(rate_hz: f64, corner_hz: f64) -> Self {
        let k = (std::f64::consts::PI * corner_hz / rate_hz).tan();
        let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        let gain = k * k * norm;
        Self {
            input: [gain, 2.0 * gain, gain],
            feedback: [2.0 * (k * k - 1.0) * norm, (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm],
        }
    }

    /// Filters in place, starting in the steady state of the first sample.
    fn run<'a>(&self, samples: impl Iterator<Item = &'a mut f64>) {
        let mut past: Option<([f64; 2], [f64; 2])> = None;
        for sample in samples {
            let x = *sample;
            let (inputs, outputs) = past.unwrap_or(([x; 2], [x; 2]));
            let y = self.input[0] * x + self.input[1] * inputs[0] + self.input[2] * inputs[1]
                - self.feedback[0] * outputs[0]
                - self.feedback[1] * outputs[1];
            past = Some(([x, inputs[0]], [y, outputs[0]]));
            *sample = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(frequency_hz: f64) -> Vec<f64> {
        (0..1000)
            .map(|index| (std::f64::consts::TAU * frequency_hz * f64::from(index) / 100.0).sin())
            .collect()
    }

    fn gain(frequency_hz: f64) -> f64 {
        let mut filtered = sine(frequency_hz);
        low_pass(&mut filtered, 100.0, 6.0);
        let power = |values: &[f64]| values[200..800].iter().map(|v| v * v).sum::<f64>();
        (power(&filtered) / power(&sine(frequency_hz))).sqrt()
    }

    #[test]
    fn passes_slow_halves_power_at_the_cutoff_and_stops_fast() {
        assert!((gain(1.0) - 1.0).abs() < 2e-3, "{}", gain(1.0));
        // The bilinear transform keeps the corner of each pass, not the 3 dB point of both, hence the hundredth.
        assert!((gain(6.0) - 0.5_f64.sqrt()).abs() < 1e-2, "{}", gain(6.0));
        // Order four, 24 dB an octave: two octaves up a 256th, and a little for the bilinear transform.
        assert!(gain(24.0) < 0.005, "{}", gain(24.0));
    }

    #[test]
    fn leaves_a_line_a_line_and_adds_no_lag() {
        let mut line: Vec<f64> = (0..50).map(|index| 0.3 + 0.02 * f64::from(index)).collect();
        let expected = line.clone();
        low_pass(&mut line, 100.0, 6.0);
        assert!(line.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-3), "{line:?}");
        let mut slow = sine(2.0);
        low_pass(&mut slow, 100.0, 6.0);
        let (index, _) = slow[400..450].iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
        let (expected, _) = sine(2.0)[400..450]
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map(|(i, v)| (i, *v))
            .unwrap();
        assert!(index.abs_diff(expected) <= 1);
    }
}
