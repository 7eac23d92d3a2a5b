//! A whole grid of tiny models: trained in parts, stopped, gone on with, scored, and scored again to the same bytes.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use rprae::features::{
    CaptionFeatures, MotionFeatures, Normalizer, Pair, PreparedSet, Root, Split, Vocabulary,
};
use rprae::model::Draws;
use rprae::motion::NUM_CHANNELS;

/// Twelve motions of sines, each with a caption of its own.
fn prepared() -> PreparedSet {
    let split = |place: usize| match place {
        0..8 => Split::Train,
        8..10 => Split::Validation,
        _ => Split::Test,
    };
    let frames = |place: usize| -> Vec<[f32; NUM_CHANNELS]> {
        let value = |time: usize, channel: usize| (0.3 * (time + channel * (place + 1)) as f32).sin() * 0.5;
        (0..8 + place % 3).map(|time| std::array::from_fn(|channel| value(time, channel))).collect()
    };
    let caption = |place: usize| CaptionFeatures {
        words: vec![0, 2 + (place % 4) as u32, 2 + (place / 4 + 3) as u32, 1],
        text: format!("{} {}", ["a", "b", "c", "d"][place % 4], ["d", "e", "f"][place / 4]),
        motion: Some(place),
        split: split(place),
    };
    let pairs = |places: std::ops::Range<usize>| {
        places.map(|place| Pair { motion: place, caption: place }).collect::<Vec<_>>()
    };
    let set = PreparedSet {
        rate_hz: 10.0,
        root: Root::Absolute,
        normalizer: Normalizer { minimum: vec![-1.0; NUM_CHANNELS], maximum: vec![1.0; NUM_CHANNELS] },
        vocabulary: Vocabulary {
            words: ["<bos>", "<eos>", "a", "b", "c", "d", "e", "f"].map(str::to_owned).to_vec(),
            dimensions: 4,
            vectors: (0..8).map(|w| (w > 2).then(|| Draws::new(1, "vector", w).uniform(4, 0.5))).collect(),
        },
        motions: (0..12)
            .map(|place| MotionFeatures {
                id: format!("m{place:02}"),
                split: split(place),
                frames: frames(place),
            })
            .collect(),
        captions: (0..12).map(caption).collect(),
        non_paired_motions: (0..8).collect(),
        non_paired_captions: (0..8).collect(),
        paired: pairs(0..8),
        validation: pairs(8..10),
        test: pairs(10..12),
        fingerprint: String::new(),
    };
    set.with_fingerprint()
}

const GRID: &str = "\
prepared = \"prepared\"
paired = [3, \"all\"]
non_paired = [4]
seeds = [1, 2]
folds = 3
resamples = 100
[run.model]
action_units = 6
action_decoder_layers = 1
description_units = 6
latent = 5
retrofit_units = 6
retrofit_layers = 1
[run.training]
batch_size = 4
stage1_iterations = 6
stage2_iterations = 6
alternate_every = 2
validate_every = 4
checkpoint_every = 3
";

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rprae"));
    command.args(args).current_dir(folder).env_remove("CARGO");
    command
}

