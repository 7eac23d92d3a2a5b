//! The motion cache: equal to the source to the bit, and never trusted when it should not be.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::path::{Path, PathBuf};

use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, OpenOptions, Sample, Skipped};
use rprae::motion::{Body, Frame, Motion};

struct Set {
    folder: tempfile::TempDir,
}

impl Set {
    /// Three motions that can be read, one that cannot, captions, and a table of numbers that are no short decimals.
    fn new() -> Self {
        let set = Self { folder: tempfile::tempdir().unwrap() };
        std::fs::create_dir(set.motions()).unwrap();
        for (id, num_frames) in [("00001", 30), ("00002", 50)] {
            set.write(&format!("{id}_mmm.xml"), &write_mmm(&motion(num_frames, 0.012345), "s"));
        }
        set.write("00001_annotations.json", r#"["a person walks", ""]"#);
        set.write("00003_mmm.xml", "<MMM>");
        let row = (0..50).map(|i| (1.0 / f64::from(3 + i)).to_string()).collect::<Vec<_>>().join(",");
        set.write("00004.csv", &row);
        set
    }

    fn motions(&self) -> PathBuf {
        self.folder.path().join("motions")
    }

    fn caches(&self) -> PathBuf {
        self.folder.path().join("caches")
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.motions().join(name), text).unwrap();
    }

    fn plain(&self) -> Dataset {
        Dataset::open(&self.motions(), &OpenOptions::default()).unwrap()
    }

    fn cached(&self) -> (Dataset, Vec<String>) {
        self.plain().cached(&self.motions(), &self.caches(), &|_, _| {})
    }

    fn file(&self) -> PathBuf {
        let mut files: Vec<PathBuf> =
            std::fs::read_dir(self.caches()).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert_eq!(files.len(), 1, "{files:?}");
        files.remove(0)
    }
}

fn motion(num_frames: usize, step: f64) -> Motion {
    let frames = (0..num_frames).map(|index| {
        let mut frame = Frame::ZERO;
        frame.root_position_m = [step * index as f64, -1.25, 0.912345];
        frame.joint_angles_rad[20] = -step * index as f64;
        frame
    });
    Motion::new(Body::with_default_mass(1.8), 100.0, frames.collect()).unwrap()
}

fn all(dataset: &Dataset) -> Vec<Result<Sample, Skipped>> {
    dataset.entries().iter().map(|entry| dataset.load(entry)).collect()
}

fn bits(loaded: &[Result<Sample, Skipped>]) -> Vec<u64> {
    let samples = loaded.iter().flatten();
    samples.flat_map(|sample| sample.motion.frames()).flat_map(Frame::to_channels).map(f64::to_bits).collect()
}

