//! The way of a part of a batch through a decoder, and back.

use super::{Decoder, Feedback};
use crate::kernel::Run;
use crate::lanes::Number;
use crate::layer::{Backward, Forward, Hears, History, State, StateGradient};
use crate::multiply::{Destination, multiply};
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;
use crate::weight_gradients::{Factors, Gone};
use crate::weights::{Packed, pack_columns, pack_columns_transposed};

/// A decoder's weights packed for steps forward.
pub(super) struct Packs<T: Number> {
    layers: Vec<Forward<T>>,
    projection: Packed<T>,
    bias: Packed<T>,
}

impl<T: Number> Packs<T> {
    pub(super) fn new(decoder: &Decoder<'_, T>, lanes: usize) -> Self {
        let outputs = decoder.outputs();
        Self {
            layers: decoder.layers.iter().map(|layer| Forward::new(layer, lanes)).collect(),
            projection: pack_columns(decoder.projection.weights, outputs, lanes),
            bias: pack_columns(decoder.projection.bias, outputs, lanes),
        }
    }
}

/// A decoder's weights packed for steps back.
pub(super) struct Transposed<T: Number> {
    layers: Vec<Backward<T>>,
    projection: Packed<T>,
}

impl<T: Number> Transposed<T> {
    pub(super) fn new(decoder: &Decoder<'_, T>, lanes: usize) -> Self {
        Self {
            layers: decoder.layers.iter().map(|layer| Backward::new(layer, lanes)).collect(),
            projection: pack_columns_transposed(decoder.projection.weights, decoder.outputs(), lanes),
        }
    }
}

/// What a part of the batch remembers of its way.
#[derive(Debug, Clone)]
pub(super) struct Part<T: Number> {
    plan: Plan,
    layers: Vec<History<T>>,
    /// What the bottom layer heard, `[frame, feature]`.
    inputs: Panels<T>,
    /// `[frame, output]`.
    outputs: Panels<T>,
    /// The row of the table that was heard, for each frame after the first step.
    words: Vec<usize>,
}

/// What the way back left beside the gates' gradients.
pub(super) struct Back<T: Number> {
    /// Of the initial states, from the bottom up.
    states: Vec<StateGradient<T>>,
    /// Of the outputs before their activation, `[frame, output]`.
    outputs: Panels<T>,
    /// Of the inputs, `[frame, feature]`.
    inputs: Panels<T>,
}

/// Two rows of equal length, possibly of different matrices.
fn rows<T: Number>(
    panels: &Panels<T>,
    range: std::ops::Range<usize>,
) -> impl Iterator<Item = std::ops::Range<usize>> + use<T> {
    let width = panels.width;
    std::iter::repeat_n(range.start * width..range.end * width, panels.panels.len())
}

impl<T: Number> Part<T> {
    pub(super) fn run(
        plan: Plan,
        first: &[T],
        initial: &[(&[T], &[T])],
        decoder: &Decoder<'_, T>,
        packs: &Packs<T>,
    ) -> Self {
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        let lanes = T::lanes(plan.instructions);
        let wide = WIDE * lanes;
        let layers = decoder
            .layers
            .iter()
            .zip(initial)
            .map(|(layer, &state)| History::new(&plan, Some(state), layer.hidden(), lanes))
            .collect();
        let frames = plan.num_frames();
        let mut part = Self {
            layers,
            inputs: Panels::zeros(frames, feature, wide),
            outputs: Panels::zeros(frames, outputs, wide),
            words: Vec::with_capacity(frames),
            plan,
        };
        for (row, &index) in part.plan.order().iter().enumerate().take(part.first_rows()) {
            part.inputs.set_row(row, &first[index * feature..][..feature]);
        }
        for step in 0..part.plan.num_steps() {
            part.step(step, packs, decoder);
        }
        part
    }

    /// Sequences that have a first frame.
    fn first_rows(&self) -> usize {
        if self.plan.num_steps() == 0 { 0 } else { self.plan.frames(0).len() }
    }

