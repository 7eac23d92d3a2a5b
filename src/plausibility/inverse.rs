//! Level 1: what physics cannot explain.

use super::metric::{Better, Metric, Score};
use super::trace::mean;
use crate::dynamics::{ExplainedFrame, ExplanationSettings, explain};
use crate::humanoid::Humanoid;
use crate::motion::{JOINTS, Motion};
use crate::simulation::{GRAVITY_M_S2, Level};

/// Frames explained per second; the filter leaves nothing that is faster.
const FRAMES_PER_SEC: f64 = 50.0;
/// A sole point faster than this cannot carry in the gated variant, m/s.
const GATE_M_S: f64 = 0.4;
/// A torque from this share of the limit on counts as at the limit.
const AT_LIMIT: f64 = 0.99;
const PERCENT: f64 = 100.0;

const RESIDUAL: &str = "root residual of inverse dynamics after the best contact forces, as OpenSim's residual reduction \
                        reports it (Delp et al. 2007, IEEE Trans Biomed Eng 54:1940; thresholds: Hicks et al. 2015, \
                        J Biomech Eng 137:020905)";

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "% BW",
    level: Level::L1,
    better: Better::Lower,
    formula: "",
    empty: "the static residual of one frame",
    reference: RESIDUAL,
    signature: "",
};

/// Mean force that nothing explains.
pub(super) static FORCE_MEAN: Metric = Metric {
    key: "l1/residual_force",
    title: "residual force",
    formula: "mean over frames of |residual force at the root| / (m g), after the contact forces inside friction cones at \
              the 12 sole points below 35 mm that come closest to the wanted root wrench",
    signature: "filter:butterworth4-6Hz|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|v:1",
    ..SHARED
};

/// 95th percentile of the force that nothing explains.
pub(super) static FORCE_P95: Metric = Metric {
    key: "l1/residual_force_p95",
    title: "residual p95",
    formula: "95th percentile over frames of |residual force at the root| / (m g), as l1/residual_force",
    signature: "filter:butterworth4-6Hz|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|quantile:95|v:1",
    ..SHARED
};

/// Mean unexplained force when only slow points carry.
pub(super) static FORCE_GATED: Metric = Metric {
    key: "l1/residual_force_gated",
    title: "residual gated",
    formula: "l1/residual_force with sole points slower than 0.4 m/s only, so that a slide at constant speed shows",
    signature: "filter:butterworth4-6Hz|rate:50Hz|mu:0.8|h:35mm|gate:0.4m/s|solver:clarabel-soc|v:1",
    ..SHARED
};

/// Mean moment that nothing explains.
pub(super) static MOMENT_MEAN: Metric = Metric {
    key: "l1/residual_moment",
    title: "residual moment",
    unit: "% BW H",
    formula: "mean over frames of |residual moment about the root| / (m g H), as l1/residual_force",
    signature: "filter:butterworth4-6Hz|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|v:1",
    ..SHARED
};

/// Share of joint torques at their limit.
pub(super) static TORQUE_LIMIT_SHARE: Metric = Metric {
    key: "l1/torque_limit_share",
    title: "torque limit",
    unit: "",
    formula: "share of joints x frames whose inverse-dynamics torque is at least 0.99 of the URDF effort limit",
    reference: "effort limits: published human strength, see the humanoid module",
    signature: "filter:butterworth4-6Hz|rate:50Hz|mu:0.8|h:35mm|share:0.99|v:1",
    ..SHARED
};

/// Scores of a motion whose floor is z = 0.
pub(super) fn scores(humanoid: &Humanoid, motion: &Motion) -> Vec<Score> {
    let stride = (motion.rate_hz() / FRAMES_PER_SEC).round().max(1.0) as usize;
    let free = ExplanationSettings { stride, ..ExplanationSettings::default() };
    let gated = ExplanationSettings { contact_speed_m_s: GATE_M_S, ..free };
    let weight_n = humanoid.body.mass_kg * GRAVITY_M_S2;
    let force = |frame: &ExplainedFrame| frame.residual_force_n.norm() / weight_n * PERCENT;
    let moment = |frame: &ExplainedFrame| {
        frame.residual_moment_nm.norm() / (weight_n * humanoid.body.height_m) * PERCENT
    };

    let frames = explain(humanoid, motion, GRAVITY_M_S2, &free);
    let gated_frames = explain(humanoid, motion, GRAVITY_M_S2, &gated);
    let mut sorted: Vec<f64> = frames.iter().map(force).collect();
    sorted.sort_by(f64::total_cmp);
    let p95 = sorted.get((sorted.len() * 95).div_ceil(100).saturating_sub(1)).copied();
    let limits = effort_limits(humanoid);
    let at_limit = frames.iter().map(|frame| {
        let count =
            frame.torques_nm.iter().zip(&limits).filter(|(torque, limit)| torque.abs() >= AT_LIMIT * *limit);
        count.count() as f64 / JOINTS.len() as f64
    });
    [
        (&FORCE_MEAN, mean(frames.iter().map(force))),
        (&FORCE_P95, p95),
        (&FORCE_GATED, mean(gated_frames.iter().map(force))),
        (&MOMENT_MEAN, mean(frames.iter().map(moment))),
        (&TORQUE_LIMIT_SHARE, mean(at_limit)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}

/// Effort limits in KIT order, N m.
fn effort_limits(humanoid: &Humanoid) -> Vec<f64> {
    let mut limits = vec![f64::INFINITY; JOINTS.len()];
    for (limit, &kit) in humanoid.robot.limits.iter().zip(humanoid.kit_of_angle()) {
        limits[kit] = limit.effort_nm;
    }
    limits
}
