//! The way of an arm through a whole clip, found among all ways at once.
//!
//! A frame after a frame, an arm follows what is nearest and may run into limits from which there is no smooth way out; where
//! a source bends elbows backwards, as some conversions do, every way that begins well ends so.
//! Here the shoulder lives on a grid of its three angles, and dynamic programming finds the path over it that follows the
//! directions of upper arm and forearm best over all frames while it moves by at most a cell at a time.

use nalgebra::{UnitQuaternion, Vector3};

use super::quality::FLIP_RAD;
use super::solver::DIRECTION_LENGTH_M;
use super::track::{SMOOTH_RATE_HZ, smooth_weight};
use crate::humanoid::{Humanoid, Side};
use crate::motion::{JOINTS, joint_index};

/// Width of a cell, radians.
const CELL_RAD: f64 = 0.18;
/// A bone within this of being flipped counts as flipped, radians: cells are coarse.
const MARGIN_RAD: f64 = 0.09;
/// What a flipped bone costs a frame, square metres: more than a second of any bone that is not.
const FLIP_COST: f64 = 10.0;
/// Time over which the path from cell to cell is averaged, seconds.
const SMOOTH_SECS: f64 = 0.1;
/// Longer clips are not worth the memory, bytes.
const MAX_BYTES: usize = 1 << 28;

/// Angles of an arm: shoulder x, z, y, as they follow each other, and elbow, radians.
pub(super) type ArmAngles = [f64; 4];

/// An arm of the humanoid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arm {
    /// Indices of the angles in tree order.
    pub angles: [usize; 4],
    limits_rad: [[f64; 2]; 4],
}

impl Arm {
    /// `None` for a humanoid without such an arm.
    pub(super) fn of(humanoid: &Humanoid, side: Side) -> Option<Self> {
        let letter = if side == Side::Left { 'L' } else { 'R' };
        let (mut angles, mut limits_rad) = ([0; 4], [[0.0; 2]; 4]);
        for (index, joint) in ["Sx", "Sz", "Sy", "Ex"].into_iter().enumerate() {
            let kit = joint_index(&format!("{letter}{joint}"))?;
            angles[index] = humanoid.kit_of_angle().iter().position(|&of_angle| of_angle == kit)?;
            limits_rad[index] = [JOINTS[kit].lower_rad, JOINTS[kit].upper_rad];
        }
        Some(Self { angles, limits_rad })
    }

    /// The way that follows these directions of upper arm and forearm (units, in the frame of the thorax) over all frames;
    /// `None` where there are too many.
    pub(super) fn way(&self, directions: &[[Vector3<f64>; 2]], rate_hz: f64) -> Option<Vec<ArmAngles>> {
        let grid = Grid::new(&self.limits_rad);
        // Slow recordings move by several cells from frame to frame.
        let moves = (SMOOTH_RATE_HZ / rate_hz).ceil().max(1.0);
        let steps = directions.len().checked_mul(moves as usize)?;
        if directions.is_empty() || steps.checked_mul(grid.cells.len())? > MAX_BYTES {
            return None;
        }
        let step_cost = smooth_weight(rate_hz) * moves * CELL_RAD * CELL_RAD;
        let mut costs = vec![0.0; grid.cells.len()];
        let mut from: Vec<Vec<u8>> = Vec::with_capacity(steps);
        for (frame, directions) in directions.iter().enumerate() {
            if frame > 0 {
                for _ in 0..moves as usize {
                    from.push(grid.spread(&mut costs, step_cost));
                }
            }
            for (cost, cell) in costs.iter_mut().zip(&grid.cells) {
                *cost += self.elbow(cell, directions).1;
            }
        }
        let mut cell = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
        let mut way = Vec::with_capacity(directions.len());
        for (frame, directions) in directions.iter().enumerate().rev() {
            let [x, z, y] = grid.cells[cell].angles_rad;
            way.push([x, z, y, self.elbow(&grid.cells[cell], directions).0]);
            if frame > 0 {
                for _ in 0..moves as usize {
                    // As many were pushed on the way forward.
                    cell = grid.back(cell, &from.pop()?);
                }
            }
        }
        way.reverse();
        Some(smoothed(&way, (SMOOTH_SECS * rate_hz / 2.0).round() as usize))
    }

