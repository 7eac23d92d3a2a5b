//! Files to checked domain types; the only place where millimetres exist.
//!
//! In: MMM XML files, folders and zips in the KIT-ML layout, and plain number tables.
//! Out: [`Sample`]s, each a [`Motion`] with its id and captions, and [`Skipped`] inputs with the reason.
//! Nothing a file says may crash, hang or exhaust memory.

use std::path::PathBuf;

use crate::motion::Motion;

/// A motion with its identity and captions.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Identity within its source, for example `00001`; unique after loading, sorts in file order.
    pub id: String,
    /// The checked motion.
    pub motion: Motion,
    /// Captions in file order; may be empty.
    pub captions: Vec<String>,
    /// Doubts about the input that do not prevent its use, as sentences for a person.
    pub warnings: Vec<String>,
    /// Where it was read: a file, or `archive.zip!/entry`.
    pub source: PathBuf,
}

/// An input that could not be used, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skipped {
    /// Identity the sample would have had.
    pub id: String,
    /// Where it was read: a file, or `archive.zip!/entry`.
    pub source: PathBuf,
    /// One line that names the place and the reason.
    pub reason: String,
}
