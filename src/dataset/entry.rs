//! Inputs found while listing, before they are read.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::Skipped;
use super::files::Files;

/// An input that looks like a motion; [`super::Dataset::load`] reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Identity, unique in the dataset and fit to name a file.
    pub id: String,
    /// Where it is: a file, or `archive.zip!/entry`.
    pub source: PathBuf,
    /// Name within the dataset's files.
    pub(super) name: String,
    pub(super) format: Format,
    pub(super) captions: Captions,
    /// The skeleton file of an AMC motion.
    pub(super) skeleton: Option<String>,
    /// Rate and height that a manifest states.
    pub(super) rate_hz: Option<f64>,
    pub(super) height_m: Option<f64>,
}

/// How a motion is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Mmm,
    Npy,
    Npz,
    Csv,
    Bvh,
    Amc,
}

/// What some motions do not say themselves, so that it is asked of the caller; see [`super::OpenOptions`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unstated {
    /// Frames per second: number tables and AMC files may state none.
    Rate,
    /// Body height: number tables may state none.
    Height,
    /// Which joint is which: of motion capture, and of arrays that may hold joint positions.
    Skeleton,
}

impl Format {
    /// Whether a motion stored like this may leave it open.
    pub(super) fn leaves_open(self, what: Unstated) -> bool {
        match what {
            Unstated::Rate => matches!(self, Self::Npy | Self::Npz | Self::Csv | Self::Amc),
            Unstated::Height => matches!(self, Self::Npy | Self::Npz | Self::Csv),
            Unstated::Skeleton => matches!(self, Self::Npy | Self::Npz | Self::Bvh | Self::Amc),
        }
    }
}

/// Where the captions of a motion are.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Captions {
    None,
    /// In this file beside the motion.
    File(String),
    /// In the manifest.
    Given(Vec<String>),
}

/// Most characters of an id, so that file names made from it stay within what file systems accept.
const MAX_ID_CHARS: usize = 100;

impl Format {
    /// The format a file name's extension says.
    pub(super) fn of(name: &str) -> Option<Self> {
        let (_, extension) = name.rsplit_once('.')?;
        match extension.to_ascii_lowercase().as_str() {
            "xml" => Some(Self::Mmm),
            "npy" => Some(Self::Npy),
            "npz" => Some(Self::Npz),
            "csv" => Some(Self::Csv),
            "bvh" => Some(Self::Bvh),
            "amc" => Some(Self::Amc),
            _ => None,
        }
    }

    /// File name without folders, extension and the `_mmm` of KIT-ML.
    pub(super) fn stem(name: &str) -> &str {
        let file = name.rsplit('/').next().unwrap_or(name);
        let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
        match stem.strip_suffix("_mmm") {
            Some(id) if !id.is_empty() => id,
            _ => stem,
        }
    }
}

/// Whether a text can name a result file as it is.
pub(super) fn is_portable_id(id: &str) -> bool {
    !id.is_empty()
        && !id.starts_with('.')
        && id.chars().count() <= MAX_ID_CHARS
        && id.chars().all(is_portable)
}

fn is_portable(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '.' | '_' | '+' | '-')
}

/// The nearest text that can name a result file.
pub(super) fn portable_id(name: &str) -> String {
    let id: String = name.chars().take(MAX_ID_CHARS).map(|c| if is_portable(c) { c } else { '_' }).collect();
    if is_portable_id(&id) { id } else { format!("_{}", id.chars().skip(1).collect::<String>()) }
}

