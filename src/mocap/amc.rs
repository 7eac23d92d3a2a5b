//! AMC: the frames of an Acclaim recording.

use super::clip::Values;
use super::words::lines;
use super::{AsfSkeleton, Channel, Clip, MAX_FRAMES, MocapError, MocapFault};

/// Reads an AMC file for the bones of a skeleton; the format states no rate.
///
/// Angles are degrees unless the file says `:RADIANS`.
///
/// # Errors
/// [`MocapError`] names the line and what is wrong there.
pub fn read_amc(bytes: &[u8], skeleton: &AsfSkeleton) -> Result<Clip, MocapError> {
    // Where the channels of each joint begin among those of a frame.
    let mut starts = Vec::with_capacity(skeleton.joints.len());
    let mut num_channels = 0;
    for joint in &skeleton.joints {
        starts.push(num_channels);
        num_channels += joint.channels.len();
    }
    let mut values: Vec<f64> = Vec::new();
    let mut radians_per_angle = 1.0_f64.to_radians();
    let mut given = vec![true; skeleton.joints.len()];
    let (mut num_frames, mut last_line) = (0, 0);
    let check_complete = |given: &[bool], num_frames: usize, line| match given.iter().position(|given| !given)
    {
        Some(joint) => Err(MocapError {
            line,
            fault: MocapFault::MissingBone {
                frame: num_frames - 1,
                name: skeleton.joints[joint].name.clone(),
            },
        }),
        None => Ok(()),
    };
    for (line, mut words) in lines(bytes) {
        last_line = line;
        let Some(first) = words.next() else { continue };
        if first.text.starts_with(b":") {
            if first.is(":RADIANS") {
                radians_per_angle = 1.0;
            } else if first.is(":DEGREES") {
                radians_per_angle = 1.0_f64.to_radians();
            }
            continue;
        }
        let numbers_follow = first.text.first().is_some_and(u8::is_ascii_digit);
        if numbers_follow {
            // A frame number; its value says nothing, since files count from anywhere.
            first.count().ok_or_else(|| first.unexpected("a frame number"))?;
            check_complete(&given, num_frames, line)?;
            if num_frames == MAX_FRAMES {
                return Err(first.error(MocapFault::TooMany { what: "frames", limit: MAX_FRAMES }));
            }
            for (given, joint) in given.iter_mut().zip(&skeleton.joints) {
                *given = joint.channels.is_empty();
            }
            num_frames += 1;
            values.resize(num_frames * num_channels, 0.0);
            continue;
        }
        if num_frames == 0 {
            return Err(first.unexpected("a frame number"));
        }
        let name = first.shown();
        let Some(dofs) = skeleton.dofs.get(&name) else {
            return Err(first.error(MocapFault::UnknownBone { name }));
        };
        if std::mem::replace(&mut given[dofs.joint], true) {
            return Err(first.error(MocapFault::DuplicateName { name }));
        }
        let mut found = 0;
        let count = dofs.channels.len();
        let end = (num_frames - 1) * num_channels + starts[dofs.joint] + count;
        while let Some(word) = words.next() {
            let value = word.number()?;
            if let Some(channel) = dofs.channels.get(found) {
                // The joint applies its channels in the reverse of the file's order.
                values[end - 1 - found] = match channel {
                    Channel::Position(_) => value / skeleton.length_unit,
                    Channel::Rotation(_) => value * radians_per_angle,
                };
            }
            found += 1;
        }
        if found != count {
            return Err(first.error(MocapFault::NumberCount { what: name, found, expected: count }));
        }
    }
    if num_frames == 0 {
        return Err(MocapError {
            line: last_line.max(1),
            fault: MocapFault::Truncated { expected: "a frame".to_owned() },
        });
    }
    check_complete(&given, num_frames, last_line)?;
    Ok(Clip { joints: skeleton.joints.clone(), num_frames, rate_hz: None, values: Values::Channels(values) })
}
