//! Motion capture to motions of the humanoid: what positions determine comes back, and everything enters by one door.

#![expect(clippy::unwrap_used, reason = "a test that is surprised should stop at once")]

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Vector3;
use rprae::dataset::{Dataset, OpenOptions};
use rprae::humanoid::Humanoid;
use rprae::mocap::{PositionOrder, read_bvh};
use rprae::motion::{Body, Frame, Motion, joint_index};
use rprae::retarget::{
    Correspondence, RetargetError, RetargetOptions, Retargeted, Role, recognise, retarget,
};

fn bundled(id: &str) -> Motion {
    let dataset = Dataset::bundled();
    let entry = dataset.entries().iter().find(|entry| entry.id == id).unwrap();
    dataset.load(entry).unwrap().motion
}

/// Our joint centres by role name, in our world.
fn centres(humanoid: &Humanoid, frame: &Frame) -> impl Fn(&str) -> Vector3<f64> + use<> {
    let poses = humanoid.forward(frame);
    let links: Vec<(String, Vector3<f64>)> = Role::all()
        .filter_map(|role| {
            let link = humanoid.robot.tree.link_index(role.link()?)?;
            Some((role.name().to_owned(), poses[link].translation.vector))
        })
        .collect();
    let root = poses[0].translation.vector;
    move |name| links.iter().find(|(role, _)| role == name).map_or(root, |(_, centre)| *centre)
}

/// y up and z forward from z up and y forward.
fn y_up(centre: Vector3<f64>) -> [f64; 3] {
    [-centre.x, centre.z, centre.y]
}

const KIT_ROLES: [&str; 21] = [
    "root",
    "abdomen",
    "thorax",
    "neck",
    "head",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_midfoot",
    "left_toe",
    "right_hip",
    "right_knee",
    "right_ankle",
    "right_midfoot",
    "right_toe",
];

fn kit_positions(motion: &Motion) -> Vec<[f64; 3]> {
    let humanoid = Humanoid::new(motion.body()).unwrap();
    motion
        .frames()
        .iter()
        .flat_map(|frame| {
            let centre = centres(&humanoid, frame);
            KIT_ROLES.map(|role| y_up(centre(role)))
        })
        .collect()
}

fn through_positions(motion: &Motion) -> Retargeted {
    let clip = PositionOrder::KitMl.clip(kit_positions(motion), Some(motion.rate_hz())).unwrap();
    let skeleton = recognise(&clip).unwrap();
    assert_eq!(skeleton.name, "kit-ml");
    retarget(&clip, &skeleton, &RetargetOptions::default()).unwrap()
}

/// Joints that positions determine, with what makes their pose singular: an arm or leg along its first axis's twin.
const DETERMINED: [&str; 20] = [
    "LHx", "LHy", "RHx", "RHy", "LHz", "RHz", "LKx", "RKx", "LSx", "LSy", "LSz", "RSx", "RSy", "RSz", "LEx",
    "REx", "BPx", "BPy", "BTx", "BTy",
];

/// Joints of the neck: the head's position tells their bend where both share it as the rule says, as in synthesised motions;
/// in a recording they may share it otherwise.
const NECK: [&str; 2] = ["BLNx", "BLNy"];

/// Median absolute difference over the frames in which the joint is not near a singular pose, degrees.
fn median_difference(name: &str, a: &Motion, b: &Motion) -> Option<f64> {
    let joint = joint_index(name).unwrap();
    let angle = |frame: &Frame, name: &str| frame.joint_angles_rad[joint_index(name).unwrap()];
    let regular = |frame: &Frame| {
        let side = &name[..1];
        match name.get(1..2) {
            // The twist of a straight limb is nowhere to be seen; its first two angles are those of its direction.
            Some("S") => {
                angle(frame, &format!("{side}Ex")) > 0.35 && angle(frame, &format!("{side}Sz")).abs() < 1.2
            }
            Some("H") if name.ends_with('z') => angle(frame, &format!("{side}Kx")) < -0.35,
            // How the trunk's two joints share their twist is nowhere to be seen either. As far as the thorax is bent forwards
            // or back, its part of the twist also turns it sideways.
            Some("T") if name.ends_with('y') => angle(frame, "BTx").abs() < 0.15,
            _ => true,
        }
    };
    let mut differences: Vec<f64> = a
        .frames()
        .iter()
        .zip(b.frames())
        .filter(|(frame, _)| regular(frame))
        .map(|(a, b)| (a.joint_angles_rad[joint] - b.joint_angles_rad[joint]).abs().to_degrees())
        .collect();
    differences.sort_by(f64::total_cmp);
    (differences.len() >= 10).then(|| differences[differences.len() / 2])
}

