//! Level 0, height over the floor z = 0: penetration, float and the lowest point.

use super::metric::{Better, Metric, Score};
use super::trace::{Trace, mean, median};
use crate::simulation::Level;

/// Depth or height that counts as touching, metres; `PhysDiff` allows it for the geometry's inexactness.
const TOLERANCE_M: f64 = 0.005;
const MM_PER_M: f64 = 1000.0;

const PHYSDIFF: &str = "PhysDiff (Yuan et al. 2023, arXiv 2212.02500); it has no official code. \
                        CLoSD (GuyTevet/CLoSD) subtracts the tolerance instead";

/// Mean depth of the lowest point.
pub(super) static PENETRATION: Metric = Metric {
    key: "l0/penetration",
    title: "penetration",
    unit: "mm",
    level: Level::L0,
    better: Better::Lower,
    formula: "mean over all frames of d, the depth of the lowest point below the floor where that is > 5 mm, else 0; \
              this is also the time integral of d per second of motion",
    empty: "one frame suffices",
    reference: PHYSDIFF,
    signature: "points:all-collision-solids|floor:z0|tol:5mm,clip|agg:mean-frames|v:1",
};

/// Penetration added up over time.
pub(super) static PENETRATION_INTEGRAL: Metric = Metric {
    key: "l0/penetration_integral",
    title: "penetration time",
    unit: "mm s",
    level: Level::L0,
    better: Better::Lower,
    formula: "integral over the motion of the depth d of l0/penetration, by the trapezoid rule",
    empty: "0 for a single frame",
    reference: PHYSDIFF,
    signature: "points:all-collision-solids|floor:z0|tol:5mm,clip|agg:trapezoid|v:1",
};

/// Mean height of the lowest point.
pub(super) static FLOAT: Metric = Metric {
    key: "l0/float",
    title: "float",
    unit: "mm",
    level: Level::L0,
    better: Better::Lower,
    formula: "mean over all frames of h, the height of the lowest point over the floor where that is > 5 mm, else 0; \
              a jump floats too; this is also the time integral of h per second of motion",
    empty: "one frame suffices",
    reference: PHYSDIFF,
    signature: "points:all-collision-solids|floor:z0|tol:5mm,clip|agg:mean-frames|v:1",
};

/// Float added up over time.
pub(super) static FLOAT_INTEGRAL: Metric = Metric {
    key: "l0/float_integral",
    title: "float time",
    unit: "mm s",
    level: Level::L0,
    better: Better::Lower,
    formula: "integral over the motion of the height h of l0/float, by the trapezoid rule",
    empty: "0 for a single frame",
    reference: PHYSDIFF,
    signature: "points:all-collision-solids|floor:z0|tol:5mm,clip|agg:trapezoid|v:1",
};

/// Height of the lowest point in the lowest frame.
pub(super) static LOWEST_MIN: Metric = Metric {
    key: "l0/lowest_point_min",
    title: "lowest point, min",
    unit: "mm",
    level: Level::L0,
    better: Better::Neither,
    formula: "min over frames of the signed height of the lowest point; \
              well above zero the body never touches the floor, which no jump explains",
    empty: "one frame suffices",
    reference: "this project",
    signature: "points:all-collision-solids|floor:z0|agg:min-frames|v:1",
};

/// Typical height of the lowest point.
pub(super) static LOWEST_MEDIAN: Metric = Metric {
    key: "l0/lowest_point_median",
    title: "lowest point, median",
    unit: "mm",
    level: Level::L0,
    better: Better::Neither,
    formula: "median over frames of the signed height of the lowest point; \
              the offset of the recording's floor, insensitive to jumps and single bad frames",
    empty: "one frame suffices",
    reference: "this project",
    signature: "points:all-collision-solids|floor:z0|agg:median-frames|v:1",
};

/// Scores of a body's height over the floor.
pub(super) fn scores(trace: &Trace) -> Vec<Score> {
    let depths_m: Vec<f64> = trace.lowest_m.iter().map(|&height| beyond_tolerance(-height)).collect();
    let heights_m: Vec<f64> = trace.lowest_m.iter().map(|&height| beyond_tolerance(height)).collect();
    let lowest_m = || trace.lowest_m.iter().copied();
    [
        (&PENETRATION, mean(depths_m.iter().copied())),
        (&PENETRATION_INTEGRAL, Some(integral(&depths_m, trace.rate_hz))),
        (&FLOAT, mean(heights_m.iter().copied())),
        (&FLOAT_INTEGRAL, Some(integral(&heights_m, trace.rate_hz))),
        (&LOWEST_MIN, lowest_m().min_by(f64::total_cmp)),
        (&LOWEST_MEDIAN, median(lowest_m())),
    ]
    .into_iter()
    .filter_map(|(metric, metres)| Score::new(metric, metres? * MM_PER_M))
    .collect()
}

/// The whole distance once it exceeds the tolerance, zero before.
fn beyond_tolerance(distance_m: f64) -> f64 {
    if distance_m > TOLERANCE_M { distance_m } else { 0.0 }
}

/// Time integral of values at the frames by the trapezoid rule, metre seconds.
fn integral(values_m: &[f64], rate_hz: f64) -> f64 {
    values_m.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).sum::<f64>() / rate_hz
}
