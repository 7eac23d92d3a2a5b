//! Losses, Eqs. 1 to 5.

use burn::tensor::{Bool, Int, Tensor, activation};
use serde::{Deserialize, Serialize};

use super::settings::InvalidSetting;

/// How losses of parts are put together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reduction {
    /// Mean over frames, words and pairs.
    ///
    /// `Deviation:` the equations are sums; with 80 pairs a batch the hinge of Eq. 3 has 6320 terms and drowns the rest.
    Mean,
    /// Sums over everything in the batch, as printed.
    Sum,
}

/// The second term of Eq. 3, which keeps apart what does not belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Binding {
    /// A hinge over the descriptions of other actions, as printed.
    OneSided,
    /// The same, and a hinge over the actions of other descriptions (Yamada et al. 2018).
    TwoSided,
    /// Cross entropy of finding the partner among the batch, in both directions, with minus the distance over
    /// [`LossSettings::temperature`] as logits (after van den Oord et al. 2018).
    InfoNce,
}

/// What the losses are made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossSettings {
    /// How parts are put together.
    pub reduction: Reduction,
    /// What keeps apart pairs that do not belong together.
    pub binding: Binding,
    /// Delta of Eq. 3: how much farther than its partner every other latent has to be.
    pub margin: f64,
    /// Distance that counts as one nat, for [`Binding::InfoNce`].
    pub temperature: f64,
    /// Whether two captions of one motion, met in one batch, are pushed apart like any others (the paper says nothing).
    pub same_motion_negatives: bool,
}

impl Default for LossSettings {
    fn default() -> Self {
        Self {
            reduction: Reduction::Mean,
            binding: Binding::OneSided,
            margin: 1.0,
            temperature: 1.0,
            same_motion_negatives: true,
        }
    }
}

impl LossSettings {
    /// Checks every setting.
    ///
    /// # Errors
    /// [`InvalidSetting`] names the first one outside its range.
    pub fn check(&self) -> Result<(), InvalidSetting> {
        let (margin, temperature) = (self.margin, self.temperature);
        InvalidSetting::unless((0.0..=1e6).contains(&margin), "loss.margin", margin, || {
            "0 to 1000000".to_owned()
        })?;
        InvalidSetting::unless((1e-6..=1e6).contains(&temperature), "loss.temperature", temperature, || {
            "0.000001 to 1000000".to_owned()
        })
    }
}

/// Eq. 1 over frames `[frame, channel]`: squared distance between what came and what should have, a frame.
#[must_use]
pub fn action_loss(predicted: Tensor<2>, target: Tensor<2>, reduction: Reduction) -> Tensor<1> {
    let num_frames = target.dims()[0];
    reduced((predicted - target).square().sum(), num_frames, reduction)
}

/// Eq. 2 over words: cross entropy of logits `[word, vocab]` with the words that should have come, in nats a word.
#[must_use]
pub fn description_loss(logits: Tensor<2>, target: Tensor<1, Int>, reduction: Reduction) -> Tensor<1> {
    let num_words = logits.dims()[0];
    let log_probability = activation::log_softmax(logits, 1).gather(1, target.unsqueeze_dim(1));
    reduced(log_probability.sum().neg(), num_words, reduction)
}

/// Eq. 3 over the latents of a batch of pairs, both `[batch, latent]`.
///
/// `motions` says which motion each pair is about. With the mean, the first term is a mean over pairs and the second
/// one over pairs of pairs; a batch of one pair has only the first.
#[must_use]
pub fn binding_loss(
    action: Tensor<2>,
    description: Tensor<2>,
    motions: &[usize],
    settings: &LossSettings,
) -> Tensor<1> {
    let device = action.device();
    let [batch, latent] = action.dims();
    // Entry (i, j): action i and description j. The floor keeps the slope finite where two latents coincide.
    let offsets = action.reshape([batch, 1, latent]) - description.reshape([1, batch, latent]);
    let distances: Tensor<2> = offsets.square().sum_dim(2).squeeze_dim::<2>(2).clamp_min(1e-12).sqrt();
    let is_partner: Tensor<2, Bool> = Tensor::<2, Int>::eye(batch, &device).equal_elem(1);
    let partner = distances.clone().mask_fill(is_partner.clone().bool_not(), 0.0).sum_dim(1);
    let pull = reduced(partner.clone().sum(), batch, settings.reduction);

    let excused = if settings.same_motion_negatives { is_partner } else { same_motion(motions, &device) };
    let num_negatives = batch * batch - excused.clone().int().sum().into_scalar::<i64>() as usize;
    if num_negatives == 0 {
        return pull;
    }
    let hinge = |anchor: Tensor<2>| {
        let excess = (anchor - distances.clone()).add_scalar(settings.margin).clamp_min(0.0);
        reduced(excess.mask_fill(excused.clone(), 0.0).sum(), num_negatives, settings.reduction)
    };
    let push = match settings.binding {
        Binding::OneSided => hinge(partner),
        Binding::TwoSided => hinge(partner.clone()) + hinge(partner.transpose()),
        Binding::InfoNce => {
            let own: Tensor<2, Bool> = Tensor::<2, Int>::eye(batch, &device).equal_elem(1);
            let rival = excused.bool_and(own.clone().bool_not());
            let logits = distances.div_scalar(-settings.temperature).mask_fill(rival, -1e30);
            let found =
                |dim| activation::log_softmax(logits.clone(), dim).mask_fill(own.clone().bool_not(), 0.0);
            reduced((found(1) + found(0)).sum().neg(), batch, settings.reduction)
        }
    };
    pull + push
}

