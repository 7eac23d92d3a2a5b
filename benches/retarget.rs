//! Retargeting in frames per CPU second of one core.
//!
//! `cargo bench --bench retarget [FOLDER]` takes the first clips of a folder of motion capture, or walking of the bundled
//! suite as KIT-ML joint positions when none is given. Reading is not timed; solving, sweeping and measuring are.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use rprae::dataset::Dataset;
use rprae::humanoid::Humanoid;
use rprae::mocap::{Clip, PositionOrder, read_bvh};
use rprae::retarget::{RetargetOptions, recognise, retarget};

/// Rounds; the printed number is their median.
const ROUNDS: usize = 5;
/// Most clips of a folder.
const MAX_CLIPS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    let (label, clips) = match folder {
        Some(folder) => ("recorded BVH", recorded(Path::new(&folder))?),
        None => ("walking as KIT-ML positions", bundled()?),
    };
    let num_frames: usize = clips.iter().map(Clip::num_frames).sum();
    let skeletons = clips.iter().map(recognise).collect::<Result<Vec<_>, _>>()?;
    let mut rates = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        let start = Instant::now();
        for (clip, skeleton) in clips.iter().zip(&skeletons) {
            let options =
                RetargetOptions { rate_hz: clip.rate_hz().or(Some(100.0)), ..RetargetOptions::default() };
            std::hint::black_box(retarget(clip, skeleton, &options)?);
        }
        rates.push(num_frames as f64 / start.elapsed().as_secs_f64());
    }
    rates.sort_by(f64::total_cmp);
    println!("{} clips of {label}, {num_frames} frames, one thread, median of {ROUNDS} rounds", clips.len());
    println!("{:.0} frames/s (lowest {:.0}, highest {:.0})", rates[ROUNDS / 2], rates[0], rates[ROUNDS - 1]);
    Ok(())
}

fn recorded(folder: &Path) -> Result<Vec<Clip>, Box<dyn Error>> {
    let mut paths: Vec<_> =
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<_>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "bvh"));
    paths.sort();
    let read =
        |path: &std::path::PathBuf| -> Result<Clip, Box<dyn Error>> { Ok(read_bvh(&std::fs::read(path)?)?) };
    paths.iter().take(MAX_CLIPS).map(read).collect()
}

/// Order of KIT-ML arrays as links of the humanoid.
const LINKS: [&str; 21] = [
    "pelvis",
    "abdomen",
    "thorax",
    "neck",
    "head",
    "left_upper_arm",
    "left_forearm",
    "left_hand",
    "right_upper_arm",
    "right_forearm",
    "right_hand",
    "left_thigh",
    "left_shank",
    "left_foot",
    "left_midfoot",
    "left_toes",
    "right_thigh",
    "right_shank",
    "right_foot",
    "right_midfoot",
    "right_toes",
];

fn bundled() -> Result<Vec<Clip>, Box<dyn Error>> {
    let dataset = Dataset::bundled();
    let entry =
        dataset.entries().iter().find(|entry| entry.id == "90001").ok_or("no walking in the suite")?;
    let motion = dataset.load(entry).map_err(|skipped| skipped.reason)?.motion;
    let humanoid = Humanoid::new(motion.body())?;
    let links: Vec<usize> = LINKS.iter().filter_map(|name| humanoid.robot.tree.link_index(name)).collect();
    let mut centres = Vec::new();
    for frame in motion.frames() {
        let poses = humanoid.forward(frame);
        centres.extend(links.iter().map(|&link| {
            let centre = poses[link].translation.vector;
            [-centre.x, centre.z, centre.y]
        }));
    }
    Ok(vec![PositionOrder::KitMl.clip(centres, Some(motion.rate_hz()))?])
}
