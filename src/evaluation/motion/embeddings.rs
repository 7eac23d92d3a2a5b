//! Vectors of one space.

use nalgebra::DMatrix;
use thiserror::Error;

/// Vectors of equal length, checked once.
#[derive(Debug, Clone, PartialEq)]
pub struct Embeddings {
    dimensions: usize,
    /// `[item, dimension]`, row by row.
    values: Vec<f64>,
}

/// Vectors that are no embeddings.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum EmbeddingsError {
    /// Nothing was embedded, or into nothing.
    #[error("use embeddings: there are none")]
    Empty,
    /// Vectors of different lengths.
    #[error("use embeddings: vector {index} has {found} numbers and the first {expected}")]
    Ragged {
        /// Place of the vector.
        index: usize,
        /// Its length.
        found: usize,
        /// Length of the first.
        expected: usize,
    },
    /// A number that is infinite or none.
    #[error("use embeddings: vector {index} is not finite")]
    NotFinite {
        /// Place of the vector.
        index: usize,
    },
}

impl Embeddings {
    /// Checks vectors.
    ///
    /// # Errors
    /// An [`EmbeddingsError`] that names the first vector at fault.
    pub fn new(vectors: &[Vec<f32>]) -> Result<Self, EmbeddingsError> {
        let expected = vectors.first().map_or(0, Vec::len);
        if expected == 0 {
            return Err(EmbeddingsError::Empty);
        }
        for (index, vector) in vectors.iter().enumerate() {
            if vector.len() != expected {
                return Err(EmbeddingsError::Ragged { index, found: vector.len(), expected });
            }
            if !vector.iter().all(|value| value.is_finite()) {
                return Err(EmbeddingsError::NotFinite { index });
            }
        }
        let values = vectors.iter().flatten().map(|&value| f64::from(value)).collect();
        Ok(Self { dimensions: expected, values })
    }

    /// Number of vectors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len() / self.dimensions
    }

    /// Always false: there are vectors.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Numbers in a vector.
    #[must_use]
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// One vector.
    #[must_use]
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.dimensions..(index + 1) * self.dimensions]
    }

    /// Euclidean distance of a vector to one of other embeddings.
    ///
    /// # Panics
    /// If the vectors have different lengths.
    #[must_use]
    pub fn distance(&self, index: usize, others: &Self, other: usize) -> f64 {
        assert_eq!(self.dimensions, others.dimensions, "numbers in a vector");
        let squares = self.row(index).iter().zip(others.row(other)).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>().sqrt()
    }

    /// Some of the vectors, in the order given.
    ///
    /// # Panics
    /// If none is chosen.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        assert!(!indices.is_empty(), "at least one vector");
        let values = indices.iter().flat_map(|&index| self.row(index).iter().copied()).collect();
        Self { dimensions: self.dimensions, values }
    }

    /// Mean, and the vectors around it, `[item, dimension]`.
    pub(super) fn centred(&self) -> (Vec<f64>, DMatrix<f64>) {
        let num = self.len() as f64;
        let mean: Vec<f64> = (0..self.dimensions)
            .map(|place| (0..self.len()).map(|index| self.row(index)[place]).sum::<f64>() / num)
            .collect();
        let centred = DMatrix::from_fn(self.len(), self.dimensions, |index, place| {
            self.row(index)[place] - mean[place]
        });
        (mean, centred)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_embedding_is_named() {
        assert_eq!(Embeddings::new(&[]), Err(EmbeddingsError::Empty));
        assert_eq!(Embeddings::new(&[vec![]]), Err(EmbeddingsError::Empty));
        let ragged = Embeddings::new(&[vec![1.0], vec![1.0, 2.0]]);
        assert_eq!(ragged, Err(EmbeddingsError::Ragged { index: 1, found: 2, expected: 1 }));
        let infinite = Embeddings::new(&[vec![1.0], vec![f32::NAN]]);
        assert_eq!(infinite, Err(EmbeddingsError::NotFinite { index: 1 }));
    }

    #[test]
    fn distances_are_euclidean() {
        let a = Embeddings::new(&[vec![0.0, 0.0], vec![3.0, 0.0]]).unwrap();
        let b = Embeddings::new(&[vec![0.0, 4.0]]).unwrap();
        assert_eq!(a.distance(1, &b, 0), 5.0);
        assert_eq!(a.select(&[1]).row(0), [3.0, 0.0]);
    }
}
