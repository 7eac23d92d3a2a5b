//! Brings feet that stand onto the floor, one by one, by bending the legs.
//!
//! A recording's foot is not ours: one that rests moves up and down by a centimetre, and one on its toes may hang three
//! centimetres in the air. A simulated foot then carries nothing, or pushes into the floor.
//! The pelvis and everything above keep their course, soles their direction.

use nalgebra::{UnitQuaternion, Vector3};

use super::chain::{Chain, chains};
use super::sole::SoleTracks;
use crate::humanoid::Humanoid;
use crate::motion::{Frame, JOINTS, Motion, MotionError};

/// Half of the time over which the height of a resting foot is taken, seconds: its median, so that lifting and landing,
/// which are slow for a moment too, do not count.
const HALF_WINDOW_SECS: f64 = 0.25;
/// Time over which a correction fades before and after, seconds.
const FADE_SECS: f64 = 0.1;
/// Half-width of the window that smooths the correction, seconds.
const SMOOTHING_SECS: f64 = 0.03;
/// Corrections none of which is larger than this are left out, metres.
const NEGLIGIBLE_M: f64 = 0.002;
/// Height within which a foot of a body that steps is left as it is, metres: mending it would jerk more than it helps.
const STEPPING_TOLERANCE_M: f64 = 0.01;
/// Height from which on a foot of a body that does not step is held up while the other carries, metres.
const HELD_UP_M: f64 = 0.01;
/// Height, as a multiple of the largest correction, from which on a foot at rest does not stand on the floor.
const TOO_FAR: f64 = 1.5;
/// Steps in which the knee is found, and the largest of them, radians.
const NUM_STEPS: usize = 8;
const LARGEST_STEP_RAD: f64 = 0.2;

/// Moves standing feet vertically onto the floor; together with `shift_m`, by which the motion was moved before, by at
/// most `limit_m`.
pub(super) fn ground_feet(
    humanoid: &Humanoid,
    mut motion: Motion,
    shift_m: f64,
    limit_m: f64,
    note: &mut impl FnMut(String),
) -> Result<Motion, MotionError> {
    // Without chains the body cannot be simulated either, which is told elsewhere.
    let Ok(chains) = chains(humanoid) else { return Ok(motion) };
    let soles = SoleTracks::new(humanoid, &motion);
    let still = soles.stand_still();
    let lifts = [0, 1].map(|foot| lift_m(&soles, foot, still, shift_m, limit_m));
    let largest = lifts.iter().flatten().fold(0.0_f64, |largest, lift| largest.max(lift.abs()));
    if largest < NEGLIGIBLE_M {
        return Ok(motion);
    }
    for (prefix, lift) in ["left", "right"].into_iter().zip(&lifts) {
        if let Some(leg) = Leg::new(humanoid, &chains, prefix) {
            motion = motion.map_frames(|index, frame| leg.lift(frame, lift[index]))?;
        }
    }
    note(format!("brought standing feet onto the floor one by one, by at most {:.1} mm", largest * 1e3));
    Ok(motion)
}

/// Vertical correction of one foot by frame, metres; `still`: both feet rest all the time.
fn lift_m(soles: &SoleTracks, foot: usize, still: bool, shift_m: f64, limit_m: f64) -> Vec<f64> {
    let tolerance_m = if still { 0.0 } else { STEPPING_TOLERANCE_M };
    let count = soles.feet.len();
    let frames = |secs: f64| (secs / soles.interval_secs).round() as usize;
    let stands = |frame: usize| {
        let [sole, other] = [foot, 1 - foot].map(|foot| &soles.feet[frame][foot]);
        // Of a body that does not step, a foot that hangs while the other carries is held up on purpose.
        let carries = !still || sole.lowest_m <= HELD_UP_M || other.lowest_m > HELD_UP_M;
        sole.stands() && carries && sole.lowest_m.abs() < TOO_FAR * limit_m
    };
    let mut wanted: Vec<Option<f64>> = vec![None; count];
    let mut start = 0;
    while start < count {
        let end = (start..count).find(|&frame| !stands(frame)).unwrap_or(count);
        for (frame, wanted) in wanted.iter_mut().enumerate().take(end).skip(start) {
            let reach = frames(HALF_WINDOW_SECS);
            let window = frame.saturating_sub(reach).max(start)..(frame + reach + 1).min(end);
            let mut heights: Vec<f64> = soles.feet[window].iter().map(|feet| feet[foot].lowest_m).collect();
            let middle = heights.len() / 2;
            let height = *heights.select_nth_unstable_by(middle, f64::total_cmp).1;
            let height = height - height.clamp(-tolerance_m, tolerance_m);
            *wanted = Some((shift_m - height).clamp(-limit_m, limit_m) - shift_m);
        }
        start = end + 1;
    }
    let faded = fade(&wanted, frames(FADE_SECS).max(1));
    super::retarget::moving_average(&faded, frames(SMOOTHING_SECS))
}

