//! BERT and RoBERTa out of their files (Devlin et al. 2019, Liu et al. 2019).

use rprae_encoder::{Instructions, Layer, Linear, Memory, Norm};

use super::config::EncoderConfig;
use super::error::EncoderError;
use super::weights::Weights;

/// An encoder up to a layer.
#[derive(Debug)]
pub(super) struct Transformer {
    /// `[vocab, width]`.
    words: Vec<f32>,
    /// `[position, width]`, from the position of the first token on, the vector of segment 0 added.
    positions: Vec<f32>,
    embedding_norm: Norm,
    layers: Vec<Layer>,
    pooler: Option<Linear>,
    width: usize,
}

impl Transformer {
    /// Loads the embeddings, the first `num_layers` layers, and the pooler where the file has one and all layers are loaded.
    pub fn load(
        weights: &mut Weights,
        config: &EncoderConfig,
        num_layers: usize,
    ) -> Result<Self, EncoderError> {
        let (width, inner) = (config.width, config.inner_width);
        let epsilon = config.norm_epsilon as f32;
        let mut load = Loader { weights, epsilon, instructions: Instructions::best() };
        let words = load.matrix("embeddings.word_embeddings.weight", [config.vocab_size, width])?;
        let mut positions =
            load.matrix("embeddings.position_embeddings.weight", [config.num_positions, width])?;
        positions.drain(..config.first_position * width);
        let types = load.matrix("embeddings.token_type_embeddings.weight", [config.num_types, width])?;
        for position in positions.chunks_exact_mut(width) {
            add(position, &types[..width]);
        }
        let embedding_norm = load.norm("embeddings.LayerNorm", width)?;
        let layers = (0..num_layers)
            .map(|index| {
                let name = |part: &str| format!("encoder.layer.{index}.{part}");
                let heads = ["query", "key", "value"].map(|part| name(&format!("attention.self.{part}")));
                Ok(Layer {
                    projected: load.linear(&heads, width, width)?,
                    mixed: load.linear(&[name("attention.output.dense")], width, width)?,
                    attention_norm: load.norm(&name("attention.output.LayerNorm"), width)?,
                    inner: load.linear(&[name("intermediate.dense")], width, inner)?,
                    outer: load.linear(&[name("output.dense")], inner, width)?,
                    output_norm: load.norm(&name("output.LayerNorm"), width)?,
                    num_heads: config.num_heads,
                })
            })
            .collect::<Result<_, EncoderError>>()?;
        let wants_pooler = num_layers == config.num_layers && load.weights.has("pooler.dense.weight");
        let pooler =
            if wants_pooler { Some(load.linear(&["pooler.dense".to_owned()], width, width)?) } else { None };
        Ok(Self { words, positions, embedding_norm, layers, pooler, width })
    }

    pub fn has_pooler(&self) -> bool {
        self.pooler.is_some()
    }

    /// Token vectors after the last loaded layer, `[token, width]`, of sentences one after the other.
    ///
    /// The same bits for a sentence whatever others it comes with.
    pub fn forward(&self, sentences: &[&[u32]]) -> Vec<f32> {
        let lengths: Vec<usize> = sentences.iter().map(|ids| ids.len()).collect();
        let mut tokens = Vec::with_capacity(lengths.iter().sum::<usize>() * self.width);
        for ids in sentences {
            for (&id, position) in ids.iter().zip(self.positions.chunks_exact(self.width)) {
                let first = tokens.len();
                tokens.extend_from_slice(&self.words[id as usize * self.width..][..self.width]);
                add(&mut tokens[first..], position);
            }
        }
        self.embedding_norm.apply(&mut tokens);
        let mut memory = Memory::default();
        for layer in &self.layers {
            layer.apply(&mut tokens, &lengths, &mut memory);
        }
        tokens
    }

    /// The pooler's output for start tokens `[sentence, width]`, where the model has one.
    pub fn pool(&self, starts: &[f32]) -> Option<Vec<f32>> {
        let mut pooled = self.pooler.as_ref()?.forward(starts);
        for number in &mut pooled {
            *number = number.tanh();
        }
        Some(pooled)
    }
}

fn add(row: &mut [f32], other: &[f32]) {
    for (number, other) in row.iter_mut().zip(other) {
        *number += other;
    }
}

/// Turns tensors of the file into parts of the model.
struct Loader<'a> {
    weights: &'a mut Weights,
    epsilon: f32,
    instructions: Instructions,
}

impl Loader<'_> {
    fn matrix(&mut self, name: &str, shape: [usize; 2]) -> Result<Vec<f32>, EncoderError> {
        self.weights.read(name, &shape)
    }

    fn vector(&mut self, name: &str, width: usize) -> Result<Vec<f32>, EncoderError> {
        self.weights.read(name, &[width])
    }

    /// One map out of those of these names, each `[to, from]`, one below the other.
    fn linear(&mut self, names: &[String], from: usize, to: usize) -> Result<Linear, EncoderError> {
        let (mut weight, mut bias) = (Vec::new(), Vec::new());
        for name in names {
            weight.append(&mut self.matrix(&format!("{name}.weight"), [to, from])?);
            bias.append(&mut self.vector(&format!("{name}.bias"), to)?);
        }
        Ok(Linear::new(&weight, &bias, self.instructions))
    }

    fn norm(&mut self, name: &str, width: usize) -> Result<Norm, EncoderError> {
        let scale = self.vector(&format!("{name}.weight"), width)?;
        let shift = self.vector(&format!("{name}.bias"), width)?;
        Ok(Norm::new(scale, shift, self.epsilon, self.instructions))
    }
}
