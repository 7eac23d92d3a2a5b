//! Motion capture files that lie: each gets one clear line with the place, and nothing crashes or hangs.

use nalgebra::Vector3;
use proptest::prelude::*;
use rprae::mocap::{PositionOrder, read_amc, read_asf, read_bvh};

const BVH: &str = "HIERARCHY\nROOT hips\n{\n  OFFSET 0 0 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n  \
    JOINT left leg\n  {\n    OFFSET 0 -4 0\n    CHANNELS 1 Xrotation\n    End Site\n    {\n      OFFSET 0 -4 0\n    }\n  }\n}\n\
    MOTION\nFrames: 2\nFrame Time: 0.0333333\n1 2 3 90 0 0 0\n1 2 3 0 0 0 90\n";

#[test]
fn a_small_bvh_is_read() {
    let clip = read_bvh(BVH.as_bytes()).unwrap();
    let names: Vec<&str> = clip.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["hips", "left leg", "left leg_end"]);
    assert_eq!((clip.num_frames(), clip.rate_hz()), (2, Some(30.0)));
    let mut poses = Vec::new();
    clip.pose_into(0, &mut poses);
    assert!((poses[2].translation.vector - Vector3::new(9.0, 2.0, 3.0)).norm() < 1e-12, "{}", poses[2]);
    clip.pose_into(1, &mut poses);
    // The leg swings about x: what hung along -y points along -z.
    assert!((poses[2].translation.vector - Vector3::new(1.0, -2.0, -1.0)).norm() < 1e-12, "{}", poses[2]);
}

#[test]
fn bvh_faults_are_named_with_their_line() {
    let change = |from: &str, to: &str| BVH.replacen(from, to, 1);
    let deep = format!(
        "HIERARCHY\nROOT r\n{{\n{}",
        (0..100_000).fold(String::new(), |t, i| t + &format!("JOINT j{i}\n{{\n"))
    );
    for (text, reason) in [
        (String::new(), "line 1: the file ends where HIERARCHY should follow"),
        ("\0\0\0\0".to_owned(), "line 1: found"),
        (change("OFFSET 0 0 0", "OFFSET 0 0 NaN"), "line 4: \"NaN\" is not a number"),
        (change("OFFSET 0 0 0", "OFFSET 0 0 1e300"), "line 4: \"1e300\" is not a number"),
        (change("CHANNELS 6 X", "CHANNELS 60000000000 X"), "line 5: found \"60000000000\", expected 0 to 6"),
        (change("Zrotation", "Wrotation"), "line 5: found \"Wrotation\""),
        (change("Yposition", "Xposition"), "each channel once"),
        (change("JOINT left leg", "JOINT hips"), "line 6: the name \"hips\" is used twice"),
        (change("JOINT left leg\n", "JOINT\n"), "expected a name"),
        (change("Frames: 2", "Frames: 3"), "3 frames of 7 channels: found 14 numbers, expected 21"),
        (change("Frames: 2", "Frames: 1"), "line 20: 1 frames of 7 channels: found 8 numbers"),
        (change("Frames: 2", "Frames: 0"), "line 17: found \"0\", expected at least one frame"),
        (change("Frames: 2", "Frames: 99999999999999999999999"), "expected the number of frames"),
        (change("Frames: 2", "Frames: 400000000"), "line 17: more than 500000 frames"),
        (change("0.0333333", "0"), "line 18: the frame time is 0"),
        (change("0.0333333", "-1"), "the frame time is -1"),
        (change("MOTION", "ROOT second\n{\n}\nMOTION"), "a second ROOT"),
        (BVH[..180].to_owned(), "line 10: found \"En\", expected"),
        (
            change("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation", "")
                .replace("CHANNELS 1 Xrotation", ""),
            "without channels",
        ),
        (deep, "more than 1024 joints"),
    ] {
        let message = read_bvh(text.as_bytes()).unwrap_err().to_string();
        assert!(message.contains(reason), "{message} should contain {reason}");
        assert!(!message.contains('\n') && message.len() < 300, "{message}");
    }
}

const ASF: &str = ":version 1.10\n:units\n  mass 1.0\n  length 0.5\n  angle deg\n:root\n  order TX TY TZ RX RY RZ\n  axis XYZ\n  \
    position 0 0 0\n  orientation 0 0 0\n:bonedata\n  begin\n    id 1\n    name thigh\n    direction 0 -1 0\n    length 2\n    \
    axis 0 0 90 XYZ\n    dof rx rz\n    limits (-10 20)\n           (-inf inf)\n  end\n  begin\n    name shin\n    \
    direction 0 -1 0\n    length 1\n    axis 0 0 0 XYZ\n  end\n:hierarchy\n  begin\n    root thigh\n    thigh shin\n  end\n";
const AMC: &str = "#!comment\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 1 0 0 0 0 0\nthigh 90 0\n2\nroot 0 0 0 0 90 0\nthigh 0 90\n";

