//! Captions: checked sentences.

use super::one_line;

/// Longest caption kept, characters; KIT-ML's longest has about 250.
const MAX_CAPTION_CHARS: usize = 2000;

/// Most captions kept for one motion; KIT-ML's most described motion has 13.
const MAX_CAPTIONS: usize = 1000;

/// Parses an `_annotations.json`: an array of sentences, possibly empty.
pub(super) fn parse_annotations(json: &[u8]) -> Result<Vec<String>, String> {
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    serde_json::from_slice(json).map_err(|error| one_line(&error.to_string()))
}

/// Captions with single spaces and without control characters; empty and absurdly long ones are left out and counted
/// in a warning.
pub(super) fn clean_captions(captions: &[String], warnings: &mut Vec<String>) -> Vec<String> {
    let mut kept = Vec::new();
    let (mut empty, mut long) = (0, 0);
    for caption in captions {
        let words: Vec<&str> =
            caption.split(|c: char| c.is_whitespace() || c.is_control()).filter(|w| !w.is_empty()).collect();
        let caption = words.join(" ");
        if caption.is_empty() {
            empty += 1;
        } else if caption.chars().nth(MAX_CAPTION_CHARS).is_some() {
            long += 1;
        } else {
            kept.push(caption);
        }
    }
    if empty > 0 {
        warnings.push(format!("empty captions left out: {empty}"));
    }
    if long > 0 {
        warnings.push(format!("captions of more than {MAX_CAPTION_CHARS} characters left out: {long}"));
    }
    if kept.len() > MAX_CAPTIONS {
        warnings.push(format!("only the first {MAX_CAPTIONS} of {} captions are kept", kept.len()));
        kept.truncate(MAX_CAPTIONS);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_become_single_lines() {
        let mut warnings = Vec::new();
        let captions =
            ["  a person\n walks, \"slowly\"\t", "", " \u{0} ", "رجل يمشي", &"x".repeat(10_000_000)]
                .map(str::to_owned);
        assert_eq!(clean_captions(&captions, &mut warnings), ["a person walks, \"slowly\"", "رجل يمشي"]);
        assert_eq!(
            warnings,
            ["empty captions left out: 2", "captions of more than 2000 characters left out: 1"]
        );
    }

    #[test]
    fn annotations_that_are_no_list_of_sentences_are_refused() {
        assert_eq!(parse_annotations(b"\xef\xbb\xbf[\"a\", \"b\"]").unwrap(), ["a", "b"]);
        assert_eq!(parse_annotations(b"[]").unwrap(), [] as [&str; 0]);
        for bad in [&b""[..], b"{}", b"[1]", b"[\"a\"", b"[\"\xff\"]", &b"[".repeat(100_000)] {
            let reason = parse_annotations(bad).unwrap_err();
            assert!(!reason.is_empty() && !reason.contains('\n'), "{reason}");
        }
    }
}
