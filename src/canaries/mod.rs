//! Canaries: faults put into clean motions, and which metric sees which.
//!
//! In: clean motions. Out: a [`Report`], the matrix of metrics and faults with what was required of it.
//! A metric that does not see the fault it is meant for is useless, and so is one that sees faults that are not there; both
//! are required here, and both can fail.
//!
//! Levels 0 and 1 are compared over windows of one second, level 2 over whole motions.
//! A cell holds two numbers: the area under the ROC curve over all windows (or motions), and the share of motions whose mean
//! grew with the fault.

mod fault;
mod requirement;
mod roc;

pub use fault::{Fault, Scope};
pub use requirement::{Kind, Requirement, Verdict, requirements};

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

use crate::humanoid::Humanoid;
use crate::motion::{Motion, MotionError};
use crate::plausibility::{METRICS, Metric, Score, inverse_windows, kinematic_windows, rollout_scores};
use crate::robot::RobotError;
use crate::simulation::{Level, Simulation, SimulationError, SimulationSettings};

/// Length of a window, seconds.
pub const WINDOW_SECS: f64 = 1.0;
/// Mean speed of the joint centres from which on a body moves, m/s (as `l0/dynamic_degree`).
const MOVING_M_S: f64 = 0.05;
/// Way of the root in a window from which on a body travels, metres.
const TRAVELLING_M: f64 = 0.2;
/// Distance between the first and the last place of the root from which on a motion is one of locomotion, metres.
const LOCOMOTION_M: f64 = 1.0;

/// A clean motion.
#[derive(Debug, Clone)]
pub struct Clip {
    /// Its name in the report.
    pub id: String,
    /// The motion.
    pub motion: Motion,
}

/// Why a motion cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CanaryError {
    /// The body is no robot.
    #[error("{id}: {source}")]
    Robot {
        /// The motion.
        id: String,
        /// Why.
        source: RobotError,
    },
    /// A fault leaves the bounds of a motion.
    #[error("{id} with the fault {fault}: {source}", fault = .fault.name())]
    Fault {
        /// The motion.
        id: String,
        /// The fault.
        fault: Fault,
        /// Why.
        source: MotionError,
    },
    /// The motion cannot be simulated.
    #[error("{id}: {source}")]
    Simulation {
        /// The motion.
        id: String,
        /// Why.
        source: SimulationError,
    },
}

/// What one metric says about one fault.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// Key of the metric.
    pub metric: &'static str,
    /// The fault.
    pub fault: Fault,
    /// Area under the ROC curve: probability that a faulty window (motion at level 2) has the larger value.
    pub area: f64,
    /// Share of motions whose mean over the windows is larger with the fault, equal ones counting half.
    pub paired: f64,
    /// Number of clean and of faulty values behind the area.
    pub num_values: [usize; 2],
    /// Number of motions behind the pairs.
    pub num_clips: usize,
    /// Number of them whose mean is another one with the fault.
    pub num_changed: usize,
}

/// The matrix and the verdicts on it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Names of the motions.
    pub clips: Vec<String>,
    /// Those of them that go somewhere, which locomotion faults are put into.
    pub locomotion: Vec<String>,
    /// Length of a window, seconds.
    pub window_secs: f64,
    /// Cells by metric, then by fault; without those of metrics that have no value.
    pub cells: Vec<Cell>,
    /// What was required, and whether it held.
    pub verdicts: Vec<Verdict>,
}

impl Report {
    /// The cell of a metric and a fault.
    #[must_use]
    pub fn cell(&self, metric: &str, fault: Fault) -> Option<&Cell> {
        self.cells.iter().find(|cell| cell.metric == metric && cell.fault == fault)
    }

    /// Whether every requirement held.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.verdicts.iter().all(|verdict| verdict.holds)
    }
}

/// Values of one motion, clean or with a fault.
struct Measured {
    /// By metric key, one entry a window; one entry for a metric of level 2.
    values: BTreeMap<&'static str, Vec<Option<f64>>>,
}

