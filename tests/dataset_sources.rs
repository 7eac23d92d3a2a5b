//! Folders, zips, manifests and tables through the public interface.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::io::Write as _;
use std::path::Path;

use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, DatasetError, OpenOptions, Sample};
use rprae::motion::{Body, Frame, Motion};
use zip::write::SimpleFileOptions;

fn motion(num_frames: usize) -> Motion {
    let frames = (0..num_frames)
        .map(|index| {
            let mut frame = Frame::ZERO;
            frame.root_position_m = [0.01 * index as f64, 0.0, 0.9];
            frame.joint_angles_rad[20] = -0.01 * index as f64;
            frame
        })
        .collect();
    Motion::new(Body::with_default_mass(1.8), 100.0, frames).unwrap()
}

fn csv(num_frames: usize) -> String {
    let row = vec!["0.1"; 50].join(",");
    vec![row; num_frames].join("\n")
}

fn open(path: &Path) -> Dataset {
    Dataset::open(path, &OpenOptions::default()).unwrap()
}

fn ids(dataset: &Dataset) -> Vec<&str> {
    dataset.entries().iter().map(|entry| entry.id.as_str()).collect()
}

fn load_all(dataset: &Dataset) -> Vec<Sample> {
    dataset.entries().iter().map(|entry| dataset.load(entry).unwrap()).collect()
}

fn zip_of(path: &Path, entries: &[(&str, &[u8])]) {
    let mut writer = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in entries {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_folder_and_a_zip_in_the_kit_layout_read_alike() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (write_mmm(&motion(5), "s1"), write_mmm(&motion(7), "s2"));
    let files: [(&str, &[u8]); 8] = [
        ("00002_mmm.xml", two.as_bytes()),
        ("00001_mmm.xml", one.as_bytes()),
        ("00001_annotations.json", br#"["a person bends a knee", " "]"#),
        ("00001_meta.json", b"{}"),
        ("00001_raw.c3d", b"\x02P"),
        ("00002_annotations.json", b"{broken"),
        ("extra.csv", csv(3).leak().as_bytes()),
        (".hidden.xml", b"no"),
    ];
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("sub/deep.xml"), &one).unwrap();
    let archive = folder.path().join("kit.zip");
    zip_of(&archive, &files);

    let (from_folder, from_zip) = (open(folder.path()), open(&archive));
    for dataset in [&from_folder, &from_zip] {
        assert_eq!(ids(dataset), ["00001", "00002", "extra"]);
        assert!(dataset.skipped().is_empty());
        let samples = load_all(dataset);
        assert_eq!(samples[0].captions, ["a person bends a knee"]);
        assert_eq!(samples[0].warnings, ["empty captions left out: 1"]);
        assert_eq!((samples[0].motion.num_frames(), samples[0].motion.rate_hz()), (5, 100.0));
        assert!(samples[1].captions.is_empty());
        assert!(samples[1].warnings[0].contains("00002_annotations.json"), "{:?}", samples[1].warnings);
        assert!(samples[2].warnings[0].contains("100 Hz is assumed"), "{:?}", samples[2].warnings);
    }
    for (a, b) in load_all(&from_folder).iter().zip(load_all(&from_zip)) {
        assert_eq!((&a.motion, &a.captions), (&b.motion, &b.captions));
    }
    let source = load_all(&from_zip)[0].source.display().to_string();
    assert!(source.ends_with("kit.zip!/00001_mmm.xml"), "{source}");
}

#[test]
fn a_zip_is_read_from_many_threads() {
    use rayon::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.zip");
    let files: Vec<(String, Vec<u8>)> = (0..40)
        .map(|i| (format!("kit/{i:05}_mmm.xml"), write_mmm(&motion(3 + i), "s").into_bytes()))
        .collect();
    let entries: Vec<(&str, &[u8])> = files.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
    zip_of(&path, &entries);
    let dataset = open(&path);
    let lengths: Vec<usize> =
        dataset.entries().par_iter().map(|entry| dataset.load(entry).unwrap().motion.num_frames()).collect();
    assert_eq!(lengths, (3..43).collect::<Vec<_>>());
}

#[test]
fn a_single_file_has_its_captions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("00007_mmm.xml");
    std::fs::write(&path, write_mmm(&motion(4), "s")).unwrap();
    std::fs::write(folder.path().join("00007_annotations.json"), r#"["a, \"b\"\nc"]"#).unwrap();
    std::fs::write(folder.path().join("00008_mmm.xml"), "no").unwrap();
    let dataset = open(&path);
    assert_eq!(ids(&dataset), ["00007"]);
    assert_eq!(load_all(&dataset)[0].captions, ["a, \"b\" c"]);
}

#[test]
fn options_fill_what_tables_do_not_say() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, csv(3)).unwrap();
    let options = OpenOptions { rate_hz: Some(20.0), height_m: 1.6, mass_kg: Some(50.0) };
    let dataset = Dataset::open(&path, &options).unwrap();
    let sample = dataset.load(&dataset.entries()[0]).unwrap();
    assert_eq!(sample.motion.rate_hz(), 20.0);
    assert_eq!(sample.motion.body(), Body { height_m: 1.6, mass_kg: 50.0 });
    assert!(sample.warnings.is_empty());

    for options in [
        OpenOptions { rate_hz: Some(f64::NAN), ..OpenOptions::default() },
        OpenOptions { height_m: 175.0, ..OpenOptions::default() },
        OpenOptions { mass_kg: Some(0.0), ..OpenOptions::default() },
    ] {
        assert!(matches!(Dataset::open(&path, &options), Err(DatasetError::Setting { .. })));
    }
}

