//! Whether the right one is among the nearest.

use super::embeddings::Embeddings;
use crate::evaluation::clusters::Clusters;
use crate::evaluation::measurement::Measurement;
use crate::evaluation::resampling::Resampling;
use crate::evaluation::signature::Signature;
use crate::report::Interval;

/// Candidates of a pool, the right one included (Guo et al. 2022).
pub const POOL: usize = 32;

/// Where the right candidate of a query stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Rank {
    /// Wrong candidates at most as far away as the right one: a tie counts against it.
    pub ahead: usize,
    /// All wrong candidates.
    pub wrong: usize,
}

impl Rank {
    /// Probability that at most `top - 1` of `others` wrong candidates, drawn without replacement, are ahead.
    ///
    /// The hypergeometric distribution: the mean over all pools, where the field takes the mean over some that are drawn.
    #[must_use]
    pub fn chance_in_pool(self, top: usize, others: usize) -> f64 {
        let others = others.min(self.wrong);
        // Probability of exactly `drawn` ahead, from none upwards, by the ratio of neighbours.
        let behind = self.wrong - self.ahead;
        let mut total = 0.0;
        for drawn in 0..top.min(others + 1) {
            if drawn > self.ahead || others - drawn > behind {
                continue;
            }
            total += (ln_choose(self.ahead, drawn) + ln_choose(behind, others - drawn)
                - ln_choose(self.wrong, others))
            .exp();
        }
        total.min(1.0)
    }
}

fn ln_choose(from: usize, drawn: usize) -> f64 {
    (0..drawn).map(|index| ((from - index) as f64 / (drawn - index) as f64).ln()).sum()
}

/// What is looked for by what, and in whose space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Retrieval {
    /// What a query is, as in signatures: `caption`.
    pub query: &'static str,
    /// What candidates are, as in signatures: `generated-motion`.
    pub among: &'static str,
    /// Who embedded both.
    pub evaluator: String,
    /// Ranks of all queries.
    pub ranks: Vec<Rank>,
    /// Which queries are drawn together when a score is resampled.
    pub clusters: Clusters,
}

impl Retrieval {
    /// Ranks queries whose right candidate stands at the same place.
    ///
    /// `is_wrong(query, candidate)` says which others count as wrong: a second caption of the same motion is neither
    /// right nor wrong. `distance` is that of a query to a candidate; infinite or no number counts against the query.
    pub fn new(
        (query, among): (&'static str, &'static str),
        evaluator: &str,
        num: usize,
        is_wrong: impl Fn(usize, usize) -> bool,
        distance: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let rank = |query: usize| {
            let right = distance(query, query);
            let wrong = (0..num).filter(|&other| other != query && is_wrong(query, other));
            wrong.fold(Rank { ahead: 0, wrong: 0 }, |rank, other| {
                // Neither is behind when one of the two is no number.
                let is_behind = distance(query, other) > right;
                Rank { ahead: rank.ahead + usize::from(!is_behind), wrong: rank.wrong + 1 }
            })
        };
        Self {
            query,
            among,
            evaluator: evaluator.to_owned(),
            ranks: (0..num).map(rank).collect(),
            clusters: Clusters::singles(num),
        }
    }

    /// The same, its queries drawn together as `clusters` says.
    ///
    /// # Panics
    /// If these are groups of another number of queries.
    #[must_use]
    pub fn clustered(self, clusters: &Clusters) -> Self {
        assert_eq!(clusters.num_segments(), self.ranks.len(), "groups of the queries");
        Self { clusters: clusters.clone(), ..self }
    }

    /// Candidates of a pool: [`POOL`], or all where one query has fewer.
    #[must_use]
    pub fn pool(&self) -> usize {
        self.ranks.iter().map(|rank| rank.wrong + 1).min().unwrap_or(0).min(POOL)
    }

    /// R-precision at 1 to 3 in pools and recall at 1, 5 and 10 among all candidates; 0 to 1, higher is better.
    #[must_use]
    pub fn measure(&self) -> Vec<Measurement> {
        const PRECISION: [(&str, usize); 3] =
            [("r-precision-1", 1), ("r-precision-2", 2), ("r-precision-3", 3)];
        const RECALL: [(&str, usize); 3] = [("recall-1", 1), ("recall-5", 5), ("recall-10", 10)];
        let pool = self.pool();
        let in_pool = |&(key, top): &(&'static str, usize)| {
            let values = self.ranks.iter().map(|rank| rank.chance_in_pool(top, pool.saturating_sub(1)));
            let signature = self.signature(key).with("pool", pool).with("pools", "all").with("v", 1);
            Measurement::of_values(key, signature, values.collect()).clustered(&self.clusters)
        };
        let among_all = |&(key, top): &(&'static str, usize)| {
            let values = self.ranks.iter().map(|rank| f64::from(u8::from(rank.ahead < top)));
            let signature = self.signature(key).with("candidates", self.num_candidates()).with("v", 1);
            Measurement::of_values(key, signature, values.collect()).clustered(&self.clusters)
        };
        PRECISION.iter().map(in_pool).chain(RECALL.iter().map(among_all)).collect()
    }

    /// Candidates a query has, the right one included: a number, or the least and the most.
    fn num_candidates(&self) -> String {
        let all = || self.ranks.iter().map(|rank| rank.wrong + 1);
        let (least, most) = (all().min().unwrap_or(0), all().max().unwrap_or(0));
        if least == most { most.to_string() } else { format!("{least}-{most}") }
    }

    fn signature(&self, key: &str) -> Signature {
        Signature::new(key)
            .with("query", self.query)
            .with("among", self.among)
            .with("ties", "against")
            .with("evaluator", &self.evaluator)
    }

