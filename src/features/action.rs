//! Channels of a motion as the model sees them.

use serde::{Deserialize, Serialize};

use crate::motion::NUM_CHANNELS;

/// Bound of the normalised range: minimum and maximum of the training split map to `-LIMIT` and `LIMIT` (the paper's 0.9).
pub const LIMIT: f64 = 0.9;

/// Per-channel affine map between SI units and the model's range.
///
/// A channel that is constant in the training split maps to 0, and back to that constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Normalizer {
    /// Smallest value of each of the 50 channels in the training split, radians or metres.
    pub minimum: Vec<f64>,
    /// Largest value of each of the 50 channels in the training split, radians or metres.
    pub maximum: Vec<f64>,
}

impl Normalizer {
    /// One frame from SI units to the model's range.
    #[must_use]
    pub fn normalize(&self, channels: &[f64; NUM_CHANNELS]) -> [f32; NUM_CHANNELS] {
        std::array::from_fn(|channel| {
            let span = self.maximum[channel] - self.minimum[channel];
            if span > 0.0 {
                let middle = f64::midpoint(self.maximum[channel], self.minimum[channel]);
                (2.0 * LIMIT * (channels[channel] - middle) / span) as f32
            } else {
                0.0
            }
        })
    }

    /// One frame from the model's range back to SI units.
    #[must_use]
    pub fn denormalize(&self, values: &[f32; NUM_CHANNELS]) -> [f64; NUM_CHANNELS] {
        std::array::from_fn(|channel| {
            let span = self.maximum[channel] - self.minimum[channel];
            let middle = f64::midpoint(self.maximum[channel], self.minimum[channel]);
            middle + f64::from(values[channel]) * span / (2.0 * LIMIT)
        })
    }
}
