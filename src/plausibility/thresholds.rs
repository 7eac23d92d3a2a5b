//! Level 1, the residual against the thresholds of the musculoskeletal field.

use super::inverse::{InverseFrame, RESIDUAL};
use super::metric::{Better, Metric, Score};
use super::trace::mean;
use crate::simulation::Level;

/// Largest residual force of a good simulation as a share of the largest net external force.
const HICKS_FORCE: f64 = 0.05;
/// Largest residual moment of a good simulation as a share of mean height of the centre of mass times that force.
const HICKS_MOMENT: f64 = 0.01;
/// Good and okay residuals: force max and rms, N, moment max and rms, N m.
const OPENSIM_GOOD: [f64; 4] = [10.0, 5.0, 50.0, 30.0];
const OPENSIM_OKAY: [f64; 4] = [25.0, 10.0, 75.0, 50.0];
const PERCENT: f64 = 100.0;

const HICKS: &str = "Hicks et al. 2015, J Biomech Eng 137:020905: residual forces below 5 % of the net external force, residual \
                     moments below 1 % of centre-of-mass height times that force";
const OPENSIM: &str = "OpenSim's guide to residual reduction: force max 0-10 N good, 10-25 N okay, rms 0-5 and 5-10 N; moment max \
                       0-50 N m good, 50-75 okay, rms 0-30 and 30-50; made for tracked experiments with force plates";

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "N",
    level: Level::L1,
    better: Better::Lower,
    formula: "",
    empty: "the static residual of one frame",
    reference: RESIDUAL,
    signature: "filter:butterworth4-6Hz|edges:out|rate:50Hz|mu:0.8|h:35mm|gate:none|solver:clarabel-soc|v:1",
};

/// Largest residual force.
pub(super) static FORCE_MAX: Metric = Metric {
    key: "l1/residual_force_max",
    title: "residual force max",
    formula: "max over frames of |residual force at the root|, as l1/residual_force",
    ..SHARED
};

/// Root mean square residual force.
pub(super) static FORCE_RMS: Metric = Metric {
    key: "l1/residual_force_rms",
    title: "residual force rms",
    formula: "root mean square over frames of |residual force at the root|, as l1/residual_force",
    ..SHARED
};

/// Largest residual moment.
pub(super) static MOMENT_MAX: Metric = Metric {
    key: "l1/residual_moment_max",
    title: "residual moment max",
    unit: "N m",
    formula: "max over frames of |residual moment about the root|, as l1/residual_force",
    ..SHARED
};

/// Root mean square residual moment.
pub(super) static MOMENT_RMS: Metric = Metric {
    key: "l1/residual_moment_rms",
    title: "residual moment rms",
    unit: "N m",
    formula: "root mean square over frames of |residual moment about the root|, as l1/residual_force",
    ..SHARED
};

/// Residual force against the net external force.
pub(super) static HICKS_FORCE_SHARE: Metric = Metric {
    key: "l1/hicks_force",
    title: "Hicks force",
    unit: "%",
    formula: "100 * largest residual force / largest ground force found; 5 % is the threshold",
    reference: HICKS,
    empty: "absent when the ground never pushes",
    ..SHARED
};

/// Residual moment against the net external force times height.
pub(super) static HICKS_MOMENT_SHARE: Metric = Metric {
    key: "l1/hicks_moment",
    title: "Hicks moment",
    unit: "%",
    formula: "100 * largest residual moment / (mean height of the centre of mass * largest ground force found); 1 % is the \
              threshold",
    reference: HICKS,
    empty: "absent when the ground never pushes",
    ..SHARED
};

/// Whether both thresholds of Hicks et al. hold.
pub(super) static HICKS_PASS: Metric = Metric {
    key: "l1/hicks_pass",
    title: "Hicks pass",
    unit: "",
    better: Better::Higher,
    formula: "1 when l1/hicks_force < 5 % and l1/hicks_moment < 1 %, else 0; one bad frame fails a motion",
    reference: HICKS,
    empty: "0 when the ground never pushes",
    ..SHARED
};

/// Grade of the residual by OpenSim's guide.
pub(super) static OPENSIM_GRADE: Metric = Metric {
    key: "l1/opensim_grade",
    title: "OpenSim grade",
    unit: "",
    better: Better::Higher,
    formula: "2 good, 1 okay, 0 bad: the worst of force max and rms and moment max and rms",
    reference: OPENSIM,
    ..SHARED
};

pub(super) fn scores(frames: &[&InverseFrame]) -> Vec<Score> {
    let largest =
        |value: fn(&InverseFrame) -> f64| frames.iter().map(|frame| value(frame)).max_by(f64::total_cmp);
    let rms = |value: fn(&InverseFrame) -> f64| {
        mean(frames.iter().map(|frame| value(frame).powi(2))).map(f64::sqrt)
    };
    let force: fn(&InverseFrame) -> f64 = |frame| frame.force_n;
    let moment: fn(&InverseFrame) -> f64 = |frame| frame.moment_nm;
    let (Some(force_max), Some(force_rms), Some(moment_max), Some(moment_rms)) =
        (largest(force), rms(force), largest(moment), rms(moment))
    else {
        return Vec::new();
    };
    let external_n = largest(|frame| frame.ground_force_n).filter(|force| *force > 0.0);
    let height_m = mean(frames.iter().map(|frame| frame.com_height_m));
    let hicks_force = external_n.map(|external| force_max / external);
    let hicks_moment = external_n.zip(height_m).map(|(external, height)| moment_max / (external * height));
    let passes = hicks_force.is_some_and(|share| share < HICKS_FORCE)
        && hicks_moment.is_some_and(|share| share.abs() < HICKS_MOMENT);
    let found = [force_max, force_rms, moment_max, moment_rms];
    let within = |limits: [f64; 4]| found.iter().zip(limits).all(|(found, limit)| *found <= limit);
    let grade = if within(OPENSIM_GOOD) {
        2.0
    } else if within(OPENSIM_OKAY) {
        1.0
    } else {
        0.0
    };
    [
        (&FORCE_MAX, Some(force_max)),
        (&FORCE_RMS, Some(force_rms)),
        (&MOMENT_MAX, Some(moment_max)),
        (&MOMENT_RMS, Some(moment_rms)),
        (&HICKS_FORCE_SHARE, hicks_force.map(|share| share * PERCENT)),
        (&HICKS_MOMENT_SHARE, hicks_moment.map(|share| share * PERCENT)),
        (&HICKS_PASS, Some(f64::from(u8::from(passes)))),
        (&OPENSIM_GRADE, Some(grade)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}
