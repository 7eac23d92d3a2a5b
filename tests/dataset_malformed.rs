//! Malformed motion files: each gives one line that names the fault, and nothing panics or takes long.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up should fail")]
#![expect(clippy::format_collect, reason = "the documents are small")]

use std::path::Path;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use rprae::dataset::mmm::write_mmm;
use rprae::dataset::{Dataset, OpenOptions, Sample, Skipped};
use rprae::motion::{Body, Frame, Motion};

fn valid_xml() -> String {
    let mut frame = Frame::ZERO;
    frame.root_position_m = [0.1, 0.2, 0.9];
    let motion = Motion::new(Body::with_default_mass(1.8), 100.0, vec![frame; 3]).unwrap();
    write_mmm(&motion, "subject")
}

/// A v2.0 file with the pose and joints of `num_frames` frames, and `sensor` between the sensors.
fn version_2(num_frames: usize, num_joint_frames: usize, sensor: &str) -> String {
    let names: String =
        rprae::motion::JOINTS.iter().map(|j| format!("<Joint name=\"{}\"/>", j.name)).collect();
    let zeros = "0 ".repeat(44);
    let poses: String = (0..num_frames)
        .map(|i| format!(
            "<Measurement timestep=\"{}\"><RootPosition>1 2 900</RootPosition><RootRotation>0 0 1</RootRotation></Measurement>",
            f64::from(i as u32) * 0.01
        ))
        .collect();
    let joints: String = (0..num_joint_frames)
        .map(|i| {
            format!(
                "<Measurement timestep=\"{}\"><JointPosition>{zeros}</JointPosition></Measurement>",
                f64::from(i as u32) * 0.01
            )
        })
        .collect();
    format!(
        "<MMM version=\"2.0\"><Motion name=\"a\"><Model path=\"m\"><ModelProcessorConfig><Height>1.8</Height><Mass>100</Mass>\
         </ModelProcessorConfig></Model><Sensors><Sensor type=\"ModelPose\"><Configuration/><Data>{poses}</Data></Sensor>\
         {sensor}<Sensor type=\"Kinematic\"><Configuration><JointOrder>{names}</JointOrder></Configuration><Data>{joints}</Data>\
         </Sensor></Sensors></Motion></MMM>"
    )
}

/// The same with the joints directly in the configuration, as some recordings have them.
fn flat_joint_list() -> String {
    version_2(3, 3, "").replace("<JointOrder>", "").replace("</JointOrder>", "")
}

fn load(folder: &Path, name: &str, bytes: &[u8]) -> Result<Sample, Skipped> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    let dataset = Dataset::open(&path, &OpenOptions::default()).unwrap();
    dataset.load(&dataset.entries()[0])
}

fn check_reason(skipped: &Skipped, name: &str, expected: &str) {
    assert!(skipped.reason.contains(expected), "{:?} should contain {expected:?}", skipped.reason);
    assert!(!skipped.reason.contains(['\n', '\r']), "{:?}", skipped.reason);
    assert!(skipped.reason.len() < 1500, "{} characters: {:?}", skipped.reason.len(), skipped.reason);
    assert!(skipped.source.ends_with(name));
}

