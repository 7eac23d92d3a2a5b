//! What a number means.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::simulation::Level;

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// Smaller values are better.
    Lower,
    /// Larger values are better.
    Higher,
    /// The value describes; it does not judge.
    Neither,
}

impl Better {
    /// `lower`, `higher` or `neither`, as in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Lower => "lower",
            Self::Higher => "higher",
            Self::Neither => "neither",
        }
    }
}

/// A named, documented quantity.
///
/// Two results may be compared when key and signature agree: everything that changes the number is in the signature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metric {
    /// Stable key, `l0/...` to `l3/...`.
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
    /// What is reported when there is too little input: a single frame, or a rollout of one sample.
    pub empty: &'static str,
    /// Where the definition comes from.
    pub reference: &'static str,
    /// Everything that changes the number, sacreBLEU style: `tol:5mm|points:sole12|v:1`.
    pub signature: &'static str,
}

/// A value of a metric; never NaN or infinite when made by [`Score::new`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// What was measured.
    pub metric: &'static Metric,
    /// The value, in the metric's unit.
    pub value: f64,
}

impl Score {
    /// A score, or nothing when the value is NaN or infinite: a missing score is seen, a NaN spreads.
    ///
    /// Negative zero becomes zero, so that equal scores print equally.
    #[must_use]
    pub fn new(metric: &'static Metric, value: f64) -> Option<Self> {
        value.is_finite().then_some(Self { metric, value: value + 0.0 })
    }
}

/// Everything about a metric as text for a person, one labelled line per field and without a final newline.
#[must_use]
pub fn explain(metric: &Metric) -> String {
    let unit = if metric.unit.is_empty() { "ratio" } else { metric.unit };
    let better = match metric.better {
        Better::Lower => "lower is better",
        Better::Higher => "higher is better",
        Better::Neither => "describes, does not judge",
    };
    let mut text = format!("{} ({}) [{unit}], level {}, {better}", metric.key, metric.title, metric.level);
    for (label, line) in [
        ("formula", metric.formula),
        ("empty", metric.empty),
        ("reference", metric.reference),
        ("signature", metric.signature),
    ] {
        let _ = write!(text, "\n  {label:<10} {line}");
    }
    text
}

/// A rollout metric defined at both simulated levels.
#[derive(Debug)]
pub(super) struct PerLevel {
    pub l2: Metric,
    pub l3: Metric,
}

impl PerLevel {
    /// The metric `shared` under its two keys; key and level of `shared` itself are replaced.
    pub(super) const fn new(l2_key: &'static str, l3_key: &'static str, shared: Metric) -> Self {
        Self {
            l2: Metric { key: l2_key, level: Level::L2, ..shared },
            l3: Metric { key: l3_key, level: Level::L3, ..shared },
        }
    }

    /// The metric of a level: L3's for [`Level::L3`], L2's otherwise.
    pub(super) fn of(&'static self, level: Level) -> &'static Metric {
        if level == Level::L3 { &self.l3 } else { &self.l2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static HEIGHT: Metric = Metric {
        key: "l0/height",
        title: "height",
        unit: "mm",
        level: Level::L0,
        better: Better::Neither,
        formula: "h",
        empty: "absent",
        reference: "none",
        signature: "v:1",
    };

    #[test]
    fn a_score_is_a_finite_number() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(Score::new(&HEIGHT, value), None);
        }
        assert!(Score::new(&HEIGHT, -0.0).unwrap().value.is_sign_positive());
        assert_eq!(Score::new(&HEIGHT, 1.5).unwrap().value, 1.5);
    }

    #[test]
    fn the_explanation_names_unit_direction_and_every_field() {
        assert_eq!(
            explain(&HEIGHT),
            "l0/height (height) [mm], level L0, describes, does not judge\n  formula    h\n  empty      absent\n  \
             reference  none\n  signature  v:1"
        );
    }
}
