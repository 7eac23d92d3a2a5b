//! The result of one case: one motion, at every level that was asked for.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::plausibility::{Better, Metric, PropSupport};
use crate::simulation::{Event, Level, Outcome};

/// A metric as it stood when numbers were computed with it, saved beside them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetricRecord {
    /// Stable key.
    pub key: String,
    /// Short column title.
    pub title: String,
    /// Unit, empty for a ratio.
    pub unit: String,
    /// Level the value belongs to.
    pub level: Level,
    /// Which way is better.
    pub better: Better,
    /// Everything that changes the number.
    pub signature: String,
}

impl From<&Metric> for MetricRecord {
    fn from(metric: &Metric) -> Self {
        Self {
            key: metric.key.to_owned(),
            title: metric.title.to_owned(),
            unit: metric.unit.to_owned(),
            level: metric.level,
            better: metric.better,
            signature: metric.signature.to_owned(),
        }
    }
}

impl MetricRecord {
    /// Title with its unit, for example `skate [mm/s]`.
    #[must_use]
    pub fn title_with_unit(&self) -> String {
        if self.unit.is_empty() { self.title.clone() } else { format!("{} [{}]", self.title, self.unit) }
    }
}

/// What one level says about a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LevelResult {
    /// The level.
    pub level: Level,
    /// How the rollout ended; `None` at level 0, where nothing is simulated, and when no rollout came about.
    pub outcome: Option<Outcome>,
    /// Finite values by metric key; empty when the rollout failed.
    pub scores: BTreeMap<String, f64>,
    /// What happened, in time order.
    pub events: Vec<Event>,
    /// Path of the recording inside the run folder, with forward slashes; `None` without one.
    pub recording: Option<String>,
    /// The caption a model reads back from the movement at this level; `None` without a model in the loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub read_back: Option<String>,
    /// Doubts about reading it, as sentences for a person.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub read_back_doubts: Vec<String>,
}

/// One of several motions made of a sentence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Candidate {
    /// Mean over the scores of the share of the other candidates that are better; the smallest is kept, of equals the first.
    pub badness: f64,
    /// Whether it is the one that was run.
    pub kept: bool,
    /// Scores it was judged by, and its dynamic degree, by metric key.
    pub scores: BTreeMap<String, f64>,
}

/// The result of one case.
///
/// It holds no times of day and no durations of work, so the same input and settings give the same bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaseResult {
    /// Identity within the dataset.
    pub id: String,
    /// Where the motion was read.
    pub source: String,
    /// Captions of the motion; may be empty.
    pub captions: Vec<String>,
    /// Checksum of the checked motion.
    pub motion_sha256: String,
    /// Body height, metres.
    pub height_m: f64,
    /// Body mass, kilograms.
    pub mass_kg: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Number of frames.
    pub num_frames: usize,
    /// Time from the first to the last frame, seconds.
    pub duration_secs: f64,
    /// Doubts about the input, as sentences.
    pub warnings: Vec<String>,
    /// The motions made of the sentence, in the order they were made; empty unless there were several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<Candidate>,
    /// Where something other than the floor held the body; then the motion cannot be simulated on a floor alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub props: Vec<PropSupport>,
    /// Results in level order.
    pub levels: Vec<LevelResult>,
    /// Why the case failed, one line each; empty when it did not.
    pub failures: Vec<String>,
}

impl CaseResult {
    /// Whether the case failed. A fall or a bad score is a result, not a failure.
    #[must_use]
    pub fn failed(&self) -> bool {
        !self.failures.is_empty()
    }

    /// Whether a floor alone could hold the body throughout; what levels 1 to 3 say of others is not the motion's fault.
    #[must_use]
    pub fn simulable(&self) -> bool {
        self.props.is_empty()
    }

    /// Whether a metric of this level says something about the motion.
    #[must_use]
    pub fn counts_at(&self, level: Level) -> bool {
        level == Level::L0 || self.simulable()
    }

    /// Value of a metric; `None` when it was not measured.
    #[must_use]
    pub fn score(&self, key: &str) -> Option<f64> {
        self.levels.iter().find_map(|level| level.scores.get(key)).copied()
    }

    /// All values by metric key, in level order.
    pub fn scores(&self) -> impl Iterator<Item = (&str, f64)> {
        self.levels.iter().flat_map(|level| level.scores.iter()).map(|(key, value)| (key.as_str(), *value))
    }

    /// What a model reads back from the movement at a level.
    #[must_use]
    pub fn read_back(&self, level: Level) -> Option<&str> {
        self.levels.iter().find(|result| result.level == level)?.read_back.as_deref()
    }

    /// Doubts about what is read back, and the level of each.
    pub fn doubts(&self) -> impl Iterator<Item = (Level, &str)> {
        self.levels
            .iter()
            .flat_map(|result| result.read_back_doubts.iter().map(|doubt| (result.level, doubt.as_str())))
    }

    /// First caption, or nothing.
    #[must_use]
    pub fn caption(&self) -> &str {
        self.captions.first().map_or("", String::as_str)
    }
}

/// Small made-up results for the tests of this module.
#[cfg(test)]
pub(super) mod samples {
    use super::*;

    pub(crate) fn metric(key: &str, unit: &str, better: Better) -> MetricRecord {
        let level = match key.split_once('/').map(|(level, _)| level) {
            Some("l2") => Level::L2,
            Some("l3") => Level::L3,
            _ => Level::L0,
        };
        MetricRecord {
            key: key.to_owned(),
            title: key.rsplit('/').next().unwrap_or(key).to_owned(),
            unit: unit.to_owned(),
            level,
            better,
            signature: "v:1".to_owned(),
        }
    }

    pub(crate) fn case(id: &str, scores: &[(&str, f64)]) -> CaseResult {
        let mut levels: Vec<LevelResult> = Vec::new();
        for &(key, value) in scores {
            let level = metric(key, "", Better::Lower).level;
            if !levels.iter().any(|result| result.level == level) {
                levels.push(LevelResult {
                    level,
                    outcome: (level != Level::L0).then_some(Outcome::Completed),
                    scores: BTreeMap::new(),
                    events: Vec::new(),
                    recording: None,
                    read_back: None,
                    read_back_doubts: Vec::new(),
                });
            }
            let result = levels.iter_mut().find(|result| result.level == level).unwrap();
            result.scores.insert(key.to_owned(), value);
        }
        CaseResult {
            id: id.to_owned(),
            source: format!("{id}_mmm.xml"),
            captions: vec![format!("a person does {id}")],
            motion_sha256: "0".repeat(64),
            height_m: 1.75,
            mass_kg: 68.9,
            rate_hz: 100.0,
            num_frames: 201,
            duration_secs: 2.0,
            warnings: Vec::new(),
            candidates: Vec::new(),
            props: Vec::new(),
            levels,
            failures: Vec::new(),
        }
    }
}
