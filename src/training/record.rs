//! What is written down about a run while it goes on.

use serde::{Deserialize, Serialize};

use super::plan::{Phase, Stage};

/// Losses of a batch, or means over the validation pairs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossValues {
    /// Eq. 4 in stage 1, Eq. 5 in stage 2.
    pub total: f64,
    /// Eq. 2, nats a word (with the mean).
    pub description: f64,
    /// Eq. 1, squared normalised units a frame (with the mean).
    pub action: f64,
    /// Eq. 3; absent in stage 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub binding: Option<f64>,
    /// Of the length head: squared error of the logarithm.
    pub length: f64,
}

impl LossValues {
    /// Losses by name, in the order of the equations.
    #[must_use]
    pub fn named(&self) -> Vec<(&'static str, f64)> {
        let mut named =
            vec![("total", self.total), ("description", self.description), ("action", self.action)];
        named.extend(self.binding.map(|binding| ("binding", binding)));
        named.push(("length", self.length));
        named
    }
}

/// One iteration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Iteration {
    /// Counted from 1 through both stages.
    pub iteration: usize,
    /// Stage it belongs to.
    pub stage: Stage,
    /// What learned.
    pub phase: Phase,
    /// Losses before the update.
    pub loss: LossValues,
    /// Norm of the gradient of the part that learned, before clipping; the larger one when both did.
    pub gradient_norm: f64,
    /// Time it took, seconds.
    pub secs: f64,
}

/// One look at the validation pairs: means, in closed loop, whatever the settings train with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Validation {
    /// Iteration after which it was.
    pub iteration: usize,
    /// Stage of that iteration.
    pub stage: Stage,
    /// Losses; the binding loss is that of one-sided Eq. 3 or what the settings ask for, over batches of training size.
    pub validation: LossValues,
    /// Captions written from motions: share of words that are the reference's at the same place, 0 to 1.
    pub m2t_word_accuracy: f64,
    /// Score of captions written word by word from all motions against all their captions, if one was asked for;
    /// `rprae train` asks for corpus BLEU-4, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub m2t_score: Option<f64>,
    /// Motions made from captions, as long as the reference: root mean squared error of a channel, normalised units.
    pub t2m_error: f64,
    /// Largest memory the process has used, MiB, where the system tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_memory_mib: Option<f64>,
}

/// A line of `metrics.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Line {
    /// An iteration.
    Iteration(Iteration),
    /// A validation.
    Validation(Validation),
}

/// Largest memory this process has used so far, MiB; `None` where the system does not tell.
#[must_use]
pub fn peak_memory_mib() -> Option<f64> {
    status_kib("VmHWM:").map(|kib| kib / 1024.0)
}

/// Memory this process uses now, MiB; `None` where the system does not tell.
#[must_use]
pub fn memory_mib() -> Option<f64> {
    status_kib("VmRSS:").map(|kib| kib / 1024.0)
}

fn status_kib(key: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