    fn step(&mut self, step: usize, packs: &Packs<T>, decoder: &Decoder<'_, T>) {
        let plan = &self.plan;
        let frames = plan.frames(step);
        for (layer, packed) in packs.layers.iter().enumerate() {
            let (below, above) = self.layers.split_at_mut(layer);
            let heard = match below.last() {
                Some(below) => Hears::Rows { left: &below.latest, first_row: 0 },
                None => Hears::Rows { left: &self.inputs, first_row: frames.start },
            };
            above[0].step(plan, packed, step, &heard);
        }
        // The layers are not empty: `check` has seen to that.
        let Some(top) = self.layers.last() else { return };
        let destination = Destination {
            panels: &mut self.outputs,
            first_row: frames.start,
            packed: &packs.projection,
            bias: Some(&packs.bias),
        };
        multiply(plan.instructions, &top.latest, 0, frames.len(), vec![destination]);
        if let Feedback::Tanh = decoder.feedback {
            let ranges = rows(&self.outputs, frames.clone());
            for (panel, range) in self.outputs.panels.iter_mut().zip(ranges) {
                for number in &mut panel[range] {
                    *number = number.tanh();
                }
            }
        }
        if step + 1 < plan.num_steps() {
            let next = plan.frames(step + 1);
            match decoder.feedback {
                Feedback::Tanh => {
                    let from = rows(&self.outputs, frames.start..frames.start + next.len());
                    let to = rows(&self.inputs, next);
                    let panels = self.inputs.panels.iter_mut().zip(self.outputs.panels.iter());
                    for ((inputs, outputs), (from, to)) in panels.zip(from.zip(to)) {
                        inputs[to].copy_from_slice(&outputs[from]);
                    }
                }
                Feedback::ArgMax { table } => {
                    let feature = decoder.feature();
                    for (row, frame) in next.enumerate() {
                        let word = greatest(&self.outputs, frames.start + row);
                        self.words.push(word);
                        self.inputs.set_row(frame, &table[word * feature..][..feature]);
                    }
                }
            }
        }
    }

    /// Writes outputs, `[batch, time, output]`.
    pub(super) fn write_outputs(&self, values: &mut [T]) {
        self.plan.scatter(&self.outputs, 0, values);
    }

    /// Fills the gates of all layers with gradients.
    pub(super) fn back(&mut self, decoder: &Decoder<'_, T>, output: &[T], packs: &Transposed<T>) -> Back<T> {
        let plan = &self.plan;
        let instructions = plan.instructions;
        let lanes = T::lanes(instructions);
        let wide = WIDE * lanes;
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        let mut states: Vec<StateGradient<T>> = decoder
            .layers
            .iter()
            .map(|layer| StateGradient::new(plan, None, layer.hidden(), lanes))
            .collect();
        // Gradients of each layer's hidden states from what hears them at the same step.
        let mut above: Vec<Panels<T>> =
            decoder.layers.iter().map(|layer| Panels::zeros(plan.batch(), layer.hidden(), lanes)).collect();
        let mut d_outputs = plan.gather(output, outputs, wide);
        let mut d_inputs = Panels::<T>::zeros(plan.num_frames(), feature, wide);
        for step in (0..plan.num_steps()).rev() {
            let frames = plan.frames(step);
            if let Feedback::Tanh = decoder.feedback {
                if step + 1 < plan.num_steps() {
                    let next = plan.frames(step + 1);
                    let to = rows(&d_outputs, frames.start..frames.start + next.len());
                    let from = rows(&d_inputs, next);
                    let panels = d_outputs.panels.iter_mut().zip(d_inputs.panels.iter());
                    for ((d_outputs, d_inputs), (to, from)) in panels.zip(to.zip(from)) {
                        for (d_output, &d_input) in d_outputs[to].iter_mut().zip(&d_inputs[from]) {
                            *d_output += d_input;
                        }
                    }
                }
                let ranges = rows(&d_outputs, frames.clone());
                for ((d_outputs, outputs), range) in
                    d_outputs.panels.iter_mut().zip(self.outputs.panels.iter()).zip(ranges)
                {
                    for (d_output, &output) in d_outputs[range.clone()].iter_mut().zip(&outputs[range]) {
                        *d_output = *d_output * (T::ONE - output * output);
                    }
                }
            }
            let top = above.len() - 1;
            let destination =
                Destination { panels: &mut above[top], first_row: 0, packed: &packs.projection, bias: None };
            multiply(instructions, &d_outputs, frames.start, frames.len(), vec![destination]);
            for layer in (0..packs.layers.len()).rev() {
                let (below, own) = above.split_at_mut(layer);
                self.layers[layer].step_back(plan, step, Some((&own[0], 0)), &mut states[layer]);
                let heard = match below.last_mut() {
                    Some(below) => Destination {
                        panels: below,
                        first_row: 0,
                        packed: &packs.layers[layer].input,
                        bias: None,
                    },
                    None => Destination {
                        panels: &mut d_inputs,
                        first_row: frames.start,
                        packed: &packs.layers[layer].input,
                        bias: None,
                    },
                };
                let recurrent = Destination {
                    panels: &mut states[layer].hidden,
                    first_row: 0,
                    packed: &packs.layers[layer].recurrent,
                    bias: None,
                };
                let gates = &self.layers[layer].gates;
                multiply(instructions, gates, frames.start, frames.len(), vec![recurrent, heard]);
            }
        }
        Back { states, outputs: d_outputs, inputs: d_inputs }
    }

