//! The number elements of one frame, in either layout.

use super::joint_order::JointOrder;
use super::xml::{Cursor, NamedChild};
use super::{MmmError, MmmFault};
use crate::motion::Frame;

/// What a `<MotionFrame>` of the legacy layout holds.
pub(super) const LEGACY_FRAME: &[&str] = &["Timestep", "RootPosition", "RootRotation", "JointPosition"];
/// What a `<Measurement>` of a `ModelPose` sensor holds.
pub(super) const POSE_MEASUREMENT: &[&str] = &["RootPosition", "RootRotation"];
/// What a `<Measurement>` of a `Kinematic` sensor holds.
pub(super) const KINEMATIC_MEASUREMENT: &[&str] = &["JointPosition"];

/// Reads frames of one kind, each of whose elements must stand exactly once; other elements are skipped.
pub(super) struct FrameReader<'o> {
    inside: &'static str,
    elements: &'static [&'static str],
    order: &'o JointOrder,
    /// The numbers of a `<JointPosition>` in file order.
    columns: Vec<f64>,
}

impl<'o> FrameReader<'o> {
    pub(super) fn new(
        inside: &'static str,
        elements: &'static [&'static str],
        order: &'o JointOrder,
    ) -> Self {
        Self { inside, elements, order, columns: vec![0.0; order.num_columns()] }
    }

    /// Fills `frame`, with the position still in millimetres, from the element just opened; returns the time stamp,
    /// or 0 where the elements include none.
    pub(super) fn read(
        &mut self,
        cursor: &mut Cursor<'_>,
        index: usize,
        frame: &mut Frame,
    ) -> Result<f64, MmmError> {
        let mut seen = 0_u32;
        let mut stamp_secs = [0.0];
        while let Some(NamedChild { index: which, content }) = cursor.child_of(self.inside, self.elements)? {
            let element = self.elements[which];
            if seen & (1 << which) != 0 {
                return Err(cursor.fault(MmmFault::Repeated { place: frame_place(index), element }));
            }
            seen |= 1 << which;
            let values: &mut [f64] = match element {
                "Timestep" => &mut stamp_secs,
                "RootPosition" => &mut frame.root_position_m,
                "RootRotation" => &mut frame.root_rotation_rad,
                _ => &mut self.columns,
            };
            read_numbers(cursor, element, content, || frame_place(index), values)?;
            if element == "JointPosition" {
                self.order.scatter(&self.columns, &mut frame.joint_angles_rad);
            }
        }
        match self.elements.iter().enumerate().find(|(which, _)| seen & (1 << which) == 0) {
            None => Ok(stamp_secs[0]),
            Some((_, element)) => Err(cursor.fault(MmmFault::Missing { place: frame_place(index), element })),
        }
    }
}

/// Fills `values` from the numbers of an element: from its `content` if the cursor has passed it already, else from
/// the element just opened.
pub(super) fn read_numbers(
    cursor: &mut Cursor<'_>,
    element: &'static str,
    content: Option<&[u8]>,
    place: impl Fn() -> String,
    values: &mut [f64],
) -> Result<(), MmmError> {
    let mut found = 0;
    cursor.numbers(
        element,
        content,
        |value| {
            if let Some(slot) = values.get_mut(found) {
                *slot = value;
            }
            found += 1;
        },
        |word| MmmFault::NotANumber { place: place(), element, found: word.found },
    )?;
    let expected = values.len();
    if found == expected {
        return Ok(());
    }
    Err(cursor.fault(MmmFault::NumberCount { place: place(), element, expected, found }))
}

/// How messages name a frame.
pub(super) fn frame_place(frame: usize) -> String {
    format!("frame {frame}")
}
