//! Checks that need a body: which way is up, which side is left, where the floor is.

use nalgebra::Vector3;

use super::channels::median;
use super::finding::{AXES, Finding, GROUND, LEFT_RIGHT, Severity};
use crate::humanoid::{Humanoid, Side};
use crate::motion::{Frame, JOINTS, Motion, NUM_JOINTS, joint_index};

/// Poses looked at per second; more tell nothing new.
const POSES_PER_SEC: f64 = 20.0;

/// Soles that never come closer to the floor than this float, and never rise above minus this sink, metres.
///
/// Recorded KIT motions lie within about 30 mm.
const MAX_OFFSET_M: f64 = 0.06;

/// Mean excess over the limits that swapped sides explain, radians a frame.
const SWAPPED_EXCESS_RAD: f64 = 0.1;

pub(super) fn check(humanoid: &Humanoid, motion: &Motion, findings: &mut Vec<Finding>) {
    let stride = ((motion.rate_hz() / POSES_PER_SEC) as usize).max(1);
    let frames: Vec<&Frame> = motion.frames().iter().step_by(stride).collect();
    if lies_on_its_side(motion.body().height_m, &frames) {
        findings.push(AXES.found(
            Severity::Error,
            "root",
            "the body stands upright along y, as in data with y up",
        ));
        return;
    }
    let swapped = check_sides(&frames, findings);
    check_floor(humanoid, &frames, swapped, findings);
}

/// Upright along y at standing height over y, but not over z.
fn lies_on_its_side(height_m: f64, frames: &[&Frame]) -> bool {
    let middle = |value: &dyn Fn(&Frame) -> f64| {
        let mut values: Vec<f64> = frames.iter().map(|frame| value(frame)).collect();
        median(&mut values)
    };
    let standing = 0.35 * height_m..0.7 * height_m;
    let up = |frame: &Frame| frame.world_from_root_rotation() * Vector3::z();
    standing.contains(&middle(&|frame| frame.root_position_m[1]))
        && !standing.contains(&middle(&|frame| frame.root_position_m[2]))
        && middle(&|frame| up(frame).y) > 0.7
}

/// Whether the columns of left and right are swapped.
fn check_sides(frames: &[&Frame], findings: &mut Vec<Finding>) -> bool {
    let excess = |angles: &[f64; NUM_JOINTS]| -> f64 {
        let excess = |(angle, joint): (&f64, &crate::motion::JointInfo)| {
            (joint.lower_rad - angle).max(angle - joint.upper_rad).max(0.0)
        };
        angles.iter().zip(&JOINTS).map(excess).sum()
    };
    let count = frames.len() as f64;
    let as_is = frames.iter().map(|frame| excess(&frame.joint_angles_rad)).sum::<f64>() / count;
    let other = frames.iter().map(|frame| excess(&swapped(&frame.joint_angles_rad))).sum::<f64>() / count;
    let found = as_is > SWAPPED_EXCESS_RAD && other < 0.25 * as_is;
    if found {
        let message = format!(
            "joints are beyond their limits by {:.0} degrees a frame, with left and right exchanged by {:.0}",
            as_is.to_degrees(),
            other.to_degrees()
        );
        findings.push(LEFT_RIGHT.found(Severity::Error, "left and right joints", message));
    }
    found
}

/// The angles with the columns of left and right exchanged.
fn swapped(angles: &[f64; NUM_JOINTS]) -> [f64; NUM_JOINTS] {
    std::array::from_fn(|joint| {
        let name = JOINTS[joint].name;
        let other = match name.split_at(1) {
            ("L", rest) => joint_index(&format!("R{rest}")),
            ("R", rest) => joint_index(&format!("L{rest}")),
            _ => None,
        };
        angles[other.unwrap_or(joint)]
    })
}

fn check_floor(humanoid: &Humanoid, frames: &[&Frame], swapped: bool, findings: &mut Vec<Finding>) {
    let (mut lowest, mut crossed, mut apart) = (Vec::new(), 0, Vec::new());
    for frame in frames {
        let poses = humanoid.forward(frame);
        let points: Vec<_> = humanoid
            .sole_points
            .iter()
            .map(|point| (point.side, poses[point.link] * point.point_in_link_m))
            .collect();
        lowest.push(points.iter().map(|(_, point)| point.z).fold(f64::INFINITY, f64::min));
        let center = |side: Side| {
            let of_side: Vec<_> = points.iter().filter(|(s, _)| *s == side).map(|(_, p)| p.coords).collect();
            of_side.iter().sum::<Vector3<f64>>() / of_side.len().max(1) as f64
        };
        let right = frame.world_from_root_rotation() * Vector3::x();
        let distance = (center(Side::Right) - center(Side::Left)).dot(&right);
        crossed += usize::from(distance < 0.0);
        apart.push(distance);
    }
    if !swapped && 10 * crossed > 7 * frames.len() && median(&mut apart) < -0.02 * humanoid.body.height_m {
        let message =
            format!("the left foot is to the right of the right one in {crossed} of {} poses", frames.len());
        findings.push(LEFT_RIGHT.found(Severity::Warning, "feet", message));
    }
    lowest.sort_by(f64::total_cmp);
    // The lower end, since jumps lift the soles and noise alone reaches below.
    let floor_m = lowest[lowest.len() / 10];
    if floor_m.abs() > MAX_OFFSET_M {
        let what = if floor_m > 0.0 { "above" } else { "below" };
        let message = format!("the soles stay {:.0} mm {what} the floor", 1e3 * floor_m.abs());
        findings.push(GROUND.found(Severity::Warning, "root z", message));
    }
}
