//! The folder of a run: one place for all its files, never overwritten by another run.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::settings::SettingsProblem;
use super::{RunSettings, initial_manifest};
use crate::manifest::{Manifest, seal, sha256_hex, unseal, write_file};
use crate::report::CaseResult;
use crate::simulation::Level;

const SETTINGS_FILE: &str = "settings.toml";
const MANIFEST_FILE: &str = "manifest.json";
const LOCK_FILE: &str = ".lock";
const CASES: &str = "cases";
const RECORDINGS: &str = "recordings";
/// Everything a run writes at the top of its folder.
pub(super) const FILES: [&str; 8] = [
    SETTINGS_FILE,
    MANIFEST_FILE,
    "results.json",
    "samples.jsonl",
    "scores.csv",
    "report.md",
    "report.html",
    "timings.json",
];

/// Why a folder cannot take a run.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The file system refuses.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The settings cannot be saved.
    #[error(transparent)]
    Settings(#[from] SettingsProblem),
    /// The folder holds something else.
    #[error("use {path} for results: it is not empty and holds no run; choose another --out")]
    Foreign {
        /// The folder.
        path: PathBuf,
    },
    /// The folder holds a run with other settings or by another program.
    #[error(
        "continue the run in {path}: {difference}; choose another --out, or replace the run with --overwrite"
    )]
    OtherRun {
        /// The folder.
        path: PathBuf,
        /// What differs.
        difference: String,
    },
    /// Another process writes into the folder.
    #[error("use {path} for results: another process is writing there")]
    Locked {
        /// The folder.
        path: PathBuf,
    },
}

/// An open run folder; only one process has it at a time.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// Held, not read: the lock ends with it.
    _lock: File,
}

impl RunFolder {
    /// Opens `path` for a run with these settings and saves them there first.
    ///
    /// A missing or empty folder is new. A folder with a run of the same settings by the same program is continued.
    /// Any other run is replaced when `overwrite` says so, and refused otherwise; other content is always refused.
    ///
    /// # Errors
    /// [`FolderError`] names the folder and what to do.
    pub fn open(
        path: &Path,
        settings: &RunSettings,
        dataset: &str,
        overwrite: bool,
    ) -> Result<Self, FolderError> {
        fs::create_dir_all(path).map_err(|error| named(path, &error))?;
        let is_run = path.join(SETTINGS_FILE).is_file();
        let is_empty = fs::read_dir(path).map_err(|error| named(path, &error))?.all(|entry| {
            // A lock without settings is left by a run that was stopped before it began.
            entry.is_ok_and(|entry| entry.file_name() == LOCK_FILE)
        });
        if !is_run && !is_empty {
            return Err(FolderError::Foreign { path: path.to_owned() });
        }
        let lock_path = path.join(LOCK_FILE);
        let lock = File::create(&lock_path).map_err(|error| named(&lock_path, &error))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(fs::TryLockError::WouldBlock) => return Err(FolderError::Locked { path: path.to_owned() }),
            Err(fs::TryLockError::Error(error)) => return Err(named(&lock_path, &error).into()),
        }

