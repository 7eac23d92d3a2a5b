//! `rprae doctor`: whether this machine and build can be trusted.

mod device;
mod physics;

use clap::Args;

use super::exit::{Exit, Failure};

#[derive(Debug, Args)]
pub(super) struct DoctorArgs {
    /// Show versions, threads, memory and graphics adapters, and compare what they compute with the processor
    #[arg(long)]
    pub device: bool,
    /// Check the physics engine against closed forms: weight at rest, a throw, a pendulum, a joint limit, the ground
    #[arg(long)]
    pub physics: bool,
    #[command(flatten)]
    pub simulation: physics::PhysicsArgs,
}

/// Runs the examinations asked for, or all of them when none is.
pub(super) fn run(args: &DoctorArgs) -> Result<Exit, Failure> {
    let all = !args.device && !args.physics;
    let mut exit = Exit::Clean;
    if args.device || all {
        exit = device::run()?;
    }
    if args.physics || all {
        let physics = physics::run(&args.simulation)?;
        if exit == Exit::Clean {
            exit = physics;
        }
    }
    Ok(exit)
}
