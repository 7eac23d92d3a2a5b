//! The whole clip: frame after frame, then sweeps that make it smooth in time.
//!
//! Minimised is the sum over all frames of the targets' cost plus a small pull of every angle towards rest and towards
//! its neighbours in time. The first pass goes forward and knows the past only; each later sweep solves every frame
//! between its two neighbours, so what remains has no lag.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::arm::{Arm, ArmAngles};
use super::solver::{Kind, Pose, Prior, Solver, Target, Task};
use super::source::Source;
use super::target::Plan;
use crate::humanoid::{Humanoid, Side};
use crate::motion::{NUM_JOINTS, joint_index};

/// Pull of an angle towards rest, square metres per square radian; a full bone direction weighs 0.09.
const REST_WEIGHT: f64 = 1e-4;
/// Pull of an angle towards each neighbour in time at 100 Hz; it grows with the square of the rate.
const SMOOTH_WEIGHT: f64 = 4e-3;
pub(super) const SMOOTH_RATE_HZ: f64 = 100.0;

const FIRST_STEPS: usize = 60;
const TRACK_STEPS: usize = 12;
const SWEEP_STEPS: usize = 3;
/// An upper arm this far from its direction looks for another way, radians,
const ESCAPE_RAD: f64 = 0.6;
/// and then keeps it for this time, seconds.
const ESCAPE_PAUSE_SECS: f64 = 0.3;
const ESCAPE_STEPS: usize = 12;
const NUM_SWEEPS: usize = 4;
/// Pull of a led arm towards its way, square metres per square radian: bones that cannot be followed would pull it off.
const LEAD_WEIGHT: f64 = 0.05;
/// Neighbours that differ by this much in some angle do the same in different ways, radians.
const OTHER_WAY_RAD: f64 = 0.3;

impl Prior {
    /// The pull towards rest alone.
    const REST: Self = Self { center: [0.0; NUM_JOINTS], weight: [REST_WEIGHT; NUM_JOINTS] };
}

/// How much better another way must be for an arm to take it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Worthwhile {
    /// It costs less by this, square metres; a bone that is turned by 60 degrees costs 0.09.
    Less(f64),
    /// It costs at most this share.
    Share(f64),
}

impl Worthwhile {
    /// In the order in which they are tried: no one of them frees the arms of every clip.
    pub(super) const ALL: [Self; 4] =
        [Self::Less(0.03), Self::Share(0.5), Self::Less(0.06), Self::Less(0.015)];

    /// The cost below which another way is taken.
    fn limit(self, cost: f64) -> f64 {
        match self {
            Self::Less(by) => cost - by,
            Self::Share(share) => share * cost,
        }
    }
}

/// Solves all frames; returns poses in tree order.
pub(super) fn track(
    humanoid: &Humanoid,
    source: &Source,
    plan: &mut Plan,
    worthwhile: Worthwhile,
) -> Vec<Pose> {
    let tasks = plan.tasks.clone();
    let mut solver = Solver::new(humanoid, &tasks);
    let mut targets: Vec<Target> = Vec::with_capacity(plan.tasks.len());
    let smooth = smooth_weight(source.rate_hz);
    let mut prior = Prior::REST;
    let mut poses: Vec<Pose> = Vec::with_capacity(source.frames.len());
    let escapes = Escape::of_arms(humanoid, plan);
    let escape_pause = (ESCAPE_PAUSE_SECS * source.rate_hz).round() as usize;
    let mut next_escape = 0;
    for (index, frame) in source.frames.iter().enumerate() {
        plan.fill(index, frame, &mut targets);
        let pose = match poses.last() {
            None => {
                let mut pose = first_pose(&solver, source, plan);
                solver.solve(&mut pose, &targets, &Prior::REST, FIRST_STEPS);
                pose
            }
            Some(before) => {
                let mut pose = *before;
                pose.root.translation.vector += plan.pelvis(frame) - plan.pelvis(&source.frames[index - 1]);
                towards(&mut prior, &[(&before.angles, smooth)]);
                let cost = solver.solve(&mut pose, &targets, &prior, TRACK_STEPS);
                if index >= next_escape {
                    for escape in &escapes {
                        if escape.attempt(&mut solver, &mut pose, worthwhile.limit(cost), &targets) {
                            next_escape = index + escape_pause;
                        }
                    }
                }
                pose
            }
        };
        poses.push(pose);
    }
    sweep(&mut solver, source, plan, &[], &mut poses);
    poses
}

/// Pull of an angle towards each neighbour in time, square metres per square radian.
pub(super) fn smooth_weight(rate_hz: f64) -> f64 {
    SMOOTH_WEIGHT * (rate_hz / SMOOTH_RATE_HZ).powi(2)
}

