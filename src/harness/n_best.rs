//! The most plausible of several motions of one sentence.

use std::collections::BTreeMap;

use super::language_metrics::{N_BEST_DYNAMIC, N_BEST_RESIDUAL, N_BEST_SKATE};
use crate::humanoid::Humanoid;
use crate::motion::Motion;
use crate::plausibility::{Better, Metric, Score, find_metric, inverse_scores, kinematic_scores};
use crate::report::Candidate;
use crate::simulation::{Level, Simulation, SimulationSettings};

/// Scores that candidates are ranked by, all of levels that need no rollout; smaller is better in each.
const JUDGED: [&str; 5] =
    ["l0/skate", "l0/float", "l0/penetration", "l1/residual_force_gated", "l1/torque_limit_share"];
/// Tells what the choice costs; standing still is the most plausible motion of all.
const DYNAMIC: &str = "l0/dynamic_degree";

/// Judges motions of the same sentence and keeps one: the kept one, and all that could be judged with their scores.
///
/// The rule, in the order it decides:
///
/// 1. for each score a candidate gets the share of the others that are better ([`badness`]), and the smallest mean is kept: ranks
///    have no unit, so millimetres and newtons need no weights, and one score that is far off does not outvote the others;
/// 2. among equal means, which are common with few candidates, the one whose scores are the smaller parts of the largest of all
///    candidates ([`relative_size`]): what is clearly worse by its values is not kept;
/// 3. then the first, which is what the sentence says without noise.
///
/// A motion that cannot be judged is left out with its reason, but the first, which is what the sentence says, must be.
///
/// # Errors
/// What stands in the way of scoring the first, as one line.
pub(super) fn choose(
    motions: Vec<Motion>,
    settings: &SimulationSettings,
    left_out: &mut Vec<String>,
) -> Result<(Motion, Vec<Candidate>), String> {
    choose_by(motions, left_out, |motion| judge(motion, settings))
}

fn choose_by(
    motions: Vec<Motion>,
    left_out: &mut Vec<String>,
    judge: impl Fn(&Motion) -> Result<BTreeMap<String, f64>, String>,
) -> Result<(Motion, Vec<Candidate>), String> {
    let mut judged = Vec::new();
    let mut scores: Vec<BTreeMap<String, f64>> = Vec::new();
    for motion in motions {
        match judge(&motion) {
            Ok(found) => {
                judged.push(motion);
                scores.push(found);
            }
            Err(reason) if judged.is_empty() => return Err(reason),
            Err(reason) => left_out.push(reason),
        }
    }
    if judged.is_empty() {
        return Err("choose among motions: there is none".to_owned());
    }
    let badness: Vec<f64> = (0..scores.len()).map(|place| badness(&scores, place)).collect();
    let by_rule = |&a: &usize, &b: &usize| {
        let sizes = || relative_size(&scores, a).total_cmp(&relative_size(&scores, b));
        badness[a].total_cmp(&badness[b]).then_with(sizes)
    };
    let kept = (0..scores.len()).min_by(by_rule).unwrap_or(0);
    let candidates = scores
        .into_iter()
        .zip(badness)
        .enumerate()
        .map(|(place, (scores, badness))| Candidate { badness, kept: place == kept, scores });
    let candidates = candidates.collect();
    Ok((judged.swap_remove(kept), candidates))
}

fn judge(motion: &Motion, settings: &SimulationSettings) -> Result<BTreeMap<String, f64>, String> {
    let humanoid = Humanoid::new(motion.body()).map_err(|error| format!("build the body: {error}"))?;
    let simulation = Simulation::new(&humanoid, motion, settings)
        .map_err(|error| format!("judge a candidate: {error}"))?;
    let mut all = kinematic_scores(&humanoid, motion);
    all.extend(inverse_scores(&humanoid, simulation.reference_motion()));
    let wanted = |key: &str| JUDGED.contains(&key) || key == DYNAMIC;
    Ok(all
        .into_iter()
        .filter(|score| wanted(score.metric.key))
        .map(|score| (score.metric.key.to_owned(), score.value))
        .collect())
}

/// Mean over the scores of the share of the others that are better; a score that is not there is as bad as can be.
fn badness(scores: &[BTreeMap<String, f64>], place: usize) -> f64 {
    let others = scores.len().saturating_sub(1).max(1) as f64;
    let share = |key: &str| {
        let value = |scores: &BTreeMap<String, f64>| scores.get(key).copied().unwrap_or(f64::INFINITY);
        let ours = value(&scores[place]);
        scores.iter().filter(|other| value(other) < ours).count() as f64 / others
    };
    JUDGED.iter().map(|key| share(key)).sum::<f64>() / JUDGED.len() as f64
}

/// Mean over the scores of the share of the largest value of all candidates, 0 to 1; a score that is not there counts as that.
fn relative_size(scores: &[BTreeMap<String, f64>], place: usize) -> f64 {
    let share = |key: &str| {
        let largest = scores.iter().filter_map(|scores| scores.get(key)).copied().fold(0.0, f64::max);
        match scores[place].get(key) {
            None => 1.0,
            Some(_) if largest == 0.0 => 0.0,
            Some(value) => value / largest,
        }
    };
    JUDGED.iter().map(|key| share(key)).sum::<f64>() / JUDGED.len() as f64
}

