//! Captions apart from motions: a corpus, or the descriptions of motions that are elsewhere.
//!
//! In: a `.jsonl`, `.tsv`, `.json` or `.txt` file, also packed with gzip, or the `NNNNN_annotations.json` of a folder or zip.
//! Out: [`CaptionRecord`]s, each with the id of the motion it describes where there is one.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use flate2::read::MultiGzDecoder;
use serde::Deserialize;

use super::captions::{clean_captions, parse_annotations};
use super::files::{MAX_FILES, MAX_TEXT_BYTES, read_bounded};
use super::{Dataset, DatasetError, Skipped, one_line};

/// Captions of one motion, or of none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CaptionRecord {
    /// Identity within the file: that of the record, else its line.
    pub id: String,
    /// Id of the motion described; `None` in a corpus without motions.
    pub motion: Option<String>,
    /// Part of the motion described, seconds from its start; `None` for all of it.
    pub span_secs: Option<(f64, f64)>,
    /// The captions, cleaned; never empty.
    pub texts: Vec<String>,
}

/// What a caption file holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CaptionFile {
    /// Records in file order; captions of one motion that follow each other line by line are one record.
    pub records: Vec<CaptionRecord>,
    /// Records that cannot be used.
    pub skipped: Vec<Skipped>,
    /// Doubts that do not prevent the use of what is there.
    pub warnings: Vec<String>,
}

/// A line of JSONL; other keys are ignored, since every corpus has its own.
#[derive(Deserialize)]
struct Line {
    id: Option<String>,
    motion: Option<String>,
    caption: Option<String>,
    text: Option<String>,
    captions: Option<Vec<String>>,
    start_s: Option<f64>,
    end_s: Option<f64>,
}

/// A motion of a JSON object of annotations by id, as text-to-motion projects keep them.
#[derive(Deserialize)]
struct Annotated {
    annotations: Vec<Annotation>,
}

#[derive(Deserialize)]
struct Annotation {
    text: String,
}

