//! ASF: the skeleton of an Acclaim recording.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{UnitQuaternion, Vector3};

use super::words::{Word, Words, lines};
use super::{Axis, Channel, Joint, MAX_JOINTS, MocapError, MocapFault};

/// Name of the root in hierarchy and motion files.
pub(super) const ROOT: &str = "root";

/// A skeleton that AMC motions move.
#[derive(Debug, Clone, PartialEq)]
pub struct AsfSkeleton {
    /// Joints, parents first. The joint of a bone lies where the bone begins; a bone without children adds `<name>_end`.
    ///
    /// Lengths are those of the file divided by its length unit: inches, where the unit is CMU's 0.45.
    pub(super) joints: Vec<Joint>,
    /// For each joint that moves: what the numbers of a frame are, in the order of the AMC file.
    pub(super) dofs: BTreeMap<String, Dofs>,
    /// Divides lengths of AMC files.
    pub(super) length_unit: f64,
}

/// Numbers that a frame has for one bone.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Dofs {
    pub(super) joint: usize,
    /// The channel of each number.
    pub(super) channels: Vec<Channel>,
}

#[derive(Debug, Default)]
struct Bone {
    line: usize,
    vector: Vector3<f64>,
    axes: UnitQuaternion<f64>,
    channels: Vec<Channel>,
}

#[derive(Debug)]
struct Reader {
    length_unit: f64,
    radians_per_angle: f64,
    root: Bone,
    bones: BTreeMap<String, Bone>,
    /// Children in file order.
    children: BTreeMap<String, Vec<(String, usize)>>,
}

/// Reads an ASF file. Joint limits in it are checked for form and left aside: the target body has its own.
///
/// # Errors
/// [`MocapError`] names the line and what is wrong there.
pub fn read_asf(bytes: &[u8]) -> Result<AsfSkeleton, MocapError> {
    let mut reader = Reader {
        length_unit: 1.0,
        radians_per_angle: 1.0_f64.to_radians(),
        root: Bone::default(),
        bones: BTreeMap::new(),
        children: BTreeMap::new(),
    };
    let mut section = String::new();
    let mut bone: Option<(String, Bone)> = None;
    let mut last_line = 0;
    for (line, mut words) in lines(bytes) {
        last_line = line;
        let Some(first) = words.next() else { continue };
        if let Some(keyword) = first.text.strip_prefix(b":") {
            section = String::from_utf8_lossy(keyword).to_ascii_lowercase();
            continue;
        }
        match section.as_str() {
            "units" => reader.unit(first, &mut words)?,
            "root" => reader.root_line(first, &mut words)?,
            "bonedata" => reader.bone_line(first, &mut words, &mut bone)?,
            "hierarchy" => reader.hierarchy_line(first, &mut words)?,
            // Version, name, documentation and whatever else there is.
            _ => {}
        }
    }
    let truncated = |expected: &str| MocapError {
        line: last_line,
        fault: MocapFault::Truncated { expected: expected.to_owned() },
    };
    if bone.is_some() {
        return Err(truncated("the end of the bone"));
    }
    if reader.root.channels.is_empty() {
        return Err(truncated(":root with its order"));
    }
    if reader.children.is_empty() {
        return Err(truncated(":hierarchy"));
    }
    reader.skeleton()
}

impl Reader {
    fn unit(&mut self, first: Word<'_>, words: &mut Words<'_>) -> Result<(), MocapError> {
        if first.is("length") {
            let word = words.expect("the length unit")?;
            self.length_unit = word.number()?;
            if !(1e-3..=1e3).contains(&self.length_unit) {
                let found = self.length_unit;
                return Err(word.error(MocapFault::Value {
                    what: "length unit",
                    found,
                    expected: "0.001 to 1000",
                }));
            }
        } else if first.is("angle") {
            let word = words.expect("deg or rad")?;
            self.radians_per_angle = if word.is("deg") {
                1.0_f64.to_radians()
            } else if word.is("rad") {
                1.0
            } else {
                return Err(word.unexpected("deg or rad"));
            };
        }
        Ok(())
    }

