//! From what was gathered to a prepared set: which captions stay, which part each motion belongs to, what is drawn.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::gather::{Gathered, GatheredMotion};
use super::settings::PrepareSettings;
use super::{Corpus, PrepareError, Selection, Step};
use crate::dataset::{Coverage, WordVectors};
use crate::features::split::{order_key, split_by_files, split_by_seed};
use crate::features::{
    BOS, CaptionFeatures, EOS, MotionFeatures, Normalizer, Pair, PreparedSet, Split, Vocabulary,
};
use crate::motion::NUM_CHANNELS;

/// Names of the two ends of a sentence; no caption can hold them, since `<` is a word of its own.
const ENDS: [&str; 2] = ["<bos>", "<eos>"];

/// Numbers in a vector where no file of vectors says it; that of the paper.
const DEFAULT_DIMENSIONS: usize = 300;

/// A caption with its words.
struct Words {
    text: String,
    words: Vec<String>,
}

pub(super) struct Selected {
    pub set: PreparedSet,
    pub selection: Selection,
    pub corpus: Corpus,
    pub coverage: Option<Coverage>,
    pub vector_warnings: Vec<String>,
}

pub(super) fn select(
    settings: &PrepareSettings,
    gathered: Gathered,
    progress: &(dyn Fn(Step<'_>) + Sync),
) -> Result<Selected, PrepareError> {
    let tokenize = |text: String| Words { words: settings.tokens.tokenize(&text), text };
    let mut captions_of: Vec<Vec<Words>> = Vec::new();
    let mut motions = gathered.motions;
    for motion in &mut motions {
        captions_of.push(std::mem::take(&mut motion.captions).into_iter().map(tokenize).collect());
    }
    let mut loose: Vec<Words> = gathered.loose_captions.into_iter().map(tokenize).collect();
    let all = || captions_of.iter().flatten().chain(&loose);
    let corpus = Corpus::of(all().map(|caption| caption.words.as_slice()));

    let mut occurrences: BTreeMap<String, usize> = BTreeMap::new();
    for word in all().flat_map(|caption| &caption.words) {
        *occurrences.entry(word.clone()).or_default() += 1;
    }
    let vectors = match &settings.vectors {
        Some(path) => {
            let wanted: BTreeSet<String> = occurrences.keys().cloned().collect();
            Some(WordVectors::read(path, &wanted, &|share| progress(Step::Vectors { share }))?)
        }
        None => None,
    };
    let coverage = vectors.as_ref().map(|vectors| vectors.coverage(&occurrences));

    // Which captions stay.
    let mut selection = Selection::default();
    let is_kept = |caption: &Words| -> bool {
        !caption.words.is_empty()
            && caption.words.iter().all(|word| occurrences[word] >= settings.min_word_count)
            && (settings.keep_all_captions
                || vectors.as_ref().is_none_or(|vectors| {
                    caption
                        .words
                        .iter()
                        .all(|word| vectors.vectors.contains_key(word) || is_special(settings, word))
                }))
    };
    let mut dropped = 0;
    for captions in captions_of.iter_mut().chain([&mut loose]) {
        let before = captions.len();
        captions.retain(|caption| is_kept(caption));
        dropped += before - captions.len();
    }
    selection.num_captions_dropped = dropped;
    if !settings.extras {
        loose.clear();
    }

    // Which motions belong where.
    let paired_ids: Vec<&str> = motions
        .iter()
        .zip(&captions_of)
        .filter(|(_, captions)| !captions.is_empty())
        .map(|(motion, _)| motion.id.as_str())
        .collect();
    let all_ids: Vec<&str> = motions.iter().map(|motion| motion.id.as_str()).collect();
    let splits = splits(settings, &paired_ids, &all_ids, &mut selection)?;
    let mut kept: Vec<(GatheredMotion, Split, Vec<Words>)> = Vec::new();
    for (motion, captions) in motions.into_iter().zip(captions_of) {
        let (split, is_extra) = (splits.get(motion.id.as_str()).copied(), captions.is_empty());
        match split {
            _ if is_extra && !settings.extras => selection.num_motions_left_out += 1,
            None if !is_extra => selection.num_motions_in_no_list += 1,
            // A motion without captions is learned from, unless a list keeps it for later.
            _ => {
                let split = split.unwrap_or(Split::Train);
                selection.num_motions_extra += usize::from(is_extra && split == Split::Train);
                kept.push((motion, split, captions));
            }
        }
    }
    selection.num_captions_extra = loose.len();

    let kept_captions = kept.iter().flat_map(|(_, _, captions)| captions).chain(&loose);
    selection.subset = Corpus::of(kept_captions.clone().map(|caption| caption.words.as_slice()));
    let vocabulary = vocabulary(kept_captions.flat_map(|caption| &caption.words), vectors.as_ref());
    let normalizer = normalizer(
        kept.iter().filter(|(_, split, _)| *split == Split::Train).flat_map(|(motion, ..)| &motion.frames),
    );
    let set = assemble(settings, kept, loose, vocabulary, normalizer, &mut selection)?;
    let vector_warnings = vectors.map(|vectors| vectors.warnings).unwrap_or_default();
    Ok(Selected { set, selection, corpus, coverage, vector_warnings })
}

/// Whether a word may be without a pretrained vector.
fn is_special(settings: &PrepareSettings, word: &str) -> bool {
    let is_mark = !word.contains(char::is_alphabetic) || word.starts_with(|c: char| c.is_ascii_digit());
    settings.special_words.iter().any(|special| special == word) || (settings.special_marks && is_mark)
}

fn splits(
    settings: &PrepareSettings,
    paired_ids: &[&str],
    all_ids: &[&str],
    selection: &mut Selection,
) -> Result<BTreeMap<String, Split>, PrepareError> {
    let lists = [
        (Split::Train, &settings.split.train),
        (Split::Validation, &settings.split.validation),
        (Split::Test, &settings.split.test),
    ];
    let lists: Vec<(Split, PathBuf)> =
        lists.into_iter().filter_map(|(split, path)| Some((split, path.clone()?))).collect();
    if lists.is_empty() {
        let splits = split_by_seed(paired_ids, settings.seed);
        return Ok(splits.into_iter().map(|(id, split)| (id.to_owned(), split)).collect());
    }
    let mut listed = split_by_files(&lists)?;
    let known: BTreeSet<&str> = all_ids.iter().copied().collect();
    let num_listed = listed.len();
    listed.retain(|id, _| known.contains(id.as_str()));
    selection.num_listed_absent = num_listed - listed.len();
    Ok(listed)
}

fn vocabulary<'w>(words: impl Iterator<Item = &'w String>, vectors: Option<&WordVectors>) -> Vocabulary {
    let known: BTreeSet<&String> = words.collect();
    let words: Vec<String> =
        ENDS.iter().map(|end| (*end).to_owned()).chain(known.into_iter().cloned()).collect();
    let found = words.iter().map(|word| vectors.and_then(|vectors| vectors.vectors.get(word)).cloned());
    let found = found.collect();
    let dimensions = vectors.map_or(DEFAULT_DIMENSIONS, |vectors| vectors.dimensions);
    Vocabulary { words, dimensions, vectors: found }
}

/// Range of each channel; zero to zero where there is no frame.
fn normalizer<'f>(frames: impl Iterator<Item = &'f [f64; NUM_CHANNELS]>) -> Normalizer {
    let mut ranges: Option<([f64; NUM_CHANNELS], [f64; NUM_CHANNELS])> = None;
    for frame in frames {
        let (low, high) = ranges.get_or_insert((*frame, *frame));
        for channel in 0..NUM_CHANNELS {
            low[channel] = low[channel].min(frame[channel]);
            high[channel] = high[channel].max(frame[channel]);
        }
    }
    let (low, high) = ranges.unwrap_or(([0.0; NUM_CHANNELS], [0.0; NUM_CHANNELS]));
    Normalizer { minimum: low.to_vec(), maximum: high.to_vec() }
}