    /// The elbow that follows best from this shoulder, and what both bones cost, square metres.
    fn elbow(&self, cell: &Cell, [upper_arm, forearm]: &[Vector3<f64>; 2]) -> (f64, f64) {
        let wanted = cell.thorax_from_upper_arm.inverse() * forearm;
        // The forearm points to (0, sin, -cos) of the elbow in the frame of the upper arm.
        let along = |elbow: f64| wanted.y * elbow.sin() - wanted.z * elbow.cos();
        let free = wanted.y.atan2(-wanted.z);
        let [lower, upper] = self.limits_rad[3];
        let elbow = if (lower..=upper).contains(&free) {
            free
        } else if along(lower) >= along(upper) {
            lower
        } else {
            upper
        };
        let cosines = [cell.upper_arm.dot(upper_arm), along(elbow)];
        let cost: f64 = cosines
            .into_iter()
            .map(|cosine| {
                let flipped = cosine < (FLIP_RAD - MARGIN_RAD).cos();
                2.0 * (1.0 - cosine) * DIRECTION_LENGTH_M.powi(2) + if flipped { FLIP_COST } else { 0.0 }
            })
            .sum();
        (elbow, cost)
    }
}

/// Means over `reach` frames on either side.
fn smoothed(way: &[ArmAngles], reach: usize) -> Vec<ArmAngles> {
    (0..way.len())
        .map(|frame| {
            let near = &way[frame.saturating_sub(reach)..(frame + reach + 1).min(way.len())];
            [0, 1, 2, 3].map(|angle| near.iter().map(|angles| angles[angle]).sum::<f64>() / near.len() as f64)
        })
        .collect()
}

struct Cell {
    angles_rad: [f64; 3],
    thorax_from_upper_arm: UnitQuaternion<f64>,
    /// Direction of the upper arm in the frame of the thorax.
    upper_arm: Vector3<f64>,
}

struct Grid {
    counts: [usize; 3],
    /// The last angle runs fastest.
    cells: Vec<Cell>,
}

impl Grid {
    fn new(limits_rad: &[[f64; 2]; 4]) -> Self {
        let counts = [0, 1, 2].map(|angle| {
            let [lower, upper] = limits_rad[angle];
            ((upper - lower) / CELL_RAD).ceil() as usize + 1
        });
        let value = |angle: usize, index: usize| {
            let [lower, upper] = limits_rad[angle];
            lower + (upper - lower) * index as f64 / (counts[angle] - 1) as f64
        };
        let cells = (0..counts.iter().product())
            .map(|cell: usize| {
                let index = [cell / (counts[1] * counts[2]), cell / counts[2] % counts[1], cell % counts[2]];
                let angles_rad = [0, 1, 2].map(|angle| value(angle, index[angle]));
                let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
                let thorax_from_upper_arm = turn(Vector3::x(), angles_rad[0])
                    * turn(Vector3::z(), angles_rad[1])
                    * turn(Vector3::y(), angles_rad[2]);
                let upper_arm = thorax_from_upper_arm * -Vector3::z();
                Cell { angles_rad, thorax_from_upper_arm, upper_arm }
            })
            .collect();
        Self { counts, cells }
    }

    /// How far apart neighbours along an angle are in `cells`.
    fn stride(&self, angle: usize) -> usize {
        self.counts[angle + 1..].iter().product()
    }

    /// Lets every cell be reached from its neighbours; returns by cell whence, two bits an angle: 0 from below, 1 from
    /// itself, 2 from above. The angles move one after the other, which reaches all 26 neighbours.
    fn spread(&self, costs: &mut Vec<f64>, step_cost: f64) -> Vec<u8> {
        let mut from = vec![0_u8; costs.len()];
        let mut next = costs.clone();
        for angle in 0..3 {
            let (stride, count) = (self.stride(angle), self.counts[angle]);
            for cell in 0..costs.len() {
                let index = cell / stride % count;
                let (mut least, mut whence) = (costs[cell], 1);
                if index > 0 && costs[cell - stride] + step_cost < least {
                    (least, whence) = (costs[cell - stride] + step_cost, 0);
                }
                if index + 1 < count && costs[cell + stride] + step_cost < least {
                    (least, whence) = (costs[cell + stride] + step_cost, 2);
                }
                next[cell] = least;
                from[cell] |= whence << (2 * angle);
            }
            std::mem::swap(costs, &mut next);
        }
        from
    }

