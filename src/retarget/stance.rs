//! When feet stand, told from the heights and speeds of their joints: one rule for the source and for our motion.

use nalgebra::Vector3;

use super::rest::{Rest, lowest_height_m, rests_of};

/// A foot stands while its toe is at most this far above the lowest toe of the clip, metres,
const TOE_HEIGHT_M: f64 = 0.035;
/// and moves at most this fast, metres per second.
const TOE_SPEED_M_S: f64 = 0.35;
/// It stands flat while its ankle is also at most this far above the ankle's lowest, metres,
const ANKLE_HEIGHT_M: f64 = 0.03;
/// and moves at most this fast, metres per second.
const ANKLE_SPEED_M_S: f64 = 0.25;
/// The lowest height is at least this quantile over the clip, so that single bad frames do not decide;
/// and at least the lowest height at which feet rest more than once, so that a single bad stance does not either.
const LOWEST_SHARE: f64 = 0.03;
/// Half of the interval over which speeds are taken, seconds.
const SPEED_REACH_SECS: f64 = 0.025;

/// Path of the toe and ankle joints of both feet (left, right), metres.
pub(super) struct FootPaths {
    pub toes: [Vec<Vector3<f64>>; 2],
    pub ankles: [Vec<Vector3<f64>>; 2],
}

/// Stance of both feet (left, right).
#[derive(Debug, Clone)]
pub(super) struct Stance {
    /// Whether each foot stands, by frame.
    pub stands: Vec<[bool; 2]>,
    /// Whether each foot stands flat, by frame.
    pub flat: Vec<[bool; 2]>,
    /// Height of each ankle while its foot stands flat, median, metres; of a foot that never does, that of the other.
    pub ankle_height_m: [f64; 2],
}

impl Stance {
    /// `is_level` says of a frame and a foot whether its sole may lie flat, where that is known.
    pub(super) fn of(paths: &FootPaths, rate_hz: f64, is_level: impl Fn(usize, usize) -> bool) -> Self {
        let count = paths.toes[0].len();
        let mut stance = Self {
            stands: vec![[false; 2]; count],
            flat: vec![[false; 2]; count],
            ankle_height_m: [f64::NAN; 2],
        };
        let lowest = |path: &[Vector3<f64>]| quantile(&heights(path), LOWEST_SHARE);
        let raised =
            |lowest: f64, rests: &[Rest]| lowest_height_m(rests).map_or(lowest, |rest| rest.max(lowest));
        let toe_rests = [0, 1].map(|foot| rests_of(foot, &paths.toes[foot], rate_hz)).concat();
        let toe_floor = raised(lowest(&paths.toes[0]).min(lowest(&paths.toes[1])), &toe_rests);
        // Ankles stand at heights of their own.
        let ankle_floors = [0, 1].map(|foot| {
            let ankle = &paths.ankles[foot];
            raised(lowest(ankle), &rests_of(foot, ankle, rate_hz))
        });
        let ankle_floor = ankle_floors[0].min(ankle_floors[1]);
        for foot in 0..2 {
            let (toe, ankle) = (&paths.toes[foot], &paths.ankles[foot]);
            let (toe_speeds, ankle_speeds) = (speeds(toe, rate_hz), speeds(ankle, rate_hz));
            // Ankles of the same body lie a little apart; one that stays far up never stands flat.
            let floor = ankle_floors[foot].min(ankle_floor + ANKLE_HEIGHT_M);
            for frame in 0..count {
                let stands = toe[frame].z < toe_floor + TOE_HEIGHT_M && toe_speeds[frame] < TOE_SPEED_M_S;
                let low = ankle[frame].z < floor + ANKLE_HEIGHT_M && ankle_speeds[frame] < ANKLE_SPEED_M_S;
                stance.stands[frame][foot] = stands;
                stance.flat[frame][foot] = stands && low && is_level(frame, foot);
            }
            let standing: Vec<f64> = ankle
                .iter()
                .zip(&stance.flat)
                .filter(|(_, flat)| flat[foot])
                .map(|(ankle, _)| ankle.z)
                .collect();
            if !standing.is_empty() {
                stance.ankle_height_m[foot] = quantile(&standing, 0.5);
            }
        }
        let [left, right] = stance.ankle_height_m;
        stance.ankle_height_m = match (left.is_nan(), right.is_nan()) {
            (true, true) => [ankle_floor; 2],
            (true, false) => [right; 2],
            (false, true) => [left; 2],
            (false, false) => [left, right],
        };
        stance
    }
}