    fn root_line(&mut self, first: Word<'_>, words: &mut Words<'_>) -> Result<(), MocapError> {
        if first.is("order") {
            self.root.channels = channels(words)?;
        } else if first.is("axis") {
            // The order in which the orientation at rest acts, which must be zero.
            axis_order(words.expect("an order of axes")?)?;
        } else if first.is("position") {
            self.root.vector = Vector3::from(words.numbers("three positions")?) / self.length_unit;
        } else if first.is("orientation") {
            let angles: [f64; 3] = words.numbers("three angles")?;
            if angles != [0.0; 3] {
                return Err(
                    first.error(MocapFault::Unsupported { what: "a root that is turned at rest".to_owned() })
                );
            }
        }
        Ok(())
    }

    fn bone_line(
        &mut self,
        first: Word<'_>,
        words: &mut Words<'_>,
        open: &mut Option<(String, Bone)>,
    ) -> Result<(), MocapError> {
        if first.is("begin") {
            if open.is_some() {
                return Err(first.unexpected("the end of the bone before"));
            }
            if self.bones.len() == MAX_JOINTS / 2 {
                return Err(first.error(MocapFault::TooMany { what: "bones", limit: MAX_JOINTS / 2 }));
            }
            *open = Some((String::new(), Bone { line: first.line, ..Bone::default() }));
            return Ok(());
        }
        let Some((name, bone)) = open else { return Err(first.unexpected("begin")) };
        if first.is("end") {
            let name = std::mem::take(name);
            if name.is_empty() || name == ROOT {
                return Err(first.unexpected("a bone with a name of its own"));
            }
            let bone = std::mem::take(bone);
            *open = None;
            if self.bones.insert(name.clone(), bone).is_some() {
                return Err(first.error(MocapFault::DuplicateName { name }));
            }
        } else if first.is("name") {
            *name = words.expect("a name")?.shown();
        } else if first.is("direction") {
            let direction = Vector3::from(words.numbers::<3>("three components")?);
            let length = if bone.vector == Vector3::zeros() { 1.0 } else { bone.vector.norm() };
            bone.vector = direction.try_normalize(1e-9).map_or(bone.vector, |unit| unit * length);
        } else if first.is("length") {
            let length = words.expect("a length")?.number()?;
            let unit = bone.vector.try_normalize(1e-12).unwrap_or(Vector3::x());
            // A bone of no length keeps its direction out of sight, but not its children.
            bone.vector = unit * length / self.length_unit;
        } else if first.is("axis") {
            let angles = words.numbers::<3>("three angles")?.map(|angle| angle * self.radians_per_angle);
            let order = axis_order(words.expect("an order of axes")?)?;
            // The first axis of the order acts first, so it stands last in the product.
            bone.axes = order
                .iter()
                .rev()
                .zip(angles.iter().rev())
                .fold(UnitQuaternion::identity(), |product, (axis, &angle)| product * rotation(*axis, angle));
        } else if first.is("dof") {
            bone.channels = channels(words)?;
        }
        // Id, limits, masses and what other writers add do not move anything.
        Ok(())
    }

    fn hierarchy_line(&mut self, first: Word<'_>, words: &mut Words<'_>) -> Result<(), MocapError> {
        if first.is("begin") || first.is("end") {
            return Ok(());
        }
        let parent = first.shown();
        if parent != ROOT && !self.bones.contains_key(&parent) {
            return Err(first.error(MocapFault::UnknownBone { name: parent }));
        }
        while let Some(word) = words.next() {
            let child = word.shown();
            if !self.bones.contains_key(&child) {
                return Err(word.error(MocapFault::UnknownBone { name: child }));
            }
            self.children.entry(parent.clone()).or_default().push((child, word.line));
        }
        Ok(())
    }

