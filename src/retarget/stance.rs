//! When the feet of the source stand, and how high its ankles are then.

use super::Role;
use super::source::Source;

/// A foot stands while its toe is at most this far above its lowest, metres,
const TOE_HEIGHT_M: f64 = 0.03;
/// and moves at most this fast, metres per second.
const TOE_SPEED_M_S: f64 = 0.35;
/// It stands flat while its ankle is also at most this far above the ankle's lowest, metres,
const ANKLE_HEIGHT_M: f64 = 0.03;
/// and moves at most this fast, metres per second.
const ANKLE_SPEED_M_S: f64 = 0.25;
/// The lowest height is this quantile over the clip, so that single bad frames do not decide.
const LOWEST_SHARE: f64 = 0.03;
/// Half of the interval over which speeds are taken, seconds.
const SPEED_REACH_SECS: f64 = 0.025;

/// Stance of both feet (left, right) of a source.
#[derive(Debug)]
pub(super) struct Stance {
    /// Whether each foot stands, by frame.
    pub stands: Vec<[bool; 2]>,
    /// Whether each foot stands flat, by frame.
    pub flat: Vec<[bool; 2]>,
    /// Height of each ankle in the source while its foot stands flat, median, metres.
    pub ankle_height_m: [f64; 2],
}

const ANKLES: [Role; 2] = [Role::LeftAnkle, Role::RightAnkle];
const TOES: [Role; 2] = [Role::LeftToe, Role::RightToe];

impl Stance {
    pub(super) fn of(source: &Source) -> Self {
        let count = source.frames.len();
        let mut stance =
            Self { stands: vec![[false; 2]; count], flat: vec![[false; 2]; count], ankle_height_m: [f64::NAN; 2] };
        for foot in 0..2 {
            let heights =
                |role: Role| source.frames.iter().map(move |frame| frame.centre(role).z).collect::<Vec<f64>>();
            let (toe, ankle) = (heights(TOES[foot]), heights(ANKLES[foot]));
            let (toe_floor, ankle_floor) = (quantile(&toe, LOWEST_SHARE), quantile(&ankle, LOWEST_SHARE));
            let toe_speed = speeds(source, TOES[foot]);
            let ankle_speed = speeds(source, ANKLES[foot]);
            for frame in 0..count {
                let stands = toe[frame] < toe_floor + TOE_HEIGHT_M && toe_speed[frame] < TOE_SPEED_M_S;
                let flat = stands
                    && ankle[frame] < ankle_floor + ANKLE_HEIGHT_M
                    && ankle_speed[frame] < ANKLE_SPEED_M_S;
                stance.stands[frame][foot] = stands;
                stance.flat[frame][foot] = flat;
            }
            let standing: Vec<f64> =
                ankle.iter().zip(&stance.flat).filter(|(_, flat)| flat[foot]).map(|(height, _)| *height).collect();
            stance.ankle_height_m[foot] =
                if standing.is_empty() { ankle_floor } else { quantile(&standing, 0.5) };
        }
        stance
    }
}

/// A quantile of values of which there is at least one.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    let index = ((values.len() as f64 - 1.0) * share).round() as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}

/// Speed of a joint centre by frame, metres per second.
pub(super) fn speeds(source: &Source, role: Role) -> Vec<f64> {
    let reach = ((SPEED_REACH_SECS * source.rate_hz).round() as usize).max(1);
    let last = source.frames.len() - 1;
    (0..=last)
        .map(|frame| {
            let (before, after) = (frame.saturating_sub(reach), (frame + reach).min(last));
            let way = source.frames[after].centre(role) - source.frames[before].centre(role);
            // A single frame has no speed.
            way.norm() * source.rate_hz / (after - before).max(1) as f64
        })
        .collect()
}
