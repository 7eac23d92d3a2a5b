//! Roles: the joint centres and bones by which a source skeleton and the humanoid know each other.

/// A joint centre, or the end of a bone, that a source skeleton may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names say it")]
pub enum Role {
    LeftHip,
    RightHip,
    LeftKnee,
    RightKnee,
    LeftAnkle,
    RightAnkle,
    LeftToe,
    RightToe,
    LeftShoulder,
    RightShoulder,
    LeftElbow,
    RightElbow,
    LeftWrist,
    RightWrist,
    Neck,
    Head,
    /// Lower joint of the trunk, between pelvis and abdomen.
    Abdomen,
    /// Upper joint of the trunk, between abdomen and thorax.
    Thorax,
    LeftMidfoot,
    RightMidfoot,
    /// End of the toes.
    LeftToeTip,
    RightToeTip,
    /// A point of the hand beyond the wrist, such as the root of the middle finger.
    LeftHand,
    RightHand,
    HeadTop,
}

/// Number of roles.
pub const NUM_ROLES: usize = 25;

/// What is known about a role.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoleInfo {
    pub role: Role,
    /// Name in correspondence files and reports.
    pub name: &'static str,
    /// Link of the humanoid whose origin it is; empty for points that are no joint of it.
    pub link: &'static str,
    /// Whether every source skeleton must have it.
    pub required: bool,
}

const fn info(role: Role, name: &'static str, link: &'static str, required: bool) -> RoleInfo {
    RoleInfo { role, name, link, required }
}

/// All roles, in the order of [`Role`].
#[rustfmt::skip]
pub(super) const ROLES: [RoleInfo; NUM_ROLES] = [
    info(Role::LeftHip, "left_hip", "left_thigh", true),
    info(Role::RightHip, "right_hip", "right_thigh", true),
    info(Role::LeftKnee, "left_knee", "left_shank", true),
    info(Role::RightKnee, "right_knee", "right_shank", true),
    info(Role::LeftAnkle, "left_ankle", "left_foot", true),
    info(Role::RightAnkle, "right_ankle", "right_foot", true),
    info(Role::LeftToe, "left_toe", "left_toes", true),
    info(Role::RightToe, "right_toe", "right_toes", true),
    info(Role::LeftShoulder, "left_shoulder", "left_upper_arm", true),
    info(Role::RightShoulder, "right_shoulder", "right_upper_arm", true),
    info(Role::LeftElbow, "left_elbow", "left_forearm", true),
    info(Role::RightElbow, "right_elbow", "right_forearm", true),
    info(Role::LeftWrist, "left_wrist", "left_hand", true),
    info(Role::RightWrist, "right_wrist", "right_hand", true),
    info(Role::Neck, "neck", "neck", true),
    info(Role::Head, "head", "head", true),
    info(Role::Abdomen, "abdomen", "abdomen", false),
    info(Role::Thorax, "thorax", "thorax", false),
    info(Role::LeftMidfoot, "left_midfoot", "left_midfoot", false),
    info(Role::RightMidfoot, "right_midfoot", "right_midfoot", false),
    info(Role::LeftToeTip, "left_toe_tip", "", false),
    info(Role::RightToeTip, "right_toe_tip", "", false),
    info(Role::LeftHand, "left_hand", "", false),
    info(Role::RightHand, "right_hand", "", false),
    info(Role::HeadTop, "head_top", "", false),
];

impl Role {
    /// Index of the role in arrays of [`NUM_ROLES`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name in correspondence files and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        ROLES[self.index()].name
    }

    /// Link of the humanoid whose origin the joint is; `None` for points that are no joint of it.
    #[must_use]
    pub fn link(self) -> Option<&'static str> {
        Some(ROLES[self.index()].link).filter(|link| !link.is_empty())
    }

    /// All roles, in order.
    pub fn all() -> impl Iterator<Item = Self> {
        ROLES.iter().map(|info| info.role)
    }
}

/// A rigid segment of the humanoid whose orientation a source bone can tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names say it")]
pub enum Segment {
    Pelvis,
    Thorax,
    Head,
    LeftUpperArm,
    RightUpperArm,
    LeftForearm,
    RightForearm,
    LeftHand,
    RightHand,
    LeftThigh,
    RightThigh,
    LeftFoot,
    RightFoot,
    LeftToes,
    RightToes,
}

/// Number of segments.
pub(super) const NUM_ORIENTED: usize = 15;

/// Link name of each segment, in the order of [`Segment`].
pub(super) const ORIENTED: [(Segment, &str); NUM_ORIENTED] = [
    (Segment::Pelvis, "pelvis"),
    (Segment::Thorax, "thorax"),
    (Segment::Head, "head"),
    (Segment::LeftUpperArm, "left_upper_arm"),
    (Segment::RightUpperArm, "right_upper_arm"),
    (Segment::LeftForearm, "left_forearm"),
    (Segment::RightForearm, "right_forearm"),
    (Segment::LeftHand, "left_hand"),
    (Segment::RightHand, "right_hand"),
    (Segment::LeftThigh, "left_thigh"),
    (Segment::RightThigh, "right_thigh"),
    (Segment::LeftFoot, "left_foot"),
    (Segment::RightFoot, "right_foot"),
    (Segment::LeftToes, "left_toes"),
    (Segment::RightToes, "right_toes"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_in_the_order_of_their_enums() {
        assert!(ROLES.iter().enumerate().all(|(index, info)| info.role.index() == index));
        assert!(ORIENTED.iter().enumerate().all(|(index, (segment, _))| *segment as usize == index));
    }
}
