//! The numbers of a motion in as few bytes as give back the same bits.
//!
//! Motion files print decimals of six digits or so. Such a number is a whole number below 2^27 over a power of ten, and
//! that quotient, correctly rounded, is what reading the decimal gave: four bytes instead of eight, and no loss.
//! Motions that are not made of such numbers are kept as doubles.

use serde::{Deserialize, Serialize};

use crate::motion::{Frame, NUM_CHANNELS, NUM_JOINTS};

/// How the numbers of a motion are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Encoding {
    /// Sign (1 bit), power of ten (4), whole number (27); positions in millimetres.
    Decimal,
    /// Doubles, little-endian.
    Double,
}

/// Bits of the whole number.
const MAGNITUDE_BITS: u32 = 27;

/// Powers of ten that are exact doubles and whose exponent has four bits.
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Order in which powers are tried: those that fit most angles and most positions first.
const ANGLE_ORDER: [usize; 16] = [8, 7, 9, 10, 6, 5, 4, 3, 2, 1, 0, 11, 12, 13, 14, 15];
const POSITION_ORDER: [usize; 16] = [5, 4, 3, 2, 6, 7, 8, 9, 1, 0, 10, 11, 12, 13, 14, 15];

/// What readers of files in millimetres multiply by; the product must be the same to the bit.
const METRES_PER_MILLIMETRE: f64 = 1e-3;

impl Encoding {
    pub(super) fn bytes_per_frame(self) -> usize {
        NUM_CHANNELS
            * match self {
                Self::Decimal => 4,
                Self::Double => 8,
            }
    }
}

pub(super) fn encode(frames: &[Frame]) -> (Encoding, Vec<u8>) {
    let mut bytes = Vec::with_capacity(frames.len() * Encoding::Decimal.bytes_per_frame());
    for frame in frames {
        let values = channels(frame);
        for (channel, value) in values.iter().enumerate() {
            let Some(word) = decimal(*value, is_position(channel)) else {
                return (Encoding::Double, doubles(frames));
            };
            bytes.extend(word.to_le_bytes());
        }
    }
    (Encoding::Decimal, bytes)
}

/// `None` when there are not as many bytes as the frames need.
pub(super) fn decode(encoding: Encoding, bytes: &[u8]) -> Option<Vec<Frame>> {
    if !bytes.len().is_multiple_of(encoding.bytes_per_frame()) {
        return None;
    }
    let frames = bytes.chunks_exact(encoding.bytes_per_frame()).map(|bytes| match encoding {
        Encoding::Decimal => decimal_frame(bytes.as_chunks().0),
        Encoding::Double => double_frame(bytes.as_chunks().0),
    });
    Some(frames.collect())
}

fn decimal_frame(words: &[[u8; 4]]) -> Frame {
    let mut frame = Frame::ZERO;
    let (angles, root) = words.split_at(NUM_JOINTS);
    let (position, rotation) = root.split_at(3);
    for (value, word) in frame.joint_angles_rad.iter_mut().zip(angles) {
        *value = quotient(u32::from_le_bytes(*word));
    }
    for (value, word) in frame.root_position_m.iter_mut().zip(position) {
        *value = quotient(u32::from_le_bytes(*word)) * METRES_PER_MILLIMETRE;
    }
    for (value, word) in frame.root_rotation_rad.iter_mut().zip(rotation) {
        *value = quotient(u32::from_le_bytes(*word));
    }
    frame
}

fn double_frame(words: &[[u8; 8]]) -> Frame {
    let mut channels = [0.0; NUM_CHANNELS];
    for (value, word) in channels.iter_mut().zip(words) {
        *value = f64::from_le_bytes(*word);
    }
    Frame::from_channels(&channels)
}

fn doubles(frames: &[Frame]) -> Vec<u8> {
    frames.iter().flat_map(channels).flat_map(f64::to_le_bytes).collect()
}

fn channels(frame: &Frame) -> [f64; NUM_CHANNELS] {
    frame.to_channels()
}

fn is_position(channel: usize) -> bool {
    (NUM_JOINTS..NUM_JOINTS + 3).contains(&channel)
}

#[inline]
fn quotient(word: u32) -> f64 {
    let magnitude = word & ((1 << MAGNITUDE_BITS) - 1);
    let power = POWERS[(word >> MAGNITUDE_BITS & 15) as usize];
    let value = f64::from(magnitude) / power;
    f64::from_bits(value.to_bits() | u64::from(word >> 31) << 63)
}

/// The word that [`quotient`] turns back into the same bits, if there is one.
fn decimal(value: f64, is_position: bool) -> Option<u32> {
    let sign = u32::from(value.is_sign_negative()) << 31;
    let target = value.abs();
    let (order, unit) =
        if is_position { (&POSITION_ORDER, METRES_PER_MILLIMETRE) } else { (&ANGLE_ORDER, 1.0) };
    for &exponent in order {
        let magnitude = (target / unit * POWERS[exponent]).round();
        if magnitude < f64::from(1_u32 << MAGNITUDE_BITS) && magnitude / POWERS[exponent] * unit == target {
            return Some(sign | (exponent as u32) << MAGNITUDE_BITS | magnitude as u32);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bits(frames: &[Frame]) -> Vec<u64> {
        frames.iter().flat_map(channels).map(f64::to_bits).collect()
    }

    fn frame(values: impl Fn(usize) -> f64) -> Frame {
        Frame::from_channels(&std::array::from_fn(values))
    }

    proptest! {
        /// Decimals of six digits, as files print them, read as files are read.
        #[test]
        fn printed_decimals_take_four_bytes_and_keep_their_bits(digits in prop::collection::vec((-999_999_i32..=999_999, 0_usize..9), 50)) {
            let value = |channel: usize| {
                let (digits, decimals) = digits[channel];
                let printed = format!("{digits}e-{decimals}");
                let value: f64 = printed.parse().unwrap();
                if is_position(channel) { value * METRES_PER_MILLIMETRE } else { value }
            };
            let frames = [frame(value); 3];
            let (encoding, bytes) = encode(&frames);
            prop_assert_eq!((encoding, bytes.len()), (Encoding::Decimal, 3 * 50 * 4));
            prop_assert_eq!(bits(&decode(encoding, &bytes).unwrap()), bits(&frames));
        }

        #[test]
        fn any_numbers_keep_their_bits(values in prop::collection::vec(any::<f64>(), 50)) {
            let frames = [frame(|channel| values[channel])];
            let (encoding, bytes) = encode(&frames);
            prop_assert_eq!(bits(&decode(encoding, &bytes).unwrap()), bits(&frames));
        }
    }

    #[test]
    fn zeros_keep_their_sign_and_short_data_is_none() {
        let frames = [frame(|channel| if channel % 2 == 0 { -0.0 } else { 0.0 })];
        let (encoding, bytes) = encode(&frames);
        assert_eq!(encoding, Encoding::Decimal);
        assert_eq!(bits(&decode(encoding, &bytes).unwrap()), bits(&frames));
        assert!(decode(encoding, &bytes[1..]).is_none());
        assert_eq!(encode(&[frame(|_| 1.0 / 3.0)]).0, Encoding::Double);
    }
}
