//! BVH: a hierarchy of joints with offsets and channels, then one row of numbers a frame.

use std::collections::BTreeSet;

use nalgebra::{UnitQuaternion, Vector3};

use super::clip::Values;
use super::words::{Word, Words};
use super::{Axis, Channel, Clip, Joint, MAX_FRAMES, MAX_JOINTS, MocapError, MocapFault};

/// Reads a BVH file; angles in it are degrees, its rate is one over the frame time.
///
/// A frame time such as 0.0083333 is a rounded one: the integer rate that rounds to it is taken where there is one.
///
/// # Errors
/// [`MocapError`] names the line and what is wrong there.
pub fn read_bvh(bytes: &[u8]) -> Result<Clip, MocapError> {
    let mut words = Words::new(bytes);
    words.keyword("HIERARCHY")?;
    let joints = read_hierarchy(&mut words)?;
    words.keyword("MOTION").map_err(|error| match &error.fault {
        MocapFault::Unexpected { found, .. } if found.eq_ignore_ascii_case("ROOT") => MocapError {
            fault: MocapFault::Unsupported { what: "a second ROOT (one body a file)".to_owned() },
            ..error
        },
        _ => error,
    })?;

    words.keyword("Frames:")?;
    let count = words.expect("the number of frames")?;
    let num_frames = count.count().ok_or_else(|| count.unexpected("the number of frames"))?;
    match num_frames {
        0 => return Err(count.unexpected("at least one frame")),
        1..=MAX_FRAMES => {}
        _ => return Err(count.error(MocapFault::TooMany { what: "frames", limit: MAX_FRAMES })),
    }
    words.keyword("Frame")?;
    words.keyword("Time:")?;
    let rate_hz = read_rate(words.expect("the frame time")?)?;

    let channels: Vec<Channel> = joints.iter().flat_map(|joint| joint.channels.clone()).collect();
    // A number takes at least two bytes, so what the header claims reserves no more than the file can hold.
    let expected = num_frames * channels.len();
    let mut values = Vec::with_capacity(expected.min(bytes.len() / 2 + 1));
    let counted = |found, line| MocapError {
        line,
        fault: MocapFault::NumberCount {
            what: format!("{num_frames} frames of {} channels", channels.len()),
            found,
            expected,
        },
    };
    while let Some(word) = words.next() {
        let value = word.number()?;
        if values.len() == expected {
            return Err(counted(expected + 1, word.line));
        }
        values.push(match channels[values.len() % channels.len()] {
            Channel::Position(_) => value,
            Channel::Rotation(_) => value.to_radians(),
        });
    }
    if values.len() < expected {
        return Err(counted(values.len(), words.line()));
    }
    Ok(Clip { joints, num_frames, rate_hz: Some(rate_hz), values: Values::Channels(values) })
}

fn read_rate(word: Word<'_>) -> Result<f64, MocapError> {
    let frame_secs = word.number()?;
    let error = |expected| word.error(MocapFault::Value { what: "frame time", found: frame_secs, expected });
    if !(1e-4..=10.0).contains(&frame_secs) {
        return Err(error("0.0001 to 10 seconds"));
    }
    let decimals =
        word.text.iter().rev().take_while(|&&byte| byte != b'.').take(15).fold(0, |count, _| count + 1);
    let half_step = 0.5 * 0.1_f64.powi(decimals);
    let nearest = (1.0 / frame_secs).round().max(1.0);
    Ok(if (1.0 / nearest - frame_secs).abs() <= 1.01 * half_step { nearest } else { 1.0 / frame_secs })
}

