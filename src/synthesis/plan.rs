//! From a plan (feet, posture, height and support over time) to frames that keep their balance.

use nalgebra::{Isometry3, Vector3};

use super::flight;
use super::foot::{Contact, FootPose, FootTrack};
use super::ground::{GRAVITY_M_S2, GroundReaction, LEAST_SUPPORT, balanced_path};
use super::leg::Leg;
use super::posture::Posture;
use super::track::Track;
use super::{Performance, RATE_HZ, SynthesisError};
use crate::humanoid::{Humanoid, Side};
use crate::motion::{Frame, JOINTS, Motion};

/// What the body shall do; the solver finds where the pelvis must be.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub duration_secs: f64,
    /// Left and right.
    pub feet: [FootTrack; 2],
    /// Rotation of the pelvis, trunk, neck and arms.
    pub posture: Posture,
    /// Height of the centre of mass, metres.
    pub com_height_m: Track,
    /// Wanted zero-moment point along x and y, metres.
    pub support_m: [Track; 2],
}

/// Passes over the whole motion; each corrects the path of the centre of mass for the angular momentum of the last.
const PASSES: usize = 8;
/// The search for the pelvis ends when the centre of mass is this close to its plan, metres.
const COM_TOLERANCE_M: f64 = 1e-9;
/// Most steps of the search for the pelvis in one frame; each leaves some 5 % of the error.
const PELVIS_STEPS: usize = 30;

impl Plan {
    /// Performs the plan.
    ///
    /// # Errors
    /// [`SynthesisError::OutOfReach`] or [`SynthesisError::JointLimit`] when the body cannot do it.
    pub fn perform(&self, humanoid: &Humanoid) -> Result<Performance, SynthesisError> {
        let legs = [Leg::new(humanoid, Side::Left)?, Leg::new(humanoid, Side::Right)?];
        let num_frames = (self.duration_secs * RATE_HZ).round() as usize + 1;
        let times: Vec<f64> = (0..num_frames).map(|frame| frame as f64 / RATE_HZ).collect();
        let feet: Vec<_> = times.iter().map(|&t| [self.feet[0].at(t), self.feet[1].at(t)]).collect();
        let height_m: Vec<f64> = times.iter().map(|&t| self.com_height_m.at(t)).collect();
        let specific_force = specific_force_m_s2(&height_m, &feet);
        let wanted: Vec<[f64; 2]> =
            times.iter().map(|&t| [self.support_m[0].at(t), self.support_m[1].at(t)]).collect();

        let mut frames: Vec<Frame> = times.iter().map(|&t| self.posture.frame(t)).collect();
        for (frame, height) in frames.iter_mut().zip(&height_m) {
            frame.root_position_m = [0.0, 0.0, *height - 0.05];
        }
        let pelvis_pitch_rad: Vec<f64> = frames.iter().map(|frame| frame.root_rotation_rad[0]).collect();
        let mut moment = vec![Vector3::<f64>::zeros(); num_frames];
        let unsupported = flight::unsupported(&specific_force);
        let mut tilt_rad = vec![0.0; num_frames];
        let mut poses = vec![Vec::new(); num_frames];
        let mut missing_m = vec![[0.0; 2]; num_frames];
        for _ in 0..PASSES {
            let path = |axis: usize| {
                let load: Vec<f64> = (0..num_frames)
                    .map(|i| {
                        let force = specific_force[i];
                        let moment = [moment[i].y, -moment[i].x][axis] / humanoid.body.mass_kg;
                        force * wanted[i][axis] + grip(force) * moment
                    })
                    .collect();
                let ends = [wanted[0][axis], wanted[num_frames - 1][axis]];
                balanced_path(&height_m, &specific_force, &load, ends, RATE_HZ)
            };
            let (x, y) = (path(0), path(1));
            let pitch_rate: Vec<f64> = moment.iter().map(|moment| moment.x).collect();
            tilt_rad = flight::tilt(&unsupported, &pitch_rate, &tilt_rad);
            for i in 0..num_frames {
                let com = Vector3::new(x[i], y[i], height_m[i]);
                frames[i].root_rotation_rad[0] = pelvis_pitch_rad[i] + tilt_rad[i];
                let ankles = [feet[i][0].world_from_foot, feet[i][1].world_from_foot];
                for (side, joint) in Posture::TOES.iter().enumerate() {
                    frames[i].joint_angles_rad[*joint] = feet[i][side].toe_rad;
                }
                missing_m[i] = place_pelvis(humanoid, &legs, &ankles, &com, &mut frames[i], &mut poses[i]);
            }
            moment = GroundReaction::of_poses(humanoid, &poses, RATE_HZ).angular_momentum_rate_nm;
        }

        for (i, missing) in missing_m.iter().enumerate() {
            for (side, &missing_m) in [Side::Left, Side::Right].into_iter().zip(missing) {
                if missing_m > 0.0 {
                    return Err(SynthesisError::OutOfReach { time_secs: times[i], side, missing_m });
                }
            }
            check_limits(times[i], &frames[i])?;
        }
        frames.iter_mut().for_each(round);
        let contacts = feet.iter().map(|pair| [pair[0].contact, pair[1].contact]).collect();
        Ok(Performance { motion: Motion::new(humanoid.body, RATE_HZ, frames)?, contacts })
    }
}

