//! A comparison as JUnit XML, which CI systems show as tests.

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::compare::{CaseFate, Change, Comparison};

/// A comparison as JUnit XML: one test a case, failed where the case regressed.
///
/// # Errors
/// When the report cannot be written as XML.
pub fn comparison_junit(comparison: &Comparison) -> Result<String, quick_junit::SerializeError> {
    let mut suite = TestSuite::new("rprae regress");
    for (id, fate) in &comparison.cases {
        let regressed: Vec<&Change> = comparison
            .changes
            .iter()
            .filter(|change| change.case == *id && change.verdict.is_regression())
            .collect();
        let status = match fate {
            CaseFate::Failed { reason } => failure("the case failed", reason),
            CaseFate::Missing { reason } => {
                failure("the case is missing", reason.as_deref().unwrap_or("the run does not have it"))
            }
            CaseFate::Compared if !regressed.is_empty() => {
                let lines: Vec<String> = regressed.iter().map(|change| line(change)).collect();
                failure(&format!("{} metrics regressed", lines.len()), &lines.join("\n"))
            }
            CaseFate::Compared | CaseFate::New => TestCaseStatus::success(),
        };
        let mut test = TestCase::new(id.as_str(), status);
        test.set_classname("rprae.regress");
        suite.add_test_case(test);
    }
    let mut report = Report::new("rprae");
    report.add_test_suite(suite);
    report.to_string()
}

fn failure(message: &str, description: &str) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_message(message).set_description(description);
    status
}

fn line(change: &Change) -> String {
    let value = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), |value| value.to_string());
    format!(
        "{}: {} ({} -> {}, allowed change {})",
        change.metric,
        change.verdict.word(),
        value(change.before),
        value(change.after),
        change.allowed
    )
}

#[cfg(test)]
mod tests {
    use super::super::super::case::samples::case;
    use super::super::super::results::samples::results;
    use super::super::{Baseline, compare};
    use super::*;

    #[test]
    fn one_test_a_case() {
        let before = results(vec![case("a", &[("l0/skate", 1.0)]), case("b", &[("l0/skate", 3.0)])]);
        let mut failed = case("c<&>", &[]);
        failed.failures.push("not a number".to_owned());
        let after = results(vec![case("b", &[("l0/skate", 9.0)]), failed, case("d", &[])]);
        let comparison = compare(&Baseline::accept(&before, None).unwrap(), &after).unwrap();
        let xml = comparison_junit(&comparison).unwrap();
        assert!(xml.contains("tests=\"4\" skipped=\"0\" errors=\"0\" failures=\"3\""), "{xml}");
        assert!(xml.contains("l0/skate: worse (3 -&gt; 9, allowed change 0.56)"), "{xml}");
        assert!(xml.contains("c&lt;&amp;&gt;"), "{xml}");
    }
}
