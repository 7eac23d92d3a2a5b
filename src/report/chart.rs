//! Line charts as SVG: panels above each other over one horizontal axis.

use std::fmt::Write as _;

use super::Interval;
use super::number::{compact, escape_html};

/// One line of a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in the order they are joined; one without a finite value interrupts the line.
    pub points: Vec<Point>,
}

/// One point of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Place on the horizontal axis.
    pub x: f64,
    /// Place on the vertical axis.
    pub y: f64,
    /// Drawn as a bar through the point.
    pub interval: Option<Interval>,
}

/// Lines over the shared horizontal axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Name and unit of the vertical axis.
    pub label: String,
    /// The lines.
    pub series: Vec<Series>,
}

/// A picture of panels above each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// Name and unit of the horizontal axis.
    pub x_label: String,
    /// The panels, from top to bottom.
    pub panels: Vec<Panel>,
}

const WIDTH: f64 = 720.0;
const PANEL_HEIGHT: f64 = 200.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 180.0;
const TOP: f64 = 44.0;
const GAP: f64 = 26.0;
const BOTTOM: f64 = 46.0;
/// Eight colours that people with colour blindness tell apart (Okabe and Ito 2008), without yellow.
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];

impl Chart {
    /// The chart as an SVG file.
    #[must_use]
    pub fn svg(&self) -> String {
        let height = TOP + self.panels.len() as f64 * (PANEL_HEIGHT + GAP) + BOTTOM - GAP;
        let mut svg = String::new();
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">"
        );
        let _ = writeln!(svg, "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>");
        text(&mut svg, [LEFT, 22.0], "start", &self.title, " font-size=\"15\"");
        let points = || self.panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.points);
        let across = Axis::new(points().map(|point| point.x), [LEFT, WIDTH - RIGHT], false);
        for (index, panel) in self.panels.iter().enumerate() {
            let top = TOP + index as f64 * (PANEL_HEIGHT + GAP);
            draw(&mut svg, panel, &across, top, index + 1 == self.panels.len());
        }
        text(&mut svg, [(LEFT + WIDTH - RIGHT) / 2.0, height - 10.0], "middle", &self.x_label, "");
        svg.push_str("</svg>\n");
        svg
    }
}

fn draw(svg: &mut String, panel: &Panel, across: &Axis, top: f64, is_last: bool) {
    let bottom = top + PANEL_HEIGHT;
    let values = panel.series.iter().flat_map(|series| &series.points).flat_map(|point| {
        let ends = point.interval.map_or([point.y; 2], |interval| [interval.low, interval.high]);
        [point.y, ends[0], ends[1]]
    });
    let up = Axis::new(values, [bottom, top], true);
    for tick in up.ticks() {
        let y = up.place(tick);
        line(svg, [LEFT, y], [WIDTH - RIGHT, y], "#dddddd", 1.0);
        text(svg, [LEFT - 8.0, y + 4.0], "end", &compact(tick), "");
    }
    for tick in across.ticks() {
        let x = across.place(tick);
        line(svg, [x, bottom], [x, bottom + 4.0], "#444444", 1.0);
        if is_last {
            text(svg, [x, bottom + 18.0], "middle", &compact(tick), "");
        }
    }
    line(svg, [LEFT, bottom], [WIDTH - RIGHT, bottom], "#444444", 1.0);
    let middle = (top + bottom) / 2.0;
    let turned = format!(" transform=\"rotate(-90 16 {middle:.1})\"");
    text(svg, [16.0, middle], "middle", &panel.label, &turned);
    for (index, series) in panel.series.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let place = |point: &Point| [across.place(point.x), up.place(point.y)];
        let is_drawn = |point: &&Point| point.x.is_finite() && point.y.is_finite();
        for pair in series.points.windows(2).filter(|pair| pair.iter().all(|point| is_drawn(&point))) {
            line(svg, place(&pair[0]), place(&pair[1]), colour, 2.0);
        }
        for point in series.points.iter().filter(is_drawn) {
            let [x, y] = place(point);
            if let Some(interval) = point.interval {
                line(svg, [x, up.place(interval.low)], [x, up.place(interval.high)], colour, 1.0);
            }
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{colour}\"/>");
        }
        let y = top + 8.0 + 18.0 * index as f64;
        let x = WIDTH - RIGHT + 14.0;
        line(svg, [x, y], [x + 18.0, y], colour, 2.0);
        text(svg, [x + 24.0, y + 4.0], "start", &series.name, "");
    }
}

