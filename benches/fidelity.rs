//! Do the engine's two joint forms and MuJoCo agree on what a tracked body does?
//!
//! `cargo bench --bench fidelity` tracks motions with the bounded assist of level 2: with ball joints (the default, with more
//! passes of the solver, and with shorter steps), in reduced coordinates, in MuJoCo at the same step, and in MuJoCo at 2400 Hz,
//! which stands for the truth.
//! All get the same URDF, gains, limits, feed-forward torques and commands.
//! Motions are those of the bundled suite and, where `$RPRAE_DATA` is set, recordings of KIT; `-- IDS` picks some.
//! The table is printed; `--out FILE` also writes it.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rprae::dataset::{Dataset, OpenOptions, Sample};
use rprae::humanoid::{Humanoid, NUM_SEGMENTS};
use rprae::motion::JOINTS;
use rprae::simulation::{
    ADDED_INERTIA, GRAVITY_M_S2, JointForm, Level, SegmentPoses, Simulation, SimulationSettings, gains,
};
use serde_json::json;

/// Recordings of KIT that are compared where they are at hand.
const RECORDED: [&str; 5] = ["00001", "00208", "01026", "02187", "push_from_the_right_side_06"];

fn main() -> Result<(), Box<dyn Error>> {
    let (mut ids, mut out) = (Vec::new(), None);
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    while let Some(word) = words.next() {
        if word == "--out" { out = words.next().map(PathBuf::from) } else { ids.push(word) }
    }
    let mut text = String::from(
        "| motion | engine | MPJPE root to reference, mm | to MuJoCo 2400 Hz, mm | vertical force, N | ratio | \
         foot impulse difference, % | slip, mm/s | assist, % BW |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    print!("{text}");
    for sample in samples(&ids)? {
        let rows = compare(&sample)?;
        print!("{rows}");
        text += &rows;
    }
    if let Some(path) = out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

/// The bundled suite without its impossible motions, then recordings.
fn samples(ids: &[String]) -> Result<Vec<Sample>, Box<dyn Error>> {
    let wanted = |id: &str| ids.is_empty() || ids.iter().any(|wanted| id == wanted);
    let bundled = Dataset::bundled();
    let possible = bundled.entries().iter().filter(|entry| !entry.id.starts_with("909") && wanted(&entry.id));
    let mut samples: Vec<Sample> = possible
        .map(|entry| bundled.load(entry))
        .collect::<Result<_, _>>()
        .map_err(|skipped| skipped.reason)?;
    let Some(data) = std::env::var_os("RPRAE_DATA").map(PathBuf::from) else {
        eprintln!("recordings are left out: $RPRAE_DATA is not set");
        return Ok(samples);
    };
    for folder in ["kit-ml/dataset", "kit-ml/mmm-other"] {
        let dataset = Dataset::open(&data.join(folder), &OpenOptions::default())?;
        let chosen = |id: &str| if ids.is_empty() { RECORDED.contains(&id) } else { wanted(id) };
        for entry in dataset.entries().iter().filter(|entry| chosen(&entry.id)) {
            samples.push(dataset.load(entry).map_err(|skipped| skipped.reason)?);
        }
    }
    Ok(samples)
}

/// One sample of any engine.
struct State {
    poses: SegmentPoses,
    /// Force of the ground on every segment and the point it acts at.
    ground: [(Vector3<f64>, Point3<f64>); NUM_SEGMENTS],
    assist_n: Vector3<f64>,
}

fn compare(sample: &Sample) -> Result<String, Box<dyn Error>> {
    let humanoid = Humanoid::new(sample.motion.body())?;
    let settings = SimulationSettings::default();
    let simulation = Simulation::new(&humanoid, &sample.motion, &settings)?;
    let folder = tempfile::tempdir()?;
    write_inputs(folder.path(), &humanoid, &simulation, &settings, sample.motion.duration_secs())?;
    let truth = mujoco(folder.path(), 5)?;
    let with = |settings: &SimulationSettings| ours(&Simulation::new(&humanoid, &sample.motion, settings)?);
    // More passes and shorter steps tell what of the difference is the solver's.
    let many_passes = SimulationSettings { pgs_iterations: 64, ..settings.clone() };
    let short_steps = SimulationSettings { dt_secs: settings.dt_secs / 5.0, ..settings.clone() };
    let reduced = SimulationSettings { joint_form: JointForm::Multibody, ..settings.clone() };
    let engines = [
        ("balls, 480 Hz", ours(&simulation)?),
        ("balls, 480 Hz, 64 passes", with(&many_passes)?),
        ("balls, 2400 Hz", with(&short_steps)?),
        ("reduced, 480 Hz", with(&reduced)?),
        ("MuJoCo, 480 Hz", mujoco(folder.path(), 1)?),
        ("MuJoCo, 2400 Hz", truth),
    ];
    let truth = &engines[engines.len() - 1].1;
    let interval = settings.steps_per_sample() as f64 * settings.dt_secs;
    let reference: Vec<SegmentPoses> =
        (0..truth.len()).map(|index| simulation.reference_poses(index as f64 * interval)).collect();
    let weight = humanoid.body.mass_kg * GRAVITY_M_S2;
    let force = |states: &[State]| mean(states.iter().skip(1).map(|state| ground_force(state).z));
    let mut text = String::new();
    for (name, states) in &engines {
        let to_reference = mean(states.iter().zip(&reference).skip(1).map(|(s, r)| distance_mm(&s.poses, r)));
        let to_truth = mean(states.iter().zip(truth).skip(1).map(|(s, t)| distance_mm(&s.poses, &t.poses)));
        let assist = 100.0 * mean(states.iter().skip(1).map(|state| state.assist_n.norm())) / weight;
        let _ = writeln!(
            text,
            "| {} | {name} | {to_reference:.1} | {to_truth:.1} | {:.0} | {:.3} | {:.1} | {:.1} | {assist:.1} |",
            sample.id,
            force(states),
            force(states) / force(truth),
            impulse_difference_percent(states, truth, interval),
            slip_mm_s(states, interval)
        );
    }
    Ok(text)
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn ground_force(state: &State) -> Vector3<f64> {
    state.ground.iter().map(|(force, _)| *force).sum()
}

/// Mean distance of the segments' origins, each relative to its root.
fn distance_mm(a: &SegmentPoses, b: &SegmentPoses) -> f64 {
    let offset =
        |poses: &SegmentPoses, index: usize| poses[index].translation.vector - poses[0].translation.vector;
    1e3 * mean((0..NUM_SEGMENTS).map(|index| (offset(a, index) - offset(b, index)).norm()))
}

/// Difference of the ground's vertical impulse in windows of a tenth of a second, as a share of all of it.
fn impulse_difference_percent(states: &[State], truth: &[State], interval_secs: f64) -> f64 {
    let window = (0.1 / interval_secs).round().max(1.0) as usize;
    let sums = |states: &[State]| -> Vec<f64> {
        let forces: Vec<f64> = states.iter().skip(1).map(|state| ground_force(state).z).collect();
        forces.chunks(window).map(|chunk| chunk.iter().sum()).collect()
    };
    let (ours, theirs) = (sums(states), sums(truth));
    let apart: f64 = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).sum();
    100.0 * apart / theirs.iter().sum::<f64>()
}

/// Mean horizontal speed of the points the ground pushes at, weighted by the push.
fn slip_mm_s(states: &[State], interval_secs: f64) -> f64 {
    let (mut moved, mut pushed) = (0.0, 0.0);
    for pair in states.windows(2) {
        for segment in 0..NUM_SEGMENTS {
            let (force, point) = pair[1].ground[segment];
            if force.z > 0.0 {
                let in_segment = pair[1].poses[segment].inverse_transform_point(&point);
                let before = pair[0].poses[segment] * in_segment;
                moved += force.z * (point - before).xy().norm();
                pushed += force.z;
            }
        }
    }
    if pushed > 0.0 { 1e3 * moved / pushed / interval_secs } else { 0.0 }
}

fn ours(simulation: &Simulation<'_>) -> Result<Vec<State>, Box<dyn Error>> {
    let rollout = simulation.run(Level::L2, &mut |_| {})?;
    let state = |sample: &rprae::simulation::RolloutSample| {
        let mut ground = [(Vector3::zeros(), Point3::origin()); NUM_SEGMENTS];
        for contact in &sample.contacts {
            ground[contact.segment] = (contact.force_n, contact.position_m);
        }
        State { poses: sample.world_from_segment, ground, assist_n: sample.assist_force_n }
    };
    Ok(rollout.samples.iter().map(state).collect())
}

fn mujoco(folder: &Path, substeps: usize) -> Result<Vec<State>, Box<dyn Error>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/tracking_mujoco.py");
    let python = std::env::var_os("RPRAE_PEER_PYTHON").unwrap_or_else(|| "python3".into());
    let out = folder.join("out.csv");
    let status = Command::new(python)
        .arg(script)
        .args(["--substeps", &substeps.to_string()])
        .arg("--urdf")
        .arg(folder.join("body.urdf"))
        .arg("--control")
        .arg(folder.join("control.json"))
        .arg("--commands")
        .arg(folder.join("commands.csv"))
        .arg("--out")
        .arg(&out)
        .stdout(std::process::Stdio::null())
        .status()?;
    if !status.success() {
        return Err("the peer failed, is mujoco installed?".into());
    }
    let text = std::fs::read_to_string(out)?;
    text.lines().map(state).collect()
}

fn state(line: &str) -> Result<State, Box<dyn Error>> {
    let values: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
    if values.len() != 13 * NUM_SEGMENTS + 3 {
        return Err(format!("the peer wrote {} columns", values.len()).into());
    }
    let mut state = State {
        poses: [Isometry3::identity(); NUM_SEGMENTS],
        ground: [(Vector3::zeros(), Point3::origin()); NUM_SEGMENTS],
        assist_n: Vector3::from_column_slice(&values[13 * NUM_SEGMENTS..]),
    };
    for (segment, v) in values.chunks_exact(13).take(NUM_SEGMENTS).enumerate() {
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(v[3], v[4], v[5], v[6]));
        state.poses[segment] = Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), rotation);
        state.ground[segment] = (Vector3::new(v[7], v[8], v[9]), Point3::new(v[10], v[11], v[12]));
    }
    Ok(state)
}

