//! Batches of prepared data.

use burn::tensor::Device;

use super::sampler::Sampler;
use crate::features::{Pair, PreparedSet};
use crate::model::{CaptionBatch, Frames, MotionBatch};

/// What one iteration learns from.
pub(super) struct Batch {
    pub(super) captions: CaptionBatch,
    pub(super) motions: MotionBatch,
    /// Motion of each pair; `None` when captions and motions have nothing to do with each other.
    pub(super) pairs: Option<Vec<usize>>,
    /// Places of the captions in [`PreparedSet::captions`].
    pub(super) caption_places: Vec<usize>,
    /// Places of the motions in [`PreparedSet::motions`].
    pub(super) motion_places: Vec<usize>,
}

impl Batch {
    fn new(
        set: &PreparedSet,
        caption_places: Vec<usize>,
        motion_places: Vec<usize>,
        are_pairs: bool,
        device: &Device,
    ) -> Self {
        let captions: Vec<&[u32]> =
            caption_places.iter().map(|&place| set.captions[place].words.as_slice()).collect();
        let motions: Vec<Frames<'_>> =
            motion_places.iter().map(|&place| set.motions[place].frames.as_slice()).collect();
        Self {
            captions: CaptionBatch::new(&captions, device),
            motions: MotionBatch::new(&motions, device),
            pairs: are_pairs.then(|| motion_places.clone()),
            caption_places,
            motion_places,
        }
    }

    /// A batch of pairs.
    pub(super) fn of_pairs(set: &PreparedSet, pairs: &[Pair], device: &Device) -> Self {
        let captions = pairs.iter().map(|pair| pair.caption).collect();
        let motions = pairs.iter().map(|pair| pair.motion).collect();
        Self::new(set, captions, motions, true, device)
    }

    /// What it is made of, for messages.
    pub(super) fn ids(&self, set: &PreparedSet) -> String {
        let motions: Vec<&str> =
            self.motion_places.iter().map(|&place| set.motions[place].id.as_str()).collect();
        let captions: Vec<String> = self.caption_places.iter().map(ToString::to_string).collect();
        format!("motions {}; captions {}", motions.join(" "), captions.join(" "))
    }
}

/// The batches of a run.
pub(super) struct Batches<'a> {
    set: &'a PreparedSet,
    captions: Sampler,
    motions: Sampler,
    pairs: Sampler,
    device: Device,
}

impl<'a> Batches<'a> {
    pub(super) fn new(set: &'a PreparedSet, seed: u64, batch_size: usize, device: Device) -> Self {
        let sampler = |name, places| Sampler::new(seed, name, places, batch_size);
        Self {
            set,
            captions: sampler("captions", set.non_paired_captions.len()),
            motions: sampler("motions", set.non_paired_motions.len()),
            pairs: sampler("pairs", set.paired.len()),
            device,
        }
    }

    /// Captions and motions drawn independently, for an iteration of stage 1 counted from 0.
    pub(super) fn non_paired(&mut self, iteration: usize) -> Batch {
        let set = self.set;
        let captions =
            self.captions.batch(iteration).iter().map(|&draw| set.non_paired_captions[draw]).collect();
        let motions =
            self.motions.batch(iteration).iter().map(|&draw| set.non_paired_motions[draw]).collect();
        Batch::new(set, captions, motions, false, &self.device)
    }

    /// Pairs, for an iteration of stage 2 counted from 0.
    pub(super) fn paired(&mut self, iteration: usize) -> Batch {
        let set = self.set;
        let pairs: Vec<Pair> = self.pairs.batch(iteration).iter().map(|&draw| set.paired[draw]).collect();
        Batch::of_pairs(set, &pairs, &self.device)
    }
}
