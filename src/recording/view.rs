//! How to look at recordings: the command to type for each.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::read::{LinearReader, Options};
use mcap::records::Record;

use super::RecordingError;
use super::recorder::ROLLOUT_METADATA;

/// Deepest folder below a results folder that is searched.
const MAX_DEPTH: usize = 8;
/// The record that says what a recording holds lies within this many bytes of its start.
const BEGINNING_BYTES: u64 = 256 << 10;

/// A recording and the command that shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ViewCommand {
    /// The recording.
    pub recording: PathBuf,
    /// Identity of the motion; the file's name when the recording does not say.
    pub id: String,
    /// Level of the simulation, `L2` or `L3`; empty when the recording does not say.
    pub level: String,
    /// First caption of the motion; empty when there is none.
    pub caption: String,
    /// Whether the recording was closed; one of a killed process was not and has to be recovered first.
    pub complete: bool,
    /// What to type in a POSIX shell.
    pub command: String,
}

/// The commands for a recording, or for all recordings below a results folder, sorted by path.
///
/// # Errors
/// [`RecordingError::Read`] when something cannot be read, [`RecordingError::NotARecording`] when a file is no MCAP,
/// [`RecordingError::NoRecordings`] when there is none in the folder.
pub fn view_commands(path: &Path) -> Result<Vec<ViewCommand>, RecordingError> {
    let failed = |source| RecordingError::Read { path: path.to_owned(), source };
    if fs::metadata(path).map_err(failed)?.is_file() {
        return Ok(vec![view_command(path)?]);
    }
    let mut recordings = Vec::new();
    find_recordings(path, MAX_DEPTH, &mut recordings)?;
    if recordings.is_empty() {
        return Err(RecordingError::NoRecordings { path: path.to_owned() });
    }
    recordings.sort();
    recordings.iter().map(|recording| view_command(recording)).collect()
}

fn find_recordings(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), RecordingError> {
    let failed = |source| RecordingError::Read { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        // The type of the entry itself: a link to a folder is not followed, so there are no cycles.
        let kind = entry.file_type().map_err(failed)?;
        let path = entry.path();
        if kind.is_dir() && depth > 0 {
            find_recordings(&path, depth - 1, found)?;
        } else if !kind.is_dir() && path.extension().is_some_and(|extension| extension == "mcap") {
            found.push(path);
        }
    }
    Ok(())
}

fn view_command(recording: &Path) -> Result<ViewCommand, RecordingError> {
    let (beginning, complete) =
        read_ends(recording).map_err(|source| RecordingError::Read { path: recording.to_owned(), source })?;
    if !beginning.starts_with(mcap::MAGIC) {
        return Err(RecordingError::NotARecording { path: recording.to_owned() });
    }
    let mut command = ViewCommand {
        recording: recording.to_owned(),
        id: recording.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        level: String::new(),
        caption: String::new(),
        complete,
        command: shell_command(recording, complete),
    };
    let records = LinearReader::new_with_options(&beginning, Options::IgnoreEndMagic.into());
    for record in records.into_iter().flatten().map_while(Result::ok) {
        if let Record::Metadata(mut record) = record
            && record.name == ROLLOUT_METADATA
        {
            let mut take = |key: &str| record.metadata.remove(key).unwrap_or_default();
            command.id = take("id");
            command.level = take("level");
            command.caption = take("caption_00");
            break;
        }
    }
    Ok(command)
}

/// The beginning of a file, and whether it ends as a closed MCAP file does.
fn read_ends(path: &Path) -> std::io::Result<(Vec<u8>, bool)> {
    let mut file = File::open(path)?;
    let mut beginning = Vec::new();
    file.by_ref().take(BEGINNING_BYTES).read_to_end(&mut beginning)?;
    let len = file.seek(SeekFrom::End(0))?;
    let mut end = Vec::new();
    // Twice the magic bytes is the least a closed file has: they open it and close it.
    let magic_bytes = mcap::MAGIC.len() as u64;
    if len >= 2 * magic_bytes {
        file.seek(SeekFrom::Start(len - magic_bytes))?;
        file.read_to_end(&mut end)?;
    }
    Ok((beginning, end == mcap::MAGIC))
}

fn shell_command(recording: &Path, complete: bool) -> String {
    let path = shell_word(recording);
    if complete {
        return format!("rerun {path}");
    }
    let recovered = shell_word(&recording.with_extension("rrd"));
    format!("rerun mcap convert --recover {path} -o {recovered} && rerun {recovered}")
}

/// The path as one word of a POSIX shell, and never as an option.
fn shell_word(path: &Path) -> String {
    let text = path.to_string_lossy();
    let text = if text.starts_with('-') { format!("./{text}") } else { text.into_owned() };
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:@%,".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_single_words() {
        let words = [
            ("results/a_1/x.mcap", "results/a_1/x.mcap"),
            ("my run/x.mcap", "'my run/x.mcap'"),
            ("it's.mcap", r"'it'\''s.mcap'"),
            ("-o.mcap", "./-o.mcap"),
            ("$HOME.mcap", "'$HOME.mcap'"),
        ];
        for (path, expected) in words {
            assert_eq!(shell_word(Path::new(path)), expected);
        }
    }

    #[test]
    fn an_open_recording_is_recovered_first() {
        let command = shell_command(Path::new("a b.mcap"), false);
        assert_eq!(command, "rerun mcap convert --recover 'a b.mcap' -o 'a b.rrd' && rerun 'a b.rrd'");
    }
}
