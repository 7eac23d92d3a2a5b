//! `rprae urdf`: the humanoid as a file for other programs.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::output;
use crate::humanoid::Humanoid;
use crate::manifest::write_file;
use crate::motion::{Body, Frame, Motion};

#[derive(Debug, Args)]
pub(super) struct UrdfArgs {
    /// Body height in metres
    #[arg(long, value_name = "METRES", default_value_t = 1.75)]
    pub height: f64,
    /// Body mass in kilograms [default: 22.5 times the squared height]
    #[arg(long, value_name = "KG")]
    pub mass: Option<f64>,
    /// File to write, with its folders; standard output when absent
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Replace the file that is there
    #[arg(long, requires = "out")]
    pub overwrite: bool,
}

pub(super) fn run(args: &UrdfArgs) -> Result<Exit, Failure> {
    if let Some(path) = &args.out {
        output::check_free(path, args.overwrite).or_usage()?;
    }
    let mut body = Body::with_default_mass(args.height);
    body.mass_kg = args.mass.unwrap_or(body.mass_kg);
    // A motion checks its body; one frame is enough.
    Motion::new(body, 1.0, vec![Frame::ZERO]).context("make the humanoid").or_usage()?;
    let humanoid = Humanoid::new(body).context("make the humanoid").or_failed()?;
    match &args.out {
        Some(path) => write_file(path, humanoid.urdf.as_bytes()).or_failed()?,
        None => output::print(&humanoid.urdf).or_failed()?,
    }
    Ok(Exit::Clean)
}
