//! What a motion asks of the ground: momentum, zero-moment point, and the centre-of-mass path that keeps it in place.
//!
//! The zero-moment point is where the ground force can act alone:
//! `p = c - z c'' / (z'' + g) + (L'_x in y, -L'_y in x) / (m (z'' + g))` for the centre of mass `c` at height `z` and the
//! angular momentum `L` about it (Vukobratovic and Borovac 2004, Int. J. Humanoid Robotics 1:157).

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};

use crate::humanoid::Humanoid;
use crate::motion::Motion;

/// Below this share of the body weight the ground force has no use for a moment: its point of action is arbitrary.
pub(super) const LEAST_SUPPORT: f64 = 0.3;

/// Gravity, m/s^2, along -z.
pub const GRAVITY_M_S2: f64 = 9.81;

/// What a motion asks of the ground, by central differences, one value per frame; both ends are taken as at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundReaction {
    /// Centre of mass in the world, metres.
    pub com_m: Vec<Vector3<f64>>,
    /// Acceleration of the centre of mass, m/s^2.
    pub com_acceleration_m_s2: Vec<Vector3<f64>>,
    /// Rate of the angular momentum about the centre of mass, N m.
    pub angular_momentum_rate_nm: Vec<Vector3<f64>>,
    mass_kg: f64,
}

impl GroundReaction {
    /// For a motion performed by `humanoid`.
    #[must_use]
    pub fn of(humanoid: &Humanoid, motion: &Motion) -> Self {
        let poses: Vec<_> = motion.frames().iter().map(|frame| humanoid.forward(frame)).collect();
        Self::of_poses(humanoid, &poses, motion.rate_hz())
    }

    /// From the link poses of each frame.
    pub(super) fn of_poses(humanoid: &Humanoid, poses: &[Vec<Isometry3<f64>>], rate_hz: f64) -> Self {
        let tree = &humanoid.robot.tree;
        let com_m: Vec<_> = poses.iter().map(|pose| tree.center_of_mass(pose)).collect();
        let momentum: Vec<_> = (1..poses.len())
            .map(|i| {
                let (before, after) = (&poses[i - 1], &poses[i]);
                angular_momentum(humanoid, before, after, &com_m[i - 1], &com_m[i]) * rate_hz
            })
            .collect();
        let mut acceleration = vec![Vector3::zeros(); poses.len()];
        let mut rate = vec![Vector3::zeros(); poses.len()];
        for i in 1..poses.len().saturating_sub(1) {
            acceleration[i] = (com_m[i + 1] - 2.0 * com_m[i] + com_m[i - 1]) * (rate_hz * rate_hz);
            rate[i] = (momentum[i] - momentum[i - 1]) * rate_hz;
        }
        Self {
            com_m,
            com_acceleration_m_s2: acceleration,
            angular_momentum_rate_nm: rate,
            mass_kg: tree.total_mass_kg(),
        }
    }

    /// Vertical ground force at a frame, newtons.
    #[must_use]
    pub fn vertical_force_n(&self, frame: usize) -> f64 {
        self.mass_kg * (self.com_acceleration_m_s2[frame].z + GRAVITY_M_S2)
    }

    /// Zero-moment point on the floor at a frame, metres; `None` while the ground bears less than 30 % of the weight.
    #[must_use]
    pub fn zero_moment_point_m(&self, frame: usize) -> Option<[f64; 2]> {
        let (com, acceleration) = (self.com_m[frame], self.com_acceleration_m_s2[frame]);
        let moment = self.angular_momentum_rate_nm[frame];
        let force = self.vertical_force_n(frame);
        let specific = force / self.mass_kg;
        (specific > LEAST_SUPPORT * GRAVITY_M_S2).then(|| {
            [
                com.x - com.z * acceleration.x / specific - moment.y / force,
                com.y - com.z * acceleration.y / specific + moment.x / force,
            ]
        })
    }
}

