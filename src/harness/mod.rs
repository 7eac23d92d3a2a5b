//! Runs a suite: every motion through every level, each finished case safe on disk at once.
//!
//! In: a [`Selection`] of the motions of a [`Source`], [`RunSettings`], a [`RunFolder`].
//! Out: a [`Run`], its files in the folder, and [`Progress`] while it lasts.
//! A motion that cannot be read is skipped, a case that fails or panics is a failed case; the run goes on after both.
//! The files are the same bytes for any number of threads; what took how long is in `timings.json` alone.

mod case;
mod curve;
mod fingerprint;
mod folder;
mod generated;
mod language;
mod language_metrics;
mod meaning;
mod n_best;
mod proof;
mod publish;
mod selection;
mod settings;
mod source;

pub use curve::{Condition, CurveSettings, run_curve};
pub use fingerprint::motion_sha256;
pub use folder::{FolderError, RunFolder};
pub use generated::Generated;
pub use language::{Language, LanguageSettings, bundle_sha256};
pub use language_metrics::LANGUAGE_METRICS;
pub use proof::{Proof, cache_folder, prove};
pub use publish::publish;
pub use selection::{Selection, SelectionError};
pub use settings::{RunSettings, SettingsProblem, TableSettings};
pub use source::Source;

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use crate::manifest::{
    Manifest, RunKey, SkippedInput, UsedInput, VERSION, platform, processor, program_sha256,
};
use crate::plausibility::METRICS;
use crate::report::{CaseResult, MetricRecord, Results};
use crate::simulation::ENGINE_VERSION;
use case::{CaseContext, finish_case};

/// Something that happened during a run, for a progress display.
#[derive(Debug, Clone, Copy)]
pub enum Progress<'a> {
    /// The run starts with this many inputs.
    Started {
        /// Number of motions, and of inputs that are skipped already.
        num_cases: usize,
    },
    /// A case is done and on disk.
    Finished {
        /// Its result.
        case: &'a CaseResult,
        /// Whether it was found finished in the folder.
        resumed: bool,
        /// Wall time it took here.
        secs: f64,
    },
    /// A motion could not be read.
    Skipped {
        /// Which, and why.
        input: &'a SkippedInput,
    },
}

/// Wall time of one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaseTiming {
    /// Id of the case.
    pub id: String,
    /// Wall time from reading the motion to the finished file, seconds.
    pub secs: f64,
    /// Whether the case was found finished, so that the time says nothing about work.
    pub resumed: bool,
}

/// What took how long; the only result that differs between equal runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timings {
    /// Number of worker threads.
    pub threads: usize,
    /// Wall time of the whole run, seconds.
    pub total_secs: f64,
    /// Duration of the motions that were worked on, seconds.
    pub motion_secs: f64,
    /// Cases by id.
    pub cases: Vec<CaseTiming>,
}

/// A finished run.
#[derive(Debug, Clone)]
pub struct Run {
    /// All results.
    pub results: Results,
    /// What made them.
    pub manifest: Manifest,
    /// What took how long.
    pub timings: Timings,
}

impl Run {
    /// Number of cases that were found finished in the folder.
    #[must_use]
    pub fn num_resumed(&self) -> usize {
        self.timings.cases.iter().filter(|timing| timing.resumed).count()
    }
}

