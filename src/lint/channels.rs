//! Checks of the 50 channels by themselves.

use super::finding::{CONSTANT, Finding, JUMP, LIMIT, SAMPLING, Severity, UNITS_ANGLE, UNITS_LENGTH};
use crate::motion::{JOINTS, Motion, NUM_JOINTS, ROOT_CHANNEL_NAMES, find_jumps};

/// Excess over a limit that is rounding or a fit's tolerance, radians (1 degree).
const LIMIT_TOLERANCE_RAD: f64 = 0.0175;

/// Beyond this a joint angle is no angle of a body in radians: the widest range of any joint is 4.54.
const NO_ANGLE_RAD: f64 = 6.3;

/// Root speed no person reaches, metres per second; sprinters reach 12.4.
const MAX_ROOT_SPEED_M_S: f64 = 14.0;

/// Root turning speed no person reaches, radians per second; figure skaters reach about 36.
const MAX_ROOT_TURN_RAD_S: f64 = 40.0;

/// Frames repeated for longer than this are a gap that was filled, seconds.
const MAX_HELD_SECS: f64 = 0.05;

/// Joints whose constancy matters: hips, knees, shoulders and elbows about their main axes.
const MAIN_JOINTS: [&str; 8] = ["LHx", "RHx", "LKx", "RKx", "LSx", "RSx", "LEx", "REx"];

pub(super) fn check(motion: &Motion, findings: &mut Vec<Finding>) {
    let degrees = check_units(motion, findings);
    // In degrees every angle is beyond its limit and jumps; saying so once is enough.
    if !degrees {
        check_limits(motion, findings);
        check_jumps(motion, findings);
    }
    let moves = check_held(motion, findings);
    if moves {
        check_constant(motion, findings);
    }
}

fn check_units(motion: &Motion, findings: &mut Vec<Finding>) -> bool {
    let count = motion
        .frames()
        .iter()
        .filter(|frame| frame.joint_angles_rad.iter().any(|angle| angle.abs() > NO_ANGLE_RAD))
        .count();
    let degrees = 4 * count > motion.num_frames();
    if degrees {
        let message =
            format!("{count} of {} frames have joint angles beyond a full turn", motion.num_frames());
        findings.push(UNITS_ANGLE.found(Severity::Error, "joint angles", message));
    }

    let height_m = motion.body().height_m;
    let mut heights: Vec<f64> = motion.frames().iter().map(|frame| frame.root_position_m[2]).collect();
    let middle_m = median(&mut heights);
    let reach = |axis: usize| {
        motion.frames().iter().map(|frame| frame.root_position_m[axis].abs()).fold(0.0, f64::max)
    };
    if middle_m > 8.0 * height_m {
        let message = format!("the root is {middle_m:.1} m high for a body of {height_m:.2} m");
        findings.push(UNITS_LENGTH.found(Severity::Error, "root z", message));
    } else if middle_m > 0.0 && reach(0).max(reach(1)).max(reach(2)) < 0.02 * height_m {
        let message = format!(
            "the root stays within {:.1} mm of the origin; a standing one is {:.2} m high",
            1e3 * middle_m,
            0.53 * height_m
        );
        findings.push(UNITS_LENGTH.found(Severity::Error, "root position", message));
    }
    degrees
}

fn check_limits(motion: &Motion, findings: &mut Vec<Finding>) {
    let mut worst: Vec<(f64, String, String)> = Vec::new();
    for (joint, info) in JOINTS.iter().enumerate() {
        let excess = |angle: f64| (info.lower_rad - angle).max(angle - info.upper_rad);
        let mut count = 0;
        let (mut worst_frame, mut worst_excess) = (0, 0.0);
        for (index, frame) in motion.frames().iter().enumerate() {
            let excess = excess(frame.joint_angles_rad[joint]);
            count += usize::from(excess > LIMIT_TOLERANCE_RAD);
            if excess > worst_excess {
                (worst_frame, worst_excess) = (index, excess);
            }
        }
        if count > 0 {
            let message = format!(
                "{count} of {} frames are outside {:.1} to {:.1} degrees, at most by {:.1}",
                motion.num_frames(),
                info.lower_rad.to_degrees(),
                info.upper_rad.to_degrees(),
                worst_excess.to_degrees()
            );
            worst.push((worst_excess, format!("{}, frame {worst_frame}", info.short_name()), message));
        }
    }
    for (_, place, message) in worst {
        findings.push(LIMIT.found(Severity::Warning, place, message));
    }
}

