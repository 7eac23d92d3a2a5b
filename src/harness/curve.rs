//! Runs motions under one condition made harder and harder, against an undisturbed control arm.
//!
//! In: a [`Source`], [`RunSettings`], [`CurveSettings`]. Out: a [`Curve`].
//! Everything random (when and whither a push goes, how the body is placed at the start) is drawn from the seed, the motion
//! and the number of the draw alone: all magnitudes, the control among them, meet the same draws.

use std::panic::{AssertUnwindSafe, catch_unwind};

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{HarnessError, RunSettings, Selection, Source, run_key};
use crate::humanoid::Humanoid;
use crate::manifest::{SkippedInput, sha256_hex};
use crate::motion::NUM_JOINTS;
use crate::plausibility::rollout_scores;
use crate::report::{Curve, CurveRollout, SplitMix64};
use crate::simulation::{Conditions, EventKind, Level, Outcome, Push, Simulation};

/// What is made harder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// The largest assist force, % of body weight. Less is harder; nothing is drawn.
    Assist,
    /// A push at the pelvis in a drawn horizontal direction at a drawn time, N s within 0.1 s.
    Push,
    /// Friction between sole and ground, as a factor.
    Friction,
    /// Mass and inertia of every segment, as a factor that springs and feed-forward do not know.
    Mass,
    /// Time by which the joints' commands come late, milliseconds.
    Latency,
}

/// Duration of a push, seconds.
const PUSH_SECS: f64 = 0.1;
/// Part of the motion in which a push may start.
const PUSH_BETWEEN: [f64; 2] = [0.1, 0.8];
/// Largest drawn offset of a joint angle at the start, radians.
const START_OFFSET_RAD: f64 = 0.01;

impl Condition {
    /// Every condition.
    pub const ALL: [Self; 5] = [Self::Assist, Self::Push, Self::Friction, Self::Mass, Self::Latency];

    /// Name for command lines and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Assist => "assist",
            Self::Push => "push",
            Self::Friction => "friction",
            Self::Mass => "mass",
            Self::Latency => "latency",
        }
    }

    /// Magnitudes that show where bodies start to fall.
    #[must_use]
    pub fn default_magnitudes(self) -> &'static [f64] {
        match self {
            Self::Assist => &[0.0, 5.0, 10.0, 15.0, 20.0, 40.0],
            Self::Push => &[0.0, 10.0, 20.0, 30.0, 45.0, 60.0],
            Self::Friction => &[1.0, 0.5, 0.25, 0.125, 0.0625],
            Self::Mass => &[0.7, 0.85, 1.0, 1.15, 1.3, 1.5],
            Self::Latency => &[0.0, 10.0, 20.0, 40.0, 60.0, 80.0],
        }
    }

    /// Magnitude of the control arm.
    fn control(self) -> Option<f64> {
        match self {
            Self::Assist => None,
            Self::Push | Self::Latency => Some(0.0),
            Self::Friction | Self::Mass => Some(1.0),
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Assist => "What the assist is worth",
            Self::Push => "Pushes of 0.1 s at the pelvis",
            Self::Friction => "Friction between sole and ground",
            Self::Mass => "Mass the controller does not know",
            Self::Latency => "Latency of the joint commands",
        }
    }

    fn magnitude(self) -> &'static str {
        match self {
            Self::Assist => "assist limit, % BW",
            Self::Push => "push, N s",
            Self::Friction => "friction, times the setting",
            Self::Mass => "mass, times the body's",
            Self::Latency => "latency, ms",
        }
    }

    /// Largest magnitude that means anything.
    fn largest(self) -> f64 {
        match self {
            Self::Assist | Self::Push => 10_000.0,
            Self::Friction | Self::Mass => 10.0,
            Self::Latency => 1000.0,
        }
    }
}

/// One curve to run.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveSettings {
    /// What is made harder.
    pub condition: Condition,
    /// How hard; see [`Condition`] for the units. The control arm is added where it is missing.
    pub magnitudes: Vec<f64>,
    /// Draws of everything random for each motion, at least one; the assist has none.
    pub num_draws: usize,
    /// [`Level::L2`] or [`Level::L3`]; the assist acts at L2 only.
    pub level: Level,
}

impl CurveSettings {
    /// A magnitude that means nothing, if any.
    #[must_use]
    pub fn bad_magnitude(&self) -> Option<f64> {
        let smallest = if self.condition == Condition::Mass { 0.01 } else { 0.0 };
        let range = smallest..=self.condition.largest();
        self.magnitudes.iter().copied().find(|magnitude| !range.contains(magnitude))
    }
}

