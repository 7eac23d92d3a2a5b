//! The text layouts: a word and its numbers on each line, with (fastText) or without (`GloVe`) a header `N D`.
//!
//! A word may contain spaces, as some of `GloVe`'s do: the last D fields are the numbers.

use std::io::BufRead;

use super::{MAX_DIMENSIONS, MAX_WORD_BYTES, Stop, Wanted, WordVectors, too_odd};

/// Longest line, bytes.
pub(super) const MAX_LINE_BYTES: usize = MAX_WORD_BYTES + MAX_DIMENSIONS * 32;

/// `first` is a line already taken that is no header; the header gives the number of words and of numbers.
pub(super) fn read(
    source: &mut impl BufRead,
    first: Option<&[u8]>,
    header: Option<(u64, usize)>,
    wanted: &Wanted<'_>,
) -> Result<WordVectors, Stop> {
    let dimensions = match (header, first) {
        (Some((_, dimensions)), _) => dimensions,
        (None, line) => dimensions_of(line.unwrap_or_default())?,
    };
    let mut read = WordVectors { dimensions, ..WordVectors::default() };
    let mut line = first.unwrap_or_default().to_vec();
    let (mut number, mut num_odd, mut first_odd) = (u64::from(header.is_some()), 0, None);
    loop {
        if line.is_empty() {
            std::io::Read::take(&mut *source, MAX_LINE_BYTES as u64 + 1).read_until(b'\n', &mut line)?;
        }
        if line.is_empty() {
            break;
        }
        number += 1;
        if line.len() > MAX_LINE_BYTES {
            return Err(Stop::Layout(format!("line {number} has more than {MAX_LINE_BYTES} bytes")));
        }
        if let Some((word, vector)) = entry(&line, dimensions, |word| wanted.has(word, &read)) {
            read.num_words += 1;
            if let Some(vector) = vector {
                read.vectors.entry(word.to_owned()).or_insert(vector);
            }
        } else {
            num_odd += 1;
            first_odd.get_or_insert(number);
            if too_odd(num_odd, number) {
                let reason = format!("line {number}: expected a word and {dimensions} numbers");
                return Err(Stop::Layout(reason));
            }
        }
        line.clear();
    }
    if let Some(first) = first_odd {
        read.warnings.push(format!(
            "lines that are not a word and {dimensions} finite numbers left out: {num_odd}, the first is line {first}"
        ));
    }
    match header {
        Some((announced, _)) if announced != read.num_words + num_odd => read.warnings.push(format!(
            "the header announces {announced} words, the file has {}",
            read.num_words + num_odd
        )),
        _ => {}
    }
    Ok(read)
}

/// Numbers on the first line of a file without a header, whose word is a single field.
fn dimensions_of(line: &[u8]) -> Result<usize, Stop> {
    let not_vectors = || {
        Stop::Layout(
            "line 1 is neither `N D` nor a word and its numbers; expected word2vec .bin, GloVe or fastText text"
                .to_owned(),
        )
    };
    let line = std::str::from_utf8(line).map_err(|_| not_vectors())?;
    let numbers: Vec<&str> = line.split_ascii_whitespace().skip(1).collect();
    if !(1..=MAX_DIMENSIONS).contains(&numbers.len())
        || numbers.iter().any(|number| number.parse::<f32>().is_err())
    {
        return Err(not_vectors());
    }
    Ok(numbers.len())
}

/// The word of a line, and its vector if it is wanted; `None` when the line is not an entry.
fn entry(
    line: &[u8],
    dimensions: usize,
    is_wanted: impl FnOnce(&str) -> bool,
) -> Option<(&str, Option<Vec<f32>>)> {
    let line = line.trim_ascii_end();
    // The word ends before the last `dimensions` fields.
    let mut end = line.len();
    for _ in 0..dimensions {
        end = memchr::memrchr(b' ', &line[..end])?;
    }
    let word = std::str::from_utf8(&line[..end]).ok()?;
    if word.is_empty() || word.len() > MAX_WORD_BYTES {
        return None;
    }
    if !is_wanted(word) {
        return Some((word, None));
    }
    let numbers = std::str::from_utf8(&line[end..]).ok()?;
    let vector: Vec<f32> = numbers.split_ascii_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    (vector.len() == dimensions && vector.iter().all(|value| value.is_finite()))
        .then_some((word, Some(vector)))
}
