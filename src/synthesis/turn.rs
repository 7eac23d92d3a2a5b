//! Turning on the spot by stepping.

use super::actor::{Actor, MIDFOOT_M, STANDING_HALF_WIDTH_M, TOE_OUT_RAD, sign};
use super::foot::{Footprint, Stance};
use super::gait::{Footfall, Footfalls, Manner, opposite};
use super::plan::Plan;
use crate::humanoid::Side;

/// Headings after each step, degrees; the left foot steps first.
const HEADINGS_DEG: [f64; 5] = [45.0, 90.0, 135.0, 180.0, 180.0];
const STAND_SECS: f64 = 0.4;
const SHIFT_SECS: f64 = 0.8;
const SWING_SECS: f64 = 0.46;
const DOUBLE_SUPPORT_SECS: f64 = 0.30;
const LIFT_M: f64 = 0.065;

const MANNER: Manner = Manner {
    full_step_m: 1.0,
    pelvis_turn_deg: 0.0,
    pelvis_drop_deg: 1.5,
    lean_deg: 1.0,
    arm_swing_deg: 0.0,
    elbow_deg: 16.0,
    elbow_swing_deg: 0.0,
};

/// Turns left by half a turn in five steps around the place between the feet.
pub(super) fn turn_left(actor: &Actor) -> Plan {
    let mut footfalls = Footfalls::standing(Side::Left);
    let (mut side, mut leave) = (Side::Left, STAND_SECS + SHIFT_SECS);
    for heading in HEADINGS_DEG {
        let yaw = f64::to_radians(heading);
        let reach = sign(side) * STANDING_HALF_WIDTH_M;
        // The middle of the soles, not of the ankles, keeps its place.
        let footprint = Footprint {
            x_m: reach * yaw.cos() + MIDFOOT_M * yaw.sin(),
            y_m: reach * yaw.sin() + MIDFOOT_M * (1.0 - yaw.cos()),
            yaw_rad: yaw - sign(side) * TOE_OUT_RAD,
        };
        let leaving = footfalls.0.len() - 2;
        footfalls.0[leaving].stance.leave_secs = leave;
        footfalls.0[leaving].stance.heel_off_secs = leave;
        footfalls.0[leaving].lift_m = LIFT_M;
        footfalls.0.push(Footfall {
            side,
            stance: Stance::flat(footprint, leave + SWING_SECS, f64::INFINITY),
            lift_m: 0.0,
            dip_rad: 0.0,
            support_m: [MIDFOOT_M; 2],
        });
        side = opposite(side);
        leave += SWING_SECS + DOUBLE_SUPPORT_SECS;
    }
    let duration_secs = ((leave + SHIFT_SECS + STAND_SECS) * super::RATE_HZ).round() / super::RATE_HZ;
    let mut plan = footfalls.plan(actor, &MANNER, STAND_SECS, duration_secs);
    let low = actor.standing_com_m - 0.015;
    plan.com_height_m.move_to(STAND_SECS, STAND_SECS + SHIFT_SECS, low);
    plan.com_height_m.move_to(leave, duration_secs - STAND_SECS, actor.standing_com_m);
    plan
}
