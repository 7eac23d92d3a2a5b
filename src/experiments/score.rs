//! What a model is worth on pairs it never saw.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::baseline::{MOMENTS, most_frequent_caption, nearest_in_pose_space};
use super::evaluator::{BATCH, Evaluator, EvaluatorError, describe, describe_by};
use super::poses::in_heading_frame;
use crate::evaluation::motion::{
    Embeddings, PoseComparison, Poses, PosesError, Rank, Retrieval, SetScore, diversity, frechet_score,
    pair_distance,
};
use crate::evaluation::{Clusters, Corpus, CorpusError, Measurement, Segment};
use crate::features::{Pair, PreparedSet};
use crate::humanoid::Humanoid;
use crate::model::{Bundle, MotionLength};
use crate::motion::NUM_CHANNELS;
use crate::translation::Search;

/// Why a model cannot be scored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScoreError {
    /// The judge does not understand it.
    #[error(transparent)]
    Evaluator(#[from] EvaluatorError),
    /// A motion that is none.
    #[error("score the motion of {id}: {error}")]
    Poses {
        /// The motion described.
        id: String,
        /// What is wrong with it.
        error: PosesError,
    },
    /// A motion that no encoder reads.
    #[error(
        "score the motion of {id}: it has a single frame, and two are needed; prepare the set without it"
    )]
    TooShort {
        /// The motion.
        id: String,
    },
    /// Captions that cannot be scored.
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    /// A model of other words than the set.
    #[error("score the model: its words are not those of the prepared set; give the set it was trained on")]
    OtherWords,
    /// A model of motions prepared in another way.
    #[error(
        "score the model: its motions have another rate, or begin elsewhere, than those of the prepared set; give the set it \
         was trained on"
    )]
    OtherMotions,
}

/// A caption written of a motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Described {
    /// Motion.
    pub id: String,
    /// What the model wrote.
    pub caption: String,
    /// The caption of the nearest training motion in pose space; people wrote it, so no file gets it.
    #[serde(skip)]
    pub nearest: String,
}

/// A motion made from a caption.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Performed {
    /// Motion that the caption describes.
    pub id: String,
    /// Place of the caption in the prepared set.
    pub caption: usize,
    /// Frames made.
    pub frames: usize,
    /// Frames of the recorded motion.
    pub recorded_frames: usize,
    /// What the judge wrote of the motion made.
    pub read_back: String,
    /// The motion made beside the recorded one.
    pub pose: PoseComparison,
    /// The motion made among those made from other captions, looked for by its caption.
    pub rank: Rank,
    /// The recorded motion among all recorded ones, looked for by the poses of the one made.
    pub pose_rank: Rank,
}

/// Everything found out about a model.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Name of the judge.
    pub evaluator: String,
    /// Captions of all motions of the pairs, sorted by place.
    pub described: Vec<Described>,
    /// Motions of all pairs.
    pub performed: Vec<Performed>,
    /// Pairs whose caption no pair learned from has: the others are of motions that were held out, but no new sentences.
    pub num_unseen_captions: usize,
    /// Captions with their references.
    pub captions: Corpus,
    /// The most frequent training caption, for every motion.
    pub most_frequent: Corpus,
    /// The caption of the nearest training motion in pose space.
    pub nearest: Corpus,
    /// Captions read back from the motions made from captions.
    pub read_back: Corpus,
    /// Which pairs are captions of one motion; [`Outcome::performed`] and what is measured of it are drawn so.
    pub clusters: Clusters,
    /// What was looked for, named.
    pub retrievals: Vec<Retrieval>,
    /// Distance of captions from the motions made from them, and from the recorded ones.
    pub pair_distances: [Measurement; 2],
    /// FID of the motions made, their diversity, and that of the recorded ones, each recording once.
    pub sets: Vec<SetScore>,
    /// The motions made, normalised by the set, for pictures.
    pub motions: Vec<Vec<[f32; NUM_CHANNELS]>>,
    /// Latents of captions, of recorded motions, and of motions made, one of each a pair.
    pub latents: [Embeddings; 3],
}

