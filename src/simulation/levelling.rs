//! Levels the soles of a motion that stands, and brings both onto one floor.
//!
//! Marker fit and shoes leave recorded soles pitched, rolled, and up to two centimetres apart in height.
//! A simulated foot then stands on an edge, and the assist has to hold what a flat foot would.

use nalgebra::{UnitQuaternion, Vector3};

use super::chain::{Chain, chains};
use super::sole::{Sole, SoleTracks};
use crate::humanoid::Humanoid;
use crate::motion::{JOINTS, Motion, MotionError, joint_index};

/// Largest slope of a standing sole that is taken for a fault of marker fit and shoes, radians.
const LARGEST_LEVELLING_RAD: f64 = 0.35;
/// Largest tilt of the pelvis that is taken for such a fault, radians.
const LARGEST_TILT_RAD: f64 = 0.1;
/// Difference in height of the two levelled soles from which on the pelvis is tilted, metres.
const SMALLEST_STEP_M: f64 = 0.001;
/// Largest difference that may be left, metres; a larger one says that the fit is off elsewhere.
const LARGEST_STEP_M: f64 = 0.005;

/// Levels the soles of a motion that stands, by constant offsets of ankle, midfoot and toe angles and a constant tilt of the pelvis.
///
/// A motion that steps keeps its ankles: turning them would make the heel of the swinging foot scuff.
/// So does one whose soles, once level, would not lie on one floor.
pub(super) fn level_soles(
    humanoid: &Humanoid,
    motion: Motion,
    note: &mut impl FnMut(String),
) -> Result<Motion, MotionError> {
    if !SoleTracks::new(humanoid, &motion).stand_still() {
        return Ok(motion);
    }
    let mut messages = Vec::new();
    let levelled = with_level_soles(humanoid, motion.clone(), &mut messages)?;
    let levelled = with_one_floor(humanoid, levelled, &mut messages)?;
    if step_m(humanoid, &levelled).is_some_and(|step| step.abs() > LARGEST_STEP_M) {
        return Ok(motion);
    }
    messages.into_iter().for_each(note);
    Ok(levelled)
}

/// Height of the right sole above the left one while they stand flat; `None` when one never does.
fn step_m(humanoid: &Humanoid, motion: &Motion) -> Option<f64> {
    let soles = SoleTracks::new(humanoid, motion);
    let height = |foot| soles.standing_median(foot, |sole: &Sole| sole.lowest_m);
    Some(height(1)? - height(0)?)
}

/// Tilts the pelvis about its forward axis until both soles lie on one floor.
fn with_one_floor(
    humanoid: &Humanoid,
    mut motion: Motion,
    messages: &mut Vec<String>,
) -> Result<Motion, MotionError> {
    // Without chains the body cannot be simulated either, which is told elsewhere.
    let Ok(chains) = chains(humanoid) else { return Ok(motion) };
    let on_pelvis: Vec<&Chain> = chains.iter().filter(|chain| chain.parent_segment == 0).collect();
    let places = || on_pelvis.iter().map(|chain| chain.parent_from_joint.translation.x);
    let hips_apart_m = places().fold(f64::MIN, f64::max) - places().fold(f64::MAX, f64::min);
    let before = step_m(humanoid, &motion).unwrap_or(0.0);
    let (mut step, mut tilt_rad) = (before, 0.0);
    for _ in 0..3 {
        if step.abs() < SMALLEST_STEP_M || hips_apart_m <= 0.0 {
            break;
        }
        // A positive turn about the forward axis lowers the right side.
        let wanted = tilt_rad + (step / hips_apart_m).clamp(-1.0, 1.0).asin();
        let bounded = wanted.clamp(-LARGEST_TILT_RAD, LARGEST_TILT_RAD);
        motion = tilted(motion, &on_pelvis, bounded - tilt_rad)?;
        tilt_rad = bounded;
        step = step_m(humanoid, &motion).unwrap_or(0.0);
    }
    if tilt_rad != 0.0 {
        messages.push(format!(
            "tilted the pelvis by {:+.1} deg, the level soles stood {:.1} mm apart in height, now {:.1} mm",
            tilt_rad.to_degrees(),
            before.abs() * 1e3,
            step.abs() * 1e3
        ));
    }
    Ok(motion)
}

