//! `rprae view`: the commands that open recordings.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::output;
use crate::recording::view_commands;
use crate::report::shorten;

#[derive(Debug, Args)]
pub(super) struct ViewArgs {
    /// Run folder, or one recording
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
}

pub(super) fn run(args: &ViewArgs) -> Result<Exit, Failure> {
    let mut text = String::new();
    for view in view_commands(&args.run).or_usage()? {
        let caption = shorten(&view.caption, 80);
        let state = if view.complete { "" } else { " (incomplete)" };
        let _ = writeln!(text, "# {} {}{state}: {caption}\n{}", view.id, view.level, view.command);
    }
    output::print(&text).or_failed()?;
    Ok(Exit::Clean)
}
