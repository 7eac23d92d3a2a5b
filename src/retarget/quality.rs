//! How well a motion follows its source.

use nalgebra::{Isometry3, Vector3};

use super::Role;
use super::role::{NUM_ROLES, ROLES};
use super::source::{Source, SourceFrame};
use super::stance::{FootPaths, Stance, quantile, speeds};
use super::target::Plan;
use crate::humanoid::{Humanoid, Side};
use crate::motion::{JOINTS, Motion, NUM_JOINTS};

/// A bone turned further than this from the source's is on its way to being flipped, radians,
pub(super) const FLIP_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// and is flipped when it stays so for this long, seconds.
const FLIP_SECS: f64 = 0.2;
/// An angle this close to a limit is at it, radians.
const AT_LIMIT_RAD: f64 = 1e-3;

/// Residual of one joint centre over a clip, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointResidual {
    /// The joint.
    pub role: Role,
    /// Median distance from the source's joint centre, once the clip is moved vertically to stand on the floor.
    pub raw_m: f64,
    /// Median distance from where the joint would be with the source's bone directions and our bone lengths.
    pub pose_m: f64,
    /// Median distance between those two: what proportions alone make.
    pub proportion_m: f64,
}

/// Direction error of one bone over a clip, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoneError {
    /// Name of the segment.
    pub bone: &'static str,
    /// Median angle between our bone and the source's.
    pub median_rad: f64,
    /// Largest angle that lasted at least 0.2 s.
    pub sustained_rad: f64,
}

/// What came out of a clip.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Joint centres, in the order of [`Role`].
    pub joints: Vec<JointResidual>,
    /// Bones of limbs, neck and head.
    pub bones: Vec<BoneError>,
    /// Median over joints and frames of the distance from the source's joint centres, once the clip stands on the floor,
    /// metres.
    pub raw_median_m: f64,
    /// The same at our proportions, metres.
    pub pose_median_m: f64,
    /// Share of all angles (0 to 1) that rest at a limit.
    pub at_limit: f64,
    /// Largest excess of any angle over its limits, radians.
    pub beyond_limit_rad: f64,
    /// Bones more than 60 degrees from their source for over 0.2 s.
    pub flipped: Vec<&'static str>,
    /// Share of frames (0 to 1) in which a foot stands in the source and ours does too, or neither; both feet.
    pub contact_agreement: f64,
    /// Median and 95th percentile of the distance of the lowest point of the sole from the floor in flat stance, metres.
    pub stance_height_m: Option<[f64; 2]>,
    /// Median speed of the lowest sole points in flat stance, metres per second.
    pub stance_slip_m_s: Option<f64>,
    /// Median speed of the source's ankles in the same frames, metres per second.
    pub source_slip_m_s: Option<f64>,
    /// Length of our root's horizontal path over that of the source; `None` when the source travels less than 0.5 m.
    pub travel_ratio: Option<f64>,
    /// Vertical distance by which the clip was moved to stand on the floor, metres.
    pub ground_shift_m: f64,
    /// Largest change of an angle between two frames, radians per second, and the joint's name.
    pub fastest_rad_s: (f64, &'static str),
}

/// Bones that are looked at: name, from, to.
const BONES: [(&str, Role, Role); 9] = [
    ("left upper arm", Role::LeftShoulder, Role::LeftElbow),
    ("right upper arm", Role::RightShoulder, Role::RightElbow),
    ("left forearm", Role::LeftElbow, Role::LeftWrist),
    ("right forearm", Role::RightElbow, Role::RightWrist),
    ("left thigh", Role::LeftHip, Role::LeftKnee),
    ("right thigh", Role::RightHip, Role::RightKnee),
    ("left shank", Role::LeftKnee, Role::LeftAnkle),
    ("right shank", Role::RightKnee, Role::RightAnkle),
    ("head", Role::Neck, Role::Head),
];

/// Joints whose place at our proportions is found from another: role, the one before it.
const TREE: [(Role, Role); 13] = [
    (Role::LeftKnee, Role::LeftHip),
    (Role::RightKnee, Role::RightHip),
    (Role::LeftAnkle, Role::LeftKnee),
    (Role::RightAnkle, Role::RightKnee),
    (Role::LeftToe, Role::LeftAnkle),
    (Role::RightToe, Role::RightAnkle),
    (Role::Head, Role::Neck),
    (Role::LeftShoulder, Role::Neck),
    (Role::RightShoulder, Role::Neck),
    (Role::LeftElbow, Role::LeftShoulder),
    (Role::RightElbow, Role::RightShoulder),
    (Role::LeftWrist, Role::LeftElbow),
    (Role::RightWrist, Role::RightElbow),
];

/// Toe and ankle of both feet.
const FEET: [(Role, Role); 2] = [(Role::LeftToe, Role::LeftAnkle), (Role::RightToe, Role::RightAnkle)];

