//! Level 0 scores of recorded KIT motions lie where recordings of real people must lie.
//!
//! The recordings are not part of the project; `RPRAE_DATA` names the folder that holds them.

use std::collections::BTreeMap;
use std::path::Path;

use rprae::dataset::{Dataset, OpenOptions};
use rprae::humanoid::Humanoid;
use rprae::plausibility::{METRICS, kinematic_scores};
use rprae::simulation::Level;

/// What recordings of people who stand, gesture, walk and are pushed may score.
const RANGES: [(&str, f64, f64); 8] = [
    // Nobody exceeds the limits of the model the recordings were fitted to.
    ("l0/joint_limit_excess", 0.0, 0.0),
    // The fitted floor is off by up to 3 cm.
    ("l0/lowest_point_median", -30.0, 30.0),
    ("l0/penetration", 0.0, 30.0),
    ("l0/float", 0.0, 30.0),
    // Nobody is a statue, and nobody runs.
    ("l0/dynamic_degree", 0.05, 5.0),
    ("l0/root_speed_peak", 0.0, 5.0),
    // One foot stands most of the time, even when pushed.
    ("l0/slowest_contact_speed", 0.0, 100.0),
    ("l0/foot_skate_ratio", 0.0, 0.4),
];

#[test]
fn recorded_people_score_as_people() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA does not name the folder of recordings");
        return;
    };
    let mut found: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut num_motions = 0;
    for folder in ["kit-ml/dataset", "kit-ml/mmm-other"] {
        let dataset = Dataset::open(&Path::new(&data).join(folder), &OpenOptions::default()).unwrap();
        for sample in dataset.entries().iter().filter_map(|entry| dataset.load(entry).ok()) {
            let humanoid = Humanoid::new(sample.motion.body()).unwrap();
            for score in kinematic_scores(&humanoid, &sample.motion) {
                found.entry(score.metric.key).or_default().push(score.value);
            }
            num_motions += 1;
        }
    }
    assert!(num_motions >= 20, "{num_motions} recordings");
    for metric in METRICS.iter().filter(|metric| metric.level == Level::L0) {
        let values = found.entry(metric.key).or_default();
        values.sort_unstable_by(f64::total_cmp);
        let (least, most) = (values[0], values[values.len() - 1]);
        println!(
            "{:28} {least:12.4} {:12.4} {most:12.4} {}",
            metric.key,
            values[values.len() / 2],
            metric.unit
        );
        assert_eq!(values.len(), num_motions, "{} of every recording", metric.key);
    }
    for (key, lowest, highest) in RANGES {
        let values = &found[key];
        assert!(
            values[0] >= lowest && values[values.len() - 1] <= highest,
            "{key} leaves {lowest} to {highest}"
        );
    }
}