#[test]
fn every_fault_of_an_xml_is_named() {
    let good = valid_xml();
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1)
    };
    let row = "0 ".repeat(44);
    let row = row.trim_end();
    let cases: Vec<(String, &str)> = vec![
        (String::new(), "line 1: the document is empty"),
        ("\n\n  \n".to_owned(), "the document is empty"),
        ("hello".to_owned(), "line 1: not an XML document"),
        ("<robot name=\"x\"></robot>".to_owned(), "the document is a <robot>, expected an <MMM>"),
        ("<MMM></MMM>".to_owned(), "the file has no <Motion>"),
        ("<MMM><Motion/></MMM>".to_owned(), "no list of joints (<JointOrder>)"),
        (
            good[..good.find("</RootPosition>").unwrap()].to_owned(),
            "the file ends inside <RootPosition>: it is truncated",
        ),
        (good[..good.find("</MMM>").unwrap()].to_owned(), "the file ends inside <MMM>: it is truncated"),
        (good[..good.len() - 3].to_owned(), "not well-formed XML"),
        (with("</RootPosition>", "</RootPos>"), "line 60: not well-formed XML"),
        (format!("{good}<MMM/>"), "content after the end of <MMM>"),
        (with("<MMM>", "<!DOCTYPE MMM [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><MMM>"), "<!DOCTYPE>"),
        (with(">100 200 900<", ">&b; 200 900<"), "\"&b;\" in <RootPosition> is not a number"),
        (with(">100 200 900<", "><![CDATA[100 200 900]]><"), "CDATA"),
        (
            with(">100 200 900<", ">100 200 nine<"),
            "line 60: frame 0: \"nine\" in <RootPosition> is not a number",
        ),
        (with(">100 200 900<", ">100 200<"), "frame 0: <RootPosition> has 2 numbers, expected 3"),
        (with(">100 200 900<", ">100 200 900 1<"), "has 4 numbers, expected 3"),
        (with(">100 200 900<", ">100 200 nan<"), "frame 0: root z is NaN"),
        (with(">100 200 900<", ">100 200 1e308<"), "frame 0: root z is"),
        (with(">100 200 900<", ">100 200 1e999<"), "frame 0: root z is inf"),
        (with(row, row.get(2..).unwrap()), "frame 0: <JointPosition> has 43 numbers, expected 44"),
        (with(row, &"0 ".repeat(500)), "has 500 numbers, expected 44"),
        (with(row, "<a/>"), "unexpected <a> in <JointPosition>"),
        (
            with("<Timestep>0.01</Timestep>", "<Timestep>0</Timestep>"),
            "frame 1: the time stamp 0 s does not come after 0 s",
        ),
        (
            with("<Timestep>0.02</Timestep>", "<Timestep>0.07</Timestep>"),
            "resample the motion to a constant rate",
        ),
        (with("<Timestep>0.02</Timestep>", "<Timestep>inf</Timestep>"), "frame 2: the time stamp is inf"),
        (with("<Timestep>0.01</Timestep>", ""), "frame 1 has no <Timestep>"),
        (
            with("<Timestep>0.01</Timestep>", "<Timestep>0</Timestep><Timestep>0</Timestep>"),
            "frame 1 has more than one <Timestep>",
        ),
        (with("<Height>1.8</Height>", ""), "has no <Height>"),
        (with("<Height>1.8</Height>", "<Height>1800</Height>"), "body height of 1800 m"),
        (with("<Height>1.8</Height>", "<Height>-1</Height>"), "body height of -1 m"),
        (with("<Mass>72.9</Mass>", "<Mass>0</Mass>"), "body mass of 0 kg"),
        (with("BLNx_joint", "BLNy_joint"), "the joint list has BLNy_joint twice"),
        (with("BLNx_joint", "Tail_joint"), "missing BLNx_joint; unknown Tail_joint"),
        (with("<MotionFrames>", "<MotionFrames>text"), "unexpected text \"text\" in <MotionFrames>"),
        (good.replace("<MotionFrame>", "<Other>").replace("</MotionFrame>", "</Other>"), "no frames"),
        (
            with("<MotionFrames>", "<Sensors/><Sensors/><MotionFrames>")
                .replace("</MotionFrames>", "</MotionFrames><Sensors/>"),
            "unexpected <Sensors>",
        ),
        (
            with("<MotionFrames>", &format!("{}<MotionFrames>", "<a>".repeat(100_000))),
            "nested more than 64 deep",
        ),
        (
            with(
                "<JointOrder>",
                &format!(
                    "<JointOrder>{}",
                    (0..1000).map(|i| format!("<Joint name='{i}'/>")).collect::<String>()
                ),
            ),
            "more than 256 joints",
        ),
        (with("<Joint name='BLNx_joint'/>", "<Joint name='&x;'/>"), "not well-formed XML"),
        (version_2(3, 2, ""), "the Kinematic sensor has 2 measurements, the ModelPose sensor 3"),
        (
            version_2(3, 3, "").replacen("timestep=\"0.01\"", "timestep=\"0.011\"", 1),
            "time stamp 0.01 s at frame 1",
        ),
        (
            version_2(3, 3, "").replacen("timestep=\"0.01\"", "time=\"0.01\"", 1),
            "frame 1 has no <Measurement timestep",
        ),
        (
            version_2(3, 3, "").replacen("timestep=\"0.01\"", "timestep=\"x\"", 1),
            "\"x\" in <Measurement> is not a number",
        ),
        (version_2(3, 3, "").replacen("ModelPose", "Other", 1), "has no <Sensor type=\"ModelPose\">"),
        (version_2(3, 3, "<Sensor type=\"ModelPose\"/>"), "more than one <ModelPose sensor>"),
        (version_2(3, 3, "<Sensor type=\"Kinematic\"><Data/></Sensor>"), "no list of joints"),
        (version_2(1, 1, ""), "single frame"),
        (version_2(0, 0, ""), "no frames"),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (xml, reason) in &cases {
        let start = Instant::now();
        let skipped = load(folder.path(), "a_mmm.xml", xml.as_bytes()).expect_err(reason);
        check_reason(&skipped, "a_mmm.xml", reason);
        assert!(start.elapsed() < Duration::from_secs(2), "{reason}");
    }
    let latin: Vec<u8> =
        good.replace("subject", "subj\u{1}").bytes().map(|b| if b == 1 { 0xe9 } else { b }).collect();
    let skipped = load(folder.path(), "a.xml", &latin).unwrap_err();
    check_reason(&skipped, "a.xml", "line 3: not well-formed XML");
}

