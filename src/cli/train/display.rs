//! Progress of a training run on standard error: a bar where a person watches, plain lines where not.

use std::time::{Duration, Instant};

use crate::cli::progress::Screen;
use crate::training::{Event, Iteration, LossValues, Plan, Stage, Validation};

/// Time between plain lines.
const PLAIN_EVERY: Duration = Duration::from_secs(10);

pub(super) struct Display {
    screen: Screen,
    plan: Option<Plan>,
    started: Instant,
    first: usize,
    told: Option<Instant>,
}

impl Display {
    pub(super) fn new(quiet: bool) -> Self {
        Self { screen: Screen::new(quiet), plan: None, started: Instant::now(), first: 0, told: None }
    }

    pub(super) fn observe(&mut self, event: &Event<'_>) {
        match event {
            Event::Started { plan, done } => {
                self.plan = Some(*plan);
                self.first = *done;
                self.started = Instant::now();
                if let Some(bar) = &self.screen.bar {
                    bar.set_length(plan.total() as u64);
                    bar.set_position(*done as u64);
                }
                let going_on = if *done > 0 { format!(", going on after {done}") } else { String::new() };
                self.line(&format!(
                    "{} iterations of stage 1, {} of stage 2{going_on}",
                    plan.stage1, plan.stage2
                ));
            }
            Event::Iterated(iteration) => self.iterated(iteration),
            Event::Validated(found) => {
                self.line(&format!("validation after {}: {}", found.iteration, told(found)));
            }
            Event::StoppedEarly { iteration } => {
                self.line(&format!("stopped after {iteration}: the validation gets no better"));
            }
        }
    }

    fn iterated(&mut self, iteration: &Iteration) {
        let Some(plan) = self.plan else { return };
        let done = iteration.iteration - self.first;
        let rate = done as f64 / self.started.elapsed().as_secs_f64().max(1e-9);
        let left = (plan.total() - iteration.iteration) as f64 / rate;
        let stage = if iteration.stage == Stage::One { 1 } else { 2 };
        let state = format!("stage {stage}  {}  {rate:.2} /s  {} left", losses(&iteration.loss), clock(left));
        if let Some(bar) = &self.screen.bar {
            bar.set_position(iteration.iteration as u64);
            bar.set_message(state);
        } else if self.told.is_none_or(|told| told.elapsed() >= PLAIN_EVERY) {
            self.told = Some(Instant::now());
            self.line(&format!("[{}/{}] {state}", iteration.iteration, plan.total()));
        }
    }

    /// Prints a line, above the bar if there is one.
    pub(super) fn line(&self, text: &str) {
        self.screen.line(text);
    }

    /// Clears the bar.
    pub(super) fn finish(&self) {
        self.screen.finish();
    }
}

fn losses(loss: &LossValues) -> String {
    let named = loss.named().into_iter().map(|(name, loss)| format!("{name} {loss:.3}"));
    named.collect::<Vec<_>>().join("  ")
}

/// A validation in a line.
pub(super) fn told(found: &Validation) -> String {
    let score = found.m2t_score.map_or_else(String::new, |score| format!(", BLEU-4 {score:.3}"));
    format!(
        "{}; words right from motions {:.1} %{score}, error of motions from captions {:.3}",
        losses(&found.validation),
        100.0 * found.m2t_word_accuracy,
        found.t2m_error
    )
}

/// Seconds as hours, minutes and seconds.
fn clock(secs: f64) -> String {
    let secs = secs.clamp(0.0, 1e9) as u64;
    format!("{}:{:02}:{:02}", secs / 3600, secs / 60 % 60, secs % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_reads_like_a_clock() {
        assert_eq!(clock(3725.9), "1:02:05");
        assert_eq!(clock(f64::INFINITY), "277777:46:40");
    }
}
