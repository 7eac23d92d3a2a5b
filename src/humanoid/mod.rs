//! The humanoid that performs KIT motions: 44 revolute joints, 21 rigid segments, any height and mass.
//!
//! In: a [`Body`]. Out: [`Humanoid`], its URDF, its kinematic tree and the points of its soles.
//! Joint names are KIT's; three-axis joints act x, then z, then y along the chain, elbows x then z, wrists x then y.

mod foot;
mod mass;
mod segments;
mod solids;
mod strength;
mod urdf;

pub use foot::{Side, SolePoint, SoleRegion};
pub use segments::ROOT_HEIGHT_FRACTION;
pub use solids::Solids;

use nalgebra::{Isometry3, Point3};

use crate::motion::{Body, Frame, JOINTS, NUM_JOINTS};
use crate::robot::{Robot, RobotError, parse_urdf};

/// Number of rigid segments with mass.
pub const NUM_SEGMENTS: usize = segments::SEGMENTS.len();

/// A body of given height and mass as a robot.
#[derive(Debug, Clone)]
pub struct Humanoid {
    /// Height and mass.
    pub body: Body,
    /// Tree, limits and collision shapes.
    pub robot: Robot,
    /// The URDF the robot was read from.
    pub urdf: String,
    /// Tree link of each of the [`NUM_SEGMENTS`] rigid segments, in tree order; the first is the pelvis, the root.
    pub segment_links: [usize; NUM_SEGMENTS],
    /// Two points each for heel, ball and toe of both feet.
    pub sole_points: Vec<SolePoint>,
    /// KIT joint index of each angle of the tree.
    kit_of_angle: [usize; NUM_JOINTS],
}

impl Humanoid {
    /// Builds the humanoid for a body.
    ///
    /// # Errors
    /// [`RobotError`] when the body's numbers give no valid robot (not for any body within [`crate::motion::bounds`]).
    pub fn new(body: Body) -> Result<Self, RobotError> {
        let urdf = urdf::humanoid_urdf(body);
        let robot = parse_urdf(&urdf)?;
        let missing = |name: &str| RobotError::Value {
            element: "link",
            name: name.to_owned(),
            reason: "is missing from the humanoid".to_owned(),
        };

        let mut kit_of_angle = [0; NUM_JOINTS];
        for joint in robot.tree.joints() {
            if let Some(angle) = joint.angle_index {
                kit_of_angle[angle] = JOINTS
                    .iter()
                    .position(|kit| kit.name == joint.name)
                    .ok_or_else(|| missing(&joint.name))?;
            }
        }
        let mut segment_links = [0; NUM_SEGMENTS];
        let mut sole_points = Vec::new();
        for (index, segment) in segments::SEGMENTS.iter().enumerate() {
            let link = robot.tree.link_index(segment.name).ok_or_else(|| missing(segment.name))?;
            segment_links[index] = link;
            sole_points.extend(foot::sole_points(segment, link, body));
        }
        segment_links.sort_unstable();
        Ok(Self { body, robot, urdf, segment_links, sole_points, kit_of_angle })
    }

    /// Angles in tree order from angles in KIT order.
    #[must_use]
    pub fn tree_angles(&self, kit_angles_rad: &[f64; NUM_JOINTS]) -> [f64; NUM_JOINTS] {
        self.kit_of_angle.map(|kit| kit_angles_rad[kit])
    }

    /// KIT joint index of each angle of the tree.
    #[must_use]
    pub fn kit_of_angle(&self) -> &[usize; NUM_JOINTS] {
        &self.kit_of_angle
    }

    /// Pose of every link of the tree in the world for one frame of a motion.
    #[must_use]
    pub fn forward(&self, frame: &Frame) -> Vec<Isometry3<f64>> {
        self.robot.tree.forward(&frame.world_from_root(), &self.tree_angles(&frame.joint_angles_rad))
    }

    /// Height of the root above the floor in the neutral standing pose, metres.
    #[must_use]
    pub fn standing_root_height_m(&self) -> f64 {
        ROOT_HEIGHT_FRACTION * self.body.height_m
    }

    /// The sole points in the world for the link poses of [`Humanoid::forward`], in the order of `sole_points`.
    pub fn sole_points_in_world<'a>(
        &'a self,
        world_from_link: &'a [Isometry3<f64>],
    ) -> impl Iterator<Item = Point3<f64>> + 'a {
        self.sole_points.iter().map(|point| world_from_link[point.link] * point.point_in_link_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adult() -> Humanoid {
        Humanoid::new(Body::with_default_mass(1.75)).unwrap()
    }

    #[test]
    fn has_the_joints_of_kit_and_the_mass_of_the_body() {
        let humanoid = adult();
        assert_eq!(humanoid.robot.tree.num_angles(), NUM_JOINTS);
        let mut kit = *humanoid.kit_of_angle();
        kit.sort_unstable();
        assert!(kit.iter().enumerate().all(|(index, &joint)| index == joint));
        // The frames between axes weigh a milligram each.
        let excess = humanoid.robot.tree.total_mass_kg() - humanoid.body.mass_kg;
        assert!((0.0..1e-4).contains(&excess), "{excess}");
    }

    #[test]
    fn stands_on_a_flat_sole_as_tall_as_its_body() {
        let humanoid = adult();
        let mut frame = Frame::ZERO;
        frame.root_position_m[2] = humanoid.standing_root_height_m();
        let poses = humanoid.forward(&frame);
        for point in humanoid.sole_points_in_world(&poses) {
            assert!(point.z.abs() < 2e-5 * humanoid.body.height_m, "{point}");
        }
        let head = humanoid.robot.tree.link_index("head").unwrap();
        let top = poses[head].translation.z + 0.130 * humanoid.body.height_m;
        assert!((top - humanoid.body.height_m).abs() < 1e-9, "{top}");
    }

    #[test]
    fn positive_angles_turn_the_right_way() {
        let humanoid = adult();
        let tip = |name: &str, link: &str| {
            let mut frame = Frame::ZERO;
            frame.joint_angles_rad[crate::motion::joint_index(name).unwrap()] = 0.3;
            let poses = humanoid.forward(&frame);
            poses[humanoid.robot.tree.link_index(link).unwrap()].translation.vector
        };
        // Hip flexion brings the foot forward, knee angles are negative when bent, elbows positive.
        assert!(tip("LHx", "left_foot").y > 0.1);
        assert!(tip("LKx", "left_foot").y > 0.1);
        assert!(tip("LEx", "left_hand").y > 0.05);
        // Left arm abduction (negative x is left) lifts the hand to the left.
        assert!(tip("LSy", "left_hand").x < -0.2);
        assert!(tip("RSy", "right_hand").x < 0.05);
    }
}
