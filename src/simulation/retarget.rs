//! Changes made to a motion before physics sees it; each is named, bounded and reported.
//!
//! - *sole levelling*: recorded feet stand with the heel two centimetres up, a matter of shoes and marker fit; ankle and toe
//!   angles get a constant offset per foot so that the median sole of flat stance is level, by a bounded amount, and where
//!   the two level soles then lie at different heights the pelvis is tilted by a constant, bounded angle under a trunk and
//!   over legs that keep their directions;
//! - *ground shift*: the whole motion is moved vertically so that the soles of stance meet the floor, by a bounded amount
//!   (an unbounded shift would hide floating);
//! - *feet to the floor*: a foot that rests is moved onto the floor by bending its leg, shift included by no more than the
//!   same bound;
//! - *jump filter*: joint angles that jump between two frames faster than a joint moves ([`crate::motion::filter_jumps`]);
//! - *limit clamp*: angles beyond the joint limits are cut, since the body cannot reach them;
//! - *swing lift*: recorded feet pass the floor by a few millimetres, and simulated ones then scuff and trip, so the
//!   swinging leg is bent a little more. Only the command is lifted; errors are measured against the unlifted motion.

use super::grounding::ground_feet;
use super::levelling::level_soles;
use super::sole::SoleTracks;
use super::{Event, EventKind, SimulationSettings};
use crate::humanoid::{Humanoid, Side};
use crate::motion::{Frame, JOINTS, Motion, MotionError, filter_jumps, joint_index};

/// A foot that clears the floor by this much needs no lift, metres.
const ENOUGH_CLEARANCE_M: f64 = 0.05;
/// Full lift: knee, hip and ankle angles added, radians.
const LIFT_RAD: [(&str, f64); 3] = [("Kx", -0.35), ("Hx", 0.175), ("Ax", 0.275)];
/// Half-width of the window that smooths the lift, seconds.
const LIFT_SMOOTHING_SECS: f64 = 0.06;

/// A motion made ready for physics.
pub(super) struct Retargeted {
    /// What errors are measured against.
    pub reference: Motion,
    /// What the springs are told.
    pub command: Motion,
    /// What was changed.
    pub events: Vec<Event>,
}

pub(super) fn retarget(
    humanoid: &Humanoid,
    motion: &Motion,
    settings: &SimulationSettings,
) -> Result<Retargeted, MotionError> {
    let mut events = Vec::new();
    let mut note =
        |message: String| events.push(Event { time_secs: 0.0, kind: EventKind::Retarget, message });

    let (smooth, jumps) = filter_jumps(motion);
    if let Some(largest) = jumps.iter().max_by(|a, b| a.size_rad.abs().total_cmp(&b.size_rad.abs())) {
        note(format!(
            "filtered {} jumps of a joint between two frames, the largest {:+.2} rad in {} at {:.2} s",
            jumps.len(),
            largest.size_rad,
            largest.joint_name(),
            largest.frame as f64 / motion.rate_hz()
        ));
    }

    let mut num_clamped = 0_usize;
    let clamped = smooth.map_frames(|_, frame| {
        for (angle, joint) in frame.joint_angles_rad.iter_mut().zip(&JOINTS) {
            let inside = angle.clamp(joint.lower_rad, joint.upper_rad);
            // The files print limits with six digits.
            num_clamped += usize::from((*angle - inside).abs() > 1e-4);
            *angle = inside;
        }
    })?;
    if num_clamped > 0 {
        let share = 100.0 * num_clamped as f64 / (motion.num_frames() * JOINTS.len()) as f64;
        note(format!("joint angles beyond their limits were cut, {share:.2} % of all"));
    }

    let levelled = if settings.sole_levelling { level_soles(humanoid, clamped, &mut note)? } else { clamped };
    let standing = SoleTracks::new(humanoid, &levelled).standing_height_m();
    let limit = settings.ground_correction_limit_m;
    let shift = (-standing.unwrap_or(0.0)).clamp(-limit, limit);
    let shifted = levelled.map_frames(|_, frame| frame.root_position_m[2] += shift)?;
    if let Some(standing) = standing.filter(|standing| limit > 0.0 && standing.abs() > 5e-5) {
        note(format!(
            "moved {:+.1} mm vertically, stance soles were at {:+.1} mm",
            shift * 1e3,
            standing * 1e3
        ));
    }

    let reference =
        if limit > 0.0 { ground_feet(humanoid, shifted, shift, limit, &mut note)? } else { shifted };

    let mut command = reference.clone();
    if settings.swing_lift {
        let soles = SoleTracks::new(humanoid, &reference);
        let mut longest: f64 = 0.0;
        for side in [Side::Left, Side::Right] {
            let lift = lift(&soles, side);
            longest = lift.iter().copied().fold(longest, f64::max);
            command = command.map_frames(|index, frame| raise(frame, side, lift[index]))?;
        }
        if longest > 0.0 {
            note(format!("swing feet lifted, at most {:.0} % of the full lift", longest * 100.0));
        }
    }
    Ok(Retargeted { reference, command, events })
}

fn raise(frame: &mut Frame, side: Side, lift: f64) {
    let prefix = if side == Side::Left { "L" } else { "R" };
    for (suffix, full) in LIFT_RAD {
        if let Some(joint) = joint_index(&format!("{prefix}{suffix}")) {
            let limits = &JOINTS[joint];
            let angle = frame.joint_angles_rad[joint] + lift * full;
            frame.joint_angles_rad[joint] = angle.clamp(limits.lower_rad, limits.upper_rad);
        }
    }
}

/// Lift of one foot per frame, 0 to 1, smooth.
///
/// A foot swings while no point of it stands and the other foot does; in flight both legs keep their course.
fn lift(soles: &SoleTracks, side: Side) -> Vec<f64> {
    let (own, other) = if side == Side::Left { (0, 1) } else { (1, 0) };
    let raw: Vec<f64> = soles
        .feet
        .iter()
        .map(|feet| {
            let swinging = !feet[own].stands() && feet[other].stands();
            let missing = (ENOUGH_CLEARANCE_M - feet[own].lowest_m) / ENOUGH_CLEARANCE_M;
            if swinging { missing.clamp(0.0, 1.0) } else { 0.0 }
        })
        .collect();
    let reach = (LIFT_SMOOTHING_SECS / soles.interval_secs).round() as usize;
    moving_average(&moving_average(&raw, reach), reach)
}

/// Mean over `reach` values on either side, with the ends held.
pub(super) fn moving_average(values: &[f64], reach: usize) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|center| {
            let window = (0..=2 * reach).map(|step| values[(center + step).saturating_sub(reach).min(last)]);
            window.sum::<f64>() / (2 * reach + 1) as f64
        })
        .collect()
}
