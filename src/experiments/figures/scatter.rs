//! Points in the plane, coloured by label.

use std::fmt::Write as _;

/// A point with what it is.
#[derive(Debug, Clone, PartialEq)]
pub struct ScatterPoint {
    /// Place.
    pub place: [f64; 2],
    /// What decides its colour.
    pub label: String,
    /// Told where the pointer rests.
    pub name: String,
}

const PANEL: f64 = 360.0;
const MARGIN: f64 = 30.0;
const LEGEND: f64 = 150.0;
/// Okabe and Ito 2008, and two greys.
const COLOURS: [&str; 9] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#777777", "#bbbbbb"];

/// Panels side by side, each with a title; labels have one colour in all of them.
#[must_use]
pub fn scatter(panels: &[(String, Vec<ScatterPoint>)]) -> String {
    let mut labels: Vec<&str> =
        panels.iter().flat_map(|(_, points)| points.iter().map(|point| point.label.as_str())).collect();
    labels.sort_unstable();
    labels.dedup();
    let width = MARGIN + panels.len() as f64 * (PANEL + MARGIN) + LEGEND;
    let height = PANEL + 2.5 * MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let colour = |label: &str| {
        let place = labels.iter().position(|known| *known == label).unwrap_or_default();
        COLOURS[place.min(COLOURS.len() - 1)]
    };
    for (index, (title, points)) in panels.iter().enumerate() {
        let left = MARGIN + index as f64 * (PANEL + MARGIN);
        let _ =
            writeln!(svg, "<text x=\"{left}\" y=\"{}\" font-size=\"14\">{}</text>", MARGIN, escape(title));
        let top = 1.5 * MARGIN;
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{PANEL}\" height=\"{PANEL}\" fill=\"none\" stroke=\"#999999\"/>"
        );
        let ends = |axis: usize| {
            points
                .iter()
                .map(|point| point.place[axis])
                .fold((f64::INFINITY, f64::NEG_INFINITY), |ends, value| {
                    (ends.0.min(value), ends.1.max(value))
                })
        };
        // One scale for both axes: distances count, not directions.
        let (across, up) = (ends(0), ends(1));
        let span = (across.1 - across.0).max(up.1 - up.0).max(1e-12);
        let place = |value: f64, (low, high): (f64, f64)| {
            (0.5 + (value - f64::midpoint(low, high)) / span * 0.92) * PANEL
        };
        for point in points {
            let (x, y) = (left + place(point.place[0], across), top + PANEL - place(point.place[1], up));
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{}\" fill-opacity=\"0.8\"><title>{}</title></circle>",
                colour(&point.label),
                escape(&point.name)
            );
        }
    }
    for (index, label) in labels.iter().enumerate() {
        let (x, y) = (width - LEGEND, 1.5 * MARGIN + 10.0 + 20.0 * index as f64);
        let _ = writeln!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"5\" fill=\"{}\"/>", colour(label));
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{}\">{}</text>", x + 12.0, y + 4.0, escape(label));
    }
    svg.push_str("</svg>\n");
    svg
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_drawn_with_its_colour() {
        let point = |x: f64, label: &str| ScatterPoint {
            place: [x, -x],
            label: label.to_owned(),
            name: "a < b".to_owned(),
        };
        let svg = scatter(&[("z".to_owned(), vec![point(1.0, "run"), point(2.0, "walk")])]);
        assert_eq!(svg.matches("<title>a &lt; b</title>").count(), 2);
        assert_eq!(svg.matches(COLOURS[1]).count(), 2, "a point and its legend");
        assert!(!scatter(&[("z".to_owned(), vec![])]).contains("NaN"));
    }
}
