//! URDF text to [`Robot`].
//!
//! The text is first walked without building anything: its depth and size are bounded, a document type is refused, and
//! so is an `<origin>` after `<geometry>`, which the URDF parser below would silently read as the identity.

use nalgebra::{Isometry3, Matrix3, Rotation3, SymmetricEigen, Translation3, Unit, UnitQuaternion, Vector3};
use quick_xml::events::Event;

use super::{Collision, JointLimits, Robot, Shape};
use crate::kinematics::{Inertial, JointKind, JointSpec, Link, Tree, TreeError};

/// Deepest nesting of elements accepted in a URDF.
const MAX_DEPTH: usize = 32;
/// Largest URDF accepted, bytes.
const MAX_BYTES: usize = 16 << 20;

/// Why a text is not a usable robot.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The text is larger than any sensible URDF.
    #[error("the text is {found} bytes long, more than the {MAX_BYTES} accepted")]
    TooLarge {
        /// Size found, bytes.
        found: usize,
    },
    /// The text is not well-formed XML.
    #[error("byte {position}: {reason}")]
    Xml {
        /// Byte offset of the fault.
        position: u64,
        /// What is wrong there.
        reason: String,
    },
    /// The XML is not a URDF.
    #[error("not a URDF: {0}")]
    Urdf(#[from] urdf_rs::UrdfError),
    /// The links and joints do not form a tree.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// A number is not usable.
    #[error("{element} {name:?}: {reason}")]
    Value {
        /// `link` or `joint`.
        element: &'static str,
        /// Its name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// Reads a robot from URDF text.
///
/// # Errors
/// [`RobotError`] names the place: malformed XML, a joint cycle, a negative mass, an impossible inertia, a mesh.
pub fn parse_urdf(text: &str) -> Result<Robot, RobotError> {
    check_structure(text)?;
    let urdf = urdf_rs::read_from_string(text)?;

    let links = urdf
        .links
        .iter()
        .map(|link| Ok(Link { name: link.name.clone(), inertial: inertial(link)? }))
        .collect::<Result<Vec<_>, RobotError>>()?;
    let specs = urdf.joints.iter().map(joint_spec).collect::<Result<Vec<_>, _>>()?;
    let tree = Tree::new(links, specs)?;

    let mut limits = Vec::with_capacity(tree.num_angles());
    for joint in tree.joints().iter().filter(|joint| joint.angle_index.is_some()) {
        // The tree was built from these very joints, so the name is found.
        let source = urdf.joints.iter().find(|source| source.name == joint.name);
        limits.extend(source.map(joint_limits).transpose()?);
    }
    let mut collisions = Vec::with_capacity(tree.links().len());
    for link in tree.links() {
        let source = urdf.links.iter().find(|source| source.name == link.name);
        collisions.push(source.map(link_collisions).transpose()?.unwrap_or_default());
    }
    Ok(Robot { name: urdf.name, tree, limits, collisions })
}

fn check_structure(text: &str) -> Result<(), RobotError> {
    if text.len() > MAX_BYTES {
        return Err(RobotError::TooLarge { found: text.len() });
    }
    let mut reader = quick_xml::Reader::from_str(text);
    let mut path: Vec<String> = Vec::new();
    let mut geometry_seen = false;
    loop {
        let fault = |position, reason: &str| RobotError::Xml { position, reason: reason.to_owned() };
        let event =
            reader.read_event().map_err(|error| fault(reader.error_position(), &error.to_string()))?;
        let position = reader.buffer_position();
        let (element, opens) = match &event {
            Event::Start(element) => (element, true),
            Event::Empty(element) => (element, false),
            Event::End(_) => {
                path.pop();
                continue;
            }
            Event::DocType(_) => return Err(fault(position, "a document type declaration is not accepted")),
            Event::Eof => return Ok(()),
            _ => continue,
        };
        let name = element.name().as_ref().to_owned();
        match name.as_str() {
            "visual" | "collision" => geometry_seen = false,
            "geometry" => geometry_seen = true,
            "origin"
                if geometry_seen
                    && matches!(path.last().map(String::as_str), Some("visual" | "collision")) =>
            {
                return Err(fault(
                    position,
                    "<origin> must come before <geometry> in <visual> and <collision>",
                ));
            }
            _ => {}
        }
        if opens {
            path.push(name);
            if path.len() > MAX_DEPTH {
                return Err(fault(position, "elements are nested more than 32 deep"));
            }
        }
    }
}

fn isometry(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(pose.xyz.0)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

fn finite(element: &'static str, name: &str, values: &[f64]) -> Result<(), RobotError> {
    match values.iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) => Err(RobotError::Value {
            element,
            name: name.to_owned(),
            reason: format!("{value} is not a finite number"),
        }),
    }
}

fn finite_pose(
    element: &'static str,
    name: &str,
    pose: &urdf_rs::Pose,
) -> Result<Isometry3<f64>, RobotError> {
    finite(element, name, &pose.xyz.0)?;
    finite(element, name, &pose.rpy.0)?;
    Ok(isometry(pose))
}

fn inertial(link: &urdf_rs::Link) -> Result<Option<Inertial>, RobotError> {
    let source = &link.inertial;
    let fault = |reason: String| RobotError::Value { element: "link", name: link.name.clone(), reason };
    let link_from_inertial = finite_pose("link", &link.name, &source.origin)?;
    let m = &source.inertia;
    finite("link", &link.name, &[source.mass.value, m.ixx, m.ixy, m.ixz, m.iyy, m.iyz, m.izz])?;
    if source.mass.value < 0.0 {
        return Err(fault(format!("the mass of {} kg is negative", source.mass.value)));
    }
    if source.mass.value == 0.0 {
        return Ok(None);
    }
    let inertia = Matrix3::new(m.ixx, m.ixy, m.ixz, m.ixy, m.iyy, m.iyz, m.ixz, m.iyz, m.izz);
    let mut principal: [f64; 3] = SymmetricEigen::new(inertia).eigenvalues.into();
    principal.sort_by(f64::total_cmp);
    let [smallest, middle, largest] = principal;
    // No rigid body has a principal moment that is negative or above the sum of the other two.
    if smallest < -1e-12 || largest > (smallest + middle) * (1.0 + 1e-6) + 1e-12 {
        return Err(fault(format!(
            "principal moments of inertia {smallest:e}, {middle:e}, {largest:e} kg m^2 belong to no rigid body"
        )));
    }
    let rotation: Rotation3<f64> = link_from_inertial.rotation.into();
    Ok(Some(Inertial {
        mass_kg: source.mass.value,
        com_in_link_m: link_from_inertial.translation.vector,
        inertia_about_com_kgm2: rotation * inertia * rotation.inverse(),
    }))
}

fn joint_spec(joint: &urdf_rs::Joint) -> Result<JointSpec, RobotError> {
    let fault = |reason: String| RobotError::Value { element: "joint", name: joint.name.clone(), reason };
    let parent_from_joint = finite_pose("joint", &joint.name, &joint.origin)?;
    let kind = match joint.joint_type {
        urdf_rs::JointType::Fixed => JointKind::Fixed,
        urdf_rs::JointType::Revolute | urdf_rs::JointType::Continuous => {
            let axis = Vector3::from(joint.axis.xyz.0);
            finite("joint", &joint.name, axis.as_slice())?;
            let axis = Unit::try_new(axis, 1e-9).ok_or_else(|| fault("the axis has no length".to_owned()))?;
            JointKind::Revolute { axis }
        }
        ref other => return Err(fault(format!("joints of type {other:?} are not supported"))),
    };
    Ok(JointSpec {
        name: joint.name.clone(),
        parent: joint.parent.link.clone(),
        child: joint.child.link.clone(),
        parent_from_joint,
        kind,
    })
}

fn joint_limits(joint: &urdf_rs::Joint) -> Result<JointLimits, RobotError> {
    let limit = &joint.limit;
    finite("joint", &joint.name, &[limit.lower, limit.upper, limit.effort, limit.velocity])?;
    let (lower_rad, upper_rad) = match joint.joint_type {
        urdf_rs::JointType::Continuous => (f64::NEG_INFINITY, f64::INFINITY),
        _ => (limit.lower, limit.upper),
    };
    if lower_rad > upper_rad || limit.effort < 0.0 || limit.velocity < 0.0 {
        return Err(RobotError::Value {
            element: "joint",
            name: joint.name.clone(),
            reason: format!(
                "limits {lower_rad} to {upper_rad} rad, effort {} N m, velocity {} rad/s are not usable",
                limit.effort, limit.velocity
            ),
        });
    }
    Ok(JointLimits { lower_rad, upper_rad, effort_nm: limit.effort, velocity_rad_s: limit.velocity })
}

fn link_collisions(link: &urdf_rs::Link) -> Result<Vec<Collision>, RobotError> {
    link.collision
        .iter()
        .map(|collision| {
            let link_from_shape = finite_pose("link", &link.name, &collision.origin)?;
            let fault = |reason: String| RobotError::Value { element: "link", name: link.name.clone(), reason };
            let (shape, sizes) = match collision.geometry {
                urdf_rs::Geometry::Box { size } => (Shape::Box { size_m: Vector3::from(size.0) }, size.0),
                urdf_rs::Geometry::Cylinder { radius, length } => {
                    (Shape::Cylinder { radius_m: radius, length_m: length }, [radius, length, 1.0])
                }
                urdf_rs::Geometry::Capsule { radius, length } => {
                    (Shape::Capsule { radius_m: radius, length_m: length }, [radius, length, 1.0])
                }
                urdf_rs::Geometry::Sphere { radius } => (Shape::Sphere { radius_m: radius }, [radius, 1.0, 1.0]),
                urdf_rs::Geometry::Mesh { ref filename, .. } => {
                    return Err(fault(format!(
                        "mesh collisions are not supported; give it a box, cylinder or sphere instead of {filename:?}"
                    )));
                }
            };
            if sizes.iter().any(|size| !size.is_finite() || *size <= 0.0) {
                return Err(fault(format!("the collision shape {shape:?} has no positive size")));
            }
            Ok(Collision { link_from_shape, shape })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDULUM: &str = r#"<robot name="pendulum">
      <link name="base"/>
      <link name="rod">
        <inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
          <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.01"/></inertial>
        <collision><origin xyz="0 0 -0.5"/><geometry><cylinder radius="0.05" length="1"/></geometry></collision>
      </link>
      <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><origin xyz="0 0 2"/>
        <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="10" velocity="5"/></joint>
    </robot>"#;

    #[test]
    fn reads_a_pendulum_and_swings_it_forward() {
        let robot = parse_urdf(PENDULUM).unwrap();
        assert_eq!(robot.tree.num_angles(), 1);
        assert_eq!(robot.limits[0].effort_nm, 10.0);
        let poses = robot.tree.forward(&Isometry3::identity(), &[std::f64::consts::FRAC_PI_2]);
        // A rod hanging down turns about x: down (-z) goes to forward (+y).
        let com = robot.tree.center_of_mass(&poses);
        assert!((com - Vector3::new(0.0, 0.5, 2.0)).norm() < 1e-12, "{com}");
    }

    #[test]
    fn refuses_what_it_would_misread() {
        let after = PENDULUM.replace(
            r#"<origin xyz="0 0 -0.5"/><geometry><cylinder radius="0.05" length="1"/></geometry>"#,
            r#"<geometry><cylinder radius="0.05" length="1"/></geometry><origin xyz="0 0 -0.5"/>"#,
        );
        let cases = [
            (after, "<origin> must come before <geometry>"),
            (PENDULUM.replace(r#"value="2""#, r#"value="-2""#), "negative"),
            (PENDULUM.replace(r#"izz="0.01""#, r#"izz="0.9""#), "belong to no rigid body"),
            (PENDULUM.replace(r#"xyz="1 0 0""#, r#"xyz="0 0 0""#), "axis has no length"),
            (PENDULUM.replace(r#"parent link="base""#, r#"parent link="bass""#), "does not exist"),
            (PENDULUM.replace(r#"parent link="base""#, r#"parent link="rod""#), "do not form a tree"),
            (PENDULUM.replace("<robot", "<!DOCTYPE x><robot"), "document type"),
            ("<a>".repeat(50_000), "nested"),
            ("not xml <".to_owned(), "byte"),
        ];
        for (text, expected) in cases {
            let error = parse_urdf(&text).unwrap_err().to_string();
            assert!(error.contains(expected), "{error:?} should contain {expected:?}");
        }
    }
}