impl Outcome {
    /// Pose errors of the motions made.
    #[must_use]
    pub fn pose_measurements(&self) -> Vec<Measurement> {
        let comparisons: Vec<PoseComparison> = self.performed.iter().map(|one| one.pose).collect();
        let measured = PoseComparison::measure(&comparisons).into_iter();
        measured.map(|measurement| measurement.clustered(&self.clusters)).collect()
    }
}

/// Scores a model on some pairs of a set; `judge` embeds and reads back what it makes, and `decoding` says how the model
/// finds the captions it writes.
///
/// Motions begin where the model lets them begin and are as long as it predicts: nothing of the reference is given.
///
/// # Errors
/// [`ScoreError`] says what does not fit.
pub fn score(
    bundle: &Bundle,
    judge: &Evaluator<'_>,
    set: &PreparedSet,
    pairs: &[Pair],
    humanoid: &Humanoid,
    decoding: &Search,
) -> Result<Outcome, ScoreError> {
    judge.check(bundle)?;
    if bundle.vocabulary.words != set.vocabulary.words {
        return Err(ScoreError::OtherWords);
    }
    if bundle.config.rate_hz != set.rate_hz || bundle.config.root != set.root {
        return Err(ScoreError::OtherMotions);
    }
    let asked: BTreeSet<usize> = pairs.iter().map(|pair| pair.motion).collect();
    let asked: Vec<usize> = asked.into_iter().collect();
    if let Some(&motion) = asked.iter().find(|&&motion| set.motions[motion].frames.len() < 2) {
        return Err(ScoreError::TooShort { id: set.motions[motion].id.clone() });
    }
    let poses = recorded_poses(set, pairs, humanoid)?;
    let described = describe_all(bundle, set, &asked, &poses, decoding);
    let captions: Vec<&[u32]> =
        pairs.iter().map(|pair| set.captions[pair.caption].words.as_slice()).collect();
    let made = perform(bundle, set, &captions);

    let in_judge = judge.renormalized(&made, &set.normalizer);
    // A recording is embedded once, however many captions it has.
    let recorded: Vec<Vec<[f32; NUM_CHANNELS]>> =
        asked.iter().map(|&motion| set.motions[motion].frames.clone()).collect();
    let recorded = judge.renormalized(&recorded, &set.normalizer);
    let recording: BTreeMap<usize, usize> =
        asked.iter().enumerate().map(|(at, &motion)| (motion, at)).collect();
    let recording: Vec<usize> = pairs.iter().map(|pair| recording[&pair.motion]).collect();
    let clusters = Clusters::of(&recording);
    let of_captions = judge.embed_captions(&captions)?;
    let (of_recordings, of_made) = (judge.embed_motions(&recorded)?, judge.embed_motions(&in_judge)?);
    let of_recorded = of_recordings.select(&recording);
    let read_back = describe(judge.bundle, &in_judge);

    let made_poses = pairs
        .iter()
        .zip(&made)
        .map(|(pair, frames)| pose(set, pair.motion, frames, humanoid))
        .collect::<Result<Vec<_>, _>>()?;
    let is_other = |a: usize, b: usize| {
        pairs[a].motion != pairs[b].motion
            && set.captions[pairs[a].caption].words != set.captions[pairs[b].caption].words
    };
    // A recorded motion counts once, however many captions it has.
    let is_first = |place: usize| pairs[..place].iter().all(|before| before.motion != pairs[place].motion);
    let is_other_motion = |a: usize, b: usize| pairs[a].motion != pairs[b].motion && is_first(b);
    let num = pairs.len();
    let retrieval = |names, queries: &Embeddings, candidates: &Embeddings, once: bool| {
        let is_wrong = |a: usize, b: usize| if once { is_other_motion(a, b) } else { is_other(a, b) };
        Retrieval::new(names, &judge.name, num, is_wrong, |a, b| queries.distance(a, candidates, b))
            .clustered(&clusters)
    };
    let by_poses = Retrieval::new(
        ("generated-motion", "recorded-motion"),
        &format!("poses-at-{MOMENTS}-moments"),
        num,
        is_other_motion,
        |a, b| {
            poses
                .get(&pairs[b].motion)
                .map_or(f64::NAN, |other| made_poses[a].distance_over_course_m(other, MOMENTS))
        },
    )
    .clustered(&clusters);
    let retrievals = vec![
        retrieval(("caption", "generated-motion"), &of_captions, &of_made, false),
        retrieval(("generated-motion", "caption"), &of_made, &of_captions, false),
        by_poses,
        retrieval(("caption", "recorded-motion"), &of_captions, &of_recorded, true),
        retrieval(("recorded-motion", "caption"), &of_recorded, &of_captions, false),
    ];

    let performed = pairs
        .iter()
        .enumerate()
        .map(|(place, pair)| Performed {
            id: set.motions[pair.motion].id.clone(),
            caption: pair.caption,
            frames: made[place].len(),
            recorded_frames: set.motions[pair.motion].frames.len(),
            read_back: read_back[place].clone(),
            pose: PoseComparison::new(&made_poses[place], &poses[&pair.motion]),
            rank: retrievals[0].ranks[place],
            pose_rank: retrievals[2].ranks[place],
        })
        .collect();
    let mut sets = vec![frechet_score(&of_made, &of_recordings, &recording, &judge.name)];
    sets.extend(diversity(&of_made, &clusters, "generated-motion", &judge.name));
    let alone = Clusters::singles(of_recordings.len());
    sets.extend(diversity(&of_recordings, &alone, "recorded-motion", &judge.name));

    let most_frequent = most_frequent_caption(set);
    let of_motions = |write: &dyn Fn(usize) -> String| {
        let segments = asked.iter().enumerate().map(|(place, &motion)| segment(set, motion, write(place)));
        Corpus::new(segments.collect())
    };
    let back = pairs.iter().zip(&read_back).map(|(pair, caption)| segment(set, pair.motion, caption.clone()));
    let seen: BTreeSet<&[u32]> =
        set.paired.iter().map(|pair| set.captions[pair.caption].words.as_slice()).collect();
    Ok(Outcome {
        evaluator: judge.name.clone(),
        num_unseen_captions: captions.iter().filter(|words| !seen.contains(*words)).count(),
        captions: of_motions(&|place| described[place].caption.clone())?,
        most_frequent: of_motions(&|_| most_frequent.clone())?,
        nearest: of_motions(&|place| described[place].nearest.clone())?,
        read_back: Corpus::new(back.collect())?,
        described,
        performed,
        pair_distances: [
            pair_distance(&of_captions, &of_made, &judge.name).clustered(&clusters),
            pair_distance(&of_captions, &of_recorded, &judge.name).clustered(&clusters),
        ],
        clusters,
        retrievals,
        sets,
        motions: made,
        latents: [of_captions, of_recorded, of_made],
    })
}

