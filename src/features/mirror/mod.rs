//! Mirror images of what is learned from: twice the data, since people are all but symmetric.

mod words;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use self::words::MirroredWords;
use super::{BOS, CaptionFeatures, EOS, MotionFeatures, Normalizer, Pair, PreparedSet};
use crate::motion::{NUM_CHANNELS, mirrored_channels};

/// How many images a set has; what is left out has a caption without an image in the vocabulary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MirrorCount {
    /// Images of pairs.
    pub num_pairs: usize,
    /// Pairs without an image.
    pub num_pairs_left_out: usize,
    /// Images of non-paired motions; a motion that is drawn from several places has one for each.
    pub num_motions: usize,
    /// Images of non-paired captions.
    pub num_captions: usize,
    /// Non-paired captions without an image.
    pub num_captions_left_out: usize,
}

impl MirrorCount {
    /// The images [`PreparedSet::with_mirror_images`] makes, without making them.
    #[must_use]
    pub fn of(set: &PreparedSet) -> Self {
        let words = MirroredWords::of(&set.vocabulary);
        let has_image: Vec<bool> =
            set.captions.iter().map(|caption| words.caption(&caption.words).is_some()).collect();
        let num_pairs = set.paired.iter().filter(|pair| has_image[pair.caption]).count();
        let num_captions = set.non_paired_captions.iter().filter(|&&caption| has_image[caption]).count();
        Self {
            num_pairs,
            num_pairs_left_out: set.paired.len() - num_pairs,
            num_motions: set.non_paired_motions.len(),
            num_captions,
            num_captions_left_out: set.non_paired_captions.len() - num_captions,
        }
    }
}

impl Normalizer {
    /// The ranges widened to hold every motion that was within them and its mirror image.
    ///
    /// With these, the image of a normalised frame is [`mirrored_channels`] of it, to the last bit.
    #[must_use]
    pub fn with_mirror_images(&self) -> Self {
        let bounds = |of: &[f64]| -> [f64; NUM_CHANNELS] { std::array::from_fn(|channel| of[channel]) };
        let (low, high) = (bounds(&self.minimum), bounds(&self.maximum));
        // Where a channel is negated, its bounds change places.
        let (a, b) = (mirrored_channels(&low), mirrored_channels(&high));
        let bound = |choose: fn(f64, f64) -> f64, of: &[f64; NUM_CHANNELS]| {
            (0..NUM_CHANNELS).map(|channel| choose(of[channel], choose(a[channel], b[channel]))).collect()
        };
        Self { minimum: bound(f64::min, &low), maximum: bound(f64::max, &high) }
    }
}

impl PreparedSet {
    /// The same motions in the range of another normaliser; the fingerprint stays that of the prepared set.
    #[must_use]
    pub fn renormalized(&self, normalizer: &Normalizer) -> Self {
        let mut set = self.clone();
        if set.normalizer != *normalizer {
            for frame in set.motions.iter_mut().flat_map(|motion| &mut motion.frames) {
                *frame = normalizer.normalize(&self.normalizer.denormalize(frame));
            }
            set.normalizer = normalizer.clone();
        }
        set
    }

    /// The set with the mirror images of its pairs and non-paired samples behind them; nothing held out has one.
    ///
    /// In the image of a pair left and right are exchanged in the motion and in the words; a pair whose caption has a word
    /// without an image in the vocabulary has none. The ranges are widened to hold the images, and everything is normalised
    /// anew. Every motion, caption and draw keeps its place.
    ///
    /// This is a set to learn from, not to save: its motions are not sorted by id any more, and its fingerprint stays that of
    /// the prepared set, which decides everything in it.
    #[must_use]
    pub fn with_mirror_images(&self) -> Self {
        let words = MirroredWords::of(&self.vocabulary);
        let mut images = Images {
            set: self.renormalized(&self.normalizer.with_mirror_images()),
            words,
            motions: BTreeMap::new(),
            captions: BTreeMap::new(),
        };
        for pair in &self.paired {
            if let Some(caption) = images.caption(pair.caption) {
                let motion = images.motion(pair.motion);
                images.set.paired.push(Pair { motion, caption });
            }
        }
        for &motion in &self.non_paired_motions {
            let image = images.motion(motion);
            images.set.non_paired_motions.push(image);
        }
        for &caption in &self.non_paired_captions {
            let image = images.caption(caption);
            images.set.non_paired_captions.extend(image);
        }
        images.set
    }
}

