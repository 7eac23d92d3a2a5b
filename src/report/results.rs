//! All results of a run in one file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::aggregate::{Aggregate, aggregate};
use super::case::{CaseResult, MetricRecord};
use crate::manifest::{RunKey, SkippedInput};

/// Name and version of the form of `results.json`.
pub const RESULTS_FORMAT: &str = "rprae-results/1";

/// All results of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Results {
    /// [`RESULTS_FORMAT`].
    pub format: String,
    /// What makes the numbers comparable.
    pub key: RunKey,
    /// Where the motions came from.
    pub dataset: String,
    /// The metrics behind the keys, in the order of the tables.
    pub metrics: Vec<MetricRecord>,
    /// Cases by id.
    pub cases: Vec<CaseResult>,
    /// Inputs that were not used.
    pub skipped: Vec<SkippedInput>,
    /// One metric over all cases, in metric order.
    pub aggregates: Vec<Aggregate>,
}

/// Why results cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("read {path}: {error}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The file is not what it should be.
    #[error("read {path}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

impl Results {
    /// Puts finished cases together; `cases` and `skipped` are sorted by id here.
    #[must_use]
    pub fn new(
        key: RunKey,
        dataset: String,
        metrics: Vec<MetricRecord>,
        mut cases: Vec<CaseResult>,
        mut skipped: Vec<SkippedInput>,
        seed: u64,
    ) -> Self {
        cases.sort_by(|a, b| a.id.cmp(&b.id));
        skipped.sort_by(|a, b| (&a.id, &a.source).cmp(&(&b.id, &b.source)));
        let aggregates = aggregate(&metrics, &cases, seed);
        Self { format: RESULTS_FORMAT.to_owned(), key, dataset, metrics, cases, skipped, aggregates }
    }

    /// Reads a run folder or its `results.json`.
    ///
    /// # Errors
    /// [`ReadError`] names the file and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let path = if path.is_dir() { path.join("results.json") } else { path.to_owned() };
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) => return Err(ReadError::Io { path, error }),
        };
        let results: Self = match serde_json::from_str(&text) {
            Ok(results) => results,
            Err(error) => return Err(ReadError::Content { path, reason: error.to_string() }),
        };
        if results.format != RESULTS_FORMAT {
            let reason = format!("the format is {:?}, expected {RESULTS_FORMAT:?}", results.format);
            return Err(ReadError::Content { path, reason });
        }
        Ok(results)
    }

    /// The metric behind a key.
    #[must_use]
    pub fn metric(&self, key: &str) -> Option<&MetricRecord> {
        self.metrics.iter().find(|metric| metric.key == key)
    }

    /// Metrics that at least one case has a value for, in metric order.
    pub fn measured_metrics(&self) -> impl Iterator<Item = &MetricRecord> {
        self.aggregates.iter().filter_map(|aggregate| self.metric(&aggregate.key))
    }

    /// Those of `keys` that at least one case has a value for, in the order of `keys`.
    pub fn shown_metrics<'a>(&'a self, keys: &'a [&str]) -> impl Iterator<Item = &'a MetricRecord> {
        keys.iter().filter_map(|key| self.measured_metrics().find(|metric| metric.key == *key))
    }

    /// Cases that something other than the floor held.
    pub fn not_simulable(&self) -> impl Iterator<Item = &CaseResult> {
        self.cases.iter().filter(|case| !case.simulable())
    }

    /// Number of failed cases.
    #[must_use]
    pub fn num_failed(&self) -> usize {
        self.cases.iter().filter(|case| case.failed()).count()
    }
}

/// Small made-up results for the tests of this module.
#[cfg(test)]
pub(super) mod samples {
    use super::super::case::samples::metric;
    use super::*;
    use crate::plausibility::Better;

    pub(crate) fn key() -> RunKey {
        RunKey {
            rprae: "0.1.0".to_owned(),
            engine: "rapier 0.36.1".to_owned(),
            device: "cpu".to_owned(),
            signature: "dt:1/480".to_owned(),
        }
    }

    pub(crate) fn results(cases: Vec<CaseResult>) -> Results {
        let metrics = vec![
            metric("l0/skate", "mm/s", Better::Lower),
            metric("l2/mpjpe", "mm", Better::Lower),
            metric("l2/airtime", "", Better::Neither),
            metric("l3/upright", "s", Better::Higher),
        ];
        Results::new(key(), "bundled".to_owned(), metrics, cases, Vec::new(), 0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::samples::results;
    use super::*;

    #[test]
    fn files_return_the_same_results() {
        let folder = tempfile::tempdir().unwrap();
        let written = results(vec![case("b", &[("l0/skate", 0.1)]), case("a", &[("l0/skate", 1.0 / 3.0)])]);
        let path = folder.path().join("results.json");
        std::fs::write(&path, serde_json::to_string_pretty(&written).unwrap()).unwrap();
        assert_eq!(Results::read(folder.path()).unwrap(), written);
        assert_eq!(Results::read(&path).unwrap(), written);
        assert_eq!(written.cases[0].id, "a");
    }

    #[test]
    fn bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = Results::read(&folder.path().join("nothing.json")).unwrap_err();
        assert!(missing.to_string().contains("nothing.json"), "{missing}");
        let path = folder.path().join("results.json");
        let mut other = results(vec![]);
        other.format = "rprae-results/0".to_owned();
        for text in [String::new(), "[]".to_owned(), serde_json::to_string(&other).unwrap()] {
            std::fs::write(&path, text).unwrap();
            let error = Results::read(&path).unwrap_err();
            assert!(error.to_string().contains("results.json"), "{error}");
        }
    }
}