    /// Writes gradients of the first input, `[batch, feature]`, and of the initial states.
    pub(super) fn write_gradients(&self, back: &Back<T>, first: &mut [T], initial: &mut [State<T>]) {
        let feature = back.inputs.columns;
        for (row, &index) in self.plan.order().iter().enumerate().take(self.first_rows()) {
            back.inputs.get_row(row, &mut first[index * feature..][..feature]);
        }
        for (gradient, state) in back.states.iter().zip(initial) {
            gradient.write(&self.plan, state);
        }
    }

    /// Adds to the gradient of the table, `[output, feature]`, what its rows met when they were heard.
    pub(super) fn add_table_gradient(&self, back: &Back<T>, table: &mut [T]) {
        let feature = back.inputs.columns;
        let mut heard = vec![T::default(); feature];
        for (&word, frame) in self.words.iter().zip(self.first_rows()..) {
            back.inputs.get_row(frame, &mut heard);
            for (sum, &number) in table[word * feature..][..feature].iter_mut().zip(&heard) {
                *sum += number;
            }
        }
    }

    pub(super) fn gone(&self, layer: usize) -> Gone<'_, T> {
        let (plan, history) = (&self.plan, &self.layers[layer]);
        match layer.checked_sub(1) {
            Some(below) => Gone { plan, history, input: &self.layers[below].hidden, first_row: plan.batch() },
            None => Gone { plan, history, input: &self.inputs, first_row: 0 },
        }
    }

    pub(super) fn projection_factors<'a>(&'a self, back: &'a Back<T>) -> Factors<'a, T> {
        let run = Run { left: self.plan.batch(), right: 0, rows: self.plan.num_frames() };
        let top = &self.layers[self.layers.len() - 1].hidden;
        Factors { left: top, right: &back.outputs, runs: vec![run] }
    }
}

/// The column of the greatest number of a row, the first of equals.
fn greatest<T: Number>(panels: &Panels<T>, row: usize) -> usize {
    let (mut column, mut greatest) = (0, None);
    for (panel, range) in panels.panels.iter().zip(panels.column_ranges()) {
        for (&number, index) in panel[row * panels.width..].iter().zip(range) {
            if greatest.is_none_or(|greatest| number > greatest) {
                (column, greatest) = (index, Some(number));
            }
        }
    }
    column
}
