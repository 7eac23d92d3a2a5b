//! From a sentence to motions, files and what they are read back as.

use std::fmt::Write as _;

use serde::Serialize;

use super::Session;
use super::perform::Performance;
use super::write::{self, Target};
use crate::motion::Motion;
use crate::report::{counted, fixed};
use crate::translation::{Acted, Search, Sentence, TranslationError, upsampled};

/// What came of a sentence.
#[derive(Debug, Serialize)]
pub(super) struct ActedRecord {
    /// Number in the file of sentences.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// The sentence.
    pub caption: String,
    /// Words that are not in the vocabulary.
    pub notes: Vec<String>,
    /// The motions made of it.
    pub motions: Vec<MotionRecord>,
}

/// A motion that was made.
#[derive(Debug, Serialize)]
pub(super) struct MotionRecord {
    /// Number among the motions of the sentence, from 1.
    number: usize,
    /// Time from the first to the last frame, seconds.
    duration_secs: f64,
    /// Frames the model made.
    num_frames: usize,
    /// Frames a second the model makes.
    rate_hz: f64,
    /// Distance of the last place of the root from the first, on the floor, metres.
    travel_m: f64,
    /// Change of the heading from the first frame to the last, degrees, positive to the left.
    turn_deg: f64,
    /// Files written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    files: Vec<String>,
    /// What the motion says, with --round-trip.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    read_back: Vec<Sentence>,
    /// Doubts about reading it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    read_back_notes: Vec<String>,
    /// What the humanoid did, with --perform.
    #[serde(skip_serializing_if = "Option::is_none")]
    performed: Option<Performance>,
}

/// A sentence with its motions, before anything is written.
pub(super) struct Unfinished {
    id: Option<String>,
    caption: String,
    notes: Vec<String>,
    /// Each with its number from 0; noisy ones that are no motion are missing.
    motions: Vec<(usize, Acted)>,
}

/// Why what was made of a sentence is not finished.
#[derive(Debug)]
pub(super) enum Fault {
    /// This sentence cannot be; another may.
    Sentence(anyhow::Error),
    /// A file cannot be written.
    Write(anyhow::Error),
}

impl Fault {
    pub(super) fn sentence(error: impl Into<anyhow::Error>) -> Self {
        Self::Sentence(error.into())
    }

    pub(super) fn write(error: impl Into<anyhow::Error>) -> Self {
        Self::Write(error.into())
    }
}

impl From<Fault> for anyhow::Error {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Sentence(error) | Fault::Write(error) => error,
        }
    }
}

impl Session<'_> {
    /// The motions of a sentence.
    pub fn act(&self, id: Option<String>, caption: &str) -> Result<Unfinished, TranslationError> {
        let Session { translator, acting, args, .. } = self;
        let reading = translator.read(caption)?;
        let latent = translator.latent_of(&reading);
        let (count, seed) = (usize::from(args.n_best), args.seed.unwrap_or(0));
        let made = translator.act_often(&latent, acting, count, args.noise(), seed)?;
        let mut notes: Vec<String> = reading.notes.iter().map(ToString::to_string).collect();
        let left_out = made.left_out.iter();
        notes.extend(left_out.map(|(number, error)| format!("motion {} is left out: {error}", number + 1)));
        Ok(Unfinished { id, caption: caption.to_owned(), notes, motions: made.motions })
    }

    /// Reads back, performs and writes what was made.
    pub fn finish(&self, made: Unfinished, targets: &[Target]) -> Result<ActedRecord, Fault> {
        let motions = made.motions.iter().map(|acted| self.finish_motion(&made, acted, targets));
        let motions = motions.collect::<Result<_, _>>()?;
        Ok(ActedRecord { id: made.id, caption: made.caption, notes: made.notes, motions })
    }

    fn finish_motion(
        &self,
        made: &Unfinished,
        (number, acted): &(usize, Acted),
        targets: &[Target],
    ) -> Result<MotionRecord, Fault> {
        let Session { translator, args, search, .. } = self;
        let file_number = (args.n_best > 1).then_some(number + 1);
        // Several sentences about one motion are not what --n-best asks of a sentence.
        let search = Search { n_best: 1, ..*search };
        let motion = &acted.motion;
        let fine = upsampled(motion, args.out_rate()).map_err(Fault::sentence)?;
        let (read_back, read_back_notes) = if args.round_trip {
            let described = translator.describe(motion, &search).map_err(Fault::sentence)?;
            (described.sentences, described.warnings)
        } else {
            Default::default()
        };
        let places: Vec<_> =
            targets.iter().filter_map(|target| target.motion_file(made.id.as_deref(), file_number)).collect();
        // One at most, written while the humanoid performs.
        let recording = places.iter().find(|path| write::is_recording(path));
        for path in places.iter().filter(|path| Some(*path) != recording) {
            let name = made.id.as_deref().unwrap_or(&made.caption);
            write::motion(path, &fine, name, &made.caption).map_err(Fault::write)?;
        }
        let performed = match &self.stage {
            Some(stage) => {
                let performance = stage.perform(&fine, &made.caption, recording.map(|path| &**path))?;
                Some(performance.read_back(translator, &search))
            }
            None => None,
        };
        let files = places.iter().map(|path| path.display().to_string()).collect();
        let (travel_m, turn_deg) = way(motion);
        Ok(MotionRecord {
            number: number + 1,
            duration_secs: motion.duration_secs(),
            num_frames: motion.num_frames(),
            rate_hz: motion.rate_hz(),
            travel_m,
            turn_deg,
            files,
            read_back,
            read_back_notes,
            performed,
        })
    }
}

