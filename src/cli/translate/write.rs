//! Where translations go.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use serde::Serialize;

use super::{TranslateArgs, plot};
use crate::cli::output::check_free;
use crate::cli::retarget::npy;
use crate::dataset::mmm::write_mmm;
use crate::manifest::write_file;
use crate::motion::Motion;
use crate::report::shorten;

/// Manifest of a folder of motions.
const MANIFEST: &str = "manifest.jsonl";

/// A place for results.
#[derive(Debug)]
pub(super) enum Target {
    /// One motion, in the form its ending says.
    Motion(PathBuf),
    /// A folder of motions with a manifest.
    Folder(PathBuf),
    /// All translations, a line each.
    Lines(PathBuf),
}

impl Target {
    pub fn path(&self) -> &Path {
        match self {
            Self::Motion(path) | Self::Folder(path) | Self::Lines(path) => path,
        }
    }

    /// Where a motion goes; with `number` it is one of several of the same sentence.
    pub fn motion_file(&self, id: Option<&str>, number: Option<usize>) -> Option<PathBuf> {
        let numbered = |stem: &str, ending: &str| match number {
            Some(number) => format!("{stem}-{number}.{ending}"),
            None => format!("{stem}.{ending}"),
        };
        match self {
            // As it was written: on some systems Walk.XML and Walk.xml are two files.
            Self::Motion(path) if number.is_none() => Some(path.clone()),
            Self::Motion(path) => {
                let part = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
                let name = numbered(&part(path.file_stem()), &part(path.extension()));
                Some(path.with_file_name(name))
            }
            Self::Folder(path) => Some(path.join(numbered(id.unwrap_or("motion"), "xml"))),
            Self::Lines(_) => None,
        }
    }
}

/// Whether this is the name of a recording.
pub(super) fn is_recording(path: &Path) -> bool {
    ending(path) == "mcap"
}

fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

/// The places of `--out`, checked before any work: known endings, nothing replaced that should not be.
pub(super) fn targets(args: &TranslateArgs) -> anyhow::Result<Vec<Target>> {
    let is_sentence = args.has_sentence();
    let mut targets = Vec::new();
    for path in &args.out {
        let refuse = |expected: &str| Err(anyhow!("write {}: {expected}", path.display()));
        let target = match ending(path).as_str() {
            "xml" | "npy" | "svg" | "mcap" if is_sentence => Target::Motion(path.clone()),
            "jsonl" => Target::Lines(path.clone()),
            "" if args.captions.is_some() => Target::Folder(path.clone()),
            _ if is_sentence => return refuse("expected a name ending in .xml, .npy, .svg, .mcap or .jsonl"),
            _ if args.captions.is_some() => {
                return refuse("of a file of sentences expected a folder, or a name ending in .jsonl");
            }
            _ if args.motions.is_some() => return refuse("of motions expected a name ending in .jsonl"),
            _ => return refuse("what is read from standard input is printed; leave out --out"),
        };
        let count = if is_sentence { usize::from(args.n_best) } else { 1 };
        let files: Vec<PathBuf> = match &target {
            Target::Motion(_) if count > 1 => {
                (1..=count).filter_map(|number| target.motion_file(None, Some(number))).collect()
            }
            Target::Folder(_) => Vec::new(),
            Target::Motion(path) | Target::Lines(path) => vec![path.clone()],
        };
        for file in &files {
            check_free(file, args.overwrite)?;
        }
        if let Target::Folder(path) = &target {
            check_folder(path, args.overwrite)?;
        }
        if targets.iter().any(|other: &Target| other.path() == path) {
            return refuse("it is named twice");
        }
        // Recordings are of one sentence, folders of a file of them, so the two do not meet.
        let is_single = |target: &Target| match target {
            Target::Folder(_) => true,
            Target::Motion(path) => is_recording(path),
            Target::Lines(_) => false,
        };
        if is_single(&target) && targets.iter().any(is_single) {
            return refuse("one recording and one folder are written at most");
        }
        targets.push(target);
    }
    Ok(targets)
}

