//! The blocks of the foot in the frames of its segments, and the points of the sole.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::segments::{Block, SEGMENTS, Segment, Solid};
use crate::motion::Body;

/// Left or right half of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// Left (-x).
    Left,
    /// Right (+x).
    Right,
}

/// Part of the sole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SoleRegion {
    /// Back of the rear foot.
    Heel,
    /// Front of the midfoot, under the toe joint.
    Ball,
    /// Tip of the toes.
    Toe,
}

/// A point of the sole that can touch the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolePoint {
    /// Foot it belongs to.
    pub side: Side,
    /// Part of the sole.
    pub region: SoleRegion,
    /// Index of its link in the tree.
    pub link: usize,
    /// Position in the link frame, metres.
    pub point_in_link_m: Point3<f64>,
}

/// The two sole points of a segment of the foot, which is link `link` of the tree; nothing for other segments.
pub(super) fn sole_points(segment: &Segment, link: usize, body: Body) -> Vec<SolePoint> {
    let Some((side, region)) = foot_part(segment.name) else { return Vec::new() };
    let blocks = segment.solids.iter().filter_map(|solid| match solid {
        Solid::Block(block) => Some(place(segment, block, body)),
        Solid::Capsule { .. } => None,
    });
    // The two lower corners at the end of the block that touches first: back of the heel, front of the others.
    let end = if region == SoleRegion::Heel { -0.5 } else { 0.5 };
    blocks
        .flat_map(|PlacedBlock { segment_from_block, size_m }| {
            [-0.5, 0.5].map(|half| {
                let corner = Point3::new(half * size_m.x, end * size_m.y, -0.5 * size_m.z);
                SolePoint { side, region, link, point_in_link_m: segment_from_block * corner }
            })
        })
        .collect()
}

fn foot_part(segment_name: &str) -> Option<(Side, SoleRegion)> {
    let (side, part) = segment_name.split_once('_')?;
    let side = if side == "left" { Side::Left } else { Side::Right };
    let region = match part {
        "foot" => SoleRegion::Heel,
        "midfoot" => SoleRegion::Ball,
        "toes" => SoleRegion::Toe,
        _ => return None,
    };
    Some((side, region))
}

/// A block in the frame of its segment.
pub(super) struct PlacedBlock {
    /// Pose of the middle of the block.
    pub segment_from_block: Isometry3<f64>,
    /// Edge lengths, metres.
    pub size_m: Vector3<f64>,
}

/// The block of a foot segment for a body of this height.
pub(super) fn place(segment: &Segment, block: &Block, body: Body) -> PlacedBlock {
    let scale = body.height_m / 1000.0;
    let (min, max) = (Vector3::from(block.min_mm) * scale, Vector3::from(block.max_mm) * scale);
    let ankle_from_block = Isometry3::from(Translation3::from((min + max) / 2.0));
    PlacedBlock {
        segment_from_block: ankle_from_segment(segment, body).inverse() * ankle_from_block,
        size_m: max - min,
    }
}

/// Pose of a foot segment in the ankle frame, all joints at zero.
fn ankle_from_segment(segment: &Segment, body: Body) -> Isometry3<f64> {
    let parent = SEGMENTS.iter().find(|parent| parent.name == segment.parent);
    match parent {
        Some(parent) if foot_part(parent.name).is_some() => {
            ankle_from_segment(parent, body) * parent_from_segment(segment, body)
        }
        // The rear foot itself carries the ankle frame.
        _ => Isometry3::identity(),
    }
}

/// Pose of a segment in its parent's frame, all joints at zero.
pub(super) fn parent_from_segment(segment: &Segment, body: Body) -> Isometry3<f64> {
    let rows = segment.rotation.into_iter().flatten();
    let rotation = Rotation3::from_matrix(&Matrix3::from_row_iterator(rows));
    let offset_m = Vector3::from(segment.offset_mm) * (body.height_m / 1000.0);
    Isometry3::from_parts(Translation3::from(offset_m), UnitQuaternion::from(rotation))
}
