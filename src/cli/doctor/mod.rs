//! `rprae doctor`: whether this machine and build can be trusted.

mod physics;

use clap::Args;

use super::exit::{Exit, Failure};

#[derive(Debug, Args)]
pub(super) struct DoctorArgs {
    /// Check the physics engine against closed forms: weight at rest, a throw, a pendulum, a joint limit, the ground
    #[arg(long)]
    pub physics: bool,
    #[command(flatten)]
    pub simulation: physics::PhysicsArgs,
}

pub(super) fn run(args: &DoctorArgs) -> Result<Exit, Failure> {
    // The only examination there is, so asking for none asks for it.
    physics::run(&args.simulation)
}