/// Why a run ended early. Finished cases stay in the folder.
#[derive(Debug, thiserror::Error)]
pub enum HarnessError {
    /// The worker threads could not be started.
    #[error("start {threads} worker threads: {reason}")]
    Threads {
        /// Number of threads asked for.
        threads: usize,
        /// What the system says.
        reason: String,
    },
    /// A result could not be written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

/// What makes the numbers of runs with these settings comparable.
#[must_use]
pub fn run_key(settings: &RunSettings) -> RunKey {
    RunKey {
        rprae: VERSION.to_owned(),
        engine: format!("rapier {ENGINE_VERSION}"),
        device: "cpu".to_owned(),
        signature: settings.signature(),
    }
}

/// The manifest of a run that has not used any input yet.
#[must_use]
pub fn initial_manifest(settings: &RunSettings, dataset: &str) -> Manifest {
    Manifest {
        key: run_key(settings),
        program_sha256: program_sha256(),
        platform: platform(),
        processor: processor(),
        dataset: dataset.to_owned(),
        inputs: Vec::new(),
        skipped: Vec::new(),
    }
}

/// Runs the selected motions of `source` on `threads` workers and writes each finished case into `folder`.
///
/// With a model in the loop, captions are read back from the motions and from what the humanoid made of them.
/// Cases that the folder already holds for the same motion are not run again, unless they failed.
/// `observe` is called from the worker threads.
///
/// # Errors
/// [`HarnessError`] when a result cannot be written, or there are no threads.
pub fn run(
    source: &dyn Source,
    selection: &Selection,
    settings: &RunSettings,
    language: Option<&Language>,
    folder: &RunFolder,
    threads: usize,
    observe: &(dyn Fn(Progress<'_>) + Sync),
) -> Result<Run, HarnessError> {
    let started = Instant::now();
    let Selection { indices, mut skipped } = selection.clone();
    let manifest = initial_manifest(settings, &source.name());
    let context = CaseContext::new(settings, language, &manifest.key, folder);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| HarnessError::Threads { threads, reason: error.to_string() })?;

    observe(Progress::Started { num_cases: indices.len() + skipped.len() });
    for input in &skipped {
        observe(Progress::Skipped { input });
    }
    let finished: Vec<Result<(CaseResult, CaseTiming), SkippedInput>> = pool.install(|| {
        indices
            .par_iter()
            .with_max_len(1)
            .map(|&index| -> std::io::Result<_> {
                let started = Instant::now();
                Ok(match finish_case(&context, source, index)? {
                    Ok((case, resumed)) => {
                        let secs = started.elapsed().as_secs_f64();
                        observe(Progress::Finished { case: &case, resumed, secs });
                        let timing = CaseTiming { id: case.id.clone(), secs, resumed };
                        Ok((case, timing))
                    }
                    Err(input) => {
                        observe(Progress::Skipped { input: &input });
                        Err(input)
                    }
                })
            })
            .collect::<std::io::Result<_>>()
    })?;

    let mut cases = Vec::new();
    let mut case_timings = Vec::new();
    for outcome in finished {
        match outcome {
            Ok((case, timing)) => {
                cases.push(case);
                case_timings.push(timing);
            }
            Err(input) => skipped.push(input),
        }
    }
    let motion_secs = cases
        .iter()
        .zip(&case_timings)
        .filter(|(_, timing)| !timing.resumed)
        .map(|(case, _)| case.duration_secs)
        // Not `sum`, which gives a negative zero for nothing.
        .fold(0.0, |total, secs| total + secs);
    let n_best = settings.language.as_ref().map_or(1, |language| language.n_best);
    let language_metrics =
        language.map(|language| language.metrics(&settings.levels, n_best)).unwrap_or_default();
    let metrics = METRICS
        .iter()
        .filter(|metric| settings.levels.contains(&metric.level))
        .map(|metric| MetricRecord::from(*metric))
        .chain(language_metrics)
        .collect();
    let results = Results::new(manifest.key.clone(), source.name(), metrics, cases, skipped, settings.seed);
    let inputs = results.cases.iter().map(|case| UsedInput {
        id: case.id.clone(),
        source: case.source.clone(),
        motion_sha256: case.motion_sha256.clone(),
    });
    let manifest = Manifest { inputs: inputs.collect(), skipped: results.skipped.clone(), ..manifest };
    let timings = Timings {
        threads: pool.current_num_threads(),
        total_secs: started.elapsed().as_secs_f64(),
        motion_secs,
        cases: case_timings,
    };
    Ok(Run { results, manifest, timings })
}

#[cfg(test)]
mod tests;
