//! Algorithm 1: which stage an iteration is in, and which part learns.

use serde::{Deserialize, Serialize};

use super::settings::{Schedule, TrainingSettings};
use crate::features::{MirrorCount, PreparedSet};

/// A stage of the training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Reconstruction of captions and motions that have nothing to do with each other.
    One,
    /// Reconstruction and binding of pairs.
    Two,
}

/// The part that learns at an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// `theta_ret`.
    Retrofit,
    /// `theta_rae`.
    Rae,
    /// Both, where the settings ask for no alternation.
    Both,
}

/// Numbers of iterations, counted from 1 through both stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// Iterations of stage 1 (`N_1`).
    pub stage1: usize,
    /// Iterations of stage 2 (`N_2`).
    pub stage2: usize,
    /// Iterations until the other part learns (`n_ch`); 0: both always learn.
    pub alternate_every: usize,
}

/// Batches an epoch has: a last, smaller one counts.
pub(super) fn iterations_per_epoch(places: usize, batch_size: usize) -> usize {
    places.div_ceil(batch_size)
}

impl Plan {
    /// The plan of some settings for some data, a prepared set without mirror images.
    ///
    /// An epoch of stage 1 goes once through the larger of the two collections; the smaller one begins anew meanwhile.
    #[must_use]
    pub fn new(settings: &TrainingSettings, set: &PreparedSet) -> Self {
        let stage1 = Self::stage1_iterations(settings, Self::stage1_samples(set, settings.mirror));
        let images = if settings.mirror { MirrorCount::of(set).num_pairs } else { 0 };
        let stage2_epoch = iterations_per_epoch(set.paired.len() + images, settings.batch_size);
        let stage2 = settings.stage2_iterations.unwrap_or(settings.stage2_epochs * stage2_epoch);
        let (stage1, stage2) = match settings.schedule {
            Schedule::TwoStage => (stage1, stage2),
            Schedule::VanillaEqualEpochs => (0, stage2),
            Schedule::VanillaEqualUpdates => (0, stage1 + stage2),
        };
        Self { stage1, stage2, alternate_every: settings.alternate_every }
    }

    /// Samples that an epoch of stage 1 goes through: those of the larger of the two collections, with their mirror
    /// images where they have some.
    #[must_use]
    pub fn stage1_samples(set: &PreparedSet, mirror: bool) -> usize {
        let images = if mirror { MirrorCount::of(set) } else { MirrorCount::default() };
        let captions = set.non_paired_captions.len() + images.num_captions;
        captions.max(set.non_paired_motions.len() + images.num_motions)
    }

    /// Iterations of stage 1 where the larger of the two collections has so many samples.
    #[must_use]
    pub fn stage1_iterations(settings: &TrainingSettings, samples: usize) -> usize {
        let epoch = iterations_per_epoch(samples, settings.batch_size);
        settings.stage1_iterations.unwrap_or(settings.stage1_epochs * epoch)
    }

    /// Iterations of both stages.
    #[must_use]
    pub fn total(&self) -> usize {
        self.stage1 + self.stage2
    }

    /// Stage of an iteration.
    #[must_use]
    pub fn stage(&self, iteration: usize) -> Stage {
        if iteration <= self.stage1 { Stage::One } else { Stage::Two }
    }

    /// What learns: `int(i / n_ch) % 2`, with i counted on through stage 2.
    #[must_use]
    pub fn phase(&self, iteration: usize) -> Phase {
        match iteration.checked_div(self.alternate_every) {
            None => Phase::Both,
            Some(turn) if turn % 2 == 1 => Phase::Rae,
            Some(_) => Phase::Retrofit,
        }
    }

    /// How much of its stage is behind an iteration, 0 to 1.
    #[must_use]
    pub fn progress(&self, iteration: usize) -> f64 {
        let (done, of) = match self.stage(iteration) {
            Stage::One => (iteration, self.stage1),
            Stage::Two => (iteration - self.stage1, self.stage2),
        };
        done as f64 / of.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::tests::empty_set;

    fn paper(schedule: Schedule, pairs: usize) -> Plan {
        let mut set = empty_set();
        set.non_paired_motions = vec![0; 4368];
        set.non_paired_captions = vec![0; 4368];
        set.paired = vec![crate::features::Pair { motion: 0, caption: 0 }; pairs];
        Plan::new(&TrainingSettings { schedule, ..TrainingSettings::default() }, &set)
    }

    #[test]
    fn iterations_are_counted_as_in_the_paper() {
        assert_eq!((iterations_per_epoch(4368, 80), iterations_per_epoch(500, 80)), (55, 7));
        let plan = paper(Schedule::TwoStage, 500);
        assert_eq!((plan.stage1, plan.stage2), (11_000, 2_800));
        assert_eq!(paper(Schedule::TwoStage, 250).stage2, 1_600);
        assert_eq!(paper(Schedule::TwoStage, 100).stage2, 800);
        let plan = paper(Schedule::VanillaEqualEpochs, 500);
        assert_eq!((plan.stage1, plan.stage2), (0, 2_800));
        let plan = paper(Schedule::VanillaEqualUpdates, 500);
        assert_eq!((plan.stage1, plan.stage2), (0, 13_800));
    }

    #[test]
    fn mirror_images_make_epochs_longer() {
        let set = crate::training::tests::four_pairs();
        let plan = |mirror| {
            let settings = TrainingSettings { batch_size: 3, mirror, ..TrainingSettings::default() };
            Plan::new(&settings, &set)
        };
        assert_eq!((plan(false).stage1, plan(false).stage2), (200 * 2, 400 * 2));
        assert_eq!((plan(true).stage1, plan(true).stage2), (200 * 3, 400 * 3));
    }

    #[test]
    fn the_parts_alternate_as_in_algorithm_one() {
        let plan = paper(Schedule::TwoStage, 500);
        for iteration in 1..=plan.total() {
            let expected = if (iteration / 100) % 2 == 1 { Phase::Rae } else { Phase::Retrofit };
            assert_eq!(plan.phase(iteration), expected);
        }
        // The retrofit layer opens with one iteration less, and it opens stage 2 with one more: i + N_1 = 11001.
        assert_eq!((plan.phase(99), plan.phase(100)), (Phase::Retrofit, Phase::Rae));
        assert_eq!((plan.stage(11_000), plan.phase(11_000)), (Stage::One, Phase::Retrofit));
        assert_eq!((plan.stage(11_001), plan.phase(11_001)), (Stage::Two, Phase::Retrofit));
        assert_eq!(plan.phase(11_100), Phase::Rae);
        assert_eq!((plan.progress(5_500), plan.progress(11_000), plan.progress(12_400)), (0.5, 1.0, 0.5));
    }
}
