//! Level 0, world space: how far and how smoothly the body moves.

use nalgebra::Vector3;

use super::metric::{Better, Metric, Score};
use super::trace::{Trace, mean};
use crate::humanoid::NUM_SEGMENTS;
use crate::simulation::Level;

/// Largest speed of the root.
pub(super) static ROOT_SPEED_PEAK: Metric = Metric {
    key: "l0/root_speed_peak",
    title: "root speed peak",
    unit: "m/s",
    level: Level::L0,
    better: Better::Lower,
    formula: "max over frame pairs of |p_root(t+1) - p_root(t)| * rate; a teleport shows as an impossible speed",
    empty: "absent for a single frame",
    reference: "this project",
    signature: "diff:backward|filter:none|v:1",
};

/// Largest turning speed of the root.
pub(super) static ROOT_TURN_PEAK: Metric = Metric {
    key: "l0/root_turn_peak",
    title: "root turn peak",
    unit: "rad/s",
    level: Level::L0,
    better: Better::Lower,
    formula: "max over frame pairs of the angle of R_root(t)^-1 R_root(t+1), at most pi, * rate",
    empty: "absent for a single frame",
    reference: "this project",
    signature: "diff:geodesic|filter:none|v:1",
};

/// How much the body moves at all.
pub(super) static DYNAMIC_DEGREE: Metric = Metric {
    key: "l0/dynamic_degree",
    title: "dynamic degree",
    unit: "m/s",
    level: Level::L0,
    better: Better::Higher,
    formula: "rate * (mean |dp| + mean |d(p - p_root)|), means over frame pairs and the 21 joint centres; \
              zero for a statue, so that standing still cannot win unnoticed",
    empty: "absent for a single frame",
    reference: "MBench (MotrixLab/ViMoGen: mbench/motion_quality.py), there per frame, here per second",
    signature: "points:21-segment-origins|per:second|parts:world+root-relative|v:1",
};

/// Mean jerk of the joint centres.
pub(super) static JERK: Metric = Metric {
    key: "l0/jerk",
    title: "jerk",
    unit: "m/s^3",
    level: Level::L0,
    better: Better::Lower,
    formula: "mean over frames and the 21 joint centres of |p(t+3) - 3 p(t+2) + 3 p(t+1) - p(t)| * rate^3; \
              noise grows with the cube of the rate: compare at equal rates only",
    empty: "absent below four frames",
    reference: "Flash and Hogan 1985 (jerk as a measure of smoothness)",
    signature: "points:21-segment-origins|frame:world|diff:third|filter:none|v:1",
};

/// Scores of a body's way through the world.
pub(super) fn scores(trace: &Trace) -> Vec<Score> {
    let rate_hz = trace.rate_hz;
    let mut scores = Vec::new();
    if trace.num_frames() > 1 {
        let steps = trace.centers_m.windows(2);
        let fastest = steps.clone().map(|pair| (pair[1][0] - pair[0][0]).norm()).fold(0.0, f64::max);
        scores.extend(Score::new(&ROOT_SPEED_PEAK, fastest * rate_hz));
        let turns = trace.world_from_root.windows(2).map(|pair| pair[0].angle_to(&pair[1]));
        scores.extend(Score::new(&ROOT_TURN_PEAK, turns.fold(0.0, f64::max) * rate_hz));
        let moved = mean(steps.map(|pair| mean_step_m(&pair[0], &pair[1])));
        scores.extend(moved.and_then(|moved| Score::new(&DYNAMIC_DEGREE, moved * rate_hz)));
    }
    let jerk = mean(trace.centers_m.windows(4).map(mean_third_difference_m));
    scores.extend(jerk.and_then(|jerk| Score::new(&JERK, jerk * rate_hz.powi(3))));
    scores
}

/// Mean over segments of the step in the world plus that relative to the root.
fn mean_step_m(before: &[Vector3<f64>; NUM_SEGMENTS], after: &[Vector3<f64>; NUM_SEGMENTS]) -> f64 {
    let root_step = after[0] - before[0];
    let total: f64 = before
        .iter()
        .zip(after)
        .map(|(before, after)| (after - before).norm() + (after - before - root_step).norm())
        .sum();
    total / NUM_SEGMENTS as f64
}

/// Mean over segments of the third difference of four frames.
fn mean_third_difference_m(window: &[[Vector3<f64>; NUM_SEGMENTS]]) -> f64 {
    let step = |frame: usize, segment: usize| window[frame + 1][segment] - window[frame][segment];
    // Differences of differences: exactly zero for a body at rest, where 3 p would be rounded.
    let second = |frame, segment| step(frame + 1, segment) - step(frame, segment);
    let third = |segment| second(1, segment) - second(0, segment);
    (0..NUM_SEGMENTS).map(|segment| third(segment).norm()).sum::<f64>() / NUM_SEGMENTS as f64
}
