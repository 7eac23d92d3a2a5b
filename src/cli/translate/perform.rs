//! A motion performed by the humanoid in the simulator, and what that says.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::anyhow;
use serde::Serialize;

use super::act::{Fault, read_back_text};
use crate::harness::{self, RunSettings};
use crate::humanoid::Humanoid;
use crate::manifest::VERSION;
use crate::motion::Motion;
use crate::plausibility::rollout_scores;
use crate::recording::{Recorder, Recording, RecordingHeader};
use crate::simulation::{ENGINE_VERSION, Level, Outcome, Simulation};
use crate::translation::{Search, Sentence, Translator, performed_motion};

/// A simulator that passed its self-test.
pub(super) struct Stage {
    settings: RunSettings,
}

/// What the humanoid did.
pub(super) struct Performed {
    /// Its movement, until the end or the failure.
    motion: Motion,
    outcome: Outcome,
    /// Scores of the rollout by key.
    scores: BTreeMap<&'static str, f64>,
}

/// What the humanoid did, and what that says.
#[derive(Debug, Serialize)]
pub(super) struct Performance {
    /// Level and engine.
    level: Level,
    /// How the rollout ended.
    outcome: Outcome,
    /// What the movement of the humanoid says; empty when it was too short to be read.
    read_back: Vec<Sentence>,
    /// Doubts about reading it, or why it cannot be read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    read_back_notes: Vec<String>,
    /// Scores of the rollout by key.
    scores: BTreeMap<&'static str, f64>,
}

impl Stage {
    /// Proves the engine, or remembers that it was proved.
    pub fn new(quiet: bool) -> anyhow::Result<Self> {
        let settings = RunSettings::default();
        let proof = harness::prove(&settings.simulation, harness::cache_folder().as_deref())?;
        if let Some(check) = proof.failed().next() {
            return Err(anyhow!("prove the physics engine; `rprae doctor` shows all checks: {check}"));
        }
        if !quiet {
            eprintln!("{}", proof.line());
        }
        Ok(Self { settings })
    }

    /// Performs a motion at level 2, recorded at `path` if there is one.
    pub fn perform(&self, motion: &Motion, caption: &str, path: Option<&Path>) -> Result<Performed, Fault> {
        let humanoid = Humanoid::new(motion.body()).map_err(Fault::sentence)?;
        let settings = &self.settings.simulation;
        let simulation = Simulation::new(&humanoid, motion, settings).map_err(Fault::sentence)?;
        let metadata = [
            ("rprae", VERSION.to_owned()),
            ("engine", format!("rapier {ENGINE_VERSION}")),
            ("signature", self.settings.signature()),
        ];
        let metadata = metadata.map(|(name, value)| (name.to_owned(), value)).into();
        let header = RecordingHeader {
            humanoid: &humanoid,
            id: "translation",
            captions: &[caption.to_owned()],
            level: Level::L2,
            settings: &self.settings.to_toml().map_err(Fault::sentence)?,
            metadata: &metadata,
            sample_interval_secs: settings.steps_per_sample() as f64 * settings.dt_secs,
        };
        let mut recording =
            path.map_or_else(Recording::none, |path| Recording::new(Recorder::replace(path, &header)));
        let rollout = simulation
            .run_under(Level::L2, &simulation.undisturbed(), &mut recording)
            .map_err(Fault::sentence)?;
        let scores = rollout_scores(&humanoid, &rollout);
        let scores_by_key: BTreeMap<&'static str, f64> =
            scores.iter().map(|score| (score.metric.key, score.value)).collect();
        let result_json = serde_json::to_string_pretty(&scores_by_key).map_err(Fault::sentence)?;
        recording.finish(&rollout, || result_json, &scores).map_err(Fault::write)?;
        let motion = performed_motion(motion, &rollout).map_err(Fault::sentence)?;
        Ok(Performed { motion, outcome: rollout.outcome, scores: scores_by_key })
    }
}

impl Performed {
    /// Reads the movement back.
    pub fn read_back(self, translator: &Translator, search: &Search) -> Performance {
        let (read_back, read_back_notes) = match translator.describe(&self.motion, search) {
            Ok(described) => (described.sentences, described.warnings),
            Err(error) => (Vec::new(), vec![format!("not read back: {error}")]),
        };
        Performance {
            level: Level::L2,
            outcome: self.outcome,
            read_back,
            read_back_notes,
            scores: self.scores,
        }
    }
}

impl Performance {
    /// Whether the rollout ended before its time.
    pub fn has_failed(&self) -> bool {
        matches!(self.outcome, Outcome::Failed { .. })
    }

    /// For a person.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let score = |key: &str| {
            self.scores.get(key).map_or_else(|| "-".to_owned(), |value| crate::report::compact(*value))
        };
        let fell = (self.scores.get("l2/survived") == Some(&0.0)).then(|| score("l2/time_to_fall"));
        let ended = match &self.outcome {
            Outcome::Completed => fell.map_or_else(String::new, |secs| format!(", fell at {secs} s")),
            Outcome::Failed { time_secs, reason } => format!(" until {time_secs:.2} s, when {reason}"),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "     performed in rapier at level 2{ended}: joints {} mm from those commanded (seen from the root), assisted by {} % of body weight",
            score("l2/mpjpe_root"),
            score("l2/assist_mean"),
        );
        text.push_str(&read_back_text("read back from what it did", &self.read_back, &self.read_back_notes));
        text
    }
}