#[test]
fn the_mass_of_a_file_holds_unless_it_is_the_placeholder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xml");
    let mass = |text: &str, option: Option<f64>| {
        let xml = write_mmm(&motion(4), "s").replace("<Mass>72.9</Mass>", text);
        std::fs::write(&path, xml).unwrap();
        let dataset =
            Dataset::open(&path, &OpenOptions { mass_kg: option, ..OpenOptions::default() }).unwrap();
        dataset.load(&dataset.entries()[0]).unwrap().motion.body().mass_kg
    };
    assert_eq!(mass("<Mass>100</Mass>", None), 22.5 * 1.8 * 1.8);
    assert_eq!(mass("", None), 22.5 * 1.8 * 1.8);
    assert_eq!(mass("<Mass>69</Mass>", None), 69.0);
    assert_eq!(mass("<Mass>100</Mass>", Some(80.0)), 80.0);
}

#[test]
fn a_manifest_pairs_files_and_captions() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("set");
    std::fs::create_dir_all(root.join("sub")).unwrap();
    std::fs::write(folder.path().join("outside.csv"), csv(3)).unwrap();
    std::fs::write(root.join("a.csv"), csv(3)).unwrap();
    std::fs::write(root.join("sub/b.csv"), csv(4)).unwrap();
    std::fs::write(root.join("c.xml"), write_mmm(&motion(4), "s")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("../outside.csv", root.join("link.csv")).unwrap();
    let lines = [
        r#"{"file": "sub/b.csv", "captions": ["one", "two"], "rate_hz": 25, "height_m": 1.9}"#,
        "",
        r#"{"file": "a.csv", "id": "z", "caption": "three"}"#,
        r#"{"file": "c.xml", "height_m": 1.5, "rate_hz": 30}"#,
        r#"{"file": "a.csv", "id": "z"}"#,
        r#"{"file": "../outside.csv"}"#,
        r#"{"file": "/etc/passwd"}"#,
        r#"{"file": "missing.csv"}"#,
        r#"{"file": "a.csv", "id": "../../z"}"#,
        r#"{"file": "a.csv", "fps": 3}"#,
        r#"{"file": "a.csv", "caption": "x", "captions": []}"#,
        r#"{"file": "sub"}"#,
        r#"{"file": "#,
        "\u{0}",
        r#"{"file": "link.csv"}"#,
    ];
    let path = root.join("all.jsonl");
    std::fs::write(&path, lines.join("\n")).unwrap();
    let dataset = open(&path);
    assert_eq!(ids(&dataset), ["b", "c", "z"]);
    let samples = load_all(&dataset);
    assert_eq!(samples[0].captions, ["one", "two"]);
    assert_eq!((samples[0].motion.rate_hz(), samples[0].motion.body().height_m), (25.0, 1.9));
    assert_eq!((samples[1].motion.rate_hz(), samples[1].motion.body().height_m), (100.0, 1.5));
    assert!(samples[1].warnings[0].contains("30 Hz"), "{:?}", samples[1].warnings);
    assert_eq!(samples[2].captions, ["three"]);

    let mut reasons: Vec<&str> = dataset.skipped().iter().map(|s| s.reason.as_str()).collect();
    reasons
        .sort_by_key(|reason| reason.split([' ', ':']).nth(1).and_then(|number| number.parse::<u32>().ok()));
    let expected = [
        "line 5: the id \"z\" is that of line 3 already",
        "line 6: the file \"../outside.csv\" is not inside",
        "line 7: the file \"/etc/passwd\" is not inside",
        "line 8: the file \"missing.csv\": No such file",
        "line 9: the id \"../../z\" cannot name a file",
        "line 10: unknown field `fps`",
        "line 11: both \"caption\" and \"captions\"",
        "line 12: the file \"sub\" is none of",
        "line 13: EOF while parsing a value",
        "line 14: expected value",
        "line 15: the file \"link.csv\" links out",
    ];
    assert_eq!(reasons.len(), expected.len(), "{reasons:#?}");
    for (reason, expected) in reasons.iter().zip(expected) {
        assert!(reason.starts_with(expected), "{reason} should start with {expected}");
    }
}

