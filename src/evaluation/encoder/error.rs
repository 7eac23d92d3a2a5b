//! Why an encoder folder cannot be used.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Why an encoder cannot be opened or used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EncoderError {
    /// A file of the folder that is not there or cannot be read.
    #[error("read {}: {source}; an encoder folder holds config.json, model.safetensors, and tokenizer.json or vocab.txt or vocab.json with merges.txt", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file that is larger than any of its kind.
    #[error("read {}: it has {found} bytes and at most {limit} are taken", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size in bytes.
        found: u64,
        /// The largest size.
        limit: u64,
    },
    /// A file that does not hold what it should.
    #[error("understand {}: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A model of a kind that is not built here.
    #[error("run the model of {}: {reason}; the families BERT and RoBERTa are known", path.display())]
    Unsupported {
        /// The file that says so.
        path: PathBuf,
        /// What is not known.
        reason: String,
    },
    /// A layer the model does not have.
    #[error("take layer {layer}: the model has {num_layers}")]
    NoSuchLayer {
        /// The layer asked for.
        layer: usize,
        /// Number of layers.
        num_layers: usize,
    },
    /// A pooling that needs what the model was saved without.
    #[error("pool with the model's pooler: {} holds none, use cls or mean", path.display())]
    NoPooler {
        /// The weights.
        path: PathBuf,
    },
    /// A sentence that cannot be cut into tokens.
    #[error("tokenise {sentence:?}: {reason}")]
    Tokenise {
        /// The sentence.
        sentence: String,
        /// What the tokeniser says.
        reason: String,
    },
    /// The computation itself failed.
    #[error("run the encoder: {reason}")]
    Compute {
        /// What is wrong.
        reason: String,
    },
}
