//! Stacked layers that hear their own output.

use crate::kernel::Run;
use crate::lanes::Number;
use crate::layer::{
    Backward, Destination, Forward, Hears, History, State, StateGradient, in_pool, multiply, plain_outer,
};
use crate::panels::{Panels, WIDE};
use crate::plan::Plan;
use crate::weights::{LayerGradients, LayerWeights, Packed, pack_columns, pack_columns_transposed};

/// The linear map from the top layer's hidden states to the output.
#[derive(Debug, Clone, Copy)]
pub struct Projection<'a, T> {
    /// `[hidden, output]`.
    pub weights: &'a [T],
    /// `[output]`.
    pub bias: &'a [T],
}

/// How an output becomes the next input.
#[derive(Debug, Clone, Copy)]
pub enum Feedback<'a, T> {
    /// The output is tanh of the projection, and it is the next input.
    Tanh,
    /// The output is the projection, and the next input is the row of a table `[output, feature]` at its greatest number, the
    /// first of equals.
    ArgMax {
        /// The table.
        table: &'a [T],
    },
}

/// A decoder: layers from the bottom up, what they say, and how they hear it.
#[derive(Debug, Clone, Copy)]
pub struct Decoder<'a, T> {
    /// From the bottom up; each hears the hidden states of the one below at the same step.
    pub layers: &'a [LayerWeights<'a, T>],
    /// From the top layer to the output.
    pub projection: Projection<'a, T>,
    /// From the output to the bottom layer's next input.
    pub feedback: Feedback<'a, T>,
}

impl<T> Decoder<'_, T> {
    fn feature(&self) -> usize {
        self.layers[0].feature()
    }

    fn outputs(&self) -> usize {
        self.projection.bias.len()
    }

    fn top(&self) -> usize {
        self.layers[self.layers.len() - 1].hidden()
    }

    fn check(&self) {
        assert!(!self.layers.is_empty(), "a decoder without layers");
        for pair in self.layers.windows(2) {
            assert_eq!(pair[1].feature(), pair[0].hidden(), "layers that do not fit together");
        }
        assert_eq!(self.projection.weights.len(), self.top() * self.outputs(), "weights of the projection");
        match self.feedback {
            Feedback::Tanh => assert_eq!(self.feature(), self.outputs(), "the output is the next input"),
            Feedback::ArgMax { table } => {
                assert_eq!(
                    table.len(),
                    self.feature() * self.outputs(),
                    "a table of {} words",
                    self.outputs()
                );
            }
        }
    }
}

/// A decoder's way through a batch, kept for the way back.
#[derive(Debug, Clone)]
pub struct ClosedLoop<T> {
    plan: Plan,
    layers: Vec<History<T>>,
    /// What the bottom layer heard, `[frame, feature]`.
    inputs: Panels<T>,
    /// `[frame, output]`.
    outputs: Panels<T>,
    /// The row of the table that was heard, for each frame after the first step.
    words: Vec<usize>,
}

/// Gradients of what [`ClosedLoop::forward`] was given.
#[derive(Debug, Clone)]
pub struct ClosedLoopGradients<T> {
    /// Of the first input, `[batch, feature]`.
    pub first: Vec<T>,
    /// Of the initial states, from the bottom up.
    pub initial: Vec<State<T>>,
    /// Of the layers' weights, from the bottom up.
    pub layers: Vec<LayerGradients<T>>,
    /// Of the projection's weights, `[hidden, output]`.
    pub projection: Vec<T>,
    /// Of the projection's bias, `[output]`.
    pub bias: Vec<T>,
    /// Of the table, `[output, feature]`, if there is one.
    pub table: Option<Vec<T>>,
}

/// Two rows of equal length, possibly of different matrices.
fn rows<T>(
    panels: &Panels<T>,
    range: std::ops::Range<usize>,
) -> impl Iterator<Item = std::ops::Range<usize>> + use<T> {
    let width = panels.width;
    std::iter::repeat_n(range.start * width..range.end * width, panels.panels.len())
}

