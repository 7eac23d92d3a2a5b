//! A decoder that hears itself.

use super::Decoder;
use super::part::{Back, Packs, Part, Transposed};
use crate::lanes::Number;
use crate::layer::{Hears, History, StateGradient};
use crate::multiply::{Destination, multiply};
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;

impl<T: Number> Part<T> {
    /// Hears the first input, and then its output or, where there is a table, a row of it.
    pub(super) fn run_closed(
        plan: Plan,
        first: &[T],
        table: Option<&[T]>,
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
            if step + 1 < part.plan.num_steps() {
                part.hear_itself(step, table);
            }
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
        self.activate(decoder.activation, frames);
    }

    /// The next step's inputs.
    fn hear_itself(&mut self, step: usize, table: Option<&[T]>) {
        let (frames, next) = (self.plan.frames(step), self.plan.frames(step + 1));
        let Some(table) = table else {
            let width = self.inputs.width;
            for (inputs, outputs) in self.inputs.panels.iter_mut().zip(self.outputs.panels.iter()) {
                let said = &outputs[frames.start * width..][..next.len() * width];
                inputs[next.start * width..next.end * width].copy_from_slice(said);
            }
            return;
        };
        let feature = self.inputs.columns;
        for (row, frame) in next.enumerate() {
            let word = greatest(&self.outputs, frames.start + row);
            self.words.push(word);
            self.inputs.set_row(frame, &table[word * feature..][..feature]);
        }
    }

    /// Fills the gates of all layers with gradients.
    ///
    /// The outputs' gradients hold those of the inputs they became, if they were `heard`.
    pub(super) fn back_closed(
        &mut self,
        decoder: &Decoder<'_, T>,
        output: &[T],
        packs: &Transposed<T>,
        heard: bool,
    ) -> Back<T> {
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
        let mut d_outputs = plan.gather_packed(output, outputs, wide);
        let mut d_inputs = Panels::<T>::zeros(plan.num_frames(), feature, wide);
        for step in (0..plan.num_steps()).rev() {
            let frames = plan.frames(step);
            if heard && step + 1 < plan.num_steps() {
                let next = plan.frames(step + 1);
                let width = d_outputs.width;
                for (d_outputs, d_inputs) in d_outputs.panels.iter_mut().zip(d_inputs.panels.iter()) {
                    let d_outputs = &mut d_outputs[frames.start * width..][..next.len() * width];
                    for (d_output, &d_input) in d_outputs.iter_mut().zip(&d_inputs[next.start * width..]) {
                        *d_output += d_input;
                    }
                }
            }
            self.activate_back(decoder.activation, frames.clone(), &mut d_outputs);
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
        Back { states, outputs: d_outputs, inputs: Some(d_inputs) }
    }

    /// Writes gradients of the first input, `[batch, feature]`.
    pub(super) fn write_first(&self, back: &Back<T>, first: &mut [T]) {
        let Some(inputs) = &back.inputs else { return };
        let feature = inputs.columns;
        for (row, &index) in self.plan.order().iter().enumerate().take(self.first_rows()) {
            inputs.get_row(row, &mut first[index * feature..][..feature]);
        }
    }

    /// Adds to the gradient of the table, `[output, feature]`, what its rows met when they were heard.
    pub(super) fn add_table_gradient(&self, back: &Back<T>, table: &mut [T]) {
        let Some(inputs) = &back.inputs else { return };
        let feature = inputs.columns;
        let mut heard = vec![T::default(); feature];
        for (&word, frame) in self.words.iter().zip(self.first_rows()..) {
            inputs.get_row(frame, &mut heard);
            for (sum, &number) in table[word * feature..][..feature].iter_mut().zip(&heard) {
                *sum += number;
            }
        }
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
