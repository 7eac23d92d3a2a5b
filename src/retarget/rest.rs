//! Where feet rest: places at which a joint of a foot is slow for long enough to carry something.

use nalgebra::Vector3;

use super::stance::{quantile, speeds};

/// A joint that is slower than this for long enough rests on something, metres per second,
const REST_SPEED_M_S: f64 = 0.25;
/// seconds.
const REST_SECS: f64 = 0.1;
/// Rests on one floor differ in height by this much, metres.
const SAME_HEIGHT_M: f64 = 0.015;
/// Share of the resting time that must be spent at a height for it to be a floor.
const SUPPORT_SHARE: f64 = 0.1;
/// A lone rest further below all others than this is another level, such as the foot of a stair; a nearer one is a fault
/// of the recording, metres.
const LARGEST_FAULT_M: f64 = 0.1;

/// A stretch of time in which a joint stays in one place, at most a second of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rest {
    /// Whose joint it is: 0 left, 1 right.
    pub foot: usize,
    /// The median place, metres.
    pub place_m: Vector3<f64>,
    pub num_frames: usize,
}

/// The rests of a joint of a foot, in time.
pub(super) fn rests_of(foot: usize, path: &[Vector3<f64>], rate_hz: f64) -> Vec<Rest> {
    let slow: Vec<bool> = speeds(path, rate_hz).iter().map(|speed| *speed < REST_SPEED_M_S).collect();
    let least = ((REST_SECS * rate_hz).round() as usize).max(1);
    // A foot that stands for long counts once a second, so that standing still outweighs no walk and is not lost.
    let most = (rate_hz.round() as usize).max(least);
    let mut rests = Vec::new();
    let mut start = 0;
    while start < path.len() {
        let end = (start..path.len()).find(|&frame| !slow[frame]).unwrap_or(path.len());
        for run in path[start..end].chunks(most).filter(|run| run.len() >= least) {
            let median =
                |axis: usize| quantile(&run.iter().map(|place| place[axis]).collect::<Vec<_>>(), 0.5);
            let place_m = Vector3::new(median(0), median(1), median(2));
            rests.push(Rest { foot, place_m, num_frames: run.len() });
        }
        start = end + 1;
    }
    rests
}

/// The lowest height at which joints rest more than once, metres; `None` where they rest nowhere twice.
///
/// One stance that a recording has too low is no floor: the others would seem to hang above it.
pub(super) fn lowest_height_m(rests: &[Rest]) -> Option<f64> {
    let all: usize = rests.iter().map(|rest| rest.num_frames).sum();
    let mut heights: Vec<f64> = rests.iter().map(|rest| rest.place_m.z).collect();
    heights.sort_by(f64::total_cmp);
    heights.iter().enumerate().find_map(|(index, &height)| {
        let near = rests.iter().filter(|rest| (rest.place_m.z - height).abs() <= SAME_HEIGHT_M);
        let (count, frames) =
            near.fold((0, 0), |(count, frames), rest| (count + 1, frames + rest.num_frames));
        let supported = count > 1 && frames as f64 >= SUPPORT_SHARE * all as f64;
        let far_below = heights.get(index + 1).is_some_and(|next| next - height > LARGEST_FAULT_M);
        (supported || far_below).then_some(height)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rest(height: f64, num_frames: usize) -> Rest {
        Rest { foot: 0, place_m: Vector3::z() * height, num_frames }
    }

    #[test]
    fn one_stance_that_is_too_low_is_no_floor_and_the_foot_of_a_stair_is_one() {
        let walk = [0.031, 0.025, 0.036, 0.028, 0.03].map(|height| rest(height, 60));
        assert_eq!(lowest_height_m(&walk), Some(0.025));
        let wrong = [&walk[..], &[rest(-0.03, 50)]].concat();
        assert_eq!(lowest_height_m(&wrong), Some(0.025));
        let stair = [&walk[..], &[rest(-0.15, 50)]].concat();
        assert_eq!(lowest_height_m(&stair), Some(-0.15));
    }

    #[test]
    fn touches_of_a_moment_are_no_floor_and_a_single_rest_tells_nothing() {
        let stands = [0.03, 0.04, 0.035].map(|height| rest(height, 100));
        let touches = [&stands[..], &[rest(-0.05, 12), rest(-0.045, 12)]].concat();
        assert_eq!(lowest_height_m(&touches), Some(0.03));
        assert_eq!(lowest_height_m(&stands[..1]), None);
        assert_eq!(lowest_height_m(&[]), None);
    }

    #[test]
    fn long_stands_count_once_a_second() {
        let still = vec![Vector3::new(0.1, 0.2, 0.03); 250];
        let rests = rests_of(1, &still, 100.0);
        assert_eq!(rests.iter().map(|rest| rest.num_frames).collect::<Vec<_>>(), [100, 100, 50]);
        assert!(rests.iter().all(|rest| rest.foot == 1 && rest.place_m == still[0]));
    }
}
