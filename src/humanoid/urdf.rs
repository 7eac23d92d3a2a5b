//! The body as URDF text.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::foot::{parent_from_segment, place};
use super::mass::inertial;
use super::segments::{SEGMENTS, Segment, Solid};
use super::strength::strength;
use crate::motion::skeleton::Axis;
use crate::motion::{Body, JOINTS, joint_index};

/// Mass of the frames between the axes of one anatomical joint, kilograms.
///
/// They stand for no part of the body. Simulators refuse a moving frame without mass, so each gets a milligram.
pub(super) const PLACEHOLDER_MASS_KG: f64 = 1.0e-6;
const PLACEHOLDER_INERTIA_KGM2: f64 = 1.0e-9;

/// URDF of the humanoid for this body.
pub(super) fn humanoid_urdf(body: Body) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n\
         <!-- Whole-body humanoid: 44 revolute joints named as in KIT motions, height {} m, mass {} kg.\n     \
         Written by `rprae urdf`; change the numbers in src/humanoid, not here. -->\n\
         <robot name=\"mmm_humanoid\">\n",
        number(body.height_m),
        number(body.mass_kg)
    );
    for (name, rgba) in
        [("skin", "0.86 0.72 0.62 1"), ("shirt", "0.30 0.45 0.65 1"), ("trousers", "0.25 0.27 0.33 1")]
    {
        let _ = writeln!(text, "  <material name=\"{name}\"><color rgba=\"{rgba}\"/></material>");
    }
    for segment in &SEGMENTS {
        write_chain(&mut text, segment, body);
        write_link(&mut text, segment, body);
    }
    text.push_str("</robot>\n");
    text
}

/// A number with nine significant digits and no trailing zeros.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.8e}").parse().unwrap_or(value);
    // Avoid the sign of a negative zero.
    if rounded == 0.0 { "0".to_owned() } else { format!("{rounded}") }
}

fn triple(values: impl Into<[f64; 3]>) -> String {
    values.into().map(number).join(" ")
}

fn origin(pose: &Isometry3<f64>) -> String {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let xyz = triple(pose.translation.vector);
    let rpy = triple([roll, pitch, yaw].map(|angle| if angle.abs() < 1e-12 { 0.0 } else { angle }));
    format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")
}

fn write_chain(text: &mut String, segment: &Segment, body: Body) {
    let mut pose = parent_from_segment(segment, body);
    let mut parent = segment.parent.to_owned();
    for (position, short_name) in segment.chain.iter().enumerate() {
        let joint = joint_index(short_name).map(|index| &JOINTS[index]);
        let (Some(joint), Some(limits)) = (joint, strength(short_name)) else {
            unreachable!(
                "the segment table names KIT joints only, and the tests build a humanoid from all of it"
            );
        };
        let child = if position + 1 == segment.chain.len() {
            segment.name.to_owned()
        } else {
            let child = format!("{short_name}_link");
            let inertia = number(PLACEHOLDER_INERTIA_KGM2);
            let _ = writeln!(
                text,
                "  <link name=\"{child}\"><inertial><mass value=\"{}\"/><inertia ixx=\"{inertia}\" ixy=\"0\" ixz=\"0\" \
                 iyy=\"{inertia}\" iyz=\"0\" izz=\"{inertia}\"/></inertial></link>",
                number(PLACEHOLDER_MASS_KG)
            );
            child
        };
        let axis = match joint.axis {
            Axis::X => "1 0 0",
            Axis::Y => "0 1 0",
            Axis::Z => "0 0 1",
        };
        let _ = writeln!(
            text,
            "  <joint name=\"{}\" type=\"revolute\">\n    <parent link=\"{parent}\"/><child link=\"{child}\"/>\n    {}\n    \
             <axis xyz=\"{axis}\"/><limit lower=\"{}\" upper=\"{}\" effort=\"{}\" velocity=\"{}\"/>\n  </joint>",
            joint.name,
            origin(&pose),
            number(joint.lower_rad),
            number(joint.upper_rad),
            number(limits.effort_nm(body)),
            number(limits.velocity_rad_s),
        );
        parent = child;
        pose = Isometry3::identity();
    }
}

fn write_link(text: &mut String, segment: &Segment, body: Body) {
    let inertial = inertial(segment, body);
    let inertia = inertial.inertia_about_com_kgm2;
    let _ = writeln!(
        text,
        "  <link name=\"{}\">\n    <inertial><origin xyz=\"{}\" rpy=\"0 0 0\"/><mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
        segment.name,
        triple(inertial.com_in_link_m),
        number(inertial.mass_kg),
        number(inertia.m11),
        number(inertia.m12),
        number(inertia.m13),
        number(inertia.m22),
        number(inertia.m23),
        number(inertia.m33),
    );
    let material = match segment.name {
        "pelvis" => "trousers",
        name if name.ends_with("thigh") || name.ends_with("shank") => "trousers",
        "abdomen" | "thorax" => "shirt",
        name if name.ends_with("upper_arm") => "shirt",
        _ => "skin",
    };
    for (pose, geometry) in segment.solids.iter().flat_map(|solid| primitives(segment, solid, body)) {
        let _ = writeln!(
            text,
            "    <visual>{o}<geometry>{geometry}</geometry><material name=\"{material}\"/></visual>\n    \
             <collision>{o}<geometry>{geometry}</geometry></collision>",
            o = origin(&pose)
        );
    }
    text.push_str("  </link>\n");
}

/// The URDF primitives of a solid; standard URDF has no capsule, so one is a cylinder and two spheres.
fn primitives(segment: &Segment, solid: &Solid, body: Body) -> Vec<(Isometry3<f64>, String)> {
    match *solid {
        Solid::Block(block) => {
            let placed = place(segment, &block, body);
            vec![(placed.segment_from_block, format!("<box size=\"{}\"/>", triple(placed.size_m)))]
        }
        Solid::Capsule { from_mm, to_mm, radius_mm } => {
            let scale = body.height_m / 1000.0;
            let (from, to) = (Vector3::from(from_mm) * scale, Vector3::from(to_mm) * scale);
            let along = to - from;
            let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &along)
                // Antiparallel: any half turn about an axis across z will do.
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            let middle = Isometry3::from_parts(Translation3::from((from + to) / 2.0), rotation);
            let radius = number(radius_mm * scale);
            let sphere = |center: Vector3<f64>| {
                (Isometry3::from(Translation3::from(center)), format!("<sphere radius=\"{radius}\"/>"))
            };
            let cylinder = format!("<cylinder radius=\"{radius}\" length=\"{}\"/>", number(along.norm()));
            vec![(middle, cylinder), sphere(from), sphere(to)]
        }
    }
}
