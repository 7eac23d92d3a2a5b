//! Each check sees its own fault in a sound motion, and nothing else; sound motions are clean.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::path::Path;

use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, OpenOptions, Sample};
use rprae::lint::{
    Finding, Linted, Severity, findings_json, findings_junit, findings_text, lint, lint_sample,
};
use rprae::motion::{Frame, JOINTS, Motion, joint_index};

/// The bundled motions that no fault was put into.
fn sound() -> Vec<Sample> {
    let dataset = Dataset::bundled();
    let entries = dataset.entries().iter().filter(|entry| !entry.id.starts_with("909"));
    entries.map(|entry| dataset.load(entry).unwrap()).collect()
}

fn walk() -> Sample {
    sound().remove(0)
}

/// Findings that matter, as code and place.
fn matters(sample: &Sample) -> Vec<Finding> {
    lint_sample(sample).into_iter().filter(|finding| finding.severity > Severity::Info).collect()
}

fn changed(change: impl FnMut(usize, &mut Frame)) -> Vec<Finding> {
    let mut sample = walk();
    sample.motion = sample.motion.map_frames(change).unwrap();
    matters(&sample)
}

fn index(name: &str) -> usize {
    joint_index(name).unwrap()
}

#[track_caller]
fn only(findings: &[Finding], code: &str, severity: Severity, part: &str) {
    assert!(!findings.is_empty(), "nothing was found");
    for finding in findings {
        assert_eq!((finding.code, finding.severity), (code, severity), "{findings:#?}");
    }
    let text = format!("{} {}", findings[0].place, findings[0].message);
    assert!(text.contains(part), "{text} should contain {part}");
}

#[test]
fn sound_motions_are_clean() {
    for sample in sound() {
        assert_eq!(matters(&sample), [], "{}", sample.id);
    }
}

#[test]
fn the_impossible_motions_of_the_suite_are_told() {
    let found: Vec<Linted> =
        lint(&Dataset::bundled(), &|| ()).into_iter().filter(|one| one.id.starts_with("909")).collect();
    let codes: Vec<Vec<&str>> = found
        .iter()
        .map(|one| {
            let matters = one.findings.iter().filter(|finding| finding.severity > Severity::Info);
            matters.map(|finding| finding.code).collect()
        })
        .collect();
    assert_eq!(codes, [vec!["ground-offset"], vec!["constant-channel"], vec!["jump", "constant-channel"]]);
}

#[test]
fn degrees_and_millimetres_are_told() {
    let degrees = changed(|_, frame| {
        frame.joint_angles_rad.iter_mut().for_each(|angle| *angle = angle.to_degrees());
    });
    only(&degrees, "units-angle", Severity::Error, "beyond a full turn");
    let small = changed(|_, frame| frame.root_position_m.iter_mut().for_each(|value| *value *= 1e-3));
    only(&small, "units-length", Severity::Error, "of the origin");
    let large = changed(|_, frame| frame.root_position_m[2] *= 1e3);
    assert!(large.iter().any(|finding| finding.code == "units-length"), "{large:#?}");
}

#[test]
fn y_up_is_told() {
    let findings = changed(|_, frame| {
        let world_from_root = frame.world_from_root();
        let turn = nalgebra::Isometry3::rotation(nalgebra::Vector3::x() * -std::f64::consts::FRAC_PI_2);
        frame.set_world_from_root(&(turn * world_from_root));
    });
    // (x, y, z) with z up becomes (x, z, -y) with y up.
    only(&findings, "axes", Severity::Error, "along y");
}

#[test]
fn limits_are_told_with_joint_and_frame() {
    let knee = index("LKx");
    let findings = changed(|at, frame| {
        if (40..60).contains(&at) {
            frame.joint_angles_rad[knee] = JOINTS[knee].upper_rad + 0.1;
        }
    });
    let limit: Vec<Finding> = findings.into_iter().filter(|finding| finding.code == "joint-limit").collect();
    only(&limit, "joint-limit", Severity::Warning, "LKx, frame 40 20 of");
    // A degree is the tolerance of a fit.
    let findings = changed(|_, frame| {
        frame.joint_angles_rad[knee] = frame.joint_angles_rad[knee].min(0.0) + 0.0;
        frame.joint_angles_rad[index("REx")] = -0.01;
    });
    assert_eq!(findings, []);
}

#[test]
fn jumps_of_joints_and_root_are_told() {
    let elbow = index("LEx");
    let findings = changed(|at, frame| {
        if at == 50 {
            frame.joint_angles_rad[elbow] += 1.0;
        }
    });
    only(&findings, "jump", Severity::Warning, "LEx, frame 5");
    let findings = changed(|at, frame| {
        if at >= 50 {
            frame.root_position_m[0] += 0.5;
        }
    });
    only(&findings, "jump", Severity::Warning, "root, frame 50 the root moves 0.5");
    let findings = changed(|at, frame| {
        if at >= 50 {
            frame.root_rotation_rad[2] += 1.5;
        }
    });
    only(&findings, "jump", Severity::Warning, "root, frame 50 the root turns 86 degrees");
    // A whole turn is none.
    let findings = changed(|at, frame| {
        if at >= 50 {
            frame.root_rotation_rad[2] += std::f64::consts::TAU;
        }
    });
    assert_eq!(findings, []);
}

