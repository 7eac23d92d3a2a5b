//! Self-attention of one sentence (Vaswani et al. 2017, Eq. 1).

use crate::elementwise::Softmax;
use crate::layer::at_least;
use crate::packed::Packed;
use crate::product::{Finish, Product};
use rprae_lanes::Instructions;

/// A sentence before attention.
#[derive(Clone, Copy)]
pub(crate) struct Sentence<'a> {
    /// `[token, 3 width]`: queries, keys, values, each with the heads one after the other.
    pub(crate) projected: &'a [f32],
    /// Number of tokens.
    pub(crate) length: usize,
    pub(crate) width: usize,
    pub(crate) num_heads: usize,
}

impl Sentence<'_> {
    /// Writes what each token hears, `[token, width]`.
    pub(crate) fn attend(
        self,
        instructions: Instructions,
        heard: &mut [f32],
        scores: &mut Vec<f32>,
        scratch: &mut Vec<f32>,
    ) {
        let Self { projected, length, width, num_heads } = self;
        let (stride, size) = (3 * width, width / num_heads);
        let lanes = instructions.lanes();
        for head in (0..width).step_by(size) {
            let piece = |token: usize, first: usize| &projected[token * stride + first + head..][..size];
            let keys = Packed::from_columns([size, length], lanes, |token| piece(token, width));
            let values =
                Packed::from_rows([length, size], lanes, |token, range| &piece(token, 2 * width)[range]);
            let row = length.next_multiple_of(keys.width);
            let scores = at_least(scores, length * row);
            instructions.run(Product {
                left: &projected[head..],
                left_stride: stride,
                rows: length,
                right: &keys,
                bias: None,
                out: scores,
                out_stride: row,
                finish: Finish::Keep,
                scratch,
            });
            let scale = 1.0 / (size as f32).sqrt();
            instructions.run(Softmax { rows: scores, stride: row, length, scale });
            instructions.run(Product {
                left: scores,
                left_stride: row,
                rows: length,
                right: &values,
                bias: None,
                out: &mut heard[head..],
                out_stride: width,
                finish: Finish::Keep,
                scratch,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_hear_values_by_the_likeness_of_query_and_key() {
        let (num_heads, size) = (3, 8);
        let width = num_heads * size;
        for instructions in Instructions::all() {
            for length in [1, 2, 17, 70] {
                let projected: Vec<f32> =
                    (0..length * 3 * width).map(|k| ((k * 7919) % 1999) as f32 / 500.0 - 2.0).collect();
                let sentence = Sentence { projected: &projected, length, width, num_heads };
                let mut heard = vec![0.0; length * width];
                sentence.attend(instructions, &mut heard, &mut Vec::new(), &mut Vec::new());
                let at = |token: usize, part: usize, column| {
                    f64::from(projected[(token * 3 + part) * width + column])
                };
                for (place, &got) in heard.iter().enumerate() {
                    let (token, column) = (place / width, place % width);
                    let head = column / size * size;
                    let likeness = |other| {
                        let products = (head..head + size).map(|c| at(token, 0, c) * at(other, 1, c));
                        (products.sum::<f64>() / (size as f64).sqrt()).exp()
                    };
                    let total: f64 = (0..length).map(likeness).sum();
                    let want =
                        (0..length).map(|other| likeness(other) * at(other, 2, column)).sum::<f64>() / total;
                    assert!((f64::from(got) - want).abs() < 1e-5, "{length}: {got} {want}");
                }
            }
        }
    }
}