/// A set that grows by images, each made once.
struct Images<'s> {
    set: PreparedSet,
    words: MirroredWords<'s>,
    /// Place of the image of a motion.
    motions: BTreeMap<usize, usize>,
    /// Place of the image of a caption that has one.
    captions: BTreeMap<usize, Option<usize>>,
}

impl Images<'_> {
    fn motion(&mut self, place: usize) -> usize {
        if let Some(&image) = self.motions.get(&place) {
            return image;
        }
        let motion = &self.set.motions[place];
        let image = MotionFeatures {
            id: format!("{} (mirrored)", motion.id),
            split: motion.split,
            frames: motion.frames.iter().map(mirrored_channels).collect(),
        };
        self.set.motions.push(image);
        self.motions.insert(place, self.set.motions.len() - 1);
        self.set.motions.len() - 1
    }

    fn caption(&mut self, place: usize) -> Option<usize> {
        if let Some(&image) = self.captions.get(&place) {
            return image;
        }
        let image = self.words.caption(&self.set.captions[place].words).map(|words| {
            let motion = self.set.captions[place].motion.map(|motion| self.motion(motion));
            let inner = words.iter().filter(|&&word| word != BOS && word != EOS);
            let text: Vec<&str> =
                inner.map(|&word| self.set.vocabulary.words[word as usize].as_str()).collect();
            let text = text.join(" ");
            let split = self.set.captions[place].split;
            self.set.captions.push(CaptionFeatures { words, text, motion, split });
            self.set.captions.len() - 1
        });
        self.captions.insert(place, image);
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{LIMIT, Root, Split, Vocabulary};
    use crate::motion::joint_index;

    /// Two pairs to learn from, of which the second has no image, a caption and a motion alone, and a pair held out.
    fn set() -> PreparedSet {
        let frames = |start: f32| -> Vec<[f32; NUM_CHANNELS]> {
            (0..3).map(|t| std::array::from_fn(|c| start + 0.1 * t as f32 + 0.01 * c as f32)).collect()
        };
        let motion =
            |id: &str, split, start| MotionFeatures { id: id.to_owned(), split, frames: frames(start) };
        let caption = |motion, split, words: &[u32]| CaptionFeatures {
            words: words.to_vec(),
            text: "As written.".to_owned(),
            motion,
            split,
        };
        let words = ["<bos>", "<eos>", "left", "leftwards", "right", "walks"];
        PreparedSet {
            rate_hz: 10.0,
            root: Root::FromStart,
            normalizer: Normalizer {
                minimum: (0..NUM_CHANNELS).map(|channel| -1.0 - 0.01 * channel as f64).collect(),
                maximum: (0..NUM_CHANNELS).map(|channel| 2.0 + 0.02 * channel as f64).collect(),
            },
            vocabulary: Vocabulary {
                words: words.map(str::to_owned).to_vec(),
                dimensions: 1,
                vectors: vec![None; words.len()],
            },
            motions: vec![
                motion("1", Split::Train, -0.5),
                motion("2", Split::Train, -0.4),
                motion("3", Split::Test, -0.3),
                motion("4", Split::Train, -0.2),
            ],
            captions: vec![
                caption(Some(0), Split::Train, &[0, 5, 2, 1]),
                caption(Some(1), Split::Train, &[0, 5, 3, 1]),
                caption(Some(2), Split::Test, &[0, 5, 4, 1]),
                caption(None, Split::Train, &[0, 5, 1]),
            ],
            non_paired_motions: vec![0, 0, 1, 3],
            non_paired_captions: vec![0, 1, 3],
            paired: vec![Pair { motion: 0, caption: 0 }, Pair { motion: 1, caption: 1 }],
            validation: Vec::new(),
            test: vec![Pair { motion: 2, caption: 2 }],
            fingerprint: "of the set".to_owned(),
        }
    }

    #[test]
    fn only_what_is_learned_from_has_images() {
        let (before, after) = (set(), set().with_mirror_images());
        assert_eq!((&after.test, &after.validation), (&before.test, &before.validation));
        assert_eq!(after.fingerprint, before.fingerprint);
        let ids: Vec<&str> = after.motions.iter().map(|motion| motion.id.as_str()).collect();
        assert_eq!(ids, ["1", "2", "3", "4", "1 (mirrored)", "2 (mirrored)", "4 (mirrored)"]);
        assert_eq!(after.non_paired_motions, [0, 0, 1, 3, 4, 4, 5, 6]);
        assert_eq!(after.captions[..4], before.captions);
        assert_eq!(after.non_paired_captions, [0, 1, 3, 4, 5]);
        assert_eq!(after.paired[..2], before.paired);
        assert_eq!(after.paired[2..], [Pair { motion: 4, caption: 4 }]);
        let image = CaptionFeatures {
            words: vec![0, 5, 4, 1],
            text: "walks right".to_owned(),
            motion: Some(4),
            split: Split::Train,
        };
        assert_eq!(after.captions[4], image);
        assert_eq!((after.captions[5].motion, after.captions[5].text.as_str()), (None, "walks"));

        let count = MirrorCount::of(&before);
        let expected = MirrorCount {
            num_pairs: 1,
            num_pairs_left_out: 1,
            num_motions: 4,
            num_captions: 2,
            num_captions_left_out: 1,
        };
        assert_eq!(count, expected);
        assert_eq!(after.paired.len(), before.paired.len() + count.num_pairs);
        assert_eq!(after.non_paired_motions.len(), before.non_paired_motions.len() + count.num_motions);
        assert_eq!(after.non_paired_captions.len(), before.non_paired_captions.len() + count.num_captions);
    }

    #[test]
    fn images_are_those_of_the_motion_in_si_units() {
        let (before, after) = (set(), set().with_mirror_images());
        for (place, image) in [(0, 4), (1, 5), (3, 6)] {
            for (frame, mirrored) in before.motions[place].frames.iter().zip(&after.motions[image].frames) {
                let expected = mirrored_channels(&before.normalizer.denormalize(frame));
                let found = after.normalizer.denormalize(mirrored);
                let worst = expected.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-6, "{worst}");
            }
        }
        // What was not mirrored is where it was.
        for (old, new) in before.motions.iter().zip(&after.motions) {
            for (old, new) in old.frames.iter().zip(&new.frames) {
                let (old, new) = (before.normalizer.denormalize(old), after.normalizer.denormalize(new));
                assert!(old.iter().zip(new).all(|(a, b)| (a - b).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn the_ranges_hold_the_images() {
        let knee = |side: &str| joint_index(&format!("{side}Kx")).unwrap();
        let (left, right, x) = (knee("L"), knee("R"), 44);
        let mut normalizer =
            Normalizer { minimum: vec![0.0; NUM_CHANNELS], maximum: vec![0.0; NUM_CHANNELS] };
        (normalizer.minimum[left], normalizer.maximum[left]) = (-2.0, 0.1);
        (normalizer.minimum[right], normalizer.maximum[right]) = (-1.0, 0.3);
        (normalizer.minimum[x], normalizer.maximum[x]) = (-0.5, 3.0);
        let wide = normalizer.with_mirror_images();
        for (channel, low, high) in [(left, -2.0, 0.3), (right, -2.0, 0.3), (x, -3.0, 3.0), (45, 0.0, 0.0)] {
            assert_eq!((wide.minimum[channel], wide.maximum[channel]), (low, high));
        }
        assert_eq!(wide.with_mirror_images(), wide);
        let mut frame = [0.0; NUM_CHANNELS];
        (frame[left], frame[right], frame[x]) = (-2.0, 0.3, 3.0);
        let normalised = wide.normalize(&frame);
        assert_eq!(wide.normalize(&mirrored_channels(&frame)), mirrored_channels(&normalised));
        assert!(normalised.iter().all(|value| f64::from(value.abs()) <= LIMIT + 1e-6));
    }
}