    fn skeleton(self) -> Result<AsfSkeleton, MocapError> {
        let mut joints = vec![joint(ROOT, None, &self.root, self.root.vector)];
        let mut dofs = BTreeMap::new();
        let root_dofs = Dofs { joint: 0, channels: self.root.channels.clone() };
        dofs.insert(ROOT.to_owned(), root_dofs);
        let mut seen = BTreeSet::new();
        // Each entry: name, line of the hierarchy, index of the parent, where the parent's bone ends.
        let children_of = |name: &str, parent: usize, end: Vector3<f64>| {
            let children = self.children.get(name).into_iter().flatten().rev();
            children.map(move |(child, line)| (child.clone(), *line, parent, end)).collect::<Vec<_>>()
        };
        let mut stack = children_of(ROOT, 0, Vector3::zeros());
        while let Some((name, line, parent, offset)) = stack.pop() {
            let Some(bone) = self.bones.get(&name) else { continue };
            if !seen.insert(name.clone()) {
                return Err(MocapError { line, fault: MocapFault::NotATree { name } });
            }
            let index = joints.len();
            joints.push(joint(&name, Some(parent), bone, offset));
            if !bone.channels.is_empty() {
                dofs.insert(name.clone(), Dofs { joint: index, channels: bone.channels.clone() });
            }
            let below = children_of(&name, index, bone.vector);
            if below.is_empty() {
                let end = Bone::default();
                joints.push(joint(&format!("{name}_end"), Some(index), &end, bone.vector));
            }
            stack.extend(below);
        }
        if let Some((name, bone)) = self.bones.iter().find(|(name, _)| !seen.contains(*name)) {
            return Err(MocapError { line: bone.line, fault: MocapFault::NotATree { name: name.clone() } });
        }
        Ok(AsfSkeleton { joints, dofs, length_unit: self.length_unit })
    }
}

/// The joint of a bone: its rotations multiply in the reverse of the order in which the file lists them.
fn joint(name: &str, parent: Option<usize>, bone: &Bone, offset: Vector3<f64>) -> Joint {
    let channels = bone.channels.iter().rev().copied().collect();
    Joint { name: name.to_owned(), parent, offset, axes: bone.axes, channels }
}

fn rotation(axis: Axis, angle: f64) -> UnitQuaternion<f64> {
    let axis = match axis {
        Axis::X => Vector3::x_axis(),
        Axis::Y => Vector3::y_axis(),
        Axis::Z => Vector3::z_axis(),
    };
    UnitQuaternion::from_axis_angle(&axis, angle)
}

fn axis_of(letter: u8) -> Option<Axis> {
    match letter.to_ascii_lowercase() {
        b'x' => Some(Axis::X),
        b'y' => Some(Axis::Y),
        b'z' => Some(Axis::Z),
        _ => None,
    }
}

/// `XYZ`: each axis once, in any order.
fn axis_order(word: Word<'_>) -> Result<[Axis; 3], MocapError> {
    let axes: Option<Vec<Axis>> = word.text.iter().map(|&letter| axis_of(letter)).collect();
    match axes.as_deref() {
        Some(&[a, b, c]) if a != b && b != c && a != c => Ok([a, b, c]),
        _ => Err(word.unexpected("an order of axes such as XYZ")),
    }
}

/// `rx ry rz` and `tx ty tz`, each at most once.
fn channels(words: &mut Words<'_>) -> Result<Vec<Channel>, MocapError> {
    let mut channels = Vec::new();
    while let Some(word) = words.next() {
        let channel = match *word.text {
            [b'r' | b'R', axis] => axis_of(axis).map(Channel::Rotation),
            [b't' | b'T', axis] => axis_of(axis).map(Channel::Position),
            [b'l' | b'L'] => {
                return Err(word.error(MocapFault::Unsupported { what: "a bone that stretches".to_owned() }));
            }
            _ => None,
        };
        match channel {
            Some(channel) if !channels.contains(&channel) => channels.push(channel),
            _ => return Err(word.unexpected("rx, ry, rz, tx, ty or tz, each once")),
        }
    }
    Ok(channels)
}
