//! Support by something that is not the floor: a chair, a rail, a wall, a stair.
//!
//! Such motions cannot be simulated on a flat floor, and failing at it says nothing about them.
//! A motion counts as *not simulable* when for half a second or longer
//!
//! - the floor does not explain it: with the best contact forces at soles and at whatever else is near the floor, more than
//!   10 % of body weight or 1.5 % of weight times height is left over;
//! - a part of the body rests in the place where something could hold it: the **seat** (pelvis still, a thigh more than 40
//!   degrees from upright), a **hand** (still, and reaching beyond the centre of mass, or above the head), or a **foot** on a step (still,
//!   5 cm or more above the floor, in a motion that stands on the floor elsewhere);
//! - for seat and hand, the centre of mass is outside the feet by 3 cm or more, wherever the feet are;
//! - a force there takes away at least 70 % of what was left over.
//!
//! Still means slower than 0.2 m/s.
//! A whole motion that hangs too high, slides or jumps has none of this: it stays a fault.

use nalgebra::{Point3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::inverse;
use super::polygon::{convex_hull, margin_m};
use super::success::segment;
use crate::dynamics::{Explainer, ExplanationSettings};
use crate::humanoid::{Humanoid, Side, Solids};
use crate::motion::Motion;
use crate::simulation::GRAVITY_M_S2;

/// What is left over that needs a reason: share of body weight, and of weight times height.
const UNEXPLAINED: (f64, f64) = (0.10, 0.015);
/// Share of it that a support must take away.
const EXPLAINED: f64 = 0.70;
/// Shortest support, and longest gap inside one, seconds.
const LEAST_SECS: f64 = 0.5;
const GAP_SECS: f64 = 0.1;
/// Speed below which a part rests, m/s.
const STILL_M_S: f64 = 0.2;
/// Distance of the centre of mass from the feet that no standing has, metres.
const OFF_FEET_M: f64 = 0.03;
/// Height from which a foot is on a step, and up to which another stands on the floor, metres.
const STEP_M: f64 = 0.05;
const FLOOR_M: f64 = 0.035;
/// Height up to which any part of the body may press on the floor, metres.
const NEAR_FLOOR_M: f64 = 0.05;
/// Cosine of the angle from upright beyond which a thigh sits.
const SITTING: f64 = 0.766;
/// How much farther than the centre of mass a hand must reach in the direction of the lean, metres.
const REACH_M: f64 = 0.10;

/// The part of the body that something holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Prop {
    /// Pelvis and thighs: a chair, a stool.
    Seat,
    /// A hand: a rail, a table, a wall.
    Hand,
    /// A foot above the floor: a stair, a box.
    Foothold,
}

impl Prop {
    /// The word in reports.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Seat => "seat",
            Self::Hand => "hand",
            Self::Foothold => "step",
        }
    }
}

/// Evidence that something other than the floor held the body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PropSupport {
    /// What was held.
    pub prop: Prop,
    /// First moment, seconds.
    pub from_secs: f64,
    /// Last moment, seconds.
    pub to_secs: f64,
    /// Mean force that the floor does not explain, share of body weight.
    pub unexplained_bw: f64,
    /// Mean share of it that a support there takes away.
    pub explained: f64,
}

/// Supports by something other than the floor, by start; empty for a motion that can be simulated.
///
/// The floor is the plane z = 0, as for [`super::inverse_scores`].
#[must_use]
pub fn prop_supports(humanoid: &Humanoid, motion: &Motion) -> Vec<PropSupport> {
    let settings = inverse::settings(motion.rate_hz());
    let explainer = Explainer::new(humanoid, motion, GRAVITY_M_S2, &settings);
    let rate_hz = motion.rate_hz() / settings.stride.max(1) as f64;
    let search = Search::new(humanoid, &explainer, settings);
    let steady = explainer.steady_frames(&settings);
    let findings: Vec<Vec<Finding>> = explainer
        .explained_frames
        .iter()
        .enumerate()
        .map(|(index, &frame)| if steady.contains(&frame) { search.frame(index, frame) } else { Vec::new() })
        .collect();
    let mut supports: Vec<PropSupport> = [Prop::Seat, Prop::Hand, Prop::Foothold]
        .iter()
        .flat_map(|&prop| runs(prop, &findings, rate_hz))
        .collect();
    supports.sort_by(|a, b| a.from_secs.total_cmp(&b.from_secs).then(a.prop.cmp(&b.prop)));
    supports
}

/// One support that explains one frame.
#[derive(Debug, Clone, Copy)]
struct Finding {
    prop: Prop,
    unexplained_bw: f64,
    explained: f64,
}

