//! The programs as their users meet them: arguments in, exit code, tables and files out.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn call(program: &str, args: &[&str], folder: &Path) -> Output {
    Command::new(program).args(args).current_dir(folder).env_remove("CARGO").output().unwrap()
}

fn eval_sim(args: &[&str], folder: &Path) -> Output {
    call(env!("CARGO_BIN_EXE_eval-sim"), args, folder)
}

fn rprae(args: &[&str], folder: &Path) -> Output {
    call(env!("CARGO_BIN_EXE_rprae"), args, folder)
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A body that stands still, `lift_m` above the floor, as a table of 30 frames.
fn standing(lift_m: f64) -> String {
    let mut text = String::new();
    for _ in 0..30 {
        let mut row = vec!["0".to_owned(); 50];
        // The root stands at this height on flat soles for the default height of 1.75 m.
        row[46] = (rprae::humanoid::ROOT_HEIGHT_FRACTION * 1.75 + lift_m).to_string();
        let _ = writeln!(text, "{}", row.join(","));
    }
    text
}

/// A folder with one table that can be read.
fn empty_folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("motions")).unwrap();
    fs::write(folder.path().join("motions/stand.csv"), standing(0.0)).unwrap();
    folder
}

const KINEMATIC: [&str; 6] = ["--motions", "motions", "--levels", "L0", "--rate", "100"];

fn kinematic_run(folder: &Path, out: &str) -> Output {
    eval_sim(&[&KINEMATIC[..], &["--out", out]].concat(), folder)
}

#[test]
fn wrong_usage_ends_with_two_and_says_why() {
    let folder = empty_folder();
    fs::write(folder.path().join("bad.toml"), "frictoin = 1.0\n").unwrap();
    fs::write(folder.path().join("far.toml"), "[simulation]\nfriction = 50\n").unwrap();
    fs::write(folder.path().join("a.xml"), "").unwrap();
    let xml = ["--motions", "a.xml", "--levels", "L0"];
    let cases: [(&[&str], &str); 15] = [
        (&["--frobnicate"], "--frobnicate"),
        (&["--levels", "L4"], "L0, L1, L2, L3"),
        (&["--dt", "1"], "failed to use the setting simulation.dt_secs: it is 1, expected 0.00001 to 0.02 s"),
        (&["--mass", "-3"], "failed to use the setting mass_kg: it is -3, expected 1 to 500 kg"),
        (&["--seed", "-1"], "expected a whole number from 0 to 9223372036854775807"),
        (&["--assist-limit", "20"], "20%"),
        (
            &["--config", "far.toml"],
            "the setting simulation.friction of far.toml: it is 50, expected 0 to 10",
        ),
        (&["--rate", "50"], "--rate"),
        (&[xml[0], xml[1], xml[2], xml[3], "--height", "1.6"], "--height"),
        (&[xml[0], xml[1], xml[2], xml[3], "--skeleton", "s.toml"], "s.toml"),
        (&["--overwrite"], "--out"),
        (&["--config", "bad.toml"], "frictoin"),
        (&["--config", "missing.toml"], "missing.toml"),
        (&["--motions", "nowhere"], "nowhere"),
        (&["--motions", "motions", "--levels", "L0", "--ids", "stand,walk"], "motions has none called walk"),
    ];
    for (args, part) in cases {
        let output = eval_sim(args, folder.path());
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{args:?}: {}", stderr(&output));
        assert!(stdout(&output).is_empty());
    }
}

#[test]
fn a_run_leaves_all_its_files_and_says_where() {
    let folder = empty_folder();
    let output = kinematic_run(folder.path(), "run");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("stand") && text.contains("rprae regress --baseline baseline.json run"), "{text}");
    for file in [
        "settings.toml",
        "manifest.json",
        "results.json",
        "samples.jsonl",
        "scores.csv",
        "report.md",
        "report.html",
        "timings.json",
        "cases/stand.json",
    ] {
        assert!(folder.path().join("run").join(file).is_file(), "{file}");
    }
    let second = eval_sim(&[&KINEMATIC[..], &["--quiet"]].concat(), folder.path());
    assert_eq!((code(&second), second.stdout.len(), second.stderr.len()), (0, 0, 0));
    assert!(folder.path().join("results/motions-001/results.json").is_file());
}

#[test]
fn saved_settings_repeat_the_run_bit_for_bit() {
    let folder = empty_folder();
    assert_eq!(code(&kinematic_run(folder.path(), "first")), 0);
    let output = eval_sim(&["--config", "first/settings.toml", "--out", "second"], folder.path());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    for file in ["results.json", "manifest.json", "scores.csv", "report.html", "cases/stand.json"] {
        let read = |run: &str| fs::read(folder.path().join(run).join(file)).unwrap();
        assert!(read("first") == read("second"), "{file} differs");
    }
}

