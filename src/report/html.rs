//! A run as one HTML page that needs nothing else: no scripts, no fonts, no network.

use std::fmt::Write as _;

use super::case::{CaseResult, MetricRecord};
use super::cell::cell;
use super::markdown::{count, interval};
use super::notes::{NoteKind, notes, remarks};
use super::number::{compact, counted, escape_html};
use super::ranking::worst_first;
use super::read_back::read_back_rows;
use super::results::Results;

const STYLE: &str = "\
body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:96rem;padding:0 1rem;color:#1c2733;background:#fff}\
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2.2rem}code{font-size:.85em;overflow-wrap:anywhere}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
th,td{padding:.3rem .6rem;border-bottom:1px solid #dde3ea;text-align:left;vertical-align:top}\
th{position:sticky;top:0;background:#fff}.n{text-align:right;white-space:nowrap}\
tr.failed td{background:#fdecea}tr.implausible td{background:#fff6e0}tr.held td{color:#5b6b7b}tr.fell td:last-child{color:#8a4b00}b{color:#b3261e}svg{display:block;margin-left:auto}\
rect.bar{fill:#7aa7d9}rect.bin{fill:#7aa7d9}small{color:#5b6b7b}\
@media(prefers-color-scheme:dark){body,th{background:#12181f;color:#dce5ee}th,td{border-color:#2b3742}\
tr.failed td{background:#3a1c1a}tr.implausible td{background:#33290f}tr.fell td:last-child{color:#f0b36a}b{color:#ff8a80}small{color:#93a3b3}a{color:#8ab8f0}}";

/// A run as a self-contained HTML page: cases from worst to best with the metrics in `keys`, a bar in each cell,
/// links to the recordings, a histogram for every metric, and the skipped inputs with their reasons.
#[must_use]
pub fn results_html(results: &Results, keys: &[&str]) -> String {
    let key = &results.key;
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>rprae: {title}</title>\
         <style>{STYLE}</style></head><body>\n<h1>Evaluation of {title}</h1>\n\
         <p>{cases}, {num_failed} failed, {num_held} not simulable, {skipped} skipped.<br>\
         <small>rprae {}, {}, {}; <code>{}</code></small></p>\n",
        escape_html(&key.rprae),
        escape_html(&key.engine),
        escape_html(&key.device),
        escape_html(&key.signature),
        title = escape_html(&results.dataset),
        cases = counted(results.cases.len(), "case"),
        num_failed = results.num_failed(),
        num_held = results.not_simulable().count(),
        skipped = counted(results.skipped.len(), "input"),
    );
    push_cases(&mut page, results, keys);
    push_read_back(&mut page, results);
    push_aggregates(&mut page, results);
    if !results.skipped.is_empty() {
        page.push_str(
            "<h2>Skipped inputs</h2>\n<div class=\"wide\"><table><tr><th>id<th>source<th>reason</tr>\n",
        );
        for skipped in &results.skipped {
            let [id, source, reason] =
                [&skipped.id, &skipped.source, &skipped.reason].map(|cell| escape_html(cell));
            let _ = writeln!(page, "<tr><td>{id}<td>{source}<td>{reason}</tr>");
        }
        page.push_str("</table></div>\n");
    }
    page.push_str("</body></html>\n");
    page
}

fn push_cases(page: &mut String, results: &Results, keys: &[&str]) {
    let shown: Vec<(&MetricRecord, f64)> = results
        .shown_metrics(keys)
        .map(|metric| {
            let largest = results
                .cases
                .iter()
                .filter_map(|case| case.score(&metric.key))
                .fold(0.0, |a, b| f64::max(a, b.abs()));
            (metric, largest)
        })
        .collect();
    page.push_str("<h2>Cases, worst first</h2>\n<div class=\"wide\"><table><tr><th>case<th>caption<th class=\"n\">length<br>s");
    for (metric, _) in &shown {
        let (title, unit) = (escape_html(&metric.title), escape_html(&metric.unit));
        let _ = write!(page, "<th class=\"n\">{} {title}<br>{unit}", metric.level);
    }
    page.push_str("<th>recordings<th>notes</tr>\n");
    for case in worst_first(results, keys) {
        push_case(page, case, &shown);
    }
    page.push_str("</table></div>\n");
}

fn push_case(page: &mut String, case: &CaseResult, shown: &[(&MetricRecord, f64)]) {
    let noted = notes(case);
    let class = match noted.first().map(|note| note.kind) {
        Some(NoteKind::Failed) => "failed",
        Some(NoteKind::NotSimulable) => "held",
        Some(NoteKind::Implausible) => "implausible",
        Some(NoteKind::Fell) => "fell",
        Some(NoteKind::Doubt) | None => "",
    };
    let (id, caption) = (escape_html(&case.id), escape_html(case.caption()));
    let _ =
        write!(page, "<tr class=\"{class}\"><td>{id}<td>{caption}<td class=\"n\">{:.1}", case.duration_secs);
    for (metric, largest) in shown {
        match case.score(&metric.key) {
            Some(value) => {
                let width = if *largest > 0.0 { 60.0 * value.abs() / largest } else { 0.0 };
                let _ = write!(
                    page,
                    "<td class=\"n\" title=\"{value}\">{}<svg width=\"60\" height=\"5\" aria-hidden=\"true\">\
                     <rect class=\"bar\" width=\"{width:.1}\" height=\"5\"/></svg>",
                    escape_html(&cell(case, &metric.key))
                );
            }
            None => page.push_str("<td class=\"n\">-"),
        }
    }
    let links: Vec<String> = case
        .levels
        .iter()
        .filter_map(|level| {
            let path = level.recording.as_ref()?;
            Some(format!("<a href=\"{}\">{}</a>", escape_html(&link(path)), level.level))
        })
        .collect();
    let texts: Vec<String> = noted
        .iter()
        .map(|note| match note.kind {
            NoteKind::Failed | NoteKind::Implausible => format!("<b>{}</b>", escape_html(&note.text)),
            NoteKind::NotSimulable | NoteKind::Fell | NoteKind::Doubt => escape_html(&note.text),
        })
        .collect();
    let _ = write!(page, "<td>{}<td>{}", links.join(" "), texts.join("<br>"));
    let details: Vec<String> = remarks(case)
        .iter()
        .map(|(when, what)| format!("{}: {}", escape_html(when), escape_html(what)))
        .collect();
    if !details.is_empty() {
        let _ = write!(
            page,
            "<details><summary>{} remarks</summary><small>{}</small></details>",
            details.len(),
            details.join("<br>")
        );
    }
    page.push_str("</tr>\n");
}

fn push_read_back(page: &mut String, results: &Results) {
    let mut rows = read_back_rows(results).peekable();
    if rows.peek().is_none() {
        return;
    }
    page.push_str(
        "<h2>Read back</h2>\n<p><small>What a model says the motions are, as they were given and as the humanoid performed \
         them with assist.</small></p>\n<div class=\"wide\"><table><tr><th>case<th>caption<th>given<th>performed</tr>\n",
    );
    for row in rows {
        let [id, caption, given, performed] = row.cells().map(escape_html);
        let _ = writeln!(page, "<tr><td>{id}<td>{caption}<td>{given}<td>{performed}</tr>");
    }
    page.push_str("</table></div>\n");
}

/// A path inside the run folder as a link: `%` would otherwise start an escape.
fn link(path: &str) -> String {
    path.replace('%', "%25").replace('#', "%23").replace('?', "%3F")
}

fn push_aggregates(page: &mut String, results: &Results) {
    page.push_str(
        "<h2>Over all cases</h2>\n<p><small>n counts the cases with a value. The interval of the mean is a 95 % \
         bootstrap over cases. The histogram spans the smallest to the largest value.</small></p>\n\
         <div class=\"wide\"><table><tr><th>metric<th>better<th class=\"n\">n<th class=\"n\">median\
         <th class=\"n\">min to max<th class=\"n\">mean<th class=\"n\">interval<th>histogram</tr>\n",
    );
    for aggregate in &results.aggregates {
        let Some(metric) = results.metric(&aggregate.key) else { continue };
        let values: Vec<f64> = results.cases.iter().filter_map(|case| case.score(&aggregate.key)).collect();
        let _ = writeln!(
            page,
            "<tr><td>{} {} <small>{}</small><td>{}<td class=\"n\">{}<td class=\"n\">{}<td class=\"n\">{} to {}\
             <td class=\"n\">{}<td class=\"n\">{}<td>{}</tr>",
            metric.level,
            escape_html(&metric.title_with_unit()),
            escape_html(&metric.key),
            metric.better.word(),
            count(aggregate),
            compact(aggregate.median),
            compact(aggregate.min),
            compact(aggregate.max),
            compact(aggregate.mean),
            interval(aggregate),
            histogram(&values, aggregate.min, aggregate.max),
        );
    }
    page.push_str("</table></div>\n");
}

/// A histogram of ten equal bins from `min` to `max` as inline SVG.
fn histogram(values: &[f64], min: f64, max: f64) -> String {
    const NUM_BINS: usize = 10;
    let mut bins = [0_usize; NUM_BINS];
    for value in values {
        let share = if max > min { (value - min) / (max - min) } else { 0.5 };
        bins[((share * NUM_BINS as f64) as usize).min(NUM_BINS - 1)] += 1;
    }
    let fullest = bins.iter().copied().max().unwrap_or(0).max(1);
    let mut svg = String::from("<svg width=\"120\" height=\"24\" role=\"img\" aria-label=\"histogram\">");
    for (index, bin) in bins.into_iter().enumerate() {
        let height = 24.0 * bin as f64 / fullest as f64;
        let (left, top) = (12 * index, 24.0 - height);
        let _ = write!(
            svg,
            "<rect class=\"bin\" x=\"{left}\" y=\"{top:.1}\" width=\"11\" height=\"{height:.1}\"/>"
        );
    }
    svg.push_str("</svg>");
    svg
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::super::results::samples::results;
    use super::*;

    #[test]
    fn page_is_self_contained_and_keeps_captions_as_text() {
        let mut walk = case("walk", &[("l0/skate", 1.5), ("l2/mpjpe", 20.0)]);
        walk.captions = vec!["<script>alert(1)</script>".to_owned()];
        walk.levels[1].recording = Some("recordings/50%25.L2.mcap".to_owned());
        let page = results_html(&results(vec![walk]), &["l0/skate", "l2/mpjpe"]);
        for forbidden in ["<script", "http:", "https:", "<link", "@import", "url("] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
        assert!(page.contains("&lt;script&gt;"));
        assert!(page.contains("href=\"recordings/50%2525.L2.mcap\""));
    }

    #[test]
    fn histogram_counts_every_value_once() {
        let svg = histogram(&[0.0, 0.0, 1.0], 0.0, 1.0);
        assert_eq!(svg.matches("height=\"24.0\"").count(), 1);
        assert_eq!(svg.matches("height=\"12.0\"").count(), 1);
        assert_eq!(svg.matches("height=\"0.0\"").count(), 8);
    }
}
