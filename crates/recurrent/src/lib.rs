//! Fast LSTM sequences of mixed lengths on the CPU, forward and backward.

#![expect(clippy::inline_always, reason = "vector code keeps its instruction set only where it is inlined")]

mod decoder;
mod fetch;
mod kernel;
mod lanes;
mod layer;
mod memory;
mod multiply;
mod panels;
mod plan;
mod sequence;
mod weight_gradients;
mod weights;

pub use decoder::{Activation, Decoder, Hearing, Projection, Unrolled, UnrolledGradients};
pub use layer::State;
pub use plan::{Direction, Plan};
pub use rprae_lanes::Instructions;
pub use sequence::{Sequence, SequenceGradients};
pub use weights::{LayerGradients, LayerWeights};
