//! Levels 2 and 3: the forces a rollout took, from outside, from the ground and from the joints.

use nalgebra::Vector3;

use super::fall::Observed;
use super::joints::limits_in_kit_order;
use super::metric::{Better, Metric, PerLevel, Score};
use super::trace::mean;
use crate::humanoid::Humanoid;
use crate::motion::NUM_JOINTS;
use crate::simulation::{Contact, GRAVITY_M_S2, Level, Rollout, RolloutSample};

/// Share of the torque limit that counts as reaching it.
const AT_LIMIT: f64 = 0.99;

/// Assist force added up over time.
pub(super) static ASSIST_IMPULSE: Metric = Metric {
    key: "l2/assist_impulse",
    title: "assist impulse",
    unit: "N s/kg",
    level: Level::L2,
    better: Better::Lower,
    formula: "sum over intervals of |mean assist force| * interval / body mass; grows with the motion's length",
    empty: "absent for one sample or a failed rollout",
    reference: "this project; residual force of UHC (Luo et al. 2021)",
    signature: "force:interval-mean|mass:body|v:1",
};

/// Assist moment added up over time.
pub(super) static ASSIST_MOMENT_IMPULSE: Metric = Metric {
    key: "l2/assist_moment_impulse",
    title: "assist moment impulse",
    unit: "N m s/kg",
    level: Level::L2,
    better: Better::Lower,
    formula: "sum over intervals of |mean assist moment| * interval / body mass; grows with the motion's length",
    empty: "absent for one sample or a failed rollout",
    reference: "this project; residual force of UHC (Luo et al. 2021)",
    signature: "moment:interval-mean|mass:body|v:1",
};

/// Mean assist force in body weights.
pub(super) static ASSIST_MEAN: Metric = Metric {
    key: "l2/assist_mean",
    title: "assist",
    unit: "% BW",
    level: Level::L2,
    better: Better::Lower,
    formula: "100 * mean over intervals of |mean assist force| / (body mass * 9.81 m/s^2)",
    empty: "absent for one sample or a failed rollout",
    reference: "this project; residual force of UHC (Luo et al. 2021)",
    signature: "force:interval-mean|mass:body|g:9.81|v:1",
};

/// Share of the time on the ground.
pub(super) static CONTACT_SHARE: PerLevel = PerLevel::new(
    "l2/contact_share",
    "l3/contact_share",
    Metric {
        key: "",
        title: "contact",
        unit: "",
        level: Level::L2,
        better: Better::Neither,
        formula: "intervals in which the floor pushes any segment upwards / intervals",
        empty: "absent for one sample or a failed rollout",
        reference: "this project",
        signature: "contact:upward-force>0,any-segment|v:1",
    },
);

/// Mean vertical ground force.
pub(super) static VERTICAL_FORCE_MEAN: PerLevel = PerLevel::new(
    "l2/vertical_force_mean",
    "l3/vertical_force_mean",
    Metric {
        key: "",
        title: "vertical force, mean",
        unit: "BW",
        level: Level::L2,
        better: Better::Neither,
        formula: "mean over intervals of F_z / (body mass * 9.81 m/s^2), F the sum of the floor's forces on the body; \
                  1 for a body that ends as fast as it began and had no help",
        empty: "absent for one sample or a failed rollout",
        reference: "this project",
        signature: "force:interval-mean|mass:body|g:9.81|v:1",
    },
);

/// Peak vertical ground force.
pub(super) static VERTICAL_FORCE_PEAK: PerLevel = PerLevel::new(
    "l2/vertical_force_peak",
    "l3/vertical_force_peak",
    Metric {
        key: "",
        title: "vertical force, peak",
        unit: "BW",
        level: Level::L2,
        better: Better::Neither,
        formula: "max over intervals of F_z / (body mass * 9.81 m/s^2); a longer interval smooths the peak",
        empty: "absent for one sample or a failed rollout",
        reference: "this project",
        signature: "force:interval-mean|window:record-interval|mass:body|g:9.81|v:1",
    },
);

/// Share of joints at their torque limit.
pub(super) static TORQUE_LIMIT_SHARE: PerLevel = PerLevel::new(
    "l2/torque_limit_share",
    "l3/torque_limit_share",
    Metric {
        key: "",
        title: "torque at limit",
        unit: "",
        level: Level::L2,
        better: Better::Lower,
        formula: "intervals x joints with |mean torque| >= 0.99 * effort limit / intervals x joints",
        empty: "absent for one sample or a failed rollout",
        reference: "effort limits of the URDF, from published human joint strength",
        signature: "torque:interval-mean|at:0.99|limits:urdf|joints:44|v:1",
    },
);

/// Scores of a rollout's forces; none when it failed, since the missing part cannot be averaged away.
///
/// The first sample is the start state and closes no interval.
pub(super) fn scores(humanoid: &Humanoid, rollout: &Rollout, observed: &Observed<'_>) -> Vec<Score> {
    if observed.failed_at_secs.is_some() {
        return Vec::new();
    }
    let intervals = || observed.samples.iter().skip(1);
    let mass_kg = humanoid.body.mass_kg;
    let weight_n = mass_kg * GRAVITY_M_S2;
    let mut scores = Vec::new();

    if rollout.level == Level::L2 {
        let mean_size =
            |of: fn(&RolloutSample) -> Vector3<f64>| mean(intervals().map(|sample| of(sample).norm()));
        let force_n = mean_size(|sample| sample.assist_force_n);
        let moment_nm = mean_size(|sample| sample.assist_moment_nm);
        // Intervals are equally long: the sum over time is the mean times the time.
        let assisted_secs = intervals().count() as f64 * rollout.sample_interval_secs;
        scores.extend([
            (&ASSIST_IMPULSE, force_n.map(|force| force * assisted_secs / mass_kg)),
            (&ASSIST_MOMENT_IMPULSE, moment_nm.map(|moment| moment * assisted_secs / mass_kg)),
            (&ASSIST_MEAN, force_n.map(|force| 100.0 * force / weight_n)),
        ]);
    }

    let vertical_bw = || intervals().map(|sample| sample.ground_force_n().z / weight_n);
    let touches = |sample: &RolloutSample| sample.contacts.iter().any(Contact::bears_load);
    let limits = limits_in_kit_order(humanoid);
    let share_at_limit = |sample: &RolloutSample| {
        let at_limit =
            |(torque, limit): (&f64, &crate::robot::JointLimits)| torque.abs() >= AT_LIMIT * limit.effort_nm;
        let num_at_limit = sample.joint_torques_nm.iter().zip(&limits).filter(|&pair| at_limit(pair)).count();
        num_at_limit as f64 / NUM_JOINTS as f64
    };
    let both = [
        (&CONTACT_SHARE, mean(intervals().map(|sample| f64::from(touches(sample))))),
        (&VERTICAL_FORCE_MEAN, mean(vertical_bw())),
        (&VERTICAL_FORCE_PEAK, vertical_bw().max_by(f64::total_cmp)),
        (&TORQUE_LIMIT_SHARE, mean(intervals().map(share_at_limit))),
    ];
    scores.extend(both.map(|(metric, value)| (metric.of(rollout.level), value)));
    scores.into_iter().filter_map(|(metric, value)| Score::new(metric, value?)).collect()
}
