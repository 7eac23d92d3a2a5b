//! How different motions are from each other.

use super::embeddings::Embeddings;
use super::jackknife::SetScore;
use crate::evaluation::signature::Signature;

/// Mean Euclidean distance over all pairs of embeddings; `None` below two.
///
/// Unit: that of the space. To be compared with the diversity of recorded motions: neither higher nor lower is better.
/// Guo et al. draw 300 pairs; this is what those draws approach.
#[must_use]
pub fn diversity(motions: &Embeddings, of: &str, evaluator: &str) -> Option<SetScore> {
    let num = motions.len();
    if num < 2 {
        return None;
    }
    let sums: Vec<f64> = (0..num)
        .map(|index| (0..num).map(|other| motions.distance(index, motions, other)).sum::<f64>())
        .collect();
    let total: f64 = sums.iter().sum();
    let mean = |total: f64, num: usize| total / (num * (num - 1)) as f64;
    let signature = Signature::new("diversity")
        .with("of", of)
        .with("pairs", "all")
        .with("n", num)
        .with("evaluator", evaluator)
        .with("v", 1);
    // Without one motion, its distances to the others are missing twice.
    let without = |index: usize| mean(total - 2.0 * sums[index], num - 1);
    Some(SetScore::of("diversity", signature, mean(total, num), num, without))
}

/// Mean over captions of the mean distance over all pairs of motions made from one caption; `None` where no caption has
/// two motions.
///
/// 0 for a model that makes one motion of a caption.
/// Guo et al. draw 10 pairs of 30 motions; this is what those draws approach.
#[must_use]
pub fn multimodality(per_caption: &[Embeddings], evaluator: &str) -> Option<SetScore> {
    let spreads: Vec<f64> = per_caption
        .iter()
        .filter_map(|motions| diversity(motions, "", ""))
        .map(|score| score.value)
        .collect();
    let num = spreads.len();
    if num == 0 {
        return None;
    }
    let total: f64 = spreads.iter().sum();
    let signature = Signature::new("multimodality")
        .with("pairs", "all")
        .with("captions", num)
        .with("evaluator", evaluator)
        .with("v", 1);
    let without = |index: usize| (total - spreads[index]) / (num - 1) as f64;
    Some(SetScore::of("multimodality", signature, total / num as f64, num, without))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(places: &[f32]) -> Embeddings {
        Embeddings::new(&places.iter().map(|&place| vec![place]).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn all_pairs_count() {
        // Distances 1, 3 and 2.
        let score = diversity(&line(&[0.0, 1.0, 3.0]), "generated", "e").unwrap();
        assert_eq!(score.value, 2.0);
        assert_eq!(score.signature.as_str(), "diversity|of:generated|pairs:all|n:3|evaluator:e|v:1");
        assert_eq!(diversity(&line(&[1.0]), "generated", "e"), None);
    }

    #[test]
    fn leaving_one_out_is_leaving_its_distances_out() {
        let motions = line(&[0.0, 1.0, 3.0, 7.0, 20.0]);
        let interval = diversity(&motions, "", "").unwrap().interval.unwrap();
        let left_out = |index: usize| {
            let kept: Vec<usize> = (0..5).filter(|&other| other != index).collect();
            diversity(&motions.select(&kept), "", "").unwrap().value
        };
        let left: Vec<f64> = (0..5).map(left_out).collect();
        let mean = left.iter().sum::<f64>() / 5.0;
        let error = (left.iter().map(|one| (one - mean).powi(2)).sum::<f64>() * 0.8).sqrt();
        assert!((0.5 * (interval.high - interval.low) - 1.96 * error).abs() < 1e-9);
    }

    #[test]
    fn one_motion_a_caption_has_no_modes() {
        assert_eq!(multimodality(&[line(&[1.0])], "e"), None);
        let score = multimodality(&[line(&[1.0, 1.0]), line(&[0.0, 4.0]), line(&[9.0])], "e").unwrap();
        assert_eq!(score.value, 2.0);
    }
}
