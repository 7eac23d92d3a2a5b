//! One sentence, or one motion file, a line.

use std::io::{self, BufRead, IsTerminal as _, Read as _, Write as _};
use std::path::Path;

use anyhow::Context as _;

use super::act::ActedRecord;
use super::describe::DescribedRecord;
use super::{Session, open};
use crate::cli::exit::{Exit, Failure, Inputs, OrExit, message};
use crate::cli::progress::Steps;

/// Longest line that is read, bytes.
const MAX_LINE_BYTES: usize = 10_000;

const GREETING: &str =
    "A sentence becomes a motion; the name of a motion file becomes a sentence. Ctrl-D ends.\n";

/// What was read of the input.
#[derive(Debug, PartialEq, Eq)]
enum Line {
    /// A line, without the space around it.
    Text(String),
    /// A line that is longer than any sentence; none of it is used.
    TooLong,
    /// There is no more.
    End,
}

/// What came of the lines.
#[derive(Default)]
struct Tally {
    inputs: Inputs,
    /// Rollouts that ended before their time.
    num_failed: usize,
}

impl Tally {
    fn skip(&mut self, reason: &str) {
        eprintln!("failed to {reason}");
        self.inputs.skipped += 1;
    }

    fn exit(&self) -> Exit {
        self.inputs.exit().or_worse(if self.num_failed > 0 { Exit::Failed } else { Exit::Clean })
    }
}

/// Translates line by line until the input ends; a line that cannot be translated is told and counted.
pub(super) fn run(session: &mut Session<'_>) -> Result<Exit, Failure> {
    let watched = io::stdin().is_terminal() && !session.args.quiet;
    if watched {
        eprint!("{GREETING}");
    }
    let mut input = io::stdin().lock();
    let mut tally = Tally::default();
    loop {
        if watched {
            eprint!("> ");
            // A prompt that cannot be shown is no reason to stop.
            let _ = io::stderr().flush();
        }
        match next_line(&mut input).context("read standard input").or_failed()? {
            Line::End => break,
            Line::TooLong => {
                tally
                    .skip(&format!("read a line of more than {MAX_LINE_BYTES} bytes; all of it is left out"));
            }
            Line::Text(line) if line.is_empty() => {}
            Line::Text(line) => one(session, &line, &mut tally)?,
        }
    }
    Ok(tally.exit())
}

/// The next line, of which never more than the limit is held.
fn next_line(input: &mut impl BufRead) -> io::Result<Line> {
    let mut line = Vec::new();
    input.by_ref().take(MAX_LINE_BYTES as u64 + 1).read_until(b'\n', &mut line)?;
    if line.is_empty() {
        return Ok(Line::End);
    }
    if line.len() > MAX_LINE_BYTES && !line.ends_with(b"\n") {
        skip_line(input)?;
        return Ok(Line::TooLong);
    }
    Ok(Line::Text(String::from_utf8_lossy(&line).trim().to_owned()))
}

/// Drops the rest of a line, piece by piece.
fn skip_line(input: &mut impl BufRead) -> io::Result<()> {
    loop {
        let piece = input.fill_buf()?;
        if piece.is_empty() {
            return Ok(());
        }
        let end = piece.iter().position(|&byte| byte == b'\n');
        let taken = end.map_or(piece.len(), |end| end + 1);
        input.consume(taken);
        if end.is_some() {
            return Ok(());
        }
    }
}

/// Translates a line, which is the name of a file or folder of motions, or a sentence.
fn one(session: &mut Session<'_>, line: &str, tally: &mut Tally) -> Result<(), Failure> {
    let path = Path::new(line);
    if path.is_file() || path.is_dir() {
        match open(session.args, path) {
            Ok(dataset) => {
                let steps = Steps::new(true, dataset.entries().len());
                let told = |record| session.print(&record, DescribedRecord::text);
                let Inputs { used, skipped } = session.describe_each(&dataset, &steps, told)?;
                tally.inputs.used += used;
                tally.inputs.skipped += skipped;
            }
            Err(error) => tally.skip(&message(&error)),
        }
        return Ok(());
    }
    match acted(session, line) {
        Ok(record) => {
            session.print(&record, ActedRecord::text)?;
            tally.inputs.used += 1;
            tally.num_failed += usize::from(record.has_failed());
        }
        Err(error) => tally.skip(&message(&error)),
    }
    Ok(())
}

fn acted(session: &mut Session<'_>, sentence: &str) -> anyhow::Result<ActedRecord> {
    if let Some(vectors) = &mut session.vectors {
        vectors.look_up_line(&mut session.translator, sentence)?;
    }
    Ok(session.finish(session.act(None, sentence)?, &[])?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_rollout_fails_the_lines() {
        let inputs = Inputs { used: 3, skipped: 0 };
        assert_eq!(Tally { inputs, num_failed: 0 }.exit(), Exit::Clean);
        assert_eq!(Tally { inputs, num_failed: 1 }.exit(), Exit::Failed);
        assert_eq!(Tally { inputs: Inputs { skipped: 1, ..inputs }, num_failed: 1 }.exit(), Exit::Failed);
    }

    #[test]
    fn a_line_that_is_too_long_is_left_out_whole() {
        let long = "walks ".repeat(2 * MAX_LINE_BYTES / 6);
        let text = format!("a person waves\n{long}\n  \na person {}\nlast", "x".repeat(MAX_LINE_BYTES - 9));
        // Pieces far smaller than the lines.
        let mut input = io::BufReader::with_capacity(64, text.as_bytes());
        let mut lines = Vec::new();
        loop {
            match next_line(&mut input).unwrap() {
                Line::End => break,
                line => lines.push(line),
            }
        }
        let text = |text: &str| Line::Text(text.to_owned());
        assert_eq!(lines.len(), 5);
        assert_eq!((&lines[0], &lines[1]), (&text("a person waves"), &Line::TooLong));
        assert_eq!((&lines[2], &lines[4]), (&text(""), &text("last")));
        assert!(matches!(&lines[3], Line::Text(line) if line.len() == MAX_LINE_BYTES));
        assert_eq!(next_line(&mut &b""[..]).unwrap(), Line::End);
    }
}
