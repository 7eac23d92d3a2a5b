//! Joint angles over time, generated beside recorded.

use std::fmt::Write as _;

use super::scatter::escape;
use crate::features::Normalizer;
use crate::motion::{JOINTS, NUM_CHANNELS, NUM_JOINTS};

/// Angles drawn of each motion: those that move most in the recording.
const NUM_ANGLES: usize = 8;
const PANEL: (f64, f64) = (330.0, 150.0);
const MARGIN: f64 = 44.0;
const LEGEND: f64 = 120.0;
/// Lines of what was recorded.
const DASHES: &str = " stroke-dasharray=\"4 3\" stroke-opacity=\"0.6\"";
const COLOURS: [&str; NUM_ANGLES] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#777777"];

/// Normalised frames.
pub type Frames = [[f32; NUM_CHANNELS]];

/// A motion's name, its recording, and what each system made.
pub type CurveRow<'a> = (String, &'a Frames, Vec<&'a Frames>);

/// A row a motion, a column a system: solid what it made, dashed what was recorded, degrees over seconds.
///
/// All frames are normalised by `normalizer`; each row has a motion of every system.
#[must_use]
pub fn joint_curves(
    normalizer: &Normalizer,
    rate_hz: f64,
    systems: &[&str],
    rows: &[CurveRow<'_>],
) -> String {
    let width = MARGIN + systems.len() as f64 * (PANEL.0 + MARGIN) + LEGEND;
    let height = MARGIN + rows.len() as f64 * (PANEL.1 + MARGIN);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (row, (name, recorded, made)) in rows.iter().enumerate() {
        let top = MARGIN + row as f64 * (PANEL.1 + MARGIN);
        let recorded = degrees(normalizer, recorded);
        let angles = liveliest(&recorded);
        for (column, frames) in made.iter().enumerate() {
            let left = MARGIN + column as f64 * (PANEL.0 + MARGIN);
            let title = format!("{name}: {}", systems.get(column).copied().unwrap_or_default());
            let made = degrees(normalizer, frames);
            panel(&mut svg, (left, top), &escape(&title), rate_hz, &angles, (&recorded, &made));
        }
        for (place, &angle) in angles.iter().enumerate() {
            let (x, y) = (width - LEGEND, top + 8.0 + 16.0 * place as f64);
            let _ = writeln!(
                svg,
                "<line x1=\"{x}\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\" stroke=\"{}\" stroke-width=\"2\"/>\
                 <text x=\"{}\" y=\"{}\">{}</text>",
                x + 16.0,
                COLOURS[place],
                x + 20.0,
                y + 4.0,
                JOINTS[angle].short_name()
            );
        }
    }
    push_legend(&mut svg, width - LEGEND);
    svg.push_str("</svg>\n");
    svg
}

/// Which lines are which, above the names of the angles.
fn push_legend(svg: &mut String, x: f64) {
    for (y, dashes, name) in [(12.0, "", "made"), (26.0, DASHES, "recorded")] {
        let _ = writeln!(
            svg,
            "<line x1=\"{x}\" x2=\"{}\" y1=\"{y}\" y2=\"{y}\" stroke=\"#000000\" stroke-width=\"1.4\"{dashes}/>\
             <text x=\"{}\" y=\"{}\">{name}</text>",
            x + 16.0,
            x + 20.0,
            y + 4.0
        );
    }
}

fn degrees(normalizer: &Normalizer, frames: &Frames) -> Vec<[f64; NUM_JOINTS]> {
    let frame = |frame: &[f32; NUM_CHANNELS]| {
        let channels = normalizer.denormalize(frame);
        std::array::from_fn(|joint| channels[joint].to_degrees())
    };
    frames.iter().map(frame).collect()
}

/// The angles of largest variance, in the order of the joint table.
fn liveliest(frames: &[[f64; NUM_JOINTS]]) -> Vec<usize> {
    let num = frames.len().max(1) as f64;
    let variance = |joint: usize| {
        let mean = frames.iter().map(|frame| frame[joint]).sum::<f64>() / num;
        frames.iter().map(|frame| (frame[joint] - mean).powi(2)).sum::<f64>() / num
    };
    let mut order: Vec<usize> = (0..NUM_JOINTS).collect();
    order.sort_by(|&a, &b| variance(b).total_cmp(&variance(a)));
    order.truncate(NUM_ANGLES);
    order.sort_unstable();
    order
}

fn panel(
    svg: &mut String,
    (left, top): (f64, f64),
    title: &str,
    rate_hz: f64,
    angles: &[usize],
    (recorded, made): (&[[f64; NUM_JOINTS]], &[[f64; NUM_JOINTS]]),
) {
    let all = || recorded.iter().chain(made).flat_map(|frame| angles.iter().map(|&angle| frame[angle]));
    let (low, high) =
        all().fold((f64::INFINITY, f64::NEG_INFINITY), |ends, value| (ends.0.min(value), ends.1.max(value)));
    let (low, high) = if low < high { (low, high) } else { (-1.0, 1.0) };
    let last = (recorded.len().max(made.len()).max(2) - 1) as f64;
    let x = |frame: usize| left + frame as f64 / last * PANEL.0;
    let y = |value: f64| top + PANEL.1 - (value - low) / (high - low) * PANEL.1;
    let _ = writeln!(
        svg,
        "<text x=\"{left}\" y=\"{}\">{title}</text>\
         <rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#999999\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{high:.0}&#176;</text>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{low:.0}&#176;</text>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{:.1} s</text>",
        top - 6.0,
        PANEL.0,
        PANEL.1,
        left - 3.0,
        top + 9.0,
        left - 3.0,
        top + PANEL.1,
        left + PANEL.0,
        top + PANEL.1 + 13.0,
        last / rate_hz
    );
    for (frames, dashes) in [(recorded, DASHES), (made, "")] {
        for (&angle, colour) in angles.iter().zip(COLOURS) {
            let points: Vec<String> = frames
                .iter()
                .enumerate()
                .map(|(index, frame)| format!("{:.1},{:.1}", x(index), y(frame[angle])))
                .collect();
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\"{dashes}/>",
                points.join(" ")
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_angle_is_drawn_twice_inside_its_panel() {
        let normalizer = Normalizer { minimum: vec![-1.0; NUM_CHANNELS], maximum: vec![1.0; NUM_CHANNELS] };
        let frames = |num: usize| -> Vec<[f32; NUM_CHANNELS]> {
            (0..num)
                .map(|time| std::array::from_fn(|channel| ((time * channel) as f32 * 0.01).sin()))
                .collect()
        };
        let (recorded, made) = (frames(20), frames(30));
        let svg = joint_curves(&normalizer, 10.0, &["ours"], &[("m".to_owned(), &recorded, vec![&made])]);
        assert_eq!(svg.matches("<polyline").count(), 2 * NUM_ANGLES);
        // One more in the legend, which says what it is.
        assert_eq!(svg.matches("dasharray").count(), NUM_ANGLES + 1);
        assert!(svg.contains(">recorded<") && svg.contains(">made<"));
        assert!(!svg.contains("NaN") && svg.contains("2.9 s"));
    }
}