    /// The cell from which `spread` came to this one.
    fn back(&self, mut cell: usize, from: &[u8]) -> usize {
        for angle in (0..3).rev() {
            match from[cell] >> (2 * angle) & 3 {
                0 => cell -= self.stride(angle),
                2 => cell += self.stride(angle),
                _ => {}
            }
        }
        cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Body;

    fn left() -> Arm {
        Arm::of(&Humanoid::new(Body::with_default_mass(1.75)).unwrap(), Side::Left).unwrap()
    }

    fn bones([x, z, y, elbow]: ArmAngles) -> [Vector3<f64>; 2] {
        let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
        let upper_arm = turn(Vector3::x(), x) * turn(Vector3::z(), z) * turn(Vector3::y(), y);
        [upper_arm * -Vector3::z(), upper_arm * turn(Vector3::x(), elbow) * -Vector3::z()]
    }

    /// Largest angle of a bone from its direction, and largest movement of a shoulder angle between frames.
    fn largest(way: &[ArmAngles], directions: &[[Vector3<f64>; 2]]) -> (f64, f64) {
        let off = way
            .iter()
            .zip(directions)
            .flat_map(|(angles, directions)| {
                let bones = bones(*angles);
                [bones[0].angle(&directions[0]), bones[1].angle(&directions[1])]
            })
            .fold(0.0, f64::max);
        let moved = way
            .windows(2)
            .flat_map(|pair| [0, 1, 2].map(|angle| (pair[1][angle] - pair[0][angle]).abs()))
            .fold(0.0, f64::max);
        (off, moved)
    }

    #[test]
    fn the_links_of_the_humanoid_are_where_the_grid_has_them() {
        let humanoid = Humanoid::new(Body::with_default_mass(1.75)).unwrap();
        let tree = &humanoid.robot.tree;
        for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
            let arm = Arm::of(&humanoid, side).unwrap();
            let mut angles = vec![0.0; tree.num_angles()];
            let (mut values, sign) = ([0.6, 0.3, 0.7, 1.1], if side == Side::Left { 1.0 } else { -1.0 });
            values[2] *= sign;
            for (angle, value) in arm.angles.into_iter().zip(values) {
                angles[angle] = value;
            }
            let poses = tree.forward(&nalgebra::Isometry3::identity(), &angles);
            let links =
                ["upper_arm", "forearm"].map(|part| tree.link_index(&format!("{name}_{part}")).unwrap());
            for (link, bone) in links.into_iter().zip(bones(values)) {
                assert!((poses[link].rotation * -Vector3::z() - bone).norm() < 1e-9, "{name}");
            }
        }
    }

    #[test]
    fn follows_an_arm_that_swings_within_its_limits() {
        let arm = left();
        for rate_hz in [30.0, 120.0] {
            let path: Vec<ArmAngles> = (0..(2.0 * rate_hz) as usize)
                .map(|frame| {
                    let phase = (3.0 * frame as f64 / rate_hz).sin();
                    [0.8 + phase, 0.4 * phase, 0.5 + 0.3 * phase, 1.2 + phase]
                })
                .collect();
            let directions: Vec<_> = path.iter().copied().map(bones).collect();
            let (off, moved) = largest(&arm.way(&directions, rate_hz).unwrap(), &directions);
            assert!(off < 0.2, "{off} rad at {rate_hz} Hz");
            assert!(moved <= CELL_RAD * (SMOOTH_RATE_HZ / rate_hz).ceil().max(1.0), "{moved} rad");
        }
    }

    #[test]
    fn an_elbow_that_bends_backwards_is_followed_without_a_flip() {
        // The upper arm swings between down and forward while the forearm hangs behind it at a right angle.
        let directions: Vec<[Vector3<f64>; 2]> = (0..600)
            .map(|frame| {
                let swing = 0.35 - 0.35 * (f64::from(frame) / 60.0).cos();
                [Vector3::new(0.0, swing.sin(), -swing.cos()), Vector3::new(0.0, -swing.cos(), -swing.sin())]
            })
            .collect();
        let (off, moved) = largest(&left().way(&directions, 120.0).unwrap(), &directions);
        assert!(off < FLIP_RAD, "{} degrees", off.to_degrees());
        assert!(moved <= CELL_RAD, "{moved} rad");
        // Without turning the upper arm round, an elbow that only bends forward is a right angle off.
        assert!(bones([0.0; 4])[1].angle(&directions[0][1]) > 1.5);
    }

    #[test]
    fn clips_without_end_are_left_alone() {
        let directions = vec![[-Vector3::z(); 2]; 100_000];
        assert!(left().way(&directions, 120.0).is_none());
        assert!(left().way(&[], 120.0).is_none());
    }
}