#[test]
fn a_small_asf_and_amc_are_read() {
    let clip = read_amc(AMC.as_bytes(), &read_asf(ASF.as_bytes()).unwrap()).unwrap();
    let names: Vec<&str> = clip.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!((names.as_slice(), clip.rate_hz()), (["root", "thigh", "shin", "shin_end"].as_slice(), None));
    let mut poses = Vec::new();
    clip.pose_into(0, &mut poses);
    // Lengths are divided by 0.5. The thigh's x axis is turned to y, along which it lies: it turns in place.
    assert!((poses[3].translation.vector - Vector3::new(2.0, -6.0, 0.0)).norm() < 1e-12, "{}", poses[3]);
    clip.pose_into(1, &mut poses);
    // About its z axis it swings from -y to +x, and the root then turns that to -z.
    assert!((poses[3].translation.vector - Vector3::new(0.0, 0.0, -6.0)).norm() < 1e-12, "{}", poses[3]);
}

#[test]
fn asf_and_amc_faults_are_named_with_their_line() {
    let change = |from: &str, to: &str| ASF.replacen(from, to, 1);
    for (text, reason) in [
        (String::new(), ":root with its order"),
        (change("length 0.5", "length 0"), "line 4: the length unit is 0"),
        (change("angle deg", "angle grad"), "line 5: found \"grad\", expected deg or rad"),
        (change("direction 0 -1 0", "direction 0 -1"), "line 15: the file ends where three components"),
        (change("axis 0 0 90 XYZ", "axis 0 0 90 XXZ"), "line 17: found \"XXZ\""),
        (change("dof rx rz", "dof rx rx"), "line 18: found \"rx\""),
        (change("dof rx rz", "dof l"), "a bone that stretches is not supported"),
        (change("name shin", "name thigh"), "the name \"thigh\" is used twice"),
        (change("name shin", "name root"), "a bone with a name of its own"),
        (change("thigh shin", "thigh foot"), "line 31: there is no bone \"foot\""),
        (
            change("thigh shin", "thigh shin\n shin thigh"),
            "does not reach the bone \"thigh\" from the root exactly once",
        ),
        (change("root thigh\n    thigh shin", "thigh shin\n shin thigh"), "does not reach"),
        (change("orientation 0 0 0", "orientation 0 90 0"), "turned at rest is not supported"),
        (ASF.split(":hierarchy").next().unwrap().to_owned(), "truncated"),
    ] {
        let message = read_asf(text.as_bytes()).unwrap_err().to_string();
        assert!(message.contains(reason), "{message} should contain {reason}");
    }
    let skeleton = read_asf(ASF.as_bytes()).unwrap();
    let change = |from: &str, to: &str| AMC.replacen(from, to, 1);
    for (text, reason) in [
        (":FULLY-SPECIFIED\n".to_owned(), "a frame should follow"),
        (change("\n1\n", "\n"), "line 4: found \"root\", expected a frame number"),
        (change("thigh 90 0\n", ""), "line 6: frame 0 has no values for the bone \"thigh\""),
        (change("thigh 0 90\n", ""), "frame 1 has no values for the bone \"thigh\""),
        (change("thigh 90 0", "thigh 90"), "line 6: thigh: found 1 numbers, expected 2"),
        (change("thigh 90 0", "thigh 90 0 0"), "line 6: thigh: found 3 numbers, expected 2"),
        (change("thigh 90 0", "thigh 90 x"), "line 6: \"x\" is not a number"),
        (change("thigh 90 0", "knee 90 0"), "line 6: there is no bone \"knee\""),
        (change("thigh 90 0", "thigh 90 0\nthigh 90 0"), "line 7: the name \"thigh\" is used twice"),
    ] {
        let message = read_amc(text.as_bytes(), &skeleton).unwrap_err().to_string();
        assert!(message.contains(reason), "{message} should contain {reason}");
    }
}

#[test]
fn positions_that_are_none_are_named() {
    let mut centres = vec![[0.0; 3]; 44];
    centres[23][1] = f64::NAN;
    let message = PositionOrder::HumanMl3d.clip(centres, None).unwrap_err().to_string();
    assert_eq!(message, "frame 1, joint left_hip: NaN is not a position within ±1e7");
    assert!(PositionOrder::KitMl.clip(Vec::new(), None).is_err());
}

proptest! {
    /// Damage anywhere gives an error or a clip whose every pose can be asked for.
    #[test]
    fn damaged_files_never_panic(at in 0..1000_usize, byte in any::<u8>(), cut in 0..1000_usize) {
        for text in [BVH, ASF, AMC] {
            let mut bytes = text.as_bytes().to_vec();
            let length = bytes.len();
            bytes[at % length] = byte;
            bytes.truncate(length - cut % 40);
            let mut poses = Vec::new();
            if let Ok(clip) = read_bvh(&bytes) {
                clip.pose_into(clip.num_frames() - 1, &mut poses);
            }
            let skeleton = read_asf(if text == ASF { &bytes } else { ASF.as_bytes() });
            if let Ok(Ok(clip)) = skeleton.map(|skeleton| read_amc(if text == AMC { &bytes } else { AMC.as_bytes() }, &skeleton)) {
                clip.pose_into(clip.num_frames() - 1, &mut poses);
            }
        }
    }
}
