//! One case: a motion, its body, its scores at every level, its recordings.

use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::fingerprint::motion_sha256;
use super::meaning::Meaning;
use super::n_best::gains;
use super::{Language, RunFolder, RunSettings, Source};
use crate::dataset::Sample;
use crate::humanoid::Humanoid;
use crate::manifest::{RunKey, SkippedInput};
use crate::plausibility::{
    PropSupport, Score, inverse_scores, kinematic_scores, prop_supports, rollout_scores,
};
use crate::recording::{Recorder, Recording, RecordingError, RecordingHeader};
use crate::report::{Candidate, CaseResult, LevelResult};
use crate::simulation::{Level, Outcome, Rollout, Simulation};

/// What all cases of a run share.
pub(super) struct CaseContext<'a> {
    settings: &'a RunSettings,
    /// The model in the loop.
    language: Option<&'a Language>,
    folder: &'a RunFolder,
    /// The settings as TOML, for the recordings.
    settings_text: String,
    /// The key of the run as metadata, for the recordings.
    metadata: BTreeMap<String, String>,
}

impl<'a> CaseContext<'a> {
    pub(super) fn new(
        settings: &'a RunSettings,
        language: Option<&'a Language>,
        key: &RunKey,
        folder: &'a RunFolder,
    ) -> Self {
        let metadata = [
            ("rprae", key.rprae.clone()),
            ("engine", key.engine.clone()),
            ("device", key.device.clone()),
            ("signature", key.signature.clone()),
            ("seed", settings.seed.to_string()),
        ];
        Self {
            settings,
            language,
            folder,
            // The folder was opened with the same settings, so they have a TOML form.
            settings_text: settings.to_toml().unwrap_or_default(),
            metadata: metadata.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
        }
    }
}

/// Runs a case unless the folder has it, saves it, and says whether it was found.
///
/// A panic while reading skips the input, a panic later fails the case: the rest of the run is not its business.
pub(super) fn finish_case(
    context: &CaseContext<'_>,
    source: &dyn Source,
    index: usize,
) -> io::Result<Result<(CaseResult, bool), SkippedInput>> {
    let loaded = catch_unwind(AssertUnwindSafe(|| source.load_chosen(index))).unwrap_or_else(|panic| {
        let id = source.ids().swap_remove(index);
        let reason = format!("reading it panicked: {}", panic_message(&*panic));
        Err(SkippedInput { id, source: source.name(), reason })
    });
    let (sample, candidates) = match loaded {
        Ok(loaded) => loaded,
        Err(skipped) => return Ok(Err(skipped)),
    };
    let mut case = CaseResult { candidates, ..unfinished(&sample) };
    if let Some(found) = context.folder.read_case(&case.id).filter(|found| is_current(context, found, &case))
    {
        return Ok(Ok((found, true)));
    }
    let evaluated = catch_unwind(AssertUnwindSafe(|| evaluate(context, &sample, &case.candidates)));
    match evaluated {
        Ok(Evaluation { props, levels, failures }) => {
            (case.props, case.levels, case.failures) = (props, levels, failures);
        }
        Err(panic) => case.failures.push(format!("panicked: {}", panic_message(&*panic))),
    }
    context.folder.write_case(&case)?;
    Ok(Ok((case, false)))
}

/// Whether a result found in the folder is whole and belongs to the same motion.
fn is_current(context: &CaseContext<'_>, found: &CaseResult, case: &CaseResult) -> bool {
    let recorded = found.levels.iter().filter_map(|level| level.recording.as_ref());
    let same_input =
        CaseResult { levels: Vec::new(), failures: Vec::new(), props: Vec::new(), ..found.clone() } == *case;
    same_input
        && !found.failed()
        && recorded.into_iter().all(|path| context.folder.path().join(path).is_file())
}

/// The result of a case before any level has run.
fn unfinished(sample: &Sample) -> CaseResult {
    let motion = &sample.motion;
    CaseResult {
        id: sample.id.clone(),
        source: sample.source.display().to_string(),
        captions: sample.captions.clone(),
        motion_sha256: motion_sha256(motion),
        height_m: motion.body().height_m,
        mass_kg: motion.body().mass_kg,
        rate_hz: motion.rate_hz(),
        num_frames: motion.num_frames(),
        duration_secs: motion.duration_secs(),
        warnings: sample.warnings.clone(),
        candidates: Vec::new(),
        props: Vec::new(),
        levels: Vec::new(),
        failures: Vec::new(),
    }
}

/// What came of a case.
#[derive(Default)]
struct Evaluation {
    props: Vec<PropSupport>,
    levels: Vec<LevelResult>,
    failures: Vec<String>,
}

