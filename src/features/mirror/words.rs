//! What a sentence says of its movement in a mirror.

use crate::features::Vocabulary;

/// Endings that make a side another word: `leftwards`, `right-handed`.
const ENDINGS: [&str; 8] = ["", "ward", "wards", "most", "hand", "handed", "side", "sided"];
/// Spellings of one sense of rotation, the usual one first.
const CLOCKWISE: [&str; 2] = ["clockwise", "clock-wise"];
/// Spellings of the other one.
const COUNTERCLOCKWISE: [&str; 6] = [
    "counterclockwise",
    "counter-clockwise",
    "anticlockwise",
    "anti-clockwise",
    "counter-clock-wise",
    "anti-clock-wise",
];
/// Words that only look like a side.
const NEUTRAL: [&str; 5] = ["upright", "bright", "brightly", "alright", "outright"];
/// Words before which `right` may be no side: right after, right angle.
const NO_SIDE_BEFORE: [&str; 7] = ["after", "angle", "angled", "angles", "away", "before", "now"];
/// Words that turn a `clockwise` behind them round.
const TURNS_ROUND: [&str; 2] = ["counter", "anti"];

/// What becomes of a word.
#[derive(Debug, PartialEq, Eq)]
enum Image {
    /// It says nothing of sides.
    Same,
    /// The spellings its image may have, the usual one first.
    Other(Vec<String>),
    /// It may name a side in a way that is not known here.
    Unclear,
}

/// The image of a word, whatever vocabulary there is.
fn image(word: &str) -> Image {
    let spellings = |words: &[&str]| Image::Other(words.iter().map(|&word| word.to_owned()).collect());
    if CLOCKWISE.contains(&word) {
        return spellings(&COUNTERCLOCKWISE);
    }
    if COUNTERCLOCKWISE.contains(&word) {
        return spellings(&CLOCKWISE);
    }
    let mut mirrored = String::new();
    for part in word.split_inclusive(['-', '/']) {
        let (part, link) = match part.strip_suffix(['-', '/']) {
            Some(bare) => (bare, &part[bare.len()..]),
            None => (part, ""),
        };
        let exchange = |from: &str, to: &str| {
            let ending = part.strip_prefix(from).filter(|ending| ENDINGS.contains(ending));
            ending.map(|ending| format!("{to}{ending}"))
        };
        if let Some(other) = exchange("left", "right").or_else(|| exchange("right", "left")) {
            mirrored.push_str(&other);
        } else if !NEUTRAL.contains(&part)
            && ["left", "right", "clock"].iter().any(|side| part.to_lowercase().contains(side))
        {
            return Image::Unclear;
        } else {
            mirrored.push_str(part);
        }
        mirrored.push_str(link);
    }
    if mirrored == word { Image::Same } else { Image::Other(vec![mirrored]) }
}

/// The images of the words of a vocabulary.
pub(super) struct MirroredWords<'v> {
    vocabulary: &'v Vocabulary,
    /// Number of the image of each word; `None` where the vocabulary has none, or it is unclear.
    images: Vec<Option<u32>>,
}

impl<'v> MirroredWords<'v> {
    pub(super) fn of(vocabulary: &'v Vocabulary) -> Self {
        let images = vocabulary.words.iter().zip(0..).map(|(word, number)| match image(word) {
            Image::Same => Some(number),
            Image::Other(spellings) => spellings.iter().find_map(|word| vocabulary.index(word)),
            Image::Unclear => None,
        });
        Self { vocabulary, images: images.collect() }
    }

    /// What a caption, words by number, says in the mirror; `None` where a word has no image in the vocabulary or may mean
    /// something else than a side.
    pub(super) fn caption(&self, caption: &[u32]) -> Option<Vec<u32>> {
        let text = |word: u32| self.vocabulary.words.get(word as usize).map_or("", String::as_str);
        let is_unclear = caption.windows(2).any(|pair| {
            let (first, second) = (text(pair[0]), text(pair[1]));
            first == "right" && NO_SIDE_BEFORE.contains(&second)
                || TURNS_ROUND.contains(&first) && CLOCKWISE.contains(&second)
        });
        if is_unclear {
            return None;
        }
        caption.iter().map(|&word| self.images.get(word as usize).copied().flatten()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_and_senses_of_rotation_are_exchanged() {
        let other = |words: &[&str]| Image::Other(words.iter().map(|&word| word.to_owned()).collect());
        for (word, expected) in [
            ("left", "right"),
            ("rightwards", "leftwards"),
            ("left-handed", "right-handed"),
            ("righthand", "lefthand"),
            ("left/right", "right/left"),
            ("front-left", "front-right"),
        ] {
            assert_eq!(image(word), other(&[expected]));
        }
        assert_eq!(image("clockwise"), other(&COUNTERCLOCKWISE));
        assert_eq!(image("anti-clockwise"), other(&CLOCKWISE));
        for word in ["walks", "upright", "<bos>", "-", "forward", "clothes"] {
            assert_eq!(image(word), Image::Same, "{word}");
        }
        for word in ["rightturn", "Left", "conterclockwise", "leftover", "o'clock"] {
            assert_eq!(image(word), Image::Unclear, "{word}");
        }
    }

    fn vocabulary(words: &[&str]) -> Vocabulary {
        let mut words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
        words.sort();
        words.splice(0..0, ["<bos>".to_owned(), "<eos>".to_owned()]);
        Vocabulary { dimensions: 1, vectors: vec![None; words.len()], words }
    }

    fn said(vocabulary: &Vocabulary, caption: &str) -> Option<String> {
        let numbers: Vec<u32> = caption.split(' ').map(|word| vocabulary.index(word).unwrap()).collect();
        let image = MirroredWords::of(vocabulary).caption(&numbers)?;
        let words: Vec<&str> = image.iter().map(|&word| vocabulary.words[word as usize].as_str()).collect();
        Some(words.join(" "))
    }

    #[test]
    fn a_caption_is_mirrored_whole_or_not_at_all() {
        let known = vocabulary(&[
            "after",
            "anti",
            "anticlockwise",
            "clockwise",
            "left",
            "leftwards",
            "right",
            "turns",
        ]);
        let mirrored = |caption| said(&known, caption);
        assert_eq!(mirrored("turns right").as_deref(), Some("turns left"));
        assert_eq!(mirrored("left right turns").as_deref(), Some("right left turns"));
        assert_eq!(mirrored("turns clockwise").as_deref(), Some("turns anticlockwise"));
        assert_eq!(mirrored("turns anticlockwise").as_deref(), Some("turns clockwise"));
        assert_eq!(mirrored("turns").as_deref(), Some("turns"));
        assert_eq!(mirrored("turns leftwards"), None, "there is no rightwards");
        assert_eq!(mirrored("turns right after"), None);
        assert_eq!(mirrored("anti clockwise"), None);
        assert_eq!(said(&vocabulary(&["clockwise"]), "clockwise"), None);
    }
}
