//! The whole clip: frame after frame, then sweeps that make it smooth in time.
//!
//! Minimised is the sum over all frames of the targets' cost plus a small pull of every angle towards rest and towards
//! its neighbours in time. The first pass goes forward and knows the past only; each later sweep solves every frame
//! between its two neighbours, so what remains has no lag.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::solver::{Pose, Prior, Solver, Target};
use super::source::Source;
use super::target::Plan;
use crate::humanoid::Humanoid;
use crate::motion::NUM_JOINTS;

/// Pull of an angle towards rest, square metres per square radian; a full bone direction weighs 0.09.
const REST_WEIGHT: f64 = 1e-4;
/// Pull of an angle towards each neighbour in time at 100 Hz; it grows with the square of the rate.
const SMOOTH_WEIGHT: f64 = 4e-3;
const SMOOTH_RATE_HZ: f64 = 100.0;

const FIRST_STEPS: usize = 60;
const TRACK_STEPS: usize = 12;
const SWEEP_STEPS: usize = 3;
const NUM_SWEEPS: usize = 2;

/// Solves all frames; returns poses in tree order.
pub(super) fn track(humanoid: &Humanoid, source: &Source, plan: &Plan) -> Vec<Pose> {
    let mut solver = Solver::new(humanoid, &plan.tasks);
    let mut targets: Vec<Target> = Vec::with_capacity(plan.tasks.len());
    let smooth = SMOOTH_WEIGHT * (source.rate_hz / SMOOTH_RATE_HZ).powi(2);
    let rest = Prior { center: [0.0; NUM_JOINTS], weight: [REST_WEIGHT; NUM_JOINTS] };
    let mut prior = rest.clone();
    let mut poses: Vec<Pose> = Vec::with_capacity(source.frames.len());
    for (index, frame) in source.frames.iter().enumerate() {
        plan.fill(index, frame, &mut targets);
        let pose = match poses.last() {
            None => {
                let mut pose = first_pose(&solver, source, plan);
                solver.solve(&mut pose, &targets, &rest, FIRST_STEPS);
                pose
            }
            Some(before) => {
                let mut pose = *before;
                pose.root.translation.vector += plan.pelvis(frame) - plan.pelvis(&source.frames[index - 1]);
                towards(&mut prior, &[(&before.angles, smooth)]);
                solver.solve(&mut pose, &targets, &prior, TRACK_STEPS);
                pose
            }
        };
        poses.push(pose);
    }
    for sweep in 0..NUM_SWEEPS {
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
            solver.solve(&mut pose, &targets, &prior, SWEEP_STEPS);
            poses[index] = pose;
        }
    }
    poses
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
    let rotation = rotation
        * UnitQuaternion::from_basis_unchecked(&[
            -nalgebra::Vector3::x(),
            nalgebra::Vector3::z(),
            nalgebra::Vector3::y(),
        ]);
    let finite = rotation.coords.iter().all(|value| value.is_finite());
    let rotation = if finite { rotation } else { UnitQuaternion::identity() };
    Pose {
        root: Isometry3::from_parts(Translation3::from(plan.pelvis(frame)), rotation),
        angles: std::array::from_fn(|angle| solver.clamp(angle, 0.0)),
    }
}
