//! The retrofit layer: word vectors made to say what they mean for motion.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};

use super::layer::{Linear, uniform};
use super::{Draws, ModelSettings};
use crate::features::Vocabulary;

/// Fully connected layers with tanh from a word vector to a word vector.
///
/// Words that come without a vector (the beginning and end of a sentence among them) enter by trained ones.
/// `Deviation:` the paper has vectors for all its words and says nothing of the two marks.
#[derive(Module, Debug)]
pub struct Retrofit {
    layers: Vec<Linear>,
    /// Vectors of the words without one, `[word, dimension]`; an unused row is kept when there are none.
    trained: Param<Tensor<2>>,
    /// Vectors of the words with one, `[word, dimension]`; not trained; an unused row is kept when there are none.
    given: Tensor<2>,
    /// Row of every word in `trained` and `given` together, `[vocab]`.
    rows: Tensor<1, Int>,
}

impl Retrofit {
    pub(super) fn new(
        settings: &ModelSettings,
        vocabulary: &Vocabulary,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        let dimensions = vocabulary.dimensions;
        let mut layers = Vec::with_capacity(settings.retrofit_layers + 1);
        let mut input = dimensions;
        for _ in 0..settings.retrofit_layers {
            layers.push(Linear::new(input, settings.retrofit_units, draws, device));
            input = settings.retrofit_units;
        }
        layers.push(Linear::new(input, dimensions, draws, device));

        let num_given = vocabulary.vectors.iter().flatten().count();
        let num_trained = (vocabulary.vectors.len() - num_given).max(1);
        let (mut next_trained, mut next_given) = (0, num_trained as i32);
        let mut rows = Vec::with_capacity(vocabulary.vectors.len());
        let mut given = Vec::with_capacity(num_given.max(1) * dimensions);
        for vector in &vocabulary.vectors {
            let next = if let Some(vector) = vector {
                given.extend_from_slice(vector);
                &mut next_given
            } else {
                &mut next_trained
            };
            rows.push(*next);
            *next += 1;
        }
        given.resize(num_given.max(1) * dimensions, 0.0);
        Self {
            layers,
            // As long as the given ones are on average: their numbers lie around 0.1.
            trained: uniform([num_trained, dimensions], 0.1 * 3.0_f32.sqrt(), draws, device),
            given: Tensor::from_data(TensorData::new(given, [num_given.max(1), dimensions]), device),
            rows: Tensor::from_data(TensorData::new(rows, [vocabulary.vectors.len()]), device),
        }
    }

    /// Retrofitted vectors, `[word, dimension]` to `[word, dimension]`, each number within -1 and 1.
    pub fn forward(&self, vectors: Tensor<2>) -> Tensor<2> {
        self.layers.iter().fold(vectors, |values, layer| layer.forward(values).tanh())
    }

    /// Trained numbers of the layers alone, without the vectors of words.
    pub(super) fn num_layer_params(&self) -> usize {
        self.layers.num_params()
    }

    /// Retrofitted vectors of the whole vocabulary, `[vocab, dimension]`.
    pub fn table(&self) -> Tensor<2> {
        let vectors = Tensor::cat(vec![self.trained.val(), self.given.clone()], 0);
        self.forward(vectors.select(0, self.rows.clone()))
    }
}
