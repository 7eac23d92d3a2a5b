//! A jump on the spot: crouch, push-off over the toes, ballistic flight, landing on the toes, rise.

use super::actor::{Actor, MIDFOOT_M, standing_footprint};
use super::foot::{Stance, Swing};
use super::ground::GRAVITY_M_S2;
use super::plan::Plan;
use super::track::{Key, Track};
use crate::humanoid::Side;

const CROUCH_SECS: f64 = 0.5;
const BOTTOM_SECS: f64 = 1.35;
const LEAVE_SECS: f64 = BOTTOM_SECS + 0.28;
/// Speed of the centre of mass on leaving, m/s: it rises by 0.11 m in flight.
const LEAVE_SPEED_M_S: f64 = 1.472;
const FLIGHT_SECS: f64 = 2.0 * LEAVE_SPEED_M_S / GRAVITY_M_S2;
const LAND_SECS: f64 = LEAVE_SECS + FLIGHT_SECS;
const ABSORBED_SECS: f64 = LAND_SECS + 0.28;
const RISEN_SECS: f64 = ABSORBED_SECS + 1.1;
const DURATION_SECS: f64 = 4.6;
/// The load is this far ahead of the ankle while on the toes, metres.
const TOES_M: f64 = 0.158;

/// Jumps on the spot.
pub(super) fn jump(actor: &Actor) -> Plan {
    let mut plan = actor.standing(DURATION_SECS);
    plan.feet = [Side::Left, Side::Right].map(|side| {
        let footprint = standing_footprint(side);
        let before = Stance {
            heel_off_secs: LEAVE_SECS - 0.25,
            leave_toe_rad: 0.60,
            ..Stance::flat(footprint, 0.0, LEAVE_SECS)
        };
        let after = Stance {
            flat_secs: LAND_SECS + 0.22,
            land_pitch_rad: -0.55,
            ..Stance::flat(footprint, LAND_SECS, DURATION_SECS)
        };
        actor.foot(side, vec![before, after], &[Swing { lift_m: 0.05, dip_rad: 0.0, via: Vec::new() }])
    });

    let z = actor.standing_com_m;
    let (leave, bottom) = (z + 0.018, z - 0.11);
    let height = &mut plan.com_height_m;
    let mut key = |time_secs, value, rate, acceleration| {
        height.push(Key { time_secs, value, rate, acceleration });
    };
    key(CROUCH_SECS, z, 0.0, 0.0);
    key(BOTTOM_SECS, bottom, 0.0, 2.0);
    key(LEAVE_SECS, leave, LEAVE_SPEED_M_S, -GRAVITY_M_S2);
    key(LAND_SECS, leave, -LEAVE_SPEED_M_S, -GRAVITY_M_S2);
    key(ABSORBED_SECS, bottom, 0.0, 2.0);
    key(RISEN_SECS, z, 0.0, 0.0);

    plan.support_m[1] = Track::through(&[
        (CROUCH_SECS, MIDFOOT_M),
        (BOTTOM_SECS - 0.1, MIDFOOT_M + 0.06),
        (LEAVE_SECS - 0.25, TOES_M - 0.025),
        (LEAVE_SECS, TOES_M),
        (LAND_SECS, TOES_M),
        (LAND_SECS + 0.22, TOES_M - 0.025),
        (ABSORBED_SECS + 0.1, MIDFOOT_M + 0.06),
        (RISEN_SECS, MIDFOOT_M),
    ]);

    let posture = &mut plan.posture;
    posture.move_to(
        CROUCH_SECS,
        BOTTOM_SECS,
        &[("pelvis x", -28.0), ("BPx", -20.0), ("LSx", -32.0), ("RSx", -32.0), ("LEx", 25.0), ("REx", 25.0)],
    );
    posture.move_to(
        BOTTOM_SECS,
        LEAVE_SECS,
        &[("pelvis x", -2.0), ("BPx", 0.0), ("LSx", 30.0), ("RSx", 30.0), ("LEx", 35.0), ("REx", 35.0)],
    );
    posture.move_to(
        LAND_SECS,
        ABSORBED_SECS,
        &[("pelvis x", -27.0), ("BPx", -20.0), ("LSx", 25.0), ("RSx", 25.0)],
    );
    posture.relax(ABSORBED_SECS, RISEN_SECS);
    plan
}
