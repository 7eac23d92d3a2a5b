//! How well a number tells two groups apart.

/// Area under the ROC curve: the probability that a faulty value is larger than a clean one, ties counting half.
///
/// Values within `resolution` of each other are tied: of numbers that are equal but for rounding, rounding must not decide.
/// `None` when either group is empty.
/// Computed from ranks (Hanley and McNeil 1982, Radiology 143:29).
pub(super) fn area(clean: &[f64], faulty: &[f64], resolution: f64) -> Option<f64> {
    if clean.is_empty() || faulty.is_empty() {
        return None;
    }
    let mut sorted = clean.to_vec();
    sorted.sort_by(f64::total_cmp);
    let total: f64 = faulty
        .iter()
        .map(|value| {
            let below = sorted.partition_point(|clean| *clean < value - resolution);
            let not_above = sorted.partition_point(|clean| *clean <= value + resolution);
            (below + not_above) as f64 / 2.0
        })
        .sum();
    Some(total / (clean.len() * faulty.len()) as f64)
}

/// Pairs (clean, faulty) in which the faulty value is larger, and in which it is smaller.
///
/// Values within 1 % of the larger one, or within `resolution` of each other, are equal.
pub(super) fn changed(pairs: &[(f64, f64)], resolution: f64) -> [usize; 2] {
    let differ = |&&(clean, faulty): &&(f64, f64)| {
        (faulty - clean).abs() > (0.01 * clean.abs().max(faulty.abs())).max(resolution)
    };
    let different = || pairs.iter().filter(differ);
    let larger = different().filter(|(clean, faulty)| faulty > clean).count();
    [larger, different().count() - larger]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_counts_pairs_in_order() {
        assert_eq!(area(&[1.0, 2.0], &[3.0, 4.0], 0.0), Some(1.0));
        assert_eq!(area(&[3.0, 4.0], &[1.0, 2.0], 0.0), Some(0.0));
        assert_eq!(area(&[1.0, 3.0], &[2.0, 3.0], 0.0), Some((1.0 + 1.5) / 4.0));
        assert_eq!(area(&[1.0; 5], &[1.0; 3], 0.0), Some(0.5));
        assert_eq!(area(&[], &[1.0], 0.0), None);
    }

    #[test]
    fn rounding_does_not_decide_between_equal_values() {
        let (clean, faulty) = ([0.0, 0.0, 5.0], [1e-12, 1e-12, 5.0 - 1e-12]);
        assert_eq!(area(&clean, &faulty, 1e-3), Some(0.5));
        assert_eq!(area(&clean, &faulty.map(|value| value + 1.0), 1e-3), Some(7.0 / 9.0));
    }

    #[test]
    fn pairs_that_hardly_differ_are_equal() {
        assert_eq!(changed(&[(1.0, 2.0), (1.0, 1.005), (5.0, 1.0), (0.0, 0.0005)], 1e-3), [1, 1]);
        assert_eq!(changed(&[(1.0, 2.0), (3.0, 4.0), (0.0, 0.05)], 0.1), [2, 0]);
    }
}
