//! Recurrences on a tape: one node each, whatever the number of steps.

#![expect(clippy::redundant_closure_for_method_calls, reason = "the path of the method is not public")]

use std::sync::Arc;

use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;

use super::backend::{
    DecoderTask, Hears, Layer, RecurrentBackend, RecurrentOps, SequenceInputs, SequenceTask, Stack,
    decoder_inputs,
};
use super::{Activation, Direction};

/// What was kept for the way back, without a copy if nobody else holds it.
fn own<T: Clone>(kept: Arc<T>) -> T {
    Arc::try_unwrap(kept).unwrap_or_else(|kept| (*kept).clone())
}

#[derive(Debug)]
struct SequenceBack;

impl<B: RecurrentBackend> Backward<B, 6> for SequenceBack {
    type State = (Arc<B::Sequence>, SequenceInputs<B>, SequenceTask);

    fn backward(self, ops: Ops<Self::State, 6>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gradient = grads.consume::<B>(&ops.node);
        let (way, inputs, task) = ops.state;
        let want_input = ops.parents[0].is_some();
        let gradients = B::sequence_backward(own(way), inputs, gradient, &task, want_input);
        for (parent, gradient) in ops.parents.into_iter().zip(gradients) {
            if let (Some(parent), Some(gradient)) = (parent, gradient) {
                grads.register::<B>(parent.id, gradient);
            }
        }
    }
}

#[derive(Debug)]
struct DecoderBack;

impl<B: RecurrentBackend, const N: usize> Backward<B, N> for DecoderBack {
    type State = (Arc<B::Decoder>, Vec<FloatTensor<B>>, DecoderTask);

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gradient = grads.consume::<B>(&ops.node);
        let (way, inputs, task) = ops.state;
        let want_inputs = ops.parents[0].is_some();
        let gradients = B::decoder_backward(own(way), inputs, gradient, &task, want_inputs);
        for (parent, gradient) in ops.parents.into_iter().zip(gradients) {
            if let (Some(parent), Some(gradient)) = (parent, gradient) {
                grads.register::<B>(parent.id, gradient);
            }
        }
    }
}

/// A decoder with `N` inputs.
fn decoder<B: RecurrentBackend, C: CheckpointStrategy, const N: usize>(
    inputs: Vec<FloatTensor<Autodiff<B, C>>>,
    task: DecoderTask,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = std::array::from_fn::<_, N, _>(|index| inputs[index].node());
    let inputs: Vec<FloatTensor<B>> = inputs.into_iter().map(|input| input.into_primitive()).collect();
    match DecoderBack.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let (output, way) = B::decoder_forward(inputs.clone(), &task);
            prepared.finish((Arc::new(way), inputs, task), output)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(B::decoder_forward(inputs, &task).0),
    }
}

/// A decoder without a table.
fn stacked<B: RecurrentBackend, C: CheckpointStrategy>(
    inputs: [FloatTensor<Autodiff<B, C>>; 3],
    stack: Stack<Autodiff<B, C>>,
    task: DecoderTask,
) -> FloatTensor<Autodiff<B, C>> {
    let inputs = decoder_inputs(inputs, stack, None);
    // The tape wants to know the number of inputs when it is compiled.
    match inputs.len() {
        8 => decoder::<B, C, 8>(inputs, task),
        13 => decoder::<B, C, 13>(inputs, task),
        _ => decoder::<B, C, 18>(inputs, task),
    }
}

impl<B: RecurrentBackend, C: CheckpointStrategy> RecurrentOps for Autodiff<B, C> {
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
    ) -> FloatTensor<Self> {
        let inputs = [input, hidden, cell, input_weights, recurrent_weights, bias];
        let nodes = inputs.each_ref().map(|input| input.node());
        let inputs: SequenceInputs<B> = inputs.map(|input| input.into_primitive());
        let task = SequenceTask { lengths, direction, outputs };
        match SequenceBack.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prepared) => {
                let (output, way) = B::sequence_forward(inputs.clone(), &task);
                prepared.finish((Arc::new(way), inputs, task), output)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::sequence_forward(inputs, &task).0),
        }
    }

    fn recurrent_closed_loop(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        stack: Stack<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self> {
        stacked([first, projection, projection_bias], stack, DecoderTask { lengths, hears: Hears::Own })
    }

    fn recurrent_open_loop(
        inputs: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        stack: Stack<Self>,
        lengths: Vec<usize>,
        activation: Activation,
    ) -> FloatTensor<Self> {
        let task = DecoderTask { lengths, hears: Hears::Known(activation) };
        stacked([inputs, projection, projection_bias], stack, task)
    }

    fn recurrent_words(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        table: FloatTensor<Self>,
        layer: Layer<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self> {
        let inputs = decoder_inputs([first, projection, projection_bias], Stack::One(layer), Some(table));
        decoder::<B, C, 9>(inputs, DecoderTask { lengths, hears: Hears::Words })
    }
}
