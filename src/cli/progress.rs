//! Progress on standard error: a bar where a person watches, plain lines where not.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};

use crate::harness::Progress;
use crate::report::shorten;

/// Longest note about one input, columns.
const LONGEST_NOTE: usize = 400;

/// Standard error: a bar where a person watches, plain lines where not.
pub(super) struct Screen {
    quiet: bool,
    /// `None` where nobody watches.
    pub(super) bar: Option<ProgressBar>,
}

impl Screen {
    pub(super) fn new(quiet: bool) -> Self {
        let watched = !quiet && std::io::stderr().is_terminal();
        Self { quiet, bar: watched.then(bar) }
    }

    /// Prints a line, above the bar if there is one.
    pub(super) fn line(&self, text: &str) {
        if !self.quiet {
            self.note(text);
        }
    }

    /// Prints a line that bears on the results, even when nothing else is said.
    pub(super) fn note(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.println(text),
            None => eprintln!("{text}"),
        }
    }

    /// Clears the bar.
    pub(super) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::no_length();
    match ProgressStyle::with_template("{bar:30} {pos}/{len}  {elapsed} so far  {wide_msg}") {
        Ok(style) => bar.with_style(style),
        // The template is fixed and valid; without it the bar would only look different.
        Err(_) => bar,
    }
}

/// Shows what a run is doing.
pub(super) struct Display {
    screen: Screen,
    num_cases: AtomicUsize,
    num_done: AtomicUsize,
}

impl Display {
    pub(super) fn new(quiet: bool) -> Self {
        Self { screen: Screen::new(quiet), num_cases: AtomicUsize::new(0), num_done: AtomicUsize::new(0) }
    }

    /// Takes note; called from the worker threads.
    pub(super) fn observe(&self, progress: Progress<'_>) {
        match progress {
            Progress::Started { num_cases } => {
                self.num_cases.store(num_cases, Ordering::Relaxed);
                if let Some(bar) = &self.screen.bar {
                    bar.set_length(num_cases as u64);
                    bar.tick();
                }
            }
            Progress::Finished { case, resumed, secs } => {
                let mut what = if resumed {
                    "already finished".to_owned()
                } else {
                    format!("{:.1} s of motion in {secs:.1} s", case.duration_secs)
                };
                if let Some(reason) = case.failures.first() {
                    self.note_if_quiet("failed", &format!("{}: {reason}", case.id));
                    what += ", failed";
                }
                self.step(&case.id, &what);
            }
            Progress::Skipped { input } => {
                self.note_if_quiet("skipped", &input.to_string());
                self.step(&input.id, "skipped");
            }
        }
    }

    /// What the summary of the run will tell is told at once only where there will be no summary.
    fn note_if_quiet(&self, what: &str, of_whom: &str) {
        if self.screen.quiet {
            self.screen.note(&format!("{what} {}", shorten(of_whom, LONGEST_NOTE)));
        }
    }

    fn step(&self, id: &str, what: &str) {
        let done = 1 + self.num_done.fetch_add(1, Ordering::Relaxed);
        let id = shorten(id, 40);
        if let Some(bar) = &self.screen.bar {
            bar.set_message(id);
            bar.inc(1);
        } else {
            let num_cases = self.num_cases.load(Ordering::Relaxed);
            self.screen.line(&format!("[{done}/{num_cases}] {id}: {what}"));
        }
    }

    /// Clears the bar.
    pub(super) fn finish(&self) {
        self.screen.finish();
    }
}

/// Shows how many of how many things of one kind after another are done.
pub(super) struct Counter {
    screen: Screen,
    /// Tenths of the current kind that were told in plain lines.
    told: Mutex<(String, usize)>,
}

impl Counter {
    pub(super) fn new(quiet: bool) -> Self {
        Self { screen: Screen::new(quiet), told: Mutex::default() }
    }

    /// Takes note; called from the worker threads.
    pub(super) fn show(&self, what: &str, done: usize, total: usize) {
        if let Some(bar) = &self.screen.bar {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
            bar.set_message(shorten(what, 40));
            return;
        }
        // Few things need no telling.
        if self.screen.quiet || total < 100 {
            return;
        }
        let tenth = 10 * done / total;
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if told.0 != what {
            *told = (what.to_owned(), 0);
        }
        if tenth > told.1 {
            told.1 = tenth;
            eprintln!("{what}: {done}/{total}");
        }
    }

    /// Clears the bar.
    pub(super) fn finish(&self) {
        self.screen.finish();
    }
}

/// Shows how far a job of known length is; a line for each input that is skipped.
pub(super) struct Steps {
    screen: Screen,
    total: usize,
    num_done: AtomicUsize,
}

/// Without a bar, every so many steps are worth a line.
const STEPS_PER_LINE: usize = 100;

impl Steps {
    pub(super) fn new(quiet: bool, total: usize) -> Self {
        let screen = Screen::new(quiet);
        if let Some(bar) = &screen.bar {
            bar.set_length(total as u64);
        }
        Self { screen, total, num_done: AtomicUsize::new(0) }
    }

    /// Takes note that a step is done, with the input it had to skip, if one is to be told; called from worker threads.
    pub(super) fn step(&self, name: &str, skipped: Option<&str>) {
        let done = 1 + self.num_done.fetch_add(1, Ordering::Relaxed);
        if let Some(input) = skipped {
            self.screen.note(&format!("skipped {}", shorten(input, LONGEST_NOTE)));
        }
        match &self.screen.bar {
            Some(bar) => {
                bar.set_message(shorten(name, 40));
                bar.inc(1);
            }
            None if done.is_multiple_of(STEPS_PER_LINE) || done == self.total => {
                self.screen.line(&format!("[{done}/{}]", self.total));
            }
            None => {}
        }
    }

    /// Clears the bar.
    pub(super) fn finish(&self) {
        self.screen.finish();
    }
}