/// A caption with all the captions people gave the motion, as they wrote them: capitals and marks are not cut away, though a
/// model may write neither.
fn segment(set: &PreparedSet, motion: usize, hypothesis: String) -> Segment {
    let references = set.captions.iter().filter(|caption| caption.motion == Some(motion));
    Segment {
        id: set.motions[motion].id.clone(),
        hypothesis,
        references: references.map(|caption| caption.text.clone()).collect(),
    }
}

fn pose(
    set: &PreparedSet,
    motion: usize,
    frames: &[[f32; NUM_CHANNELS]],
    humanoid: &Humanoid,
) -> Result<Poses, ScoreError> {
    in_heading_frame(humanoid, &set.normalizer, set.rate_hz, frames)
        .map_err(|error| ScoreError::Poses { id: set.motions[motion].id.clone(), error })
}

/// Poses of all motions of the pairs and of the training pairs.
fn recorded_poses(
    set: &PreparedSet,
    pairs: &[Pair],
    humanoid: &Humanoid,
) -> Result<BTreeMap<usize, Poses>, ScoreError> {
    let motions: BTreeSet<usize> = pairs.iter().chain(&set.paired).map(|pair| pair.motion).collect();
    motions
        .into_iter()
        .map(|motion| Ok((motion, pose(set, motion, &set.motions[motion].frames, humanoid)?)))
        .collect()
}