fn assemble(
    settings: &PrepareSettings,
    kept: Vec<(GatheredMotion, Split, Vec<Words>)>,
    loose: Vec<Words>,
    vocabulary: Vocabulary,
    normalizer: Normalizer,
    selection: &mut Selection,
) -> Result<PreparedSet, PrepareError> {
    let numbered = |caption: Words, motion: Option<usize>, split: Split| CaptionFeatures {
        words: [BOS]
            .into_iter()
            // Every word of a kept caption is in the vocabulary, which was made of them.
            .chain(caption.words.iter().filter_map(|word| vocabulary.index(word)))
            .chain([EOS])
            .collect(),
        text: caption.text,
        motion,
        split,
    };
    let (mut motions, mut captions) = (Vec::new(), Vec::new());
    let mut pairs: BTreeMap<Split, Vec<Pair>> = BTreeMap::new();
    let mut keys: Vec<([u8; 32], Pair)> = Vec::new();
    let mut extra_motions = Vec::new();
    for (motion, split, described) in kept {
        let place = motions.len();
        let counts = selection.division.entry(split).or_default();
        if !described.is_empty() {
            counts.num_motions += 1;
            counts.num_captions += described.len();
        } else if split == Split::Train {
            extra_motions.push(place);
        }
        for (number, caption) in described.into_iter().enumerate() {
            let pair = Pair { motion: place, caption: captions.len() };
            pairs.entry(split).or_default().push(pair);
            if split == Split::Train {
                keys.push((order_key(settings.seed, "pairs", &format!("{} {number}", motion.id)), pair));
            }
            captions.push(numbered(caption, Some(place), split));
        }
        let frames = motion.frames.iter().map(|frame| normalizer.normalize(frame)).collect();
        motions.push(MotionFeatures { id: motion.id, split, frames });
    }
    let extra_captions = captions.len()..captions.len() + loose.len();
    captions.extend(loose.into_iter().map(|caption| numbered(caption, None, Split::Train)));

    // One order for both draws, so that the paired set is part of the non-paired one and larger sets contain smaller ones.
    keys.sort();
    let num_non_paired = amount("non_paired", settings.non_paired, keys.len())?;
    let num_paired = amount("paired", settings.paired, num_non_paired)?;
    let drawn = |count: usize| {
        let mut drawn: Vec<Pair> = keys[..count].iter().map(|(_, pair)| *pair).collect();
        drawn.sort();
        drawn
    };
    let non_paired = drawn(num_non_paired);
    let mut take = |split| pairs.remove(&split).unwrap_or_default();
    Ok(PreparedSet {
        rate_hz: settings.rate_hz,
        root: settings.root,
        normalizer,
        vocabulary,
        non_paired_motions: non_paired.iter().map(|pair| pair.motion).chain(extra_motions).collect(),
        non_paired_captions: non_paired.iter().map(|pair| pair.caption).chain(extra_captions).collect(),
        paired: drawn(num_paired),
        validation: take(Split::Validation),
        test: take(Split::Test),
        motions,
        captions,
        fingerprint: String::new(),
    }
    .with_fingerprint())
}

fn amount(name: &'static str, asked: Option<usize>, available: usize) -> Result<usize, PrepareError> {
    match asked {
        Some(asked) if asked > available => Err(PrepareError::Amount { name, asked, available }),
        Some(asked) => Ok(asked),
        None => Ok(available),
    }
}

impl Corpus {
    fn of<'c>(captions: impl Iterator<Item = &'c [String]>) -> Self {
        let (mut corpus, mut words) = (Self::default(), BTreeSet::new());
        let mut shortest = usize::MAX;
        for caption in captions {
            corpus.num_captions += 1;
            shortest = shortest.min(caption.len() + 2);
            corpus.longest = corpus.longest.max(caption.len() + 2);
            words.extend(caption);
        }
        corpus.num_words = words.len() + 2;
        corpus.shortest = if shortest == usize::MAX { 0 } else { shortest };
        corpus
    }
}
