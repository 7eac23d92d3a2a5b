//! Inverse kinematics of a leg: seven joint angles from the poses of pelvis and foot.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::SynthesisError;
use crate::humanoid::{Humanoid, Side};
use crate::motion::{NUM_JOINTS, joint_index};

/// Least knee bend, radians (4 degrees): a straight knee has no direction to bend and cannot track.
pub(super) const LEAST_KNEE_BEND_RAD: f64 = 0.07;

/// Geometry and joints of one leg.
#[derive(Debug, Clone)]
pub(super) struct Leg {
    hip_in_pelvis_m: Vector3<f64>,
    thigh_m: f64,
    shank_m: f64,
    hip: [usize; 3],
    knee: usize,
    ankle: [usize; 3],
}

impl Leg {
    pub fn new(humanoid: &Humanoid, side: Side) -> Result<Self, SynthesisError> {
        let letter = match side {
            Side::Left => 'L',
            Side::Right => 'R',
        };
        let kit = |name: &str| {
            let name = format!("{letter}{name}");
            joint_index(&name).ok_or(SynthesisError::Missing { name })
        };
        let offset = |name: &str| {
            let name = format!("{letter}{name}_joint");
            let joint = humanoid.robot.tree.joints().iter().find(|joint| joint.name == name);
            joint
                .map(|joint| joint.parent_from_joint.translation.vector)
                .ok_or(SynthesisError::Missing { name })
        };
        Ok(Self {
            hip_in_pelvis_m: offset("Hx")?,
            thigh_m: offset("Kx")?.norm(),
            shank_m: offset("Ax")?.norm(),
            hip: [kit("Hx")?, kit("Hz")?, kit("Hy")?],
            knee: kit("Kx")?,
            ankle: [kit("Ax")?, kit("Az")?, kit("Ay")?],
        })
    }

    /// Writes the angles that put the foot link at `world_from_foot`; the knee points midway between pelvis and foot.
    ///
    /// Returns the length in metres by which the leg is too short (zero when it reaches); it then points at the foot.
    pub fn reach(
        &self,
        world_from_pelvis: &Isometry3<f64>,
        world_from_foot: &Isometry3<f64>,
        joint_angles_rad: &mut [f64; NUM_JOINTS],
    ) -> f64 {
        let (l1, l2) = (self.thigh_m, self.shank_m);
        let straightest = (l1 * l1 + l2 * l2 + 2.0 * l1 * l2 * LEAST_KNEE_BEND_RAD.cos()).sqrt();
        let hip = world_from_pelvis * nalgebra::Point3::from(self.hip_in_pelvis_m);
        let to_ankle = world_from_foot.translation.vector - hip.coords;
        let wanted = to_ankle.norm();
        let distance = wanted.clamp(0.2 * (l1 + l2), straightest);
        let down = to_ankle / wanted;

        // The knee bends in the plane of hip and ankle whose normal is the mean of the two right-hand directions.
        let right = world_from_pelvis.rotation * Vector3::x() + world_from_foot.rotation * Vector3::x();
        let normal = (right - down * right.dot(&down)).normalize();
        let forward = normal.cross(&down);

        // Law of cosines: angle at the hip between thigh and line to the ankle, and inner angle of the knee.
        let cos_hip = (l1 * l1 + distance * distance - l2 * l2) / (2.0 * l1 * distance);
        let cos_knee = (l1 * l1 + l2 * l2 - distance * distance) / (2.0 * l1 * l2);
        let sin_hip = (1.0 - cos_hip * cos_hip).max(0.0).sqrt();
        let bend = std::f64::consts::PI - cos_knee.clamp(-1.0, 1.0).acos();

        let up = -(down * cos_hip + forward * sin_hip);
        let axes = Matrix3::from_columns(&[normal, up.cross(&normal), up]);
        let world_from_thigh = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let world_from_shank = world_from_thigh * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -bend);

        let hip_angles = chain_angles(&(world_from_pelvis.rotation.inverse() * world_from_thigh));
        let ankle_angles = chain_angles(&(world_from_shank.inverse() * world_from_foot.rotation));
        for (joint, angle) in
            self.hip.iter().chain(&self.ankle).zip(hip_angles.into_iter().chain(ankle_angles))
        {
            joint_angles_rad[*joint] = angle;
        }
        joint_angles_rad[self.knee] = -bend;
        (wanted - straightest).max(0.0)
    }
}

/// Angles (a, b, c) with `R = Rx(a) Rz(b) Ry(c)`, the order of the three-axis chains.
fn chain_angles(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let m = rotation.to_rotation_matrix();
    [m[(2, 1)].atan2(m[(1, 1)]), (-m[(0, 1)]).clamp(-1.0, 1.0).asin(), m[(0, 2)].atan2(m[(0, 0)])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, Frame};

    #[test]
    fn forward_kinematics_returns_the_foot() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        for (side, link, sign) in [(Side::Left, "left_foot", -1.0), (Side::Right, "right_foot", 1.0)] {
            let leg = Leg::new(&humanoid, side).unwrap();
            let mut frame = Frame::ZERO;
            frame.root_position_m = [0.1, -0.2, 0.85];
            frame.root_rotation_rad = [-0.2, 0.05, 0.3];
            let foot = Isometry3::from_parts(
                nalgebra::Translation3::new(0.1 + sign * 0.12, 0.05, 0.12),
                UnitQuaternion::from_euler_angles(0.2, -0.04, 0.25),
            );
            let missing = leg.reach(&frame.world_from_root(), &foot, &mut frame.joint_angles_rad);
            assert_eq!(missing, 0.0);
            let pose = humanoid.forward(&frame)[humanoid.robot.tree.link_index(link).unwrap()];
            assert!((pose.translation.vector - foot.translation.vector).norm() < 1e-9);
            assert!(pose.rotation.angle_to(&foot.rotation) < 1e-7);
            assert!(frame.joint_angles_rad[leg.knee] < -0.3, "the knee bends backwards");
        }
    }

    #[test]
    fn a_foot_out_of_reach_is_reported() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let leg = Leg::new(&humanoid, Side::Left).unwrap();
        let mut angles = [0.0; NUM_JOINTS];
        let pelvis = Isometry3::translation(0.0, 0.0, 1.2);
        let missing = leg.reach(&pelvis, &Isometry3::translation(-0.091, 0.0, 0.07), &mut angles);
        let straight = 1.13 - (leg.thigh_m + leg.shank_m);
        assert!(missing > straight && missing < straight + 1e-3, "{missing}");
        assert!((angles[leg.knee] + LEAST_KNEE_BEND_RAD).abs() < 1e-9);
    }
}