fn evaluate(context: &CaseContext<'_>, sample: &Sample, candidates: &[Candidate]) -> Evaluation {
    let mut failures = Vec::new();
    let humanoid = match Humanoid::new(sample.motion.body()) {
        Ok(humanoid) => humanoid,
        Err(error) => {
            return Evaluation {
                failures: vec![format!("build the body: {error}")],
                ..Evaluation::default()
            };
        }
    };
    // Made for the first level that needs it; all levels above L0 share it.
    let settings = &context.settings.simulation;
    let simulation = LazyCell::new(|| Simulation::new(&humanoid, &sample.motion, settings));
    let meaning = context.language.map(|language| Meaning::new(language, sample, &mut failures));
    let mut levels = Vec::new();
    for &level in &context.settings.levels {
        let mut result = empty_level(level);
        add_scores(&mut result, &gains(candidates, level), &mut failures);
        if level == Level::L0 {
            add_scores(&mut result, &kinematic_scores(&humanoid, &sample.motion), &mut failures);
            if let Some(meaning) = &meaning {
                meaning.score_given(&mut result);
            }
        } else {
            match &*simulation {
                Err(error) => failures.push(format!("{level}: {error}")),
                Ok(simulation) if level == Level::L1 => {
                    let scores = inverse_scores(&humanoid, simulation.reference_motion());
                    add_scores(&mut result, &scores, &mut failures);
                }
                Ok(simulation) => {
                    let recording = CaseRecording::start(context, sample, &humanoid, level);
                    let rollout =
                        simulated_level(&mut result, simulation, &humanoid, recording, &mut failures);
                    if let (Level::L2, Some(meaning), Some(rollout)) = (level, &meaning, &rollout) {
                        meaning.score_performed(&mut result, rollout, &mut failures);
                    }
                }
            }
        }
        levels.push(result);
    }
    // Level 0 runs without inverse dynamics, and so without this.
    let needs_floor = context.settings.levels.iter().any(|&level| level != Level::L0);
    let prepared = if needs_floor { simulation.as_ref().ok() } else { None };
    let props = prepared.map(|simulation| prop_supports(&humanoid, simulation.reference_motion()));
    Evaluation { props: props.unwrap_or_default(), levels, failures }
}

fn empty_level(level: Level) -> LevelResult {
    LevelResult {
        level,
        outcome: None,
        scores: BTreeMap::new(),
        events: Vec::new(),
        recording: None,
        read_back: None,
        read_back_doubts: Vec::new(),
    }
}

fn simulated_level(
    result: &mut LevelResult,
    simulation: &Simulation<'_>,
    humanoid: &Humanoid,
    mut recording: CaseRecording,
    failures: &mut Vec<String>,
) -> Option<Rollout> {
    let level = result.level;
    let rollout = match simulation.run_under(level, &simulation.undisturbed(), &mut recording.recording) {
        Ok(rollout) => rollout,
        Err(error) => {
            failures.push(format!("{level}: {error}"));
            return None;
        }
    };
    let scores = rollout_scores(humanoid, &rollout);
    add_scores(result, &scores, failures);
    result.events.clone_from(&rollout.events);
    if let Outcome::Failed { time_secs, reason } = &rollout.outcome {
        failures.push(format!("{level} at {time_secs:.3} s: {reason}"));
    }
    result.outcome = Some(rollout.outcome.clone());
    match recording.finish(&rollout, result, &scores) {
        Ok(path) => result.recording = path,
        Err(error) => failures.push(format!("{level}: {error}")),
    }
    Some(rollout)
}

/// Takes scores over; one that is not finite fails the case, since no file or mean may hold it.
pub(super) fn add_scores(result: &mut LevelResult, scores: &[Score], failures: &mut Vec<String>) {
    for score in scores {
        if score.value.is_finite() {
            result.scores.insert(score.metric.key.to_owned(), score.value);
        } else {
            failures.push(format!("{}: {} is {}", result.level, score.metric.key, score.value));
        }
    }
}

/// The recording of a rollout, started where there is to be one.
struct CaseRecording {
    /// Path inside the run folder.
    path: String,
    recording: Recording,
}

impl CaseRecording {
    fn start(context: &CaseContext<'_>, sample: &Sample, humanoid: &Humanoid, level: Level) -> Self {
        let path = RunFolder::recording(&sample.id, level);
        if !context.settings.recordings {
            return Self { path, recording: Recording::none() };
        }
        let simulation = &context.settings.simulation;
        let header = RecordingHeader {
            humanoid,
            id: &sample.id,
            captions: &sample.captions,
            level,
            settings: &context.settings_text,
            metadata: &context.metadata,
            sample_interval_secs: simulation.steps_per_sample() as f64 * simulation.dt_secs,
        };
        let recorder = Recorder::replace(&context.folder.path().join(&path), &header);
        Self { path, recording: Recording::new(recorder) }
    }

    /// Closes the recording; its path, or nothing when there was to be none.
    fn finish(
        self,
        rollout: &Rollout,
        result: &LevelResult,
        scores: &[Score],
    ) -> Result<Option<String>, RecordingError> {
        // Finite numbers and strings always have a JSON form.
        let result_json = || serde_json::to_string_pretty(result).unwrap_or_default();
        let is_written = self.recording.finish(rollout, result_json, scores)?;
        Ok(is_written.then_some(self.path))
    }
}

fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|message| (*message).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}
