//! Correspondence files: what the joints of a source skeleton are called, and how its bones are turned.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Deserialize;

use super::role::{ROLES, Role, Segment};
use crate::mocap::Clip;

/// Largest correspondence file, bytes.
const MAX_BYTES: usize = 1 << 20;

/// How a source skeleton corresponds to the humanoid; `assets/skeletons` holds those that come with the program.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correspondence {
    /// Name of the skeleton: `cmu-mb`.
    pub name: String,
    /// What it is and where it is used, one sentence.
    pub about: String,
    /// Axis of the source that points up.
    pub up: AxisVector,
    /// Direction of the source that becomes +y of the world; at rest the source looks there.
    pub forward: AxisVector,
    /// Metres per length unit; of several the first that gives an adult body is taken.
    pub unit_m: Vec<f64>,
    /// Rate to assume where neither file nor user says one, hertz.
    #[serde(default)]
    pub rate_hz: Option<f64>,
    /// Joint of each role; of several names their middle is meant.
    pub joints: BTreeMap<Role, OneOrMore>,
    /// Bones that tell how segments are turned.
    #[serde(default)]
    pub orientations: BTreeMap<Segment, Orientation>,
    /// Direction towards a role's joint, in the frame of our segment below the role before it, where the two skeletons
    /// differ: the foot's bone may run from ankle to toe less steeply than ours.
    #[serde(default)]
    pub rest: BTreeMap<Role, AxisVector>,
    /// Whether the source is the humanoid itself, so that nothing of it needs to be fitted to our feet.
    #[serde(default)]
    pub same_body: bool,
}

/// Joint names.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum OneOrMore {
    /// A joint.
    One(String),
    /// The middle of several joints.
    More(Vec<String>),
    /// A point on the line through two joints, where the joint itself is missing.
    Between(Between),
}

/// `from + at * (to - from)`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Between {
    /// Joint at 0.
    pub from: String,
    /// Joint at 1.
    pub to: String,
    /// Place on the line, -2 to 3.
    pub at: f64,
}

impl OneOrMore {
    /// The joints and how much each counts; the shares add up to one.
    #[must_use]
    pub fn shares(&self) -> Vec<(&str, f64)> {
        match self {
            Self::One(name) => vec![(name, 1.0)],
            Self::More(names) => names.iter().map(|name| (name.as_str(), 1.0 / names.len() as f64)).collect(),
            Self::Between(Between { from, to, at }) => vec![(from, 1.0 - at), (to, *at)],
        }
    }
}

/// Orientation of one of our segments in a joint of the source: our axes in the joint's own frame.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Orientation {
    /// Joint whose frame turns with the segment.
    pub joint: String,
    /// Our up axis (z), as the joint sees it; absent where only the way it faces is to be used.
    #[serde(default)]
    pub up: Option<AxisVector>,
    /// Our forward axis (y), as the joint sees it.
    #[serde(default)]
    pub forward: Option<AxisVector>,
}

/// `"y"`, `"-x"` or three numbers.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "AxisText")]
pub struct AxisVector(pub Vector3<f64>);

#[derive(Deserialize)]
#[serde(untagged)]
enum AxisText {
    Name(String),
    Vector([f64; 3]),
}

impl TryFrom<AxisText> for AxisVector {
    type Error = String;

    fn try_from(text: AxisText) -> Result<Self, String> {
        let vector = match &text {
            AxisText::Name(name) => {
                let (sign, letter) = name.strip_prefix('-').map_or((1.0, name.as_str()), |rest| (-1.0, rest));
                match letter {
                    "x" => Vector3::x() * sign,
                    "y" => Vector3::y() * sign,
                    "z" => Vector3::z() * sign,
                    _ => {
                        return Err(format!(
                            "{name:?} is no axis: expected x, -x, y, -y, z, -z or three numbers"
                        ));
                    }
                }
            }
            AxisText::Vector(components) => Vector3::from(*components),
        };
        vector
            .try_normalize(1e-6)
            .filter(|unit| unit.iter().all(|component| component.is_finite()))
            .map(Self)
            .ok_or_else(|| "a direction has a length".to_owned())
    }
}