/// Runs a curve; `observe` hears of every finished motion from the worker threads.
///
/// A motion that cannot be read or prepared is skipped and named in the second part of the answer.
///
/// # Errors
/// [`HarnessError::Threads`] before any work.
pub fn run_curve(
    source: &dyn Source,
    selection: &Selection,
    settings: &RunSettings,
    curve: &CurveSettings,
    threads: usize,
    observe: &(dyn Fn(&str) + Sync),
) -> Result<(Curve, Vec<SkippedInput>), HarnessError> {
    let Selection { indices, mut skipped } = selection.clone();
    let control = curve.condition.control();
    let mut magnitudes: Vec<f64> = curve.magnitudes.iter().copied().chain(control).collect();
    magnitudes.sort_by(f64::total_cmp);
    magnitudes.dedup();
    let curve = CurveSettings { magnitudes, ..curve.clone() };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| HarnessError::Threads { threads, reason: error.to_string() })?;
    let finished: Vec<Result<Vec<CurveRollout>, SkippedInput>> = pool.install(|| {
        let run = |&index: &usize| {
            let id = source.ids().swap_remove(index);
            let rollouts = catch_unwind(AssertUnwindSafe(|| run_motion(source, settings, &curve, index)));
            observe(&id);
            rollouts.unwrap_or_else(|_| {
                let reason = "panicked while it was simulated".to_owned();
                Err(SkippedInput { id, source: source.name(), reason })
            })
        };
        indices.par_iter().with_max_len(1).map(run).collect()
    });
    let mut rollouts = Vec::new();
    for motion in finished {
        match motion {
            Ok(all) => rollouts.extend(all),
            Err(input) => skipped.push(input),
        }
    }
    let curve = Curve {
        title: format!("{} ({})", curve.condition.title(), curve.level),
        magnitude: curve.condition.magnitude().to_owned(),
        control,
        key: run_key(settings),
        dataset: source.name(),
        seed: settings.seed,
        rollouts,
    };
    Ok((curve, skipped))
}

fn run_motion(
    source: &dyn Source,
    settings: &RunSettings,
    curve: &CurveSettings,
    index: usize,
) -> Result<Vec<CurveRollout>, SkippedInput> {
    let sample = source.load(index)?;
    let refuse = |reason: String| SkippedInput {
        id: sample.id.clone(),
        source: sample.source.display().to_string(),
        reason,
    };
    let humanoid = Humanoid::new(sample.motion.body()).map_err(|error| refuse(error.to_string()))?;
    let simulation = Simulation::new(&humanoid, &sample.motion, &settings.simulation)
        .map_err(|error| refuse(error.to_string()))?;
    let num_draws = if curve.condition == Condition::Assist { 1 } else { curve.num_draws };
    let mut rollouts = Vec::with_capacity(num_draws * curve.magnitudes.len());
    for draw in 0..num_draws {
        for &magnitude in &curve.magnitudes {
            let conditions = Draw::new(settings.seed, &sample.id, draw).conditions(
                &simulation.undisturbed(),
                curve.condition,
                magnitude,
                sample.motion.duration_secs(),
            );
            let rollout = simulation
                .run_under(curve.level, &conditions, &mut ())
                .map_err(|error| refuse(error.to_string()))?;
            let failed = match &rollout.outcome {
                Outcome::Completed => None,
                Outcome::Failed { time_secs, .. } => Some(*time_secs),
            };
            let fall = rollout.events.iter().find(|event| event.kind == EventKind::Fall);
            let end_secs = fall.map(|event| event.time_secs).or(failed);
            let scores = rollout_scores(&humanoid, &rollout);
            let score = |name: &str| {
                let key = format!("{}/{name}", curve.level.to_string().to_lowercase());
                scores.iter().find(|score| score.metric.key == key).map(|score| score.value)
            };
            rollouts.push(CurveRollout {
                case: sample.id.clone(),
                draw,
                magnitude,
                survived: end_secs.is_none(),
                failed: failed.is_some(),
                end_secs,
                mpjpe_root_mm: score("mpjpe_root"),
                assist_percent: score("assist_mean"),
            });
        }
    }
    Ok(rollouts)
}

