//! Inverse dynamics per second of one core, beside Pinocchio on the same URDF.
//!
//! `cargo bench --bench dynamics` alternates both programs in one run and prints medians and their ratio.
//! Both sides compute forward kinematics and the recursive Newton-Euler algorithm with a free root for random states; on
//! Pinocchio's side the cost of a call from Python is measured on a body of one joint and taken off.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

use std::error::Error;
use std::hint::black_box;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Instant;

use nalgebra::{Isometry3, Vector3};
use rprae::dynamics::{Inertia, InverseDynamics, RootMotion, inverse_dynamics};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, NUM_JOINTS};
use serde_json::Value;

/// Alternations; the printed numbers are medians over them.
const ROUNDS: usize = 11;
const CALLS: usize = 20_000;
const NUM_STATES: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let humanoid = Humanoid::new(Body::with_default_mass(1.75))?;
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("body.urdf"), &humanoid.urdf)?;
    let mut peer = Peer::start(folder.path())
        .map_err(|error| eprintln!("Pinocchio is left out ({error}); see benches/peers/requirements.txt"))
        .ok();
    let (mut ours, mut mass, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    // One round to warm caches and clocks on both sides.
    for round in 0..=ROUNDS {
        let (inverse_secs, mass_secs) = (inverse_secs(&humanoid), mass_matrix_secs(&humanoid));
        let measured = peer.as_mut().map(Peer::measure).transpose()?;
        if round > 0 {
            ours.push(inverse_secs);
            mass.push(mass_secs);
            theirs.extend(measured.and_then(|reply| reply["secs_per_call"].as_f64()));
        }
    }
    let mut ratios: Vec<f64> = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
    println!("{CALLS} calls, one core, median of {ROUNDS} alternating rounds\n");
    println!("| program | microseconds a call | times Pinocchio (lowest..highest) |\n|---|---|---|");
    let micros = |values: &mut [f64]| format!("{:.2}", 1e6 * median(values));
    let ratio = if ratios.is_empty() {
        "-".to_owned()
    } else {
        let middle = median(&mut ratios);
        format!("{middle:.2} ({:.2}..{:.2})", ratios[0], ratios[ratios.len() - 1])
    };
    println!("| rprae, forward kinematics and inverse dynamics | {} | {ratio} |", micros(&mut ours));
    if !theirs.is_empty() {
        println!("| Pinocchio, rnea | {} | 1 |", micros(&mut theirs));
    }
    println!("| rprae, mass matrix, momentum and Jacobian | {} | |", micros(&mut mass));
    Ok(())
}

/// Some angles, speeds and accelerations that are neither small nor regular.
fn state(index: usize) -> [[f64; NUM_JOINTS]; 3] {
    let wave = |scale: f64, offset: f64| {
        std::array::from_fn(|joint| scale * (offset + 1.7 * joint as f64 + 0.3 * index as f64).sin())
    };
    [wave(0.5, 0.1), wave(2.0, 0.7), wave(20.0, 1.3)]
}

fn inverse_secs(humanoid: &Humanoid) -> f64 {
    let tree = &humanoid.robot.tree;
    let states: Vec<_> = (0..NUM_STATES).map(state).collect();
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let root_pose = Isometry3::new(Vector3::new(0.1, 0.2, 0.9), Vector3::new(0.1, -0.2, 0.3));
    let root = RootMotion {
        velocity: Vector3::new(0.5, 1.0, 0.1),
        angular_velocity: Vector3::new(0.3, 0.2, 0.1),
        acceleration: Vector3::new(1.0, 2.0, 3.0),
        angular_acceleration: Vector3::new(2.0, 1.0, 0.5),
    };
    let (mut poses, mut found) = (Vec::new(), InverseDynamics::default());
    let start = cpu_secs();
    for call in 0..CALLS {
        let [angles, speeds, accelerations] = &states[call % NUM_STATES];
        tree.forward_into(&root_pose, angles, &mut poses);
        inverse_dynamics(tree, &poses, &root, speeds, accelerations, &gravity, &[], &mut found);
        black_box(&found.root_force_n);
    }
    (cpu_secs() - start) / CALLS as f64
}

fn mass_matrix_secs(humanoid: &Humanoid) -> f64 {
    let tree = &humanoid.robot.tree;
    let poses: Vec<_> =
        (0..NUM_STATES).map(|index| tree.forward(&Isometry3::identity(), &state(index)[0])).collect();
    let mut inertia = Inertia::default();
    let start = cpu_secs();
    for call in 0..CALLS {
        inertia.update(tree, &poses[call % NUM_STATES]);
        black_box(inertia.com_m());
    }
    (cpu_secs() - start) / CALLS as f64
}

/// Sorts, and gives the middle.
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
    fn start(folder: &Path) -> Result<Self, Box<dyn Error>> {
        let script =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/inverse_dynamics_pinocchio.py");
        let python = std::env::var_os("RPRAE_PEER_PYTHON").unwrap_or_else(|| "python3".into());
        let mut process = Command::new(python)
            .arg(script)
            .args(["--calls", &CALLS.to_string()])
            .arg("--urdf")
            .arg(folder.join("body.urdf"))
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
            return Err("the peer stopped, is pinocchio installed?".into());
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
