//! Any motion capture as a motion of the humanoid: 44 joint angles and a root.
//!
//! In: a [`Clip`] and the [`Correspondence`] of its skeleton, found by the names of its joints or given by the user.
//! Out: a [`Motion`] of a body as tall as the source's, and its [`Quality`].
//! Nothing is read from files here, and physics is not consulted.

mod arm;
mod bones;
mod correspondence;
mod floor;
mod footing;
mod hold;
mod library;
mod low_pass;
mod quality;
mod rest;
mod role;
mod size;
mod solver;
mod source;
mod stance;
mod target;
mod track;

pub use correspondence::{AxisVector, Correspondence, CorrespondenceError, OneOrMore, Orientation};
pub use library::{UnknownSkeleton, bundled, recognise};
pub use quality::{BoneError, JointResidual, Quality};
pub use role::{NUM_ROLES, Role, Segment};

use crate::humanoid::{Humanoid, Side};
use crate::mocap::Clip;
use crate::motion::{Body, Frame, JOINTS, Jump, Motion, MotionError, NUM_JOINTS};
use crate::robot::RobotError;
use size::Proportions;
use solver::Pose;
use source::Source;
use target::Plan;

/// Median residual at our proportions above which a clip does not fit, metres.
pub const LARGEST_RESIDUAL_M: f64 = 0.08;

/// What the file leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RetargetOptions {
    /// Frames per second; goes before that of the file.
    pub rate_hz: Option<f64>,
    /// Body height in metres; goes before that of the skeleton.
    pub height_m: Option<f64>,
    /// Body mass in kilograms instead of 22.5 kg/m^2.
    pub mass_kg: Option<f64>,
}

/// A clip as a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Retargeted {
    /// The motion, at the rate of the clip.
    pub motion: Motion,
    /// How well it follows the source.
    pub quality: Quality,
    /// Name of the correspondence.
    pub skeleton: String,
    /// What was assumed or changed, as sentences for a person.
    pub notes: Vec<String>,
}

/// Why a clip cannot be retargeted.
#[derive(Debug, thiserror::Error)]
pub enum RetargetError {
    /// The skeleton is unknown.
    #[error(transparent)]
    Unknown(#[from] UnknownSkeleton),
    /// The correspondence names joints that the clip lacks.
    #[error("the skeleton {skeleton} needs joints that are not there: {}", .joints.join(", "))]
    MissingJoints {
        /// Name of the correspondence.
        skeleton: String,
        /// Names of the joints.
        joints: Vec<String>,
    },
    /// Neither file nor user says a rate.
    #[error("the file states no rate; give one")]
    NoRate,
    /// The joints of legs or trunk coincide.
    #[error("the joints lie in one place, which makes no body")]
    NoBody,
    /// A body of impossible size.
    #[error(
        "the skeleton {skeleton} would make a body {height_m:.3} m tall, expected 1.2 to 2.2 m: \
         state its length unit with unit_m in a correspondence file"
    )]
    Size {
        /// Height found with the first unit, metres.
        height_m: f64,
        /// Name of the correspondence.
        skeleton: String,
    },
    /// The humanoid cannot follow.
    #[error(
        "the median joint is {:.0} mm from where the source has it, more than the {:.0} mm accepted: \
         does the correspondence fit?", 1e3 * .residual_m, 1e3 * LARGEST_RESIDUAL_M
    )]
    Residual {
        /// Median residual at our proportions, metres.
        residual_m: f64,
    },
    /// The body's numbers give no robot.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The result is no motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// Makes a motion of a clip whose skeleton is known.
///
/// # Errors
/// [`RetargetError`] says what does not fit.
pub fn retarget(
    clip: &Clip,
    correspondence: &Correspondence,
    options: &RetargetOptions,
) -> Result<Retargeted, RetargetError> {
    let mut notes = Vec::new();
    let rate_hz = if let Some(rate_hz) = options.rate_hz.or(clip.rate_hz()) {
        rate_hz
    } else {
        let rate_hz = correspondence.rate_hz.ok_or(RetargetError::NoRate)?;
        notes.push(format!("no rate is given; {rate_hz} Hz is assumed, as {} has it", correspondence.name));
        rate_hz
    };
    if !crate::motion::bounds::RATE_HZ.contains(&rate_hz) {
        return Err(MotionError::Rate { found: rate_hz }.into());
    }
    // Proportions are the same for every height.
    let proportions = Proportions::of(&Humanoid::new(Body::with_default_mass(1.75))?);
    let source = Source::new(clip, correspondence, &proportions, rate_hz, options.height_m)?;
    let mut body = Body::with_default_mass(source.height_m);
    body.mass_kg = options.mass_kg.unwrap_or(body.mass_kg);
    let humanoid = Humanoid::new(body)?;
    let plan = Plan::new(&humanoid, &source, correspondence, &proportions);
    let Attempt { motion, jumps, quality, led, .. } = best_attempt(&humanoid, &source, &plan)?;
    notes.extend(led.into_iter().map(led_note));
    if let Some(note) = jump_note(&jumps) {
        notes.push(note);
    }
    if quality.pose_median_m.is_nan() || quality.pose_median_m > LARGEST_RESIDUAL_M {
        return Err(RetargetError::Residual { residual_m: quality.pose_median_m });
    }
    notes.extend(source.notes);
    notes.extend(plan.footing.notes.iter().cloned());
    Ok(Retargeted { motion, quality, skeleton: correspondence.name.clone(), notes })
}

