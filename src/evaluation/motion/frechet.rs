//! The distance between two Gaussians, fitted to embeddings (FID).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::embeddings::Embeddings;
use super::jackknife::SetScore;
use crate::evaluation::signature::Signature;

/// Groups of recordings left out in turn: each costs two decompositions, which take the cube of the dimensions.
const MAX_GROUPS: usize = 50;

/// How a covariance is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Covariance {
    /// The sample covariance, with n - 1.
    Sample,
    /// Shrunk towards a multiple of the identity by the intensity of Ledoit and Wolf 2004, "A well-conditioned estimator for
    /// large-dimensional covariance matrices", with n.
    LedoitWolf,
}

impl Covariance {
    /// The sample covariance where it can have full rank, the shrunk one where there are too few vectors for that.
    #[must_use]
    pub fn for_size(num: usize, dimensions: usize) -> Self {
        if num > dimensions { Self::Sample } else { Self::LedoitWolf }
    }

    /// Name in signatures.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::LedoitWolf => "ledoit-wolf",
        }
    }

    /// Mean and covariance of embeddings.
    fn fit(self, embeddings: &Embeddings) -> (DVector<f64>, DMatrix<f64>) {
        let (mean, centred) = embeddings.centred();
        let num = embeddings.len() as f64;
        let scatter = centred.tr_mul(&centred);
        let covariance = match self {
            Self::Sample => scatter / (num - 1.0).max(1.0),
            Self::LedoitWolf => shrunk(&centred, scatter / num),
        };
        (DVector::from_vec(mean), covariance)
    }
}

/// The covariance `empirical` of `centred` vectors, shrunk.
fn shrunk(centred: &DMatrix<f64>, empirical: DMatrix<f64>) -> DMatrix<f64> {
    let (num, dimensions) = (centred.nrows() as f64, centred.ncols() as f64);
    let trace = empirical.trace();
    let scale = trace / dimensions;
    let squares = empirical.norm_squared();
    let centred_squares = centred.map(|value| value * value);
    // Sum over all entries of (X^2)' (X^2): the squared length of each vector, squared.
    let fourth: f64 = centred_squares.row_iter().map(|row| row.sum() * row.sum()).sum();
    let spread = (fourth / num - squares) / (dimensions * num);
    let distance = (squares - 2.0 * scale * trace + dimensions * scale * scale) / dimensions;
    let intensity = if distance > 0.0 { (spread / distance).clamp(0.0, 1.0) } else { 0.0 };
    let mut covariance = empirical * (1.0 - intensity);
    for place in 0..centred.ncols() {
        covariance[(place, place)] += intensity * scale;
    }
    covariance
}

/// `|m1 - m2|^2 + tr(S1 + S2 - 2 (S1 S2)^(1/2))`, the squared Frechet distance of two Gaussians.
///
/// The trace of the root comes from the eigenvalues of the symmetric `S1^(1/2) S2 S1^(1/2)`, which needs neither a complex
/// root nor an added diagonal where a covariance is singular. 0 and above; lower is better.
///
/// # Panics
/// If the embeddings have vectors of different lengths.
#[must_use]
pub fn frechet_distance(a: &Embeddings, b: &Embeddings, covariance: Covariance) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions(), "numbers in a vector");
    let ((mean_a, cov_a), (mean_b, cov_b)) = (covariance.fit(a), covariance.fit(b));
    let traces = cov_a.trace() + cov_b.trace();
    let eigen = SymmetricEigen::new(cov_a);
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    let half = &eigen.eigenvectors * DMatrix::from_diagonal(&roots);
    let mut inner = half.tr_mul(&cov_b) * &half;
    // Rounding leaves it a little off symmetry.
    inner = (&inner + inner.transpose()) * 0.5;
    let trace_of_root: f64 = inner.symmetric_eigenvalues().iter().map(|value| value.max(0.0).sqrt()).sum();
    ((mean_a - mean_b).norm_squared() + traces - 2.0 * trace_of_root).max(0.0)
}

