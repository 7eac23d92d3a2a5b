//! Level 1: what physics cannot explain.

use std::ops::Range;

use super::metric::{Better, Metric, Score};
use super::thresholds;
use super::trace::mean;
use crate::dynamics::{ExplainedFrame, Explainer, ExplanationSettings};
use crate::humanoid::Humanoid;
use crate::motion::{Motion, NUM_JOINTS};
use crate::robot::JointLimits;
use crate::simulation::{GRAVITY_M_S2, Level};

use super::joints::limits_in_kit_order;

/// Frames explained per second; the filter leaves nothing that is faster.
pub(super) const FRAMES_PER_SEC: f64 = 50.0;
/// A sole point faster than this cannot carry in the gated variant, m/s.
pub(super) const GATE_M_S: f64 = 0.4;
/// A torque or power from this share of the limit on counts as at the limit.
const AT_LIMIT: f64 = 0.99;
/// Largest power of a joint as a share of its torque limit times its speed limit: the peak of a straight line between both.
const POWER_SHARE: f64 = 0.25;
const PERCENT: f64 = 100.0;

pub(super) const RESIDUAL: &str = "root residual of inverse dynamics after the best contact forces, as OpenSim's residual \
                                   reduction reports it (Delp et al. 2007, IEEE Trans Biomed Eng 54:1940)";

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
              the 12 sole points below 35 mm that come closest to the wanted root wrench; frames within one period of the \
              filter's cutoff of either end are left out (l1/edge_share)",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|v:2",
    ..SHARED
};

/// 95th percentile of the force that nothing explains.
pub(super) static FORCE_P95: Metric = Metric {
    key: "l1/residual_force_p95",
    title: "residual p95",
    formula: "95th percentile over frames of |residual force at the root| / (m g), as l1/residual_force",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|quantile:95|v:2",
    ..SHARED
};

/// Mean unexplained force when only slow points carry.
pub(super) static FORCE_GATED: Metric = Metric {
    key: "l1/residual_force_gated",
    title: "residual gated",
    formula: "l1/residual_force with sole points slower than 0.4 m/s only, so that a slide at constant speed shows",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|gate:0.4m/s|solver:clarabel-soc|v:2",
    ..SHARED
};

/// Mean unexplained force in the frames that the other metrics leave out.
pub(super) static FORCE_EDGES: Metric = Metric {
    key: "l1/residual_force_edges",
    title: "residual at ends",
    better: Better::Neither,
    formula: "l1/residual_force over the frames that it leaves out; large where a recording is cut in mid-movement, since the \
              filter knows nothing beyond the ends",
    empty: "absent when no frame is left out",
    signature: "filter:butterworth4-6Hz|edges:only|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|v:1",
    ..SHARED
};

/// Share of frames left out.
pub(super) static EDGE_SHARE: Metric = Metric {
    key: "l1/edge_share",
    title: "ends left out",
    unit: "",
    better: Better::Neither,
    formula: "share of the frames within one period of the filter's cutoff (1/6 s) of either end, at most a quarter of the \
              motion at either; no other l1 metric but l1/residual_force_edges counts them",
    empty: "0 for a single frame",
    reference: "this project",
    signature: "margin:1/6s,quarter|rate:50Hz|v:1",
    ..SHARED
};

/// Mean moment that nothing explains.
pub(super) static MOMENT_MEAN: Metric = Metric {
    key: "l1/residual_moment",
    title: "residual moment",
    unit: "% BW H",
    formula: "mean over frames of |residual moment about the root| / (m g H), as l1/residual_force",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|v:2",
    ..SHARED
};

/// Mean unexplained moment when only slow points carry.
pub(super) static MOMENT_GATED: Metric = Metric {
    key: "l1/residual_moment_gated",
    title: "residual moment gated",
    unit: "% BW H",
    formula: "l1/residual_moment with sole points slower than 0.4 m/s only",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|gate:0.4m/s|solver:clarabel-soc|v:1",
    ..SHARED
};

/// Share of joint torques at their limit.
pub(super) static TORQUE_LIMIT_SHARE: Metric = Metric {
    key: "l1/torque_limit_share",
    title: "torque limit",
    unit: "",
    formula: "share of joints x frames whose inverse-dynamics torque is at least 0.99 of the URDF effort limit",
    reference: "effort limits: published human strength, see the humanoid module",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|share:0.99|v:2",
    ..SHARED
};

/// Largest torque in units of its limit.
pub(super) static TORQUE_PEAK: Metric = Metric {
    key: "l1/torque_peak",
    title: "torque peak",
    unit: "",
    formula: "max over joints and frames of |inverse-dynamics torque| / URDF effort limit; above 1 hardly anybody is so strong",
    reference: "effort limits: published human strength, see the humanoid module",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|v:1",
    ..SHARED
};

