//! How different motions are from each other.

use super::embeddings::Embeddings;
use super::jackknife::SetScore;
use crate::evaluation::clusters::Clusters;
use crate::evaluation::signature::Signature;

/// Mean Euclidean distance over all pairs of embeddings; `None` below two.
///
/// Unit: that of the space. To be compared with the diversity of recorded motions: neither higher nor lower is better.
/// Guo et al. draw 300 pairs; this is what those draws approach. For the interval the motions of a group are left out
/// together.
///
/// # Panics
/// If these are groups of another number of motions.
#[must_use]
pub fn diversity(motions: &Embeddings, groups: &Clusters, of: &str, evaluator: &str) -> Option<SetScore> {
    assert_eq!(groups.num_segments(), motions.len(), "groups of the motions");
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
    // Without a group its distances are missing twice, but those within it only once.
    let without = |group: usize| {
        let members = groups.members(group);
        let all: f64 = members.iter().map(|&index| sums[index]).sum();
        let within = |&index: &usize| -> f64 {
            members.iter().map(|&other| motions.distance(index, motions, other)).sum()
        };
        let within: f64 = members.iter().map(within).sum();
        mean(total - 2.0 * all + within, num - members.len())
    };
    Some(SetScore::of("diversity", signature, mean(total, num), groups.len(), without))
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
        .filter_map(|motions| diversity(motions, &Clusters::singles(motions.len()), "", ""))
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

    fn alone(motions: &Embeddings) -> Option<SetScore> {
        diversity(motions, &Clusters::singles(motions.len()), "generated", "e")
    }

    #[test]
    fn all_pairs_count() {
        // Distances 1, 3 and 2.
        let score = alone(&line(&[0.0, 1.0, 3.0])).unwrap();
        assert_eq!(score.value, 2.0);
        assert_eq!(score.signature.as_str(), "diversity|of:generated|pairs:all|n:3|evaluator:e|v:1");
        assert_eq!(alone(&line(&[1.0])), None);
    }

    #[test]
    fn leaving_one_out_is_leaving_its_distances_out() {
        let motions = line(&[0.0, 1.0, 3.0, 7.0, 20.0, 4.0, 9.0]);
        // The last two belong to the first and to the third.
        let groups = [0, 1, 2, 3, 4, 0, 2];
        let found = diversity(&motions, &Clusters::of(groups), "", "").unwrap();
        let interval = found.interval.unwrap();
        assert_eq!(found.value, alone(&motions).unwrap().value);
        let left_out = |group: usize| {
            let kept: Vec<usize> = (0..7).filter(|&other| groups[other] != group).collect();
            alone(&motions.select(&kept)).unwrap().value
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
