//! Level 0, feet that slide over the floor: three definitions, since the field has no single one.

use nalgebra::Vector3;

use super::metric::{Better, Metric, Score};
use super::trace::{Trace, horizontal_m, mean, median};
use crate::simulation::Level;

const MM_PER_M: f64 = 1000.0;
/// Height up to which a sole point is in contact, metres.
const CONTACT_M: f64 = 0.005;
/// Height up to which a sole point may carry the body, metres; recorded soles hover that much in stance.
const NEAR_FLOOR_M: f64 = 0.030;

/// Rate the skating ratio is defined at, hertz.
const RATIO_RATE_HZ: f64 = 20.0;
const RATIO_HEIGHT_M: f64 = 0.05;
const RATIO_SPEED_M_S: f64 = 0.5;
const RATIO_WINDOW: usize = 5;

/// Share of the motion in which a foot skates.
///
/// A swinging foot that passes below 5 cm counts too: recorded walking scores 0.1 to 0.3 and a gliding statue 1.
/// It is printed because others print it; [`SLOWEST_CONTACT`] separates walking from sliding by far more.
pub(super) static RATIO: Metric = Metric {
    key: "l0/foot_skate_ratio",
    title: "foot skate",
    unit: "",
    level: Level::L0,
    better: Better::Lower,
    formula: "share of frame pairs at 20 Hz in which either ball of the foot is below 5 cm in both frames, moves \
              horizontally faster than 0.5 m/s, and does so too in the mean of five pairs around (pairs outside the motion count as 0)",
    empty: "absent below 1/20 s",
    reference: "GMD (korrawe/guided-motion-diffusion: data_loaders/humanml/utils/metrics.py); \
                also OmniControl and CLoSD. There the point is the toe joint, which its data \
                puts on the floor in stance; here it is the sole under that joint",
    signature: "points:ball-of-foot|rate:20Hz,linear-positions|h:5cm|speed:0.5m/s|window:5,zero-padded|v:1",
};

/// Mean slide of the soles from frame to frame.
pub(super) static PER_FRAME: Metric = Metric {
    key: "l0/skate_per_frame",
    title: "skate per frame",
    unit: "mm/frame",
    level: Level::L0,
    better: Better::Lower,
    formula: "mean over frame pairs of s, the mean horizontal displacement of the sole points at or below 5 mm in both \
              frames, 0 without any; at the motion's own rate, so compare at equal rates only",
    empty: "absent for a single frame",
    reference: "PhysDiff (Yuan et al. 2023, arXiv 2212.02500); displacement of vertices as in \
                ZhengyiLuo/UniversalHumanoidControl: uhc/smpllib/smpl_eval.py, contact height of CLoSD",
    signature: "points:sole12|contact:5mm,both|agg:mean-points,mean-pairs|rate:own|v:1",
};

/// Mean slide of the soles per second.
pub(super) static PER_SECOND: Metric = Metric {
    key: "l0/skate",
    title: "skate",
    unit: "mm/s",
    level: Level::L0,
    better: Better::Lower,
    formula: "l0/skate_per_frame * rate",
    empty: "absent for a single frame",
    reference: "PhysDiff (Yuan et al. 2023, arXiv 2212.02500), per second so that frame rates can be compared",
    signature: "points:sole12|contact:5mm,both|agg:mean-points,mean-pairs|per:second|v:1",
};

/// Typical speed of the stillest sole point.
pub(super) static SLOWEST_CONTACT: Metric = Metric {
    key: "l0/slowest_contact_speed",
    title: "slowest contact",
    unit: "mm/s",
    level: Level::L0,
    better: Better::Lower,
    formula: "median, over frame pairs with sole points at or below 30 mm in both frames, of the smallest horizontal speed \
              among those points; near 0 where a foot stands, the sliding speed where all feet slide \
              most of the time, untouched by a single jump",
    empty: "absent for a single frame, or when no sole point comes near the floor",
    reference: "this project",
    signature: "points:sole12|near:30mm,both|per-pair:min|agg:median-pairs|per:second|v:1",
};

