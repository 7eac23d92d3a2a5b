//! Cosine between sentence vectors, as SimCSE and sentence-transformers are scored (Gao, Yao, Chen 2021).
//!
//! -1..1; 0 where a vector is zero.

use super::measurement::Measurement;
use super::signature::Signature;

/// What is made of several references.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OverReferences {
    /// The mean: what scoring every pair of hypothesis and reference on its own comes to.
    Mean,
    /// The best.
    Best,
}

/// Settings of the sentence cosine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentenceCosine {
    /// What is made of several references.
    pub over_references: OverReferences,
    /// Encoder and pooling, as in signatures.
    pub encoder: String,
}

/// The vectors of one hypothesis and of its references.
#[derive(Debug, Clone)]
pub struct VectorSegment<'a> {
    /// Vector of the hypothesis.
    pub hypothesis: &'a [f32],
    /// Vectors of the references.
    pub references: Vec<&'a [f32]>,
}

impl SentenceCosine {
    /// The cosine of a corpus: the mean over segments.
    #[must_use]
    pub fn measure(&self, segments: &[VectorSegment<'_>]) -> Measurement {
        let (key, over) = match self.over_references {
            OverReferences::Mean => ("cosine", "mean"),
            OverReferences::Best => ("cosine-best", "best"),
        };
        let values = segments
            .iter()
            .map(|segment| {
                let cosines =
                    segment.references.iter().map(|reference| cosine(segment.hypothesis, reference));
                match self.over_references {
                    OverReferences::Mean => cosines.sum::<f64>() / segment.references.len().max(1) as f64,
                    OverReferences::Best => cosines.fold(-1.0, f64::max),
                }
            })
            .collect();
        let signature =
            Signature::new(key).with("encoder", &self.encoder).with("references", over).with("v", 1);
        Measurement::of_values(key, signature, values)
    }
}

/// Cosine of the angle between two vectors of equal length; 0 where one is zero.
#[must_use]
pub fn cosine(a: &[f32], b: &[f32]) -> f64 {
    let dot =
        |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(&x, &y)| f64::from(x) * f64::from(y)).sum() };
    let lengths = (dot(a, a) * dot(b, b)).sqrt();
    if lengths > 0.0 { dot(a, b) / lengths } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_are_averaged_or_the_best_counts() {
        let segment = VectorSegment { hypothesis: &[1.0, 0.0], references: vec![&[2.0, 0.0], &[0.0, 3.0]] };
        let measure = |over_references| {
            SentenceCosine { over_references, encoder: "e".to_owned() }
                .measure(std::slice::from_ref(&segment))
        };
        assert_eq!(measure(OverReferences::Mean).score(), 0.5);
        assert_eq!(measure(OverReferences::Best).score(), 1.0);
        assert_eq!(measure(OverReferences::Mean).signature.as_str(), "cosine|encoder:e|references:mean|v:1");
    }

    #[test]
    fn a_zero_vector_has_no_direction() {
        assert_eq!(cosine(&[0.0, 0.0], &[1.0, 0.0]), 0.0);
    }
}
