//! Rollout steps per second of one core, beside MuJoCo on the same URDF, step length, gains and ground.
//!
//! `cargo bench --bench rollout` alternates both programs in one run and prints medians and their ratio;
//! `-- --svg FILE` draws the joint error over the speed for rising numbers of solver iterations.
//! Two workloads, both without assist: holding the neutral stance, and swinging both arms.
//! On our side the whole of [`simulate`] is timed, with inverse dynamics and retargeting switched off, since MuJoCo's side
//! has neither; on MuJoCo's side the step loop that runs inside MuJoCo.
//! Both sides report what the body did, so that a fast fall is not taken for speed.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

#[path = "beside/clock.rs"]
mod clock;
#[path = "beside/peer.rs"]
mod peer;

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, JOINTS, Motion, joint_index};
use rprae::report::{Chart, Panel, Point, Series};
use rprae::simulation::{
    ADDED_INERTIA, GRAVITY_M_S2, JointForm, Level, Rollout, SimulationSettings, gains, simulate,
};
use serde_json::{Value, json};

use clock::cpu_secs;
use peer::{Peer, median, script};

/// Alternations; the printed numbers are medians over them.
const ROUNDS: usize = 9;
/// Steps of one measurement.
const STEPS: usize = 2400;
const RATE_HZ: f64 = 120.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip_while(|word| word != "--svg");
    let svg = words.nth(1);
    let mut series = Vec::new();
    let humanoid = Humanoid::new(Body::with_default_mass(1.75))?;
    println!(
        "{STEPS} steps, one core, median of {ROUNDS} alternating rounds; speeds in steps per CPU second\n"
    );
    println!(
        "| workload | configuration | rprae | MuJoCo | ratio (lowest..highest) | joint rms rprae / MuJoCo, rad |"
    );
    println!("|---|---|---|---|---|---|");
    for (workload, amplitude) in [("standing", 0.0), ("arm swing", 0.5)] {
        let mut points = Vec::new();
        for (configuration, pgs_iterations, joint_form) in [
            ("balls, 12 PGS", 12, JointForm::Balls),
            ("balls, 8 PGS (default)", 8, JointForm::Balls),
            ("balls, 6 PGS", 6, JointForm::Balls),
            ("balls, 4 PGS", 4, JointForm::Balls),
            ("balls, 3 PGS", 3, JointForm::Balls),
            ("balls, 2 PGS", 2, JointForm::Balls),
            ("reduced coordinates", 8, JointForm::Multibody),
        ] {
            let settings = SimulationSettings {
                pgs_iterations,
                joint_form,
                feed_forward: false,
                swing_lift: false,
                sole_levelling: false,
                ground_correction_limit_m: 0.0,
                record_rate_hz: 30.0,
                ..SimulationSettings::default()
            };
            let (ratio, error_rad) = compare(&humanoid, workload, amplitude, configuration, &settings)?;
            if joint_form == JointForm::Balls {
                points.push(Point { x: ratio, y: 1e3 * error_rad, interval: None });
            }
        }
        series.push(Series { name: workload.to_owned(), points });
    }
    if let Some(path) = svg {
        let panels = vec![Panel { label: "joint error, mrad".to_owned(), series }];
        let title = "Accuracy against speed: 12, 8, 6, 4, 3, 2 solver iterations".to_owned();
        let chart = Chart { title, x_label: "speed, times MuJoCo".to_owned(), panels };
        std::fs::write(path, chart.svg())?;
    }
    Ok(())
}

fn compare(
    humanoid: &Humanoid,
    workload: &str,
    amplitude_rad: f64,
    configuration: &str,
    settings: &SimulationSettings,
) -> Result<(f64, f64), Box<dyn Error>> {
    let motion = motion(humanoid, amplitude_rad, settings.dt_secs)?;
    let folder = tempfile::tempdir()?;
    let mut peer = mujoco(folder.path(), humanoid, &motion, settings)
        .map_err(|error| eprintln!("MuJoCo is left out ({error}); see benches/peers/requirements.txt"))
        .ok();
    let (mut ours, mut theirs, mut errors) = (Vec::new(), Vec::new(), (0.0, f64::NAN));
    // One round to warm caches and clocks on both sides.
    for round in 0..=ROUNDS {
        let start = cpu_secs();
        let rollout = simulate(humanoid, &motion, Level::L3, settings, &mut |_| {})?;
        let speed = STEPS as f64 / (cpu_secs() - start);
        errors.0 = joint_rms(&rollout);
        let measured = peer.as_mut().map(|peer| peer.ask("measure")).transpose()?;
        let measured: Option<Value> = measured.as_deref().map(serde_json::from_str).transpose()?;
        if round > 0 {
            ours.push(speed);
            theirs.extend(measured.as_ref().and_then(|m| m["steps_per_cpu_sec"].as_f64()));
        }
        errors.1 = measured.and_then(|m| m["joint_error_rms_rad"].as_f64()).unwrap_or(f64::NAN);
    }
    let mut ratios: Vec<f64> = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
    ratios.sort_by(f64::total_cmp);
    let middle = median(&mut ratios);
    let ratio = match ratios.as_slice() {
        [lowest, .., highest] => format!("{middle:.2} ({lowest:.2}..{highest:.2})"),
        _ => "-".to_owned(),
    };
    let peer_speed = if theirs.is_empty() { "-".to_owned() } else { format!("{:.0}", median(&mut theirs)) };
    println!(
        "| {workload} | {configuration} | {:.0} | {peer_speed} | {ratio} | {:.4} / {:.4} |",
        median(&mut ours),
        errors.0,
        errors.1
    );
    Ok((middle, errors.0))
}