/// Begins again from these poses with the arms of these sides led along their [best way](Arm::way); whether any could be.
pub(super) fn track_led(
    humanoid: &Humanoid,
    source: &Source,
    plan: &mut Plan,
    sides: &[Side],
    poses: &mut [Pose],
) -> bool {
    let tasks = plan.tasks.clone();
    let mut solver = Solver::new(humanoid, &tasks);
    let leads: Vec<Lead> =
        sides.iter().filter_map(|&side| Lead::new(&mut solver, humanoid, source, side, poses)).collect();
    for lead in &leads {
        for (pose, angles) in poses.iter_mut().zip(&lead.way) {
            for (angle, value) in lead.arm.angles.into_iter().zip(angles) {
                pose.angles[angle] = solver.clamp(angle, *value);
            }
        }
    }
    if !leads.is_empty() {
        sweep(&mut solver, source, plan, &leads, poses);
    }
    !leads.is_empty()
}

/// An arm and the way it is led along.
struct Lead {
    arm: Arm,
    way: Vec<ArmAngles>,
}

impl Lead {
    /// The best way at the thorax of these poses.
    fn new(
        solver: &mut Solver<'_>,
        humanoid: &Humanoid,
        source: &Source,
        side: Side,
        poses: &[Pose],
    ) -> Option<Self> {
        use super::Role;
        let arm = Arm::of(humanoid, side)?;
        let thorax = humanoid.robot.tree.link_index("thorax")?;
        let [shoulder, elbow, wrist] = match side {
            Side::Left => [Role::LeftShoulder, Role::LeftElbow, Role::LeftWrist],
            Side::Right => [Role::RightShoulder, Role::RightElbow, Role::RightWrist],
        };
        let mut last = [-Vector3::z(); 2];
        let directions: Vec<[Vector3<f64>; 2]> = poses
            .iter()
            .zip(&source.frames)
            .map(|(pose, frame)| {
                let world_from_thorax = solver.forward(pose)[thorax].rotation;
                for (bone, (from, to)) in last.iter_mut().zip([(shoulder, elbow), (elbow, wrist)]) {
                    let along = (frame.centre(to) - frame.centre(from)).try_normalize(1e-6);
                    *bone = along.map_or(*bone, |along| world_from_thorax.inverse() * along);
                }
                last
            })
            .collect();
        let way = arm.way(&directions, source.rate_hz)?;
        Some(Self { arm, way })
    }

    /// Adds the pull towards the way in this frame to the prior.
    fn pull(&self, frame: usize, prior: &mut Prior) {
        for (angle, value) in self.arm.angles.into_iter().zip(self.way[frame]) {
            let weight = prior.weight[angle] + LEAD_WEIGHT;
            prior.center[angle] = (prior.center[angle] * prior.weight[angle] + value * LEAD_WEIGHT) / weight;
            prior.weight[angle] = weight;
        }
    }
}

/// Solves every frame between its neighbours, to and fro.
fn sweep(solver: &mut Solver<'_>, source: &Source, plan: &mut Plan, leads: &[Lead], poses: &mut [Pose]) {
    let humanoid = solver.humanoid();
    let smooth = smooth_weight(source.rate_hz);
    let mut targets: Vec<Target> = Vec::with_capacity(plan.tasks.len());
    let mut prior = Prior::REST;
    for sweep in 0..NUM_SWEEPS {
        let placed = poses.iter().map(|pose| solver.forward(pose).to_vec());
        plan.hold_feet(humanoid, source.rate_hz, placed);
        for step in 0..poses.len() {
            let index = if sweep % 2 == 0 { poses.len() - 1 - step } else { step };
            plan.fill(index, &source.frames[index], &mut targets);
            let mut pose = poses[index];
            let mut neighbours = [(&pose.angles, 0.0); 2];
            if let Some(before) = index.checked_sub(1) {
                neighbours[0] = (&poses[before].angles, smooth);
            }
            if let Some(after) = poses.get(index + 1) {
                neighbours[1] = (&after.angles, smooth);
            }
            towards(&mut prior, &neighbours);
            for lead in leads {
                lead.pull(index, &mut prior);
            }
            let mut least = solver.solve(&mut pose, &targets, &prior, SWEEP_STEPS);
            // Where a neighbour found another way to do the same, it is tried here too, so that changes of sides are few.
            // A source of our own body is followed as it is: it may well change sides.
            let neighbours = [index.checked_sub(1), Some(index + 1)].into_iter().flatten();
            for neighbour in neighbours.filter(|_| !plan.is_same_body()) {
                let Some(other) = poses.get(neighbour).filter(|other| turned(&pose, other) > OTHER_WAY_RAD)
                else {
                    continue;
                };
                let mut candidate = Pose { root: pose.root, angles: other.angles };
                let cost = solver.solve(&mut candidate, &targets, &prior, TRACK_STEPS);
                if cost < least {
                    (pose, least) = (candidate, cost);
                }
            }
            poses[index] = pose;
        }
    }
}

