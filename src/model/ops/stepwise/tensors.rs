//! Tensors cut, joined and put in order.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Slice, TensorData};
use rprae_recurrent::Plan;

pub(super) fn rows<B: Backend>(tensor: FloatTensor<B>, from: usize, to: usize) -> FloatTensor<B> {
    if from == 0 && tensor.shape()[0] == to {
        return tensor;
    }
    B::float_slice(tensor, &[Slice::new(from as isize, Some(to as isize), 1), Slice::full()])
}

pub(super) fn columns<B: Backend>(tensor: FloatTensor<B>, from: usize, to: usize) -> FloatTensor<B> {
    B::float_slice(tensor, &[Slice::full(), Slice::new(from as isize, Some(to as isize), 1)])
}

pub(super) fn join<B: Backend>(mut tensors: Vec<FloatTensor<B>>, dim: usize) -> FloatTensor<B> {
    if tensors.len() == 1 { tensors.swap_remove(0) } else { B::float_cat(tensors, dim) }
}

pub(super) fn indices<B: Backend>(indices: Vec<usize>, like: &FloatTensor<B>) -> IntTensor<B> {
    let indices: Vec<i32> = indices.into_iter().map(|index| index as i32).collect();
    let count = indices.len();
    B::int_from_data(TensorData::new(indices, [count]), &like.device())
}

pub(super) fn select<B: Backend>(tensor: FloatTensor<B>, rows: Vec<usize>) -> FloatTensor<B> {
    let rows = indices::<B>(rows, &tensor);
    B::float_select(tensor, 0, rows)
}

pub(super) fn zeros<B: Backend>(shape: [usize; 2], like: &FloatTensor<B>) -> FloatTensor<B> {
    B::float_from_data(TensorData::zeros::<f32, _>(shape), &like.device())
}

pub(super) fn add_bias<B: Backend>(product: FloatTensor<B>, bias: FloatTensor<B>) -> FloatTensor<B> {
    let columns = bias.shape()[0];
    B::float_add(product, B::float_reshape(bias, Shape::from([1, columns])))
}

/// The gradient before a tanh, given that after it and the tanh itself.
pub(super) fn tanh_back<B: Backend>(gradient: FloatTensor<B>, said: FloatTensor<B>) -> FloatTensor<B> {
    let slope = B::float_neg(B::float_mul(said.clone(), said));
    B::float_mul(gradient, B::float_add_scalar(slope, 1.0_f32.into()))
}

/// The transpose of `left` times `right`.
pub(super) fn outer<B: Backend>(left: FloatTensor<B>, right: FloatTensor<B>) -> FloatTensor<B> {
    B::float_matmul(B::float_transpose(left), right)
}

pub(super) fn sum_rows<B: Backend>(tensor: FloatTensor<B>) -> FloatTensor<B> {
    let columns = tensor.shape()[1];
    B::float_reshape(B::float_sum_dim(tensor, 0), Shape::from([columns]))
}

/// `[batch, time, column]` as one row for each frame.
pub(super) fn gather<B: Backend>(plan: &Plan, values: FloatTensor<B>, columns: usize) -> FloatTensor<B> {
    let flat = B::float_reshape(values, Shape::from([plan.batch() * plan.width(), columns]));
    select::<B>(flat, plan.places().collect())
}

/// One row for each frame as `[batch, time * column]`, zeros in the padding.
pub(super) fn scatter<B: Backend>(plan: &Plan, frames: FloatTensor<B>) -> FloatTensor<B> {
    let columns = frames.shape()[1];
    let mut from = vec![0; plan.batch() * plan.width()];
    for (frame, place) in plan.places().enumerate() {
        from[place] = frame + 1;
    }
    let padded = B::float_cat(vec![zeros::<B>([1, columns], &frames), frames], 0);
    B::float_reshape(select::<B>(padded, from), Shape::from([plan.batch(), plan.width() * columns]))
}

/// `[frame, column]` of sequences one after the other as one row for each frame.
pub(super) fn gather_packed<B: Backend>(plan: &Plan, values: FloatTensor<B>) -> FloatTensor<B> {
    select::<B>(values, plan.packed_places().collect())
}

/// The reverse of [`gather_packed`].
pub(super) fn scatter_packed<B: Backend>(plan: &Plan, frames: FloatTensor<B>) -> FloatTensor<B> {
    let mut from = vec![0; plan.num_frames()];
    for (frame, place) in plan.packed_places().enumerate() {
        from[place] = frame;
    }
    select::<B>(frames, from)
}

/// For each place in the caller's batch, its row.
pub(super) fn back(plan: &Plan) -> Vec<usize> {
    let mut rows = vec![0; plan.batch()];
    for (row, &index) in plan.order().iter().enumerate() {
        rows[index] = row;
    }
    rows
}
