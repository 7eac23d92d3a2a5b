//! The parts of an encoder and how they follow each other.

use crate::attention::Sentence;
use crate::elementwise::Normalise;
use crate::packed::Packed;
use crate::product::{Finish, Product};
use rprae_lanes::Instructions;

/// `y = x W^T + b`.
#[derive(Debug)]
pub struct Linear {
    weight: Packed,
    /// Padded to whole panels.
    bias: Vec<f32>,
    instructions: Instructions,
}

impl Linear {
    /// From weights `[out, in]`, row by row, and `[out]` biases.
    ///
    /// # Panics
    /// When there are no biases, or the weights are no whole number of rows.
    #[must_use]
    pub fn new(weight: &[f32], bias: &[f32], instructions: Instructions) -> Self {
        let columns = bias.len();
        assert!(columns > 0 && weight.len().is_multiple_of(columns), "the weights are [out, in]");
        let depth = weight.len() / columns;
        let weight = Packed::from_columns([depth, columns], instructions.lanes(), |column| {
            &weight[column * depth..][..depth]
        });
        let mut bias = bias.to_vec();
        bias.resize(columns.next_multiple_of(weight.width), 0.0);
        Self { weight, bias, instructions }
    }

    /// Rows `[row, in]` to rows `[row, out]`.
    #[must_use]
    pub fn forward(&self, rows: &[f32]) -> Vec<f32> {
        let num_rows = rows.len().checked_div(self.weight.depth).unwrap_or(0);
        let mut out = vec![0.0; num_rows * self.weight.columns];
        self.write(rows, &mut out, Finish::Keep, &mut Vec::new());
        out
    }

    fn write(&self, rows: &[f32], out: &mut [f32], finish: Finish, scratch: &mut Vec<f32>) {
        self.instructions.run(Product {
            left: rows,
            left_stride: self.weight.depth,
            rows: out.len() / self.weight.columns,
            right: &self.weight,
            bias: Some(&self.bias),
            out,
            out_stride: self.weight.columns,
            finish,
            scratch,
        });
    }
}

/// Layer normalisation over a row.
#[derive(Debug)]
pub struct Norm {
    scale: Vec<f32>,
    shift: Vec<f32>,
    epsilon: f32,
    instructions: Instructions,
}

impl Norm {
    /// From `[width]` scales and shifts; `epsilon` is added to the variance.
    ///
    /// # Panics
    /// When there are no scales, or not as many shifts.
    #[must_use]
    pub fn new(scale: Vec<f32>, shift: Vec<f32>, epsilon: f32, instructions: Instructions) -> Self {
        assert!(!scale.is_empty() && scale.len() == shift.len(), "a scale and a shift for each column");
        Self { scale, shift, epsilon, instructions }
    }

    /// Normalises rows `[row, width]` in place.
    pub fn apply(&self, rows: &mut [f32]) {
        let Self { scale, shift, epsilon, instructions } = self;
        instructions.run(Normalise { rows, scale, shift, epsilon: *epsilon });
    }
}

/// Self-attention and a feed-forward block, each added to its input and normalised (Devlin et al. 2019).
#[derive(Debug)]
pub struct Layer {
    /// `[3 width, width]`: queries, keys and values, one below the other.
    pub projected: Linear,
    /// `[width, width]`, after attention.
    pub mixed: Linear,
    /// After attention.
    pub attention_norm: Norm,
    /// `[inner, width]`, with a GELU after it.
    pub inner: Linear,
    /// `[width, inner]`.
    pub outer: Linear,
    /// After the feed-forward block.
    pub output_norm: Norm,
    /// Heads of attention; they share the width equally.
    pub num_heads: usize,
}