/// A clip with everything measured on it.
struct Subject {
    travels: bool,
    clean: Measured,
    /// Whether the clean body moves, and whether it travels, by window.
    windows: Vec<[bool; 2]>,
    faulty: Vec<(Fault, Measured)>,
}

/// Puts every fault into every motion and compares all metrics of levels 0, 1 and, with `rollouts`, 2.
///
/// Faults of locomotion are put into motions that go somewhere only.
/// `observe` is called from worker threads, with the name of each motion that is done.
///
/// # Errors
/// [`CanaryError`] names the motion that cannot be used.
pub fn run(
    clips: &[Clip],
    rollouts: Option<&SimulationSettings>,
    seed: u64,
    observe: &(dyn Fn(&str) + Sync),
) -> Result<Report, CanaryError> {
    let subjects: Vec<Subject> = clips
        .par_iter()
        .with_max_len(1)
        .enumerate()
        .map(|(index, clip)| {
            let subject = subject(clip, rollouts, seed.wrapping_add(index as u64));
            observe(&clip.id);
            subject
        })
        .collect::<Result<_, _>>()?;
    let cells: Vec<Cell> = METRICS
        .iter()
        .flat_map(|metric| Fault::ALL.map(|fault| (*metric, fault)))
        .filter_map(|(metric, fault)| cell(&subjects, metric, fault))
        .collect();
    let names = |wanted: fn(&Subject) -> bool| {
        let kept = clips.iter().zip(&subjects).filter(|(_, subject)| wanted(subject));
        kept.map(|(clip, _)| clip.id.clone()).collect()
    };
    let mut report = Report {
        clips: names(|_| true),
        locomotion: names(|subject| subject.travels),
        window_secs: WINDOW_SECS,
        cells,
        verdicts: Vec::new(),
    };
    report.verdicts = requirement::judge(&report, rollouts.is_some());
    Ok(report)
}

fn subject(clip: &Clip, rollouts: Option<&SimulationSettings>, seed: u64) -> Result<Subject, CanaryError> {
    let humanoid = Humanoid::new(clip.motion.body())
        .map_err(|source| CanaryError::Robot { id: clip.id.clone(), source })?;
    let clip = &whole_windows(clip).map_err(|source| CanaryError::Fault {
        id: clip.id.clone(),
        fault: Fault::TimeReversal,
        source,
    })?;
    let measured = |motion: &Motion| {
        measure(&humanoid, motion, rollouts)
            .map_err(|source| CanaryError::Simulation { id: clip.id.clone(), source })
    };
    let clean = measured(&clip.motion)?;
    let [first, last] = [clip.motion.frames().first(), clip.motion.frames().last()]
        .map(|frame| frame.map_or([0.0; 2], |frame| [frame.root_position_m[0], frame.root_position_m[1]]));
    let travels = (last[0] - first[0]).hypot(last[1] - first[1]) >= LOCOMOTION_M;
    let length = (WINDOW_SECS * clip.motion.rate_hz()).round() as usize;
    let degree = clean.values.get("l0/dynamic_degree").cloned().unwrap_or_default();
    let windows = clip
        .motion
        .frames()
        .chunks_exact(length.max(1))
        .zip(degree)
        .map(|(frames, degree)| {
            let way: f64 = frames
                .windows(2)
                .map(|pair| {
                    let [dx, dy] = [0, 1]
                        .map(|axis: usize| pair[1].root_position_m[axis] - pair[0].root_position_m[axis]);
                    dx.hypot(dy)
                })
                .sum();
            [degree.is_some_and(|degree| degree >= MOVING_M_S), way >= TRAVELLING_M]
        })
        .collect();
    let faulty = Fault::ALL
        .into_iter()
        .filter(|fault| travels || fault.scope() != Scope::Travelling)
        .map(|fault| {
            let motion = fault.inject(&clip.motion, seed).map_err(|source| CanaryError::Fault {
                id: clip.id.clone(),
                fault,
                source,
            })?;
            Ok((fault, measured(&motion)?))
        })
        .collect::<Result<_, CanaryError>>()?;
    Ok(Subject { travels, clean, windows, faulty })
}