/// What is wanted, and next to it the nearest wanted value on either side, less with every frame.
fn fade(wanted: &[Option<f64>], reach: usize) -> Vec<f64> {
    let share = |far: usize| {
        let far = (far as f64 / reach as f64).min(1.0);
        1.0 - far * far * (3.0 - 2.0 * far)
    };
    let side = |frames: &mut dyn Iterator<Item = usize>| {
        let mut values = vec![0.0; wanted.len()];
        let mut last: Option<(usize, f64)> = None;
        for frame in frames {
            last = wanted[frame].map(|value| (frame, value)).or(last);
            values[frame] = last.map_or(0.0, |(other, value)| value * share(frame.abs_diff(other)));
        }
        values
    };
    let before = side(&mut (0..wanted.len()));
    let after = side(&mut (0..wanted.len()).rev());
    let both = before.into_iter().zip(after).zip(wanted);
    both.map(|((before, after), wanted)| wanted.unwrap_or(before + after)).collect()
}

/// Hip, knee and ankle of one side.
struct Leg<'a> {
    hip: &'a Chain,
    knee: &'a Chain,
    ankle: &'a Chain,
}

impl<'a> Leg<'a> {
    fn new(humanoid: &Humanoid, chains: &'a [Chain], prefix: &str) -> Option<Self> {
        let link = humanoid.robot.tree.link_index(&format!("{prefix}_foot"))?;
        let segment = humanoid.segment_links.iter().position(|&other| other == link)?;
        let above = |segment: usize| chains.iter().find(|chain| chain.segment == segment);
        let ankle = above(segment)?;
        let knee = above(ankle.parent_segment)?;
        let hip = above(knee.parent_segment)?;
        (hip.parent_segment == 0 && knee.axes.len() == 1).then_some(Self { hip, knee, ankle })
    }

