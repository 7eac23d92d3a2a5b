//! The accepted numbers, and how far a run may be from them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::case::MetricRecord;
use super::super::results::Results;
use crate::manifest::{RunKey, write_file};
use crate::plausibility::Better;

/// Name and version of the form of a baseline file.
pub const BASELINE_FORMAT: &str = "rprae-baseline/1";

/// Relative tolerance of a metric that enters a baseline.
///
/// A run repeats bit for bit, so this is not noise but the change that a reader would not care about.
const DEFAULT_RELATIVE: f64 = 0.02;

/// A metric in a baseline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineMetric {
    /// Which way is better.
    pub better: Better,
    /// What the accepted values were computed with.
    pub signature: String,
    /// Allowed change in the metric's unit, added to the relative part.
    pub absolute: f64,
    /// Allowed change as a share of the accepted value's magnitude.
    pub relative: f64,
}

impl BaselineMetric {
    /// The default tolerance: 2 % and an absolute part that depends on the unit.
    #[must_use]
    pub fn with_default_tolerance(metric: &MetricRecord) -> Self {
        Self {
            better: metric.better,
            signature: metric.signature.clone(),
            absolute: default_absolute(&metric.unit),
            relative: DEFAULT_RELATIVE,
        }
    }

    /// Largest change from an accepted value that counts as none, in the metric's unit.
    #[must_use]
    pub fn allowed(&self, accepted: f64) -> f64 {
        self.absolute + self.relative * accepted.abs()
    }
}

/// About the last digit a person would read in a value of this unit.
fn default_absolute(unit: &str) -> f64 {
    match unit {
        "m/s^3" | "rad/s^3" => 1.0,
        "mm" | "mm/s" | "mm s" => 0.5,
        "% BW" | "% BW H" => 0.2,
        "s" | "BW" | "rad/s" | "mm/frame" | "N s/kg" | "N m s/kg" => 0.02,
        _ => 0.005,
    }
}

/// The accepted numbers of a suite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// [`BASELINE_FORMAT`].
    pub format: String,
    /// What the numbers were made with; a run with another key cannot be compared.
    pub key: RunKey,
    /// Direction, definition and tolerance by metric key.
    pub metrics: BTreeMap<String, BaselineMetric>,
    /// Accepted values by case and metric key.
    pub cases: BTreeMap<String, BTreeMap<String, f64>>,
}

/// Why a baseline cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The file cannot be read or written.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The file is not a baseline.
    #[error("read {path}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The run and the baseline were made with different versions or settings.
    #[error(
        "compare with the baseline: its key differs ({}); \
         run with the settings of the baseline, or accept the new ones with --update", .differences.join("; ")
    )]
    OtherKey {
        /// What differs, the run first.
        differences: Vec<String>,
    },
    /// A metric now means something else.
    #[error(
        "compare with the baseline: metrics are defined differently now ({}); \
         look at the new values and accept them with --update", .differences.join("; ")
    )]
    OtherDefinition {
        /// One line a metric.
        differences: Vec<String>,
    },
    /// A run with failed cases cannot become a baseline.
    #[error("accept the run: cases failed ({}); a baseline holds only whole runs", .cases.join(", "))]
    FailedCases {
        /// Ids of the failed cases.
        cases: Vec<String>,
    },
    /// A run without cases cannot become a baseline.
    #[error("accept the run: it has no cases")]
    NoCases,
}

impl Baseline {
    /// Reads a baseline file.
    ///
    /// # Errors
    /// [`BaselineError::Io`] and [`BaselineError::Content`] name the file.
    pub fn read(path: &Path) -> Result<Self, BaselineError> {
        let text = std::fs::read_to_string(path).map_err(|error| {
            std::io::Error::new(error.kind(), format!("read {}: {error}", path.display()))
        })?;
        let content = |reason: String| BaselineError::Content { path: path.to_owned(), reason };
        let baseline: Self = serde_json::from_str(&text).map_err(|error| content(error.to_string()))?;
        if baseline.format != BASELINE_FORMAT {
            return Err(content(format!(
                "the format is {:?}, expected {BASELINE_FORMAT:?}",
                baseline.format
            )));
        }
        for (key, metric) in &baseline.metrics {
            let bad = |value: f64| !(value.is_finite() && value >= 0.0);
            if bad(metric.absolute) || bad(metric.relative) {
                return Err(content(format!("the tolerance of {key} is not a number of at least 0")));
            }
        }
        Ok(baseline)
    }