/// Refuses what is no folder, and one with files in it unless those of the same names may be replaced.
fn check_folder(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    let entries = match std::fs::read_dir(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        entries => entries.with_context(|| format!("write into {}", path.display()))?,
    };
    if entries.count() > 0 && !overwrite {
        return Err(anyhow!(
            "write into {}: it is not empty; choose another --out, or replace files of the same names with --overwrite",
            path.display()
        ));
    }
    Ok(())
}

/// Writes a motion in the form its ending says.
pub(super) fn motion(path: &Path, motion: &Motion, name: &str, caption: &str) -> anyhow::Result<()> {
    let bytes = match ending(path).as_str() {
        "npy" => npy(motion),
        "svg" => plot::svg(motion, &shorten(caption, 80)).into_bytes(),
        _ => write_mmm(motion, name).into_bytes(),
    };
    whole(path, &bytes)
}

/// Writes all translations to where they are wanted as lines, and the manifest into folders of motions.
pub(super) fn records<T: Serialize>(
    targets: &[Target],
    records: &[T],
    manifest: Option<&str>,
) -> anyhow::Result<()> {
    for target in targets {
        match target {
            Target::Lines(path) => {
                let mut text = String::new();
                for record in records {
                    text.push_str(&serde_json::to_string(record)?);
                    text.push('\n');
                }
                whole(path, text.as_bytes())?;
            }
            Target::Folder(path) => {
                if let Some(manifest) = manifest {
                    whole(&path.join(MANIFEST), manifest.as_bytes())?;
                }
            }
            Target::Motion(_) => {}
        }
    }
    Ok(())
}

fn whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let place = || format!("write {}", path.display());
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(place)?;
    }
    write_file(path, bytes).with_context(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(out: &[&Path]) -> TranslateArgs {
        let out = out.iter().map(|path| path.to_path_buf()).collect();
        TranslateArgs { n_best: 1, out, ..TranslateArgs::default() }
    }

    #[test]
    fn endings_count_in_capitals_too_and_stay_as_they_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("Walk.XML");
        let args = TranslateArgs { sentence: Some("a walk".to_owned()), ..args(&[&path]) };
        let found = targets(&args).unwrap();
        let [target] = &found[..] else { panic!("one target") };
        assert_eq!(target.motion_file(None, None).unwrap(), path);
        assert_eq!(target.motion_file(None, Some(2)).unwrap(), folder.path().join("Walk-2.XML"));
        let standing = crate::motion::Motion::new(
            crate::motion::Body::with_default_mass(1.75),
            100.0,
            vec![crate::motion::Frame::ZERO; 3],
        );
        motion(&path, &standing.unwrap(), "a walk", "a walk").unwrap();
        assert!(std::fs::read_to_string(&path).unwrap().contains("<MMM"));
        assert!(targets(&args).unwrap_err().to_string().contains("Walk.XML"), "it is there now");
    }

    #[test]
    fn a_folder_with_anything_in_it_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let made = folder.path().join("made");
        let base = TranslateArgs { captions: Some("a.txt".into()), ..args(&[&made]) };
        targets(&base).unwrap();
        std::fs::create_dir(&made).unwrap();
        targets(&base).unwrap();
        std::fs::write(made.join("thesis"), "years of work").unwrap();
        let message = targets(&base).unwrap_err().to_string();
        assert!(message.contains("not empty") && message.contains("--overwrite"), "{message}");
        targets(&TranslateArgs { overwrite: true, ..base }).unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let base = TranslateArgs { captions: Some("a.txt".into()), ..args(&[&file]) };
        assert!(targets(&base).unwrap_err().to_string().contains("file"));
        let twice = TranslateArgs { captions: Some("a.txt".into()), ..args(&[Path::new("a.jsonl"); 2]) };
        assert!(targets(&twice).unwrap_err().to_string().contains("twice"));
    }
}
