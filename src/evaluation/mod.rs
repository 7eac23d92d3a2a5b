//! Scores of sentences against reference sentences, with the settings that made them and how sure they are.
//!
//! In: a [`Corpus`] of strings, or vectors of them, of any origin.
//! Out: [`Measurement`]s: a score, its [`Signature`] of everything that changes the number, and the statistics of every
//! segment, from which [`Resampling`] makes intervals and compares systems without another pass over text.
//! Nothing here knows a motion or the model that wrote a sentence; [`encoder`] alone reads files, those of a pretrained
//! sentence encoder.
//!
//! ```
//! use rprae::evaluation::{Bleu, Corpus, Resampling, Segment};
//!
//! let segment = |id: &str, hypothesis: &str, references: &[&str]| Segment {
//!     id: id.to_owned(),
//!     hypothesis: hypothesis.to_owned(),
//!     references: references.iter().map(|&text| text.to_owned()).collect(),
//! };
//! let corpus = Corpus::new(vec![
//!     segment("a", "a person walks forward", &["a person walks forward", "someone walks"]),
//!     segment("b", "a person waves", &["a person waves with the right hand"]),
//! ])?;
//! let [.., bleu4] = Bleu::SACREBLEU.measure(&corpus);
//! assert_eq!(bleu4.signature.as_str(), "sacrebleu-4|nrefs:var|tok:13a|case:mixed|smooth:exp|eff:no|v:1");
//! assert!((bleu4.score() - 0.5647).abs() < 1e-4);
//! assert_eq!(Resampling::default().interval(&bleu4), None, "two segments are too few");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bert_score;
mod bleu;
mod cider;
mod clusters;
mod corpus;
pub mod encoder;
mod measurement;
pub mod motion;
mod ngrams;
mod panel;
mod resampling;
mod rouge;
mod sentence_cosine;
mod signature;
mod tokens;

pub use bert_score::{Baseline, BertScore, EmbeddedSegment, EmbeddedTokens};
pub use bleu::{Bleu, Smoothing};
pub use cider::{Cider, CiderVariant};
pub use clusters::Clusters;
pub use corpus::{Corpus, CorpusError, MAX_REFERENCES, MAX_SENTENCE_BYTES, Segment};
pub use measurement::{Combine, Measurement, Statistics};
pub use panel::{Absent, Panel, SentenceEncoder, TokenEncoder};
pub use resampling::{Comparison, ComparisonError, MIN_SEGMENTS, Resampling, relative_performance};
pub use rouge::{RougeL, RougeVariant};
pub use sentence_cosine::{OverReferences, SentenceCosine, VectorSegment, cosine};
pub use signature::Signature;
pub use tokens::{Cut, Tokenization, UnknownTokenization};
