//! The forward pass of BERT and RoBERTa, without padding (Devlin et al. 2019, Liu et al. 2019).
//!
//! All sentences of a batch have the same number of tokens, so nothing is masked and a batch gives what its sentences
//! give alone, but for the last bits of sums in another order.

use burn::tensor::activation::{gelu, tanh};
use burn::tensor::module::{attention, layer_norm, linear};
use burn::tensor::ops::AttentionModuleOptions;
use burn::tensor::{Device, Int, Tensor, TensorData};

use super::config::EncoderConfig;
use super::error::EncoderError;
use super::weights::Weights;

/// `y = x W^T + b`, the weight as files have it.
#[derive(Debug)]
struct Linear {
    /// `[in, out]`, a transposed view of the file's `[out, in]`.
    weight: Tensor<2>,
    /// `[out]`.
    bias: Tensor<1>,
}

/// Layer normalisation over the last axis.
#[derive(Debug)]
struct Norm {
    /// `[width]`.
    scale: Tensor<1>,
    /// `[width]`.
    shift: Tensor<1>,
    epsilon: f64,
}

/// Self-attention and a feed-forward block, each added to its input and normalised.
#[derive(Debug)]
struct Layer {
    query: Linear,
    key: Linear,
    value: Linear,
    mixed: Linear,
    attention_norm: Norm,
    inner: Linear,
    outer: Linear,
    output_norm: Norm,
    num_heads: usize,
}

/// An encoder up to a layer.
#[derive(Debug)]
pub(super) struct Transformer {
    /// `[vocab, width]`.
    words: Tensor<2>,
    /// `[position, width]`, from the position of the first token on, the vector of segment 0 added.
    positions: Tensor<2>,
    embedding_norm: Norm,
    layers: Vec<Layer>,
    pooler: Option<Linear>,
    device: Device,
    width: usize,
}

impl Transformer {
    /// Loads the embeddings, the first `num_layers` layers, and the pooler where the file has one and all layers are loaded.
    pub fn load(
        weights: &mut Weights,
        config: &EncoderConfig,
        num_layers: usize,
    ) -> Result<Self, EncoderError> {
        let device = Device::flex();
        let (width, inner) = (config.width, config.inner_width);
        let mut load = Loader { weights, device: &device, epsilon: config.norm_epsilon };
        let words = load.matrix("embeddings.word_embeddings.weight", [config.vocab_size, width])?;
        let positions = load
            .matrix("embeddings.position_embeddings.weight", [config.num_positions, width])?
            .slice([config.first_position..config.num_positions, 0..width]);
        let types = load
            .matrix("embeddings.token_type_embeddings.weight", [config.num_types, width])?
            .slice([0..1, 0..width]);
        let embedding_norm = load.norm("embeddings.LayerNorm", width)?;
        let layers = (0..num_layers)
            .map(|index| {
                let name = |part: &str| format!("encoder.layer.{index}.{part}");
                Ok(Layer {
                    query: load.linear(&name("attention.self.query"), width, width)?,
                    key: load.linear(&name("attention.self.key"), width, width)?,
                    value: load.linear(&name("attention.self.value"), width, width)?,
                    mixed: load.linear(&name("attention.output.dense"), width, width)?,
                    attention_norm: load.norm(&name("attention.output.LayerNorm"), width)?,
                    inner: load.linear(&name("intermediate.dense"), width, inner)?,
                    outer: load.linear(&name("output.dense"), inner, width)?,
                    output_norm: load.norm(&name("output.LayerNorm"), width)?,
                    num_heads: config.num_heads,
                })
            })
            .collect::<Result<_, EncoderError>>()?;
        let wants_pooler = num_layers == config.num_layers && load.weights.has("pooler.dense.weight");
        let pooler = if wants_pooler { Some(load.linear("pooler.dense", width, width)?) } else { None };
        let positions = positions + types;
        Ok(Self { words, positions, embedding_norm, layers, pooler, device, width })
    }

