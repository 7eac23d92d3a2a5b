//! Files that are whole or absent, whatever happens while they are written.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// Writes a file so that a reader, or a crash, never sees half of it.
///
/// The bytes go to a hidden file beside it, reach the disk, and then take the name in one step.
/// Missing folders are made. Two writers of the same path must not run at once.
///
/// # Errors
/// Any error of the file system; the message names the path.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_steps(path, bytes)
        .map_err(|error| io::Error::new(error.kind(), format!("write {}: {error}", path.display())))
}

fn write_steps(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::other("the path ends in no file name"))?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder)?;
    let mut part_name = std::ffi::OsString::from(".");
    part_name.push(name);
    part_name.push(".part");
    let part = folder.join(part_name);

    let mut file = File::create(&part)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    drop(file);
    if let Err(error) = written.and_then(|()| fs::rename(&part, path)) {
        // The first error is the one to report; a leftover part is overwritten by the next attempt.
        let _ = fs::remove_file(&part);
        return Err(error);
    }
    // The new name lives in the folder, which must reach the disk too. Not every system can sync a folder.
    if cfg!(unix) {
        File::open(folder)?.sync_all()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_a_file_and_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deeper").join("result.json");
        write_file(&path, b"first").unwrap();
        write_file(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn names_the_path_it_cannot_write() {
        let folder = tempfile::tempdir().unwrap();
        let blocked = folder.path().join("file");
        write_file(&blocked, b"").unwrap();
        let error = write_file(&blocked.join("below"), b"").unwrap_err();
        assert!(error.to_string().contains("below"), "{error}");
    }
}
