//! Where the points of a body are in every frame of a motion.

use std::ops::Range;

use nalgebra::{UnitQuaternion, Vector3};

use super::self_contact::SelfContact;
use super::surface::{Surface, SurfaceFrame};
use crate::humanoid::{Humanoid, NUM_SEGMENTS, Side, SoleRegion, Solids};
use crate::motion::Motion;

/// Where a motion's points are in every frame; one pass of forward kinematics.
#[derive(Clone)]
pub(super) struct Trace {
    /// Frames per second.
    pub rate_hz: f64,
    /// Origins of the segments, `[frame][segment]`, metres; the first segment is the root.
    pub centers_m: Vec<[Vector3<f64>; NUM_SEGMENTS]>,
    /// Rotation of the root, `[frame]`.
    pub world_from_root: Vec<UnitQuaternion<f64>>,
    /// Centre of mass, `[frame]`, metres.
    pub com_m: Vec<Vector3<f64>>,
    /// Height of the lowest point of all collision solids, `[frame]`, metres.
    pub lowest_m: Vec<f64>,
    /// What the points on the surface of the solids show, `[frame]`.
    pub surface: Vec<SurfaceFrame>,
    /// Depth of the deepest overlap of two segments, zero without one, `[frame]`, metres.
    pub self_depth_m: Vec<f64>,
    /// The sole points.
    pub soles: Soles,
    /// `[frame * number of sole points + point]`.
    sole_points_m: Vec<Vector3<f64>>,
}

impl Trace {
    pub(super) fn new(humanoid: &Humanoid, motion: &Motion) -> Self {
        let solids = Solids::new(humanoid);
        let num_frames = motion.num_frames();
        let soles = Soles::new(humanoid);
        let mut trace = Self {
            rate_hz: motion.rate_hz(),
            centers_m: Vec::with_capacity(num_frames),
            world_from_root: Vec::with_capacity(num_frames),
            com_m: Vec::with_capacity(num_frames),
            lowest_m: Vec::with_capacity(num_frames),
            surface: Vec::with_capacity(num_frames),
            self_depth_m: Vec::with_capacity(num_frames),
            sole_points_m: Vec::with_capacity(num_frames * soles.num_points),
            soles,
        };
        let mut surface = Surface::new(humanoid, &solids);
        let self_contact = SelfContact::new(humanoid);
        let mut world_from_link = Vec::new();
        for frame in motion.frames() {
            let angles = humanoid.tree_angles(&frame.joint_angles_rad);
            humanoid.robot.tree.forward_into(&frame.world_from_root(), &angles, &mut world_from_link);
            trace.centers_m.push(humanoid.segment_links.map(|link| world_from_link[link].translation.vector));
            trace.world_from_root.push(world_from_link[0].rotation);
            trace.com_m.push(humanoid.robot.tree.center_of_mass(&world_from_link));
            trace.lowest_m.push(solids.lowest_m(&world_from_link));
            trace.surface.push(surface.frame(&world_from_link));
            trace.self_depth_m.push(self_contact.depth_m(&world_from_link));
            let sole_points = humanoid.sole_points_in_world(&world_from_link);
            trace.sole_points_m.extend(sole_points.map(|point| point.coords));
        }
        trace
    }

    /// The same of some frames in a row.
    pub(super) fn window(&self, frames: Range<usize>) -> Self {
        let num_points = self.soles.num_points;
        Self {
            rate_hz: self.rate_hz,
            centers_m: self.centers_m[frames.clone()].to_vec(),
            world_from_root: self.world_from_root[frames.clone()].to_vec(),
            com_m: self.com_m[frames.clone()].to_vec(),
            lowest_m: self.lowest_m[frames.clone()].to_vec(),
            surface: self.surface[frames.clone()].to_vec(),
            self_depth_m: self.self_depth_m[frames.clone()].to_vec(),
            soles: self.soles.clone(),
            sole_points_m: self.sole_points_m[frames.start * num_points..frames.end * num_points].to_vec(),
        }
    }

    pub(super) fn num_frames(&self) -> usize {
        self.centers_m.len()
    }

    /// World positions of the sole points in a frame, in the order of [`Humanoid::sole_points`], metres.
    pub(super) fn sole_points_m(&self, frame: usize) -> &[Vector3<f64>] {
        &self.sole_points_m[frame * self.soles.num_points..(frame + 1) * self.soles.num_points]
    }

    /// World positions of the middle of a region of the left and the right sole in a frame, metres.
    pub(super) fn middle_m(&self, frame: usize, region: SoleRegion) -> [Vector3<f64>; 2] {
        let points = self.sole_points_m(frame);
        [0, 1].map(|side| {
            let own = &self.soles.of_region[side][region as usize];
            own.iter().map(|&index| points[index]).sum::<Vector3<f64>>() / own.len() as f64
        })
    }

    /// World positions of the middle of the left and the right ball in a frame, on the sole, metres.
    pub(super) fn balls_m(&self, frame: usize) -> [Vector3<f64>; 2] {
        self.middle_m(frame, SoleRegion::Ball)
    }

    /// Frame index before a time and the share of the way to the next, for linear interpolation.
    fn place(&self, time_secs: f64) -> (usize, usize, f64) {
        let last = self.num_frames() - 1;
        let position = time_secs * self.rate_hz;
        let before = (position.floor() as usize).min(last);
        (before, (before + 1).min(last), (position - before as f64).clamp(0.0, 1.0))
    }

    /// Values of the frames at another rate from the first frame on, interpolated linearly.
    ///
    /// `value` gives the points of a frame.
    pub(super) fn resampled<const N: usize>(
        &self,
        rate_hz: f64,
        value: impl Fn(usize) -> [Vector3<f64>; N],
    ) -> Vec<[Vector3<f64>; N]> {
        let duration_secs = (self.num_frames() - 1) as f64 / self.rate_hz;
        // A hair more than the duration, so that rounding does not lose the last frame.
        let num_steps = (duration_secs * rate_hz + 1e-6).floor() as usize;
        (0..=num_steps)
            .map(|step| {
                let (before, after, share) = self.place(step as f64 / rate_hz);
                let (from, to) = (value(before), value(after));
                std::array::from_fn(|index| from[index].lerp(&to[index], share))
            })
            .collect()
    }
}

/// Which sole point is where on which foot.
#[derive(Clone)]
pub(super) struct Soles {
    pub num_points: usize,
    /// Indices of the sole points by foot (left, right) and [`SoleRegion`].
    pub of_region: [[Vec<usize>; 3]; 2],
    /// Foot of each sole point: 0 left, 1 right.
    pub foot: Vec<usize>,
}

impl Soles {
    fn new(humanoid: &Humanoid) -> Self {
        let of = |side: Side, region: SoleRegion| {
            let points = humanoid.sole_points.iter().enumerate();
            points
                .filter(|(_, point)| point.side == side && point.region == region)
                .map(|(index, _)| index)
                .collect::<Vec<_>>()
        };
        let of_region = [Side::Left, Side::Right]
            .map(|side| [SoleRegion::Heel, SoleRegion::Ball, SoleRegion::Toe].map(|region| of(side, region)));
        let foot = humanoid.sole_points.iter().map(|point| usize::from(point.side == Side::Right)).collect();
        Self { num_points: humanoid.sole_points.len(), of_region, foot }
    }
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
