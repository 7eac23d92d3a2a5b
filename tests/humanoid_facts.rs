//! The humanoid against the facts of the MMM reference model, from which its numbers come.
//!
//! Runs with `RPRAE_DATA` set to a folder that holds `kit-ml/model/mmm-model-facts.json`.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use rprae::humanoid::Humanoid;
use rprae::kinematics::{Inertial, JointKind};
use rprae::motion::{Body, Frame, JOINTS};
use serde_json::Value;

/// A node of the facts, in a body of the given height and mass.
struct Node {
    name: String,
    parent: Option<usize>,
    parent_from_self: Isometry3<f64>,
    axis: Option<Unit<Vector3<f64>>>,
    limits_rad: (f64, f64),
    /// Index of the joint in KIT order.
    kit: Option<usize>,
    inertial: Option<Inertial>,
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let numbers: Vec<f64> = value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect();
    numbers.try_into().unwrap()
}

fn facts() -> Option<Value> {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        eprintln!("skipped: RPRAE_DATA is not set, so the facts of the MMM model are not at hand");
        return None;
    };
    let text = std::fs::read_to_string(Path::new(&data).join("kit-ml/model/mmm-model-facts.json")).unwrap();
    Some(serde_json::from_str(&text).unwrap())
}

fn nodes(facts: &Value, body: Body) -> Vec<Node> {
    let scale = body.height_m / 1000.0;
    let mut nodes: Vec<Node> = Vec::new();
    for fact in facts["nodes"].as_array().unwrap() {
        let offset = Vector3::from(numbers(&fact["translation_mm_at_H1m"])) * scale;
        let rotation = fact.get("rotation_rowmajor").map_or(UnitQuaternion::identity(), |rows| {
            Rotation3::from_matrix(&Matrix3::from_row_slice(&numbers::<9>(rows))).into()
        });
        let revolute = fact.get("revolute");
        let inertial = fact.get("mass_fraction").and_then(Value::as_f64).map(|fraction| {
            let rows = fact["inertia_kgm2_at_M1kg_H1m"].as_array().unwrap();
            let inertia =
                Matrix3::from_rows(&[0, 1, 2].map(|row| Vector3::from(numbers(&rows[row])).transpose()));
            Inertial {
                mass_kg: fraction * body.mass_kg,
                com_in_link_m: Vector3::from(numbers(&fact["com_mm_at_H1m"])) * scale,
                inertia_about_com_kgm2: inertia * (body.mass_kg * body.height_m * body.height_m),
            }
        });
        nodes.push(Node {
            name: fact["name"].as_str().unwrap().to_owned(),
            parent: fact["parent"]
                .as_str()
                .map(|parent| nodes.iter().position(|node| node.name == parent).unwrap()),
            parent_from_self: Isometry3::from_parts(Translation3::from(offset), rotation),
            axis: revolute.map(|revolute| Unit::new_normalize(Vector3::from(numbers(&revolute["axis"])))),
            limits_rad: revolute.map_or((0.0, 0.0), |revolute| {
                (revolute["lower"].as_f64().unwrap(), revolute["upper"].as_f64().unwrap())
            }),
            kit: revolute.and_then(|revolute| revolute["kitml_index"].as_u64()).map(|index| index as usize),
            inertial,
        });
    }
    nodes
}

/// Poses of the nodes in the world; joints that KIT motions do not move stay at zero.
fn forward(nodes: &[Node], frame: &Frame) -> Vec<Isometry3<f64>> {
    let mut poses: Vec<Isometry3<f64>> = Vec::new();
    for node in nodes {
        let parent = node.parent.map_or_else(|| frame.world_from_root(), |parent| poses[parent]);
        let angle = node.kit.map_or(0.0, |kit| frame.joint_angles_rad[kit]);
        let turned = node
            .axis
            .map_or(UnitQuaternion::identity(), |axis| UnitQuaternion::from_axis_angle(&axis, angle));
        poses.push(parent * node.parent_from_self * turned);
    }
    poses
}

/// Poses spread over the joint ranges.
fn frames() -> impl Iterator<Item = Frame> {
    (1..=10).map(|state| {
        let share = |index: usize| (0.618_034 * (state * (index + 1)) as f64).fract();
        let mut frame = Frame::ZERO;
        for (index, joint) in JOINTS.iter().enumerate() {
            frame.joint_angles_rad[index] =
                joint.lower_rad + share(index) * (joint.upper_rad - joint.lower_rad);
        }
        frame.root_position_m = [share(50), share(51), share(52)];
        frame.root_rotation_rad = [share(53), share(54), share(55)];
        frame
    })
}

fn bodies() -> [Body; 2] {
    [Body::with_default_mass(1.75), Body { height_m: 1.58, mass_kg: 50.0 }]
}

