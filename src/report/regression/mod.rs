//! Comparison of a run with an accepted one.
//!
//! In: a [`Baseline`] and the [`Results`](super::Results) of a run of the same key.
//! Out: a [`Comparison`] of every case and metric with itself, as Markdown or JUnit.
//! A difference beyond its tolerance in the bad direction is a regression; so is a case or a metric that vanished and
//! a case that failed, because a gate that cannot see is no gate.

mod baseline;
mod compare;
mod junit;
mod markdown;

pub use baseline::{BASELINE_FORMAT, Baseline, BaselineError, BaselineMetric};
pub use compare::{CaseFate, Change, Comparison, MetricSummary, Verdict, compare};
pub use junit::comparison_junit;
pub use markdown::comparison_markdown;
