//! Inverse dynamics against MuJoCo and Pinocchio, and contact forces on recorded motion.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::path::Path;

use nalgebra::{DVector, Isometry3, Matrix6xX, Point3, Translation3, UnitQuaternion, Vector3};
use rprae::dynamics::{
    ContactSolver, ExternalForce, Inertia, InverseDynamics, RootMotion, inverse_dynamics, point_jacobian_into,
};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, JOINTS, NUM_JOINTS};
use serde_json::Value;
use sha2::{Digest, Sha256};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn adult() -> Humanoid {
    Humanoid::new(Body::with_default_mass(1.75)).unwrap()
}

fn golden() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/humanoid_dynamics.json");
    let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let urdf =
        Sha256::digest(adult().urdf).iter().fold(String::new(), |sum, byte| sum + &format!("{byte:02x}"));
    assert_eq!(golden["urdf_sha256"], urdf, "the URDF changed; run {}", golden["command"]);
    golden
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()))
}

fn by_joint(humanoid: &Humanoid, value: &Value) -> [f64; NUM_JOINTS] {
    humanoid.kit_of_angle().map(|kit| value[JOINTS[kit].name].as_f64().unwrap())
}

#[test]
fn torques_and_root_wrench_agree_with_mujoco_and_pinocchio() {
    let humanoid = adult();
    let tree = &humanoid.robot.tree;
    let mut found = InverseDynamics::default();
    let mut worst: f64 = 0.0;
    for state in golden()["states"].as_array().unwrap() {
        let rpy = vector(&state["root_rpy_rad"]);
        let root_pose = Isometry3::from_parts(
            Translation3::from(vector(&state["root_position_m"])),
            UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z),
        );
        let root = RootMotion {
            velocity: vector(&state["root_velocity_m_s"]),
            angular_velocity: vector(&state["root_angular_velocity_rad_s"]),
            acceleration: vector(&state["root_acceleration_m_s2"]),
            angular_acceleration: vector(&state["root_angular_acceleration_rad_s2"]),
        };
        let poses = tree.forward(&root_pose, &by_joint(&humanoid, &state["angles_rad"]));
        let speeds = by_joint(&humanoid, &state["speeds_rad_s"]);
        let accelerations = by_joint(&humanoid, &state["accelerations_rad_s2"]);
        inverse_dynamics(tree, &poses, &root, &speeds, &accelerations, &GRAVITY, &[], &mut found);
        let expected = by_joint(&humanoid, &state["torques_nm"]);
        let scale = expected.iter().fold(0.0_f64, |scale, torque| scale.max(torque.abs()));
        let mut differ = |a: f64, b: f64| worst = worst.max((a - b).abs() / scale);
        found.torques_nm.iter().zip(&expected).for_each(|(a, b)| differ(*a, *b));
        let (force, moment) = (vector(&state["root_force_n"]), vector(&state["root_moment_nm"]));
        found.root_force_n.iter().zip(&force).for_each(|(a, b)| differ(*a, *b));
        found.root_moment_nm.iter().zip(&moment).for_each(|(a, b)| differ(*a, *b));
    }
    assert!(worst < 1e-9, "differs by {worst:e} of the largest torque");
    println!("inverse dynamics differs from Pinocchio by at most {worst:.1e} of the largest torque");
}

fn root_pose(state: &Value) -> Isometry3<f64> {
    let rpy = vector(&state["root_rpy_rad"]);
    Isometry3::from_parts(
        Translation3::from(vector(&state["root_position_m"])),
        UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z),
    )
}

/// The state's velocity in the order of [`Inertia`].
fn velocity(humanoid: &Humanoid, state: &Value) -> DVector<f64> {
    let parts = [vector(&state["root_velocity_m_s"]), vector(&state["root_angular_velocity_rad_s"])];
    let root = parts.iter().flat_map(|part| part.iter().copied().collect::<Vec<_>>());
    let speeds = by_joint(humanoid, &state["speeds_rad_s"]);
    DVector::from_iterator(6 + NUM_JOINTS, root.chain(speeds))
}

#[test]
fn mass_matrix_momentum_and_jacobians_agree_with_mujoco_and_pinocchio() {
    let humanoid = adult();
    let tree = &humanoid.robot.tree;
    let (mut inertia, mut jacobian) = (Inertia::default(), Matrix6xX::zeros(6 + NUM_JOINTS));
    let mut worst: f64 = 0.0;
    for state in golden()["states"].as_array().unwrap() {
        let poses = tree.forward(&root_pose(state), &by_joint(&humanoid, &state["angles_rad"]));
        inertia.update(tree, &poses);
        let velocity = velocity(&humanoid, state);
        let mut differ = |name: &str, found: &[f64], expected: &[f64]| {
            let scale = expected.iter().fold(1e-3_f64, |scale, value| scale.max(value.abs()));
            for (a, b) in found.iter().zip(expected) {
                assert!((a - b).abs() < 1e-9 * scale, "{name}: {a} instead of {b}");
                worst = worst.max((a - b).abs() / scale);
            }
        };
        let numbers = |value: &Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
        };
        let momentum = inertia.mass_matrix() * &velocity;
        differ("momentum of the root", &momentum.as_slice()[..6], &numbers(&state["momentum_of_root"]));
        differ("momentum", &momentum.as_slice()[6..], &by_joint(&humanoid, &state["momentum_of_joints"]));
        let diagonal = inertia.mass_matrix().diagonal();
        differ(
            "diagonal",
            &diagonal.as_slice()[6..],
            &by_joint(&humanoid, &state["mass_diagonal_of_joints"]),
        );
        let energy_j = velocity.dot(&momentum) / 2.0;
        differ("kinetic energy", &[energy_j], &[state["kinetic_energy_j"].as_f64().unwrap()]);
        differ("centre of mass", inertia.com_m().as_slice(), &numbers(&state["com_m"]));
        differ("tree's centre of mass", tree.center_of_mass(&poses).as_slice(), &numbers(&state["com_m"]));
        let com_velocity = inertia.com_jacobian() * &velocity;
        differ(
            "velocity of the centre of mass",
            com_velocity.as_slice(),
            &numbers(&state["com_velocity_m_s"]),
        );
        let centroidal = inertia.centroidal_momentum_matrix() * &velocity;
        differ("angular momentum", &centroidal.as_slice()[3..], &numbers(&state["angular_momentum_kgm2_s"]));
        let linear = com_velocity * tree.total_mass_kg();
        differ("linear momentum", &centroidal.as_slice()[..3], linear.as_slice());
        let hand = tree.link_index("left_hand").unwrap();
        let point = poses[hand] * Point3::new(0.01, 0.02, -0.05);
        point_jacobian_into(tree, &poses, hand, &point.coords, &mut jacobian);
        differ("hand", (&jacobian * &velocity).as_slice(), &numbers(&state["hand_velocity"]));
    }
    println!("mass matrix, momentum and Jacobians differ from Pinocchio by at most {worst:.1e}");
}

