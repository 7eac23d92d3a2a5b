//! Recurrences as single operations, forward and backward.
//!
//! A tape that records every step of a long short-term memory spends most of its time on bookkeeping and on padding. Here a
//! whole batch of sequences of mixed lengths is one operation with a backward pass written by hand: the CPU runs the kernels of
//! `rprae-recurrent`, a GPU goes step by step with the numbers of a cell in one launch.
//!
//! The equations, with `*` for the product of numbers at the same place:
//!
//! ```text
//! [i f g o] = x W_input + h W_recurrent + b      c' = s(f) * c + s(i) * tanh(g)      h' = s(o) * tanh(c')
//! ```

mod backend;
#[cfg(feature = "wgpu")]
mod cube;
mod native;
#[cfg(feature = "wgpu")]
mod stepwise;
mod tape;

use burn::backend::Dispatch;
use burn::tensor::Tensor;
pub use rprae_recurrent::Activation;

use backend::{Layer, RecurrentOps, Stack};

/// Weights of a long short-term memory, gates in the order input, forget, cell, output.
#[derive(Debug, Clone)]
pub struct LstmWeights {
    /// `[feature, 4 * hidden]`.
    pub input: Tensor<2>,
    /// `[hidden, 4 * hidden]`.
    pub recurrent: Tensor<2>,
    /// `[4 * hidden]`.
    pub bias: Tensor<1>,
}

/// Hidden states and cells, `[batch, hidden]` each.
#[derive(Debug, Clone)]
pub struct LstmState {
    /// What the layer says.
    pub hidden: Tensor<2>,
    /// What the layer remembers.
    pub cell: Tensor<2>,
}

/// The order in which a sequence is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the first frame to the last.
    Forward,
    /// From the last valid frame to the first.
    Backward,
}

/// A layer over `input` `[batch, time, feature]`, the first `lengths[i]` frames of sequence `i`; zeros to begin with if no
/// state is given.
///
/// Yields the hidden states `[batch, time, hidden]`, at the time of the frame they belong to and zero in the padding, and the
/// state after the last frame read, which is the initial one for an empty sequence. What stands in the padding has no effect.
///
/// # Panics
///
/// If the shapes do not fit together, or a length exceeds `time`.
#[must_use]
pub fn lstm_sequence(
    input: Tensor<3>,
    lengths: &[usize],
    initial: Option<LstmState>,
    weights: &LstmWeights,
    direction: Direction,
) -> (Tensor<3>, LstmState) {
    let [batch, time, _] = input.dims();
    let hidden = weights.recurrent.dims()[0];
    let all = sequence(input, lengths, initial, weights, direction, true);
    let output = all.clone().narrow(1, 0, time * hidden).reshape([batch, time, hidden]);
    (output, state(&all, time * hidden))
}

/// The state [`lstm_sequence`] ends with, without the cost of the hidden states on the way.
///
/// # Panics
///
/// See [`lstm_sequence`].
#[must_use]
pub fn lstm_last_state(
    input: Tensor<3>,
    lengths: &[usize],
    initial: Option<LstmState>,
    weights: &LstmWeights,
    direction: Direction,
) -> LstmState {
    state(&sequence(input, lengths, initial, weights, direction, false), 0)
}

/// Hidden states and cells that stand side by side from column `first` on.
fn state(all: &Tensor<2>, first: usize) -> LstmState {
    let hidden = (all.dims()[1] - first) / 2;
    LstmState {
        hidden: all.clone().narrow(1, first, hidden),
        cell: all.clone().narrow(1, first + hidden, hidden),
    }
}

fn sequence(
    input: Tensor<3>,
    lengths: &[usize],
    initial: Option<LstmState>,
    weights: &LstmWeights,
    direction: Direction,
    outputs: bool,
) -> Tensor<2> {
    let [batch, _, feature] = input.dims();
    let hidden = check(weights, feature, batch, lengths);
    let zeros = || Tensor::zeros([batch, hidden], &input.device());
    let initial = initial.unwrap_or_else(|| LstmState { hidden: zeros(), cell: zeros() });
    Tensor::from_dispatch(<Dispatch as RecurrentOps>::recurrent_sequence(
        input.into_dispatch(),
        initial.hidden.into_dispatch(),
        initial.cell.into_dispatch(),
        weights.input.clone().into_dispatch(),
        weights.recurrent.clone().into_dispatch(),
        weights.bias.clone().into_dispatch(),
        lengths.to_vec(),
        direction,
        outputs,
    ))
}

