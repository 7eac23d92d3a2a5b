//! What both recurrent autoencoders share: the way into the latent and out of it.

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::Draws;
use super::layer::Linear;
use super::ops::LstmState;

/// Linear maps between the states of recurrent layers and the latent.
///
/// The final hidden and cell states of every encoder layer and direction are mapped to the latent; the latent is
/// mapped to the first hidden and cell states of every decoder layer. No tanh here (Table 1).
#[derive(Module, Debug)]
pub(super) struct Bottleneck {
    inward: Linear,
    outward: Linear,
    decoder_layers: usize,
}

impl Bottleneck {
    /// For `encoder_states` states of `units` into the latent, and `decoder_layers` layers of `units` out of it.
    pub(super) fn new(
        units: usize,
        encoder_states: usize,
        latent: usize,
        decoder_layers: usize,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        Self {
            inward: Linear::new(2 * units * encoder_states, latent, draws, device),
            outward: Linear::new(latent, 2 * units * decoder_layers, draws, device),
            decoder_layers,
        }
    }

    /// States of `[batch, units]` to the latent `[batch, latent]`.
    pub(super) fn latent(&self, states: Vec<LstmState>) -> Tensor<2> {
        let parts = states.into_iter().flat_map(|state| [state.hidden, state.cell]).collect();
        self.inward.forward(Tensor::cat(parts, 1))
    }

    /// The latent `[batch, latent]` to the first state of every decoder layer.
    pub(super) fn states(&self, latent: Tensor<2>) -> Vec<LstmState> {
        let parts = self.outward.forward(latent).chunk(2 * self.decoder_layers, 1);
        parts
            .chunks_exact(2)
            .map(|pair| LstmState { hidden: pair[0].clone(), cell: pair[1].clone() })
            .collect()
    }
}
