//! Numbers and texts in the space a table has.

use std::fmt::Write as _;

use console::measure_text_width;

/// A number with about three significant digits, for tables; files keep every digit.
///
/// Not a number in, `nan` out: a table must never hide it.
#[must_use]
pub fn compact(value: f64) -> String {
    let magnitude = value.abs();
    match magnitude {
        // Also the negative zero, whose sign says nothing to a reader.
        0.0 => "0".to_owned(),
        _ if !value.is_finite() => format!("{value}").to_lowercase(),
        _ if magnitude >= 1.0e6 => format!("{value:.1e}"),
        _ if magnitude >= 99.95 => format!("{value:.0}"),
        _ if magnitude >= 9.995 => format!("{value:.1}"),
        _ if magnitude >= 0.9995 => format!("{value:.2}"),
        _ if magnitude >= 0.0005 => format!("{value:.3}"),
        _ => format!("{value:.0e}"),
    }
}

/// A number of things, as one says it: `1 case`, `2 cases`.
#[must_use]
pub fn counted(count: usize, thing: &str) -> String {
    if count == 1 { format!("1 {thing}") } else { format!("{count} {thing}s") }
}

/// A number with so many digits after the point, zero without a sign.
#[must_use]
pub fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(magnitude) if magnitude.bytes().all(|byte| matches!(byte, b'0' | b'.')) => magnitude.to_owned(),
        _ => text,
    }
}

/// A change, always with its sign.
#[must_use]
pub(super) fn signed(value: f64) -> String {
    if value > 0.0 { format!("+{}", compact(value)) } else { compact(value) }
}

/// The text in at most `width` columns, its end replaced by `…` where it does not fit.
///
/// Control characters, line breaks among them, become spaces: a caption may hold anything.
#[must_use]
pub fn shorten(text: &str, width: usize) -> String {
    let clean: String = text.chars().map(|symbol| if symbol.is_control() { ' ' } else { symbol }).collect();
    if measure_text_width(&clean) <= width {
        return clean;
    }
    console::truncate_str(&clean, width, "…").into_owned()
}

/// The text with the five characters that mean something to HTML and XML replaced.
#[must_use]
pub(super) fn escape_html(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for symbol in text.chars() {
        match symbol {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// The text as one cell of a Markdown table.
#[must_use]
pub(super) fn escape_markdown(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for symbol in text.chars() {
        match symbol {
            // Not the underscore: inside a word, as in every metric key, it means nothing.
            '|' | '\\' | '`' | '*' | '<' | '>' | '[' | ']' => {
                let _ = write!(escaped, "\\{symbol}");
            }
            other if other.is_control() => escaped.push(' '),
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        let expected = [
            (0.0, "0"),
            (-0.0, "0"),
            (1234.5, "1234"),
            (99.96, "100"),
            (12.345, "12.3"),
            (9.996, "10.0"),
            (-1.234, "-1.23"),
            (0.01234, "0.012"),
            (0.0001, "1e-4"),
            (2.0e7, "2.0e7"),
            (f64::NAN, "nan"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in expected {
            assert_eq!(compact(value), text);
        }
        assert_eq!([1, 2, 0].map(|count| counted(count, "case")), ["1 case", "2 cases", "0 cases"]);
        assert_eq!([fixed(-0.3, 0), fixed(-0.6, 0), fixed(-0.004, 2)], ["0", "-1", "0.00"]);
        assert_eq!(fixed(12.345, 1), "12.3");
        assert_eq!(signed(0.5), "+0.500");
        assert_eq!(signed(-0.5), "-0.500");
    }

    #[test]
    fn texts_fit_and_stay_on_their_line() {
        assert_eq!(shorten("walks\nforward", 20), "walks forward");
        assert_eq!(shorten("walks forward", 6), "walks…");
        assert_eq!(shorten("歩く人がいる", 5), "歩く…");
    }

    #[test]
    fn markup_in_a_caption_stays_text() {
        assert_eq!(escape_html("<b>\"a\" & 'b'"), "&lt;b&gt;&quot;a&quot; &amp; &#39;b&#39;");
        assert_eq!(escape_markdown("a|b\n*c*"), "a\\|b \\*c\\*");
    }
}
