//! How tall a body is, from the distances between its joints.

use nalgebra::Vector3;

use super::Role;
use super::source::SourceFrame;
use crate::humanoid::Humanoid;
use crate::motion::Frame;

/// Distances between joint centres of the humanoid, per metre of body height.
#[derive(Debug, Clone, Copy)]
pub(super) struct Proportions {
    pub thigh: f64,
    pub shank: f64,
    /// From the middle of the hips to the middle of the shoulders, upright.
    pub shoulders: f64,
    /// From the middle of the hips to the base of the neck, upright.
    pub neck: f64,
    /// Ankle above the floor, standing.
    pub ankle: f64,
}

impl Proportions {
    pub(super) fn of(humanoid: &Humanoid) -> Self {
        let poses = humanoid.forward(&Frame::ZERO);
        let centre = |role: Role| {
            let link = role.link().and_then(|link| humanoid.robot.tree.link_index(link));
            // Every role asked for here is a link of the humanoid.
            link.map_or(Vector3::zeros(), |link| poses[link].translation.vector) / humanoid.body.height_m
        };
        let distance = |a: Role, b: Role| (centre(a) - centre(b)).norm();
        let ankle = centre(Role::LeftAnkle).z + humanoid.standing_root_height_m() / humanoid.body.height_m;
        Self {
            thigh: distance(Role::LeftHip, Role::LeftKnee),
            shank: distance(Role::LeftKnee, Role::LeftAnkle),
            shoulders: centre(Role::LeftShoulder).z,
            neck: centre(Role::Neck).z,
            ankle,
        }
    }
}

/// Weight of the hips' height against knees, shoulders and neck, which count once, half and half.
const WEIGHTS: [f64; 4] = [1.0, 2.0, 0.5, 0.5];

/// Share of the frames in which the trunk is shorter than the length taken for it: it is longest when upright.
const UPRIGHT_SHARE: f64 = 0.75;

/// Body height in the length unit of the frames.
///
/// Knees, hips, shoulders and neck lie at fixed fractions of the humanoid's height above its ankles when it stands; the
/// height is the one for which the source's own, stacked from its bones, fit these best in the sense of least squares.
/// Bones have the median length of all frames, the trunk the upper quartile.
pub(super) fn height_m(frames: &[SourceFrame], proportions: &Proportions) -> Option<f64> {
    let quantile = |share: f64, length: &dyn Fn(&SourceFrame) -> f64| {
        let mut lengths: Vec<f64> = frames.iter().map(length).filter(|length| length.is_finite()).collect();
        let index = ((lengths.len() as f64 - 1.0) * share).round().max(0.0) as usize;
        (!lengths.is_empty()).then(|| *lengths.select_nth_unstable_by(index, f64::total_cmp).1)
    };
    let limb = |a: [Role; 2], b: [Role; 2]| {
        quantile(0.5, &|frame| {
            (0..2).map(|side| (frame.centre(a[side]) - frame.centre(b[side])).norm()).sum::<f64>() / 2.0
        })
    };
    let (hips, knees) = ([Role::LeftHip, Role::RightHip], [Role::LeftKnee, Role::RightKnee]);
    let thigh = limb(hips, knees)?;
    let shank = limb(knees, [Role::LeftAnkle, Role::RightAnkle])?;
    let shoulders = quantile(UPRIGHT_SHARE, &|frame| {
        let middle = (frame.centre(Role::LeftShoulder) + frame.centre(Role::RightShoulder)) / 2.0;
        (middle - frame.pelvis()).norm()
    })?;
    let neck = quantile(UPRIGHT_SHARE, &|frame| (frame.centre(Role::Neck) - frame.pelvis()).norm())?;

    let leg = proportions.thigh + proportions.shank;
    let ours = [proportions.shank, leg, leg + proportions.shoulders, leg + proportions.neck];
    let theirs = [shank, shank + thigh, shank + thigh + shoulders, shank + thigh + neck];
    let sum =
        |product: &dyn Fn(usize) -> f64| (0..4).map(|index| WEIGHTS[index] * product(index)).sum::<f64>();
    Some(sum(&|index| ours[index] * theirs[index]) / sum(&|index| ours[index] * ours[index]))
}
