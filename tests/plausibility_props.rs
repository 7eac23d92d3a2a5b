//! Support by something that is not the floor, on postures made by hand and on motions that must not be taken for it.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f64::consts::FRAC_PI_2;

use std::path::Path;
use std::sync::LazyLock;

use rprae::dataset::{Dataset, OpenOptions};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, Motion, joint_index};
use rprae::plausibility::{Prop, PropSupport, prop_supports};
use rprae::simulation::{Simulation, SimulationSettings};

const BODY: Body = Body { height_m: 1.75, mass_kg: 70.0 };
static HUMANOID: LazyLock<Humanoid> = LazyLock::new(|| Humanoid::new(BODY).unwrap());

/// Three seconds of standing, changed by `change(time, frame)`.
fn supports(change: impl Fn(f64, &mut Frame)) -> Vec<PropSupport> {
    let mut frame = Frame::ZERO;
    frame.root_position_m[2] = HUMANOID.standing_root_height_m();
    let motion = Motion::new(BODY, 100.0, vec![frame; 301])
        .unwrap()
        .map_frames(|index, frame| change(index as f64 / 100.0, frame))
        .unwrap();
    prop_supports(&HUMANOID, &motion)
}

fn set(frame: &mut Frame, angles: &[(&str, f64)]) {
    for (name, angle) in angles {
        for side in ["L", "R"] {
            frame.joint_angles_rad[joint_index(&format!("{side}{name}")).unwrap()] = *angle;
        }
    }
}

/// Leans forward about the ankles, soles flat.
fn lean(frame: &mut Frame, angle: f64) {
    let height = frame.root_position_m[2] - 0.039 * BODY.height_m;
    frame.root_rotation_rad[0] = -angle;
    frame.root_position_m[1] += height * angle.sin();
    frame.root_position_m[2] += height * (angle.cos() - 1.0);
    set(frame, &[("Ax", angle)]);
}

#[track_caller]
fn only(found: &[PropSupport], prop: Prop) -> PropSupport {
    assert_eq!(found.iter().map(|support| support.prop).collect::<Vec<_>>(), [prop], "{found:?}");
    found[0]
}

#[test]
fn sitting_without_a_chair_is_held_by_one() {
    let found = supports(|_, frame| {
        // Thighs level, shanks upright, soles on the floor in front.
        set(frame, &[("Hx", FRAC_PI_2), ("Kx", -FRAC_PI_2)]);
        frame.root_position_m[2] = (0.246 + 0.039) * BODY.height_m;
    });
    let seat = only(&found, Prop::Seat);
    assert!(seat.to_secs - seat.from_secs > 2.0 && seat.unexplained_bw > 0.1, "{seat:?}");
}

#[test]
fn leaning_on_a_table_is_held_by_the_hands() {
    let found = supports(|_, frame| {
        lean(frame, 0.4);
        set(frame, &[("Sx", 1.4)]);
    });
    only(&found, Prop::Hand);
}

#[test]
fn standing_on_a_box_after_standing_on_the_floor_is_held_by_the_box() {
    let up = |time: f64| ((time - 1.0) / 0.6).clamp(0.0, 1.0);
    let found = supports(|time, frame| frame.root_position_m[2] += 0.25 * up(time));
    let step = only(&found, Prop::Foothold);
    assert!((1.4..2.2).contains(&step.from_secs), "{step:?}");
}

#[test]
fn faults_are_not_taken_for_furniture() {
    assert_eq!(supports(|_, _| {}), []);
    assert_eq!(supports(|_, frame| frame.root_position_m[2] += 0.10), [], "a float is a fault");
    assert_eq!(supports(|_, frame| frame.root_position_m[2] -= 0.05), []);
    assert_eq!(supports(|time, frame| frame.root_position_m[1] += 0.6 * time), []);
    assert_eq!(supports(|_, frame| lean(frame, 0.3)), [], "arms at the sides hold nothing");
    let fall = |time: f64, frame: &mut Frame| frame.root_position_m[2] += 6.0 - 4.905 * (time - 1.0).powi(2);
    assert_eq!(supports(fall), []);
}

fn held(dataset: &Dataset) -> Vec<(String, Vec<PropSupport>)> {
    let settings = SimulationSettings::default();
    let mut held = Vec::new();
    for entry in dataset.entries() {
        let Ok(sample) = dataset.load(entry) else { continue };
        let humanoid = Humanoid::new(sample.motion.body()).unwrap();
        let simulation = Simulation::new(&humanoid, &sample.motion, &settings).unwrap();
        let supports = prop_supports(&humanoid, simulation.reference_motion());
        if !supports.is_empty() {
            held.push((sample.id, supports));
        }
    }
    held
}

#[test]
fn the_whole_suite_can_be_simulated_or_is_at_fault() {
    assert_eq!(held(&Dataset::bundled()), []);
}

#[test]
fn recorded_walks_gestures_and_pushes_need_no_furniture() {
    let Some(data) = std::env::var_os("RPRAE_DATA") else {
        println!("skipped: RPRAE_DATA is not set");
        return;
    };
    for folder in ["kit-ml/dataset", "kit-ml/mmm-other"] {
        let dataset = Dataset::open(&Path::new(&data).join(folder), &OpenOptions::default()).unwrap();
        assert_eq!(held(&dataset), []);
    }
}
