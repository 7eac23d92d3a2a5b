//! Where a foot is: stances that roll over heel and toes without slipping, and swings between them.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::SynthesisError;
use super::track::{Key, Track};
use crate::humanoid::{Humanoid, Side, SoleRegion};
use crate::kinematics::{JointKind, Tree};

/// Which part of a foot bears load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// The foot is in the air.
    None,
    /// The back edge of the heel; the foot rolls about it.
    Heel,
    /// The whole sole, which does not move.
    Sole,
    /// The toes, which do not move while the foot rolls about the toe joint.
    Toes,
}

/// A footprint: the point of the floor below the ankle of a flat foot, and its heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Footprint {
    pub x_m: f64,
    pub y_m: f64,
    /// Positive to the left.
    pub yaw_rad: f64,
}

impl Footprint {
    /// World position of a point of the flat sole, `forward_m` ahead of the ankle.
    pub fn ahead(&self, forward_m: f64) -> [f64; 2] {
        [self.x_m - forward_m * self.yaw_rad.sin(), self.y_m + forward_m * self.yaw_rad.cos()]
    }
}

/// A foot on the floor, from landing to leaving.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stance {
    pub footprint: Footprint,
    /// Touches the floor.
    pub land_secs: f64,
    /// Is flat.
    pub flat_secs: f64,
    /// Starts to lift the heel.
    pub heel_off_secs: f64,
    /// Leaves the floor.
    pub leave_secs: f64,
    /// Pitch on landing: positive lands on the heel, negative on the toes with the toe joint bent by as much (more than
    /// `tiptoe_rad`).
    pub land_pitch_rad: f64,
    /// Toe joint angle on leaving (more than `tiptoe_rad`).
    pub leave_toe_rad: f64,
    /// Toe joint angle between landing and leaving: zero for a flat sole, positive to stay on the toes.
    pub tiptoe_rad: f64,
}

impl Stance {
    /// On the floor with a flat sole all the time.
    pub fn flat(footprint: Footprint, land_secs: f64, leave_secs: f64) -> Self {
        Self {
            footprint,
            land_secs,
            flat_secs: land_secs,
            heel_off_secs: leave_secs,
            leave_secs,
            land_pitch_rad: 0.0,
            leave_toe_rad: 0.0,
            tiptoe_rad: 0.0,
        }
    }
}

/// A place the ankle passes during a swing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Via {
    pub time_secs: f64,
    pub ankle_m: [f64; 3],
    /// Velocity of the ankle, m/s; the pitch rests.
    pub velocity_m_s: [f64; 3],
    pub yaw_rad: f64,
    /// Positive with the toes up.
    pub pitch_rad: f64,
}

/// What a foot does between two stances.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Swing {
    /// Height added to the ankle in the middle of the swing, metres.
    pub lift_m: f64,
    /// Angle by which the toes hang lower in the first half of the swing, while the shank is tilted forward.
    pub dip_rad: f64,
    /// Places to pass, in order of time.
    pub via: Vec<Via>,
}

/// Pose of a foot at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FootPose {
    pub world_from_foot: Isometry3<f64>,
    pub toe_rad: f64,
    pub contact: Contact,
}

/// Geometry of one foot, in the frame of its foot link (origin at the ankle).
#[derive(Debug, Clone)]
pub(super) struct FootGeometry {
    sole_depth_m: f64,
    heel_behind_m: f64,
    foot_from_toe_joint: Isometry3<f64>,
    toe_axis: nalgebra::Unit<Vector3<f64>>,
}

impl FootGeometry {
    pub fn new(humanoid: &Humanoid, side: Side) -> Result<Self, SynthesisError> {
        let heel = humanoid
            .sole_points
            .iter()
            .find(|point| point.side == side && point.region == SoleRegion::Heel)
            .ok_or_else(|| SynthesisError::Missing { name: "heel".to_owned() })?;
        let toes = humanoid
            .sole_points
            .iter()
            .find(|point| point.side == side && point.region == SoleRegion::Toe)
            .ok_or_else(|| SynthesisError::Missing { name: "toes".to_owned() })?;
        let tree: &Tree = &humanoid.robot.tree;
        let zero = tree.forward(&Isometry3::identity(), &vec![0.0; tree.num_angles()]);
        let (Some(toe_joint), Some(foot)) = (tree.joint_above(toes.link), Some(heel.link)) else {
            return Err(SynthesisError::Missing { name: "toe joint".to_owned() });
        };
        let JointKind::Revolute { axis } = toe_joint.kind else {
            return Err(SynthesisError::Missing { name: "toe joint".to_owned() });
        };
        Ok(Self {
            sole_depth_m: -heel.point_in_link_m.z,
            heel_behind_m: -heel.point_in_link_m.y,
            foot_from_toe_joint: zero[foot].inverse() * zero[toes.link],
            toe_axis: axis,
        })
    }

