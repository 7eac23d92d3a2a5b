//! Which data an iteration sees.

use super::plan::iterations_per_epoch;
use crate::model::Draws;

/// Places of a collection in an order that is drawn anew for every epoch.
///
/// The order depends on the seed, the name and the epoch alone, so that a run can go on from any iteration.
pub(super) struct Sampler {
    seed: u64,
    name: &'static str,
    places: usize,
    batch_size: usize,
    epoch: Option<usize>,
    order: Vec<usize>,
}

impl Sampler {
    /// A sampler of `places` places, of which there is at least one.
    pub(super) fn new(seed: u64, name: &'static str, places: usize, batch_size: usize) -> Self {
        Self { seed, name, places, batch_size, epoch: None, order: Vec::new() }
    }

    /// Places of the batch of an iteration, counted from 0.
    pub(super) fn batch(&mut self, iteration: usize) -> &[usize] {
        let per_epoch = iterations_per_epoch(self.places, self.batch_size);
        let (epoch, batch) = (iteration / per_epoch, iteration % per_epoch);
        if self.epoch != Some(epoch) {
            self.order = (0..self.places).collect();
            Draws::new(self.seed, self.name, epoch as u64).shuffle(&mut self.order);
            self.epoch = Some(epoch);
        }
        let start = batch * self.batch_size;
        &self.order[start..self.places.min(start + self.batch_size)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_sees_everything_once_and_its_last_batch_is_smaller() {
        let mut sampler = Sampler::new(3, "pairs", 10, 4);
        let mut epochs = Vec::new();
        for epoch in 0..3 {
            let batches: Vec<Vec<usize>> = (0..3).map(|b| sampler.batch(3 * epoch + b).to_vec()).collect();
            assert_eq!(batches.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4, 2]);
            let mut seen = batches.concat();
            epochs.push(seen.clone());
            seen.sort_unstable();
            assert_eq!(seen, (0..10).collect::<Vec<_>>());
        }
        assert_ne!(epochs[0], epochs[1]);
        // From the middle, without what came before.
        assert_eq!(Sampler::new(3, "pairs", 10, 4).batch(7), &epochs[2][4..8]);
    }
}