/// FID of generated motions and recorded ones, each recording once, however many motions were made of its captions.
///
/// `of` is the place of the recording that each generated motion stands for; for the interval, recordings are left out with
/// all motions that stand for them. The value falls as the numbers grow, so only values of equal numbers compare.
///
/// # Panics
/// If the vectors have different lengths, or `of` is not a recording for each generated motion.
#[must_use]
pub fn frechet_score(
    generated: &Embeddings,
    recorded: &Embeddings,
    of: &[usize],
    evaluator: &str,
) -> SetScore {
    assert!(
        of.len() == generated.len() && of.iter().all(|&place| place < recorded.len()),
        "a recorded motion for each generated one"
    );
    let least = generated.len().min(recorded.len());
    let covariance = Covariance::for_size(least, generated.dimensions());
    let signature = Signature::new("fid")
        .with("covariance", covariance.name())
        .with("n", generated.len())
        .with("recorded", recorded.len())
        .with("dimensions", generated.dimensions())
        .with("evaluator", evaluator)
        .with("v", 2);
    let value = frechet_distance(generated, recorded, covariance);
    let groups = recorded.len().min(MAX_GROUPS);
    SetScore::of("fid", signature, value, groups, |group| {
        let is_kept = |recording: usize| recording % groups != group;
        let ours: Vec<usize> = (0..generated.len()).filter(|&index| is_kept(of[index])).collect();
        let theirs: Vec<usize> = (0..recorded.len()).filter(|&index| is_kept(index)).collect();
        if ours.is_empty() {
            // Only where no motion stands for most recordings.
            return value;
        }
        frechet_distance(&generated.select(&ours), &recorded.select(&theirs), covariance)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vectors with mean `mean` and the diagonal covariance `spread^2`, exactly: plus and minus along each axis.
    fn exact(mean: [f32; 2], spread: [f32; 2]) -> Embeddings {
        // Four vectors, n - 1 = 3: two of them along an axis give 2 d^2 / 3.
        let far = spread.map(|spread| spread * 1.5_f32.sqrt());
        let vectors = [[far[0], 0.0], [-far[0], 0.0], [0.0, far[1]], [0.0, -far[1]]];
        let moved = vectors.map(|[x, y]| vec![x + mean[0], y + mean[1]]);
        Embeddings::new(&moved).unwrap()
    }

    #[test]
    fn two_gaussians_have_their_closed_form() {
        // With diagonal covariances: |m1 - m2|^2 + sum (s1 - s2)^2 = 9 + 16 + 1 + 4.
        let distance = frechet_distance(
            &exact([0.0, 0.0], [1.0, 5.0]),
            &exact([3.0, 4.0], [2.0, 3.0]),
            Covariance::Sample,
        );
        assert!((distance - 30.0).abs() < 1e-4, "{distance}");
    }

    #[test]
    fn a_set_is_at_no_distance_from_itself() {
        let set = exact([1.0, 2.0], [0.5, 0.0]);
        for covariance in [Covariance::Sample, Covariance::LedoitWolf] {
            assert!(frechet_distance(&set, &set, covariance) < 1e-9);
        }
    }

    #[test]
    fn captions_of_one_recording_do_not_repeat_it() {
        let recorded = exact([0.0, 0.0], [1.0, 5.0]);
        // Of the second recording three motions, of the others one each.
        let of = [0, 1, 1, 1, 2, 3];
        let made = recorded.select(&of);
        let score = frechet_score(&made, &recorded, &of, "e");
        assert_eq!(score.value, frechet_distance(&made, &recorded, Covariance::Sample));
        assert!(score.value > 0.0 && score.signature.as_str().contains("|n:6|recorded:4|"), "{score:?}");
    }

    #[test]
    fn few_vectors_are_told() {
        let set = exact([1.0, 2.0], [0.5, 1.0]);
        let score = frechet_score(&set, &set, &[0, 1, 2, 3], "e");
        assert_eq!(
            score.signature.as_str(),
            "fid|covariance:sample|n:4|recorded:4|dimensions:2|evaluator:e|v:2"
        );
        assert_eq!(Covariance::for_size(96, 96), Covariance::LedoitWolf);
    }
}