/// Pairs of pairs about the same motion, `[batch, batch]`.
fn same_motion(motions: &[usize], device: &burn::tensor::Device) -> Tensor<2, Bool> {
    let same =
        motions.iter().flat_map(|a| motions.iter().map(move |b| i32::from(a == b))).collect::<Vec<_>>();
    let data = burn::tensor::TensorData::new(same, [motions.len(), motions.len()]);
    Tensor::<2, Int>::from_data(data, device).equal_elem(1)
}

fn reduced(sum: Tensor<1>, count: usize, reduction: Reduction) -> Tensor<1> {
    match reduction {
        Reduction::Mean => sum.div_scalar(count as f64),
        Reduction::Sum => sum,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    fn close(loss: Tensor<1>, expected: f64) {
        let found: f64 = loss.into_scalar();
        assert!((found - expected).abs() < 1e-5, "{found} is not {expected}");
    }

    #[test]
    fn action_loss_by_hand() {
        let device = Device::flex();
        let predicted = Tensor::<2>::from_floats([[1.0, 2.0], [0.5, 0.0]], &device);
        let target = Tensor::<2>::from_floats([[0.0, 0.0], [0.0, 1.0]], &device);
        // Frames of 1 + 4 and of 0.25 + 1.
        close(action_loss(predicted.clone(), target.clone(), Reduction::Sum), 6.25);
        close(action_loss(predicted, target, Reduction::Mean), 3.125);
    }

    #[test]
    fn description_loss_by_hand() {
        let device = Device::flex();
        let ln = |p: f32| p.ln();
        let logits = Tensor::<2>::from_floats([[ln(0.5), ln(0.25), ln(0.25)], [0.0, 0.0, 0.0]], &device);
        let target = Tensor::<1, Int>::from_ints([1, 2], &device);
        // -ln(1/4) and -ln(1/3).
        let sum = 4.0_f64.ln() + 3.0_f64.ln();
        close(description_loss(logits.clone(), target.clone(), Reduction::Sum), sum);
        close(description_loss(logits, target, Reduction::Mean), sum / 2.0);
    }

    /// Three pairs on a line: actions at 0, 3, 10, descriptions at 0.5, 3, 4.
    ///
    /// Distances, action by row: 0.5 3 4; 2.5 0 1; 9.5 7 6. Partners: 0.5, 0, 6, together 6.5.
    fn pairs() -> (Tensor<2>, Tensor<2>) {
        let device = Device::flex();
        (
            Tensor::from_floats([[0.0], [3.0], [10.0]], &device),
            Tensor::from_floats([[0.5], [3.0], [4.0]], &device),
        )
    }

    fn bound(binding: Binding, reduction: Reduction, same_motion_negatives: bool) -> Tensor<1> {
        let (action, description) = pairs();
        let settings =
            LossSettings { binding, reduction, margin: 1.5, temperature: 2.0, same_motion_negatives };
        binding_loss(action, description, &[7, 7, 8], &settings)
    }

    #[test]
    fn one_sided_binding_by_hand() {
        // By action: 0 and 0; 0 and 0.5; 0 and 0.5.
        close(bound(Binding::OneSided, Reduction::Sum, true), 6.5 + 1.0);
        close(bound(Binding::OneSided, Reduction::Mean, true), 6.5 / 3.0 + 1.0 / 6.0);
        // The first two pairs are about one motion: four pairs of pairs remain, with the same excess.
        close(bound(Binding::OneSided, Reduction::Mean, false), 6.5 / 3.0 + 1.0 / 4.0);
    }

    #[test]
    fn two_sided_binding_by_hand() {
        // By description: against 2.5 and 9.5, nothing; against 3 and 7, nothing; 1.5 + 6 - 4 = 3.5 and 1.5 + 6 - 1 = 6.5.
        close(bound(Binding::TwoSided, Reduction::Sum, true), 6.5 + 1.0 + 10.0);
        close(bound(Binding::TwoSided, Reduction::Mean, true), 6.5 / 3.0 + 11.0 / 6.0);
    }

    #[test]
    fn info_nce_by_hand() {
        let d = [[0.5_f64, 3.0, 4.0], [2.5, 0.0, 1.0], [9.5, 7.0, 6.0]];
        let weight = |i: usize, j: usize| (-d[i][j] / 2.0).exp();
        let sum: f64 = (0..3)
            .map(|i| {
                let row: f64 = (0..3).map(|j| weight(i, j)).sum();
                let column: f64 = (0..3).map(|j| weight(j, i)).sum();
                -(weight(i, i) / row).ln() - (weight(i, i) / column).ln()
            })
            .sum();
        close(bound(Binding::InfoNce, Reduction::Sum, true), 6.5 + sum);
        close(bound(Binding::InfoNce, Reduction::Mean, true), 6.5 / 3.0 + sum / 3.0);
        assert!(bound(Binding::InfoNce, Reduction::Mean, false).into_scalar::<f64>().is_finite());
    }

    #[test]
    fn coinciding_latents_have_finite_slopes() {
        let device = Device::flex().autodiff();
        let action = Tensor::<2>::zeros([3, 4], &device).require_grad();
        let description = Tensor::<2>::zeros([3, 4], &device).require_grad();
        let loss = binding_loss(action.clone(), description, &[0, 1, 2], &LossSettings::default());
        // Every distance is 0, every hinge at its margin.
        close(loss.clone().inner(), 1.0);
        let slope = action.grad(&loss.backward()).unwrap();
        assert!(slope.into_data().iter::<f32>().all(f32::is_finite));
    }

    #[test]
    fn a_single_pair_is_only_pulled() {
        let device = Device::flex();
        let action = Tensor::<2>::from_floats([[3.0, 0.0]], &device);
        let description = Tensor::<2>::from_floats([[0.0, 4.0]], &device);
        close(binding_loss(action, description, &[0], &LossSettings::default()), 5.0);
    }
}
