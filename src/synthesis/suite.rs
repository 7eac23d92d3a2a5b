//! The list of the suite: identity, captions and makers.

use rayon::prelude::*;

use super::actor::Actor;
use super::{Performance, SynthesisError, gestures, impossible, jump, one_leg, run, turn, walk};
use crate::humanoid::Side;

/// Whether a body could perform a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feasibility {
    /// Obeys gravity, friction and balance.
    Possible,
    /// The whole body hangs above the floor.
    Floats,
    /// Resting feet slide over the floor.
    Slides,
    /// The body is elsewhere from one frame to the next.
    Jumps,
}

/// One motion of the suite.
#[derive(Debug, Clone, PartialEq)]
pub struct SuiteMotion {
    /// Five digits, as KIT-ML names its motions.
    pub id: &'static str,
    /// What a person would call it.
    pub name: &'static str,
    /// Sentences that describe what was asked.
    pub captions: &'static [&'static str],
    /// Whether a body could perform it.
    pub feasibility: Feasibility,
    /// The motion and its contacts.
    pub performance: Performance,
}

type Make = fn(&Actor) -> Result<Performance, SynthesisError>;

#[rustfmt::skip]
const MOTIONS: &[(&str, &str, &[&str], Feasibility, Make)] = &[
    ("90001", "walk", &["A person walks forward six steps.", "Someone walks straight ahead and stops."],
        Feasibility::Possible, |actor| walk::COMFORTABLE.plan(actor).perform(&actor.humanoid)),
    ("90002", "slow-walk", &["A person walks forward slowly.", "A human takes a few slow steps forward."],
        Feasibility::Possible, |actor| walk::SLOW.plan(actor).perform(&actor.humanoid)),
    ("90003", "jog", &["A person jogs forward and stops.", "Someone runs a few steps."],
        Feasibility::Possible, |actor| run::jog(actor).perform(&actor.humanoid)),
    ("90004", "squat", &["A person does a squat with the arms held out in front.", "Someone bends the knees and stands up again."],
        Feasibility::Possible, |actor| gestures::squat(actor).perform(&actor.humanoid)),
    ("90005", "bow", &["A person bows.", "A human bends forward to bow and straightens up."],
        Feasibility::Possible, |actor| gestures::bow(actor).perform(&actor.humanoid)),
    ("90006", "wave-left", &["A person waves with the left hand."],
        Feasibility::Possible, |actor| gestures::wave(actor, Side::Left).perform(&actor.humanoid)),
    ("90007", "wave-right", &["A person waves with the right hand."],
        Feasibility::Possible, |actor| gestures::wave(actor, Side::Right).perform(&actor.humanoid)),
    ("90008", "kick", &["A person kicks with the right foot.", "Someone swings the right leg back and kicks."],
        Feasibility::Possible, |actor| one_leg::kick(actor).perform(&actor.humanoid)),
    ("90009", "jump", &["A person jumps up on the spot.", "A human jumps."],
        Feasibility::Possible, |actor| jump::jump(actor).perform(&actor.humanoid)),
    ("90010", "turn", &["A person turns around to the left on the spot.", "Someone turns left by 180 degrees."],
        Feasibility::Possible, |actor| turn::turn_left(actor).perform(&actor.humanoid)),
    ("90011", "sit", &["A person slowly sits down in the air and stands up again."],
        Feasibility::Possible, |actor| gestures::sit_in_the_air(actor).perform(&actor.humanoid)),
    ("90012", "balance", &["A person balances on the left leg.", "A human stands on one leg with the arms spread."],
        Feasibility::Possible, |actor| one_leg::balance(actor).perform(&actor.humanoid)),
    ("90901", "floating-walk", &["A person walks forward."], Feasibility::Floats, impossible::floating_walk),
    ("90902", "sliding-stand", &["A person stands still."], Feasibility::Slides, impossible::sliding_stand),
    ("90903", "teleport", &["A person stands still."], Feasibility::Jumps, impossible::teleport),
];

/// All motions of the suite, in order of their ids.
///
/// # Errors
/// [`SynthesisError`] when a choreography asks more than the body can do.
pub fn suite() -> Result<Vec<SuiteMotion>, SynthesisError> {
    let actor = Actor::new()?;
    MOTIONS
        .par_iter()
        .map(|&(id, name, captions, feasibility, make)| {
            let performance =
                make(&actor).map_err(|source| SynthesisError::Suite { name, source: Box::new(source) })?;
            Ok(SuiteMotion { id, name, captions, feasibility, performance })
        })
        .collect()
}
