//! The humanoid against MuJoCo, Pinocchio and its own committed files.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::path::Path;

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, JOINTS};
use rprae::robot::Shape;
use serde_json::Value;
use sha2::{Digest, Sha256};

/// The body of `urdf/mmm_humanoid.urdf`.
fn adult() -> Humanoid {
    Humanoid::new(Body::with_default_mass(1.75)).unwrap()
}

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn sha256(text: &str) -> String {
    Sha256::digest(text).iter().fold(String::new(), |sum, byte| sum + &format!("{byte:02x}"))
}

/// The golden file, with a check that it was made from the committed URDF.
fn golden() -> Value {
    let golden: Value = serde_json::from_str(&read("tests/golden/humanoid_fk.json")).unwrap();
    assert_eq!(
        golden["urdf_sha256"],
        sha256(&read("urdf/mmm_humanoid.urdf")),
        "the URDF changed since the golden file was made; run {}",
        golden["command"]
    );
    golden
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let numbers: Vec<f64> = value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect();
    numbers.try_into().unwrap()
}

fn frame(state: &Value) -> Frame {
    let mut frame = Frame::ZERO;
    frame.root_position_m = numbers(&state["root_position_m"]);
    frame.root_rotation_rad = numbers(&state["root_rpy_rad"]);
    for (angle, joint) in frame.joint_angles_rad.iter_mut().zip(&JOINTS) {
        *angle = state["angles_rad"][joint.name].as_f64().unwrap();
        assert!((joint.lower_rad..=joint.upper_rad).contains(angle), "{}", joint.name);
    }
    frame
}

#[test]
fn committed_urdf_is_what_the_library_writes() {
    let written = adult().urdf;
    let committed = read("urdf/mmm_humanoid.urdf");
    let differs = written.lines().zip(committed.lines()).position(|(new, old)| new != old);
    assert!(
        written == committed,
        "line {:?} differs; renew the file with `rprae urdf --height 1.75 --out urdf/mmm_humanoid.urdf`",
        differs.map(|line| line + 1)
    );
}

#[test]
fn every_file_beside_the_urdf_has_its_checksum_in_the_readme() {
    let readme = read("urdf/README.md");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("urdf");
    let mut checked = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name != "README.md" {
            let row = readme.lines().find(|line| line.starts_with(&format!("| `{name}` |")));
            let sum = sha256(&read(&format!("urdf/{name}")));
            assert!(
                row.is_some_and(|row| row.contains(&sum)),
                "urdf/README.md has no row with {name} and {sum}"
            );
            checked += 1;
        }
    }
    assert!(checked > 0);
}

#[test]
fn link_poses_equal_those_of_mujoco_and_pinocchio() {
    let (humanoid, golden) = (adult(), golden());
    let states = golden["states"].as_array().unwrap();
    assert_eq!(states.len(), 20);
    for state in states {
        let poses = humanoid.forward(&frame(state));
        let links = state["links"].as_object().unwrap();
        assert_eq!(links.len(), humanoid.segment_links.len());
        for (name, pose) in links {
            let [x, y, z, w, i, j, k] = numbers(pose);
            let expected = Isometry3::from_parts(
                Translation3::new(x, y, z),
                UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
            );
            let found = poses[humanoid.robot.tree.link_index(name).unwrap()];
            // A point as far from the link's origin as a body reaches sees position and rotation.
            for point in [Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 1.0)] {
                let error_m = (found * point - expected * point).norm();
                assert!(error_m < 1e-9, "{name}: {error_m:e} m");
            }
        }
    }
}

#[test]
fn mass_and_centre_of_mass_equal_those_of_mujoco_and_pinocchio() {
    let (humanoid, golden) = (adult(), golden());
    let tree = &humanoid.robot.tree;
    assert!((tree.total_mass_kg() - golden["mass_kg"].as_f64().unwrap()).abs() < 1e-9);
    for state in golden["states"].as_array().unwrap() {
        let com = tree.center_of_mass(&humanoid.forward(&frame(state)));
        let error_m = (com - Vector3::from(numbers(&state["center_of_mass_m"]))).norm();
        assert!(error_m < 1e-9, "{error_m:e} m");
    }
}

#[test]
fn point_jacobian_equals_that_of_mujoco_and_pinocchio() {
    let (humanoid, golden) = (adult(), golden());
    let tree = &humanoid.robot.tree;
    let point_in_link = Point3::from(numbers(&golden["point_in_link_m"]));
    let mut moving = 0;
    for state in golden["states"].as_array().unwrap() {
        let poses = humanoid.forward(&frame(state));
        let expected = &state["jacobian"];
        let link = tree.link_index(expected["link"].as_str().unwrap()).unwrap();
        let jacobian = tree.point_jacobian(&poses, link, &(poses[link] * point_in_link).coords);
        for joint in tree.joints() {
            let column = expected["columns_m"].get(&joint.name).map_or(Vector3::zeros(), |column| {
                moving += 1;
                Vector3::from(numbers(column))
            });
            let error_m = (jacobian.column(joint.angle_index.unwrap()) - column).norm();
            assert!(error_m < 1e-9, "{}: {error_m:e} m", joint.name);
        }
    }
    assert!(moving > 100, "only {moving} columns move their point");
}

