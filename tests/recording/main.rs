//! Recordings: what is written can be read back, by strangers and after a crash.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails here")]

mod decode;
mod playback;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use mcap::read::Options;
use nalgebra::Isometry3;
use rprae::humanoid::Humanoid;
use rprae::motion::JOINTS;
use rprae::plausibility::{METRICS, Score};
use rprae::recording::{
    Recorder, RecordingError, RecordingHeader, RecordingSummary, SAMPLE_METRICS, START_TIME_NS, view_commands,
};
use rprae::simulation::{Level, Rollout};

const SETTINGS: &str = "dt_secs = 0.002\n";
const RESULT: &str = "{\"id\":\"squat\"}";

fn captions() -> Vec<String> {
    vec!["a person squats".to_owned(), "jemand geht in die Hocke – zweimal".to_owned()]
}

fn run_metadata() -> BTreeMap<String, String> {
    BTreeMap::from([("rprae".to_owned(), "0.1.0".to_owned()), ("seed".to_owned(), "7".to_owned())])
}

/// Runs `body` with the header of the playback.
fn with_header<T>(humanoid: &Humanoid, body: impl FnOnce(&RecordingHeader<'_>) -> T) -> T {
    body(&RecordingHeader {
        humanoid,
        id: "squat",
        captions: &captions(),
        level: Level::L2,
        settings: SETTINGS,
        metadata: &run_metadata(),
        sample_interval_secs: 1.0 / playback::RATE_HZ,
    })
}

fn record(path: &Path, humanoid: &Humanoid, rollout: &Rollout) -> Result<(), RecordingError> {
    let mut recorder = with_header(humanoid, |header| Recorder::create(path, header))?;
    for sample in &rollout.samples {
        recorder.sample(sample)?;
    }
    let scores = [Score::new(METRICS[0], 12.5).unwrap()];
    recorder.finish(rollout, &RecordingSummary { result_json: RESULT, scores: &scores })
}

/// Messages as topic, log time, data, up to the first one that cannot be read.
fn readable_messages(bytes: &[u8]) -> Vec<(String, u64, Vec<u8>)> {
    let Ok(stream) = mcap::MessageStream::new_with_options(bytes, Options::IgnoreEndMagic.into()) else {
        return Vec::new();
    };
    stream
        .map_while(Result::ok)
        .map(|message| (message.channel.topic.clone(), message.log_time, message.data.into_owned()))
        .collect()
}

fn secs_since_start(time_ns: u64) -> f64 {
    (time_ns - START_TIME_NS) as f64 * 1e-9
}

#[test]
fn every_number_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("squat.mcap");
    let humanoid = playback::adult();
    let rollout = playback::rollout(&humanoid, 151);
    record(&path, &humanoid, &rollout).unwrap();
    let bytes = fs::read(&path).unwrap();

    let mut by_topic: BTreeMap<String, Vec<(u64, Vec<u8>)>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert_eq!(message.channel.message_encoding, "cdr");
        assert_eq!(message.log_time, message.publish_time);
        let messages = by_topic.entry(message.channel.topic.clone()).or_default();
        assert_eq!(message.sequence as usize, messages.len(), "{}", message.channel.topic);
        messages.push((message.log_time, message.data.into_owned()));
    }
    let counts: BTreeMap<&str, usize> = by_topic.iter().map(|(t, m)| (t.as_str(), m.len())).collect();
    let expected = BTreeMap::from([
        ("/assist_wrench", 151),
        ("/caption", 1),
        ("/contact_points", 151),
        ("/contact_wrench", 151),
        ("/joint_states", 151),
        ("/metrics", 151),
        ("/reference/joint_states", 151),
        ("/reference/robot_description", 1),
        ("/reference/tf", 151),
        ("/robot_description", 1),
        ("/rosout", 5),
        ("/tf", 151),
        ("/tf_static", 1),
    ]);
    assert_eq!(counts, expected);

    assert_eq!(decode::text(&by_topic["/caption"][0].1), captions().join("\n"));
    for (index, sample) in rollout.samples.iter().enumerate() {
        let time = START_TIME_NS + (sample.time_secs * 1e9).round() as u64;
        let data = |topic: &str| {
            let (at, data) = &by_topic[topic][index];
            assert_eq!(*at, time, "{topic}");
            data.as_slice()
        };
        // Every link hangs from the world through links named before it, and every segment is where it was.
        for (topic, prefix, poses) in [
            ("/tf", "", &sample.world_from_segment),
            ("/reference/tf", "reference/", &sample.reference_world_from_segment),
        ] {
            let mut world_from = BTreeMap::from([("world".to_owned(), Isometry3::identity())]);
            for transform in decode::transforms(data(topic)) {
                assert_eq!(transform.stamp, time);
                let pose = world_from[&transform.parent] * transform.parent_from_child;
                assert!(world_from.insert(transform.child, pose).is_none());
            }
            assert_eq!(world_from.len(), 2 + humanoid.robot.tree.links().len());
            for (&link, pose) in humanoid.segment_links.iter().zip(poses) {
                let name = format!("{prefix}{}", humanoid.robot.tree.links()[link].name);
                let error = world_from[&name].inv_mul(pose);
                assert!(error.translation.vector.norm() < 2e-6 && error.rotation.angle() < 2e-6, "{name}");
            }
        }

        let close = |read: &[f64], written: &[f64], tolerance: f64| {
            assert_eq!(read.len(), written.len());
            for (r, w) in read.iter().zip(written) {
                assert!((r - w).abs() <= tolerance, "{r} {w}");
            }
        };
        let joints = decode::joint_state(data("/joint_states"));
        assert_eq!(joints.stamp, time);
        assert!(joints.names.iter().zip(&JOINTS).all(|(name, joint)| name == joint.name));
        close(&joints.positions, &sample.joint_angles_rad, 3e-8);
        close(&joints.velocities, &sample.joint_velocities_rad_s, 8e-6);
        close(&joints.efforts, &sample.joint_torques_nm, 8e-6);
        let reference = decode::joint_state(data("/reference/joint_states"));
        close(&reference.positions, &sample.reference_joint_angles_rad, 3e-8);
        assert!(reference.velocities.is_empty() && reference.efforts.is_empty());

        let points = decode::point_cloud(data("/contact_points"));
        assert_eq!(points.len(), sample.contacts.len());
        let mut moment = nalgebra::Vector3::zeros();
        for ([x, y, z, force], contact) in points.into_iter().zip(&sample.contacts) {
            let p = contact.position_m;
            assert_eq!([x, y, z], [p.x as f32, p.y as f32, p.z as f32]);
            assert_eq!(force, contact.force_n.norm() as f32);
            moment += (p - sample.world_from_segment[0].translation.vector).coords.cross(&contact.force_n);
        }
        let (frame, force_n, moment_nm) = decode::wrench(data("/contact_wrench"));
        assert_eq!(frame, "root_aligned");
        close(&force_n, sample.ground_force_n().as_slice(), 8e-6);
        close(&moment_nm, moment.as_slice(), 8e-6);
        let (frame, force_n, moment_nm) = decode::wrench(data("/assist_wrench"));
        assert_eq!(frame, "root_aligned");
        close(&force_n, sample.assist_force_n.as_slice(), 8e-6);
        close(&moment_nm, sample.assist_moment_nm.as_slice(), 8e-6);

        let metrics = decode::metrics(data("/metrics"), SAMPLE_METRICS.len());
        let metric = |name| metrics[SAMPLE_METRICS.iter().position(|metric| metric.name == name).unwrap()];
        assert_eq!(metric("contact_count"), sample.contacts.len() as f64);
        assert_eq!(metric("assist_moment_nm"), 5.0);
        let root = |poses: &rprae::simulation::SegmentPoses| poses[0].translation.vector;
        let offset = root(&sample.world_from_segment) - root(&sample.reference_world_from_segment);
        assert_eq!(metric("root_height_error_m"), offset.z);
    }

    let fixed = decode::transforms(&by_topic["/tf_static"][0].1);
    let fixed: Vec<_> = fixed.iter().map(|t| (t.parent.as_str(), t.child.as_str())).collect();
    assert_eq!(fixed, [("pelvis", "base_link"), ("reference/pelvis", "reference/base_link")]);

    let logs: Vec<_> = by_topic["/rosout"].iter().map(|(_, data)| decode::log(data)).collect();
    let logs: Vec<_> =
        logs.iter().map(|(t, level, text)| (secs_since_start(*t), *level, text.as_str())).collect();
    assert_eq!(
        logs,
        [
            (0.0, 20, "rollout of squat at level L2"),
            (0.0, 20, "the swing foot was lifted"),
            (0.5, 30, "the left hand reached the ground"),
            (0.75, 40, "a number was not finite"),
            (1.25, 20, "completed after 1.250 s"),
        ]
    );
}

