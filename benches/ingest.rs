//! MMM XML ingest in megabytes per CPU second of one core, beside lxml.
//!
//! `cargo bench --bench ingest` reads the recorded files under `$RPRAE_DATA/kit-ml/dataset`, or files it generates when
//! that is not set. Both sides parse the same bytes from memory into the same numbers (time stamps, root pose, 44 joint
//! angles), alternating in one run; ours also maps joints by name, finds the rate and checks every value.
//! The peer runs under `$RPRAE_PEER_PYTHON` (default `python3`) with the packages of `benches/peers/requirements.txt`.

#[path = "beside/clock.rs"]
mod clock;
#[path = "beside/peer.rs"]
mod peer;

use std::error::Error;
use std::path::{Path, PathBuf};

use rprae::dataset::mmm::{read_mmm, write_mmm};
use rprae::motion::{Body, Frame, Motion};

use clock::cpu_secs;
use peer::{Peer, median, script};

/// Alternations; the printed numbers are medians over them.
const ROUNDS: usize = 11;

/// Passes over all files that one of our rounds averages, so that it lasts about as long as one of the peer's.
const PASSES: usize = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let generated = tempfile::tempdir()?;
    let (label, paths) = match std::env::var_os("RPRAE_DATA") {
        Some(data) => ("recorded", recorded_files(&Path::new(&data).join("kit-ml/dataset"))?),
        None => ("generated (RPRAE_DATA is not set)", generate_files(generated.path())?),
    };
    let files: Vec<Vec<u8>> = paths.iter().map(std::fs::read).collect::<Result<_, _>>()?;
    let megabytes = files.iter().map(Vec::len).sum::<usize>() as f64 / 1e6;
    println!(
        "{} {label} files, {megabytes:.2} MB, one core, median of {ROUNDS} rounds, MB per CPU second",
        files.len()
    );

    let mut peer = Peer::start(script("ingest.py").args(&paths))
        .map_err(|error| println!("lxml is left out ({error}); see benches/peers/requirements.txt"))
        .ok()
        .map(|(peer, hello)| {
            println!("peer: {}", hello.trim());
            peer
        });
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let (secs, sum) = run_ours(&files)?;
        ours.push(megabytes / secs);
        if let Some(peer) = &mut peer {
            let reply = peer.ask("")?;
            let (peer_secs, peer_sum) = reply.trim().split_once(' ').ok_or("unreadable reply")?;
            let (peer_secs, peer_sum): (f64, f64) = (peer_secs.parse()?, peer_sum.parse()?);
            if (sum - peer_sum).abs() > 1e-9 * sum.abs() {
                return Err(format!("the two sides read different numbers: {sum} and {peer_sum}").into());
            }
            theirs.push(megabytes / peer_secs);
        }
    }
    println!("rprae {:8.1} MB/s", median(&mut ours.clone()));
    if !theirs.is_empty() {
        let mut ratios: Vec<f64> = ours.iter().zip(&theirs).map(|(ours, theirs)| ours / theirs).collect();
        let (low, high) = ratios.iter().fold((f64::MAX, 0.0_f64), |(l, h), &r| (l.min(r), h.max(r)));
        println!("lxml  {:8.1} MB/s", median(&mut theirs));
        println!("ratio {:8.1}x (lowest {low:.1}, highest {high:.1})", median(&mut ratios));
    }
    Ok(())
}

/// Seconds for one pass over the files, and the sum of all numbers read, in the units of the files.
fn run_ours(files: &[Vec<u8>]) -> Result<(f64, f64), Box<dyn Error>> {
    let mut sum = 0.0;
    let start = cpu_secs();
    for pass in 0..PASSES {
        for file in files {
            let motion = read_mmm(file, None)?.motion;
            if pass == 0 {
                sum += motion.frames().iter().map(sum_of_frame).sum::<f64>();
            }
            std::hint::black_box(motion);
        }
    }
    Ok(((cpu_secs() - start) / PASSES as f64, sum))
}

fn sum_of_frame(frame: &Frame) -> f64 {
    let angles: f64 = frame.joint_angles_rad.iter().chain(&frame.root_rotation_rad).sum();
    angles + 1e3 * frame.root_position_m.iter().sum::<f64>()
}

fn recorded_files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "xml") {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Files of about the length and digits of recorded ones.
fn generate_files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    (0..7_u32)
        .map(|file| {
            let frames = (0..800_u32)
                .map(|index| {
                    let mut phase = f64::from(index) * 0.01 + f64::from(file);
                    let mut frame = Frame::ZERO;
                    frame.root_position_m = [phase.sin(), phase, 0.9];
                    for angle in &mut frame.joint_angles_rad {
                        phase += 0.37;
                        *angle = 0.4 * phase.sin();
                    }
                    frame
                })
                .collect();
            let motion = Motion::new(Body::with_default_mass(1.75), 100.0, frames)?;
            let path = folder.join(format!("{file:05}_mmm.xml"));
            std::fs::write(&path, write_mmm(&motion, "generated"))?;
            Ok(path)
        })
        .collect()
}