        let settings_text = settings.to_toml()?;
        let manifest = initial_manifest(settings, dataset);
        if is_run && overwrite {
            remove_run(path)?;
        } else if is_run && let Some(difference) = difference(path, settings, &manifest) {
            return Err(FolderError::OtherRun { path: path.to_owned(), difference });
        }
        let folder = Self { path: path.to_owned(), _lock: lock };
        fs::create_dir_all(path.join(CASES)).map_err(|error| named(path, &error))?;
        if settings.recordings && settings.levels.iter().any(|level| *level > Level::L1) {
            fs::create_dir_all(path.join(RECORDINGS)).map_err(|error| named(path, &error))?;
        }
        folder.write_json(MANIFEST_FILE, &manifest)?;
        folder.write(SETTINGS_FILE, settings_text.as_bytes())?;
        Ok(folder)
    }

    /// Opens a new folder below `parent`, called `name` and the first free number: `walks-001`.
    ///
    /// # Errors
    /// As [`RunFolder::open`].
    pub fn create_next(
        parent: &Path,
        name: &str,
        settings: &RunSettings,
        dataset: &str,
    ) -> Result<Self, FolderError> {
        fs::create_dir_all(parent).map_err(|error| named(parent, &error))?;
        let stem = file_stem(name);
        for number in 1_u32.. {
            let path = parent.join(format!("{stem}-{number:03}"));
            // Whoever makes the folder owns it, so two runs started together get two folders.
            match fs::create_dir(&path) {
                Ok(()) => return Self::open(&path, settings, dataset, false),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(named(&path, &error).into()),
            }
        }
        Err(io::Error::other("there are 4294967295 runs already").into())
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of a recording inside the folder, with a forward slash.
    #[must_use]
    pub fn recording(id: &str, level: Level) -> String {
        format!("{RECORDINGS}/{}.{level}.mcap", file_stem(id))
    }

    fn case_path(&self, id: &str) -> PathBuf {
        self.path.join(CASES).join(format!("{}.json", file_stem(id)))
    }

    /// The finished result of a case; `None` when there is none that can be trusted.
    #[must_use]
    pub fn read_case(&self, id: &str) -> Option<CaseResult> {
        let text = fs::read_to_string(self.case_path(id)).ok()?;
        unseal::<CaseResult>(&text).ok().filter(|case| case.id == id)
    }

    /// Saves a finished case; from here on no crash loses it.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write_case(&self, case: &CaseResult) -> io::Result<()> {
        write_file(&self.case_path(&case.id), seal(case)?.as_bytes())
    }

    /// Writes a file at the top of the folder, whole or not at all.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        write_file(&self.path.join(name), bytes)
    }

    /// Writes a value as indented JSON.
    ///
    /// # Errors
    /// Any error of the file system.
    pub fn write_json<T: serde::Serialize>(&self, name: &str, value: &T) -> io::Result<()> {
        let mut text = serde_json::to_string_pretty(value)?;
        text.push('\n');
        self.write(name, text.as_bytes())
    }
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("use {} for results: {error}", path.display()))
}

/// What keeps the run in a folder from being continued; `None` when nothing does.
fn difference(path: &Path, settings: &RunSettings, manifest: &Manifest) -> Option<String> {
    let saved = RunSettings::read(&path.join(SETTINGS_FILE)).ok();
    // Models and vectors may have moved; their checksums are compared.
    if saved.map(RunSettings::without_places) != Some(settings.clone().without_places()) {
        return Some("it was started with other settings".to_owned());
    }
    let saved: Option<Manifest> =
        fs::read_to_string(path.join(MANIFEST_FILE)).ok().and_then(|text| serde_json::from_str(&text).ok());
    let Some(saved) = saved else {
        return Some("its manifest cannot be read".to_owned());
    };
    let differences = manifest.key.differences(&saved.key);
    if !differences.is_empty() {
        return Some(differences.join("; "));
    }
    (saved.program_sha256 != manifest.program_sha256)
        .then(|| "it was started by another build of this program".to_owned())
}

/// Removes what a run writes, and nothing else.
fn remove_run(path: &Path) -> io::Result<()> {
    for folder in [CASES, RECORDINGS] {
        match fs::remove_dir_all(path.join(folder)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(named(path, &error)),
            _ => {}
        }
    }
    for file in FILES {
        match fs::remove_file(path.join(file)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(named(path, &error)),
            _ => {}
        }
    }
    Ok(())
}