impl<T: Number> ClosedLoop<T> {
    pub(crate) fn run(plan: Plan, first: &[T], initial: &[(&[T], &[T])], decoder: &Decoder<'_, T>) -> Self {
        decoder.check();
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        assert_eq!(first.len(), plan.batch() * feature, "first inputs of {feature} features");
        assert_eq!(initial.len(), decoder.layers.len(), "one initial state for each layer");
        let lanes = T::lanes(plan.instructions);
        let wide = WIDE * lanes;
        let packed: Vec<Forward<T>> = decoder.layers.iter().map(|layer| Forward::new(layer, lanes)).collect();
        let projection = pack_columns(decoder.projection.weights, outputs, lanes);
        let bias: Packed<T> = pack_columns(decoder.projection.bias, outputs, lanes);
        let layers = decoder
            .layers
            .iter()
            .zip(initial)
            .map(|(layer, &state)| History::new(&plan, Some(state), layer.hidden(), lanes))
            .collect();
        let frames = plan.num_frames();
        let mut way = Self {
            layers,
            inputs: Panels::zeros(frames, feature, wide),
            outputs: Panels::zeros(frames, outputs, wide),
            words: Vec::with_capacity(frames),
            plan,
        };
        for (row, &index) in way.plan.order().iter().enumerate().take(way.first_rows()) {
            way.inputs.set_row(row, &first[index * feature..][..feature]);
        }
        for step in 0..way.plan.num_steps() {
            way.step(step, &packed, &projection, &bias, decoder);
        }
        way
    }

    /// Sequences that have a first frame.
    fn first_rows(&self) -> usize {
        if self.plan.num_steps() == 0 { 0 } else { self.plan.frames(0).len() }
    }