fn assert_angles_return(id: &str, motion: &Motion, names: &[&str]) -> usize {
    let back = through_positions(motion);
    assert!(
        (back.motion.body().height_m - motion.body().height_m).abs() < 0.02,
        "{id}: {:?}",
        back.motion.body()
    );
    assert!(back.quality.flipped.is_empty(), "{id}: {:?}", back.quality.flipped);
    let mut seen = 0;
    for name in names {
        if let Some(difference) = median_difference(name, motion, &back.motion) {
            assert!(difference < 1.0, "{id}: {name} differs by {difference:.2} degrees");
            seen += 1;
        }
    }
    seen
}

#[test]
fn angles_of_the_suite_return_from_positions() {
    for id in ["90001", "90003", "90007"] {
        let names = [&DETERMINED[..], &NECK].concat();
        assert!(assert_angles_return(id, &bundled(id), &names) >= 17, "{id}");
    }
}

#[test]
fn angles_of_recordings_return_from_positions() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set");
        return;
    };
    let dataset = Dataset::open(&Path::new(&data).join("kit-ml/dataset"), &OpenOptions::default()).unwrap();
    for entry in dataset.entries() {
        let motion = dataset.load(entry).unwrap().motion;
        // Recorded angles rest at limits and beyond them by a hair; positions of five seconds are enough.
        let count = motion.num_frames().min(500);
        let motion = Motion::new(motion.body(), motion.rate_hz(), motion.frames()[..count].to_vec()).unwrap();
        let seen = assert_angles_return(&entry.id, &motion, &DETERMINED);
        println!("{}: {seen} joints", entry.id);
    }
}

const HUMAN_ROLES: [(&str, [f64; 3]); 22] = [
    ("root", [0.0, 0.0, 0.05]),
    ("left_hip", [0.0; 3]),
    ("right_hip", [0.0; 3]),
    ("abdomen", [0.0; 3]),
    ("left_knee", [0.0; 3]),
    ("right_knee", [0.0; 3]),
    ("thorax", [0.0; 3]),
    ("left_ankle", [0.0; 3]),
    ("right_ankle", [0.0; 3]),
    ("thorax", [0.0, 0.0, 0.1]),
    ("left_toe", [0.0; 3]),
    ("right_toe", [0.0; 3]),
    ("neck", [0.0; 3]),
    ("neck", [-0.08, 0.0, -0.05]),
    ("neck", [0.08, 0.0, -0.05]),
    ("head", [0.0; 3]),
    ("left_shoulder", [0.0; 3]),
    ("right_shoulder", [0.0; 3]),
    ("left_elbow", [0.0; 3]),
    ("right_elbow", [0.0; 3]),
    ("left_wrist", [0.0; 3]),
    ("right_wrist", [0.0; 3]),
];

#[test]
fn walking_in_the_order_of_human_ml_3d_keeps_its_way_and_its_feet() {
    let motion = bundled("90001");
    let humanoid = Humanoid::new(motion.body()).unwrap();
    let positions = motion
        .frames()
        .iter()
        .flat_map(|frame| {
            let centre = centres(&humanoid, frame);
            let turn = frame.world_from_root_rotation();
            HUMAN_ROLES.map(|(role, offset)| y_up(centre(role) + turn * Vector3::from(offset)))
        })
        .collect();
    let clip = PositionOrder::HumanMl3d.clip(positions, Some(motion.rate_hz())).unwrap();
    let skeleton = recognise(&clip).unwrap();
    assert_eq!(skeleton.name, "humanml3d");
    let quality = retarget(&clip, &skeleton, &RetargetOptions::default()).unwrap().quality;
    assert!(quality.raw_median_m < 0.03, "{quality:?}");
    assert!(quality.flipped.is_empty() && quality.beyond_limit_rad < 1e-9, "{quality:?}");
    assert!((quality.travel_ratio.unwrap() - 1.0).abs() < 0.05, "{quality:?}");
    assert!(quality.stance_height_m.unwrap()[1] < 0.02, "{quality:?}");
}

#[test]
fn mirrored_positions_are_turned_round() {
    let motion = bundled("90001");
    let mirrored = kit_positions(&motion).into_iter().map(|[x, y, z]| [-x, y, z]).collect();
    let clip = PositionOrder::KitMl.clip(mirrored, Some(motion.rate_hz())).unwrap();
    let back = retarget(&clip, &recognise(&clip).unwrap(), &RetargetOptions::default()).unwrap();
    assert!(
        back.notes.iter().any(|note| note.contains("left and right are taken for exchanged")),
        "{:?}",
        back.notes
    );
    assert!(back.quality.flipped.is_empty());
}

