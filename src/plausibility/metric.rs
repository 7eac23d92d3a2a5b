//! What a number means.

use crate::simulation::Level;

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Smaller values are better.
    Lower,
    /// Larger values are better.
    Higher,
    /// The value describes; it does not judge.
    Neither,
}

/// A named, documented quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metric {
    /// Stable key, `l0/...`, `l2/...` or `l3/...`.
    pub key: &'static str,
    /// Short column title.
    pub title: &'static str,
    /// Unit, empty for a ratio.
    pub unit: &'static str,
    /// Level the value belongs to.
    pub level: Level,
    /// Which way is better.
    pub better: Better,
    /// Formula in words and symbols.
    pub formula: &'static str,
    /// Where the definition comes from.
    pub reference: &'static str,
    /// Everything that changes the number, sacreBLEU style: `tol:5mm|points:sole12|v:1`.
    pub signature: &'static str,
}

/// A value of a metric; never NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// What was measured.
    pub metric: &'static Metric,
    /// The value, in the metric's unit.
    pub value: f64,
}
