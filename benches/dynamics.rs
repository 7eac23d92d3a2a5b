//! Inverse dynamics per second of one core, beside Pinocchio on the same URDF.
//!
//! `cargo bench --bench dynamics` alternates both programs in one run and prints medians and their ratio.
//! Both sides compute forward kinematics and the recursive Newton-Euler algorithm with a free root for random states; on
//! Pinocchio's side the cost of a call from Python is measured on a body of one joint and taken off.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

#[path = "beside/clock.rs"]
mod clock;
#[path = "beside/peer.rs"]
mod peer;

use std::error::Error;
use std::hint::black_box;

use nalgebra::{Isometry3, Vector3};
use rprae::dynamics::{Inertia, InverseDynamics, RootMotion, inverse_dynamics};
use rprae::humanoid::Humanoid;
use rprae::motion::{Body, NUM_JOINTS};
use serde_json::Value;

use clock::cpu_secs;
use peer::{Peer, median, script};

/// Alternations; the printed numbers are medians over them.
const ROUNDS: usize = 11;
const CALLS: usize = 20_000;
const NUM_STATES: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let humanoid = Humanoid::new(Body::with_default_mass(1.75))?;
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("body.urdf"), &humanoid.urdf)?;
    let mut command = script("inverse_dynamics_pinocchio.py");
    command.args(["--calls", &CALLS.to_string(), "--urdf"]).arg(folder.path().join("body.urdf"));
    let mut peer = Peer::start(&mut command)
        .map_err(|error| eprintln!("Pinocchio is left out ({error}); see benches/peers/requirements.txt"))
        .ok()
        .map(|(peer, _)| peer);
    let (mut ours, mut mass, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    // One round to warm caches and clocks on both sides.
    for round in 0..=ROUNDS {
        let (inverse_secs, mass_secs) = (inverse_secs(&humanoid), mass_matrix_secs(&humanoid));
        let measured = peer.as_mut().map(|peer| peer.ask("measure")).transpose()?;
        if round > 0 {
            ours.push(inverse_secs);
            mass.push(mass_secs);
            let measured: Option<Value> = measured.as_deref().map(serde_json::from_str).transpose()?;
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