#[test]
fn carries_what_identifies_and_repeats_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("squat.mcap");
    let humanoid = playback::adult();
    record(&path, &humanoid, &playback::rollout(&humanoid, 13)).unwrap();
    let bytes = fs::read(&path).unwrap();

    // The crate checks every checksum on the way: of chunks, of attachments, of the data and of the summary.
    let mut profile = String::new();
    let mut attachments = BTreeMap::new();
    let mut metadata = BTreeMap::new();
    for record in mcap::read::LinearReader::new(&bytes).unwrap() {
        match record.unwrap() {
            mcap::records::Record::Header(header) => profile = header.profile,
            mcap::records::Record::Attachment { header, data, .. } => {
                attachments.insert(header.name, (header.media_type, data.into_owned()));
            }
            mcap::records::Record::Metadata(record) => {
                metadata.insert(record.name, record.metadata);
            }
            mcap::records::Record::Chunk { header, .. } => {
                assert_eq!(header.compression, "zstd");
                assert_ne!(header.uncompressed_crc, 0);
            }
            _ => {}
        }
    }
    assert_eq!(profile, "ros2");
    let attachment = |name: &str| std::str::from_utf8(&attachments[name].1).unwrap();
    assert_eq!(attachment("robot.urdf"), humanoid.urdf);
    assert_eq!(attachment("settings.toml"), SETTINGS);
    assert_eq!(attachment("result.json"), RESULT);
    assert_eq!(attachments.len(), 3);
    assert_eq!(metadata["run"], run_metadata());
    assert_eq!(metadata["scores"], BTreeMap::from([(METRICS[0].key.to_owned(), "12.5".to_owned())]));
    assert_eq!(metadata["outcome"]["kind"], "completed");
    assert_eq!(metadata["outcome"]["max_joint_drift_m"], "0.0003");
    assert_eq!(metadata["rollout"]["id"], "squat");
    assert_eq!(metadata["rollout"]["level"], "L2");
    assert_eq!(metadata["rollout"]["caption_01"], captions()[1]);

    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let schemas: BTreeSet<_> =
        summary.schemas.values().map(|s| (s.name.as_str(), s.encoding.as_str())).collect();
    let names = [
        "geometry_msgs/msg/WrenchStamped",
        "rcl_interfaces/msg/Log",
        "rprae_msgs/msg/SampleMetrics",
        "sensor_msgs/msg/JointState",
        "sensor_msgs/msg/PointCloud2",
        "std_msgs/msg/String",
        "tf2_msgs/msg/TFMessage",
    ];
    assert_eq!(schemas, names.map(|name| (name, "ros2msg")).into());
    let latched = |topic: &str| {
        let channel = summary.channels.values().find(|channel| channel.topic == topic).unwrap();
        channel.metadata["offered_qos_profiles"].contains("transient_local")
    };
    assert!(latched("/robot_description") && latched("/tf_static") && !latched("/tf"));
}