    /// What guessing would reach at [`Retrieval::measure`]'s `r-precision-top`.
    #[must_use]
    pub fn chance_level(&self, top: usize) -> f64 {
        (top as f64 / self.pool().max(1) as f64).min(1.0)
    }

    /// Median over queries of the rank among all candidates, 1 where the right one is nearest, with its 95 % interval.
    #[must_use]
    pub fn median_rank(&self, resampling: Resampling) -> (f64, Option<Interval>) {
        let median = |chosen: &[usize]| {
            let mut ranks: Vec<usize> = chosen.iter().map(|&query| self.ranks[query].ahead + 1).collect();
            ranks.sort_unstable();
            let middle = ranks.len() / 2;
            match ranks.len() {
                0 => f64::NAN,
                num if num % 2 == 1 => ranks[middle] as f64,
                _ => f64::midpoint(ranks[middle - 1] as f64, ranks[middle] as f64),
            }
        };
        let all: Vec<usize> = (0..self.ranks.len()).collect();
        (median(&all), resampling.interval_of(&self.clusters, median))
    }
}

/// Distance of every motion from its caption in the space both share (MM-Dist); lower is better.
///
/// # Panics
/// If the numbers or lengths of the vectors differ.
#[must_use]
pub fn pair_distance(captions: &Embeddings, motions: &Embeddings, evaluator: &str) -> Measurement {
    assert_eq!(captions.len(), motions.len(), "a motion for each caption");
    let values = (0..captions.len()).map(|place| captions.distance(place, motions, place)).collect();
    let signature = Signature::new("mm-dist").with("evaluator", evaluator).with("v", 1);
    Measurement::of_values("mm-dist", signature, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::SplitMix64;

    /// Queries on a line whose right candidate stands `shift` places further, around a ring.
    fn permuted(num: usize, shift: usize) -> Retrieval {
        let apart = move |query: usize, candidate: usize| ((candidate + shift + num - query) % num) as f64;
        Retrieval::new(("caption", "motion"), "e", num, |_, _| true, apart)
    }

    fn value(retrieval: &Retrieval, key: &str) -> f64 {
        retrieval.measure().into_iter().find(|found| found.key == key).unwrap().score()
    }

    #[test]
    fn a_permutation_has_the_rank_it_shifts_by() {
        let right = permuted(64, 0);
        assert_eq!((value(&right, "r-precision-1"), value(&right, "recall-1")), (1.0, 1.0));
        assert_eq!(right.median_rank(Resampling::default()).0, 1.0);
        let shifted = permuted(64, 4);
        assert_eq!((value(&shifted, "recall-1"), value(&shifted, "recall-5")), (0.0, 1.0));
        assert_eq!(shifted.median_rank(Resampling::default()).0, 5.0);
        // Four of 63 are ahead, and a pool has 31 of the 63: none of the four with C(59, 31) / C(63, 31).
        let none: f64 = (0..4).map(|index| f64::from(32 - index) / f64::from(63 - index)).product();
        assert!((value(&shifted, "r-precision-1") - none).abs() < 1e-12);
    }

    #[test]
    fn guessing_reaches_the_chance_level() {
        let mut random = SplitMix64(7);
        let distances: Vec<f64> = (0..400 * 400).map(|_| random.share()).collect();
        let guess = Retrieval::new(
            ("caption", "motion"),
            "e",
            400,
            |_, _| true,
            |query, candidate| distances[query * 400 + candidate],
        );
        for (top, key) in [(1, "r-precision-1"), (3, "r-precision-3")] {
            let level = guess.chance_level(top);
            assert!((value(&guess, key) - level).abs() < 0.02, "{key} {}", value(&guess, key));
        }
        assert!((guess.chance_level(3) - 3.0 / 32.0).abs() < 1e-12);
    }

    #[test]
    fn the_mean_over_all_pools_is_what_drawn_pools_approach() {
        let rank = Rank { ahead: 9, wrong: 80 };
        let mut random = SplitMix64(3);
        let draws = 20_000;
        let hits = (0..draws)
            .filter(|_| {
                let mut urn: Vec<usize> = (0..80).collect();
                let ahead = (0..31).filter(|_| urn.swap_remove(random.below(urn.len())) < 9).count();
                ahead < 3
            })
            .count();
        assert!((rank.chance_in_pool(3, 31) - hits as f64 / f64::from(draws)).abs() < 0.01);
    }

    #[test]
    fn a_collapsed_space_finds_nothing() {
        let collapsed = Retrieval::new(("caption", "motion"), "e", 40, |_, _| true, |_, _| 1.0);
        assert_eq!(value(&collapsed, "r-precision-3"), 0.0);
        let broken = Retrieval::new(("caption", "motion"), "e", 40, |_, _| true, |_, _| f64::NAN);
        assert_eq!(value(&broken, "r-precision-3"), 0.0);
    }

    #[test]
    fn candidates_of_the_same_motion_are_not_wrong() {
        // Two captions of each motion, at the same place.
        let place = |index: usize| (index / 2) as f64;
        let pairs = Retrieval::new(
            ("caption", "motion"),
            "e",
            10,
            |query, other| query / 2 != other / 2,
            |query, other| (place(query) - place(other)).abs(),
        );
        assert_eq!(value(&pairs, "recall-1"), 1.0);
        assert_eq!(pairs.pool(), 9);
        // Ten queries, but each among nine.
        assert!(pairs.measure()[3].signature.as_str().contains("|candidates:9|"));
        assert!(pairs.measure()[0].signature.as_str().contains("|pool:9|"));
    }
}