fn describe_all(
    bundle: &Bundle,
    set: &PreparedSet,
    motions: &[usize],
    poses: &BTreeMap<usize, Poses>,
    decoding: &Search,
) -> Vec<Described> {
    let frames: Vec<Vec<[f32; NUM_CHANNELS]>> =
        motions.iter().map(|&motion| set.motions[motion].frames.clone()).collect();
    // A bundle may have been trained on another set with the same words.
    let frames = Evaluator { bundle, name: String::new() }.renormalized(&frames, &set.normalizer);
    let captions = describe_by(bundle, &frames, decoding);
    let nearest = nearest_in_pose_space(set, poses, motions);
    let rows = motions.iter().zip(captions.into_iter().zip(nearest));
    rows.map(|(&motion, (caption, nearest))| Described {
        id: set.motions[motion].id.clone(),
        caption,
        nearest,
    })
    .collect()
}

/// Motions of captions, normalised by the set.
fn perform(bundle: &Bundle, set: &PreparedSet, captions: &[&[u32]]) -> Vec<Vec<[f32; NUM_CHANNELS]>> {
    let mut made = Vec::new();
    for captions in captions.chunks(BATCH) {
        let latent = bundle.encode_captions(captions);
        made.extend(bundle.decode_motions(&latent, None, &MotionLength::Predicted));
    }
    if bundle.normalizer != set.normalizer {
        for frame in made.iter_mut().flatten() {
            *frame = set.normalizer.normalize(&bundle.normalizer.denormalize(frame));
        }
    }
    made
}

