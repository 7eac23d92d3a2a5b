use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::dataset::Sample;
use crate::motion::{Body, Frame, Motion};
use crate::plausibility::find_metric;
use crate::simulation::Level;

/// Motions that stand still, each a little longer than the one before.
struct Stands {
    ids: Vec<&'static str>,
    num_loads: AtomicUsize,
}

impl Stands {
    fn new(ids: &[&'static str]) -> Self {
        Self { ids: ids.to_vec(), num_loads: AtomicUsize::new(0) }
    }
}

fn stand(num_frames: usize) -> Motion {
    let body = Body::with_default_mass(1.75);
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = crate::humanoid::ROOT_HEIGHT_FRACTION * body.height_m;
    Motion::new(body, 100.0, vec![frame; num_frames]).unwrap()
}

impl Source for Stands {
    fn name(&self) -> String {
        "stands".to_owned()
    }

    fn ids(&self) -> Vec<String> {
        self.ids.iter().map(|id| (*id).to_owned()).collect()
    }

    fn skipped(&self) -> Vec<SkippedInput> {
        Vec::new()
    }

    fn load(&self, index: usize) -> Result<Sample, SkippedInput> {
        self.num_loads.fetch_add(1, Ordering::Relaxed);
        let id = self.ids[index].to_owned();
        assert_ne!(id, "panics", "the reader is broken");
        if id == "unreadable" {
            let reason = "37 joints, expected 44".to_owned();
            return Err(SkippedInput { id, source: "file.xml".to_owned(), reason });
        }
        Ok(Sample {
            id,
            motion: stand(5 + index),
            captions: vec!["a person stands".to_owned()],
            warnings: Vec::new(),
            source: PathBuf::from("memory"),
        })
    }
}

fn kinematic() -> RunSettings {
    RunSettings { levels: vec![Level::L0], ..RunSettings::default() }
}

fn run_into(path: &Path, source: &Stands, settings: &RunSettings, threads: usize) -> Run {
    let folder = RunFolder::open(path, settings, "stands", false).unwrap();
    let selection = Selection::of(source, &settings.ids, settings.limit).unwrap();
    let run = run(source, &selection, settings, None, &folder, threads, &|_| ()).unwrap();
    publish(&run, &folder, &["l0/skate"]).unwrap();
    run
}

/// All files below a folder except those that hold times, by relative path.
fn files(folder: &Path) -> std::collections::BTreeMap<PathBuf, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.ends_with("timings.json") {
                let bytes = std::fs::read(&path).unwrap();
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), bytes);
            }
        }
    }
    found
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let parent = tempfile::tempdir().unwrap();
    let settings = RunSettings { levels: vec![Level::L0, Level::L2], ..RunSettings::default() };
    let ids = ["a", "b", "c"];
    run_into(&parent.path().join("one"), &Stands::new(&ids), &settings, 1);
    run_into(&parent.path().join("three"), &Stands::new(&ids), &settings, 3);
    let (one, three) = (files(&parent.path().join("one")), files(&parent.path().join("three")));
    assert_eq!(one.keys().collect::<Vec<_>>(), three.keys().collect::<Vec<_>>());
    for (path, bytes) in &one {
        assert!(three[path] == *bytes, "{} differs", path.display());
    }
    assert!(one.contains_key(Path::new("recordings/b.L2.mcap")));
    assert!(one.contains_key(Path::new("cases/c.json")));
}

