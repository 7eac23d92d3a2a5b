//! Motions on two resting feet: squat, bow, waves, sitting down in the air.

use super::actor::Actor;
use super::plan::Plan;
use super::posture::Posture;
use crate::humanoid::Side;

/// Bends the knees to a half squat with the arms held out in front, and rises.
pub(super) fn squat(actor: &Actor) -> Plan {
    let mut plan = actor.standing(4.6);
    let low = actor.standing_com_m - 0.27;
    plan.com_height_m.move_to(0.5, 1.9, low);
    plan.com_height_m.move_to(2.4, 3.9, actor.standing_com_m);
    plan.posture.move_to(
        0.5,
        1.9,
        &[
            ("pelvis x", -22.0),
            ("BPx", -14.0),
            ("BTx", -8.0),
            ("BLNx", 14.0),
            ("LSx", 78.0),
            ("RSx", 78.0),
            ("LSy", 4.0),
            ("RSy", -4.0),
        ],
    );
    plan.posture.relax(2.4, 3.9);
    plan
}

/// Sits down slowly as on a low stool that is not there, stays, and stands up.
pub(super) fn sit_in_the_air(actor: &Actor) -> Plan {
    let mut plan = actor.standing(7.4);
    let low = actor.standing_com_m - 0.33;
    plan.com_height_m.move_to(0.6, 2.8, low);
    plan.com_height_m.move_to(4.4, 6.6, actor.standing_com_m);
    plan.posture.move_to(
        0.6,
        2.8,
        &[
            ("pelvis x", -20.0),
            ("BPx", -30.0),
            ("BTx", -14.0),
            ("BLNx", 14.0),
            ("BUNx", 12.0),
            ("LSx", 62.0),
            ("RSx", 62.0),
            ("LSy", 3.0),
            ("RSy", -3.0),
            ("LEx", 20.0),
            ("REx", 20.0),
        ],
    );
    plan.posture.relax(4.4, 6.6);
    plan
}

/// Bows from hips and back with straight legs.
pub(super) fn bow(actor: &Actor) -> Plan {
    let mut plan = actor.standing(5.0);
    // The trunk comes down while the hips keep their height.
    plan.com_height_m.move_to(0.6, 2.0, actor.standing_com_m - 0.115);
    plan.com_height_m.move_to(2.8, 4.4, actor.standing_com_m);
    plan.posture.move_to(
        0.6,
        2.0,
        &[
            ("pelvis x", -32.0),
            ("BPx", -22.0),
            ("BTx", -12.0),
            ("BUNx", -8.0),
            ("LSx", 18.0),
            ("RSx", 18.0),
            ("LSy", 4.0),
            ("RSy", -4.0),
        ],
    );
    plan.posture.relax(2.8, 4.4);
    plan
}

/// Raises a hand beside the head and waves it three times.
pub(super) fn wave(actor: &Actor, side: Side) -> Plan {
    let mut plan = actor.standing(5.2);
    let [arm_x, arm_y, elbow, forearm, wrist] = match side {
        Side::Left => ["LSx", "LSy", "LEx", "LEz", "LWy"],
        Side::Right => ["RSx", "RSy", "REx", "REz", "RWy"],
    };
    // Rotations about y and z change sign from left to right, those about x do not.
    let outward = -super::actor::sign(side);
    let posture: &mut Posture = &mut plan.posture;
    posture.move_to(
        0.5,
        1.5,
        &[
            (arm_x, 80.0),
            (arm_y, outward * 75.0),
            (elbow, 85.0),
            ("BLNz", outward * 6.0),
            ("BPy", outward * 2.0),
        ],
    );
    for beat in 0..3 {
        let start = 1.5 + 0.8 * f64::from(beat);
        let out = start + if beat == 0 { 0.3 } else { 0.4 };
        posture.move_to(start, out, &[(elbow, 58.0), (wrist, outward * 12.0), (forearm, 0.0)]);
        posture.move_to(out, start + 0.8, &[(elbow, 98.0), (wrist, outward * -12.0)]);
    }
    posture.relax(3.9, 4.9);
    plan
}