/// Largest difference of an angle, radians.
fn turned(pose: &Pose, other: &Pose) -> f64 {
    pose.angles.iter().zip(&other.angles).fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}

/// A way out for an arm that has run into its limits on the wrong side: other starts of the shoulder.
///
/// The model's shoulder turns 260 degrees about its first axis, so an arm that circles must change sides somewhere.
struct Escape {
    upper_arm: usize,
    /// Angles x, z, y of the shoulder.
    shoulder: [usize; 3],
    task: usize,
    side: f64,
}

impl Escape {
    fn of_arms(humanoid: &Humanoid, plan: &Plan) -> Vec<Self> {
        let tree = &humanoid.robot.tree;
        let angle = |name: String| {
            let kit = joint_index(&name)?;
            humanoid.kit_of_angle().iter().position(|&of_angle| of_angle == kit)
        };
        [("L", "left_upper_arm", 1.0), ("R", "right_upper_arm", -1.0)]
            .into_iter()
            .filter_map(|(letter, link, side)| {
                let upper_arm = tree.link_index(link)?;
                let shoulder = [
                    angle(format!("{letter}Sx"))?,
                    angle(format!("{letter}Sz"))?,
                    angle(format!("{letter}Sy"))?,
                ];
                let along = |task: &Task| {
                    task.link == upper_arm && task.kind == Kind::Direction && task.local.z < -0.9
                };
                let task = plan.tasks.iter().position(along)?;
                Some(Self { upper_arm, shoulder, task, side })
            })
            .collect()
    }

    /// Tries other starts when the arm points far off; the best that costs less than `limit` is taken; whether one was is
    /// returned.
    fn attempt(&self, solver: &mut Solver<'_>, pose: &mut Pose, limit: f64, targets: &[Target]) -> bool {
        let target = targets[self.task];
        let direction = solver.forward(pose)[self.upper_arm].rotation * -Vector3::z();
        if target.weight <= 0.0 || direction.angle(&target.value) < ESCAPE_RAD {
            return false;
        }
        let (mut best, mut least) = (None, limit);
        for x in [-0.5, 1.0, 2.5] {
            for z in [-0.7, 0.3] {
                for y in [0.3, 1.3, 2.3] {
                    let mut candidate = *pose;
                    for (angle, value) in self.shoulder.into_iter().zip([x, z * self.side, y * self.side]) {
                        candidate.angles[angle] = solver.clamp(angle, value);
                    }
                    let cost = solver.solve(&mut candidate, targets, &Prior::REST, ESCAPE_STEPS);
                    if cost < least {
                        (best, least) = (Some(candidate), cost);
                    }
                }
            }
        }
        *pose = best.unwrap_or(*pose);
        best.is_some()
    }
}

/// Sets the prior to the pull towards rest and towards these neighbours.
fn towards(prior: &mut Prior, neighbours: &[(&[f64; NUM_JOINTS], f64)]) {
    for angle in 0..NUM_JOINTS {
        let (mut weight, mut moment) = (REST_WEIGHT, 0.0);
        for (angles, pull) in neighbours {
            weight += pull;
            moment += pull * angles[angle];
        }
        prior.weight[angle] = weight;
        prior.center[angle] = moment / weight;
    }
}

/// All joints at rest (or the nearest they may be), the pelvis where it should be and facing as the hips say.
fn first_pose(solver: &Solver<'_>, source: &Source, plan: &Plan) -> Pose {
    use super::Role;
    let frame = &source.frames[0];
    let right = frame.centre(Role::RightHip) - frame.centre(Role::LeftHip);
    let trunk = frame.centre(Role::Neck) - frame.pelvis();
    let forward = trunk.cross(&right);
    let rotation = UnitQuaternion::face_towards(&forward, &trunk);
    // `face_towards` looks along z with y up; ours looks along y with z up, so the axes are put in their places.
    let rotation =
        rotation * UnitQuaternion::from_basis_unchecked(&[-Vector3::x(), Vector3::z(), Vector3::y()]);
    let finite = rotation.coords.iter().all(|value| value.is_finite());
    let rotation = if finite { rotation } else { UnitQuaternion::identity() };
    Pose {
        root: Isometry3::from_parts(Translation3::from(plan.pelvis(frame)), rotation),
        angles: std::array::from_fn(|angle| solver.clamp(angle, 0.0)),
    }
}
