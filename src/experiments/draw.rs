//! The data of one model of a grid.
//!
//! Draws sort by a checksum of seed, purpose and what is drawn, so smaller draws are part of larger ones, and neither the
//! order of files nor the number of threads changes them.

use std::collections::{BTreeMap, BTreeSet};

use super::amounts::Amount;
use super::grid::Cell;
use crate::features::{MotionFeatures, Normalizer, Pair, PreparedSet, Split};
use crate::manifest::sha256_hex;
use crate::motion::NUM_CHANNELS;
use crate::training::Plan;

/// Why a model has no data.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum DrawError {
    /// Fewer motions with captions than parts of the cross-validation.
    #[error("cross-validate: {found} motions have captions, which is too few for {folds} parts")]
    TooFewMotions {
        /// Motions with captions.
        found: usize,
        /// Parts.
        folds: usize,
    },
    /// More pairs asked for than there are.
    #[error("draw {asked} pairs: there are {found} to learn from; ask for fewer, or for \"all\"")]
    TooFewPairs {
        /// Pairs asked for.
        asked: Amount,
        /// Pairs to learn from.
        found: usize,
    },
    /// More non-paired samples asked for than there are.
    #[error(
        "draw {asked} non-paired samples: there are {captions} captions and {motions} motions to learn from; ask for fewer"
    )]
    TooFewSamples {
        /// Samples of each kind asked for.
        asked: usize,
        /// Captions there are.
        captions: usize,
        /// Motions there are.
        motions: usize,
    },
    /// Pairs are among the non-paired samples, which these cannot hold.
    #[error("draw {asked} non-paired samples: the {pairs} pairs are among them; ask for as many at least")]
    FewerThanPairs {
        /// Samples of each kind asked for.
        asked: usize,
        /// Pairs drawn.
        pairs: usize,
    },
    /// A set that was prepared with a part of its pairs, which says nothing of the others.
    #[error(
        "cross-validate: {left_out} captions of motions are in no pair of the prepared set; prepare it without paired and \
         non_paired, for the grid draws its amounts itself"
    )]
    LimitedPairs {
        /// Captions whose pair is missing.
        left_out: usize,
    },
    /// A split without pairs.
    #[error("use the prepared set: its {split:?} split has no pairs; prepare it anew, or set folds")]
    NoPairs {
        /// The split.
        split: Split,
    },
}

/// The data of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// What it is trained, watched and scored on.
    pub set: PreparedSet,
    /// Samples that an epoch of stage 1 goes through; without stage 1 those of the model with all non-paired samples, which
    /// has as many updates.
    pub stage1_samples: usize,
    /// The same with mirror images.
    pub mirrored_stage1_samples: usize,
}

/// The set of a cell: the part that is scored is its test split, and its pairs and non-paired samples are drawn.
///
/// With folds, the range of every channel is that of the new training split, and one copy of each caption of a motion that
/// is watched or scored is taken out of the captions without motions, where it may have come along.
///
/// # Errors
/// [`DrawError`] when there is too little data; no amount is cut to what there is. Only where one kind of non-paired samples
/// is short, all of it is taken.
pub fn draw(full: &PreparedSet, cell: &Cell, folds: usize) -> Result<Drawn, DrawError> {
    let mut set = if folds == 0 { full.clone() } else { fold(full, cell.fold, folds)? };
    for (split, pairs) in
        [(Split::Train, &set.paired), (Split::Validation, &set.validation), (Split::Test, &set.test)]
    {
        if pairs.is_empty() {
            return Err(DrawError::NoPairs { split });
        }
    }
    let seed = cell.seed;
    set.paired.sort_by_cached_key(|pair| pair_key(full, seed, *pair));
    let found = set.paired.len();
    match cell.paired.of(found) {
        Some(num_pairs) => set.paired.truncate(num_pairs),
        None => return Err(DrawError::TooFewPairs { asked: cell.paired, found }),
    }
    let samples = |set: &PreparedSet| [false, true].map(|mirror| Plan::stage1_samples(set, mirror));
    let mut stage1_samples = samples(&set);
    match cell.non_paired {
        None => {
            set.non_paired_motions.clear();
            set.non_paired_captions.clear();
        }
        Some(Amount::All) => {}
        Some(Amount::Some(amount)) => {
            let (captions, motions) = (set.non_paired_captions.len(), set.non_paired_motions.len());
            if amount > stage1_samples[0] {
                return Err(DrawError::TooFewSamples { asked: amount, captions, motions });
            }
            if amount < set.paired.len() {
                return Err(DrawError::FewerThanPairs { asked: amount, pairs: set.paired.len() });
            }
            // The pairs are drawn from the non-paired samples (Algorithm 1), so theirs come first.
            let chosen_motions: Vec<usize> = set.paired.iter().map(|pair| pair.motion).collect();
            let chosen_captions: Vec<usize> = set.paired.iter().map(|pair| pair.caption).collect();
            set.non_paired_motions = first(&set.non_paired_motions, &chosen_motions, amount, |place| {
                key(seed, "motion", &full.motions[place].id)
            });
            set.non_paired_captions = first(&set.non_paired_captions, &chosen_captions, amount, |place| {
                key(seed, "caption", &format!("{place} {}", full.captions[place].text))
            });
            stage1_samples = samples(&set);
        }
    }
    set.paired.sort_unstable();
    let [stage1_samples, mirrored_stage1_samples] = stage1_samples;
    Ok(Drawn { set: set.with_fingerprint(), stage1_samples, mirrored_stage1_samples })
}

