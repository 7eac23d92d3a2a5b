//! The files of a finished run.

use std::io;

use super::{Run, RunFolder};
use crate::report::{results_html, results_markdown, scores_csv};

/// Writes everything that is made from all cases together; `keys` are the metrics that the reports show per case.
///
/// # Errors
/// Any error of the file system.
pub fn publish(run: &Run, folder: &RunFolder, keys: &[&str]) -> io::Result<()> {
    folder.write_json("manifest.json", &run.manifest)?;
    folder.write_json("timings.json", &run.timings)?;
    folder.write("scores.csv", scores_csv(&run.results).as_bytes())?;
    folder.write("report.md", results_markdown(&run.results, keys).as_bytes())?;
    folder.write("report.html", results_html(&run.results, keys).as_bytes())?;
    let mut lines = String::new();
    for case in &run.results.cases {
        lines.push_str(&serde_json::to_string(case)?);
        lines.push('\n');
    }
    folder.write("samples.jsonl", lines.as_bytes())?;
    // Last, so that a folder with results.json is complete.
    folder.write_json("results.json", &run.results)
}
