//! Findings for a person, for programs, and for CI.

use std::fmt::Write as _;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use serde::Serialize;

use super::{Finding, Linted, Severity};
use crate::manifest::VERSION;

#[derive(Serialize)]
struct Json<'l> {
    rprae: &'static str,
    num_motions: usize,
    num_errors: usize,
    num_warnings: usize,
    motions: Vec<&'l Linted>,
}

fn count(linted: &[Linted], severity: Severity) -> usize {
    linted.iter().flat_map(|one| &one.findings).filter(|finding| finding.severity == severity).count()
}

fn line(finding: &Finding) -> String {
    let place = if finding.place.is_empty() { String::new() } else { format!("{}: ", finding.place) };
    format!("{} {}: {place}{}", finding.severity.word(), finding.code, finding.message)
}

/// Findings of at least this severity by motion, each with its remedy, and a line of counts.
///
/// A motion with notes only counts as clean.
#[must_use]
pub fn findings_text(linted: &[Linted], least: Severity) -> String {
    let mut text = String::new();
    for one in linted.iter().filter(|one| one.worst() >= Some(least)) {
        let _ = writeln!(text, "{} ({})", one.id, one.source);
        for finding in one.findings.iter().filter(|finding| finding.severity >= least) {
            let _ = writeln!(text, "  {}\n    remedy: {}", line(finding), finding.remedy);
        }
    }
    let num_notes = count(linted, Severity::Info);
    let clean = linted.iter().filter(|one| one.worst() < Some(Severity::Warning)).count();
    let _ = writeln!(
        text,
        "motions: {}, {clean} clean; errors: {}, warnings: {}, notes: {num_notes}{}",
        linted.len(),
        count(linted, Severity::Error),
        count(linted, Severity::Warning),
        if num_notes > 0 && least > Severity::Info { " (shown with --notes)" } else { "" }
    );
    text
}

/// Motions with findings as JSON.
///
/// # Errors
/// When a value has no JSON form.
pub fn findings_json(linted: &[Linted]) -> Result<String, serde_json::Error> {
    let mut json = serde_json::to_string_pretty(&Json {
        rprae: VERSION,
        num_motions: linted.len(),
        num_errors: count(linted, Severity::Error),
        num_warnings: count(linted, Severity::Warning),
        motions: linted.iter().filter(|one| !one.findings.is_empty()).collect(),
    })?;
    json.push('\n');
    Ok(json)
}

/// One test a motion as JUnit XML, failed where it has an error, or a warning if those count.
///
/// # Errors
/// When the report cannot be written as XML.
pub fn findings_junit(linted: &[Linted], warnings_fail: bool) -> Result<String, quick_junit::SerializeError> {
    let fails = if warnings_fail { Severity::Warning } else { Severity::Error };
    let mut suite = TestSuite::new("rprae lint");
    for one in linted {
        let lines: Vec<String> = one.findings.iter().map(line).collect();
        let failed = one.worst().is_some_and(|worst| worst >= fails);
        let status = if failed {
            let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
            status.set_message(lines[0].clone()).set_description(lines.join("\n"));
            status
        } else {
            TestCaseStatus::success()
        };
        let mut test = TestCase::new(one.id.as_str(), status);
        test.set_classname("rprae.lint");
        if !failed && !lines.is_empty() {
            test.set_system_out(lines.join("\n"));
        }
        suite.add_test_case(test);
    }
    let mut report = Report::new("rprae");
    report.add_test_suite(suite);
    report.to_string()
}
