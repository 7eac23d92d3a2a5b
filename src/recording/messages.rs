//! The ROS 2 messages of a recording, as CDR bytes.

use nalgebra::{Point3, Vector3};

use super::cdr::CdrWriter;
use super::frames::{FramePose, WORLD_FRAME, rounded_effort, rounded_pose};
use crate::motion::JOINTS;
use crate::simulation::{Contact, EventKind};

/// Time in nanoseconds since the Unix epoch.
pub(super) type Nanoseconds = u64;

/// `PointField::FLOAT32`.
const FLOAT32: u8 = 7;
/// Fields of a contact point, each a 32-bit float: position in the world, m, and magnitude of the force, N.
const CONTACT_FIELDS: [&str; 4] = ["x", "y", "z", "force"];

impl CdrWriter {
    fn stamp(&mut self, time: Nanoseconds) -> &mut Self {
        self.i32((time / 1_000_000_000) as i32).u32((time % 1_000_000_000) as u32)
    }

    fn header(&mut self, time: Nanoseconds, frame: &str) -> &mut Self {
        self.stamp(time).string(frame)
    }

    fn vector(&mut self, vector: &Vector3<f64>) -> &mut Self {
        self.f64(vector.x).f64(vector.y).f64(vector.z)
    }
}

pub(super) fn text(text: &str) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    cdr.string(text);
    cdr.into_bytes()
}

pub(super) fn transforms(time: Nanoseconds, poses: &[FramePose<'_>]) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    cdr.len(poses.len());
    for pose in poses {
        let rotation = &pose.parent_from_child.rotation;
        cdr.header(time, pose.parent).string(pose.child).vector(&pose.parent_from_child.translation.vector);
        cdr.f64(rotation.i).f64(rotation.j).f64(rotation.k).f64(rotation.w);
    }
    cdr.into_bytes()
}

/// Joint angles, and speeds and torques where they are known (empty slices where not), all in KIT order.
pub(super) fn joint_states(
    time: Nanoseconds,
    angles_rad: &[f64],
    speeds_rad_s: &[f64],
    torques_nm: &[f64],
) -> Vec<u8> {
    let rounded =
        |values: &[f64], round: fn(f64) -> f64| values.iter().map(|v| round(*v)).collect::<Vec<_>>();
    let mut cdr = CdrWriter::new();
    cdr.header(time, "").strings(JOINTS.iter().map(|joint| joint.name));
    cdr.f64s(&rounded(angles_rad, rounded_pose));
    cdr.f64s(&rounded(speeds_rad_s, rounded_effort)).f64s(&rounded(torques_nm, rounded_effort));
    cdr.into_bytes()
}

pub(super) fn contact_points(time: Nanoseconds, contacts: &[Contact]) -> Vec<u8> {
    let point_step = 4 * CONTACT_FIELDS.len();
    let mut cdr = CdrWriter::new();
    cdr.header(time, WORLD_FRAME).u32(1).u32(contacts.len() as u32).len(CONTACT_FIELDS.len());
    for (index, name) in CONTACT_FIELDS.iter().enumerate() {
        cdr.string(name).u32(4 * index as u32).u8(FLOAT32).u32(1);
    }
    let mut points = Vec::with_capacity(contacts.len() * point_step);
    for contact in contacts {
        let Point3 { coords: p } = contact.position_m;
        for value in [p.x, p.y, p.z, contact.force_n.norm()] {
            points.extend((value as f32).to_le_bytes());
        }
    }
    cdr.bool(false).u32(point_step as u32).u32(points.len() as u32).blob(&points).bool(true);
    cdr.into_bytes()
}

/// A force at the origin of `frame` and a moment about it, along the axes of `frame`.
pub(super) fn wrench(
    time: Nanoseconds,
    frame: &str,
    force_n: &Vector3<f64>,
    moment_nm: &Vector3<f64>,
) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    cdr.header(time, frame).vector(&force_n.map(rounded_effort)).vector(&moment_nm.map(rounded_effort));
    cdr.into_bytes()
}

pub(super) fn metrics(time: Nanoseconds, values: impl Iterator<Item = f64>) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    cdr.header(time, WORLD_FRAME);
    for value in values {
        cdr.f64(value);
    }
    cdr.into_bytes()
}

/// Severity of a log message, with the numbers of `rcl_interfaces/msg/Log`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Severity {
    Info = 20,
    Warn = 30,
    Error = 40,
}

impl From<EventKind> for Severity {
    fn from(kind: EventKind) -> Self {
        match kind {
            EventKind::Retarget => Self::Info,
            EventKind::Fall => Self::Warn,
            EventKind::Failure => Self::Error,
        }
    }
}

pub(super) fn log(time: Nanoseconds, severity: Severity, source: &str, message: &str) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    // File, function and line are for programs that log from their code; an event of a rollout has none.
    cdr.stamp(time).u8(severity as u8).string(source).string(message).string("").string("").u32(0);
    cdr.into_bytes()
}