impl Stance {
    /// By frame and foot: 1 while it stands, falling smoothly to 0 at `reach` frames from the next frame in which it does.
    pub(super) fn nearness(&self, reach: f64) -> Vec<[f64; 2]> {
        let count = self.stands.len();
        let mut away = vec![[f64::INFINITY; 2]; count];
        let mut since = [f64::INFINITY; 2];
        let mut pass = |frame: usize| {
            for ((away, since), stands) in away[frame].iter_mut().zip(&mut since).zip(self.stands[frame]) {
                *since = if stands { 0.0 } else { *since + 1.0 };
                *away = away.min(*since);
            }
        };
        (0..count).for_each(&mut pass);
        (0..count).rev().for_each(&mut pass);
        let share = |frames: f64| {
            let far = (frames / reach.max(1.0)).min(1.0);
            1.0 - far * far * (3.0 - 2.0 * far)
        };
        away.into_iter().map(|feet| feet.map(share)).collect()
    }
}

fn heights(path: &[Vector3<f64>]) -> Vec<f64> {
    path.iter().map(|point| point.z).collect()
}

/// A quantile of values of which there is at least one.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    let index = ((values.len() as f64 - 1.0) * share).round() as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}

/// Speed along a path by frame, metres per second.
pub(super) fn speeds(path: &[Vector3<f64>], rate_hz: f64) -> Vec<f64> {
    let reach = ((SPEED_REACH_SECS * rate_hz).round() as usize).max(1);
    let last = path.len() - 1;
    (0..=last)
        .map(|frame| {
            let (before, after) = (frame.saturating_sub(reach), (frame + reach).min(last));
            // A single frame has no speed.
            (path[after] - path[before]).norm() * rate_hz / (after - before).max(1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 100.0;

    /// Eight steps of either foot, toes standing at 3 cm and ankles at 7 cm; one stance of the left is lower by `fault_m`.
    fn walk(fault_m: f64) -> FootPaths {
        let joint = |foot: usize, height: f64| -> Vec<Vector3<f64>> {
            (0..800)
                .map(|frame| {
                    let phase = f64::from(frame) / 100.0 + 0.5 * foot as f64;
                    let (step, part) = (phase.floor(), phase.fract());
                    let swing = ((part - 0.6) / 0.4).max(0.0);
                    let lift = 0.1 * (std::f64::consts::PI * swing).sin();
                    let fault = if foot == 0 && step == 4.0 { fault_m } else { 0.0 };
                    Vector3::new(0.2 * foot as f64, 0.7 * (step + swing), height + lift - fault)
                })
                .collect()
        };
        FootPaths { toes: [joint(0, 0.03), joint(1, 0.03)], ankles: [joint(0, 0.07), joint(1, 0.07)] }
    }

    #[test]
    fn one_wrong_stance_takes_no_other_stance_away() {
        let right = Stance::of(&walk(0.0), RATE_HZ, |_, _| true);
        let standing = right.stands.iter().filter(|stands| stands[0]).count();
        assert!((450..=520).contains(&standing), "{standing} of 800 frames");
        for fault_m in [0.03, 0.05, 0.08] {
            let wrong = Stance::of(&walk(fault_m), RATE_HZ, |_, _| true);
            for (frame, (right, wrong)) in right.flat.iter().zip(&wrong.flat).enumerate() {
                let beside_the_fault = (395..=505).contains(&frame);
                assert!(
                    right == wrong || beside_the_fault,
                    "frame {frame}, {fault_m} m: {right:?}, {wrong:?}"
                );
            }
            assert!(
                (wrong.ankle_height_m[0] - 0.07).abs() < 1e-6
                    && (wrong.ankle_height_m[1] - 0.07).abs() < 1e-6
            );
        }
    }
    #[test]
    fn a_steep_sole_stands_but_not_flat() {
        let steep = |frame: usize, foot: usize| foot == 1 || frame > 400;
        let stance = Stance::of(&walk(0.0), RATE_HZ, steep);
        assert!(stance.stands[30][0] && !stance.flat[30][0] && stance.flat[430][0]);
        assert_eq!(stance.stands, Stance::of(&walk(0.0), RATE_HZ, |_, _| true).stands);
    }
    #[test]
    fn nearness_fades_on_either_side_of_a_stance() {
        let stance = Stance {
            stands: (0..9).map(|frame| [frame == 4, false]).collect(),
            flat: vec![[false; 2]; 9],
            ankle_height_m: [0.0; 2],
        };
        let near = stance.nearness(4.0);
        let left: Vec<f64> = near.iter().map(|feet| feet[0]).collect();
        assert_eq!(left, [0.0, 0.15625, 0.5, 0.84375, 1.0, 0.84375, 0.5, 0.15625, 0.0]);
        assert!(near.iter().all(|feet| feet[1] == 0.0));
    }
}
