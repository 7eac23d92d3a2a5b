//! How rollouts fare as one condition gets harder: survival, tracking and help over its magnitude.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::number::compact;
use super::{Chart, Interval, Panel, Point, Series, wilson_interval};
use crate::manifest::RunKey;

/// One rollout of a curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurveRollout {
    /// Id of the motion.
    pub case: String,
    /// Number of the draw of everything random in it; equal numbers mean equal draws at every magnitude.
    pub draw: usize,
    /// Magnitude of the condition, in the curve's unit.
    pub magnitude: f64,
    /// Neither fell nor failed.
    pub survived: bool,
    /// The state stopped being one.
    pub failed: bool,
    /// When the body fell or the rollout failed, seconds.
    pub end_secs: Option<f64>,
    /// Root-relative mean position error, mm; absent when failed.
    pub mpjpe_root_mm: Option<f64>,
    /// Mean assist force, % of body weight; absent without assist and when failed.
    pub assist_percent: Option<f64>,
}

/// Rollouts over the magnitudes of one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// What the condition is, for headings.
    pub title: String,
    /// Name and unit of the magnitude.
    pub magnitude: String,
    /// Magnitude at which nothing is out of the ordinary: the control arm. Absent when the curve has none.
    pub control: Option<f64>,
    /// What was run.
    pub key: RunKey,
    /// Where the motions came from.
    pub dataset: String,
    /// Seed of all draws.
    pub seed: u64,
    /// Every rollout, by case, draw and magnitude.
    pub rollouts: Vec<CurveRollout>,
}

/// All rollouts at one magnitude.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvePoint {
    /// Magnitude of the condition.
    pub magnitude: f64,
    /// Number of rollouts.
    pub num_rollouts: usize,
    /// Number of rollouts that neither fell nor failed.
    pub num_survived: usize,
    /// Number of rollouts that failed.
    pub num_failed: usize,
    /// 95 % Wilson interval of the share that survives.
    pub survival: Option<Interval>,
    /// Rollouts that survive under control and not here, and the other way round; `None` without a control arm.
    pub lost_and_won: Option<(usize, usize)>,
    /// Median over survivors, mm.
    pub mpjpe_root_mm: Option<f64>,
    /// Median over survivors, % of body weight.
    pub assist_percent: Option<f64>,
}

impl Curve {
    /// The points in order of magnitude.
    #[must_use]
    pub fn points(&self) -> Vec<CurvePoint> {
        let mut magnitudes: Vec<f64> = self.rollouts.iter().map(|rollout| rollout.magnitude).collect();
        magnitudes.sort_by(f64::total_cmp);
        magnitudes.dedup();
        magnitudes.into_iter().map(|magnitude| self.point(magnitude)).collect()
    }

    fn point(&self, magnitude: f64) -> CurvePoint {
        let at = |magnitude: f64| self.rollouts.iter().filter(move |rollout| rollout.magnitude == magnitude);
        let survivors = || at(magnitude).filter(|rollout| rollout.survived);
        let (num_rollouts, num_survived) = (at(magnitude).count(), survivors().count());
        let lost_and_won = self.control.map(|control| {
            let pairs = at(magnitude).filter_map(|here| {
                let twin = at(control).find(|twin| twin.case == here.case && twin.draw == here.draw)?;
                Some((twin.survived, here.survived))
            });
            pairs.fold((0, 0), |(lost, won), (before, after)| {
                (lost + usize::from(before && !after), won + usize::from(!before && after))
            })
        });
        CurvePoint {
            magnitude,
            num_rollouts,
            num_survived,
            num_failed: at(magnitude).filter(|rollout| rollout.failed).count(),
            survival: wilson_interval(num_survived, num_rollouts),
            lost_and_won,
            mpjpe_root_mm: median(survivors().filter_map(|rollout| rollout.mpjpe_root_mm)),
            assist_percent: median(survivors().filter_map(|rollout| rollout.assist_percent)),
        }
    }

