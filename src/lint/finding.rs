//! What a check says.

use serde::Serialize;

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing; nothing is wrong.
    Info,
    /// Probably not what was meant; scores may mislead.
    Warning,
    /// The motion cannot be used, or every score of it would be wrong.
    Error,
}

impl Severity {
    /// The word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// A check of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Check {
    /// Name that stays the same across versions.
    pub code: &'static str,
    /// What it looks for.
    pub looks_for: &'static str,
    /// What to do about a finding.
    pub remedy: &'static str,
}

/// One thing found in one motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the check.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// Where in the motion: a frame, a joint, a line; empty when it is all of it.
    pub place: String,
    /// What was found, with numbers.
    pub message: String,
    /// What to do about it.
    pub remedy: &'static str,
}

impl Check {
    pub(super) fn found(
        &self,
        severity: Severity,
        place: impl Into<String>,
        message: impl Into<String>,
    ) -> Finding {
        Finding {
            code: self.code,
            severity,
            place: place.into(),
            message: message.into(),
            remedy: self.remedy,
        }
    }
}

macro_rules! checks {
    ($($name:ident = $code:literal, $looks_for:literal, $remedy:literal;)*) => {
        $(pub(super) const $name: Check = Check { code: $code, looks_for: $looks_for, remedy: $remedy };)*
        /// All checks, in the order they run.
        pub const CHECKS: &[Check] = &[$($name),*];
    };
}

checks! {
    FILE = "file", "a file that cannot be read", "check that the file is whole and readable";
    SCHEMA = "schema", "a file that is not laid out as its format says", "write the file again; README lists the formats";
    MODEL = "model", "joints that are not the 44 of the MMM reference model", "convert the motion to the 44-joint model";
    SAMPLING = "sampling", "time stamps without an even rate, lost frames, repeated frames", "resample the motion to a constant rate";
    VALUE = "value", "numbers that are not finite or absurdly large", "repair the frame or cut the motion there";
    UNITS_ANGLE = "units-angle", "angles in degrees", "convert the angles to radians";
    UNITS_LENGTH = "units-length", "positions in another unit than the file's", "MMM files are in millimetres, tables in metres";
    AXES = "axes", "another axis than z up", "turn the motion so that z is up: (x, y, z) becomes (x, -z, y)";
    LIMIT = "joint-limit", "joint angles outside the limits of the model", "check joint order and signs; clamp small excesses";
    JUMP = "jump", "changes from one frame to the next faster than a body moves", "filter or interpolate the frame";
    CONSTANT = "constant-channel", "channels that never change while the body moves", "check that the joint was exported";
    LEFT_RIGHT = "left-right", "left and right swapped or mirrored", "swap the left and right joints";
    GROUND = "ground-offset", "soles that stay above or below the floor", "shift the root height by the offset";
    READER = "reader", "doubts of the reader", "read the message; the motion was still used";
}
