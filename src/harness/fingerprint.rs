//! Identity of a motion by its numbers.

use sha2::{Digest, Sha256};

use crate::manifest::hex;
use crate::motion::Motion;

/// Checksum of a motion: height, mass, rate and all frames as little-endian doubles, in channel order.
///
/// It is the same for the same movement in a zip, a folder or another file format.
#[must_use]
pub fn motion_sha256(motion: &Motion) -> String {
    let mut digest = Sha256::new();
    for value in [motion.body().height_m, motion.body().mass_kg, motion.rate_hz()] {
        digest.update(value.to_le_bytes());
    }
    for frame in motion.frames() {
        for value in frame.to_channels() {
            digest.update(value.to_le_bytes());
        }
    }
    hex(&digest.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, Frame};

    #[test]
    fn every_number_counts() {
        let motion = |height_m: f64, rate_hz: f64, angle: f64| {
            let mut frame = Frame::ZERO;
            frame.joint_angles_rad[43] = angle;
            Motion::new(Body::with_default_mass(height_m), rate_hz, vec![Frame::ZERO, frame]).unwrap()
        };
        let sums: std::collections::BTreeSet<String> =
            [(1.7, 100.0, 0.0), (1.8, 100.0, 0.0), (1.7, 50.0, 0.0), (1.7, 100.0, 1e-12)]
                .into_iter()
                .map(|(height_m, rate_hz, angle)| motion_sha256(&motion(height_m, rate_hz, angle)))
                .collect();
        assert_eq!(sums.len(), 4);
    }
}
