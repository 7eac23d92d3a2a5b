//! Translation as its users meet it: a small model that learned four motions of the bundled suite by heart.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;

use rprae::dataset::{Dataset, OpenOptions};
use serde_json::Value;
use tempfile::TempDir;

/// Ids in the suite, and what the model learns to say of them.
const LEARNED: [(&str, &str); 4] = [
    ("90001", "a person walks forward"),
    ("90007", "a person waves with the right hand"),
    ("90008", "someone kicks a ball"),
    ("90010", "a person turns around to the left"),
];

const TRAINING: &str = "
preset = \"compact\"
device = \"cpu\"
[model]
action_units = 48
action_decoder_layers = 1
description_units = 32
latent = 24
retrofit_units = 16
retrofit_layers = 1
[training]
batch_size = 4
alternate_every = 20
learning_rate = 0.005
stage1_iterations = 200
stage2_iterations = 400
validate_every = 0
checkpoint_every = 1000
";

fn rprae(args: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rprae"));
    command.args(args).current_dir(folder).env_remove("CARGO").stdin(Stdio::null()).output().unwrap()
}

fn eval_sim(args: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_eval-sim"));
    command.args(args).current_dir(folder).env_remove("CARGO").output().unwrap()
}

fn clean(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A folder with `motions/` in the layout of KIT-ML and `run/bundle`, trained once for all tests.
static TRAINED: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let suite = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/suite");
    let motions = folder.path().join("motions");
    fs::create_dir(&motions).unwrap();
    for (id, caption) in LEARNED {
        let name = format!("{id}_mmm.xml");
        fs::copy(suite.join(&name), motions.join(&name)).unwrap();
        fs::write(motions.join(format!("{id}_annotations.json")), format!("[\"{caption}\"]")).unwrap();
    }
    fs::write(folder.path().join("train.txt"), LEARNED.map(|(id, _)| id).join("\n")).unwrap();
    fs::write(folder.path().join("none.txt"), "").unwrap();
    fs::write(folder.path().join("train.toml"), TRAINING).unwrap();
    let lists = ["--split-train", "train.txt", "--split-validation", "none.txt", "--split-test", "none.txt"];
    let prepare = ["prepare", "--motions", "motions", "--out", "prepared", "--no-cache"];
    clean(&rprae(&[&prepare[..], &lists].concat(), folder.path()));
    let train = ["train", "--config", "train.toml", "--prepared", "prepared", "--out", "run", "--quiet"];
    clean(&rprae(&train, folder.path()));
    folder
});

fn bundle() -> PathBuf {
    TRAINED.path().join("run/bundle")
}

