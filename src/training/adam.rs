//! Adam, in one pass over all numbers where the processor can reach them.

use burn::optim::{AdamConfig, AdamState, AdaptiveMomentumState, LearningRate, Optimizer};
use burn::tensor::{DType, Device, Tensor};
use rayon::prelude::*;

/// Adam (Kingma and Ba 2015): every weight moves by the mean of its slopes over the root of the mean of their squares.
///
/// On the CPU, weights and memory change where they lie, on all threads; elsewhere burn's Adam runs. Both do the same
/// arithmetic, to the last bit, but burn's goes over all numbers a dozen times and writes new memory each time, on one thread.
#[derive(Clone)]
pub struct Adam {
    beta_1: f32,
    beta_2: f32,
    epsilon: f32,
    elsewhere: burn::optim::Adam,
}

/// Weights that one thread takes at a time.
const PORTION: usize = 1 << 14;

/// What does not depend on the weight.
struct Factors {
    /// Of the moments so far.
    kept: [f32; 2],
    /// Of the slope and its square.
    new: [f32; 2],
    /// Makes up for moments that began at zero.
    correction: f32,
    epsilon: f32,
    learning_rate: f32,
}

impl Factors {
    /// Moves some weights.
    fn apply(&self, weights: &mut [f32], slopes: &[f32], first: &mut [f32], second: &mut [f32]) {
        for (((weight, slope), first), second) in weights.iter_mut().zip(slopes).zip(first).zip(second) {
            *first = *first * self.kept[0] + slope * self.new[0];
            *second = *second * self.kept[1] + slope * slope * self.new[1];
            let direction = *first * self.correction / (second.sqrt() + self.epsilon);
            *weight -= direction * self.learning_rate;
        }
    }
}

impl Adam {
    /// Adam that forgets slopes by the factor `beta_1`, their squares by `beta_2`, and adds `epsilon` to the root.
    #[must_use]
    pub fn new(beta_1: f32, beta_2: f32, epsilon: f32) -> Self {
        let config = AdamConfig::new().with_beta_1(beta_1).with_beta_2(beta_2).with_epsilon(epsilon);
        Self { beta_1, beta_2, epsilon, elsewhere: config.build() }
    }

    /// What the update after `time - 1` others needs.
    fn factors(&self, time: usize, learning_rate: LearningRate) -> Factors {
        let time = i32::try_from(time).unwrap_or(i32::MAX);
        let root = (1.0 - self.beta_2.powi(time)).sqrt();
        Factors {
            kept: [self.beta_1, self.beta_2],
            new: [1.0 - self.beta_1, 1.0 - self.beta_2],
            correction: root / (1.0 - self.beta_1.powi(time)),
            epsilon: self.epsilon * root,
            learning_rate: learning_rate as f32,
        }
    }
}

impl Optimizer for Adam {
    type State<const D: usize> = AdamState<D>;

    fn step<const D: usize>(
        &self,
        learning_rate: LearningRate,
        weights: Tensor<D>,
        slopes: Tensor<D>,
        state: Option<AdamState<D>>,
    ) -> (Tensor<D>, Option<AdamState<D>>) {
        let device = weights.device();
        let is_plain = [weights.dtype(), slopes.dtype()] == [DType::F32; 2];
        if device != Device::flex() || !is_plain {
            return self.elsewhere.step(learning_rate, weights, slopes, state);
        }
        let (before, first, second) = match state {
            Some(AdamState { momentum }) => (momentum.time, momentum.moment_1, momentum.moment_2),
            None => (0, weights.zeros_like(), weights.zeros_like()),
        };
        let factors = self.factors(before + 1, learning_rate);
        let mut data = [weights, slopes, first, second].map(Tensor::into_data);
        let [weights, slopes, first, second] =
            data.each_mut().map(|data| data.as_mut_slice::<f32>().unwrap_or_default());
        weights
            .par_chunks_mut(PORTION)
            .zip(slopes.par_chunks(PORTION))
            .zip(first.par_chunks_mut(PORTION).zip(second.par_chunks_mut(PORTION)))
            .for_each(|((weights, slopes), (first, second))| factors.apply(weights, slopes, first, second));
        let [weights, _, first, second] = data.map(|data| Tensor::from_data(data, &device));
        (weights, Some(AdamState::new(AdaptiveMomentumState::new(before + 1, first, second))))
    }

    fn to_device<const D: usize>(state: AdamState<D>, device: &Device) -> AdamState<D> {
        <burn::optim::Adam as Optimizer>::to_device(state, device)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights, moments and slopes of all sizes, among them zero.
    fn numbers(count: usize, seed: u32) -> Vec<f32> {
        let value = |index: u32| {
            let bits = (index.wrapping_mul(2_654_435_761) ^ seed).wrapping_mul(0x9e37_79b9);
            let size = 10.0_f32.powi((bits % 17) as i32 - 12);
            if bits.is_multiple_of(13) { 0.0 } else { ((bits >> 8) as f32 / (1 << 23) as f32 - 1.0) * size }
        };
        (0..count as u32).map(value).collect()
    }

    #[test]
    fn every_update_is_burns_to_the_last_bit() {
        let device = Device::flex();
        let size = 2 * PORTION + 77;
        let tensor = |seed| Tensor::<1>::from_floats(&numbers(size, seed)[..], &device);
        let own = Adam::new(0.9, 0.999, 1e-8);
        let burns = own.elsewhere.clone();
        let (mut weights, mut state) = (tensor(1), None);
        let (mut expected, mut expected_state) = (tensor(1), None);
        for update in 0..4 {
            let rate = 1e-3 / f64::from(update + 1);
            (weights, state) = own.step(rate, weights, tensor(update + 2), state);
            (expected, expected_state) = burns.step(rate, expected, tensor(update + 2), expected_state);
            let bits = |tensor: &Tensor<1>| -> Vec<u32> {
                tensor.to_data().iter::<f32>().map(|number| (number + 0.0).to_bits()).collect()
            };
            assert_eq!(bits(&weights), bits(&expected), "weights after update {update}");
            let (own, burns) =
                (&state.as_ref().unwrap().momentum, &expected_state.as_ref().unwrap().momentum);
            assert_eq!(bits(&own.moment_1), bits(&burns.moment_1), "mean slopes after update {update}");
            assert_eq!(bits(&own.moment_2), bits(&burns.moment_2), "mean squares after update {update}");
            assert_eq!(own.time, burns.time);
        }
    }

    #[test]
    fn the_first_update_is_the_step_size() {
        // Both moments are corrected to the slope itself: the weight moves by the step size, whatever the slope.
        let device = Device::flex();
        let weights = Tensor::<2>::from_floats([[1.0, 1.0], [1.0, 1.0]], &device);
        let slopes = Tensor::<2>::from_floats([[3.0, -0.002], [700.0, 0.0]], &device);
        let (weights, _) = Adam::new(0.9, 0.999, 1e-12).step(0.25, weights, slopes, None);
        let expected = [0.75, 1.25, 0.75, 1.0];
        for (weight, expected) in weights.into_data().iter::<f32>().zip(expected) {
            assert!((weight - expected).abs() < 1e-6, "{weight} for {expected}");
        }
    }
}
