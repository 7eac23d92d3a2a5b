//! What is done, in one word, for colours.

/// Beginnings of words and what they are called, the first that a caption has.
const VERBS: [(&str, &str); 13] = [
    ("danc", "dance"),
    ("jump", "jump"),
    ("hop", "jump"),
    ("leap", "jump"),
    ("run", "run"),
    ("jog", "run"),
    ("sprint", "run"),
    ("climb", "stairs"),
    ("stair", "stairs"),
    ("wav", "wave, wipe, play"),
    ("wip", "wave, wipe, play"),
    ("wash", "wave, wipe, play"),
    ("play", "wave, wipe, play"),
];

/// The label of a caption: its verb; walks are told apart by their path.
#[must_use]
pub fn verb_label(caption: &str) -> &'static str {
    let caption = caption.to_lowercase();
    let words: Vec<&str> = caption.split(|symbol: char| !symbol.is_alphanumeric()).collect();
    let has = |start: &str| words.iter().any(|word| word.starts_with(start));
    if !has("walk") {
        return VERBS.iter().find(|(start, _)| has(start)).map_or("other", |(_, label)| label);
    }
    if ["circle", "curve", "turn", "around"].iter().any(|start| has(start)) {
        "walk, turning"
    } else if has("back") {
        "walk backward"
    } else if ["stair", "climb", "upstairs", "downstairs"].iter().any(|start| has(start)) {
        "stairs"
    } else {
        "walk"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_get_their_verb() {
        for (caption, label) in [
            ("A person walks forward.", "walk"),
            ("Someone is walking in a circle", "walk, turning"),
            ("a person walks a few steps forward", "walk"),
            ("Someone walks up the stairs", "stairs"),
            ("a human is running", "run"),
            ("Somebody hops on one leg", "jump"),
            ("a person wipes a table", "wave, wipe, play"),
            ("a person bows", "other"),
        ] {
            assert_eq!(verb_label(caption), label, "{caption}");
        }
    }
}
