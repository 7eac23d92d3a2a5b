//! Translation both ways: descriptions to motions and motions to descriptions.
//!
//! In: a trained [`Bundle`], and sentences or motions of any rate.
//! Out: [`Acted`], a motion at the bundle's rate, and [`Described`], the best sentences with their probabilities; both with
//! notes on what the model had to be helped with.
//! Nothing here trains, scores or writes files.
//!
//! ```text
//!  sentence --> Reading (words; unknown ones by vector or spelling) --> latent --> frames --> Motion
//!  Motion --> the bundle's rate, normalised --> latent --> beam search or draws --> sentences
//! ```

mod consensus;
mod performance;
mod reading;
mod sampling;
mod search;
mod spline;
mod variation;

pub use performance::performed_motion;
pub use reading::{Note, Reading, Substitute};
pub use search::{Choose, Search, Sentence};
pub use spline::upsampled;
pub use variation::DEFAULT_NOISE;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};

use crate::dataset::WordVectors;
use crate::features::TokenRule;
use crate::manifest::sha256_hex;
use crate::model::{Bundle, BundleError, Frames, MotionLength};
use crate::motion::{Body, Frame, Motion, MotionError, NUM_CHANNELS};

/// Most words of a sentence; the longest caption of KIT-ML has 42.
const MAX_WORDS: usize = 500;
/// How many times as long as the longest motion of the training a motion may be.
const MAX_STRETCH: f64 = 10.0;
/// Time a decoder is given to settle, seconds, unless told otherwise; see [`Acting::settle_secs`].
pub const DEFAULT_SETTLE_SECS: f64 = 0.5;
/// Longest time to settle, seconds.
const MAX_SETTLE_SECS: f64 = 10.0;
/// Normalised value beyond which a channel is far outside of what was learned; training stays within 0.9.
const FAR_OUTSIDE: f32 = 1.5;

/// Why something cannot be translated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TranslationError {
    /// A sentence without a word the model can read.
    #[error(
        "read the caption {caption:?}: the model knows none of its words, nor any that is spelled like them"
    )]
    NoWords {
        /// The sentence, shortened.
        caption: String,
    },
    /// A sentence of too many words.
    #[error("read a caption of {found} words: at most {MAX_WORDS} are read")]
    TooManyWords {
        /// Number of words.
        found: usize,
    },
    /// A motion too short to have a second frame.
    #[error(
        "read a motion of {secs:.3} s: at the model's {rate_hz} Hz it has a single frame, at least 2 are needed"
    )]
    TooShort {
        /// Duration, seconds.
        secs: f64,
        /// Rate of the model, hertz.
        rate_hz: f64,
    },
    /// A length far beyond what was learned.
    #[error(
        "translate a motion of {secs} s: the model has seen {seen:.1} s at most, and ten times that is the limit"
    )]
    TooLong {
        /// Duration, seconds.
        secs: f64,
        /// Longest of the training, seconds.
        seen: f64,
    },
    /// A length that is none.
    #[error("make a motion of {secs} s: at least {least} s are needed, two frames of the model")]
    Length {
        /// Length asked for, seconds.
        secs: f64,
        /// Shortest accepted, seconds.
        least: f64,
    },
    /// Word vectors of another kind.
    #[error("use the word vectors: they have {found} numbers, the model was trained with {expected}")]
    Dimensions {
        /// Numbers in a vector of the file.
        found: usize,
        /// Numbers in a vector of the model.
        expected: usize,
    },
    /// What was made is no motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// How a description becomes a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acting {
    /// Time from the first to the last frame, seconds; `None` takes what the length head predicts, within the lengths seen
    /// in training.
    ///
    /// `Deviation:` the paper generates as many frames as the reference has; give the reference's length for that.
    pub length_secs: Option<f64>,
    /// Time at the beginning that is made and left out, seconds, rounded to frames; at most 10.
    ///
    /// The decoder is given the mean first frame of the training motions, which is no frame of the motion it is to make, and
    /// takes some frames to get from there into the movement. 0 keeps them. Default 0.5.
    pub settle_secs: f64,
    /// Who moves; the model knows angles and places only.
    pub body: Body,
}

impl Default for Acting {
    /// The predicted length, half a second to settle, and a body of 1.75 m.
    fn default() -> Self {
        Self { length_secs: None, settle_secs: DEFAULT_SETTLE_SECS, body: Body::with_default_mass(1.75) }
    }
}

/// A motion made from a description.
#[derive(Debug, Clone, PartialEq)]
pub struct Acted {
    /// The motion, at the rate of the model, as [`Acting`] says.
    pub motion: Motion,
    /// The latent it was made from, `[latent]`.
    pub latent: Vec<f32>,
}

