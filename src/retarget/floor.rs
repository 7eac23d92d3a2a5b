//! The floor of a recording where it is not level.
//!
//! A capture volume is levelled once, by hand, and its cameras bend space a little: over four metres of CMU's walks the
//! standing feet climb by five to six centimetres.
//! Gravity knows nothing of that, so the floor is found from where feet rest and turned level, with the body on it.

use nalgebra::{Matrix4, Rotation3, UnitQuaternion, Vector3, Vector4};

use super::rest::{Rest, rests_of};
use super::source::SourceFrame;
use super::stance::FootPaths;

/// Spread expected of the height of a resting toe, metres; rests far beyond it count ever less.
const REST_SPREAD_M: f64 = 0.01;
/// Slope expected of a floor, metres a metre: without rests that say otherwise it is level.
const SLOPE_SPREAD: f64 = 0.02;
/// Difference expected between the toe heights of both feet, metres: without it a straight walk would tell a slope
/// across its way from a foot that lies higher.
const FEET_SPREAD_M: f64 = 0.01;
/// A steeper floor is none of a fault, radians.
const LARGEST_SLOPE_RAD: f64 = 0.05;
/// A floor that changes the height of no rest by more than this is level, metres.
const LEVEL_M: f64 = 0.01;
/// Share of the rests that must lie within two spreads of the floor found.
const FITTING_SHARE: f64 = 0.7;
const NUM_ROUNDS: usize = 10;

/// A plane through the resting toes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Floor {
    /// Its upward normal in the world.
    normal: Vector3<f64>,
    /// The middle of the rests, metres.
    middle_m: Vector3<f64>,
}

impl Floor {
    /// The floor of a recording, where rests show that it slopes by a small angle; `None` where it is level, cannot be
    /// seen, or is no plane.
    pub(super) fn sloping(paths: &FootPaths, rate_hz: f64) -> Option<Self> {
        let rests: Vec<Rest> = (0..2).flat_map(|foot| rests_of(foot, &paths.toes[foot], rate_hz)).collect();
        if rests.len() < 3 {
            return None;
        }
        let middle_m = rests.iter().map(|rest| rest.place_m).sum::<Vector3<f64>>() / rests.len() as f64;
        let (slope, errors) = fit(&rests, &middle_m)?;
        let rise = |rest: &Rest| {
            let from_middle = rest.place_m - middle_m;
            slope[0] * from_middle.x + slope[1] * from_middle.y
        };
        let fitting = errors.iter().filter(|error| error.abs() < 2.0 * REST_SPREAD_M).count();
        let matters = rests.iter().any(|rest| rise(rest).abs() > LEVEL_M);
        let normal = Vector3::new(-slope[0], -slope[1], 1.0).normalize();
        let small = normal.z.acos() <= LARGEST_SLOPE_RAD;
        let fits = fitting as f64 >= FITTING_SHARE * rests.len() as f64;
        (matters && small && fits).then_some(Self { normal, middle_m })
    }

    /// Angle against the level, radians.
    pub(super) fn slope_rad(&self) -> f64 {
        self.normal.z.clamp(-1.0, 1.0).acos()
    }

    /// Turns everything about the middle of the rests until the floor is level.
    pub(super) fn level(&self, frames: &mut [SourceFrame]) {
        let turn = Rotation3::rotation_between(&self.normal, &Vector3::z())
            .map_or_else(UnitQuaternion::identity, |turn| UnitQuaternion::from_rotation_matrix(&turn));
        for frame in frames {
            for centre in &mut frame.centres {
                *centre = self.middle_m + turn * (*centre - self.middle_m);
            }
            for axis in frame.axes.iter_mut().flatten() {
                *axis = turn * *axis;
            }
        }
    }
}

