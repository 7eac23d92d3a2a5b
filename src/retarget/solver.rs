//! Levenberg-Marquardt over a kinematic tree: points and directions of links, joint limits, a quadratic prior.
//!
//! The unknowns are the pose of the root (translation and a small rotation about the world's axes) and the angles.
//! Residuals are lengths: a direction counts as the offset of the end of a bone of [`DIRECTION_LENGTH_M`].
//! Jacobians are analytic; nothing is allocated after construction.

use nalgebra::{Cholesky, Isometry3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use crate::humanoid::Humanoid;
use crate::kinematics::JointKind;
use crate::motion::{JOINTS, NUM_JOINTS};

/// Unknowns: root translation, root rotation, angles.
const SIZE: usize = 6 + NUM_JOINTS;

/// Length of the bone whose end stands for a direction, metres.
pub(super) const DIRECTION_LENGTH_M: f64 = 0.3;

/// The solution is reached when no unknown moves more than this, radians or metres.
const SMALL_STEP: f64 = 1e-5;
/// or when a step improves the cost by less than this share.
const SMALL_GAIN: f64 = 1e-5;

const FIRST_DAMPING: f64 = 1e-7;
const LARGEST_DAMPING: f64 = 1e3;

/// What a task asks of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A point of the link should be at a place.
    Point,
    /// A direction of the link should point somewhere.
    Direction,
}

/// A wish about a link; its target comes with each frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Task {
    pub link: usize,
    pub kind: Kind,
    /// The point or unit direction in the link frame.
    pub local: Vector3<f64>,
}

/// Target of a task in one frame; a weight of zero switches the task off.
#[derive(Debug, Clone, Copy)]
pub(super) struct Target {
    pub value: Vector3<f64>,
    pub weight: f64,
}

impl Target {
    pub(super) const NONE: Self = Self { value: Vector3::new(0.0, 0.0, 0.0), weight: 0.0 };
}

/// Root pose and angles in tree order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    pub root: Isometry3<f64>,
    pub angles: [f64; NUM_JOINTS],
}

/// Where each angle should be as far as the targets leave it open: `weight * (angle - center)^2`.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    pub center: [f64; NUM_JOINTS],
    /// Square metres per square radian.
    pub weight: [f64; NUM_JOINTS],
}

/// Joints on the way from the root to a link, as indices of angles.
type Chain = Vec<usize>;

pub(super) struct Solver<'a> {
    humanoid: &'a Humanoid,
    tasks: &'a [Task],
    chains: Vec<Chain>,
    lower: [f64; NUM_JOINTS],
    upper: [f64; NUM_JOINTS],
    /// Link whose origin and axes each angle turns about.
    link_of_angle: [usize; NUM_JOINTS],
    local_axis: [Vector3<f64>; NUM_JOINTS],
    poses: Vec<Isometry3<f64>>,
    axes: [Vector3<f64>; NUM_JOINTS],
    hessian: Box<SMatrix<f64, SIZE, SIZE>>,
    damped: Box<SMatrix<f64, SIZE, SIZE>>,
    gradient: SVector<f64, SIZE>,
}

impl<'a> Solver<'a> {
    pub(super) fn new(humanoid: &'a Humanoid, tasks: &'a [Task]) -> Self {
        let tree = &humanoid.robot.tree;
        let (mut lower, mut upper) = ([0.0; NUM_JOINTS], [0.0; NUM_JOINTS]);
        let mut link_of_angle = [0; NUM_JOINTS];
        let mut local_axis = [Vector3::zeros(); NUM_JOINTS];
        for joint in tree.joints() {
            if let (JointKind::Revolute { axis }, Some(angle)) = (joint.kind, joint.angle_index) {
                link_of_angle[angle] = joint.child;
                local_axis[angle] = axis.into_inner();
            }
        }
        for (angle, &kit) in humanoid.kit_of_angle().iter().enumerate() {
            (lower[angle], upper[angle]) = (JOINTS[kit].lower_rad, JOINTS[kit].upper_rad);
        }
        let chains = tasks
            .iter()
            .map(|task| {
                let (mut chain, mut below) = (Vec::new(), task.link);
                while let Some(joint) = tree.joint_above(below) {
                    chain.extend(joint.angle_index);
                    below = joint.parent;
                }
                chain.reverse();
                chain
            })
            .collect();
        Self {
            humanoid,
            tasks,
            chains,
            lower,
            upper,
            link_of_angle,
            local_axis,
            poses: Vec::with_capacity(tree.links().len()),
            axes: [Vector3::zeros(); NUM_JOINTS],
            hessian: Box::new(SMatrix::zeros()),
            damped: Box::new(SMatrix::zeros()),
            gradient: SVector::zeros(),
        }
    }