    /// Moves the ankle up by this much in the world, as far as the leg reaches; the foot keeps its direction.
    fn lift(&self, frame: &mut Frame, lift_m: f64) {
        if lift_m == 0.0 {
            return;
        }
        let mut angles = frame.joint_angles_rad;
        let turn = |chain: &Chain, angles: &[f64; JOINTS.len()]| {
            chain.parent_from_joint.rotation * chain.turn(angles, &[0.0; JOINTS.len()]).0
        };
        let root = frame.world_from_root_rotation();
        let (knee_m, ankle_m) =
            (self.knee.parent_from_joint.translation.vector, self.ankle.parent_from_joint.translation.vector);
        // In the pelvis' frame, from the hip.
        let thigh = turn(self.hip, &angles);
        let reach = |angles: &[f64; JOINTS.len()]| knee_m + turn(self.knee, angles) * ankle_m;
        let foot = thigh * turn(self.knee, &angles) * turn(self.ankle, &angles);
        let wanted = thigh * reach(&angles) + root.inverse() * Vector3::z() * lift_m;

        let axis = &self.knee.axes[0];
        let limits = &JOINTS[axis.kit];
        let knee_from_thigh = self.knee.parent_from_joint.rotation;
        for _ in 0..NUM_STEPS {
            // The distance from hip to ankle depends on the knee alone.
            let arm = turn(self.knee, &angles) * ankle_m;
            let leg = knee_m + arm;
            let excess = leg.norm_squared() - wanted.norm_squared();
            let slope = 2.0 * knee_m.dot(&(knee_from_thigh * axis.axis.into_inner()).cross(&arm));
            let step = -excess / if slope.abs() < 1e-6 { 1e-6 } else { slope };
            let angle = angles[axis.kit] + step.clamp(-LARGEST_STEP_RAD, LARGEST_STEP_RAD);
            angles[axis.kit] = angle.clamp(limits.lower_rad, limits.upper_rad);
        }
        let swing = UnitQuaternion::rotation_between(&(thigh * reach(&angles)), &wanted);
        let thigh = swing.unwrap_or_else(UnitQuaternion::identity) * thigh;
        self.hip.read_angles(&(self.hip.parent_from_joint.rotation.inverse() * thigh), &mut angles);
        let shank = turn(self.hip, &angles) * turn(self.knee, &angles);
        let joint_from_foot = (shank * self.ankle.parent_from_joint.rotation).inverse() * foot;
        self.ankle.read_angles(&joint_from_foot, &mut angles);
        for axis in [self.hip, self.knee, self.ankle].into_iter().flat_map(|chain| &chain.axes) {
            let limits = &JOINTS[axis.kit];
            frame.joint_angles_rad[axis.kit] = angles[axis.kit].clamp(limits.lower_rad, limits.upper_rad);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, joint_index};

    /// Stands with bent knees, the pelvis up and down by `sway_m`.
    fn standing(humanoid: &Humanoid, sway_m: f64) -> Motion {
        let mut frame = Frame::ZERO;
        for (joint, angle) in [("Kx", -0.4), ("Hx", 0.2), ("Ax", 0.2)] {
            for side in ["L", "R"] {
                frame.joint_angles_rad[joint_index(&format!("{side}{joint}")).unwrap()] = angle;
            }
        }
        frame.root_position_m[2] = humanoid.standing_root_height_m();
        let motion = Motion::new(humanoid.body, 100.0, vec![frame; 300]).unwrap();
        let height = SoleTracks::new(humanoid, &motion).standing_height_m().unwrap();
        motion
            .map_frames(|index, frame| {
                frame.root_position_m[2] += sway_m * (index as f64 / 40.0).sin() - height;
            })
            .unwrap()
    }

    #[test]
    fn feet_that_rest_come_to_the_floor_under_a_pelvis_that_stays() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let motion = standing(&humanoid, 0.012);
        let mut notes = Vec::new();
        let grounded =
            ground_feet(&humanoid, motion.clone(), 0.0, 0.03, &mut |note| notes.push(note)).unwrap();
        assert_eq!(notes.len(), 1);
        let soles = SoleTracks::new(&humanoid, &grounded);
        // The window is cut at either end, so the median lags there.
        let middle = &soles.feet[25..275];
        let worst = middle.iter().flatten().fold(0.0_f64, |worst, sole| worst.max(sole.lowest_m.abs()));
        assert!(worst < 0.002, "{worst}");
        for (a, b) in motion.frames().iter().zip(grounded.frames()) {
            assert_eq!(a.root_position_m, b.root_position_m);
            let (before, after) = (humanoid.forward(a), humanoid.forward(b));
            let foot = humanoid.robot.tree.link_index("left_foot").unwrap();
            assert!(before[foot].rotation.angle_to(&after[foot].rotation) < 1e-6);
            let moved = after[foot].translation.vector - before[foot].translation.vector;
            assert!(moved.xy().norm() < 1e-4, "{moved}");
        }
    }

    #[test]
    fn level_feet_are_left_alone_and_floating_ones_come_down_by_the_limit_only() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let motion = standing(&humanoid, 0.0);
        let mut silent = |note: String| panic!("{note}");
        assert_eq!(ground_feet(&humanoid, motion.clone(), 0.0, 0.03, &mut silent).unwrap(), motion);
        // Moved down by the whole limit already and still 10 mm up: no more.
        let floating = motion.map_frames(|_, frame| frame.root_position_m[2] += 0.01).unwrap();
        assert_eq!(ground_feet(&humanoid, floating.clone(), -0.03, 0.03, &mut silent).unwrap(), floating);
    }
}