fn translate(args: &[&str], folder: &Path) -> Output {
    rprae(&[&["translate", "--bundle", bundle().to_str().unwrap()], args].concat(), folder)
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn motions_learned_by_heart_are_told_by_their_captions() {
    let text = clean(&translate(&["--motions", "motions", "--json"], TRAINED.path()));
    let records = lines(&text);
    assert_eq!(records.len(), LEARNED.len());
    for (record, (id, caption)) in records.iter().zip(LEARNED) {
        assert_eq!((record["id"].as_str(), record["hypothesis"].as_str()), (Some(id), Some(caption)));
        assert_eq!(record["references"][0].as_str(), Some(caption));
    }
    let several = clean(&translate(&["--motion", "motions/90001_mmm.xml", "--n-best", "4"], TRAINED.path()));
    assert_eq!(several.lines().filter(|line| line.trim_start().starts_with("score")).count(), 4, "{several}");
    assert!(several.contains("reference: a person walks forward"), "{several}");
}

#[test]
fn one_command_makes_a_motion_performs_it_and_reads_back_what_the_humanoid_did() {
    let folder = tempfile::tempdir().unwrap();
    let outs = ["--out", "turn.xml", "--out", "turn.npy", "--out", "turn.svg", "--out", "turn.mcap"];
    let sentence = ["a person turns around to the left", "--round-trip", "--perform", "--json", "--quiet"];
    let text = clean(&translate(&[&sentence[..], &outs].concat(), folder.path()));
    let record = &lines(&text)[0];
    let motion = &record["motions"][0];
    assert_eq!(motion["read_back"][0]["text"], "a person turns around to the left");
    assert!((motion["turn_deg"].as_f64().unwrap() - 180.0).abs() < 60.0, "{motion}");
    assert!((motion["duration_secs"].as_f64().unwrap() - 6.2).abs() < 1.0, "{motion}");
    let performed = &motion["performed"];
    assert_eq!(performed["outcome"]["kind"], "completed");
    assert!(performed["scores"]["l2/mpjpe_root"].as_f64().unwrap() > 0.0, "{performed}");
    assert!(!performed["read_back"][0]["text"].as_str().unwrap().is_empty());

    let dataset = Dataset::open(&folder.path().join("turn.xml"), &OpenOptions::default()).unwrap();
    let written = dataset.load(&dataset.entries()[0]).unwrap().motion;
    assert!((written.rate_hz() - 100.0).abs() < 1e-6);
    assert!((written.duration_secs() - motion["duration_secs"].as_f64().unwrap()).abs() < 1e-6);
    assert_eq!(&fs::read(folder.path().join("turn.npy")).unwrap()[1..6], b"NUMPY");
    assert!(fs::read_to_string(folder.path().join("turn.svg")).unwrap().starts_with("<svg"));
    let recording = fs::read(folder.path().join("turn.mcap")).unwrap();
    let caption = b"a person turns around to the left";
    assert!(recording.starts_with(b"\x89MCAP") && recording.len() > 10_000);
    let summary = mcap::Summary::read(&recording).unwrap().unwrap();
    assert!(summary.channels.values().any(|channel| channel.topic == "/caption"));
    let told = mcap::MessageStream::new(&recording).unwrap().filter_map(|message| {
        let message = message.unwrap();
        (message.channel.topic == "/caption")
            .then(|| message.data.windows(caption.len()).any(|w| w == caption))
    });
    assert_eq!(told.collect::<Vec<_>>(), [true]);

    // Nothing is replaced unasked, and that is found before the work.
    let again = translate(&[&sentence[..], &outs].concat(), folder.path());
    assert_eq!(again.status.code(), Some(2));
    assert!(stderr(&again).contains("turn.xml") && stderr(&again).contains("--overwrite"));
}

#[test]
fn a_batch_becomes_a_dataset_and_its_descriptions_can_be_scored() {
    let folder = tempfile::tempdir().unwrap();
    let sentences = "a person walks forward\nxyzzy 42\na person wavse with the right hand\n";
    fs::write(folder.path().join("sentences.txt"), sentences).unwrap();
    let made = translate(&["--captions", "sentences.txt", "--out", "made", "--quiet"], folder.path());
    assert_eq!(made.status.code(), Some(3), "one sentence has no word the model knows");
    assert!(stderr(&made).contains("xyzzy"), "{}", stderr(&made));
    let manifest = lines(&fs::read_to_string(folder.path().join("made/manifest.jsonl")).unwrap());
    let files: Vec<&str> = manifest.iter().map(|line| line["file"].as_str().unwrap()).collect();
    assert_eq!(files, ["00001.xml", "00003.xml"]);

    let told = ["--motions", "made/manifest.jsonl", "--out", "told.jsonl", "--quiet"];
    clean(&translate(&told, folder.path()));
    let told = lines(&fs::read_to_string(folder.path().join("told.jsonl")).unwrap());
    assert_eq!(told[0]["hypothesis"], "a person walks forward");
    assert_eq!(told[0]["references"][0], "a person walks forward");
    let scores = ["evaluate", "--hypotheses", "told.jsonl", "--references", "told.jsonl", "--out", "scores"];
    let scored = rprae(&scores, folder.path());
    assert_eq!(scored.status.code(), Some(0), "{}", stderr(&scored));
}

#[test]
fn a_motion_that_cannot_be_written_is_no_sentence_that_is_skipped() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("sentences.txt"), "a person walks forward\nsomeone kicks a ball\n").unwrap();
    // What is in the way cannot be replaced by a file.
    fs::create_dir_all(folder.path().join("made/00002.xml")).unwrap();
    let args = ["--captions", "sentences.txt", "--out", "made", "--overwrite"];
    let failed = translate(&args, folder.path());
    assert_eq!(failed.status.code(), Some(1), "{}", stderr(&failed));
    let told = stderr(&failed);
    assert!(told.contains("failed to write made/00002.xml: ") && !told.contains("skipped"), "{told}");
}

