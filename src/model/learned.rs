//! What a model learned from.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::features::PreparedSet;

/// The data of a training run, as far as they must be known when the model is scored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearnedFrom {
    /// Fingerprint of the prepared set.
    pub fingerprint: String,
    /// Ids of the motions of its pairs and of its non-paired samples, sorted; motions that were watched or scored only are not
    /// among them.
    pub motions: Vec<String>,
}

impl LearnedFrom {
    /// What a run on a set learns from.
    #[must_use]
    pub fn of(set: &PreparedSet) -> Self {
        let paired = set.paired.iter().map(|pair| pair.motion);
        let places: BTreeSet<usize> = paired.chain(set.non_paired_motions.iter().copied()).collect();
        let ids: BTreeSet<&str> = places.into_iter().map(|place| set.motions[place].id.as_str()).collect();
        Self { fingerprint: set.fingerprint.clone(), motions: ids.into_iter().map(str::to_owned).collect() }
    }

    /// Whether a motion was learned from.
    #[must_use]
    pub fn has(&self, id: &str) -> bool {
        self.motions.binary_search_by(|motion| motion.as_str().cmp(id)).is_ok()
    }

    /// Whether the ids are in the order that [`LearnedFrom::has`] relies on.
    pub(super) fn is_sound(&self) -> bool {
        self.motions.is_sorted_by(|a, b| a < b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::tests::four_pairs;

    #[test]
    fn pairs_and_non_paired_samples_are_learned_from_and_others_are_not() {
        let mut set = four_pairs();
        set.non_paired_motions = vec![3, 3];
        set.paired.truncate(2);
        let learned = LearnedFrom::of(&set);
        assert_eq!(learned.motions, ["motion0", "motion1", "motion3"]);
        assert!(learned.has("motion3") && !learned.has("motion2"));
        assert_eq!(learned.fingerprint, "some data");
        let shuffled = LearnedFrom { motions: vec!["b".to_owned(), "a".to_owned()], ..learned };
        assert!(!shuffled.is_sound());
    }
}
