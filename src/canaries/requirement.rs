//! What the matrix must show: responses and silences.

use serde::Serialize;

use super::{Fault, Report};
use crate::plausibility::METRICS;
use crate::simulation::Level;

/// Largest distance of a silent area from one half, over windows.
const SILENT: f64 = 0.10;
/// The same over few values, such as motions or their ends: with 8 on either side, chance alone is 0.15 off (one standard
/// deviation).
const SILENT_FEW: f64 = 0.20;
/// From so many values on, both clean and faulty, an area is not one over few.
const MANY_VALUES: usize = 20;

/// What is required of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The fault makes the value larger: area and pairs at least this.
    Larger {
        /// Least area and pairs.
        least: f64,
    },
    /// The fault makes the value smaller: one less area and pairs at least this.
    Smaller {
        /// Least of one less area and pairs.
        least: f64,
    },
    /// The fault leaves the value alone: the area within this of one half (0.2 where fewer than 20 values make it), or no
    /// motion's mean changed at all.
    Silent {
        /// Largest distance from one half.
        most: f64,
    },
}

/// A requirement on one cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Requirement {
    /// Key of the metric.
    pub metric: &'static str,
    /// The fault.
    pub fault: Fault,
    /// What is required.
    pub kind: Kind,
}

/// A requirement and what came of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Verdict {
    /// What was required.
    pub requirement: Requirement,
    /// Area found; `None` when no motion has the fault and the metric.
    pub area: Option<f64>,
    /// Pairs found.
    pub paired: Option<f64>,
    /// Whether it held. A required response that was not measured does not hold, a silence does.
    pub holds: bool,
}

/// The metric meant for a fault, and how well it must see it.
const RESPONSES: [(&str, Fault, Kind); 12] = [
    ("l0/float", Fault::Float, Kind::Larger { least: 0.99 }),
    ("l1/residual_force", Fault::Float, Kind::Larger { least: 0.99 }),
    ("l0/penetration", Fault::Sink, Kind::Larger { least: 0.99 }),
    ("l0/slowest_contact_speed", Fault::Slide, Kind::Larger { least: 0.99 }),
    ("l1/residual_force_gated", Fault::Slide, Kind::Larger { least: 0.9 }),
    ("l0/jitter", Fault::Jitter, Kind::Larger { least: 0.99 }),
    ("l1/residual_force", Fault::Jitter, Kind::Larger { least: 0.9 }),
    ("l0/zmp_outside", Fault::Lean, Kind::Larger { least: 0.99 }),
    ("l0/dynamic_degree", Fault::Frozen, Kind::Smaller { least: 0.99 }),
    ("l0/zmp_outside", Fault::DoubleSpeed, Kind::Larger { least: 0.95 }),
    ("l1/residual_force_gated", Fault::KneeSwap, Kind::Larger { least: 0.95 }),
    ("l0/heading_speed", Fault::TimeReversal, Kind::Smaller { least: 0.99 }),
];

/// Metrics that a fault leaves alone by construction.
const SILENCES: [(Fault, &[&str]); 6] = [
    (
        Fault::Float,
        &[
            "l0/dynamic_degree",
            "l0/jitter",
            "l0/joint_speed_p95",
            "l0/heading_speed",
            "l0/self_collision_depth",
        ],
    ),
    (
        Fault::Sink,
        &[
            "l0/dynamic_degree",
            "l0/jitter",
            "l0/joint_speed_p95",
            "l0/heading_speed",
            "l0/self_collision_depth",
        ],
    ),
    (
        Fault::Slide,
        &[
            "l0/float",
            "l0/penetration",
            "l0/jitter",
            "l0/joint_speed_p95",
            "l0/com_margin",
            "l1/residual_force",
        ],
    ),
    (
        Fault::Jitter,
        &["l0/joint_speed_p95", "l0/joint_jerk", "l0/joint_limit_share", "l0/self_collision_depth"],
    ),
    (Fault::Lean, &["l0/joint_speed_p95", "l0/joint_jerk", "l0/heading_speed", "l0/self_collision_depth"]),
    (Fault::KneeSwap, &["l0/heading_speed", "l0/root_speed_peak", "l0/root_turn_peak"]),
];

/// Scores of a rollout that contact decides. Inverse dynamics knows no direction of time, but contact does: it brakes a body
/// whichever way it goes, so that a walk played backwards is held up where the walk itself was helped along. With commands that are
/// mirror images in time, `MuJoCo` shows the same drift (`results/canaries.md`); no silence under reversal is required of these.
const DECIDED_BY_CONTACT: [&str; 12] = [
    "l2/assist_impulse",
    "l2/assist_mean",
    "l2/contact_kept",
    "l2/edge_contact",
    "l2/foot_slip",
    "l2/mpjpe_before_fall",
    "l2/mpjpe_world",
    "l2/power_peak",
    "l2/root_position_error",
    "l2/root_rotation_error",
    "l2/trajectory_error",
    "l2/vertical_force_peak",
];