#[test]
fn what_is_skipped_is_named_once_with_its_file_and_nothing_left_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("torn.csv"), "1,2,3\n").unwrap();
    fs::write(folder.path().join("sentences.txt"), "xyzzy\n").unwrap();
    for (args, part) in [
        (["--motions", "torn.csv"], "skipped torn (torn.csv): line 1: "),
        (["--captions", "sentences.txt"], "skipped 00001 (sentences.txt): "),
    ] {
        let output = translate(&args, folder.path());
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert_eq!(stderr(&output).matches(part).count(), 1, "{}", stderr(&output));
        assert_eq!(stderr(&output).matches("skipped").count(), 1, "{}", stderr(&output));
    }
}

#[test]
fn words_outside_the_vocabulary_are_noted_and_vectors_let_them_in() {
    let folder = tempfile::tempdir().unwrap();
    let vector: Vec<String> = (0..300).map(|index| format!("0.{}", index % 10)).collect();
    fs::write(folder.path().join("vectors.txt"), format!("strolls {}\n", vector.join(" "))).unwrap();
    let caption = "a persno strolls forward";
    let notes = |args: &[&str]| -> String {
        let text = clean(&translate(&[&[caption, "--json", "--quiet"], args].concat(), folder.path()));
        lines(&text)[0]["notes"].to_string()
    };
    let plain = notes(&[]);
    assert!(plain.contains("read as \\\"person\\\"") && plain.contains("left out"), "{plain}");
    let helped = notes(&["--vectors", "vectors.txt"]);
    assert!(helped.contains("by its own word vector") && !helped.contains("left out"), "{helped}");
}