    fn step(
        &mut self,
        step: usize,
        packed: &[Forward<T>],
        projection: &Packed<T>,
        bias: &Packed<T>,
        decoder: &Decoder<'_, T>,
    ) {
        let plan = &self.plan;
        let frames = plan.frames(step);
        for (layer, packed) in packed.iter().enumerate() {
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
            packed: projection,
            bias: Some(bias),
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
                    let panels = self.inputs.panels.iter_mut().zip(&self.outputs.panels);
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

    pub(crate) fn output_values(&self) -> Vec<T> {
        self.plan.scatter(&self.outputs, 0)
    }

    pub(crate) fn run_back(mut self, decoder: &Decoder<'_, T>, output: &[T]) -> ClosedLoopGradients<T> {
        let plan = &self.plan;
        let instructions = plan.instructions;
        let lanes = T::lanes(instructions);
        let wide = WIDE * lanes;
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        let packed: Vec<Backward<T>> =
            decoder.layers.iter().map(|layer| Backward::new(layer, lanes)).collect();
        let projection = pack_columns_transposed(decoder.projection.weights, outputs, lanes);
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
                    let panels = d_outputs.panels.iter_mut().zip(&d_inputs.panels);
                    for ((d_outputs, d_inputs), (to, from)) in panels.zip(to.zip(from)) {
                        for (d_output, &d_input) in d_outputs[to].iter_mut().zip(&d_inputs[from]) {
                            *d_output += d_input;
                        }
                    }
                }
                let ranges = rows(&d_outputs, frames.clone());
                for ((d_outputs, outputs), range) in
                    d_outputs.panels.iter_mut().zip(&self.outputs.panels).zip(ranges)
                {
                    for (d_output, &output) in d_outputs[range.clone()].iter_mut().zip(&outputs[range]) {
                        *d_output = *d_output * (T::ONE - output * output);
                    }
                }
            }
            let top = above.len() - 1;
            let destination =
                Destination { panels: &mut above[top], first_row: 0, packed: &projection, bias: None };
            multiply(instructions, &d_outputs, frames.start, frames.len(), vec![destination]);
            for layer in (0..packed.len()).rev() {
                let (below, own) = above.split_at_mut(layer);
                self.layers[layer].step_back(plan, step, Some((&own[0], 0)), &mut states[layer]);
                let heard = match below.last_mut() {
                    Some(below) => {
                        Destination { panels: below, first_row: 0, packed: &packed[layer].input, bias: None }
                    }
                    None => Destination {
                        panels: &mut d_inputs,
                        first_row: frames.start,
                        packed: &packed[layer].input,
                        bias: None,
                    },
                };
                let recurrent = Destination {
                    panels: &mut states[layer].hidden,
                    first_row: 0,
                    packed: &packed[layer].recurrent,
                    bias: None,
                };
                let gates = &self.layers[layer].gates;
                multiply(instructions, gates, frames.start, frames.len(), vec![recurrent, heard]);
            }
        }
        self.collect(decoder, states, &d_outputs, &d_inputs)
    }

    fn collect(
        &self,
        decoder: &Decoder<'_, T>,
        states: Vec<StateGradient<T>>,
        d_outputs: &Panels<T>,
        d_inputs: &Panels<T>,
    ) -> ClosedLoopGradients<T> {
        let plan = &self.plan;
        let (batch, frames) = (plan.batch(), plan.num_frames());
        let (feature, outputs) = (decoder.feature(), decoder.outputs());
        let mut first = vec![T::default(); batch * feature];
        for (row, &index) in plan.order().iter().enumerate().take(self.first_rows()) {
            d_inputs.get_row(row, &mut first[index * feature..][..feature]);
        }
        let layers = (0..self.layers.len())
            .map(|layer| match layer.checked_sub(1) {
                Some(below) => self.layers[layer].weight_gradients(plan, &self.layers[below].hidden, batch),
                None => self.layers[layer].weight_gradients(plan, &self.inputs, 0),
            })
            .collect();
        let run = Run { left: batch, right: 0, rows: frames };
        let top = &self.layers[self.layers.len() - 1].hidden;
        let (projection, bias) = plain_outer(plan.instructions, top, d_outputs, run);
        let table = matches!(decoder.feedback, Feedback::ArgMax { .. }).then(|| {
            let mut table = vec![T::default(); outputs * feature];
            let mut heard = vec![T::default(); feature];
            for (&word, frame) in self.words.iter().zip(self.first_rows()..) {
                d_inputs.get_row(frame, &mut heard);
                for (sum, &number) in table[word * feature..][..feature].iter_mut().zip(&heard) {
                    *sum += number;
                }
            }
            table
        });
        ClosedLoopGradients {
            first,
            initial: states.into_iter().map(|state| state.into_state(plan)).collect(),
            layers,
            projection,
            bias,
            table,
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

/// See [`crate::sequence`]: compiled here, optimised.
macro_rules! entry_points {
    ($number:ty) => {
        impl ClosedLoop<$number> {
            /// Runs a decoder for as many steps as each sequence has frames.
            ///
            /// `first` is the input of the first step, `[batch, feature]`; `initial` holds hidden states and cells
            /// `[batch, hidden]`, from the bottom up.
            ///
            /// # Panics
            ///
            /// If a slice is not as long as the plan and the weights say.
            #[must_use]
            pub fn forward(
                plan: Plan,
                first: &[$number],
                initial: &[(&[$number], &[$number])],
                decoder: &Decoder<'_, $number>,
            ) -> Self {
                in_pool(|| Self::run(plan, first, initial, decoder))
            }

            /// Outputs `[batch, time, output]`, zeros in the padding.
            #[must_use]
            pub fn output(&self) -> Vec<$number> {
                self.output_values()
            }

            /// Gradients, given those of the output `[batch, time, output]`.
            ///
            /// # Panics
            ///
            /// If a slice or the weights have other shapes than on the way forward.
            #[must_use]
            pub fn backward(
                self,
                decoder: &Decoder<'_, $number>,
                output: &[$number],
            ) -> ClosedLoopGradients<$number> {
                in_pool(|| self.run_back(decoder, output))
            }
        }
    };
}

entry_points!(f32);
entry_points!(f64);
