//! Level 0, limbs inside one another.

use nalgebra::{Isometry3, Point3, Vector3};

use super::metric::{Better, Metric, Score};
use super::trace::{Trace, mean};
use crate::humanoid::Humanoid;
use crate::robot::{Collision, Shape};
use crate::simulation::Level;

const MM_PER_M: f64 = 1000.0;
/// Overlap that counts, metres: soft tissue gives way by as much.
const TOLERANCE_M: f64 = 0.010;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    level: Level::L0,
    better: Better::Lower,
    formula: "",
    empty: "one frame suffices",
    reference: "body penetration of MBench (share of intersecting mesh), here between the collision solids",
    signature: "solids:capsules,boxes-as-inscribed-capsules|pairs:not-neighbours,apart-when-standing|tol:10mm|v:1",
};

/// Depth of the worst overlap.
pub(super) static DEPTH: Metric = Metric {
    key: "l0/self_collision_depth",
    title: "self-collision",
    unit: "mm",
    formula: "max over frames of the deepest overlap of two collision solids whose segments are not neighbours and lie \
              apart in the neutral stance, 0 where none is deeper than 10 mm",
    ..SHARED
};

/// Share of frames with an overlap.
pub(super) static SHARE: Metric = Metric {
    key: "l0/self_collision_share",
    title: "self-collision share",
    formula: "share of frames with an overlap as in l0/self_collision_depth",
    ..SHARED
};