impl Quality {
    pub(super) fn of(humanoid: &Humanoid, motion: &Motion, source: &Source, plan: &Plan) -> Self {
        let measured = Measured::new(humanoid, motion, source, plan);
        let roles: Vec<Role> = Role::all().filter(|role| ROLES[role.index()].required).collect();
        let median = |values: &[f64]| if values.is_empty() { f64::NAN } else { quantile(values, 0.5) };
        let joints: Vec<JointResidual> = roles
            .iter()
            .map(|&role| JointResidual {
                role,
                raw_m: median(&measured.raw[role.index()]),
                pose_m: median(&measured.pose[role.index()]),
                proportion_m: median(&measured.proportion[role.index()]),
            })
            .collect();
        let bones: Vec<BoneError> = BONES
            .iter()
            .zip(&measured.bones)
            .map(|((bone, _, _), angles)| BoneError {
                bone,
                median_rad: median(angles),
                sustained_rad: sustained(angles, source.rate_hz),
            })
            .collect();
        let flipped =
            bones.iter().filter(|bone| bone.sustained_rad > FLIP_RAD).map(|bone| bone.bone).collect();
        let (at_limit, beyond_limit_rad) = limits(motion);
        Self {
            joints,
            raw_median_m: median(&measured.raw.concat()),
            pose_median_m: median(&measured.pose.concat()),
            bones,
            at_limit,
            beyond_limit_rad,
            flipped,
            contact_agreement: measured.agreement,
            stance_height_m: (!measured.stance_heights.is_empty())
                .then(|| [quantile(&measured.stance_heights, 0.5), quantile(&measured.stance_heights, 0.95)]),
            stance_slip_m_s: (!measured.stance_slips.is_empty())
                .then(|| quantile(&measured.stance_slips, 0.5)),
            source_slip_m_s: (!measured.source_slips.is_empty())
                .then(|| quantile(&measured.source_slips, 0.5)),
            travel_ratio: travel_ratio(motion, source),
            ground_shift_m: plan.footing.ground_shift_m(),
            fastest_rad_s: fastest(motion),
        }
    }
}

#[derive(Default)]
struct Measured {
    raw: Vec<Vec<f64>>,
    pose: Vec<Vec<f64>>,
    proportion: Vec<Vec<f64>>,
    bones: Vec<Vec<f64>>,
    stance_heights: Vec<f64>,
    stance_slips: Vec<f64>,
    source_slips: Vec<f64>,
    agreement: f64,
}

impl Measured {
    fn new(humanoid: &Humanoid, motion: &Motion, source: &Source, plan: &Plan) -> Self {
        let tree = &humanoid.robot.tree;
        let links = ROLES.map(|info| tree.link_index(info.link).unwrap_or_default());
        let at_rest = humanoid.forward(&crate::motion::Frame::ZERO);
        let lengths = Lengths::new(&links, &at_rest, source);
        let mut measured = Self {
            raw: vec![Vec::new(); NUM_ROLES],
            pose: vec![Vec::new(); NUM_ROLES],
            proportion: vec![Vec::new(); NUM_ROLES],
            bones: vec![Vec::new(); BONES.len()],
            ..Self::default()
        };
        let stance = &plan.footing.stance;
        let mut poses = Vec::new();
        let mut soles_before: Vec<Vector3<f64>> = Vec::new();
        let mut paths = FootPaths { toes: [Vec::new(), Vec::new()], ankles: [Vec::new(), Vec::new()] };
        for (index, (frame, own)) in source.frames.iter().zip(motion.frames()).enumerate() {
            tree.forward_into(
                &own.world_from_root(),
                &humanoid.tree_angles(&own.joint_angles_rad),
                &mut poses,
            );
            let ours = |role: Role| poses[links[role.index()]].translation.vector;
            let scaled = lengths.scaled(frame, &own.world_from_root());
            for role in Role::all().filter(|role| ROLES[role.index()].required) {
                let theirs = frame.centre(role) + Vector3::z() * plan.footing.ground_shift_m();
                let index = role.index();
                measured.raw[index].push((ours(role) - theirs).norm());
                measured.pose[index].push((ours(role) - scaled[index]).norm());
                measured.proportion[index].push((scaled[index] - theirs).norm());
            }
            for (angles, (_, from, to)) in measured.bones.iter_mut().zip(&BONES) {
                let angle = (ours(*to) - ours(*from)).angle(&(frame.centre(*to) - frame.centre(*from)));
                angles.push(if angle.is_finite() { angle } else { 0.0 });
            }
            let soles: Vec<Vector3<f64>> =
                humanoid.sole_points_in_world(&poses).map(|point| point.coords).collect();
            for (foot, (toe, ankle)) in FEET.into_iter().enumerate() {
                paths.toes[foot].push(ours(toe));
                paths.ankles[foot].push(ours(ankle));
            }
            for (foot, side) in [Side::Left, Side::Right].into_iter().enumerate() {
                let points = || {
                    soles.iter().enumerate().filter(|(point, _)| humanoid.sole_points[*point].side == side)
                };
                let Some((lowest, point)) = points().min_by(|a, b| a.1.z.total_cmp(&b.1.z)) else { continue };
                if stance.flat[index][foot] {
                    measured.stance_heights.push(point.z.abs());
                    if let Some(before) = soles_before.get(lowest) {
                        measured.stance_slips.push((point - before).xy().norm() * motion.rate_hz());
                    }
                }
            }
            soles_before = soles;
        }
        let own = Stance::of(&paths, motion.rate_hz(), |_, _| true);
        let pairs = own.stands.iter().zip(&stance.stands);
        let agreeing: usize = pairs.map(|(a, b)| usize::from(a[0] == b[0]) + usize::from(a[1] == b[1])).sum();
        measured.agreement = agreeing as f64 / (2 * source.frames.len()) as f64;
        let theirs = source.foot_paths();
        for foot in 0..2 {
            let speeds = speeds(&theirs.ankles[foot], source.rate_hz);
            let flat = speeds.iter().zip(&stance.flat).filter(|(_, flat)| flat[foot]);
            measured.source_slips.extend(flat.map(|(speed, _)| *speed));
        }
        measured
    }
}

