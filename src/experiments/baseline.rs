//! Captions without a model: what a trained one must beat.

use std::collections::BTreeMap;

use super::evaluator::sentence;
use crate::evaluation::motion::Poses;
use crate::features::PreparedSet;

/// Moments of a motion that pose space compares.
pub const MOMENTS: usize = 16;

/// The caption that most pairs of the training split have; of equally frequent ones the first by its words.
#[must_use]
pub fn most_frequent_caption(set: &PreparedSet) -> String {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for pair in &set.paired {
        *counts.entry(sentence(&set.vocabulary.words, &set.captions[pair.caption].words)).or_default() += 1;
    }
    let best = counts.into_iter().reduce(|best, other| if other.1 > best.1 { other } else { best });
    best.map_or_else(String::new, |(caption, _)| caption)
}

/// For each motion to describe, the caption of the training motion whose poses are nearest over its course
/// ([`Poses::distance_over_course_m`] at [`MOMENTS`] moments); a motion with several captions gives its first.
///
/// `poses` are those of every motion of the set, by place; only motions of the pairs are looked at.
#[must_use]
pub fn nearest_in_pose_space(
    set: &PreparedSet,
    poses: &BTreeMap<usize, Poses>,
    motions: &[usize],
) -> Vec<String> {
    let mut captions: BTreeMap<usize, usize> = BTreeMap::new();
    for pair in &set.paired {
        captions.entry(pair.motion).or_insert(pair.caption);
    }
    let describe = |motion: &usize| {
        let of = poses.get(motion)?;
        let distance =
            |other: usize| poses.get(&other).map(|other| of.distance_over_course_m(other, MOMENTS));
        let known = captions.iter().filter_map(|(&other, &caption)| Some((distance(other)?, caption)));
        let nearest = known.reduce(|best, other| if other.0 < best.0 { other } else { best });
        nearest.map(|(_, caption)| sentence(&set.vocabulary.words, &set.captions[caption].words))
    };
    motions.iter().map(|motion| describe(motion).unwrap_or_default()).collect()
}