pub(super) fn scores(trace: &Trace) -> Vec<Score> {
    let depths = || trace.self_depth_m.iter().map(|&depth| if depth > TOLERANCE_M { depth } else { 0.0 });
    [
        (&DEPTH, depths().max_by(f64::total_cmp).map(|depth| depth * MM_PER_M)),
        (&SHARE, mean(depths().map(|depth| f64::from(depth > 0.0)))),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}

/// A solid as a thick line in the frame of its link.
#[derive(Debug, Clone, Copy)]
struct Capsule {
    link: usize,
    ends_m: [Point3<f64>; 2],
    radius_m: f64,
}

/// The pairs of solids that could meet.
pub(super) struct SelfContact {
    capsules: Vec<Capsule>,
    pairs: Vec<(usize, usize)>,
}

impl SelfContact {
    pub(super) fn new(humanoid: &Humanoid) -> Self {
        let capsules: Vec<Capsule> = humanoid
            .robot
            .collisions
            .iter()
            .enumerate()
            .flat_map(|(link, collisions)| collisions.iter().map(move |collision| capsule(link, collision)))
            .collect();
        let neutral = humanoid.forward(&crate::motion::Frame::ZERO);
        let ends: Vec<_> = capsules.iter().map(|capsule| placed(capsule, &neutral)).collect();
        // The segments above each segment, nearest first.
        let above = |link: usize| {
            let joint = |link: usize| humanoid.robot.tree.joint_above(link).map(|joint| joint.parent);
            std::iter::successors(joint(link), move |&link| joint(link))
                .find(|link| humanoid.segment_links.contains(link))
        };
        let neighbours = |a: usize, b: usize| a == b || above(a) == Some(b) || above(b) == Some(a);
        let mut pairs = Vec::new();
        for a in 0..capsules.len() {
            for b in a + 1..capsules.len() {
                let apart = distance_m(&ends[a], &ends[b]) > capsules[a].radius_m + capsules[b].radius_m;
                if apart && !neighbours(capsules[a].link, capsules[b].link) {
                    pairs.push((a, b));
                }
            }
        }
        Self { capsules, pairs }
    }

    /// Depth of the deepest overlap, zero without one, metres.
    pub(super) fn depth_m(&self, world_from_link: &[Isometry3<f64>]) -> f64 {
        let ends: Vec<_> = self.capsules.iter().map(|capsule| placed(capsule, world_from_link)).collect();
        let mut deepest = 0.0_f64;
        for &(a, b) in &self.pairs {
            let reach = self.capsules[a].radius_m + self.capsules[b].radius_m;
            // Two lines are at least as far apart as their middles less their half lengths.
            let [from, to] = [a, b].map(|index| (ends[index][0].coords + ends[index][1].coords) / 2.0);
            let half = [a, b].map(|index| (ends[index][1] - ends[index][0]).norm() / 2.0);
            if (from - to).norm() < reach + half[0] + half[1] {
                deepest = deepest.max(reach - distance_m(&ends[a], &ends[b]));
            }
        }
        deepest
    }
}

fn placed(capsule: &Capsule, world_from_link: &[Isometry3<f64>]) -> [Point3<f64>; 2] {
    capsule.ends_m.map(|end| world_from_link[capsule.link] * end)
}

/// A box becomes the longest thick line that fits inside.
fn capsule(link: usize, collision: &Collision) -> Capsule {
    let (half_length_m, radius_m, axis) = match collision.shape {
        Shape::Sphere { radius_m } => (0.0, radius_m, Vector3::z()),
        Shape::Capsule { radius_m, length_m } => (length_m / 2.0, radius_m, Vector3::z()),
        Shape::Cylinder { radius_m, length_m } => {
            let radius = radius_m.min(length_m / 2.0);
            (length_m / 2.0 - radius, radius, Vector3::z())
        }
        Shape::Box { size_m } => {
            let (longest, shortest) = (size_m.imax(), size_m.min() / 2.0);
            (size_m[longest] / 2.0 - shortest, shortest, Vector3::ith(longest, 1.0))
        }
    };
    let end = axis * half_length_m;
    let ends_m = [-end, end].map(|end| collision.link_from_shape * Point3::from(end));
    Capsule { link, ends_m, radius_m }
}

/// Distance of two line segments (Ericson 2005, Real-Time Collision Detection, section 5.1.9).
fn distance_m(first: &[Point3<f64>; 2], second: &[Point3<f64>; 2]) -> f64 {
    let (d1, d2, r) = (first[1] - first[0], second[1] - second[0], first[0] - second[0]);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let ratio = |above: f64, below: f64| if below > 0.0 { (above / below).clamp(0.0, 1.0) } else { 0.0 };
    // Nearest place on the first line, then on the second, then on the first again where the second was clamped.
    let s = ratio(b * f - c * e, a * e - b * b);
    let t = if e > 0.0 { (b * s + f) / e } else { 0.0 };
    let t = t.clamp(0.0, 1.0);
    let s = ratio(b * t - c, a);
    ((first[0] + d1 * s) - (second[0] + d2 * t)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(from: [f64; 3], to: [f64; 3]) -> [Point3<f64>; 2] {
        [from, to].map(Point3::from)
    }

    #[test]
    fn lines_have_the_distance_geometry_says() {
        let x = line([0.0; 3], [1.0, 0.0, 0.0]);
        for (other, expected) in [
            (line([0.5, -1.0, 0.3], [0.5, 1.0, 0.3]), 0.3),
            (line([0.0, 0.0, 0.2], [1.0, 0.0, 0.2]), 0.2),
            (line([2.0, 0.0, 0.0], [3.0, 0.0, 0.0]), 1.0),
            (line([1.3, 0.4, 0.0], [1.3, 0.4, 0.0]), 0.5),
            (line([1.3, 0.4, 0.0], [1.3, 5.0, 0.0]), 0.5),
            (line([-0.3, 0.4, -1.0], [-0.3, 0.4, 1.0]), 0.5),
        ] {
            assert!((distance_m(&x, &other) - expected).abs() < 1e-12, "{other:?}");
            assert!((distance_m(&other, &x) - expected).abs() < 1e-12, "{other:?}");
        }
        let point = line([0.0; 3], [0.0; 3]);
        assert_eq!(distance_m(&point, &line([0.0, 3.0, 4.0], [0.0, 3.0, 4.0])), 5.0);
    }
}
