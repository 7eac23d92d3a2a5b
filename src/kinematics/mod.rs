//! Kinematic trees: rigid links joined by fixed and revolute joints.
//!
//! In: links and joints in any order (from `crate::robot`), a root pose and joint angles.
//! Out: a [`Tree`], the pose of every link in the world, the centre of mass and point Jacobians.
//! All arithmetic is `f64`; nothing here reads files or knows a physics engine.
//!
//! A pose named `a_from_b` takes coordinates in frame `b` to frame `a`.
//! The frame of a link is that of the joint above it, turned by the joint's angle; the root link has the root's frame.

#[cfg(test)]
mod tests;

use nalgebra::{Isometry3, Matrix3, Unit, UnitQuaternion, Vector3};

/// Mass distribution of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Mass in kilograms.
    pub mass_kg: f64,
    /// Centre of mass in the link frame, metres.
    pub com_in_link_m: Vector3<f64>,
    /// Rotational inertia about the centre of mass, along the link axes, kg m^2.
    pub inertia_about_com_kgm2: Matrix3<f64>,
}

/// A rigid body of the tree.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Name, unique in the tree.
    pub name: String,
    /// Mass distribution; `None` for a massless frame.
    pub inertial: Option<Inertial>,
}

/// What a joint lets its child do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JointKind {
    /// Child and parent move as one.
    Fixed,
    /// The child turns about `axis`, a unit vector in the joint frame.
    Revolute {
        /// Axis of rotation.
        axis: Unit<Vector3<f64>>,
    },
}

/// A joint between two links.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name, unique in the tree.
    pub name: String,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link, always above `parent`.
    pub child: usize,
    /// Pose of the joint frame in the parent link; the child frame coincides with it at angle zero.
    pub parent_from_joint: Isometry3<f64>,
    /// What the joint lets the child do.
    pub kind: JointKind,
    /// Index among the revolute joints, which is the index of its angle; `None` when fixed.
    pub angle_index: Option<usize>,
}

/// Why links and joints do not form a tree.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TreeError {
    /// There is no link.
    #[error("there are no links")]
    Empty,
    /// Two links or two joints share a name.
    #[error("the name {name:?} is used twice")]
    DuplicateName {
        /// The name in question.
        name: String,
    },
    /// A joint names a link that does not exist.
    #[error("joint {joint:?} names the link {link:?}, which does not exist")]
    UnknownLink {
        /// Joint with the bad reference.
        joint: String,
        /// Link it names.
        link: String,
    },
    /// A link is the child of two joints.
    #[error("link {link:?} is the child of more than one joint")]
    TwoParents {
        /// The link in question.
        link: String,
    },
    /// More than one link has no parent.
    #[error("the links {first:?} and {second:?} both have no joint above them, expected one root")]
    ManyRoots {
        /// First link without a parent.
        first: String,
        /// Second link without a parent.
        second: String,
    },
    /// Joints form a cycle.
    #[error("link {link:?} is in or below a cycle of joints, which no root reaches")]
    Cycle {
        /// First link the root does not reach.
        link: String,
    },
}

/// A joint as a file lists it, before it is put in its place in the tree.
#[derive(Debug, Clone, PartialEq)]
pub struct JointSpec {
    /// Name, unique in the tree.
    pub name: String,
    /// Name of the parent link.
    pub parent: String,
    /// Name of the child link.
    pub child: String,
    /// Pose of the joint frame in the parent link.
    pub parent_from_joint: Isometry3<f64>,
    /// What the joint lets the child do.
    pub kind: JointKind,
}

/// Links and joints in topological order: a parent always precedes its children, the root is link 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    links: Vec<Link>,
    joints: Vec<Joint>,
    num_angles: usize,
}

impl Tree {
    /// Orders links and joints so that parents come first, keeping the order of the input among siblings.
    ///
    /// # Errors
    /// [`TreeError`] when the joints do not connect all links to a single root.
    pub fn new(links: Vec<Link>, joints: Vec<JointSpec>) -> Result<Self, TreeError> {
        if links.is_empty() {
            return Err(TreeError::Empty);
        }
        let mut index_of = std::collections::BTreeMap::new();
        for (index, link) in links.iter().enumerate() {
            if index_of.insert(link.name.clone(), index).is_some() {
                return Err(TreeError::DuplicateName { name: link.name.clone() });
            }
        }
        let mut seen = std::collections::BTreeSet::new();
        let mut has_parent = vec![false; links.len()];
        let mut joints_below = vec![Vec::new(); links.len()];
        for spec in joints {
            if !seen.insert(spec.name.clone()) {
                return Err(TreeError::DuplicateName { name: spec.name });
            }
            let find = |link: &str| {
                index_of
                    .get(link)
                    .copied()
                    .ok_or_else(|| TreeError::UnknownLink { joint: spec.name.clone(), link: link.to_owned() })
            };
            let (parent, child) = (find(&spec.parent)?, find(&spec.child)?);
            if std::mem::replace(&mut has_parent[child], true) {
                return Err(TreeError::TwoParents { link: spec.child });
            }
            joints_below[parent].push((child, spec));
        }
        let mut roots = (0..links.len()).filter(|&link| !has_parent[link]);
        let Some(root) = roots.next() else {
            return Err(TreeError::Cycle { link: links[0].name.clone() });
        };
        if let Some(second) = roots.next() {
            let name = |link: usize| links[link].name.clone();
            return Err(TreeError::ManyRoots { first: name(root), second: name(second) });
        }

        // Depth first with an explicit stack, so that a deep file cannot overflow ours.
        let mut links: Vec<Option<Link>> = links.into_iter().map(Some).collect();
        let mut tree = Self { links: Vec::with_capacity(links.len()), joints: Vec::new(), num_angles: 0 };
        let mut stack = vec![(root, None)];
        while let Some((index, above)) = stack.pop() {
            let Some(link) = links[index].take() else { continue };
            let child = tree.links.len();
            tree.links.push(link);
            if let Some((parent, spec)) = above {
                let JointSpec { name, parent_from_joint, kind, .. } = spec;
                let angle_index = matches!(kind, JointKind::Revolute { .. }).then_some(tree.num_angles);
                tree.num_angles += usize::from(angle_index.is_some());
                tree.joints.push(Joint { name, parent, child, parent_from_joint, kind, angle_index });
            }
            for (below, spec) in std::mem::take(&mut joints_below[index]).into_iter().rev() {
                stack.push((below, Some((child, spec))));
            }
        }
        match links.into_iter().flatten().next() {
            Some(unreached) => Err(TreeError::Cycle { link: unreached.name }),
            None => Ok(tree),
        }
    }

