//! Level 0, joint space: limits, speeds and jerk of the 44 angles.

use super::metric::{Better, Metric, Score};
use super::trace::mean;
use crate::humanoid::Humanoid;
use crate::motion::{Frame, NUM_JOINTS};
use crate::robot::JointLimits;
use crate::simulation::Level;

/// Excess below which an angle counts as on its limit, radians: recordings rest there, in six-digit numbers.
const LIMIT_TOLERANCE_RAD: f64 = 1.0e-3;

/// Share of angles beyond their limits.
pub(super) static LIMIT_SHARE: Metric = Metric {
    key: "l0/joint_limit_share",
    title: "beyond limits",
    unit: "",
    level: Level::L0,
    better: Better::Lower,
    formula: "frames x joints with max(lower - q, q - upper) > 1 mrad / frames x joints",
    empty: "one frame suffices",
    reference: "limits of the MMM reference model (Terlemez et al. 2014), in the URDF",
    signature: "tol:1mrad|limits:urdf|joints:44|v:1",
};

/// Worst excess over a limit.
pub(super) static LIMIT_EXCESS: Metric = Metric {
    key: "l0/joint_limit_excess",
    title: "limit excess",
    unit: "rad",
    level: Level::L0,
    better: Better::Lower,
    formula: "max over frames and joints of max(lower - q, q - upper) where that is > 1 mrad, else 0",
    empty: "one frame suffices",
    reference: "limits of the MMM reference model (Terlemez et al. 2014), in the URDF",
    signature: "tol:1mrad|limits:urdf|joints:44|v:1",
};

/// Speed of the fastest joint that 95 % of the motion stays below.
pub(super) static SPEED_P95: Metric = Metric {
    key: "l0/joint_speed_p95",
    title: "joint speed p95",
    unit: "rad/s",
    level: Level::L0,
    better: Better::Neither,
    formula: "95th percentile (linear interpolation) over frame pairs of max over joints of |q(t+1) - q(t)| * rate",
    empty: "absent for a single frame",
    reference: "this project",
    signature: "diff:backward|filter:none|per-pair:max44|p:95,linear|v:1",
};

/// Largest joint speed.
pub(super) static SPEED_PEAK: Metric = Metric {
    key: "l0/joint_speed_peak",
    title: "joint speed peak",
    unit: "rad/s",
    level: Level::L0,
    better: Better::Lower,
    formula: "max over frame pairs and joints of |q(t+1) - q(t)| * rate",
    empty: "absent for a single frame",
    reference: "this project",
    signature: "diff:backward|filter:none|joints:44|v:1",
};

/// Share of joint speeds beyond their limits.
pub(super) static SPEED_LIMIT_SHARE: Metric = Metric {
    key: "l0/joint_speed_limit_share",
    title: "too fast",
    unit: "",
    level: Level::L0,
    better: Better::Lower,
    formula: "frame pairs x joints with |q(t+1) - q(t)| * rate > velocity limit / frame pairs x joints",
    empty: "absent for a single frame",
    reference: "velocity limits of the URDF, from published peak human joint speeds",
    signature: "diff:backward|filter:none|limits:urdf|joints:44|v:1",
};

/// Mean jerk of the angles.
pub(super) static JERK: Metric = Metric {
    key: "l0/joint_jerk",
    title: "joint jerk",
    unit: "rad/s^3",
    level: Level::L0,
    better: Better::Lower,
    formula: "mean over frames and joints of |q(t+3) - 3 q(t+2) + 3 q(t+1) - q(t)| * rate^3; \
              noise grows with the cube of the rate: compare at equal rates only",
    empty: "absent below four frames",
    reference: "Flash and Hogan 1985 (jerk as a measure of smoothness)",
    signature: "diff:third|filter:none|joints:44|v:1",
};