/// Everything required of the matrix; with `rollouts` of level 2 too.
#[must_use]
pub fn requirements(rollouts: bool) -> Vec<Requirement> {
    let responses = RESPONSES.map(|(metric, fault, kind)| Requirement { metric, fault, kind });
    let silences = SILENCES.iter().flat_map(|&(fault, metrics)| {
        metrics.iter().map(move |&metric| Requirement { metric, fault, kind: Kind::Silent { most: SILENT } })
    });
    // Mechanics without contact knows no direction of time, and none knows left and right.
    let controls = METRICS.iter().filter(|metric| rollouts || metric.level != Level::L2).flat_map(|metric| {
        let of = |fault| Requirement { metric: metric.key, fault, kind: Kind::Silent { most: SILENT } };
        let reversible = match metric.level {
            Level::L1 => true,
            Level::L2 => !DECIDED_BY_CONTACT.contains(&metric.key),
            _ => false,
        };
        let reversal = reversible.then(|| of(Fault::TimeReversal));
        reversal.into_iter().chain((metric.level != Level::L3).then(|| of(Fault::Mirror)))
    });
    responses.into_iter().chain(silences).chain(controls).collect()
}

pub(super) fn judge(report: &Report, rollouts: bool) -> Vec<Verdict> {
    requirements(rollouts)
        .into_iter()
        .map(|requirement| {
            let cell = report.cell(requirement.metric, requirement.fault);
            let (area, paired) = (cell.map(|cell| cell.area), cell.map(|cell| cell.paired));
            let holds = match (requirement.kind, cell) {
                (Kind::Larger { least }, Some(cell)) => cell.area >= least && cell.paired >= least,
                (Kind::Smaller { least }, Some(cell)) => {
                    1.0 - cell.area >= least && 1.0 - cell.paired >= least
                }
                (Kind::Silent { most }, Some(cell)) => {
                    let few = cell.num_values.iter().any(|&num| num < MANY_VALUES);
                    let most = if few { most.max(SILENT_FEW) } else { most };
                    (cell.area - 0.5).abs() <= most || cell.num_changed == 0
                }
                (Kind::Silent { .. }, None) => true,
                (Kind::Larger { .. } | Kind::Smaller { .. }, None) => false,
            };
            Verdict { requirement, area, paired, holds }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::Cell;
    use super::*;

    #[test]
    fn requirements_name_metrics_that_exist() {
        for requirement in requirements(true) {
            assert!(crate::plausibility::find_metric(requirement.metric).is_some(), "{}", requirement.metric);
        }
        for metric in DECIDED_BY_CONTACT {
            assert!(crate::plausibility::find_metric(metric).is_some(), "{metric}");
        }
    }

    #[test]
    fn a_blind_metric_and_a_nervous_one_fail() {
        let cell = |metric, fault, area| Cell {
            metric,
            fault,
            area,
            paired: area,
            num_values: if metric == "l0/skate" { [8, 8] } else { [30, 30] },
            num_clips: 3,
            num_changed: 3,
        };
        let mut report = Report {
            clips: Vec::new(),
            locomotion: Vec::new(),
            window_secs: 1.0,
            cells: vec![
                cell("l0/float", Fault::Float, 1.0),
                cell("l0/penetration", Fault::Sink, 0.98),
                cell("l0/dynamic_degree", Fault::Frozen, 0.0),
                cell("l0/jitter", Fault::Mirror, 0.7),
                cell("l0/float", Fault::Mirror, 0.55),
                cell("l0/penetration", Fault::Mirror, 0.65),
                cell("l0/skate", Fault::Mirror, 0.65),
            ],
            verdicts: Vec::new(),
        };
        report.verdicts = judge(&report, false);
        let holds = |metric: &str, fault: Fault| {
            let of = |verdict: &&Verdict| {
                verdict.requirement.metric == metric && verdict.requirement.fault == fault
            };
            report.verdicts.iter().find(of).unwrap().holds
        };
        assert!(holds("l0/float", Fault::Float) && holds("l0/dynamic_degree", Fault::Frozen));
        assert!(!holds("l0/penetration", Fault::Sink), "0.98 is not 0.99");
        assert!(!holds("l0/jitter", Fault::Mirror) && holds("l0/float", Fault::Mirror));
        assert!(
            !holds("l0/penetration", Fault::Mirror) && holds("l0/skate", Fault::Mirror),
            "8 values are few"
        );
        assert!(!holds("l0/jitter", Fault::Jitter), "not measured");
        assert!(!report.passed());
    }
}
