//! Soles over a motion: when they stand, how high, and how level.

use nalgebra::Point3;

use crate::humanoid::{Humanoid, Side, SoleRegion};
use crate::motion::Motion;

/// A sole point slower than this is taken to stand, m/s.
pub(super) const STANCE_SPEED_M_S: f64 = 0.3;
/// A foot of which no point is faster than this stands flat, m/s.
const FLAT_SPEED_M_S: f64 = 0.15;
/// Share of the frames in which both feet must rest for a motion to be one of standing.
const STANDING_SHARE: f64 = 0.95;
/// Half the time over which speeds are measured, seconds.
const SPEED_HALF_WINDOW_SECS: f64 = 0.02;

/// One foot in one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sole {
    /// Speed of the slowest and of the fastest sole point, m/s.
    pub slowest_m_s: f64,
    pub fastest_m_s: f64,
    /// Height of the lowest sole point, metres.
    pub lowest_m: f64,
    /// Slope from heel to ball, radians, positive with the front up.
    pub pitch_rad: f64,
    /// Slope from ball to toes, radians, positive with the toes up.
    pub toe_pitch_rad: f64,
    /// Slope of the heel towards +x of the foot, radians, positive with the right side up.
    pub roll_rad: f64,
    /// Slope of the ball towards +x of the foot, radians, positive with the right side up.
    pub ball_roll_rad: f64,
}

impl Sole {
    /// Some point of the foot rests on something.
    pub fn stands(&self) -> bool {
        self.slowest_m_s < STANCE_SPEED_M_S
    }

    /// The whole foot rests.
    pub fn stands_flat(&self) -> bool {
        self.fastest_m_s < FLAT_SPEED_M_S
    }
}

/// Both soles over a motion.
pub(super) struct SoleTracks {
    pub interval_secs: f64,
    /// Left and right foot, per frame.
    pub feet: Vec<[Sole; 2]>,
}

impl SoleTracks {
    pub fn new(humanoid: &Humanoid, motion: &Motion) -> Self {
        let points: Vec<Vec<Point3<f64>>> = motion
            .frames()
            .iter()
            .map(|frame| humanoid.sole_points_in_world(&humanoid.forward(frame)).collect())
            .collect();
        let reach = (SPEED_HALF_WINDOW_SECS * motion.rate_hz()).round().max(1.0) as usize;
        let last = points.len() - 1;
        let feet = (0..points.len())
            .map(|frame| {
                let (before, after) = (frame.saturating_sub(reach), (frame + reach).min(last));
                let elapsed = (after - before) as f64 / motion.rate_hz();
                let speed = |index: usize| {
                    let moved = (points[after][index] - points[before][index]).norm();
                    if elapsed > 0.0 { moved / elapsed } else { 0.0 }
                };
                [Side::Left, Side::Right].map(|side| sole(humanoid, side, &points[frame], speed))
            })
            .collect();
        Self { interval_secs: 1.0 / motion.rate_hz(), feet }
    }

    /// Whether both feet rest in nearly every frame: the motion is one of standing.
    pub fn stand_still(&self) -> bool {
        let standing = self.feet.iter().filter(|feet| feet.iter().all(Sole::stands)).count();
        standing as f64 >= STANDING_SHARE * self.feet.len() as f64
    }

    /// Median height of the lowest sole point while a foot stands; `None` when none ever does.
    pub fn standing_height_m(&self) -> Option<f64> {
        median(self.feet.iter().filter_map(|feet| {
            feet.iter().filter(|sole| sole.stands()).map(|sole| sole.lowest_m).min_by(f64::total_cmp)
        }))
    }

    /// Median of some property of one foot while it stands flat; `None` when it never does.
    pub fn standing_median(&self, foot: usize, property: impl Fn(&Sole) -> f64) -> Option<f64> {
        median(self.feet.iter().map(|feet| &feet[foot]).filter(|sole| sole.stands_flat()).map(property))
    }
}

fn sole(humanoid: &Humanoid, side: Side, points: &[Point3<f64>], speed: impl Fn(usize) -> f64) -> Sole {
    let (mut slowest_m_s, mut fastest_m_s, mut lowest_m) = (f64::INFINITY, 0.0_f64, f64::INFINITY);
    // Per region: left (-x) and right (+x) point, in the order the humanoid lists them.
    let mut pairs: [[Point3<f64>; 2]; 3] = [[Point3::origin(); 2]; 3];
    let mut filled = [0; 3];
    for (index, point) in humanoid.sole_points.iter().enumerate().filter(|(_, point)| point.side == side) {
        slowest_m_s = slowest_m_s.min(speed(index));
        fastest_m_s = fastest_m_s.max(speed(index));
        lowest_m = lowest_m.min(points[index].z);
        let region = match point.region {
            SoleRegion::Heel => 0,
            SoleRegion::Ball => 1,
            SoleRegion::Toe => 2,
        };
        if let Some(slot) = pairs[region].get_mut(filled[region]) {
            *slot = points[index];
            filled[region] += 1;
        }
    }
    let middles = pairs.map(|[left, right]| nalgebra::center(&left, &right));
    let roll = |region: usize| slope_rad(&pairs[region][0], &pairs[region][1]);
    Sole {
        slowest_m_s,
        fastest_m_s,
        lowest_m,
        pitch_rad: slope_rad(&middles[0], &middles[1]),
        toe_pitch_rad: slope_rad(&middles[1], &middles[2]),
        roll_rad: roll(0),
        ball_roll_rad: roll(1),
    }
}

/// Rise of the line from one point to another, radians.
fn slope_rad(from: &Point3<f64>, to: &Point3<f64>) -> f64 {
    let line = to - from;
    line.z.atan2(line.xy().norm())
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
