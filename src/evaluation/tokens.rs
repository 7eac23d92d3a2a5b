//! Sentences into words, the ways other programs do it.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use regex::Regex;

/// How a sentence is cut into words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    /// At white space only, punctuation stays at its word: Python's `str.split()`, and sacrebleu's `none`.
    Split,
    /// Words with inner `-` and `'` kept, and single punctuation marks: `\w+(?:[-']\w+)*|[^\w\s]`.
    Words,
    /// mteval-v13a as sacrebleu has it: punctuation apart, but `.` and `,` stay inside numbers.
    V13a,
    /// Runs of `a-z0-9`, everything else is dropped: the package rouge-score without its stemmer. Always lower case.
    AsciiWords,
}

/// A way to make words of sentences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tokenization {
    /// How a sentence is cut.
    pub cut: Cut,
    /// Whether upper and lower case are the same.
    pub lowercase: bool,
}

/// A tokenisation that has no such name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("understand the tokenisation {0:?}: use split, words, 13a or ascii, with -lc to ignore case")]
pub struct UnknownTokenization(pub String);

impl Tokenization {
    /// Lower-case words and punctuation marks, the default for scores of the image-captioning family.
    pub const LOWER_WORDS: Self = Self { cut: Cut::Words, lowercase: true };
    /// What sacrebleu does unless told otherwise.
    pub const V13A: Self = Self { cut: Cut::V13a, lowercase: false };
    /// What the package rouge-score does unless told otherwise.
    pub const ROUGE: Self = Self { cut: Cut::AsciiWords, lowercase: true };

    /// Name of the cut, as in signatures.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.cut {
            Cut::Split => "split",
            Cut::Words => "words",
            Cut::V13a => "13a",
            Cut::AsciiWords => "ascii",
        }
    }

    /// `lc` or `mixed`, as in signatures.
    #[must_use]
    pub fn case(self) -> &'static str {
        if self.lowercase || self.cut == Cut::AsciiWords { "lc" } else { "mixed" }
    }

    /// The words of a sentence.
    #[must_use]
    pub fn words(self, sentence: &str) -> Vec<String> {
        let mut words = Vec::new();
        self.for_each(sentence, |word| words.push(word.to_owned()));
        words
    }

    /// Hands the words of a sentence to `take`, in order.
    pub fn for_each(self, sentence: &str, take: impl FnMut(&str)) {
        if self.case() == "mixed" {
            return self.cut_up(sentence, take);
        }
        if sentence.is_ascii() && !sentence.bytes().any(|byte| byte.is_ascii_uppercase()) {
            return self.cut_up(sentence, take);
        }
        self.cut_up(&sentence.to_lowercase(), take);
    }

    fn cut_up(self, sentence: &str, mut take: impl FnMut(&str)) {
        match self.cut {
            Cut::Split => split(sentence).for_each(take),
            Cut::V13a => split(&spread_13a(sentence)).for_each(take),
            Cut::Words => {
                for word in WORDS.find_iter(sentence) {
                    take(word.as_str());
                }
            }
            Cut::AsciiWords => sentence
                .split(|symbol: char| !(symbol.is_ascii_lowercase() || symbol.is_ascii_digit()))
                .filter(|word| !word.is_empty())
                .for_each(take),
        }
    }
}

impl fmt::Display for Tokenization {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())?;
        if self.lowercase && self.cut != Cut::AsciiWords { formatter.write_str("-lc") } else { Ok(()) }
    }
}

impl FromStr for Tokenization {
    type Err = UnknownTokenization;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (name, lowercase) = text.strip_suffix("-lc").map_or((text, false), |name| (name, true));
        let cut = match name {
            "split" | "none" => Cut::Split,
            "words" => Cut::Words,
            "13a" => Cut::V13a,
            "ascii" => Cut::AsciiWords,
            _ => return Err(UnknownTokenization(text.to_owned())),
        };
        Ok(Self { cut, lowercase })
    }
}

// Python's \w is a letter, a number or the underscore; the classes of this engine spell that out.
// The pattern is a constant, and a test compiles it.
#[expect(clippy::unwrap_used, reason = "a constant pattern that a test compiles")]
static WORDS: LazyLock<Regex> =
    LazyLock::new(|| Regex::new(r"[\p{L}\p{N}_]+(?:[-'][\p{L}\p{N}_]+)*|[^\p{L}\p{N}_\s\x1c-\x1f]").unwrap());

/// Python's `str.split()`, whose white space includes the four ASCII separators.
fn split(text: &str) -> impl Iterator<Item = &str> {
    text.split(|symbol: char| symbol.is_whitespace() || ('\x1c'..='\x1f').contains(&symbol))
        .filter(|word| !word.is_empty())
}

