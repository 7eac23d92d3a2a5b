//! Checks of the 50 channels by themselves.

use super::finding::{CONSTANT, Finding, JUMP, LIMIT, SAMPLING, Severity, UNITS_ANGLE, UNITS_LENGTH};
use crate::motion::{JOINTS, Motion, NUM_JOINTS, ROOT_CHANNEL_NAMES, find_jumps, joint_index};

/// Excess over a limit that is rounding or a fit's tolerance, radians (1 degree).
const LIMIT_TOLERANCE_RAD: f64 = 0.0175;

/// Beyond this a joint angle is no angle of a body in radians: the widest range of any joint is 4.54.
const NO_ANGLE_RAD: f64 = 6.3;

/// Root speed no person reaches, metres per second; sprinters reach 12.4.
const MAX_ROOT_SPEED_M_S: f64 = 14.0;

/// Root turning speed no person reaches, radians per second; figure skaters reach about 36.
const MAX_ROOT_TURN_RAD_S: f64 = 40.0;

/// Frames repeated for longer than this in the middle of a movement are a gap that was filled, seconds.
const MAX_HELD_SECS: f64 = 0.05;

/// Share of frames that may repeat the one before in the middle of a movement.
const MAX_HELD_SHARE: f64 = 0.05;

/// Speed of the fastest joint above which the body is in the middle of a movement, radians per second.
const MOVING_RAD_S: f64 = 0.5;

/// Path of the root that legs must have made, metres.
const TRAVEL_M: f64 = 0.5;

/// Range of a leg joint whose other side cannot be still, radians.
const LEG_RANGE_RAD: f64 = 0.3;

/// Hips, knees and ankles about their main axis, left and right.
const LEG_PAIRS: [[&str; 2]; 3] = [["LHx", "RHx"], ["LKx", "RKx"], ["LAx", "RAx"]];

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
///
/// Somebody who stands still repeats frames too, and so do made motions; a hold that begins and ends at speed does not
/// happen to a body.
fn check_held(motion: &Motion, findings: &mut Vec<Finding>) -> bool {
    let frames = motion.frames();
    if frames.iter().all(|frame| frame == &frames[0]) {
        if frames.len() > 1 {
            findings.push(SAMPLING.found(Severity::Warning, "", "all frames are equal: nothing moves"));
        }
        return false;
    }
    let moves = |from: usize| {
        let pair = frames.get(from..from + 2);
        pair.is_some_and(|pair| {
            let angles = pair[0].joint_angles_rad.iter().zip(&pair[1].joint_angles_rad);
            angles.map(|(a, b)| (b - a).abs()).fold(0.0, f64::max) * motion.rate_hz() > MOVING_RAD_S
        })
    };
    let (mut start, mut longest, mut num_held) = (0, (0, 0), 0);
    for index in 1..frames.len() {
        if frames[index] == frames[start] {
            continue;
        }
        let held = index - 1 - start;
        if held > 0 && start > 0 && moves(start - 1) && moves(index - 1) {
            num_held += held;
            if held > longest.1 {
                longest = (start, held);
            }
        }
        start = index;
    }
    let (first, held) = longest;
    let held_secs = held as f64 / motion.rate_hz();
    let place = format!("frames {first} to {}", first + held);
    if held > 1 && held_secs > MAX_HELD_SECS {
        let message = format!(
            "the body stops dead for {held_secs:.2} s in the middle of a movement: a gap that was filled"
        );
        findings.push(SAMPLING.found(Severity::Warning, place, message));
    } else if num_held as f64 > MAX_HELD_SHARE * frames.len() as f64 {
        let message = format!(
            "{num_held} of {} frames repeat the one before in the middle of a movement: the rate is lower than stated",
            frames.len()
        );
        findings.push(SAMPLING.found(Severity::Warning, place, message));
    }
    true
}

fn check_constant(motion: &Motion, findings: &mut Vec<Finding>) {
    let first = motion.frames()[0].to_channels();
    let (mut low, mut high) = (first, first);
    for frame in motion.frames() {
        for (channel, value) in frame.to_channels().into_iter().enumerate() {
            low[channel] = low[channel].min(value);
            high[channel] = high[channel].max(value);
        }
    }
    let range_of = |name: &str| joint_index(name).map_or(0.0, |joint| high[joint] - low[joint]);
    let path_m: f64 = motion
        .frames()
        .windows(2)
        .map(|pair| {
            let moved = |axis: usize| pair[1].root_position_m[axis] - pair[0].root_position_m[axis];
            moved(0).hypot(moved(1))
        })
        .sum();
    let legs_still = LEG_PAIRS.iter().flatten().all(|name| range_of(name) == 0.0);
    if legs_still && path_m > TRAVEL_M {
        let message = format!("the legs never move while the root travels {path_m:.1} m");
        findings.push(CONSTANT.found(Severity::Warning, "legs", message));
    }
    for pair in LEG_PAIRS {
        for [still, moving] in [pair, [pair[1], pair[0]]] {
            if range_of(still) == 0.0 && range_of(moving) > LEG_RANGE_RAD {
                let message = format!(
                    "it never changes while {moving} moves by {:.0} degrees",
                    range_of(moving).to_degrees()
                );
                findings.push(CONSTANT.found(Severity::Warning, still, message));
            }
        }
    }
    let names: Vec<&str> = (0..low.len())
        .filter(|channel| low[*channel] == high[*channel])
        .map(|channel| match JOINTS.get(channel) {
            Some(joint) => joint.short_name(),
            None => ROOT_CHANNEL_NAMES[channel - NUM_JOINTS],
        })
        .collect();
    if !names.is_empty() {
        let message = format!("{} channels never change", names.len());
        findings.push(CONSTANT.found(Severity::Info, names.join(" "), message));
    }
}

/// Sorts; 0 for nothing.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
