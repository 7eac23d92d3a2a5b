//! Standard output, files that are not replaced, and how to call this program again.

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

use anyhow::bail;

/// Widest table on a terminal that does not say how wide it is, and in a file.
const DEFAULT_WIDTH: usize = 160;

/// Writes to standard output; a reader that has left, as `head` does, is not an error.
pub(super) fn print(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(io::Error::new(error.kind(), format!("write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// Refuses a file that is there already, unless it may be replaced: the rule of every `--out`.
///
/// Reports for other programs (`--json`, `--junit`, `--markdown`, `--report`) are replaced, as their help says: a gate writes them
/// to the same place each time.
pub(super) fn check_free(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    if path.exists() && !overwrite {
        bail!(
            "write {}: it is there already; choose another --out, or replace it with --overwrite",
            path.display()
        );
    }
    Ok(())
}

/// Width for tables on standard output.
pub(super) fn table_width() -> usize {
    console::Term::stdout().size_checked().map_or(DEFAULT_WIDTH, |(_, columns)| usize::from(columns))
}

/// The words of a `rprae` call as one line that a person can paste.
///
/// Under `cargo run` the program is not on the path, and the line goes through cargo too.
pub(super) fn rprae_command(words: &[&OsStr]) -> String {
    let through_cargo = std::env::var_os("CARGO").is_some();
    let start = if through_cargo { "cargo run --bin rprae --" } else { "rprae" };
    let quoted: Vec<String> = words.iter().map(|word| quote(&word.to_string_lossy())).collect();
    format!("{start} {}", quoted.join(" "))
}

/// A word as a POSIX shell reads it back.
fn quote(word: &str) -> String {
    let is_plain = |symbol: char| symbol.is_ascii_alphanumeric() || "-_./=:,+@%".contains(symbol);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_the_shell() {
        assert_eq!(quote("results/bundled-001"), "results/bundled-001");
        assert_eq!(quote("my results"), "'my results'");
        assert_eq!(quote("it's"), "'it'\\''s'");
        assert_eq!(quote(""), "''");
    }
}
