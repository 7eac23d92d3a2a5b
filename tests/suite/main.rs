//! The bundled suite: what is committed is what the generator makes, and what it makes is physics.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod captions;
mod impossible;
mod measure;
mod physics;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use rprae::dataset::Dataset;
use rprae::synthesis::{SuiteMotion, suite, suite_files, suite_readme};

static SUITE: LazyLock<Vec<SuiteMotion>> = LazyLock::new(|| suite().unwrap());

/// A motion of the suite by name.
fn motion(name: &str) -> &'static SuiteMotion {
    SUITE.iter().find(|motion| motion.name == name).unwrap()
}

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets")
}

#[test]
fn the_committed_files_are_what_the_generator_makes() {
    const REMEDY: &str = "run `cargo run --example generate_suite`";
    let files = suite_files(&SUITE);
    for (name, content) in &files {
        let path = assets().join("suite").join(name);
        let committed = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert!(committed == content.as_bytes(), "{name} differs; {REMEDY}");
    }
    let mut committed: Vec<_> = std::fs::read_dir(assets().join("suite"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    committed.sort();
    assert!(committed.iter().eq(files.iter().map(|(name, _)| name)), "files nobody makes: {committed:?}");
    let readme = std::fs::read_to_string(assets().join("README.md")).unwrap();
    assert_eq!(readme, suite_readme(&SUITE, &files), "assets/README.md differs; {REMEDY}");
    let total: usize = files.iter().map(|(_, content)| content.len()).sum();
    assert!(total < 4_000_000, "{total} bytes");
}

#[test]
fn the_program_carries_the_suite() {
    let dataset = Dataset::bundled();
    assert_eq!(dataset.entries().len(), SUITE.len());
    for (entry, made) in dataset.entries().iter().zip(SUITE.iter()) {
        let sample = dataset.load(entry).unwrap();
        assert_eq!(sample.id, made.id);
        assert_eq!(sample.captions, made.captions);
        assert_eq!(sample.warnings, Vec::<String>::new(), "{}", made.name);
        let motion = &made.performance.motion;
        assert_eq!(sample.motion.body(), motion.body());
        assert_eq!(sample.motion.num_frames(), motion.num_frames());
        assert!((sample.motion.rate_hz() - motion.rate_hz()).abs() < 1e-9);
        for (read, written) in sample.motion.frames().iter().zip(motion.frames()) {
            for (read, written) in read.to_channels().iter().zip(written.to_channels()) {
                assert!((read - written).abs() < 1e-9, "{}: {read} and {written}", made.name);
            }
        }
    }
}
