//! Scores of motions made from captions.
//!
//! In: [`Embeddings`] of motions and captions in a space both share, and [`Poses`] in metres; whose they are is not known
//! here. Out: [`Measurement`](super::Measurement)s where a score is a mean over queries, [`SetScore`]s where it belongs to
//! a whole set.
//!
//! The scores of embeddings are those of Guo et al. 2022, "Generating diverse and natural 3D human motions from text",
//! with two differences that take the chance out of them: pools of 32 and pairs of motions are not drawn, the mean over
//! all of them is computed. Which evaluator embedded the motions decides every number, so signatures name it.

mod diversity;
mod embeddings;
mod frechet;
mod jackknife;
mod pose;
mod retrieval;
mod warp;

pub use diversity::{diversity, multimodality};
pub use embeddings::{Embeddings, EmbeddingsError};
pub use frechet::{Covariance, frechet_distance, frechet_score};
pub use jackknife::SetScore;
pub use pose::{PoseComparison, Poses, PosesError};
pub use retrieval::{POOL, Rank, Retrieval, pair_distance};
