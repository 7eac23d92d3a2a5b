//! What the humanoid is asked to do in a frame: its tasks, and their targets from the source.
//!
//! Matched are the *directions* of bones, the orientations of pelvis, thorax, head, hands and feet where the source has
//! them, the place of both ankles, and the place of the pelvis:
//!
//! - an ankle is where the source's is, except that its height is counted from where it stands: the joint that a source
//!   calls ankle lies 4 to 12 cm above the floor, ours at 3.9 % of the height;
//! - the pelvis is above the source's, its height above the standing ankles scaled by the ratio of the leg lengths, so a
//!   stretched leg stays stretched and a bent one bent;
//! - everything above follows by direction: limb for limb the source's pose at our proportions.
//!
//! The path through the world is that of the source, unscaled.

use nalgebra::{UnitQuaternion, UnitVector3, Vector3};

use super::hold::{Corrections, hold_feet};
use super::role::{NUM_ORIENTED, ORIENTED, Segment};
use super::size::Proportions;
use super::solver::{Kind, Target, Task};
use super::source::{Source, SourceFrame};
use super::stance::{Stance, quantile};
use super::{Correspondence, Role};
use crate::humanoid::Humanoid;

/// Weights of the tasks; a point counts by its distance, a direction by that of the end of a 0.3 m bone.
const PELVIS_WEIGHT: f64 = 3.0;
const ANKLE_WEIGHT: f64 = 10.0;
/// Toes of a foot that stands, and the foot itself where only positions are known: the sole is level.
const LEVEL_WEIGHT: f64 = 0.3;
/// Time in which toes come down before a stance and leave the floor after it, seconds.
const TOES_FADE_SECS: f64 = 0.1;
/// Largest turn by which the standing soles of a source are levelled, radians.
const LARGEST_LEVELLING_RAD: f64 = 0.35;
/// A sole turned further than this does not stand flat, whatever height and speed say, radians.
const NOT_STANDING_RAD: f64 = 0.8;
/// Largest difference between the heights of the two ankles in stance that is taken for a matter of the source's feet;
/// a larger one is a step of the floor, metres.
const LARGEST_STEP_M: f64 = 0.05;
/// Largest distance by which a clip is lowered to stand on the floor, metres: beyond it, it may hang or climb.
/// Raised it is by any distance, since nobody stands below the floor.
pub(super) const LARGEST_GROUND_SHIFT_M: f64 = 0.15;