/// The motion with its pelvis turned about its forward axis; everything that hangs on the pelvis keeps its direction.
fn tilted(motion: Motion, on_pelvis: &[&Chain], tilt_rad: f64) -> Result<Motion, MotionError> {
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), tilt_rad);
    motion.map_frames(|_, frame| {
        let (roll, pitch, yaw) = (frame.world_from_root_rotation() * tilt).euler_angles();
        frame.root_rotation_rad = [roll, pitch, yaw];
        let mut angles = frame.joint_angles_rad;
        for chain in on_pelvis {
            let (turn, _) = chain.turn(&frame.joint_angles_rad, &[0.0; JOINTS.len()]);
            let pelvis_from_joint = chain.parent_from_joint.rotation;
            let back = pelvis_from_joint.inverse() * tilt.inverse() * pelvis_from_joint;
            chain.read_angles(&(back * turn), &mut angles);
            for axis in &chain.axes {
                let limits = &JOINTS[axis.kit];
                frame.joint_angles_rad[axis.kit] = angles[axis.kit].clamp(limits.lower_rad, limits.upper_rad);
            }
        }
    })
}

fn with_level_soles(
    humanoid: &Humanoid,
    mut motion: Motion,
    messages: &mut Vec<String>,
) -> Result<Motion, MotionError> {
    for (foot, prefix) in ["L", "R"].into_iter().enumerate() {
        let joint = |suffix: &str| joint_index(&format!("{prefix}{suffix}"));
        let (Some(pitch), Some(roll), Some(midfoot), Some(toe)) =
            (joint("Ax"), joint("Ay"), joint("Mrot"), joint("Fx"))
        else {
            continue;
        };
        let mut sum = [0.0; 4];
        // The axes are not quite along the slopes, so a second round removes what the first one left.
        for _ in 0..2 {
            let soles = SoleTracks::new(humanoid, &motion);
            let slopes = [
                soles.standing_median(foot, |sole| sole.pitch_rad),
                soles.standing_median(foot, |sole| sole.roll_rad),
                soles.standing_median(foot, |sole| sole.ball_roll_rad - sole.roll_rad),
                soles.standing_median(foot, |sole| sole.toe_pitch_rad - sole.pitch_rad),
            ];
            let [Some(pitch_rad), Some(roll_rad), Some(twist_rad), Some(toe_rad)] = slopes else { break };
            // Positive x lifts the front, positive y lowers the right side.
            let wanted = [sum[0] - pitch_rad, sum[1] + roll_rad, sum[2] + twist_rad, sum[3] - toe_rad];
            let bounded = wanted.map(|offset| offset.clamp(-LARGEST_LEVELLING_RAD, LARGEST_LEVELLING_RAD));
            let change = [0, 1, 2, 3].map(|index| bounded[index] - sum[index]);
            sum = bounded;
            motion = motion.map_frames(|_, frame| {
                for (joint, offset) in [pitch, roll, midfoot, toe].into_iter().zip(change) {
                    let angle = frame.joint_angles_rad[joint] + offset;
                    frame.joint_angles_rad[joint] =
                        angle.clamp(JOINTS[joint].lower_rad, JOINTS[joint].upper_rad);
                }
            })?;
        }
        if sum.iter().any(|offset| offset.abs() > 1e-3) {
            let [pitch, roll, midfoot, toe] = sum.map(f64::to_degrees);
            let side = if foot == 0 { "left" } else { "right" };
            messages.push(format!(
                "levelled the {side} sole of stance: ankle {pitch:+.1} deg pitch, {roll:+.1} deg roll, \
                 midfoot {midfoot:+.1} deg, toes {toe:+.1} deg"
            ));
        }
    }
    Ok(motion)
}