/// Neutral stance, with shoulders and elbows swinging at 0.5 Hz by this amplitude.
fn motion(humanoid: &Humanoid, amplitude_rad: f64, dt_secs: f64) -> Result<Motion, Box<dyn Error>> {
    let num_frames = (STEPS as f64 * dt_secs * RATE_HZ).round() as usize + 1;
    let frames = (0..num_frames)
        .map(|index| {
            let mut frame = Frame::ZERO;
            frame.root_position_m[2] = humanoid.standing_root_height_m();
            let swing = amplitude_rad * (std::f64::consts::PI * index as f64 / RATE_HZ).sin();
            for (joint, share) in [("LSx", 1.0_f64), ("RSx", -1.0), ("LEx", 0.4), ("REx", 0.4)] {
                if let Some(joint) = joint_index(joint) {
                    let bent = if share.abs() < 1.0 { 0.4 * amplitude_rad } else { 0.0 };
                    let angle = share * swing + bent;
                    frame.joint_angles_rad[joint] =
                        angle.clamp(JOINTS[joint].lower_rad, JOINTS[joint].upper_rad);
                }
            }
            frame
        })
        .collect();
    Ok(Motion::new(humanoid.body, RATE_HZ, frames)?)
}

fn joint_rms(rollout: &Rollout) -> f64 {
    let squares: f64 = rollout
        .samples
        .iter()
        .flat_map(|sample| sample.joint_angles_rad.iter().zip(&sample.reference_joint_angles_rad))
        .map(|(angle, reference)| (angle - reference).powi(2))
        .sum();
    (squares / (rollout.samples.len() * JOINTS.len()) as f64).sqrt()
}

/// MuJoCo with a body, its control and its targets, loaded and waiting.
fn mujoco(
    folder: &Path,
    humanoid: &Humanoid,
    motion: &Motion,
    settings: &SimulationSettings,
) -> Result<Peer, Box<dyn Error>> {
    let [body, gains, commands] = ["body.urdf", "control.json", "targets.csv"].map(|name| folder.join(name));
    std::fs::write(&body, &humanoid.urdf)?;
    std::fs::write(&gains, control(humanoid, motion, settings).to_string())?;
    std::fs::write(&commands, targets(motion, settings.dt_secs)?)?;
    let mut command = script("rollout_mujoco.py");
    command.args(["--on-request", "--warm-up", "0", "--steps", &STEPS.to_string()]);
    command.arg("--urdf").arg(body).arg("--control").arg(gains).arg("--targets").arg(commands);
    Ok(Peer::start(&mut command)?.0)
}

fn control(humanoid: &Humanoid, motion: &Motion, settings: &SimulationSettings) -> Value {
    let tree = &humanoid.robot.tree;
    let joints: Vec<Value> = JOINTS
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
                "target_rad": motion.frames()[0].joint_angles_rad[kit],
            })
        })
        .collect();
    let added: serde_json::Map<String, Value> = humanoid
        .segment_links
        .iter()
        .skip(1)
        .map(|&link| {
            let is_foot = humanoid.sole_points.iter().any(|point| point.link == link);
            let extra = ADDED_INERTIA.everywhere_kgm2 + if is_foot { ADDED_INERTIA.feet_kgm2 } else { 0.0 };
            (tree.links()[link].name.clone(), json!(extra))
        })
        .collect();
    json!({
        "dt_secs": settings.dt_secs,
        "gravity_m_s2": GRAVITY_M_S2,
        "friction": settings.friction,
        "root_position_m": motion.frames()[0].root_position_m,
        "root_quaternion_wxyz": [1.0, 0.0, 0.0, 0.0],
        "joints": joints,
        "added_inertia_kgm2": added,
    })
}

/// One row per step: target angles, then target speeds, in the order of the control file.
fn targets(motion: &Motion, dt_secs: f64) -> Result<String, std::fmt::Error> {
    let angles_at = |time_secs: f64| {
        let position = (time_secs * RATE_HZ).clamp(0.0, (motion.num_frames() - 1) as f64);
        let frame = (position.floor() as usize).min(motion.num_frames() - 2);
        let share = position - frame as f64;
        let (before, after) = (&motion.frames()[frame], &motion.frames()[frame + 1]);
        let mix = |joint: usize| {
            let (a, b) = (before.joint_angles_rad[joint], after.joint_angles_rad[joint]);
            (a + share * (b - a), (b - a) * RATE_HZ)
        };
        (0..JOINTS.len()).map(mix).unzip::<f64, f64, Vec<_>, Vec<_>>()
    };
    let mut text = String::new();
    for step in 0..STEPS {
        let (angles, speeds) = angles_at(step as f64 * dt_secs);
        for (index, value) in angles.iter().chain(&speeds).enumerate() {
            write!(text, "{}{value}", if index == 0 { "" } else { "," })?;
        }
        text.push('\n');
    }
    Ok(text)
}