/// Why a file is no correspondence.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CorrespondenceError {
    /// Too large to be one.
    #[error("it is larger than {MAX_BYTES} bytes")]
    TooLarge,
    /// Not text.
    #[error("it is not UTF-8 text")]
    NotText,
    /// Not TOML of the expected form.
    #[error("{reason}")]
    Toml {
        /// What the reader said, with line and column.
        reason: String,
    },
    /// A role that every skeleton must have.
    #[error("[joints] has no {}", .roles.join(", "))]
    MissingRoles {
        /// Names of the roles.
        roles: Vec<&'static str>,
    },
    /// A value outside its range.
    #[error("{name} {fault}")]
    Value {
        /// Name of the entry.
        name: String,
        /// What is wrong with it.
        fault: String,
    },
}

impl Correspondence {
    /// Reads and checks a correspondence file.
    ///
    /// # Errors
    /// [`CorrespondenceError`] says what is wrong and where.
    pub fn parse(bytes: &[u8]) -> Result<Self, CorrespondenceError> {
        if bytes.len() > MAX_BYTES {
            return Err(CorrespondenceError::TooLarge);
        }
        let text = std::str::from_utf8(bytes).map_err(|_| CorrespondenceError::NotText)?;
        let read: Self = toml::from_str(text)
            .map_err(|error| CorrespondenceError::Toml { reason: error.to_string().trim_end().to_owned() })?;
        read.check()?;
        Ok(read)
    }

    fn check(&self) -> Result<(), CorrespondenceError> {
        let fault = |name: &str, fault: &str| {
            Err(CorrespondenceError::Value { name: name.to_owned(), fault: fault.to_owned() })
        };
        let missing: Vec<&'static str> = ROLES
            .iter()
            .filter(|info| info.required && !self.joints.contains_key(&info.role))
            .map(|info| info.name)
            .collect();
        if !missing.is_empty() {
            return Err(CorrespondenceError::MissingRoles { roles: missing });
        }
        for (role, joints) in &self.joints {
            if joints.shares().is_empty() {
                return fault(&format!("joints.{}", role.name()), "names no joint");
            }
            if !joints.shares().iter().all(|(_, share)| (-2.0..=3.0).contains(share)) {
                return fault(&format!("joints.{}", role.name()), "lies outside -2 to 3 on its line");
            }
        }
        if self.up.0.dot(&self.forward.0).abs() > 1e-6 {
            return fault("forward", "is not perpendicular to up");
        }
        if self.unit_m.is_empty() || !self.unit_m.iter().all(|unit| (1e-6..=1e3).contains(unit)) {
            return fault("unit_m", "must be one or more numbers of 0.000001 to 1000");
        }
        if self.rate_hz.is_some_and(|rate| !(0.1..=10_000.0).contains(&rate)) {
            return fault("rate_hz", "is outside 0.1 to 10000");
        }
        for (segment, orientation) in &self.orientations {
            let name = format!("orientations.{segment:?}");
            match (orientation.up, orientation.forward) {
                (None, None) => return fault(&name, "has neither up nor forward"),
                (Some(up), Some(forward)) if up.0.cross(&forward.0).norm() < 0.5 => {
                    return fault(&name, "has up and forward along one line");
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Names of all joints it speaks of.
    pub(super) fn joint_names(&self) -> impl Iterator<Item = &str> {
        let roles = self.joints.values().flat_map(|joints| joints.shares()).map(|(name, _)| name);
        roles.chain(self.orientations.values().map(|orientation| orientation.joint.as_str()))
    }

    /// Joints that a clip lacks; none means that it fits.
    #[must_use]
    pub fn missing_in(&self, clip: &Clip) -> Vec<&str> {
        let has = |name: &str| clip.joints().iter().any(|joint| joint.name == name);
        let mut missing: Vec<&str> = self.joint_names().filter(|name| !has(name)).collect();
        missing.sort_unstable();
        missing.dedup();
        missing
    }
}
