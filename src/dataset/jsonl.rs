//! JSONL manifests that pair motion files with captions, one object a line.

use std::collections::BTreeMap;
use std::path::{Component, Path};

use serde::Deserialize;

use super::entry::{Captions, Entry, Format, is_portable_id, portable_id, skeleton_of};
use super::files::{Files, MAX_FILES, MAX_TEXT_BYTES};
use super::{DatasetError, Skipped, one_line};

/// One line: `{"file": "a.npy", "id": "a", "captions": ["a person waves"], "rate_hz": 20, "height_m": 1.75}`.
///
/// All but `file` may be missing; `caption` is a single caption.
/// `file` is relative to the folder of the manifest and must stay in it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    file: String,
    id: Option<String>,
    caption: Option<String>,
    captions: Option<Vec<String>>,
    rate_hz: Option<f64>,
    height_m: Option<f64>,
}

/// Entries and skipped lines of the manifest at `path`, with the files of its folder.
pub(super) fn open_manifest(path: &Path) -> Result<(Files, Vec<Entry>, Vec<Skipped>), DatasetError> {
    let io_error = |source| DatasetError::Io { path: path.to_owned(), source };
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let root = folder.canonicalize().map_err(io_error)?;
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let files = Files::Folder(folder.to_owned());
    let text = files.read(name, MAX_TEXT_BYTES).map_err(|error| DatasetError::Unreadable {
        path: path.to_owned(),
        reason: format!("the manifest {error}"),
    })?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);

    let mut line_of_id: BTreeMap<String, usize> = BTreeMap::new();
    let (mut entries, mut skipped) = (Vec::new(), Vec::new());
    for (index, line) in text.split(|&byte| byte == b'\n').enumerate() {
        let number = index + 1;
        if line.trim_ascii().is_empty() {
            continue;
        }
        if entries.len() + skipped.len() == MAX_FILES {
            return Err(DatasetError::TooMany { path: path.to_owned(), limit: MAX_FILES });
        }
        let entry = parse_line(line).and_then(|line| make_entry(line, folder, &root)).and_then(|entry| {
            match line_of_id.get(&entry.id) {
                Some(earlier) => Err(format!("the id {:?} is that of line {earlier} already", entry.id)),
                None => Ok(entry),
            }
        });
        match entry {
            Ok(entry) => {
                line_of_id.insert(entry.id.clone(), number);
                entries.push(entry);
            }
            Err(reason) => skipped.push(Skipped {
                id: format!("{name}:{number}"),
                source: path.to_owned(),
                reason: format!("line {number}: {reason}"),
            }),
        }
    }
    Ok((files, entries, skipped))
}

fn parse_line(line: &[u8]) -> Result<Line, String> {
    serde_json::from_slice(line).map_err(|error| {
        // The line is counted by us; the parser would always call it line 1.
        let message = error.to_string();
        let reason = message.split(" at line ").next().unwrap_or_default();
        format!("{} (column {})", one_line(reason), error.column())
    })
}

fn make_entry(line: Line, folder: &Path, root: &Path) -> Result<Entry, String> {
    let path = Path::new(&line.file);
    let inside = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if !inside || line.file.is_empty() {
        return Err(format!("the file {:?} is not inside the manifest's folder", one_line(&line.file)));
    }
    let Some(format) = Format::of(&line.file) else {
        return Err(format!(
            "the file {:?} is none of .xml, .bvh, .amc, .npy, .npz, .csv",
            one_line(&line.file)
        ));
    };
    let source = folder.join(path);
    let target =
        source.canonicalize().map_err(|error| format!("the file {:?}: {error}", one_line(&line.file)))?;
    if !target.starts_with(root) {
        return Err(format!("the file {:?} links out of the manifest's folder", one_line(&line.file)));
    }
    if !target.is_file() {
        return Err(format!("{:?} is not a file", one_line(&line.file)));
    }
    let id = match line.id {
        Some(id) if is_portable_id(&id) => id,
        Some(id) => {
            return Err(format!(
                "the id {:?} cannot name a file: use at most 100 letters, digits and . _ + -, not starting with a dot",
                one_line(&id)
            ));
        }
        None => portable_id(Format::stem(&line.file)),
    };
    let captions = match (line.captions, line.caption) {
        (Some(_), Some(_)) => return Err("both \"caption\" and \"captions\" are given".to_owned()),
        (Some(captions), None) => Captions::Given(captions),
        (None, Some(caption)) => Captions::Given(vec![caption]),
        (None, None) => Captions::None,
    };
    Ok(Entry {
        id,
        source,
        skeleton: skeleton_of(format, &line.file, |other| folder.join(other).is_file()),
        name: line.file,
        format,
        captions,
        rate_hz: line.rate_hz,
        height_m: line.height_m,
    })
}
