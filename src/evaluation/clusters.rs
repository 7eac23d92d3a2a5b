//! Which segments are drawn together.

use std::collections::BTreeMap;

/// Segments in groups; a score is resampled by group, never by segment.
///
/// Captions of one motion rise and fall together: drawn one by one they would count as independent and make an interval
/// narrower than it is (Davison and Hinkley 1997, "Bootstrap methods and their application", section 3.8).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clusters {
    /// Where each group begins in `segments`, and where the last one ends.
    starts: Vec<usize>,
    /// Segments, group by group.
    segments: Vec<usize>,
}

impl Clusters {
    /// Every segment on its own.
    #[must_use]
    pub fn singles(num_segments: usize) -> Self {
        Self { starts: (0..=num_segments).collect(), segments: (0..num_segments).collect() }
    }

    /// Segments of equal keys together, groups in the order of their first segment.
    #[must_use]
    pub fn of<K: Ord>(keys: impl IntoIterator<Item = K>) -> Self {
        let mut places: BTreeMap<K, usize> = BTreeMap::new();
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (segment, key) in keys.into_iter().enumerate() {
            let place = *places.entry(key).or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
            }
            groups[place].push(segment);
        }
        let mut clusters = Self { starts: vec![0], segments: Vec::new() };
        for group in groups {
            clusters.segments.extend(group);
            clusters.starts.push(clusters.segments.len());
        }
        clusters
    }

    /// The groups of other segments, which come after those that are here, beside these.
    pub fn append(&mut self, others: &Self) {
        let before = self.segments.len();
        self.segments.extend(others.segments.iter().map(|segment| segment + before));
        self.starts.extend(others.starts[1..].iter().map(|start| start + before));
    }

    /// Number of groups.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no group.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of segments in all groups.
    #[must_use]
    pub fn num_segments(&self) -> usize {
        self.segments.len()
    }

    /// Segments of a group, in rising order.
    ///
    /// # Panics
    /// If there is no such group.
    #[must_use]
    pub fn members(&self, group: usize) -> &[usize] {
        &self.segments[self.starts[group]..self.starts[group + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_keys_belong_together() {
        let mut clusters = Clusters::of(["b", "a", "b", "c"]);
        assert_eq!((clusters.len(), clusters.num_segments()), (3, 4));
        assert_eq!((clusters.members(0), clusters.members(1)), (&[0, 2][..], &[1][..]));
        clusters.append(&Clusters::of(["a", "a"]));
        assert_eq!((clusters.len(), clusters.members(3)), (4, &[4, 5][..]));
        assert_eq!(Clusters::of([1, 2, 3]), Clusters::singles(3));
        assert!(Clusters::singles(0).is_empty());
    }
}
