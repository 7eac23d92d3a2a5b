//! How the step size falls.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::plan::{Plan, Stage};

/// How the step size of Adam goes on through stage 2; in stage 1 it stays as it is set.
///
/// `Deviation:` the paper names no decay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decay {
    /// It stays, as in the paper.
    #[default]
    Constant,
    /// It falls to nothing along half a cosine (Loshchilov and Hutter 2017, without restarts). What is kept should be the
    /// last model then.
    Cosine,
}

impl Decay {
    /// What the step size is multiplied with at an iteration, counted from 1 through both stages: above 0, at most 1.
    pub(super) fn factor(self, plan: &Plan, iteration: usize) -> f64 {
        match (self, plan.stage(iteration)) {
            (Self::Constant, _) | (_, Stage::One) => 1.0,
            (Self::Cosine, Stage::Two) => {
                // Of the iterations before this one, so that the first has all of it and the last one something.
                let done = (iteration - plan.stage1 - 1) as f64 / plan.stage2.max(1) as f64;
                f64::midpoint(1.0, (PI * done).cos())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_falls_through_stage_two_alone() {
        let plan = Plan { stage1: 10, stage2: 4, alternate_every: 0 };
        let factors: Vec<f64> = (10..=14).map(|iteration| Decay::Cosine.factor(&plan, iteration)).collect();
        let root = 0.5_f64.sqrt();
        let expected = [1.0, 1.0, f64::midpoint(1.0, root), 0.5, f64::midpoint(1.0, -root)];
        for (found, expected) in factors.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{factors:?}");
        }
        assert!((1..=14).all(|iteration| Decay::Constant.factor(&plan, iteration) == 1.0));
    }
}
