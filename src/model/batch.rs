//! Sequences of different lengths, side by side.

use burn::tensor::{Device, Int, Tensor, TensorData};

use crate::features::EOS;
use crate::motion::NUM_CHANNELS;

/// Frames of one motion, normalised.
pub type Frames<'a> = &'a [[f32; NUM_CHANNELS]];

/// Motions side by side, padded with zeros to the longest.
#[derive(Debug, Clone)]
pub struct MotionBatch {
    /// `[batch, time, channel]`.
    pub(super) frames: Tensor<3>,
    /// Frames of each motion; at least 2.
    pub(super) lengths: Vec<usize>,
    /// Every frame but the first of each motion, one motion after the other, `[frame, channel]`.
    pub(super) targets: Tensor<2>,
}

impl MotionBatch {
    /// A batch of at least one motion, each of at least 2 frames.
    ///
    /// # Panics
    /// If there is no motion, or one is shorter.
    #[must_use]
    pub fn new(motions: &[Frames<'_>], device: &Device) -> Self {
        let longest = motions.iter().map(|motion| motion.len()).max().unwrap_or(0);
        Self::padded(motions, longest, device)
    }

    /// A batch padded to a given number of frames, which changes no result.
    pub(crate) fn padded(motions: &[Frames<'_>], width: usize, device: &Device) -> Self {
        assert!(!motions.is_empty() && motions.iter().all(|motion| motion.len() >= 2), "motions too short");
        let lengths: Vec<usize> = motions.iter().map(|motion| motion.len()).collect();
        let mut frames = vec![0.0; motions.len() * width * NUM_CHANNELS];
        for (motion, row) in motions.iter().zip(frames.chunks_exact_mut(width * NUM_CHANNELS)) {
            row[..motion.len() * NUM_CHANNELS].copy_from_slice(motion.as_flattened());
        }
        let targets: Vec<f32> =
            motions.iter().flat_map(|motion| motion[1..].as_flattened()).copied().collect();
        let num_targets = targets.len() / NUM_CHANNELS;
        Self {
            frames: Tensor::from_data(TensorData::new(frames, [motions.len(), width, NUM_CHANNELS]), device),
            lengths,
            targets: Tensor::from_data(TensorData::new(targets, [num_targets, NUM_CHANNELS]), device),
        }
    }

    /// Frames to be predicted of each motion.
    pub(super) fn num_steps(&self) -> Vec<usize> {
        self.lengths.iter().map(|length| length - 1).collect()
    }

    /// Frames to be predicted in all.
    #[must_use]
    pub fn num_targets(&self) -> usize {
        self.targets.dims()[0]
    }
}

/// Captions side by side, padded to the longest.
#[derive(Debug, Clone)]
pub struct CaptionBatch {
    /// Word numbers, `[batch * time]`.
    pub(super) words: Tensor<1, Int>,
    /// The same, not on the device.
    pub(super) captions: Vec<Vec<u32>>,
    /// Words of each caption, beginning and end included; at least 2.
    pub(super) lengths: Vec<usize>,
    /// Words of the longest caption, or more.
    pub(super) width: usize,
    /// Every word but the first of each caption, one caption after the other, `[word]`.
    pub(super) targets: Tensor<1, Int>,
}

impl CaptionBatch {
    /// A batch of at least one caption, each of at least 2 words.
    ///
    /// # Panics
    /// If there is no caption, or one is shorter.
    #[must_use]
    pub fn new(captions: &[&[u32]], device: &Device) -> Self {
        let longest = captions.iter().map(|caption| caption.len()).max().unwrap_or(0);
        Self::padded(captions, longest, device)
    }

    /// A batch padded to a given number of words, which changes no result.
    pub(crate) fn padded(captions: &[&[u32]], width: usize, device: &Device) -> Self {
        assert!(!captions.is_empty() && captions.iter().all(|words| words.len() >= 2), "captions too short");
        let targets: Vec<u32> = captions.iter().flat_map(|words| &words[1..]).copied().collect();
        Self {
            words: flat_words(captions, width, device),
            captions: captions.iter().map(|words| words.to_vec()).collect(),
            lengths: captions.iter().map(|words| words.len()).collect(),
            width,
            targets: indices(targets.into_iter().map(|word| word as usize), device),
        }
    }

    /// Words to be predicted of each caption.
    pub(super) fn num_steps(&self) -> Vec<usize> {
        self.lengths.iter().map(|length| length - 1).collect()
    }

    /// Words to be predicted in all.
    #[must_use]
    pub fn num_targets(&self) -> usize {
        self.targets.dims()[0]
    }

    /// Number of captions.
    pub(super) fn size(&self) -> usize {
        self.lengths.len()
    }
}

/// Word numbers padded to `width`, `[batch * width]`.
pub(super) fn flat_words<W: AsRef<[u32]>>(captions: &[W], width: usize, device: &Device) -> Tensor<1, Int> {
    let words = captions.iter().flat_map(|words| {
        let words = words.as_ref();
        words.iter().copied().chain(std::iter::repeat_n(EOS, width - words.len()))
    });
    indices(words.map(|word| word as usize), device)
}

/// Numbers of rows, `[row]`.
pub(super) fn indices(values: impl Iterator<Item = usize>, device: &Device) -> Tensor<1, Int> {
    let values: Vec<i32> = values.map(|value| value as i32).collect();
    let len = values.len();
    Tensor::from_data(TensorData::new(values, [len]), device)
}

/// Leaves out the padding: `[batch, time, feature]` to `[step, feature]`, one sequence after the other.
///
/// What follows cannot depend on how far the batch was padded, not even by the order of a sum.
pub(super) fn packed(padded: Tensor<3>, num_steps: &[usize]) -> Tensor<2> {
    let [batch, width, feature] = padded.dims();
    let rows =
        num_steps.iter().enumerate().flat_map(|(row, &steps)| (0..steps).map(move |t| row * width + t));
    let rows = indices(rows, &padded.device());
    padded.reshape([batch * width, feature]).select(0, rows)
}