/// Stacked layers whose output `tanh(h W + b)` is their next input: `[frame, feature]`, one sequence after the other.
///
/// `first` `[batch, feature]` is the input of the first step, `initial` has one state for each layer, from the bottom up, and
/// `projection` is `W` `[hidden, feature]` with `b` `[feature]`.
///
/// # Panics
///
/// If the shapes do not fit together, or there are no layers or more than three.
#[must_use]
pub fn lstm_closed_loop(
    first: Tensor<2>,
    lengths: &[usize],
    initial: Vec<LstmState>,
    layers: &[LstmWeights],
    projection: (Tensor<2>, Tensor<1>),
) -> Tensor<2> {
    let [batch, feature] = first.dims();
    let stack = stack(batch, feature, lengths, initial, layers);
    Tensor::from_dispatch(<Dispatch as RecurrentOps>::recurrent_closed_loop(
        first.into_dispatch(),
        projection.0.into_dispatch(),
        projection.1.into_dispatch(),
        stack,
        lengths.to_vec(),
    ))
}

/// Stacked layers over known inputs `[batch, time, feature]`, and what the top one says, `h W + b` or its tanh:
/// `[frame, output]`, one sequence after the other.
///
/// `initial` has one state for each layer, from the bottom up, and `projection` is `W` `[hidden, output]` with `b` `[output]`.
/// What stands in the padding has no effect.
///
/// # Panics
///
/// If the shapes do not fit together, a length exceeds `time`, or there are no layers or more than three.
#[must_use]
pub fn lstm_open_loop(
    inputs: Tensor<3>,
    lengths: &[usize],
    initial: Vec<LstmState>,
    layers: &[LstmWeights],
    projection: (Tensor<2>, Tensor<1>),
    activation: Activation,
) -> Tensor<2> {
    let [batch, _, feature] = inputs.dims();
    let stack = stack(batch, feature, lengths, initial, layers);
    Tensor::from_dispatch(<Dispatch as RecurrentOps>::recurrent_open_loop(
        inputs.into_dispatch(),
        projection.0.into_dispatch(),
        projection.1.into_dispatch(),
        stack,
        lengths.to_vec(),
        activation,
    ))
}

/// Layers that fit together, with their initial states.
fn stack(
    batch: usize,
    mut feature: usize,
    lengths: &[usize],
    initial: Vec<LstmState>,
    layers: &[LstmWeights],
) -> Stack<Dispatch> {
    assert_eq!(initial.len(), layers.len(), "one initial state for each layer");
    let mut stack = layers.iter().zip(initial).map(|(weights, state)| {
        feature = check(weights, feature, batch, lengths);
        layer(weights, state)
    });
    match (stack.next(), stack.next(), stack.next(), stack.next()) {
        (Some(a), None, None, None) => Stack::One(a),
        (Some(a), Some(b), None, None) => Stack::Two(a, b),
        (Some(a), Some(b), Some(c), None) => Stack::Three(a, b, c),
        _ => panic!("{} layers; a decoder has one to three", layers.len()),
    }
}

/// Weights and initial state of a layer as the dispatch takes them.
fn layer(weights: &LstmWeights, state: LstmState) -> Layer<Dispatch> {
    Layer {
        input: weights.input.clone().into_dispatch(),
        recurrent: weights.recurrent.clone().into_dispatch(),
        bias: weights.bias.clone().into_dispatch(),
        hidden: state.hidden.into_dispatch(),
        cell: state.cell.into_dispatch(),
    }
}

/// A layer that says words: logits `h W + b` `[frame, vocab]`, one sequence after the other.
///
/// `first` `[batch, dimension]` is the input of the first step. Every later one is the row of `table` `[vocab, dimension]` at
/// the greatest logit of the step before, the first of equals. The choice of the word has no gradient; its row has.
///
/// # Panics
///
/// If the shapes do not fit together.
#[must_use]
pub fn lstm_closed_loop_words(
    first: Tensor<2>,
    table: Tensor<2>,
    lengths: &[usize],
    initial: LstmState,
    weights: &LstmWeights,
    projection: (Tensor<2>, Tensor<1>),
) -> Tensor<2> {
    let [batch, feature] = first.dims();
    check(weights, feature, batch, lengths);
    Tensor::from_dispatch(<Dispatch as RecurrentOps>::recurrent_words(
        first.into_dispatch(),
        projection.0.into_dispatch(),
        projection.1.into_dispatch(),
        table.into_dispatch(),
        layer(weights, initial),
        lengths.to_vec(),
    ))
}

/// Units of a layer whose shapes fit together.
fn check(weights: &LstmWeights, feature: usize, batch: usize, lengths: &[usize]) -> usize {
    let hidden = weights.recurrent.dims()[0];
    assert_eq!(weights.recurrent.dims(), [hidden, 4 * hidden], "recurrent weights");
    assert_eq!(weights.input.dims(), [feature, 4 * hidden], "input weights");
    assert_eq!(weights.bias.dims(), [4 * hidden], "bias");
    assert_eq!(lengths.len(), batch, "one length for each sequence");
    hidden
}
