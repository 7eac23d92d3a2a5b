//! Mass matrix, momentum and Jacobians of a tree with a free root.
//!
//! Generalised velocity: the root's velocity (3, of its origin), its angular velocity (3), the speeds of the angles; all in
//! world axes. A row or column index below 6 is one of the root.
//!
//! Reference: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 6; Orin, Goswami and Lee 2013, Autonomous Robots
//! 35:161 (centroidal momentum).

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix3xX, Matrix6xX, Vector3};

use crate::kinematics::{JointKind, Tree};

/// Mass, first and second moment of a body about a point, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Composite {
    mass_kg: f64,
    /// Mass times the vector from the point to the centre of mass, kg m.
    first_kgm: Vector3<f64>,
    /// Inertia about the point, kg m^2.
    inertia_kgm2: Matrix3<f64>,
}

impl Composite {
    const NOTHING: Self = Self { mass_kg: 0.0, first_kgm: Vector3::new(0.0, 0.0, 0.0), inertia_kgm2: ZERO };

    fn add(&mut self, other: &Self) {
        self.mass_kg += other.mass_kg;
        self.first_kgm += other.first_kgm;
        self.inertia_kgm2 += other.inertia_kgm2;
    }
}

const ZERO: Matrix3<f64> = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// `m (|r|^2 1 - r r')`: inertia of a point mass at `r`.
fn point_inertia(mass_kg: f64, at: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal_element(mass_kg * at.norm_squared()) - at * at.transpose() * mass_kg
}

/// Buffers and results of the mass-matrix algorithms; reused, they allocate nothing after the first call.
#[derive(Debug, Clone, Default)]
pub struct Inertia {
    composites: Vec<Composite>,
    mass_matrix: DMatrix<f64>,
    momentum: Matrix6xX<f64>,
    com_jacobian: Matrix3xX<f64>,
    com_m: Vector3<f64>,
    mass_kg: f64,
}

/// Axis and origin of a revolute joint in the world.
fn hinge(tree: &Tree, poses: &[Isometry3<f64>], link: usize) -> Option<(usize, Vector3<f64>, Vector3<f64>)> {
    let joint = tree.joint_above(link)?;
    let (JointKind::Revolute { axis }, Some(index)) = (joint.kind, joint.angle_index) else { return None };
    let pose = &poses[link];
    Some((6 + index, pose.rotation * axis.into_inner(), pose.translation.vector))
}

