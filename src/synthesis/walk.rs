//! Walking straight ahead.
//!
//! Cadence, step length and the share of double support follow adult norms (Perry and Burnfield 2010, "Gait Analysis",
//! chapters 2 and 26; Winter 2009, "Biomechanics and Motor Control of Human Movement"): some 110 steps a minute at
//! 1.1 m/s, two double supports of 10 to 12 % of the stride each, heel contact with the toes up, heel off before the other foot
//! lands, pelvis rotation of 4 to 5 degrees and an arm swing of some 30 degrees (Murray et al. 1967).
//! Deviation: the knees stay more bent in stance than in people, so that legs never reach full length.

use super::actor::{Actor, STANDING_HALF_WIDTH_M, TOE_OUT_RAD, sign};
use super::foot::{Footprint, Stance};
use super::gait::{Footfall, Footfalls, Manner, opposite};
use super::plan::Plan;
use super::track::{Key, Track};
use crate::humanoid::Side;

/// A way of walking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Walk {
    pub num_steps: usize,
    pub step_m: f64,
    pub step_secs: f64,
    pub double_support_secs: f64,
    /// The heel leaves this long before the other foot lands.
    pub heel_off_secs: f64,
    /// Pitch of the foot at heel contact.
    pub land_pitch_deg: f64,
    /// Toe joint when the foot leaves.
    pub toe_off_deg: f64,
    pub lift_m: f64,
    /// Half the distance between the lines of the feet, metres.
    pub half_width_m: f64,
    /// Mean height of the centre of mass below quiet standing, metres.
    pub drop_m: f64,
    /// Rise and fall of the centre of mass about its mean, metres.
    pub bounce_m: f64,
    pub manner: Manner,
}

/// Walking at a comfortable speed, 1.1 m/s.
pub(super) const COMFORTABLE: Walk = Walk {
    num_steps: 6,
    step_m: 0.60,
    step_secs: 0.545,
    double_support_secs: 0.13,
    heel_off_secs: 0.14,
    land_pitch_deg: 13.0,
    toe_off_deg: 38.0,
    lift_m: 0.072,
    half_width_m: 0.065,
    drop_m: 0.034,
    bounce_m: 0.014,
    manner: Manner {
        full_step_m: 0.60,
        pelvis_turn_deg: 4.5,
        pelvis_drop_deg: 2.5,
        lean_deg: 3.0,
        arm_swing_deg: 15.0,
        elbow_deg: 24.0,
        elbow_swing_deg: 7.0,
    },
};

/// Walking slowly, 0.6 m/s.
pub(super) const SLOW: Walk = Walk {
    num_steps: 5,
    step_m: 0.45,
    step_secs: 0.75,
    double_support_secs: 0.24,
    heel_off_secs: 0.10,
    land_pitch_deg: 10.0,
    toe_off_deg: 28.0,
    lift_m: 0.072,
    half_width_m: 0.075,
    drop_m: 0.020,
    bounce_m: 0.008,
    manner: Manner {
        full_step_m: 0.45,
        pelvis_turn_deg: 3.0,
        pelvis_drop_deg: 2.0,
        lean_deg: 2.0,
        arm_swing_deg: 8.0,
        elbow_deg: 18.0,
        elbow_swing_deg: 4.0,
    },
};

/// Time of quiet standing before and after.
const STAND_SECS: f64 = 0.4;
/// From the first shift of load to the first lift of a foot.
const SHIFT_SECS: f64 = 0.75;
/// From the last landing to quiet standing.
const SETTLE_SECS: f64 = 0.9;
/// Length of the first step from standing, in full steps.
const FIRST_STEP: f64 = 0.55;
/// Length of the last step before the feet close, in full steps.
const LAST_STEP: f64 = 0.75;
/// The toes hang by this much more in the first half of a swing, radians.
const DIP_RAD: f64 = 0.12;
/// After heel contact the foot is flat within this share of the double support.
const FLAT_SHARE: f64 = 0.5;