fn key(seed: u64, purpose: &str, what: &str) -> String {
    sha256_hex(format!("{seed} {purpose} {what}").as_bytes())
}

fn pair_key(set: &PreparedSet, seed: u64, pair: Pair) -> String {
    key(seed, "pair", &format!("{} {}", set.motions[pair.motion].id, set.captions[pair.caption].text))
}

/// At most `amount` of some places: the chosen ones first, the others in random order; sorted at the end.
fn first(places: &[usize], chosen: &[usize], amount: usize, order: impl Fn(usize) -> String) -> Vec<usize> {
    if amount >= places.len() {
        return places.to_vec();
    }
    let mut waiting: BTreeMap<usize, usize> = BTreeMap::new();
    for &place in chosen {
        *waiting.entry(place).or_default() += 1;
    }
    // Each chosen sample once for each time it is in a pair; the same place again counts as another sample.
    let mut keyed: Vec<(bool, String, usize, usize)> = places
        .iter()
        .enumerate()
        .map(|(copy, &place)| {
            let left = waiting.get_mut(&place).filter(|left| **left > 0);
            let is_chosen = left.map(|left| *left -= 1).is_some();
            (!is_chosen, order(place), copy, place)
        })
        .collect();
    keyed.sort_unstable();
    let mut kept: Vec<usize> = keyed.into_iter().take(amount).map(|(.., place)| place).collect();
    kept.sort_unstable();
    kept
}

/// The set with one of some parts as its test split, the next as its validation split, and the rest to learn from.
fn fold(full: &PreparedSet, fold: usize, folds: usize) -> Result<PreparedSet, DrawError> {
    let pairs: Vec<Pair> = full.paired.iter().chain(&full.validation).chain(&full.test).copied().collect();
    let paired: BTreeSet<usize> = pairs.iter().map(|pair| pair.caption).collect();
    let of_motions = full.captions.iter().enumerate().filter(|(_, caption)| caption.motion.is_some());
    let left_out = of_motions.filter(|(place, _)| !paired.contains(place)).count();
    if left_out > 0 {
        return Err(DrawError::LimitedPairs { left_out });
    }
    let with_captions: BTreeSet<usize> = pairs.iter().map(|pair| pair.motion).collect();
    if with_captions.len() < 2 * folds {
        return Err(DrawError::TooFewMotions { found: with_captions.len(), folds });
    }
    let mut order: Vec<usize> = with_captions.iter().copied().collect();
    // The parts are the same for every seed: seeds differ in what is learned, not in what is asked.
    order.sort_by_cached_key(|&motion| key(0, "fold", &full.motions[motion].id));
    let mut splits = vec![Split::Train; full.motions.len()];
    for (place, motion) in order.into_iter().enumerate() {
        splits[motion] = match (place % folds + folds - fold) % folds {
            0 => Split::Test,
            1 => Split::Validation,
            _ => Split::Train,
        };
    }
    let mut set = full.clone();
    let normalizer = refit(full, &splits);
    for (motion, split) in set.motions.iter_mut().zip(&splits) {
        motion.split = *split;
        for frame in &mut motion.frames {
            *frame = normalizer.normalize(&full.normalizer.denormalize(frame));
        }
    }
    set.normalizer = normalizer;
    for caption in &mut set.captions {
        caption.split = caption.motion.map_or(Split::Train, |motion| splits[motion]);
    }
    let of = |split: Split| -> Vec<Pair> {
        pairs.iter().filter(|pair| splits[pair.motion] == split).copied().collect()
    };
    (set.paired, set.validation, set.test) = (of(Split::Train), of(Split::Validation), of(Split::Test));
    let extra_motions = full.non_paired_motions.iter().filter(|place| !with_captions.contains(place));
    set.non_paired_motions =
        set.paired.iter().map(|pair| pair.motion).chain(extra_motions.copied()).collect();
    let mut held_out: BTreeMap<&[u32], usize> = BTreeMap::new();
    for pair in set.validation.iter().chain(&set.test) {
        *held_out.entry(&full.captions[pair.caption].words).or_default() += 1;
    }
    let extra_captions = full.non_paired_captions.iter().copied().filter(|&place| {
        let caption = &full.captions[place];
        if caption.motion.is_some() {
            return false;
        }
        match held_out.get_mut(caption.words.as_slice()) {
            Some(left) if *left > 0 => {
                *left -= 1;
                false
            }
            _ => true,
        }
    });
    let own = set.paired.iter().map(|pair| pair.caption);
    set.non_paired_captions = own.chain(extra_captions).collect();
    set.non_paired_motions.sort_unstable();
    set.non_paired_captions.sort_unstable();
    Ok(set)
}

