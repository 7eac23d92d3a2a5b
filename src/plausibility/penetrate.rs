//! Level 0, penetration and float as other programs count them, for comparison with their tables.

use super::metric::{Better, Metric, Score};
use super::trace::{Trace, mean};
use crate::humanoid::SoleRegion;
use crate::simulation::Level;

const MM_PER_M: f64 = 1000.0;
/// Tolerance of CLoSD and MBench, metres.
const TOLERANCE_M: f64 = 0.005;
/// Depth that counts for OmniRetarget, metres.
const OMNI_M: f64 = 0.010;
/// Speed below which MBench takes a foot for resting, metres per frame, and the height below which it does so too.
const RESTING_M_PER_FRAME: f64 = 0.01;
const RESTING_HEIGHT_M: f64 = 0.02;
/// Fewest frames in a row without a resting foot that count as floating.
const FLOATING_RUN: usize = 4;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "mm",
    level: Level::L0,
    better: Better::Lower,
    formula: "",
    empty: "one frame suffices",
    reference: "",
    signature: "",
};

/// Mean depth of everything that is below the floor.
pub(super) static UHC: Metric = Metric {
    key: "l0/penetrate_uhc",
    title: "penetrate UHC",
    formula: "mean over all frames of the mean depth of the surface points below the floor, 0 without any; \
              more points just below the floor lower it",
    reference: "UHC (ZhengyiLuo/UniversalHumanoidControl: uhc/smpllib/smpl_eval.py), there over mesh vertices",
    signature: "points:surface-samples|floor:z0|tol:0|agg:mean-below,mean-frames|v:1",
    ..SHARED
};

/// Depth beyond a tolerance.
pub(super) static CLOSD: Metric = Metric {
    key: "l0/penetrate_closd",
    title: "penetrate CLoSD",
    formula: "mean over all frames of max(0, -(h + 5 mm)), h the height of the lowest sole point or joint centre: the \
              tolerance is subtracted, so the value is up to 5 mm below l0/penetration",
    reference: "CLoSD (GuyTevet/CLoSD: utils/metrics.py); its lowest joint lies on the sole",
    signature: "points:sole12+21-segment-origins|floor:z0|tol:5mm,subtract|agg:mean-frames|v:1",
    ..SHARED
};

/// Mean depth of foot samples that are deep.
pub(super) static MBENCH: Metric = Metric {
    key: "l0/penetrate_mbench",
    title: "penetrate MBench",
    formula: "mean depth over the foot samples (heel and ball of both feet, every frame) that are more than 5 mm deep; \
              frames without penetration do not enter, so a single bad frame counts in full",
    empty: "0 without such a sample",
    reference: "MBench (MotrixLab/ViMoGen: mbench/motion_quality.py), there in metres",
    signature: "points:heel+ball|floor:z0|tol:5mm,clip|agg:mean-deep-samples|v:1",
    ..SHARED
};

const HUMOR: Metric = Metric {
    unit: "",
    formula: "share of the toe samples (both feet, every frame) that are deeper than the distance in the key",
    reference: "HuMoR (davrempe/humor: humor/fitting/eval_utils.py); the toe joint there, the sole under its tip here",
    signature: "points:toe-tips|floor:z0|agg:share-samples|v:1",
    ..SHARED
};

/// Share of toe samples below the floor, by depth.
pub(super) static HUMOR_AT: [Metric; 6] = [
    Metric { key: "l0/penetrate_humor_00cm", title: "penetrate HuMoR @0", ..HUMOR },
    Metric { key: "l0/penetrate_humor_03cm", title: "penetrate HuMoR @3", ..HUMOR },
    Metric { key: "l0/penetrate_humor_06cm", title: "penetrate HuMoR @6", ..HUMOR },
    Metric { key: "l0/penetrate_humor_09cm", title: "penetrate HuMoR @9", ..HUMOR },
    Metric { key: "l0/penetrate_humor_12cm", title: "penetrate HuMoR @12", ..HUMOR },
    Metric { key: "l0/penetrate_humor_15cm", title: "penetrate HuMoR @15", ..HUMOR },
];
const HUMOR_DEPTHS_M: [f64; 6] = [0.0, 0.03, 0.06, 0.09, 0.12, 0.15];

/// Mean depth of the toes times how often they are deep.
pub(super) static HUMOR_DEPTH: Metric = Metric {
    key: "l0/penetrate_humor_depth",
    title: "penetrate HuMoR",
    unit: "mm",
    formula: "mean depth of the toe samples below the floor * their share of all toe samples",
    ..HUMOR
};

/// Share of frames that are deep.
pub(super) static OMNI_SHARE: Metric = Metric {
    key: "l0/penetrate_omniretarget",
    title: "penetrate OmniRetarget",
    unit: "",
    formula: "share of frames whose lowest point is more than 10 mm below the floor",
    reference: "OmniRetarget (amazon-far/holosoma: evaluation/eval_retargeting.py)",
    signature: "points:all-collision-solids|floor:z0|tol:10mm|agg:share-frames|v:1",
    ..SHARED
};