/// Ground force per mass that carries the centre of mass along these heights; zero in flight, m/s^2.
fn specific_force_m_s2(height_m: &[f64], feet: &[[FootPose; 2]]) -> Vec<f64> {
    let last = height_m.len() - 1;
    (0..=last)
        .map(|i| {
            if feet[i].iter().all(|foot| foot.contact == Contact::None) {
                return 0.0;
            }
            if i == 0 || i == last {
                return GRAVITY_M_S2;
            }
            let acceleration = (height_m[i + 1] - 2.0 * height_m[i] + height_m[i - 1]) * RATE_HZ * RATE_HZ;
            (acceleration + GRAVITY_M_S2).max(0.0)
        })
        .collect()
}

/// Share of the moment that the ground gives: where it bears little it can give none, so it fades out towards flight.
fn grip(specific_force_m_s2: f64) -> f64 {
    let share = (specific_force_m_s2 / (LEAST_SUPPORT * GRAVITY_M_S2)).min(1.0);
    share * share * (3.0 - 2.0 * share)
}

/// Moves the pelvis until the centre of mass is at `com` with the feet where they are; returns what each leg lacks.
fn place_pelvis(
    humanoid: &Humanoid,
    legs: &[Leg; 2],
    world_from_foot: &[Isometry3<f64>; 2],
    com: &Vector3<f64>,
    frame: &mut Frame,
    poses: &mut Vec<Isometry3<f64>>,
) -> [f64; 2] {
    let tree = &humanoid.robot.tree;
    let mut missing_m = [0.0; 2];
    for _ in 0..PELVIS_STEPS {
        let world_from_pelvis = frame.world_from_root();
        for side in 0..2 {
            missing_m[side] =
                legs[side].reach(&world_from_pelvis, &world_from_foot[side], &mut frame.joint_angles_rad);
        }
        tree.forward_into(&world_from_pelvis, &humanoid.tree_angles(&frame.joint_angles_rad), poses);
        let error = com - tree.center_of_mass(poses);
        if error.norm() < COM_TOLERANCE_M {
            break;
        }
        // The legs follow in part, so the centre of mass moves by about four fifths of what the pelvis does.
        for (position, error) in frame.root_position_m.iter_mut().zip(error.iter()) {
            *position += 1.2 * error;
        }
    }
    missing_m
}

/// Rounds to the digits a file keeps (a microradian, a micrometre), so that a motion equals what is stored of it.
fn round(frame: &mut Frame) {
    let channels = frame.to_channels().map(|value| (value * 1e6).round() / 1e6);
    *frame = Frame::from_channels(&channels);
}

fn check_limits(time_secs: f64, frame: &Frame) -> Result<(), SynthesisError> {
    for (joint, &found_rad) in JOINTS.iter().zip(&frame.joint_angles_rad) {
        if found_rad < joint.lower_rad || found_rad > joint.upper_rad {
            return Err(SynthesisError::JointLimit {
                joint: joint.short_name(),
                time_secs,
                found_rad,
                lower_rad: joint.lower_rad,
                upper_rad: joint.upper_rad,
            });
        }
    }
    Ok(())
}
