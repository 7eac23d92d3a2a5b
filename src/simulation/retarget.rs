//! Changes made to a motion before physics sees it; each is named, bounded and reported.
//!
//! - *ground shift*: the whole motion is moved vertically so that the soles of stance meet the floor, by a bounded amount
//!   (an unbounded shift would hide floating);
//! - *limit clamp*: angles beyond the joint limits are cut, since the body cannot reach them;
//! - *swing lift*: recorded feet pass the floor by a few millimetres, and simulated ones then scuff and trip, so the
//!   swinging leg is bent a little more. Only the command is lifted; errors are measured against the unlifted motion.

use nalgebra::Point3;

use super::{Event, EventKind, SimulationSettings};
use crate::humanoid::{Humanoid, Side};
use crate::motion::{Frame, JOINTS, Motion, MotionError, joint_index};

/// A sole point slower than this is taken to stand, m/s.
const STANCE_SPEED_M_S: f64 = 0.3;
/// Half the time over which sole speeds are measured, seconds.
const SPEED_HALF_WINDOW_SECS: f64 = 0.02;
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

    let mut num_clamped = 0_usize;
    let clamped = motion.clone().map_frames(|_, frame| {
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

    let soles = SoleTracks::new(humanoid, &clamped);
    let standing = soles.standing_height_m();
    let limit = settings.ground_correction_limit_m;
    let shift = (-standing.unwrap_or(0.0)).clamp(-limit, limit);
    let reference = clamped.map_frames(|_, frame| frame.root_position_m[2] += shift)?;
    if let Some(standing) = standing.filter(|_| limit > 0.0) {
        note(format!(
            "moved {:+.1} mm vertically, stance soles were at {:+.1} mm",
            shift * 1e3,
            standing * 1e3
        ));
    }

    let mut command = reference.clone();
    if settings.swing_lift {
        let mut longest: f64 = 0.0;
        for side in [Side::Left, Side::Right] {
            let lift = soles.lift(side, shift);
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

/// Heights and speeds of both soles over a motion.
struct SoleTracks {
    interval_secs: f64,
    /// Per frame and foot (left, right): speed of the slowest sole point, m/s, and height of the lowest, metres.
    feet: Vec<[(f64, f64); 2]>,
}

impl SoleTracks {
    fn new(humanoid: &Humanoid, motion: &Motion) -> Self {
        let points: Vec<Vec<Point3<f64>>> = motion
            .frames()
            .iter()
            .map(|frame| humanoid.sole_points_in_world(&humanoid.forward(frame)).collect())
            .collect();
        let reach = (SPEED_HALF_WINDOW_SECS * motion.rate_hz()).round().max(1.0) as usize;
        let last = points.len() - 1;
        let feet = (0..points.len())
            .map(|frame| {
                let (before, after) = (frame.saturating_sub(reach), (frame + reach).min(last));
                let elapsed = (after - before) as f64 / motion.rate_hz();
                [Side::Left, Side::Right].map(|side| {
                    let mut slowest = f64::INFINITY;
                    let mut lowest = f64::INFINITY;
                    for (index, point) in
                        humanoid.sole_points.iter().enumerate().filter(|(_, p)| p.side == side)
                    {
                        let moved = (points[after][index] - points[before][index]).norm();
                        slowest = slowest.min(if elapsed > 0.0 { moved / elapsed } else { 0.0 });
                        lowest = lowest.min(points[frame][index].z);
                        debug_assert_eq!(point.side, side);
                    }
                    (slowest, lowest)
                })
            })
            .collect();
        Self { interval_secs: 1.0 / motion.rate_hz(), feet }
    }

    /// Median height of the lowest sole point of standing feet; `None` when no foot ever stands.
    fn standing_height_m(&self) -> Option<f64> {
        let mut heights: Vec<f64> = self
            .feet
            .iter()
            .filter_map(|feet| {
                let standing = feet.iter().filter(|(speed, _)| *speed < STANCE_SPEED_M_S);
                standing.map(|(_, height)| *height).min_by(f64::total_cmp)
            })
            .collect();
        heights.sort_by(f64::total_cmp);
        heights.get(heights.len() / 2).copied()
    }

    /// Lift of one foot per frame, 0 to 1, smooth.
    ///
    /// A foot swings while no point of it stands and the other foot does; in flight both legs keep their course.
    fn lift(&self, side: Side, shift_m: f64) -> Vec<f64> {
        let (own, other) = if side == Side::Left { (0, 1) } else { (1, 0) };
        let raw: Vec<f64> = self
            .feet
            .iter()
            .map(|feet| {
                let swinging = feet[own].0 >= STANCE_SPEED_M_S && feet[other].0 < STANCE_SPEED_M_S;
                let missing = (ENOUGH_CLEARANCE_M - (feet[own].1 + shift_m)) / ENOUGH_CLEARANCE_M;
                if swinging { missing.clamp(0.0, 1.0) } else { 0.0 }
            })
            .collect();
        let reach = (LIFT_SMOOTHING_SECS / self.interval_secs).round() as usize;
        moving_average(&moving_average(&raw, reach), reach)
    }
}

/// Mean over `reach` values on either side, with the ends held.
fn moving_average(values: &[f64], reach: usize) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|center| {
            let window = (0..=2 * reach).map(|step| values[(center + step).saturating_sub(reach).min(last)]);
            window.sum::<f64>() / (2 * reach + 1) as f64
        })
        .collect()
}
