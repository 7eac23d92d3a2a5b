//! Pelvis rotation, trunk, neck and arms over time: everything the feet do not decide.

use super::track::Track;
use crate::motion::{Frame, JOINTS, JointInfo, NUM_JOINTS, joint_index};

/// Rotations of the pelvis, named beside the joints of KIT.
const PELVIS: [&str; 3] = ["pelvis x", "pelvis y", "pelvis z"];

/// Tracks of the angles that are given rather than solved, in radians.
#[derive(Debug, Clone)]
pub(super) struct Posture {
    joints: Vec<Track>,
    pelvis: [Track; 3],
}

/// Angles in degrees by KIT short name, or `pelvis x`, `pelvis y`, `pelvis z`.
pub(super) type Angles<'a> = &'a [(&'a str, f64)];

/// Quiet standing: arms hang a little away from the body with the elbows a little bent.
const RELAXED: Angles<'static> =
    &[("LSx", -3.0), ("RSx", -3.0), ("LSy", 8.0), ("RSy", -8.0), ("LEx", 14.0), ("REx", 14.0)];

impl Posture {
    /// KIT indices of the toe joints, left and right, which the feet decide.
    pub const TOES: [usize; 2] = [26, 42];

    /// Quiet standing.
    pub fn relaxed() -> Self {
        let mut posture = Self {
            joints: vec![Track::at_rest(0.0); NUM_JOINTS],
            pelvis: std::array::from_fn(|_| Track::at_rest(0.0)),
        };
        for &(name, degrees) in RELAXED {
            *posture.track(name) = Track::at_rest(degrees.to_radians());
        }
        posture
    }

    /// The track of an angle.
    ///
    /// # Panics
    /// On a name that is no joint: a slip in a choreography, which every test would meet.
    pub fn track(&mut self, name: &str) -> &mut Track {
        if let Some(axis) = PELVIS.iter().position(|pelvis| *pelvis == name) {
            return &mut self.pelvis[axis];
        }
        match joint_index(name) {
            Some(joint) => &mut self.joints[joint],
            None => panic!("{name} is no joint of the choreography"),
        }
    }

    /// Moves angles from where they are to the given degrees, from rest at `start_secs` to rest at `end_secs`.
    pub fn move_to(&mut self, start_secs: f64, end_secs: f64, angles: Angles<'_>) {
        for &(name, degrees) in angles {
            self.track(name).move_to(start_secs, end_secs, degrees.to_radians());
        }
    }

    /// Moves everything back to quiet standing.
    pub fn relax(&mut self, start_secs: f64, end_secs: f64) {
        let mut rest = Self::relaxed();
        let names = JOINTS.iter().map(JointInfo::short_name).chain(PELVIS);
        for name in names {
            let value = rest.track(name).last().value;
            let track = self.track(name);
            if track.last().value != value {
                track.move_to(start_secs, end_secs, value);
            }
        }
    }

    /// The given angles at this time; root position, legs and toes are zero.
    pub fn frame(&self, time_secs: f64) -> Frame {
        let mut frame = Frame::ZERO;
        for (angle, track) in frame.joint_angles_rad.iter_mut().zip(&self.joints) {
            *angle = track.at(time_secs);
        }
        for (angle, track) in frame.root_rotation_rad.iter_mut().zip(&self.pelvis) {
            *angle = track.at(time_secs);
        }
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_toes_are_the_toes() {
        assert_eq!(Posture::TOES.map(|joint| JOINTS[joint].short_name()), ["LFx", "RFx"]);
    }

    #[test]
    fn relaxing_returns_every_angle() {
        let mut posture = Posture::relaxed();
        posture.move_to(1.0, 2.0, &[("BPx", -20.0), ("pelvis x", -10.0), ("LSy", 60.0)]);
        assert_ne!(posture.frame(2.0), Posture::relaxed().frame(0.0));
        posture.relax(3.0, 4.0);
        assert_eq!(posture.frame(4.0), Posture::relaxed().frame(0.0));
    }
}