/// Several motions of one sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct Variants {
    /// Motions with their numbers, in rising order; number 0 is that of the sentence itself, without noise.
    pub motions: Vec<(usize, Acted)>,
    /// Numbers of noisy ones that are no motion, each with the reason.
    pub left_out: Vec<(usize, TranslationError)>,
}

impl Variants {
    /// Parts what was made from what was not; without the first there is nothing.
    fn sift(made: impl Iterator<Item = Result<Acted, TranslationError>>) -> Result<Self, TranslationError> {
        let mut variants = Self { motions: Vec::new(), left_out: Vec::new() };
        for (number, made) in made.enumerate() {
            match made {
                Ok(acted) => variants.motions.push((number, acted)),
                Err(error) if number == 0 => return Err(error),
                Err(error) => variants.left_out.push((number, error)),
            }
        }
        Ok(variants)
    }
}

/// Sentences written about a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Described {
    /// Best first, no two alike; at least one.
    pub sentences: Vec<Sentence>,
    /// The latent they were written from, `[latent]`.
    pub latent: Vec<f32>,
    /// Doubts about the motion, as sentences for a person.
    pub warnings: Vec<String>,
}

impl Described {
    /// The best sentence; it may be empty.
    #[must_use]
    pub fn best(&self) -> &str {
        self.sentences.first().map_or("", |sentence| sentence.text.as_str())
    }
}

/// A trained model that translates.
#[derive(Debug, Clone)]
pub struct Translator {
    bundle: Bundle,
    rule: TokenRule,
    /// Vectors of words outside the vocabulary.
    vectors: BTreeMap<String, Vec<f32>>,
    /// Standard deviation of each number of the latent, `[latent]`.
    spread: Vec<f32>,
}

impl Translator {
    /// Translates with a bundle.
    #[must_use]
    pub fn new(bundle: Bundle) -> Self {
        let rule = reading::rule_of(&bundle.vocabulary);
        let spread = variation::spread(&bundle);
        Self { bundle, rule, vectors: BTreeMap::new(), spread }
    }

