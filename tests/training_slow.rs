//! Training runs as processes and over many iterations: kill -9, resume, memory.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use rprae::features::{
    CaptionFeatures, MotionFeatures, Normalizer, Pair, PreparedSet, Root, Split, Vocabulary,
};
use rprae::model::{self, Bundle, DeviceChoice, Draws, ModelSettings};
use rprae::motion::NUM_CHANNELS;
use rprae::training::{
    self, Begin, Event, Line, METRICS_FILE, RunFacts, RunFolder, RunSettings, TrainingSettings,
};

/// Motions and captions that mean nothing, half of them for validation.
fn prepared() -> PreparedSet {
    let places = 0..8;
    let split = |place: usize| if place < 6 { Split::Train } else { Split::Validation };
    let pair = |place| Pair { motion: place, caption: place };
    let frames = |place: usize| {
        let values = Draws::new(1, "frames", place as u64).uniform((4 + place % 5) * NUM_CHANNELS, 0.8);
        values.as_chunks::<NUM_CHANNELS>().0.to_vec()
    };
    let words = |place: usize| {
        let mut draws = Draws::new(1, "words", place as u64);
        let middle: Vec<u32> = (0..=place % 4).map(|_| 2 + draws.below(6) as u32).collect();
        [&[0], middle.as_slice(), &[1]].concat()
    };
    let mut set = PreparedSet {
        rate_hz: 10.0,
        root: Root::Absolute,
        normalizer: Normalizer { minimum: vec![-1.0; NUM_CHANNELS], maximum: vec![1.0; NUM_CHANNELS] },
        vocabulary: Vocabulary {
            words: ["<bos>", "<eos>", "a", "b", "c", "d", "e", "f"].map(str::to_owned).to_vec(),
            dimensions: 4,
            vectors: (0..8).map(|w| (w > 2).then(|| Draws::new(1, "vector", w).uniform(4, 0.5))).collect(),
        },
        motions: places
            .clone()
            .map(|place| MotionFeatures {
                id: format!("m{place}"),
                split: split(place),
                frames: frames(place),
            })
            .collect(),
        captions: places
            .map(|place| CaptionFeatures {
                words: words(place),
                text: format!("caption {place}"),
                motion: Some(place),
                split: split(place),
            })
            .collect(),
        non_paired_motions: vec![0, 1, 2, 3, 4, 5],
        non_paired_captions: vec![0, 1, 2, 3, 4],
        paired: (0..6).map(pair).collect(),
        validation: (6..8).map(pair).collect(),
        test: Vec::new(),
        fingerprint: String::new(),
    };
    set.fingerprint = set.computed_fingerprint();
    set
}

fn settings(prepared: &Path, stage1: usize, stage2: usize) -> RunSettings {
    RunSettings {
        prepared: prepared.to_owned(),
        device: DeviceChoice::Cpu,
        model: ModelSettings {
            action_units: 8,
            action_decoder_layers: 2,
            description_units: 8,
            latent: 6,
            retrofit_units: 8,
            retrofit_layers: 1,
            ..ModelSettings::default()
        },
        training: TrainingSettings {
            batch_size: 4,
            stage1_iterations: Some(stage1),
            stage2_iterations: Some(stage2),
            alternate_every: 7,
            validate_every: 20,
            checkpoint_every: 6,
            ..TrainingSettings::default()
        },
        ..RunSettings::default()
    }
}

