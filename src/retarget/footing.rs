//! How the feet of a source stand, and what that changes for ours: the height of the floor, and feet and toes turned level.

use nalgebra::{UnitQuaternion, UnitVector3, Vector3};

use super::Correspondence;
use super::role::Segment;
use super::source::{Source, SourceFrame};
use super::stance::{Stance, quantile};

/// Time in which toes come down before a stance and leave the floor after it, seconds.
const TOES_FADE_SECS: f64 = 0.1;
/// Largest turn by which the standing soles of a source are levelled, radians.
const LARGEST_LEVELLING_RAD: f64 = 0.35;
/// A sole turned further than this does not stand flat, whatever height and speed say, radians.
const NOT_STANDING_RAD: f64 = 0.8;
/// Largest difference between the heights of the two ankles in stance that is taken for a matter of the source's feet;
/// a larger one is a step of the floor, metres.
const LARGEST_STEP_M: f64 = 0.05;
/// Largest distance by which a clip is lowered to stand on the floor, metres: beyond it, it may hang or climb.
/// Raised it is by any distance, since nobody stands below the floor.
const LARGEST_GROUND_SHIFT_M: f64 = 0.15;

const FEET: [Segment; 2] = [Segment::LeftFoot, Segment::RightFoot];

/// How the feet of a source stand.
#[derive(Clone)]
pub(super) struct Footing {
    pub stance: Stance,
    /// How far the toes of each foot lie on the floor, flat foot or raised heel, by frame (0 to 1).
    pub toes_lie: Vec<[f64; 2]>,
    /// Height of our standing ankle, metres.
    pub ankle_height_m: f64,
    /// Height of the standing ankle in the source, per foot and for both, metres.
    pub source_ankles_m: [f64; 2],
    pub source_ankle_m: f64,
    /// What is assumed, as sentences for a person.
    pub notes: Vec<String>,
    /// Turns the source's foot axes so that its standing sole is level (left, right).
    levelling: [UnitQuaternion<f64>; 2],
    /// Slope of the source's toes when its feet stand flat, radians, positive with the tip up (left, right).
    toe_slopes_rad: [f64; 2],
}

impl Footing {
    /// `ankle_height_m` is that of our standing ankle.
    pub(super) fn new(source: &Source, correspondence: &Correspondence, ankle_height_m: f64) -> Self {
        let stance =
            Stance::of(&source.foot_paths(), source.rate_hz, |frame, foot| is_level(source, frame, foot));
        let mut footing = Self {
            stance,
            toes_lie: vec![[0.0; 2]; source.frames.len()],
            ankle_height_m,
            source_ankles_m: [0.0; 2],
            source_ankle_m: 0.0,
            notes: Vec::new(),
            levelling: [UnitQuaternion::identity(); 2],
            toe_slopes_rad: [0.0; 2],
        };
        footing.find_floor(correspondence);
        if !correspondence.same_body {
            footing.toes_lie = footing.stance.nearness(TOES_FADE_SECS * source.rate_hz);
            footing.level_soles(source);
            footing.level_toes(source);
        }
        footing
    }

    /// Height by which the clip is moved to stand on our floor, metres.
    pub(super) fn ground_shift_m(&self) -> f64 {
        self.ankle_height_m - self.source_ankle_m
    }

    /// Our up axis (0) or forward axis (1) of a foot, where the source's is as it is in this frame, levelled there.
    pub(super) fn levelled_foot(&self, foot: usize, frame: &SourceFrame, axis: usize) -> Vector3<f64> {
        let [up, forward] = frame.axes[FEET[foot] as usize];
        let local = if axis == 0 { Vector3::z() } else { Vector3::y() };
        let turned = self.levelling[foot].inverse() * local;
        forward.cross(&up) * turned.x + forward * turned.y + up * turned.z
    }

