//! A prepared set: everything a training run needs, in one folder.

use serde::{Deserialize, Serialize};

use super::{Normalizer, Root, Vocabulary};
use crate::motion::NUM_CHANNELS;

/// Part of the data a motion, with all its captions, belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Learned from.
    Train,
    /// Watched while learning.
    Validation,
    /// Scored once, at the end.
    Test,
}

/// A motion as the model sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionFeatures {
    /// Identity in its dataset.
    pub id: String,
    /// Part it belongs to.
    pub split: Split,
    /// Normalised frames at the set's rate, `[time][channel]`.
    pub frames: Vec<[f32; NUM_CHANNELS]>,
}

/// A caption as the model sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CaptionFeatures {
    /// Words by number, from [`super::BOS`] to [`super::EOS`].
    pub words: Vec<u32>,
    /// The caption as it was read, for the tables.
    pub text: String,
    /// The motion it describes, by place in [`PreparedSet::motions`]; `None` for captions without motions.
    pub motion: Option<usize>,
    /// Part it belongs to.
    pub split: Split,
}

/// A caption and the motion it describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Pair {
    /// Place in [`PreparedSet::motions`].
    pub motion: usize,
    /// Place in [`PreparedSet::captions`].
    pub caption: usize,
}

/// Normalised motions, numbered captions, and the draws made of them.
#[derive(Debug, Clone, PartialEq)]
pub struct PreparedSet {
    /// Frames a second of every motion (10 for the paper).
    pub rate_hz: f64,
    /// What the root channels are relative to.
    pub root: Root,
    /// Map between SI units and the model's range, from the training split.
    pub normalizer: Normalizer,
    /// The words.
    pub vocabulary: Vocabulary,
    /// All motions, sorted by id.
    pub motions: Vec<MotionFeatures>,
    /// All captions kept, in the order of their motions.
    pub captions: Vec<CaptionFeatures>,
    /// Stage 1 draws motions from these places; a motion appears once for each of its captions, as in the paper.
    pub non_paired_motions: Vec<usize>,
    /// Stage 1 draws captions from these places.
    pub non_paired_captions: Vec<usize>,
    /// Stage 2 draws from these (training split).
    pub paired: Vec<Pair>,
    /// Pairs of the validation split.
    pub validation: Vec<Pair>,
    /// Pairs of the test split.
    pub test: Vec<Pair>,
    /// SHA-256 over all of the above, hexadecimal: runs refuse to go on with other data.
    pub fingerprint: String,
}
