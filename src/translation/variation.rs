//! Latents near a latent, for several motions of one sentence.

use std::f64::consts::TAU;

use crate::features::{BOS, EOS};
use crate::model::{Bundle, Draws};

/// Width of the noise on the latent, as a share of its spread, that `rprae` takes unless told otherwise.
pub const DEFAULT_NOISE: f64 = 0.5;

/// Most one-word sentences that are looked at.
const MAX_PROBES: usize = 256;

/// Standard deviation of each number of the latent over the one-word sentences of the vocabulary, `[latent]`.
///
/// A bundle holds no training data; its own words, spaced evenly over the vocabulary, say how far each number moves when
/// a sentence changes.
pub(super) fn spread(bundle: &Bundle) -> Vec<f32> {
    let num_words = bundle.vocabulary.words.len();
    let stride = (num_words - 2).div_ceil(MAX_PROBES).max(1);
    let probes: Vec<[u32; 3]> = (2..num_words).step_by(stride).map(|word| [BOS, word as u32, EOS]).collect();
    let probes: Vec<&[u32]> = probes.iter().map(<[u32; 3]>::as_slice).collect();
    let latents = bundle.encode_captions(&probes);
    let [count, width] = latents.dims();
    let values: Vec<f32> = latents.into_data().iter().collect();
    (0..width)
        .map(|place| {
            let column = || values[place..].iter().step_by(width).map(|&value| f64::from(value));
            let mean = column().sum::<f64>() / count as f64;
            let variance = column().map(|value| (value - mean).powi(2)).sum::<f64>() / count as f64;
            variance.sqrt() as f32
        })
        .collect()
}

/// The latent itself for number 0, else with Gaussian noise on every number.
pub(super) fn vary(latent: &[f32], spread: &[f32], number: u64, noise: f64, seed: u64) -> Vec<f32> {
    if number == 0 {
        return latent.to_vec();
    }
    let mut draws = Draws::new(own_seed(seed, latent), "latent", number);
    latent
        .iter()
        .zip(spread)
        .map(|(&value, &width)| value + (noise * f64::from(width) * gaussian(&mut draws)) as f32)
        .collect()
}

/// A seed of its own for each latent, so that what is said over latents is said over independent draws.
pub(super) fn own_seed(seed: u64, latent: &[f32]) -> u64 {
    let place = latent.iter().fold(0xcbf2_9ce4_8422_2325, |hash, value| {
        (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3)
    });
    seed ^ place
}

/// A draw from the standard normal distribution (Box and Muller 1958).
fn gaussian(draws: &mut Draws) -> f64 {
    // In (0, 1], so that the logarithm is finite.
    let radius = (-2.0 * (1.0 - draws.unit()).ln()).sqrt();
    radius * (TAU * draws.unit()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_width_it_says_and_follows_the_seed() {
        let (latent, spread) = (vec![1.0; 20_000], vec![0.5; 20_000]);
        assert_eq!(vary(&latent, &spread, 0, 0.3, 1), latent);
        let first = vary(&latent, &spread, 1, 0.3, 1);
        assert_eq!(first, vary(&latent, &spread, 1, 0.3, 1));
        assert_ne!(first, vary(&latent, &spread, 2, 0.3, 1));
        assert_ne!(first, vary(&latent, &spread, 1, 0.3, 2));
        let others = vary(&vec![2.0; 20_000], &spread, 1, 0.3, 1);
        assert!((others[0] - 2.0 - (first[0] - 1.0)).abs() > 1e-6, "another sentence, another noise");
        let differences: Vec<f64> = first.iter().map(|&value| f64::from(value) - 1.0).collect();
        let mean = differences.iter().sum::<f64>() / 20_000.0;
        let width = (differences.iter().map(|d| d * d).sum::<f64>() / 20_000.0).sqrt();
        // Five standard errors.
        assert!(mean.abs() < 5.0 * 0.15 / 20_000_f64.sqrt(), "{mean}");
        assert!((width - 0.15).abs() < 5.0 * 0.15 / 40_000_f64.sqrt(), "{width}");
    }
}
