//! Going on foot: from footfalls to feet, support and the counter-swing of trunk and arms.

use super::actor::{Actor, MIDFOOT_M, sign, standing_footprint};
use super::foot::{Footprint, Stance, Swing};
use super::plan::Plan;
use super::posture::Posture;
use super::track::{Key, Track};
use crate::humanoid::Side;

/// A foot that comes down, carries and leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Footfall {
    pub side: Side,
    pub stance: Stance,
    /// Lift of the swing that follows, metres, and how far the toes hang in it.
    pub lift_m: f64,
    pub dip_rad: f64,
    /// Support while this foot alone carries: from `support_m[0]` to `support_m[1]` ahead of the ankle, metres.
    pub support_m: [f64; 2],
}

/// How much of the body swings along, in degrees at a full step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Manner {
    /// Length of a full step, metres, to which the swings are proportional.
    pub full_step_m: f64,
    /// Rotation of the pelvis about the vertical, to either side.
    pub pelvis_turn_deg: f64,
    /// Drop of the pelvis on the side of the swinging leg.
    pub pelvis_drop_deg: f64,
    /// Forward lean of the pelvis.
    pub lean_deg: f64,
    /// Swing of the upper arm forward and backward about its middle.
    pub arm_swing_deg: f64,
    /// Elbow at the middle of the swing.
    pub elbow_deg: f64,
    /// Change of the elbow with the swing of the arm.
    pub elbow_swing_deg: f64,
}

/// Footfalls in order of landing; the first two and the last two are the feet of quiet standing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Footfalls(pub Vec<Footfall>);

impl Footfalls {
    /// The feet of quiet standing at the origin; `first` is the side that steps first.
    pub fn standing(first: Side) -> Self {
        let other = opposite(first);
        Self(
            [first, other]
                .map(|side| Footfall {
                    side,
                    stance: Stance::flat(standing_footprint(side), 0.0, f64::INFINITY),
                    lift_m: 0.0,
                    dip_rad: 0.0,
                    support_m: [MIDFOOT_M; 2],
                })
                .to_vec(),
        )
    }

    /// While this footfall carries alone: from the later of its landing and the leaving of the one before, to the
    /// earlier of its leaving and the landing of the one after.
    pub fn single_support(&self, index: usize) -> (f64, f64) {
        let (before, own, after) =
            (&self.0[index - 1].stance, &self.0[index].stance, &self.0[index + 1].stance);
        (before.leave_secs.max(own.land_secs), after.land_secs.min(own.leave_secs))
    }

    /// Footfalls other than the two standing ones at either end that carry alone.
    pub fn carrying(&self) -> std::ops::Range<usize> {
        1..self.0.len() - 1
    }

    /// Middle of the last two footprints, `MIDFOOT_M` ahead.
    fn final_support(&self) -> [f64; 2] {
        let [a, b] = [1, 2].map(|back| self.0[self.0.len() - back].stance.footprint.ahead(MIDFOOT_M));
        [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0]
    }

    /// A plan with these feet; the height stays that of quiet standing.
    pub fn plan(&self, actor: &Actor, manner: &Manner, start_secs: f64, duration_secs: f64) -> Plan {
        let mut plan = actor.standing(duration_secs);
        plan.feet = [Side::Left, Side::Right].map(|side| {
            let own: Vec<_> = self.0.iter().filter(|footfall| footfall.side == side).collect();
            let stances = own
                .iter()
                .map(|footfall| {
                    let mut stance = footfall.stance;
                    stance.leave_secs = stance.leave_secs.min(duration_secs);
                    stance.heel_off_secs = stance.heel_off_secs.min(duration_secs);
                    stance
                })
                .collect();
            let swings: Vec<_> = own[..own.len() - 1]
                .iter()
                .map(|footfall| Swing { lift_m: footfall.lift_m, dip_rad: footfall.dip_rad, via: Vec::new() })
                .collect();
            actor.foot(side, stances, &swings)
        });
        plan.support_m = self.support(start_secs, duration_secs);
        plan.posture = self.posture(manner, start_secs, duration_secs);
        plan
    }

