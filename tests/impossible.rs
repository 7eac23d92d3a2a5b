//! The three impossible motions of the bundled suite stand outside the range of all possible ones.

use std::collections::BTreeMap;

use rprae::dataset::Dataset;
use rprae::humanoid::Humanoid;
use rprae::plausibility::kinematic_scores;

/// Each impossible motion, the metric meant for its fault, and how far apart from every possible motion it must be.
const IMPOSSIBLE: [(&str, &str, f64); 3] = [
    // A body that never comes near the floor, millimetres.
    ("90901", "l0/lowest_point_min", 50.0),
    // Feet that never stand, mm/s.
    ("90902", "l0/slowest_contact_speed", 100.0),
    // Elsewhere from one frame to the next, m/s; a sprinter reaches 12.
    ("90903", "l0/root_speed_peak", 20.0),
];

type Scores = BTreeMap<&'static str, f64>;

/// Level 0 scores of every bundled motion by id.
fn bundled_scores() -> BTreeMap<String, Scores> {
    let dataset = Dataset::bundled();
    let scores = dataset.entries().iter().map(|entry| {
        let sample = dataset.load(entry).unwrap_or_else(|skipped| panic!("{skipped:?}"));
        let humanoid = Humanoid::new(sample.motion.body()).unwrap_or_else(|error| panic!("{error}"));
        let scores = kinematic_scores(&humanoid, &sample.motion);
        (sample.id, scores.iter().map(|score| (score.metric.key, score.value)).collect())
    });
    scores.collect()
}

#[test]
fn each_impossible_motion_is_outside_the_range_of_the_possible_on_its_own_metric_only() {
    let all = bundled_scores();
    let is_possible = |id: &str| IMPOSSIBLE.iter().all(|(impossible, ..)| *impossible != id);
    assert!(all.keys().filter(|id| is_possible(id)).count() >= 10, "{:?}", all.keys());
    for (fault, metric, margin) in IMPOSSIBLE {
        let worst_possible = all
            .iter()
            .filter(|(id, _)| is_possible(id))
            .filter_map(|(_, scores)| scores.get(metric))
            .fold(f64::NEG_INFINITY, |worst, &value| worst.max(value));
        for (id, ..) in IMPOSSIBLE {
            // A motion without the score has nothing to measure: no foot comes near the floor.
            let Some(&value) = all[id].get(metric) else { continue };
            println!("{metric}: {id} {value:.3}, possible up to {worst_possible:.3}");
            if id == fault {
                assert!(
                    value > worst_possible + margin,
                    "{id} has {metric} {value}, possible: {worst_possible}"
                );
            } else {
                assert!(value <= worst_possible + margin / 10.0, "{id} also breaks {metric}: {value}");
            }
        }
        assert!(all[fault].contains_key(metric), "{fault} has no {metric}");
    }
}