fn check_jumps(motion: &Motion, findings: &mut Vec<Finding>) {
    let jumps = find_jumps(motion);
    if let Some(largest) = jumps.iter().max_by(|a, b| a.size_rad.abs().total_cmp(&b.size_rad.abs())) {
        let message = format!(
            "{} of the joints, the largest by {:.0} degrees in one frame",
            jumps.len(),
            largest.size_rad.to_degrees()
        );
        let place = format!("{}, frame {}", largest.joint_name(), largest.frame);
        findings.push(JUMP.found(Severity::Warning, place, message));
    }
    let rate_hz = motion.rate_hz();
    for (index, pair) in motion.frames().windows(2).enumerate() {
        let moved_m = (0..3)
            .map(|axis| (pair[1].root_position_m[axis] - pair[0].root_position_m[axis]).powi(2))
            .sum::<f64>()
            .sqrt();
        let same = pair[0].root_rotation_rad == pair[1].root_rotation_rad;
        let turned_rad = if same {
            0.0
        } else {
            pair[0].world_from_root_rotation().angle_to(&pair[1].world_from_root_rotation())
        };
        let message = if moved_m * rate_hz > MAX_ROOT_SPEED_M_S {
            format!("the root moves {moved_m:.2} m in one frame, {:.0} m/s", moved_m * rate_hz)
        } else if turned_rad * rate_hz > MAX_ROOT_TURN_RAD_S {
            format!("the root turns {:.0} degrees in one frame", turned_rad.to_degrees())
        } else {
            continue;
        };
        findings.push(JUMP.found(Severity::Warning, format!("root, frame {}", index + 1), message));
        return;
    }
}

/// Whether the motion moves at all.
fn check_held(motion: &Motion, findings: &mut Vec<Finding>) -> bool {
    let frames = motion.frames();
    let (mut start, mut longest) = (0, (0, 0));
    for index in 1..=frames.len() {
        if index == frames.len() || frames[index] != frames[start] {
            if index - start > longest.1 {
                longest = (start, index - start);
            }
            start = index;
        }
    }
    let (start, length) = longest;
    if length == frames.len() {
        if length > 1 {
            findings.push(SAMPLING.found(Severity::Warning, "", "all frames are equal: nothing moves"));
        }
        return false;
    }
    let held_secs = (length - 1) as f64 / motion.rate_hz();
    if length > 2 && held_secs > MAX_HELD_SECS {
        let message =
            format!("{length} equal frames in a row, {held_secs:.2} s: a gap that was filled, or a still");
        findings.push(SAMPLING.found(
            Severity::Warning,
            format!("frames {start} to {}", start + length - 1),
            message,
        ));
    }
    true
}

fn check_constant(motion: &Motion, findings: &mut Vec<Finding>) {
    let first = motion.frames()[0].to_channels();
    let mut constant = [true; NUM_JOINTS + 6];
    for frame in motion.frames() {
        for (constant, (value, first)) in constant.iter_mut().zip(frame.to_channels().iter().zip(&first)) {
            *constant &= value == first;
        }
    }
    let names: Vec<&str> = (0..constant.len())
        .filter(|channel| constant[*channel])
        .map(|channel| match JOINTS.get(channel) {
            Some(joint) => joint.short_name(),
            None => ROOT_CHANNEL_NAMES[channel - NUM_JOINTS],
        })
        .collect();
    if names.is_empty() {
        return;
    }
    let matters = names.iter().any(|name| MAIN_JOINTS.contains(name));
    let severity = if matters { Severity::Warning } else { Severity::Info };
    let message = format!("{} channels never change", names.len());
    findings.push(CONSTANT.found(severity, names.join(" "), message));
}

/// Sorts; 0 for nothing.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
