//! Whether what a model is scored on was kept from it.

use std::collections::BTreeSet;

use serde::Serialize;

use crate::features::{Pair, PreparedSet};
use crate::model::Bundle;

/// Whether the motions a model is scored on were kept from it while it learned.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum HeldOut {
    /// It learned from none of them.
    Yes,
    /// It learned from some of them.
    No {
        /// How many it learned from.
        learned: usize,
        /// How many are scored.
        scored: usize,
        /// Id of the first that it learned from.
        first: String,
    },
    /// The bundle is of a version that did not say what it learned from.
    NotKnown,
}

impl HeldOut {
    /// Looks up the motions of some pairs of a set, by their ids, among those a model learned from.
    #[must_use]
    pub fn of(bundle: &Bundle, set: &PreparedSet, pairs: &[Pair]) -> Self {
        let Some(learned) = &bundle.config.learned_from else { return Self::NotKnown };
        let ids: BTreeSet<&str> = pairs.iter().map(|pair| set.motions[pair.motion].id.as_str()).collect();
        let mut known = ids.iter().filter(|id| learned.has(id));
        match known.next() {
            None => Self::Yes,
            Some(first) => {
                let first = (*first).to_owned();
                Self::No { learned: 1 + known.count(), scored: ids.len(), first }
            }
        }
    }

    /// For a person, as the end of a line that begins with `held out: `.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Yes => "yes, the model learned from none of these motions".to_owned(),
            Self::No { learned, scored, .. } => {
                format!("no, the model learned from {learned} of {scored} motions")
            }
            Self::NotKnown => "not known, for the bundle does not say what it learned from".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::model::Rprae;
    use crate::model::tests::tiny;
    use crate::training::tests::four_pairs;

    #[test]
    fn motions_that_were_learned_from_are_found_by_their_ids() {
        let full = four_pairs();
        let mut part = full.clone();
        part.paired.truncate(2);
        part.non_paired_motions = vec![0, 1];
        let mut bundle =
            Bundle::new(&Rprae::new(&tiny(), &part.vocabulary, 1, &Device::flex()), &tiny(), &part);
        assert_eq!(HeldOut::of(&bundle, &full, &full.paired[2..]), HeldOut::Yes);
        let found = HeldOut::of(&bundle, &full, &full.paired[1..]);
        assert_eq!(found, HeldOut::No { learned: 1, scored: 3, first: "motion1".to_owned() });
        assert!(found.text().contains("1 of 3"));
        bundle.config.learned_from = None;
        assert_eq!(HeldOut::of(&bundle, &full, &full.paired), HeldOut::NotKnown);
    }
}
