//! A recording as an observer of a rollout.

use super::{Recorder, RecordingError, RecordingSummary};
use crate::plausibility::Score;
use crate::simulation::{Event, Observer, Rollout, RolloutSample};

/// A recording that may be switched off or have failed; the first error is kept until the end of the rollout.
#[derive(Debug)]
pub struct Recording {
    recorder: Option<Recorder>,
    error: Option<RecordingError>,
}

impl Recording {
    /// Records nothing.
    #[must_use]
    pub fn none() -> Self {
        Self { recorder: None, error: None }
    }

    /// Records, unless the recording could not be started.
    #[must_use]
    pub fn new(recorder: Result<Recorder, RecordingError>) -> Self {
        match recorder {
            Ok(recorder) => Self { recorder: Some(recorder), error: None },
            Err(error) => Self { recorder: None, error: Some(error) },
        }
    }

    /// Closes the recording with the result as JSON; whether there is one.
    ///
    /// # Errors
    /// The first [`RecordingError`] since the beginning.
    pub fn finish(
        self,
        rollout: &Rollout,
        result_json: impl FnOnce() -> String,
        scores: &[Score],
    ) -> Result<bool, RecordingError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let Some(recorder) = self.recorder else { return Ok(false) };
        recorder.finish(rollout, &RecordingSummary { result_json: &result_json(), scores })?;
        Ok(true)
    }

    /// Writes on, unless something went wrong before.
    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecordingError>) {
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = write(recorder)
        {
            self.recorder = None;
            self.error = Some(error);
        }
    }
}

impl Observer for Recording {
    fn sample(&mut self, sample: &RolloutSample) {
        self.write(|recorder| recorder.sample(sample));
    }

    fn event(&mut self, event: &Event) {
        self.write(|recorder| recorder.event(event));
    }
}
