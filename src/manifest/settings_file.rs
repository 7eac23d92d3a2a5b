//! Settings files: TOML, whatever they are settings of.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

/// Largest settings file read, bytes; people write some kilobytes.
const MAX_BYTES: u64 = 4 << 20;

/// Why a settings file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SettingsFileError {
    /// The file cannot be read.
    #[error("read the settings {}: {error}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// The file is not the settings it should be.
    #[error("read the settings {}: {error}", .path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// Place and reason.
        error: Box<toml::de::Error>,
    },
}

/// The text of a settings file, which may be read in more than one way.
#[derive(Debug)]
pub struct SettingsFile {
    path: PathBuf,
    text: String,
}

impl SettingsFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`SettingsFileError::Io`], also for a file of more than 4 MiB or one that is not UTF-8.
    pub fn open(path: &Path) -> Result<Self, SettingsFileError> {
        let read = || {
            let mut text = String::new();
            File::open(path)?.take(MAX_BYTES + 1).read_to_string(&mut text)?;
            if text.len() as u64 > MAX_BYTES {
                return Err(io::Error::other(format!("it has more than {} MiB", MAX_BYTES >> 20)));
            }
            Ok(text)
        };
        let text = read().map_err(|error| SettingsFileError::Io { path: path.to_owned(), error })?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// The settings in it.
    ///
    /// # Errors
    /// [`SettingsFileError::Toml`] names the place and the reason.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, SettingsFileError> {
        toml::from_str(&self.text).map_err(|error| self.fault(error))
    }

    /// What is wrong with the file.
    #[must_use]
    pub fn fault(&self, error: toml::de::Error) -> SettingsFileError {
        SettingsFileError::Toml { path: self.path.clone(), error: Box::new(error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.toml");
        let read = || SettingsFile::open(&path).and_then(|file| file.parse::<toml::Table>());
        assert!(read().unwrap_err().to_string().contains("run.toml"));
        std::fs::write(&path, "seed = 3\n").unwrap();
        assert_eq!(read().unwrap()["seed"].as_integer(), Some(3));
        std::fs::write(&path, "seed = 3\nlimit = \n").unwrap();
        let message = read().unwrap_err().to_string();
        assert!(message.contains("run.toml") && message.contains("line 2"), "{message}");
        std::fs::write(&path, b"\xff").unwrap();
        assert!(read().unwrap_err().to_string().contains("UTF-8"));
        std::fs::write(&path, " ".repeat(MAX_BYTES as usize + 1)).unwrap();
        assert!(read().unwrap_err().to_string().contains("4 MiB"));
    }
}
