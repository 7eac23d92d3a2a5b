//! The body that performs, and the numbers every choreography starts from.

use super::SynthesisError;
use super::foot::{FootGeometry, FootTrack, Footprint, Stance, Swing};
use super::plan::Plan;
use super::posture::Posture;
use super::track::Track;
use crate::humanoid::{Humanoid, Side};
use crate::motion::{Body, Frame};

/// Height of the bodies of the suite, metres.
const HEIGHT_M: f64 = 1.75;
/// The pelvis stands this far below its height with straight legs, metres; the knees bend by about 10 degrees.
const STANDING_DROP_M: f64 = 0.006;
/// Distance from the middle to either ankle in quiet standing, metres: the feet stand below the hips.
pub(super) const STANDING_HALF_WIDTH_M: f64 = 0.091;
/// Feet point outwards by this angle, radians (6 degrees; adults walk with 5 to 10).
pub(super) const TOE_OUT_RAD: f64 = 0.105;
/// Quiet standing loads the foot this far ahead of the ankle, metres (Winter 1995, Gait and Posture 3:193: 4 to 6 cm).
pub(super) const MIDFOOT_M: f64 = 0.05;

/// The humanoid of the suite.
#[derive(Debug, Clone)]
pub(super) struct Actor {
    pub humanoid: Humanoid,
    /// Height of the centre of mass in quiet standing, metres.
    pub standing_com_m: f64,
    feet: [FootGeometry; 2],
}

impl Actor {
    pub fn new() -> Result<Self, SynthesisError> {
        let humanoid = Humanoid::new(Body::with_default_mass(HEIGHT_M))?;
        let mut neutral = Frame::ZERO;
        neutral.root_position_m[2] = humanoid.standing_root_height_m();
        let com = humanoid.robot.tree.center_of_mass(&humanoid.forward(&neutral));
        let feet = [FootGeometry::new(&humanoid, Side::Left)?, FootGeometry::new(&humanoid, Side::Right)?];
        Ok(Self { humanoid, standing_com_m: com.z - STANDING_DROP_M, feet })
    }

    /// A foot that goes from stance to stance.
    pub fn foot(&self, side: Side, stances: Vec<Stance>, swings: &[Swing]) -> FootTrack {
        FootTrack::new(self.feet[side as usize].clone(), stances, swings)
    }

    /// Quiet standing at the origin, facing forward; choreographies change what moves.
    pub fn standing(&self, duration_secs: f64) -> Plan {
        let feet = [Side::Left, Side::Right].map(|side| {
            self.foot(side, vec![Stance::flat(standing_footprint(side), 0.0, duration_secs)], &[])
        });
        Plan {
            duration_secs,
            feet,
            posture: Posture::relaxed(),
            com_height_m: Track::at_rest(self.standing_com_m),
            support_m: [Track::at_rest(0.0), Track::at_rest(MIDFOOT_M)],
        }
    }
}

/// +1 on the right (x), -1 on the left.
pub(super) fn sign(side: Side) -> f64 {
    match side {
        Side::Left => -1.0,
        Side::Right => 1.0,
    }
}

/// Where a foot stands before and after most motions.
pub(super) fn standing_footprint(side: Side) -> Footprint {
    Footprint { x_m: sign(side) * STANDING_HALF_WIDTH_M, y_m: 0.0, yaw_rad: -sign(side) * TOE_OUT_RAD }
}
