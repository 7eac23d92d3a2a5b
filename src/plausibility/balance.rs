//! Level 0, balance: centre of mass, centre of pressure and zero-moment point against the feet.

use nalgebra::Vector2;

use super::metric::{Better, Metric, Score};
use super::polygon::{convex_hull, margin_m};
use super::trace::{Trace, mean};
use crate::dynamics::{Explainer, ExplanationSettings};
use crate::humanoid::Humanoid;
use crate::motion::Motion;
use crate::simulation::{GRAVITY_M_S2, Level};

const MM_PER_M: f64 = 1000.0;
/// Height up to which a sole point may carry the body, metres; recorded soles hover that much in stance.
const NEAR_FLOOR_M: f64 = 0.035;
/// Share of body weight below which the zero-moment point is arbitrary.
const LEAST_LOAD: f64 = 0.3;
/// A zero-moment point this far outside the feet is outside; less is the roundness of the sole, metres.
const OUTSIDE_M: f64 = 0.02;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "mm",
    level: Level::L0,
    better: Better::Higher,
    formula: "",
    empty: "absent without a sole point near the floor",
    reference: "",
    signature: "",
};

/// Distance of the centre of mass from the edge of the feet.
pub(super) static COM_MARGIN: Metric = Metric {
    key: "l0/com_margin",
    title: "CoM margin",
    formula: "mean over frames of the signed distance of the centre of mass's plumb line from the edge of the convex hull of \
              the sole points below 35 mm, positive inside; walking leaves its feet at every step",
    reference: "base of support and centre of mass as in IPMAN (sha2nkt/ipman-r: stability/stability_metrics.py), there \
                inside or not",
    signature: "points:sole12|h:35mm|hull:convex|agg:mean-frames|v:1",
    ..SHARED
};

/// Share of frames with the centre of mass over the feet.
pub(super) static COM_INSIDE: Metric = Metric {
    key: "l0/com_in_support",
    title: "CoM in support",
    unit: "",
    formula: "share of frames with the centre of mass's plumb line inside the convex hull of the sole points below 35 mm; \
              frames without such a point count as outside",
    empty: "one frame suffices",
    reference: "IPMAN (sha2nkt/ipman-r: stability/stability_metrics.py)",
    signature: "points:sole12|h:35mm|hull:convex|none:outside|v:1",
    ..SHARED
};

/// Share of frames without support.
pub(super) static NO_SUPPORT: Metric = Metric {
    key: "l0/no_support",
    title: "no support",
    unit: "",
    better: Better::Neither,
    formula: "share of frames without a sole point below 35 mm: flight, or a floor that is elsewhere",
    empty: "one frame suffices",
    reference: "IPMAN's class -1 (sha2nkt/ipman-r: stability/stability_metrics.py), there up to ten vertices in contact",
    signature: "points:sole12|h:35mm|v:1",
    ..SHARED
};

/// Distance of the centre of mass from the centre of pressure.
pub(super) static COP_ERROR: Metric = Metric {
    key: "l0/cop_error",
    title: "CoP error",
    better: Better::Lower,
    formula: "mean over frames of the horizontal distance between the centre of mass and the centre of pressure, the mean of \
              the surface points weighted by 1 - 100 h below the floor and exp(-10 h) above it, h in metres",
    empty: "one frame suffices",
    reference: "IPMAN (sha2nkt/ipman-r: stability/stability_metrics.py), there over volume-weighted vertices",
    signature: "points:surface-samples|weight:100,10|agg:mean-frames|v:1",
    ..SHARED
};

/// Distance of the zero-moment point from the edge of the feet.
pub(super) static ZMP_MARGIN: Metric = Metric {
    key: "l0/zmp_margin",
    title: "ZMP margin",
    formula: "mean over frames of the signed distance of the zero-moment point from the edge of the convex hull of the sole \
              points below 35 mm, positive inside; frames that ask less than 30 % of body weight of the floor do not enter",
    reference: ZMP,
    signature: "points:sole12|h:35mm|hull:convex|filter:butterworth4-6Hz|edges:out|load:30%|agg:mean-frames|v:1",
    ..SHARED
};

/// Share of frames whose zero-moment point is outside the feet.
pub(super) static ZMP_OUTSIDE: Metric = Metric {
    key: "l0/zmp_outside",
    title: "ZMP outside",
    unit: "",
    better: Better::Lower,
    formula: "share of the frames of l0/zmp_margin with the zero-moment point more than 20 mm outside; no foot can press there",
    reference: ZMP,
    signature: "points:sole12|h:35mm|hull:convex|filter:butterworth4-6Hz|edges:out|load:30%|tol:20mm|v:1",
    ..SHARED
};

const ZMP: &str = "zero-moment point with angular momentum (Vukobratovic and Borovac 2004, Int. J. Humanoid Robotics 1:157)";

/// Signed distances of one frame, metres; `None` without support, or where nothing presses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Balance {
    pub com_margin_m: Option<f64>,
    pub zmp_margin_m: Option<f64>,
}

/// One entry per frame of the motion that `trace` is of.
pub(super) fn balance(humanoid: &Humanoid, motion: &Motion, trace: &Trace) -> Vec<Balance> {
    let settings = ExplanationSettings::default();
    let explainer = Explainer::new(humanoid, motion, GRAVITY_M_S2, &settings);
    let steady = explainer.steady_frames(&settings);
    let least_force_n = LEAST_LOAD * explainer.weight_n();
    (0..trace.num_frames())
        .map(|frame| {
            let near = trace.sole_points_m(frame).iter().filter(|point| point.z < NEAR_FLOOR_M);
            let hull = convex_hull(near.map(nalgebra::Matrix::xy).collect());
            let zmp = explainer.wanted[frame].zero_moment_point_m(&explainer.root_m(frame), least_force_n);
            let zmp = zmp.filter(|_| steady.contains(&frame)).map(Vector2::from);
            Balance {
                com_margin_m: margin_m(&hull, &trace.com_m[frame].xy()),
                zmp_margin_m: zmp.and_then(|zmp| margin_m(&hull, &zmp)),
            }
        })
        .collect()
}

pub(super) fn scores(trace: &Trace, balance: &[Balance]) -> Vec<Score> {
    let com = || balance.iter().map(|frame| frame.com_margin_m);
    let zmp = || balance.iter().filter_map(|frame| frame.zmp_margin_m);
    let cop =
        trace.surface.iter().zip(&trace.com_m).map(|(surface, com)| (surface.pressure_m - com.xy()).norm());
    [
        (&COM_MARGIN, mean(com().flatten()).map(|margin| margin * MM_PER_M)),
        (&COM_INSIDE, mean(com().map(|margin| f64::from(margin.is_some_and(|margin| margin >= 0.0))))),
        (&NO_SUPPORT, mean(com().map(|margin| f64::from(margin.is_none())))),
        (&COP_ERROR, mean(cop).map(|error| error * MM_PER_M)),
        (&ZMP_MARGIN, mean(zmp()).map(|margin| margin * MM_PER_M)),
        (&ZMP_OUTSIDE, mean(zmp().map(|margin| f64::from(margin < -OUTSIDE_M)))),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}