#[test]
fn what_is_unusual_but_clear_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let good = valid_xml();
    let expected = load(folder.path(), "a.xml", good.as_bytes()).unwrap();
    assert!(expected.warnings.is_empty(), "{:?}", expected.warnings);
    for xml in [
        good.replace('\n', "\r\n"),
        good.replace(['\n', '\t'], ""),
        format!("\u{feff}{good}<!-- end -->\n"),
        good.replace(">100 200 900<", "> 100 <!-- x --> 200\n900 <"),
        good.replace(">100 200 900<", ">1e2 200.0 +900<"),
        good.replace("</MotionFrame>", "<JointVelocity>nonsense</JointVelocity><CoM>1 2</CoM></MotionFrame>"),
        good.replace("<Joint name='BLNx_joint'/>", "<Joint name=\"BLNx_joint\"></Joint>"),
    ] {
        let found =
            load(folder.path(), "a.xml", xml.as_bytes()).unwrap_or_else(|s| panic!("{}: {xml}", s.reason));
        assert_eq!(found, expected);
    }
    let motion = &good[good.find("<Motion ").unwrap()..good.find("</MMM>").unwrap()];
    let two =
        load(folder.path(), "a.xml", format!("<MMM>{motion}{motion}<Other/></MMM>").as_bytes()).unwrap();
    assert_eq!(two.motion, expected.motion);
    assert_eq!(two.warnings, ["the file has 2 motions; only the first is read"]);
    let metres = load(folder.path(), "a.xml", good.replace("100 200 900", "0.1 0.2 0.9").as_bytes()).unwrap();
    assert!(metres.warnings[0].contains("are the positions in metres?"), "{:?}", metres.warnings);

    let version_2 =
        load(folder.path(), "b.xml", version_2(3, 3, "<Sensor type=\"Force\"><x/></Sensor>").as_bytes());
    let version_2 = version_2.unwrap();
    assert_eq!(version_2.motion.frames()[2].root_position_m, [0.001, 0.002, 0.9]);
    assert_eq!(version_2.motion.frames()[2].root_rotation_rad, [0.0, 0.0, 1.0]);
    assert_eq!((version_2.motion.rate_hz(), version_2.motion.num_frames()), (100.0, 3));
    let flat = flat_joint_list();
    assert_eq!(load(folder.path(), "b.xml", flat.as_bytes()).unwrap(), version_2);
}