fn train(config: &Path, out: &Path, flags: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rprae"));
    command.args(["train", "--quiet", "--config"]).arg(config).arg("--out").arg(out).args(flags);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Everything a finished run learned: weights and moments of its last checkpoint, and all its losses.
fn learned(run: &Path) -> (Vec<u8>, Vec<u8>, Vec<Line>) {
    let checkpoints = std::fs::read_dir(run.join("checkpoints")).unwrap();
    let last = checkpoints.map(|entry| entry.unwrap().path()).max().unwrap();
    let mut lines = training::read_metrics(&run.join(METRICS_FILE)).unwrap();
    for line in &mut lines {
        match line {
            Line::Iteration(found) => found.secs = 0.0,
            Line::Validation(found) => found.peak_memory_mib = None,
        }
    }
    let read = |name: &str| std::fs::read(last.join(name)).unwrap();
    (read("weights.safetensors"), read("optimizer.safetensors"), lines)
}

#[test]
fn killed_at_twenty_moments_a_run_ends_like_one_that_was_not() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| -> PathBuf { folder.path().join(name) };
    prepared().save(&place("prepared")).unwrap();
    let config = place("run.toml");
    std::fs::write(&config, settings(&place("prepared"), 150, 150).to_toml().unwrap()).unwrap();

    let started = std::time::Instant::now();
    let whole = train(&config, &place("whole"), &[]).output().unwrap();
    assert!(whole.status.success(), "{}", String::from_utf8_lossy(&whole.stderr));
    let whole_millis = started.elapsed().as_millis() as usize;
    let expected = learned(&place("whole"));
    assert_eq!(expected.2.iter().filter(|line| matches!(line, Line::Iteration(_))).count(), 300);

    let mut draws = Draws::new(20, "moments", 0);
    let (mut kills, mut runs, mut advances, mut reached) = (0, 0, 0, 0);
    while kills < 20 {
        let out = place(&format!("killed{runs}"));
        let flags: &[&str] = if out.join("settings.toml").exists() { &["--resume"] } else { &[] };
        let mut child = train(&config, &out, flags).spawn().unwrap();
        // Anywhere from before the first iteration to some way into the run.
        std::thread::sleep(Duration::from_millis(draws.below(whole_millis / 3 + 20) as u64));
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success());
            assert!(learned(&out) == expected, "run {runs} ended with something else");
            (runs, reached) = (runs + 1, 0);
            continue;
        }
        // SIGKILL: nothing in the process gets to run any more.
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        let now = std::fs::read_dir(out.join("checkpoints")).map_or(0, |entries| {
            let names = entries.filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
            names.max().unwrap_or(0_usize)
        });
        advances += usize::from(now > reached);
        reached = now;
    }
    let out = place(&format!("killed{runs}"));
    let flags: &[&str] = if out.join("settings.toml").exists() { &["--resume"] } else { &[] };
    let last = train(&config, &out, flags).output().unwrap();
    assert!(last.status.success(), "{}", String::from_utf8_lossy(&last.stderr));
    assert!(learned(&out) == expected, "the last run ended with something else");
    // Enough of the kills fell into the training itself.
    assert!(advances >= 5, "only {advances} of 20 kills came after a new checkpoint");
    // What is left is a model that loads without the data.
    let bundle = Bundle::load(&out.join("bundle"), &model::cpu().device).unwrap();
    assert_eq!(bundle.vocabulary, prepared().vocabulary);
}

#[test]
fn memory_is_flat_over_two_thousand_iterations() {
    let folder = tempfile::tempdir().unwrap();
    let set = prepared();
    let mut settings = settings(Path::new("unused"), 1000, 1000);
    settings.training.checkpoint_every = 100;
    let facts = RunFacts {
        rprae: "0".to_owned(),
        data: set.fingerprint.clone(),
        device: "cpu".to_owned(),
        parameters: Vec::new(),
        mirrored: None,
    };
    let run = RunFolder::open(folder.path(), &settings, &facts, Begin::New).unwrap();
    let mut memory = Vec::new();
    training::train(&set, &settings, &model::cpu().device, &run, None, &mut |event| {
        if let Event::Iterated(found) = event
            && found.iteration.is_multiple_of(250)
        {
            memory.push(training::memory_mib());
        }
    })
    .unwrap();
    let Some(memory) = memory.into_iter().collect::<Option<Vec<f64>>>() else {
        eprintln!("skipped: this system does not tell how much memory a process uses");
        return;
    };
    // After the first 250 iterations everything has its place; a leak of 10 kB an iteration would be 17 MiB.
    assert!(memory[7] - memory[0] < 8.0, "{memory:?} MiB");
}