    fn flat(&self, footprint: &Footprint) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::new(footprint.x_m, footprint.y_m, self.sole_depth_m),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), footprint.yaw_rad),
        )
    }

    /// Pitched about the back edge of the heel, toes up.
    fn on_heel(&self, footprint: &Footprint, pitch_rad: f64) -> Isometry3<f64> {
        let heel = Translation3::new(0.0, -self.heel_behind_m, -self.sole_depth_m);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch_rad);
        self.flat(footprint) * heel * roll * heel.inverse()
    }

    /// Rolled over the toe joint, which is bent by `toe_rad` so that the toes stay where they are.
    fn on_toes(&self, footprint: &Footprint, toe_rad: f64) -> Isometry3<f64> {
        let bent = self.foot_from_toe_joint * UnitQuaternion::from_axis_angle(&self.toe_axis, toe_rad);
        self.flat(footprint) * self.foot_from_toe_joint * bent.inverse()
    }

    fn stance_pose(&self, stance: &Stance, time_secs: f64) -> FootPose {
        let on_toes = |toe_rad| FootPose {
            world_from_foot: self.on_toes(&stance.footprint, toe_rad),
            toe_rad,
            contact: Contact::Toes,
        };
        if time_secs < stance.flat_secs {
            let left = (stance.flat_secs - time_secs) / (stance.flat_secs - stance.land_secs);
            let pitch = stance.land_pitch_rad * roll(left, LANDING_RATE);
            if stance.land_pitch_rad < 0.0 {
                return on_toes(stance.tiptoe_rad - pitch);
            }
            return FootPose {
                world_from_foot: self.on_heel(&stance.footprint, pitch),
                toe_rad: 0.0,
                contact: Contact::Heel,
            };
        }
        if time_secs > stance.heel_off_secs {
            let done = (time_secs - stance.heel_off_secs) / (stance.leave_secs - stance.heel_off_secs);
            return on_toes(stance.tiptoe_rad + stance.leave_toe_rad * roll(done, LEAVING_RATE));
        }
        if stance.tiptoe_rad > 0.0 {
            return on_toes(stance.tiptoe_rad);
        }
        FootPose { world_from_foot: self.flat(&stance.footprint), toe_rad: 0.0, contact: Contact::Sole }
    }
}

/// Rate of a roll at landing, in rolls per duration.
const LANDING_RATE: f64 = 1.0;
/// Rate of a roll at leaving, in rolls per duration.
const LEAVING_RATE: f64 = 1.5;

/// From 0 at rest to 1 at the given rate and no acceleration.
fn roll(s: f64, rate: f64) -> f64 {
    s.powi(3) * (10.0 - 4.0 * rate + s * (7.0 * rate - 15.0 + s * (6.0 - 3.0 * rate)))
}

/// Ankle position, yaw, pitch, roll and toe angle: the numbers a swing moves.
type Coordinates = [f64; 7];

fn coordinates(pose: &FootPose, heading_rad: f64) -> Coordinates {
    let position = pose.world_from_foot.translation.vector;
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading_rad);
    let m = (heading.inverse() * pose.world_from_foot.rotation).to_rotation_matrix();
    // R = Rz(yaw) Rx(pitch) Ry(roll), yaw counted from the heading so that it may exceed half a turn.
    let pitch = m[(2, 1)].clamp(-1.0, 1.0).asin();
    let yaw = heading_rad + (-m[(0, 1)]).atan2(m[(1, 1)]);
    let roll = (-m[(2, 0)]).atan2(m[(2, 2)]);
    [position.x, position.y, position.z, yaw, pitch, roll, pose.toe_rad]
}

#[derive(Debug, Clone)]
struct SwingTracks {
    tracks: [Track; 7],
    lift_m: f64,
    dip_rad: f64,
    from_secs: f64,
    until_secs: f64,
}

impl SwingTracks {
    fn pose(&self, time_secs: f64) -> FootPose {
        let [x, y, mut z, yaw, mut pitch, roll, toe_rad] =
            std::array::from_fn(|i| self.tracks[i].at(time_secs));
        let s = (time_secs - self.from_secs) / (self.until_secs - self.from_secs);
        // Bumps of height one with no rate and no acceleration at their ends; the second peaks at 3/7.
        z += self.lift_m * 64.0 * (s * (1.0 - s)).powi(3);
        pitch -= self.dip_rad * 119.14 * s.powi(3) * (1.0 - s).powi(4);
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch)
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), roll);
        FootPose {
            world_from_foot: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
            toe_rad,
            contact: Contact::None,
        }
    }
}

/// A foot over the whole motion.
#[derive(Debug, Clone)]
pub(super) struct FootTrack {
    geometry: FootGeometry,
    stances: Vec<Stance>,
    swings: Vec<SwingTracks>,
}

impl FootTrack {
    /// Joins stances by swings; there is one swing fewer than stances.
    pub fn new(geometry: FootGeometry, stances: Vec<Stance>, swings: &[Swing]) -> Self {
        debug_assert_eq!(stances.len(), swings.len() + 1, "one swing between two stances");
        let swings = stances
            .windows(2)
            .zip(swings)
            .map(|(pair, swing)| swing_tracks(&geometry, &pair[0], &pair[1], swing))
            .collect();
        Self { geometry, stances, swings }
    }

