//! Recorded motions, where they are at hand: `RPRAE_DATA` names a folder with `kit-ml/dataset` and `kit-ml/mmm-other`.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rprae::dataset::mmm::{read_mmm, write_mmm};
use rprae::dataset::{Dataset, OpenOptions, Sample, Skipped};
use rprae::humanoid::Humanoid;
use rprae::motion::{Motion, filter_jumps, find_jumps};

/// The walks among the recordings.
const WALKS: [&str; 4] = ["00001", "00208", "00212", "01026"];

fn recorded() -> Option<PathBuf> {
    let data = std::env::var_os("RPRAE_DATA").map(|data| Path::new(&data).join("kit-ml"));
    if data.is_none() {
        println!("skipped: RPRAE_DATA is not set, so there are no recorded motions to read");
    }
    data
}

fn load_folder(folder: &Path) -> (Vec<Sample>, Vec<Skipped>) {
    let dataset = Dataset::open(folder, &OpenOptions::default()).unwrap();
    assert!(dataset.skipped().is_empty(), "{:?}", dataset.skipped());
    let (mut samples, mut skipped) = (Vec::new(), Vec::new());
    for entry in dataset.entries() {
        match dataset.load(entry) {
            Ok(sample) => samples.push(sample),
            Err(reason) => skipped.push(reason),
        }
    }
    (samples, skipped)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// What the list of recordings says of each file.
struct Listed {
    height_m: f64,
    num_frames: usize,
    num_joints: usize,
    has_captions: bool,
}

fn listed(data: &Path) -> BTreeMap<String, Listed> {
    let list = std::fs::read_to_string(data.join("motions.tsv")).unwrap();
    let mut lines = list.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let column = |name: &str| header.iter().position(|column| *column == name).unwrap();
    let columns = ["height_m", "frames", "joints", "kitml_captions"].map(column);
    lines
        .map(|fields| {
            let stem = Path::new(fields[0]).file_stem().unwrap().to_str().unwrap();
            let listed = Listed {
                height_m: fields[columns[0]].parse().unwrap(),
                num_frames: fields[columns[1]].parse().unwrap(),
                num_joints: fields[columns[2]].parse().unwrap(),
                has_captions: fields.get(columns[3]).is_some_and(|captions| !captions.is_empty()),
            };
            (stem.trim_end_matches("_mmm").to_owned(), listed)
        })
        .collect()
}

#[test]
fn all_recordings_are_read_or_refused_as_listed() {
    let Some(data) = recorded() else { return };
    let list = listed(&data);
    let (kit, none) = load_folder(&data.join("dataset"));
    let (other, refused) = load_folder(&data.join("mmm-other"));
    assert!(none.is_empty(), "{none:?}");
    assert_eq!((kit.len(), other.len(), refused.len()), (7, 16, 6));

    for sample in kit.iter().chain(&other) {
        let (listed, motion) = (&list[&sample.id], &sample.motion);
        assert_eq!(listed.num_joints, 44, "{}", sample.id);
        assert_eq!(motion.num_frames(), listed.num_frames, "{}", sample.id);
        assert_eq!(motion.rate_hz(), 100.0, "{}", sample.id);
        assert_eq!(motion.body().height_m, listed.height_m, "{}", sample.id);
        assert_eq!(motion.body().mass_kg, 22.5 * listed.height_m * listed.height_m, "{}", sample.id);
        assert!(sample.warnings.is_empty(), "{}: {:?}", sample.id, sample.warnings);
    }
    for sample in &kit {
        assert_eq!(!sample.captions.is_empty(), list[&sample.id].has_captions, "{}", sample.id);
    }
    for skipped in &refused {
        let joints = list[&skipped.id].num_joints;
        println!("refused {}: {}", skipped.id, skipped.reason);
        assert!(joints == 37 || joints == 40);
        assert!(skipped.reason.contains(&format!("the motion has {joints} joints, expected the 44")));
        assert!(skipped.reason.contains("an older MMM model"), "{}", skipped.reason);
    }
}

#[test]
fn what_is_recorded_survives_being_written() {
    let Some(data) = recorded() else { return };
    for sample in load_folder(&data.join("dataset")).0 {
        let written = write_mmm(&sample.motion, &sample.id);
        let read = read_mmm(written.as_bytes(), None).unwrap();
        assert_eq!((read.name, read.motion.rate_hz()), (sample.id, 100.0));
        assert_eq!(read.motion.num_frames(), sample.motion.num_frames());
        for (a, b) in sample.motion.frames().iter().zip(read.motion.frames()) {
            for (a, b) in a.to_channels().iter().zip(b.to_channels()) {
                assert!((a - b).abs() <= 1e-7 * a.abs() + 1e-10, "{a} {b}");
            }
        }
    }
}

/// Displacement of the root along its own forward and right axes (heading only), summed over the motion, metres.
fn travelled(motion: &Motion) -> (f64, f64) {
    let mut sum = (0.0, 0.0);
    for pair in motion.frames().windows(2) {
        let moved: Vec<f64> =
            (0..2).map(|i| pair[1].root_position_m[i] - pair[0].root_position_m[i]).collect();
        let (sin, cos) = pair[0].root_rotation_rad[2].sin_cos();
        // Forward is y of the body: (-sin yaw, cos yaw) in the world.
        sum.0 += -sin * moved[0] + cos * moved[1];
        sum.1 += cos * moved[0] + sin * moved[1];
    }
    sum
}

#[test]
fn walking_goes_forward_on_the_floor() {
    let Some(data) = recorded() else { return };
    let (samples, _) = load_folder(&data.join("dataset"));
    let mut num_walks = 0;
    for sample in samples.iter().filter(|sample| WALKS.contains(&sample.id.as_str())) {
        num_walks += 1;
        let (forward_m, right_m) = travelled(&sample.motion);
        let humanoid = Humanoid::new(sample.motion.body()).unwrap();
        let sole_height_m = median(
            sample
                .motion
                .frames()
                .iter()
                .map(|frame| {
                    let poses = humanoid.forward(frame);
                    humanoid.sole_points_in_world(&poses).map(|point| point.z).fold(f64::INFINITY, f64::min)
                })
                .collect(),
        );
        println!(
            "{}: {forward_m:.2} m forward, {right_m:+.2} m to the right, median sole height {:+.1} mm",
            sample.id,
            1e3 * sole_height_m
        );
        assert!(forward_m > 0.5 && forward_m > 3.0 * right_m.abs(), "{}", sample.id);
        assert!(sole_height_m.abs() < 0.03, "{}: {sole_height_m}", sample.id);
    }
    assert_eq!(num_walks, WALKS.len());
}

#[test]
fn jumps_are_found_and_filtered_where_they_are() {
    let Some(data) = recorded() else { return };
    let mut samples = load_folder(&data.join("dataset")).0;
    samples.extend(load_folder(&data.join("mmm-other")).0);
    let mut num_jumps = 0;
    for sample in samples {
        let (filtered, jumps) = filter_jumps(&sample.motion);
        let mut joints: BTreeMap<&str, usize> = BTreeMap::new();
        for jump in &jumps {
            *joints.entry(jump.joint_name()).or_default() += 1;
        }
        let changed = sample.motion.frames().iter().zip(filtered.frames()).filter(|(a, b)| a != b).count();
        if !jumps.is_empty() {
            println!("{}: {} jumps {joints:?}, {changed} frames changed", sample.id, jumps.len());
        }
        assert_eq!(changed == 0, jumps.is_empty(), "{}", sample.id);
        assert!(changed <= 20 * jumps.len(), "{}", sample.id);
        assert!(find_jumps(&filtered).is_empty(), "{}: {:?}", sample.id, find_jumps(&filtered));
        num_jumps += jumps.len();
    }
    assert!(num_jumps > 0, "the recordings have jumps in toes, midfoot and knees");
}