/// A clip solved one way.
struct Attempt {
    poses: Vec<Pose>,
    motion: Motion,
    jumps: Vec<Jump>,
    quality: Quality,
    /// Sides whose arms were led.
    led: Vec<Side>,
}

impl Attempt {
    fn new(humanoid: &Humanoid, source: &Source, plan: &Plan, poses: Vec<Pose>) -> Result<Self, MotionError> {
        // An arm that circles changes sides somewhere (see `track`): the change is spread over some frames.
        let (motion, jumps) = crate::motion::filter_jumps(&motion_of(humanoid, &poses, source.rate_hz)?);
        let quality = Quality::of(humanoid, &motion, source, plan);
        Ok(Self { poses, motion, jumps, quality, led: Vec::new() })
    }

    fn num_flipped(&self) -> usize {
        self.quality.flipped.len()
    }

    /// Sides whose arms are flipped.
    fn flipped_arms(&self) -> Vec<Side> {
        let is_flipped = |side: &str| {
            self.quality.flipped.iter().any(|bone| bone.starts_with(side) && bone.ends_with("arm"))
        };
        let sides = [("left", Side::Left), ("right", Side::Right)];
        sides.into_iter().filter(|(name, _)| is_flipped(name)).map(|(_, side)| side).collect()
    }
}

/// The first attempt without a flipped limb, or that with the fewest. Where none is without, arms that are flipped are led.
fn best_attempt(humanoid: &Humanoid, source: &Source, plan: &Plan) -> Result<Attempt, MotionError> {
    let mut best: Option<Attempt> = None;
    for worthwhile in track::Worthwhile::ALL {
        let mut plan = plan.clone();
        let poses = track::track(humanoid, source, &mut plan, worthwhile);
        let attempt = Attempt::new(humanoid, source, &plan, poses)?;
        let done = attempt.num_flipped() == 0;
        if best.as_ref().is_none_or(|best| attempt.num_flipped() < best.num_flipped()) {
            best = Some(attempt);
        }
        if done {
            break;
        }
    }
    let best = best.ok_or(MotionError::Empty)?;
    let sides = best.flipped_arms();
    if sides.is_empty() {
        return Ok(best);
    }
    let (mut plan, mut poses) = (plan.clone(), best.poses.clone());
    if track::track_led(humanoid, source, &mut plan, &sides, &mut poses) {
        let led = Attempt::new(humanoid, source, &plan, poses)?;
        if led.num_flipped() < best.num_flipped() {
            return Ok(Attempt { led: sides, ..led });
        }
    }
    Ok(best)
}

fn led_note(side: Side) -> String {
    let name = if side == Side::Left { "left" } else { "right" };
    format!(
        "the {name} arm bends as ours does not and would flip; it is led along the way that follows best over the whole clip"
    )
}

/// How many jumps were spread, and where most of them were.
fn jump_note(jumps: &[Jump]) -> Option<String> {
    let mut counts = [0_usize; NUM_JOINTS];
    for jump in jumps {
        counts[jump.joint] += 1;
    }
    let (joint, most) = counts.iter().enumerate().max_by_key(|(_, count)| **count)?;
    (*most > 0).then(|| {
        format!(
            "{} jumps of a joint between two frames were spread, {most} of them in {}: limits leave no way round",
            jumps.len(),
            JOINTS[joint].short_name()
        )
    })
}

/// Angles in KIT order, and a root whose roll, pitch and yaw change without turns.
fn motion_of(humanoid: &Humanoid, poses: &[Pose], rate_hz: f64) -> Result<Motion, MotionError> {
    let mut frames: Vec<Frame> = Vec::with_capacity(poses.len());
    for pose in poses {
        let mut frame = Frame::ZERO;
        for (angle, &kit) in humanoid.kit_of_angle().iter().enumerate() {
            frame.joint_angles_rad[kit] = pose.angles[angle];
        }
        debug_assert_eq!(pose.angles.len(), NUM_JOINTS);
        frame.set_world_from_root(&pose.root);
        if let Some(before) = frames.last() {
            frame.root_rotation_rad =
                crate::motion::closest_turns(frame.root_rotation_rad, before.root_rotation_rad);
        }
        frames.push(frame);
    }
    Motion::new(humanoid.body, rate_hz, frames)
}
