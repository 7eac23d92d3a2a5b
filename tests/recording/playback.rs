//! A rollout without a simulation: a choreographed motion, a body that follows it imperfectly, known contacts.

use nalgebra::{UnitQuaternion, Vector3};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, JOINTS, joint_index};
use rprae::simulation::{
    Contact, Event, EventKind, Level, Outcome, Rollout, RolloutSample, SegmentPoses, SimulationSettings,
};

/// Samples per second of the playback.
pub const RATE_HZ: f64 = 120.0;

pub fn adult() -> Humanoid {
    Humanoid::new(Body::with_default_mass(1.75)).unwrap()
}

/// A squat every two seconds with the arms swinging, while the root drifts forward and turns left.
fn commanded(humanoid: &Humanoid, time_secs: f64) -> Frame {
    let mut frame = Frame::ZERO;
    let phase = std::f64::consts::PI * time_secs;
    let bend = 0.4 * (1.0 - phase.cos());
    let mut set = |name: &str, angle: f64| {
        let index = joint_index(name).unwrap();
        frame.joint_angles_rad[index] = angle.clamp(JOINTS[index].lower_rad, JOINTS[index].upper_rad);
    };
    for side in ["L", "R"] {
        let sign = if side == "L" { 1.0 } else { -1.0 };
        set(&format!("{side}Hx"), bend);
        set(&format!("{side}Kx"), -2.0 * bend);
        set(&format!("{side}Ax"), bend);
        set(&format!("{side}Sx"), 0.8 * (phase * 2.0).sin() * sign + 0.3);
        set(&format!("{side}Sy"), sign * (0.4 + 0.2 * (phase * 1.3).sin()));
        set(&format!("{side}Ex"), 0.5 + 0.4 * (phase * 1.7).cos());
    }
    set("BTz", 0.3 * phase.sin());
    set("BUNz", -0.2 * phase.sin());
    // The hips come down by what bending thigh and shank of equal length by one angle takes away.
    let leg_m = 0.245 * humanoid.body.height_m;
    frame.root_position_m =
        [0.0, 0.2 * time_secs, humanoid.standing_root_height_m() - 2.0 * leg_m * (1.0 - bend.cos())];
    frame.root_rotation_rad = [0.0, 0.0, 0.1 * time_secs];
    frame
}

/// Where the body really is: a little late, a little off in every joint, 20 mm low.
fn performed(humanoid: &Humanoid, time_secs: f64) -> Frame {
    let mut frame = commanded(humanoid, (time_secs - 0.02).max(0.0));
    for (index, angle) in frame.joint_angles_rad.iter_mut().enumerate() {
        *angle += 0.03 * (time_secs * (3.0 + 0.17 * index as f64) + index as f64).sin();
    }
    frame.root_position_m[2] -= 0.02;
    frame
}

fn segments(humanoid: &Humanoid, frame: &Frame) -> SegmentPoses {
    let links = humanoid.forward(frame);
    humanoid.segment_links.map(|link| links[link])
}

pub fn sample(humanoid: &Humanoid, index: usize) -> RolloutSample {
    let time_secs = index as f64 / RATE_HZ;
    let (reference, actual) = (commanded(humanoid, time_secs), performed(humanoid, time_secs));
    let mut world_from_segment = segments(humanoid, &actual);
    for (segment, pose) in world_from_segment.iter_mut().enumerate().skip(1) {
        // Joints that drift apart by a fraction of a millimetre, and twist by less than a milliradian.
        let wobble = 0.0002 * (time_secs * 40.0 + segment as f64).sin();
        pose.translation.vector += Vector3::new(wobble, -wobble, 0.5 * wobble);
        pose.rotation *= UnitQuaternion::from_euler_angles(wobble, 2.0 * wobble, -wobble);
    }
    let later = performed(humanoid, time_secs + 1.0 / RATE_HZ);
    let joint_velocities_rad_s =
        std::array::from_fn(|j| (later.joint_angles_rad[j] - actual.joint_angles_rad[j]) * RATE_HZ);
    let weight_n = humanoid.body.mass_kg * 9.81;
    let links = humanoid.forward(&actual);
    let contacts = humanoid
        .sole_points
        .iter()
        .zip(humanoid.sole_points_in_world(&links))
        .filter(|_| index > 0)
        .map(|(point, position_m)| Contact {
            segment: humanoid.segment_links.iter().position(|&link| link == point.link).unwrap(),
            position_m,
            force_n: Vector3::new(3.0, -2.0, weight_n / humanoid.sole_points.len() as f64),
        })
        .collect();
    RolloutSample {
        time_secs,
        world_from_segment,
        reference_world_from_segment: segments(humanoid, &reference),
        joint_angles_rad: actual.joint_angles_rad,
        joint_velocities_rad_s,
        joint_torques_nm: std::array::from_fn(|j| 20.0 * (time_secs * 5.0 + j as f64).sin()),
        reference_joint_angles_rad: reference.joint_angles_rad,
        assist_force_n: Vector3::new(0.0, 10.0 * time_secs, 40.0),
        assist_moment_nm: Vector3::new(3.0, 4.0, 0.0),
        contacts,
    }
}

/// A playback of this many samples, with one event of each kind.
pub fn rollout(humanoid: &Humanoid, num_samples: usize) -> Rollout {
    let event = |time_secs, kind, message: &str| Event { time_secs, kind, message: message.to_owned() };
    Rollout {
        level: Level::L2,
        settings: SimulationSettings::default(),
        sample_interval_secs: 1.0 / RATE_HZ,
        motion_duration_secs: (num_samples - 1) as f64 / RATE_HZ,
        samples: (0..num_samples).map(|index| sample(humanoid, index)).collect(),
        events: vec![
            event(0.0, EventKind::Retarget, "the swing foot was lifted"),
            event(0.5, EventKind::Fall, "the left hand reached the ground"),
            event(0.75, EventKind::Failure, "a number was not finite"),
        ],
        max_joint_drift_m: 0.0003,
        outcome: Outcome::Completed,
    }
}
