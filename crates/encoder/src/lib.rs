//! Layers of sentence encoders (BERT, RoBERTa) on the CPU: inference only, without padding.
//!
//! A batch is the tokens of some sentences of any lengths one after the other, `[token, width]` row by row. Every sum runs over
//! its terms in an order of its own row, so that a sentence has the same bits in every batch, alone too.
//! A call runs on the thread that makes it; batches are for the caller to spread over threads.

#![expect(clippy::inline_always, reason = "vector code keeps its instruction set only where it is inlined")]

mod attention;
mod elementwise;
mod layer;
mod packed;
mod product;

pub use layer::{Layer, Linear, Memory, Norm};
pub use rprae_lanes::Instructions;