#[test]
fn unusable_datasets_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let empty_zip = folder.path().join("empty.zip");
    zip_of(&empty_zip, &[("readme.txt", b"x")]);
    for (path, reason) in [
        (folder.path().join("missing"), "No such file"),
        (empty, "there is no .xml"),
        (empty_zip, "there is no .xml"),
        (at("bad.zip", b"PK\x03\x04 not a zip"), "read the zip"),
        (at("bad.jsonl", b"{}\n[]\n"), "2 inputs, none usable; the first is bad.jsonl:1 ("),
        (at("worse.jsonl", b"{}\n"), "worse.jsonl): line 1: missing field `file`"),
        (at("none.jsonl", b""), "there is no .xml"),
        (at("model.pkl", b"\x80\x04."), "pickled files can run code"),
        (at("model.txt", b"1 2 3"), "not a kind of file that holds motions; expected a folder, .zip"),
    ] {
        let error = Dataset::open(&path, &OpenOptions::default()).unwrap_err().to_string();
        assert!(error.contains(reason), "{error} should contain {reason}");
        assert!(error.contains(&*path.file_name().unwrap().to_string_lossy()), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn zips_that_cheat_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cheat.zip");
    let good = write_mmm(&motion(4), "s");
    zip_of(&path, &[("../up.xml", good.as_bytes()), ("ok_mmm.xml", good.as_bytes()), ("C:\\x.xml", b"x")]);
    let dataset = open(&path);
    assert_eq!(ids(&dataset), ["ok"]);
    assert_eq!(dataset.skipped().len(), 2);
    assert!(dataset.skipped().iter().all(|s| s.reason.contains("points outside the archive")));

    // 64 MB of zeros in some 64 kB.
    zip_of(&path, &[("bomb.xml", &vec![0; 64 << 20])]);
    let dataset = open(&path);
    let skipped = dataset.load(&dataset.entries()[0]).unwrap_err();
    assert!(skipped.reason.contains("compressed more than 200:1"), "{}", skipped.reason);

    // The second of two names is changed into the first, in the local header and the table of contents.
    zip_of(&path, &[("aa.xml", good.as_bytes()), ("ab.xml", good.as_bytes())]);
    let mut bytes = std::fs::read(&path).unwrap();
    for at in 0..bytes.len() - 6 {
        if &bytes[at..at + 6] == b"ab.xml" {
            bytes[at + 1] = b'a';
        }
    }
    std::fs::write(&path, &bytes).unwrap();
    let error = Dataset::open(&path, &OpenOptions::default()).unwrap_err().to_string();
    assert!(error.contains("two entries share a name"), "{error}");

    // A size in the table of contents that is not that of the data.
    zip_of(&path, &[("a.xml", good.as_bytes())]);
    let honest = std::fs::read(&path).unwrap();
    for change in [-1, 1] {
        let mut bytes = honest.clone();
        let contents = bytes.windows(4).rposition(|w| w == b"PK\x01\x02").unwrap();
        let size = u32::from_le_bytes(bytes[contents + 24..contents + 28].try_into().unwrap());
        bytes[contents + 24..contents + 28].copy_from_slice(&size.wrapping_add_signed(change).to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let dataset = open(&path);
        let skipped = dataset.load(&dataset.entries()[0]).unwrap_err();
        assert!(skipped.reason.contains("cannot be unpacked"), "{}", skipped.reason);
    }
}

#[test]
fn the_bundled_dataset_loads() {
    let dataset = Dataset::bundled();
    assert!(dataset.skipped().is_empty());
    for sample in load_all(&dataset) {
        assert!(!sample.captions.is_empty(), "{}", sample.id);
        assert!(sample.warnings.is_empty(), "{}: {:?}", sample.id, sample.warnings);
    }
}
