//! Contact forces that explain a movement.
//!
//! A free body can only accelerate as the ground pushes it.
//! Given the wrench the root would need if nothing touched the body, this finds forces at the sole points, inside friction
//! cones, that come closest to it; what they cannot give is the residual.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{DMatrix, DVector, Point3, Vector3};

/// Forces found for one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactForces {
    /// Force on the body at each candidate point, world, N, in the order given.
    pub forces_n: Vec<Vector3<f64>>,
    /// Part of the wanted force that no admissible contact force gives, world, N.
    pub residual_force_n: Vector3<f64>,
    /// Part of the wanted moment about the root that none gives, world, N m.
    pub residual_moment_nm: Vector3<f64>,
}

/// Finds contact forces inside friction cones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactSolver {
    /// Coulomb friction coefficient between sole and ground.
    pub friction: f64,
    /// Body weight, N; forces are scaled by it.
    pub weight_n: f64,
    /// Body height, metres; moments are scaled by weight times a tenth of it.
    pub height_m: f64,
}

/// Weight of the squared contact forces against the squared residual, both in body weights.
///
/// Small enough that it leaves the residual alone, large enough that the forces spread over the points that can carry.
const REGULARISATION: f64 = 1.0e-5;
/// Height at which a point costs twice as much as one on the floor, metres: what is higher carries less.
const SOFT_HEIGHT_M: f64 = 0.01;

impl ContactSolver {
    /// Forces at `points` (each with its height above the floor, metres) that best give the root its wanted wrench.
    ///
    /// The wanted moment is about `root`.
    /// Minimises |residual force / weight|^2 + |residual moment / (weight height / 10)|^2 + a small multiple of the forces'
    /// squares, over the product of second-order cones |tangential| <= friction * normal.
    /// Without points, or should the solver fail, all is residual.
    #[must_use]
    pub fn solve(
        &self,
        points: &[(Point3<f64>, f64)],
        root: &Vector3<f64>,
        wanted_force_n: &Vector3<f64>,
        wanted_moment_nm: &Vector3<f64>,
    ) -> ContactForces {
        self.solve_with_grips(points, &[], root, wanted_force_n, wanted_moment_nm)
    }

    /// As [`ContactSolver::solve`], with places besides where a force of any direction may act: a hand on a rail, a seat.
    ///
    /// The forces at `grips` follow those at `points` in the result; they cost as much as a point on the floor.
    #[must_use]
    pub fn solve_with_grips(
        &self,
        points: &[(Point3<f64>, f64)],
        grips: &[Point3<f64>],
        root: &Vector3<f64>,
        wanted_force_n: &Vector3<f64>,
        wanted_moment_nm: &Vector3<f64>,
    ) -> ContactForces {
        let places: Vec<(Point3<f64>, f64)> =
            points.iter().copied().chain(grips.iter().map(|grip| (*grip, 0.0))).collect();
        let unexplained = ContactForces {
            forces_n: vec![Vector3::zeros(); places.len()],
            residual_force_n: *wanted_force_n,
            residual_moment_nm: *wanted_moment_nm,
        };
        if places.is_empty() {
            return unexplained;
        }
        let moment_scale = self.weight_n * self.height_m / 10.0;
        let num_columns = 3 * places.len();
        // Wrench of unit forces (in body weights), force rows over moment rows, scaled.
        let mut wrench = DMatrix::zeros(6, num_columns);
        for (index, (point, _)) in places.iter().enumerate() {
            let lever = (point.coords - root) * (self.weight_n / moment_scale);
            wrench.view_mut((0, 3 * index), (3, 3)).copy_from(&nalgebra::Matrix3::identity());
            wrench.view_mut((3, 3 * index), (3, 3)).copy_from(&lever.cross_matrix());
        }
        let force = wanted_force_n / self.weight_n;
        let moment = wanted_moment_nm / moment_scale;
        let wanted = DVector::from_iterator(6, force.iter().chain(moment.iter()).copied());
        let costs: Vec<f64> = places
            .iter()
            .map(|(_, height_m)| REGULARISATION * (1.0 + (height_m.max(0.0) / SOFT_HEIGHT_M).powi(2)))
            .collect();
        let Some(solution) = self.minimise(&wrench, &wanted, &costs, points.len()) else {
            return unexplained;
        };

        let residual = wanted - wrench * &solution;
        let forces_n = (0..places.len())
            .map(|index| {
                Vector3::new(solution[3 * index], solution[3 * index + 1], solution[3 * index + 2])
                    * self.weight_n
            })
            .collect();
        ContactForces {
            forces_n,
            residual_force_n: Vector3::new(residual[0], residual[1], residual[2]) * self.weight_n,
            residual_moment_nm: Vector3::new(residual[3], residual[4], residual[5]) * moment_scale,
        }
    }

