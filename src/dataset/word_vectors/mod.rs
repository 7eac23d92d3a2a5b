//! Pretrained word vectors: word2vec `.bin`, and the text files of `GloVe` and fastText, each also packed with gzip.
//!
//! In: a file and the words that matter. Out: the vectors of those words that are there.
//! The file streams through a small buffer, whatever its size, and only the wanted vectors are kept: the 3.6 GB of
//! `GoogleNews` need some megabytes of memory. Words are looked up exactly as they are spelled.

mod binary;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;

/// Most numbers in a vector.
const MAX_DIMENSIONS: usize = 4096;

/// Most words a header may announce.
const MAX_WORDS: u64 = 200_000_000;

/// Longest word, bytes; `GoogleNews` has phrases of about 100.
const MAX_WORD_BYTES: usize = 2000;

/// Largest accepted ratio of unpacked to packed size; vectors reach about 3.
const MAX_RATIO: u64 = 200;

/// Bytes that may be unpacked whatever the ratio.
const RATIO_FREE_BYTES: u64 = 16 << 20;

/// Entries that may be odd before the file is taken for something else, besides one in a hundred.
const ODD_ENTRIES: u64 = 16;

/// Why a file gives no vectors.
#[derive(Debug, thiserror::Error)]
pub enum VectorError {
    /// The file cannot be read.
    #[error("read the word vectors {}: {source}", .path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is not one of word vectors.
    #[error("read the word vectors {}: {reason}", .path.display())]
    Layout {
        /// File.
        path: PathBuf,
        /// Why not, and where.
        reason: String,
    },
}

/// The vectors of the words that were asked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WordVectors {
    /// Numbers in each vector; 300 for `GoogleNews`.
    pub dimensions: usize,
    /// Vectors by word, each `dimensions` long and finite.
    pub vectors: BTreeMap<String, Vec<f32>>,
    /// Words in the file, wanted or not.
    pub num_words: u64,
    /// Doubts about the file that do not prevent its use.
    pub warnings: Vec<String>,
}

/// How many of the words in some text have a vector.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Coverage {
    /// Different words.
    pub num_words: usize,
    /// Different words with a vector.
    pub num_covered: usize,
    /// Occurrences of words.
    pub num_tokens: usize,
    /// Occurrences of words with a vector.
    pub num_covered_tokens: usize,
    /// Words without a vector and how often they occur, the most frequent first.
    pub missing: Vec<(String, usize)>,
}

/// What stops a reader; the path is added by the caller.
enum Stop {
    Io(io::Error),
    Layout(String),
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Words whose vectors are kept.
enum Wanted<'w> {
    /// These.
    Words(&'w BTreeSet<String>),
    /// The first of the file, until they take so many bytes.
    First { most_bytes: usize },
}

impl Wanted<'_> {
    /// Whether the next word of a file is kept.
    fn has(&self, word: &str, read: &WordVectors) -> bool {
        // Beside its numbers a vector has a word and its places in memory.
        const BESIDE: usize = 128;
        match self {
            Self::Words(words) => words.contains(word),
            Self::First { most_bytes } => {
                (read.vectors.len() + 1).saturating_mul(4 * read.dimensions + BESIDE) <= *most_bytes
            }
        }
    }
}

impl WordVectors {
    /// Reads the vectors of the `wanted` words; `progress` is told the share of the file that is done, now and then.
    ///
    /// A file that ends too early gives what it has, with a warning. Of a repeated word the first vector holds.
    ///
    /// # Errors
    /// [`VectorError`] when the file cannot be read, is none of the known layouts, or when its header does not fit what
    /// follows.
    pub fn read(path: &Path, wanted: &BTreeSet<String>, progress: &dyn Fn(f64)) -> Result<Self, VectorError> {
        Self::read_wanted(path, &Wanted::Words(wanted), progress)
    }

    /// Reads the vectors of the first words of a file, until they take about `most_bytes` of memory; files have their most
    /// frequent words first. Whether that is all of them, [`WordVectors::num_words`] tells.
    ///
    /// # Errors
    /// As [`WordVectors::read`].
    pub fn read_first(path: &Path, most_bytes: usize, progress: &dyn Fn(f64)) -> Result<Self, VectorError> {
        Self::read_wanted(path, &Wanted::First { most_bytes }, progress)
    }