/// Share of joint powers at their limit.
pub(super) static POWER_LIMIT_SHARE: Metric = Metric {
    key: "l1/power_limit_share",
    title: "power limit",
    unit: "",
    formula: "share of joints x frames whose power |torque * speed| is at least 0.99 of a quarter of effort limit * velocity \
              limit: the peak of a straight line between the two limits",
    reference: "this project; effort and velocity limits: published human strength, see the humanoid module",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|share:0.99|limit:effort*velocity/4|v:1",
    ..SHARED
};

/// Largest power per body mass.
pub(super) static POWER_PEAK: Metric = Metric {
    key: "l1/power_peak",
    title: "power peak",
    unit: "W/kg",
    formula: "max over joints and frames of |torque * speed| / body mass, single axes, giving and taking alike",
    reference: "joint power of inverse dynamics (Winter, Biomechanics and Motor Control of Human Movement, chapter 6)",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|v:1",
    ..SHARED
};

/// Share of frames in flight.
pub(super) static FLIGHT_SHARE: Metric = Metric {
    key: "l1/flight_share",
    title: "flight",
    unit: "",
    better: Better::Neither,
    formula: "share of frames without a sole point below 35 mm",
    reference: "this project",
    signature: "edges:out|rate:50Hz|h:35mm|v:1",
    ..SHARED
};

/// How far a flight is from free fall.
pub(super) static FLIGHT_ERROR: Metric = Metric {
    key: "l1/flight_error",
    title: "flight error",
    unit: "m/s^2",
    formula: "mean over the frames of l1/flight_share of |acceleration of the centre of mass + g|: 0 for a ballistic arc, 9.81 \
              for a body that hangs in the air; the filter blurs take-off and landing over 0.1 s",
    empty: "absent without flight",
    reference: "this project",
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|h:35mm|v:1",
    ..SHARED
};

/// What one explained frame shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct InverseFrame {
    /// Index of the frame in the motion.
    pub frame: usize,
    /// Whether the ends of the motion do not bend it.
    pub is_steady: bool,
    /// Residual force, N, and residual moment, N m, with all low points and with slow ones only.
    pub force_n: f64,
    pub moment_nm: f64,
    pub gated_force_n: f64,
    pub gated_moment_nm: f64,
    /// Force of the ground as found, N.
    pub ground_force_n: f64,
    /// Height of the centre of mass, metres.
    pub com_height_m: f64,
    /// Acceleration error where no sole point is low, m/s^2.
    pub flight_error_m_s2: Option<f64>,
    /// Share of joints at their torque limit and at their power limit.
    pub torque_share: f64,
    pub power_share: f64,
    /// Largest torque over its limit; largest power, W.
    pub torque_peak: f64,
    pub power_peak_w: f64,
}

/// A motion explained frame by frame.
pub(super) struct Inverse {
    pub frames: Vec<InverseFrame>,
    pub weight_n: f64,
    pub height_m: f64,
}

/// The settings of level 1 for a motion of this rate.
pub(super) fn settings(rate_hz: f64) -> ExplanationSettings {
    let stride = (rate_hz / FRAMES_PER_SEC).round().max(1.0) as usize;
    ExplanationSettings { stride, ..ExplanationSettings::default() }
}

impl Inverse {
    /// Explains a motion whose floor is z = 0.
    pub(super) fn new(humanoid: &Humanoid, motion: &Motion) -> Self {
        let free = settings(motion.rate_hz());
        let explainer = Explainer::new(humanoid, motion, GRAVITY_M_S2, &free);
        Self::of(humanoid, &explainer, &free)
    }

    pub(super) fn of(humanoid: &Humanoid, explainer: &Explainer<'_>, free: &ExplanationSettings) -> Self {
        let gated = ExplanationSettings { contact_speed_m_s: GATE_M_S, ..*free };
        let (frames, gated_frames) = (explainer.explain(free), explainer.explain(&gated));
        let limits = limits_in_kit_order(humanoid);
        let steady = explainer.steady_frames(free);
        let frames = explainer
            .explained_frames
            .iter()
            .zip(frames.iter().zip(&gated_frames))
            .zip(&explainer.wanted)
            .map(|((&frame, (explained, gated)), wanted)| {
                let in_flight = explainer.carrying(frame, free).is_empty();
                let loads = Loads::new(humanoid, explainer, frame, explained, &limits);
                InverseFrame {
                    frame,
                    is_steady: steady.contains(&frame),
                    force_n: explained.residual_force_n.norm(),
                    moment_nm: explained.residual_moment_nm.norm(),
                    gated_force_n: gated.residual_force_n.norm(),
                    gated_moment_nm: gated.residual_moment_nm.norm(),
                    ground_force_n: explained.contact_forces_n.iter().sum::<nalgebra::Vector3<f64>>().norm(),
                    com_height_m: humanoid.robot.tree.center_of_mass(&explainer.poses[frame]).z,
                    flight_error_m_s2: in_flight.then(|| wanted.force_n.norm() / humanoid.body.mass_kg),
                    torque_share: loads.num_torques as f64 / NUM_JOINTS as f64,
                    power_share: loads.num_powers as f64 / NUM_JOINTS as f64,
                    torque_peak: loads.torque_peak,
                    power_peak_w: loads.power_peak_w,
                }
            })
            .collect();
        Self { frames, weight_n: explainer.weight_n(), height_m: humanoid.body.height_m }
    }