fn flip(path: &Path, place: usize) {
    let mut bytes = std::fs::read(path).unwrap();
    bytes[place] ^= 0x10;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_cached_motion_is_that_of_its_source() {
    let set = Set::new();
    let from_source = all(&set.plain());
    let (first, notes) = set.cached();
    assert_eq!(notes, [""; 0]);
    let written = std::fs::metadata(set.file()).unwrap().modified().unwrap();
    let (second, notes) = set.cached();
    assert_eq!(notes, [""; 0]);
    assert_eq!(std::fs::metadata(set.file()).unwrap().modified().unwrap(), written, "it was built again");
    for dataset in [first, second] {
        let cached = all(&dataset);
        assert_eq!(cached, from_source);
        assert_eq!(bits(&cached), bits(&from_source));
    }
    assert!(from_source[2].is_err());
}

#[test]
fn a_cached_motion_is_really_read_from_the_cache() {
    let set = Set::new();
    let (dataset, _) = set.cached();
    let before = all(&dataset);
    for entry in std::fs::read_dir(set.motions()).unwrap() {
        std::fs::remove_file(entry.unwrap().path()).unwrap();
    }
    assert_eq!(all(&dataset), before);
}

#[test]
fn what_changed_is_read_again() {
    let set = Set::new();
    drop(set.cached());
    set.write("00002_mmm.xml", &write_mmm(&motion(50, 0.054321), "s"));
    set.write("00001_annotations.json", r#"["another"]"#);
    set.write("00005_mmm.xml", &write_mmm(&motion(5, 0.1), "s"));
    std::fs::remove_file(set.motions().join("00004.csv")).unwrap();
    let (dataset, notes) = set.cached();
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(notes[0].contains("3 of 4 motions are new or changed"), "{notes:?}");
    assert_eq!(all(&dataset), all(&set.plain()));
    assert_eq!(set.cached().1, [""; 0]);
}

#[test]
fn a_file_put_back_in_time_is_read_again() {
    let set = Set::new();
    drop(set.cached());
    let path = set.motions().join("00002_mmm.xml");
    let times = std::fs::metadata(&path).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    // Same size, same modification time, other content.
    std::fs::write(&path, text.replacen("912.345", "812.345", 1)).unwrap();
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    file.set_modified(times.modified().unwrap()).unwrap();
    assert_eq!(std::fs::metadata(&path).unwrap().len(), times.len());
    let (dataset, _) = set.cached();
    assert_eq!(all(&dataset), all(&set.plain()));
}

#[test]
fn other_options_have_another_cache() {
    let set = Set::new();
    drop(set.cached());
    let options = OpenOptions { mass_kg: Some(60.0), ..OpenOptions::default() };
    let dataset = Dataset::open(&set.motions(), &options).unwrap();
    let (dataset, notes) = dataset.cached(&set.motions(), &set.caches(), &|_, _| {});
    assert_eq!(notes, [""; 0]);
    assert_eq!(dataset.load(&dataset.entries()[0]).unwrap().motion.body().mass_kg, 60.0);
    assert_eq!(std::fs::read_dir(set.caches()).unwrap().count(), 2);
}

#[test]
fn damage_is_never_trusted() {
    let set = Set::new();
    drop(set.cached());
    let (file, good) = (set.file(), std::fs::read(set.file()).unwrap());
    let from_source = all(&set.plain());
    for place in (0..good.len()).step_by(97).chain(good.len() - 40..good.len()) {
        std::fs::write(&file, &good).unwrap();
        flip(&file, place);
        let (dataset, notes) = set.cached();
        let loaded = all(&dataset);
        assert_eq!(bits(&loaded), bits(&from_source), "a flipped bit at {place}");
        let told =
            loaded.iter().flatten().any(|sample| sample.warnings.iter().any(|w| w.contains("is damaged")));
        assert!(told || notes.iter().any(|note| note.contains("is built again")), "{place}: {notes:?}");
    }
    for cut in (0..good.len()).step_by(211) {
        std::fs::write(&file, &good[..cut]).unwrap();
        let (dataset, notes) = set.cached();
        assert!(notes.len() == 1 && notes[0].contains("is built again"), "{cut}: {notes:?}");
        assert_eq!(all(&dataset), from_source);
    }
    // It is whole again by now.
    assert_eq!(set.cached().1, [""; 0]);
}

#[test]
fn a_cache_that_cannot_be_written_is_left_out() {
    let set = Set::new();
    std::fs::write(set.caches(), "a file where the folder should be").unwrap();
    let (dataset, notes) = set.cached();
    assert!(notes.iter().any(|note| note.contains("cannot be written")), "{notes:?}");
    assert_eq!(all(&dataset), all(&set.plain()));
}

#[test]
fn a_zip_is_cached_and_its_missing_pieces_are_named() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kit.zip");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    let xml = write_mmm(&motion(20, 0.01), "s");
    let meta = r#"{"nb_annotations": 1, "source": {"institution": {"identifier": "kit", "name": "x"}, "database": {"identifier": "kit"}}}"#;
    for (name, text) in [
        ("00001_mmm.xml", xml.as_str()),
        ("00001_annotations.json", "[\"a\"]"),
        ("00001_meta.json", meta),
        ("00001_raw.c3d", "ignored"),
        ("00002_mmm.xml", xml.as_str()),
        ("00003_annotations.json", "[\"lost\"]"),
    ] {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    }
    zip.finish().unwrap();
    let dataset = Dataset::open(&path, &OpenOptions::default()).unwrap();
    let from_source = all(&dataset);
    let pieces = dataset.pieces().unwrap();
    assert_eq!(pieces.without_captions, ["00002"]);
    assert_eq!(pieces.without_meta, ["00002"]);
    assert_eq!(pieces.without_motion, ["00003"]);
    let meta = dataset.meta(&dataset.entries()[0]).unwrap().unwrap();
    assert_eq!(meta.source.database.identifier, "kit");
    assert_eq!(dataset.meta(&dataset.entries()[1]), Ok(None));
    let (dataset, notes) = dataset.cached(&path, &folder.path().join("caches"), &|_, _| {});
    assert_eq!((notes.len(), all(&dataset)), (0, from_source));
}