#[test]
fn a_folder_is_continued_or_replaced_only_on_purpose() {
    let folder = empty_folder();
    assert_eq!(code(&kinematic_run(folder.path(), "run")), 0);
    let again = kinematic_run(folder.path(), "run");
    assert!(stderr(&again).contains("already finished"), "{}", stderr(&again));
    let other: &[&str] = &["--seed", "5", "--out", "run"];
    let refused = eval_sim(&[&KINEMATIC[..], other].concat(), folder.path());
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("--overwrite"), "{}", stderr(&refused));
    let replaced = eval_sim(&[&KINEMATIC[..], other, &["--overwrite"]].concat(), folder.path());
    assert_eq!(code(&replaced), 0, "{}", stderr(&replaced));
}

#[test]
fn a_bad_input_is_skipped_by_name_and_ends_with_three() {
    let folder = empty_folder();
    fs::write(folder.path().join("motions/torn.csv"), "1,2,3\n").unwrap();
    let output = kinematic_run(folder.path(), "run");
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let reason = "torn (motions/torn.csv): line 1: found 3 columns, expected 50";
    assert!(stdout(&output).contains(&format!("Skipped inputs (1):\n  {reason}\n")), "{}", stdout(&output));
    assert!(stdout(&output).contains("\n1 case, 0 failed, 1 skipped; "), "{}", stdout(&output));
    assert!(stderr(&output).contains("[2/2]") && !stderr(&output).contains(reason), "{}", stderr(&output));
    let quiet = eval_sim(&[&KINEMATIC[..], &["--quiet"]].concat(), folder.path());
    assert_eq!(stderr(&quiet), format!("skipped {reason}\n"), "without a summary it is told at once");
    assert!(fs::read_to_string(folder.path().join("run/report.md")).unwrap().contains("torn"));
}

#[test]
fn a_wrong_selection_leaves_no_folder() {
    let folder = empty_folder();
    let typo = eval_sim(&[&KINEMATIC[..], &["--ids", "stnad", "--out", "run"]].concat(), folder.path());
    assert_eq!(code(&typo), 2);
    assert!(!folder.path().join("run").exists() && !folder.path().join("results").exists());
    let typo = rprae(&["canaries", "--ids", "stnad", "--no-rollouts"], folder.path());
    assert_eq!((code(&typo), stdout(&typo).as_str()), (2, ""));
    assert!(stderr(&typo).contains("bundled has none called stnad"), "{}", stderr(&typo));
}

#[test]
fn a_command_without_a_usable_input_ends_with_two_whatever_it_is() {
    let folder = empty_folder();
    let path = folder.path();
    fs::write(path.join("motions/stand.csv"), "1,2,3\n").unwrap();
    fs::write(path.join("torn.bvh"), "torn\n").unwrap();
    let commands: [&[&str]; 5] = [
        &["sim", "--motions", "motions", "--levels", "L0"],
        &["lint", "motions"],
        &["canaries", "--motions", "motions", "--no-rollouts"],
        &["metrics", "--rosetta", "motions"],
        &["retarget", "torn.bvh", "--out", "made"],
    ];
    for args in commands {
        let output = rprae(args, path);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
    }
}

#[test]
fn residuals_need_level_1_and_say_how_to_get_it() {
    let folder = empty_folder();
    assert_eq!(code(&kinematic_run(folder.path(), "run")), 0);
    let refused = rprae(&["residuals", "run", "--out", "table.md"], folder.path());
    assert_eq!((code(&refused), folder.path().join("table.md").exists()), (2, false));
    assert!(stderr(&refused).contains("--levels L0,L1"), "{}", stderr(&refused));
    let args = ["--motions", "motions", "--rate", "100", "--levels", "L0,L1", "--out", "both", "--quiet"];
    assert_eq!(code(&eval_sim(&args, folder.path())), 0);
    let told = rprae(&["residuals", "both", "--out", "table.md"], folder.path());
    assert_eq!(code(&told), 0, "{}", stderr(&told));
    assert!(fs::read_to_string(folder.path().join("table.md")).unwrap().contains("1 motion of motions"));
}

