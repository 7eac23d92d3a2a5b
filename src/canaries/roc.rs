//! How well a number tells two groups apart.

/// Area under the ROC curve: the probability that a faulty value is larger than a clean one, ties counting half.
///
/// `None` when either group is empty.
/// Computed from ranks (Hanley and McNeil 1982, Radiology 143:29).
pub(super) fn area(clean: &[f64], faulty: &[f64]) -> Option<f64> {
    if clean.is_empty() || faulty.is_empty() {
        return None;
    }
    let mut sorted = clean.to_vec();
    sorted.sort_by(f64::total_cmp);
    let total: f64 = faulty
        .iter()
        .map(|value| {
            let below = sorted.partition_point(|clean| clean < value);
            let not_above = sorted.partition_point(|clean| clean <= value);
            (below + not_above) as f64 / 2.0
        })
        .sum();
    Some(total / (clean.len() * faulty.len()) as f64)
}

/// Share of pairs (clean, faulty) in which the faulty value is larger, equal ones counting half.
///
/// Values within 1 % of the larger one, or within `1e-3` of each other, are equal: solvers stop at less than that.
pub(super) fn paired(pairs: &[(f64, f64)]) -> Option<f64> {
    let score = |&(clean, faulty): &(f64, f64)| {
        let tolerance = (0.01 * clean.abs().max(faulty.abs())).max(1e-3);
        if (faulty - clean).abs() <= tolerance { 0.5 } else { f64::from(u8::from(faulty > clean)) }
    };
    (!pairs.is_empty()).then(|| pairs.iter().map(score).sum::<f64>() / pairs.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_counts_pairs_in_order() {
        assert_eq!(area(&[1.0, 2.0], &[3.0, 4.0]), Some(1.0));
        assert_eq!(area(&[3.0, 4.0], &[1.0, 2.0]), Some(0.0));
        assert_eq!(area(&[1.0, 3.0], &[2.0, 3.0]), Some((1.0 + 1.5) / 4.0));
        assert_eq!(area(&[1.0; 5], &[1.0; 3]), Some(0.5));
        assert_eq!(area(&[], &[1.0]), None);
    }

    #[test]
    fn pairs_that_hardly_differ_are_equal() {
        assert_eq!(paired(&[(1.0, 2.0), (1.0, 1.005), (5.0, 1.0), (0.0, 0.0005)]), Some(0.5));
        assert_eq!(paired(&[(1.0, 2.0), (3.0, 4.0)]), Some(1.0));
        assert_eq!(paired(&[]), None);
    }
}