    /// Accepts a run. Tolerances set by hand in `previous` are kept; new metrics get the default.
    ///
    /// # Errors
    /// [`BaselineError::FailedCases`] and [`BaselineError::NoCases`]: such a run is not worth accepting.
    pub fn accept(results: &Results, previous: Option<&Self>) -> Result<Self, BaselineError> {
        let cases: Vec<String> =
            results.cases.iter().filter(|case| case.failed()).map(|case| case.id.clone()).collect();
        if !cases.is_empty() {
            return Err(BaselineError::FailedCases { cases });
        }
        if results.cases.is_empty() {
            return Err(BaselineError::NoCases);
        }
        let metrics = results.measured_metrics().map(|metric| {
            let mut entry = BaselineMetric::with_default_tolerance(metric);
            if let Some(kept) = previous.and_then(|baseline| baseline.metrics.get(&metric.key)) {
                (entry.absolute, entry.relative) = (kept.absolute, kept.relative);
            }
            (metric.key.clone(), entry)
        });
        let cases = results.cases.iter().map(|case| {
            let values = case.scores().map(|(key, value)| (key.to_owned(), value)).collect();
            (case.id.clone(), values)
        });
        Ok(Self {
            format: BASELINE_FORMAT.to_owned(),
            key: results.key.clone(),
            metrics: metrics.collect(),
            cases: cases.collect(),
        })
    }

    /// Writes the baseline as indented JSON, in one step.
    ///
    /// # Errors
    /// [`BaselineError::Io`] names the file.
    pub fn write(&self, path: &Path) -> Result<(), BaselineError> {
        let mut text = serde_json::to_string_pretty(self).map_err(std::io::Error::from)?;
        text.push('\n');
        Ok(write_file(path, text.as_bytes())?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::case::samples::case;
    use super::super::super::results::samples::results;
    use super::*;

    #[test]
    fn files_return_the_same_baseline() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("baseline.json");
        let run = results(vec![case("walk", &[("l0/skate", 1.0 / 3.0), ("l3/upright", 2.0)])]);
        let baseline = Baseline::accept(&run, None).unwrap();
        baseline.write(&path).unwrap();
        assert_eq!(Baseline::read(&path).unwrap(), baseline);
    }

    #[test]
    fn tolerances_set_by_hand_survive_an_update() {
        let run = results(vec![case("walk", &[("l0/skate", 1.0)])]);
        let mut baseline = Baseline::accept(&run, None).unwrap();
        baseline.metrics.get_mut("l0/skate").unwrap().absolute = 7.0;
        let run = results(vec![case("walk", &[("l0/skate", 4.0), ("l3/upright", 1.0)])]);
        let updated = Baseline::accept(&run, Some(&baseline)).unwrap();
        assert_eq!(updated.metrics["l0/skate"].absolute, 7.0);
        assert_eq!(updated.cases["walk"]["l0/skate"], 4.0);
        assert_eq!(updated.metrics["l3/upright"].relative, DEFAULT_RELATIVE);
    }

    #[test]
    fn only_whole_runs_are_accepted() {
        let mut broken = case("walk", &[("l0/skate", 1.0)]);
        broken.failures.push("not a number".to_owned());
        let refused = Baseline::accept(&results(vec![broken]), None);
        assert!(matches!(refused, Err(BaselineError::FailedCases { .. })));
        assert!(matches!(Baseline::accept(&results(vec![]), None), Err(BaselineError::NoCases)));
    }

    #[test]
    fn a_tolerance_that_hides_everything_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("baseline.json");
        let run = results(vec![case("walk", &[("l0/skate", 1.0)])]);
        let mut baseline = Baseline::accept(&run, None).unwrap();
        baseline.metrics.get_mut("l0/skate").unwrap().relative = -1.0;
        baseline.write(&path).unwrap();
        let error = Baseline::read(&path).unwrap_err().to_string();
        assert!(error.contains("l0/skate") && error.contains("baseline.json"), "{error}");
    }
}
