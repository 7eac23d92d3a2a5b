//! Numbers of one sample, plotted over time by a viewer.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Vector3};

use crate::humanoid::{Humanoid, NUM_SEGMENTS};
use crate::motion::NUM_JOINTS;
use crate::simulation::{GRAVITY_M_S2, RolloutSample};

/// A number of one sample: a field of the `/metrics` message.
#[derive(Debug, Clone, Copy)]
pub struct SampleMetric {
    /// Field name, ending in its unit.
    pub name: &'static str,
    /// What the number is, with unit and sign.
    pub meaning: &'static str,
    /// The number.
    pub(super) value: fn(&RolloutSample, &BodyScale) -> f64,
}

/// What the metrics need to know of the body.
#[derive(Debug, Clone)]
pub(super) struct BodyScale {
    weight_n: f64,
    /// Torque limits, KIT order, N m.
    effort_nm: [f64; NUM_JOINTS],
}

impl BodyScale {
    pub(super) fn new(humanoid: &Humanoid) -> Self {
        let mut effort_nm = [0.0; NUM_JOINTS];
        for (limits, &kit) in humanoid.robot.limits.iter().zip(humanoid.kit_of_angle()) {
            effort_nm[kit] = limits.effort_nm;
        }
        Self { weight_n: humanoid.robot.tree.total_mass_kg() * GRAVITY_M_S2, effort_nm }
    }
}

/// The fields of the `/metrics` message, in order.
pub const SAMPLE_METRICS: [SampleMetric; 14] = [
    SampleMetric {
        name: "mpjpe_world_mm",
        meaning: "mean distance of the segment origins from the reference in the world, mm",
        value: |sample, _| 1000.0 * sample.mean_distance_m(),
    },
    SampleMetric {
        name: "mpjpe_root_relative_mm",
        meaning: "the same after moving both roots to one place (positions only), mm",
        value: |sample, _| mean_root_relative_distance_mm(sample),
    },
    SampleMetric {
        name: "joint_rms_rad",
        meaning: "root mean square joint angle error over the 44 joints, differences taken to -pi..pi, rad",
        value: |sample, _| joint_rms_rad(sample),
    },
    SampleMetric {
        name: "root_position_error_m",
        meaning: "distance of the root from the reference, m",
        value: |sample, _| root_offset_m(sample).norm(),
    },
    SampleMetric {
        name: "root_height_error_m",
        meaning: "height of the root above the reference, m, positive: too high",
        value: |sample, _| root_offset_m(sample).z,
    },
    SampleMetric {
        name: "root_rotation_error_rad",
        meaning: "angle between the orientations of root and reference, rad",
        value: |sample, _| {
            let reference = &sample.reference_world_from_segment[0];
            sample.world_from_segment[0].rotation.angle_to(&reference.rotation)
        },
    },
    SampleMetric {
        name: "root_height_m",
        meaning: "height of the root above the floor, m",
        value: |sample, _| sample.world_from_segment[0].translation.z,
    },
    SampleMetric {
        name: "assist_force_n",
        meaning: "magnitude of the assist force at the root, mean over the interval, N",
        value: |sample, _| sample.assist_force_n.norm(),
    },
    SampleMetric {
        name: "assist_moment_nm",
        meaning: "magnitude of the assist moment at the root, mean over the interval, N m",
        value: |sample, _| sample.assist_moment_nm.norm(),
    },
    SampleMetric {
        name: "assist_force_body_weights",
        meaning: "the assist force as a share of body weight",
        value: |sample, body| sample.assist_force_n.norm() / body.weight_n,
    },
    SampleMetric {
        name: "ground_force_body_weights",
        meaning: "vertical force of the ground on the body as a share of body weight, positive: up",
        value: |sample, body| sample.ground_force_n().z / body.weight_n,
    },
    SampleMetric {
        name: "contact_count",
        meaning: "number of contact points with the ground during the interval",
        value: |sample, _| sample.contacts.len() as f64,
    },
    SampleMetric {
        name: "torque_share_max",
        meaning: "largest joint torque as a share of that joint's limit",
        value: torque_share_max,
    },
    SampleMetric {
        name: "joint_speed_max_rad_s",
        meaning: "largest joint speed, rad/s",
        value: |sample, _| {
            sample.joint_velocities_rad_s.iter().fold(0.0, |speed, joint| speed.max(joint.abs()))
        },
    },
];

fn position_m(pose: &Isometry3<f64>) -> Vector3<f64> {
    pose.translation.vector
}

/// From the root of the reference to the root, in the world.
fn root_offset_m(sample: &RolloutSample) -> Vector3<f64> {
    position_m(&sample.world_from_segment[0]) - position_m(&sample.reference_world_from_segment[0])
}

/// Mean distance of the segment origins from those of the reference moved by its root's error.
fn mean_root_relative_distance_mm(sample: &RolloutSample) -> f64 {
    let shift_m = root_offset_m(sample);
    let pairs = sample.world_from_segment.iter().zip(&sample.reference_world_from_segment);
    let sum_m: f64 = pairs
        .map(|(simulated, reference)| (position_m(simulated) - position_m(reference) - shift_m).norm())
        .sum();
    1000.0 * sum_m / NUM_SEGMENTS as f64
}

