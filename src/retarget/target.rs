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

use nalgebra::Vector3;

use super::bones::{AXIS_WEIGHTS, BONES, REACHES};
use super::footing::Footing;
use super::hold::{Corrections, hold_feet};
use super::role::{ORIENTED, Segment};
use super::size::Proportions;
use super::solver::{Kind, Target, Task};
use super::source::{Source, SourceFrame};
use super::stance::quantile;
use super::{Correspondence, Role};
use crate::humanoid::Humanoid;

/// Weights of the tasks; a point counts by its distance, a direction by that of the end of a 0.3 m bone.
const PELVIS_WEIGHT: f64 = 3.0;
const ANKLE_WEIGHT: f64 = 10.0;
/// Toes of a foot that stands, and the foot itself where only positions are known: the sole is level.
const LEVEL_WEIGHT: f64 = 0.3;

/// The tasks of one source and how to fill their targets.
#[derive(Clone)]
pub(super) struct Plan {
    pub tasks: Vec<Task>,
    bones: Vec<(usize, f64)>,
    axes: Vec<(usize, usize, f64)>,
    /// Tasks that level a standing foot (left, right).
    levels: [Option<usize>; 2],
    pub footing: Footing,
    corrections: Corrections,
    leg_ratio: f64,
    same_body: bool,
}

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
            footing: Footing::new(source, correspondence, proportions.ankle * humanoid.body.height_m),
            corrections: vec![[Vector3::zeros(); 2]; source.frames.len()],
            leg_ratio: leg_ratio(humanoid, source, proportions),
            same_body: correspondence.same_body,
        };
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

    /// Keeps the standing feet of these poses in place and on the floor when targets are filled again.
    pub(super) fn hold_feet(
        &mut self,
        humanoid: &Humanoid,
        rate_hz: f64,
        poses: impl Iterator<Item = Vec<nalgebra::Isometry3<f64>>>,
    ) {
        if !self.same_body {
            hold_feet(humanoid, rate_hz, &self.footing.stance, poses, &mut self.corrections);
        }
    }

    /// Whether the source has our own proportions and joints.
    pub(super) fn is_same_body(&self) -> bool {
        self.same_body
    }

    /// Where the pelvis should be.
    pub(super) fn pelvis(&self, frame: &SourceFrame) -> Vector3<f64> {
        let mut pelvis = frame.pelvis();
        let Footing { ankle_height_m, source_ankle_m, .. } = self.footing;
        pelvis.z = ankle_height_m + (pelvis.z - source_ankle_m) * self.leg_ratio;
        pelvis
    }

    /// Writes the targets of a frame, in the order of the tasks.
    pub(super) fn fill(&self, index: usize, frame: &SourceFrame, targets: &mut Vec<Target>) {
        targets.clear();
        targets.push(Target { value: self.pelvis(frame), weight: PELVIS_WEIGHT });
        for (foot, role) in [Role::LeftAnkle, Role::RightAnkle].into_iter().enumerate() {
            let mut value = frame.centre(role);
            value.z += self.footing.ankle_height_m - self.footing.source_ankles_m[foot];
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
            let value = match ORIENTED[number].0 {
                Segment::LeftFoot => self.footing.levelled_foot(0, frame, axis),
                Segment::RightFoot => self.footing.levelled_foot(1, frame, axis),
                Segment::LeftToes if axis == 1 => self.footing.levelled_toes(0, frame, forward),
                Segment::RightToes if axis == 1 => self.footing.levelled_toes(1, frame, forward),
                _ => [up, forward][axis],
            };
            let lies = match ORIENTED[number].0 {
                Segment::LeftToes => self.footing.toes_lie[index][0],
                Segment::RightToes => self.footing.toes_lie[index][1],
                _ => 0.0,
            };
            targets.push(direction(value, weight * (1.0 - lies)));
        }
        if !self.same_body {
            let lies = self.footing.toes_lie[index];
            targets.extend(lies.map(|lies| Target { value: Vector3::z(), weight: lies * LEVEL_WEIGHT }));
        }
        for (foot, level) in self.levels.iter().enumerate() {
            if level.is_some() {
                let weight = if self.footing.stance.flat[index][foot] { LEVEL_WEIGHT } else { 0.0 };
                targets.push(Target { value: Vector3::z(), weight });
            }
        }
    }
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
