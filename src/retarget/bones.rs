//! What of the humanoid is matched with what of a source: bones, axes of segments, and places to reach.

use super::Role;
use super::role::{NUM_ORIENTED, Segment};

/// A direction between two joint centres, matched by one of our segments.
pub(super) struct BoneTask {
    pub link: &'static str,
    pub from: Role,
    pub to: Role,
    /// In the segment's frame; `None`: from the segment's origin to that of the link of `to`.
    pub local: Option<[f64; 3]>,
    pub weight: f64,
    /// The segment whose orientation, where the source has it, says more than this bone.
    pub instead: Option<Segment>,
}

const fn bone(
    link: &'static str,
    from: Role,
    to: Role,
    local: Option<[f64; 3]>,
    weight: f64,
    instead: Option<Segment>,
) -> BoneTask {
    BoneTask { link, from, to, local, weight, instead }
}

const RIGHT: Option<[f64; 3]> = Some([1.0, 0.0, 0.0]);
const UP: Option<[f64; 3]> = Some([0.0, 0.0, 1.0]);
const DOWN: Option<[f64; 3]> = Some([0.0, 0.0, -1.0]);
const FORWARD: Option<[f64; 3]> = Some([0.0, 1.0, 0.0]);

#[rustfmt::skip]
pub(super) const BONES: [BoneTask; 24] = [
    bone("pelvis", Role::LeftHip, Role::RightHip, RIGHT, 1.0, None),
    bone("pelvis", Role::LeftHip, Role::Abdomen, UP, 1.0, Some(Segment::Pelvis)),
    bone("abdomen", Role::Abdomen, Role::Thorax, UP, 1.0, None),
    bone("thorax", Role::Thorax, Role::Neck, UP, 1.0, Some(Segment::Thorax)),
    bone("thorax", Role::LeftShoulder, Role::RightShoulder, RIGHT, 0.5, Some(Segment::Thorax)),
    bone("neck", Role::Neck, Role::Head, UP, 0.3, None),
    bone("head", Role::Head, Role::HeadTop, UP, 0.3, Some(Segment::Head)),
    bone("left_thigh", Role::LeftHip, Role::LeftKnee, DOWN, 1.0, None),
    bone("right_thigh", Role::RightHip, Role::RightKnee, DOWN, 1.0, None),
    bone("left_shank", Role::LeftKnee, Role::LeftAnkle, DOWN, 1.0, None),
    bone("right_shank", Role::RightKnee, Role::RightAnkle, DOWN, 1.0, None),
    bone("left_foot", Role::LeftAnkle, Role::LeftToe, None, 1.0, Some(Segment::LeftFoot)),
    bone("right_foot", Role::RightAnkle, Role::RightToe, None, 1.0, Some(Segment::RightFoot)),
    bone("left_foot", Role::LeftAnkle, Role::LeftMidfoot, None, 1.0, Some(Segment::LeftFoot)),
    bone("right_foot", Role::RightAnkle, Role::RightMidfoot, None, 1.0, Some(Segment::RightFoot)),
    bone("left_midfoot", Role::LeftMidfoot, Role::LeftToe, None, 1.0, None),
    bone("right_midfoot", Role::RightMidfoot, Role::RightToe, None, 1.0, None),
    bone("left_upper_arm", Role::LeftShoulder, Role::LeftElbow, DOWN, 1.0, None),
    bone("right_upper_arm", Role::RightShoulder, Role::RightElbow, DOWN, 1.0, None),
    bone("left_forearm", Role::LeftElbow, Role::LeftWrist, DOWN, 1.0, None),
    bone("right_forearm", Role::RightElbow, Role::RightWrist, DOWN, 1.0, None),
    bone("left_hand", Role::LeftWrist, Role::LeftHand, DOWN, 0.3, None),
    bone("right_hand", Role::RightWrist, Role::RightHand, DOWN, 0.3, None),
    bone("left_toes", Role::LeftToe, Role::LeftToeTip, FORWARD, 0.0, None),
];

/// Weights of the up and forward axes of each segment, in the order of [`Segment`].
pub(super) const AXIS_WEIGHTS: [[f64; 2]; NUM_ORIENTED] = [
    [1.0, 1.0],
    [1.0, 1.0],
    [0.5, 1.0],
    // Twist of the arm: small, since it matters only where the elbow is straight and says nothing.
    [0.1, 0.1],
    [0.1, 0.1],
    [0.1, 0.1],
    [0.1, 0.1],
    [0.2, 0.1],
    [0.2, 0.1],
    [0.1, 0.05],
    [0.1, 0.05],
    [1.0, 1.0],
    [1.0, 1.0],
    [0.1, 0.1],
    [0.1, 0.1],
];

/// Joints that should also be near the source's, moved with the pelvis: link, role, weight.
///
/// With other proportions direction and place contradict each other; hands then give up some of either.
pub(super) const REACHES: [(&str, Role, f64); 4] = [
    ("left_forearm", Role::LeftElbow, 0.4),
    ("right_forearm", Role::RightElbow, 0.4),
    ("left_hand", Role::LeftWrist, 0.4),
    ("right_hand", Role::RightWrist, 0.4),
];
