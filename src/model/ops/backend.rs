//! What a backend must do for the recurrences.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType, backend_extension};
use rprae_recurrent::Activation;

use super::Direction;

/// Recurrences as operations that every backend understands, those with a tape included.
#[backend_extension(Autodiff, Flex, Cube: cfg(feature = "wgpu"))]
pub trait RecurrentOps: Backend {
    /// A layer over known inputs. `[batch, columns]`: hidden states `[time, hidden]` of each sequence if `outputs`, then its
    /// last hidden state and cell.
    #[allow(
        clippy::too_many_arguments,
        reason = "the dispatch takes tensors one by one, here and in what it expands to"
    )]
    fn recurrent_sequence(
        input: FloatTensor<Self>,
        hidden: FloatTensor<Self>,
        cell: FloatTensor<Self>,
        input_weights: FloatTensor<Self>,
        recurrent_weights: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        lengths: Vec<usize>,
        direction: Direction,
        outputs: bool,
    ) -> FloatTensor<Self>;

    /// Stacked layers whose output is their next input, `[frame, feature]`.
    fn recurrent_closed_loop(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        #[extension_type] stack: Stack<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self>;

    /// Stacked layers over known inputs, `[frame, output]`.
    fn recurrent_open_loop(
        inputs: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        #[extension_type] stack: Stack<Self>,
        lengths: Vec<usize>,
        activation: Activation,
    ) -> FloatTensor<Self>;

    /// A layer that hears the words it says, `[frame, vocab]`.
    fn recurrent_words(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        table: FloatTensor<Self>,
        #[extension_type] layer: Layer<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self>;
}

/// Weights and initial state of a layer.
#[derive(ExtensionType)]
pub struct Layer<B: Backend> {
    pub input: FloatTensor<B>,
    pub recurrent: FloatTensor<B>,
    pub bias: FloatTensor<B>,
    pub hidden: FloatTensor<B>,
    pub cell: FloatTensor<B>,
}

/// Layers from the bottom up. The dispatch knows no lists.
#[derive(ExtensionType)]
pub enum Stack<B: Backend> {
    One(#[extension_type] Layer<B>),
    Two(#[extension_type] Layer<B>, #[extension_type] Layer<B>),
    Three(#[extension_type] Layer<B>, #[extension_type] Layer<B>, #[extension_type] Layer<B>),
}

impl<B: Backend> Layer<B> {
    fn into_inputs(self) -> [FloatTensor<B>; 5] {
        [self.input, self.recurrent, self.bias, self.hidden, self.cell]
    }
}

/// Inputs of a decoder as a list: the first input, or all of them, the projection's weights and bias, then for each layer its
/// weights (input, recurrent, bias) and initial state (hidden, cell), and last the table, if there is one.
pub fn decoder_inputs<B: Backend>(
    [first, projection, bias]: [FloatTensor<B>; 3],
    stack: Stack<B>,
    table: Option<FloatTensor<B>>,
) -> Vec<FloatTensor<B>> {
    let layers = match stack {
        Stack::One(a) => vec![a],
        Stack::Two(a, b) => vec![a, b],
        Stack::Three(a, b, c) => vec![a, b, c],
    };
    let mut inputs = vec![first, projection, bias];
    inputs.extend(layers.into_iter().flat_map(Layer::into_inputs));
    inputs.extend(table);
    inputs
}

/// Tensors of [`RecurrentOps::recurrent_sequence`], in its order.
pub type SequenceInputs<B> = [FloatTensor<B>; 6];

/// What [`RecurrentOps::recurrent_sequence`] is asked for.
#[derive(Debug, Clone)]
pub struct SequenceTask {
    pub lengths: Vec<usize>,
    pub direction: Direction,
    pub outputs: bool,
}

/// What a decoder is asked for.
#[derive(Debug, Clone)]
pub struct DecoderTask {
    pub lengths: Vec<usize>,
    pub hears: Hears,
}

/// What a decoder hears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hears {
    /// Known inputs; see [`RecurrentOps::recurrent_open_loop`].
    Known(Activation),
    /// Its output, which is a tanh; see [`RecurrentOps::recurrent_closed_loop`].
    Own,
    /// The words it says; see [`RecurrentOps::recurrent_words`].
    Words,
}

impl Hears {
    /// What becomes of the projection.
    pub fn activation(self) -> Activation {
        match self {
            Self::Known(activation) => activation,
            Self::Own => Activation::Tanh,
            Self::Words => Activation::None,
        }
    }
}

/// A backend that computes recurrences and their gradients.
pub trait RecurrentBackend: Backend {
    /// What the way back needs of a way through a sequence.
    type Sequence: Clone + Send + Sync + Debug + 'static;
    /// What the way back needs of a way through a decoder.
    type Decoder: Clone + Send + Sync + Debug + 'static;

    /// See [`RecurrentOps::recurrent_sequence`].
    fn sequence_forward(
        inputs: SequenceInputs<Self>,
        task: &SequenceTask,
    ) -> (FloatTensor<Self>, Self::Sequence);

    /// Gradients of the inputs, in their order; that of the first may be missing unless `want_input`.
    fn sequence_backward(
        way: Self::Sequence,
        inputs: SequenceInputs<Self>,
        gradient: FloatTensor<Self>,
        task: &SequenceTask,
        want_input: bool,
    ) -> [Option<FloatTensor<Self>>; 6];

    /// The output of a decoder; the inputs as [`decoder_inputs`] orders them.
    fn decoder_forward(
        inputs: Vec<FloatTensor<Self>>,
        task: &DecoderTask,
    ) -> (FloatTensor<Self>, Self::Decoder);

    /// Gradients of the inputs, in their order; that of known inputs may be missing unless `want_inputs`.
    fn decoder_backward(
        way: Self::Decoder,
        inputs: Vec<FloatTensor<Self>>,
        gradient: FloatTensor<Self>,
        task: &DecoderTask,
        want_inputs: bool,
    ) -> Vec<Option<FloatTensor<Self>>>;
}