/// Distance on the floor from the first to the last place, metres, and change of the heading, degrees.
fn way(motion: &Motion) -> (f64, f64) {
    let frames = motion.frames();
    let (first, last) = (&frames[0], &frames[frames.len() - 1]);
    let travel = [0, 1].map(|axis| last.root_position_m[axis] - first.root_position_m[axis]);
    let turn = last.root_rotation_rad[2] - first.root_rotation_rad[2];
    (travel[0].hypot(travel[1]), turn.to_degrees())
}

impl ActedRecord {
    /// Whether a rollout ended before its time.
    pub fn has_failed(&self) -> bool {
        self.motions.iter().filter_map(|motion| motion.performed.as_ref()).any(Performance::has_failed)
    }

    /// For a person.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let id = self.id.as_ref().map_or_else(String::new, |id| format!("{id}  "));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{id}{}", self.caption);
        for note in &self.notes {
            let _ = writeln!(text, "  note: {note}");
        }
        for motion in &self.motions {
            let number = if self.motions.len() > 1 { format!("{}. ", motion.number) } else { String::new() };
            let _ = writeln!(
                text,
                "  {number}{:.1} s ({} at {} Hz), travels {:.2} m, turns {} degrees",
                motion.duration_secs,
                counted(motion.num_frames, "frame"),
                motion.rate_hz,
                motion.travel_m,
                fixed(motion.turn_deg, 0)
            );
            text.push_str(&read_back_text("read back", &motion.read_back, &motion.read_back_notes));
            if let Some(performed) = &motion.performed {
                text.push_str(&performed.text());
            }
            for file in &motion.files {
                let _ = writeln!(text, "     wrote {file}");
            }
        }
        text
    }
}

/// Sentences read back from a movement with the doubts about it, for a person.
pub(super) fn read_back_text(what: &str, sentences: &[Sentence], notes: &[String]) -> String {
    let mut text = String::new();
    for Sentence { text: words, log_probability, .. } in sentences {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "     {what}: {words} (log p {})", fixed(*log_probability, 2));
    }
    for note in notes {
        let _ = writeln!(text, "     {what}, note: {note}");
    }
    text
}

/// A line a motion file, as `--motions` of the other commands takes it.
pub(super) fn manifest(records: &[ActedRecord]) -> String {
    let mut text = String::new();
    for record in records {
        for file in record.motions.iter().flat_map(|motion| &motion.files) {
            let name = std::path::Path::new(file).file_name().unwrap_or_default().to_string_lossy();
            let line = serde_json::json!({ "file": name, "caption": record.caption });
            let _ = writeln!(text, "{line}");
        }
    }
    text
}
