//! Words and their numbers.

use serde::{Deserialize, Serialize};

/// Number of the word that begins every sentence.
pub const BOS: u32 = 0;
/// Number of the word that ends every sentence.
pub const EOS: u32 = 1;

/// The words a model can read and write, with the vectors they enter it by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Vocabulary {
    /// Words by number; [`BOS`] and [`EOS`] first, the rest sorted.
    pub words: Vec<String>,
    /// Numbers in a word vector (300 for the paper).
    pub dimensions: usize,
    /// Vector of each word, `dimensions` long; `None` for special words and words without one, whose vectors are trained.
    pub vectors: Vec<Option<Vec<f32>>>,
}

impl Vocabulary {
    /// Number of a word, if it is known.
    #[must_use]
    pub fn index(&self, word: &str) -> Option<u32> {
        let rest = &self.words[2..];
        rest.binary_search_by(|known| known.as_str().cmp(word)).ok().map(|place| place as u32 + 2)
    }
}
