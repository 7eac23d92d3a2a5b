//! A prepared set as a folder: numbers in a safetensors file, everything else in JSON.
//!
//! - `features.safetensors`: `frames` `[frame, 50]`, the frames of all motions one after another; `word_vectors`
//!   `[word, dimension]`, those of the words that have one; `has_vector` `[word]`.
//! - `set.json`: rate, normalizer, words, motions with their numbers of frames, captions, draws and the fingerprint.
//!
//! `set.json` is written last, and the fingerprint covers both files, so a folder that was cut off, mixed or edited is refused.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::check::{MAX_DIMENSIONS, Unsound};
use super::{CaptionFeatures, MotionFeatures, Normalizer, Pair, PreparedSet, Root, Split, Vocabulary};
use crate::manifest::write_file;
use crate::motion::NUM_CHANNELS;

/// Name of the JSON part, whose presence makes a folder a prepared set.
pub const SET_FILE: &str = "set.json";
/// Name of the numbers.
pub const FEATURES_FILE: &str = "features.safetensors";

/// Layout of the folder.
const FORMAT: u32 = 1;

/// Largest file read, bytes; all of KIT-ML takes 80 MB.
const MAX_BYTES: u64 = 16 << 30;

/// Why a prepared set cannot be saved or loaded.
#[derive(Debug, thiserror::Error)]
pub enum PreparedError {
    /// The file system said no.
    #[error("{doing} {}: {source}", .path.display())]
    Io {
        /// `read` or `write`.
        doing: &'static str,
        /// File.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The folder holds no prepared set.
    #[error("read {}: there is no {SET_FILE}; `rprae prepare --out DIR` makes such a folder", .path.display())]
    NotPrepared {
        /// Folder.
        path: PathBuf,
    },
    /// A file is not what was saved.
    #[error("read {}: {reason}; prepare the data again", .path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The set does not hold together.
    #[error("use the prepared set: {0}")]
    Unsound(#[from] Unsound),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Listing {
    format: u32,
    fingerprint: String,
    rate_hz: f64,
    #[serde(default)]
    root: Root,
    normalizer: Normalizer,
    dimensions: usize,
    words: Vec<String>,
    motions: Vec<ListedMotion>,
    captions: Vec<ListedCaption>,
    non_paired_motions: Vec<usize>,
    non_paired_captions: Vec<usize>,
    paired: Vec<Pair>,
    validation: Vec<Pair>,
    test: Vec<Pair>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ListedMotion {
    id: String,
    split: Split,
    num_frames: usize,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ListedCaption {
    text: String,
    motion: Option<usize>,
    split: Split,
    words: Vec<u32>,
}

impl PreparedSet {
    /// Writes the set into a folder, which is made where it is missing; a set that is there already is replaced.
    ///
    /// # Errors
    /// [`PreparedError::Unsound`] when the set does not hold together or its fingerprint is not that of its content,
    /// [`PreparedError::Io`] when it cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), PreparedError> {
        self.check()?;
        if self.fingerprint != self.computed_fingerprint() {
            let fault = "it is not that of the content; take `with_fingerprint`".to_owned();
            return Err(Unsound { place: "fingerprint".to_owned(), fault }.into());
        }
        let path = folder.join(FEATURES_FILE);
        let io_error = |path: PathBuf| move |source| PreparedError::Io { doing: "write", path, source };
        let bytes = self.numbers().map_err(|error| io_error(path.clone())(std::io::Error::other(error)))?;
        write_file(&path, &bytes).map_err(io_error(path))?;
        let path = folder.join(SET_FILE);
        let json =
            serde_json::to_vec(&self.listing()).map_err(|error| io_error(path.clone())(error.into()))?;
        write_file(&path, &json).map_err(io_error(path))
    }

    /// Reads a set that [`PreparedSet::save`] wrote.
    ///
    /// # Errors
    /// [`PreparedError`] when the folder holds none, or one that is damaged, mixed from two, or edited.
    pub fn load(folder: &Path) -> Result<Self, PreparedError> {
        let listing_path = folder.join(SET_FILE);
        let bytes = match read(&listing_path) {
            Err(PreparedError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                return Err(PreparedError::NotPrepared { path: folder.to_owned() });
            }
            other => other?,
        };
        let damaged = |path: &Path, reason: String| PreparedError::Damaged { path: path.to_owned(), reason };
        let listing: Listing = serde_json::from_slice(&bytes)
            .map_err(|error| damaged(&listing_path, format!("it is not a list of features ({error})")))?;
        if listing.format != FORMAT {
            let reason = format!("it has the layout {}, this program reads {FORMAT}", listing.format);
            return Err(damaged(&listing_path, reason));
        }
        let path = folder.join(FEATURES_FILE);
        let set = assemble(listing, &read(&path)?).map_err(|reason| damaged(&path, reason))?;
        set.check()?;
        let found = set.computed_fingerprint();
        if found != set.fingerprint {
            let reason =
                format!("the content has the fingerprint {found}, but {} was saved with it", set.fingerprint);
            return Err(damaged(&path, reason));
        }
        Ok(set)
    }

    fn listing(&self) -> Listing {
        let motions = self.motions.iter().map(|motion| ListedMotion {
            id: motion.id.clone(),
            split: motion.split,
            num_frames: motion.frames.len(),
        });
        let captions = self.captions.iter().map(|caption| ListedCaption {
            text: caption.text.clone(),
            motion: caption.motion,
            split: caption.split,
            words: caption.words.clone(),
        });
        Listing {
            format: FORMAT,
            fingerprint: self.fingerprint.clone(),
            rate_hz: self.rate_hz,
            root: self.root,
            normalizer: self.normalizer.clone(),
            dimensions: self.vocabulary.dimensions,
            words: self.vocabulary.words.clone(),
            motions: motions.collect(),
            captions: captions.collect(),
            non_paired_motions: self.non_paired_motions.clone(),
            non_paired_captions: self.non_paired_captions.clone(),
            paired: self.paired.clone(),
            validation: self.validation.clone(),
            test: self.test.clone(),
        }
    }

    fn numbers(&self) -> Result<Vec<u8>, SafeTensorError> {
        let num_frames: usize = self.motions.iter().map(|motion| motion.frames.len()).sum();
        let frames: Vec<u8> = self
            .motions
            .iter()
            .flat_map(|motion| motion.frames.iter().flatten())
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let vectors = &self.vocabulary.vectors;
        let num_vectors = vectors.iter().flatten().count();
        let values: Vec<u8> =
            vectors.iter().flatten().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let has_vector: Vec<u8> = vectors.iter().map(|vector| u8::from(vector.is_some())).collect();
        let dimensions = self.vocabulary.dimensions;
        let tensors = [
            ("frames", TensorView::new(Dtype::F32, vec![num_frames, NUM_CHANNELS], &frames)?),
            ("word_vectors", TensorView::new(Dtype::F32, vec![num_vectors, dimensions], &values)?),
            ("has_vector", TensorView::new(Dtype::U8, vec![vectors.len()], &has_vector)?),
        ];
        safetensors::serialize(tensors, None)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, PreparedError> {
    let io_error = |source| PreparedError::Io { doing: "read", path: path.to_owned(), source };
    let file = File::open(path).map_err(io_error)?;
    let length = file.metadata().map_err(io_error)?.len();
    if length > MAX_BYTES {
        let reason = format!("it is larger than the {MAX_BYTES} bytes accepted");
        return Err(PreparedError::Damaged { path: path.to_owned(), reason });
    }
    let mut bytes = Vec::with_capacity(length as usize);
    file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(io_error)?;
    Ok(bytes)
}

/// Joins the two parts, or says why they do not belong together.
fn assemble(listing: Listing, bytes: &[u8]) -> Result<PreparedSet, String> {
    let tensors = SafeTensors::deserialize(bytes).map_err(|error| format!("it is damaged ({error})"))?;
    let tensor = |name: &str, dtype: Dtype, shape: &[usize]| {
        let tensor = tensors.tensor(name).map_err(|_| format!("it has no {name:?}"))?;
        if tensor.dtype() != dtype || tensor.shape() != shape {
            return Err(format!("{name:?} has the shape {:?}, expected {shape:?}", tensor.shape()));
        }
        Ok(tensor.data())
    };
    if !(1..=MAX_DIMENSIONS).contains(&listing.dimensions) {
        return Err(format!("{} dimensions are listed", listing.dimensions));
    }

    let num_frames =
        listing.motions.iter().try_fold(0_usize, |sum, motion| sum.checked_add(motion.num_frames));
    let num_frames = num_frames.ok_or("more frames are listed than can be")?;
    let frames = tensor("frames", Dtype::F32, &[num_frames, NUM_CHANNELS])?;
    let mut frames = frames.chunks_exact(4 * NUM_CHANNELS);
    let motions = listing.motions.into_iter().map(|motion| MotionFeatures {
        id: motion.id,
        split: motion.split,
        frames: frames
            .by_ref()
            .take(motion.num_frames)
            .map(|frame| {
                let mut values = singles(frame);
                std::array::from_fn(|_| values.next().unwrap_or_default())
            })
            .collect(),
    });
    let motions = motions.collect();

    let has_vector = tensor("has_vector", Dtype::U8, &[listing.words.len()])?;
    let num_vectors = has_vector.iter().filter(|has| **has != 0).count();
    let values = tensor("word_vectors", Dtype::F32, &[num_vectors, listing.dimensions])?;
    let mut values = values.chunks_exact(4 * listing.dimensions);
    let vectors = has_vector
        .iter()
        .map(|has| if *has == 0 { None } else { values.next().map(|vector| singles(vector).collect()) })
        .collect();

    let captions = listing.captions.into_iter().map(|caption| CaptionFeatures {
        words: caption.words,
        text: caption.text,
        motion: caption.motion,
        split: caption.split,
    });
    Ok(PreparedSet {
        rate_hz: listing.rate_hz,
        root: listing.root,
        normalizer: listing.normalizer,
        vocabulary: Vocabulary { words: listing.words, dimensions: listing.dimensions, vectors },
        motions,
        captions: captions.collect(),
        non_paired_motions: listing.non_paired_motions,
        non_paired_captions: listing.non_paired_captions,
        paired: listing.paired,
        validation: listing.validation,
        test: listing.test,
        fingerprint: listing.fingerprint,
    })
}

fn singles(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn set() -> PreparedSet {
        let frames = |start: f32| (0..3).map(|t| [start + t as f32 * 0.1; NUM_CHANNELS]).collect();
        let motion =
            |id: &str, split, start| MotionFeatures { id: id.to_owned(), split, frames: frames(start) };
        let caption = |text: &str, motion, split, words: &[u32]| CaptionFeatures {
            words: words.to_vec(),
            text: text.to_owned(),
            motion,
            split,
        };
        PreparedSet {
            rate_hz: 10.0,
            root: Root::FromStart,
            normalizer: Normalizer { minimum: vec![-1.0; NUM_CHANNELS], maximum: vec![1.0; NUM_CHANNELS] },
            vocabulary: Vocabulary {
                words: ["<bos>", "<eos>", "a", "walks"].map(str::to_owned).to_vec(),
                dimensions: 2,
                vectors: vec![None, None, None, Some(vec![0.5, -0.25])],
            },
            motions: vec![
                motion("00001", Split::Train, 0.0),
                motion("00002", Split::Validation, 0.1),
                motion("00003", Split::Test, 0.2),
            ],
            captions: vec![
                caption("a walks", Some(0), Split::Train, &[0, 2, 3, 1]),
                caption("walks", Some(1), Split::Validation, &[0, 3, 1]),
                caption("a", Some(2), Split::Test, &[0, 2, 1]),
                caption("A!", None, Split::Train, &[0, 2, 1]),
            ],
            non_paired_motions: vec![0],
            non_paired_captions: vec![0, 3],
            paired: vec![Pair { motion: 0, caption: 0 }],
            validation: vec![Pair { motion: 1, caption: 1 }],
            test: vec![Pair { motion: 2, caption: 2 }],
            fingerprint: String::new(),
        }
        .with_fingerprint()
    }

    #[test]
    fn what_is_saved_is_what_is_loaded() {
        let folder = tempfile::tempdir().unwrap();
        set().save(folder.path()).unwrap();
        assert_eq!(PreparedSet::load(folder.path()).unwrap(), set());
        let bytes = |name| fs::read(folder.path().join(name)).unwrap();
        let first = (bytes(SET_FILE), bytes(FEATURES_FILE));
        set().save(folder.path()).unwrap();
        assert_eq!(first, (bytes(SET_FILE), bytes(FEATURES_FILE)));
    }

    #[test]
    fn damage_is_refused_wherever_it_is() {
        let folder = tempfile::tempdir().unwrap();
        for name in [SET_FILE, FEATURES_FILE] {
            set().save(folder.path()).unwrap();
            let path = folder.path().join(name);
            let good = fs::read(&path).unwrap();
            for place in (0..good.len()).step_by(7).chain([good.len() - 1]) {
                let mut bad = good.clone();
                bad[place] ^= 1;
                fs::write(&path, &bad).unwrap();
                let error = PreparedSet::load(folder.path()).expect_err(name).to_string();
                assert!(!error.contains('\n'), "{error}");
                fs::write(&path, &good[..place]).unwrap();
                assert!(PreparedSet::load(folder.path()).is_err(), "{name} cut at {place}");
            }
            fs::write(&path, good).unwrap();
        }
        fs::remove_file(folder.path().join(SET_FILE)).unwrap();
        let error = PreparedSet::load(folder.path()).unwrap_err().to_string();
        assert!(error.contains("rprae prepare"), "{error}");
    }

    #[test]
    fn sets_that_do_not_hold_together_are_not_saved() {
        type Change = fn(&mut PreparedSet);
        let folder = tempfile::tempdir().unwrap();
        let changes: [(&str, Change); 12] = [
            ("rate_hz", |set| set.rate_hz = f64::NAN),
            ("normalizer", |set| set.normalizer.minimum.truncate(49)),
            ("channel 3", |set| set.normalizer.minimum[3] = 2.0),
            ("word 3", |set| set.vocabulary.words[3] = "a".to_owned()),
            ("word 3", |set| set.vocabulary.vectors[3] = Some(vec![1.0])),
            ("frame 1", |set| set.motions[0].frames[1][7] = f32::INFINITY),
            ("motions, 1", |set| set.motions[1].id = "00001".to_owned()),
            ("captions, 0", |set| set.captions[0].words[1] = 4),
            ("captions, 1", |set| set.captions[1].words = vec![0, 1, 1]),
            ("captions, 2", |set| set.captions[2].split = Split::Train),
            ("non_paired_captions", |set| set.non_paired_captions.push(4)),
            ("paired, pair 0", |set| set.paired[0].caption = 3),
        ];
        for (place, change) in changes {
            let mut set = set();
            change(&mut set);
            let error = set.with_fingerprint().save(folder.path()).expect_err(place).to_string();
            assert!(error.contains(place), "{error}");
        }
        let mut set = set();
        set.captions[0].text.push('!');
        assert!(set.save(folder.path()).unwrap_err().to_string().contains("with_fingerprint"));
    }

    #[test]
    fn every_field_moves_the_fingerprint() {
        let changes: [fn(&mut PreparedSet); 9] = [
            |set| set.rate_hz = 20.0,
            |set| set.normalizer.maximum[0] = 2.0,
            |set| set.vocabulary.words[2] = "an".to_owned(),
            |set| set.vocabulary.vectors[2] = Some(vec![0.0, 0.0]),
            |set| set.motions[0].frames[0][0] = 0.5,
            |set| set.captions[3].split = Split::Test,
            |set| set.captions[3].motion = Some(0),
            |set| set.non_paired_motions.push(0),
            |set| set.test.clear(),
        ];
        for change in changes {
            let mut changed = set();
            change(&mut changed);
            assert_ne!(changed.computed_fingerprint(), set().fingerprint);
        }
    }
}
