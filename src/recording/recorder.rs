//! Writes a rollout to an MCAP file, sample by sample.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use nalgebra::Vector3;

use super::description::{Actor, viewer_urdf};
use super::frames::{LinkFrames, REFERENCE_PREFIX};
use super::messages::{self, Nanoseconds, Severity};
use super::metrics::{BodyScale, SAMPLE_METRICS};
use super::topics::{TOPICS, Topic, offered_qos};
use super::{RecordingError, START_TIME_NS};
use crate::humanoid::Humanoid;
use crate::plausibility::Score;
use crate::simulation::{Event, EventKind, Level, Outcome, Rollout, RolloutSample};

/// Name of the metadata record that says which rollout a recording holds.
pub(super) const ROLLOUT_METADATA: &str = "rollout";

/// Longest stretch of motion a killed process loses, seconds.
const FLUSH_INTERVAL_SECS: f64 = 1.0;

/// What is known of a rollout before it starts.
#[derive(Debug, Clone, Copy)]
pub struct RecordingHeader<'a> {
    /// The body that moves.
    pub humanoid: &'a Humanoid,
    /// Identity of the motion.
    pub id: &'a str,
    /// Captions of the motion; may be empty.
    pub captions: &'a [String],
    /// Level of the simulation.
    pub level: Level,
    /// The resolved settings as TOML text, attached as `settings.toml`.
    pub settings: &'a str,
    /// Versions, seeds, signature: whatever identifies the run, written as the metadata record `run`.
    pub metadata: &'a BTreeMap<String, String>,
    /// Seconds between samples.
    pub sample_interval_secs: f64,
}

/// What is known of a rollout when it has ended.
#[derive(Debug, Clone, Copy)]
pub struct RecordingSummary<'a> {
    /// The result as JSON text, attached as `result.json`.
    pub result_json: &'a str,
    /// The scores of the rollout, written as the metadata record `scores`.
    pub scores: &'a [Score],
}

/// Time of a message about the instant `time_secs` of the motion.
fn message_time(time_secs: f64) -> Nanoseconds {
    // A cast saturates, so no time, however wrong, wraps around.
    START_TIME_NS.saturating_add((time_secs * 1e9).round() as u64)
}

