//! Where translations go.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use serde::Serialize;

use super::{TranslateArgs, plot};
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
            Self::Motion(path) => {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                Some(path.with_file_name(numbered(&stem, &ending(path))))
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
    let is_sentence = args.sentence.as_ref().is_some_and(|sentence| sentence != "-");
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
            Target::Folder(path) => vec![path.join(MANIFEST)],
            Target::Motion(path) | Target::Lines(path) => vec![path.clone()],
        };
        if let Some(there) = files.iter().find(|file| file.exists() && !args.overwrite) {
            return Err(anyhow!("write {}: it is there already; --overwrite replaces it", there.display()));
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