fn tables(folder: &Path, args: &[&str]) -> Output {
    let base = ["tables", "--grid", "grid.toml", "--device", "cpu"];
    let output = command(folder, &[&base[..], args].concat()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn a_grid_in_parts_is_the_grid_in_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    prepared().save(&folder.join("prepared")).unwrap();
    fs::write(folder.join("grid.toml"), GRID).unwrap();

    // In one go, but killed in the middle and called again.
    let base = ["tables", "--grid", "grid.toml", "--device", "cpu", "--out", "whole"];
    let mut killed = command(folder, &base).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    let num_trained = || fs::read_dir(folder.join("whole/cells")).map_or(0, Iterator::count);
    while num_trained() < 5 && started.elapsed() < Duration::from_mins(2) {
        std::thread::sleep(Duration::from_millis(10));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let whole = tables(folder, &["--out", "whole"]);

    // In two shards, on what could be two machines.
    for (shard, out) in [("1/2", "first"), ("2/2", "second")] {
        tables(folder, &["--out", out, "--shard", shard]);
    }
    let incomplete = tables(folder, &["--out", "first", "--shard", "1/2"]);
    assert!(String::from_utf8(incomplete.stdout).unwrap().contains("not trained yet"));
    for cell in fs::read_dir(folder.join("second/cells")).unwrap() {
        let cell = cell.unwrap();
        fs::rename(cell.path(), folder.join("first/cells").join(cell.file_name())).unwrap();
    }
    let merged = tables(folder, &["--out", "first"]);

    assert_eq!(whole.stdout, merged.stdout);
    for name in [
        "tables.md",
        "samples.jsonl",
        "scores.json",
        "efficiency.svg",
        "latents.svg",
        "joints.svg",
        "captions.md",
    ] {
        let read = |out: &str| fs::read(folder.join(out).join(name)).unwrap();
        assert!(read("whole") == read("first"), "{name} differs");
    }
    let text = String::from_utf8(whole.stdout).unwrap();
    assert!(text.contains("## Table 7") && text.contains("12 motions"), "{text}");
    let samples = fs::read_to_string(folder.join("whole/samples.jsonl")).unwrap();
    // Four kinds of models, two seeds, twelve motions with a caption each.
    assert_eq!(samples.lines().count(), 4 * 2 * (12 + 12));

    results_are_replaced_only_when_asked(folder);
    a_model_is_scored_on_what_was_kept_from_it(folder);
}

fn results_are_replaced_only_when_asked(folder: &Path) {
    let call = |args: &[&str]| {
        let base = ["tables", "--grid", "grid.toml", "--device", "cpu", "--out", "whole"];
        let output = command(folder, &[&base[..], args].concat()).output().unwrap();
        let text = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        (output.status.code(), text.concat())
    };
    let before = fs::read(folder.join("whole/scores.json")).unwrap();
    let (code, message) = call(&[]);
    assert!(code == Some(2) && message.contains("--overwrite"), "{message}");
    assert!(fs::read(folder.join("whole/scores.json")).unwrap() == before);
    assert!(message_of_a_shard(folder).contains("without --shard"));

    // A set that moved is the same set, and encoders add their columns.
    fs::rename(folder.join("prepared"), folder.join("moved")).unwrap();
    fs::write(folder.join("grid.toml"), GRID.replace("prepared\"", "moved\"")).unwrap();
    let encoder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/text/tiny_bert");
    let encoder = encoder.to_str().unwrap();
    let (code, text) = call(&["--overwrite", "--encoder", encoder, "--sentence-encoder", encoder]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("| BERTScore P | R | F | cosine |"), "{text}");
    assert!(text.contains("captions BERTScore F | captions cosine |"), "{text}");
    let scores: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.join("whole/scores.json")).unwrap()).unwrap();
    let keys: Vec<&str> = scores["rows"][1]["differences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["key"].as_str().unwrap())
        .collect();
    assert!(keys.contains(&"bertscore-f") && keys.contains(&"cosine"), "{keys:?}");
    fs::rename(folder.join("moved"), folder.join("prepared")).unwrap();
    fs::write(folder.join("grid.toml"), GRID).unwrap();
}

/// What is said where a shard has nothing left to train.
fn message_of_a_shard(folder: &Path) -> String {
    String::from_utf8(tables(folder, &["--out", "whole", "--shard", "1/2"]).stdout).unwrap()
}

fn a_model_is_scored_on_what_was_kept_from_it(folder: &Path) {
    let cell = |fold: usize| format!("whole/cells/paired-all_nonpaired-0_seed-1_fold-{fold}/bundle");
    let config = |fold: usize| -> serde_json::Value {
        serde_json::from_slice(&fs::read(folder.join(cell(fold)).join("config.json")).unwrap()).unwrap()
    };
    let learned = |fold: usize, id: &str| {
        let motions = config(fold)["learned_from"]["motions"].as_array().unwrap().clone();
        motions.iter().any(|motion| motion == id)
    };
    let evaluate = |fold: usize, args: &[&str]| {
        let bundle = cell(fold);
        let base =
            ["evaluate", "--bundle", &bundle, "--prepared", "prepared", "--out", "scores", "--overwrite"];
        let output = command(folder, &[&base[..], args].concat()).output().unwrap();
        let text = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        (output.status.code(), text.concat())
    };
    // Motions are made from the first frames that lie there.
    assert!(folder.join(cell(0)).join("starts.safetensors").exists());
    // The test motions of the set are m10 and m11; other parts of the cross-validation learned from them.
    let fold = (0..3).find(|&fold| learned(fold, "m10") || learned(fold, "m11")).unwrap();
    let (code, message) = evaluate(fold, &[]);
    assert!(
        code == Some(2) && message.contains("learned from") && message.contains("--split train"),
        "{message}"
    );
    let (code, text) = evaluate(fold, &["--split", "train"]);
    assert!(code == Some(0) && text.contains("held out: no, the model learned from"), "{text}");
    assert!(text.contains("most frequent") && text.contains("r-precision-3"), "{text}");

    // A bundle that does not say is scored, and it is said that nobody knows.
    let path = folder.join(cell(fold)).join("config.json");
    let mut old = config(fold);
    old.as_object_mut().unwrap().remove("learned_from");
    fs::write(&path, old.to_string()).unwrap();
    let (code, text) = evaluate(fold, &[]);
    assert!(code == Some(0) && text.contains("held out: not known"), "{text}");
    let scores = fs::read_to_string(folder.join("scores/scores.json")).unwrap();
    assert!(scores.contains("\"not-known\""), "{scores}");
}

#[test]
fn another_grid_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    prepared().save(&folder.join("prepared")).unwrap();
    let call = |grid: &str| {
        fs::write(folder.join("grid.toml"), grid).unwrap();
        let args = ["tables", "--grid", "grid.toml", "--device", "cpu", "--out", "out", "--shard", "1/20"];
        let output = command(folder, &args).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    assert_eq!(call(GRID).0, Some(0));
    let (code, message) = call(&GRID.replace("latent = 5", "latent = 4"));
    assert!(code == Some(2) && message.contains("other settings"), "{message}");
    let (code, message) = call(&GRID.replace("non_paired = [4]\n", "").replace("[3,", "[30,"));
    assert!(code == Some(2) && message.contains("draw 30 pairs"), "{message}");
    // A model of another version is found before any other is trained.
    let cells = || fs::read_dir(folder.join("out/cells")).unwrap().count();
    let trained = cells();
    let stale =
        fs::read_dir(folder.join("out/cells")).unwrap().next().unwrap().unwrap().path().join("run.json");
    let text = fs::read_to_string(&stale).unwrap();
    let mut facts: serde_json::Value = serde_json::from_str(&text).unwrap();
    facts["rprae"] = "0.0.0".into();
    fs::write(&stale, facts.to_string()).unwrap();
    fs::write(folder.join("grid.toml"), GRID).unwrap();
    let args = ["tables", "--grid", "grid.toml", "--device", "cpu", "--out", "out", "--shard", "2/20"];
    let output = command(folder, &args).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && message.contains("version 0.0.0"), "{message}");
    assert_eq!(cells(), trained);
    let (code, message) = call(&GRID.replace("seeds", "seads"));
    assert!(code == Some(2) && message.contains("seads"), "{message}");
}
