//! Recurrences in plain tensor operations, until the fused ones replace them.

use burn::tensor::{Tensor, activation};

/// Weights of a layer, gates in the order input, forget, cell, output.
#[derive(Debug, Clone)]
pub struct LstmWeights {
    /// `[feature, 4 * hidden]`.
    pub input: Tensor<2>,
    /// `[hidden, 4 * hidden]`.
    pub recurrent: Tensor<2>,
    /// `[4 * hidden]`.
    pub bias: Tensor<1>,
}

/// State of a layer.
#[derive(Debug, Clone)]
pub struct LstmState {
    /// `[batch, hidden]`.
    pub hidden: Tensor<2>,
    /// `[batch, hidden]`.
    pub cell: Tensor<2>,
}

/// Order in which a sequence is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// First step first.
    Forward,
    /// Last step first.
    Backward,
}

fn cell(x: Tensor<2>, s: &LstmState, w: &LstmWeights) -> LstmState {
    let g =
        x.matmul(w.input.clone()) + s.hidden.clone().matmul(w.recurrent.clone()) + w.bias.clone().unsqueeze();
    let p = g.chunk(4, 1);
    let (i, f, c, o) = (
        activation::sigmoid(p[0].clone()),
        activation::sigmoid(p[1].clone()),
        p[2].clone().tanh(),
        activation::sigmoid(p[3].clone()),
    );
    let cell = f * s.cell.clone() + i * c;
    LstmState { hidden: o * cell.clone().tanh(), cell }
}
fn gate(t: usize, lengths: &[usize], new: LstmState, old: &LstmState) -> LstmState {
    let device = new.hidden.device();
    let m: Vec<f32> = lengths.iter().map(|&l| if t < l { 1.0 } else { 0.0 }).collect();
    let m = Tensor::<1>::from_floats(m.as_slice(), &device).unsqueeze_dim::<2>(1);
    let pick = |n: Tensor<2>, o: Tensor<2>| n * m.clone() + o * (m.clone().neg() + 1.0);
    LstmState { hidden: pick(new.hidden, old.hidden.clone()), cell: pick(new.cell, old.cell.clone()) }
}
/// One layer over known inputs, `[batch, time, feature]` to `[batch, time, hidden]`.
pub fn lstm_sequence(
    input: Tensor<3>,
    lengths: &[usize],
    initial: Option<LstmState>,
    weights: &LstmWeights,
    direction: Direction,
) -> (Tensor<3>, LstmState) {
    let [b, t, _] = input.dims();
    let h = weights.recurrent.dims()[0];
    let zeros = || Tensor::zeros([b, h], &input.device());
    let mut s = initial.unwrap_or_else(|| LstmState { hidden: zeros(), cell: zeros() });
    let mut outs = vec![None; t];
    let steps: Vec<usize> =
        if direction == Direction::Forward { (0..t).collect() } else { (0..t).rev().collect() };
    for k in steps {
        let n = cell(input.clone().narrow(1, k, 1).squeeze_dim(1), &s, weights);
        s = gate(k, lengths, n, &s);
        outs[k] = Some(s.hidden.clone());
    }
    (Tensor::stack(outs.into_iter().flatten().collect(), 1), s)
}
/// Stacked layers that hear their output, `[batch, time, feature]`.
pub fn lstm_closed_loop(
    first: Tensor<2>,
    lengths: &[usize],
    initial: Vec<LstmState>,
    layers: &[LstmWeights],
    projection: (Tensor<2>, Tensor<1>),
) -> Tensor<3> {
    let t = lengths.iter().copied().max().unwrap_or(0);
    let (mut states, mut x, mut outs) = (initial, first, vec![]);
    for _ in 0..t {
        for (s, w) in states.iter_mut().zip(layers) {
            *s = cell(x, s, w);
            x = s.hidden.clone();
        }
        x = (x.matmul(projection.0.clone()) + projection.1.clone().unsqueeze()).tanh();
        outs.push(x.clone());
    }
    Tensor::stack(outs, 1)
}
/// One layer that hears its most probable word, `[batch, time, vocab]`.
pub fn lstm_closed_loop_words(
    first: Tensor<2>,
    table: Tensor<2>,
    lengths: &[usize],
    initial: LstmState,
    layer: &LstmWeights,
    projection: (Tensor<2>, Tensor<1>),
) -> Tensor<3> {
    let t = lengths.iter().copied().max().unwrap_or(0);
    let (mut s, mut x, mut outs) = (initial, first, vec![]);
    for _ in 0..t {
        s = cell(x, &s, layer);
        let logits = s.hidden.clone().matmul(projection.0.clone()) + projection.1.clone().unsqueeze();
        x = table.clone().select(0, logits.clone().argmax(1).squeeze_dim(1));
        outs.push(logits);
    }
    Tensor::stack(outs, 1)
}
