//! `rprae view`: the commands that open recordings, or with the feature `rerun` the recordings themselves.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::exit::{Exit, Failure, OrExit};
use super::output;
use crate::recording::{ViewCommand, view_commands};
use crate::report::shorten;

#[derive(Debug, Args)]
pub(super) struct ViewArgs {
    /// Run folder, or one recording
    #[arg(value_name = "RUN")]
    pub run: PathBuf,

    /// Open the recordings in a rerun viewer, laid out for rollouts
    #[cfg(feature = "rerun")]
    #[arg(long)]
    pub open: bool,

    /// Save each recording as ID.LEVEL.rrd in this folder, layout included
    #[cfg(feature = "rerun")]
    #[arg(long, value_name = "DIR")]
    pub save: Option<PathBuf>,
}

pub(super) fn run(args: &ViewArgs) -> Result<Exit, Failure> {
    let views = view_commands(&args.run).or_usage()?;
    let mut text = String::new();
    for view in &views {
        let caption = shorten(&view.caption, 80);
        let state = if view.complete { "" } else { " (incomplete)" };
        let _ = writeln!(text, "# {} {}{state}: {caption}\n{}", view.id, view.level, view.command);
    }
    output::print(&text).or_failed()?;
    show(args, &views)?;
    Ok(Exit::Clean)
}

#[cfg(feature = "rerun")]
fn show(args: &ViewArgs, views: &[ViewCommand]) -> Result<(), Failure> {
    use crate::recording::{RerunTarget, rerun_view};

    for view in views {
        if args.open {
            rerun_view(view, &RerunTarget::Viewer).or_failed()?;
        }
        if let Some(folder) = &args.save {
            std::fs::create_dir_all(folder).or_failed()?;
            let file = folder.join(format!("{}.{}.rrd", view.id, view.level));
            rerun_view(view, &RerunTarget::File(file)).or_failed()?;
        }
    }
    Ok(())
}

/// Without the feature there is nothing to show: the commands were printed.
#[cfg(not(feature = "rerun"))]
#[expect(clippy::unnecessary_wraps, reason = "fails with the feature `rerun`")]
fn show(_args: &ViewArgs, _views: &[ViewCommand]) -> Result<(), Failure> {
    Ok(())
}
