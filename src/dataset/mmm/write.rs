//! Motions as MMM XML in the legacy layout of the KIT-ML archive.

use std::fmt::Write as _;

use crate::motion::{JOINTS, Motion};

const MILLIMETRES_PER_METRE: f64 = 1e3;

/// Significant digits of every number; KIT's own files have six.
const SIGNIFICANT_DIGITS: i32 = 8;

/// Smallest decimal place written; a nanoradian or a picometre is nothing.
const MAX_DECIMALS: i32 = 10;

/// The motion as an MMM file that [`super::read_mmm`] reads back.
///
/// Numbers have eight significant digits.
/// A body of exactly [`super::PLACEHOLDER_MASS_KG`] reads back with its default mass, as KIT's files do.
#[must_use]
pub fn write_mmm(motion: &Motion, name: &str) -> String {
    let body = motion.body();
    let mut xml = String::with_capacity(4096 + motion.num_frames() * 720);
    xml.push_str("<?xml version='1.0'?>\n<MMM>\n");
    // An apostrophe ends the attribute, so it is escaped like the markup characters.
    let _ = writeln!(xml, "\t<Motion name='{}'>", quick_xml::escape::escape(name));
    xml.push_str("\t\t<Model>\n\t\t\t<File>mmm.xml</File>\n\t\t</Model>\n");
    xml.push_str("\t\t<ModelProcessorConfig type='Winter'>\n\t\t\t<Height>");
    push_number(&mut xml, body.height_m);
    xml.push_str("</Height>\n\t\t\t<Mass>");
    push_number(&mut xml, body.mass_kg);
    xml.push_str("</Mass>\n\t\t</ModelProcessorConfig>\n\t\t<JointOrder>\n");
    for joint in &JOINTS {
        let _ = writeln!(xml, "\t\t\t<Joint name='{}'/>", joint.name);
    }
    xml.push_str("\t\t</JointOrder>\n\t\t<MotionFrames>\n");
    for (index, frame) in motion.frames().iter().enumerate() {
        xml.push_str("\t\t\t<MotionFrame>\n");
        push_element(&mut xml, "Timestep", &[index as f64 / motion.rate_hz()]);
        push_element(&mut xml, "RootPosition", &frame.root_position_m.map(|x| x * MILLIMETRES_PER_METRE));
        push_element(&mut xml, "RootRotation", &frame.root_rotation_rad);
        push_element(&mut xml, "JointPosition", &frame.joint_angles_rad);
        xml.push_str("\t\t\t</MotionFrame>\n");
    }
    xml.push_str("\t\t</MotionFrames>\n\t</Motion>\n</MMM>\n");
    xml
}

fn push_element(xml: &mut String, name: &str, values: &[f64]) {
    let _ = write!(xml, "\t\t\t\t<{name}>");
    for (index, value) in values.iter().enumerate() {
        if index > 0 {
            xml.push(' ');
        }
        push_number(xml, *value);
    }
    let _ = writeln!(xml, "</{name}>");
}

/// A finite number without exponent and without trailing zeros.
fn push_number(xml: &mut String, value: f64) {
    let magnitude = value.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
    let decimals = (SIGNIFICANT_DIGITS - 1 - magnitude).clamp(0, MAX_DECIMALS) as usize;
    let start = xml.len();
    let _ = write!(xml, "{value:.decimals$}");
    if decimals > 0 {
        let kept = xml[start..].trim_end_matches('0').trim_end_matches('.').len();
        xml.truncate(start + kept);
    }
    if &xml[start..] == "-0" {
        xml.truncate(start);
        xml.push('0');
    }
}

#[cfg(test)]
mod tests {
    use super::super::read_mmm;
    use super::*;
    use crate::motion::{Body, Frame};
    use proptest::prelude::*;

    fn number(value: f64) -> String {
        let mut text = String::new();
        push_number(&mut text, value);
        text
    }

    #[test]
    fn numbers_are_short_and_exact_to_eight_digits() {
        assert_eq!(number(0.0), "0");
        assert_eq!(number(-0.0), "0");
        assert_eq!(number(100.0), "100");
        assert_eq!(number(-1142.97), "-1142.97");
        assert_eq!(number(1.0 / 3.0), "0.33333333");
        assert_eq!(number(-0.000123456789), "-0.0001234568");
        assert_eq!(number(1e-15), "0");
        assert_eq!(number(123456789.0), "123456789");
    }

    #[test]
    fn name_and_body_survive() {
        let body = Body { height_m: 1.625, mass_kg: 61.5 };
        let motion = Motion::new(body, 30.0, vec![Frame::ZERO; 100]).unwrap();
        let name = "it's <1> & \"2\"";
        let read = read_mmm(write_mmm(&motion, name).as_bytes(), None).unwrap();
        assert_eq!((read.name.as_str(), read.motion.body(), read.motion.rate_hz()), (name, body, 30.0));
        assert_eq!(read.motion.num_frames(), 100);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(
            rate in prop::sample::select(vec![10.0, 12.5, 20.0, 24.0, 60.0, 100.0, 120.0]),
            channels in prop::collection::vec(-3.2_f64..3.2, 150),
        ) {
            let frames: Vec<Frame> = channels
                .chunks_exact(50)
                .map(|chunk| Frame::from_channels(chunk.try_into().unwrap()))
                .collect();
            let motion = Motion::new(Body::with_default_mass(1.8), rate, frames).unwrap();
            let read = read_mmm(write_mmm(&motion, "x").as_bytes(), None).unwrap().motion;
            prop_assert_eq!(read.num_frames(), 3);
            prop_assert!((read.rate_hz() - rate).abs() <= 1e-7 * rate);
            for (a, b) in motion.frames().iter().zip(read.frames()) {
                for (a, b) in a.to_channels().iter().zip(b.to_channels()) {
                    prop_assert!((a - b).abs() < 1e-7, "{} {}", a, b);
                }
            }
        }
    }
}
