//! The body as URDF text.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::segments::{FOOT_MASS_FRACTION, Mass, SEGMENTS, Segment, Solid};
use super::strength::strength;
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
    let rows = segment.rotation;
    let rotation = Rotation3::from_matrix(&Matrix3::from_row_iterator(rows.into_iter().flatten()));
    let offset = Vector3::from(segment.offset_mm) * (body.height_m / 1000.0);
    let mut pose = Isometry3::from_parts(Translation3::from(offset), UnitQuaternion::from(rotation));
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
            crate::motion::skeleton::Axis::X => "1 0 0",
            crate::motion::skeleton::Axis::Y => "0 1 0",
            crate::motion::skeleton::Axis::Z => "0 0 1",
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

/// Mass, centre of mass and inertia about it of a segment, in SI units.
fn mass_properties(segment: &Segment, body: Body) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let parts: Vec<_> = segment
        .masses
        .iter()
        .map(|(mass, offset_mm)| match *mass {
            Mass::Known { fraction, com_mm, inertia } => {
                let com =
                    (Vector3::from(offset_mm.to_owned()) + Vector3::from(com_mm)) * (body.height_m / 1000.0);
                let scale = body.mass_kg * body.height_m * body.height_m;
                (fraction * body.mass_kg, com, Matrix3::from_diagonal(&(Vector3::from(inertia) * scale)))
            }
            Mass::ShareOfFoot => share_of_foot(segment, body),
        })
        .collect();
    let mass: f64 = parts.iter().map(|part| part.0).sum();
    let com = parts.iter().map(|part| part.1 * part.0).sum::<Vector3<f64>>() / mass;
    let inertia = parts
        .iter()
        .map(|(mass, part_com, inertia)| {
            let lever = part_com - com;
            // Parallel axis theorem.
            inertia + (Matrix3::identity() * lever.norm_squared() - lever * lever.transpose()) * *mass
        })
        .sum();
    (mass, com, inertia)
}

fn share_of_foot(segment: &Segment, body: Body) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let volume = |segment: &Segment| -> f64 { segment.solids.iter().map(box_volume_mm3).sum() };
    let side = &segment.name[..segment.name.find('_').unwrap_or(0)];
    let whole: f64 = SEGMENTS
        .iter()
        .filter(|other| other.name.starts_with(side) && matches!(other.masses[0].0, Mass::ShareOfFoot))
        .map(volume)
        .sum();
    let mass = FOOT_MASS_FRACTION * body.mass_kg * volume(segment) / whole;
    let placed = place(segment, &segment.solids[0], body);
    let Placed::Box { pose, size_m: size } = placed else {
        return (mass, Vector3::zeros(), Matrix3::identity());
    };
    let squares = size.component_mul(&size);
    let along_box =
        Vector3::new(squares.y + squares.z, squares.x + squares.z, squares.x + squares.y) * (mass / 12.0);
    let rotation = pose.rotation.to_rotation_matrix();
    let inertia = rotation * Matrix3::from_diagonal(&along_box) * rotation.inverse();
    (mass, pose.translation.vector, inertia)
}

fn box_volume_mm3(solid: &Solid) -> f64 {
    match solid {
        Solid::Box { min_mm, max_mm } => (0..3).map(|axis| max_mm[axis] - min_mm[axis]).product(),
        Solid::Capsule { .. } => 0.0,
    }
}

/// A solid in the frame of its link, in metres.
pub(super) enum Placed {
    Box {
        pose: Isometry3<f64>,
        size_m: Vector3<f64>,
    },
    /// Centres of the two end spheres.
    Capsule {
        from_m: Vector3<f64>,
        to_m: Vector3<f64>,
        radius_m: f64,
    },
}

pub(super) fn place(segment: &Segment, solid: &Solid, body: Body) -> Placed {
    let scale = body.height_m / 1000.0;
    match *solid {
        Solid::Capsule { from_mm, to_mm, radius_mm } => Placed::Capsule {
            from_m: Vector3::from(from_mm) * scale,
            to_m: Vector3::from(to_mm) * scale,
            radius_m: radius_mm * scale,
        },
        Solid::Box { min_mm, max_mm } => {
            let (min, max) = (Vector3::from(min_mm) * scale, Vector3::from(max_mm) * scale);
            let ankle_from_box =
                Isometry3::translation((min.x + max.x) / 2.0, (min.y + max.y) / 2.0, (min.z + max.z) / 2.0);
            Placed::Box {
                pose: ankle_from_segment(segment, scale).inverse() * ankle_from_box,
                size_m: max - min,
            }
        }
    }
}

/// Pose of a foot segment in the ankle frame, all joints at zero.
fn ankle_from_segment(segment: &Segment, scale: f64) -> Isometry3<f64> {
    if segment.name.ends_with("_foot") {
        return Isometry3::identity();
    }
    let rotation =
        Rotation3::from_matrix(&Matrix3::from_row_iterator(segment.rotation.into_iter().flatten()));
    let own = Isometry3::from_parts(
        Translation3::from(Vector3::from(segment.offset_mm) * scale),
        UnitQuaternion::from(rotation),
    );
    match SEGMENTS.iter().find(|parent| parent.name == segment.parent) {
        Some(parent) => ankle_from_segment(parent, scale) * own,
        None => own,
    }
}

fn write_link(text: &mut String, segment: &Segment, body: Body) {
    let (mass, com, inertia) = mass_properties(segment, body);
    let _ = writeln!(
        text,
        "  <link name=\"{}\">\n    <inertial><origin xyz=\"{}\" rpy=\"0 0 0\"/><mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
        segment.name,
        triple(com),
        number(mass),
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
    for solid in segment.solids {
        for (pose, geometry) in primitives(&place(segment, solid, body)) {
            let _ = writeln!(
                text,
                "    <visual>{o}<geometry>{geometry}</geometry><material name=\"{material}\"/></visual>\n    \
                 <collision>{o}<geometry>{geometry}</geometry></collision>",
                o = origin(&pose)
            );
        }
    }
    text.push_str("  </link>\n");
}

/// The URDF primitives of a solid; standard URDF has no capsule, so one is a cylinder and two spheres.
fn primitives(placed: &Placed) -> Vec<(Isometry3<f64>, String)> {
    match placed {
        Placed::Box { pose, size_m } => vec![(*pose, format!("<box size=\"{}\"/>", triple(*size_m)))],
        Placed::Capsule { from_m, to_m, radius_m } => {
            let along = to_m - from_m;
            let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &along)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            let middle = Isometry3::from_parts(Translation3::from((from_m + to_m) / 2.0), rotation);
            let radius = number(*radius_m);
            let sphere = |center: &Vector3<f64>| {
                (Isometry3::from(Translation3::from(*center)), format!("<sphere radius=\"{radius}\"/>"))
            };
            let cylinder = format!("<cylinder radius=\"{radius}\" length=\"{}\"/>", number(along.norm()));
            vec![(middle, cylinder), sphere(from_m), sphere(to_m)]
        }
    }
}