impl Inertia {
    /// Computes everything for the link poses of [`Tree::forward`].
    ///
    /// # Panics
    /// When there is not one pose per link.
    pub fn update(&mut self, tree: &Tree, world_from_link: &[Isometry3<f64>]) {
        let num_links = tree.links().len();
        assert_eq!(world_from_link.len(), num_links, "one pose per link");
        let size = 6 + tree.num_angles();
        if self.mass_matrix.nrows() != size {
            self.mass_matrix = DMatrix::zeros(size, size);
            self.momentum = Matrix6xX::zeros(size);
            self.com_jacobian = Matrix3xX::zeros(size);
        }
        let root = world_from_link[0].translation.vector;
        self.gather(tree, world_from_link, &root);
        let whole = self.composites[0];
        self.mass_kg = whole.mass_kg;
        let com = whole.first_kgm / whole.mass_kg;
        self.com_m = root + com;

        // The momentum that a unit speed of each column gives, about the root; it is the column of the root's six rows.
        self.mass_matrix.fill(0.0);
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            self.set_column(axis, &(unit * whole.mass_kg), &whole.first_kgm.cross(&unit), &com);
            let spin = unit.cross(&whole.first_kgm);
            self.set_column(3 + axis, &spin, &(whole.inertia_kgm2 * unit), &com);
        }
        for link in 1..num_links {
            let Some((column, axis, origin)) = hinge(tree, world_from_link, link) else { continue };
            let below = self.composites[link];
            let from_root = origin - root;
            // What is below turns about the joint: its momentum, and that about the root.
            let velocity = from_root.cross(&axis);
            let linear = axis.cross(&below.first_kgm) + velocity * below.mass_kg;
            let angular = below.inertia_kgm2 * axis + below.first_kgm.cross(&velocity);
            self.set_column(column, &linear, &angular, &com);
            // Every joint above feels it as the moment about its own axis.
            let mut above = link;
            while let Some(joint) = tree.joint_above(above) {
                if let Some((row, other, place)) = hinge(tree, world_from_link, above) {
                    let moment = angular - (place - root).cross(&linear);
                    let entry = other.dot(&moment);
                    self.mass_matrix[(row, column)] = entry;
                    self.mass_matrix[(column, row)] = entry;
                }
                above = joint.parent;
            }
        }
    }

    /// Composites of every link with all that is below it, about the root's origin.
    fn gather(&mut self, tree: &Tree, poses: &[Isometry3<f64>], root: &Vector3<f64>) {
        self.composites.clear();
        for (link, pose) in tree.links().iter().zip(poses) {
            let composite = link.inertial.map_or(Composite::NOTHING, |inertial| {
                let center = pose.rotation * inertial.com_in_link_m + pose.translation.vector - root;
                let axes = pose.rotation.to_rotation_matrix();
                let own = axes.matrix() * inertial.inertia_about_com_kgm2 * axes.matrix().transpose();
                Composite {
                    mass_kg: inertial.mass_kg,
                    first_kgm: center * inertial.mass_kg,
                    inertia_kgm2: own + point_inertia(inertial.mass_kg, &center),
                }
            });
            self.composites.push(composite);
        }
        for joint in tree.joints().iter().rev() {
            let below = self.composites[joint.child];
            self.composites[joint.parent].add(&below);
        }
    }

    /// Enters the linear momentum and the angular momentum about the root that a unit speed of a column gives.
    fn set_column(
        &mut self,
        column: usize,
        linear: &Vector3<f64>,
        angular: &Vector3<f64>,
        com: &Vector3<f64>,
    ) {
        for axis in 0..3 {
            self.mass_matrix[(axis, column)] = linear[axis];
            self.mass_matrix[(3 + axis, column)] = angular[axis];
            self.mass_matrix[(column, axis)] = linear[axis];
            self.mass_matrix[(column, 3 + axis)] = angular[axis];
            self.momentum[(axis, column)] = linear[axis];
            self.com_jacobian[(axis, column)] = linear[axis] / self.mass_kg;
        }
        let about_com = angular - com.cross(linear);
        for axis in 0..3 {
            self.momentum[(3 + axis, column)] = about_com[axis];
        }
    }

    /// Mass matrix, `[velocity, velocity]`: kg, kg m and kg m^2.
    #[must_use]
    pub fn mass_matrix(&self) -> &DMatrix<f64> {
        &self.mass_matrix
    }

    /// Centroidal momentum matrix, `[6, velocity]`: linear momentum (kg m/s) over angular momentum about the centre of mass
    /// (kg m^2/s).
    #[must_use]
    pub fn centroidal_momentum_matrix(&self) -> &Matrix6xX<f64> {
        &self.momentum
    }

    /// Jacobian of the centre of mass, `[3, velocity]`: its velocity in the world.
    #[must_use]
    pub fn com_jacobian(&self) -> &Matrix3xX<f64> {
        &self.com_jacobian
    }

    /// Centre of mass in the world, metres.
    #[must_use]
    pub fn com_m(&self) -> Vector3<f64> {
        self.com_m
    }
}

/// Writes the Jacobian of a point fixed to a link into `jacobian`, `[6, velocity]`: velocity of the point over angular
/// velocity of the link, world axes.
///
/// # Panics
/// When `jacobian` does not have six columns and one per angle.
pub fn point_jacobian_into(
    tree: &Tree,
    world_from_link: &[Isometry3<f64>],
    link: usize,
    point_in_world_m: &Vector3<f64>,
    jacobian: &mut Matrix6xX<f64>,
) {
    assert_eq!(jacobian.ncols(), 6 + tree.num_angles(), "six columns for the root and one per angle");
    jacobian.fill(0.0);
    let lever = point_in_world_m - world_from_link[0].translation.vector;
    for axis in 0..3 {
        jacobian[(axis, axis)] = 1.0;
        jacobian[(3 + axis, 3 + axis)] = 1.0;
        let velocity = Vector3::ith(axis, 1.0).cross(&lever);
        jacobian.fixed_view_mut::<3, 1>(0, 3 + axis).copy_from(&velocity);
    }
    let mut above = link;
    while let Some(joint) = tree.joint_above(above) {
        if let Some((column, axis, origin)) = hinge(tree, world_from_link, above) {
            jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&axis.cross(&(point_in_world_m - origin)));
            jacobian.fixed_view_mut::<3, 1>(3, column).copy_from(&axis);
        }
        above = joint.parent;
    }
}