/// Everything random in the rollouts of one draw.
struct Draw {
    /// Direction of a push, radians from the world's x axis.
    direction_rad: f64,
    /// Start of a push as a share of the motion.
    push_at: f64,
    offsets_rad: [f64; NUM_JOINTS],
}

impl Draw {
    fn new(seed: u64, id: &str, draw: usize) -> Self {
        let digest = sha256_hex(format!("{seed} {draw} {id}").as_bytes());
        // Sixteen hexadecimal digits are 64 bits.
        let mut random = SplitMix64(u64::from_str_radix(&digest[..16], 16).unwrap_or(seed));
        let direction_rad = std::f64::consts::TAU * random.share();
        let push_at = PUSH_BETWEEN[0] + (PUSH_BETWEEN[1] - PUSH_BETWEEN[0]) * random.share();
        let offsets_rad = std::array::from_fn(|_| START_OFFSET_RAD * (2.0 * random.share() - 1.0));
        Self { direction_rad, push_at, offsets_rad }
    }

    fn conditions(
        &self,
        undisturbed: &Conditions,
        condition: Condition,
        magnitude: f64,
        duration_secs: f64,
    ) -> Conditions {
        let start_offsets_rad = Some(self.offsets_rad);
        match condition {
            Condition::Assist => Conditions { assist_limit: magnitude / 100.0, ..undisturbed.clone() },
            Condition::Push => {
                let (sin, cos) = self.direction_rad.sin_cos();
                let push = Push {
                    time_secs: self.push_at * duration_secs,
                    duration_secs: PUSH_SECS,
                    force_n: Vector3::new(cos, sin, 0.0) * (magnitude / PUSH_SECS),
                };
                Conditions { push: Some(push), start_offsets_rad, ..undisturbed.clone() }
            }
            Condition::Friction => {
                Conditions { friction_factor: magnitude, start_offsets_rad, ..undisturbed.clone() }
            }
            Condition::Mass => {
                Conditions { mass_factor: magnitude, start_offsets_rad, ..undisturbed.clone() }
            }
            Condition::Latency => {
                Conditions { latency_secs: magnitude / 1000.0, start_offsets_rad, ..undisturbed.clone() }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Dataset;

    /// A person who waves, standing.
    const STANDING: &str = "90006";

    fn run(condition: Condition, magnitudes: &[f64], threads: usize) -> Curve {
        let dataset = Dataset::bundled();
        let curve =
            CurveSettings { condition, magnitudes: magnitudes.to_vec(), num_draws: 2, level: Level::L2 };
        let settings = RunSettings { ids: vec![STANDING.to_owned()], ..RunSettings::default() };
        let source = ("bundled", &dataset);
        let selection = Selection::of(&source, &settings.ids, None).unwrap();
        let (curve, skipped) = run_curve(&source, &selection, &settings, &curve, threads, &|_| ()).unwrap();
        assert!(skipped.is_empty(), "{skipped:?}");
        curve
    }

    #[test]
    fn a_hard_push_fells_a_body_that_stands_without() {
        let curve = run(Condition::Push, &[300.0], 1);
        let points = curve.points();
        assert_eq!(points.len(), 2, "the control arm is added");
        assert_eq!((points[0].num_survived, points[0].num_rollouts), (2, 2));
        assert_eq!(points[1].lost_and_won, Some((2, 0)));
        assert_eq!(run(Condition::Push, &[300.0], 2), curve, "threads change nothing");
    }

    #[test]
    fn draws_differ_and_magnitudes_share_them() {
        let draw = |id: &str, index| Draw::new(7, id, index);
        assert_ne!(draw("a", 0).direction_rad, draw("a", 1).direction_rad);
        assert_ne!(draw("a", 0).direction_rad, draw("b", 0).direction_rad);
        assert_eq!(draw("a", 0).offsets_rad, draw("a", 0).offsets_rad);
    }

    #[test]
    fn magnitudes_have_bounds() {
        let curve = |condition, magnitude| CurveSettings {
            condition,
            magnitudes: vec![magnitude],
            num_draws: 1,
            level: Level::L2,
        };
        assert_eq!(curve(Condition::Mass, 0.0).bad_magnitude(), Some(0.0));
        assert!(curve(Condition::Push, f64::NAN).bad_magnitude().is_some_and(f64::is_nan));
        for condition in Condition::ALL {
            let defaults = condition.default_magnitudes().to_vec();
            assert_eq!(CurveSettings { magnitudes: defaults, ..curve(condition, 1.0) }.bad_magnitude(), None);
        }
    }
}
