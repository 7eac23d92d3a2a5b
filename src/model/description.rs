//! The recurrent autoencoder of descriptions.

use burn::module::Module;
use burn::tensor::{Device, Tensor, activation};

use super::batch::{CaptionBatch, flat_words, indices, packed};
use super::feed::Feed;
use super::layer::{Linear, Lstm};
use super::ops::{
    Activation, Direction, LstmState, lstm_closed_loop_words, lstm_last_state, lstm_open_loop, lstm_sequence,
};
use super::rae::Bottleneck;
use super::{DescriptionFeedback, Draws, ModelSettings};
use crate::features::{BOS, Vocabulary};

/// Retrofitted words, bidirectional LSTM, latent, LSTM, one logit for each word (Table 1).
///
/// `Deviation:` Table 1 gives every layer tanh; the logits have none, since probabilities could not get near 1.
#[derive(Module, Debug)]
pub struct DescriptionRae {
    forward: Lstm,
    backward: Lstm,
    bottleneck: Bottleneck,
    decoder: Lstm,
    output: Linear,
}

impl DescriptionRae {
    pub(super) fn new(
        settings: &ModelSettings,
        vocabulary: &Vocabulary,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        let units = settings.description_units;
        let lstm =
            |draws: &mut Draws| Lstm::new(vocabulary.dimensions, units, settings.forget_bias, draws, device);
        Self {
            forward: lstm(draws),
            backward: lstm(draws),
            decoder: lstm(draws),
            bottleneck: Bottleneck::new(units, 2, settings.latent, 1, draws, device),
            output: Linear::new(units, vocabulary.words.len(), draws, device),
        }
    }

    /// Latents of captions, `[batch, latent]`; `table` is [`super::Retrofit::table`].
    #[must_use]
    pub fn encode(&self, batch: &CaptionBatch, table: &Tensor<2>) -> Tensor<2> {
        let vectors = table.clone().select(0, batch.words.clone());
        let dimensions = vectors.dims()[1];
        self.encode_vectors(vectors.reshape([batch.size(), batch.width, dimensions]), &batch.lengths)
    }

    /// Latents of sentences whose retrofitted words are given, `[batch, time, dimension]` to `[batch, latent]`.
    #[must_use]
    pub fn encode_vectors(&self, vectors: Tensor<3>, lengths: &[usize]) -> Tensor<2> {
        let forward =
            lstm_last_state(vectors.clone(), lengths, None, &self.forward.weights(), Direction::Forward);
        let backward = lstm_last_state(vectors, lengths, None, &self.backward.weights(), Direction::Backward);
        self.bottleneck.latent(vec![forward, backward])
    }

    /// Logits of [`CaptionBatch::targets`] while the decoder learns, `[word, vocab]`.
    pub(super) fn reconstruct(
        &self,
        batch: &CaptionBatch,
        table: &Tensor<2>,
        latent: Tensor<2>,
        feedback: DescriptionFeedback,
        feed: &mut Feed,
    ) -> Tensor<2> {
        let num_steps = batch.num_steps();
        match feed {
            Feed::ClosedLoop => match feedback {
                DescriptionFeedback::ArgMax => self.generate(latent, table, &num_steps),
                DescriptionFeedback::Expectation => self.expect(latent, table, &num_steps),
            },
            Feed::TeacherForcing => self.follow(latent, table, &batch.captions, &num_steps, batch.width - 1),
            Feed::Mixed { share, draws } => {
                let plain = table.clone().without_autodiff();
                let logits = self.valid().follow(
                    latent.clone().without_autodiff(),
                    &plain,
                    &batch.captions,
                    &num_steps,
                    batch.width - 1,
                );
                let predicted: Vec<u32> = arg_max(logits);
                let inputs = mixed(&batch.captions, &predicted, *share, draws);
                self.follow(latent, table, &inputs, &num_steps, batch.width - 1)
            }
        }
    }

    /// Logits of a decoder that hears its most probable word, `[step, vocab]`.
    fn generate(&self, latent: Tensor<2>, table: &Tensor<2>, num_steps: &[usize]) -> Tensor<2> {
        let initial = self.initial(latent);
        let first = begin(table, num_steps.len());
        let weights = self.decoder.weights();
        lstm_closed_loop_words(first, table.clone(), num_steps, initial, &weights, self.output.weights())
    }