#[test]
fn a_body_below_the_floor_is_raised_onto_it_and_one_in_the_air_is_not_pulled_down() {
    let motion = bundled("90001");
    let moved = |up: f64| {
        let positions = kit_positions(&motion).into_iter().map(|[x, y, z]| [x, y + up, z]).collect();
        let clip = PositionOrder::KitMl.clip(positions, Some(motion.rate_hz())).unwrap();
        retarget(&clip, &recognise(&clip).unwrap(), &RetargetOptions::default()).unwrap()
    };
    let told = |back: &Retargeted, what: &str| back.notes.iter().any(|note| note.contains(what));
    let raised = moved(-0.7);
    assert!(told(&raised, "below every floor"), "{:?}", raised.notes);
    assert!(raised.quality.stance_height_m.unwrap()[1] < 0.02, "{:?}", raised.quality.stance_height_m);
    let floating = moved(0.7);
    assert!(told(&floating, "moved by -150 mm only"), "{:?}", floating.notes);
    assert!(floating.quality.stance_height_m.is_none_or(|height| height[0] > 0.4));
}

/// The humanoid as BVH: its chains act x, z, y, so its own angles are the channels.
fn bvh(motion: &Motion, num_frames: usize) -> String {
    let humanoid = Humanoid::new(motion.body()).unwrap();
    let rest = humanoid.forward(&Frame::ZERO);
    let tree = &humanoid.robot.tree;
    let place = |name: &str| rest[tree.link_index(name).unwrap()].translation.vector;
    // Name, depth, joints of the chain, ends.
    let parts: [(&str, usize, [&str; 3]); 17] = [
        ("abdomen", 1, ["BPx", "BPz", "BPy"]),
        ("thorax", 2, ["BTx", "BTz", "BTy"]),
        ("neck", 3, ["BLNx", "BLNz", "BLNy"]),
        ("head", 4, ["BUNx", "BUNz", "BUNy"]),
        ("left_upper_arm", 3, ["LSx", "LSz", "LSy"]),
        ("left_forearm", 4, ["LEx", "LEz", ""]),
        ("left_hand", 5, ["LWx", "", "LWy"]),
        ("right_upper_arm", 3, ["RSx", "RSz", "RSy"]),
        ("right_forearm", 4, ["REx", "REz", ""]),
        ("right_hand", 5, ["RWx", "", "RWy"]),
        ("left_thigh", 1, ["LHx", "LHz", "LHy"]),
        ("left_shank", 2, ["LKx", "", ""]),
        ("left_foot", 3, ["LAx", "LAz", "LAy"]),
        ("left_toes", 4, ["", "", ""]),
        ("right_thigh", 1, ["RHx", "RHz", "RHy"]),
        ("right_shank", 2, ["RKx", "", ""]),
        ("right_foot", 3, ["RAx", "RAz", "RAy"]),
    ];
    let mut text = "HIERARCHY\nROOT pelvis\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n".to_owned();
    let mut open: Vec<&str> = vec!["pelvis"];
    for (name, depth, _) in parts {
        while open.len() > depth {
            open.pop();
            text.push_str("}\n");
        }
        let offset = 100.0 * (place(name) - place(open.last().unwrap()));
        let _ = writeln!(text, "JOINT {name}\n{{\nOFFSET {} {} {}", offset.x, offset.y, offset.z);
        text.push_str("CHANNELS 3 Xrotation Zrotation Yrotation\n");
        open.push(name);
        if name == "right_foot" {
            let toe = 100.0 * (place("right_toes") - place("right_foot"));
            let _ = writeln!(text, "End Site\n{{\nOFFSET {} {} {}\n}}", toe.x, toe.y, toe.z);
        }
    }
    text.push_str(&"}\n".repeat(open.len()));
    let _ = writeln!(text, "MOTION\nFrames: {num_frames}\nFrame Time: {:.6}", 1.0 / motion.rate_hz());
    for frame in &motion.frames()[..num_frames] {
        let [x, y, z] = frame.root_position_m.map(|metres| 100.0 * metres);
        let [roll, pitch, yaw] = frame.root_rotation_rad.map(f64::to_degrees);
        let _ = write!(text, "{x} {y} {z} {yaw} {pitch} {roll}");
        for (_, _, chain) in parts {
            for joint in chain {
                let angle =
                    joint_index(joint).map_or(0.0, |joint| frame.joint_angles_rad[joint].to_degrees());
                let _ = write!(text, " {angle}");
            }
        }
        text.push('\n');
    }
    text
}

