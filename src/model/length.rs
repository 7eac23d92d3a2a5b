//! How long a motion will be.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::Draws;
use super::layer::Linear;

/// Frames of a motion that the head calls 0.
const TYPICAL_FRAMES: f64 = 64.0;

/// Reads the length of a motion off the latent.
///
/// `Deviation:` the paper generates as many frames as the reference has. The head looks on: nothing it learns changes the
/// rest of the model.
#[derive(Module, Debug)]
pub struct LengthHead {
    linear: Linear,
}

impl LengthHead {
    pub(super) fn new(latent: usize, draws: &mut Draws, device: &Device) -> Self {
        Self { linear: Linear::new(latent, 1, draws, device) }
    }

    /// Mean squared error of the logarithm of the length in frames; no slope with regard to the latent `[batch, latent]`.
    pub(super) fn loss(&self, latent: Tensor<2>, num_frames: &[usize]) -> Tensor<1> {
        let logarithms: Vec<f32> =
            num_frames.iter().map(|&frames| (frames as f64 / TYPICAL_FRAMES).ln() as f32).collect();
        let target = TensorData::new(logarithms, [num_frames.len(), 1]);
        let target = Tensor::from_data(target, &latent.device());
        (self.linear.forward(latent.detach()) - target).square().mean()
    }

    /// Lengths in frames, not rounded.
    pub(super) fn predict(&self, latent: Tensor<2>) -> Vec<f64> {
        let logarithms = self.linear.forward(latent).into_data();
        logarithms.iter::<f64>().map(|logarithm| logarithm.exp() * TYPICAL_FRAMES).collect()
    }
}