#[test]
fn gaps_and_a_rate_that_is_not_the_stated_one_are_told() {
    let mut sample = walk();
    let frames = sample.motion.frames().to_vec();
    let with =
        |frames: Vec<Frame>| Motion::new(sample.motion.body(), sample.motion.rate_hz(), frames).unwrap();
    // Eight frames lost to holding the one before, then on as if nothing had been.
    let held = frames
        .iter()
        .enumerate()
        .map(|(at, frame)| if (100..108).contains(&at) { frames[99] } else { *frame });
    let held = with(held.collect());
    let thirty = with((0..frames.len()).map(|at| frames[at / 3 * 3]).collect());
    sample.motion = held;
    let gap: Vec<Finding> = matters(&sample).into_iter().filter(|finding| finding.code != "jump").collect();
    only(&gap, "sampling", Severity::Warning, "frames 99 to 107 the body stops dead for 0.08 s");
    sample.motion = thirty;
    let repeated: Vec<Finding> =
        matters(&sample).into_iter().filter(|finding| finding.code != "jump").collect();
    only(&repeated, "sampling", Severity::Warning, "the rate is lower than stated");
}

#[test]
fn legs_that_were_not_exported_are_told() {
    let findings = changed(|_, frame| frame.joint_angles_rad[index("LKx")] = -0.3);
    let constant: Vec<Finding> =
        findings.into_iter().filter(|finding| finding.code == "constant-channel").collect();
    only(&constant, "constant-channel", Severity::Warning, "LKx it never changes while RKx moves");
}

#[test]
fn swapped_sides_are_told() {
    let mut sample = sound().into_iter().find(|sample| sample.id == "90004").unwrap();
    let reference = sound().remove(3);
    assert_eq!(reference.id, sample.id);
    sample.motion = sample
        .motion
        .map_frames(|_, frame| {
            let angles = frame.joint_angles_rad;
            for (joint, info) in JOINTS.iter().enumerate() {
                if let Some(rest) = info.name.strip_prefix('L') {
                    let right = joint_index(&format!("R{rest}")).unwrap();
                    frame.joint_angles_rad[joint] =
                        angles[right] - if rest == "Sy_joint" { 0.4 } else { 0.0 };
                    frame.joint_angles_rad[right] =
                        angles[joint] + if rest == "Sy_joint" { 0.4 } else { 0.0 };
                }
            }
        })
        .unwrap();
    let found = matters(&sample);
    let sides: Vec<Finding> = found.into_iter().filter(|finding| finding.code == "left-right").collect();
    only(&sides, "left-right", Severity::Error, "with left and right exchanged by 0");
}

#[test]
fn feet_on_the_wrong_sides_are_told() {
    let findings = changed(|_, frame| {
        frame.joint_angles_rad[index("LHy")] = -0.34;
        frame.joint_angles_rad[index("RHy")] = 0.34;
    });
    let sides: Vec<Finding> = findings.into_iter().filter(|finding| finding.code == "left-right").collect();
    only(&sides, "left-right", Severity::Warning, "feet the left foot is to the right");
}

#[test]
fn floating_and_sinking_are_told_in_millimetres() {
    for (shift, part) in [(0.1, "above the floor"), (-0.1, "below the floor")] {
        let findings = changed(|_, frame| frame.root_position_m[2] += shift);
        only(&findings, "ground-offset", Severity::Warning, part);
    }
    assert_eq!(changed(|_, frame| frame.root_position_m[2] += 0.03), []);
}

#[test]
fn unreadable_inputs_have_the_code_of_their_fault() {
    let folder = tempfile::tempdir().unwrap();
    let good = write_mmm(&walk().motion, "s");
    let row = |value: &str| vec![value; 50].join(",") + "\n";
    for (name, text, code) in [
        ("a.xml", good[..good.len() / 2].to_owned(), "schema"),
        ("b.xml", good.replacen("<Joint name='BLNx_joint'/>", "", 1), "model"),
        ("c.xml", good.replacen("<Timestep>0.05</Timestep>", "<Timestep>0.01</Timestep>", 1), "sampling"),
        ("d.csv", row("0") + &row("nan"), "value"),
        ("e.csv", row("20").repeat(5), "units-angle"),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
        let dataset = Dataset::open(&folder.path().join(name), &OpenOptions::default()).unwrap();
        let linted = lint(&dataset, &|| ());
        assert_eq!(linted[0].findings[0].code, code, "{linted:?}");
        assert_eq!(linted[0].worst(), Some(Severity::Error));
    }
}

#[test]
fn findings_are_written_for_people_programs_and_ci() {
    let linted = lint(&Dataset::bundled(), &|| ());
    let text = findings_text(&linted, Severity::Warning);
    assert!(
        text.ends_with("motions: 15, 12 clean; errors: 0, warnings: 4, notes: 15 (shown with --notes)\n"),
        "{text}"
    );
    assert!(text.contains("remedy: shift the root height"), "{text}");
    let json: serde_json::Value = serde_json::from_str(&findings_json(&linted).unwrap()).unwrap();
    assert_eq!((json["num_motions"].as_u64(), json["num_warnings"].as_u64()), (Some(15), Some(4)));
    let failed = |strict| findings_junit(&linted, strict).unwrap().matches("<failure").count();
    assert_eq!((failed(false), failed(true)), (0, 3));
}

#[test]
fn recorded_motions_have_jumps_at_most() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set, so there are no recorded motions to lint");
        return;
    };
    for (folder, num_refused) in [("dataset", 0), ("mmm-other", 6)] {
        let path = Path::new(&data).join("kit-ml").join(folder);
        let linted = lint(&Dataset::open(&path, &OpenOptions::default()).unwrap(), &|| ());
        let codes = |severity| {
            let findings = linted.iter().flat_map(|one| &one.findings);
            findings.filter(|f| f.severity == severity).map(|f| f.code).collect::<Vec<_>>()
        };
        println!("{}", findings_text(&linted, Severity::Info));
        assert_eq!(codes(Severity::Error), vec!["model"; num_refused]);
        assert!(codes(Severity::Warning).iter().all(|code| *code == "jump"), "{linted:?}");
    }
}
