//! The steps through a layer in both directions.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use rprae_recurrent::Plan;

use super::Pointwise;
use super::tensors::{back, join, rows, select, zeros};

/// One layer's way through a batch.
#[derive(Debug, Clone)]
pub(super) struct Layer<B: Backend> {
    /// Of each step: activated gates, cells before and after, hidden states before and after.
    pub(super) gates: Vec<FloatTensor<B>>,
    pub(super) before: Vec<FloatTensor<B>>,
    pub(super) after: Vec<FloatTensor<B>>,
    pub(super) heard: Vec<FloatTensor<B>>,
    pub(super) said: Vec<FloatTensor<B>>,
    pub(super) hidden: FloatTensor<B>,
    pub(super) cell: FloatTensor<B>,
    /// States of sequences that have ended, the longest ones last.
    pub(super) ended: Vec<(FloatTensor<B>, FloatTensor<B>)>,
}

impl<B: Pointwise> Layer<B> {
    pub(super) fn new(plan: &Plan, hidden: FloatTensor<B>, cell: FloatTensor<B>) -> Self {
        Self {
            gates: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
            heard: Vec::new(),
            said: Vec::new(),
            hidden: select::<B>(hidden, plan.order().to_vec()),
            cell: select::<B>(cell, plan.order().to_vec()),
            ended: Vec::new(),
        }
    }

    /// Keeps the first `count` rows and puts the others aside.
    pub(super) fn shrink(&mut self, count: usize) {
        let size = self.hidden.shape()[0];
        if count < size {
            let rest = |tensor: &FloatTensor<B>| rows::<B>(tensor.clone(), count, size);
            self.ended.push((rest(&self.hidden), rest(&self.cell)));
            self.hidden = rows::<B>(self.hidden.clone(), 0, count);
            self.cell = rows::<B>(self.cell.clone(), 0, count);
        }
    }

    pub(super) fn step(
        &mut self,
        input: FloatTensor<B>,
        recurrent_weights: &FloatTensor<B>,
    ) -> FloatTensor<B> {
        self.shrink(input.shape()[0]);
        let recurrent = B::float_matmul(self.hidden.clone(), recurrent_weights.clone());
        let cell = B::cell(input, recurrent, self.cell.clone());
        self.heard.push(std::mem::replace(&mut self.hidden, cell.hidden));
        self.before.push(std::mem::replace(&mut self.cell, cell.cell));
        self.after.push(self.cell.clone());
        self.gates.push(cell.gates);
        self.said.push(self.hidden.clone());
        self.hidden.clone()
    }

    /// States after the last frame of each sequence, in the caller's order.
    pub(super) fn last(&self, plan: &Plan) -> (FloatTensor<B>, FloatTensor<B>) {
        let running = (self.hidden.shape()[0] > 0).then(|| (self.hidden.clone(), self.cell.clone()));
        let (hidden, cell) = running.into_iter().chain(self.ended.iter().rev().cloned()).unzip();
        (select::<B>(join::<B>(hidden, 0), back(plan)), select::<B>(join::<B>(cell, 0), back(plan)))
    }
}

/// The gradient of a layer's states on the way back.
pub(super) struct Back<B: Backend> {
    /// Of the states after the last frame, sorted.
    last: Option<(FloatTensor<B>, FloatTensor<B>)>,
    /// Of the states of the rows at work, none before the first step back.
    running: Option<(FloatTensor<B>, FloatTensor<B>)>,
    batch: usize,
    units: usize,
    /// Gradients of the gates, from the last step to the first.
    gates: Vec<FloatTensor<B>>,
}

impl<B: Pointwise> Back<B> {
    /// Before the last step of a layer; `last` are gradients of the states after the last frame, sorted, if there are any.
    pub(super) fn new(plan: &Plan, layer: &Layer<B>, last: Option<(FloatTensor<B>, FloatTensor<B>)>) -> Self {
        let units = layer.cell.shape()[1];
        Self { last, running: None, batch: plan.batch(), units, gates: Vec::new() }
    }

    /// States of the first `count` rows; those that end here join with the gradient of their last state.
    pub(super) fn grow(&mut self, count: usize, like: &FloatTensor<B>) -> (FloatTensor<B>, FloatTensor<B>) {
        let have = self.running.as_ref().map_or(0, |(hidden, _)| hidden.shape()[0]);
        let (mut hidden, mut cell): (Vec<_>, Vec<_>) = self.running.take().into_iter().unzip();
        if count > have || (count == 0 && have == 0) {
            #[expect(clippy::single_match_else, reason = "two ways of the same length")]
            let (new_hidden, new_cell) = match &self.last {
                Some((hidden, cell)) => {
                    (rows::<B>(hidden.clone(), have, count), rows::<B>(cell.clone(), have, count))
                }
                None => {
                    let new = zeros::<B>([count - have, self.units], like);
                    (new.clone(), new)
                }
            };
            hidden.push(new_hidden);
            cell.push(new_cell);
        }
        (join::<B>(hidden, 0), join::<B>(cell, 0))
    }

    /// Through one step; yields the gradient of the gates.
    pub(super) fn step(
        &mut self,
        layer: &Layer<B>,
        step: usize,
        above: Option<FloatTensor<B>>,
        recurrent_transposed: &FloatTensor<B>,
    ) -> FloatTensor<B> {
        let gates = layer.gates[step].clone();
        let (mut d_hidden, d_cell) = self.grow(gates.shape()[0], &gates);
        if let Some(above) = above {
            d_hidden = B::float_add(d_hidden, above);
        }
        let (before, after) = (layer.before[step].clone(), layer.after[step].clone());
        let (d_gates, d_cell) = B::cell_back(gates, before, after, d_hidden, d_cell);
        let d_hidden = B::float_matmul(d_gates.clone(), recurrent_transposed.clone());
        self.running = Some((d_hidden, d_cell));
        self.gates.push(d_gates.clone());
        d_gates
    }

    /// Gradients of the initial states in the caller's order, and of all gates, frame by frame.
    pub(super) fn finish(
        mut self,
        plan: &Plan,
        like: &FloatTensor<B>,
    ) -> (FloatTensor<B>, FloatTensor<B>, FloatTensor<B>) {
        let (hidden, cell) = self.grow(self.batch, like);
        self.gates.reverse();
        let gates = if self.gates.is_empty() {
            zeros::<B>([0, 4 * self.units], like)
        } else {
            join::<B>(self.gates, 0)
        };
        (select::<B>(hidden, back(plan)), select::<B>(cell, back(plan)), gates)
    }
}