/// The clip cut to whole windows and one frame, so that its windows are the same ones played in reverse.
///
/// A clip shorter than a window stays as it is and has no window.
fn whole_windows(clip: &Clip) -> Result<Clip, MotionError> {
    let (motion, length) = (&clip.motion, (WINDOW_SECS * clip.motion.rate_hz()).round() as usize);
    let num_windows = (motion.num_frames() - 1) / length.max(1);
    if num_windows == 0 {
        return Ok(clip.clone());
    }
    let frames = motion.frames()[..=num_windows * length].to_vec();
    Ok(Clip { id: clip.id.clone(), motion: Motion::new(motion.body(), motion.rate_hz(), frames)? })
}

fn measure(
    humanoid: &Humanoid,
    motion: &Motion,
    rollouts: Option<&SimulationSettings>,
) -> Result<Measured, SimulationError> {
    let defaults = SimulationSettings::default();
    let simulation = Simulation::new(humanoid, motion, rollouts.unwrap_or(&defaults))?;
    let mut values: BTreeMap<&'static str, Vec<Option<f64>>> = BTreeMap::new();
    let mut add = |windows: &[Vec<Score>]| {
        for (index, scores) in windows.iter().enumerate() {
            for score in scores {
                let row = values.entry(score.metric.key).or_insert_with(|| vec![None; windows.len()]);
                row[index] = Some(score.value);
            }
        }
    };
    add(&kinematic_windows(humanoid, motion, WINDOW_SECS));
    add(&inverse_windows(humanoid, simulation.reference_motion(), WINDOW_SECS));
    if rollouts.is_some() {
        let rollout = simulation.run(Level::L2, &mut |_| {})?;
        add(&[rollout_scores(humanoid, &rollout)]);
    }
    Ok(Measured { values })
}

/// Smallest difference that counts: solvers and the nine digits of the robot's file give no more.
fn resolution(metric: &Metric) -> f64 {
    if metric.unit.starts_with("mm") { 0.1 } else { 1.0e-3 }
}

fn cell(subjects: &[Subject], metric: &'static Metric, fault: Fault) -> Option<Cell> {
    let level = metric.level;
    let (mut clean, mut faulty, mut pairs) = (Vec::new(), Vec::new(), Vec::new());
    for subject in subjects {
        let Some((_, measured)) = subject.faulty.iter().find(|(of, _)| *of == fault) else { continue };
        let counts = |window: usize| {
            let [moves, travels] = subject.windows.get(window).copied().unwrap_or([false; 2]);
            match fault.scope() {
                _ if level == Level::L2 => true,
                Scope::All => true,
                Scope::Moving => moves,
                Scope::Travelling => travels,
            }
        };
        let kept = |measured: &Measured, counts: &dyn Fn(usize) -> bool| -> Vec<f64> {
            let row = measured.values.get(metric.key).map_or(&[][..], Vec::as_slice);
            row.iter()
                .enumerate()
                .filter(|(window, _)| counts(*window))
                .filter_map(|(_, value)| *value)
                .collect()
        };
        // Reversed and doubled in speed, a window of the faulty motion is another one of the clean motion.
        let there = |window: usize| match fault {
            _ if level == Level::L2 => true,
            Fault::TimeReversal => counts(subject.windows.len().saturating_sub(window + 1)),
            Fault::DoubleSpeed => counts(2 * window) || counts(2 * window + 1),
            _ => counts(window),
        };
        let (here, with) = (kept(&subject.clean, &counts), kept(measured, &there));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        if !here.is_empty() && !with.is_empty() {
            pairs.push((mean(&here), mean(&with)));
        }
        clean.extend(here);
        faulty.extend(with);
    }
    if pairs.is_empty() {
        return None;
    }
    let [larger, smaller] = roc::changed(&pairs, resolution(metric));
    Some(Cell {
        metric: metric.key,
        fault,
        area: roc::area(&clean, &faulty, resolution(metric))?,
        paired: 0.5 + (larger as f64 - smaller as f64) / (2.0 * pairs.len() as f64),
        num_values: [clean.len(), faulty.len()],
        num_clips: pairs.len(),
        num_changed: larger + smaller,
    })
}
