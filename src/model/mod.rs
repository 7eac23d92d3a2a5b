//! The model: two recurrent autoencoders that share a latent, and a layer that retrofits word vectors.
//!
//! In: normalised frames and word numbers, side by side in [`MotionBatch`] and [`CaptionBatch`].
//! Out: latents, reconstructions, the losses of Eqs. 1 to 5, and a [`Bundle`] that holds a trained model with everything
//! it needs. How a model is trained is decided in `training`.
//!
//! ```text
//!  words --> Retrofit --> DescriptionRae.encode --> latent --> DescriptionRae decoder --> words
//!                                                     :  bound by Eq. 3
//!  frames --------------> ActionRae.encode -------> latent --> ActionRae decoder ------> frames
//! ```
//!
//! Reference: Toyoda, Suzuki, Hayashi, Ogata, "Learning Bidirectional Translation between Descriptions and Actions with
//! Small Paired Data", IEEE RA-L 7(4), 2022, Table 1. Tensor axes are written in the order `[batch, time, feature]`.

mod action;
mod batch;
mod bundle;
mod description;
mod device;
mod draws;
mod feed;
mod frames;
mod generate;
mod layer;
mod learned;
mod length;
mod loss;
pub mod ops;
mod parameters;
mod parity;
mod rae;
mod retrofit;
mod settings;
mod starts;
mod tensors;
#[cfg(test)]
pub(crate) mod tests;

pub use action::ActionRae;
pub use batch::{CaptionBatch, Frames, MotionBatch};
pub use bundle::{BUNDLE_FILES, Bundle, BundleConfig, BundleError};
pub use description::DescriptionRae;
pub use device::{Adapter, DeviceChoice, DeviceError, Selected, adapter, cpu, select};
pub use draws::Draws;
pub use feed::{Feed, Feeds};
pub use generate::{MotionLength, Word, Writing};
pub use learned::LearnedFrom;
pub use length::LengthHead;
pub use loss::{Binding, LossSettings, Reduction, action_loss, binding_loss, description_loss};
pub use parameters::{NamedTensor, Part, WeightsError, gradients, load_weights, num_parameters, weights};
pub use parity::{PARITY_TOLERANCE, Parity, parity};
pub use retrofit::Retrofit;
pub use settings::{Decoding, DescriptionFeedback, InvalidSetting, ModelSettings};
pub use tensors::{TensorsError, read_tensors, write_tensors};

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::features::Vocabulary;

/// The retrofitted paired recurrent autoencoder.
#[derive(Module, Debug)]
pub struct Rprae {
    /// Word vectors to word vectors.
    pub retrofit: Retrofit,
    /// Words to latent to words.
    pub description: DescriptionRae,
    /// Frames to latent to frames.
    pub action: ActionRae,
    /// Latent to number of frames.
    pub length: LengthHead,
}

/// Losses of one batch, each `[1]`.
#[derive(Debug, Clone)]
pub struct Losses {
    /// Eq. 2.
    pub description: Tensor<1>,
    /// Eq. 1.
    pub action: Tensor<1>,
    /// Eq. 3; only of pairs.
    pub binding: Option<Tensor<1>>,
    /// Of the length head; not part of any equation.
    pub length: Tensor<1>,
}

/// What translation makes of a batch of pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossed {
    /// Words, written from the motions, that are those of the captions at the same place.
    pub words_right: usize,
    /// Sum over frames and channels of the squared error of the motions made from the captions, normalised units.
    pub squared_error: f64,
}

impl Losses {
    /// Eq. 4 without a binding loss, Eq. 5 with one.
    #[must_use]
    pub fn total(&self) -> Tensor<1> {
        let reconstruction = self.description.clone() + self.action.clone();
        match &self.binding {
            Some(binding) => reconstruction + binding.clone(),
            None => reconstruction,
        }
    }
}

impl Rprae {
    /// An untrained model; equal seeds give equal weights on every device.
    #[must_use]
    pub fn new(settings: &ModelSettings, vocabulary: &Vocabulary, seed: u64, device: &Device) -> Self {
        let draws = &mut Draws::new(seed, "weights", 0);
        Self {
            retrofit: Retrofit::new(settings, vocabulary, draws, device),
            description: DescriptionRae::new(settings, vocabulary, draws, device),
            action: ActionRae::new(settings, draws, device),
            length: LengthHead::new(settings.latent, draws, device),
        }
    }

    /// Losses of captions and motions.
    ///
    /// With `pairs`, caption and motion of each place belong together, and it names the motion each is about;
    /// without, the two batches have nothing to do with each other.
    pub fn losses(
        &self,
        captions: &CaptionBatch,
        motions: &MotionBatch,
        pairs: Option<&[usize]>,
        settings: &ModelSettings,
        losses: &LossSettings,
        feeds: &mut Feeds,
    ) -> Losses {
        let table = self.retrofit.table();
        let described = self.description.encode(captions, &table);
        let acted = self.action.encode(motions);
        let logits = self.description.reconstruct(
            captions,
            &table,
            feeds.noisy(described.clone()),
            settings.description_feedback,
            &mut feeds.description,
        );
        let frames = self.action.reconstruct(motions, feeds.noisy(acted.clone()), &mut feeds.action);
        let mut length = self.length.loss(acted.clone(), &motions.lengths);
        if pairs.is_some() {
            length = length + self.length.loss(described.clone(), &motions.lengths);
        }
        Losses {
            description: description_loss(logits, captions.targets.clone(), losses.reduction),
            action: action_loss(frames, motions.targets.clone(), losses.reduction),
            binding: pairs.map(|pairs| binding_loss(acted, described, pairs, losses)),
            length,
        }
    }

    /// Translates a batch of pairs both ways, in closed loop and as long as the references are.
    pub fn crossed(
        &self,
        captions: &CaptionBatch,
        motions: &MotionBatch,
        settings: &ModelSettings,
    ) -> Crossed {
        let table = self.retrofit.table();
        let (described, acted) = (self.description.encode(captions, &table), self.action.encode(motions));
        let feedback = settings.description_feedback;
        let logits = self.description.reconstruct(captions, &table, acted, feedback, &mut Feed::ClosedLoop);
        let right = logits.argmax(1).squeeze_dim::<1>(1).equal(captions.targets.clone()).int().sum();
        let frames = self.action.reconstruct(motions, described, &mut Feed::ClosedLoop);
        let squared_error = (frames - motions.targets.clone()).square().sum();
        Crossed {
            words_right: right.into_scalar::<i64>() as usize,
            squared_error: squared_error.into_scalar(),
        }
    }
}