/// An open recording.
///
/// The same rollout gives the same bytes: times count from [`START_TIME_NS`], not from a clock.
/// What was written reaches the file after every second of motion, so a killed process leaves a readable beginning.
/// Dropping a recorder closes the file without result and scores.
pub struct Recorder {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    /// Channel id and number of messages so far, in the order of [`TOPICS`].
    channels: [(u16, u32); TOPICS.len()],
    simulated: LinkFrames,
    reference: LinkFrames,
    body: BodyScale,
    /// Number of events of the rollout written so far.
    num_events: usize,
    /// Time of the last sample written and of the last flush, seconds.
    last_sample_secs: f64,
    last_flush_secs: f64,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Recorder {
    /// Creates the file and writes all that is known before the rollout.
    ///
    /// # Errors
    /// [`RecordingError::Exists`] when there is a file already, [`RecordingError::Create`] and [`RecordingError::Write`]
    /// when the file system refuses.
    pub fn create(path: &Path, header: &RecordingHeader<'_>) -> Result<Self, RecordingError> {
        let file = File::create_new(path).map_err(|source| match source.kind() {
            std::io::ErrorKind::AlreadyExists => RecordingError::Exists { path: path.to_owned() },
            _ => RecordingError::Create { path: path.to_owned(), source },
        })?;
        Self::begin(path, file, header)
    }

    /// As [`Recorder::create`], over whatever is there.
    ///
    /// # Errors
    /// [`RecordingError::Create`] and [`RecordingError::Write`] when the file system refuses.
    pub fn replace(path: &Path, header: &RecordingHeader<'_>) -> Result<Self, RecordingError> {
        let file =
            File::create(path).map_err(|source| RecordingError::Create { path: path.to_owned(), source })?;
        Self::begin(path, file, header)
    }

    fn begin(path: &Path, file: File, header: &RecordingHeader<'_>) -> Result<Self, RecordingError> {
        let failed = |source| RecordingError::Write { path: path.to_owned(), time_secs: 0.0, source };
        let humanoid = header.humanoid;
        let writer = open(file).map_err(failed)?;
        let mut recorder = Self {
            path: path.to_owned(),
            writer,
            channels: [(0, 0); TOPICS.len()],
            simulated: LinkFrames::new(humanoid, ""),
            reference: LinkFrames::new(humanoid, REFERENCE_PREFIX),
            body: BodyScale::new(humanoid),
            num_events: 0,
            last_sample_secs: 0.0,
            last_flush_secs: 0.0,
        };
        recorder.write_beginning(header).map_err(failed)?;
        Ok(recorder)
    }

    fn write_beginning(&mut self, header: &RecordingHeader<'_>) -> mcap::McapResult<()> {
        let mut rollout = BTreeMap::from([
            ("id".to_owned(), header.id.to_owned()),
            ("level".to_owned(), header.level.to_string()),
            ("sample_interval_secs".to_owned(), header.sample_interval_secs.to_string()),
            ("start_time_ns".to_owned(), START_TIME_NS.to_string()),
        ]);
        for (index, caption) in header.captions.iter().enumerate() {
            rollout.insert(format!("caption_{index:02}"), caption.clone());
        }
        self.metadata(ROLLOUT_METADATA, rollout)?;
        self.metadata("run", header.metadata.clone())?;
        self.attach("robot.urdf", "application/xml", &header.humanoid.urdf)?;
        self.attach("settings.toml", "application/toml", header.settings)?;
        self.announce_topics()?;

        let start = START_TIME_NS;
        for (topic, actor) in
            [(Topic::RobotDescription, Actor::Simulated), (Topic::ReferenceDescription, Actor::Reference)]
        {
            // The humanoid was read from this very text, so it is XML.
            let urdf = viewer_urdf(&header.humanoid.urdf, actor)
                .map_err(|error| mcap::McapError::Io(std::io::Error::other(error)))?;
            self.message(topic, start, &messages::text(&urdf))?;
        }
        if !header.captions.is_empty() {
            self.message(Topic::Caption, start, &messages::text(&header.captions.join("\n")))?;
        }
        let fixed = messages::transforms(start, &[self.simulated.fixed(), self.reference.fixed()]);
        self.message(Topic::TfStatic, start, &fixed)?;
        let title = format!("rollout of {} at level {}", header.id, header.level);
        self.message(Topic::Rosout, start, &messages::log(start, Severity::Info, "rollout", &title))?;
        self.writer.flush()
    }

    /// Writes one sample; samples come in time order.
    ///
    /// # Errors
    /// [`RecordingError::Write`] when the file system refuses; the rollout itself is not affected.
    pub fn sample(&mut self, sample: &RolloutSample) -> Result<(), RecordingError> {
        self.last_sample_secs = sample.time_secs;
        self.write_sample(sample).map_err(|source| self.failed(source))
    }

    /// Writes one event at once, so that a killed process does not lose it; events come in the order of the rollout's.
    ///
    /// Those that were not written by the end of the rollout are written then.
    ///
    /// # Errors
    /// [`RecordingError::Write`] when the file system refuses; the rollout itself is not affected.
    pub fn event(&mut self, event: &Event) -> Result<(), RecordingError> {
        self.num_events += 1;
        self.log(event.time_secs, event.kind.into(), &event.message)
            .and_then(|()| self.writer.flush())
            .map_err(|source| self.failed(source))
    }

    fn write_sample(&mut self, sample: &RolloutSample) -> mcap::McapResult<()> {
        let time = message_time(sample.time_secs);
        let root = sample.world_from_segment[0].translation.vector;

        let simulated = self.simulated.poses(&sample.world_from_segment, &sample.joint_angles_rad);
        let tf = messages::transforms(time, &simulated);
        let reference =
            self.reference.poses(&sample.reference_world_from_segment, &sample.reference_joint_angles_rad);
        let reference_tf = messages::transforms(time, &reference);

        let moment_about_root: Vector3<f64> = sample
            .contacts
            .iter()
            .map(|contact| (contact.position_m.coords - root).cross(&contact.force_n))
            .sum();
        let at_root = self.simulated.root_aligned();
        let contact_wrench = messages::wrench(time, at_root, &sample.ground_force_n(), &moment_about_root);
        let assist_wrench = messages::wrench(time, at_root, &sample.assist_force_n, &sample.assist_moment_nm);
        let joint_states = messages::joint_states(
            time,
            &sample.joint_angles_rad,
            &sample.joint_velocities_rad_s,
            &sample.joint_torques_nm,
        );
        let reference_joint_states =
            messages::joint_states(time, &sample.reference_joint_angles_rad, &[], &[]);
        let metrics = messages::metrics(time, SAMPLE_METRICS.iter().map(|m| (m.value)(sample, &self.body)));

        self.message(Topic::Tf, time, &tf)?;
        self.message(Topic::ReferenceTf, time, &reference_tf)?;
        self.message(Topic::JointStates, time, &joint_states)?;
        self.message(Topic::ReferenceJointStates, time, &reference_joint_states)?;
        self.message(Topic::ContactPoints, time, &messages::contact_points(time, &sample.contacts))?;
        self.message(Topic::ContactWrench, time, &contact_wrench)?;
        self.message(Topic::AssistWrench, time, &assist_wrench)?;
        self.message(Topic::Metrics, time, &metrics)?;

        // The margin keeps a time like 0.9999999 from waiting for the next sample.
        if sample.time_secs - self.last_flush_secs >= FLUSH_INTERVAL_SECS - 1e-6 {
            self.last_flush_secs = sample.time_secs;
            self.writer.flush()?;
        }
        Ok(())
    }

    /// Writes outcome, scores, result and what events are left, and closes the file.
    ///
    /// # Errors
    /// [`RecordingError::Write`] when the file system refuses, at the latest when the file is forced to disk.
    pub fn finish(mut self, rollout: &Rollout, summary: &RecordingSummary<'_>) -> Result<(), RecordingError> {
        if let Err(source) = self.write_end(rollout, summary) {
            return Err(self.failed(source));
        }
        let Self { path, writer, last_sample_secs: time_secs, .. } = self;
        writer
            .into_inner()
            .into_inner()
            .map_err(std::io::IntoInnerError::into_error)
            .and_then(|file| file.sync_all())
            .map_err(|error| RecordingError::Write { path, time_secs, source: error.into() })
    }

    fn write_end(&mut self, rollout: &Rollout, summary: &RecordingSummary<'_>) -> mcap::McapResult<()> {
        for event in rollout.events.iter().skip(self.num_events) {
            self.log(event.time_secs, event.kind.into(), &event.message)?;
        }
        let end_secs = self.last_sample_secs;
        let drift_m = rollout.max_joint_drift_m.to_string();
        let mut outcome = BTreeMap::from([("max_joint_drift_m".to_owned(), drift_m)]);
        match &rollout.outcome {
            Outcome::Completed => {
                outcome.insert("kind".to_owned(), "completed".to_owned());
                self.log(end_secs, Severity::Info, &format!("completed after {end_secs:.3} s"))?;
            }
            Outcome::Failed { time_secs, reason } => {
                outcome.insert("kind".to_owned(), "failed".to_owned());
                outcome.insert("time_secs".to_owned(), time_secs.to_string());
                outcome.insert("reason".to_owned(), reason.clone());
                if !rollout.events.iter().any(|event| event.kind == EventKind::Failure) {
                    self.log(*time_secs, Severity::Error, reason)?;
                }
            }
        }
        self.metadata("outcome", outcome)?;
        let scores =
            summary.scores.iter().map(|score| (score.metric.key.to_owned(), score.value.to_string()));
        self.metadata("scores", scores.collect())?;
        self.attach("result.json", "application/json", summary.result_json)?;
        self.writer.finish()?;
        Ok(())
    }

    fn log(&mut self, time_secs: f64, severity: Severity, message: &str) -> mcap::McapResult<()> {
        let time = message_time(time_secs);
        self.message(Topic::Rosout, time, &messages::log(time, severity, "rollout", message))
    }

    /// Lists every topic with its type, so that empty ones are known too.
    fn announce_topics(&mut self) -> mcap::McapResult<()> {
        for (topic, name, schema, latched) in TOPICS {
            let definition = schema.definition();
            let schema_id = self.writer.add_schema(schema.name(), "ros2msg", definition.as_bytes())?;
            let qos = BTreeMap::from([("offered_qos_profiles".to_owned(), offered_qos(latched))]);
            self.channels[topic as usize].0 = self.writer.add_channel(schema_id, name, "cdr", &qos)?;
        }
        Ok(())
    }

    fn message(&mut self, topic: Topic, time: Nanoseconds, data: &[u8]) -> mcap::McapResult<()> {
        let (channel_id, sequence) = &mut self.channels[topic as usize];
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: time,
            publish_time: time,
        };
        *sequence += 1;
        self.writer.write_to_known_channel(&header, data)
    }

    fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> mcap::McapResult<()> {
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    fn attach(&mut self, name: &str, media_type: &str, text: &str) -> mcap::McapResult<()> {
        let time = message_time(self.last_sample_secs);
        self.writer.attach(&Attachment {
            log_time: time,
            create_time: time,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: Cow::Borrowed(text.as_bytes()),
        })
    }

    fn failed(&self, source: mcap::McapError) -> RecordingError {
        RecordingError::Write { path: self.path.clone(), time_secs: self.last_sample_secs, source }
    }
}

/// Starts the file.
fn open(file: File) -> mcap::McapResult<Writer<BufWriter<File>>> {
    WriteOptions::new()
        .profile("ros2")
        .library(concat!("rprae ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        // One thread: the bytes must not depend on the machine.
        .compression_threads(0)
        // Chunks end where the recorder flushes.
        .chunk_size(None)
        .create(BufWriter::new(file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_times_round_to_the_nanosecond_and_never_wrap() {
        assert_eq!(message_time(0.0), START_TIME_NS);
        assert_eq!(message_time(1.0 / 120.0), START_TIME_NS + 8_333_333);
        assert_eq!(message_time(f64::NAN), START_TIME_NS);
        assert_eq!(message_time(f64::INFINITY), u64::MAX);
    }
}