/// A direction between two joint centres, matched by one of our segments.
struct BoneTask {
    link: &'static str,
    from: Role,
    to: Role,
    /// In the segment's frame; `None`: from the segment's origin to that of the link of `to`.
    local: Option<[f64; 3]>,
    weight: f64,
    /// The segment whose orientation, where the source has it, says more than this bone.
    instead: Option<Segment>,
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
const BONES: [BoneTask; 24] = [
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
const AXIS_WEIGHTS: [[f64; 2]; NUM_ORIENTED] = [
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

/// The tasks of one source and how to fill their targets.
#[derive(Clone)]
pub(super) struct Plan {
    pub tasks: Vec<Task>,
    bones: Vec<(usize, f64)>,
    axes: Vec<(usize, usize, f64)>,
    /// Tasks that level a standing foot (left, right).
    levels: [Option<usize>; 2],
    /// Turns the source's foot axes so that its standing sole is level (left, right).
    levelling: [UnitQuaternion<f64>; 2],
    /// Slope of the source's toes when its feet stand flat, radians, positive with the tip up (left, right).
    toe_slopes_rad: [f64; 2],
    stance: Stance,
    /// How far the toes of each foot lie on the floor, flat foot or raised heel, by frame (0 to 1).
    toes_lie: Vec<[f64; 2]>,
    corrections: Corrections,
    ankle_height_m: f64,
    /// Height of the standing ankle in the source, per foot and for both.
    source_ankles_m: [f64; 2],
    source_ankle_m: f64,
    leg_ratio: f64,
    same_body: bool,
    pub notes: Vec<String>,
}

/// Joints that should also be near the source's, moved with the pelvis: link, role, weight.
///
/// With other proportions direction and place contradict each other; hands then give up some of either.
const REACHES: [(&str, Role, f64); 4] = [
    ("left_forearm", Role::LeftElbow, 0.4),
    ("right_forearm", Role::RightElbow, 0.4),
    ("left_hand", Role::LeftWrist, 0.4),
    ("right_hand", Role::RightWrist, 0.4),
];

impl Plan {
    pub(super) fn new(
        humanoid: &Humanoid,
        source: &Source,
        correspondence: &Correspondence,
        proportions: &Proportions,
    ) -> Self {
        let tree = &humanoid.robot.tree;
        // The tables name links of the humanoid, which a test checks.
        let link = |name: &str| tree.link_index(name).unwrap_or_default();
        let at_rest = humanoid.forward(&crate::motion::Frame::ZERO);
        let point = |name| Task { link: link(name), kind: Kind::Point, local: Vector3::zeros() };
        let mut plan = Self {
            tasks: ["pelvis", "left_foot", "right_foot"]
                .into_iter()
                .chain(REACHES.map(|(link, _, _)| link))
                .map(point)
                .collect(),
            bones: Vec::new(),
            axes: Vec::new(),
            levels: [None; 2],
            levelling: [UnitQuaternion::identity(); 2],
            toe_slopes_rad: [0.0; 2],
            toes_lie: vec![[0.0; 2]; source.frames.len()],
            corrections: vec![[Vector3::zeros(); 2]; source.frames.len()],
            stance: Stance::of(&source.foot_paths(), source.rate_hz, |frame, foot| {
                is_level(source, frame, foot)
            }),
            ankle_height_m: proportions.ankle * humanoid.body.height_m,
            source_ankles_m: [0.0; 2],
            source_ankle_m: 0.0,
            leg_ratio: leg_ratio(humanoid, source, proportions),
            same_body: correspondence.same_body,
            notes: Vec::new(),
        };
        plan.find_floor(correspondence);
        if !correspondence.same_body {
            plan.toes_lie = plan.stance.nearness(TOES_FADE_SECS * source.rate_hz);
            plan.level_soles(source);
            plan.level_toes(source);
        }

        for (index, bone) in BONES.iter().enumerate() {
            let oriented =
                bone.instead.is_some_and(|segment| correspondence.orientations.contains_key(&segment));
            let known = |role: Role| source.has[role.index()];
            if bone.weight == 0.0 || oriented || !known(bone.from) || !known(bone.to) {
                continue;
            }
            let own = link(bone.link);
            let geometric = || {
                let end = bone.to.link().map_or(own, link);
                (at_rest[own].inverse() * at_rest[end]).translation.vector.normalize()
            };
            let stated = correspondence.rest.get(&bone.to).map(|axis| axis.0);
            let local = stated.or(bone.local.map(Vector3::from)).unwrap_or_else(geometric);
            plan.bones.push((index, bone.weight));
            plan.tasks.push(Task { link: own, kind: Kind::Direction, local });
        }
        for (number, (segment, name)) in ORIENTED.iter().enumerate() {
            let Some(orientation) = correspondence.orientations.get(segment) else { continue };
            let axes = [(orientation.up, Vector3::z()), (orientation.forward, Vector3::y())];
            for (axis, (stated, local)) in axes.into_iter().enumerate() {
                if stated.is_some() && source.frames[0].axes[number][axis].x.is_finite() {
                    plan.axes.push((number, axis, AXIS_WEIGHTS[number][axis]));
                    plan.tasks.push(Task { link: link(name), kind: Kind::Direction, local });
                }
            }
        }
        if !correspondence.same_body {
            let level = |name| Task { link: link(name), kind: Kind::Direction, local: Vector3::z() };
            plan.tasks.extend(["left_toes", "right_toes"].map(level));
        }
        for (foot, (segment, name)) in
            [(Segment::LeftFoot, "left_foot"), (Segment::RightFoot, "right_foot")].into_iter().enumerate()
        {
            if !correspondence.same_body && !correspondence.orientations.contains_key(&segment) {
                plan.levels[foot] = Some(plan.tasks.len());
                plan.tasks.push(Task { link: link(name), kind: Kind::Direction, local: Vector3::z() });
            }
        }
        plan
    }

    /// Heights of the standing ankles: one for each foot where they differ as feet do, else one for both.
    fn find_floor(&mut self, correspondence: &Correspondence) {
        let [left, right] = self.stance.ankle_height_m;
        let common = (left + right) / 2.0;
        let is_step = (left - right).abs() > LARGEST_STEP_M;
        let shift = self.ankle_height_m - if is_step { left.min(right) } else { common };
        let bounded = shift.max(-LARGEST_GROUND_SHIFT_M);
        if bounded != shift {
            self.notes.push(format!(
                "the ankles stand at {:.0} mm, ours at {:.0} mm; the clip is moved by {:+.0} mm only",
                1e3 * (self.ankle_height_m - shift),
                1e3 * self.ankle_height_m,
                1e3 * bounded
            ));
        } else if shift > LARGEST_GROUND_SHIFT_M {
            self.notes.push(format!(
                "the ankles stand at {:.0} mm, below every floor; the clip is raised by {:.0} mm",
                1e3 * (self.ankle_height_m - shift),
                1e3 * shift
            ));
        }
        self.source_ankle_m = self.ankle_height_m - bounded;
        let both = [self.source_ankle_m; 2];
        self.source_ankles_m = if is_step || correspondence.same_body || bounded != shift {
            both
        } else {
            self.stance.ankle_height_m
        };
        if is_step {
            self.notes.push(format!(
                "the feet stand at heights {:.0} mm apart, which is kept as a step of the floor",
                1e3 * (left - right).abs()
            ));
        }
    }

    /// Finds how the source's feet are turned against the floor when they stand flat, and turns them back.
    fn level_soles(&mut self, source: &Source) {
        for (foot, segment) in [Segment::LeftFoot, Segment::RightFoot].into_iter().enumerate() {
            let floor_in_foot: Vec<Vector3<f64>> = source
                .frames
                .iter()
                .zip(&self.stance.flat)
                .filter(|(_, flat)| flat[foot])
                .filter_map(|(frame, _)| {
                    let [up, forward] = frame.axes[segment as usize];
                    let right = forward.cross(&up);
                    let floor = Vector3::new(right.z, forward.z, up.z);
                    floor.x.is_finite().then_some(floor)
                })
                .collect();
            if floor_in_foot.is_empty() {
                continue;
            }
            let median = |axis: usize| {
                quantile(&floor_in_foot.iter().map(|floor| floor[axis]).collect::<Vec<_>>(), 0.5)
            };
            let floor = Vector3::new(median(0), median(1), median(2));
            let Some(turn) = UnitQuaternion::rotation_between(&floor, &Vector3::z()) else { continue };
            let angle = turn.angle();
            if angle <= LARGEST_LEVELLING_RAD {
                self.levelling[foot] = turn;
            } else {
                self.levelling[foot] = turn.powf(LARGEST_LEVELLING_RAD / angle);
                self.notes.push(format!(
                    "the {} sole stands {:.0} degrees off level, of which {:.0} are taken away",
                    if foot == 0 { "left" } else { "right" },
                    angle.to_degrees(),
                    LARGEST_LEVELLING_RAD.to_degrees()
                ));
            }
        }
    }

    /// Finds how far the source's toes point up or down when their feet stand flat.
    fn level_toes(&mut self, source: &Source) {
        for (foot, segment) in [Segment::LeftToes, Segment::RightToes].into_iter().enumerate() {
            let slopes: Vec<f64> = source
                .frames
                .iter()
                .zip(&self.stance.flat)
                .filter(|(_, flat)| flat[foot])
                .map(|(frame, _)| frame.axes[segment as usize][1].z)
                .filter(|slope| slope.is_finite())
                .map(|slope| slope.clamp(-1.0, 1.0).asin())
                .collect();
            if !slopes.is_empty() {
                self.toe_slopes_rad[foot] =
                    quantile(&slopes, 0.5).clamp(-LARGEST_LEVELLING_RAD, LARGEST_LEVELLING_RAD);
            }
        }
    }

    /// The toes' forward axis, as far up or down as when they stand level.
    fn levelled_toes(&self, foot: usize, frame: &SourceFrame, forward: Vector3<f64>) -> Vector3<f64> {
        let [up, ahead] = frame.axes[[Segment::LeftFoot, Segment::RightFoot][foot] as usize];
        match UnitVector3::try_new(ahead.cross(&up), 1e-6) {
            // A positive turn about the right lifts the tip.
            Some(right) => UnitQuaternion::from_axis_angle(&right, -self.toe_slopes_rad[foot]) * forward,
            None => forward,
        }
    }

    /// Keeps the standing feet of these poses in place and on the floor when targets are filled again.
    pub(super) fn hold_feet(
        &mut self,
        humanoid: &Humanoid,
        rate_hz: f64,
        poses: impl Iterator<Item = Vec<nalgebra::Isometry3<f64>>>,
    ) {
        if !self.same_body {
            hold_feet(humanoid, rate_hz, &self.stance, poses, &mut self.corrections);
        }
    }

    /// Whether the source has our own proportions and joints.
    pub(super) fn is_same_body(&self) -> bool {
        self.same_body
    }

    pub(super) fn stance(&self) -> &Stance {
        &self.stance
    }

    /// Height by which the clip is moved to stand on our floor, metres.
    pub(super) fn ground_shift_m(&self) -> f64 {
        self.ankle_height_m - self.source_ankle_m
    }

    /// Where the pelvis should be.
    pub(super) fn pelvis(&self, frame: &SourceFrame) -> Vector3<f64> {
        let mut pelvis = frame.pelvis();
        pelvis.z = self.ankle_height_m + (pelvis.z - self.source_ankle_m) * self.leg_ratio;
        pelvis
    }

    /// Writes the targets of a frame, in the order of the tasks.
    pub(super) fn fill(&self, index: usize, frame: &SourceFrame, targets: &mut Vec<Target>) {
        targets.clear();
        targets.push(Target { value: self.pelvis(frame), weight: PELVIS_WEIGHT });
        for (foot, role) in [Role::LeftAnkle, Role::RightAnkle].into_iter().enumerate() {
            let mut value = frame.centre(role);
            value.z += self.ankle_height_m - self.source_ankles_m[foot];
            value += self.corrections[index][foot];
            targets.push(Target { value, weight: ANKLE_WEIGHT });
        }
        let shift = self.pelvis(frame) - frame.pelvis();
        for (_, role, weight) in &REACHES {
            targets.push(Target { value: frame.centre(*role) + shift, weight: *weight });
        }
        for &(bone, weight) in &self.bones {
            let bone = &BONES[bone];
            // The lower trunk begins in the middle between the hips.
            let from = if bone.to == Role::Abdomen { frame.pelvis() } else { frame.centre(bone.from) };
            targets.push(direction(frame.centre(bone.to) - from, weight));
        }
        for &(number, axis, weight) in &self.axes {
            let [up, forward] = frame.axes[number];
            let levelled_foot = |foot: usize| {
                // Our axes in the source's foot, levelled there.
                let local = if axis == 0 { Vector3::z() } else { Vector3::y() };
                let turned = self.levelling[foot].inverse() * local;
                forward.cross(&up) * turned.x + forward * turned.y + up * turned.z
            };
            let value = match ORIENTED[number].0 {
                Segment::LeftFoot => levelled_foot(0),
                Segment::RightFoot => levelled_foot(1),
                Segment::LeftToes if axis == 1 => self.levelled_toes(0, frame, forward),
                Segment::RightToes if axis == 1 => self.levelled_toes(1, frame, forward),
                _ => [up, forward][axis],
            };
            let lies = match ORIENTED[number].0 {
                Segment::LeftToes => self.toes_lie[index][0],
                Segment::RightToes => self.toes_lie[index][1],
                _ => 0.0,
            };
            targets.push(direction(value, weight * (1.0 - lies)));
        }
        if !self.same_body {
            let lies = self.toes_lie[index];
            targets.extend(lies.map(|lies| Target { value: Vector3::z(), weight: lies * LEVEL_WEIGHT }));
        }
        for (foot, level) in self.levels.iter().enumerate() {
            if level.is_some() {
                let weight = if self.stance.flat[index][foot] { LEVEL_WEIGHT } else { 0.0 };
                targets.push(Target { value: Vector3::z(), weight });
            }
        }
    }
}

/// Whether a sole may lie flat on the floor; one whose orientation the source does not tell may.
fn is_level(source: &Source, frame: usize, foot: usize) -> bool {
    let segment = [Segment::LeftFoot, Segment::RightFoot][foot];
    let up = source.frames[frame].axes[segment as usize][0];
    up.z.is_nan() || up.z >= NOT_STANDING_RAD.cos()
}

/// A target direction; bones that have no length for a moment ask for nothing.
fn direction(vector: Vector3<f64>, weight: f64) -> Target {
    vector.try_normalize(1e-6).map_or(Target::NONE, |value| Target { value, weight })
}

/// Our leg over the source's.
fn leg_ratio(humanoid: &Humanoid, source: &Source, proportions: &Proportions) -> f64 {
    let lengths: Vec<f64> = source
        .frames
        .iter()
        .map(|frame| {
            let length = |a: Role, b: Role| (frame.centre(a) - frame.centre(b)).norm();
            let left = length(Role::LeftHip, Role::LeftKnee) + length(Role::LeftKnee, Role::LeftAnkle);
            let right = length(Role::RightHip, Role::RightKnee) + length(Role::RightKnee, Role::RightAnkle);
            (left + right) / 2.0
        })
        .collect();
    (proportions.thigh + proportions.shank) * humanoid.body.height_m / quantile(&lengths, 0.5).max(1e-3)
}