    pub fn has_pooler(&self) -> bool {
        self.pooler.is_some()
    }

    /// Token vectors after the last loaded layer, `[sentence, token, width]`; every sentence has `length` ids.
    pub fn forward(&self, sentences: &[&[u32]], length: usize) -> Tensor<3> {
        let num_sentences = sentences.len();
        let ids: Vec<i64> = sentences.iter().flat_map(|ids| ids.iter().map(|&id| i64::from(id))).collect();
        let shape = [num_sentences * length];
        let ids = Tensor::<1, Int>::from_data(TensorData::new(ids, shape), &self.device);
        let words = self.words.clone().select(0, ids).reshape([num_sentences, length, self.width]);
        let positions = self.positions.clone().slice([0..length, 0..self.width]).unsqueeze::<3>();
        let start =
            self.embedding_norm.forward((words + positions).reshape([num_sentences * length, self.width]));
        self.layers
            .iter()
            .fold(start, |tokens, layer| layer.forward(tokens, num_sentences, length))
            .reshape([num_sentences, length, self.width])
    }

    /// The pooler's output for start tokens `[sentence, width]`, where the model has one.
    pub fn pool(&self, starts: Tensor<2>) -> Option<Tensor<2>> {
        self.pooler.as_ref().map(|pooler| tanh(pooler.forward(starts)))
    }
}

impl Layer {
    /// `tokens` and the result are `[sentence x token, width]`.
    fn forward(&self, tokens: Tensor<2>, num_sentences: usize, length: usize) -> Tensor<2> {
        let [num_tokens, width] = tokens.dims();
        let heads = |part: &Linear| {
            part.forward(tokens.clone())
                .reshape([num_sentences, length, self.num_heads, width / self.num_heads])
                .swap_dims(1, 2)
        };
        let options = AttentionModuleOptions::default();
        let mixed = attention(heads(&self.query), heads(&self.key), heads(&self.value), None, None, options);
        let mixed = self.mixed.forward(mixed.swap_dims(1, 2).reshape([num_tokens, width]));
        let tokens = self.attention_norm.forward(tokens + mixed);
        let inner = gelu(self.inner.forward(tokens.clone()));
        self.output_norm.forward(tokens + self.outer.forward(inner))
    }
}

impl Linear {
    fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        linear(input, self.weight.clone(), Some(self.bias.clone()))
    }
}

impl Norm {
    fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        layer_norm(input, self.scale.clone(), Some(self.shift.clone()), self.epsilon)
    }
}

/// Turns tensors of the file into parts of the model.
struct Loader<'a> {
    weights: &'a mut Weights,
    device: &'a Device,
    epsilon: f64,
}

impl Loader<'_> {
    fn matrix(&mut self, name: &str, shape: [usize; 2]) -> Result<Tensor<2>, EncoderError> {
        let numbers = self.weights.read(name, &shape)?;
        Ok(Tensor::from_data(TensorData::new(numbers, shape), self.device))
    }

    fn vector(&mut self, name: &str, width: usize) -> Result<Tensor<1>, EncoderError> {
        let numbers = self.weights.read(name, &[width])?;
        Ok(Tensor::from_data(TensorData::new(numbers, [width]), self.device))
    }

    fn linear(&mut self, name: &str, from: usize, to: usize) -> Result<Linear, EncoderError> {
        let weight = self.matrix(&format!("{name}.weight"), [to, from])?.transpose();
        Ok(Linear { weight, bias: self.vector(&format!("{name}.bias"), to)? })
    }

    fn norm(&mut self, name: &str, width: usize) -> Result<Norm, EncoderError> {
        let scale = self.vector(&format!("{name}.weight"), width)?;
        let shift = self.vector(&format!("{name}.bias"), width)?;
        Ok(Norm { scale, shift, epsilon: self.epsilon })
    }
}
