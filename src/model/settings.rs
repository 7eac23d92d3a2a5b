//! Sizes of the model and the choices the paper leaves open.

use serde::{Deserialize, Serialize};

/// What a decoder is fed while it learns. When it generates, it always hears itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decoding {
    /// Its own output of the step before; the first frame, or the beginning of the sentence, is given.
    ClosedLoop,
    /// The true value of the step before.
    TeacherForcing,
    /// The true value or its own, drawn anew for every step; see [`ModelSettings::own_output_share`].
    ///
    /// `Deviation:` in two passes, as in parallel scheduled sampling (Duckworth et al. 2019): what a
    /// teacher-forced pass predicts is mixed into the input of the pass that is learned from.
    ScheduledSampling,
}

/// What the description decoder hears of its own output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DescriptionFeedback {
    /// The retrofitted vector of the most probable word.
    ArgMax,
    /// The mean of the retrofitted vectors of all words, weighted by their probability; slower.
    Expectation,
}

/// Sizes of the model and how its decoders are run.
///
/// The defaults are those of the paper (Table 1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelSettings {
    /// Units of the action encoder and of each layer of the action decoder.
    pub action_units: usize,
    /// Layers of the action decoder.
    pub action_decoder_layers: usize,
    /// Units of the description encoder, in each direction, and of the description decoder.
    pub description_units: usize,
    /// Numbers of the representation both autoencoders share.
    pub latent: usize,
    /// Units of each hidden layer of the retrofit layer.
    pub retrofit_units: usize,
    /// Hidden layers of the retrofit layer.
    pub retrofit_layers: usize,
    /// What the decoders are fed while they learn.
    pub decoding: Decoding,
    /// What the description decoder is fed instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description_decoding: Option<Decoding>,
    /// Standard deviation of Gaussian noise on latents before they are decoded in training, as a share of their spread in
    /// the batch. Larger values make neighbouring latents mean the same, which is where the other modality's latents come
    /// to lie; 0 is the paper's.
    pub latent_noise: f64,
    /// Share of steps at which a decoder hears itself, with scheduled sampling; reached linearly over each stage.
    pub own_output_share: f64,
    /// What the description decoder hears of its own output.
    pub description_feedback: DescriptionFeedback,
    /// What the bias of every forget gate starts from; larger values remember for longer from the beginning.
    pub forget_bias: f32,
}

impl Default for ModelSettings {
    fn default() -> Self {
        Self {
            action_units: 500,
            action_decoder_layers: 3,
            description_units: 500,
            latent: 500,
            retrofit_units: 400,
            retrofit_layers: 3,
            decoding: Decoding::ClosedLoop,
            description_decoding: None,
            latent_noise: 0.0,
            own_output_share: 0.5,
            description_feedback: DescriptionFeedback::ArgMax,
            forget_bias: 1.0,
        }
    }
}

impl ModelSettings {
    /// The paper's shape at a size a CPU trains in hours: about a fortieth of the arithmetic.
    #[must_use]
    pub fn compact() -> Self {
        Self {
            action_units: 96,
            action_decoder_layers: 2,
            description_units: 128,
            latent: 96,
            retrofit_units: 128,
            retrofit_layers: 2,
            ..Self::default()
        }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// [`InvalidSetting`] names the first one outside its range.
    pub fn check(&self) -> Result<(), InvalidSetting> {
        let sizes = [
            ("model.action_units", self.action_units, 4096),
            ("model.action_decoder_layers", self.action_decoder_layers, 3),
            ("model.description_units", self.description_units, 4096),
            ("model.latent", self.latent, 4096),
            ("model.retrofit_units", self.retrofit_units, 4096),
            ("model.retrofit_layers", self.retrofit_layers, 16),
        ];
        for (name, found, largest) in sizes {
            InvalidSetting::unless((1..=largest).contains(&found), name, found, || {
                format!("1 to {largest}")
            })?;
        }
        let share = self.own_output_share;
        InvalidSetting::unless((0.0..=1.0).contains(&share), "model.own_output_share", share, || {
            "0 to 1".to_owned()
        })?;
        let noise = self.latent_noise;
        InvalidSetting::unless((0.0..=10.0).contains(&noise), "model.latent_noise", noise, || {
            "0 to 10".to_owned()
        })?;
        let bias = self.forget_bias;
        InvalidSetting::unless(bias.abs() <= 10.0, "model.forget_bias", bias, || "-10 to 10".to_owned())
    }
}

/// A setting outside its range.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("use the setting {name}: it is {found}, expected {expected}")]
pub struct InvalidSetting {
    /// Name of the setting, as in the settings file.
    pub name: &'static str,
    /// Value found.
    pub found: String,
    /// What is accepted.
    pub expected: String,
}

impl InvalidSetting {
    /// Nothing when `holds`; otherwise the error.
    ///
    /// # Errors
    /// The error, when the value does not hold.
    #[expect(clippy::needless_pass_by_value, reason = "a number or a text, given as it is")]
    pub fn unless(
        holds: bool,
        name: &'static str,
        found: impl ToString,
        expected: impl FnOnce() -> String,
    ) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self { name, found: found.to_string(), expected: expected() }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_keys_are_refused_and_missing_ones_keep_their_default() {
        let settings: ModelSettings = toml::from_str("latent = 7\ndecoding = \"teacher-forcing\"").unwrap();
        assert_eq!((settings.latent, settings.decoding), (7, Decoding::TeacherForcing));
        assert_eq!(settings.action_units, 500);
        let error = toml::from_str::<ModelSettings>("latend = 7").unwrap_err();
        assert!(error.to_string().contains("latend"), "{error}");
    }

    #[test]
    fn sizes_have_bounds() {
        ModelSettings::default().check().unwrap();
        ModelSettings::compact().check().unwrap();
        let error = ModelSettings { latent: 0, ..ModelSettings::default() }.check().unwrap_err();
        assert_eq!(error.to_string(), "use the setting model.latent: it is 0, expected 1 to 4096");
        assert!(
            ModelSettings { own_output_share: f64::NAN, ..ModelSettings::default() }.check().is_err(),
            "a share that is no number"
        );
    }
}
