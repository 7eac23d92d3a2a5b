//! Inputs made to do harm: a clear line each, and nothing lost that was good.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]

use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, OpenOptions, Sample, Skipped};
use rprae::motion::{Body, Frame, Motion};
use zip::write::SimpleFileOptions;

fn good_xml() -> String {
    let mut frame = Frame::ZERO;
    frame.root_position_m = [0.0, 0.0, 0.9];
    write_mmm(&Motion::new(Body::with_default_mass(1.8), 100.0, vec![frame; 40]).unwrap(), "s")
}

fn open(path: &Path) -> Dataset {
    Dataset::open(path, &OpenOptions::default()).unwrap()
}

fn load(path: &Path) -> Vec<Result<Sample, Skipped>> {
    let dataset = open(path);
    dataset.entries().iter().map(|entry| dataset.load(entry)).collect()
}

fn zip_of(path: &Path, entries: &[(&str, &[u8])]) {
    let mut writer = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in entries {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
}

#[track_caller]
fn refused(loaded: &Result<Sample, Skipped>, part: &str) {
    let reason = &loaded.as_ref().expect_err(part).reason;
    assert!(reason.contains(part) && !reason.contains('\n'), "{reason} should contain {part}");
}

#[test]
fn a_bomb_among_good_motions_costs_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kit.zip");
    let xml = good_xml();
    let zeros = vec![0; 80 << 20];
    zip_of(
        &path,
        &[
            ("00001_mmm.xml", xml.as_bytes()),
            ("00002_mmm.xml", &zeros),
            ("00003_mmm.xml", xml.as_bytes()),
            ("00003_annotations.json", &zeros),
        ],
    );
    let start = Instant::now();
    let loaded = load(&path);
    assert!(start.elapsed() < Duration::from_secs(20));
    refused(&loaded[1], "compressed more than 200:1");
    assert!(loaded[0].is_ok());
    let third = loaded[2].as_ref().unwrap();
    assert!(third.captions.is_empty());
    assert!(third.warnings[0].contains("00003_annotations.json") && third.warnings[0].contains("200:1"));
}

#[test]
fn an_archive_cut_off_anywhere_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kit.zip");
    let xml = good_xml();
    zip_of(&path, &[("00001_mmm.xml", xml.as_bytes()), ("00002_mmm.xml", xml.as_bytes())]);
    let whole = std::fs::read(&path).unwrap();
    for cut in (0..whole.len()).step_by(37) {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let error = Dataset::open(&path, &OpenOptions::default()).expect_err("cut").to_string();
        assert!(error.contains("kit.zip") && !error.contains('\n'), "{error}");
    }
    // Data damaged inside one entry: the other is still good.
    let mut damaged = whole.clone();
    let middle = 60 + whole.len() / 8;
    damaged[middle..middle + 40].fill(0xaa);
    std::fs::write(&path, &damaged).unwrap();
    let loaded = load(&path);
    refused(&loaded[0], "cannot be unpacked");
    assert!(loaded[1].is_ok());
}

#[test]
fn names_that_leave_the_archive_or_come_twice_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kit.zip");
    let xml = good_xml();
    zip_of(
        &path,
        &[
            ("../../etc/00001_mmm.xml", xml.as_bytes()),
            ("/abs/00002_mmm.xml", xml.as_bytes()),
            ("a/00003_mmm.xml", xml.as_bytes()),
            ("b/00003_mmm.xml", xml.as_bytes()),
        ],
    );
    let dataset = open(&path);
    assert_eq!(dataset.skipped().len(), 2, "{:?}", dataset.skipped());
    assert!(dataset.skipped().iter().all(|s| s.reason.contains("points outside the archive")));
    // Two motions of one id are told apart by their folders.
    let ids: Vec<&str> = dataset.entries().iter().map(|entry| entry.id.as_str()).collect();
    assert_eq!(ids, ["a_00003_mmm.xml", "b_00003_mmm.xml"]);
    assert!(load(&path).iter().all(Result::is_ok));
}

