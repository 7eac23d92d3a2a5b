//! White-space separated decimal numbers, straight from the text of an element.

use crate::dataset::one_line;

/// Why a text is not a list of numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NotANumber {
    /// The word in question, printable and short.
    pub(super) found: String,
}

/// Parses all numbers of `text` and hands each to `take`, without allocating.
pub(super) fn parse_numbers(text: &[u8], mut take: impl FnMut(f64)) -> Result<(), NotANumber> {
    let mut at = 0;
    loop {
        while at < text.len() && text[at].is_ascii_whitespace() {
            at += 1;
        }
        if at == text.len() {
            return Ok(());
        }
        let (value, length) = match simple_decimal(&text[at..]) {
            Some(parsed) => parsed,
            None => any_number(&text[at..])?,
        };
        take(value);
        at += length;
    }
}

/// Most digits whose value and power of ten are both exact doubles.
const EXACT_DIGITS: usize = 15;

/// Powers of ten up to [`EXACT_DIGITS`], each also exact as a double.
const POWERS: [u64; EXACT_DIGITS + 1] = {
    let mut powers = [1; EXACT_DIGITS + 1];
    let mut exponent = 1;
    while exponent <= EXACT_DIGITS {
        powers[exponent] = 10 * powers[exponent - 1];
        exponent += 1;
    }
    powers
};

/// A number such as `-0.0735726` at the start of `text`, and its length.
///
/// With at most [`EXACT_DIGITS`] digits both the digits and the power of ten are exact, so their quotient is the
/// correctly rounded value; `None` leaves everything else to [`any_number`].
#[expect(clippy::inline_always, reason = "a call per number costs a quarter of the speed")]
#[inline(always)]
fn simple_decimal(text: &[u8]) -> Option<(f64, usize)> {
    let negative = text[0] == b'-';
    let start = usize::from(negative);
    // Most angles: one digit, the point, up to seven digits and white space.
    if let Some(([whole @ b'0'..=b'9', b'.'], rest)) = text.get(start..)?.split_first_chunk()
        && let Some(eight) = rest.first_chunk()
    {
        let (part, decimals) = leading_digits(u64::from_le_bytes(*eight));
        if eight.get(decimals).is_some_and(u8::is_ascii_whitespace) {
            let digits = u64::from(whole - b'0') * POWERS[decimals] + part;
            return Some((scaled(digits, decimals, negative), start + 2 + decimals));
        }
    }
    let mut at = start;
    let mut value = 0;
    while let Some(byte @ b'0'..=b'9') = text.get(at) {
        if at == start + EXACT_DIGITS {
            return None;
        }
        value = value * 10 + u64::from(byte - b'0');
        at += 1;
    }
    let num_whole = at - start;
    let mut decimals = 0;
    if text.get(at) == Some(&b'.') {
        at += 1;
        // Eight bytes at a time: the number of decimals varies, and a branch on each would often be mispredicted.
        while let Some((eight, _)) = text[at..].split_first_chunk() {
            let (part, count) = leading_digits(u64::from_le_bytes(*eight));
            decimals += count;
            if num_whole + decimals > EXACT_DIGITS {
                return None;
            }
            value = value * POWERS[count] + part;
            at += count;
            if count < 8 {
                break;
            }
        }
        while let Some(byte @ b'0'..=b'9') = text.get(at) {
            decimals += 1;
            if num_whole + decimals > EXACT_DIGITS {
                return None;
            }
            value = value * 10 + u64::from(byte - b'0');
            at += 1;
        }
    }
    if num_whole + decimals == 0 || !text.get(at).is_none_or(u8::is_ascii_whitespace) {
        return None;
    }
    Some((scaled(value, decimals, negative), at))
}

/// `digits / 10^decimals` with a sign; exact operands, so correctly rounded.
#[inline]
fn scaled(digits: u64, decimals: usize, negative: bool) -> f64 {
    let magnitude = digits.cast_signed() as f64 / POWERS[decimals].cast_signed() as f64;
    // Signs follow no pattern, so setting the sign bit is cheaper than a branch.
    f64::from_bits(magnitude.to_bits() | u64::from(negative) << 63)
}