/// What choosing gained at a level; nothing where there was no choice.
pub(super) fn gains(candidates: &[Candidate], level: Level) -> Vec<Score> {
    let Some(kept) = candidates.iter().find(|candidate| candidate.kept) else { return Vec::new() };
    let gains: [(&'static Metric, &str); 3] = [
        (&N_BEST_DYNAMIC, DYNAMIC),
        (&N_BEST_SKATE, "l0/skate"),
        (&N_BEST_RESIDUAL, "l1/residual_force_gated"),
    ];
    gains
        .into_iter()
        .filter(|(metric, _)| metric.level == level)
        .filter_map(|(metric, key)| {
            // The first is the one without noise, which would have been made without a choice.
            let saved = candidates.first()?.scores.get(key)? - kept.scores.get(key)?;
            let is_higher_better = find_metric(key)?.better == Better::Higher;
            Score::new(metric, if is_higher_better { -saved } else { saved })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(skate: f64, residual: f64, dynamic: f64, kept: bool) -> Candidate {
        let scores = [("l0/skate", skate), ("l1/residual_force_gated", residual), (DYNAMIC, dynamic)];
        let scores = scores.map(|(key, value)| (key.to_owned(), value)).into();
        Candidate { badness: 0.0, kept, scores }
    }

    #[test]
    fn gains_are_told_in_the_units_of_the_scores_and_so_is_their_price() {
        let candidates = [
            candidate(10.0, 5.0, 2.0, false),
            candidate(4.0, 3.0, 1.0, true),
            candidate(7.0, 1.0, 3.0, false),
        ];
        let of = |level| -> Vec<(&str, f64)> {
            gains(&candidates, level).iter().map(|score| (score.metric.key, score.value)).collect()
        };
        assert_eq!(of(Level::L0), [("l0/n_best_dynamic_gain", -1.0), ("l0/n_best_skate_gain", 6.0)]);
        assert_eq!(of(Level::L1), [("l1/n_best_residual_gain", 2.0)]);
        assert!(gains(&[], Level::L0).is_empty());
    }

    #[test]
    fn every_judged_score_is_one_where_smaller_is_better() {
        for key in JUDGED {
            assert_eq!(find_metric(key).unwrap().better, Better::Lower, "{key}");
        }
        assert_eq!(find_metric(DYNAMIC).unwrap().better, Better::Higher);
    }

    #[test]
    fn a_candidate_that_cannot_be_judged_is_left_out_alone() {
        use crate::motion::{Body, Frame};
        let motion =
            |frames| Motion::new(Body::with_default_mass(1.75), 100.0, vec![Frame::ZERO; frames]).unwrap();
        // Longer ones skate less; one frame cannot be judged.
        let judge = |motion: &Motion| match motion.num_frames() {
            1 => Err("judge a single frame".to_owned()),
            frames => Ok(BTreeMap::from([("l0/skate".to_owned(), 1.0 / frames as f64)])),
        };
        let mut left_out = Vec::new();
        let all = vec![motion(2), motion(1), motion(4), motion(3)];
        let (kept, candidates) = choose_by(all, &mut left_out, judge).unwrap();
        assert_eq!((kept.num_frames(), candidates.len()), (4, 3));
        assert!(candidates[1].kept && left_out == ["judge a single frame"], "{left_out:?}");
        let refused = choose_by(vec![motion(1), motion(2)], &mut left_out, judge).unwrap_err();
        assert_eq!(refused, "judge a single frame", "without the first there is nothing to gain on");
    }

    #[test]
    fn of_two_that_win_as_often_the_one_that_is_clearly_better_is_kept() {
        use crate::motion::{Body, Frame};
        // Skate of the first is a hair smaller, its unexplained force many times that of the second; the others are equal.
        let of = |frames: usize| match frames {
            1 => [("l0/skate", 10.0), ("l1/residual_force_gated", 80.0)],
            _ => [("l0/skate", 10.1), ("l1/residual_force_gated", 2.0)],
        };
        let judge =
            |motion: &Motion| Ok(of(motion.num_frames()).map(|(key, value)| (key.to_owned(), value)).into());
        let motion =
            |frames| Motion::new(Body::with_default_mass(1.75), 100.0, vec![Frame::ZERO; frames]).unwrap();
        for (order, kept) in [([1, 2], 1), ([2, 1], 0)] {
            let (found, candidates) = choose_by(order.map(motion).into(), &mut Vec::new(), judge).unwrap();
            assert_eq!(candidates[0].badness, candidates[1].badness);
            assert!(candidates[kept].kept && found.num_frames() == 2);
        }
        // What is equal in everything is what the sentence says.
        let (_, candidates) = choose_by(vec![motion(2), motion(2)], &mut Vec::new(), judge).unwrap();
        assert!(candidates[0].kept);
    }

    #[test]
    fn the_candidate_with_the_best_ranks_is_kept() {
        let scores = |values: [f64; 5]| -> BTreeMap<String, f64> {
            JUDGED.iter().zip(values).map(|(key, value)| ((*key).to_owned(), value)).collect()
        };
        let all = [
            scores([1.0, 9.0, 9.0, 9.0, 0.0]),
            scores([2.0, 1.0, 1.0, 1.0, 0.0]),
            scores([3.0, 2.0, 2.0, 2.0, 0.0]),
        ];
        let found: Vec<f64> = (0..3).map(|place| badness(&all, place)).collect();
        // Of two others, by five scores: equal ones count for neither.
        assert_eq!(found, [(0.0 + 1.0 + 1.0 + 1.0) / 5.0, 0.5 / 5.0, (1.0 + 0.5 + 0.5 + 0.5) / 5.0]);
    }
}