/// Runs of a prop that last.
fn runs(prop: Prop, findings: &[Vec<Finding>], rate_hz: f64) -> Vec<PropSupport> {
    let (gap, least) = ((GAP_SECS * rate_hz) as usize, LEAST_SECS * rate_hz);
    let mut found: Vec<(usize, usize, Vec<Finding>)> = Vec::new();
    for (index, frame) in findings.iter().enumerate() {
        let Some(finding) = frame.iter().find(|finding| finding.prop == prop) else { continue };
        match found.last_mut() {
            Some((_, last, run)) if index <= *last + 1 + gap => {
                *last = index;
                run.push(*finding);
            }
            _ => found.push((index, index, vec![*finding])),
        }
    }
    let mean =
        |run: &[Finding], value: fn(&Finding) -> f64| run.iter().map(value).sum::<f64>() / run.len() as f64;
    found
        .into_iter()
        .filter(|(first, last, _)| (last - first) as f64 >= least)
        .map(|(first, last, run)| PropSupport {
            prop,
            from_secs: first as f64 / rate_hz,
            to_secs: last as f64 / rate_hz,
            unexplained_bw: mean(&run, |finding| finding.unexplained_bw),
            explained: mean(&run, |finding| finding.explained),
        })
        .collect()
}

/// What is needed to look for supports in a frame.
struct Search<'a> {
    humanoid: &'a Humanoid,
    explainer: &'a Explainer<'a>,
    settings: ExplanationSettings,
    solids: Solids,
    /// Links of the hands, and of thigh and shank of either leg.
    hands: Vec<usize>,
    legs: Vec<[usize; 2]>,
    head: Option<usize>,
    /// Whether a foot rests on the floor anywhere in the motion.
    stands_on_floor: bool,
}

impl<'a> Search<'a> {
    fn new(humanoid: &'a Humanoid, explainer: &'a Explainer<'a>, settings: ExplanationSettings) -> Self {
        let link = |name: &str| segment(humanoid, name).map(|segment| humanoid.segment_links[segment]);
        let leg = |side: &str| Some([link(&format!("{side}_thigh"))?, link(&format!("{side}_shank"))?]);
        let mut search = Self {
            humanoid,
            explainer,
            settings,
            solids: Solids::new(humanoid),
            hands: ["left_hand", "right_hand"].iter().filter_map(|name| link(name)).collect(),
            legs: ["left", "right"].iter().filter_map(|side| leg(side)).collect(),
            head: link("head"),
            stands_on_floor: false,
        };
        let resting = explainer.explained_frames.iter().filter(|&&frame| {
            explainer.carrying(frame, &settings).iter().any(|&point| {
                explainer.soles_m[frame][point].z.abs() < FLOOR_M
                    && explainer.sole_speed_m_s(frame, point) < STILL_M_S
            })
        });
        search.stands_on_floor =
            resting.count() as f64 * settings.stride as f64 >= 0.2 * explainer.trajectory.rate_hz;
        search
    }

    fn frame(&self, index: usize, frame: usize) -> Vec<Finding> {
        let weight_n = self.explainer.weight_n();
        let (weight_height, wanted) = (weight_n * self.humanoid.body.height_m, self.explainer.wanted[index]);
        let solver = self.explainer.solver(self.settings.friction);
        let root = self.explainer.root_m(frame);
        let floor = self.floor_points(frame);
        let size = |raised: &[(Point3<f64>, f64)], grips: &[Point3<f64>]| {
            let points = [floor.as_slice(), raised].concat();
            let found = solver.solve_with_grips(&points, grips, &root, &wanted.force_n, &wanted.moment_nm);
            (found.residual_force_n.norm() / weight_n, found.residual_moment_nm.norm() / weight_height)
        };
        let (force, moment) = size(&[], &[]);
        if force < UNEXPLAINED.0 && moment < UNEXPLAINED.1 {
            return Vec::new();
        }
        // Both in units of what needs a reason.
        let amount = |(force, moment): (f64, f64)| force / UNEXPLAINED.0 + moment / UNEXPLAINED.1;
        let before = amount((force, moment));
        let finding = |prop: Prop, after: (f64, f64)| {
            let explained = 1.0 - amount(after) / before;
            (explained >= EXPLAINED).then_some(Finding { prop, unexplained_bw: force, explained })
        };
        let mut findings = Vec::new();
        if let Some(off_feet) = self.off_feet_m(frame) {
            let seat = self.seat(frame);
            if !seat.is_empty() {
                findings.extend(finding(Prop::Seat, size(&[], &seat)));
            }
            // Hands hang beside a seat; they are asked only where no seat is the reason.
            let hands = self.reaching_hands(frame, &off_feet);
            if findings.is_empty() && !hands.is_empty() {
                findings.extend(finding(Prop::Hand, size(&[], &hands)));
            }
        }
        let steps = self.steps(frame);
        if self.stands_on_floor && !steps.is_empty() {
            findings.extend(finding(Prop::Foothold, size(&steps, &[])));
        }
        findings
    }

