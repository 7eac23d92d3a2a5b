//! Joint positions without a skeleton file, as datasets of generated motion publish them.

use nalgebra::{UnitQuaternion, Vector3};

use super::clip::Values;
use super::{Clip, Joint, MAX_FRAMES, MAX_VALUE};

/// Known orders of joints in arrays `[frame, joint, axis]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PositionOrder {
    /// 21 joints of the MMM model, as published for KIT-ML.
    KitMl,
    /// 22 joints of the SMPL body, as published for `HumanML3D`.
    HumanMl3d,
}

/// Name and parent of each joint of KIT-ML arrays.
const KIT_ML: [(&str, usize); 21] = [
    ("root", 0),
    ("BP", 0),
    ("BT", 1),
    ("BLN", 2),
    ("BUN", 3),
    ("LS", 3),
    ("LE", 5),
    ("LW", 6),
    ("RS", 3),
    ("RE", 8),
    ("RW", 9),
    ("LH", 0),
    ("LK", 11),
    ("LA", 12),
    ("LMrot", 13),
    ("LF", 14),
    ("RH", 0),
    ("RK", 16),
    ("RA", 17),
    ("RMrot", 18),
    ("RF", 19),
];

/// Name and parent of each joint of `HumanML3D` arrays.
const HUMAN_ML3D: [(&str, usize); 22] = [
    ("pelvis", 0),
    ("left_hip", 0),
    ("right_hip", 0),
    ("spine1", 0),
    ("left_knee", 1),
    ("right_knee", 2),
    ("spine2", 3),
    ("left_ankle", 4),
    ("right_ankle", 5),
    ("spine3", 6),
    ("left_foot", 7),
    ("right_foot", 8),
    ("neck", 9),
    ("left_collar", 9),
    ("right_collar", 9),
    ("head", 12),
    ("left_shoulder", 13),
    ("right_shoulder", 14),
    ("left_elbow", 16),
    ("right_elbow", 17),
    ("left_wrist", 18),
    ("right_wrist", 19),
];

/// Why positions are no clip.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PositionsError {
    /// No frame at all.
    #[error("the array has no frames")]
    Empty,
    /// More frames than accepted.
    #[error("the array has {found} frames, more than the {MAX_FRAMES} accepted")]
    TooLong {
        /// Number found.
        found: usize,
    },
    /// Not a position.
    #[error("frame {frame}, joint {joint}: {found} is not a position within ±1e7")]
    Value {
        /// Index of the frame.
        frame: usize,
        /// Name of the joint.
        joint: &'static str,
        /// Value found.
        found: f64,
    },
}

impl PositionOrder {
    /// The order that has this many joints.
    #[must_use]
    pub fn of_count(num_joints: usize) -> Option<Self> {
        match num_joints {
            21 => Some(Self::KitMl),
            22 => Some(Self::HumanMl3d),
            _ => None,
        }
    }

    /// Name and parent of each joint; the root is its own parent.
    #[must_use]
    pub fn joints(self) -> &'static [(&'static str, usize)] {
        match self {
            Self::KitMl => &KIT_ML,
            Self::HumanMl3d => &HUMAN_ML3D,
        }
    }

    /// A clip from joint positions, `[frame][joint]` in one row, file units.
    ///
    /// # Errors
    /// [`PositionsError`] when there is no frame, too many, or a position is not one.
    ///
    /// # Panics
    /// When the number of positions is no multiple of the number of joints.
    pub fn clip(self, centres: Vec<[f64; 3]>, rate_hz: Option<f64>) -> Result<Clip, PositionsError> {
        let table = self.joints();
        assert_eq!(centres.len() % table.len(), 0, "whole frames of {} joints", table.len());
        let num_frames = centres.len() / table.len();
        if num_frames == 0 {
            return Err(PositionsError::Empty);
        }
        if num_frames > MAX_FRAMES {
            return Err(PositionsError::TooLong { found: num_frames });
        }
        for (index, centre) in centres.iter().enumerate() {
            if let Some(&found) = centre.iter().find(|value| value.is_nan() || value.abs() > MAX_VALUE) {
                let (frame, joint) = (index / table.len(), table[index % table.len()].0);
                return Err(PositionsError::Value { frame, joint, found });
            }
        }
        let joints = table
            .iter()
            .enumerate()
            .map(|(index, &(name, parent))| Joint {
                name: name.to_owned(),
                parent: (index > 0).then_some(parent),
                offset: Vector3::zeros(),
                axes: UnitQuaternion::identity(),
                channels: Vec::new(),
            })
            .collect();
        Ok(Clip { joints, num_frames, rate_hz, values: Values::Centres(centres) })
    }
}