    /// Loads a bundle onto a device.
    ///
    /// # Errors
    /// [`BundleError`] names the file and what is wrong with it.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, BundleError> {
        Ok(Self::new(Bundle::load(folder, device)?))
    }

    /// The bundle.
    #[must_use]
    pub fn bundle(&self) -> &Bundle {
        &self.bundle
    }

    /// Words of some sentences that are not in the vocabulary; what to look up in a file of word vectors.
    pub fn unknown_words<'c>(&self, captions: impl IntoIterator<Item = &'c str>) -> BTreeSet<String> {
        let words = captions.into_iter().flat_map(|caption| self.rule.tokenize(caption));
        words.filter(|word| self.bundle.vocabulary.index(word).is_none()).collect()
    }

    /// Adds vectors of words outside the vocabulary; they must be of the kind the model was trained with.
    ///
    /// # Errors
    /// [`TranslationError::Dimensions`] when they have another length.
    pub fn add_vectors(&mut self, vectors: WordVectors) -> Result<(), TranslationError> {
        let expected = self.bundle.vocabulary.dimensions;
        if vectors.dimensions != expected {
            return Err(TranslationError::Dimensions { found: vectors.dimensions, expected });
        }
        self.vectors.extend(vectors.vectors);
        Ok(())
    }

    /// Checksum over the vectors added, hexadecimal; `None` where there are none.
    #[must_use]
    pub fn vectors_sha256(&self) -> Option<String> {
        let mut bytes = Vec::new();
        for (word, vector) in &self.vectors {
            bytes.extend((word.len() as u64).to_le_bytes());
            bytes.extend(word.bytes());
            bytes.extend(vector.iter().flat_map(|value| value.to_le_bytes()));
        }
        (!self.vectors.is_empty()).then(|| sha256_hex(&bytes))
    }

    /// A sentence cut by the rule the vocabulary was cut by, words with one space between: what of it a model could write.
    #[must_use]
    pub fn cut(&self, caption: &str) -> String {
        self.rule.tokenize(caption).join(" ")
    }

    /// The words of a sentence as the model reads them.
    ///
    /// A word outside the vocabulary enters by its own vector where there is one, since the retrofit layer takes any; else
    /// by the known word of the nearest spelling; else it is left out. Each is noted.
    ///
    /// # Errors
    /// [`TranslationError::NoWords`] when nothing is left, [`TranslationError::TooManyWords`].
    pub fn read(&self, caption: &str) -> Result<Reading, TranslationError> {
        reading::read(self.rule, &self.bundle.vocabulary, &self.vectors, caption)
    }

    /// The latent of a sentence, `[latent]`.
    #[must_use]
    pub fn latent_of(&self, reading: &Reading) -> Vec<f32> {
        numbers(&self.bundle.encode_words(&reading.words))
    }

    /// The motion of a latent `[latent]`.
    ///
    /// # Errors
    /// [`TranslationError`] when the length cannot be, or what the model makes is no motion.
    pub fn act(&self, latent: Vec<f32>, acting: &Acting) -> Result<Acted, TranslationError> {
        let tensor = self.tensor(&latent);
        let wanted = match acting.length_secs {
            None => self.bundle.predict_lengths(&tensor)[0],
            Some(secs) => self.num_frames(secs)?,
        };
        // A NaN settles nothing.
        let settling =
            (acting.settle_secs.clamp(0.0, MAX_SETTLE_SECS) * self.bundle.config.rate_hz).round() as usize;
        let length = MotionLength::Frames(vec![wanted + settling]);
        let frames = self.bundle.decode_motions(&tensor, None, &length).swap_remove(0);
        let motion = self.bundle.motion_of(&frames[settling..], acting.body)?;
        let mut channels: Vec<_> = motion.frames().iter().map(Frame::to_channels).collect();
        self.bundle.config.root.place(&mut channels);
        let frames = channels.iter().map(Frame::from_channels).collect();
        let motion = Motion::new(acting.body, motion.rate_hz(), frames)?;
        Ok(Acted { motion, latent })
    }

    /// Several motions of one sentence: the first from its latent, the others from latents near by.
    ///
    /// Number k > 0 adds Gaussian noise to every number of the latent, `noise` times as wide as the spread of that number
    /// over the one-word sentences of the vocabulary; equal seeds give equal motions.
    ///
    /// A noisy one that is no motion is left out and told; the others stay.
    ///
    /// # Errors
    /// As [`Translator::act`], of the first.
    pub fn act_often(
        &self,
        latent: &[f32],
        acting: &Acting,
        count: usize,
        noise: f64,
        seed: u64,
    ) -> Result<Variants, TranslationError> {
        let vary = |number: usize| variation::vary(latent, &self.spread, number as u64, noise, seed);
        Variants::sift((0..count).map(|number| self.act(vary(number), acting)))
    }

    /// Sentences about a motion of any rate.
    ///
    /// # Errors
    /// [`TranslationError::TooShort`] or [`TranslationError::TooLong`].
    pub fn describe(&self, motion: &Motion, search: &Search) -> Result<Described, TranslationError> {
        let (frames, warnings) = self.normalised(motion)?;
        let motions: [Frames<'_>; 1] = [&frames];
        let latent = numbers(&self.bundle.encode_motions(&motions));
        let sentences = search.sentences(&self.bundle, &self.tensor(&latent));
        Ok(Described { sentences, latent, warnings })
    }

    /// A motion as the encoder takes it, with doubts.
    fn normalised(
        &self,
        motion: &Motion,
    ) -> Result<(Vec<[f32; NUM_CHANNELS]>, Vec<String>), TranslationError> {
        let config = &self.bundle.config;
        let (secs, seen) = (motion.duration_secs(), self.longest_secs());
        if secs > MAX_STRETCH * seen {
            return Err(TranslationError::TooLong { secs, seen });
        }
        let frames = self.bundle.frames_of(motion)?;
        if frames.len() < 2 {
            return Err(TranslationError::TooShort { secs, rate_hz: config.rate_hz });
        }
        let mut warnings = Vec::new();
        if frames.len() > config.frames_seen.1 {
            warnings
                .push(format!("it lasts {secs:.1} s, longer than any motion of the training ({seen:.1} s)"));
        }
        let values = frames.as_flattened();
        let outside = values.iter().filter(|value| value.abs() > FAR_OUTSIDE).count();
        if outside * 100 > values.len() {
            let percent = 100.0 * outside as f64 / values.len() as f64;
            warnings.push(format!("{percent:.0} % of its values lie far outside those of the training"));
        }
        Ok((frames, warnings))
    }

    /// Longest motion of the training, seconds.
    fn longest_secs(&self) -> f64 {
        (self.bundle.config.frames_seen.1 - 1) as f64 / self.bundle.config.rate_hz
    }

    fn num_frames(&self, secs: f64) -> Result<usize, TranslationError> {
        let rate_hz = self.bundle.config.rate_hz;
        let seen = self.longest_secs();
        if secs > MAX_STRETCH * seen {
            return Err(TranslationError::TooLong { secs, seen });
        }
        // A NaN is not at least anything.
        let steps = (secs * rate_hz).round();
        if steps >= 1.0 {
            Ok(steps as usize + 1)
        } else {
            Err(TranslationError::Length { secs, least: 1.0 / rate_hz })
        }
    }

    fn tensor(&self, latent: &[f32]) -> Tensor<2> {
        Tensor::from_data(TensorData::new(latent.to_vec(), [1, latent.len()]), &self.bundle.device())
    }
}

fn numbers(latent: &Tensor<2>) -> Vec<f32> {
    latent.clone().into_data().iter().collect()
}

#[cfg(test)]
mod tests;