#[test]
fn every_fault_of_a_table_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let row = |value: &str| vec![value; 50].join(",");
    let npy = |header: &str, data: &[u8]| {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend([header.as_bytes(), data].concat());
        bytes
    };
    let header = |shape: &str| format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("a.csv", Vec::new(), "the motion has no frames"),
        ("a.csv", row("nan").into_bytes(), "frame 0: BLNx_joint is NaN"),
        ("a.csv", row("1e999").into_bytes(), "frame 0: BLNx_joint is inf"),
        ("a.csv", b"1,2,3".to_vec(), "line 1: found 3 columns, expected 50"),
        (
            "a.csv",
            format!("{}\n{}", row("0"), row("x")).into_bytes(),
            "line 2, column 1: \"x\" is not a number",
        ),
        ("a.csv", vec![0xff; 1000], "line 1: found 1 columns"),
        ("a.csv", vec![b'"'; 1000], "columns, expected 50"),
        ("a.csv", row("20").into_bytes(), "degrees"),
        ("a.npy", Vec::new(), "not an .npy array"),
        ("a.npy", npy(&header("(0, 50)"), b""), "the motion has no frames"),
        (
            "a.npy",
            npy(&header("(10, 263)"), &[0; 8 * 2630]),
            "expected frames x 50 (or joint positions, frames x 21 x 3 or frames x 22 x 3), found 10 x 263",
        ),
        ("a.npy", npy(&header("(1000000000, 50)"), &[0; 80]), "it is truncated"),
        ("a.npy", npy(&header("(1, 50)"), &f64::NAN.to_le_bytes().repeat(50)), "frame 0: BLNx_joint is NaN"),
        ("a.npy", npy(&"{".repeat(50_000), b""), "its header is not that of a plain array"),
        ("a.npz", b"PK\x05\x06".to_vec(), "the .npz cannot be unpacked"),
        ("a.npz", Vec::new(), "the .npz cannot be unpacked"),
    ];
    for (name, bytes, reason) in cases {
        check_reason(&load(folder.path(), name, &bytes).expect_err(reason), name, reason);
    }
}

/// Zip and npz of one small entry each.
fn zipped(name: &str, bytes: &[u8]) -> Vec<u8> {
    use std::io::Write as _;
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
    writer.write_all(bytes).unwrap();
    writer.finish().unwrap().into_inner()
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let csv = vec![vec!["0.1"; 50].join(","); 2].join("\n").into_bytes();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 50), }\n";
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    npy.extend((header.len() as u16).to_le_bytes());
    npy.extend(header.as_bytes());
    npy.extend([0; 200]);
    let manifest = br#"{"file": "a.csv", "id": "m", "captions": ["x"], "rate_hz": 20}"#.to_vec();
    vec![
        ("a.xml", valid_xml().into_bytes()),
        ("b.xml", version_2(2, 2, "").into_bytes()),
        ("a.npz", zipped("motion.npy", &npy)),
        ("a.zip", zipped("00001_mmm.xml", valid_xml().as_bytes())),
        ("a.npy", npy),
        ("a.csv", csv),
        ("a.jsonl", manifest),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn changed_bytes_never_panic_or_hang(
        which in 0_usize..7,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..4), 1..6),
    ) {
        let (name, mut bytes) = seeds().swap_remove(which);
        for (place, value, kind) in changes {
            if bytes.is_empty() {
                break;
            }
            let place = place.index(bytes.len());
            match kind {
                0 => bytes[place] = value,
                1 => bytes.insert(place, value),
                2 => bytes.truncate(place),
                _ => { bytes.remove(place); }
            }
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.csv"), vec!["0"; 50].join(",")).unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let start = Instant::now();
        match Dataset::open(&path, &OpenOptions::default()) {
            Ok(dataset) => for entry in dataset.entries() {
                if let Err(skipped) = dataset.load(entry) {
                    prop_assert!(!skipped.reason.contains(['\n', '\r']), "{:?}", skipped.reason);
                }
            },
            Err(error) => prop_assert!(!error.to_string().contains('\n'), "{}", error),
        }
        prop_assert!(start.elapsed() < Duration::from_secs(5));
    }
}