impl Walk {
    /// The plan of this walk, from standing to standing; the right foot steps first.
    pub fn plan(&self, actor: &Actor) -> Plan {
        let footfalls = self.footfalls();
        let last = &footfalls.0[footfalls.0.len() - 1];
        let duration_secs =
            ((last.stance.land_secs + SETTLE_SECS + STAND_SECS) * super::RATE_HZ).round() / super::RATE_HZ;
        let mut plan = footfalls.plan(actor, &self.manner, STAND_SECS, duration_secs);

        let middle = actor.standing_com_m - self.drop_m;
        let mut height = Track::at_rest(actor.standing_com_m);
        height.move_to(STAND_SECS, STAND_SECS + SHIFT_SECS, middle);
        // A cosine at step frequency: lowest between two steps, highest in the middle of each.
        let acceleration = self.bounce_m * (std::f64::consts::TAU / self.step_secs).powi(2);
        for index in footfalls.carrying() {
            let (from, until) = footfalls.single_support(index);
            let mut extreme = |time_secs, rise: f64| {
                let value = middle + rise * self.bounce_m;
                height.push(Key { time_secs, value, rate: 0.0, acceleration: -rise * acceleration });
            };
            extreme((from + until) / 2.0, 1.0);
            extreme(until + self.double_support_secs / 2.0, -1.0);
        }
        height.push(Key {
            time_secs: duration_secs - STAND_SECS,
            value: actor.standing_com_m,
            rate: 0.0,
            acceleration: 0.0,
        });
        plan.com_height_m = height;
        plan
    }

    fn footfalls(&self) -> Footfalls {
        let mut footfalls = Footfalls::standing(Side::Right);
        let swing_secs = self.step_secs - self.double_support_secs;
        let mut leave = STAND_SECS + SHIFT_SECS;
        let mut y_m = 0.0;
        let mut side = Side::Right;
        for step in 0..self.num_steps {
            let closing = step + 1 == self.num_steps;
            if step == 0 {
                y_m += FIRST_STEP * self.step_m;
            } else if !closing {
                y_m += if step + 2 == self.num_steps { LAST_STEP } else { 1.0 } * self.step_m;
            }
            let land = leave + swing_secs;
            // The foot that now leaves is the one before the last.
            let leaving = footfalls.0.len() - 2;
            let roll_secs = self.double_support_secs + self.heel_off_secs;
            let from = &mut footfalls.0[leaving];
            let (roll_secs, toe_off) = if step == 0 { (0.3, 0.4) } else { (roll_secs, 1.0) };
            from.stance.leave_secs = leave;
            from.stance.heel_off_secs = leave - roll_secs;
            from.stance.leave_toe_rad = toe_off * self.toe_off_deg.to_radians();
            from.lift_m = self.lift_m * if step == 0 { 0.9 } else { 1.0 };
            from.dip_rad = if closing { 0.0 } else { DIP_RAD };
            let half_width = if closing { STANDING_HALF_WIDTH_M } else { self.half_width_m };
            let footprint =
                Footprint { x_m: sign(side) * half_width, y_m, yaw_rad: -sign(side) * TOE_OUT_RAD };
            let mut stance = Stance::flat(footprint, land, f64::INFINITY);
            if !closing {
                stance.flat_secs = land + FLAT_SHARE * self.double_support_secs;
                stance.land_pitch_rad = self.land_pitch_deg.to_radians() * if step == 0 { 0.5 } else { 1.0 };
            }
            // The last foot to carry stays flat.
            let until_m = if step + 2 >= self.num_steps { 0.07 } else { 0.162 };
            footfalls.0.push(Footfall {
                side,
                stance,
                lift_m: 0.0,
                dip_rad: 0.0,
                support_m: [-0.03, until_m],
            });
            if step == 0 {
                // The standing foot carries first and rolls over its toes as well.
                footfalls.0[1].support_m = [0.05, 0.162];
            }
            side = opposite(side);
            leave = land + self.double_support_secs;
        }
        footfalls
    }
}
