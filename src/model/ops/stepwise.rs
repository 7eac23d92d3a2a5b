//! Recurrences step by step with the operations of any backend, for devices without kernels of their own for whole sequences.
//!
//! What differs from a tape that records every step: no work on padding, one product for all inputs known beforehand, one product
//! for each gradient of weights, and the numbers of a cell in one launch, which leaves them where those of all steps stand.

mod closed_loop;
mod decoder;
mod layer;
mod open_loop;
mod sequence;
mod tensors;

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;

use super::Activation;

pub use decoder::{DecoderWay, decoder_backward, decoder_forward};
pub use sequence::{SequenceWay, sequence_backward, sequence_forward};

/// What a layer remembers of a batch on a device: one matrix for all steps, which each step writes its rows of.
#[derive(Debug, Clone)]
pub struct History<B: Backend> {
    /// Activated gates, `[frame, 4 * hidden]`.
    pub gates: FloatTensor<B>,
    /// Initial cells and then those of each frame, `[sequence and frame, hidden]`.
    pub cells: FloatTensor<B>,
    /// Hidden states, like the cells.
    pub hidden: FloatTensor<B>,
}

/// First rows of a step.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Among the frames.
    pub frame: usize,
    /// Of the states before it.
    pub before: usize,
    /// Of the states after it.
    pub after: usize,
    /// Sequences at work.
    pub rows: usize,
}

/// Gradients of the states after a step.
pub struct Later<'a, B: Backend> {
    /// Of hidden states from the step after, `[row, hidden]`, of the first sequences; anything where there are none.
    pub hidden: &'a FloatTensor<B>,
    /// How many of them.
    pub rows: usize,
    /// Of hidden states after the last frame, `[sequence, hidden]`, if there are any: those of sequences that end here.
    pub last: Option<&'a FloatTensor<B>>,
    /// Of hidden states from what heard them, and the first row of this step among them.
    pub above: Option<(FloatTensor<B>, usize)>,
    /// Of cells, `[sequence, hidden]`; written: of those before the step afterwards.
    pub cells: &'a FloatTensor<B>,
}

/// What happens to each number alone in a step and on the way back through it, each in one launch.
///
/// What is said to be written is written in place.
pub trait Pointwise: Backend {
    /// A matrix of which nothing is read before it is written.
    fn room(rows: usize, columns: usize, like: &FloatTensor<Self>) -> FloatTensor<Self>;

    /// Writes a step's gates, cells and hidden states to the history, and yields the latter alone, `[row, hidden]`.
    ///
    /// `heard` is the input's share of the gates `[row, 4 * hidden]` and the bias, none where the gates hold both already;
    /// `recurrent` is the share of the hidden states before.
    fn cell(
        heard: Option<(FloatTensor<Self>, FloatTensor<Self>)>,
        recurrent: FloatTensor<Self>,
        history: &History<Self>,
        place: Place,
    ) -> FloatTensor<Self>;

    /// Writes gradients of a step's gates before their activations to `d_gates`, and yields them alone, `[row, 4 * hidden]`;
    /// writes `later.cells`.
    fn cell_back(
        history: &History<Self>,
        place: Place,
        later: Later<'_, Self>,
        d_gates: &FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// Writes what is said at a step to `outputs`, from `frame` on, and yields it alone.
    fn say(
        projected: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        activation: Activation,
        outputs: &FloatTensor<Self>,
        frame: usize,
    ) -> FloatTensor<Self>;

    /// Writes gradients before the tanh of a step's outputs to `d_projected`, and yields them alone.
    ///
    /// Those of the outputs are added to those of the inputs that the first `heard.1` of them became.
    fn say_back(
        d_outputs: FloatTensor<Self>,
        outputs: FloatTensor<Self>,
        heard: (FloatTensor<Self>, usize),
        d_projected: &FloatTensor<Self>,
        place: Place,
    ) -> FloatTensor<Self>;
}