/// Scores of the joint angles of frames in a row, at least one.
pub(super) fn scores(humanoid: &Humanoid, frames: &[Frame], rate_hz: f64) -> Vec<Score> {
    let limits = limits_in_kit_order(humanoid);
    let (share, worst) = beyond_limits(&limits, frames);
    let mut scores = Vec::new();
    scores.extend(Score::new(&LIMIT_SHARE, share));
    scores.extend(Score::new(&LIMIT_EXCESS, worst));

    let mut fastest = Vec::with_capacity(frames.len());
    let mut num_too_fast = 0_usize;
    for pair in frames.windows(2) {
        let mut fastest_of_pair = 0.0_f64;
        for (joint, limit) in limits.iter().enumerate() {
            let speed = (pair[1].joint_angles_rad[joint] - pair[0].joint_angles_rad[joint]).abs() * rate_hz;
            fastest_of_pair = fastest_of_pair.max(speed);
            num_too_fast += usize::from(speed > limit.velocity_rad_s);
        }
        fastest.push(fastest_of_pair);
    }
    if !fastest.is_empty() {
        let share = num_too_fast as f64 / (fastest.len() * NUM_JOINTS) as f64;
        fastest.sort_unstable_by(f64::total_cmp);
        scores.extend(Score::new(&SPEED_P95, percentile(&fastest, 0.95)));
        scores.extend(Score::new(&SPEED_PEAK, percentile(&fastest, 1.0)));
        scores.extend(Score::new(&SPEED_LIMIT_SHARE, share));
    }
    let jerk = mean(frames.windows(4).map(mean_third_difference_rad));
    scores.extend(jerk.and_then(|jerk| Score::new(&JERK, jerk * rate_hz.powi(3))));
    scores
}

/// Limits of the humanoid's joints in KIT order.
pub(super) fn limits_in_kit_order(humanoid: &Humanoid) -> [JointLimits; NUM_JOINTS] {
    let mut limits = [humanoid.robot.limits[0]; NUM_JOINTS];
    for (angle, &kit) in humanoid.kit_of_angle().iter().enumerate() {
        limits[kit] = humanoid.robot.limits[angle];
    }
    limits
}

/// Share of angles beyond their limits, and the worst excess in radians.
fn beyond_limits(limits: &[JointLimits; NUM_JOINTS], frames: &[Frame]) -> (f64, f64) {
    let (mut num_beyond, mut worst) = (0_usize, 0.0_f64);
    for frame in frames {
        for (angle, limit) in frame.joint_angles_rad.iter().zip(limits) {
            let excess = (limit.lower_rad - angle).max(angle - limit.upper_rad);
            if excess > LIMIT_TOLERANCE_RAD {
                num_beyond += 1;
                worst = worst.max(excess);
            }
        }
    }
    (num_beyond as f64 / (frames.len() * NUM_JOINTS) as f64, worst)
}

/// Mean over joints of the magnitude of the third difference of four frames.
fn mean_third_difference_rad(window: &[Frame]) -> f64 {
    let angle = |frame: usize, joint: usize| window[frame].joint_angles_rad[joint];
    let step = |frame: usize, joint| angle(frame + 1, joint) - angle(frame, joint);
    let second = |frame, joint| step(frame + 1, joint) - step(frame, joint);
    let third = |joint| second(1, joint) - second(0, joint);
    (0..NUM_JOINTS).map(|joint| third(joint).abs()).sum::<f64>() / NUM_JOINTS as f64
}

/// Value below which this share of the sorted, non-empty values lies, interpolated linearly between neighbours.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let position = share * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_percentile_interpolates_between_neighbours() {
        let values = [0.0, 10.0, 20.0, 40.0];
        assert_eq!(percentile(&values, 0.0), 0.0);
        assert_eq!(percentile(&values, 0.5), 15.0);
        assert!((percentile(&values, 0.95) - 37.0).abs() < 1e-12);
        assert_eq!(percentile(&values, 1.0), 40.0);
        assert_eq!(percentile(&[3.0], 0.95), 3.0);
    }
}
