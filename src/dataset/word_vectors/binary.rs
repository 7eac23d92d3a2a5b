//! The binary layout of word2vec: a text header, then each word, a space and its numbers as little-endian singles.
//!
//! Some writers end each entry with a line feed, Google's did not; both are read.

use std::io::{BufRead, ErrorKind};

use super::{MAX_WORD_BYTES, Stop, Wanted, WordVectors, too_odd};
use crate::dataset::one_line;

pub(super) fn read(
    source: &mut impl BufRead,
    num_words: u64,
    dimensions: usize,
    wanted: &Wanted<'_>,
) -> Result<WordVectors, Stop> {
    let mut read = WordVectors { dimensions, ..WordVectors::default() };
    let mut bytes = vec![0; 4 * dimensions];
    let mut word = Vec::new();
    let (mut num_odd, mut num_unusable, mut first_odd) = (0, 0, None);
    for index in 0..num_words {
        word.clear();
        std::io::Read::take(&mut *source, MAX_WORD_BYTES as u64 + 2).read_until(b' ', &mut word)?;
        let ended = word.pop() != Some(b' ');
        if ended && word.len() > MAX_WORD_BYTES {
            return Err(misfit(index, num_words, dimensions, "no word ends where one should"));
        }
        let complete = !ended && fill(source, &mut bytes)?;
        if !complete {
            read.warnings.push(format!(
                "the header announces {num_words} words, the file ends after {index}: it is truncated"
            ));
            break;
        }
        read.num_words = index + 1;
        let word = word.strip_prefix(b"\n").unwrap_or(&word);
        let text = match std::str::from_utf8(word) {
            Ok(text) if !text.is_empty() && !text.contains(char::is_control) => text,
            _ => {
                num_odd += 1;
                first_odd.get_or_insert_with(|| one_line(&String::from_utf8_lossy(word)));
                if too_odd(num_odd, index) {
                    return Err(misfit(index, num_words, dimensions, "what should be words are not"));
                }
                continue;
            }
        };
        if wanted.has(text, &read) && !read.vectors.contains_key(text) {
            let vector: Vec<f32> =
                bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            if vector.iter().all(|value| value.is_finite()) {
                read.vectors.insert(text.to_owned(), vector);
            } else {
                num_unusable += 1;
            }
        }
    }
    if let Some(first) = first_odd {
        read.warnings.push(format!("words that are not UTF-8 text left out: {num_odd}, the first {first:?}"));
    }
    if num_unusable > 0 {
        read.warnings
            .push(format!("wanted vectors with numbers that are not finite left out: {num_unusable}"));
    }
    let rest = source.fill_buf()?;
    if read.num_words == num_words && !rest.trim_ascii().is_empty() {
        read.warnings
            .push(format!("more data follows the {num_words} words the header announces; it is not read"));
    }
    Ok(read)
}

/// Fills the buffer, or says that the file ends before.
fn fill(source: &mut impl BufRead, bytes: &mut [u8]) -> Result<bool, Stop> {
    match source.read_exact(bytes) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        other => Ok(other.map(|()| true)?),
    }
}

fn misfit(index: u64, num_words: u64, dimensions: usize, what: &str) -> Stop {
    Stop::Layout(format!(
        "word {index}: {what}; the header's {num_words} words of {dimensions} numbers do not fit the file"
    ))
}
