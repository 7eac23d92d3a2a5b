//! Hypotheses and references out of text and JSONL files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, bail};
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::evaluation::{Corpus, Segment};

/// Largest file of sentences.
const MAX_BYTES: u64 = 256 << 20;

/// A line of a JSONL file; which of the texts must be there depends on what the file is for.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    id: Option<Id>,
    hypothesis: Option<String>,
    reference: Option<String>,
    references: Option<Vec<String>>,
    /// For the reader only, for example what kind of sentence it is.
    #[serde(rename = "category")]
    _category: Option<String>,
    /// What `rprae translate` tells besides.
    #[serde(rename = "source")]
    _source: Option<IgnoredAny>,
    #[serde(rename = "duration_secs")]
    _duration_secs: Option<IgnoredAny>,
    #[serde(rename = "sentences")]
    _sentences: Option<IgnoredAny>,
    #[serde(rename = "warnings")]
    _warnings: Option<IgnoredAny>,
}

/// An id may be a number in a file.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Id {
    Text(String),
    Number(u64),
}

impl Id {
    fn text(self) -> String {
        match self {
            Self::Text(text) => text,
            Self::Number(number) => number.to_string(),
        }
    }
}

/// Texts of one file by id; the ids of a text file are its line numbers.
struct Texts {
    ids: Vec<String>,
    by_id: BTreeMap<String, Vec<String>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Hypothesis,
    Reference,
}

/// What was read: segments in the order of the hypotheses, and what has no partner.
#[derive(Debug)]
pub(super) struct Pairs {
    pub corpus: Corpus,
    pub skipped: Vec<String>,
}

/// Pairs hypotheses with the references of one or more files, by id or by line.
pub(super) fn read(hypotheses: &Path, references: &[impl AsRef<Path>]) -> anyhow::Result<Pairs> {
    let ours = read_texts(hypotheses, Side::Hypothesis)?;
    let mut theirs: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in references {
        let texts = read_texts(path.as_ref(), Side::Reference)?;
        for (id, mut sentences) in texts.by_id {
            theirs.entry(id).or_default().append(&mut sentences);
        }
    }
    let mut segments = Vec::new();
    let mut skipped = Vec::new();
    for id in &ours.ids {
        let hypothesis = ours.by_id.get(id).and_then(|texts| texts.first()).cloned().unwrap_or_default();
        match theirs.remove(id) {
            Some(references) if !references.is_empty() => {
                segments.push(Segment { id: id.clone(), hypothesis, references });
            }
            _ => skipped.push(format!("hypothesis {id:?} has no reference")),
        }
    }
    skipped.extend(theirs.keys().map(|id| format!("reference {id:?} has no hypothesis")));
    let corpus = Corpus::new(segments)
        .with_context(|| format!("pair {} with its references", hypotheses.display()))?;
    Ok(Pairs { corpus, skipped })
}

fn read_texts(path: &Path, side: Side) -> anyhow::Result<Texts> {
    let text = read_text(path)?;
    let is_jsonl = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("jsonl"));
    let mut texts = Texts { ids: Vec::new(), by_id: BTreeMap::new() };
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        if is_jsonl && line.trim().is_empty() {
            continue;
        }
        let (id, sentences) = if is_jsonl {
            parse(line, number, side).with_context(|| format!("read {}, line {number}", path.display()))?
        } else {
            let sentences = match side {
                Side::Hypothesis => vec![line.to_owned()],
                // Several references of a line stand between tabs; an empty one is none.
                Side::Reference => {
                    line.split('\t').filter(|text| !text.trim().is_empty()).map(str::to_owned).collect()
                }
            };
            (number.to_string(), sentences)
        };
        if texts.by_id.insert(id.clone(), sentences).is_some() {
            bail!("read {}, line {number}: the id {id:?} is there already", path.display());
        }
        texts.ids.push(id);
    }
    Ok(texts)
}

fn read_text(path: &Path) -> anyhow::Result<String> {
    let reading = || format!("read {}", path.display());
    let file = File::open(path).with_context(reading)?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).with_context(reading)?;
    if bytes.len() as u64 > MAX_BYTES {
        bail!("read {}: it has more than {} MB", path.display(), MAX_BYTES >> 20);
    }
    let text =
        String::from_utf8(bytes).ok().with_context(|| format!("read {}: it is not UTF-8", path.display()))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

fn parse(line: &str, number: usize, side: Side) -> anyhow::Result<(String, Vec<String>)> {
    let line: Line = serde_json::from_str(line)?;
    let id = line.id.map_or_else(|| number.to_string(), Id::text);
    let sentences = match side {
        Side::Hypothesis => vec![line.hypothesis.context("it has no \"hypothesis\"")?],
        Side::Reference => {
            let mut sentences = line.references.unwrap_or_default();
            sentences.extend(line.reference);
            if sentences.is_empty() {
                bail!("it has no \"references\"");
            }
            sentences
        }
    };
    Ok((id, sentences))
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn files(contents: &[(&str, &str)]) -> (tempfile::TempDir, Vec<PathBuf>) {
        let folder = tempfile::tempdir().unwrap();
        let paths = contents
            .iter()
            .map(|(name, text)| {
                let path = folder.path().join(name);
                std::fs::write(&path, text).unwrap();
                path
            })
            .collect();
        (folder, paths)
    }

    #[test]
    fn lines_are_paired_with_all_their_references() {
        let (_folder, paths) =
            files(&[("h.txt", "a\n\nc\n"), ("r.txt", "a one\ta two\nb\nc\n"), ("more.txt", "a three\n\n\n")]);
        let pairs = read(&paths[0], &paths[1..]).unwrap();
        let segments = pairs.corpus.segments();
        assert_eq!(segments[0].references, ["a one", "a two", "a three"]);
        assert_eq!((segments[1].hypothesis.as_str(), segments.len()), ("", 3));
        assert!(pairs.skipped.is_empty());
    }

    #[test]
    fn ids_are_paired_in_any_order_and_the_rest_is_told() {
        let (_folder, paths) = files(&[
            ("h.jsonl", "{\"id\": 2, \"hypothesis\": \"b\"}\n\n{\"id\": \"x\", \"hypothesis\": \"x\"}\n"),
            ("r.jsonl", "{\"id\": \"1\", \"reference\": \"a\"}\n{\"id\": \"2\", \"references\": [\"b\"]}\n"),
        ]);
        let pairs = read(&paths[0], &paths[1..]).unwrap();
        assert_eq!(pairs.corpus.segments()[0].id, "2");
        assert_eq!(pairs.skipped, ["hypothesis \"x\" has no reference", "reference \"1\" has no hypothesis"]);
    }

    #[test]
    fn a_bad_line_is_named() {
        for (text, part) in [
            ("{\"id\": \"1\"}", "hypothesis"),
            ("nonsense", "line 1"),
            ("{\"hypothesis\": \"a\", \"hypotesis\": 1}", "hypotesis"),
            ("{\"id\": \"1\", \"hypothesis\": \"a\"}\n{\"id\": \"1\", \"hypothesis\": \"b\"}", "line 2"),
        ] {
            let (_folder, paths) = files(&[("h.jsonl", text), ("r.txt", "a\n")]);
            let error = format!("{:#}", read(&paths[0], &paths[1..]).unwrap_err());
            assert!(error.contains(part) && error.contains("h.jsonl"), "{error}");
        }
    }
}