#[test]
fn finished_cases_are_not_run_again_and_broken_files_are() {
    let parent = tempfile::tempdir().unwrap();
    let source = Stands::new(&["a", "b"]);
    let first = run_into(parent.path(), &source, &kinematic(), 1);
    let before = files(parent.path());
    assert_eq!(first.num_resumed(), 0);
    assert_eq!(run_into(parent.path(), &source, &kinematic(), 1).num_resumed(), 2);
    assert_eq!(files(parent.path()), before);

    let path = parent.path().join("cases").join("a.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, &text[..text.len() / 2]).unwrap();
    assert_eq!(run_into(parent.path(), &source, &kinematic(), 1).num_resumed(), 1);
    assert_eq!(files(parent.path()), before);
}

#[test]
fn a_motion_that_changed_is_run_again() {
    let parent = tempfile::tempdir().unwrap();
    run_into(parent.path(), &Stands::new(&["a", "b"]), &kinematic(), 1);
    // The second motion of this source is longer than the first of the other.
    let run = run_into(parent.path(), &Stands::new(&["", "a"]), &kinematic(), 1);
    assert_eq!(run.num_resumed(), 0);
}

#[test]
fn unreadable_inputs_and_panics_do_not_end_the_run() {
    let parent = tempfile::tempdir().unwrap();
    let run = run_into(parent.path(), &Stands::new(&["a", "panics", "unreadable"]), &kinematic(), 2);
    assert_eq!(run.results.cases.len(), 1);
    let reasons: Vec<&str> = run.results.skipped.iter().map(|input| input.reason.as_str()).collect();
    assert!(reasons[0].contains("the reader is broken"), "{reasons:?}");
    assert_eq!(reasons[1], "37 joints, expected 44");
    assert_eq!(run.manifest.skipped, run.results.skipped);
    assert_eq!(run.manifest.inputs.len(), 1);
}

#[test]
fn a_recording_that_cannot_be_written_fails_the_case_and_is_tried_again() {
    let parent = tempfile::tempdir().unwrap();
    let settings = RunSettings { levels: vec![Level::L2], ..RunSettings::default() };
    let blocked = parent.path().join("recordings").join("a.L2.mcap");
    drop(RunFolder::open(parent.path(), &settings, "stands", false).unwrap());
    std::fs::create_dir(&blocked).unwrap();
    let run = run_into(parent.path(), &Stands::new(&["a"]), &settings, 1);
    let case = &run.results.cases[0];
    assert!(case.failed() && case.failures[0].contains("a.L2.mcap"), "{:?}", case.failures);
    assert!(!case.levels[0].scores.is_empty(), "the recording changes no score");

    std::fs::remove_dir(&blocked).unwrap();
    let run = run_into(parent.path(), &Stands::new(&["a"]), &settings, 1);
    assert!(!run.results.cases[0].failed() && run.num_resumed() == 0);
}

#[test]
fn every_metric_belongs_to_a_level_that_ran() {
    let parent = tempfile::tempdir().unwrap();
    let run = run_into(parent.path(), &Stands::new(&["a"]), &kinematic(), 1);
    assert!(!run.results.aggregates.is_empty());
    for metric in &run.results.metrics {
        assert_eq!(metric.level, Level::L0);
        assert!(find_metric(&metric.key).is_some());
    }
    let case = &run.results.cases[0];
    for (key, _) in case.scores() {
        assert!(run.results.metric(key).is_some(), "{key} is not listed");
    }
}

#[test]
fn selections_are_checked_without_reading_a_motion() {
    let source = Stands::new(&["a", "b", "c"]);
    let select = |ids: &[&str], limit| {
        let ids: Vec<String> = ids.iter().map(|id| (*id).to_owned()).collect();
        Selection::of(&source, &ids, limit).map(|selection| selection.indices)
    };
    assert_eq!(select(&["c", "a"], None), Ok(vec![0, 2]));
    assert_eq!(select(&[], Some(2)), Ok(vec![0, 1]));
    let refused = select(&["a", "z"], None).unwrap_err();
    assert_eq!(refused.to_string(), "select motions: stands has none called z");
    let empty = Selection::of(&Stands::new(&[]), &[], None);
    assert!(matches!(empty, Err(SelectionError::NoMotions { .. })));
    assert_eq!(source.num_loads.load(Ordering::Relaxed), 0);
}
