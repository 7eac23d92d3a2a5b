//! Recurrences on a tape: one node each, whatever the number of steps.

#![expect(clippy::redundant_closure_for_method_calls, reason = "the path of the method is not public")]

use std::sync::Arc;

use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;

use super::Direction;
use super::backend::{
    Layer, RecurrentBackend, RecurrentOps, SequenceInputs, SequenceTask, Stack, closed_loop_inputs,
};

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
struct ClosedLoopBack;

impl<B: RecurrentBackend, const N: usize> Backward<B, N> for ClosedLoopBack {
    type State = (Arc<B::ClosedLoop>, Vec<FloatTensor<B>>, bool);

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gradient = grads.consume::<B>(&ops.node);
        let (way, inputs, words) = ops.state;
        let gradients = B::closed_loop_backward(own(way), inputs, gradient, words);
        for (parent, gradient) in ops.parents.into_iter().zip(gradients) {
            if let Some(parent) = parent {
                grads.register::<B>(parent.id, gradient);
            }
        }
    }
}

/// A closed loop with `N` inputs.
fn closed_loop<B: RecurrentBackend, C: CheckpointStrategy, const N: usize>(
    inputs: Vec<FloatTensor<Autodiff<B, C>>>,
    lengths: &[usize],
    words: bool,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = std::array::from_fn::<_, N, _>(|index| inputs[index].node());
    let inputs: Vec<FloatTensor<B>> = inputs.into_iter().map(|input| input.into_primitive()).collect();
    match ClosedLoopBack.prepare::<C>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let (output, way) = B::closed_loop_forward(inputs.clone(), lengths, words);
            prepared.finish((Arc::new(way), inputs, words), output)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(B::closed_loop_forward(inputs, lengths, words).0),
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
        let inputs = closed_loop_inputs([first, projection, projection_bias], stack, None);
        // The tape wants to know the number of inputs when it is compiled.
        match inputs.len() {
            8 => closed_loop::<B, C, 8>(inputs, &lengths, false),
            13 => closed_loop::<B, C, 13>(inputs, &lengths, false),
            _ => closed_loop::<B, C, 18>(inputs, &lengths, false),
        }
    }

    fn recurrent_words(
        first: FloatTensor<Self>,
        projection: FloatTensor<Self>,
        projection_bias: FloatTensor<Self>,
        table: FloatTensor<Self>,
        layer: Layer<Self>,
        lengths: Vec<usize>,
    ) -> FloatTensor<Self> {
        let inputs = closed_loop_inputs([first, projection, projection_bias], Stack::One(layer), Some(table));
        closed_loop::<B, C, 9>(inputs, &lengths, true)
    }
}