    /// Heights of the standing ankles: one for each foot where they differ as feet do, else one for both.
    fn find_floor(&mut self, correspondence: &Correspondence) {
        let [left, right] = self.stance.ankle_height_m;
        let common = (left + right) / 2.0;
        let is_step = (left - right).abs() > LARGEST_STEP_M;
        let shift = self.ankle_height_m - if is_step { left.min(right) } else { common };
        let bounded = shift.max(-LARGEST_GROUND_SHIFT_M);
        if bounded != shift {
            self.notes.push(format!(
                "the ankles stand at {:.0} mm, ours at {:.0} mm; the clip is moved by {:+.0} mm only",
                1e3 * (self.ankle_height_m - shift),
                1e3 * self.ankle_height_m,
                1e3 * bounded
            ));
        } else if shift > LARGEST_GROUND_SHIFT_M {
            self.notes.push(format!(
                "the ankles stand at {:.0} mm, below every floor; the clip is raised by {:.0} mm",
                1e3 * (self.ankle_height_m - shift),
                1e3 * shift
            ));
        }
        self.source_ankle_m = self.ankle_height_m - bounded;
        let both = [self.source_ankle_m; 2];
        self.source_ankles_m = if is_step || correspondence.same_body || bounded != shift {
            both
        } else {
            self.stance.ankle_height_m
        };
        if is_step {
            self.notes.push(format!(
                "the feet stand at heights {:.0} mm apart, which is kept as a step of the floor",
                1e3 * (left - right).abs()
            ));
        }
    }

    /// Finds how the source's feet are turned against the floor when they stand flat, and turns them back.
    fn level_soles(&mut self, source: &Source) {
        for (foot, segment) in FEET.into_iter().enumerate() {
            let floor_in_foot: Vec<Vector3<f64>> = source
                .frames
                .iter()
                .zip(&self.stance.flat)
                .filter(|(_, flat)| flat[foot])
                .filter_map(|(frame, _)| {
                    let [up, forward] = frame.axes[segment as usize];
                    let right = forward.cross(&up);
                    let floor = Vector3::new(right.z, forward.z, up.z);
                    floor.x.is_finite().then_some(floor)
                })
                .collect();
            if floor_in_foot.is_empty() {
                continue;
            }
            let median = |axis: usize| {
                quantile(&floor_in_foot.iter().map(|floor| floor[axis]).collect::<Vec<_>>(), 0.5)
            };
            let floor = Vector3::new(median(0), median(1), median(2));
            let Some(turn) = UnitQuaternion::rotation_between(&floor, &Vector3::z()) else { continue };
            let angle = turn.angle();
            if angle <= LARGEST_LEVELLING_RAD {
                self.levelling[foot] = turn;
            } else {
                self.levelling[foot] = turn.powf(LARGEST_LEVELLING_RAD / angle);
                self.notes.push(format!(
                    "the {} sole stands {:.0} degrees off level, of which {:.0} are taken away",
                    if foot == 0 { "left" } else { "right" },
                    angle.to_degrees(),
                    LARGEST_LEVELLING_RAD.to_degrees()
                ));
            }
        }
    }

    /// Finds how far the source's toes point up or down when their feet stand flat.
    fn level_toes(&mut self, source: &Source) {
        for (foot, segment) in [Segment::LeftToes, Segment::RightToes].into_iter().enumerate() {
            let slopes: Vec<f64> = source
                .frames
                .iter()
                .zip(&self.stance.flat)
                .filter(|(_, flat)| flat[foot])
                .map(|(frame, _)| frame.axes[segment as usize][1].z)
                .filter(|slope| slope.is_finite())
                .map(|slope| slope.clamp(-1.0, 1.0).asin())
                .collect();
            if !slopes.is_empty() {
                self.toe_slopes_rad[foot] =
                    quantile(&slopes, 0.5).clamp(-LARGEST_LEVELLING_RAD, LARGEST_LEVELLING_RAD);
            }
        }
    }

    /// The toes' forward axis, as far up or down as when they stand level.
    pub(super) fn levelled_toes(
        &self,
        foot: usize,
        frame: &SourceFrame,
        forward: Vector3<f64>,
    ) -> Vector3<f64> {
        let [up, ahead] = frame.axes[FEET[foot] as usize];
        match UnitVector3::try_new(ahead.cross(&up), 1e-6) {
            // A positive turn about the right lifts the tip.
            Some(right) => UnitQuaternion::from_axis_angle(&right, -self.toe_slopes_rad[foot]) * forward,
            None => forward,
        }
    }
}

/// Whether a sole may lie flat on the floor; one whose orientation the source does not tell may.
fn is_level(source: &Source, frame: usize, foot: usize) -> bool {
    let segment = FEET[foot];
    let up = source.frames[frame].axes[segment as usize][0];
    up.z.is_nan() || up.z >= NOT_STANDING_RAD.cos()
}