    fn support(&self, start_secs: f64, duration_secs: f64) -> [Track; 2] {
        let mut points = vec![(start_secs, [0.0, MIDFOOT_M])];
        for index in self.carrying() {
            let Footfall { stance, support_m: [from_m, until_m], .. } = self.0[index];
            let (from, until) = self.single_support(index);
            points.push((from, stance.footprint.ahead(from_m)));
            // The load is under the toes once the heel is up.
            if stance.heel_off_secs > from + 0.02 && stance.heel_off_secs < until - 0.02 {
                points.push((stance.heel_off_secs, stance.footprint.ahead(0.93 * until_m)));
            }
            points.push((until, stance.footprint.ahead(until_m)));
        }
        points.push((duration_secs - start_secs, self.final_support()));
        [0, 1].map(|axis| {
            Track::through(&points.iter().map(|(time, point)| (*time, point[axis])).collect::<Vec<_>>())
        })
    }

    fn posture(&self, manner: &Manner, start_secs: f64, duration_secs: f64) -> Posture {
        let mut posture = Posture::relaxed();
        let end_secs = duration_secs - start_secs;
        let heading = |a: &Footprint, b: &Footprint| (a.yaw_rad + b.yaw_rad) / 2.0;
        // How far each foot comes down ahead of the other, in full steps; positive when the right is ahead.
        let leads: Vec<(f64, f64, f64)> = (2..self.0.len())
            .map(|index| {
                let (own, other) = (&self.0[index], &self.0[index - 1]);
                let (a, b) = (own.stance.footprint, other.stance.footprint);
                let yaw = heading(&a, &b);
                let ahead = (b.x_m - a.x_m) * yaw.sin() + (a.y_m - b.y_m) * yaw.cos();
                (own.stance.land_secs, sign(own.side) * ahead / manner.full_step_m, yaw)
            })
            .collect();

        let swing = |offset_secs: f64, rest_deg: f64, middle_deg: f64, amplitude_deg: f64| {
            let mut points = vec![(start_secs, rest_deg.to_radians())];
            points.extend(leads.iter().map(|(time, lead, _)| {
                (time + offset_secs, (middle_deg + amplitude_deg * lead).to_radians())
            }));
            points.push((end_secs, rest_deg.to_radians()));
            Track::through(&points)
        };
        let turn = manner.pelvis_turn_deg;
        // The shoulders turn against the pelvis by about as much as it turns itself.
        *posture.track("BPz") = swing(0.02, 0.0, 0.0, -1.1 * turn);
        *posture.track("BTz") = swing(0.04, 0.0, 0.0, -0.9 * turn);
        for (arm, elbow, side) in [("LSx", "LEx", Side::Left), ("RSx", "REx", Side::Right)] {
            let rest = [arm, elbow].map(|name| posture.track(name).last().value.to_degrees());
            let forward = -sign(side);
            *posture.track(arm) = swing(0.04, rest[0], -2.0, forward * manner.arm_swing_deg);
            *posture.track(elbow) = swing(0.06, rest[1], manner.elbow_deg, forward * manner.elbow_swing_deg);
        }

        let mut yaw = vec![(start_secs, 0.0)];
        yaw.extend(leads.iter().map(|(time, lead, yaw)| (*time, yaw + (turn * lead).to_radians())));
        yaw.push((end_secs, leads.last().map_or(0.0, |lead| lead.2)));
        *posture.track("pelvis z") = Track::through(&yaw);

        let mut drop = vec![(start_secs, 0.0)];
        for index in self.carrying() {
            let (from, until) = self.single_support(index);
            let side = -sign(self.0[index].side);
            drop.push((from + 0.4 * (until - from), side * manner.pelvis_drop_deg.to_radians()));
        }
        drop.push((end_secs, 0.0));
        *posture.track("pelvis y") = Track::through(&drop);
        // The trunk stays upright over the tilting pelvis.
        let upright: Vec<_> = drop.iter().map(|(time, angle)| (*time, -angle)).collect();
        *posture.track("BPy") = Track::through(&upright);

        let (first, last) =
            (leads.first().map_or(0.0, |lead| lead.0), leads.last().map_or(0.0, |lead| lead.0));
        let lean = -manner.lean_deg.to_radians();
        let track = posture.track("pelvis x");
        for (time_secs, value) in [(start_secs, 0.0), (first, lean), (last, lean), (end_secs, 0.0)] {
            if time_secs > track.last().time_secs {
                track.push(Key { time_secs, value, rate: 0.0, acceleration: 0.0 });
            }
        }
        posture
    }
}

/// The other side.
pub(super) fn opposite(side: Side) -> Side {
    match side {
        Side::Left => Side::Right,
        Side::Right => Side::Left,
    }
}