    /// Logits of a decoder that hears the mean of all words by their probability, `[step, vocab]`.
    fn expect(&self, latent: Tensor<2>, table: &Tensor<2>, num_steps: &[usize]) -> Tensor<2> {
        let mut state = self.initial(latent);
        let mut input = begin(table, num_steps.len());
        let mut logits = Vec::new();
        for _ in 0..num_steps.iter().copied().max().unwrap_or(0) {
            let (step, after) = self.step(input, state);
            input = activation::softmax(step.clone(), 1).matmul(table.clone());
            state = after;
            logits.push(step);
        }
        packed(Tensor::stack(logits, 1), num_steps)
    }

    /// One pass over known words, `[step, vocab]`.
    fn follow(
        &self,
        latent: Tensor<2>,
        table: &Tensor<2>,
        captions: &[Vec<u32>],
        num_steps: &[usize],
        width: usize,
    ) -> Tensor<2> {
        let heard: Vec<&[u32]> =
            captions.iter().zip(num_steps).map(|(words, &steps)| &words[..steps]).collect();
        let vectors = table.clone().select(0, flat_words(&heard, width, &table.device()));
        let dimensions = vectors.dims()[1];
        let vectors = vectors.reshape([captions.len(), width, dimensions]);
        let state = self.initial(latent);
        let (weights, projection) = (self.decoder.weights(), self.output.weights());
        lstm_open_loop(vectors, num_steps, vec![state], &[weights], projection, Activation::None)
    }

    /// The decoder before its first word; `latent` is `[batch, latent]`.
    #[must_use]
    pub fn initial(&self, latent: Tensor<2>) -> LstmState {
        let mut states = self.bottleneck.states(latent);
        // A decoder of one layer has one state.
        states.swap_remove(0)
    }

    /// One step of the decoder: retrofitted words `[batch, dimension]` to logits `[batch, vocab]`.
    #[must_use]
    pub fn step(&self, words: Tensor<2>, state: LstmState) -> (Tensor<2>, LstmState) {
        let lengths = vec![1; words.dims()[0]];
        let weights = self.decoder.weights();
        let (hidden, state) =
            lstm_sequence(words.unsqueeze_dim(1), &lengths, Some(state), &weights, Direction::Forward);
        (self.output.forward(hidden.squeeze_dim(1)), state)
    }
}

/// The vector that begins every sentence, `[batch, dimension]`.
fn begin(table: &Tensor<2>, batch: usize) -> Tensor<2> {
    table.clone().select(0, indices(std::iter::repeat_n(BOS as usize, batch), &table.device()))
}

/// Most probable words of logits `[word, vocab]`.
pub(super) fn arg_max(logits: Tensor<2>) -> Vec<u32> {
    logits.argmax(1).into_data().iter::<i64>().map(|word| word as u32).collect()
}

/// Captions with some words replaced by what was predicted from the word before.
fn mixed(captions: &[Vec<u32>], predicted: &[u32], share: f64, draws: &mut Draws) -> Vec<Vec<u32>> {
    let mut from = predicted.iter();
    captions
        .iter()
        .map(|caption| {
            let mut words = caption.clone();
            let num_steps = caption.len() - 1;
            for (step, &word) in (1..=num_steps).zip(from.by_ref().take(num_steps)) {
                if step < num_steps && draws.unit() < share {
                    words[step] = word;
                }
            }
            words
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_predicted_word_replaces_the_input_of_the_step_after_it() {
        let captions = [vec![0, 5, 6, 1], vec![0, 7, 1]];
        let predicted = [50, 60, 10, 70, 11];
        let all = mixed(&captions, &predicted, 1.0, &mut Draws::new(0, "mix", 0));
        assert_eq!(all, [vec![0, 50, 60, 1], vec![0, 70, 1]]);
        assert_eq!(mixed(&captions, &predicted, 0.0, &mut Draws::new(0, "mix", 0)), captions);
    }
}
