//! Between motions in SI units and the frames a trained model reads and makes.

use burn::tensor::Tensor;

use super::Bundle;
use crate::motion::{Body, Frame, Motion, MotionError, NUM_CHANNELS};

impl Bundle {
    /// Latents `[batch, latent]` as plain numbers, row by row.
    #[must_use]
    pub fn numbers(latent: &Tensor<2>) -> Vec<Vec<f32>> {
        let values: Vec<f32> = latent.clone().into_data().iter().collect();
        values.chunks_exact(latent.dims()[1].max(1)).map(<[f32]>::to_vec).collect()
    }

    /// A motion as the encoder reads it: at the bundle's rate, its root placed as in training, and normalised.
    ///
    /// # Errors
    /// [`MotionError`] when the motion cannot be brought to the rate.
    pub fn frames_of(&self, motion: &Motion) -> Result<Vec<[f32; NUM_CHANNELS]>, MotionError> {
        let resampled = motion.resampled(self.config.rate_hz)?;
        let mut frames: Vec<[f64; NUM_CHANNELS]> =
            resampled.frames().iter().map(Frame::to_channels).collect();
        self.config.root.place(&mut frames);
        Ok(frames.iter().map(|frame| self.normalizer.normalize(frame)).collect())
    }

    /// The motion of generated frames, at the bundle's rate; its root is where [`crate::features::Root`] says.
    ///
    /// # Errors
    /// [`MotionError`] when a frame is outside what a motion can hold.
    pub fn motion_of(&self, frames: &[[f32; NUM_CHANNELS]], body: Body) -> Result<Motion, MotionError> {
        let frames = frames.iter().map(|frame| Frame::from_channels(&self.normalizer.denormalize(frame)));
        Motion::new(body, self.config.rate_hz, frames.collect())
    }
}