/// Scores of the feet's slip.
pub(super) fn scores(trace: &Trace) -> Vec<Score> {
    let pairs = 1..trace.num_frames();
    let slide = mean(pairs.clone().map(|after| {
        let steps = low_point_steps_m(trace, after, CONTACT_M);
        mean(steps).unwrap_or(0.0)
    }));
    let slowest = median(pairs.filter_map(|after| {
        let steps = low_point_steps_m(trace, after, NEAR_FLOOR_M);
        steps.min_by(f64::total_cmp)
    }));
    let to_mm_s = MM_PER_M * trace.rate_hz;
    [
        (&RATIO, skating_ratio(trace)),
        (&PER_FRAME, slide.map(|slide| slide * MM_PER_M)),
        (&PER_SECOND, slide.map(|slide| slide * to_mm_s)),
        (&SLOWEST_CONTACT, slowest.map(|slowest| slowest * to_mm_s)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric, value?))
    .collect()
}

/// Horizontal steps into frame `after` of the sole points no higher than `height_m` before and after, metres.
fn low_point_steps_m(trace: &Trace, after: usize, height_m: f64) -> impl Iterator<Item = f64> {
    let (before, after) = (trace.sole_points_m(after - 1), trace.sole_points_m(after));
    before
        .iter()
        .zip(after)
        .filter(move |(before, after)| before.z <= height_m && after.z <= height_m)
        .map(|(before, after)| horizontal_m(&(after - before)))
}

/// Share of 20 Hz frame pairs in which either foot skates; `None` without a pair.
fn skating_ratio(trace: &Trace) -> Option<f64> {
    let paths = trace.resampled(RATIO_RATE_HZ, |frame| trace.balls_m(frame));
    let skates = [0, 1].map(|side| {
        let path: Vec<_> = paths.iter().map(|balls| balls[side]).collect();
        skating_pairs(&path)
    });
    mean(skates[0].iter().zip(&skates[1]).map(|(&left, &right)| f64::from(left || right)))
}

/// Whether the foot skates, per pair of frames.
fn skating_pairs(path_m: &[Vector3<f64>]) -> Vec<bool> {
    let speeds: Vec<f64> =
        path_m.windows(2).map(|pair| horizontal_m(&(pair[1] - pair[0])) * RATIO_RATE_HZ).collect();
    let half = RATIO_WINDOW / 2;
    let is_low = |frame: usize| path_m[frame].z < RATIO_HEIGHT_M;
    (0..speeds.len())
        .map(|pair| {
            let around = &speeds[pair.saturating_sub(half)..(pair + half + 1).min(speeds.len())];
            let smoothed = around.iter().sum::<f64>() / RATIO_WINDOW as f64;
            is_low(pair) && is_low(pair + 1) && speeds[pair] > RATIO_SPEED_M_S && smoothed > RATIO_SPEED_M_S
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Skating pairs of a foot that makes these steps, all but frame `lifted` on the floor.
    fn skates(steps_m: &[f64], lifted: Option<usize>) -> Vec<bool> {
        let mut y = 0.0;
        let mut path = vec![Vector3::zeros()];
        for step in steps_m {
            y += step;
            path.push(Vector3::new(0.0, y, 0.0));
        }
        if let Some(frame) = lifted {
            path[frame].z = 0.06;
        }
        skating_pairs(&path)
    }

    #[test]
    fn a_pair_skates_when_it_and_its_surroundings_are_fast_and_low() {
        // 0.05 m a step are 1 m/s at 20 Hz.
        assert_eq!(skates(&[0.05; 4], None), [true; 4]);
        assert_eq!(skates(&[0.05; 4], Some(2)), [true, false, false, true], "low in both frames");
        assert_eq!(skates(&[0.06, 0.06, 0.02, 0.06, 0.06], None), [true, true, false, true, true]);
        assert_eq!(skates(&[0.0, 0.0, 0.05, 0.0, 0.0], None), [false; 5], "one fast pair is noise");
        assert_eq!(skates(&[0.03; 5], None), [false, false, true, false, false], "zeros beyond the ends");
    }
}