/// Angular momentum about the centre of mass between two frames, times the frame time, kg m^2.
fn angular_momentum(
    humanoid: &Humanoid,
    before: &[Isometry3<f64>],
    after: &[Isometry3<f64>],
    com_before: &Vector3<f64>,
    com_after: &Vector3<f64>,
) -> Vector3<f64> {
    let com_shift = com_after - com_before;
    let com_middle = (com_before + com_after) / 2.0;
    let mut sum = Vector3::zeros();
    for &link in &humanoid.segment_links {
        let Some(inertial) = humanoid.robot.tree.links()[link].inertial else { continue };
        let center = Point3::from(inertial.com_in_link_m);
        let (from, to) = ((before[link] * center).coords, (after[link] * center).coords);
        let turn = (after[link].rotation * before[link].rotation.inverse()).scaled_axis();
        let middle = UnitQuaternion::from_scaled_axis(turn / 2.0) * before[link].rotation;
        let axes: Matrix3<f64> = middle.to_rotation_matrix().into_inner();
        let inertia = axes * inertial.inertia_about_com_kgm2 * axes.transpose();
        let lever = (from + to) / 2.0 - com_middle;
        sum += lever.cross(&(inertial.mass_kg * (to - from - com_shift))) + inertia * turn;
    }
    sum
}

/// The load may move for this long at either end to set the body in motion, seconds.
const PREPARATION_SECS: f64 = 0.7;

/// Path of the centre of mass along one horizontal axis that puts the zero-moment point where it should be.
///
/// Solves `f_i c_i - z_i c''_i = load_i` for all frames at once, `c''` by central differences, both ends given
/// (cf. Kagami et al. 2002, "A fast dynamically equilibrated walking trajectory generation method of humanoid robot",
/// Autonomous Robots 12:71).
/// `height_m` is z, `specific_force_m_s2` is `f = z'' + g`, `load_m2_s2` is f times the wanted zero-moment point, less
/// the specific moment that the angular momentum takes.
/// Where f is zero (flight) and the load is zero the path is a straight line.
///
/// The path also begins and ends at rest: as people do before a step, the load first moves the other way, by as much as
/// that takes (Winter 1995, Gait and Posture 3:193).
pub(super) fn balanced_path(
    height_m: &[f64],
    specific_force_m_s2: &[f64],
    load_m2_s2: &[f64],
    ends_m: [f64; 2],
    rate_hz: f64,
) -> Vec<f64> {
    let mut path = solve(height_m, specific_force_m_s2, load_m2_s2, ends_m, rate_hz);
    let n = path.len();
    let length = (PREPARATION_SECS * rate_hz) as usize;
    if n < 4 * length {
        return path;
    }
    for (first, end, inner) in [(0, 0, 1), (n - 1 - length, n - 1, n - 2)] {
        let mut load = vec![0.0; n];
        for i in first..=first + length {
            let s = (i - first) as f64 / length as f64;
            load[i] = specific_force_m_s2[i] * 64.0 * (s * (1.0 - s)).powi(3);
        }
        let answer = solve(height_m, specific_force_m_s2, &load, [0.0; 2], rate_hz);
        if answer[inner].abs() > 1e-9 {
            let amount = (path[inner] - path[end]) / answer[inner];
            path.iter_mut().zip(&answer).for_each(|(path, answer)| *path -= amount * answer);
        }
    }
    path
}

