//! A peer program that answers line by line, so that two programs can take turns in one run.

use std::error::Error;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

/// A running peer, which ends with its input.
pub struct Peer {
    process: Child,
    replies: BufReader<ChildStdout>,
}

/// A script of `benches/peers`, to be run by `$RPRAE_PEER_PYTHON` (default `python3`); what it says on standard error is
/// not shown.
pub fn script(name: &str) -> Command {
    let python = std::env::var_os("RPRAE_PEER_PYTHON").unwrap_or_else(|| "python3".into());
    let mut command = Command::new(python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers").join(name)).stderr(Stdio::null());
    command
}

impl Peer {
    /// Starts a peer, and gives the line it prints when it is ready.
    pub fn start(command: &mut Command) -> Result<(Self, String), Box<dyn Error>> {
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let replies = BufReader::new(process.stdout.take().ok_or("the peer has no output")?);
        let mut peer = Self { process, replies };
        let ready = peer.reply()?;
        Ok((peer, ready))
    }

    /// Sends a line, and gives the one it answers.
    pub fn ask(&mut self, request: &str) -> Result<String, Box<dyn Error>> {
        writeln!(self.process.stdin.as_mut().ok_or("the peer has no input")?, "{request}")?;
        self.reply()
    }

    fn reply(&mut self) -> Result<String, Box<dyn Error>> {
        let mut line = String::new();
        if self.replies.read_line(&mut line)? == 0 {
            return Err(
                "the peer stopped; does it have the packages of benches/peers/requirements.txt?".into()
            );
        }
        Ok(line)
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The peer ends with its input; if it is gone already there is nothing to wait for.
        drop(self.process.stdin.take());
        let _ = self.process.wait();
    }
}

/// The middle value, after sorting; not a number where there is none.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
