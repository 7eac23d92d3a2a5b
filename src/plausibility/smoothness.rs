//! Level 0, smoothness and foot contact as other programs count them, and where the body heads.

use nalgebra::Vector3;

use super::metric::{Better, Metric, Score};
use super::penetrate::feet_m;
use super::slide::HUMOR_RATE_HZ;
use super::trace::{Trace, horizontal_m, mean};
use crate::humanoid::{NUM_SEGMENTS, SoleRegion};
use crate::simulation::Level;

/// A foot whose slowest sole point is slower than this and lower than the other stands, m/s and metres.
const STANDING: (f64, f64) = (0.15, 0.035);
/// Largest root acceleration that is none, m/s^2.
const LEAST_ACCELERATION_M_S2: f64 = 1.0e-6;
/// Scale of the PFC.
const PFC_SCALE: f64 = 1.0e4;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    level: Level::L0,
    better: Better::Lower,
    formula: "",
    empty: "absent below three frames",
    reference: "",
    signature: "",
};

/// Mean second difference.
pub(super) static JITTER: Metric = Metric {
    key: "l0/jitter",
    title: "jitter",
    unit: "m/s^2",
    formula: "rate^2 * (mean |p(t+1) - 2 p(t) + p(t-1)| + the same of p - p_root), means over frames and the 21 joint \
              centres; noise grows with the square of the rate: compare at equal rates only",
    reference: "MBench (MotrixLab/ViMoGen: mbench/motion_quality.py), there per frame, here per second",
    signature: "points:21-segment-origins|per:second|parts:world+root-relative|v:1",
    ..SHARED
};

/// Mean second difference per frame.
pub(super) static JITTER_PER_FRAME: Metric = Metric {
    key: "l0/jitter_per_frame",
    title: "jitter per frame",
    unit: "mm/frame^2",
    formula: "l0/jitter / rate^2: what MBench prints; at the motion's own rate",
    reference: "MBench (MotrixLab/ViMoGen: mbench/motion_quality.py), there in metres",
    signature: "points:21-segment-origins|rate:own|parts:world+root-relative|v:1",
    ..SHARED
};

/// Mean acceleration at 30 Hz.
pub(super) static ACCEL: Metric = Metric {
    key: "l0/accel",
    title: "accel HuMoR",
    unit: "m/s^2",
    formula: "mean over samples at 30 Hz and the 21 joint centres of |p(t+h) - 2 p(t) + p(t-h)| / h^2, h = 1/30 s",
    empty: "absent below 1/15 s",
    reference: "HuMoR (davrempe/humor: humor/fitting/eval_utils.py)",
    signature: "points:21-segment-origins|frame:world|rate:30Hz,linear-positions|v:1",
    ..SHARED
};

/// Physical foot contact score.
pub(super) static PFC: Metric = Metric {
    key: "l0/pfc",
    title: "PFC",
    formula: "1e4 * mean over samples at 30 Hz of |a| / max |a| * min(step of left heel, of left ball) * min(the same of the \
              right), a the root's acceleration with its downward part taken out, steps horizontal in metres per sample; \
              0 for a root that never accelerates",
    empty: "absent below 1/15 s",
    reference: "EDGE (Stanford-TML/EDGE: eval/eval_pfc.py); ankle and toe joint there",
    signature: "points:root,heel+ball|rate:30Hz,linear-positions|scale:1e4|v:1",
    ..SHARED
};

/// Speed in the direction the body faces.
pub(super) static HEADING_SPEED: Metric = Metric {
    key: "l0/heading_speed",
    title: "heading speed",
    unit: "m/s",
    better: Better::Neither,
    formula: "mean over frame pairs of the root's horizontal velocity along the direction the pelvis faces; negative for \
              walking backwards, which is how a motion played in reverse is seen",
    empty: "absent for a single frame",
    reference: "this project",
    signature: "point:root|direction:pelvis-y,horizontal|diff:backward|agg:mean-pairs|v:1",
    ..SHARED
};

/// Slope of standing soles.
pub(super) static SOLE_TILT: Metric = Metric {
    key: "l0/sole_tilt",
    title: "sole tilt",
    unit: "deg",
    formula: "mean over frames and standing feet (a sole point below 35 mm and slower than 0.15 m/s) of the angle between \
              floor and the plane through heel and ball; heels that rise before a step tilt too",
    empty: "absent without a standing foot",
    reference: "this project",
    signature: "points:heel+ball|stand:35mm,0.15m/s|agg:mean-feet-frames|v:1",
    ..SHARED
};

/// Share of standing feet on an edge.
pub(super) static SOLE_EDGE: Metric = Metric {
    key: "l0/sole_edge",
    title: "sole edge",
    formula: "share of the standing feet of l0/sole_tilt whose sole is rolled by more than 10 degrees to a side: the foot \
              stands on its edge",
    empty: "absent without a standing foot",
    reference: "this project",
    signature: "points:heel+ball|stand:35mm,0.15m/s|roll:10deg|v:1",
    ..SHARED
};