#[cfg(test)]
pub(super) mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::experiments::poses::humanoid;
    use crate::features::CaptionFeatures;
    use crate::model::Rprae;
    use crate::model::tests::tiny;
    use crate::training::tests::four_pairs;

    /// An untrained model on four pairs.
    pub(in crate::experiments) fn outcome() -> Outcome {
        let set = four_pairs();
        let bundle = Bundle::new(&Rprae::new(&tiny(), &set.vocabulary, 1, &Device::flex()), &tiny(), &set);
        score(&bundle, &Evaluator::new(&bundle), &set, &set.paired, &humanoid().unwrap(), &Search::default())
            .unwrap()
    }

    #[test]
    fn every_pair_is_scored_in_both_directions() {
        let found = outcome();
        assert_eq!((found.described.len(), found.performed.len(), found.read_back.len()), (4, 4, 4));
        // What was learned from is its own nearest neighbour in pose space.
        let set = four_pairs();
        for (place, one) in found.described.iter().enumerate() {
            let words = &set.captions[place].words;
            assert_eq!(one.nearest.split(' ').count(), words.len() - 2, "{one:?}");
        }
        for (one, motion) in found.performed.iter().zip(&found.motions) {
            assert_eq!(one.frames, motion.len());
            assert!(
                one.pose.pose_mm.is_finite() && one.rank.wrong == 3 && one.pose_rank.wrong == 3,
                "{one:?}"
            );
        }
        assert_eq!(found.sets.len(), 3);
        assert!(found.evaluator.starts_with("rae-") && found.evaluator.len() == 16);
        assert_eq!(outcome().evaluator, found.evaluator, "equal weights have equal names");
    }

    #[test]
    fn a_recording_counts_once_however_many_captions_it_has() {
        let mut set = four_pairs();
        let bundle = Bundle::new(&Rprae::new(&tiny(), &set.vocabulary, 1, &Device::flex()), &tiny(), &set);
        // The first motion gets the caption of every other one too.
        for place in 1..4 {
            let caption = CaptionFeatures { motion: Some(0), ..set.captions[place].clone() };
            set.paired.push(Pair { motion: 0, caption: set.captions.len() });
            set.captions.push(caption);
        }
        let humanoid = humanoid().unwrap();
        let many = score(&bundle, &Evaluator::new(&bundle), &set, &set.paired, &humanoid, &Search::default())
            .unwrap();
        let once = outcome();
        assert_eq!((many.performed.len(), many.described.len(), many.clusters.len()), (7, 4, 4));
        assert_eq!(many.num_unseen_captions, 0, "they are the ones learned from");
        let mut apart = set.clone();
        let test = apart.paired.split_off(2);
        let apart =
            score(&bundle, &Evaluator::new(&bundle), &apart, &test, &humanoid, &Search::default()).unwrap();
        // Of the five, the first motion's copy of the second caption was learned from.
        assert_eq!(apart.num_unseen_captions, 4);
        let recorded = |found: &Outcome| (found.sets[2].value, found.sets[2].signature.clone());
        assert_eq!(recorded(&many), recorded(&once));
        assert!(recorded(&once).1.as_str().contains("|n:4|"), "{}", recorded(&once).1);
        assert!(many.sets[0].signature.as_str().contains("|n:7|recorded:4|"), "{}", many.sets[0].signature);
        let measured = many.pose_measurements();
        assert!(measured.iter().chain(&many.pair_distances).all(|found| found.clusters == many.clusters));
        assert!(many.retrievals.iter().all(|found| found.clusters == many.clusters));
    }

    #[test]
    fn a_motion_of_one_frame_is_named() {
        let mut set = four_pairs();
        let bundle = Bundle::new(&Rprae::new(&tiny(), &set.vocabulary, 1, &Device::flex()), &tiny(), &set);
        set.motions[2].frames.truncate(1);
        let humanoid = humanoid().unwrap();
        let scored = |pairs: &[Pair]| {
            score(&bundle, &Evaluator::new(&bundle), &set, pairs, &humanoid, &Search::default())
        };
        let error = scored(&set.paired).unwrap_err().to_string();
        assert!(error.contains(&set.motions[2].id) && error.contains("single frame"), "{error}");
        // Beside the ones that are scored, it may well be.
        assert_eq!(scored(&set.paired[..2]).unwrap().performed.len(), 2);
    }

    #[test]
    fn models_of_other_words_are_refused() {
        let set = four_pairs();
        let bundle = |set: &PreparedSet| {
            Bundle::new(&Rprae::new(&tiny(), &set.vocabulary, 1, &Device::flex()), &tiny(), set)
        };
        let mut other = set.clone();
        other.vocabulary.words[2] = "else".to_owned();
        let (ours, theirs) = (bundle(&set), bundle(&other));
        let humanoid = humanoid().unwrap();
        let error = score(&ours, &Evaluator::new(&theirs), &set, &set.paired, &humanoid, &Search::default())
            .unwrap_err();
        assert!(matches!(error, ScoreError::Evaluator(EvaluatorError::OtherWords)), "{error}");
        let error = score(&ours, &Evaluator::new(&ours), &other, &set.paired, &humanoid, &Search::default())
            .unwrap_err();
        assert!(matches!(error, ScoreError::OtherWords), "{error}");
        let slower = PreparedSet { rate_hz: 0.5 * set.rate_hz, ..set.clone() };
        let error =
            score(&ours, &Evaluator::new(&ours), &slower, &slower.paired, &humanoid, &Search::default())
                .unwrap_err();
        assert!(matches!(error, ScoreError::OtherMotions), "{error}");
    }
}
