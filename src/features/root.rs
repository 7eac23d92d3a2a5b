//! Where a motion begins, as the model sees it.

use serde::{Deserialize, Serialize};

use crate::motion::NUM_CHANNELS;

/// First of the three channels of the root's position.
const POSITION: usize = 44;
/// Channel of the root's yaw.
const YAW: usize = 49;

/// What the root channels are relative to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Root {
    /// The world of the recording, as in the paper.
    #[default]
    Absolute,
    /// Every motion begins above the origin with yaw zero; height, roll and pitch stay as they are.
    ///
    /// `Deviation:` where in the room a recording was made says nothing about what is done, and recordings of several
    /// laboratories share no room.
    FromStart,
}

impl Root {
    /// Moves and turns a motion, frames in SI units, to where it is to begin.
    pub fn place(self, frames: &mut [[f64; NUM_CHANNELS]]) {
        let (Self::FromStart, Some(first)) = (self, frames.first().copied()) else { return };
        let (sin, cos) = first[YAW].sin_cos();
        for frame in frames {
            let (x, y) = (frame[POSITION] - first[POSITION], frame[POSITION + 1] - first[POSITION + 1]);
            // R = Rz(yaw) Ry(pitch) Rx(roll): a turn about z changes yaw alone.
            frame[POSITION] = cos * x + sin * y;
            frame[POSITION + 1] = cos * y - sin * x;
            frame[YAW] -= first[YAW];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_motion_begins_at_the_origin_and_keeps_its_shape() {
        let mut frames = [[0.25; NUM_CHANNELS]; 2];
        // Facing along -x from (3, 4), then one metre ahead and turned by 0.1.
        frames[0][POSITION..].copy_from_slice(&[3.0, 4.0, 0.9, 0.0, 0.2, FRAC_PI_2]);
        frames[1][POSITION..].copy_from_slice(&[2.0, 4.0, 0.8, 0.1, 0.3, FRAC_PI_2 + 0.1]);
        let untouched = frames;
        Root::Absolute.place(&mut frames);
        assert_eq!(frames, untouched);

        Root::FromStart.place(&mut frames);
        let close = |found: &[f64], expected: [f64; 6]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        close(&frames[0][POSITION..], [0.0, 0.0, 0.9, 0.0, 0.2, 0.0]);
        // Bodies look along y: what was ahead of this one is along y now.
        close(&frames[1][POSITION..], [0.0, 1.0, 0.8, 0.1, 0.3, 0.1]);
        assert_eq!(frames[1][..POSITION], untouched[1][..POSITION]);
        Root::FromStart.place(&mut []);
    }
}