    /// Scores over the explained frames among these frames of the motion.
    pub(super) fn scores(&self, humanoid: &Humanoid, range: &Range<usize>) -> Vec<Score> {
        let all: Vec<&InverseFrame> =
            self.frames.iter().filter(|frame| range.contains(&frame.frame)).collect();
        let steady: Vec<&InverseFrame> = all.iter().copied().filter(|frame| frame.is_steady).collect();
        let force = |value: f64| value / self.weight_n * PERCENT;
        let moment = |value: f64| value / (self.weight_n * self.height_m) * PERCENT;
        let over = |value: fn(&InverseFrame) -> f64| mean(steady.iter().map(|frame| value(frame)));
        let largest =
            |value: fn(&InverseFrame) -> f64| steady.iter().map(|frame| value(frame)).max_by(f64::total_cmp);

        let mut sorted: Vec<f64> = steady.iter().map(|frame| frame.force_n).collect();
        sorted.sort_by(f64::total_cmp);
        let p95 = sorted.get((sorted.len() * 95).div_ceil(100).saturating_sub(1)).copied();
        let edges = mean(all.iter().filter(|frame| !frame.is_steady).map(|frame| frame.force_n));
        let in_flight = || steady.iter().filter_map(|frame| frame.flight_error_m_s2);
        let mut scores: Vec<Score> = [
            (&FORCE_MEAN, over(|frame| frame.force_n).map(force)),
            (&FORCE_P95, p95.map(force)),
            (&FORCE_GATED, over(|frame| frame.gated_force_n).map(force)),
            (&FORCE_EDGES, edges.map(force)),
            (&EDGE_SHARE, mean(all.iter().map(|frame| f64::from(!frame.is_steady)))),
            (&MOMENT_MEAN, over(|frame| frame.moment_nm).map(moment)),
            (&MOMENT_GATED, over(|frame| frame.gated_moment_nm).map(moment)),
            (&TORQUE_LIMIT_SHARE, over(|frame| frame.torque_share)),
            (&TORQUE_PEAK, largest(|frame| frame.torque_peak)),
            (&POWER_LIMIT_SHARE, over(|frame| frame.power_share)),
            (&POWER_PEAK, largest(|frame| frame.power_peak_w).map(|watts| watts / humanoid.body.mass_kg)),
            (&FLIGHT_SHARE, over(|frame| f64::from(frame.flight_error_m_s2.is_some()))),
            (&FLIGHT_ERROR, mean(in_flight())),
        ]
        .into_iter()
        .filter_map(|(metric, value)| Score::new(metric, value?))
        .collect();
        scores.extend(thresholds::scores(&steady));
        scores
    }
}

/// Torques and powers of one frame against their limits.
struct Loads {
    num_torques: usize,
    num_powers: usize,
    torque_peak: f64,
    power_peak_w: f64,
}

impl Loads {
    fn new(
        humanoid: &Humanoid,
        explainer: &Explainer<'_>,
        frame: usize,
        explained: &ExplainedFrame,
        limits: &[JointLimits; NUM_JOINTS],
    ) -> Self {
        let mut loads = Self { num_torques: 0, num_powers: 0, torque_peak: 0.0, power_peak_w: 0.0 };
        for (angle, &kit) in humanoid.kit_of_angle().iter().enumerate() {
            let (limit, torque_nm) = (&limits[kit], explained.torques_nm[kit]);
            let power_w = (torque_nm * explainer.trajectory.frames[frame].speeds_rad_s[angle]).abs();
            let power_limit_w = POWER_SHARE * limit.effort_nm * limit.velocity_rad_s;
            loads.num_torques += usize::from(torque_nm.abs() >= AT_LIMIT * limit.effort_nm);
            loads.num_powers += usize::from(power_w >= AT_LIMIT * power_limit_w);
            loads.torque_peak = loads.torque_peak.max(torque_nm.abs() / limit.effort_nm);
            loads.power_peak_w = loads.power_peak_w.max(power_w);
        }
        loads
    }
}