fn write_inputs(
    folder: &Path,
    humanoid: &Humanoid,
    simulation: &Simulation<'_>,
    settings: &SimulationSettings,
    duration_secs: f64,
) -> Result<(), Box<dyn Error>> {
    let tree = &humanoid.robot.tree;
    let joints: Vec<_> = JOINTS
        .iter()
        .enumerate()
        .map(|(kit, joint)| {
            let gains = gains(joint.short_name());
            let angle = humanoid.kit_of_angle().iter().position(|&other| other == kit).unwrap_or_default();
            json!({
                "name": joint.name,
                "stiffness_nm_rad": gains.stiffness_nm_rad,
                "damping_nms_rad": gains.damping_nms_rad,
                "effort_nm": humanoid.robot.limits[angle].effort_nm,
                "target_rad": 0.0,
            })
        })
        .collect();
    let names: Vec<&str> =
        humanoid.segment_links.iter().map(|&link| tree.links()[link].name.as_str()).collect();
    let added: serde_json::Map<_, _> = humanoid
        .segment_links
        .iter()
        .skip(1)
        .map(|&link| {
            let is_foot = humanoid.sole_points.iter().any(|point| point.link == link);
            let extra = ADDED_INERTIA.everywhere_kgm2 + if is_foot { ADDED_INERTIA.feet_kgm2 } else { 0.0 };
            (tree.links()[link].name.clone(), json!(extra))
        })
        .collect();
    let force_n = settings.assist_limit * humanoid.body.mass_kg * GRAVITY_M_S2;
    let control = json!({
        "dt_secs": settings.dt_secs,
        "gravity_m_s2": GRAVITY_M_S2,
        "friction": settings.friction,
        "root_position_m": [0.0, 0.0, 1.0],
        "root_quaternion_wxyz": [1.0, 0.0, 0.0, 0.0],
        "joints": joints,
        "added_inertia_kgm2": added,
        "segments": names,
        "assist": {
            "force_n": force_n,
            "moment_nm": force_n * settings.assist_arm_m,
            "linear": [rprae::simulation::ASSIST_LINEAR.0, rprae::simulation::ASSIST_LINEAR.1],
            "angular": [rprae::simulation::ASSIST_ANGULAR.0, rprae::simulation::ASSIST_ANGULAR.1],
        },
        "steps_per_sample": settings.steps_per_sample(),
    });
    std::fs::write(folder.join("body.urdf"), &humanoid.urdf)?;
    std::fs::write(folder.join("control.json"), control.to_string())?;
    let mut commands = String::new();
    for step in 0..(duration_secs / settings.dt_secs).ceil() as usize {
        let command = simulation.command(step as f64 * settings.dt_secs);
        let rotation = command.world_from_root.rotation;
        let joints = [&command.angles_rad, &command.speeds_rad_s, &command.torques_nm].into_iter().flatten();
        let position = command.world_from_root.translation.vector;
        let root = [position.x, position.y, position.z, rotation.w, rotation.i, rotation.j, rotation.k];
        let rates = command.root_velocity_m_s.iter().chain(command.root_angular_velocity_rad_s.iter());
        let line: Vec<String> =
            joints.chain(&root).chain(rates).map(std::string::ToString::to_string).collect();
        commands += &line.join(",");
        commands.push('\n');
    }
    Ok(std::fs::write(folder.join("commands.csv"), commands)?)
}