/// Range of every channel over the motions to learn from.
fn refit(full: &PreparedSet, splits: &[Split]) -> Normalizer {
    let mut normalizer = Normalizer {
        minimum: vec![f64::INFINITY; NUM_CHANNELS],
        maximum: vec![f64::NEG_INFINITY; NUM_CHANNELS],
    };
    let learned = |(_, split): &(&MotionFeatures, &Split)| **split == Split::Train;
    for (motion, _) in full.motions.iter().zip(splits).filter(learned) {
        for frame in &motion.frames {
            for (channel, value) in full.normalizer.denormalize(frame).into_iter().enumerate() {
                normalizer.minimum[channel] = normalizer.minimum[channel].min(value);
                normalizer.maximum[channel] = normalizer.maximum[channel].max(value);
            }
        }
    }
    normalizer
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::experiments::grid::Role;
    use crate::features::{CaptionFeatures, Root, Vocabulary};

    /// Twelve motions with a caption each, two without, three captions without motions; the first repeats that of motion 0.
    pub(in crate::experiments) fn full() -> PreparedSet {
        let motion = |index: usize| MotionFeatures {
            id: format!("m{index:02}"),
            split: Split::Train,
            frames: vec![[index as f32 / 20.0; NUM_CHANNELS]; 3],
        };
        let caption = |index: usize, of: Option<usize>| CaptionFeatures {
            words: vec![0, 2 + index as u32 % 12, 1],
            text: format!("w{index:02}"),
            motion: of,
            split: Split::Train,
        };
        let pairs: Vec<Pair> = (0..12).map(|index| Pair { motion: index, caption: index }).collect();
        PreparedSet {
            rate_hz: 10.0,
            normalizer: Normalizer { minimum: vec![-1.0; NUM_CHANNELS], maximum: vec![1.0; NUM_CHANNELS] },
            vocabulary: Vocabulary { words: Vec::new(), dimensions: 1, vectors: Vec::new() },
            motions: (0..14).map(motion).collect(),
            captions: (0..15).map(|index| caption(index, (index < 12).then_some(index))).collect(),
            non_paired_motions: (0..14).collect(),
            non_paired_captions: (0..15).collect(),
            paired: pairs[..10].to_vec(),
            validation: pairs[10..11].to_vec(),
            test: pairs[11..].to_vec(),
            fingerprint: String::new(),
            root: Root::default(),
        }
    }

    fn cell(paired: Amount, non_paired: Option<Amount>, fold: usize) -> Cell {
        Cell { paired, role: Role::Proposed, non_paired, seed: 1, fold }
    }

    #[test]
    fn every_motion_is_scored_once_and_never_learned_then() {
        let mut scored = Vec::new();
        for fold in 0..4 {
            let set = draw(&full(), &cell(Amount::All, Some(Amount::All), fold), 4).unwrap().set;
            assert_eq!((set.test.len(), set.validation.len(), set.paired.len()), (3, 3, 6));
            let held_out: Vec<usize> =
                set.test.iter().chain(&set.validation).map(|pair| pair.motion).collect();
            assert!(set.non_paired_motions.iter().all(|motion| !held_out.contains(motion)));
            assert_eq!(set.non_paired_motions.len(), 6 + 2);
            // The copies of held-out captions are gone from those without motions.
            let words: Vec<Vec<u32>> =
                held_out.iter().map(|&motion| set.captions[motion].words.clone()).collect();
            assert!(set.non_paired_captions.iter().all(|&place| !words.contains(&set.captions[place].words)));
            scored.extend(set.test.iter().map(|pair| pair.motion));
        }
        scored.sort_unstable();
        assert_eq!(scored, (0..12).collect::<Vec<_>>());
    }

    #[test]
    fn ranges_are_those_of_what_is_learned() {
        let set = draw(&full(), &cell(Amount::All, None, 1), 4).unwrap().set;
        let learned = set.motions.iter().filter(|motion| motion.split == Split::Train);
        let ends = learned
            .flat_map(|motion| &motion.frames)
            .fold((1.0_f32, -1.0_f32), |ends, frame| (ends.0.min(frame[7]), ends.1.max(frame[7])));
        assert!((ends.0 + 0.9).abs() < 1e-6 && (ends.1 - 0.9).abs() < 1e-6, "{ends:?}");
        // What is held out has kept its place in metres and radians.
        let full = full();
        for (ours, before) in set.motions.iter().zip(&full.motions) {
            let (ours, before) =
                (set.normalizer.denormalize(&ours.frames[0]), full.normalizer.denormalize(&before.frames[0]));
            assert!((ours[3] - before[3]).abs() < 1e-6);
        }
    }

    #[test]
    fn small_draws_are_part_of_large_ones() {
        let pairs = |amount| draw(&full(), &cell(Amount::Some(amount), None, 0), 4).unwrap().set.paired;
        let (small, large) = (pairs(2), pairs(5));
        assert_eq!((small.len(), large.len()), (2, 5));
        assert!(small.iter().all(|pair| large.contains(pair)));
        let set = draw(&full(), &cell(Amount::Some(2), Some(Amount::Some(3)), 0), 4).unwrap().set;
        assert_eq!((set.non_paired_motions.len(), set.non_paired_captions.len()), (3, 3));
        assert!(set.paired.iter().all(|pair| set.non_paired_motions.contains(&pair.motion)));
        assert!(set.paired.iter().all(|pair| set.non_paired_captions.contains(&pair.caption)));
    }

    #[test]
    fn too_little_is_refused() {
        let error = draw(&full(), &cell(Amount::All, None, 0), 7).unwrap_err();
        assert_eq!(error, DrawError::TooFewMotions { found: 12, folds: 7 });
        // Of six pairs, eight motions and eight captions of a part nothing is cut silently.
        let refused = |paired, non_paired| draw(&full(), &cell(paired, non_paired, 0), 4).unwrap_err();
        let error = refused(Amount::Some(7), None);
        assert_eq!(error, DrawError::TooFewPairs { asked: Amount::Some(7), found: 6 });
        let captions = draw(&full(), &cell(Amount::All, Some(Amount::All), 0), 4).unwrap();
        let captions = captions.set.non_paired_captions.len();
        let error = refused(Amount::All, Some(Amount::Some(10)));
        assert_eq!(error, DrawError::TooFewSamples { asked: 10, captions, motions: 8 });
        let error = refused(Amount::Some(4), Some(Amount::Some(3)));
        assert_eq!(error, DrawError::FewerThanPairs { asked: 3, pairs: 4 });
        // One kind may be short, which the set then shows.
        let mut few = full();
        few.non_paired_motions.truncate(12);
        let set = draw(&few, &cell(Amount::Some(2), Some(Amount::Some(captions)), 0), 4).unwrap().set;
        assert_eq!((set.non_paired_motions.len(), set.non_paired_captions.len()), (6, captions));
        // Of the motions left out of the draw nobody knows whether they are held out.
        let mut limited = full();
        limited.paired.truncate(4);
        let error = draw(&limited, &cell(Amount::All, None, 0), 4).unwrap_err();
        assert_eq!(error, DrawError::LimitedPairs { left_out: 6 });
        draw(&limited, &cell(Amount::All, None, 0), 0).unwrap();
        let mut empty = full();
        empty.test.clear();
        let error = draw(&empty, &cell(Amount::All, None, 0), 0).unwrap_err();
        assert_eq!(error, DrawError::NoPairs { split: Split::Test });
    }
}
