//! A decoder that hears what is known beforehand: products of inputs go many steps at once, unless these have few features.

use super::Decoder;
use super::part::{Back, Packs, Part, Transposed};
use crate::lanes::Number;
use crate::layer::{History, StateGradient};
use crate::multiply::{Destination, multiply, multiply_all};
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;

impl<T: Number> Part<T> {
    /// Hears `inputs`, `[batch, time, feature]`.
    pub(super) fn run_open(
        plan: Plan,
        inputs: &[T],
        initial: &[(&[T], &[T])],
        decoder: &Decoder<'_, T>,
        packs: &Packs<T>,
    ) -> Self {
        let (instructions, frames) = (plan.instructions, plan.num_frames());
        let lanes = T::lanes(instructions);
        let wide = WIDE * lanes;
        let layers = decoder.layers.iter().zip(initial);
        let mut part = Self {
            layers: layers
                .map(|(layer, &state)| History::new(&plan, Some(state), layer.hidden(), lanes))
                .collect(),
            inputs: plan.gather(inputs, decoder.feature(), wide),
            outputs: Panels::unset(0, frames, decoder.outputs(), wide),
            words: Vec::new(),
            plan,
        };
        let plan = &part.plan;
        for steps in plan.blocks() {
            for (layer, packed) in packs.layers.iter().enumerate() {
                let (below, own) = part.layers.split_at_mut(layer);
                match below.last() {
                    Some(below) => own[0].steps(plan, packed, &steps, &below.hidden, plan.batch()),
                    None => own[0].steps(plan, packed, &steps, &part.inputs, 0),
                }
            }
        }
        if let Some(top) = part.layers.last() {
            let (packed, bias) = (&packs.projection, Some(&packs.bias));
            multiply_all(instructions, &top.hidden, plan.batch(), packed, bias, &mut part.outputs, 0..frames);
        }
        part.activate(decoder.activation, 0..frames);
        part
    }

    /// Fills the gates of all layers with gradients.
    pub(super) fn back_open(
        &mut self,
        decoder: &Decoder<'_, T>,
        output: &[T],
        packs: &Transposed<T>,
        want_inputs: bool,
    ) -> Back<T> {
        let (instructions, frames) = (self.plan.instructions, self.plan.num_frames());
        let lanes = T::lanes(instructions);
        let wide = WIDE * lanes;
        let mut outputs = self.plan.gather_packed(output, decoder.outputs(), wide);
        self.activate_back(decoder.activation, 0..frames, &mut outputs);
        let plan = &self.plan;
        let blocks = plan.blocks();
        let longest = blocks.iter().map(|steps| plan.frames_of(steps).len()).max().unwrap_or(0);
        // Gradients of each layer's hidden states from what heard them, for one block after the other.
        let mut above: Vec<Panels<T>> =
            self.layers.iter().map(|layer| Panels::unset(0, longest, layer.hidden_units, lanes)).collect();
        let top = above.len() - 1;
        let mut inputs = want_inputs.then(|| Panels::unset(0, frames, decoder.feature(), wide));
        let states =
            self.layers.iter().map(|layer| StateGradient::new(plan, None, layer.hidden_units, lanes));
        let mut states: Vec<StateGradient<T>> = states.collect();
        for steps in blocks.into_iter().rev() {
            let block = plan.frames_of(&steps);
            let (first, length) = (block.start, block.len());
            multiply_all(instructions, &outputs, first, &packs.projection, None, &mut above[top], 0..length);
            for (layer, packed) in packs.layers.iter().enumerate().rev() {
                let (below, own) = above.split_at_mut(layer);
                let (history, gradient) = (&mut self.layers[layer], &mut states[layer]);
                for step in steps.clone().rev() {
                    let frames = plan.frames(step);
                    history.step_back(plan, step, Some((&own[0], frames.start - first)), gradient);
                    let destination = Destination {
                        panels: &mut gradient.hidden,
                        first_row: 0,
                        packed: &packed.recurrent,
                        bias: None,
                    };
                    multiply(instructions, &history.gates, frames.start, frames.len(), vec![destination]);
                }
                let gates = &history.gates;
                if let Some(below) = below.last_mut() {
                    multiply_all(instructions, gates, first, &packed.input, None, below, 0..length);
                } else if let Some(inputs) = &mut inputs {
                    multiply_all(instructions, gates, first, &packed.input, None, inputs, block.clone());
                }
            }
        }
        Back { states, outputs, inputs }
    }
}