impl CaptionFile {
    /// Reads the captions at a path.
    ///
    /// - A folder or zip in the layout of KIT-ML: every `<id>_annotations.json`, whether its motion is there or not.
    /// - `.jsonl`: objects with `caption`, `text` or `captions`, and optionally `id`, `motion` (else `id` names the motion),
    ///   `start_s` and `end_s`.
    /// - `.tsv`: a header with `caption` or `text`, and `id` or `motion` where motions are named.
    /// - `.json`: an object of `{"annotations": [{"text": ...}]}` by motion id, or an array of captions.
    /// - `.txt`: one caption a line, without motions.
    ///
    /// Each but the first also with `.gz`.
    ///
    /// # Errors
    /// [`DatasetError`] when the file cannot be read or holds no caption at all.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        let io_error = |source| DatasetError::Io { path: path.to_owned(), source };
        let unreadable = |reason: String| DatasetError::Unreadable { path: path.to_owned(), reason };
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let mut file = Self::default();
        if path.is_dir() || path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("zip")) {
            file = Dataset::annotations(path)?;
        } else {
            let opened = std::fs::File::open(path).map_err(io_error)?;
            let length = opened.metadata().map_err(io_error)?.len();
            let bytes = match name.strip_suffix(".gz") {
                Some(_) => read_bounded(
                    MultiGzDecoder::new(std::io::BufReader::new(opened)).by_ref(),
                    0,
                    MAX_TEXT_BYTES,
                ),
                None => read_bounded(opened, length, MAX_TEXT_BYTES),
            };
            let bytes = bytes.map_err(|error| unreadable(format!("the caption file {error}")))?;
            let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
            let kind = name.trim_end_matches(".gz").rsplit('.').next().unwrap_or_default();
            match kind {
                "jsonl" => file.take_lines(path, bytes, jsonl_record),
                "txt" => file.take_lines(path, bytes, |line, _| {
                    let text = std::str::from_utf8(line).map_err(|_| "not UTF-8".to_owned())?;
                    Ok((None, None, vec![text.to_owned()]))
                }),
                "tsv" => file.take_table(path, bytes).map_err(unreadable)?,
                "json" => file.take_json(path, bytes).map_err(unreadable)?,
                _ => {
                    return Err(unreadable(
                        "not a kind of file that holds captions; expected a folder, .zip, .jsonl, .tsv, .json or .txt"
                            .to_owned(),
                    ));
                }
            }
        }
        if file.records.is_empty() {
            let reason = match file.skipped.first() {
                Some(first) => format!("no caption can be used; the first: {}", first.reason),
                None => "there is no caption in it".to_owned(),
            };
            return Err(unreadable(reason));
        }
        Ok(file)
    }

    /// Number of captions.
    #[must_use]
    pub fn num_captions(&self) -> usize {
        self.records.iter().map(|record| record.texts.len()).sum()
    }

    fn push(&mut self, id: String, motion: Option<String>, span_secs: Option<(f64, f64)>, texts: &[String]) {
        let mut warnings = Vec::new();
        let texts = clean_captions(texts, &mut warnings);
        self.warnings.extend(warnings.into_iter().map(|warning| format!("{id}: {warning}")));
        match self.records.last_mut() {
            Some(last) if motion.is_some() && last.motion == motion && last.span_secs == span_secs => {
                last.texts.extend(texts);
            }
            _ if texts.is_empty() => {}
            _ => self.records.push(CaptionRecord { id, motion, span_secs, texts }),
        }
    }

    fn take_lines(&mut self, path: &Path, bytes: &[u8], read: impl Fn(&[u8], usize) -> LineResult) {
        for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
            if line.trim_ascii().is_empty() {
                continue;
            }
            let number = index + 1;
            if self.records.len() + self.skipped.len() >= MAX_FILES {
                self.warnings.push(format!("only the first {MAX_FILES} records are read"));
                return;
            }
            match read(line, number) {
                Ok((named, span_secs, texts)) => {
                    let (id, motion) =
                        named.map_or((format!("line {number}"), None), |(id, motion)| (id, Some(motion)));
                    self.push(id, motion, span_secs, &texts);
                }
                Err(reason) => self.skipped.push(Skipped {
                    id: format!("line {number}"),
                    source: path.to_owned(),
                    reason: format!("line {number}: {reason}"),
                }),
            }
        }
    }

    fn take_table(&mut self, path: &Path, bytes: &[u8]) -> Result<(), String> {
        let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
        let header = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
        let columns: Vec<&str> = header.trim_end().split('\t').collect();
        let column = |names: [&str; 2]| names.iter().find_map(|name| columns.iter().position(|c| c == name));
        let text =
            column(["caption", "text"]).ok_or("the first line names no column \"caption\" or \"text\"")?;
        let motion = column(["motion", "id"]);
        let num_columns = columns.len();
        self.take_lines(path, &bytes[end..], |line, _| {
            let line = std::str::from_utf8(line).map_err(|_| "not UTF-8".to_owned())?;
            let fields: Vec<&str> = line.trim_end_matches('\r').split('\t').collect();
            if fields.len() != num_columns {
                return Err(format!("found {} columns, expected {num_columns}", fields.len()));
            }
            let motion = motion.map(|column| (fields[column].to_owned(), fields[column].to_owned()));
            Ok((motion, None, vec![fields[text].to_owned()]))
        });
        Ok(())
    }

    fn take_json(&mut self, path: &Path, bytes: &[u8]) -> Result<(), String> {
        if bytes.trim_ascii_start().starts_with(b"[") {
            for (index, text) in parse_annotations(bytes)?.into_iter().enumerate() {
                self.push(format!("caption {}", index + 1), None, None, &[text]);
            }
            return Ok(());
        }
        let by_id: BTreeMap<String, serde_json::Value> =
            serde_json::from_slice(bytes).map_err(|error| one_line(&error.to_string()))?;
        for (id, value) in by_id {
            match serde_json::from_value::<Annotated>(value) {
                Ok(annotated) => {
                    let texts: Vec<String> = annotated.annotations.into_iter().map(|a| a.text).collect();
                    self.push(id.clone(), Some(id), None, &texts);
                }
                Err(error) => self.skipped.push(Skipped {
                    id: one_line(&id),
                    source: path.to_owned(),
                    reason: format!("{:?}: {}", one_line(&id), one_line(&error.to_string())),
                }),
            }
        }
        Ok(())
    }

    /// Takes the content of an annotations file of a motion.
    pub(super) fn take_annotations(&mut self, id: &str, source: &Path, read: Result<Vec<String>, String>) {
        match read {
            Ok(texts) => self.push(id.to_owned(), Some(id.to_owned()), None, &texts),
            Err(reason) => {
                self.skipped.push(Skipped { id: id.to_owned(), source: source.to_owned(), reason });
            }
        }
    }
}

/// Id of the record with the motion it describes, the part described, captions; or why the line is none.
type LineResult = Result<(Option<(String, String)>, Option<(f64, f64)>, Vec<String>), String>;

