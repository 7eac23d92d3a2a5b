//! What a preparation found, kept and left out: a manifest for programs, a text for people.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::gather::Gathered;
use super::settings::PrepareSettings;
use crate::dataset::{Coverage, Skipped};
use crate::features::Split;
use crate::manifest::{VERSION, write_file};

/// Name of the account beside a prepared set.
pub const MANIFEST_FILE: &str = "manifest.json";

/// Missing words that are listed.
const NUM_MISSING_SHOWN: usize = 50;

/// Numbers of a source of motions.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest and say what they count")]
pub struct MotionsFrom {
    pub name: String,
    pub path: PathBuf,
    pub num_kept: usize,
    pub num_short: usize,
    pub num_long: usize,
    pub num_skipped: usize,
    pub num_without_captions: usize,
    pub num_without_meta: usize,
    pub num_captions_without_motion: usize,
    /// Of the motions kept.
    pub duration_secs: f64,
}

/// Numbers of a file of captions.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest and say what they count")]
pub struct CaptionsFrom {
    pub path: PathBuf,
    pub num_captions: usize,
    /// Captions whose motion is there.
    pub num_of_motions: usize,
    pub num_skipped: usize,
}

/// Size of a set of captions; lengths and words include beginning and end of sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest and say what they count")]
pub struct Corpus {
    pub num_captions: usize,
    pub num_words: usize,
    pub shortest: usize,
    pub longest: usize,
}

/// Actions and captions of one split that belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest and say what they count")]
pub struct DivisionRow {
    pub num_motions: usize,
    pub num_captions: usize,
}

/// What the selection kept and left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest and say what they count")]
pub struct Selection {
    pub division: BTreeMap<Split, DivisionRow>,
    pub subset: Corpus,
    /// Left out for a word without a vector, or for having no word.
    pub num_captions_dropped: usize,
    /// Motions without captions and captions without motions that stage 1 learns from.
    pub num_motions_extra: usize,
    pub num_captions_extra: usize,
    /// Motions without captions, where extras are not wanted.
    pub num_motions_left_out: usize,
    pub num_motions_in_no_list: usize,
    /// Listed ids that are not among the motions.
    pub num_listed_absent: usize,
}

/// How far the vectors cover all captions.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest and say what they count")]
pub struct WordCoverage {
    pub num_words: usize,
    pub num_covered: usize,
    pub num_tokens: usize,
    pub num_covered_tokens: usize,
    /// The most frequent words without a vector, with their occurrences.
    pub most_frequent_missing: Vec<(String, usize)>,
}

/// An input that was not used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the keys of the manifest")]
pub struct SkippedSource {
    pub id: String,
    pub source: String,
    pub reason: String,
}

/// The account of a preparation; `manifest.json` beside the set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Version of the program.
    pub rprae: String,
    /// Fingerprint of the set, which covers every number and word in it.
    pub fingerprint: String,
    /// The settings, which repeat the preparation.
    pub settings: PrepareSettings,
    /// Motions by source.
    pub motions: Vec<MotionsFrom>,
    /// Captions by source.
    pub captions: Vec<CaptionsFrom>,
    /// All captions, before any is left out.
    pub corpus: Corpus,
    /// What was kept.
    pub selection: Selection,
    /// Captions left out with their motion, which is too short or too long.
    pub num_captions_filtered: usize,
    /// Captions already there word for word for the same motion.
    pub num_captions_repeated: usize,
    /// Captions without motion that another source has too.
    pub num_captions_shared: usize,
    /// Captions of a part of a motion, kept as captions without motion.
    pub num_captions_partial: usize,
    /// How far the word vectors reach.
    pub coverage: Option<WordCoverage>,
    /// Inputs that could not be used.
    pub skipped: Vec<SkippedSource>,
    /// Doubts about inputs that were used.
    pub warnings: Vec<String>,
}

impl Account {
    pub(super) fn of(settings: &PrepareSettings, gathered: &mut Gathered) -> Self {
        let skipped = |skipped: &Skipped| SkippedSource {
            id: skipped.id.clone(),
            source: skipped.source.display().to_string(),
            reason: skipped.reason.clone(),
        };
        Self {
            rprae: VERSION.to_owned(),
            fingerprint: String::new(),
            settings: settings.clone(),
            motions: std::mem::take(&mut gathered.motions_from),
            captions: std::mem::take(&mut gathered.captions_from),
            corpus: Corpus::default(),
            selection: Selection::default(),
            num_captions_filtered: gathered.num_captions_filtered,
            num_captions_repeated: gathered.num_captions_repeated,
            num_captions_shared: gathered.num_captions_shared,
            num_captions_partial: gathered.num_captions_partial,
            coverage: None,
            skipped: gathered.skipped.iter().map(skipped).collect(),
            warnings: std::mem::take(&mut gathered.warnings),
        }
    }

    pub(super) fn add(
        &mut self,
        selection: Selection,
        corpus: Corpus,
        coverage: Option<Coverage>,
        warnings: Vec<String>,
    ) {
        self.selection = selection;
        self.corpus = corpus;
        self.coverage = coverage.map(|mut coverage| {
            coverage.missing.truncate(NUM_MISSING_SHOWN);
            WordCoverage {
                num_words: coverage.num_words,
                num_covered: coverage.num_covered,
                num_tokens: coverage.num_tokens,
                num_covered_tokens: coverage.num_covered_tokens,
                most_frequent_missing: coverage.missing,
            }
        });
        self.warnings.extend(warnings.into_iter().map(|warning| format!("word vectors: {warning}")));
    }

