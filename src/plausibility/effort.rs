//! Levels 2 and 3: work of the joints, and what the feet did on the floor.

use nalgebra::{Point3, Vector3};

use super::fall::Observed;
use super::metric::{Better, Metric, PerLevel, Score};
use super::trace::{horizontal_m, mean};
use crate::humanoid::{Humanoid, Side};
use crate::simulation::{Contact, FallRule, GRAVITY_M_S2, Level, Rollout, RolloutSample};

const MM_PER_M: f64 = 1000.0;
/// A way shorter than this has no cost of transport, metres.
const LEAST_WAY_M: f64 = 0.5;
/// Height of the reference's sole that counts as a contact to keep, metres.
const KEPT_M: f64 = 0.02;
/// Largest spread of the points a foot stands on, across, that is an edge, metres.
const EDGE_M: f64 = 0.015;
/// Roll from which a foot can be on its edge: a flat sole of a rigid box may bear on one side too, radians.
const EDGE_ROLL_RAD: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Forces below this share of body weight do not make a foot stand.
const LEAST_LOAD: f64 = 0.05;

const SHARED: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    level: Level::L2,
    better: Better::Lower,
    formula: "",
    empty: "absent for one sample or a failed rollout",
    reference: "this project",
    signature: "",
};

/// Work of the joints, positive and negative alike.
pub(super) static ENERGY: PerLevel = PerLevel::new(
    "l2/energy",
    "l3/energy",
    Metric {
        title: "energy",
        unit: "J/kg",
        formula: "sum over intervals and the 44 joints of |mean torque * joint speed| * interval / body mass; grows with the \
                  motion's length",
        reference: "mechanical work of joint torques (Winter, Biomechanics and Motor Control of Human Movement, chapter 6)",
        signature: "power:abs,torque-interval-mean,speed-at-end|joints:44|mass:body|v:1",
        ..SHARED
    },
);

/// Mean power.
pub(super) static POWER_MEAN: PerLevel = PerLevel::new(
    "l2/power_mean",
    "l3/power_mean",
    Metric {
        title: "power mean",
        unit: "W/kg",
        formula: "energy / duration of the rollout",
        reference: "mechanical work of joint torques (Winter, Biomechanics and Motor Control of Human Movement, chapter 6)",
        signature: "power:abs,torque-interval-mean,speed-at-end|joints:44|mass:body|v:1",
        ..SHARED
    },
);

/// Largest power.
pub(super) static POWER_PEAK: PerLevel = PerLevel::new(
    "l2/power_peak",
    "l3/power_peak",
    Metric {
        title: "power peak",
        unit: "W/kg",
        formula: "max over intervals of the sum over the 44 joints of |mean torque * joint speed| / body mass",
        reference: "mechanical work of joint torques (Winter, Biomechanics and Motor Control of Human Movement, chapter 6)",
        signature: "power:abs,sum44,torque-interval-mean,speed-at-end|mass:body|v:1",
        ..SHARED
    },
);

/// Work per way.
pub(super) static TRANSPORT: PerLevel = PerLevel::new(
    "l2/cost_of_transport",
    "l3/cost_of_transport",
    Metric {
        title: "cost of transport",
        formula: "energy / (9.81 m/s^2 * way of the root over the floor)",
        empty: "absent for a failed rollout or a way below 0.5 m",
        reference: "mechanical cost of transport (Tucker 1975, Am Sci 63:413)",
        signature: "energy:abs|way:root-xy,path|least:0.5m|g:9.81|v:1",
        ..SHARED
    },
);

/// Speed of loaded feet over the floor.
pub(super) static FOOT_SLIP: PerLevel = PerLevel::new(
    "l2/foot_slip",
    "l3/foot_slip",
    Metric {
        title: "foot slip",
        unit: "mm/s",
        formula: "mean, weighted by upward force, over intervals and contacts of the feet of the horizontal speed of the \
                  point of the foot that touches",
        empty: "absent for one sample, a failed rollout, or without foot contact",
        signature: "points:contacts,feet|weight:upward-force|speed:interval|v:1",
        ..SHARED
    },
);

/// Share of standing feet on an edge.
pub(super) static EDGE_CONTACT: PerLevel = PerLevel::new(
    "l2/edge_contact",
    "l3/edge_contact",
    Metric {
        title: "edge contact",
        formula: "share of feet under load (5 % of body weight or more) that are rolled by more than 3 degrees and whose contact \
                  points, weighted by force, spread less than 15 mm across the foot: it stands on an edge, which engines \
                  reward and people avoid",
        empty: "absent for one sample, a failed rollout, or without a loaded foot",
        signature: "points:contacts,feet|across:foot-x|spread:15mm|roll:3deg|load:5%|v:1",
        ..SHARED
    },
);

/// Share of the reference's foot contacts that the body has too.
pub(super) static CONTACT_KEPT: PerLevel = PerLevel::new(
    "l2/contact_kept",
    "l3/contact_kept",
    Metric {
        title: "contact kept",
        better: Better::Higher,
        formula: "share of feet x samples with the reference's sole below 2 cm in which the floor pushes that foot upwards",
        empty: "absent for one sample, a failed rollout, or a reference without foot contact",
        reference: "contact preservation of OmniRetarget (amazon-far/holosoma: evaluation/eval_retargeting.py)",
        signature: "feet:2|reference:sole12<2cm|contact:upward-force>0|v:1",
        ..SHARED
    },
);

