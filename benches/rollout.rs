//! Rollout steps per second of one core, beside MuJoCo on the same URDF, step length, gains and ground.
//!
//! `cargo bench --bench rollout` alternates both programs in one run and prints medians and their ratio;
//! `-- --svg FILE` draws the joint error over the speed for rising numbers of solver iterations.
//! Two workloads, both without assist: holding the neutral stance, and swinging both arms.
//! On our side the whole of [`simulate`] is timed, with inverse dynamics and retargeting switched off, since MuJoCo's side
//! has neither; on MuJoCo's side the step loop that runs inside MuJoCo.
//! Both sides report what the body did, so that a fast fall is not taken for speed.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

use std::error::Error;
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Instant;

use rprae::humanoid::Humanoid;
use rprae::motion::{Body, Frame, JOINTS, Motion, joint_index};
use rprae::report::{Chart, Panel, Point, Series};
use rprae::simulation::{
    ADDED_INERTIA, GRAVITY_M_S2, JointForm, Level, Rollout, SimulationSettings, gains, simulate,
};
use serde_json::{Value, json};

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
    let mut peer = Peer::start(folder.path(), humanoid, &motion, settings)
        .map_err(|error| eprintln!("MuJoCo is left out ({error}); see benches/peers/requirements.txt"))
        .ok();
    let (mut ours, mut theirs, mut errors) = (Vec::new(), Vec::new(), (0.0, f64::NAN));
    // One round to warm caches and clocks on both sides.
    for round in 0..=ROUNDS {
        let start = cpu_secs();
        let rollout = simulate(humanoid, &motion, Level::L3, settings, &mut |_| {})?;
        let speed = STEPS as f64 / (cpu_secs() - start);
        errors.0 = joint_rms(&rollout);
        let measured = peer.as_mut().map(Peer::measure).transpose()?;
        if round > 0 {
            ours.push(speed);
            theirs.extend(measured.as_ref().and_then(|m| m["steps_per_cpu_sec"].as_f64()));
        }
        errors.1 = measured.and_then(|m| m["joint_error_rms_rad"].as_f64()).unwrap_or(f64::NAN);
    }
    let mut ratios: Vec<f64> = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
    ratios.sort_by(f64::total_cmp);
    let middle = if ratios.is_empty() { f64::NAN } else { median(&mut ratios) };
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

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// CPU time of this thread where the system tells it, else wall time, seconds.
fn cpu_secs() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let wall = START.get_or_init(Instant::now).elapsed().as_secs_f64();
    let read = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    read.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(wall, |nanos| nanos * 1e-9)
}

struct Peer {
    process: Child,
    replies: BufReader<ChildStdout>,
}

impl Peer {
    fn start(
        folder: &Path,
        humanoid: &Humanoid,
        motion: &Motion,
        settings: &SimulationSettings,
    ) -> Result<Self, Box<dyn Error>> {
        std::fs::write(folder.join("body.urdf"), &humanoid.urdf)?;
        std::fs::write(folder.join("control.json"), control(humanoid, motion, settings).to_string())?;
        std::fs::write(folder.join("targets.csv"), targets(motion, settings.dt_secs)?)?;
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/rollout_mujoco.py");
        let python = std::env::var_os("RPRAE_PEER_PYTHON").unwrap_or_else(|| "python3".into());
        let mut process = Command::new(python)
            .arg(script)
            .args(["--on-request", "--warm-up", "0", "--steps", &STEPS.to_string()])
            .arg("--urdf")
            .arg(folder.join("body.urdf"))
            .arg("--control")
            .arg(folder.join("control.json"))
            .arg("--targets")
            .arg(folder.join("targets.csv"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let replies = BufReader::new(process.stdout.take().ok_or("the peer has no output")?);
        let mut peer = Self { process, replies };
        peer.reply()?;
        Ok(peer)
    }

    fn reply(&mut self) -> Result<Value, Box<dyn Error>> {
        let mut line = String::new();
        if self.replies.read_line(&mut line)? == 0 {
            return Err("the peer stopped, is mujoco installed?".into());
        }
        Ok(serde_json::from_str(&line)?)
    }

    fn measure(&mut self) -> Result<Value, Box<dyn Error>> {
        self.process.stdin.as_mut().ok_or("the peer has no input")?.write_all(b"measure\n")?;
        self.reply()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The peer ends with its input; if it is gone already there is nothing to wait for.
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
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
