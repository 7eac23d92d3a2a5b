//! The collision solids of a body: how far down they reach, and points on their surface.

use nalgebra::{Isometry3, Point3, Vector3};

use super::Humanoid;
use crate::robot::{Collision, Shape};

/// A solid as a centre, up to three half edges that are added and subtracted, and something round around the result.
struct Solid {
    center_m: Vector3<f64>,
    half_edges_m: [Vector3<f64>; 3],
    round: Round,
}

enum Round {
    None,
    Ball { radius_m: f64 },
    Disc { axis: Vector3<f64>, radius_m: f64 },
}

/// The collision solids of every link, ready for "how high is the lowest point".
pub struct Solids {
    of_link: Vec<Vec<Solid>>,
    /// Points on the surface, link by link.
    surface: Vec<(usize, Point3<f64>)>,
}

impl Solids {
    /// Takes the solids of a humanoid.
    #[must_use]
    pub fn new(humanoid: &Humanoid) -> Self {
        let collisions = &humanoid.robot.collisions;
        let of_link = collisions.iter().map(|collisions| collisions.iter().map(solid).collect()).collect();
        let surface = collisions
            .iter()
            .enumerate()
            .flat_map(|(link, collisions)| {
                collisions.iter().flat_map(surface_points).map(move |point| (link, point))
            })
            .collect();
        Self { of_link, surface }
    }

    /// Points spread over the surface of all solids, each with the link it is fixed to, in that link's frame, metres.
    ///
    /// They stand in for the vertices of a mesh: 26 for a box or sphere (corners, edge and face centres), 42 for a
    /// capsule or cylinder.
    #[must_use]
    pub fn surface(&self) -> &[(usize, Point3<f64>)] {
        &self.surface
    }

    /// World height of the lowest point of all solids, metres, for the link poses of [`Humanoid::forward`].
    ///
    /// Infinite for a body without solids.
    #[must_use]
    pub fn lowest_m(&self, world_from_link: &[Isometry3<f64>]) -> f64 {
        world_from_link
            .iter()
            .enumerate()
            .map(|(link, pose)| self.lowest_of_link_m(link, pose))
            .fold(f64::INFINITY, f64::min)
    }

    /// World height of the lowest point of one link's solids, metres; infinite without solids.
    #[must_use]
    pub fn lowest_of_link_m(&self, link: usize, world_from_link: &Isometry3<f64>) -> f64 {
        let solids = &self.of_link[link];
        if solids.is_empty() {
            return f64::INFINITY;
        }
        // World up in link coordinates: heights become dot products.
        let up = world_from_link.rotation.inverse_transform_vector(&Vector3::z());
        let lowest = solids.iter().map(|solid| solid.lowest_along(&up)).fold(f64::INFINITY, f64::min);
        world_from_link.translation.z + lowest
    }
}

impl Solid {
    fn lowest_along(&self, up: &Vector3<f64>) -> f64 {
        let reach: f64 = self.half_edges_m.iter().map(|edge| up.dot(edge).abs()).sum();
        let round = match &self.round {
            Round::None => 0.0,
            Round::Ball { radius_m } => *radius_m,
            // A disc reaches down by the sine of the angle between its axis and up.
            Round::Disc { axis, radius_m } => radius_m * (1.0 - up.dot(axis).powi(2)).max(0.0).sqrt(),
        };
        up.dot(&self.center_m) - reach - round
    }
}

fn solid(collision: &Collision) -> Solid {
    let pose = &collision.link_from_shape;
    let zero = Vector3::zeros();
    let axis = pose.rotation * Vector3::z();
    let (half_edges_m, round) = match collision.shape {
        Shape::Box { size_m } => {
            let edge = |axis: Vector3<f64>, length: f64| pose.rotation * axis * (0.5 * length);
            let edges =
                [edge(Vector3::x(), size_m.x), edge(Vector3::y(), size_m.y), edge(Vector3::z(), size_m.z)];
            (edges, Round::None)
        }
        Shape::Cylinder { radius_m, length_m } => {
            ([axis * (0.5 * length_m), zero, zero], Round::Disc { axis, radius_m })
        }
        Shape::Capsule { radius_m, length_m } => {
            ([axis * (0.5 * length_m), zero, zero], Round::Ball { radius_m })
        }
        Shape::Sphere { radius_m } => ([zero; 3], Round::Ball { radius_m }),
    };
    Solid { center_m: pose.translation.vector, half_edges_m, round }
}

