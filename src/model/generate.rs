//! What a trained model is for: latents of motions and captions, and motions and captions of latents.
//!
//! Translation is an encoder of one kind followed by a decoder of the other.

use burn::tensor::{Device, Tensor, TensorData, activation};

use super::batch::{CaptionBatch, Frames, MotionBatch, indices};
use super::bundle::Bundle;
use super::ops::LstmState;
use crate::features::{BOS, EOS};
use crate::motion::NUM_CHANNELS;

/// A word as it enters the encoder.
#[derive(Debug, Clone, PartialEq)]
pub enum Word {
    /// One of the vocabulary, by number.
    Known(u32),
    /// Any other word that has a vector; it goes through the retrofit layer like those trained on.
    Vector(Vec<f32>),
}

/// How long generated motions are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MotionLength {
    /// What the length head reads off the latent, within the lengths seen in training.
    Predicted,
    /// Given numbers of frames, the first included, for each motion; at least 2.
    Frames(Vec<usize>),
}

/// A sentence being written, or several side by side.
#[derive(Debug, Clone)]
pub struct Writing {
    state: LstmState,
}

impl Writing {
    /// The sentences of some rows, in that order; a row may be taken several times.
    #[must_use]
    pub fn select(&self, rows: &[usize]) -> Self {
        let rows = indices(rows.iter().copied(), &self.state.hidden.device());
        let hidden = self.state.hidden.clone().select(0, rows.clone());
        Self { state: LstmState { hidden, cell: self.state.cell.clone().select(0, rows) } }
    }
}

impl Bundle {
    /// What computes.
    #[must_use]
    pub fn device(&self) -> Device {
        self.table.device()
    }