#[test]
fn the_same_rollout_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let humanoid = playback::adult();
    let [first, second] = ["first.mcap", "second.mcap"].map(|name| {
        let path = folder.path().join(name);
        record(&path, &playback::adult(), &playback::rollout(&humanoid, 61)).unwrap();
        fs::read(path).unwrap()
    });
    assert!(first == second);
}

#[test]
fn five_seconds_stay_small() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("squat.mcap");
    let humanoid = playback::adult();
    record(&path, &humanoid, &playback::rollout(&humanoid, 601)).unwrap();
    let size = fs::metadata(&path).unwrap().len();
    println!("5 s at 120 Hz: {size} bytes");
    assert!(size < 2_000_000, "{size}");
}

#[test]
fn a_killed_process_leaves_every_full_second() {
    let folder = tempfile::tempdir().unwrap();
    let humanoid = playback::adult();
    for num_samples in [1, 120, 121, 300] {
        let path = folder.path().join(format!("{num_samples}.mcap"));
        let mut recorder = with_header(&humanoid, |header| Recorder::create(&path, header)).unwrap();
        for index in 0..num_samples {
            recorder.sample(&playback::sample(&humanoid, index)).unwrap();
        }
        // A killed process runs no destructor and flushes no buffer.
        std::mem::forget(recorder);
        let messages = readable_messages(&fs::read(&path).unwrap());
        assert!(messages.iter().any(|(topic, ..)| topic == "/robot_description"));
        let full_secs = ((num_samples - 1) as f64 / playback::RATE_HZ).floor();
        let count = messages.iter().filter(|(topic, ..)| topic == "/tf").count();
        let expected = if full_secs == 0.0 { 0 } else { 1 + (full_secs * playback::RATE_HZ) as usize };
        assert!(count >= expected, "{num_samples} samples: {count} of {expected}");
    }
}

