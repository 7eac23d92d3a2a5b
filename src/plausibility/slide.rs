//! Level 0, sliding feet as other programs count them, for comparison with their tables.

use super::metric::{Better, Metric, Score};
use super::penetrate::feet_m;
use super::trace::{Trace, horizontal_m, mean};
use super::{ground, skate};
use crate::humanoid::SoleRegion;
use crate::simulation::Level;

const MM_PER_M: f64 = 1000.0;
/// Height of contact of CLoSD, metres.
const CLOSD_CONTACT_M: f64 = 0.005;
/// Contact of MBench: slower than this in metres per frame, or lower than this in metres.
const MBENCH_CONTACT: (f64, f64) = (0.01, 0.02);
/// Height below which a foot of OmniRetarget sticks, and the step that is sliding, metres.
const OMNI_CONTACT_M: f64 = 0.02;
const OMNI_STEP_M: f64 = 0.01;
/// Contact of HuMoR: step, height of the toes and of the ankle, metres, at 30 frames a second.
const HUMOR_STEP_M: f64 = 0.005;
const HUMOR_TOE_M: f64 = 0.04;
const HUMOR_HEEL_M: f64 = 0.08;
pub(super) const HUMOR_RATE_HZ: f64 = 30.0;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "mm/frame",
    level: Level::L0,
    better: Better::Lower,
    formula: "",
    empty: "absent for a single frame",
    reference: "",
    signature: "",
};

/// Slide of the surface that is in the floor.
pub(super) static UHC: Metric = Metric {
    key: "l0/skate_uhc",
    title: "skate UHC",
    formula: "mean over frame pairs of the mean horizontal step of the feet's surface points at or below the floor in both \
              frames, 0 without any; a sole that hovers by a hair never skates",
    reference: "UHC (ZhengyiLuo/UniversalHumanoidControl: uhc/smpllib/smpl_eval.py), there over mesh vertices",
    signature: "points:feet-surface-samples|contact:0mm,both|agg:mean-points,mean-pairs|rate:own|v:1",
    ..SHARED
};

/// Slide of the lowest joint.
pub(super) static CLOSD: Metric = Metric {
    key: "l0/skate_closd",
    title: "skate CLoSD",
    formula: "mean over frame pairs of the mean horizontal step of heel and ball of both feet where they are at or below \
              5 mm in both frames, 0 without any",
    reference: "CLoSD (GuyTevet/CLoSD: utils/metrics.py)",
    signature: "points:heel+ball|contact:5mm,both|agg:mean-points,mean-pairs|rate:own|v:1",
    ..SHARED
};

/// Slide of resting feet.
pub(super) static MBENCH: Metric = Metric {
    key: "l0/slide_mbench",
    title: "slide MBench",
    formula: "for heel and ball of each foot the mean horizontal step over the frames in contact (step below 1 cm, or below \
              2 cm high), then the mean of those with contact",
    empty: "absent for a single frame; 0 without contact",
    reference: "MBench (MotrixLab/ViMoGen: mbench/motion_quality.py), there in metres",
    signature: "points:heel+ball|contact:0.01m/frame,or-h<2cm|agg:mean-contact-frames,mean-points|rate:own|v:1",
    ..SHARED
};

/// Share of sticking frames that slide.
pub(super) static OMNI: Metric = Metric {
    key: "l0/slide_omniretarget",
    title: "slide OmniRetarget",
    unit: "",
    formula: "share of the foot samples below 2 cm in two frames that move more than 1 cm between them; per frame, though \
              the original's comment says per second",
    empty: "absent for a single frame; 0 without contact",
    reference: "OmniRetarget (amazon-far/holosoma: evaluation/eval_retargeting.py)",
    signature: "points:heel+ball|contact:2cm,both|step:1cm/frame|agg:share-samples|rate:own|v:1",
    ..SHARED
};