fn read_hierarchy(words: &mut Words<'_>) -> Result<Vec<Joint>, MocapError> {
    let mut joints: Vec<Joint> = Vec::new();
    let mut names = BTreeSet::new();
    // The open joints, outermost first: an explicit stack, so that a deep file cannot overflow ours.
    let mut open: Vec<usize> = Vec::new();
    words.keyword("ROOT")?;
    let name = read_name(words)?;
    push(&mut joints, &mut names, &mut open, name)?;
    while let Some(&current) = open.last() {
        let word = words.expect("OFFSET, CHANNELS, JOINT, End Site or }")?;
        if word.is("OFFSET") {
            joints[current].offset = Vector3::from(words.numbers("three offsets")?);
        } else if word.is("CHANNELS") {
            let channels = read_channels(words)?;
            if joints[current].name.ends_with(END) || !joints[current].channels.is_empty() {
                return Err(word.unexpected("one list of channels for each joint"));
            }
            joints[current].channels = channels;
        } else if word.is("JOINT") {
            let name = read_name(words)?;
            push(&mut joints, &mut names, &mut open, name)?;
        } else if word.is("End") {
            words.keyword("Site")?;
            let line = words.keyword("{")?.line;
            let name = format!("{}{END}", joints[current].name);
            push(&mut joints, &mut names, &mut open, (name, line))?;
        } else if word.is("}") {
            open.pop();
        } else {
            return Err(word.unexpected("OFFSET, CHANNELS, JOINT, End Site or }"));
        }
    }
    if joints.iter().all(|joint| joint.channels.is_empty()) {
        return Err(MocapError {
            line: words.line(),
            fault: MocapFault::Unsupported { what: "a skeleton without channels".to_owned() },
        });
    }
    Ok(joints)
}

/// What the end of the last bone of a limb is called after its joint.
const END: &str = "_end";

fn push(
    joints: &mut Vec<Joint>,
    names: &mut BTreeSet<String>,
    open: &mut Vec<usize>,
    (name, line): (String, usize),
) -> Result<(), MocapError> {
    let error = |fault| Err(MocapError { line, fault });
    if joints.len() == MAX_JOINTS {
        return error(MocapFault::TooMany { what: "joints", limit: MAX_JOINTS });
    }
    if !names.insert(name.clone()) {
        return error(MocapFault::DuplicateName { name });
    }
    open.push(joints.len());
    let parent = open.len().checked_sub(2).map(|above| open[above]);
    joints.push(Joint {
        name,
        parent,
        offset: Vector3::zeros(),
        axes: UnitQuaternion::identity(),
        channels: Vec::new(),
    });
    Ok(())
}

/// A name, which may have blanks in it, and the brace after it.
fn read_name(words: &mut Words<'_>) -> Result<(String, usize), MocapError> {
    let line = words.line();
    let mut parts = Vec::new();
    let mut rest = words.rest_of_line();
    while let Some(word) = rest.next() {
        if word.is("{") {
            return match (parts.is_empty(), rest.next()) {
                (false, None) => Ok((parts.join(" "), line)),
                _ => Err(word.unexpected("a name, then { and nothing after it on the line")),
            };
        }
        parts.push(word.shown());
    }
    let brace = words.keyword("{")?;
    if parts.is_empty() { Err(brace.unexpected("a name")) } else { Ok((parts.join(" "), line)) }
}

fn read_channels(words: &mut Words<'_>) -> Result<Vec<Channel>, MocapError> {
    let count = words.expect("the number of channels")?;
    let number = count.count().filter(|&number| number <= 6).ok_or_else(|| count.unexpected("0 to 6"))?;
    let mut channels = Vec::with_capacity(number);
    for _ in 0..number {
        let word = words.expect("a channel")?;
        let axis = match word.text.first().map(u8::to_ascii_uppercase) {
            Some(b'X') => Axis::X,
            Some(b'Y') => Axis::Y,
            Some(b'Z') => Axis::Z,
            _ => return Err(word.unexpected("Xposition, Xrotation or one of their kind")),
        };
        let channel = match word.text[1..].to_ascii_lowercase().as_slice() {
            b"position" => Channel::Position(axis),
            b"rotation" => Channel::Rotation(axis),
            _ => return Err(word.unexpected("Xposition, Xrotation or one of their kind")),
        };
        if channels.contains(&channel) {
            return Err(word.unexpected("each channel once"));
        }
        channels.push(channel);
    }
    Ok(channels)
}