/// Our bone lengths, and what is needed to place the source's bones at them.
struct Lengths {
    bones: [f64; TREE.len()],
    half_hips: f64,
    trunk_ratio: f64,
}

impl Lengths {
    fn new(links: &[usize; NUM_ROLES], at_rest: &[Isometry3<f64>], source: &Source) -> Self {
        let centre = |role: Role| at_rest[links[role.index()]].translation.vector;
        let trunks: Vec<f64> =
            source.frames.iter().map(|frame| (frame.centre(Role::Neck) - frame.pelvis()).norm()).collect();
        Self {
            bones: TREE.map(|(to, from)| (centre(to) - centre(from)).norm()),
            half_hips: (centre(Role::RightHip) - centre(Role::LeftHip)).norm() / 2.0,
            trunk_ratio: centre(Role::Neck).norm() / quantile(&trunks, 0.75).max(1e-3),
        }
    }

    /// Joint centres with the directions of the source and our lengths, from our root on.
    fn scaled(&self, frame: &SourceFrame, world_from_root: &Isometry3<f64>) -> [Vector3<f64>; NUM_ROLES] {
        let mut scaled = [Vector3::zeros(); NUM_ROLES];
        let root = world_from_root.translation.vector;
        let across =
            (frame.centre(Role::RightHip) - frame.centre(Role::LeftHip)).normalize() * self.half_hips;
        scaled[Role::LeftHip.index()] = root - across;
        scaled[Role::RightHip.index()] = root + across;
        scaled[Role::Neck.index()] = root + (frame.centre(Role::Neck) - frame.pelvis()) * self.trunk_ratio;
        for ((to, from), length) in TREE.iter().zip(self.bones) {
            let bone =
                (frame.centre(*to) - frame.centre(*from)).try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
            scaled[to.index()] = scaled[from.index()] + bone * length;
        }
        scaled
    }
}

/// Largest value that the angles exceed for [`FLIP_SECS`] without a break, radians.
fn sustained(angles: &[f64], rate_hz: f64) -> f64 {
    let window = (FLIP_SECS * rate_hz).ceil() as usize + 1;
    let window = window.min(angles.len());
    angles.windows(window).map(|run| run.iter().copied().fold(f64::INFINITY, f64::min)).fold(0.0, f64::max)
}

fn limits(motion: &Motion) -> (f64, f64) {
    let (mut count, mut beyond) = (0_usize, 0.0_f64);
    for frame in motion.frames() {
        for (angle, joint) in frame.joint_angles_rad.iter().zip(&JOINTS) {
            count += usize::from(
                *angle < joint.lower_rad + AT_LIMIT_RAD || *angle > joint.upper_rad - AT_LIMIT_RAD,
            );
            beyond = beyond.max(joint.lower_rad - angle).max(angle - joint.upper_rad);
        }
    }
    (count as f64 / (motion.num_frames() * NUM_JOINTS) as f64, beyond)
}

fn travel_ratio(motion: &Motion, source: &Source) -> Option<f64> {
    let ours: Vec<Vector3<f64>> =
        motion.frames().iter().map(|frame| Vector3::from(frame.root_position_m)).collect();
    let theirs: Vec<Vector3<f64>> = source.frames.iter().map(SourceFrame::pelvis).collect();
    // Paths are taken over steps of a tenth of a second, so that noise adds nothing.
    let stride = ((0.1 * source.rate_hz).round() as usize).max(1);
    let length = |path: &[Vector3<f64>]| -> f64 {
        let points: Vec<_> = path.iter().step_by(stride).collect();
        points.windows(2).map(|pair| (pair[1] - pair[0]).xy().norm()).sum()
    };
    let theirs = length(&theirs);
    (theirs >= 0.5).then(|| length(&ours) / theirs)
}

fn fastest(motion: &Motion) -> (f64, &'static str) {
    let mut fastest = (0.0, JOINTS[0].short_name());
    for pair in motion.frames().windows(2) {
        for (joint, (a, b)) in pair[0].joint_angles_rad.iter().zip(&pair[1].joint_angles_rad).enumerate() {
            let speed = (a - b).abs() * motion.rate_hz();
            if speed > fastest.0 {
                fastest = (speed, JOINTS[joint].short_name());
            }
        }
    }
    fastest
}
