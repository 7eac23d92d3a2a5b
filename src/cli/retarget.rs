//! `rprae retarget`: motion capture to motions of the humanoid, with a report of how well they follow.

use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use clap::{Args, ValueEnum};
use rayon::prelude::*;

use super::exit::{Exit, Failure, Inputs, OrExit};
use super::progress::Steps;
use super::{motions, number, output};
use crate::dataset::mmm::write_mmm;
use crate::dataset::{Dataset, Entry, OpenOptions, Skipped, Unstated};
use crate::manifest::write_file;
use crate::motion::Motion;
use crate::report::retargeting::{ClipRow, Report};
use crate::retarget::Correspondence;

const RULES: &str = "\
What positions leave open:
  trunk    twist and bend that two joints share are split between them evenly
  head     yaw and the second neck joint follow the source's head where it has an orientation, else rest at zero
  forearm  twist follows the source's hand where it has an orientation, else rests at zero
  wrist    as the forearm
  toes     lie on the floor while the foot stands, else follow the source's where it has an orientation and rest at zero where it
           has none; the midfoot rests at zero
  feet     soles are level in flat stance, on the floor in stance, and stay where they stand";

/// Makes motions of the humanoid from motion capture of other skeletons.
///
/// Reads BVH, AMC with its ASF, and joint positions as .npy or .npz in the 21-joint order of KIT-ML or the 22-joint
/// order of HumanML3D, as files, folders, zips or JSONL manifests.
#[derive(Debug, Args)]
#[command(after_help = RULES)]
pub(super) struct RetargetArgs {
    /// Files, folders, zips or manifests
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// Folder for the motions, one file each; made if need be
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// How motions are written
    #[arg(long, value_enum, default_value_t = Form::Xml)]
    form: Form,
    /// Write the report of every clip to this file (JSON); replaces the file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Correspondence file (TOML) instead of recognising the skeleton by its joint names
    #[arg(long, value_name = "TOML")]
    skeleton: Option<PathBuf>,
    /// Frames per second where files do not say it
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Body mass in kilograms [default: 22.5 times the squared height]
    #[arg(long, value_name = "KG")]
    mass: Option<f64>,
    /// Retarget at most this many clips of each input, the first by id
    #[arg(long, value_name = "N", value_parser = number::count)]
    limit: Option<usize>,
    /// Replace motions that are there already
    #[arg(long)]
    overwrite: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Form {
    /// MMM XML as in KIT-ML
    Xml,
    /// frames x 50 as .npy; the rate is not in the file
    Npy,
}

impl Form {
    fn extension(self) -> &'static str {
        match self {
            Self::Xml => "xml",
            Self::Npy => "npy",
        }
    }

    fn bytes(self, motion: &Motion, name: &str) -> Vec<u8> {
        match self {
            Self::Xml => write_mmm(motion, name).into_bytes(),
            Self::Npy => npy(motion),
        }
    }
}

