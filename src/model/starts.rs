//! First frames for motions that are made without a reference.

use std::collections::{BTreeMap, BTreeSet};

use super::{Bundle, NamedTensor};
use crate::features::PreparedSet;
use crate::motion::NUM_CHANNELS;

const LATENTS: &str = "latents";
const FRAMES: &str = "frames";
/// Motions encoded at a time.
const BATCH: usize = 64;

/// Latents of training motions, each with the first frame of its motion, normalised.
///
/// `Deviation:` the paper gives the decoder the first frame of the reference. Without a reference a motion begins like the
/// training motion whose latent is nearest: a decoder that hears itself goes on from where it stands, and from the mean of all
/// first frames, which is no posture at all, it goes astray.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Starts(Vec<(Vec<f32>, [f32; NUM_CHANNELS])>);

impl Starts {
    /// The first frame that belongs to the latent nearest to this one; `None` when there are none.
    pub(super) fn nearest(&self, latent: &[f32]) -> Option<[f32; NUM_CHANNELS]> {
        let distance = |known: &[f32]| known.iter().zip(latent).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        let nearest = self.0.iter().min_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)));
        nearest.map(|(_, frame)| *frame)
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// `latents` `[motion, latent]` and `frames` `[motion, 50]`.
    pub(super) fn tensors(&self) -> BTreeMap<String, NamedTensor> {
        let latent = self.0.first().map_or(0, |(latent, _)| latent.len());
        let named = |width, values| NamedTensor { shape: vec![self.0.len(), width], values };
        let latents = self.0.iter().flat_map(|(latent, _)| latent).copied().collect();
        let frames = self.0.iter().flat_map(|(_, frame)| frame).copied().collect();
        BTreeMap::from([
            (LATENTS.to_owned(), named(latent, latents)),
            (FRAMES.to_owned(), named(NUM_CHANNELS, frames)),
        ])
    }

    /// What [`Starts::tensors`] gave; says what is wrong with it.
    pub(super) fn read(tensors: &BTreeMap<String, NamedTensor>, latent: usize) -> Result<Self, String> {
        let take = |name: &str, width: usize| {
            let tensor = tensors.get(name).ok_or_else(|| format!("it has no {name}"))?;
            let is_sound = tensor.shape.len() == 2
                && tensor.shape[1] == width
                && tensor.values.iter().all(|value| value.is_finite());
            if is_sound { Ok(tensor) } else { Err(format!("{name} are not rows of {width} finite numbers")) }
        };
        let (latents, frames) = (take(LATENTS, latent)?, take(FRAMES, NUM_CHANNELS)?);
        if latents.shape[0] != frames.shape[0] {
            return Err(format!("{} {LATENTS} and {} {FRAMES}", latents.shape[0], frames.shape[0]));
        }
        let rows = latents.values.chunks_exact(latent).map(<[f32]>::to_vec);
        Ok(Self(rows.zip(frames.values.as_chunks().0.iter().copied()).collect()))
    }
}

impl Bundle {
    /// Whether it has first frames of motions.
    #[must_use]
    pub fn has_starts(&self) -> bool {
        !self.starts.is_empty()
    }

    /// The bundle with the first frames of the training pairs' motions, for motions made without a reference.
    #[must_use]
    pub fn with_starts(mut self, set: &PreparedSet) -> Self {
        let places: BTreeSet<usize> = set.paired.iter().map(|pair| pair.motion).collect();
        let places: Vec<usize> = places.into_iter().collect();
        self.starts = Starts::default();
        for places in places.chunks(BATCH) {
            let motions: Vec<_> = places.iter().map(|&place| set.motions[place].frames.as_slice()).collect();
            let latents = Self::numbers(&self.encode_motions(&motions));
            self.starts.0.extend(latents.into_iter().zip(motions.iter().map(|frames| frames[0])));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::tiny;
    use crate::model::{MotionLength, Rprae};
    use crate::training::tests::four_pairs;
    use burn::tensor::Device;

    #[test]
    fn a_motion_begins_like_the_nearest_one() {
        let set = four_pairs();
        let model = Rprae::new(&tiny(), &set.vocabulary, 1, &Device::flex());
        let bundle = Bundle::new(&model, &tiny(), &set).with_starts(&set);
        let folder = tempfile::tempdir().unwrap();
        bundle.save(&folder.path().join("bundle"), "").unwrap();
        let loaded = Bundle::load(&folder.path().join("bundle"), &Device::flex()).unwrap();
        assert_eq!(loaded.starts, bundle.starts);
        for motion in &set.motions {
            let latent = loaded.encode_motions(&[&motion.frames]);
            let made = loaded.decode_motions(&latent, None, &MotionLength::Predicted);
            assert_eq!(made[0][0], motion.frames[0]);
        }
        let mut tensors = bundle.starts.tensors();
        assert!(Starts::read(&tensors, 3).unwrap_err().contains("3 finite"));
        tensors.remove(FRAMES);
        assert!(Starts::read(&tensors, tiny().latent).unwrap_err().contains("no frames"));
    }
}
