//! Motion capture as its files tell it: a skeleton of somebody's making and, frame by frame, where its joints are.
//!
//! In: the bytes of a BVH file, of an ASF skeleton with an AMC motion, or joint positions.
//! Out: a [`Clip`], whose [`Clip::pose_into`] gives the centre and orientation of every joint.
//! Lengths, axes and names stay those of the file; [`crate::retarget`] knows what they mean.
//! Nothing a file says may crash, hang or take memory out of proportion to its size.

mod amc;
mod asf;
mod bvh;
mod clip;
mod positions;
mod words;

pub use amc::read_amc;
pub use asf::{AsfSkeleton, read_asf};
pub use bvh::read_bvh;
pub use clip::{Axis, Channel, Clip, Joint};
pub use positions::{PositionOrder, PositionsError};

/// Most joints of a skeleton, end sites included; a body with all fingers has about 100.
pub const MAX_JOINTS: usize = 1024;

/// Most frames of a clip: more than an hour at 120 Hz.
pub const MAX_FRAMES: usize = 500_000;

/// Largest magnitude of any number in a file.
pub const MAX_VALUE: f64 = 1.0e7;

/// Why a file is no motion capture, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct MocapError {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// What is wrong there.
    pub fault: MocapFault,
}

/// What can be wrong with a motion capture file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MocapFault {
    /// The file ends too early.
    #[error("the file ends where {expected} should follow: it is truncated")]
    Truncated {
        /// What should follow.
        expected: String,
    },
    /// A word that does not belong there.
    #[error("found {found:?}, expected {expected}")]
    Unexpected {
        /// The word.
        found: String,
        /// What should stand there.
        expected: String,
    },
    /// Not a number, or none that a movement has.
    #[error("{found:?} is not a number within ±1e7")]
    NotANumber {
        /// The word.
        found: String,
    },
    /// A name that must be unique.
    #[error("the name {name:?} is used twice")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A bone that the skeleton does not have.
    #[error("there is no bone {name:?} in the skeleton")]
    UnknownBone {
        /// The name.
        name: String,
    },
    /// Bones that no path from the root reaches.
    #[error("the hierarchy does not reach the bone {name:?} from the root exactly once")]
    NotATree {
        /// Name of a bone.
        name: String,
    },
    /// A frame that leaves a bone out.
    #[error("frame {frame} has no values for the bone {name:?}")]
    MissingBone {
        /// Frame number, counted from 0.
        frame: usize,
        /// Name of the bone.
        name: String,
    },
    /// Too few or too many numbers.
    #[error("{what}: found {found} numbers, expected {expected}")]
    NumberCount {
        /// What they are.
        what: String,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// More of something than any recording has.
    #[error("more than {limit} {what}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// Most accepted.
        limit: usize,
    },
    /// Something that is known but not supported.
    #[error("{what} is not supported")]
    Unsupported {
        /// What it is.
        what: String,
    },
    /// A value outside its range.
    #[error("the {what} is {found}, expected {expected}")]
    Value {
        /// Name of the value.
        what: &'static str,
        /// Value found.
        found: f64,
        /// What it should be.
        expected: &'static str,
    },
}
