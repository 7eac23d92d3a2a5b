//! Synthesised motions: the bundled suite, made from choreography and published normative values.
//!
//! In: nothing but the numbers written here. Out: [`suite`], motions of the humanoid that keep their balance, and three
//! that break one law of physics each.
//! No recording is used. A choreography says where the feet are, how the body holds itself, how high the centre of mass
//! is and where the ground carries it; the solver finds the frames: the zero-moment point follows its plan including angular
//! momentum, and the legs are solved to the feet by inverse kinematics.

mod actor;
mod files;
mod flight;
mod foot;
mod gait;
mod gestures;
mod ground;
mod impossible;
mod jump;
mod leg;
mod one_leg;
mod plan;
mod posture;
mod run;
mod suite;
mod track;
mod turn;
mod walk;

pub use files::{File, suite_files, suite_readme};
pub use foot::Contact;
pub use ground::{GRAVITY_M_S2, GroundReaction};
pub use suite::{Feasibility, SuiteMotion, suite};

use crate::humanoid::Side;
use crate::motion::{Motion, MotionError};

/// Frames per second of synthesised motions, as in KIT recordings.
pub const RATE_HZ: f64 = 100.0;

/// A motion and what its feet were planned to do.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    /// The motion.
    pub motion: Motion,
    /// Contact of the left and the right foot, one pair per frame.
    pub contacts: Vec<[Contact; 2]>,
}

/// Why a motion cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SynthesisError {
    /// A motion of the suite cannot be made.
    #[error("{name}: {source}")]
    Suite {
        /// Name of the motion.
        name: &'static str,
        /// Why.
        source: Box<SynthesisError>,
    },
    /// The humanoid lacks a part.
    #[error("the humanoid has no {name}")]
    Missing {
        /// Name of the part.
        name: String,
    },
    /// A leg is too short for the plan.
    #[error(
        "at {time_secs:.2} s the {side:?} leg is {missing_m:.4} m too short; lower the centre of mass or step shorter"
    )]
    OutOfReach {
        /// Time of the frame.
        time_secs: f64,
        /// Leg in question.
        side: Side,
        /// Length that lacks, metres.
        missing_m: f64,
    },
    /// A joint would leave its range.
    #[error("at {time_secs:.2} s {joint} is {found_rad:.3} rad, outside {lower_rad} to {upper_rad}")]
    JointLimit {
        /// Short name of the joint.
        joint: &'static str,
        /// Time of the frame.
        time_secs: f64,
        /// Angle, radians.
        found_rad: f64,
        /// Lower limit, radians.
        lower_rad: f64,
        /// Upper limit, radians.
        upper_rad: f64,
    },
    /// The body is not a robot.
    #[error(transparent)]
    Robot(#[from] crate::robot::RobotError),
    /// The frames are not a motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
}