impl Layer {
    /// Replaces `tokens`, `[token, width]`, of sentences of these lengths one after the other.
    ///
    /// # Panics
    /// When the lengths do not add up to the tokens.
    pub fn apply(&self, tokens: &mut [f32], lengths: &[usize], memory: &mut Memory) {
        let width = self.mixed.weight.columns;
        let num_tokens = tokens.len() / width;
        assert_eq!(lengths.iter().sum::<usize>(), num_tokens, "every token belongs to a sentence");
        let Memory { projected, heard, inner, scores, scratch } = memory;
        let projected = at_least(projected, num_tokens * 3 * width);
        self.projected.write(tokens, projected, Finish::Keep, scratch);
        let heard = at_least(heard, num_tokens * width);
        let mut first = 0;
        for &length in lengths {
            let sentence = Sentence {
                projected: &projected[first * 3 * width..][..length * 3 * width],
                length,
                width,
                num_heads: self.num_heads,
            };
            let heard = &mut heard[first * width..][..length * width];
            sentence.attend(self.mixed.instructions, heard, scores, scratch);
            first += length;
        }
        self.mixed.write(heard, tokens, Finish::Add, scratch);
        self.attention_norm.apply(tokens);
        let inner = at_least(inner, num_tokens * self.inner.weight.columns);
        self.inner.write(tokens, inner, Finish::Gelu, scratch);
        self.outer.write(inner, tokens, Finish::Add, scratch);
        self.output_norm.apply(tokens);
    }
}

/// Memory that layers work in, kept from one to the next.
#[derive(Debug, Default)]
pub struct Memory {
    projected: Vec<f32>,
    heard: Vec<f32>,
    inner: Vec<f32>,
    scores: Vec<f32>,
    scratch: Vec<f32>,
}

/// The first `length` numbers, whatever they are.
pub(crate) fn at_least(numbers: &mut Vec<f32>, length: usize) -> &mut [f32] {
    if numbers.len() < length {
        numbers.resize(length, 0.0);
    }
    &mut numbers[..length]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(len: usize, seed: usize) -> Vec<f32> {
        (0..len).map(|k| ((k * 7919 + seed * 104_729) % 1999) as f32 / 1000.0 - 1.0).collect()
    }

    fn layer(width: usize, inner: usize, instructions: Instructions) -> Layer {
        let linear = |from, to| Linear::new(&numbers(from * to, from), &numbers(to, to), instructions);
        let norm = || Norm::new(numbers(width, 5), numbers(width, 6), 1e-5, instructions);
        Layer {
            projected: linear(width, 3 * width),
            mixed: linear(width, width),
            attention_norm: norm(),
            inner: linear(width, inner),
            outer: linear(inner, width),
            output_norm: norm(),
            num_heads: 2,
        }
    }

    #[test]
    fn a_sentence_has_the_same_bits_in_any_company() {
        let (width, lengths) = (72, [5, 1, 31, 14, 2]);
        for instructions in Instructions::all() {
            let layer = layer(width, 100, instructions);
            let tokens = numbers(lengths.iter().sum::<usize>() * width, 7);
            let mut together = tokens.clone();
            layer.apply(&mut together, &lengths, &mut Memory::default());
            let mut memory = Memory::default();
            let mut first = 0;
            for length in lengths {
                let range = first * width..(first + length) * width;
                let mut alone = tokens[range.clone()].to_vec();
                layer.apply(&mut alone, &[length], &mut memory);
                assert_eq!(alone, together[range], "{length} with {}", instructions.name());
                first += length;
            }
        }
    }

    #[test]
    fn sets_of_instructions_agree() {
        let tokens = numbers(20 * 72, 7);
        let results: Vec<Vec<f32>> = Instructions::all()
            .into_iter()
            .map(|instructions| {
                let mut tokens = tokens.clone();
                layer(72, 100, instructions).apply(&mut tokens, &[9, 11], &mut Memory::default());
                tokens
            })
            .collect();
        for other in &results {
            for (a, b) in results[0].iter().zip(other) {
                assert!((a - b).abs() < 1e-4, "{a} {b}");
            }
        }
    }
}
