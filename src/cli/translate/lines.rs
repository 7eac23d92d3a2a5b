//! One sentence, or one motion file, a line.

use std::io::{self, BufRead as _, IsTerminal as _, Read as _, Write as _};
use std::path::Path;

use anyhow::Context as _;

use super::act::{ActedRecord, Actor};
use super::describe::DescribedRecord;
use super::{Session, open};
use crate::cli::exit::{Exit, Failure, OrExit};

/// Longest line that is read, bytes.
const MAX_LINE_BYTES: u64 = 10_000;

const GREETING: &str =
    "A sentence becomes a motion; the name of a motion file becomes a sentence. Ctrl-D ends.\n";

/// Translates line by line until the input ends; a line that cannot be translated is told and counted.
pub(super) fn run(session: &mut Session<'_>) -> Result<Exit, Failure> {
    let watched = io::stdin().is_terminal() && !session.args.quiet;
    if watched {
        eprint!("{GREETING}");
    }
    let mut input = io::stdin().lock();
    let mut failed = 0;
    loop {
        if watched {
            eprint!("> ");
            // A prompt that cannot be shown is no reason to stop.
            let _ = io::stderr().flush();
        }
        let mut line = Vec::new();
        let read = input.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line);
        let length = read.context("read standard input").or_failed()?;
        if length == 0 {
            break;
        }
        let line = String::from_utf8_lossy(&line).trim().to_owned();
        if line.is_empty() {
            continue;
        }
        if let Err(error) = one(session, &line) {
            eprintln!("failed to {error:#}");
            failed += 1;
        }
    }
    Ok(if failed > 0 { Exit::Skipped } else { Exit::Clean })
}

fn one(session: &mut Session<'_>, line: &str) -> anyhow::Result<()> {
    let path = Path::new(line);
    if path.is_file() || path.is_dir() {
        let dataset = open(session.args, path)?;
        for entry in dataset.entries() {
            let sample = dataset.load(entry).map_err(|skipped| anyhow::anyhow!(skipped.reason))?;
            let record = DescribedRecord::new(session, sample)?;
            session.print(&record, DescribedRecord::text).map_err(|failure| failure.error)?;
        }
        return Ok(());
    }
    session.look_up([line])?;
    let actor = Actor::new(session)?;
    let record = actor.finish(actor.act(None, line)?, &[])?;
    session.print(&record, ActedRecord::text).map_err(|failure| failure.error)
}
