//! From sources to motions at the features' rate and the captions that belong to them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::settings::{MotionSource, PrepareSettings};
use super::{CaptionsFrom, MotionsFrom, PrepareError, Step};
use crate::dataset::{CaptionFile, CaptionRecord, Dataset, OpenOptions, Sample, Skipped};
use crate::motion::{Motion, NUM_CHANNELS};

/// Share of a motion that a caption may leave undescribed and still describe the motion.
const PARTIAL: f64 = 0.05;

/// A motion at the features' rate, in SI units.
pub(super) struct GatheredMotion {
    pub id: String,
    pub frames: Vec<[f64; NUM_CHANNELS]>,
    pub captions: Vec<String>,
}

/// Everything that was read.
#[derive(Default)]
pub(super) struct Gathered {
    /// Sorted by id.
    pub motions: Vec<GatheredMotion>,
    /// Captions whose motion is not there, or that have none, in the order of their sources.
    pub loose_captions: Vec<String>,
    /// Captions without motion that another source has too, left out.
    pub num_captions_shared: usize,
    /// How often a caption occurs.
    occurrences: Occurrences,
    /// Captions left out with a motion that is too short or too long.
    pub num_captions_filtered: usize,
    /// Captions that are already there, word for word, for the same motion.
    pub num_captions_repeated: usize,
    /// Captions of a part of a motion, kept as captions without motion.
    pub num_captions_partial: usize,
    pub motions_from: Vec<MotionsFrom>,
    pub captions_from: Vec<CaptionsFrom>,
    pub skipped: Vec<Skipped>,
    pub warnings: Vec<String>,
}

/// What became of a motion that was asked for.
enum Outcome {
    Kept(GatheredMotion, f64),
    /// Shorter or longer than the settings allow; with its number of captions.
    Filtered {
        short: bool,
        num_captions: usize,
    },
}

/// Motion ids of one source to their places, `None` for those filtered out; with the duration.
type Places = BTreeMap<String, Option<(usize, f64)>>;

/// How a source is opened; the caller may put a cache before it.
pub type Open<'o> = dyn Fn(&MotionSource, &OpenOptions) -> Result<(Dataset, Vec<String>), PrepareError> + 'o;

