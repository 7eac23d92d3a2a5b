//! Motions on the left leg alone: balance and kick.

use super::actor::{Actor, MIDFOOT_M, TOE_OUT_RAD, standing_footprint};
use super::foot::{Stance, Swing, Via};
use super::plan::Plan;
use super::track::Track;
use crate::humanoid::Side;

/// A plan that loads the left foot from `loaded_secs.0` to `loaded_secs.1`, while the right foot swings by these places.
fn on_left_leg(actor: &Actor, duration_secs: f64, swing_secs: (f64, f64), via: &[Via]) -> Plan {
    let mut plan = actor.standing(duration_secs);
    let footprint = standing_footprint(Side::Right);
    let stances = vec![
        Stance::flat(footprint, 0.0, swing_secs.0),
        Stance::flat(footprint, swing_secs.1, duration_secs),
    ];
    plan.feet[1] =
        actor.foot(Side::Right, stances, &[Swing { lift_m: 0.0, dip_rad: 0.0, via: via.to_vec() }]);
    let [x, y] = standing_footprint(Side::Left).ahead(MIDFOOT_M);
    let center = [0.0, MIDFOOT_M];
    plan.support_m = [x, y].map(Track::at_rest);
    for ((track, loaded), center) in plan.support_m.iter_mut().zip([x, y]).zip(center) {
        *track = Track::at_rest(center);
        track.move_to(0.5, swing_secs.0 - 0.1, loaded);
        track.move_to(swing_secs.1 + 0.1, duration_secs - 0.4, center);
    }
    plan
}

fn place(time_secs: f64, ankle_m: [f64; 3], pitch_deg: f64) -> Via {
    Via {
        time_secs,
        ankle_m,
        velocity_m_s: [0.0; 3],
        yaw_rad: -TOE_OUT_RAD,
        pitch_rad: pitch_deg.to_radians(),
    }
}

/// Stands on the left leg with the right knee raised and the arms spread.
pub(super) fn balance(actor: &Actor) -> Plan {
    let raised = [0.10, 0.06, 0.34];
    let mut plan =
        on_left_leg(actor, 7.6, (1.8, 5.8), &[place(3.0, raised, -25.0), place(4.6, raised, -25.0)]);
    plan.com_height_m.move_to(0.5, 1.7, actor.standing_com_m - 0.012);
    plan.com_height_m.move_to(1.8, 3.0, actor.standing_com_m + 0.015);
    plan.com_height_m.move_to(4.6, 5.8, actor.standing_com_m - 0.012);
    plan.com_height_m.move_to(6.0, 7.2, actor.standing_com_m);
    plan.posture.move_to(0.6, 2.4, &[("LSy", 55.0), ("RSy", -55.0), ("LEx", 10.0), ("REx", 10.0)]);
    plan.posture.relax(5.0, 7.0);
    plan
}

/// Swings the right leg back and kicks forward with it.
pub(super) fn kick(actor: &Actor) -> Plan {
    let through = Via { velocity_m_s: [0.0, 2.6, 0.4], ..place(2.72, [0.10, 0.10, 0.20], -20.0) };
    let via = [
        place(2.35, [0.10, -0.28, 0.26], -50.0),
        through,
        place(3.05, [0.10, 0.70, 0.48], 30.0),
        place(3.75, [0.10, 0.10, 0.26], -20.0),
    ];
    let mut plan = on_left_leg(actor, 6.2, (1.6, 4.5), &via);
    plan.com_height_m.move_to(0.5, 1.5, actor.standing_com_m - 0.02);
    plan.com_height_m.move_to(2.4, 3.0, actor.standing_com_m + 0.005);
    plan.com_height_m.move_to(3.3, 4.4, actor.standing_com_m - 0.02);
    plan.com_height_m.move_to(4.6, 5.8, actor.standing_com_m);
    let posture = &mut plan.posture;
    posture.move_to(0.6, 2.3, &[("LSy", 40.0), ("RSy", -40.0), ("LSx", 15.0), ("RSx", -20.0)]);
    posture.move_to(1.6, 2.35, &[("pelvis x", -10.0), ("BPx", -4.0)]);
    posture.move_to(2.4, 3.1, &[("pelvis x", 6.0), ("BPx", -12.0), ("LSx", -25.0), ("RSx", 25.0)]);
    posture.relax(3.4, 5.4);
    plan
}