    /// The curve as a Markdown section.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("## {}\n\n", self.title);
        let _ = writeln!(
            text,
            "{}; {}, `{}`, seed {}. Errors and assist are medians over the rollouts that survived.\n",
            self.dataset, self.key.engine, self.key.signature, self.seed
        );
        let paired = if self.control.is_some() { " lost / won against control |" } else { "" };
        let rule = if self.control.is_some() { "---|" } else { "" };
        let _ = writeln!(
            text,
            "| {} | rollouts | survived, % (95 % interval) |{paired} failed | MPJPE root, mm | assist, % BW |",
            self.magnitude
        );
        let _ = writeln!(text, "|---|---|---|{rule}---|---|---|");
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), compact);
        for point in self.points() {
            let share = 100.0 * point.num_survived as f64 / point.num_rollouts.max(1) as f64;
            let interval = point.survival.map_or_else(String::new, |ends| {
                format!(" ({} to {})", compact(100.0 * ends.low), compact(100.0 * ends.high))
            });
            let paired =
                point.lost_and_won.map_or_else(String::new, |(lost, won)| format!(" {lost} / {won} |"));
            let _ = writeln!(
                text,
                "| {} | {} | {}{interval} |{paired} {} | {} | {} |",
                compact(point.magnitude),
                point.num_rollouts,
                compact(share),
                point.num_failed,
                number(point.mpjpe_root_mm),
                number(point.assist_percent)
            );
        }
        text
    }

    /// The curve as an SVG picture.
    #[must_use]
    pub fn svg(&self) -> String {
        let points = self.points();
        let panel = |label: &str, value: &dyn Fn(&CurvePoint) -> Point| Panel {
            label: label.to_owned(),
            series: vec![Series { name: self.dataset.clone(), points: points.iter().map(value).collect() }],
        };
        let plain = |point: &CurvePoint, value: Option<f64>| Point {
            x: point.magnitude,
            y: value.unwrap_or(f64::NAN),
            interval: None,
        };
        let survival = panel("survived, %", &|point| Point {
            x: point.magnitude,
            y: 100.0 * point.num_survived as f64 / point.num_rollouts.max(1) as f64,
            interval: point.survival.map(|ends| Interval { low: 100.0 * ends.low, high: 100.0 * ends.high }),
        });
        let error = panel("MPJPE root, mm", &|point| plain(point, point.mpjpe_root_mm));
        let assist = panel("assist, % BW", &|point| plain(point, point.assist_percent));
        let panels = vec![survival, error, assist];
        Chart { title: self.title.clone(), x_label: self.magnitude.clone(), panels }.svg()
    }

    /// Every rollout as CSV.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut writer = ::csv::Writer::from_writer(Vec::new());
        for rollout in &self.rollouts {
            // Writing plain values to memory cannot fail.
            let _ = writer.serialize(rollout);
        }
        writer
            .into_inner()
            .map_or_else(|_| String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned())
    }
}

/// Middle value, the mean of the two middle ones for an even number.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    Some(if values.len().is_multiple_of(2) { (values[values.len() / 2 - 1] + upper) / 2.0 } else { upper })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve() -> Curve {
        let rollout = |draw: usize, magnitude: f64, survived: bool| CurveRollout {
            case: "walk".to_owned(),
            draw,
            magnitude,
            survived,
            failed: false,
            end_secs: (!survived).then_some(1.0),
            mpjpe_root_mm: Some(if survived { 10.0 + draw as f64 } else { 500.0 }),
            assist_percent: Some(5.0),
        };
        let key = RunKey {
            rprae: "0".to_owned(),
            engine: "engine".to_owned(),
            device: "cpu".to_owned(),
            signature: "s".to_owned(),
        };
        Curve {
            title: "pushes".to_owned(),
            magnitude: "N s".to_owned(),
            control: Some(0.0),
            key,
            dataset: "set".to_owned(),
            seed: 1,
            rollouts: vec![
                rollout(0, 0.0, true),
                rollout(1, 0.0, false),
                rollout(0, 9.0, false),
                rollout(1, 9.0, true),
            ],
        }
    }

    #[test]
    fn points_are_paired_with_the_control_arm() {
        let points = curve().points();
        assert_eq!(points.len(), 2);
        assert_eq!((points[0].num_survived, points[0].lost_and_won), (1, Some((0, 0))));
        assert_eq!(points[1].lost_and_won, Some((1, 1)));
        // Those that fell do not speak in the median.
        assert_eq!(points[1].mpjpe_root_mm, Some(11.0));
    }

    #[test]
    fn texts_hold_every_point() {
        let curve = curve();
        assert_eq!(curve.csv().lines().count(), 5);
        assert!(curve.markdown().contains("| 9.00 | 2 | 50.0 ("), "{}", curve.markdown());
        assert_eq!(curve.svg().matches("<circle").count(), 6);
    }
}