    fn read_wanted(path: &Path, wanted: &Wanted<'_>, progress: &dyn Fn(f64)) -> Result<Self, VectorError> {
        let io_error = |source| VectorError::Io { path: path.to_owned(), source };
        let file = File::open(path).map_err(io_error)?;
        let length = file.metadata().map_err(io_error)?.len();
        let mut packed =
            BufReader::with_capacity(1 << 20, Watched { file, length, read: 0, told: 0, progress });
        let is_gzip = packed.fill_buf().map_err(io_error)?.starts_with(&[0x1f, 0x8b]);
        let read = if is_gzip {
            let limit = RATIO_FREE_BYTES.saturating_add(length.saturating_mul(MAX_RATIO));
            let unpacked = Bounded { inner: MultiGzDecoder::new(packed), left: limit };
            read_any(&mut BufReader::with_capacity(1 << 20, unpacked), wanted)
        } else {
            read_any(&mut packed, wanted)
        };
        read.map_err(|stop| match stop {
            Stop::Io(source) => io_error(source),
            Stop::Layout(reason) => VectorError::Layout { path: path.to_owned(), reason },
        })
    }

    /// How much of a text these vectors cover, from the occurrences of its words.
    #[must_use]
    pub fn coverage(&self, occurrences: &BTreeMap<String, usize>) -> Coverage {
        let mut missing: Vec<(String, usize)> = occurrences
            .iter()
            .filter(|(word, _)| !self.vectors.contains_key(*word))
            .map(|(word, count)| (word.clone(), *count))
            .collect();
        missing.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let num_tokens: usize = occurrences.values().sum();
        Coverage {
            num_words: occurrences.len(),
            num_covered: occurrences.len() - missing.len(),
            num_tokens,
            num_covered_tokens: num_tokens - missing.iter().map(|(_, count)| count).sum::<usize>(),
            missing,
        }
    }
}

fn read_any(source: &mut impl BufRead, wanted: &Wanted<'_>) -> Result<WordVectors, Stop> {
    let mut first = Vec::new();
    (&mut *source).take(text::MAX_LINE_BYTES as u64).read_until(b'\n', &mut first)?;
    if first.is_empty() {
        return Err(Stop::Layout("the file is empty".to_owned()));
    }
    let Some((num_words, dimensions)) = header(&first) else {
        return text::read(source, Some(&first), None, wanted);
    };
    if num_words > MAX_WORDS || !(1..=MAX_DIMENSIONS as u64).contains(&dimensions) {
        return Err(Stop::Layout(format!(
            "the header announces {num_words} words of {dimensions} numbers; at most {MAX_WORDS} words of {MAX_DIMENSIONS} are accepted"
        )));
    }
    let dimensions = dimensions as usize;
    if begins_like_text(source.fill_buf()?) {
        text::read(source, None, Some((num_words, dimensions)), wanted)
    } else {
        binary::read(source, num_words, dimensions, wanted)
    }
}

/// `N D` alone on a line.
fn header(line: &[u8]) -> Option<(u64, u64)> {
    let mut words = std::str::from_utf8(line).ok()?.split_ascii_whitespace();
    let header = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    words.next().is_none().then_some(header)
}

/// Whether printed numbers follow the first word.
fn begins_like_text(bytes: &[u8]) -> bool {
    let Some(space) = bytes.iter().position(|byte| *byte == b' ') else { return false };
    let numbers = &bytes[space..bytes.len().min(space + 24)];
    let numbers = numbers.split(|byte| *byte == b'\n').next().unwrap_or_default();
    numbers.len() > 1
        && numbers.iter().all(|byte| {
            byte.is_ascii_digit() || matches!(byte, b' ' | b'.' | b'-' | b'+' | b'e' | b'E' | b'\r')
        })
}

/// Too many entries that are not words for this to be the layout it seems to be.
fn too_odd(num_odd: u64, num_read: u64) -> bool {
    num_odd > ODD_ENTRIES + num_read / 100
}

/// A file that tells how far it has been read.
struct Watched<'p> {
    file: File,
    length: u64,
    read: u64,
    told: u64,
    progress: &'p dyn Fn(f64),
}

impl Read for Watched<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read += count as u64;
        if self.read - self.told >= 32 << 20 {
            self.told = self.read;
            (self.progress)(self.read as f64 / self.length.max(1) as f64);
        }
        Ok(count)
    }
}

/// A reader that gives up beyond a number of bytes.
struct Bounded<R> {
    inner: R,
    left: u64,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| {
            io::Error::other(format!("it is compressed more than {MAX_RATIO}:1, like a bomb"))
        })?;
        Ok(count)
    }
}