pub(super) fn gather(
    settings: &PrepareSettings,
    open: &Open<'_>,
    progress: &(dyn Fn(Step<'_>) + Sync),
) -> Result<Gathered, PrepareError> {
    let mut gathered = Gathered::default();
    let names = settings.source_names();
    let mut places_of: Vec<Places> = Vec::new();
    for (source, name) in settings.motions.iter().zip(&names) {
        let prefix = if names.len() > 1 { format!("{name}.") } else { String::new() };
        let places = gathered.take_motions(source, name, &prefix, settings, open, progress)?;
        places_of.push(places);
    }
    for source in &settings.captions {
        gathered.occurrences.begin_source();
        let file = CaptionFile::read(&source.path)?;
        let mut from = CaptionsFrom {
            path: source.path.clone(),
            num_captions: file.num_captions(),
            num_of_motions: 0,
            num_skipped: file.skipped.len(),
        };
        gathered.skipped.extend(file.skipped);
        gathered.warnings.extend(file.warnings.iter().map(|w| format!("{}: {w}", source.path.display())));
        let candidates: Vec<&Places> = names
            .iter()
            .zip(&places_of)
            .filter(|(name, _)| source.motions.as_ref().is_none_or(|wanted| wanted == *name))
            .map(|(_, places)| places)
            .collect();
        for record in file.records {
            from.num_of_motions += gathered.take_record(record, &candidates);
        }
        gathered.captions_from.push(from);
    }
    gathered.unite();
    gathered.sort();
    Ok(gathered)
}

impl Gathered {
    fn take_motions(
        &mut self,
        source: &MotionSource,
        name: &str,
        prefix: &str,
        settings: &PrepareSettings,
        open: &Open<'_>,
        progress: &(dyn Fn(Step<'_>) + Sync),
    ) -> Result<Places, PrepareError> {
        let defaults = OpenOptions::default();
        let options = OpenOptions {
            rate_hz: source.rate_hz,
            height_m: source.height_m.unwrap_or(defaults.height_m),
            ..defaults
        };
        let (dataset, notes) = open(source, &options)?;
        self.warnings.extend(notes);
        let mut from =
            MotionsFrom { name: name.to_owned(), path: source.path.clone(), ..MotionsFrom::default() };
        let (total, done) = (dataset.entries().len(), AtomicUsize::new(0));
        let outcomes: Vec<Result<(Outcome, Vec<String>), Skipped>> = dataset
            .entries()
            .par_iter()
            .map(|entry| {
                let outcome = dataset.load(entry).and_then(|sample| {
                    prepare(sample, prefix, source.without_captions, settings, &entry.source)
                });
                let done = 1 + done.fetch_add(1, Ordering::Relaxed);
                progress(Step::Motions { source: name, done, total });
                outcome
            })
            .collect();

        self.occurrences.begin_source();
        let mut places = Places::new();
        for (entry, outcome) in dataset.entries().iter().zip(outcomes) {
            match outcome {
                Ok((outcome, warnings)) => {
                    self.warnings.extend(warnings.into_iter().map(|w| format!("{prefix}{}: {w}", entry.id)));
                    let place = self.take_outcome(outcome, &mut from);
                    places.insert(entry.id.clone(), place);
                }
                Err(skipped) => self.skipped.push(skipped),
            }
        }
        from.num_skipped = total - places.len() + dataset.skipped().len();
        self.skipped.extend(dataset.skipped().iter().cloned());

        let pieces = dataset.pieces()?;
        from.num_without_captions = pieces.without_captions.len();
        from.num_without_meta = pieces.without_meta.len();
        from.num_captions_without_motion = pieces.without_motion.len();
        if !source.without_captions && !pieces.without_motion.is_empty() {
            let file = CaptionFile::read(&source.path)?;
            for record in file.records {
                if record.motion.as_ref().is_some_and(|id| pieces.without_motion.binary_search(id).is_ok()) {
                    self.take_loose(record.texts);
                }
            }
        }
        self.motions_from.push(from);
        Ok(places)
    }

    fn take_outcome(&mut self, outcome: Outcome, from: &mut MotionsFrom) -> Option<(usize, f64)> {
        match outcome {
            Outcome::Kept(motion, duration_secs) => {
                from.num_kept += 1;
                from.duration_secs += duration_secs;
                for text in &motion.captions {
                    self.occurrences.add(text, true);
                }
                self.motions.push(motion);
                Some((self.motions.len() - 1, duration_secs))
            }
            Outcome::Filtered { short, num_captions } => {
                if short {
                    from.num_short += 1;
                } else {
                    from.num_long += 1;
                }
                self.num_captions_filtered += num_captions;
                None
            }
        }
    }

    /// Returns the number of captions that describe a motion that is there.
    fn take_record(&mut self, record: CaptionRecord, candidates: &[&Places]) -> usize {
        let found = record.motion.as_ref().and_then(|id| candidates.iter().find_map(|places| places.get(id)));
        match found {
            None => self.take_loose(record.texts),
            Some(None) => self.num_captions_filtered += record.texts.len(),
            Some(Some((_, duration_secs))) if is_partial(record.span_secs, *duration_secs) => {
                self.num_captions_partial += record.texts.len();
                self.take_loose(record.texts);
            }
            Some(Some((place, _))) => {
                let num_of_motion = record.texts.len();
                for text in record.texts {
                    let known = &mut self.motions[*place].captions;
                    let is_repeated = known.iter().any(|caption| key(caption) == key(&text));
                    self.occurrences.add(&text, !is_repeated);
                    if is_repeated {
                        self.num_captions_repeated += 1;
                    } else {
                        known.push(text);
                    }
                }
                return num_of_motion;
            }
        }
        0
    }

    fn take_loose(&mut self, texts: Vec<String>) {
        for text in &texts {
            self.occurrences.add(text, false);
        }
        self.loose_captions.extend(texts);
    }

    /// Leaves out loose captions that another source tells as well.
    ///
    /// Sources overlap: a corpus of all captions also has those of the motions that are here. So a caption is taken as often
    /// as it occurs in the source that has it most often, and first where it belongs to a motion. Without this, captions of
    /// held-out motions would be learned from.
    fn unite(&mut self) {
        let mut left = self.occurrences.loose();
        let before = self.loose_captions.len();
        self.loose_captions.retain(|text| match left.get_mut(&key(text)) {
            Some(left) if *left > 0 => {
                *left -= 1;
                true
            }
            _ => false,
        });
        self.num_captions_shared = before - self.loose_captions.len();
    }

    fn sort(&mut self) {
        self.motions.sort_by(|a, b| a.id.cmp(&b.id));
        self.skipped.sort_by(|a, b| (&a.source, &a.id).cmp(&(&b.source, &b.id)));
    }
}

/// A caption as it is compared: neither case, spaces nor marks make a difference.
fn key(text: &str) -> String {
    let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect::<Vec<_>>().join(" ")
}

/// How often each caption occurs in each source, and with a motion.
#[derive(Default)]
struct Occurrences {
    num_sources: usize,
    of: BTreeMap<String, Occurrence>,
}

#[derive(Default)]
struct Occurrence {
    /// Captions of motions, from all sources.
    with_motion: usize,
    /// Most often in one source.
    most: usize,
    /// The source counted now, and how often in it.
    now: (usize, usize),
}

impl Occurrences {
    fn begin_source(&mut self) {
        self.num_sources += 1;
    }

    fn add(&mut self, text: &str, with_motion: bool) {
        let found = self.of.entry(key(text)).or_default();
        found.with_motion += usize::from(with_motion);
        let before = if found.now.0 == self.num_sources { found.now.1 } else { 0 };
        found.now = (self.num_sources, before + 1);
        found.most = found.most.max(before + 1);
    }

    /// How often each caption is to be taken without a motion.
    fn loose(&self) -> BTreeMap<String, usize> {
        self.of
            .iter()
            .map(|(key, found)| (key.clone(), found.most.saturating_sub(found.with_motion)))
            .collect()
    }
}

fn is_partial(span_secs: Option<(f64, f64)>, duration_secs: f64) -> bool {
    span_secs.is_some_and(|(start, end)| {
        let slack = PARTIAL * duration_secs + 0.1;
        start > slack || end < duration_secs - slack
    })
}

/// Filters a motion by length and takes it to the features' rate.
fn prepare(
    sample: Sample,
    prefix: &str,
    without_captions: bool,
    settings: &PrepareSettings,
    source: &std::path::Path,
) -> Result<(Outcome, Vec<String>), Skipped> {
    let captions = if without_captions { Vec::new() } else { sample.captions };
    // Steps over rate, so that 100 steps at 100 Hz are one second.
    let secs = sample.motion.num_frames() as f64 / sample.motion.rate_hz();
    let (short, long) = (secs < settings.min_secs - 1e-9, secs > settings.max_secs + 1e-9);
    if short || long {
        return Ok((Outcome::Filtered { short, num_captions: captions.len() }, sample.warnings));
    }
    let mut frames = features_of(&sample.motion, settings.rate_hz).map_err(|error| Skipped {
        id: sample.id.clone(),
        source: source.to_owned(),
        reason: error.to_string(),
    })?;
    settings.root.place(&mut frames);
    let motion = GatheredMotion { id: format!("{prefix}{}", sample.id), frames, captions };
    Ok((Outcome::Kept(motion, secs), sample.warnings))
}

/// Channels at the features' rate.
///
/// At a rate that divides the motion's own, as the paper's 10 Hz does 100 Hz, these are every tenth frame as it is.
/// Deviation: the root's angles are continuous; the paper does not say what it does when yaw passes half a turn.
fn features_of(
    motion: &Motion,
    rate_hz: f64,
) -> Result<Vec<[f64; NUM_CHANNELS]>, crate::motion::MotionError> {
    Ok(motion.resampled(rate_hz)?.frames().iter().map(crate::motion::Frame::to_channels).collect())
}
