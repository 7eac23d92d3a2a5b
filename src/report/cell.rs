//! One value of one case, as a table shows it.

use super::case::CaseResult;
use super::number::compact;

/// The value of a metric in a few characters: `-` where there is none, `>` before a time that ended without a fall.
#[must_use]
pub(super) fn cell(case: &CaseResult, key: &str) -> String {
    let Some(value) = case.score(key) else { return "-".to_owned() };
    let censored = key.strip_suffix("/time_to_fall").is_some_and(|level| {
        // A body that never fell has the duration of its motion for a time to fall.
        case.score(&format!("{level}/survived")) == Some(1.0)
    });
    let text = compact(value);
    if censored { format!(">{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::*;

    #[test]
    fn a_time_without_a_fall_is_a_bound() {
        let stood = case("stand", &[("l3/time_to_fall", 4.6), ("l3/survived", 1.0)]);
        let fell = case("walk", &[("l3/time_to_fall", 3.3), ("l3/survived", 0.0)]);
        assert_eq!(cell(&stood, "l3/time_to_fall"), ">4.60");
        assert_eq!(cell(&fell, "l3/time_to_fall"), "3.30");
        assert_eq!(cell(&fell, "l2/time_to_fall"), "-");
    }
}