/// Largest depth.
pub(super) static OMNI_DEPTH: Metric = Metric {
    key: "l0/penetration_max",
    title: "penetration max",
    formula: "max over frames of the depth of the lowest point below the floor, 0 without penetration",
    reference: "OmniRetarget (amazon-far/holosoma: evaluation/eval_retargeting.py)",
    signature: "points:all-collision-solids|floor:z0|tol:0|agg:max-frames|v:1",
    ..SHARED
};

/// Height beyond a tolerance.
pub(super) static FLOAT_CLOSD: Metric = Metric {
    key: "l0/float_closd",
    title: "float CLoSD",
    formula: "mean over all frames of max(0, h - 5 mm), h the height of the lowest sole point or joint centre: the \
              tolerance is subtracted",
    reference: "CLoSD (GuyTevet/CLoSD: utils/metrics.py); its lowest joint lies on the sole",
    signature: "points:sole12+21-segment-origins|floor:z0|tol:5mm,subtract|agg:mean-frames|v:1",
    ..SHARED
};

/// Share of frames without a resting foot.
pub(super) static FLOAT_MBENCH: Metric = Metric {
    key: "l0/float_mbench",
    title: "float MBench",
    unit: "",
    formula: "share of frames in runs of at least four in which no ball or heel rests, that is, moves less than 1 cm since \
              the frame before or is below 2 cm. Deviation: the rule on the ratio of foot to root speed is left out",
    reference: "MBench (MotrixLab/ViMoGen: mbench/motion_quality.py)",
    signature: "points:heel+ball|rest:0.01m/frame,or-h<2cm|run:4|rate:own|v:1",
    ..SHARED
};

pub(super) fn scores(trace: &Trace) -> Vec<Score> {
    let frames = || 0..trace.num_frames();
    let lowest_joint_m: Vec<f64> = frames().map(|frame| lowest_joint_m(trace, frame)).collect();
    let feet: Vec<f64> = frames().flat_map(|frame| feet_m(trace, frame).map(|point| point.z)).collect();
    let toes: Vec<f64> =
        frames().flat_map(|frame| trace.middle_m(frame, SoleRegion::Toe).map(|toe| toe.z)).collect();
    let share_below =
        |depth_m: f64| mean(toes.iter().map(|height| f64::from(*height < 0.0 && -height > depth_m)));
    let in_mm = |metres: Option<f64>| metres.map(|metres| metres * MM_PER_M);
    let positive = |height: f64| height.max(0.0);

    let mut scores = vec![
        (&UHC, in_mm(mean(trace.surface.iter().map(|frame| frame.mean_depth_m)))),
        (&CLOSD, in_mm(mean(lowest_joint_m.iter().map(|height| positive(-(height + TOLERANCE_M)))))),
        (&MBENCH, in_mm(mean(feet.iter().filter(|h| **h < -TOLERANCE_M).map(|h| h.abs())).or(Some(0.0)))),
        (&HUMOR_DEPTH, in_mm(mean(toes.iter().map(|height| positive(-height))))),
        (&OMNI_SHARE, mean(trace.lowest_m.iter().map(|height| f64::from(*height < -OMNI_M)))),
        (&OMNI_DEPTH, in_mm(trace.lowest_m.iter().map(|h| positive(-h)).max_by(f64::total_cmp))),
        (&FLOAT_CLOSD, in_mm(mean(lowest_joint_m.iter().map(|height| positive(height - TOLERANCE_M))))),
        (&FLOAT_MBENCH, floating_share(trace)),
    ];
    scores.extend(HUMOR_AT.iter().zip(HUMOR_DEPTHS_M).map(|(metric, depth)| (metric, share_below(depth))));
    scores.into_iter().filter_map(|(metric, value)| Score::new(metric, value?)).collect()
}

/// Height of the lowest sole point or joint centre, metres.
fn lowest_joint_m(trace: &Trace, frame: usize) -> f64 {
    let points = trace.sole_points_m(frame).iter().chain(&trace.centers_m[frame]);
    points.map(|point| point.z).fold(f64::INFINITY, f64::min)
}

/// Heel and ball of the left, then of the right foot, metres.
pub(super) fn feet_m(trace: &Trace, frame: usize) -> [nalgebra::Vector3<f64>; 4] {
    let (heels, balls) = (trace.middle_m(frame, SoleRegion::Heel), trace.balls_m(frame));
    [heels[0], balls[0], heels[1], balls[1]]
}

fn floating_share(trace: &Trace) -> Option<f64> {
    let rests = |frame: usize| {
        let now = feet_m(trace, frame);
        let before = feet_m(trace, frame.saturating_sub(1));
        now.iter().zip(&before).any(|(now, before)| {
            now.z < RESTING_HEIGHT_M || (frame > 0 && (now - before).norm() < RESTING_M_PER_FRAME)
        })
    };
    let floats: Vec<bool> = (0..trace.num_frames()).map(|frame| !rests(frame)).collect();
    let in_runs: usize = floats
        .chunk_by(|a, b| a == b)
        .filter(|run| run[0] && run.len() >= FLOATING_RUN)
        .map(<[bool]>::len)
        .sum();
    (!floats.is_empty()).then(|| in_runs as f64 / floats.len() as f64)
}