fn jsonl_record(line: &[u8], number: usize) -> LineResult {
    let line: Line = serde_json::from_slice(line).map_err(|error| {
        // The line is counted by us; the parser would always call it line 1.
        one_line(error.to_string().split(" at line ").next().unwrap_or_default())
    })?;
    let texts = match (line.captions, line.caption.or(line.text)) {
        (Some(_), Some(_)) => {
            return Err("several of \"captions\", \"caption\" and \"text\" are given".to_owned());
        }
        (Some(texts), None) => texts,
        (None, Some(text)) => vec![text],
        (None, None) => return Err("no \"captions\", \"caption\" or \"text\"".to_owned()),
    };
    let span_secs = match (line.start_s, line.end_s) {
        (None, None) => None,
        (start, Some(end)) if start.unwrap_or(0.0) >= 0.0 && end > start.unwrap_or(0.0) => {
            Some((start.unwrap_or(0.0), end))
        }
        (start, end) => {
            return Err(format!(
                "from {:?} to {:?} s is no part of a motion",
                start.unwrap_or(0.0),
                end.unwrap_or(0.0)
            ));
        }
    };
    let motion = line.motion.or_else(|| line.id.clone());
    let id = line.id.or_else(|| motion.clone()).unwrap_or_else(|| format!("line {number}"));
    Ok((motion.map(|motion| (id, motion)), span_secs, texts))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, bytes: &[u8]) -> Result<CaptionFile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        CaptionFile::read(&path).map_err(|error| error.to_string())
    }

    fn shape(file: &CaptionFile) -> Vec<(Option<&str>, Vec<&str>)> {
        file.records
            .iter()
            .map(|record| (record.motion.as_deref(), record.texts.iter().map(String::as_str).collect()))
            .collect()
    }

    #[test]
    fn the_same_captions_in_every_layout() {
        let expected = [(Some("1"), vec!["a b", "c"]), (Some("2"), vec!["رجل يمشي"])];
        for (name, text) in [
            ("a.tsv", "id\tcaption\n1\ta  b\n1\tc\n2\tرجل يمشي\n"),
            (
                "a.jsonl",
                "{\"id\": \"x\", \"motion\": \"1\", \"captions\": [\"a b\", \"c\"], \"other\": 3}\n\n{\"id\": \"2\", \"text\": \"رجل يمشي\"}",
            ),
            (
                "a.json",
                "{\"2\": {\"annotations\": [{\"text\": \"رجل يمشي\", \"start\": 0}]}, \"1\": {\"annotations\": [{\"text\": \"a b\"}, {\"text\": \"c\"}]}}",
            ),
        ] {
            let file = read(name, text.as_bytes()).unwrap();
            assert_eq!(shape(&file), expected, "{name}");
            assert!(file.skipped.is_empty() && file.warnings.is_empty());
            assert_eq!(file.num_captions(), 3);
        }
        assert_eq!(
            shape(&read("a.txt", b"one\r\n\ntwo").unwrap()),
            [(None, vec!["one"]), (None, vec!["two"])]
        );
        assert_eq!(read("a.json", b"[\"one\", \"two\"]").unwrap().num_captions(), 2);
    }

    #[test]
    fn bad_records_are_named_and_the_good_ones_kept() {
        let long = "x".repeat(10_000_000);
        let lines = format!(
            "{{\"id\": \"1\", \"caption\": \"good\"}}\n{{\"id\": \"2\"}}\n{{\"caption\n{{\"caption\": \"{long}\"}}\n\
             {{\"id\": \"3\", \"caption\": \"late\", \"start_s\": 5, \"end_s\": 2}}\n{{\"caption\": \"\"}}\n{{\"caption\": \"free\"}}"
        );
        let file = read("a.jsonl", lines.as_bytes()).unwrap();
        assert_eq!(shape(&file), [(Some("1"), vec!["good"]), (None, vec!["free"])]);
        let reasons: Vec<&str> = file.skipped.iter().map(|skipped| skipped.reason.as_str()).collect();
        assert_eq!(reasons.len(), 3, "{reasons:?}");
        assert!(reasons[0].starts_with("line 2: no \"captions\""), "{reasons:?}");
        assert!(reasons[2].starts_with("line 5: from 5.0 to 2.0 s"), "{reasons:?}");
        assert_eq!(file.warnings.len(), 2, "{:?}", file.warnings);

        let table = read("a.tsv", b"id\tcaption\n1\tgood\n2\t\xff\n3\n").unwrap();
        assert_eq!((table.num_captions(), table.skipped.len()), (1, 2));
        assert_eq!(read("a.txt", b"good\n\xff\xfe\n").unwrap().skipped[0].reason, "line 2: not UTF-8");
    }

    #[test]
    fn files_without_captions_are_refused() {
        for (name, bytes, reason) in [
            ("a.txt", &b""[..], "no caption in it"),
            ("a.jsonl", b"{}", "no caption can be used; the first: line 1"),
            ("a.tsv", b"id\tother\n1\t2", "names no column"),
            ("a.json", b"{\"1\":", "EOF"),
            ("a.pkl", b"\x80\x04", "not a kind of file"),
            ("a.txt.gz", b"\x1f\x8bnonsense", "cannot be read"),
        ] {
            let error = read(name, bytes).unwrap_err();
            assert!(error.contains(reason) && !error.contains('\n'), "{error} should contain {reason}");
        }
    }
}
