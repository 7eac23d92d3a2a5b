//! One sentence, or one motion file, a line.

use std::io::{self, BufRead, IsTerminal as _, Read as _, Write as _};
use std::path::Path;

use anyhow::Context as _;

use super::act::{ActedRecord, Actor};
use super::describe::DescribedRecord;
use super::{Session, open};
use crate::cli::exit::{Exit, Failure, OrExit};

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
        match next_line(&mut input).context("read standard input").or_failed()? {
            Line::End => break,
            Line::TooLong => {
                eprintln!("failed to read a line of more than {MAX_LINE_BYTES} bytes; all of it is left out");
                failed += 1;
            }
            Line::Text(line) if line.is_empty() => {}
            Line::Text(line) => match one(session, &line) {
                Ok(skipped) => failed += skipped,
                Err(error) => {
                    eprintln!("failed to {error:#}");
                    failed += 1;
                }
            },
        }
    }
    Ok(if failed > 0 { Exit::Skipped } else { Exit::Clean })
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

/// Translates a line; the number of motions of a folder that were skipped.
fn one(session: &mut Session<'_>, line: &str) -> anyhow::Result<usize> {
    let path = Path::new(line);
    if path.is_file() || path.is_dir() {
        let dataset = open(session.args, path)?;
        let mut skipped = dataset.skipped().len();
        for input in dataset.skipped() {
            eprintln!("skipped {}: {}", input.id, input.reason);
        }
        for entry in dataset.entries() {
            let record = dataset
                .load(entry)
                .map_err(|skipped| skipped.reason)
                .and_then(|sample| DescribedRecord::new(session, sample).map_err(|error| error.to_string()));
            match record {
                Ok(record) => {
                    session.print(&record, DescribedRecord::text).map_err(|failure| failure.error)?;
                }
                Err(reason) => {
                    eprintln!("skipped {}: {reason}", entry.id);
                    skipped += 1;
                }
            }
        }
        return Ok(skipped);
    }
    if let Some(vectors) = &mut session.vectors {
        vectors.look_up_line(&mut session.translator, line)?;
    }
    let actor = Actor::new(session)?;
    let record = actor.finish(actor.act(None, line)?, &[])?;
    session.print(&record, ActedRecord::text).map_err(|failure| failure.error)?;
    Ok(0)
}

#[cfg(test)]
mod tests {
    use super::*;

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
