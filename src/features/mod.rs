//! What a model learns from: normalised motions, numbered words, and which of them belong together.
//!
//! In: checked [`crate::dataset`] samples, captions and word vectors. Out: a [`PreparedSet`], complete in itself, that training
//! reads and that pins everything downstream by its fingerprint. No tensors here: batches are built by the training.

mod action;
mod check;
mod fingerprint;
mod folder;
mod mirror;
pub mod prepare;
mod prepared;
mod root;
mod split;
mod tokens;
mod vocabulary;

pub use action::{LIMIT, Normalizer};
pub use check::Unsound;
pub use folder::{FEATURES_FILE, PreparedError, SET_FILE};
pub use mirror::MirrorCount;
pub use prepared::{CaptionFeatures, MotionFeatures, Pair, PreparedSet, Split};
pub use root::Root;
pub use split::SplitError;
pub use tokens::TokenRule;
pub use vocabulary::{BOS, EOS, Vocabulary};