    /// Latents of normalised motions of at least 2 frames, `[batch, latent]`.
    ///
    /// # Panics
    /// If there is no motion, or one is shorter.
    #[must_use]
    pub fn encode_motions(&self, motions: &[Frames<'_>]) -> Tensor<2> {
        self.model.action.encode(&MotionBatch::new(motions, &self.device()))
    }

    /// Latents of captions by word number, beginning and end included, `[batch, latent]`.
    ///
    /// # Panics
    /// If there is no caption, one has fewer than 2 words, or a number is not in the vocabulary.
    #[must_use]
    pub fn encode_captions(&self, captions: &[&[u32]]) -> Tensor<2> {
        let num_words = self.vocabulary.words.len();
        assert!(
            captions.iter().all(|words| words.iter().all(|&word| (word as usize) < num_words)),
            "unknown word"
        );
        self.model.description.encode(&CaptionBatch::new(captions, &self.device()), &self.table)
    }

    /// Latent of one sentence that may have words outside the vocabulary, `[1, latent]`.
    ///
    /// The words are those between the two marks, which are added here.
    ///
    /// # Panics
    /// If a number is not in the vocabulary, or a vector has another length than the vocabulary's.
    #[must_use]
    pub fn encode_words(&self, words: &[Word]) -> Tensor<2> {
        let device = self.device();
        let known = |word: u32| {
            assert!((word as usize) < self.vocabulary.words.len(), "unknown word");
            self.table.clone().select(0, indices(std::iter::once(word as usize), &device))
        };
        let mut rows = vec![known(BOS)];
        for word in words {
            rows.push(match word {
                Word::Known(word) => known(*word),
                Word::Vector(vector) => {
                    assert_eq!(vector.len(), self.vocabulary.dimensions, "length of a word vector");
                    let vector = TensorData::new(vector.clone(), [1, vector.len()]);
                    self.model.retrofit.forward(Tensor::from_data(vector, &device))
                }
            });
        }
        rows.push(known(EOS));
        let length = rows.len();
        self.model.description.encode_vectors(Tensor::cat(rows, 0).unsqueeze_dim(0), &[length])
    }

    /// Motions of latents `[batch, latent]`: normalised frames, the first included.
    ///
    /// `first` are the first frames; without them a motion begins like the training motion whose latent
    /// is nearest, or with [`super::BundleConfig::start_frame`] in a bundle that has no first frames.
    ///
    /// # Panics
    /// If the numbers of latents, first frames and lengths differ, or a length is below 2.
    #[must_use]
    pub fn decode_motions(
        &self,
        latent: &Tensor<2>,
        first: Option<&[[f32; NUM_CHANNELS]]>,
        length: &MotionLength,
    ) -> Vec<Vec<[f32; NUM_CHANNELS]>> {
        let batch = latent.dims()[0];
        let lengths = match length {
            MotionLength::Predicted => self.predict_lengths(latent),
            MotionLength::Frames(lengths) => lengths.clone(),
        };
        let start: [f32; NUM_CHANNELS] = std::array::from_fn(|channel| self.config.start_frame[channel]);
        let nearest = |latent: &Vec<f32>| self.starts.nearest(latent).unwrap_or(start);
        let first = first.map_or_else(|| Self::numbers(latent).iter().map(nearest).collect(), <[_]>::to_vec);
        assert!(
            lengths.len() == batch && first.len() == batch,
            "as many lengths and first frames as latents"
        );
        assert!(lengths.iter().all(|&length| length >= 2), "at least 2 frames");

        let steps: Vec<usize> = lengths.iter().map(|length| length - 1).collect();
        let firsts = TensorData::new(first.as_flattened().to_vec(), [batch, NUM_CHANNELS]);
        let frames =
            self.model.action.generate(latent.clone(), Tensor::from_data(firsts, &self.device()), &steps);
        let values: Vec<f32> = frames.into_data().iter().collect();
        let mut rest = values.as_chunks::<NUM_CHANNELS>().0;
        let mut own = |steps: usize| {
            let (own, others) = rest.split_at(steps);
            rest = others;
            own
        };
        steps
            .iter()
            .zip(first)
            .map(|(&steps, first)| std::iter::once(first).chain(own(steps).iter().copied()).collect())
            .collect()
    }

    /// Frames of the motions of latents, as the length head reads them, within the lengths seen in training.
    #[must_use]
    pub fn predict_lengths(&self, latent: &Tensor<2>) -> Vec<usize> {
        let (shortest, longest) = self.config.frames_seen;
        let lengths = self.model.length.predict(latent.clone());
        lengths.into_iter().map(|length| (length.round() as usize).clamp(shortest, longest)).collect()
    }

    /// Captions of latents `[batch, latent]`, always the most probable next word; without the two marks.
    ///
    /// A sentence that does not end by itself is cut after `most_words`.
    #[must_use]
    pub fn decode_captions(&self, latent: &Tensor<2>, most_words: usize) -> Vec<Vec<u32>> {
        let batch = latent.dims()[0];
        let mut captions = vec![Vec::new(); batch];
        let mut has_ended = vec![false; batch];
        let mut words = vec![BOS; batch];
        let mut writing = self.write(latent);
        for _ in 0..most_words {
            let (logits, next) = self.logits(&words, &writing);
            writing = next;
            words = super::description::arg_max(logits);
            for ((caption, &word), ended) in captions.iter_mut().zip(&words).zip(&mut has_ended) {
                *ended |= word == EOS;
                if !*ended {
                    caption.push(word);
                }
            }
            if has_ended.iter().all(|ended| *ended) {
                break;
            }
        }
        captions
    }

    /// Begins a sentence for each latent, for a search that chooses its words itself.
    #[must_use]
    pub fn write(&self, latent: &Tensor<2>) -> Writing {
        Writing { state: self.model.description.initial(latent.clone()) }
    }

    /// Natural logarithms of the probabilities of every next word, `[batch][vocab]`, after one more word in each sentence:
    /// [`BOS`] at first, then what the search chose.
    ///
    /// # Panics
    /// If there is not one word for each sentence, or one is not in the vocabulary.
    #[must_use]
    pub fn next_words(&self, words: &[u32], writing: &Writing) -> (Vec<Vec<f32>>, Writing) {
        let (logits, next) = self.logits(words, writing);
        let num_words = self.vocabulary.words.len();
        let values: Vec<f32> = activation::log_softmax(logits, 1).into_data().iter().collect();
        (values.chunks_exact(num_words).map(<[f32]>::to_vec).collect(), next)
    }

    fn logits(&self, words: &[u32], writing: &Writing) -> (Tensor<2>, Writing) {
        assert_eq!(words.len(), writing.state.hidden.dims()[0], "a word for each sentence");
        assert!(words.iter().all(|&word| (word as usize) < self.vocabulary.words.len()), "unknown word");
        let rows = indices(words.iter().map(|&word| word as usize), &self.device());
        let vectors = self.table.clone().select(0, rows);
        let (logits, state) = self.model.description.step(vectors, writing.state.clone());
        (logits, Writing { state })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Rprae;
    use crate::model::tests::tiny;
    use crate::training::tests::four_pairs;

    fn bundle() -> Bundle {
        let set = four_pairs();
        Bundle::new(&Rprae::new(&tiny(), &set.vocabulary, 1, &Device::flex()), &tiny(), &set)
    }

    fn numbers(tensor: Tensor<2>) -> Vec<f32> {
        tensor.into_data().iter().collect()
    }

    #[test]
    fn a_bundle_comes_back_whole() {
        let (set, bundle) = (four_pairs(), bundle());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bundle");
        bundle.save(&path, "# A card\n").unwrap();
        bundle.save(&path, "# A card\n").unwrap();
        let loaded = Bundle::load(&path, &Device::flex()).unwrap();
        assert_eq!((&loaded.config, &loaded.vocabulary), (&bundle.config, &bundle.vocabulary));
        assert_eq!(loaded.normalizer, bundle.normalizer);
        let motions: Vec<Frames<'_>> = set.motions.iter().map(|motion| motion.frames.as_slice()).collect();
        assert_eq!(numbers(loaded.encode_motions(&motions)), numbers(bundle.encode_motions(&motions)));

        let edit = |name: &str, from: &str, to: &str| {
            let text = std::fs::read_to_string(path.join(name)).unwrap();
            assert!(text.contains(from));
            std::fs::write(path.join(name), text.replacen(from, to, 1)).unwrap();
            let message = Bundle::load(&path, &Device::flex()).unwrap_err().to_string();
            std::fs::write(path.join(name), text).unwrap();
            message
        };
        let message = edit("config.json", "\"latent\": 8", "\"latent\": 4000");
        assert!(message.contains("weights.safetensors") && message.contains("numbers"), "{message}");
        let message = edit("config.json", "\"format\": 1", "\"format\": 2");
        assert!(message.contains("config.json"), "{message}");
        let message = edit("vocabulary.json", "true", "false");
        assert!(message.contains("finite vectors"), "{message}");
        // Older bundles do not say what they learned from.
        let text = std::fs::read_to_string(path.join("config.json")).unwrap();
        let mut config: serde_json::Value = serde_json::from_str(&text).unwrap();
        config["learned_from"]["motions"] = serde_json::json!(["b", "a"]);
        std::fs::write(path.join("config.json"), config.to_string()).unwrap();
        let message = Bundle::load(&path, &Device::flex()).unwrap_err().to_string();
        assert!(message.contains("not sorted"), "{message}");
        config.as_object_mut().unwrap().remove("learned_from");
        std::fs::write(path.join("config.json"), config.to_string()).unwrap();
        assert_eq!(Bundle::load(&path, &Device::flex()).unwrap().config.learned_from, None);
        std::fs::write(path.join("config.json"), text).unwrap();
        assert!(Bundle::load(&path, &Device::flex()).is_ok());
    }

    #[test]
    fn lengths_and_first_frames_are_kept() {
        let bundle = bundle();
        let latent = bundle.encode_captions(&[&[0, 2, 1], &[0, 5, 6, 7, 1]]);
        let first = [[0.25; NUM_CHANNELS], [-0.5; NUM_CHANNELS]];
        let motions = bundle.decode_motions(&latent, Some(&first), &MotionLength::Frames(vec![2, 7]));
        assert_eq!(motions.iter().map(Vec::len).collect::<Vec<_>>(), [2, 7]);
        assert_eq!((motions[0][0], motions[1][0]), (first[0], first[1]));
        // A motion does not depend on its neighbours.
        let alone = latent.clone().narrow(0, 0, 1);
        let alone = bundle.decode_motions(&alone, Some(&first[..1]), &MotionLength::Frames(vec![2]));
        assert_eq!(alone[0], motions[0]);
        let free = bundle.decode_motions(&latent, None, &MotionLength::Predicted);
        assert!(free.iter().all(|motion| (6..=12).contains(&motion.len())));
        assert_eq!(free[0][0].to_vec(), bundle.config.start_frame);
    }

    #[test]
    fn sentences_are_read_by_number_and_by_vector_alike() {
        let bundle = bundle();
        let by_number = bundle.encode_captions(&[&[0, 4, 2, 1]]);
        // Word 4 has a vector, word 2 has none and can be had by number only.
        let vector = bundle.vocabulary.vectors[4].clone().unwrap();
        let by_vector = bundle.encode_words(&[Word::Vector(vector), Word::Known(2)]);
        for (a, b) in numbers(by_number).into_iter().zip(numbers(by_vector)) {
            assert!((a - b).abs() < 1e-6, "{a} is not {b}");
        }
    }

    #[test]
    fn step_by_step_writes_what_the_greedy_writer_writes() {
        let bundle = bundle();
        let latent = bundle.encode_captions(&[&[0, 2, 1], &[0, 5, 6, 7, 1]]);
        let greedy = bundle.decode_captions(&latent, 6);
        let mut writing = bundle.write(&latent).select(&[1, 0]).select(&[1, 0]);
        let mut words = vec![BOS; 2];
        let mut written = vec![Vec::new(); 2];
        for _ in 0..6 {
            let (probabilities, next) = bundle.next_words(&words, &writing);
            writing = next;
            for (row, logarithms) in probabilities.iter().enumerate() {
                let sum: f32 = logarithms.iter().map(|logarithm| logarithm.exp()).sum();
                assert!((sum - 1.0).abs() < 1e-5);
                let best = (0..logarithms.len()).max_by(|&a, &b| logarithms[a].total_cmp(&logarithms[b]));
                words[row] = best.unwrap() as u32;
                written[row].push(words[row]);
            }
        }
        for (greedy, written) in greedy.iter().zip(&written) {
            assert_eq!(greedy[..], written[..greedy.len()]);
            assert!(greedy.len() == 6 || written[greedy.len()] == EOS);
        }
    }
}
