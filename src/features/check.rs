//! What must hold in a prepared set before anything is learned from it.

use super::{BOS, EOS, Pair, PreparedSet, Split};
use crate::motion::{NUM_CHANNELS, bounds};

/// Longest word vector accepted.
pub(super) const MAX_DIMENSIONS: usize = 4096;

/// Why a prepared set is not sound.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {fault}")]
pub struct Unsound {
    /// Field, with the place in it.
    pub place: String,
    /// What is wrong there.
    pub fault: String,
}

fn unsound(place: impl Into<String>, fault: impl Into<String>) -> Unsound {
    Unsound { place: place.into(), fault: fault.into() }
}

impl PreparedSet {
    /// Checks that every place points into the set, every number is finite, and splits do not mix.
    ///
    /// # Errors
    /// [`Unsound`] names the first field that is wrong.
    pub fn check(&self) -> Result<(), Unsound> {
        if !bounds::RATE_HZ.contains(&self.rate_hz) {
            return Err(unsound("rate_hz", format!("{} is no rate of a motion", self.rate_hz)));
        }
        self.check_normalizer()?;
        self.check_vocabulary()?;
        self.check_motions()?;
        self.check_captions()?;
        for (name, places, end) in [
            ("non_paired_motions", &self.non_paired_motions, self.motions.len()),
            ("non_paired_captions", &self.non_paired_captions, self.captions.len()),
        ] {
            if let Some(place) = places.iter().find(|place| **place >= end) {
                return Err(unsound(name, format!("the place {place} is outside the {end} there are")));
            }
        }
        self.check_pairs("paired", &self.paired, Split::Train)?;
        self.check_pairs("validation", &self.validation, Split::Validation)?;
        self.check_pairs("test", &self.test, Split::Test)
    }

    fn check_normalizer(&self) -> Result<(), Unsound> {
        let (low, high) = (&self.normalizer.minimum, &self.normalizer.maximum);
        if low.len() != NUM_CHANNELS || high.len() != NUM_CHANNELS {
            let fault = format!("{} minima and {} maxima, expected {NUM_CHANNELS}", low.len(), high.len());
            return Err(unsound("normalizer", fault));
        }
        match low
            .iter()
            .zip(high)
            .position(|(low, high)| !(low.is_finite() && high.is_finite() && low <= high))
        {
            Some(channel) => Err(unsound(
                format!("normalizer, channel {channel}"),
                format!("{} to {} is no range", low[channel], high[channel]),
            )),
            None => Ok(()),
        }
    }

    fn check_vocabulary(&self) -> Result<(), Unsound> {
        let vocabulary = &self.vocabulary;
        let words = &vocabulary.words;
        if words.len() < 2 || words.len() != vocabulary.vectors.len() || u32::try_from(words.len()).is_err() {
            let fault = format!("{} words and {} vectors", words.len(), vocabulary.vectors.len());
            return Err(unsound("vocabulary", fault));
        }
        if let Some(place) = (3..words.len()).find(|place| words[place - 1] >= words[*place]) {
            let fault = format!("{:?} does not come before {:?}", words[place - 1], words[place]);
            return Err(unsound(format!("vocabulary, word {place}"), fault));
        }
        if !(1..=MAX_DIMENSIONS).contains(&vocabulary.dimensions) {
            return Err(unsound("vocabulary", format!("vectors of {} numbers", vocabulary.dimensions)));
        }
        let sound = |vector: &Option<Vec<f32>>| match vector {
            Some(vector) => {
                vector.len() == vocabulary.dimensions && vector.iter().all(|value| value.is_finite())
            }
            None => true,
        };
        match vocabulary.vectors.iter().position(|vector| !sound(vector)) {
            Some(place) => Err(unsound(
                format!("vocabulary, word {place}"),
                format!("the vector is not of {} finite numbers", vocabulary.dimensions),
            )),
            None => Ok(()),
        }
    }

    fn check_motions(&self) -> Result<(), Unsound> {
        for (place, motion) in self.motions.iter().enumerate() {
            if place > 0 && self.motions[place - 1].id >= motion.id {
                let fault = format!("{:?} does not come after the id before it", motion.id);
                return Err(unsound(format!("motions, {place}"), fault));
            }
            if motion.frames.is_empty() {
                return Err(unsound(format!("motion {:?}", motion.id), "no frames"));
            }
            if let Some(frame) =
                motion.frames.iter().position(|frame| !frame.iter().all(|value| value.is_finite()))
            {
                let fault = "a value that is not finite";
                return Err(unsound(format!("motion {:?}, frame {frame}", motion.id), fault));
            }
        }
        Ok(())
    }

    fn check_captions(&self) -> Result<(), Unsound> {
        for (place, caption) in self.captions.iter().enumerate() {
            let fault = |fault: &str| Err(unsound(format!("captions, {place}"), fault));
            let [first, inner @ .., last] = caption.words.as_slice() else {
                return fault("fewer than two words");
            };
            if (*first, *last) != (BOS, EOS) || inner.iter().any(|word| [BOS, EOS].contains(word)) {
                return fault("the words do not run from BOS to EOS");
            }
            if inner.iter().any(|word| *word as usize >= self.vocabulary.words.len()) {
                return fault("a word outside the vocabulary");
            }
            match caption.motion.map(|motion| self.motions.get(motion)) {
                Some(None) => return fault("it describes a motion that is not there"),
                Some(Some(motion)) if motion.split != caption.split => {
                    return fault("it is in another split than its motion");
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn check_pairs(&self, name: &str, pairs: &[Pair], split: Split) -> Result<(), Unsound> {
        for (place, pair) in pairs.iter().enumerate() {
            let fault = |fault: &str| Err(unsound(format!("{name}, pair {place}"), fault));
            let Some(caption) = self.captions.get(pair.caption) else {
                return fault("its caption is not there");
            };
            if caption.motion != Some(pair.motion) {
                return fault("its caption describes another motion");
            }
            if caption.split != split {
                return fault("it is of another split");
            }
        }
        Ok(())
    }
}