    /// Links; the root is the first.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Joints, each after the joint above it; joint `i` has the child link `i + 1`.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Number of revolute joints, the length of an angle vector.
    #[must_use]
    pub fn num_angles(&self) -> usize {
        self.num_angles
    }

    /// Index of a link by name.
    #[must_use]
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// The joint above a link; `None` for the root.
    #[must_use]
    pub fn joint_above(&self, link: usize) -> Option<&Joint> {
        link.checked_sub(1).map(|index| &self.joints[index])
    }

    /// Sum of the link masses, kilograms.
    #[must_use]
    pub fn total_mass_kg(&self) -> f64 {
        self.links.iter().filter_map(|link| link.inertial).map(|inertial| inertial.mass_kg).sum()
    }

    /// Pose of every link in the world, in the order of [`Tree::links`].
    ///
    /// `angles_rad` has one entry per revolute joint in tree order ([`Joint::angle_index`]).
    ///
    /// # Panics
    /// When `angles_rad` is not [`Tree::num_angles`] long.
    #[must_use]
    pub fn forward(&self, world_from_root: &Isometry3<f64>, angles_rad: &[f64]) -> Vec<Isometry3<f64>> {
        let mut world_from_link = Vec::new();
        self.forward_into(world_from_root, angles_rad, &mut world_from_link);
        world_from_link
    }

    /// [`Tree::forward`] into a buffer that is cleared first, for inner loops.
    ///
    /// # Panics
    /// When `angles_rad` is not [`Tree::num_angles`] long.
    pub fn forward_into(
        &self,
        world_from_root: &Isometry3<f64>,
        angles_rad: &[f64],
        world_from_link: &mut Vec<Isometry3<f64>>,
    ) {
        assert_eq!(angles_rad.len(), self.num_angles, "one angle per revolute joint");
        world_from_link.clear();
        world_from_link.push(*world_from_root);
        for joint in &self.joints {
            let mut world_from_child = world_from_link[joint.parent] * joint.parent_from_joint;
            if let (JointKind::Revolute { axis }, Some(index)) = (joint.kind, joint.angle_index) {
                world_from_child.rotation *= UnitQuaternion::from_axis_angle(&axis, angles_rad[index]);
            }
            world_from_link.push(world_from_child);
        }
    }

    /// Centre of mass of the whole tree in the world for the link poses of [`Tree::forward`], metres.
    #[must_use]
    pub fn center_of_mass(&self, world_from_link: &[Isometry3<f64>]) -> Vector3<f64> {
        let mut weighted = Vector3::zeros();
        for (link, pose) in self.links.iter().zip(world_from_link) {
            if let Some(inertial) = link.inertial {
                weighted += inertial.mass_kg * (pose * nalgebra::Point3::from(inertial.com_in_link_m)).coords;
            }
        }
        weighted / self.total_mass_kg()
    }

    /// Jacobian of a point fixed to `link`: rows are the world x, y, z velocity of the point, columns the angles.
    ///
    /// The root is held still; `world_from_link` is what [`Tree::forward`] returned.
    #[must_use]
    pub fn point_jacobian(
        &self,
        world_from_link: &[Isometry3<f64>],
        link: usize,
        point_in_world: &Vector3<f64>,
    ) -> nalgebra::Matrix3xX<f64> {
        let mut jacobian = nalgebra::Matrix3xX::zeros(self.num_angles);
        let mut below = link;
        while let Some(joint) = self.joint_above(below) {
            if let (JointKind::Revolute { axis }, Some(index)) = (joint.kind, joint.angle_index) {
                // The child's rotation about its own axis leaves that axis where it is.
                let pose = &world_from_link[joint.child];
                let axis_in_world = pose.rotation * axis.into_inner();
                let lever = point_in_world - pose.translation.vector;
                jacobian.set_column(index, &axis_in_world.cross(&lever));
            }
            below = joint.parent;
        }
        jacobian
    }
}
