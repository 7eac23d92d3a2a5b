//! The losses of a run as a picture.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::error::TrainingError;
use super::record::{Line, LossValues};

/// Width and height of a panel, pixels.
const PANEL: (f64, f64) = (420.0, 190.0);
/// Space around the panels, pixels.
const MARGIN: f64 = 52.0;
/// Most points of a line; more iterations are averaged.
const MAX_POINTS: usize = 300;

/// Colours of training and validation.
const COLOURS: [&str; 2] = ["#1f6fb4", "#d1495b"];

/// The lines of a `metrics.jsonl`.
///
/// # Errors
/// [`TrainingError::Io`] names the file and the line.
pub fn read_metrics(path: &Path) -> Result<Vec<Line>, TrainingError> {
    let io = |error| TrainingError::Io { doing: "read", path: path.to_owned(), error };
    let text = fs::read_to_string(path).map_err(io)?;
    text.lines()
        .enumerate()
        .map(|(number, line)| {
            serde_json::from_str(line)
                .map_err(|error| io(std::io::Error::other(format!("line {}: {error}", number + 1))))
        })
        .collect()
}

/// Losses over iterations as SVG, a panel for each loss on a logarithmic scale: training in blue, validation in red, a
/// dashed line where stage 2 begins.
#[must_use]
pub fn curves(lines: &[Line], stage2_begins: usize) -> String {
    type Pick = fn(&LossValues) -> Option<f64>;
    let panels: [(&str, Pick); 4] = [
        ("description, nats a word", |loss| Some(loss.description)),
        ("action, squared units a frame", |loss| Some(loss.action)),
        ("binding", |loss| loss.binding),
        ("length, squared log", |loss| Some(loss.length)),
    ];
    let (width, height) = (2.0 * PANEL.0 + 3.0 * MARGIN, 2.0 * PANEL.1 + 3.0 * MARGIN);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (place, (title, pick)) in panels.into_iter().enumerate() {
        let left = MARGIN + (place % 2) as f64 * (PANEL.0 + MARGIN);
        let top = MARGIN * 0.8 + (place / 2) as f64 * (PANEL.1 + MARGIN);
        let train = series(lines, pick, false);
        let validation = series(lines, pick, true);
        let panel = Panel::new(left, top, &train, &validation, lines, stage2_begins);
        panel.draw(&mut svg, title, [&train, &validation]);
    }
    svg.push_str("</svg>\n");
    svg
}

/// Iterations and losses above 0, averaged over neighbours where there are many.
fn series(lines: &[Line], pick: fn(&LossValues) -> Option<f64>, of_validation: bool) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = lines
        .iter()
        .filter_map(|line| match line {
            Line::Iteration(found) if !of_validation => Some((found.iteration, pick(&found.loss)?)),
            Line::Validation(found) if of_validation => Some((found.iteration, pick(&found.validation)?)),
            _ => None,
        })
        .filter(|(_, loss)| loss.is_finite() && *loss > 0.0)
        .map(|(iteration, loss)| (iteration as f64, loss))
        .collect();
    points
        .chunks(points.len().div_ceil(MAX_POINTS).max(1))
        .map(|chunk| {
            let count = chunk.len() as f64;
            let sum = chunk.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0, sum.1 + point.1));
            (sum.0 / count, sum.1 / count)
        })
        .collect()
}

struct Panel {
    left: f64,
    top: f64,
    last: f64,
    stage2_begins: f64,
    /// Powers of ten at the bottom and the top.
    range: (f64, f64),
}

impl Panel {
    fn new(
        left: f64,
        top: f64,
        train: &[(f64, f64)],
        validation: &[(f64, f64)],
        lines: &[Line],
        stage2_begins: usize,
    ) -> Self {
        let last = lines.iter().map(|line| match line {
            Line::Iteration(found) => found.iteration,
            Line::Validation(found) => found.iteration,
        });
        let logs = train.iter().chain(validation).map(|point| point.1.log10());
        let (low, high) = logs.fold((f64::MAX, f64::MIN), |(low, high), log| (low.min(log), high.max(log)));
        let range = if low > high { (-1.0, 0.0) } else { (low - 0.05, (high + 0.05).max(low + 0.2)) };
        Self {
            left,
            top,
            last: last.max().unwrap_or(1).max(1) as f64,
            stage2_begins: stage2_begins as f64,
            range,
        }
    }

    fn x(&self, iteration: f64) -> f64 {
        self.left + PANEL.0 * iteration / self.last
    }

    fn y(&self, loss: f64) -> f64 {
        let (low, high) = self.range;
        self.top + PANEL.1 * (high - loss.log10()) / (high - low)
    }

    fn draw(&self, svg: &mut String, title: &str, lines: [&[(f64, f64)]; 2]) {
        let (left, top, bottom) = (self.left, self.top, self.top + PANEL.1);
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#999\"/>\n\
             <text x=\"{left}\" y=\"{}\" font-weight=\"bold\">{title}</text>\n\
             <text x=\"{left}\" y=\"{}\">0</text>\n\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{} iterations</text>",
            PANEL.0,
            PANEL.1,
            top - 6.0,
            bottom + 14.0,
            left + PANEL.0,
            bottom + 14.0,
            self.last,
        );
        for loss in ticks(self.range) {
            let y = self.y(loss);
            let _ = writeln!(
                svg,
                "<line x1=\"{left}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ddd\"/>\n\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{loss}</text>",
                left + PANEL.0,
                left - 4.0,
                y + 4.0,
            );
        }
        if self.stage2_begins > 0.0 && self.stage2_begins < self.last {
            let x = self.x(self.stage2_begins);
            let _ = writeln!(
                svg,
                "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top}\" y2=\"{bottom}\" stroke=\"#666\" stroke-dasharray=\"4 3\"/>"
            );
        }
        for (points, colour) in lines.into_iter().zip(COLOURS) {
            let points: Vec<String> =
                points.iter().map(|&(at, loss)| format!("{:.1},{:.1}", self.x(at), self.y(loss))).collect();
            if !points.is_empty() {
                let _ = writeln!(
                    svg,
                    "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\"/>",
                    points.join(" ")
                );
            }
        }
    }
}

/// 1, 2 and 5 times the powers of ten within a range of logarithms.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let powers = low.floor() as i32..=high.ceil() as i32;
    let ticks = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(power)));
    // Rounded, so that 3 tenths print as 0.3.
    let ticks = ticks.map(|tick| format!("{tick:.3e}").parse().unwrap_or(tick));
    ticks.filter(|tick: &f64| (low..=high).contains(&tick.log10())).collect()
}
