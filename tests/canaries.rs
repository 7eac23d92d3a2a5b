//! The metrics see the faults put into clean motions, and nothing where nothing is wrong.
//!
//! Minutes long without optimisation; recorded motions join in where `RPRAE_DATA` names a folder with them.

use std::path::Path;

use rprae::canaries::{Clip, Fault, Report, run};
use rprae::dataset::{Dataset, OpenOptions};

fn clips(dataset: &Dataset, wanted: impl Fn(&str) -> bool) -> Vec<Clip> {
    let entries = dataset.entries().iter().filter(|entry| wanted(&entry.id));
    let samples = entries.filter_map(|entry| dataset.load(entry).ok());
    samples.map(|sample| Clip { id: sample.id, motion: sample.motion }).collect()
}

#[track_caller]
fn check(report: &Report) {
    let missed: Vec<String> = report
        .verdicts
        .iter()
        .filter(|verdict| !verdict.holds)
        .map(|verdict| format!("{:?}", (verdict.requirement, verdict.area, verdict.paired)))
        .collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn a_walk_and_a_gesture_of_the_suite_give_every_alarm_they_should() {
    let report =
        run(&clips(&Dataset::bundled(), |id| ["90001", "90006"].contains(&id)), None, 0, &|_| {}).unwrap();
    assert_eq!((report.clips.len(), report.locomotion.as_slice()), (2, ["90001".to_owned()].as_slice()));
    let area = |metric: &str, fault| report.cell(metric, fault).unwrap().area;
    assert_eq!(area("l0/float", Fault::Float), 1.0);
    assert_eq!(area("l0/heading_speed", Fault::TimeReversal), 0.0);
    check(&report);
}

#[test]
fn recorded_walks_give_every_alarm_they_should() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set");
        return;
    };
    let folder = Path::new(&data).join("kit-ml/dataset");
    let dataset = Dataset::open(&folder, &OpenOptions::default()).unwrap();
    let walks = clips(&dataset, |id| ["00001", "00208", "00212", "01026"].contains(&id));
    assert_eq!(walks.len(), 4);
    check(&run(&walks, None, 0, &|_| {}).unwrap());
}