/// Penetration, float and skate added up.
pub(super) static PHYS_ERR: Metric = Metric {
    key: "l0/phys_err",
    title: "Phys-Err",
    unit: "mm",
    formula: "l0/penetration + l0/float + l0/skate_per_frame, the last in mm per frame at the motion's own rate",
    reference: "PhysDiff (Yuan et al. 2023, arXiv 2212.02500)",
    signature: "penetrate+float+skate|tol:5mm,clip|rate:own|v:1",
    ..SHARED
};

/// Share of frames with contact by HuMoR's labels.
pub(super) static HUMOR_CONTACT: Metric = Metric {
    key: "l0/contact_humor",
    title: "contact HuMoR",
    unit: "",
    better: Better::Neither,
    formula: "share of the foot samples at 30 Hz labelled in contact: a step below 5 mm since the sample before, and toes \
              below 4 cm or heel below 8 cm. Deviation: the floor is z = 0, not estimated from static toes",
    reference: "HuMoR (davrempe/humor: humor/scripts/process_amass_data.py)",
    signature: "points:toe+heel|rate:30Hz,linear-positions|step:5mm|h:4cm,8cm|floor:z0|v:1",
    ..SHARED
};

pub(super) fn scores(trace: &Trace, others: &[Score]) -> Vec<Score> {
    if trace.num_frames() < 2 {
        return Vec::new();
    }
    let pairs = || 1..trace.num_frames();
    let steps = |frame: usize| {
        let (before, now) = (feet_m(trace, frame - 1), feet_m(trace, frame));
        [0, 1, 2, 3].map(|point| (before[point], now[point], horizontal_m(&(now[point] - before[point]))))
    };
    let closd = mean(pairs().map(|frame| {
        let low = steps(frame).into_iter().filter(|(before, now, _)| before.z.max(now.z) <= CLOSD_CONTACT_M);
        mean(low.map(|(_, _, step)| step)).unwrap_or(0.0)
    }));
    let mbench = mean((0..4).filter_map(|point| {
        let in_contact = pairs()
            .map(|frame| steps(frame)[point])
            .filter(|(before, now, _)| (now - before).norm() < MBENCH_CONTACT.0 || now.z < MBENCH_CONTACT.1);
        mean(in_contact.map(|(_, _, step)| step))
    }));
    let sticking = || pairs().flat_map(steps).filter(|(before, now, _)| before.z.max(now.z) < OMNI_CONTACT_M);
    let value =
        |metric: &Metric| others.iter().find(|score| score.metric.key == metric.key).map(|score| score.value);
    let phys_err = [&ground::PENETRATION, &ground::FLOAT, &skate::PER_FRAME].map(value);
    [
        (&UHC, mean(trace.surface[1..].iter().map(|frame| frame.slide_m * MM_PER_M))),
        (&CLOSD, closd.map(|step| step * MM_PER_M)),
        (&MBENCH, Some(mbench.unwrap_or(0.0) * MM_PER_M)),
        (&OMNI, mean(sticking().map(|(_, _, step)| f64::from(step > OMNI_STEP_M))).or(Some(0.0))),
        (&PHYS_ERR, phys_err.into_iter().sum()),
        (&HUMOR_CONTACT, humor_contact(trace)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}

fn humor_contact(trace: &Trace) -> Option<f64> {
    let samples = trace.resampled(HUMOR_RATE_HZ, |frame| {
        let (toes, heels) = (trace.middle_m(frame, SoleRegion::Toe), trace.middle_m(frame, SoleRegion::Heel));
        [toes[0], heels[0], toes[1], heels[1]]
    });
    let heights = [HUMOR_TOE_M, HUMOR_HEEL_M, HUMOR_TOE_M, HUMOR_HEEL_M];
    mean(samples.windows(2).flat_map(|pair| {
        [0, 1, 2, 3].map(|point| {
            let (before, now) = (pair[0][point], pair[1][point]);
            f64::from((now - before).norm() < HUMOR_STEP_M && now.z < heights[point])
        })
    }))
}
