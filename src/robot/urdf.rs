//! URDF text to [`Robot`].
//!
//! Read are links (mass and collision shapes) and joints (revolute, continuous, fixed).
//! Refused with their name are parts that would change the motion and that we cannot represent: other joint types, mimic
//! joints, mesh collisions, unexpanded macros.
//! Passed over are visuals, materials, joint dynamics, transmissions and elements of other programs.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Translation3, Unit, UnitQuaternion, Vector3};

use super::xml::{Document, Element};
use super::{Collision, JointLimits, Robot, Shape};
use crate::kinematics::{Inertial, JointKind, JointSpec, Link, Tree, TreeError};

/// Largest magnitude of any number accepted, SI units and radians; nothing below it can overflow on the way.
const MAX_NUMBER: f64 = 1.0e9;

/// Why a text is not a usable robot.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The text is larger than any sensible URDF.
    #[error("the text is {found} bytes long, more than the {limit} accepted")]
    TooLarge {
        /// Size found, bytes.
        found: usize,
        /// Largest size accepted, bytes.
        limit: usize,
    },
    /// The text is not well-formed XML.
    #[error("line {line}: {reason}")]
    Xml {
        /// Line of the fault, from one.
        line: usize,
        /// What is wrong there.
        reason: String,
    },
    /// The links and joints do not form a tree.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// An element lacks something or says something that is not usable.
    #[error("{element} {name:?}: {reason}")]
    Value {
        /// `robot`, `link` or `joint`.
        element: &'static str,
        /// Its name.
        name: String,
        /// What is wrong with it, with the line where there is one.
        reason: String,
    },
}

/// Reads a robot from URDF text.
///
/// # Errors
/// [`RobotError`] names the place: malformed XML, a joint cycle, a negative mass, an impossible inertia, a mesh.
pub fn parse_urdf(text: &str) -> Result<Robot, RobotError> {
    let document = Document::parse(text)?;
    let root = document.root();
    let name = root.attribute("name").unwrap_or_default().to_owned();
    if root.tag != "robot" {
        return Err(RobotError::Value {
            element: "robot",
            name,
            reason: format!("line {}: the outermost element is <{}>, expected <robot>", root.line, root.tag),
        });
    }
    let mut links = Vec::new();
    let mut shapes = BTreeMap::new();
    let mut specs = Vec::new();
    let mut joint_limits = BTreeMap::new();
    for element in document.children(root) {
        match element.tag.as_str() {
            "link" => {
                let reader = Reader::new(&document, element, "link")?;
                links.push(Link { name: reader.name.to_owned(), inertial: inertial(&reader)? });
                shapes.insert(reader.name, collisions(&reader)?);
            }
            "joint" => {
                let reader = Reader::new(&document, element, "joint")?;
                let (spec, limits) = joint(&reader)?;
                joint_limits.insert(spec.name.clone(), limits);
                specs.push(spec);
            }
            tag if tag.starts_with("xacro:") => {
                return Err(RobotError::Value {
                    element: "robot",
                    name,
                    reason: format!(
                        "line {}: <{tag}> is a macro; expand the file with xacro first",
                        element.line
                    ),
                });
            }
            _ => {}
        }
    }
    let tree = Tree::new(links, specs)?;
    // The tree holds these very links and joints, by unique names, so each lookup finds one.
    let limits =
        tree.joints().iter().filter_map(|joint| joint_limits.remove(&joint.name).flatten()).collect();
    let collisions =
        tree.links().iter().map(|link| shapes.remove(link.name.as_str()).unwrap_or_default()).collect();
    Ok(Robot { name, tree, limits, collisions })
}

/// Reads the parts of one link or joint and names it in every error.
#[derive(Clone, Copy)]
struct Reader<'a> {
    document: &'a Document,
    element: &'a Element,
    /// `link` or `joint`.
    kind: &'static str,
    name: &'a str,
}

impl<'a> Reader<'a> {
    fn new(document: &'a Document, element: &'a Element, kind: &'static str) -> Result<Self, RobotError> {
        let reader = Self { document, element, kind, name: element.attribute("name").unwrap_or_default() };
        if reader.name.is_empty() {
            return Err(reader.fault(element, "it has no name"));
        }
        Ok(reader)
    }

    fn fault(&self, at: &Element, reason: impl std::fmt::Display) -> RobotError {
        RobotError::Value {
            element: self.kind,
            name: self.name.to_owned(),
            reason: format!("line {}: {reason}", at.line),
        }
    }

    /// Children of `parent` with this tag.
    fn children(
        &self,
        parent: &'a Element,
        tag: &'static str,
    ) -> impl Iterator<Item = &'a Element> + use<'a> {
        self.document.children(parent).filter(move |child| child.tag == tag)
    }