#[test]
fn nothing_is_replaced_unasked() {
    let folder = empty_folder();
    let path = folder.path();
    assert_eq!(code(&kinematic_run(path, "run")), 0);
    fs::write(path.join("there"), "years of work").unwrap();
    for args in [&["urdf", "--out", "there"], &["residuals", "run", "--out", "there"][..]] {
        let refused = rprae(args, path);
        assert_eq!(code(&refused), 2, "{args:?}");
        assert!(stderr(&refused).contains("--overwrite"), "{args:?}: {}", stderr(&refused));
        assert_eq!(fs::read_to_string(path.join("there")).unwrap(), "years of work");
    }
    assert_eq!(code(&rprae(&["urdf", "--out", "there", "--overwrite"], path)), 0);
    assert!(fs::read_to_string(path.join("there")).unwrap().contains("<robot"));
}

#[test]
fn there_is_nothing_to_resume_where_nothing_was_begun() {
    let folder = tempfile::tempdir().unwrap();
    let refused = rprae(&["train", "--out", "nowhere", "--resume"], folder.path());
    assert_eq!((code(&refused), folder.path().join("nowhere").exists()), (2, false));
    assert!(stderr(&refused).contains("resume the run in nowhere: there is none"), "{}", stderr(&refused));
}

#[test]
fn options_of_a_model_do_not_go_with_hypotheses() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["evaluate", "--hypotheses", "a.txt", "--references", "b.txt", "--prepared", "set"];
    let refused = rprae(&args, folder.path());
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("cannot be used with"), "{}", stderr(&refused));
}

#[test]
fn a_regression_ends_with_four() {
    let folder = empty_folder();
    let path = folder.path();
    assert_eq!(code(&kinematic_run(path, "good")), 0);
    let gate = |run: &str, more: &[&str]| {
        rprae(&[&["regress", "--baseline", "base.json", run], more].concat(), path)
    };
    assert_eq!(code(&gate("good", &[])), 2, "there is no baseline yet");
    assert_eq!(code(&gate("good", &["--update"])), 0);
    assert_eq!(code(&gate("good", &[])), 0);

    fs::write(path.join("motions/stand.csv"), standing(0.1)).unwrap();
    assert_eq!(code(&kinematic_run(path, "floating")), 0, "a bad score is a result");
    let failed = gate("floating", &["--junit", "out/junit.xml", "--markdown", "out/report.md"]);
    assert_eq!(code(&failed), 4);
    assert!(stdout(&failed).contains("| stand | l0/float | worse |"), "{}", stdout(&failed));
    assert!(!stdout(&failed).contains("| l0/skate |"), "it did not change: {}", stdout(&failed));
    assert_eq!(fs::read_to_string(path.join("out/report.md")).unwrap(), stdout(&failed));
    let junit = fs::read_to_string(path.join("out/junit.xml")).unwrap();
    assert!(junit.contains("failures=\"1\"") && junit.contains("l0/float: worse"), "{junit}");

    // Another key, such as another step, is refused rather than compared.
    let other = eval_sim(&[&KINEMATIC[..], &["--dt", "1/240", "--out", "other"]].concat(), path);
    assert_eq!(code(&other), 0, "{}", stderr(&other));
    let refused = gate("other", &[]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("(signature: dt:1/240s is not dt:1/480s)"), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("--update"), "{}", stderr(&refused));

    // A file that is not there is no reason to compare with nothing.
    assert_eq!(code(&gate("nowhere", &[])), 2);
}

#[test]
fn a_failed_case_ends_with_one_and_is_no_baseline() {
    let folder = empty_folder();
    let path = folder.path();
    assert_eq!(code(&kinematic_run(path, "run")), 0);
    let file = path.join("run/results.json");
    let mut results: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    results["cases"][0]["failures"] = serde_json::json!(["L2 at 0.5 s: not a number"]);
    fs::write(&file, results.to_string()).unwrap();
    let refused = rprae(&["regress", "--baseline", "base.json", "--update", "run"], path);
    assert_eq!(code(&refused), 1);
    assert!(stderr(&refused).contains("stand") && !path.join("base.json").exists());
}

#[test]
fn a_short_motion_is_simulated_recorded_and_can_be_watched() {
    let folder = empty_folder();
    let args = ["--motions", "motions", "--rate", "100", "--levels", "L0,L2", "--out", "run"];
    let output = eval_sim(&args, folder.path());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let watched = rprae(&["view", "run"], folder.path());
    assert_eq!(code(&watched), 0);
    assert!(stdout(&watched).contains("rerun run/recordings/stand.L2.mcap"), "{}", stdout(&watched));
    assert_eq!(code(&rprae(&["view", "motions"], folder.path())), 2);
}