pub(super) fn run(args: &RetargetArgs) -> Result<Exit, Failure> {
    let skeleton = args.skeleton.as_deref().map(read_skeleton).transpose().or_usage()?;
    let options = OpenOptions { rate_hz: args.rate, mass_kg: args.mass, ..OpenOptions::default() };
    let mut datasets = Vec::new();
    for input in &args.inputs {
        let dataset = Dataset::open(input, &options).or_usage()?;
        datasets.push(match &skeleton {
            Some(skeleton) => dataset.with_skeleton(skeleton.clone()),
            None => dataset,
        });
    }
    let hints = [
        ("--rate", args.rate.is_some(), Unstated::Rate),
        ("--skeleton", args.skeleton.is_some(), Unstated::Skeleton),
    ];
    motions::check_hints(&hints, &Vec::from_iter(&datasets)).or_usage()?;
    let work: Vec<(&Dataset, &Entry)> = datasets
        .iter()
        .flat_map(|dataset| {
            let entries = dataset.entries().iter().take(args.limit.unwrap_or(usize::MAX));
            entries.map(move |entry| (dataset, entry))
        })
        .collect();
    let mut ids: Vec<&str> = work.iter().map(|(_, entry)| entry.id.as_str()).collect();
    ids.sort_unstable();
    if let Some([twice, _]) = ids.array_windows().find(|[first, second]| first == second) {
        return Err(anyhow!("write two motions named {twice:?}: give each input a folder of its own"))
            .or_usage();
    }
    std::fs::create_dir_all(&args.out)
        .with_context(|| format!("make the folder {}", args.out.display()))
        .or_failed()?;

    let steps = Steps::new(args.quiet, work.len());
    let outcomes: Result<Vec<Result<ClipRow, Skipped>>, io::Error> = work
        .par_iter()
        .map(|(dataset, entry)| {
            let outcome = one(dataset, entry, args)?;
            // The report tells what was skipped; without it, it is told at once.
            let skipped = outcome.as_ref().err().filter(|_| args.quiet).map(ToString::to_string);
            steps.step(&entry.id, skipped.as_deref());
            Ok(outcome)
        })
        .collect();
    steps.finish();
    if args.quiet {
        for input in datasets.iter().flat_map(Dataset::skipped) {
            eprintln!("skipped {input}");
        }
    }
    let outcomes = outcomes.or_failed()?;

    let mut report = Report::default();
    report.skipped.extend(datasets.iter().flat_map(|dataset| dataset.skipped().to_vec()));
    for outcome in outcomes {
        match outcome {
            Ok(row) => report.clips.push(row),
            Err(skipped) => report.skipped.push(skipped),
        }
    }
    if let Some(path) = &args.report {
        write_file(path, report.to_json().as_bytes()).or_failed()?;
    }
    if !args.quiet {
        output::print(&report.to_text()).or_failed()?;
    }
    Ok(Inputs { used: report.clips.len(), skipped: report.skipped.len() }.exit())
}

/// Retargets a clip and writes it.
///
/// # Errors
/// When the file cannot be written; a clip that cannot be used is skipped.
fn one(dataset: &Dataset, entry: &Entry, args: &RetargetArgs) -> io::Result<Result<ClipRow, Skipped>> {
    let skipped =
        |reason: String| Err(Skipped { id: entry.id.clone(), source: entry.source.clone(), reason });
    let retargeted = match dataset.retarget(entry) {
        Ok(Some(retargeted)) => retargeted,
        Ok(None) => {
            return Ok(skipped("it is a motion of the humanoid already; nothing to retarget".to_owned()));
        }
        Err(unusable) => return Ok(Err(unusable)),
    };
    let path = args.out.join(format!("{}.{}", entry.id, args.form.extension()));
    if path.exists() && !args.overwrite {
        return Ok(skipped(format!("{} is there already; --overwrite replaces it", path.display())));
    }
    write_file(&path, &args.form.bytes(&retargeted.motion, &entry.id))?;
    Ok(Ok(ClipRow::new(entry.id.clone(), retargeted)))
}

/// Reads a correspondence file.
pub(super) fn read_skeleton(path: &Path) -> anyhow::Result<Correspondence> {
    let place = || format!("read the skeleton {}", path.display());
    let bytes = std::fs::read(path).with_context(place)?;
    Correspondence::parse(&bytes).with_context(place)
}

/// `frames x 50` little-endian doubles in numpy's format, version 1.
pub(super) fn npy(motion: &Motion) -> Vec<u8> {
    const ALIGNMENT: usize = 64;
    let shape = format!("({}, {})", motion.num_frames(), crate::motion::NUM_CHANNELS);
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    // Ten bytes come before the header, and a line end closes it.
    let padding = (ALIGNMENT - (10 + header.len() + 1) % ALIGNMENT) % ALIGNMENT;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for frame in motion.frames() {
        for value in frame.to_channels() {
            bytes.extend(value.to_le_bytes());
        }
    }
    bytes
}