#[test]
fn a_file_cut_anywhere_keeps_all_seconds_before_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("squat.mcap");
    let humanoid = playback::adult();
    record(&path, &humanoid, &playback::rollout(&humanoid, 421)).unwrap();
    let bytes = fs::read(&path).unwrap();
    let whole = readable_messages(&bytes);
    let mut chunks = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
    // The beginning, three full seconds, the rest with the events.
    assert_eq!(chunks.len(), 5);

    // A small generator of places: no two runs differ.
    let mut state = 1_u64;
    for _ in 0..200 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let cut = (state >> 16) as usize % bytes.len();
        let kept = readable_messages(&bytes[..cut]);
        assert!(kept.len() <= whole.len() && kept[..] == whole[..kept.len()], "cut at {cut}");
        let mut full_chunks = chunks.iter().filter(|c| c.chunk_start_offset + c.chunk_length <= cut as u64);
        if let Some(chunk) = full_chunks.next_back() {
            let last = kept.iter().map(|(_, time, _)| *time).max().unwrap();
            assert!(last >= chunk.message_end_time, "cut at {cut}");
        }
    }
}

#[test]
fn failures_name_the_file_and_leave_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let humanoid = playback::adult();
    let create = |path: &Path| with_header(&humanoid, |header| Recorder::create(path, header));

    let taken = folder.path().join("taken.mcap");
    fs::write(&taken, "precious").unwrap();
    let error = create(&taken).unwrap_err();
    assert!(matches!(error, RecordingError::Exists { .. }), "{error}");
    assert!(error.to_string().contains("taken.mcap: it exists"), "{error}");
    assert_eq!(fs::read(&taken).unwrap(), b"precious");
    drop(with_header(&humanoid, |header| Recorder::replace(&taken, header)).unwrap());
    assert!(mcap::Summary::read(&fs::read(&taken).unwrap()).unwrap().is_some());

    let lost = folder.path().join("no/such/folder.mcap");
    let error = create(&lost).unwrap_err();
    assert!(matches!(error, RecordingError::Create { .. }), "{error}");
    assert!(error.to_string().contains("no/such/folder.mcap"), "{error}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_that_names_the_file() {
    // The device accepts nothing: every write to it fails as on a full disk.
    let full = Path::new("/dev/full");
    let error = with_header(&playback::adult(), |header| Recorder::replace(full, header)).unwrap_err();
    assert!(matches!(error, RecordingError::Write { .. }), "{error}");
    let message = error.to_string();
    assert!(message.contains("/dev/full") && message.contains("No space left"), "{message}");
}

#[test]
fn a_run_lists_how_to_look_at_each_rollout() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    fs::create_dir_all(run.join("rollouts")).unwrap();
    let humanoid = playback::adult();
    let (closed, open) = (run.join("rollouts/a squat.mcap"), run.join("rollouts/open.mcap"));
    record(&closed, &humanoid, &playback::rollout(&humanoid, 2)).unwrap();
    std::mem::forget(with_header(&humanoid, |header| Recorder::create(&open, header)).unwrap());
    fs::write(run.join("results.json"), "{}").unwrap();

    let commands = view_commands(&run).unwrap();
    assert_eq!(commands.len(), 2);
    for command in &commands {
        assert_eq!((command.id.as_str(), command.level.as_str()), ("squat", "L2"));
        assert_eq!(command.caption, captions()[0]);
    }
    assert_eq!((&commands[0].recording, commands[0].complete), (&closed, true));
    assert_eq!(commands[0].command, format!("rerun '{}'", closed.display()));
    assert_eq!((&commands[1].recording, commands[1].complete), (&open, false));
    assert!(commands[1].command.starts_with("rerun mcap convert --recover "));
    assert_eq!(view_commands(&closed).unwrap(), commands[..1]);

    let error = view_commands(&run.join("results.json")).unwrap_err();
    assert!(matches!(error, RecordingError::NotARecording { .. }), "{error}");
    let error = view_commands(&run.join("nothing")).unwrap_err();
    assert!(matches!(error, RecordingError::Read { .. }), "{error}");
    fs::create_dir(run.join("empty")).unwrap();
    let error = view_commands(&run.join("empty")).unwrap_err();
    assert!(matches!(error, RecordingError::NoRecordings { .. }), "{error}");
}