#[test]
fn joints_have_the_order_axes_and_limits_of_the_facts() {
    let Some(facts) = facts() else { return };
    let order: Vec<&str> =
        facts["joint_order_44"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(order, JOINTS.map(|joint| joint.name));

    let body = bodies()[0];
    let (nodes, tree) = (nodes(&facts, body), Humanoid::new(body).unwrap().robot);
    for joint in tree.tree.joints() {
        let node = nodes.iter().find(|node| node.name == joint.name).unwrap();
        assert_eq!(node.kit.map(|kit| JOINTS[kit].name), Some(joint.name.as_str()));
        let JointKind::Revolute { axis } = joint.kind else { panic!("{} is fixed", joint.name) };
        assert_eq!(Some(axis), node.axis, "{}", joint.name);
        let limits = tree.limits[joint.angle_index.unwrap()];
        assert_eq!((limits.lower_rad, limits.upper_rad), node.limits_rad, "{}", joint.name);
    }
}

#[test]
fn joints_move_as_those_of_the_facts() {
    let Some(facts) = facts() else { return };
    for body in bodies() {
        let (nodes, humanoid) = (nodes(&facts, body), Humanoid::new(body).unwrap());
        for frame in frames() {
            let (expected, found) = (forward(&nodes, &frame), humanoid.forward(&frame));
            for joint in humanoid.robot.tree.joints() {
                let node = nodes.iter().position(|node| node.name == joint.name).unwrap();
                for point in [Point3::origin(), Point3::new(0.2, 0.3, 0.4)] {
                    let error_m = (expected[node] * point - found[joint.child] * point).norm();
                    // The URDF has nine digits.
                    assert!(error_m < 2e-8, "{}: {error_m:e} m", joint.name);
                }
            }
        }
    }
}

/// Mass distribution of parts given in one frame, together.
fn together(parts: &[Inertial]) -> Inertial {
    let mass_kg: f64 = parts.iter().map(|part| part.mass_kg).sum();
    let com = parts.iter().map(|part| part.com_in_link_m * part.mass_kg).sum::<Vector3<f64>>() / mass_kg;
    let inertia = parts
        .iter()
        .map(|part| {
            let lever = (part.com_in_link_m - com).cross_matrix();
            part.inertia_about_com_kgm2 - lever * lever * part.mass_kg
        })
        .sum();
    Inertial { mass_kg, com_in_link_m: com, inertia_about_com_kgm2: inertia }
}

fn moved(part: &Inertial, pose: &Isometry3<f64>) -> Inertial {
    let rotation = pose.rotation.to_rotation_matrix();
    Inertial {
        mass_kg: part.mass_kg,
        com_in_link_m: (pose * Point3::from(part.com_in_link_m)).coords,
        inertia_about_com_kgm2: rotation * part.inertia_about_com_kgm2 * rotation.inverse(),
    }
}

#[test]
fn segments_weigh_what_the_facts_say() {
    let Some(facts) = facts() else { return };
    for body in bodies() {
        let (nodes, humanoid) = (nodes(&facts, body), Humanoid::new(body).unwrap());
        let (neutral, links) = (forward(&nodes, &Frame::ZERO), humanoid.forward(&Frame::ZERO));
        let tree = &humanoid.robot.tree;

        // What the facts fix to each link: everything below its joint up to the next joint that moves.
        let mut expected: BTreeMap<usize, Vec<Inertial>> = BTreeMap::new();
        for (index, node) in nodes.iter().enumerate() {
            let Some(inertial) = &node.inertial else { continue };
            let mut anchor = index;
            while let (None, Some(parent)) = (nodes[anchor].kit, nodes[anchor].parent) {
                anchor = parent;
            }
            let link = tree
                .joints()
                .iter()
                .find(|joint| joint.name == nodes[anchor].name)
                .map_or(0, |joint| joint.child);
            expected
                .entry(link)
                .or_default()
                .push(moved(inertial, &(neutral[anchor].inverse() * neutral[index])));
        }
        assert_eq!(
            expected.len(),
            humanoid.segment_links.len() - 4,
            "midfoot and toes have no mass in the facts"
        );

        for (&link, parts) in &expected {
            let (name, expected) = (tree.links()[link].name.as_str(), together(parts));
            let found = tree.links()[link].inertial.unwrap();
            if let Some(side) = name.strip_suffix("_foot") {
                // Deviation: the foot is three blocks that share its mass.
                let blocks: Vec<Inertial> = ["foot", "midfoot", "toes"]
                    .iter()
                    .map(|part| {
                        let block = tree.link_index(&format!("{side}_{part}")).unwrap();
                        moved(&tree.links()[block].inertial.unwrap(), &(links[link].inverse() * links[block]))
                    })
                    .collect();
                let foot = together(&blocks);
                assert!((foot.mass_kg - expected.mass_kg).abs() < 1e-7, "{name}");
                let shift_mm_at_1m =
                    (foot.com_in_link_m - expected.com_in_link_m).norm() / body.height_m * 1000.0;
                assert!(shift_mm_at_1m < 2.5, "{name}: the centre of mass is {shift_mm_at_1m} mm off");
                continue;
            }
            let mass = (found.mass_kg - expected.mass_kg).abs() / expected.mass_kg;
            let com_m = (found.com_in_link_m - expected.com_in_link_m).norm();
            let inertia = (found.inertia_about_com_kgm2 - expected.inertia_about_com_kgm2).norm()
                / expected.inertia_about_com_kgm2.norm();
            assert!(
                mass < 1e-8 && com_m < 1e-8 && inertia < 1e-8,
                "{name}: {mass:e} {com_m:e} m {inertia:e}"
            );
        }
    }
}