#[test]
fn inverse_dynamics_is_the_mass_matrix_times_the_acceleration() {
    // At rest and without gravity nothing else is left of the equation of motion.
    let humanoid = adult();
    let tree = &humanoid.robot.tree;
    let angles: [f64; NUM_JOINTS] = std::array::from_fn(|index| 0.3 * (1.3 * index as f64).sin());
    let poses = tree.forward(&Isometry3::translation(0.3, 0.2, 1.0), &angles);
    let acceleration = DVector::from_fn(6 + NUM_JOINTS, |index, _| (0.7 * index as f64).cos());
    let root = RootMotion {
        acceleration: acceleration.fixed_rows::<3>(0).into(),
        angular_acceleration: acceleration.fixed_rows::<3>(3).into(),
        ..RootMotion::default()
    };
    let (rest, mut found, mut inertia) = ([0.0; NUM_JOINTS], InverseDynamics::default(), Inertia::default());
    let joints = &acceleration.as_slice()[6..];
    inverse_dynamics(tree, &poses, &root, &rest, joints, &Vector3::zeros(), &[], &mut found);
    inertia.update(tree, &poses);
    let expected = inertia.mass_matrix() * &acceleration;
    let forces = found.root_force_n.iter().chain(found.root_moment_nm.iter()).chain(&found.torques_nm);
    for (force, expected) in forces.zip(expected.iter()) {
        assert!((force - expected).abs() < 1e-9 * expected.abs().max(1.0), "{force} instead of {expected}");
    }
    assert_eq!(*inertia.mass_matrix(), inertia.mass_matrix().transpose(), "exactly symmetric");
    let place = inertia.mass_matrix().as_ptr();
    inertia.update(tree, &poses);
    assert_eq!(place, inertia.mass_matrix().as_ptr(), "the buffers are kept");
}

#[test]
fn an_external_force_is_felt_as_its_virtual_work() {
    // With everything at rest and no gravity, the torques must balance the force: tau = -J' f.
    let humanoid = adult();
    let tree = &humanoid.robot.tree;
    let angles: [f64; NUM_JOINTS] = std::array::from_fn(|index| 0.2 * (index as f64).sin());
    let poses = tree.forward(&Isometry3::translation(0.0, 0.0, 1.0), &angles);
    let link = tree.link_index("left_hand").unwrap();
    let point = poses[link] * Point3::new(0.01, 0.02, -0.05);
    let force = Vector3::new(3.0, -7.0, 11.0);
    let push = ExternalForce { link, point_m: point.coords, force_n: force };
    let (rest, mut found) = ([0.0; NUM_JOINTS], InverseDynamics::default());
    inverse_dynamics(
        tree,
        &poses,
        &RootMotion::default(),
        &rest,
        &rest,
        &Vector3::zeros(),
        &[push],
        &mut found,
    );
    let jacobian = tree.point_jacobian(&poses, link, &point.coords);
    for (angle, torque) in found.torques_nm.iter().enumerate() {
        assert!((torque + jacobian.column(angle).dot(&force)).abs() < 1e-12);
    }
    assert!((found.root_force_n + force).norm() < 1e-12);
}

#[test]
fn standing_is_explained_by_its_soles_to_the_last_newton() {
    let humanoid = adult();
    let tree = &humanoid.robot.tree;
    let poses = tree
        .forward(&Isometry3::translation(0.0, 0.0, humanoid.standing_root_height_m()), &[0.0; NUM_JOINTS]);
    let (rest, mut found) = ([0.0; NUM_JOINTS], InverseDynamics::default());
    inverse_dynamics(tree, &poses, &RootMotion::default(), &rest, &rest, &GRAVITY, &[], &mut found);
    let weight_n = tree.total_mass_kg() * 9.81;
    assert!((found.root_force_n.z - weight_n).abs() < 1e-9);
    let points: Vec<_> = humanoid.sole_points_in_world(&poses).map(|point| (point, point.z)).collect();
    let solver = ContactSolver { friction: 0.8, weight_n, height_m: humanoid.body.height_m };
    let contact =
        solver.solve(&points, &poses[0].translation.vector, &found.root_force_n, &found.root_moment_nm);
    assert!(contact.residual_force_n.norm() < 1e-3 * weight_n, "{}", contact.residual_force_n);
    assert!(contact.residual_moment_nm.norm() < 1e-3 * weight_n * humanoid.body.height_m);
    assert!(contact.forces_n.iter().all(|force| force.z >= -1e-6));
}
