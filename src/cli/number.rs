//! Numbers of a command line. A number below zero is a value too, and is refused by the range of what it is for.

/// Largest seed: TOML has no larger whole number.
const MAX_SEED: u64 = i64::MAX as u64;

/// A whole number of at least 1.
pub(super) fn count(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|&number| number > 0);
    number.ok_or_else(|| "expected a whole number of at least 1".to_owned())
}

/// A whole number of at least 0.
pub(super) fn whole(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "expected a whole number of at least 0".to_owned())
}

/// A seed that settings can hold.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    let number = text.parse().ok().filter(|&number| number <= MAX_SEED);
    number.ok_or_else(|| format!("expected a whole number from 0 to {MAX_SEED}"))
}

/// A number, or one number divided by another: `1/480`.
pub(super) fn fraction(text: &str) -> Result<f64, String> {
    let number = |part: &str| {
        part.trim().parse::<f64>().map_err(|_| "expected a number or a fraction such as 1/480".to_owned())
    };
    match text.split_once('/') {
        Some((above, below)) => Ok(number(above)? / number(below)?),
        None => number(text),
    }
}

/// A share of body weight, up to 1, or in percent, which must be said: `0.2` and `20%` are the same, `20` is refused.
pub(super) fn share_of_weight(text: &str) -> Result<f64, String> {
    const EXPECTED: &str =
        "expected a share of body weight from 0 to 1, such as 0.2, or percent with their sign, such as 20%";
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| EXPECTED.to_owned());
    match text.trim().strip_suffix('%') {
        Some(percent) => Ok(number(percent)? / 100.0),
        None => match number(text)? {
            share if share > 1.0 => Err(EXPECTED.to_owned()),
            share => Ok(share),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_may_be_fractions() {
        assert_eq!(fraction("1/480"), Ok(1.0 / 480.0));
        assert_eq!(fraction("0.002"), Ok(0.002));
        assert!(fraction("one").is_err());
        // A division by zero is caught by the range of the setting.
        assert_eq!(fraction("1/0"), Ok(f64::INFINITY));
    }

    #[test]
    fn a_share_is_never_taken_for_percent() {
        assert_eq!(
            [share_of_weight("0.2"), share_of_weight("20%"), share_of_weight("150 %")],
            [Ok(0.2), Ok(0.2), Ok(1.5)]
        );
        assert!(share_of_weight("20").unwrap_err().contains("20%"));
        // Whatever is below 0 is refused by the setting.
        assert_eq!(share_of_weight("-0.2"), Ok(-0.2));
        assert!(share_of_weight("much").is_err() && share_of_weight("%").is_err());
    }

    #[test]
    fn whole_numbers_know_where_they_begin_and_end() {
        assert_eq!((count("1"), whole("0"), seed("9223372036854775807")), (Ok(1), Ok(0), Ok(MAX_SEED)));
        for refused in [count("0"), count("-1"), count("1.5"), whole("-1")] {
            assert!(refused.unwrap_err().contains("whole number of at least"));
        }
        assert!(seed("-1").unwrap_err().contains("from 0 to 9223372036854775807"));
        assert!(seed("9223372036854775808").is_err());
    }
}