/// Roll beyond which a foot stands on its edge, radians.
const EDGE_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;

pub(super) fn scores(trace: &Trace) -> Vec<Score> {
    let rate_hz = trace.rate_hz;
    let jitter = mean(trace.centers_m.windows(3).map(mean_second_difference_m));
    let slow = trace.resampled(HUMOR_RATE_HZ, |frame| trace.centers_m[frame]);
    let accel =
        mean(slow.windows(3).map(|window| {
            mean((0..NUM_SEGMENTS).map(|segment| second(window, segment).norm())).unwrap_or(0.0)
        }));
    let heading = (1..trace.num_frames()).map(|frame| {
        let forward = trace.world_from_root[frame] * Vector3::y();
        let step = trace.centers_m[frame][0] - trace.centers_m[frame - 1][0];
        let facing = forward.xy().try_normalize(1e-9).unwrap_or_default();
        step.xy().dot(&facing) * rate_hz
    });
    let soles: Vec<[f64; 2]> = standing_soles(trace);
    [
        (&JITTER, jitter.map(|jitter| jitter * rate_hz * rate_hz)),
        (&JITTER_PER_FRAME, jitter.map(|jitter| jitter * 1000.0)),
        (&ACCEL, accel.map(|accel| accel * HUMOR_RATE_HZ * HUMOR_RATE_HZ)),
        (&PFC, pfc(trace)),
        (&HEADING_SPEED, mean(heading)),
        (&SOLE_TILT, mean(soles.iter().map(|[tilt, _]| tilt.to_degrees()))),
        (&SOLE_EDGE, mean(soles.iter().map(|[_, roll]| f64::from(roll.abs() > EDGE_RAD)))),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}

fn second(window: &[[Vector3<f64>; NUM_SEGMENTS]], segment: usize) -> Vector3<f64> {
    (window[2][segment] - window[1][segment]) - (window[1][segment] - window[0][segment])
}

fn mean_second_difference_m(window: &[[Vector3<f64>; NUM_SEGMENTS]]) -> f64 {
    let root = second(window, 0);
    let sizes = (0..NUM_SEGMENTS).map(|segment| {
        let own = second(window, segment);
        own.norm() + (own - root).norm()
    });
    sizes.sum::<f64>() / NUM_SEGMENTS as f64
}

fn pfc(trace: &Trace) -> Option<f64> {
    let samples = trace.resampled(HUMOR_RATE_HZ, |frame| {
        let feet = feet_m(trace, frame);
        [trace.centers_m[frame][0], feet[0], feet[1], feet[2], feet[3]]
    });
    let acceleration = |window: &[[Vector3<f64>; 5]]| {
        let mut a = (window[2][0] - window[1][0]) - (window[1][0] - window[0][0]);
        a.z = a.z.max(0.0);
        a.norm()
    };
    let largest = samples.windows(3).map(acceleration).max_by(f64::total_cmp)?;
    // The scale of a root that moves evenly would be that of rounding.
    if largest * HUMOR_RATE_HZ * HUMOR_RATE_HZ < LEAST_ACCELERATION_M_S2 {
        return Some(0.0);
    }
    let step =
        |window: &[[Vector3<f64>; 5]], point: usize| horizontal_m(&(window[2][point] - window[1][point]));
    let products = samples.windows(3).map(|window| {
        let (left, right) = (step(window, 1).min(step(window, 2)), step(window, 3).min(step(window, 4)));
        acceleration(window) / largest * left * right
    });
    mean(products).map(|product| product * PFC_SCALE)
}

/// Tilt and sideways roll of every standing sole, radians.
fn standing_soles(trace: &Trace) -> Vec<[f64; 2]> {
    let mut soles = Vec::new();
    for frame in 1..trace.num_frames() {
        let (before, now) = (trace.sole_points_m(frame - 1), trace.sole_points_m(frame));
        for foot in 0..2 {
            let stands = (0..now.len()).any(|point| {
                trace.soles.foot[point] == foot
                    && now[point].z < STANDING.1
                    && (now[point] - before[point]).norm() * trace.rate_hz < STANDING.0
            });
            if !stands {
                continue;
            }
            let corner =
                |region: SoleRegion, end: usize| now[trace.soles.of_region[foot][region as usize][end]];
            let across = corner(SoleRegion::Heel, 1) - corner(SoleRegion::Heel, 0);
            let along =
                trace.middle_m(frame, SoleRegion::Ball)[foot] - trace.middle_m(frame, SoleRegion::Heel)[foot];
            let Some(normal) = across.cross(&along).try_normalize(1e-9) else { continue };
            let Some(across) = across.try_normalize(1e-9) else { continue };
            soles.push([normal.z.abs().clamp(-1.0, 1.0).acos(), across.z.clamp(-1.0, 1.0).asin()]);
        }
    }
    soles
}
