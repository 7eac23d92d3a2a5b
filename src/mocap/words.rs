//! Words of a text file and the lines they stand on.

use super::{MAX_VALUE, MocapError, MocapFault};

/// Longest word shown in a message, characters.
const LONGEST_SHOWN: usize = 60;

/// A word and the line it stands on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Word<'a> {
    pub(super) text: &'a [u8],
    pub(super) line: usize,
}

impl Word<'_> {
    pub(super) fn is(&self, text: &str) -> bool {
        self.text.eq_ignore_ascii_case(text.as_bytes())
    }

    /// The word for messages and names; headers of old files are Latin-1, so not all of it need be UTF-8.
    pub(super) fn shown(&self) -> String {
        String::from_utf8_lossy(self.text).chars().filter(|c| !c.is_control()).take(LONGEST_SHOWN).collect()
    }

    pub(super) fn error(&self, fault: MocapFault) -> MocapError {
        MocapError { line: self.line, fault }
    }

    pub(super) fn unexpected(&self, expected: impl Into<String>) -> MocapError {
        self.error(MocapFault::Unexpected { found: self.shown(), expected: expected.into() })
    }

    /// The word as a finite number of bearable size.
    pub(super) fn number(&self) -> Result<f64, MocapError> {
        std::str::from_utf8(self.text)
            .ok()
            .and_then(|text| text.parse::<f64>().ok())
            .filter(|value| value.abs() <= MAX_VALUE)
            .ok_or_else(|| self.error(MocapFault::NotANumber { found: self.shown() }))
    }

    /// The word as a count.
    pub(super) fn count(&self) -> Option<usize> {
        std::str::from_utf8(self.text).ok()?.parse().ok()
    }
}

/// The words of a file, separated by blanks and line ends.
#[derive(Debug, Clone)]
pub(super) struct Words<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), line: 1 }
    }

    /// The next word, or `None` at the end.
    pub(super) fn next(&mut self) -> Option<Word<'a>> {
        let blank = self.rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(self.rest.len());
        self.line += self.rest[..blank].iter().map(|&byte| usize::from(byte == b'\n')).sum::<usize>();
        self.rest = &self.rest[blank..];
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (text, rest) = self.rest.split_at(end);
        self.rest = rest;
        Some(Word { text, line: self.line })
    }

    /// The next word, which must be there.
    pub(super) fn expect(&mut self, expected: &str) -> Result<Word<'a>, MocapError> {
        let line = self.line;
        self.next().ok_or_else(|| MocapError {
            line,
            fault: MocapFault::Truncated { expected: expected.to_owned() },
        })
    }

    /// The next word, which must be this one.
    pub(super) fn keyword(&mut self, text: &str) -> Result<Word<'a>, MocapError> {
        let word = self.expect(text)?;
        if word.is(text) { Ok(word) } else { Err(word.unexpected(text)) }
    }

    /// The next words as numbers.
    pub(super) fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], MocapError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.expect(what)?.number()?;
        }
        Ok(values)
    }

    /// The words left on the current line.
    pub(super) fn rest_of_line(&mut self) -> Words<'a> {
        let end = self.rest.iter().position(|&byte| byte == b'\n').unwrap_or(self.rest.len());
        let (text, rest) = self.rest.split_at(end);
        self.rest = rest;
        Words { rest: text, line: self.line }
    }

    pub(super) fn line(&self) -> usize {
        self.line
    }
}

/// Lines with words on them, without comments, each with its number.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Words<'_>)> {
    bytes.split(|&byte| byte == b'\n').enumerate().filter_map(|(index, text)| {
        let text = text.split(|&byte| byte == b'#').next().unwrap_or_default();
        let line = index + 1;
        (!text.trim_ascii().is_empty()).then_some((line, Words { rest: text, line }))
    })
}
