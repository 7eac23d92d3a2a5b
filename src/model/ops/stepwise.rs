//! Recurrences step by step with the operations of any backend, for devices without kernels of their own for whole sequences.
//!
//! What differs from a tape that records every step: no work on padding, one product for all inputs known beforehand, one product
//! for each gradient of weights, and the numbers of a cell in one launch where the backend has a kernel for them.

mod closed_loop;
mod decoder;
mod layer;
mod open_loop;
mod sequence;
mod tensors;

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;

pub use decoder::{DecoderWay, decoder_backward, decoder_forward};
pub use sequence::{SequenceWay, sequence_backward, sequence_forward};

/// The numbers of a cell at one step, `[row, ...]`.
#[expect(clippy::struct_field_names, reason = "the cell of a cell is its cell")]
pub struct Cell<B: Backend> {
    /// Activated gates `[row, 4 * hidden]`.
    pub gates: FloatTensor<B>,
    /// `[row, hidden]`.
    pub cell: FloatTensor<B>,
    /// `[row, hidden]`.
    pub hidden: FloatTensor<B>,
}

/// What happens to each number alone in a step and on the way back through it.
pub trait Pointwise: Backend {
    /// `input` and `recurrent` `[row, 4 * hidden]` are the two shares of the gates before their activations.
    fn cell(input: FloatTensor<Self>, recurrent: FloatTensor<Self>, before: FloatTensor<Self>) -> Cell<Self>;

    /// Gradients of the gates before their activations and of the cells before the step, given those of the hidden states and
    /// of the cells after it.
    fn cell_back(
        gates: FloatTensor<Self>,
        before: FloatTensor<Self>,
        after: FloatTensor<Self>,
        d_hidden: FloatTensor<Self>,
        d_cell: FloatTensor<Self>,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);
}
