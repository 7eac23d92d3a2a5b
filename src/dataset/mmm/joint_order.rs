//! From the joints a file lists to the 44 of a KIT motion.

use crate::motion::{JOINTS, NUM_JOINTS};

/// Most joints a file may list; the largest MMM model with both hands has about 104.
pub(super) const MAX_JOINTS: usize = 256;

/// Why a joint list is not that of a KIT motion.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JointOrderError {
    /// No joint is listed before the frames.
    #[error("no list of joints (<JointOrder>) comes before the frames")]
    None,
    /// A joint is listed twice.
    #[error("the joint list has {joint} twice")]
    Twice {
        /// The joint.
        joint: String,
    },
    /// More joints than any model has.
    #[error("the joint list has more than {MAX_JOINTS} joints")]
    TooMany,
    /// Some of the 44 joints are missing: another model, mostly an older one.
    #[error(
        "the motion has {found} joints, expected the 44 of the MMM reference model: {model}missing {}{}",
        .missing.join(", "), unknown_list(.unknown)
    )]
    OtherModel {
        /// Number of joints listed.
        found: usize,
        /// `an older MMM model; ` where the joints say so.
        model: &'static str,
        /// Joints of the 44 that are not listed.
        missing: Vec<&'static str>,
        /// Listed joints that are none of the 44.
        unknown: Vec<String>,
    },
}

fn unknown_list(unknown: &[String]) -> String {
    if unknown.is_empty() { String::new() } else { format!("; unknown {}", unknown.join(", ")) }
}

/// Where each number of a `<JointPosition>` belongs.
#[derive(Debug, Clone, Default)]
pub(super) struct JointOrder {
    /// KIT joint index of each listed joint; `None` for a joint that is not one of the 44.
    kit_of_column: Vec<Option<usize>>,
    names: Vec<String>,
}

impl JointOrder {
    pub(super) fn push(&mut self, name: String) -> Result<(), JointOrderError> {
        if self.names.len() == MAX_JOINTS {
            return Err(JointOrderError::TooMany);
        }
        if self.names.contains(&name) {
            return Err(JointOrderError::Twice { joint: name });
        }
        self.kit_of_column.push(JOINTS.iter().position(|joint| joint.name == name));
        self.names.push(name);
        Ok(())
    }

    /// Numbers each frame must have.
    pub(super) fn num_columns(&self) -> usize {
        self.names.len()
    }

    /// Copies the numbers of one frame to their KIT joints.
    pub(super) fn scatter(&self, columns: &[f64], joint_angles_rad: &mut [f64; NUM_JOINTS]) {
        for (value, kit) in columns.iter().zip(&self.kit_of_column) {
            if let Some(kit) = *kit {
                joint_angles_rad[kit] = *value;
            }
        }
    }

    /// Adds the joints of another list, for files that split the body into several.
    pub(super) fn merge(&mut self, other: &Self) -> Result<(), JointOrderError> {
        other.names.iter().try_for_each(|name| self.push(name.clone()))
    }

    /// Checks that all 44 joints are there; returns a warning that names the joints that will be ignored.
    pub(super) fn check(&self) -> Result<Option<String>, JointOrderError> {
        if self.names.is_empty() {
            return Err(JointOrderError::None);
        }
        let missing: Vec<&str> = JOINTS
            .iter()
            .map(|joint| joint.name)
            .filter(|name| !self.names.iter().any(|listed| listed == name))
            .collect();
        let unknown: Vec<String> = self
            .names
            .iter()
            .zip(&self.kit_of_column)
            .filter(|(_, kit)| kit.is_none())
            .map(|(name, _)| name.clone())
            .collect();
        if missing.is_empty() {
            return Ok((!unknown.is_empty()).then(|| {
                format!("joints without a place in the model are ignored: {}", unknown.join(", "))
            }));
        }
        // Older models are the reference model without neck, toe or midfoot joints.
        let older = unknown.is_empty()
            && missing
                .iter()
                .all(|name| ["BLN", "LF", "RF", "LM", "RM"].iter().any(|part| name.starts_with(part)));
        let model = if older { "this is an older MMM model; " } else { "" };
        Err(JointOrderError::OtherModel { found: self.names.len(), model, missing, unknown })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order<'a>(names: impl IntoIterator<Item = &'a str>) -> JointOrder {
        let mut order = JointOrder::default();
        for name in names {
            order.push(name.to_owned()).unwrap();
        }
        order
    }

    #[test]
    fn joints_find_their_place_in_any_order() {
        let order = order(JOINTS.iter().rev().map(|joint| joint.name).chain(["LeftThumb_joint"]));
        assert_eq!(
            order.check().unwrap().unwrap(),
            "joints without a place in the model are ignored: LeftThumb_joint"
        );
        let columns: Vec<f64> = (0..45).map(f64::from).collect();
        let mut angles = [0.0; NUM_JOINTS];
        order.scatter(&columns, &mut angles);
        assert_eq!((angles[0], angles[43]), (43.0, 0.0));
    }

    #[test]
    fn older_models_are_refused_by_name() {
        let error = order(JOINTS.iter().map(|j| j.name).filter(|n| !n.contains("LF") && !n.contains("BLN")))
            .check()
            .unwrap_err();
        assert_eq!(
            error.to_string(),
            "the motion has 40 joints, expected the 44 of the MMM reference model: this is an older MMM model; \
             missing BLNx_joint, BLNy_joint, BLNz_joint, LFx_joint"
        );
        let error = order(JOINTS.iter().map(|j| j.name).skip(1).chain(["Tail_joint"])).check().unwrap_err();
        assert_eq!(
            error.to_string(),
            "the motion has 44 joints, expected the 44 of the MMM reference model: missing BLNx_joint; \
             unknown Tail_joint"
        );
        assert_eq!(JointOrder::default().check().unwrap_err(), JointOrderError::None);
    }
}