fn line(svg: &mut String, from: [f64; 2], to: [f64; 2], colour: &str, width: f64) {
    let _ = writeln!(
        svg,
        "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>",
        from[0], from[1], to[0], to[1]
    );
}

fn text(svg: &mut String, at: [f64; 2], anchor: &str, words: &str, attributes: &str) {
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\"{attributes}>{}</text>",
        at[0],
        at[1],
        escape_html(words)
    );
}

/// A range of values laid out on the picture.
struct Axis {
    low: f64,
    high: f64,
    step: f64,
    ends: [f64; 2],
}

impl Axis {
    /// An axis over all finite values; `rounded` widens it to whole ticks and down or up to zero.
    fn new(values: impl Iterator<Item = f64>, ends: [f64; 2], rounded: bool) -> Self {
        let finite = values.filter(|value| value.is_finite());
        let (mut low, mut high) =
            finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if rounded {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        if high - low < 1e-12 * high.abs().max(1.0) {
            high = low + 1.0;
        }
        // Four to eight ticks at 1, 2 or 5 times a power of ten.
        let raw = (high - low) / 8.0;
        let decade = 10.0_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade).into_iter().find(|step| *step >= raw);
        let step = step.unwrap_or(raw);
        if rounded {
            (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
        }
        Self { low, high, step, ends }
    }

    fn place(&self, value: f64) -> f64 {
        self.ends[0] + (value - self.low) / (self.high - self.low) * (self.ends[1] - self.ends[0])
    }

    fn ticks(&self) -> impl Iterator<Item = f64> + '_ {
        let first = (self.low / self.step - 1e-9).ceil() as i64;
        let last = (self.high / self.step + 1e-9).floor() as i64;
        (first..=last).map(|index| index as f64 * self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(values: &[(f64, f64)]) -> String {
        let points = values
            .iter()
            .map(|&(x, y)| Point { x, y, interval: Some(Interval { low: y - 0.5, high: y + 0.5 }) })
            .collect();
        let series = vec![Series { name: "a < b".to_owned(), points }];
        let panels = vec![Panel { label: "falls, %".to_owned(), series }];
        Chart { title: "t".to_owned(), x_label: "limit".to_owned(), panels }.svg()
    }

    #[test]
    fn every_point_is_drawn_inside_the_picture() {
        let svg = chart(&[(0.0, 1.0), (5.0, 30.0), (40.0, 2.0)]);
        assert_eq!(svg.matches("<circle").count(), 3);
        assert!(svg.contains("a &lt; b"));
        for place in svg.split("cx=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            let x: f64 = place.parse().unwrap();
            assert!((LEFT..=WIDTH - RIGHT).contains(&x), "{x}");
        }
    }

    #[test]
    fn gaps_and_empty_charts_are_no_error() {
        let svg = chart(&[(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)]);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(!svg.contains("NaN"), "{svg}");
        assert!(!chart(&[]).contains("NaN"));
        assert!(!chart(&[(1.0, 5.0)]).contains("inf"));
    }

    #[test]
    fn ticks_are_round_numbers() {
        let axis = Axis::new([0.0, 40.0].into_iter(), [0.0, 1.0], false);
        assert_eq!(axis.ticks().collect::<Vec<_>>(), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0]);
    }
}
