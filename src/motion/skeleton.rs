//! The 44 revolute joints of a KIT motion: names, axes, limits and file order.
//!
//! The order is the one KIT files list in `<JointOrder>`.
//! Limits are those of the MMM reference model in radians; over all of KIT-ML the recorded extremes meet them exactly.

/// Number of joint angles in a KIT motion.
pub const NUM_JOINTS: usize = 44;

/// Number of channels of a motion frame: 44 joint angles, root position (3), root rotation (3).
pub const NUM_CHANNELS: usize = NUM_JOINTS + 6;

/// Axis a joint turns about, in the frame of its parent segment (x right, y forward, z up).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Axis {
    /// Right: positive turns lift the front (y towards z).
    X,
    /// Forward: positive turns take z towards x.
    Y,
    /// Up: positive turns to the left (x towards y).
    Z,
}

/// One joint of the KIT order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointInfo {
    /// Name as KIT files spell it, for example `LKx_joint`.
    pub name: &'static str,
    /// Axis in the parent segment's frame.
    pub axis: Axis,
    /// Lower limit in radians.
    pub lower_rad: f64,
    /// Upper limit in radians.
    pub upper_rad: f64,
}

impl JointInfo {
    /// Name without the `_joint` suffix: `LKx`.
    #[must_use]
    pub fn short_name(&self) -> &'static str {
        self.name.trim_end_matches("_joint")
    }
}

const fn joint(name: &'static str, axis: Axis, lower_rad: f64, upper_rad: f64) -> JointInfo {
    JointInfo { name, axis, lower_rad, upper_rad }
}

/// The joint table in KIT order.
#[rustfmt::skip]
#[expect(clippy::approx_constant, reason = "the limits are the model's own six-digit numbers, some of which are multiples of pi")]
pub const JOINTS: [JointInfo; NUM_JOINTS] = [
    joint("BLNx_joint", Axis::X, -0.785398, 0.261799),
    joint("BLNy_joint", Axis::Y, -0.349066, 0.349066),
    joint("BLNz_joint", Axis::Z, -0.261799, 0.261799),
    joint("BPx_joint", Axis::X, -0.872665, 0.610865),
    joint("BPy_joint", Axis::Y, -0.349066, 0.349066),
    joint("BPz_joint", Axis::Z, -0.785398, 0.785398),
    joint("BTx_joint", Axis::X, -0.610865, 0.471239),
    joint("BTy_joint", Axis::Y, -0.349066, 0.349066),
    joint("BTz_joint", Axis::Z, -0.628319, 0.628319),
    joint("BUNx_joint", Axis::X, -0.349066, 0.523599),
    joint("BUNy_joint", Axis::Y, -0.261799, 0.261799),
    joint("BUNz_joint", Axis::Z, -0.349066, 0.349066),
    joint("LAx_joint", Axis::X, -0.698132, 0.523599),
    joint("LAy_joint", Axis::Y, -0.349066, 0.349066),
    joint("LAz_joint", Axis::Z, -0.523599, 0.523599),
    joint("LEx_joint", Axis::X, 0.0, 2.79253),
    joint("LEz_joint", Axis::Z, -1.5708, 1.5708),
    joint("LHx_joint", Axis::X, -0.872665, 1.65806),
    joint("LHy_joint", Axis::Y, -0.349066, 1.13446),
    joint("LHz_joint", Axis::Z, -0.785398, 0.785398),
    joint("LKx_joint", Axis::X, -2.26893, 0.0),
    joint("LSx_joint", Axis::X, -1.22173, 3.31613),
    joint("LSy_joint", Axis::Y, 0.0, 2.79253),
    joint("LSz_joint", Axis::Z, -1.22173, 1.0472),
    joint("LWx_joint", Axis::X, -0.523599, 0.349066),
    joint("LWy_joint", Axis::Y, -1.22173, 1.5708),
    joint("LFx_joint", Axis::X, -0.785398, 1.5708),
    joint("LMrot_joint", Axis::Y, -0.261799, 0.261799),
    joint("RAx_joint", Axis::X, -0.698132, 0.523599),
    joint("RAy_joint", Axis::Y, -0.349066, 0.349066),
    joint("RAz_joint", Axis::Z, -0.523599, 0.523599),
    joint("REx_joint", Axis::X, 0.0, 2.79253),
    joint("REz_joint", Axis::Z, -1.5708, 1.5708),
    joint("RHx_joint", Axis::X, -0.872665, 1.65806),
    joint("RHy_joint", Axis::Y, -1.13446, 0.349066),
    joint("RHz_joint", Axis::Z, -0.785398, 0.785398),
    joint("RKx_joint", Axis::X, -2.26893, 0.0),
    joint("RSx_joint", Axis::X, -1.22173, 3.31613),
    joint("RSy_joint", Axis::Y, -2.79253, 0.0),
    joint("RSz_joint", Axis::Z, -1.0472, 1.22173),
    joint("RWx_joint", Axis::X, -0.523599, 0.349066),
    joint("RWy_joint", Axis::Y, -1.5708, 1.22173),
    joint("RFx_joint", Axis::X, -0.785398, 1.5708),
    joint("RMrot_joint", Axis::Y, -0.261799, 0.261799),
];

/// Index of a joint in [`JOINTS`] by its KIT name (`LKx_joint`) or short name (`LKx`).
#[must_use]
pub fn joint_index(name: &str) -> Option<usize> {
    JOINTS.iter().position(|joint| joint.name == name || joint.short_name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_agrees_with_the_joint_name() {
        for joint in &JOINTS {
            let expected = match joint.short_name() {
                "LMrot" | "RMrot" => Axis::Y,
                short => match short.chars().last() {
                    Some('x') => Axis::X,
                    Some('y') => Axis::Y,
                    _ => Axis::Z,
                },
            };
            assert_eq!(joint.axis, expected, "{}", joint.name);
        }
    }

    #[test]
    fn left_and_right_limits_mirror() {
        for left in JOINTS.iter().filter(|j| j.name.starts_with('L')) {
            let right = &JOINTS[joint_index(&left.name.replacen('L', "R", 1)).unwrap()];
            // Mirroring in the sagittal plane keeps rotations about x and negates those about y and z.
            let (lower, upper) = match left.axis {
                Axis::X => (left.lower_rad, left.upper_rad),
                Axis::Y | Axis::Z => (-left.upper_rad, -left.lower_rad),
            };
            assert_eq!((right.lower_rad, right.upper_rad), (lower, upper), "{}", left.name);
        }
    }
}
