//! What is done, in one word, for colours.

/// Beginnings of words and what they are called, the first that a caption has.
const VERBS: [(&str, &str); 15] = [
    ("danc", "dance"),
    ("jump", "jump"),
    ("hop", "jump"),
    ("leap", "jump"),
    ("run", "run"),
    ("jog", "run"),
    ("sprint", "run"),
    ("climb", "stairs"),
    ("stair", "stairs"),
    ("step", "stairs"),
    ("wav", "wave, wipe, play"),
    ("wip", "wave, wipe, play"),
    ("wash", "wave, wipe, play"),
    ("play", "wave, wipe, play"),
    ("walk", "walk"),
];

/// The label of a caption: its verb; walks are told apart by their path.
#[must_use]
pub fn verb_label(caption: &str) -> &'static str {
    let caption = caption.to_lowercase();
    let words: Vec<&str> = caption.split(|symbol: char| !symbol.is_alphanumeric()).collect();
    let has = |start: &str| words.iter().any(|word| word.starts_with(start));
    if has("walk") {
        return match () {
            () if has("circle") || has("curve") || has("turn") || has("around") => "walk, turning",
            () if has("back") => "walk backward",
            () if has("stair") || has("step") || has("climb") => "stairs",
            () => "walk",
        };
    }
    VERBS.iter().find(|(start, _)| has(start)).map_or("other", |(_, label)| label)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_get_their_verb() {
        for (caption, label) in [
            ("A person walks forward.", "walk"),
            ("Someone is walking in a circle", "walk, turning"),
            ("a human is running", "run"),
            ("Somebody hops on one leg", "jump"),
            ("a person wipes a table", "wave, wipe, play"),
            ("a person bows", "other"),
        ] {
            assert_eq!(verb_label(caption), label, "{caption}");
        }
    }
}
