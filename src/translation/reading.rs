//! From a sentence to what enters the encoder, with a note for every word the model was not trained on.

use std::collections::BTreeMap;
use std::fmt;

use super::{MAX_WORDS, TranslationError};
use crate::features::{TokenRule, Vocabulary};
use crate::model::Word;

/// Longest word that is compared letter by letter.
const MAX_LETTERS: usize = 64;
/// Longest caption quoted in a message, characters.
const MAX_QUOTED: usize = 60;

/// What a word outside the vocabulary was read as.
#[derive(Debug, Clone, PartialEq)]
pub enum Substitute {
    /// Itself, by its own vector through the retrofit layer.
    OwnVector {
        /// The word of the vocabulary with the nearest vector, for orientation; `None` when none has a vector.
        nearest: Option<(String, f64)>,
    },
    /// A word of the vocabulary that is spelled nearly so.
    Spelling {
        /// That word.
        known: String,
    },
    /// Nothing.
    LeftOut,
}

/// A word outside the vocabulary and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// The word as it was written.
    pub word: String,
    /// What it was read as.
    pub substitute: Substitute,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} is not in the vocabulary: ", self.word)?;
        match &self.substitute {
            Substitute::OwnVector { nearest: Some((known, cosine)) } => {
                write!(f, "read by its own word vector, nearest to {known:?} (cosine {cosine:.2})")
            }
            Substitute::OwnVector { nearest: None } => write!(f, "read by its own word vector"),
            Substitute::Spelling { known } => write!(f, "read as {known:?}, which is spelled nearly so"),
            Substitute::LeftOut => write!(f, "left out; word vectors would help"),
        }
    }
}

/// The words of a sentence as the model reads them.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The words, without the two ends.
    pub words: Vec<Word>,
    /// Words outside the vocabulary, in order.
    pub notes: Vec<Note>,
}

/// The rule by which the words of a vocabulary were cut; the vocabulary shows every choice that matters for reading.
pub(super) fn rule_of(vocabulary: &Vocabulary) -> TokenRule {
    let words = &vocabulary.words[2..];
    let has = |wanted: &[&str]| words.iter().any(|word| wanted.contains(&word.as_str()));
    TokenRule {
        lower_case: !words.iter().any(|word| word.chars().any(char::is_uppercase)),
        punctuation: has(&[",", ";", ":", "(", ")", "\"", "!", "?"]),
        full_stop: has(&["."]),
        split_contractions: has(&["'s", "n't"]),
        split_hyphens: !words.iter().any(|word| word.trim_matches('-').contains('-')),
    }
}

pub(super) fn read(
    rule: TokenRule,
    vocabulary: &Vocabulary,
    vectors: &BTreeMap<String, Vec<f32>>,
    caption: &str,
) -> Result<Reading, TranslationError> {
    let mut reading = Reading { words: Vec::new(), notes: Vec::new() };
    let words = rule.tokenize(caption);
    if words.len() > MAX_WORDS {
        return Err(TranslationError::TooManyWords { found: words.len() });
    }
    for word in words {
        if let Some(number) = vocabulary.index(&word) {
            reading.words.push(Word::Known(number));
            continue;
        }
        let substitute = if let Some(vector) = vectors.get(&word) {
            reading.words.push(Word::Vector(vector.clone()));
            Substitute::OwnVector { nearest: nearest_meaning(vocabulary, vector) }
        } else if let Some((number, known)) = nearest_spelling(vocabulary, &word) {
            reading.words.push(Word::Known(number));
            Substitute::Spelling { known: known.to_owned() }
        } else {
            Substitute::LeftOut
        };
        reading.notes.push(Note { word, substitute });
    }
    if reading.words.is_empty() {
        return Err(TranslationError::NoWords { caption: caption.chars().take(MAX_QUOTED).collect() });
    }
    Ok(reading)
}

/// The known word with the nearest vector, and the cosine.
fn nearest_meaning(vocabulary: &Vocabulary, vector: &[f32]) -> Option<(String, f64)> {
    let dot =
        |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(&x, &y)| f64::from(x) * f64::from(y)).sum() };
    let cosine = |other: &[f32]| {
        let lengths = (dot(vector, vector) * dot(other, other)).sqrt();
        if lengths > 0.0 { dot(vector, other) / lengths } else { 0.0 }
    };
    let known = vocabulary.words.iter().zip(&vocabulary.vectors);
    known
        .filter_map(|(word, other)| Some((word, cosine(other.as_ref()?))))
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
        .map(|(word, cosine)| (word.clone(), cosine))
}

