//! Gradients of weights: sums over all frames, part after part.

use rayon::prelude::*;
use rprae_lanes::Instructions;

use crate::kernel::{Outer, Right, Run, groups};
use crate::lanes::Number;
use crate::layer::History;
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;
use crate::weights::{LayerGradients, Packed, unpack_columns, unpack_gates};

/// A layer's way through a part of a batch, once its gates hold gradients.
pub(crate) struct Gone<'a, T: Number> {
    pub(crate) plan: &'a Plan,
    pub(crate) history: &'a History<T>,
    /// What was heard, frame 0 at `first_row`.
    pub(crate) input: &'a Panels<T>,
    pub(crate) first_row: usize,
}

/// Gradients of a layer's weights: sums over all frames, part after part.
pub(crate) fn weight_gradients<T: Number>(
    instructions: Instructions,
    parts: &[Gone<'_, T>],
) -> LayerGradients<T> {
    let lanes = T::lanes(instructions);
    let hidden = parts.first().map_or(0, |part| part.history.hidden_units);
    let mut bias = Panels::<T>::zeros(1, hidden.div_ceil(lanes) * WIDE * lanes, WIDE * lanes).panels;
    let heard: Vec<Factors<'_, T>> = parts
        .iter()
        .map(|part| {
            let run = Run { left: part.first_row, right: 0, rows: part.plan.num_frames() };
            Factors { left: part.input, right: &part.history.gates, runs: vec![run] }
        })
        .collect();
    let before: Vec<Factors<'_, T>> = parts
        .iter()
        .map(|part| {
            let mut runs: Vec<Run> = Vec::new();
            for step in 0..part.plan.num_steps() {
                let (left, frames) = (part.plan.before(step), part.plan.frames(step));
                match runs.last_mut() {
                    Some(run) if run.left + run.rows == left => run.rows += frames.len(),
                    _ => runs.push(Run { left, right: frames.start, rows: frames.len() }),
                }
            }
            Factors { left: &part.history.hidden, right: &part.history.gates, runs }
        })
        .collect();
    let (input, recurrent) = rayon::join(
        || unpack_gates(&outer(instructions, &heard, Some(&mut bias)), hidden, lanes),
        || unpack_gates(&outer(instructions, &before, None), hidden, lanes),
    );
    LayerGradients { input, recurrent, bias: unpack_gates(&bias, hidden, lanes) }
}

/// Two matrices and the rows of theirs that belong together.
pub(crate) struct Factors<'a, T: Number> {
    pub(crate) left: &'a Panels<T>,
    pub(crate) right: &'a Panels<T>,
    pub(crate) runs: Vec<Run>,
}

/// Wide panels of the right that one task takes through each group of rows: as many as leave every thread a few tasks.
fn together(panels: usize) -> usize {
    (panels / (8 * rayon::current_num_threads())).clamp(1, 4)
}

/// The sum over rows of left row times right row, one buffer for each wide panel of the right.
fn outer<T: Number>(
    instructions: Instructions,
    factors: &[Factors<'_, T>],
    right_sums: Option<&mut Packed<T>>,
) -> Packed<T> {
    let groups: Vec<Vec<Vec<Run>>> = factors.iter().map(|factors| groups(&factors.runs)).collect();
    let Some(Factors { left, right, .. }) = factors.first() else { return Packed::zeros(0, 0) };
    let mut sums = Packed::zeros(right.panels.len(), left.columns * right.width);
    let mut right_sums: Vec<Option<&mut [T]>> = match right_sums {
        Some(right_sums) => right_sums.iter_mut().map(Some).collect(),
        None => (0..right.panels.len()).map(|_| None).collect(),
    };
    let together = together(right.panels.len());
    let tasks = sums.par_groups_mut(together).zip(right_sums.par_chunks_mut(together));
    tasks.enumerate().for_each(|(task, (sums, right_sums))| {
        let mut sums: Vec<_> = sums.zip(right_sums).collect();
        for (factors, groups) in factors.iter().zip(&groups) {
            let mut rights: Vec<_> = sums
                .iter_mut()
                .enumerate()
                .map(|(index, (sums, total))| Right {
                    panel: &factors.right.panels[task * together + index],
                    sums,
                    total: total.as_deref_mut(),
                })
                .collect();
            T::run(instructions, Outer { left: factors.left, groups, rights: &mut rights });
        }
    });
    sums
}

/// The outer product in the caller's order, `[left column, right column]`, and the sum of the right rows.
pub(crate) fn plain_outer<T: Number>(
    instructions: Instructions,
    factors: &[Factors<'_, T>],
) -> (Vec<T>, Vec<T>) {
    let (columns, width) =
        factors.first().map_or((0, 1), |factors| (factors.right.columns, factors.right.width));
    let mut sum = Panels::zeros(1, columns, width);
    let product = outer(instructions, factors, Some(&mut sum.panels));
    let mut total = vec![T::default(); columns];
    sum.get_row(0, &mut total);
    (unpack_columns(&product, columns, width / WIDE), total)
}