    /// Soles, and the lowest point of every other segment, where they are near the floor.
    fn floor_points(&self, frame: usize) -> Vec<(Point3<f64>, f64)> {
        let soles = self.explainer.carrying(frame, &self.settings);
        let mut points: Vec<_> = soles
            .into_iter()
            .map(|point| self.explainer.soles_m[frame][point])
            .map(|point| (point, point.z))
            .collect();
        let poses = &self.explainer.poses[frame];
        for &(link, point) in self.solids.surface() {
            if self.humanoid.sole_points.iter().all(|sole| sole.link != link) {
                let point = poses[link] * point;
                if point.z < NEAR_FLOOR_M {
                    points.push((point, point.z));
                }
            }
        }
        points
    }

    /// Speed of a point of a link, m/s.
    fn speed_m_s(&self, frame: usize, link: usize, point: &Point3<f64>) -> f64 {
        let poses = &self.explainer.poses;
        let (before, after) = (frame.saturating_sub(1), (frame + 1).min(poses.len() - 1));
        let place = |frame: usize| poses[frame][link] * point;
        if before == after {
            return 0.0;
        }
        (place(after) - place(before)).norm() * self.explainer.trajectory.rate_hz / (after - before) as f64
    }

    /// From the feet, whatever their height, to the centre of mass, when it is outside them.
    fn off_feet_m(&self, frame: usize) -> Option<Vector2<f64>> {
        let com = self.humanoid.robot.tree.center_of_mass(&self.explainer.poses[frame]).xy();
        let hull = convex_hull(self.explainer.soles_m[frame].iter().map(|point| point.coords.xy()).collect());
        let margin = margin_m(&hull, &com)?;
        let middle = hull.iter().sum::<Vector2<f64>>() / hull.len() as f64;
        (margin < -OFF_FEET_M).then(|| com - middle)
    }

    fn seat(&self, frame: usize) -> Vec<Point3<f64>> {
        let poses = &self.explainer.poses[frame];
        let sits = self.legs.iter().any(|[thigh, shank]| {
            let along = poses[*shank].translation.vector - poses[*thigh].translation.vector;
            along.try_normalize(1e-9).is_some_and(|along| -along.z < SITTING)
        });
        if !sits || self.speed_m_s(frame, 0, &Point3::origin()) >= STILL_M_S {
            return Vec::new();
        }
        let hips = self.legs.iter().map(|[thigh, _]| Point3::from(poses[*thigh].translation.vector));
        std::iter::once(Point3::from(poses[0].translation.vector)).chain(hips).collect()
    }

    fn reaching_hands(&self, frame: usize, off_feet: &Vector2<f64>) -> Vec<Point3<f64>> {
        let poses = &self.explainer.poses[frame];
        let com = self.humanoid.robot.tree.center_of_mass(poses);
        let Some(direction) = off_feet.try_normalize(1e-9) else { return Vec::new() };
        let head_m = self.head.map_or(f64::INFINITY, |head| poses[head].translation.z);
        self.hands
            .iter()
            .filter(|&&hand| {
                let place: Vector3<f64> = poses[hand].translation.vector;
                let reach = (place - com).xy().dot(&direction);
                (reach > REACH_M || place.z > head_m)
                    && self.speed_m_s(frame, hand, &Point3::origin()) < STILL_M_S
            })
            .map(|&hand| Point3::from(poses[hand].translation.vector))
            .collect()
    }

    /// Sole points of feet that rest above the floor, with their height over the step they would stand on.
    fn steps(&self, frame: usize) -> Vec<(Point3<f64>, f64)> {
        let soles = &self.explainer.soles_m[frame];
        let mut points = Vec::new();
        for side in [Side::Left, Side::Right] {
            let own: Vec<usize> =
                (0..soles.len()).filter(|&point| self.humanoid.sole_points[point].side == side).collect();
            let lowest = own.iter().map(|&point| soles[point].z).fold(f64::INFINITY, f64::min);
            let slowest = own
                .iter()
                .map(|&point| self.explainer.sole_speed_m_s(frame, point))
                .fold(f64::INFINITY, f64::min);
            if lowest >= STEP_M && slowest < STILL_M_S {
                let near = own.iter().filter(|&&point| soles[point].z < lowest + FLOOR_M);
                points.extend(near.map(|&point| (soles[point], soles[point].z - lowest)));
            }
        }
        points
    }
}
