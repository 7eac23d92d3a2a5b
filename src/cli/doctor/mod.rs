//! `rprae doctor`: whether this machine and build can be trusted.

mod device;

use clap::Args;

use super::exit::{Exit, Failure};

#[derive(Debug, Args)]
pub(super) struct DoctorArgs {
    /// Show versions, threads, memory and graphics adapters, and compare what they compute with the processor
    #[arg(long)]
    pub device: bool,
}

pub(super) fn run(_: &DoctorArgs) -> Result<Exit, Failure> {
    device::run()
}