fn joint_rms_rad(sample: &RolloutSample) -> f64 {
    let pairs = sample.joint_angles_rad.iter().zip(&sample.reference_joint_angles_rad);
    let wrapped = |angle: f64| angle - TAU * (angle / TAU).round();
    let squares: f64 = pairs.map(|(simulated, reference)| wrapped(simulated - reference).powi(2)).sum();
    (squares / NUM_JOINTS as f64).sqrt()
}

fn torque_share_max(sample: &RolloutSample, body: &BodyScale) -> f64 {
    let pairs = sample.joint_torques_nm.iter().zip(&body.effort_nm);
    pairs
        .filter(|(_, effort)| **effort > 0.0)
        .map(|(torque, effort)| torque.abs() / effort)
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Body;
    use crate::simulation::Contact;
    use nalgebra::{Point3, UnitQuaternion};

    fn adult() -> Humanoid {
        Humanoid::new(Body { height_m: 1.7, mass_kg: 65.0 }).unwrap()
    }

    fn value_of(name: &str, sample: &RolloutSample) -> f64 {
        let humanoid = adult();
        let metric = SAMPLE_METRICS.iter().find(|metric| metric.name == name).unwrap();
        (metric.value)(sample, &BodyScale::new(&humanoid))
    }

    fn at_reference() -> RolloutSample {
        let poses: [Isometry3<f64>; NUM_SEGMENTS] =
            std::array::from_fn(|index| Isometry3::translation(0.1 * index as f64, 0.0, 1.0));
        RolloutSample {
            time_secs: 0.0,
            world_from_segment: poses,
            reference_world_from_segment: poses,
            joint_angles_rad: [0.1; NUM_JOINTS],
            joint_velocities_rad_s: [0.0; NUM_JOINTS],
            joint_torques_nm: [0.0; NUM_JOINTS],
            reference_joint_angles_rad: [0.1; NUM_JOINTS],
            assist_force_n: Vector3::zeros(),
            assist_moment_nm: Vector3::zeros(),
            contacts: Vec::new(),
        }
    }

    #[test]
    fn a_sample_on_its_reference_has_no_error_and_no_effort() {
        let sample = at_reference();
        for metric in SAMPLE_METRICS.iter().filter(|metric| metric.name != "root_height_m") {
            assert_eq!(value_of(metric.name, &sample), 0.0, "{}", metric.name);
        }
        assert_eq!(value_of("root_height_m", &sample), 1.0);
    }

    #[test]
    fn a_shifted_body_is_wrong_in_the_world_and_right_about_its_root() {
        let mut sample = at_reference();
        for pose in &mut sample.world_from_segment {
            pose.translation.vector += Vector3::new(0.0, 0.03, -0.04);
        }
        assert!((value_of("mpjpe_world_mm", &sample) - 50.0).abs() < 1e-9);
        assert!(value_of("mpjpe_root_relative_mm", &sample) < 1e-9);
        assert!((value_of("root_position_error_m", &sample) - 0.05).abs() < 1e-12);
        assert!((value_of("root_height_error_m", &sample) + 0.04).abs() < 1e-12);
    }

    #[test]
    fn a_root_alone_off_its_place_is_seen_by_every_segment_relative_to_it() {
        let mut sample = at_reference();
        sample.world_from_segment[0].translation.x += 0.021;
        sample.world_from_segment[0].rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5);
        assert!((value_of("mpjpe_world_mm", &sample) - 1.0).abs() < 1e-9);
        assert!((value_of("mpjpe_root_relative_mm", &sample) - 20.0).abs() < 1e-9);
        assert!((value_of("root_rotation_error_rad", &sample) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn efforts_are_shares_of_weight_and_limit() {
        let mut sample = at_reference();
        // A whole turn more is the same angle.
        sample.joint_angles_rad[3] += 0.44 + TAU;
        assert!((value_of("joint_rms_rad", &sample) - 0.44 / 44.0_f64.sqrt()).abs() < 1e-12);
        // The last joint of the tree at half its limit, under its KIT index.
        let humanoid = adult();
        let limit_nm = humanoid.robot.limits[NUM_JOINTS - 1].effort_nm;
        sample.joint_torques_nm[humanoid.kit_of_angle()[NUM_JOINTS - 1]] = -0.5 * limit_nm;
        assert!((value_of("torque_share_max", &sample) - 0.5).abs() < 1e-9);
        let force_n = Vector3::new(30.0, 0.0, 65.0 * 9.81 / 2.0);
        sample.contacts = vec![Contact { segment: 5, position_m: Point3::origin(), force_n }; 2];
        assert!((value_of("ground_force_body_weights", &sample) - 1.0).abs() < 1e-6);
        assert_eq!(value_of("contact_count", &sample), 2.0);
        sample.assist_force_n = Vector3::new(0.0, 0.0, 6.5 * 9.81);
        assert!((value_of("assist_force_body_weights", &sample) - 0.1).abs() < 1e-6);
    }
}
