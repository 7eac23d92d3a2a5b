//! Where the points of a body are in every frame of a motion.

use nalgebra::Vector3;

use super::solids::Solids;
use crate::humanoid::{Humanoid, NUM_SEGMENTS, Side, SoleRegion};
use crate::motion::Motion;

/// World positions of a motion's joint centres, sole points and lowest point; one pass of forward kinematics.
pub(super) struct Trace {
    /// Frames per second.
    pub rate_hz: f64,
    /// Origins of the segments, `[frame][segment]`, metres; the first segment is the root.
    pub centers_m: Vec<[Vector3<f64>; NUM_SEGMENTS]>,
    /// Height of the lowest point of all collision solids, `[frame]`, metres.
    pub lowest_m: Vec<f64>,
    /// Sole points under the toe joint of the left and the right foot.
    ball_points: [Vec<usize>; 2],
    num_sole_points: usize,
    /// `[frame * num_sole_points + point]`.
    sole_points_m: Vec<Vector3<f64>>,
}

impl Trace {
    pub(super) fn new(humanoid: &Humanoid, motion: &Motion) -> Self {
        let solids = Solids::new(humanoid);
        let num_frames = motion.num_frames();
        let num_sole_points = humanoid.sole_points.len();
        let mut trace = Self {
            rate_hz: motion.rate_hz(),
            centers_m: Vec::with_capacity(num_frames),
            lowest_m: Vec::with_capacity(num_frames),
            ball_points: [Side::Left, Side::Right].map(|side| ball_points(humanoid, side)),
            num_sole_points,
            sole_points_m: Vec::with_capacity(num_frames * num_sole_points),
        };
        let mut world_from_link = Vec::new();
        for frame in motion.frames() {
            let angles = humanoid.tree_angles(&frame.joint_angles_rad);
            humanoid.robot.tree.forward_into(&frame.world_from_root(), &angles, &mut world_from_link);
            trace.centers_m.push(humanoid.segment_links.map(|link| world_from_link[link].translation.vector));
            trace.lowest_m.push(solids.lowest_m(&world_from_link));
            let sole_points = humanoid.sole_points_in_world(&world_from_link);
            trace.sole_points_m.extend(sole_points.map(|point| point.coords));
        }
        trace
    }

    pub(super) fn num_frames(&self) -> usize {
        self.centers_m.len()
    }

    /// World positions of the sole points in a frame, in the order of [`Humanoid::sole_points`], metres.
    pub(super) fn sole_points_m(&self, frame: usize) -> &[Vector3<f64>] {
        &self.sole_points_m[frame * self.num_sole_points..(frame + 1) * self.num_sole_points]
    }

    /// World positions of the middle of the left and the right ball in a frame, on the sole, metres.
    pub(super) fn balls_m(&self, frame: usize) -> [Vector3<f64>; 2] {
        let points = self.sole_points_m(frame);
        [0, 1].map(|side| {
            let own = &self.ball_points[side];
            own.iter().map(|&index| points[index]).sum::<Vector3<f64>>() / own.len() as f64
        })
    }
}

/// Indices of the sole points under the ball of a foot.
fn ball_points(humanoid: &Humanoid, side: Side) -> Vec<usize> {
    let points = humanoid.sole_points.iter().enumerate();
    points
        .filter(|(_, point)| point.side == side && point.region == SoleRegion::Ball)
        .map(|(index, _)| index)
        .collect()
}

/// Length of the horizontal part of a displacement, metres.
pub(super) fn horizontal_m(displacement: &Vector3<f64>) -> f64 {
    displacement.xy().norm()
}

/// Mean of the values; `None` without any.
pub(super) fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, count) =
        values.into_iter().fold((0.0, 0_usize), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Median of the values, the mean of the middle two when they are even in number; `None` without any.
pub(super) fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    Some((sorted[last / 2] + sorted[last.div_ceil(2)]) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_median_of_nothing_are_absent() {
        assert_eq!((mean([]), median([])), (None, None));
        assert_eq!((mean([1.0, 2.0, 6.0]), median([6.0, 1.0, 2.0])), (Some(3.0), Some(2.0)));
        assert_eq!(median([8.0, 1.0, 2.0, 4.0]), Some(3.0));
        assert_eq!(median([5.0]), Some(5.0));
    }
}
