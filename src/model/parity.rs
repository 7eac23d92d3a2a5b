//! Whether a device computes what the processor computes.

use burn::tensor::Device;

use super::batch::{CaptionBatch, Frames, MotionBatch};
use super::parameters::{NamedTensor, gradients};
use super::{Draws, Feeds, LossSettings, ModelSettings, Rprae};
use crate::features::Vocabulary;
use crate::motion::NUM_CHANNELS;

/// Largest relative difference that counts as equal: single precision leaves some millionths.
pub const PARITY_TOLERANCE: f64 = 1e-4;

/// A number the two devices were compared by.
#[derive(Debug, Clone, PartialEq)]
pub struct Parity {
    /// `loss` or the name of a weight, whose gradient it is.
    pub name: String,
    /// Largest difference, as a share of the largest number.
    pub difference: f64,
}

/// Compares losses and every gradient of a small model, in closed loop and with teacher forcing, between a device and the
/// processor; sorted by the difference, largest first.
#[must_use]
pub fn parity(device: &Device) -> Vec<Parity> {
    let mut found = Vec::new();
    for (mode, mut feed) in
        [("closed loop", Feeds::closed_loop()), ("teacher forcing", Feeds::teacher_forcing())]
    {
        let expected = compute(&Device::flex(), &mut feed);
        let computed = compute(device, &mut feed);
        for ((name, expected), (_, computed)) in expected.iter().zip(&computed) {
            found
                .push(Parity { name: format!("{name}, {mode}"), difference: difference(expected, computed) });
        }
    }
    found.sort_by(|a, b| b.difference.total_cmp(&a.difference));
    found
}

fn difference(expected: &NamedTensor, computed: &NamedTensor) -> f64 {
    let largest = expected.values.iter().fold(0.0_f32, |largest, value| largest.max(value.abs()));
    let pairs = expected.values.iter().zip(&computed.values);
    let difference = pairs.map(|(a, b)| f64::from((a - b).abs()));
    // A number that is none counts as the largest difference.
    let difference = difference.map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max);
    difference / f64::from(largest.max(f32::MIN_POSITIVE))
}

/// Losses and gradients of a small model on a small batch.
fn compute(device: &Device, feed: &mut Feeds) -> Vec<(String, NamedTensor)> {
    let device = device.clone().autodiff();
    let settings = ModelSettings {
        action_units: 12,
        action_decoder_layers: 2,
        description_units: 8,
        latent: 8,
        retrofit_units: 8,
        retrofit_layers: 1,
        ..ModelSettings::default()
    };
    let vocabulary = Vocabulary {
        words: ["<bos>", "<eos>", "a", "b", "c", "d"].map(str::to_owned).to_vec(),
        dimensions: 6,
        vectors: (0..6)
            .map(|word| (word > 1).then(|| Draws::new(1, "vector", word).uniform(6, 0.5)))
            .collect(),
    };
    let model = Rprae::new(&settings, &vocabulary, 1, &device);
    let motion = |num_frames: usize, seed| -> Vec<[f32; NUM_CHANNELS]> {
        let values = Draws::new(seed, "motion", 0).uniform(num_frames * NUM_CHANNELS, 0.9);
        values.as_chunks().0.to_vec()
    };
    let motions = [motion(7, 1), motion(3, 2), motion(5, 3)];
    let motions: Vec<Frames<'_>> = motions.iter().map(Vec::as_slice).collect();
    let motions = MotionBatch::new(&motions, &device);
    let captions = CaptionBatch::new(&[&[0, 2, 3, 1], &[0, 4, 1], &[0, 5, 4, 3, 2, 1]], &device);
    let losses =
        model.losses(&captions, &motions, Some(&[0, 1, 2]), &settings, &LossSettings::default(), feed);
    let total = losses.total() + losses.length.clone();
    let value = NamedTensor { shape: vec![1], values: vec![total.clone().into_scalar()] };
    let mut found = vec![("loss".to_owned(), value)];
    found.extend(gradients(&model, &total.backward()));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_agrees_with_itself_and_a_difference_is_seen() {
        let found = parity(&Device::flex());
        assert!(found.len() > 40, "{}", found.len());
        assert!(found.iter().all(|parity| parity.difference == 0.0));
        let tensor = |values: &[f32]| NamedTensor { shape: vec![values.len()], values: values.to_vec() };
        assert_eq!(difference(&tensor(&[1.0, -4.0]), &tensor(&[1.0, -3.0])), 0.25);
        assert_eq!(difference(&tensor(&[1.0]), &tensor(&[f32::NAN])), f64::INFINITY);
    }
}