#[test]
fn lines_from_standard_input_are_translated_both_ways() {
    let folder = TRAINED.path();
    let mut child = Command::new(env!("CARGO_BIN_EXE_rprae"))
        .args(["translate", "--json", "--quiet", "--bundle", bundle().to_str().unwrap(), "-"])
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let long = "a person walks forward ".repeat(1000);
    let input = format!("a person walks forward\n\nmotions/90008_mmm.xml\nxyzzy\n{long}\n");
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let records = lines(std::str::from_utf8(&output.stdout).unwrap());
    assert_eq!(records.len(), 2);
    assert_eq!(records[0]["caption"], "a person walks forward");
    assert_eq!(records[1]["hypothesis"], "someone kicks a ball");
    assert!(
        stderr(&output).contains("xyzzy") && stderr(&output).contains("10000 bytes"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn physics_are_proved_once_for_all_lines() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_rprae"))
        .args(["translate", "--perform", "--length", "0.5", "--bundle", bundle().to_str().unwrap()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let input = "a person walks forward\na person waves with the right hand\n";
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(text.matches("performed in rapier").count(), 2, "{text}");
    assert_eq!(stderr(&output).matches("self-test").count(), 1, "{}", stderr(&output));
}

#[test]
fn wrong_usage_ends_with_two_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("empty.txt"), "\n").unwrap();
    fs::write(folder.path().join("a.xml"), "").unwrap();
    let cases: [(&[&str], &str); 13] = [
        (&["--motions", "a.xml", "--rate", "100"], "--rate"),
        (&["--motions", "a.xml", "--height", "1.6"], "--height"),
        (&["a person walks", "--length-of", "a.xml", "--rate", "50"], "--rate"),
        (&["a person walks", "--out", "walk.gif"], ".mcap"),
        (&["--captions", "missing.txt"], "missing.txt"),
        (&["--captions", "empty.txt"], "no caption"),
        (&["--motions", "nowhere"], "nowhere"),
        (&["a person walks", "--length", "0"], "0.1 s"),
        (&["a person walks", "--noise", "200"], "--noise"),
        (&["a person walks", "--noise", "0.2"], "--n-best"),
        (&["--motions", ".", "--perform"], "--perform"),
        (&["xyzzy"], "xyzzy"),
        (&["--out", "walk.xml"], "standard input"),
    ];
    for (args, part) in cases {
        let output = translate(args, folder.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{args:?}: {}", stderr(&output));
    }
    let output = rprae(&["translate", "a person walks", "--bundle", "nothing"], folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("rprae train"), "{}", stderr(&output));
}

#[test]
fn sentences_are_simulated_read_back_and_chosen_by_plausibility() {
    let folder = tempfile::tempdir().unwrap();
    let sentences = "a person walks forward\na person turns around to the left\n";
    fs::write(folder.path().join("two.txt"), sentences).unwrap();
    let bundle = bundle();
    let args =
        ["--bundle", bundle.to_str().unwrap(), "--captions", "two.txt", "--n-best", "3", "--noise", "0.1"];
    let output = eval_sim(&[&args[..], &["--out", "run"]].concat(), folder.path());
    let text = clean(&output);
    assert!(text.contains("Read back (2)"), "{text}");
    let read = |run: &str, name: &str| fs::read(folder.path().join(run).join(name)).unwrap();
    let results: Value = serde_json::from_slice(&read("run", "results.json")).unwrap();
    let cases = results["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 2);
    let mut num_right = 0;
    for (case, caption) in cases.iter().zip(sentences.lines()) {
        assert_eq!(case["captions"][0], caption);
        let levels = case["levels"].as_array().unwrap();
        assert_eq!(levels.len(), 4);
        num_right += usize::from(levels[0]["read_back"] == caption);
        let score = |level: usize, key: &str| levels[level]["scores"][key].as_f64().unwrap();
        assert_eq!(score(0, "l0/caption_bleu") == 1.0, levels[0]["read_back"] == caption);
        let lost = score(0, "l0/caption_bleu") - score(2, "l2/caption_bleu");
        assert!((score(2, "l2/caption_bleu_lost") - lost).abs() < 1e-12);
        let lost = score(0, "l0/caption_latent") - score(2, "l2/caption_latent");
        assert!((score(2, "l2/caption_latent_lost") - lost).abs() < 1e-12);

        let candidates = case["candidates"].as_array().unwrap();
        assert_eq!(candidates.len(), 3);
        let kept: Vec<&Value> = candidates.iter().filter(|one| one["kept"] == true).collect();
        let least = candidates.iter().map(|one| one["badness"].as_f64().unwrap()).fold(f64::MAX, f64::min);
        assert_eq!((kept.len(), kept[0]["badness"].as_f64().unwrap()), (1, least));
        // The case that ran is the candidate that was kept.
        assert_eq!(kept[0]["scores"]["l0/skate"].as_f64().unwrap(), score(0, "l0/skate"));
        // What was gained over the first, the one without noise.
        let gain = candidates[0]["scores"]["l0/skate"].as_f64().unwrap() - score(0, "l0/skate");
        assert!((score(0, "l0/n_best_skate_gain") - gain).abs() < 1e-9);
    }
    assert!(num_right > 0, "motions of sentences learned by heart say something else: {cases:?}");
    let page = String::from_utf8(read("run", "report.html")).unwrap();
    let report = String::from_utf8(read("run", "report.md")).unwrap();
    for text in [page, report] {
        assert!(text.contains("Read back") && text.contains("a person turns around to the left"));
    }

    // The saved settings repeat the run; the same call continues it.
    let repeated = eval_sim(&["--config", "run/settings.toml", "--out", "again"], folder.path());
    clean(&repeated);
    assert!(read("run", "results.json") == read("again", "results.json"));
    let continued = eval_sim(&[&args[..], &["--out", "run"]].concat(), folder.path());
    assert!(stderr(&continued).contains("already finished"), "{}", stderr(&continued));

    // Another model is not taken for the one of the settings.
    let settings = String::from_utf8(read("run", "settings.toml")).unwrap();
    let (before, after) = settings.split_once("bundle_sha256 = \"").unwrap();
    fs::write(folder.path().join("other.toml"), format!("{before}bundle_sha256 = \"0{after}")).unwrap();
    let refused = eval_sim(&["--config", "other.toml", "--out", "other"], folder.path());
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("not the one of the settings"), "{}", stderr(&refused));
}

#[test]
fn a_model_reads_recorded_motions_back_before_and_after_physics() {
    let folder = tempfile::tempdir().unwrap();
    let (motions, bundle) = (TRAINED.path().join("motions"), bundle());
    let args =
        ["--motions", motions.to_str().unwrap(), "--bundle", bundle.to_str().unwrap(), "--ids", "90007"];
    clean(&eval_sim(&[&args[..], &["--levels", "L2", "--out", "run"]].concat(), folder.path()));
    let results: Value =
        serde_json::from_slice(&fs::read(folder.path().join("run/results.json")).unwrap()).unwrap();
    let case = &results["cases"][0];
    assert_eq!(results["cases"].as_array().unwrap().len(), 1);
    assert!(case["levels"][0]["scores"]["l2/caption_bleu_lost"].is_f64(), "{case}");
    assert!(case["levels"][0]["read_back"].is_string());
    assert!(case.get("candidates").is_none());
}

/// Word vectors of one word, as text.
fn vectors_of(word: &str, scale: f64) -> String {
    let numbers: Vec<String> = (0..300).map(|index| (scale * f64::from(index % 10)).to_string()).collect();
    format!("{word} {}\n", numbers.join(" "))
}

#[test]
fn vectors_count_for_captions_of_references_and_may_move_but_not_change() {
    let folder = tempfile::tempdir().unwrap();
    let motions = folder.path().join("motions");
    fs::create_dir(&motions).unwrap();
    fs::copy(TRAINED.path().join("motions/90001_mmm.xml"), motions.join("90001_mmm.xml")).unwrap();
    fs::write(motions.join("90001_annotations.json"), "[\"a person strolls forward.\"]").unwrap();
    let bundle = bundle();
    let run = |args: &[&str]| {
        let base = ["--motions", "motions", "--levels", "L0", "--bundle", bundle.to_str().unwrap()];
        eval_sim(&[&base[..], args].concat(), folder.path())
    };
    let metric = |out: &str| -> (f64, String) {
        let text = fs::read_to_string(folder.path().join(out).join("results.json")).unwrap();
        let results: Value = serde_json::from_str(&text).unwrap();
        let value = results["cases"][0]["levels"][0]["scores"]["l0/caption_latent"].as_f64().unwrap();
        let metrics = results["metrics"].as_array().unwrap();
        let found = metrics.iter().find(|metric| metric["key"] == "l0/caption_latent").unwrap();
        (value, found["signature"].as_str().unwrap().to_owned())
    };
    clean(&run(&["--out", "plain"]));
    fs::write(folder.path().join("vectors.txt"), vectors_of("strolls", 0.1)).unwrap();
    clean(&run(&["--out", "helped", "--vectors", "vectors.txt"]));
    let (plain, helped) = (metric("plain"), metric("helped"));
    assert!(plain.0 != helped.0 && helped.1.contains("|vectors:"), "{plain:?} {helped:?}");
    assert!(!plain.1.contains("vectors"), "{}", plain.1);

    fs::rename(folder.path().join("vectors.txt"), folder.path().join("moved.txt")).unwrap();
    let continued = run(&["--out", "helped", "--vectors", "moved.txt"]);
    assert_eq!(continued.status.code(), Some(0), "{}", stderr(&continued));
    assert!(stderr(&continued).contains("already finished"), "{}", stderr(&continued));
    fs::write(folder.path().join("moved.txt"), vectors_of("strolls", -0.3)).unwrap();
    let refused = run(&["--out", "helped", "--vectors", "moved.txt"]);
    assert!(
        refused.status.code() == Some(2) && stderr(&refused).contains("other settings"),
        "{}",
        stderr(&refused)
    );
    // Flags that would change nothing are refused.
    let refused = run(&["--out", "none", "--n-best", "3"]);
    assert!(
        refused.status.code() == Some(2) && stderr(&refused).contains("--n-best"),
        "{}",
        stderr(&refused)
    );
}

#[test]
fn lines_find_their_words_in_vectors_that_were_read_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = vectors_of("strolls", 0.1) + &vectors_of("saunters", 0.2);
    fs::write(folder.path().join("vectors.txt"), text).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_rprae"))
        .args([
            "translate",
            "--json",
            "--quiet",
            "--bundle",
            bundle().to_str().unwrap(),
            "--vectors",
            "vectors.txt",
        ])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut told = std::io::BufReader::new(child.stdout.take().unwrap());
    let mut line = |sentence: &str| {
        writeln!(input, "{sentence}").unwrap();
        let mut text = String::new();
        std::io::BufRead::read_line(&mut told, &mut text).unwrap();
        let record: Value = serde_json::from_str(&text).unwrap();
        record["notes"].to_string()
    };
    assert!(line("a person strolls forward").contains("by its own word vector"));
    // The file is not looked at again.
    fs::remove_file(folder.path().join("vectors.txt")).unwrap();
    assert!(line("a person saunters forward").contains("by its own word vector"));
    assert!(line("a person xyzzys forward").contains("left out"));
    drop(input);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
