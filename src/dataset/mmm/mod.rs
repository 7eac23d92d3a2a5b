//! MMM XML: the files of the KIT motion database, in their legacy and v2.0 layouts.
//!
//! In: the bytes of a file. Out: a checked [`Motion`] in metres, with the rate its time stamps say.
//! Velocities, accelerations and sensors other than the model's pose and joint angles are not read.
//! Files are in millimetres; this module and its callers are the only places that know.

mod clock;
mod frame;
mod joint_order;
mod numbers;
mod read;
mod write;
mod xml;

pub use clock::ClockError;
pub use joint_order::JointOrderError;
pub use read::read_mmm;
pub use write::write_mmm;

use crate::motion::{Motion, MotionError};

/// Mass that KIT files carry instead of the person's, kilograms.
pub const PLACEHOLDER_MASS_KG: f64 = 100.0;

/// What an MMM file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct MmmMotion {
    /// Name of the motion in the file, often the subject: `subject_id_4`.
    pub name: String,
    /// The checked motion.
    pub motion: Motion,
    /// Doubts that do not prevent its use.
    pub warnings: Vec<String>,
}

/// Why a file gives no motion, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct MmmError {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// What is wrong there.
    pub fault: MmmFault,
}

/// What can be wrong with an MMM file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MmmFault {
    /// Not well-formed XML.
    #[error("not well-formed XML: {reason}")]
    Syntax {
        /// What the XML reader said.
        reason: String,
    },
    /// Text where a document should be.
    #[error("not an XML document")]
    NotXml,
    /// An empty document.
    #[error("the document is empty")]
    NoRoot,
    /// Another kind of XML document.
    #[error("the document is a <{found}>, expected an <MMM>")]
    Root {
        /// Name of the root element.
        found: String,
    },
    /// Something follows the root element.
    #[error("content after the end of <MMM>")]
    Trailing,
    /// The document ends too early.
    #[error("the file ends inside <{element}>: it is truncated")]
    Truncated {
        /// The innermost element of interest that is open.
        element: &'static str,
    },
    /// Nesting beyond any MMM file.
    #[error("elements are nested more than {limit} deep", limit = xml::MAX_DEPTH)]
    Deep,
    /// A document type, which could define entities.
    #[error("a document type (<!DOCTYPE>) is not accepted; remove it")]
    DocType,
    /// An entity, character reference or CDATA section in the text.
    #[error("entities and CDATA sections are not accepted in the text")]
    Reference,
    /// Text between elements.
    #[error("unexpected text {found:?} in <{element}>")]
    Text {
        /// Element with the text.
        element: &'static str,
        /// The text.
        found: String,
    },
    /// An element where only text may be, or one layout inside the other.
    #[error("unexpected <{found}> in <{element}>")]
    Unexpected {
        /// Element around it.
        element: &'static str,
        /// Name of the unexpected element.
        found: String,
    },
    /// No motion in the file.
    #[error("the file has no <Motion>")]
    NoMotion,
    /// An element that every motion needs.
    #[error("{place} has no <{element}>")]
    Missing {
        /// Where it is missing.
        place: String,
        /// Its name.
        element: &'static str,
    },
    /// An element that may stand only once.
    #[error("{place} has more than one <{element}>")]
    Repeated {
        /// Where it is repeated.
        place: String,
        /// Its name.
        element: &'static str,
    },
    /// A word that is not a number.
    #[error("{place}: {found:?} in <{element}> is not a number")]
    NotANumber {
        /// Where it stands.
        place: String,
        /// Element it stands in.
        element: &'static str,
        /// The word.
        found: String,
    },
    /// Too few or too many numbers.
    #[error("{place}: <{element}> has {found} numbers, expected {expected}")]
    NumberCount {
        /// Where they stand.
        place: String,
        /// Element they stand in.
        element: &'static str,
        /// How many it should have.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// The sensors of a v2.0 file do not describe the same frames.
    #[error("the {sensor} sensor has {found}, the ModelPose sensor {expected}")]
    Sensors {
        /// The sensor that differs from the pose.
        sensor: &'static str,
        /// What it has.
        found: String,
        /// What the pose has.
        expected: String,
    },
    /// The joints are not those of a KIT motion.
    #[error(transparent)]
    Joints(#[from] JointOrderError),
    /// The time stamps give no rate.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// The numbers are not those of a motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
}
