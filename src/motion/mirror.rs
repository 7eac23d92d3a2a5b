//! A motion as a mirror shows it.

use std::ops::Neg;
use std::sync::LazyLock;

use super::{Axis, Frame, JOINTS, NUM_CHANNELS, NUM_JOINTS, joint_index};

/// Where a channel of a mirrored frame comes from.
#[derive(Debug, Clone, Copy)]
struct Source {
    channel: usize,
    is_negated: bool,
}

/// Turns about x, the axis through the mirror, stay as they are; those about y and z, and places along x, are negated.
static SOURCES: LazyLock<[Source; NUM_CHANNELS]> = LazyLock::new(|| {
    let mut sources = std::array::from_fn(|channel| Source { channel, is_negated: false });
    for (channel, joint) in JOINTS.iter().enumerate() {
        let name = joint.short_name();
        let twin = match name.split_at(1) {
            ("L", rest) => joint_index(&format!("R{rest}")),
            ("R", rest) => joint_index(&format!("L{rest}")),
            _ => None,
        };
        sources[channel] = Source { channel: twin.unwrap_or(channel), is_negated: joint.axis != Axis::X };
    }
    // Root position x, pitch and yaw.
    for channel in [NUM_JOINTS, NUM_JOINTS + 4, NUM_JOINTS + 5] {
        sources[channel].is_negated = true;
    }
    sources
});

/// The channels of a frame reflected in the plane x = 0 of the world: left and right limbs change places.
///
/// Works on anything that is odd in the channels: SI units, speeds, and values of a range that is itself symmetric.
/// Twice gives the frame back.
#[must_use]
pub fn mirrored_channels<T: Copy + Neg<Output = T>>(channels: &[T; NUM_CHANNELS]) -> [T; NUM_CHANNELS] {
    SOURCES.map(|source| {
        let value = channels[source.channel];
        if source.is_negated { -value } else { value }
    })
}

impl Frame {
    /// The frame reflected in the plane x = 0 of the world; see [`mirrored_channels`].
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self::from_channels(&mirrored_channels(&self.to_channels()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn left_becomes_right_and_twice_gives_the_frame_back() {
        let channels: [f64; NUM_CHANNELS] = std::array::from_fn(|channel| channel as f64 + 1.0);
        let mirrored = mirrored_channels(&channels);
        let joint = |name: &str| joint_index(name).unwrap();
        for (name, other, sign) in
            [("LKx", "RKx", 1.0), ("RSy", "LSy", -1.0), ("LMrot", "RMrot", -1.0), ("BTx", "BTx", 1.0)]
        {
            assert_eq!(mirrored[joint(name)], sign * channels[joint(other)], "{name}");
        }
        assert_eq!(mirrored[joint("BTz")], -channels[joint("BTz")]);
        assert_eq!(mirrored[NUM_JOINTS..], [-45.0, 46.0, 47.0, 48.0, -49.0, -50.0]);
        assert_eq!(mirrored_channels(&mirrored), channels);
    }
}
