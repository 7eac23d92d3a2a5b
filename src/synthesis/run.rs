//! A jog with flight phases.
//!
//! Step time, contact time and step length follow slow running (Novacheck 1998, "The biomechanics of running", Gait and
//! Posture 7:77: toe off before 40 % of the cycle; slow runners take 2.6 to 3 steps a second).

use super::actor::{Actor, MIDFOOT_M, STANDING_HALF_WIDTH_M, TOE_OUT_RAD, sign};
use super::foot::{Footprint, Stance};
use super::gait::{Footfall, Footfalls, Manner};
use super::ground::GRAVITY_M_S2;
use super::plan::Plan;
use super::track::Key;
use crate::humanoid::Side;

/// Side, landing, leaving (seconds) and place (metres forward) of each footfall after the standing feet.
///
/// The first steps gather speed, the middle ones cover 0.76 m in 0.34 s, the last ones brake.
const FOOTFALLS: [(Side, f64, f64, f64); 11] = [
    (Side::Right, 1.32, 1.62, 0.28),
    (Side::Left, 1.67, 1.93, 0.74),
    (Side::Right, 2.01, 2.27, 1.33),
    (Side::Left, 2.35, 2.61, 2.07),
    (Side::Right, 2.69, 2.95, 2.83),
    (Side::Left, 3.03, 3.29, 3.59),
    (Side::Right, 3.37, 3.75, 4.19),
    (Side::Left, 3.70, 4.18, 4.65),
    (Side::Right, 4.08, 4.62, 5.05),
    (Side::Left, 4.52, f64::INFINITY, 5.17),
    (Side::Right, 5.02, f64::INFINITY, 5.17),
];
/// Leaving of the standing right and left foot, seconds.
const FIRST_LEAVE_SECS: [f64; 2] = [1.0, 1.36];
const START_SECS: f64 = 0.4;
const DURATION_SECS: f64 = 6.6;
/// Half the distance between the lines of the feet, metres.
const HALF_WIDTH_M: f64 = 0.05;
/// Height of the centre of mass on leaving and landing above that of quiet standing, metres, for each flight.
const FLIGHT_HEIGHTS_M: [f64; 6] = [-0.045, -0.035, -0.035, -0.03, -0.03, -0.04];
/// Height above quiet standing while gathering speed and while braking, metres.
const LOW_M: f64 = -0.044;

const MANNER: Manner = Manner {
    full_step_m: 0.76,
    pelvis_turn_deg: 6.0,
    pelvis_drop_deg: 3.0,
    lean_deg: 7.0,
    arm_swing_deg: 24.0,
    elbow_deg: 75.0,
    elbow_swing_deg: 8.0,
};

/// Jogs forward and stops.
pub(super) fn jog(actor: &Actor) -> Plan {
    let footfalls = footfalls();
    let mut plan = footfalls.plan(actor, &MANNER, START_SECS, DURATION_SECS);
    let height = &mut plan.com_height_m;
    let mut key = |time_secs, value, rate, acceleration| {
        height.push(Key { time_secs, value, rate, acceleration });
    };
    let flights =
        FOOTFALLS.windows(2).map(|pair| (pair[0].2, pair[1].1)).filter(|(leave, land)| land > leave);
    key(START_SECS, actor.standing_com_m, 0.0, 0.0);
    key(1.05, actor.standing_com_m + 0.7 * LOW_M, 0.0, 0.0);
    key(1.47, actor.standing_com_m + LOW_M - 0.015, 0.0, 4.0);
    for ((leave, land), rise) in flights.zip(FLIGHT_HEIGHTS_M) {
        // Up and down again at the same height, under gravity alone.
        let (height, speed) = (actor.standing_com_m + rise, GRAVITY_M_S2 * (land - leave) / 2.0);
        key(leave, height, speed, -GRAVITY_M_S2);
        key(land, height, -speed, -GRAVITY_M_S2);
    }
    key(3.62, actor.standing_com_m + LOW_M, 0.0, 0.0);
    key(5.2, actor.standing_com_m, 0.0, 0.0);
    plan
}

fn footfalls() -> Footfalls {
    let mut footfalls = Footfalls::standing(Side::Right);
    for (footfall, leave) in footfalls.0.iter_mut().zip(FIRST_LEAVE_SECS) {
        footfall.stance.leave_secs = leave;
        footfall.stance.heel_off_secs = leave - 0.2;
        footfall.stance.leave_toe_rad = 0.4;
        footfall.lift_m = 0.12;
        footfall.dip_rad = 0.25;
    }
    footfalls.0[1].support_m = [MIDFOOT_M, 0.155];
    footfalls.0[1].lift_m = 0.13;
    for (index, (side, land, leave, y_m)) in FOOTFALLS.into_iter().enumerate() {
        let closing = leave.is_infinite();
        let half_width = if closing { STANDING_HALF_WIDTH_M } else { HALF_WIDTH_M };
        let footprint = Footprint { x_m: sign(side) * half_width, y_m, yaw_rad: -sign(side) * TOE_OUT_RAD };
        let mut stance = Stance::flat(footprint, land, leave);
        // Before a flight the runner stays on the toes; the other steps use the whole sole.
        let springs = index < FLIGHT_HEIGHTS_M.len();
        if springs {
            stance.tiptoe_rad = 0.27;
            stance.flat_secs = land + 0.09;
            stance.land_pitch_rad = -0.10;
            stance.leave_toe_rad = 0.55;
        } else if !closing {
            stance.leave_toe_rad = 0.80;
        }
        if !closing {
            stance.heel_off_secs = land + 0.3 * (leave - land);
        }
        let support_m = if springs {
            [0.146, 0.168]
        } else if closing {
            [0.0, 0.06]
        } else {
            [0.0, 0.155]
        };
        footfalls.0.push(Footfall { side, stance, lift_m: 0.13, dip_rad: 0.34, support_m });
    }
    footfalls
}