#[test]
fn captions_of_any_kind_leave_the_motion_alone() {
    type Case<'a> = (&'a str, &'a [u8], &'a [&'a str], Option<&'a str>);
    let folder = tempfile::tempdir().unwrap();
    let long = format!("[\"{}\", \"kept\"]", "word ".repeat(2_000_000));
    let cases: [Case<'_>; 6] = [
        ("00001", b"[]", &[], None),
        ("00002", b"[\"\", \"kept\"]", &["kept"], Some("empty captions left out: 1")),
        ("00003", long.as_bytes(), &["kept"], Some("more than 2000 characters left out: 1")),
        ("00004", "[\"رجل \u{202e}يمشي\"]".as_bytes(), &["رجل \u{202e}يمشي"], None),
        ("00005", b"[\"caf\xe9\"]", &[], Some("are not read")),
        ("00006", b"", &[], Some("are not read")),
    ];
    for (id, captions, ..) in cases {
        std::fs::write(folder.path().join(format!("{id}_mmm.xml")), good_xml()).unwrap();
        std::fs::write(folder.path().join(format!("{id}_annotations.json")), captions).unwrap();
    }
    for (loaded, (id, _, expected, warning)) in load(folder.path()).into_iter().zip(cases) {
        let sample = loaded.unwrap();
        assert_eq!((sample.id.as_str(), sample.captions.as_slice()), (id, &expected.map_to_strings()[..]));
        match warning {
            Some(part) => assert!(sample.warnings[0].contains(part), "{:?}", sample.warnings),
            None => assert!(sample.warnings.is_empty(), "{:?}", sample.warnings),
        }
    }
}

trait MapToStrings {
    fn map_to_strings(&self) -> Vec<String>;
}

impl MapToStrings for &[&str] {
    fn map_to_strings(&self) -> Vec<String> {
        self.iter().map(|text| (*text).to_owned()).collect()
    }
}

/// An `.npy` of version 1.0.
fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let fortran = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn arrays_are_numbers_in_any_order_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    let value = |frame: usize, channel: usize| 0.001 * (50 * frame + channel) as f64;
    let row_major: Vec<f64> = (0..3).flat_map(|f| (0..50).map(move |c| value(f, c))).collect();
    let column_major: Vec<f64> = (0..50).flat_map(|c| (0..3).map(move |f| value(f, c))).collect();
    let little: Vec<u8> = row_major.iter().flat_map(|v| v.to_le_bytes()).collect();
    let big: Vec<u8> = row_major.iter().flat_map(|v| v.to_be_bytes()).collect();
    let fortran: Vec<u8> = column_major.iter().flat_map(|v| v.to_le_bytes()).collect();
    let fortran_big: Vec<u8> = column_major.iter().flat_map(|v| v.to_be_bytes()).collect();
    for bytes in [
        npy("'<f8'", false, "(3, 50)", &little),
        npy("'>f8'", false, "(3, 50)", &big),
        npy("'<f8'", true, "(3, 50)", &fortran),
        npy("'>f8'", true, "(3, 50)", &fortran_big),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let sample = load(&path).remove(0).unwrap();
        let channels: Vec<f64> = sample.motion.frames().iter().flat_map(Frame::to_channels).collect();
        assert_eq!(channels, row_major);
    }
    for (bytes, part) in [
        (npy("'|O'", false, "(3, 50)", b"\x80\x04cos\nsystem\n."), "pickle"),
        (npy("[('a', '<f8')]", false, "(3, 50)", &little), "not that of a plain array"),
        (npy("'<f8'", false, "(3, 50)", &little[..100]), "truncated"),
        (npy("'<f8'", false, "(18446744073709551615, 50)", &little), ""),
    ] {
        std::fs::write(&path, bytes).unwrap();
        refused(&load(&path)[0], part);
    }
}
