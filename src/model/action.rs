//! The recurrent autoencoder of actions.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::batch::MotionBatch;
use super::feed::Feed;
use super::layer::{Linear, Lstm};
use super::ops::{Activation, Direction, LstmWeights, lstm_closed_loop, lstm_last_state, lstm_open_loop};
use super::rae::Bottleneck;
use super::{Draws, ModelSettings};
use crate::motion::NUM_CHANNELS;

/// Input 50, LSTM, latent, stacked LSTM, output 50 with tanh (Table 1).
#[derive(Module, Debug)]
pub struct ActionRae {
    encoder: Lstm,
    bottleneck: Bottleneck,
    decoder: Vec<Lstm>,
    output: Linear,
}

impl ActionRae {
    pub(super) fn new(settings: &ModelSettings, draws: &mut Draws, device: &Device) -> Self {
        let units = settings.action_units;
        let layers = settings.action_decoder_layers;
        let lstm =
            |feature, draws: &mut Draws| Lstm::new(feature, units, settings.forget_bias, draws, device);
        Self {
            encoder: lstm(NUM_CHANNELS, draws),
            decoder: (0..layers)
                .map(|layer| lstm(if layer == 0 { NUM_CHANNELS } else { units }, draws))
                .collect(),
            bottleneck: Bottleneck::new(units, 1, settings.latent, layers, draws, device),
            output: Linear::new(units, NUM_CHANNELS, draws, device),
        }
    }

    /// Latents of motions, `[batch, latent]`.
    #[must_use]
    pub fn encode(&self, batch: &MotionBatch) -> Tensor<2> {
        let state = lstm_last_state(
            batch.frames.clone(),
            &batch.lengths,
            None,
            &self.encoder.weights(),
            Direction::Forward,
        );
        self.bottleneck.latent(vec![state])
    }

    /// Frames that follow the first ones, `[frame, channel]`, one motion after the other.
    ///
    /// `first` is `[batch, channel]`, and `num_steps` says how many frames each motion has after it.
    #[must_use]
    pub fn generate(&self, latent: Tensor<2>, first: Tensor<2>, num_steps: &[usize]) -> Tensor<2> {
        let (states, layers) = (self.bottleneck.states(latent), self.weights());
        lstm_closed_loop(first, num_steps, states, &layers, self.output.weights())
    }

    /// What the decoder makes of [`MotionBatch::targets`] while it learns, `[frame, channel]`.
    pub(super) fn reconstruct(&self, batch: &MotionBatch, latent: Tensor<2>, feed: &mut Feed) -> Tensor<2> {
        let num_steps = batch.num_steps();
        let width = batch.frames.dims()[1] - 1;
        match feed {
            Feed::ClosedLoop => {
                let first = batch.frames.clone().narrow(1, 0, 1).squeeze_dim(1);
                self.generate(latent, first, &num_steps)
            }
            Feed::TeacherForcing => self.follow(latent, batch.frames.clone().narrow(1, 0, width), &num_steps),
            Feed::Mixed { share, draws } => {
                let known = batch.frames.clone().without_autodiff().narrow(1, 0, width);
                let predicted =
                    self.valid().follow(latent.clone().without_autodiff(), known.clone(), &num_steps);
                let inputs = mixed(&known, predicted, &num_steps, *share, draws);
                let inputs = Tensor::from_data(inputs, &batch.frames.device());
                self.follow(latent, inputs, &num_steps)
            }
        }
    }

    /// One pass over known inputs, `[batch, time, channel]` to `[step, channel]`.
    fn follow(&self, latent: Tensor<2>, inputs: Tensor<3>, num_steps: &[usize]) -> Tensor<2> {
        let (states, layers) = (self.bottleneck.states(latent), self.weights());
        let projection = self.output.weights();
        lstm_open_loop(inputs, num_steps, states, &layers, projection, Activation::Tanh)
    }

    /// Weights of the decoder's layers, from the bottom up.
    fn weights(&self) -> Vec<LstmWeights> {
        self.decoder.iter().map(Lstm::weights).collect()
    }
}

/// Known inputs with some frames replaced by what was predicted from the frame before.
fn mixed(
    known: &Tensor<3>,
    predicted: Tensor<2>,
    num_steps: &[usize],
    share: f64,
    draws: &mut Draws,
) -> TensorData {
    let [_, width, channels] = known.dims();
    let mut values: Vec<f32> = known.clone().into_data().iter().collect();
    let predicted: Vec<f32> = predicted.into_data().iter().collect();
    let mut from = predicted.chunks_exact(channels);
    for (row, &steps) in num_steps.iter().enumerate() {
        // What step t predicts is the input of step t + 1; the last prediction is nobody's input.
        for step in 1..=steps {
            let Some(frame) = from.next() else { break };
            if step < steps && draws.unit() < share {
                let start = (row * width + step) * channels;
                values[start..start + channels].copy_from_slice(frame);
            }
        }
    }
    TensorData::new(values, known.dims())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_replaces_the_input_of_the_step_after_it() {
        let device = Device::flex();
        let known = Tensor::<3>::from_data([[[1.0], [2.0], [3.0]], [[4.0], [5.0], [6.0]]], &device);
        let predicted = Tensor::<2>::from_data([[20.0], [30.0], [40.0], [50.0], [60.0]], &device);
        let all = mixed(&known, predicted.clone(), &[3, 2], 1.0, &mut Draws::new(0, "mix", 0));
        assert_eq!(all.iter::<f32>().collect::<Vec<_>>(), [1.0, 20.0, 30.0, 4.0, 50.0, 6.0]);
        let none = mixed(&known, predicted, &[3, 2], 0.0, &mut Draws::new(0, "mix", 0));
        assert_eq!(none.iter::<f32>().collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}