/// The equations of [`balanced_path`] for one load.
fn solve(
    height_m: &[f64],
    specific_force_m_s2: &[f64],
    load_m2_s2: &[f64],
    ends_m: [f64; 2],
    rate_hz: f64,
) -> Vec<f64> {
    let n = height_m.len();
    let mut path = vec![0.0; n];
    if n == 0 {
        return path;
    }
    (path[0], path[n - 1]) = (ends_m[0], ends_m[1]);
    // Thomas algorithm on the inner frames; the matrix is diagonally dominant because f is not negative.
    let mut upper = vec![0.0; n];
    let mut right = vec![0.0; n];
    right[0] = ends_m[0];
    for i in 1..n.saturating_sub(1) {
        let off = -height_m[i] * rate_hz * rate_hz;
        let pivot = specific_force_m_s2[i].max(0.0) - 2.0 * off - off * upper[i - 1];
        upper[i] = off / pivot;
        right[i] = (load_m2_s2[i] - off * right[i - 1]) / pivot;
    }
    for i in (1..n.saturating_sub(1)).rev() {
        path[i] = right[i] - upper[i] * path[i + 1];
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Body, Frame};

    #[test]
    fn a_pendulum_follows_its_closed_form() {
        // c'' = (g / z)(c - p) with p a cosine: c = p0 cos(w t) / (1 + w^2 z / g), away from the ends.
        let (rate, z, w) = (100.0, 0.9, 6.0);
        let times: Vec<f64> = (0..1001).map(|i| f64::from(i) / rate).collect();
        let load: Vec<f64> = times.iter().map(|t| GRAVITY_M_S2 * 0.1 * (w * t).cos()).collect();
        let path = balanced_path(&vec![z; 1001], &vec![GRAVITY_M_S2; 1001], &load, [0.0, 0.0], rate);
        let gain = 0.1 / (1.0 + w * w * z / GRAVITY_M_S2);
        for i in 300..700 {
            assert!((path[i] - gain * (w * times[i]).cos()).abs() < 1e-4);
        }
    }

    #[test]
    fn a_step_to_the_side_begins_and_ends_at_rest() {
        let load: Vec<f64> = (0..600).map(|i| if i < 100 { 0.0 } else { 0.1 * GRAVITY_M_S2 }).collect();
        let path = balanced_path(&vec![0.9; 600], &vec![GRAVITY_M_S2; 600], &load, [0.0, 0.1], 100.0);
        assert!((path[1] - path[0]).abs() < 1e-7 && (path[599] - path[598]).abs() < 1e-7);
        let overshoot = path.iter().fold(0.0_f64, |worst, c| worst.max(c - 0.1).max(-c));
        assert!(overshoot < 0.01 && (path[110] - 0.05).abs() < 0.03, "{overshoot} {}", path[110]);
    }

    #[test]
    fn without_ground_force_the_path_is_straight() {
        let path = balanced_path(&[1.0; 11], &[0.0; 11], &[0.0; 11], [1.0, 2.0], 100.0);
        for (i, position) in path.iter().enumerate() {
            assert!((position - (1.0 + i as f64 / 10.0)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_rigid_tumble_has_the_momentum_of_its_inertia() {
        // The rigid body pitches at a steady 2 rad/s about its root: L is constant and the rate zero,
        // and the zero-moment point follows the circling centre of mass.
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let frames: Vec<_> = (0..60)
            .map(|i| {
                let mut frame = Frame::ZERO;
                frame.root_position_m[2] = 0.9;
                frame.root_rotation_rad[0] = 0.02 * f64::from(i) - 0.6;
                frame
            })
            .collect();
        let motion = Motion::new(humanoid.body, 100.0, frames).unwrap();
        let reaction = GroundReaction::of(&humanoid, &motion);
        let lever = reaction.com_m[30] - Vector3::new(0.0, 0.0, 0.9);
        let acceleration = reaction.com_acceleration_m_s2[30];
        assert!((acceleration + lever * 4.0).norm() < 1e-3, "centripetal: {acceleration}");
        // The axis is a principal one up to the slight asymmetry of the body.
        assert!(reaction.angular_momentum_rate_nm[30].x.abs() < 1e-6);
        assert!(reaction.angular_momentum_rate_nm[30].norm() < 1e-2);
        let still = Motion::new(humanoid.body, 100.0, vec![motion.frames()[0]; 3]).unwrap();
        let reaction = GroundReaction::of(&humanoid, &still);
        let [x, y] = reaction.zero_moment_point_m(1).unwrap();
        assert!((x - reaction.com_m[1].x).abs() + (y - reaction.com_m[1].y).abs() < 1e-12);
        assert!((reaction.vertical_force_n(1) - humanoid.body.mass_kg * GRAVITY_M_S2).abs() < 0.01);
    }
}