    pub(super) fn humanoid(&self) -> &'a Humanoid {
        self.humanoid
    }

    pub(super) fn clamp(&self, angle: usize, value: f64) -> f64 {
        value.clamp(self.lower[angle], self.upper[angle])
    }

    /// Moves `pose` to the nearest minimum of the cost in at most `max_steps` steps; returns the cost, square metres.
    pub(super) fn solve(
        &mut self,
        pose: &mut Pose,
        targets: &[Target],
        prior: &Prior,
        max_steps: usize,
    ) -> f64 {
        let mut cost = self.cost(pose, targets, prior);
        let mut damping = FIRST_DAMPING;
        for _ in 0..max_steps {
            self.linearise(pose, targets, prior);
            let (mut step_size, mut gain) = (0.0, 0.0);
            let mut improved = false;
            while damping < LARGEST_DAMPING {
                let Some(step) = self.step(pose, damping) else {
                    damping *= 10.0;
                    continue;
                };
                let candidate = self.moved(pose, &step);
                let new_cost = self.cost(&candidate, targets, prior);
                if new_cost < cost {
                    step_size = step.amax();
                    gain = (cost - new_cost) / cost;
                    (*pose, cost, improved) = (candidate, new_cost, true);
                    damping = (damping * 0.1).max(FIRST_DAMPING);
                    break;
                }
                if step.amax() < SMALL_STEP {
                    break;
                }
                damping *= 10.0;
            }
            if !improved || step_size < SMALL_STEP || gain < SMALL_GAIN {
                break;
            }
        }
        cost
    }

    /// Poses of all links.
    pub(super) fn forward(&mut self, pose: &Pose) -> &[Isometry3<f64>] {
        self.humanoid.robot.tree.forward_into(&pose.root, &pose.angles, &mut self.poses);
        &self.poses
    }

    fn cost(&mut self, pose: &Pose, targets: &[Target], prior: &Prior) -> f64 {
        self.forward(pose);
        let mut cost = 0.0;
        for (task, target) in self.tasks.iter().zip(targets).filter(|(_, target)| target.weight > 0.0) {
            let link = &self.poses[task.link];
            cost += target.weight
                * match task.kind {
                    Kind::Point => {
                        (link.rotation * task.local + link.translation.vector - target.value).norm_squared()
                    }
                    Kind::Direction => {
                        DIRECTION_LENGTH_M.powi(2)
                            * (link.rotation * task.local - target.value).norm_squared()
                    }
                };
        }
        for (angle, value) in pose.angles.iter().enumerate() {
            cost += prior.weight[angle] * (value - prior.center[angle]).powi(2);
        }
        cost
    }

    /// Normal equations at the pose whose links [`Solver::forward`] placed.
    fn linearise(&mut self, pose: &Pose, targets: &[Target], prior: &Prior) {
        self.forward(pose);
        for angle in 0..NUM_JOINTS {
            self.axes[angle] = self.poses[self.link_of_angle[angle]].rotation * self.local_axis[angle];
        }
        self.hessian.fill(0.0);
        self.gradient.fill(0.0);
        let root = pose.root.translation.vector;
        // Columns of one task: index of the unknown and what moving it does to the residual.
        let mut columns = [(0_usize, Vector3::zeros()); SIZE];
        for ((task, chain), target) in self.tasks.iter().zip(&self.chains).zip(targets) {
            if target.weight <= 0.0 {
                continue;
            }
            let link = &self.poses[task.link];
            let arm = link.rotation * task.local;
            let mut count = 0;
            let mut push = |index: usize, column: Vector3<f64>| {
                columns[count] = (index, column);
                count += 1;
            };
            let residual = match task.kind {
                Kind::Point => {
                    let point = arm + link.translation.vector;
                    for axis in 0..3 {
                        let unit = Vector3::ith(axis, 1.0);
                        push(axis, unit);
                        push(3 + axis, unit.cross(&(point - root)));
                    }
                    for &angle in chain {
                        let origin = self.poses[self.link_of_angle[angle]].translation.vector;
                        push(6 + angle, self.axes[angle].cross(&(point - origin)));
                    }
                    point - target.value
                }
                Kind::Direction => {
                    let arm = arm * DIRECTION_LENGTH_M;
                    for axis in 0..3 {
                        push(3 + axis, Vector3::ith(axis, 1.0).cross(&arm));
                    }
                    for &angle in chain {
                        push(6 + angle, self.axes[angle].cross(&arm));
                    }
                    arm - target.value * DIRECTION_LENGTH_M
                }
            };
            let columns = &columns[..count];
            for (position, (row, column)) in columns.iter().enumerate() {
                let weighted = column * target.weight;
                self.gradient[*row] += weighted.dot(&residual);
                for (other, second) in &columns[..=position] {
                    // Only the lower triangle is read; columns rise within a task except for the root's six.
                    let (low, high) = (row.min(other), row.max(other));
                    self.hessian[(*high, *low)] += weighted.dot(second);
                }
            }
        }
        for angle in 0..NUM_JOINTS {
            self.hessian[(6 + angle, 6 + angle)] += prior.weight[angle];
            self.gradient[6 + angle] += prior.weight[angle] * (pose.angles[angle] - prior.center[angle]);
        }
    }

    /// The step to the minimum of the linearised cost; angles at a limit that would leave it stay.
    fn step(&mut self, pose: &Pose, damping: f64) -> Option<SVector<f64, SIZE>> {
        *self.damped = *self.hessian;
        let mut right = -self.gradient;
        for index in 0..SIZE {
            self.damped[(index, index)] += damping + damping * self.hessian[(index, index)];
        }
        for angle in 0..NUM_JOINTS {
            let (value, slope) = (pose.angles[angle], self.gradient[6 + angle]);
            let held =
                (value <= self.lower[angle] && slope > 0.0) || (value >= self.upper[angle] && slope < 0.0);
            if held {
                let index = 6 + angle;
                for other in 0..SIZE {
                    self.damped[(index, other)] = 0.0;
                    self.damped[(other, index)] = 0.0;
                }
                self.damped[(index, index)] = 1.0;
                right[index] = 0.0;
            }
        }
        let factor = Cholesky::new(*self.damped)?;
        factor.solve_mut(&mut right);
        // A step longer than this leaves the range in which the linearisation means anything.
        let longest = right.amax();
        right
            .iter()
            .all(|value| value.is_finite())
            .then(|| if longest > 0.5 { right * (0.5 / longest) } else { right })
    }

    fn moved(&self, pose: &Pose, step: &SVector<f64, SIZE>) -> Pose {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
        let translation = pose.root.translation.vector + Vector3::new(step[0], step[1], step[2]);
        let mut rotation = turn * pose.root.rotation;
        rotation.renormalize_fast();
        let root = Isometry3::from_parts(Translation3::from(translation), rotation);
        Pose {
            root,
            angles: std::array::from_fn(|angle| self.clamp(angle, pose.angles[angle] + step[6 + angle])),
        }
    }
}