pub(super) fn scores(humanoid: &Humanoid, rollout: &Rollout, observed: &Observed<'_>) -> Vec<Score> {
    if observed.failed_at_secs.is_some() {
        return Vec::new();
    }
    let feet = Feet::new(humanoid);
    let (mass_kg, interval_secs) = (humanoid.body.mass_kg, rollout.sample_interval_secs);
    let power_w = |sample: &RolloutSample| {
        let pairs = sample.joint_torques_nm.iter().zip(&sample.joint_velocities_rad_s);
        pairs.map(|(torque, speed)| (torque * speed).abs()).sum::<f64>()
    };
    let intervals = || observed.samples.iter().skip(1);
    let mean_power = mean(intervals().map(power_w)).map(|power| power / mass_kg);
    let energy = mean_power.map(|power| power * intervals().count() as f64 * interval_secs);
    let way_m: f64 = observed
        .samples
        .windows(2)
        .map(|pair| {
            let [before, after] =
                [0, 1].map(|index: usize| pair[index].world_from_segment[0].translation.vector);
            horizontal_m(&(after - before))
        })
        .sum();
    let transport = energy.filter(|_| way_m >= LEAST_WAY_M).map(|energy| energy / (GRAVITY_M_S2 * way_m));
    [
        (&ENERGY, energy),
        (&POWER_MEAN, mean_power),
        (&POWER_PEAK, intervals().map(power_w).max_by(f64::total_cmp).map(|power| power / mass_kg)),
        (&TRANSPORT, transport),
        (&FOOT_SLIP, feet.slip_m(observed).map(|step| step / interval_secs * MM_PER_M)),
        (&EDGE_CONTACT, feet.edge_share(observed)),
        (&CONTACT_KEPT, feet.kept_share(observed)),
    ]
    .into_iter()
    .filter_map(|(metric, value)| Score::new(metric.of(rollout.level), value?))
    .collect()
}

/// Which segments are feet, and of which side.
struct Feet<'a> {
    humanoid: &'a Humanoid,
    side_of_segment: Vec<Option<usize>>,
}

impl<'a> Feet<'a> {
    fn new(humanoid: &'a Humanoid) -> Self {
        let rule = FallRule::new(humanoid);
        let side = |(segment, link): (usize, &usize)| {
            let point = humanoid.sole_points.iter().find(|point| point.link == *link);
            point.filter(|_| rule.is_foot(segment)).map(|point| usize::from(point.side == Side::Right))
        };
        Self { humanoid, side_of_segment: humanoid.segment_links.iter().enumerate().map(side).collect() }
    }

    /// The contacts that carry this foot.
    fn loaded<'s>(&'s self, sample: &'s RolloutSample, side: usize) -> impl Iterator<Item = &'s Contact> {
        let on_side = move |contact: &&Contact| {
            contact.bears_load() && self.side_of_segment[contact.segment] == Some(side)
        };
        sample.contacts.iter().filter(on_side)
    }

    /// Force-weighted mean horizontal step of the touching points over an interval, metres.
    fn slip_m(&self, observed: &Observed<'_>) -> Option<f64> {
        let (mut slip, mut load) = (0.0, 0.0);
        for pair in observed.samples.windows(2) {
            for contact in (0..2).flat_map(|side| self.loaded(&pair[1], side)) {
                let now = &pair[1].world_from_segment[contact.segment];
                let before = &pair[0].world_from_segment[contact.segment];
                let was = before * now.inverse_transform_point(&contact.position_m);
                slip += contact.force_n.z * horizontal_m(&(contact.position_m - was));
                load += contact.force_n.z;
            }
        }
        (load > 0.0).then(|| slip / load)
    }

    fn edge_share(&self, observed: &Observed<'_>) -> Option<f64> {
        let least_n = LEAST_LOAD * self.humanoid.body.mass_kg * GRAVITY_M_S2;
        let samples =
            observed.samples.iter().skip(1).flat_map(|sample| (0..2).map(move |side| (sample, side)));
        mean(samples.filter_map(|(sample, side)| {
            let loaded: Vec<&Contact> = self.loaded(sample, side).collect();
            let force_n: f64 = loaded.iter().map(|contact| contact.force_n.z).sum();
            if force_n < least_n {
                return None;
            }
            // Across the foot: the x axis of its rear part.
            let rear = self.side_of_segment.iter().position(|&of| of == Some(side))?;
            let across = sample.world_from_segment[rear].rotation * Vector3::x();
            let place = |point: &Point3<f64>| point.coords.dot(&across);
            let middle: f64 =
                loaded.iter().map(|contact| contact.force_n.z * place(&contact.position_m)).sum::<f64>()
                    / force_n;
            let variance: f64 = loaded
                .iter()
                .map(|contact| contact.force_n.z * (place(&contact.position_m) - middle).powi(2))
                .sum::<f64>()
                / force_n;
            // Two equal loads at the ends of a line deviate by half its length.
            let is_rolled = across.z.abs() > EDGE_ROLL_RAD.sin();
            Some(f64::from(is_rolled && 2.0 * variance.sqrt() < EDGE_M))
        }))
    }

    fn kept_share(&self, observed: &Observed<'_>) -> Option<f64> {
        let segment_of = |link: usize| self.humanoid.segment_links.iter().position(|&other| other == link);
        let samples =
            observed.samples.iter().skip(1).flat_map(|sample| (0..2).map(move |side| (sample, side)));
        mean(samples.filter_map(|(sample, side)| {
            let points = self
                .humanoid
                .sole_points
                .iter()
                .filter(|point| usize::from(point.side == Side::Right) == side);
            let lowest = points
                .filter_map(|point| {
                    let pose = &sample.reference_world_from_segment[segment_of(point.link)?];
                    Some((pose * point.point_in_link_m).z)
                })
                .min_by(f64::total_cmp)?;
            (lowest < KEPT_M).then(|| f64::from(u8::from(self.loaded(sample, side).next().is_some())))
        }))
    }
}