    pub fn at(&self, time_secs: f64) -> FootPose {
        for (stance, swing) in self.stances.iter().zip(&self.swings) {
            if time_secs <= stance.leave_secs {
                return self.geometry.stance_pose(stance, time_secs.max(stance.land_secs));
            }
            if time_secs < swing.until_secs {
                return swing.pose(time_secs);
            }
        }
        let last = &self.stances[self.stances.len() - 1];
        self.geometry.stance_pose(last, time_secs.min(last.leave_secs))
    }
}

fn swing_tracks(geometry: &FootGeometry, from: &Stance, to: &Stance, swing: &Swing) -> SwingTracks {
    // State of the rolling foot at the ends, by one-sided differences into the stance.
    let state = |stance: &Stance, time: f64, into_stance: f64| -> [Key; 7] {
        let h = into_stance * 1e-3;
        let [a, b, c, d] = [0.0, h, 2.0 * h, 3.0 * h].map(|offset| {
            coordinates(&geometry.stance_pose(stance, time + offset), stance.footprint.yaw_rad)
        });
        std::array::from_fn(|i| Key {
            time_secs: time,
            value: a[i],
            rate: (-11.0 * a[i] + 18.0 * b[i] - 9.0 * c[i] + 2.0 * d[i]) / (6.0 * h),
            acceleration: (2.0 * a[i] - 5.0 * b[i] + 4.0 * c[i] - d[i]) / (h * h),
        })
    };
    let start = state(from, from.leave_secs, -1.0);
    let end = state(to, to.land_secs, 1.0);
    let tracks = std::array::from_fn(|i| {
        let mut track = Track::from_key(start[i]);
        for via in &swing.via {
            let ([x, y, z], [vx, vy, vz]) = (via.ankle_m, via.velocity_m_s);
            let value = [x, y, z, via.yaw_rad, via.pitch_rad, 0.0, 0.0][i];
            let rate = [vx, vy, vz, 0.0, 0.0, 0.0, 0.0][i];
            track.push(Key { time_secs: via.time_secs, value, rate, acceleration: 0.0 });
        }
        track.push(end[i]);
        track
    });
    SwingTracks {
        tracks,
        lift_m: swing.lift_m,
        dip_rad: swing.dip_rad,
        from_secs: from.leave_secs,
        until_secs: to.land_secs,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Body;
    use crate::synthesis::actor::standing_footprint;

    fn step() -> FootTrack {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let geometry = FootGeometry::new(&humanoid, Side::Right).unwrap();
        let footprint = standing_footprint(Side::Right);
        let from = Stance { heel_off_secs: 0.7, leave_toe_rad: 0.6, ..Stance::flat(footprint, 0.0, 1.0) };
        let ahead = Footprint { y_m: 0.6, ..footprint };
        let to = Stance { flat_secs: 1.5, land_pitch_rad: 0.2, ..Stance::flat(ahead, 1.4, 2.0) };
        FootTrack::new(geometry, vec![from, to], &[Swing { lift_m: 0.06, dip_rad: 0.1, via: Vec::new() }])
    }

    #[test]
    fn the_foot_rolls_over_toes_that_stay() {
        let foot = step();
        let toes = |time: f64| {
            let pose = foot.at(time);
            assert_eq!(pose.contact, if time > 0.7 { Contact::Toes } else { Contact::Sole });
            let bend = UnitQuaternion::from_axis_angle(&foot.geometry.toe_axis, pose.toe_rad);
            pose.world_from_foot * foot.geometry.foot_from_toe_joint * bend
        };
        for time in [0.75, 0.85, 1.0] {
            assert!((toes(time).translation.vector - toes(0.5).translation.vector).norm() < 1e-12);
            assert!(toes(time).rotation.angle_to(&toes(0.5).rotation) < 1e-7);
        }
        assert!(
            foot.at(1.0).world_from_foot.translation.z > foot.at(0.5).world_from_foot.translation.z + 0.05
        );
    }

    #[test]
    fn the_heel_lands_where_the_footprint_is() {
        let foot = step();
        let heel = nalgebra::Point3::new(0.0, -foot.geometry.heel_behind_m, -foot.geometry.sole_depth_m);
        for time in [1.4, 1.43, 1.47, 1.6] {
            let place = foot.at(time).world_from_foot * heel;
            assert!((place - foot.at(1.6).world_from_foot * heel).norm() < 1e-12);
            assert!(place.z.abs() < 1e-12);
        }
    }

    #[test]
    fn velocity_and_acceleration_are_continuous() {
        let foot = step();
        let position = |time: f64| foot.at(time).world_from_foot.translation.vector;
        let h = 1e-4;
        for time in [0.7, 1.0, 1.4, 1.5] {
            let rate = |t: f64| (position(t + h) - position(t - h)) / (2.0 * h);
            let acceleration = |t: f64| (position(t + h) - 2.0 * position(t) + position(t - h)) / (h * h);
            assert!((rate(time + 2.0 * h) - rate(time - 2.0 * h)).norm() < 0.02, "{time}");
            assert!((acceleration(time + 2.0 * h) - acceleration(time - 2.0 * h)).norm() < 0.5, "{time}");
        }
    }
}