#[test]
fn metrics_explain_themselves() {
    let folder = tempfile::tempdir().unwrap();
    let listed = stdout(&rprae(&["metrics"], folder.path()));
    assert!(listed.lines().count() > 10 && listed.contains("l0/skate"));
    let explained = stdout(&rprae(&["metrics", "l0/skate"], folder.path()));
    assert!(explained.contains("formula") && explained.contains("signature"));
    let unknown = rprae(&["metrics", "l9/skate"], folder.path());
    assert_eq!(code(&unknown), 2);
    assert!(stderr(&unknown).contains("l0/skate"), "{}", stderr(&unknown));
}

#[test]
fn the_urdf_is_the_body_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let output = rprae(&["urdf", "--height", "1.6", "--mass", "50", "--out", "body.urdf"], folder.path());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let urdf = fs::read_to_string(folder.path().join("body.urdf")).unwrap();
    let robot = rprae::robot::parse_urdf(&urdf).unwrap();
    assert!((robot.tree.total_mass_kg() - 50.0).abs() < 1e-3);
    assert_eq!(code(&rprae(&["urdf", "--height", "1750"], folder.path())), 2);
}

#[test]
fn prepare_writes_a_set_its_account_and_its_report() {
    let folder = empty_folder();
    let path = folder.path();
    fs::write(path.join("captions.jsonl"), "{\"motion\": \"stand\", \"caption\": \"A person stands.\"}\n")
        .unwrap();
    fs::write(path.join("corpus.txt"), "somebody walks\n").unwrap();
    let args =
        ["prepare", "--motions", "motions", "--captions", "captions.jsonl", "--captions", "corpus.txt"];
    let prepare = |more: &[&str]| rprae(&[&args[..], more].concat(), path);
    // 30 frames at 100 Hz are shorter than a second.
    let output = prepare(&["--out", "short"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("0 kept (0.00 h), 1 shorter than 1 s"), "{}", stdout(&output));

    fs::write(path.join("prepare.toml"), "min_secs = 0.2\n[[motions]]\npath = \"motions\"\n").unwrap();
    let args = ["prepare", "--config", "prepare.toml", "--captions", "captions.jsonl", "--out", "set"];
    let output = rprae(&args, path);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("Data division: actions") && text.contains("Written: set"), "{text}");
    let set = rprae::features::PreparedSet::load(&path.join("set")).unwrap();
    assert_eq!((set.motions.len(), set.captions.len(), set.test.len()), (1, 1, 1));
    let manifest: Value = serde_json::from_slice(&fs::read(path.join("set/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["fingerprint"].as_str(), Some(set.fingerprint.as_str()));
    assert!(text.starts_with(&fs::read_to_string(path.join("set/report.txt")).unwrap()));

    assert_eq!(code(&rprae(&args, path)), 2, "the folder holds a set already");
    assert_eq!(code(&rprae(&[&args[..], &["--overwrite", "--quiet"]].concat(), path)), 0);
    for (bad, part) in [
        (&["--motions", "nowhere"][..], "nowhere"),
        (&["--vectors", "captions.jsonl"], "line 1 is neither"),
        (&["--paired", "9"], "there are 0"),
        (&["--split-train", "x"], "--split-validation"),
    ] {
        let output = rprae(&[&args[..], &["--overwrite"], bad].concat(), path);
        assert_eq!(code(&output), 2, "{bad:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{bad:?}: {}", stderr(&output));
    }
    fs::write(path.join("motions/torn.csv"), "1,2,3\n").unwrap();
    assert_eq!(code(&rprae(&[&args[..], &["--overwrite", "--quiet"]].concat(), path)), 3);
}

#[test]
fn lint_ends_with_the_code_of_what_it_found() {
    let folder = empty_folder();
    let path = folder.path();
    let lint = |args: &[&str]| rprae(&[&["lint", "motions", "--rate", "100"], args].concat(), path);
    // Nothing moves, which is a warning.
    assert_eq!(code(&lint(&[])), 0);
    assert_eq!(code(&lint(&["--deny-warnings"])), 1);
    fs::write(path.join("motions/torn.csv"), "1,2,3\n").unwrap();
    let output = lint(&["--json", "-", "--junit", "junit.xml"]);
    assert_eq!(code(&output), 3);
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(json["motions"][1]["findings"][0]["code"], "schema");
    assert!(fs::read_to_string(path.join("junit.xml")).unwrap().contains("failures=\"1\""));
    assert_eq!(code(&rprae(&["lint", "nowhere"], path)), 2);
    assert!(stdout(&rprae(&["lint", "--checks"], path)).contains("ground-offset"));
    let bundled = rprae(&["lint"], path);
    assert!(code(&bundled) == 0 && stdout(&bundled).contains("12 clean"), "{}", stdout(&bundled));
}