/// The known word that is fewest insertions, deletions, replacements and swaps of neighbours away.
///
/// At most a quarter of the letters may differ, and not the first, which typing errors seldom hit; of equally near words the
/// first by alphabet is taken. Marks, numbers and words of fewer than four letters have no near spelling.
fn nearest_spelling<'v>(vocabulary: &'v Vocabulary, word: &str) -> Option<(u32, &'v str)> {
    let letters = word.chars().count();
    if letters > MAX_LETTERS || !word.chars().all(|c| c.is_alphabetic() || "-'/".contains(c)) {
        return None;
    }
    let most = letters / 4;
    let first = word.chars().next();
    let candidates = vocabulary.words.iter().enumerate().skip(2);
    let (distance, number, known) = candidates
        .filter(|(_, known)| known.chars().next() == first && known.len().abs_diff(word.len()) <= 4 * most)
        .map(|(number, known)| (strsim::osa_distance(word, known), number as u32, known.as_str()))
        .min_by_key(|(distance, number, _)| (*distance, *number))?;
    (distance <= most).then_some((number, known))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vocabulary() -> Vocabulary {
        let words = ["<bos>", "<eos>", ",", "a", "left-handed", "person", "walks", "waves"];
        let vectors = [None, None, None, None, None, Some([1.0, 0.0]), Some([0.0, 1.0]), Some([0.6, 0.8])];
        Vocabulary {
            words: words.map(str::to_owned).to_vec(),
            dimensions: 2,
            vectors: vectors.map(|vector| vector.map(|vector| vector.to_vec())).to_vec(),
        }
    }

    fn read_with(vectors: &[(&str, [f32; 2])], caption: &str) -> Result<Reading, TranslationError> {
        let vectors = vectors.iter().map(|(word, vector)| ((*word).to_owned(), vector.to_vec())).collect();
        read(rule_of(&vocabulary()), &vocabulary(), &vectors, caption)
    }

    #[test]
    fn known_words_enter_by_number_without_a_note() {
        let reading = read_with(&[], "A person, walks.").unwrap();
        assert_eq!(reading.words, [3, 5, 2, 6].map(Word::Known));
        assert_eq!(reading.notes, []);
    }

    #[test]
    fn a_word_with_a_vector_is_itself() {
        let reading = read_with(&[("strolls", [0.1, 0.9])], "a person strolls").unwrap();
        assert_eq!(reading.words[2], Word::Vector(vec![0.1, 0.9]));
        let note = reading.notes[0].to_string();
        assert!(note.contains("\"strolls\"") && note.contains("\"walks\" (cosine 0.99)"), "{note}");
    }

    #[test]
    fn without_a_vector_the_spelling_decides_and_nothing_is_guessed_from_afar() {
        let reading = read_with(&[], "a persno waks and strolls, alks 360").unwrap();
        let substitutes: Vec<&Substitute> = reading.notes.iter().map(|note| &note.substitute).collect();
        let spelling = |known: &str| Substitute::Spelling { known: known.to_owned() };
        assert_eq!(
            substitutes,
            [
                &spelling("person"),
                &spelling("walks"),
                &Substitute::LeftOut,
                &Substitute::LeftOut,
                &Substitute::LeftOut,
                &Substitute::LeftOut
            ]
        );
        assert_eq!(reading.words, [3, 5, 6, 2].map(Word::Known));
    }

    #[test]
    fn nothing_to_read_is_an_error() {
        for caption in ["", "  ", "xyzzy plugh", "42"] {
            let error = read_with(&[], caption).unwrap_err();
            assert!(matches!(error, TranslationError::NoWords { .. }), "{error}");
        }
        let error = read_with(&[], &"a ".repeat(MAX_WORDS + 1)).unwrap_err();
        assert_eq!(error, TranslationError::TooManyWords { found: MAX_WORDS + 1 });
    }

    #[test]
    fn the_vocabulary_shows_how_its_words_were_cut() {
        assert_eq!(rule_of(&vocabulary()), TokenRule::default());
        let mut other = vocabulary();
        other.words = ["<bos>", "<eos>", "'s", ".", "A", "left"].map(str::to_owned).to_vec();
        let rule = rule_of(&other);
        assert_eq!(
            (rule.lower_case, rule.punctuation, rule.full_stop, rule.split_contractions, rule.split_hyphens),
            (false, false, true, true, true)
        );
    }
}