/// Another implementation of MCAP and CDR reads the numbers that were written.
///
/// `RPRAE_PYTHON` names a Python with the packages of `tests/peers/recording-requirements.txt`.
/// The recording stays in the temporary folder of the target directory, for a look with a viewer.
#[test]
#[ignore = "needs Python with the packages of tests/peers/recording-requirements.txt, named by RPRAE_PYTHON"]
fn a_stranger_reads_the_same_numbers() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("recording");
    fs::create_dir_all(&folder).unwrap();
    let (path, expected) = (folder.join("squat.mcap"), folder.join("squat.expected.json"));
    let humanoid = playback::adult();
    let rollout = playback::rollout(&humanoid, 601);
    let _ = fs::remove_file(&path);
    record(&path, &humanoid, &rollout).unwrap();

    let samples = rollout.samples.iter().map(|sample| {
        let pose = |pose: &Isometry3<f64>| {
            let q = pose.rotation.coords;
            let t = pose.translation.vector;
            [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
        };
        serde_json::json!({
            "time_ns": START_TIME_NS + (sample.time_secs * 1e9).round() as u64,
            "world_from_segment": sample.world_from_segment.iter().map(pose).collect::<Vec<_>>(),
            "reference_world_from_segment":
                sample.reference_world_from_segment.iter().map(pose).collect::<Vec<_>>(),
            "joint_angles_rad": sample.joint_angles_rad.to_vec(),
            "joint_velocities_rad_s": sample.joint_velocities_rad_s.to_vec(),
            "joint_torques_nm": sample.joint_torques_nm.to_vec(),
            "contacts": sample.contacts.iter().map(|contact| {
                let p = contact.position_m;
                [p.x, p.y, p.z, contact.force_n.norm()]
            }).collect::<Vec<_>>(),
            "ground_force_n": sample.ground_force_n().as_slice(),
            "assist_moment_nm": sample.assist_moment_nm.as_slice(),
        })
    });
    let tree = &humanoid.robot.tree;
    let document = serde_json::json!({
        "segments": humanoid.segment_links.map(|link| tree.links()[link].name.clone()).to_vec(),
        "joints": JOINTS.map(|joint| joint.name).to_vec(),
        "metrics": SAMPLE_METRICS.map(|metric| metric.name).to_vec(),
        "caption": captions().join("\n"),
        "samples": samples.collect::<Vec<_>>(),
    });
    fs::write(&expected, document.to_string()).unwrap();

    let python = std::env::var("RPRAE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = std::process::Command::new(python)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/read_recording.py"))
        .args([&path, &expected])
        .output()
        .unwrap();
    println!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The saved file stays in the temporary folder of the target directory, for a look with a viewer.
#[test]
#[cfg(feature = "rerun")]
fn rerun_gets_a_layout() {
    use rprae::recording::{RerunTarget, rerun_view};
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rerun");
    fs::create_dir_all(&folder).unwrap();
    let (path, saved) = (folder.join("squat.mcap"), folder.join("squat.rrd"));
    for file in [&path, &saved] {
        let _ = fs::remove_file(file);
    }
    let humanoid = playback::adult();
    record(&path, &humanoid, &playback::rollout(&humanoid, 601)).unwrap();
    let rollout = &view_commands(&path).unwrap()[0];
    rerun_view(rollout, &RerunTarget::File(saved.clone())).unwrap();
    let error = rerun_view(rollout, &RerunTarget::File(saved.clone())).unwrap_err();
    assert!(matches!(error, RecordingError::Exists { .. }), "{error}");
    // The file holds the messages, not just the layout.
    assert!(fs::metadata(&saved).unwrap().len() > fs::metadata(&path).unwrap().len());
}