    /// Minimises `|r|^2 + sum of costs |f|^2` over forces `f` with `r = wanted - wrench f`; the first `num_cones` forces stay
    /// in their friction cones, the others are free.
    ///
    /// The residual is kept as variables of its own: the quadratic form is then diagonal and the solver's matrix sparse.
    fn minimise(
        &self,
        wrench: &DMatrix<f64>,
        wanted: &DVector<f64>,
        costs: &[f64],
        num_cones: usize,
    ) -> Option<DVector<f64>> {
        let num_forces = 3 * costs.len();
        let num_columns = num_forces + 6;
        let quadratic = Columns::new(num_columns, |column, entries| {
            entries.push((column, 2.0 * costs.get(column / 3).copied().unwrap_or(1.0)));
        });
        // Rows: wrench f + r = wanted, then a cone (friction * z, x, y) a point, as s = b - A x.
        let constraints = Columns::new(num_columns, |column, entries| {
            if column >= num_forces {
                entries.push((column - num_forces, 1.0));
                return;
            }
            entries.extend((0..6).map(|row| (row, wrench[(row, column)])).filter(|(_, value)| *value != 0.0));
            let (point, axis) = (column / 3, column % 3);
            if point >= num_cones {
                return;
            }
            let (row, value) = if axis == 2 { (0, -self.friction) } else { (axis + 1, -1.0) };
            entries.push((6 + 3 * point + row, value));
        });
        let num_rows = 6 + 3 * num_cones;
        let mut bounds = vec![0.0; num_rows];
        bounds[..6].copy_from_slice(wanted.as_slice());
        let mut cones = vec![SupportedConeT::ZeroConeT(6)];
        cones.extend(vec![SupportedConeT::SecondOrderConeT(3); num_cones]);
        let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
        let mut solver = DefaultSolver::new(
            &quadratic.matrix(num_columns),
            &vec![0.0; num_columns],
            &constraints.matrix(num_rows),
            &bounds,
            &cones,
            settings,
        )
        .ok()?;
        solver.solve();
        matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved)
            .then(|| DVector::from_column_slice(&solver.solution.x[..num_forces]))
    }
}

/// A sparse matrix under construction, column by column.
struct Columns {
    starts: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
}

impl Columns {
    /// Asks `fill` for the entries (row, value) of each column, in order of rows.
    fn new(num_columns: usize, mut fill: impl FnMut(usize, &mut Vec<(usize, f64)>)) -> Self {
        let mut columns = Self { starts: vec![0], rows: Vec::new(), values: Vec::new() };
        let mut entries = Vec::new();
        for column in 0..num_columns {
            entries.clear();
            fill(column, &mut entries);
            columns.rows.extend(entries.iter().map(|(row, _)| *row));
            columns.values.extend(entries.iter().map(|(_, value)| *value));
            columns.starts.push(columns.rows.len());
        }
        columns
    }

    fn matrix(self, num_rows: usize) -> CscMatrix<f64> {
        CscMatrix::new(num_rows, self.starts.len() - 1, self.starts, self.rows, self.values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOLVER: ContactSolver = ContactSolver { friction: 0.8, weight_n: 700.0, height_m: 1.75 };

    fn square() -> Vec<(Point3<f64>, f64)> {
        [(-0.1, -0.1), (0.1, -0.1), (-0.1, 0.1), (0.1, 0.1)]
            .map(|(x, y)| (Point3::new(x, y, 0.0), 0.0))
            .to_vec()
    }

    #[test]
    fn weight_over_the_middle_is_shared_alike() {
        let root = Vector3::new(0.0, 0.0, 0.9);
        let found = SOLVER.solve(&square(), &root, &Vector3::new(0.0, 0.0, 700.0), &Vector3::zeros());
        assert!(found.residual_force_n.norm() < 0.1, "{found:?}");
        assert!(found.residual_moment_nm.norm() < 0.1, "{found:?}");
        assert!(found.forces_n.iter().all(|force| (force.z - 175.0).abs() < 0.5), "{found:?}");
    }

    #[test]
    fn a_pull_is_residual_and_a_push_sideways_stops_at_the_cone() {
        let root = Vector3::new(0.0, 0.0, 0.9);
        let pull = SOLVER.solve(&square(), &root, &Vector3::new(0.0, 0.0, -100.0), &Vector3::zeros());
        assert!((pull.residual_force_n.z + 100.0).abs() < 0.5, "{pull:?}");
        // Sideways by twice what friction gives, through the floor so that no moment arises.
        let floor = Vector3::zeros();
        let slide =
            SOLVER.solve(&square(), &floor, &Vector3::new(2.0 * 0.8 * 700.0, 0.0, 700.0), &Vector3::zeros());
        for force in &slide.forces_n {
            assert!(force.xy().norm() <= 0.8 * force.z + 0.1, "{force}");
        }
        assert!(slide.residual_force_n.norm() > 100.0, "{slide:?}");
    }

    #[test]
    fn nothing_to_stand_on_leaves_everything_unexplained() {
        let wanted = Vector3::new(1.0, 2.0, 3.0);
        let found = SOLVER.solve(&[], &Vector3::zeros(), &wanted, &wanted);
        assert_eq!((found.residual_force_n, found.residual_moment_nm), (wanted, wanted));
    }

    #[test]
    fn a_grip_pulls_where_the_floor_cannot() {
        let root = Vector3::new(0.0, 0.0, 0.9);
        let down = Vector3::new(0.0, 0.0, -100.0);
        let found = SOLVER.solve_with_grips(
            &square(),
            &[Point3::new(0.0, 0.0, 1.8)],
            &root,
            &down,
            &Vector3::zeros(),
        );
        assert_eq!(found.forces_n.len(), 5);
        assert!(
            (found.forces_n[4].z + 100.0).abs() < 5.0 && found.residual_force_n.norm() < 1.0,
            "{found:?}"
        );
    }
}