    /// The child of `parent` with this tag, if there is one; two are an error.
    fn child(&self, parent: &'a Element, tag: &'static str) -> Result<Option<&'a Element>, RobotError> {
        let mut children = self.children(parent, tag);
        let first = children.next();
        match children.next() {
            Some(second) => Err(self.fault(second, format!("it has more than one <{tag}>"))),
            None => Ok(first),
        }
    }

    fn needed_child(&self, parent: &'a Element, tag: &'static str) -> Result<&'a Element, RobotError> {
        self.child(parent, tag)?.ok_or_else(|| self.fault(parent, format!("<{tag}> is missing")))
    }

    fn needed_attribute(&self, at: &'a Element, name: &str) -> Result<&'a str, RobotError> {
        at.attribute(name).ok_or_else(|| self.fault(at, format!("<{}> has no attribute {name:?}", at.tag)))
    }

    /// Exactly `N` numbers of reasonable size, separated by blanks.
    fn numbers<const N: usize>(&self, at: &Element, value: &str) -> Result<[f64; N], RobotError> {
        let mut numbers = [0.0; N];
        let mut words = value.split_ascii_whitespace();
        for number in &mut numbers {
            let word = words.next().unwrap_or_default();
            *number =
                word.parse().ok().filter(|number: &f64| number.abs() <= MAX_NUMBER).ok_or_else(|| {
                    let what = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
                    self.fault(at, format!("expected {what} within ±1e9 in <{}>, found {value:?}", at.tag))
                })?;
        }
        match words.next() {
            Some(_) => Err(self.fault(at, format!("expected {N} numbers in <{}>, found {value:?}", at.tag))),
            None => Ok(numbers),
        }
    }

    fn needed_number(&self, at: &'a Element, attribute: &str) -> Result<f64, RobotError> {
        let [number] = self.numbers(at, self.needed_attribute(at, attribute)?)?;
        Ok(number)
    }

    fn number_or(&self, at: &Element, attribute: &str, default: f64) -> Result<f64, RobotError> {
        match at.attribute(attribute) {
            Some(value) => self.numbers(at, value).map(|[number]| number),
            None => Ok(default),
        }
    }

    /// Pose in the `<origin>` of `parent`; the identity without one.
    fn origin(&self, parent: &'a Element) -> Result<Isometry3<f64>, RobotError> {
        let Some(origin) = self.child(parent, "origin")? else { return Ok(Isometry3::identity()) };
        let triple = |attribute| match origin.attribute(attribute) {
            Some(value) => self.numbers(origin, value),
            None => Ok([0.0; 3]),
        };
        let (xyz, [roll, pitch, yaw]) = (triple("xyz")?, triple("rpy")?);
        Ok(Isometry3::from_parts(
            Translation3::from(Vector3::from(xyz)),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }
}

/// Mass distribution of a link; `None` for a frame without mass.
fn inertial(link: &Reader<'_>) -> Result<Option<Inertial>, RobotError> {
    let Some(inertial) = link.child(link.element, "inertial")? else { return Ok(None) };
    let link_from_inertial = link.origin(inertial)?;
    let mass_kg = link.needed_number(link.needed_child(inertial, "mass")?, "value")?;
    if mass_kg < 0.0 {
        return Err(link.fault(inertial, format!("the mass of {mass_kg} kg is negative")));
    }
    if mass_kg == 0.0 {
        return Ok(None);
    }
    let element = link.needed_child(inertial, "inertia")?;
    let moment = |name| link.needed_number(element, name);
    let (ixx, ixy, ixz) = (moment("ixx")?, moment("ixy")?, moment("ixz")?);
    let (iyy, iyz, izz) = (moment("iyy")?, moment("iyz")?, moment("izz")?);
    let inertia = Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz);
    let mut principal: [f64; 3] = SymmetricEigen::new(inertia).eigenvalues.into();
    principal.sort_by(f64::total_cmp);
    let [smallest, middle, largest] = principal;
    // No rigid body has a principal moment that is negative or above the sum of the other two.
    if smallest < -1e-12 || largest > (smallest + middle) * (1.0 + 1e-6) + 1e-12 {
        return Err(link.fault(
            element,
            format!("principal moments of inertia {smallest:e}, {middle:e}, {largest:e} kg m^2 belong to no rigid body"),
        ));
    }
    let rotation = link_from_inertial.rotation.to_rotation_matrix();
    Ok(Some(Inertial {
        mass_kg,
        com_in_link_m: link_from_inertial.translation.vector,
        inertia_about_com_kgm2: rotation * inertia * rotation.inverse(),
    }))
}

fn collisions(link: &Reader<'_>) -> Result<Vec<Collision>, RobotError> {
    link.children(link.element, "collision")
        .map(|collision| {
            let geometry = link.needed_child(collision, "geometry")?;
            Ok(Collision { link_from_shape: link.origin(collision)?, shape: shape(link, geometry)? })
        })
        .collect()
}

fn shape(link: &Reader<'_>, geometry: &Element) -> Result<Shape, RobotError> {
    let mut solids = link.document.children(geometry);
    let (Some(solid), None) = (solids.next(), solids.next()) else {
        return Err(link.fault(geometry, "<geometry> must hold exactly one shape"));
    };
    let positive = |attribute| {
        let length = link.needed_number(solid, attribute)?;
        if length > 0.0 {
            return Ok(length);
        }
        Err(link.fault(solid, format!("the {attribute} of {length} m of a <{}> is not positive", solid.tag)))
    };
    Ok(match solid.tag.as_str() {
        "box" => {
            let size_m: [f64; 3] = link.numbers(solid, link.needed_attribute(solid, "size")?)?;
            if size_m.iter().any(|length| *length <= 0.0) {
                return Err(link.fault(solid, format!("the size {size_m:?} m of a <box> is not positive")));
            }
            Shape::Box { size_m: Vector3::from(size_m) }
        }
        "cylinder" => Shape::Cylinder { radius_m: positive("radius")?, length_m: positive("length")? },
        "capsule" => Shape::Capsule { radius_m: positive("radius")?, length_m: positive("length")? },
        "sphere" => Shape::Sphere { radius_m: positive("radius")? },
        "mesh" => {
            let file = solid.attribute("filename").unwrap_or_default();
            return Err(link.fault(
                solid,
                format!(
                    "mesh collisions are not supported; give it a box, cylinder or sphere instead of {file:?}"
                ),
            ));
        }
        other => return Err(link.fault(solid, format!("<{other}> is not a shape"))),
    })
}

/// The joint, and its limits if it moves.
fn joint(joint: &Reader<'_>) -> Result<(JointSpec, Option<JointLimits>), RobotError> {
    let element = joint.element;
    let link_of = |tag| joint.needed_attribute(joint.needed_child(element, tag)?, "link").map(str::to_owned);
    let kind = joint.needed_attribute(element, "type")?;
    if let Some(mimic) = joint.child(element, "mimic")? {
        return Err(
            joint.fault(mimic, "mimic joints are not supported; remove <mimic> to drive it by itself")
        );
    }
    let (kind, limits) = match kind {
        "fixed" => (JointKind::Fixed, None),
        "revolute" => (JointKind::Revolute { axis: axis(joint)? }, Some(limits(joint, false)?)),
        "continuous" => (JointKind::Revolute { axis: axis(joint)? }, Some(limits(joint, true)?)),
        other => return Err(joint.fault(element, format!("joints of type {other:?} are not supported"))),
    };
    let spec = JointSpec {
        name: joint.name.to_owned(),
        parent: link_of("parent")?,
        child: link_of("child")?,
        parent_from_joint: joint.origin(element)?,
        kind,
    };
    Ok((spec, limits))
}

fn axis(joint: &Reader<'_>) -> Result<Unit<Vector3<f64>>, RobotError> {
    // The default axis is x, as the URDF specification has it.
    let Some(element) = joint.child(joint.element, "axis")? else { return Ok(Vector3::x_axis()) };
    let xyz: [f64; 3] = joint.numbers(element, joint.needed_attribute(element, "xyz")?)?;
    Unit::try_new(Vector3::from(xyz), 1e-9).ok_or_else(|| joint.fault(element, "the axis has no length"))
}

fn limits(joint: &Reader<'_>, continuous: bool) -> Result<JointLimits, RobotError> {
    let unlimited = JointLimits {
        lower_rad: f64::NEG_INFINITY,
        upper_rad: f64::INFINITY,
        effort_nm: f64::INFINITY,
        velocity_rad_s: f64::INFINITY,
    };
    let Some(element) = joint.child(joint.element, "limit")? else {
        let missing =
            || joint.fault(joint.element, "a revolute joint needs <limit> with effort and velocity");
        return if continuous { Ok(unlimited) } else { Err(missing()) };
    };
    let mut limits = JointLimits {
        effort_nm: joint.needed_number(element, "effort")?,
        velocity_rad_s: joint.needed_number(element, "velocity")?,
        ..unlimited
    };
    if !continuous {
        limits.lower_rad = joint.number_or(element, "lower", 0.0)?;
        limits.upper_rad = joint.number_or(element, "upper", 0.0)?;
    }
    let JointLimits { lower_rad, upper_rad, effort_nm, velocity_rad_s } = limits;
    if lower_rad > upper_rad || effort_nm < 0.0 || velocity_rad_s < 0.0 {
        return Err(joint.fault(
            element,
            format!(
                "limits {lower_rad} to {upper_rad} rad, effort {effort_nm} N m, velocity {velocity_rad_s} rad/s are \
                 not usable"
            ),
        ));
    }
    Ok(limits)
}
