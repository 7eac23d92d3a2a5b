//! Progress of a grid on standard error: a bar where a person watches, plain lines where not.

use std::time::{Duration, Instant};

use crate::cli::progress::Screen;
use crate::experiments::Cell;
use crate::training::Event;

/// Time between plain lines within a model.
const PLAIN_EVERY: Duration = Duration::from_secs(30);

pub(super) struct Display {
    screen: Screen,
    num_cells: usize,
    /// Models trained before this run.
    before: usize,
    /// Models trained in this run.
    done: usize,
    started: Instant,
    told: Instant,
    /// Iterations of the model in work, and those behind it.
    progress: (usize, usize),
}

impl Display {
    pub(super) fn new(quiet: bool, num_cells: usize, waiting: usize) -> Self {
        let screen = Screen::new(quiet);
        let now = Instant::now();
        let before = num_cells - waiting;
        let display = Self { screen, num_cells, before, done: 0, started: now, told: now, progress: (1, 0) };
        display.line(&format!("{num_cells} models, {before} of them trained already"));
        display
    }

    pub(super) fn begin(&mut self, cell: &Cell) {
        self.progress = (1, 0);
        self.line(&format!("[{}/{}] {}", self.before + self.done + 1, self.num_cells, cell.name()));
    }

    pub(super) fn observe(&mut self, event: &Event<'_>) {
        match event {
            Event::Started { plan, done } => {
                self.progress = (plan.total().max(1), *done);
                if let Some(bar) = &self.screen.bar {
                    bar.set_length(plan.total() as u64);
                }
            }
            Event::Iterated(iteration) => self.progress.1 = iteration.iteration,
            Event::Validated(_) | Event::StoppedEarly { .. } => {}
        }
        let left = self.left();
        if let Some(bar) = &self.screen.bar {
            bar.set_position(self.progress.1 as u64);
            bar.set_message(left);
        } else if self.told.elapsed() >= PLAIN_EVERY {
            self.told = Instant::now();
            self.line(&format!("  iteration {} of {}, {left}", self.progress.1, self.progress.0));
        }
    }

    pub(super) fn end(&mut self, cell: &Cell) {
        self.done += 1;
        self.line(&format!("  trained {}, {}", cell.name(), self.left()));
    }

    /// Time left, as if the models to come took as long as those behind.
    fn left(&self) -> String {
        let share = self.progress.1 as f64 / self.progress.0 as f64;
        let done = self.done as f64 + if share < 1.0 { share } else { 0.0 };
        let to_do = (self.num_cells - self.before) as f64 - done;
        let secs = self.started.elapsed().as_secs_f64() / done.max(1e-3) * to_do;
        let secs = secs.clamp(0.0, 1e9) as u64;
        format!("about {}:{:02}:{:02} left", secs / 3600, secs / 60 % 60, secs % 60)
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