#[test]
fn left_and_right_are_mirror_images() {
    let humanoid = adult();
    let tree = &humanoid.robot.tree;
    let mut frame = Frame::ZERO;
    for (index, joint) in JOINTS.iter().enumerate() {
        // Any pose that is its own mirror image: equal angles about x, opposite ones about y and z, a straight spine.
        let share = 0.2 + 0.01 * (index % 14) as f64;
        let angle = joint.lower_rad + share * (joint.upper_rad - joint.lower_rad);
        if let Some(rest) = joint.name.strip_prefix('L') {
            let right = JOINTS.iter().position(|other| other.name == format!("R{rest}")).unwrap();
            let about_x = joint.axis == rprae::motion::skeleton::Axis::X;
            frame.joint_angles_rad[index] = angle;
            frame.joint_angles_rad[right] = if about_x { angle } else { -angle };
        }
    }
    let poses = humanoid.forward(&frame);
    let mirror = |point: Point3<f64>| Point3::new(-point.x, point.y, point.z);
    for (index, link) in tree.links().iter().enumerate() {
        let Some(rest) = link.name.strip_prefix("left_") else { continue };
        let other = tree.link_index(&format!("right_{rest}")).unwrap();
        // The facts place both midfoot joints 0.6 mm to the right of the ankle at 1 m height, and the foot hangs on them;
        // elsewhere the two sides differ by less than 0.05 mm.
        let allowed_m = if ["midfoot", "toes"].contains(&rest) { 2.5e-3 } else { 1e-4 };
        let (left, right) = (link.inertial.unwrap(), tree.links()[other].inertial.unwrap());
        assert!((left.mass_kg - right.mass_kg).abs() < 1e-9, "{}", link.name);
        let com_error_m = mirror(poses[index] * Point3::from(left.com_in_link_m))
            - poses[other] * Point3::from(right.com_in_link_m);
        assert!(com_error_m.norm() < allowed_m, "{}: {com_error_m} m", link.name);
        for point in [Point3::origin(), Point3::new(0.1, 0.2, 0.3)] {
            let error_m = (mirror(poses[index] * point) - poses[other] * mirror(point)).norm();
            assert!(error_m < allowed_m, "{}: {error_m:e} m", link.name);
        }
    }
    // Standing upright, the soles themselves are mirror images.
    let poses = humanoid.forward(&Frame::ZERO);
    let soles: Vec<Point3<f64>> = humanoid.sole_points_in_world(&poses).collect();
    for &point in &soles {
        assert!(soles.iter().any(|&other| (mirror(point) - other).norm() < 1e-7), "{point}");
    }
}

#[test]
fn bodies_of_any_accepted_size_are_robots_of_their_mass() {
    for height_m in [0.3, 1.0, 1.62, 3.0] {
        for mass_kg in [1.0, 22.5, 68.9, 500.0] {
            let humanoid = Humanoid::new(Body { height_m, mass_kg }).unwrap();
            let found = humanoid.robot.tree.total_mass_kg();
            assert!((found - mass_kg).abs() < 1e-4, "{found} kg for {mass_kg} kg");
            let feet = humanoid.sole_points.len();
            assert_eq!(feet, 12);
        }
    }
    for height_m in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        assert!(Humanoid::new(Body { height_m, mass_kg: 70.0 }).is_err(), "{height_m}");
    }
}

#[test]
fn shapes_follow_the_bones_and_stand_on_one_floor() {
    let humanoid = adult();
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = humanoid.standing_root_height_m();
    let poses = humanoid.forward(&frame);
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    for (pose, collisions) in poses.iter().zip(&humanoid.robot.collisions) {
        for collision in collisions {
            let world_from_shape = pose * collision.link_from_shape;
            let up_in_shape = world_from_shape.rotation.inverse() * Vector3::z();
            let reach = match collision.shape {
                Shape::Box { size_m } => size_m.component_mul(&up_in_shape.abs()).sum() / 2.0,
                Shape::Sphere { radius_m } => radius_m,
                // Its two spheres are shapes of their own.
                Shape::Cylinder { .. } => 0.0,
                Shape::Capsule { .. } => panic!("not in the URDF standard"),
            };
            lowest = lowest.min(world_from_shape.translation.z - reach);
            highest = highest.max(world_from_shape.translation.z + reach);
        }
    }
    assert!(lowest.abs() < 5e-5, "the lowest point is at {lowest} m");
    assert!((highest - 1.75).abs() < 5e-3, "the highest point is at {highest} m");
}
