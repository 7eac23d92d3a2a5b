//! The steps through a layer in both directions.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use rprae_recurrent::Plan;

use super::tensors::{back, join, rows, select, zeros};
use super::{History, Later, Place, Pointwise};

/// Where a step stands.
pub(super) fn place(plan: &Plan, step: usize) -> Place {
    let frames = plan.frames(step);
    Place {
        frame: frames.start,
        before: plan.before(step),
        after: plan.batch() + frames.start,
        rows: frames.len(),
    }
}

/// For each frame, the row before it where those of all frames follow one for each sequence.
pub(super) fn before(plan: &Plan) -> Vec<usize> {
    let places = (0..plan.num_steps()).map(|step| place(plan, step));
    places.flat_map(|place| place.before..place.before + place.rows).collect()
}

/// One layer's way through a batch.
#[derive(Debug, Clone)]
pub(super) struct Layer<B: Backend> {
    history: History<B>,
    /// Hidden states of the latest step.
    latest: FloatTensor<B>,
}

impl<B: Pointwise> Layer<B> {
    /// Before the first step, with initial states in the caller's order; `gates` hold what is known beforehand of them.
    pub(super) fn new(
        plan: &Plan,
        hidden: FloatTensor<B>,
        cell: FloatTensor<B>,
        gates: Option<FloatTensor<B>>,
    ) -> Self {
        let [hidden, cell] = [hidden, cell].map(|state| select::<B>(state, plan.order().to_vec()));
        let (frames, units) = (plan.num_frames(), hidden.shape()[1]);
        let gates = gates.unwrap_or_else(|| B::room(frames, 4 * units, &hidden));
        let history = |state: &FloatTensor<B>| match frames {
            0 => state.clone(),
            _ => join::<B>(vec![state.clone(), B::room(frames, units, state)], 0),
        };
        let history = History { gates, cells: history(&cell), hidden: history(&hidden) };
        Self { history, latest: hidden }
    }

    /// Yields the hidden states of a step; see [`Pointwise::cell`].
    pub(super) fn step(
        &mut self,
        plan: &Plan,
        step: usize,
        heard: Option<(FloatTensor<B>, FloatTensor<B>)>,
        recurrent_weights: &FloatTensor<B>,
    ) -> FloatTensor<B> {
        let place = place(plan, step);
        let hidden = rows::<B>(self.latest.clone(), 0, place.rows);
        let recurrent = B::float_matmul(hidden, recurrent_weights.clone());
        self.latest = B::cell(heard, recurrent, &self.history, place);
        self.latest.clone()
    }

    /// Hidden states of all frames.
    pub(super) fn said(&self, plan: &Plan) -> FloatTensor<B> {
        rows::<B>(self.history.hidden.clone(), plan.batch(), plan.batch() + plan.num_frames())
    }

    /// Hidden states before each frame.
    pub(super) fn heard(&self, plan: &Plan) -> FloatTensor<B> {
        select::<B>(self.history.hidden.clone(), before(plan))
    }

    /// Hidden states and cells after the last frame of each sequence, in the caller's order.
    pub(super) fn last(&self, plan: &Plan) -> (FloatTensor<B>, FloatTensor<B>) {
        let last = plan.last_frames().enumerate();
        let last: Vec<usize> =
            last.map(|(row, frame)| frame.map_or(row, |frame| plan.batch() + frame)).collect();
        let last: Vec<usize> = back(plan).into_iter().map(|row| last[row]).collect();
        (
            select::<B>(self.history.hidden.clone(), last.clone()),
            select::<B>(self.history.cells.clone(), last),
        )
    }
}

/// The gradient of a layer's states on the way back.
pub(super) struct Back<B: Backend> {
    /// Of hidden states after the last frame, sorted.
    last: Option<FloatTensor<B>>,
    /// Of hidden states of the rows at work, none before the first step back.
    hidden: Option<FloatTensor<B>>,
    /// Of the cells of all rows.
    cells: FloatTensor<B>,
    /// Of all gates.
    gates: FloatTensor<B>,
}

impl<B: Pointwise> Back<B> {
    /// Before the last step of a layer; `last` are gradients of hidden states and cells after the last frame, sorted, if there
    /// are any.
    pub(super) fn new(plan: &Plan, layer: &Layer<B>, last: Option<(FloatTensor<B>, FloatTensor<B>)>) -> Self {
        let like = &layer.latest;
        let units = like.shape()[1];
        let (last, cells) = last.unzip();
        let cells = cells.unwrap_or_else(|| zeros::<B>([plan.batch(), units], like));
        Self { last, hidden: None, cells, gates: B::room(plan.num_frames(), 4 * units, like) }
    }

    /// Through one step; yields the gradient of its gates. `above` is that of its hidden states from what heard them, and the
    /// first row of the step there.
    pub(super) fn step(
        &mut self,
        plan: &Plan,
        layer: &Layer<B>,
        step: usize,
        above: Option<(FloatTensor<B>, usize)>,
        recurrent_transposed: &FloatTensor<B>,
    ) -> FloatTensor<B> {
        let later = Later {
            hidden: self.hidden.as_ref().unwrap_or(&self.cells),
            rows: self.hidden.as_ref().map_or(0, |hidden| hidden.shape()[0]),
            last: self.last.as_ref(),
            above,
            cells: &self.cells,
        };
        let gates = B::cell_back(&layer.history, place(plan, step), later, &self.gates);
        self.hidden = Some(B::float_matmul(gates.clone(), recurrent_transposed.clone()));
        gates
    }

    /// Gradients of the initial hidden states and cells in the caller's order, and of all gates, frame by frame.
    pub(super) fn finish(self, plan: &Plan) -> [FloatTensor<B>; 3] {
        let have = self.hidden.as_ref().map_or(0, |hidden| hidden.shape()[0]);
        let mut hidden: Vec<_> = self.hidden.into_iter().collect();
        if have < plan.batch() || plan.batch() == 0 {
            let units = self.cells.shape()[1];
            hidden.push(match self.last {
                Some(last) => rows::<B>(last, have, plan.batch()),
                None => zeros::<B>([plan.batch() - have, units], &self.cells),
            });
        }
        let states = [join::<B>(hidden, 0), self.cells].map(|state| select::<B>(state, back(plan)));
        let [hidden, cells] = states;
        [hidden, cells, self.gates]
    }
}