fn own_skeleton() -> String {
    let mut text = "name = \"own\"\nabout = \"The humanoid itself.\"\nup = \"z\"\nforward = \"y\"\nunit_m = [0.01]\n[joints]\n"
        .to_owned();
    for (role, joint) in [
        ("hip", "thigh"),
        ("knee", "shank"),
        ("ankle", "foot"),
        ("shoulder", "upper_arm"),
        ("elbow", "forearm"),
        ("wrist", "hand"),
    ] {
        for side in ["left", "right"] {
            let _ = writeln!(text, "{side}_{role} = \"{side}_{joint}\"");
        }
    }
    text.push_str("left_toe = \"left_toes\"\nright_toe = \"right_foot_end\"\nneck = \"neck\"\nhead = \"head\"\n[orientations]\n");
    for segment in
        ["pelvis", "thorax", "head", "left_foot", "right_foot", "left_hand", "right_hand", "left_forearm"]
    {
        let _ = writeln!(text, "{segment} = {{ joint = \"{segment}\", up = \"z\", forward = \"y\" }}");
    }
    text
}

#[test]
fn a_bvh_of_the_humanoid_says_where_its_joints_are() {
    let motion = bundled("90001");
    let humanoid = Humanoid::new(motion.body()).unwrap();
    let clip = read_bvh(bvh(&motion, 40).as_bytes()).unwrap();
    assert_eq!((clip.num_frames(), clip.rate_hz()), (40, Some(motion.rate_hz())));
    let mut poses = Vec::new();
    for (index, frame) in motion.frames().iter().take(40).enumerate() {
        clip.pose_into(index, &mut poses);
        let ours = humanoid.forward(frame);
        for (joint, pose) in clip.joints().iter().zip(&poses) {
            let Some(link) = humanoid.robot.tree.link_index(&joint.name) else { continue };
            // The midfoot, which the BVH leaves out, carries the toes.
            if !joint.name.ends_with("toes") {
                let difference = ours[link].translation.vector - pose.translation.vector / 100.0;
                assert!(difference.norm() < 1e-9, "{}: {difference}", joint.name);
            }
        }
    }
}

#[test]
fn captures_enter_by_every_door() {
    let motion = bundled("90001");
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("walk.bvh", &bvh(&motion, 60));
    write("walk_annotations.json", "[\"a person walks\"]");
    write("broken.bvh", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 zero\n");
    write("lone_01.amc", ":FULLY-SPECIFIED\n1\nroot 0 0 0 0 0 0\n");
    write("set.jsonl", "{\"file\": \"walk.bvh\", \"id\": \"w\", \"height_m\": 1.6}\n");

    let skeleton = Correspondence::parse(own_skeleton().as_bytes()).unwrap();
    let open = |path: &Path| Dataset::open(path, &OpenOptions::default()).unwrap();
    let dataset = open(folder.path());
    let load = |dataset: &Dataset, id: &str| {
        dataset.load(dataset.entries().iter().find(|entry| entry.id == id).unwrap())
    };
    let reason = load(&dataset, "walk").unwrap_err().reason;
    assert!(
        reason.contains("no known skeleton has these joints") && reason.contains("--skeleton"),
        "{reason}"
    );
    assert!(load(&dataset, "broken").unwrap_err().reason.contains("line 4: \"zero\" is not a number"));
    assert!(load(&dataset, "lone_01").unwrap_err().reason.contains("no .asf beside it"));

    let sample = load(&dataset.with_skeleton(skeleton.clone()), "walk").unwrap();
    assert_eq!((sample.motion.num_frames(), sample.motion.rate_hz()), (60, motion.rate_hz()));
    assert_eq!(sample.captions, ["a person walks"]);
    assert!(sample.warnings[0].starts_with("retargeted from the skeleton own"), "{:?}", sample.warnings);
    assert!((sample.motion.body().height_m - motion.body().height_m).abs() < 0.02);

    let single = open(&folder.path().join("walk.bvh")).with_skeleton(skeleton.clone());
    assert_eq!(load(&single, "walk").unwrap().motion, sample.motion);
    let manifest = open(&folder.path().join("set.jsonl")).with_skeleton(skeleton);
    assert_eq!(load(&manifest, "w").unwrap().motion.body(), Body::with_default_mass(1.6));
}

#[test]
fn bodies_of_impossible_size_are_refused_with_the_size() {
    let motion = bundled("90001");
    let positions: Vec<[f64; 3]> = kit_positions(&motion).into_iter().map(|p| p.map(|x| 7.0 * x)).collect();
    let clip = PositionOrder::KitMl.clip(positions, Some(20.0)).unwrap();
    let error = retarget(&clip, &recognise(&clip).unwrap(), &RetargetOptions::default()).unwrap_err();
    assert!(matches!(error, RetargetError::Size { height_m, .. } if height_m > 8.0), "{error}");
    let heap = PositionOrder::KitMl.clip(vec![[0.0; 3]; 42], Some(20.0)).unwrap();
    let error = retarget(&heap, &recognise(&heap).unwrap(), &RetargetOptions::default()).unwrap_err();
    assert!(matches!(error, RetargetError::NoBody), "{error}");
}
