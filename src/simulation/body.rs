//! Rigid bodies and collision shapes of the humanoid in the engine.

use nalgebra::{Isometry3, Matrix3, Vector3};
use rapier3d_f64::prelude::*;

use super::engine::{Engine, pose, vector};
use crate::humanoid::Humanoid;
use crate::kinematics::Inertial;
use crate::robot::{Collision, Shape};

/// Rotational inertia added to the links: iterative solvers need it, physics does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AddedInertia {
    /// About all axes of every link but the root, kg m^2.
    pub everywhere_kgm2: f64,
    /// About all axes of each of the three parts of a foot, on top of that, kg m^2.
    pub feet_kgm2: f64,
}

/// Inserts a body for a link at a pose, with its mass and shapes.
pub(super) fn insert_link(
    engine: &mut Engine,
    humanoid: &Humanoid,
    link: usize,
    world_from_link: &Isometry3<f64>,
    added: AddedInertia,
) -> RigidBodyHandle {
    let mut builder = RigidBodyBuilder::dynamic().pose(pose(world_from_link)).can_sleep(false);
    if let Some(inertial) = humanoid.robot.tree.links()[link].inertial {
        let is_foot = humanoid.sole_points.iter().any(|point| point.link == link);
        let extra = added.everywhere_kgm2 + if is_foot { added.feet_kgm2 } else { 0.0 };
        let extra = if link == 0 { 0.0 } else { extra };
        builder = builder.additional_mass_properties(mass_properties(&inertial, extra, engine.mass_factor));
    }
    let handle = engine.bodies.insert(builder);
    for (shape, body_from_shape) in solids(&humanoid.robot.collisions[link]) {
        engine.attach(shape, pose(&body_from_shape), handle);
    }
    // Mass properties otherwise take effect in the first step only, after the start velocities need them.
    engine.bodies[handle].recompute_mass_properties_from_colliders(&engine.colliders);
    handle
}

fn mass_properties(inertial: &Inertial, extra_kgm2: f64, factor: f64) -> MassProperties {
    let inertia = inertial.inertia_about_com_kgm2 * factor + Matrix3::identity() * extra_kgm2;
    let columns = [inertia.column(0), inertia.column(1), inertia.column(2)]
        .map(|column| Vector::new(column[0], column[1], column[2]));
    MassProperties::with_inertia_matrix(
        vector(&inertial.com_in_link_m),
        inertial.mass_kg * factor,
        rapier3d_f64::math::Matrix::from_cols(columns[0], columns[1], columns[2]),
    )
}

/// Engine shapes of a link: a cylinder with a sphere of its radius at either end is one capsule, the same solid.
fn solids(collisions: &[Collision]) -> Vec<(SharedShape, Isometry3<f64>)> {
    let mut used = vec![false; collisions.len()];
    let mut solids = Vec::new();
    for (index, collision) in collisions.iter().enumerate() {
        let Shape::Cylinder { radius_m, length_m } = collision.shape else { continue };
        let sphere_at = |z: f64| {
            let end = collision.link_from_shape * nalgebra::Point3::new(0.0, 0.0, z);
            collisions.iter().position(|other| {
                matches!(other.shape, Shape::Sphere { radius_m: r } if (r - radius_m).abs() < 1e-9)
                    && (other.link_from_shape.translation.vector - end.coords).norm() < 1e-7
            })
        };
        if let (Some(bottom), Some(top)) = (sphere_at(-length_m / 2.0), sphere_at(length_m / 2.0)) {
            (used[index], used[bottom], used[top]) = (true, true, true);
            solids.push((SharedShape::capsule_z(length_m / 2.0, radius_m), collision.link_from_shape));
        }
    }
    for (collision, _) in collisions.iter().zip(&used).filter(|(_, used)| !**used) {
        let mut link_from_shape = collision.link_from_shape;
        let shape = match collision.shape {
            Shape::Box { size_m } => SharedShape::cuboid(size_m.x / 2.0, size_m.y / 2.0, size_m.z / 2.0),
            Shape::Sphere { radius_m } => SharedShape::ball(radius_m),
            Shape::Capsule { radius_m, length_m } => SharedShape::capsule_z(length_m / 2.0, radius_m),
            Shape::Cylinder { radius_m, length_m } => {
                // The engine's cylinders stand along y, URDF's along z.
                link_from_shape *= nalgebra::UnitQuaternion::from_axis_angle(
                    &Vector3::x_axis(),
                    std::f64::consts::FRAC_PI_2,
                );
                SharedShape::cylinder(length_m / 2.0, radius_m)
            }
        };
        solids.push((shape, link_from_shape));
    }
    solids
}