/// The sentence with spaces around everything that mteval-v13a takes for a word of its own.
///
/// The original is four substitutions one after the other, and so is this: each consumes what it matched.
/// All matched symbols are ASCII, so bytes serve as well as characters.
fn spread_13a(sentence: &str) -> String {
    let mut text = sentence.trim_end().replace("<skipped>", "").replace("-\n", "").replace('\n', " ");
    if text.contains('&') {
        for (escaped, plain) in [("&quot;", "\""), ("&amp;", "&"), ("&lt;", "<"), ("&gt;", ">")] {
            text = text.replace(escaped, plain);
        }
    }
    let mut now = Vec::with_capacity(2 * text.len() + 8);
    now.push(b' ');
    for byte in text.bytes() {
        if is_symbol(byte) { now.extend([b' ', byte, b' ']) } else { now.push(byte) }
    }
    now.push(b' ');
    let is_point = |byte: u8| byte == b'.' || byte == b',';
    let mut next = Vec::with_capacity(2 * now.len());
    substitute(&now, &mut next, |a, b| !a.is_ascii_digit() && is_point(b), |a, b| [a, b' ', b, b' ']);
    substitute(&next, &mut now, |a, b| is_point(a) && !b.is_ascii_digit(), |a, b| [b' ', a, b' ', b]);
    substitute(&now, &mut next, |a, b| a.is_ascii_digit() && b == b'-', |a, b| [a, b' ', b, b' ']);
    // Spaces were put beside whole ASCII symbols only; should that ever fail, the untouched sentence is the answer.
    String::from_utf8(next).unwrap_or(text)
}

fn is_symbol(byte: u8) -> bool {
    matches!(byte, b'{'..=b'~' | b'['..=b'`' | b' '..=b'&' | b'('..=b'+' | b':'..=b'@' | b'/')
}

/// Replaces every pair of bytes that matches, from left to right and without overlaps.
fn substitute(
    from: &[u8],
    to: &mut Vec<u8>,
    matches: impl Fn(u8, u8) -> bool,
    replace: impl Fn(u8, u8) -> [u8; 4],
) {
    to.clear();
    let mut index = 0;
    while index < from.len() {
        match from.get(index + 1) {
            Some(&second) if matches(from[index], second) => {
                to.extend(replace(from[index], second));
                index += 2;
            }
            _ => {
                to.push(from[index]);
                index += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(name: &str, sentence: &str) -> Vec<String> {
        name.parse::<Tokenization>().unwrap().words(sentence)
    }

    #[test]
    fn every_cut_has_its_way_with_punctuation() {
        let sentence = "A right-handed person's wave, twice (1,000.5 m).";
        assert_eq!(
            words("split", sentence),
            ["A", "right-handed", "person's", "wave,", "twice", "(1,000.5", "m)."]
        );
        assert_eq!(
            words("words-lc", sentence),
            [
                "a",
                "right-handed",
                "person's",
                "wave",
                ",",
                "twice",
                "(",
                "1",
                ",",
                "000",
                ".",
                "5",
                "m",
                ")",
                "."
            ]
        );
        assert_eq!(
            words("13a", sentence),
            ["A", "right-handed", "person's", "wave", ",", "twice", "(", "1,000.5", "m", ")", "."]
        );
        assert_eq!(
            words("ascii", sentence),
            ["a", "right", "handed", "person", "s", "wave", "twice", "1", "000", "5", "m"]
        );
    }

    #[test]
    fn v13a_undoes_escapes_and_parts_dashes_after_digits() {
        assert_eq!(
            words("13a", "3-4 &lt;a&gt; &quot;b&quot; x-\ny"),
            "3 - 4 < a > \" b \" xy".split(' ').collect::<Vec<_>>()
        );
        assert_eq!(words("13a", "naïve... é,1."), ["naïve", ".", ".", ".", "é", ",", "1", "."]);
    }

    #[test]
    fn white_space_is_pythons() {
        assert_eq!(words("split", "a\u{1c}b\u{3000}c\u{85} d"), ["a", "b", "c", "d"]);
        assert_eq!(words("words", "a\u{1c}b"), ["a", "b"]);
        assert!(words("words", "").is_empty());
    }

    #[test]
    fn names_are_read_back() {
        for name in ["split", "words", "words-lc", "13a", "13a-lc", "ascii"] {
            assert_eq!(name.parse::<Tokenization>().unwrap().to_string(), name);
        }
        assert!("moses".parse::<Tokenization>().unwrap_err().to_string().contains("moses"));
    }
}