/// Points on a solid in the directions of a cube's corners, edge centres and face centres, in the link frame.
fn surface_points(collision: &Collision) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    let mut add = |point: Vector3<f64>| points.push(collision.link_from_shape * Point3::from(point));
    for index in (0..27).filter(|&index| index != 13) {
        let direction = [index % 3, index / 3 % 3, index / 9].map(|step: i32| f64::from(step - 1));
        let [x, y, z] = direction;
        match collision.shape {
            Shape::Box { size_m } => add(0.5 * Vector3::from(direction).component_mul(&size_m)),
            Shape::Sphere { radius_m } => add(Vector3::from(direction).normalize() * radius_m),
            Shape::Capsule { radius_m, length_m } => {
                let around = Vector3::from(direction).normalize() * radius_m;
                let stations: &[f64] = if z == 0.0 { &[-0.5, 0.0, 0.5] } else { &[0.5 * z] };
                for station in stations {
                    add(around + Vector3::z() * (station * length_m));
                }
            }
            Shape::Cylinder { radius_m, length_m } => {
                let side = Vector3::new(x, y, 0.0).try_normalize(0.0).unwrap_or_default() * radius_m;
                // Rings at both ends, at the middle and between, and the centres of both discs.
                let stations: &[f64] = if z == 0.0 { &[-0.25, 0.0, 0.25] } else { &[0.5 * z] };
                for station in stations {
                    add(side + Vector3::z() * (station * length_m));
                }
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};

    fn lowest(shape: Shape, roll_rad: f64) -> f64 {
        let tilt = UnitQuaternion::from_euler_angles(roll_rad, 0.0, 0.0);
        let link_from_shape = Isometry3::from_parts(nalgebra::Translation3::new(0.0, 0.0, 0.5), tilt);
        let of_link = vec![vec![solid(&Collision { link_from_shape, shape })]];
        let solids = Solids { of_link, surface: Vec::new() };
        solids.lowest_m(&[Isometry3::translation(7.0, 8.0, 1.0)])
    }

    #[test]
    fn every_shape_reaches_as_low_as_its_geometry_says() {
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
        let cube = Shape::Box { size_m: Vector3::new(0.2, 0.2, 0.2) };
        close(lowest(cube, 0.0), 1.4);
        close(lowest(cube, FRAC_PI_4), 1.5 - 0.2 * FRAC_1_SQRT_2);
        close(lowest(Shape::Sphere { radius_m: 0.3 }, 1.0), 1.2);
        close(lowest(Shape::Capsule { radius_m: 0.1, length_m: 0.4 }, 0.0), 1.2);
        close(lowest(Shape::Capsule { radius_m: 0.1, length_m: 0.4 }, FRAC_PI_4), 1.4 - 0.2 * FRAC_1_SQRT_2);
        close(lowest(Shape::Cylinder { radius_m: 0.1, length_m: 0.4 }, 0.0), 1.3);
        close(lowest(Shape::Cylinder { radius_m: 0.1, length_m: 0.4 }, FRAC_PI_4), 1.5 - 0.3 * FRAC_1_SQRT_2);
    }

    #[test]
    fn points_of_the_surface_reach_as_far_as_the_solid() {
        for (shape, count) in [
            (Shape::Box { size_m: Vector3::new(0.2, 0.3, 0.4) }, 26),
            (Shape::Sphere { radius_m: 0.3 }, 26),
            (Shape::Capsule { radius_m: 0.1, length_m: 0.4 }, 42),
            (Shape::Cylinder { radius_m: 0.1, length_m: 0.4 }, 42),
        ] {
            let collision = Collision { link_from_shape: Isometry3::identity(), shape };
            let points = surface_points(&collision);
            assert_eq!(points.len(), count, "{shape:?}");
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                let lowest = points.iter().map(|point| point.coords.dot(&axis)).fold(f64::INFINITY, f64::min);
                assert!((lowest - solid(&collision).lowest_along(&axis)).abs() < 1e-12, "{shape:?}");
            }
        }
    }
}
