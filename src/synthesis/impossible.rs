//! Motions that break one law of physics each, and no other.

use super::actor::Actor;
use super::foot::Contact;
use super::{Performance, RATE_HZ, SynthesisError, walk};

/// Height of the floating walk above the floor, metres.
pub(super) const FLOAT_M: f64 = 0.10;
/// Way of the sliding stand, metres.
const SLIDE_M: f64 = 1.0;
const SLIDE_SECS: f64 = 4.0;
/// Length of the teleport, metres.
const TELEPORT_M: f64 = 1.0;
const TELEPORT_SECS: f64 = 4.0;

/// A comfortable walk, lifted off the floor: nothing carries the body.
pub(super) fn floating_walk(actor: &Actor) -> Result<Performance, SynthesisError> {
    let walk = walk::COMFORTABLE.plan(actor).perform(&actor.humanoid)?;
    let contacts = vec![[Contact::None; 2]; walk.contacts.len()];
    let motion = walk.motion.map_frames(|_, frame| frame.root_position_m[2] += FLOAT_M)?;
    Ok(Performance { motion, contacts })
}

/// Quiet standing that glides forward at a constant speed: the soles slide under full load.
pub(super) fn sliding_stand(actor: &Actor) -> Result<Performance, SynthesisError> {
    let Performance { motion, contacts } = actor.standing(SLIDE_SECS).perform(&actor.humanoid)?;
    let speed = SLIDE_M / SLIDE_SECS;
    let motion =
        motion.map_frames(|index, frame| frame.root_position_m[1] += speed * index as f64 / RATE_HZ)?;
    Ok(Performance { motion, contacts })
}

/// Quiet standing, elsewhere from one frame to the next: infinite speed for an instant.
pub(super) fn teleport(actor: &Actor) -> Result<Performance, SynthesisError> {
    let Performance { motion, contacts } = actor.standing(TELEPORT_SECS).perform(&actor.humanoid)?;
    let middle = motion.num_frames() / 2;
    let motion = motion.map_frames(|index, frame| {
        if index >= middle {
            frame.root_position_m[1] += TELEPORT_M;
        }
    })?;
    Ok(Performance { motion, contacts })
}
