//! What the step loop needs of a body, whichever coordinates it is kept in.

use rapier3d_f64::prelude::RigidBodyHandle;

use super::engine::{Engine, from_pose};
use super::feed_forward::SegmentMoments;
use super::reference::ReferenceState;
use super::rollout::SegmentPoses;
use crate::humanoid::NUM_SEGMENTS;
use crate::motion::NUM_JOINTS;

/// A humanoid in the engine.
pub(super) trait Articulation {
    /// Bodies of the rigid segments; the first is the root.
    fn segments(&self) -> &[RigidBodyHandle; NUM_SEGMENTS];

    /// Sets the springs' rest state for the coming step; `moments` are added to what the springs do.
    fn command(&mut self, engine: &mut Engine, target: &ReferenceState, moments: &SegmentMoments);

    /// Joint angles (rad) and speeds (rad/s), KIT order.
    fn angles_and_speeds(&self, engine: &Engine) -> ([f64; NUM_JOINTS], [f64; NUM_JOINTS]);

    /// Takes note of what the motors did in the last step.
    fn add_step(&mut self, engine: &Engine);

    /// Motor torque about every axis, N m, KIT order, mean over the steps noted since the last call; zero without any.
    ///
    /// `angles` are those of now; a torque noted in a ball is taken about the axes as they stand now.
    fn take_torques(&mut self, angles: &[f64; NUM_JOINTS]) -> [f64; NUM_JOINTS];

    /// Poses of the segments in the world.
    fn segment_poses(&self, engine: &Engine) -> SegmentPoses {
        self.segments().map(|handle| from_pose(engine.bodies[handle].position()))
    }

    /// Largest distance between the two sides of a joint, metres: how far the body has come apart.
    fn joint_drift_m(&self, engine: &Engine) -> f64;
}
