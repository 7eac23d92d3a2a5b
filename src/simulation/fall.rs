//! When a body has fallen: the one rule, for events and for scores.

use super::{Contact, RolloutSample};
use crate::humanoid::{Humanoid, Solids};

/// Mean distance of the segments from the reference beyond which the body no longer performs the motion, metres.
///
/// The success rule of UHC and PHC.
pub const LOST_TRACK_M: f64 = 0.5;

/// Height up to which the reference itself puts a segment on the floor, metres.
const PLANNED_CONTACT_M: f64 = 0.050;

/// Why a body counts as fallen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FallCause {
    /// Its segments are more than [`LOST_TRACK_M`] from the reference in the mean.
    Lost,
    /// This segment, which is no part of a foot, is held up by the floor, and the reference does not put it there.
    BodyOnFloor {
        /// Index in the order of [`Humanoid::segment_links`].
        segment: usize,
    },
    /// The state became unusable.
    Failed,
}

/// Tells whether a sample is a fall: the body is lost, or the floor holds up a segment that is no part of a foot and that
/// the reference keeps more than 50 mm above the floor.
pub struct FallRule<'a> {
    humanoid: &'a Humanoid,
    solids: Solids,
    is_foot: Vec<bool>,
}

impl<'a> FallRule<'a> {
    /// The rule for a body.
    #[must_use]
    pub fn new(humanoid: &'a Humanoid) -> Self {
        let has_sole = |link: &usize| humanoid.sole_points.iter().any(|point| point.link == *link);
        let is_foot = humanoid.segment_links.iter().map(has_sole).collect();
        Self { humanoid, solids: Solids::new(humanoid), is_foot }
    }

    /// Why this sample is a fall; `None` when it is none.
    #[must_use]
    pub fn fall(&self, sample: &RolloutSample) -> Option<FallCause> {
        if sample.mean_distance_m() > LOST_TRACK_M {
            return Some(FallCause::Lost);
        }
        let on_floor = sample.contacts.iter().filter(|contact| contact.bears_load());
        let mut fallen = on_floor
            .map(|contact| contact.segment)
            .filter(|&segment| !self.is_foot[segment] && !self.is_planned(sample, segment));
        fallen.next().map(|segment| FallCause::BodyOnFloor { segment })
    }

    /// Whether a segment is part of a foot.
    #[must_use]
    pub fn is_foot(&self, segment: usize) -> bool {
        self.is_foot[segment]
    }

    fn is_planned(&self, sample: &RolloutSample, segment: usize) -> bool {
        let reference = &sample.reference_world_from_segment[segment];
        self.solids.lowest_of_link_m(self.humanoid.segment_links[segment], reference) <= PLANNED_CONTACT_M
    }

    /// The cause as a sentence without its full stop.
    pub(super) fn message(&self, cause: FallCause, sample: &RolloutSample) -> String {
        match cause {
            FallCause::BodyOnFloor { segment } => {
                let link = &self.humanoid.robot.tree.links()[self.humanoid.segment_links[segment]];
                format!("the {} touched the ground", link.name.replace('_', " "))
            }
            FallCause::Lost | FallCause::Failed => {
                format!("the body is {:.2} m from the motion on average", sample.mean_distance_m())
            }
        }
    }
}

impl Contact {
    /// Whether the contact carries load: touching without force holds nothing up.
    #[must_use]
    pub fn bears_load(&self) -> bool {
        self.force_n.z > 0.0
    }
}