/// Finds the motions among sorted file names, in the layout of KIT-ML.
///
/// A motion's captions are in `<id>_annotations.json` beside it; `<id>_meta.json` is not needed.
/// Motions that share an id (`a.xml` and `a.npy`) are named by their whole path instead.
pub(super) fn find_entries(files: &Files, names: &[String], skipped: &mut Vec<Skipped>) -> Vec<Entry> {
    let known: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    let mut entries: Vec<Entry> =
        names.iter().filter_map(|name| make_entry(files, name, |other| known.contains(other))).collect();

    let shared: BTreeSet<String> = {
        let mut seen = BTreeSet::new();
        entries.iter().map(|entry| entry.id.clone()).filter(|id| !seen.insert(id.clone())).collect()
    };
    for entry in entries.iter_mut().filter(|entry| shared.contains(&entry.id)) {
        entry.id = portable_id(&entry.name);
    }
    let mut taken = BTreeSet::new();
    entries.retain(|entry| {
        let unique = taken.insert(entry.id.clone());
        if !unique {
            skipped.push(Skipped {
                id: entry.id.clone(),
                source: entry.source.clone(),
                reason: format!("another input has the id {:?} already; rename one", entry.id),
            });
        }
        unique
    });
    entries
}

/// The entry of one file, or `None` when the name is not that of a motion; `exists` says which other files there are.
pub(super) fn make_entry(files: &Files, name: &str, exists: impl Fn(&str) -> bool) -> Option<Entry> {
    let format = Format::of(name)?;
    let (folder, file) = name.rsplit_once('/').map_or(("", name), |(folder, file)| (folder, file));
    // Hidden files, and the shadow files some archivers add.
    if file.starts_with('.') || folder.split('/').any(|part| part == "__MACOSX") {
        return None;
    }
    let stem = Format::stem(name);
    let folder = if folder.is_empty() { String::new() } else { format!("{folder}/") };
    let annotations = format!("{folder}{stem}_annotations.json");
    Some(Entry {
        id: portable_id(stem),
        source: files.source(name),
        name: name.to_owned(),
        skeleton: skeleton_of(format, name, &exists),
        format,
        captions: if exists(&annotations) { Captions::File(annotations) } else { Captions::None },
        rate_hz: None,
        height_m: None,
    })
}

/// The skeleton file beside an AMC motion: the `.asf` with the longest name that begins the motion's.
pub(super) fn skeleton_of(format: Format, name: &str, exists: impl Fn(&str) -> bool) -> Option<String> {
    let (stem, _) = name.rsplit_once('.').filter(|_| format == Format::Amc)?;
    let start = stem.rfind('/').map_or(0, |slash| slash + 1);
    let ends = stem[start..].char_indices().map(|(index, symbol)| start + index + symbol.len_utf8());
    let ends: Vec<usize> = ends.collect();
    ends.into_iter()
        .rev()
        .flat_map(|end| ["asf", "ASF"].map(|extension| format!("{}.{extension}", &stem[..end])))
        .find(|candidate| exists(candidate))
}

impl Entry {
    /// The entry as one that cannot be used.
    pub(super) fn skipped(&self, error: &impl std::fmt::Display) -> Skipped {
        Skipped {
            id: self.id.clone(),
            source: self.source.clone(),
            reason: error.to_string().replace(['\n', '\r'], " "),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(names: &[&str]) -> (Vec<String>, usize) {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut skipped = Vec::new();
        let entries = find_entries(&Files::Memory(&[]), &names, &mut skipped);
        (entries.into_iter().map(|entry| entry.id).collect(), skipped.len())
    }

    #[test]
    fn ids_are_unique_and_can_name_files() {
        let names =
            ["00001_mmm.xml", "00001_raw.c3d", "00002_mmm.xml", "x y!.csv", ".hidden.xml", "_mmm.xml"];
        assert_eq!(
            ids(&names),
            (["00001", "00002", "x_y_.csv", "_mmm"].map(|id| id.replace(".csv", "")).to_vec(), 0)
        );
        let names = ["a.npy", "a.xml", "b.xml", "k/b.xml", "__MACOSX/c.xml"];
        assert_eq!(ids(&names), (["a.npy", "a.xml", "b.xml", "k_b.xml"].map(str::to_owned).to_vec(), 0));
        assert_eq!(ids(&["k/b.xml", "k_b.xml", "l/b.xml", "l/k_b.xml"]).1, 1);
        assert_eq!(portable_id("../../etc"), "_._.._etc");
        assert_eq!(portable_id(&"x".repeat(300)).len(), 100);
        assert!(
            !is_portable_id("..") && !is_portable_id("a/b") && !is_portable_id("") && is_portable_id("a-1.b")
        );
    }
}
