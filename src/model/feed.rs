//! What a decoder hears while it learns.

use burn::tensor::{Tensor, TensorData};

use super::{Decoding, Draws, ModelSettings};

/// Input of a decoder during one iteration.
pub enum Feed {
    /// The output of the step before.
    ClosedLoop,
    /// The true value of the step before.
    TeacherForcing,
    /// One or the other.
    Mixed {
        /// Share of steps that hear the output.
        share: f64,
        /// Where the choices come from.
        draws: Draws,
    },
}

impl Feed {
    fn of(decoding: Decoding, share: f64, draws: Draws) -> Self {
        match decoding {
            Decoding::ClosedLoop => Self::ClosedLoop,
            Decoding::TeacherForcing => Self::TeacherForcing,
            Decoding::ScheduledSampling => Self::Mixed { share, draws },
        }
    }
}

/// What both decoders start from and hear during one iteration.
pub struct Feeds {
    /// Of the decoder of descriptions.
    pub description: Feed,
    /// Of the decoder of actions.
    pub action: Feed,
    noise: Option<Noise>,
}

/// Noise on latents before they are decoded.
struct Noise {
    scale: f64,
    draws: Draws,
}

impl Feeds {
    /// Both decoders hear themselves, and latents are decoded as they are: how a model is used.
    #[must_use]
    pub fn closed_loop() -> Self {
        Self { description: Feed::ClosedLoop, action: Feed::ClosedLoop, noise: None }
    }

    /// Both decoders hear the truth.
    #[must_use]
    pub fn teacher_forcing() -> Self {
        Self { description: Feed::TeacherForcing, action: Feed::TeacherForcing, noise: None }
    }

    /// What the settings ask for at an iteration, which is a fraction of its stage away from the stage's beginning, 0 to 1.
    #[must_use]
    pub fn of(settings: &ModelSettings, seed: u64, iteration: usize, progress: f64) -> Self {
        let share = settings.own_output_share * progress.clamp(0.0, 1.0);
        let draws = |purpose| Draws::new(seed, purpose, iteration as u64);
        let description = settings.description_decoding.unwrap_or(settings.decoding);
        let scale = settings.latent_noise;
        Self {
            description: Feed::of(description, share, draws("description feed")),
            action: Feed::of(settings.decoding, share, draws("action feed")),
            noise: (scale > 0.0).then(|| Noise { scale, draws: draws("latent noise") }),
        }
    }

    /// Latents `[batch, latent]` as they are to be decoded.
    pub(super) fn noisy(&mut self, latent: Tensor<2>) -> Tensor<2> {
        let Some(Noise { scale, draws }) = &mut self.noise else { return latent };
        let [batch, width] = latent.dims();
        if batch < 2 {
            return latent;
        }
        let spread = latent.clone().detach().var(0).sqrt().mul_scalar(*scale);
        let noise = TensorData::new(draws.normal(batch * width), [batch, width]);
        latent.clone() + Tensor::from_data(noise, &latent.device()) * spread
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn noise_is_as_large_as_asked_where_latents_differ() {
        let device = Device::flex();
        let values: Vec<f32> =
            (0..600).map(|place| if place % 3 == 0 { 5.0 } else { place as f32 }).collect();
        let latent = Tensor::<2>::from_data(TensorData::new(values, [200, 3]), &device);
        let settings = ModelSettings { latent_noise: 0.5, ..ModelSettings::default() };
        let noisy = |iteration| Feeds::of(&settings, 1, iteration, 0.5).noisy(latent.clone());
        let noise = noisy(3) - latent.clone();
        let share: Vec<f64> = (noise.clone().var(0).sqrt() / latent.clone().var(0).sqrt().clamp_min(1e-3))
            .into_data()
            .iter()
            .collect();
        assert!(share[0] == 0.0 && share[1..].iter().all(|share| (0.4..0.6).contains(share)), "{share:?}");
        let same = |a: Tensor<2>, b: Tensor<2>| a.into_data() == b.into_data();
        assert!(same(noisy(3), noisy(3)) && !same(noisy(3), noisy(4)));
        assert!(same(Feeds::closed_loop().noisy(latent.clone()), latent));
    }

    #[test]
    fn each_decoder_may_be_fed_in_its_own_way() {
        let settings = ModelSettings {
            decoding: Decoding::ScheduledSampling,
            description_decoding: Some(Decoding::TeacherForcing),
            own_output_share: 0.5,
            ..ModelSettings::default()
        };
        let feeds = Feeds::of(&settings, 1, 1, 0.5);
        assert!(matches!(feeds.description, Feed::TeacherForcing));
        assert!(matches!(feeds.action, Feed::Mixed { share, .. } if share == 0.25));
    }
}
