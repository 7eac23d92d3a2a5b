//! What a decoder hears while it learns.

use super::{Decoding, Draws, ModelSettings};

/// Input of the decoders during one iteration.
pub enum Feed<'a> {
    /// The output of the step before.
    ClosedLoop,
    /// The true value of the step before.
    TeacherForcing,
    /// One or the other.
    Mixed {
        /// Share of steps that hear the output.
        share: f64,
        /// Where the choices come from.
        draws: &'a mut Draws,
    },
}

impl<'a> Feed<'a> {
    /// The input the settings ask for after a fraction of the stage, 0 to 1.
    #[must_use]
    pub fn of(settings: &ModelSettings, progress: f64, draws: &'a mut Draws) -> Self {
        match settings.decoding {
            Decoding::ClosedLoop => Self::ClosedLoop,
            Decoding::TeacherForcing => Self::TeacherForcing,
            Decoding::ScheduledSampling => {
                Self::Mixed { share: settings.own_output_share * progress.clamp(0.0, 1.0), draws }
            }
        }
    }
}
