//! Case results as files and tables for people, and comparison with a baseline.
//!
//! In: [`CaseResult`]s, made by the harness or read from a run folder.
//! Out: text. Every function here returns a string; the callers decide where it goes.
//! Nothing here computes a score: removing this module changes no number.

/// Metrics shown per case in tables for people, the most telling ones of each level; files hold all of them.
pub const KEY_METRICS: &[&str] = &[
    "l0/skate",
    "l0/float",
    "l0/penetration",
    "l1/residual_force",
    "l1/residual_force_gated",
    "l2/mpjpe_root",
    "l2/assist_mean",
    "l3/time_to_fall",
];

mod aggregate;
#[cfg(feature = "png")]
mod bitmap;
mod case;
mod cell;
mod chart;
mod csv;
mod curve;
mod html;
mod markdown;
mod notes;
mod number;
mod random;
mod ranking;
mod read_back;
pub mod regression;
mod results;
pub mod retargeting;
mod table;
mod wilson;

pub(crate) use aggregate::quantile;
pub use aggregate::{Aggregate, Interval, aggregate};
#[cfg(feature = "png")]
pub use bitmap::{BitmapError, Bitmaps};
pub use case::{Candidate, CaseResult, LevelResult, MetricRecord};
pub use chart::{Chart, Panel, Point, Series};
pub use csv::scores_csv;
pub use curve::{Curve, CurvePoint, CurveRollout};
pub use html::results_html;
pub use markdown::results_markdown;
pub use notes::{Note, NoteKind, notes};
pub use number::{compact, counted, fixed, shorten};
pub use random::SplitMix64;
pub use ranking::worst_first;
pub use results::{RESULTS_FORMAT, ReadError, Results};
pub use table::{Align, Column, Table, results_table};
pub use wilson::wilson_interval;

#[cfg(test)]
mod tests {
    use super::KEY_METRICS;

    #[test]
    fn tables_show_metrics_that_exist() {
        for key in KEY_METRICS {
            assert!(crate::plausibility::find_metric(key).is_some(), "{key}");
        }
    }
}