/// Slopes along x and y of the plane `z = height + foot offset + slope (x, y)`, and the error of every rest, metres.
///
/// Iteratively reweighted least squares with Cauchy weights; slopes and foot offset are drawn to zero as their expected
/// spreads say.
fn fit(rests: &[Rest], middle_m: &Vector3<f64>) -> Option<([f64; 2], Vec<f64>)> {
    let mut unknowns = Vector4::zeros();
    let mut errors = vec![0.0; rests.len()];
    for round in 0..NUM_ROUNDS {
        let variance = REST_SPREAD_M.powi(2);
        let mut normal = Matrix4::from_diagonal(&Vector4::new(
            0.0,
            variance / FEET_SPREAD_M.powi(2),
            variance / SLOPE_SPREAD.powi(2),
            variance / SLOPE_SPREAD.powi(2),
        ));
        let mut right = Vector4::zeros();
        for (rest, error) in rests.iter().zip(&mut errors) {
            let from_middle = rest.place_m - middle_m;
            let row =
                Vector4::new(1.0, if rest.foot == 0 { -0.5 } else { 0.5 }, from_middle.x, from_middle.y);
            if round > 0 {
                *error = from_middle.z - row.dot(&unknowns);
            }
            let weight = 1.0 / (1.0 + (*error / (2.0 * REST_SPREAD_M)).powi(2));
            normal += row * row.transpose() * weight;
            right += row * (weight * from_middle.z);
        }
        unknowns = normal.cholesky()?.solve(&right);
    }
    Some(([unknowns[2], unknowns[3]], errors))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::retarget::role::{NUM_ORIENTED, NUM_ROLES};

    /// Steps of 0.7 m along y on a floor that rises with y, each toe resting for 0.6 of a second.
    fn walk(slope: f64, bump: impl Fn(usize) -> f64) -> FootPaths {
        let foot = |foot: usize| -> Vec<Vector3<f64>> {
            (0..600)
                .map(|frame| {
                    let phase = f64::from(frame) / 100.0 + 0.5 * foot as f64;
                    let (step, part) = (phase.floor(), phase.fract());
                    let swing = ((part - 0.6) / 0.4).max(0.0);
                    let y = 0.7 * (step + swing) - 0.35 * foot as f64;
                    let lift = 0.1 * (std::f64::consts::PI * swing).sin();
                    Vector3::new(0.2 * foot as f64, y, slope * y + lift + bump(step as usize))
                })
                .collect()
        };
        FootPaths { toes: [foot(0), foot(1)], ankles: [foot(0), foot(1)] }
    }

    #[test]
    fn finds_a_small_slope_and_levels_it() {
        let floor = Floor::sloping(&walk(0.014, |_| 0.0), 100.0).unwrap();
        assert!((floor.slope_rad() - 0.014).abs() < 0.001, "{}", floor.slope_rad());
        let standing = Vector3::new(0.1, 2.0, 0.028);
        let mut frames =
            [SourceFrame { centres: [standing; NUM_ROLES], axes: [[Vector3::z(); 2]; NUM_ORIENTED] }];
        floor.level(&mut frames);
        let other = walk(0.014, |_| 0.0).toes[0][10];
        let mut second =
            [SourceFrame { centres: [other; NUM_ROLES], axes: [[Vector3::z(); 2]; NUM_ORIENTED] }];
        floor.level(&mut second);
        assert!((frames[0].centres[0].z - second[0].centres[0].z).abs() < 0.002);
    }

    #[test]
    fn leaves_level_floors_steps_and_slopes_alone() {
        assert!(Floor::sloping(&walk(0.0, |_| 0.0), 100.0).is_none());
        assert!(Floor::sloping(&walk(0.1, |_| 0.0), 100.0).is_none());
        // A stair of two steps is no plane.
        let stair = |step: usize| 0.15 * (step / 2).min(1) as f64;
        assert!(Floor::sloping(&walk(0.0, stair), 100.0).is_none());
        let mut short = walk(0.014, |_| 0.0);
        short.toes.iter_mut().for_each(|toe| toe.truncate(60));
        assert!(Floor::sloping(&short, 100.0).is_none(), "two rests make no plane");
    }
}