/// A file name for an id: letters, digits, `-`, `_` and inner dots stay, other bytes become `%XX`.
///
/// An id comes from a file and may hold anything, a path out of the folder included.
/// Different ids get different names; very long ones are cut and told apart by their checksum.
fn file_stem(id: &str) -> String {
    const LONGEST: usize = 120;
    let mut stem = String::new();
    for byte in id.bytes() {
        let plain = byte.is_ascii_alphanumeric()
            || byte == b'-'
            || byte == b'_'
            || (byte == b'.' && !stem.is_empty());
        if plain {
            stem.push(char::from(byte));
        } else {
            let _ = write!(stem, "%{byte:02X}");
        }
    }
    if stem.len() > LONGEST {
        let digest = sha256_hex(id.as_bytes());
        stem.truncate(LONGEST - 17);
        stem = format!("{stem}-{}", &digest[..16]);
    }
    if stem.is_empty() { "%".to_owned() } else { stem }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(path: &Path, settings: &RunSettings, overwrite: bool) -> Result<RunFolder, FolderError> {
        RunFolder::open(path, settings, "test", overwrite)
    }

    #[test]
    fn ids_become_harmless_names() {
        for (id, stem) in [
            ("00001", "00001"),
            ("../../etc/passwd", "%2E.%2F..%2Fetc%2Fpasswd"),
            ("a b", "a%20b"),
            (".hidden", "%2Ehidden"),
            ("50%", "50%25"),
            ("", "%"),
            ("歩", "%E6%AD%A9"),
        ] {
            assert_eq!(file_stem(id), stem);
        }
        let (a, b) = (file_stem(&"a".repeat(500)), file_stem(&"a".repeat(501)));
        assert!(a != b && a.len() == 120 && b.len() == 120);
    }

    #[test]
    fn settings_are_saved_before_anything_else() {
        let parent = tempfile::tempdir().unwrap();
        let settings = RunSettings::default();
        let folder = RunFolder::create_next(parent.path(), "walks", &settings, "test").unwrap();
        assert!(folder.path().ends_with("walks-001"));
        assert_eq!(RunSettings::read(&folder.path().join("settings.toml")).unwrap(), settings);
        let second = RunFolder::create_next(parent.path(), "walks", &settings, "test").unwrap();
        assert!(second.path().ends_with("walks-002"));
    }

    #[test]
    fn only_the_same_run_is_continued() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let settings = RunSettings::default();
        drop(open(&path, &settings, false).unwrap());
        drop(open(&path, &settings, false).unwrap());
        let other = RunSettings { limit: Some(2), ..RunSettings::default() };
        let refused = open(&path, &other, false).unwrap_err();
        assert!(refused.to_string().contains("other settings"), "{refused}");
        fs::write(path.join(CASES).join("old.json"), "old").unwrap();
        drop(open(&path, &other, true).unwrap());
        assert!(!path.join(CASES).join("old.json").exists());

        let text = fs::read_to_string(path.join(MANIFEST_FILE)).unwrap();
        let mut manifest: Manifest = serde_json::from_str(&text).unwrap();
        manifest.program_sha256 = "0".repeat(64);
        fs::write(path.join(MANIFEST_FILE), serde_json::to_string(&manifest).unwrap()).unwrap();
        let refused = open(&path, &other, false).unwrap_err();
        assert!(refused.to_string().contains("another build"), "{refused}");
    }

    #[test]
    fn a_model_may_move_but_not_change() {
        use crate::harness::LanguageSettings;
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let with = |bundle: &str, vectors: &str, vectors_sha256: &str, encoder_sha256: &str| RunSettings {
            language: Some(LanguageSettings {
                bundle: Some(bundle.into()),
                vectors: Some(vectors.into()),
                vectors_sha256: vectors_sha256.to_owned(),
                sentence_encoder_sha256: encoder_sha256.to_owned(),
                ..LanguageSettings::default()
            }),
            ..RunSettings::default()
        };
        drop(open(&path, &with("a", "b", "1", "2"), false).unwrap());
        drop(open(&path, &with("elsewhere", "moved", "1", "2"), false).unwrap());
        for (vectors_sha256, encoder_sha256) in [("3", "2"), ("1", "4")] {
            let refused = open(&path, &with("a", "b", vectors_sha256, encoder_sha256), false).unwrap_err();
            assert!(refused.to_string().contains("other settings"), "{refused}");
        }
    }

    #[test]
    fn foreign_folders_are_left_alone() {
        let parent = tempfile::tempdir().unwrap();
        fs::write(parent.path().join("thesis.tex"), "years of work").unwrap();
        for overwrite in [false, true] {
            let refused = open(parent.path(), &RunSettings::default(), overwrite);
            assert!(matches!(refused, Err(FolderError::Foreign { .. })));
        }
        assert!(parent.path().join("thesis.tex").exists());
    }

    #[test]
    fn two_writers_do_not_share_a_folder() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("run");
        let held = open(&path, &RunSettings::default(), false).unwrap();
        assert!(matches!(open(&path, &RunSettings::default(), false), Err(FolderError::Locked { .. })));
        drop(held);
        open(&path, &RunSettings::default(), false).unwrap();
    }
}