    pub(super) fn why_nothing(&self, selection: &Selection) -> String {
        let sum = |count: fn(&MotionsFrom) -> usize| self.motions.iter().map(count).sum::<usize>();
        format!(
            "motions too short {}, too long {}, unreadable {}; captions with words without a vector {}",
            sum(|from| from.num_short),
            sum(|from| from.num_long),
            sum(|from| from.num_skipped),
            selection.num_captions_dropped
        )
    }

    /// Writes `manifest.json` into the folder of the set.
    ///
    /// # Errors
    /// Any error of the file system; the message names the path.
    pub fn save(&self, folder: &Path) -> std::io::Result<()> {
        let mut json = serde_json::to_string_pretty(self)?;
        json.push('\n');
        write_file(&folder.join(MANIFEST_FILE), json.as_bytes())
    }

    /// The account for a person: sources, the paper's numbers beside those found, what was left out and why.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        self.push_sources(&mut text);
        self.push_comparison(&mut text);
        self.push_remarks(&mut text);
        text
    }

    fn push_sources(&self, text: &mut String) {
        for from in &self.motions {
            let _ = writeln!(
                text,
                "Motions {}: {} kept ({:.2} h), {} shorter than {} s, {} longer than {} s, {} skipped",
                from.name,
                from.num_kept,
                from.duration_secs / 3600.0,
                from.num_short,
                self.settings.min_secs,
                from.num_long,
                self.settings.max_secs,
                from.num_skipped
            );
            let missing = [
                (from.num_without_captions, "motions without a caption file"),
                (from.num_without_meta, "motions without meta data"),
                (from.num_captions_without_motion, "caption files without a motion"),
            ];
            let missing: Vec<String> =
                missing.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
            if !missing.is_empty() {
                let _ = writeln!(text, "  missing: {}", missing.join(", "));
            }
        }
        for from in &self.captions {
            let _ = writeln!(
                text,
                "Captions {}: {}, of which {} describe a motion that is there; {} records skipped",
                from.path.display(),
                from.num_captions,
                from.num_of_motions,
                from.num_skipped
            );
        }
    }

    fn push_comparison(&self, text: &mut String) {
        let selection = &self.selection;
        let row = |split: Split| selection.division.get(&split).copied().unwrap_or_default();
        let splits = [Split::Train, Split::Validation, Split::Test];
        let (mut motions, mut captions) = (0, 0);
        for split in splits {
            motions += row(split).num_motions;
            captions += row(split).num_captions;
        }
        let _ = writeln!(text, "\n{:<34}{:>10}{:>10}", "", "paper", "here");
        let mut line = |what: &str, paper: &str, here: String| {
            let _ = writeln!(text, "{what:<34}{paper:>10}{here:>10}");
        };
        let lengths = |corpus: &Corpus| format!("{}-{}", corpus.shortest, corpus.longest);
        line("captions in all", "6353", self.corpus.num_captions.to_string());
        line("  words, with both ends", "1646", self.corpus.num_words.to_string());
        line("  sentence lengths, with both ends", "5-44", lengths(&self.corpus));
        line("captions kept", "5538", selection.subset.num_captions.to_string());
        line("  words, with both ends", "1331", selection.subset.num_words.to_string());
        line("  longest sentence", "38", selection.subset.longest.to_string());
        line("Data division: actions", "2721", motions.to_string());
        for (split, name, paper) in
            [(splits[0], "train", "2176"), (splits[1], "validation", "272"), (splits[2], "test", "273")]
        {
            line(&format!("  {name}"), paper, row(split).num_motions.to_string());
        }
        line("Data division: captions", "5538", captions.to_string());
        for (split, name, paper) in
            [(splits[0], "train", "4368"), (splits[1], "validation", "610"), (splits[2], "test", "560")]
        {
            line(&format!("  {name}"), paper, row(split).num_captions.to_string());
        }
        line("extra motions without captions", "0", selection.num_motions_extra.to_string());
        line("extra captions without motions", "0", selection.num_captions_extra.to_string());
    }

    fn push_remarks(&self, text: &mut String) {
        let selection = &self.selection;
        text.push('\n');
        if let Some(coverage) = &self.coverage {
            let missing: Vec<String> = coverage
                .most_frequent_missing
                .iter()
                .take(12)
                .map(|(word, count)| format!("{word} {count}"))
                .collect();
            let _ = writeln!(
                text,
                "Word vectors: {} of {} words, {:.1} % of their occurrences; most frequent without: {}",
                coverage.num_covered,
                coverage.num_words,
                100.0 * coverage.num_covered_tokens as f64 / coverage.num_tokens.max(1) as f64,
                missing.join(", ")
            );
        }
        for (count, what) in [
            (selection.num_captions_dropped, "captions left out for words without a vector, or too rare"),
            (self.num_captions_filtered, "captions left out with their motion, too short or too long"),
            (self.num_captions_repeated, "captions that repeat one of their motion"),
            (self.num_captions_shared, "captions without motion left out, since another source has them"),
            (self.num_captions_partial, "captions of a part of a motion, used without it"),
            (selection.num_motions_left_out, "motions without captions left out"),
            (selection.num_motions_in_no_list, "motions that are in no list of the split"),
            (selection.num_listed_absent, "ids in the lists of the split that are no motion here"),
        ] {
            if count > 0 {
                let _ = writeln!(text, "{count} {what}");
            }
        }
        let _ = writeln!(text, "Fingerprint: {}", self.fingerprint);
    }
}
