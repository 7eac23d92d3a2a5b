//! One checksum over everything a training run can see.

use sha2::{Digest, Sha256};

use super::{PreparedSet, Root, Split};
use crate::manifest::hex;

/// Begins every fingerprint, so that a later layout can never collide with this one.
const DOMAIN: &str = "rprae prepared set 1";

impl PreparedSet {
    /// SHA-256 over every field but [`PreparedSet::fingerprint`], hexadecimal.
    ///
    /// Lengths are hashed before contents and numbers as little-endian bytes, so the value depends on the data only:
    /// neither on how it is stored nor on the machine.
    #[must_use]
    pub fn computed_fingerprint(&self) -> String {
        let mut feed = Feed(Sha256::new());
        feed.text(DOMAIN);
        feed.float(self.rate_hz);
        // Nothing for the paper's form, which was the only one once.
        if self.root == Root::FromStart {
            feed.text("root from start");
        }
        feed.floats(&self.normalizer.minimum);
        feed.floats(&self.normalizer.maximum);
        feed.count(self.vocabulary.words.len());
        for word in &self.vocabulary.words {
            feed.text(word);
        }
        feed.count(self.vocabulary.dimensions);
        for vector in &self.vocabulary.vectors {
            feed.singles(vector.as_deref().unwrap_or_default());
        }
        feed.count(self.motions.len());
        for motion in &self.motions {
            feed.text(&motion.id);
            feed.split(motion.split);
            feed.count(motion.frames.len());
            for frame in &motion.frames {
                feed.singles(frame);
            }
        }
        feed.count(self.captions.len());
        for caption in &self.captions {
            feed.text(&caption.text);
            feed.split(caption.split);
            feed.count(caption.motion.map_or(0, |motion| motion + 1));
            feed.count(caption.words.len());
            for word in &caption.words {
                feed.0.update(word.to_le_bytes());
            }
        }
        for places in [&self.non_paired_motions, &self.non_paired_captions] {
            feed.count(places.len());
            for place in places {
                feed.count(*place);
            }
        }
        for pairs in [&self.paired, &self.validation, &self.test] {
            feed.count(pairs.len());
            for pair in pairs {
                feed.count(pair.motion);
                feed.count(pair.caption);
            }
        }
        hex(&feed.0.finalize())
    }

    /// The set with the fingerprint of its content.
    #[must_use]
    pub fn with_fingerprint(mut self) -> Self {
        self.fingerprint = self.computed_fingerprint();
        self
    }
}

struct Feed(Sha256);

impl Feed {
    fn count(&mut self, count: usize) {
        self.0.update((count as u64).to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.count(text.len());
        self.0.update(text.as_bytes());
    }

    fn float(&mut self, value: f64) {
        self.0.update(value.to_le_bytes());
    }

    fn floats(&mut self, values: &[f64]) {
        self.count(values.len());
        for value in values {
            self.float(*value);
        }
    }

    fn singles(&mut self, values: &[f32]) {
        self.count(values.len());
        let mut bytes = [0; 256];
        for part in values.chunks(64) {
            for (slot, value) in bytes.chunks_exact_mut(4).zip(part) {
                slot.copy_from_slice(&value.to_le_bytes());
            }
            self.0.update(&bytes[..4 * part.len()]);
        }
    }

    fn split(&mut self, split: Split) {
        self.0.update([match split {
            Split::Train => 0,
            Split::Validation => 1,
            Split::Test => 2,
        }]);
    }
}
