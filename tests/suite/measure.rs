//! Measurements on a performance: soles, support polygon, speeds.

use std::sync::LazyLock;

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use rprae::humanoid::{Humanoid, Side, SoleRegion};
use rprae::motion::Body;
use rprae::robot::Shape;
use rprae::synthesis::{Contact, Performance};

pub static HUMANOID: LazyLock<Humanoid> =
    LazyLock::new(|| Humanoid::new(Body::with_default_mass(1.75)).unwrap());

/// Link poses of every frame.
pub fn poses(performance: &Performance) -> Vec<Vec<Isometry3<f64>>> {
    performance.motion.frames().iter().map(|frame| HUMANOID.forward(frame)).collect()
}

/// Where a link is.
pub fn position(poses: &[Isometry3<f64>], link: &str) -> Vector3<f64> {
    poses[HUMANOID.robot.tree.link_index(link).unwrap()].translation.vector
}

/// The four lower corners of each block of a foot, in the world, with the part of the sole they belong to.
fn corners(poses: &[Isometry3<f64>], side: Side) -> Vec<(SoleRegion, Point3<f64>)> {
    let mut links: Vec<_> = HUMANOID
        .sole_points
        .iter()
        .filter(|point| point.side == side)
        .map(|point| (point.region, point.link))
        .collect();
    links.dedup();
    let mut corners = Vec::new();
    for (region, link) in links {
        for collision in &HUMANOID.robot.collisions[link] {
            let Shape::Box { size_m } = collision.shape else { continue };
            for (x, y) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                let corner = Point3::new(x * size_m.x, y * size_m.y, -0.5 * size_m.z);
                corners.push((region, poses[link] * collision.link_from_shape * corner));
            }
        }
    }
    corners
}

/// Corners of the soles that bear load in this frame, left and right.
pub fn loaded(poses: &[Isometry3<f64>], contacts: [Contact; 2]) -> [Vec<Point3<f64>>; 2] {
    [(Side::Left, contacts[0]), (Side::Right, contacts[1])].map(|(side, contact)| {
        let all = corners(poses, side);
        // The back edge of the heel: the two lower corners that lie furthest back in the foot.
        let heel: Vec<_> = all.iter().filter(|(region, _)| *region == SoleRegion::Heel).collect();
        match contact {
            Contact::None => Vec::new(),
            Contact::Heel => heel[..2].iter().map(|(_, corner)| *corner).collect(),
            Contact::Sole => all.iter().map(|(_, corner)| *corner).collect(),
            Contact::Toes => all
                .iter()
                .filter(|(region, _)| *region == SoleRegion::Toe)
                .map(|(_, corner)| *corner)
                .collect(),
        }
    })
}

/// Lowest point of a foot.
pub fn lowest_m(poses: &[Isometry3<f64>], side: Side) -> f64 {
    corners(poses, side).iter().map(|(_, corner)| corner.z).fold(f64::INFINITY, f64::min)
}

/// Distance of a point inside the convex hull from its border, metres; negative outside.
pub fn margin_m(points: &[Point3<f64>], [x, y]: [f64; 2]) -> f64 {
    let point = Point2::new(x, y);
    let mut margin = f64::INFINITY;
    // Every directed pair with all other points on its left is an edge of the hull.
    for a in points {
        for b in points {
            let along = (b - a).xy();
            if along.norm() < 1e-6 {
                continue;
            }
            let left = |p: Point2<f64>| along.perp(&(p - a.xy())) / along.norm();
            if points.iter().all(|p| left(p.xy()) > -1e-7) {
                margin = margin.min(left(point));
            }
        }
    }
    margin
}

/// Speeds of the joints between frames, rad/s, and their accelerations, rad/s^2; the largest of each with its place.
pub fn largest_joint_rates(performance: &Performance) -> ([(f64, usize); 44], f64) {
    let rate = performance.motion.rate_hz();
    let angles: Vec<_> = performance.motion.frames().iter().map(|frame| frame.joint_angles_rad).collect();
    let mut speeds = [(0.0_f64, 0); 44];
    let mut acceleration = 0.0_f64;
    for i in 1..angles.len() {
        for joint in 0..44 {
            let step = angles[i][joint] - angles[i - 1][joint];
            if step.abs() * rate > speeds[joint].0 {
                speeds[joint] = (step.abs() * rate, i);
            }
            if i > 1 {
                let before = angles[i - 1][joint] - angles[i - 2][joint];
                acceleration = acceleration.max((step - before).abs() * rate * rate);
            }
        }
    }
    (speeds, acceleration)
}

#[test]
fn the_margin_is_the_distance_to_the_border() {
    let square =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.4, 0.5)].map(|(x, y)| Point3::new(x, y, 0.0));
    assert!((margin_m(&square, [0.5, 0.8]) - 0.2).abs() < 1e-12);
    assert!((margin_m(&square, [0.5, 1.3]) + 0.3).abs() < 1e-12);
}