/// Value and number of the digits with which eight bytes (first byte lowest) begin.
#[inline]
fn leading_digits(bytes: u64) -> (u64, usize) {
    // A digit's byte becomes its value; any other byte gets a non-zero upper half, directly or after adding 6.
    // Carries of that addition run upwards only, so the lowest such byte is the first that is not a digit.
    let values = bytes ^ 0x3030_3030_3030_3030;
    let others = (values | values.wrapping_add(0x0606_0606_0606_0606)) & 0xf0f0_f0f0_f0f0_f0f0;
    let count = others.trailing_zeros() / 8;
    if count == 0 {
        return (0, 0);
    }
    // Moved to the top, the digits are preceded by zeros; then neighbours are joined to pairs, fours and all eight.
    let digits = values << (64 - 8 * count);
    let pairs = (digits * 10).wrapping_add(digits >> 8);
    let high = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(0x000f_4240_0000_0064);
    let low = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(0x0000_2710_0000_0001);
    (high.wrapping_add(low) >> 32, count as usize)
}

/// Any number that [`f64::from_str`](std::str::FromStr) reads (exponents, `nan`, many digits), and its length.
#[cold]
fn any_number(text: &[u8]) -> Result<(f64, usize), NotANumber> {
    let length = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    let word = &text[..length];
    match std::str::from_utf8(word).ok().and_then(|word| word.parse().ok()) {
        Some(value) => Ok((value, length)),
        None => Err(NotANumber { found: one_line(&String::from_utf8_lossy(&word[..length.min(64)])) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<Vec<f64>, NotANumber> {
        let mut values = Vec::new();
        parse_numbers(text.as_bytes(), |value| values.push(value))?;
        Ok(values)
    }

    #[test]
    fn reads_what_motion_files_hold() {
        let text = "\n 1142.97 -252.854\t0 -0 -8.33377e-09 .5 7. 1E2 +3 ";
        let expected = [1142.97, -252.854, 0.0, -0.0, -8.33377e-09, 0.5, 7.0, 100.0, 3.0];
        assert_eq!(parse(text).unwrap(), expected);
        assert_eq!(parse("").unwrap(), [] as [f64; 0]);
        assert_eq!(parse(" \n ").unwrap(), [] as [f64; 0]);
        assert!(parse("nan").unwrap()[0].is_nan());
        assert_eq!(parse("-inf").unwrap(), [f64::NEG_INFINITY]);
        assert_eq!(parse("1e999").unwrap(), [f64::INFINITY]);
    }

    #[test]
    fn names_what_is_not_a_number() {
        for (text, word) in [
            ("1 x 2", "x"),
            ("1.2.3", "1.2.3"),
            ("-", "-"),
            (".", "."),
            ("0,5", "0,5"),
            ("-nan(ind)", "-nan(ind)"),
            ("\u{662f}1", "\u{662f}1"),
        ] {
            assert_eq!(parse(text).unwrap_err().found, word, "{text}");
        }
        assert_eq!(parse(&"a".repeat(1000)).unwrap_err().found.len(), 64);
        assert_eq!(parse_numbers(b"1 \xff\n", |_| ()).unwrap_err().found, "\u{fffd}");
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_library_bit_for_bit(text in "-?[0-9]{1,17}(\\.[0-9]{0,17})?") {
            let expected: f64 = text.parse().unwrap();
            for ending in ["", " 1", "\n         "] {
                let found = parse(&format!("{text}{ending}")).unwrap()[0];
                prop_assert_eq!(found.to_bits(), expected.to_bits());
            }
        }

        #[test]
        fn any_bytes_are_read_as_the_standard_library_would(text in "[-+.0-9eE<:/ ]{1,24}") {
            let words = text.split_ascii_whitespace();
            let expected: Result<Vec<f64>, _> = words.map(str::parse).collect();
            match (parse(&text), expected) {
                (Ok(found), Ok(expected)) => {
                    prop_assert!(found.iter().map(|x| x.to_bits()).eq(expected.iter().map(|x| x.to_bits())));
                }
                (Err(_), Err(_)) => {}
                (found, expected) => prop_assert!(false, "{:?} {:?}", found, expected),
            }
        }
    }
}
