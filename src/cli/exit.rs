//! What a process tells the one that called it.

/// Outcome of a command; its code is part of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Everything was done and nothing was found.
    Clean,
    /// The run failed, or one of its cases did.
    Failed,
    /// Wrong usage, or an input that cannot be read at all.
    Usage,
    /// Finished, but inputs were skipped.
    Skipped,
    /// A regression was found.
    Regressed,
}

impl Exit {
    /// The exit code.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::Clean => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::Skipped => 3,
            Self::Regressed => 4,
        }
    }

    /// The outcome to report when both apply: 2 before 1 before 4 before 3 before 0.
    #[must_use]
    pub fn or_worse(self, other: Self) -> Self {
        let weight = |exit| match exit {
            Self::Clean => 0,
            Self::Skipped => 1,
            Self::Regressed => 2,
            Self::Failed => 3,
            Self::Usage => 4,
        };
        if weight(other) > weight(self) { other } else { self }
    }
}

/// What became of the inputs of a command: one rule for all of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Inputs {
    /// Inputs that something was made of.
    pub used: usize,
    /// Inputs that could not be used.
    pub skipped: usize,
}

impl Inputs {
    /// [`Exit::Clean`] when none was skipped, [`Exit::Usage`] when all were, [`Exit::Skipped`] between.
    pub fn exit(self) -> Exit {
        match self {
            Self { skipped: 0, .. } => Exit::Clean,
            Self { used: 0, .. } => Exit::Usage,
            _ => Exit::Skipped,
        }
    }
}

/// An error on its way out, with the code to leave with.
#[derive(Debug)]
pub(super) struct Failure {
    pub exit: Exit,
    pub error: anyhow::Error,
}

/// Turns the errors of the library into failures.
pub(super) trait OrExit<T> {
    /// A failure of the work itself.
    fn or_failed(self) -> Result<T, Failure>;
    /// A failure of what the user handed over.
    fn or_usage(self) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrExit<T> for Result<T, E> {
    fn or_failed(self) -> Result<T, Failure> {
        self.map_err(|error| Failure { exit: Exit::Failed, error: error.into() })
    }

    fn or_usage(self) -> Result<T, Failure> {
        self.map_err(|error| Failure { exit: Exit::Usage, error: error.into() })
    }
}

/// An error with its causes as one line, leaving out a cause that the text before it already tells.
pub(super) fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_are_told_once() {
        let error =
            anyhow::anyhow!("no such file").context("read a.xml: no such file").context("open the suite");
        assert_eq!(message(&error), "open the suite: read a.xml: no such file");
        let error =
            anyhow::anyhow!("no such file").context("read a.xml: no such file; name one with --config");
        assert_eq!(message(&error), "read a.xml: no such file; name one with --config");
    }

    #[test]
    fn inputs_that_are_all_skipped_are_no_inputs() {
        let exit = |used, skipped| Inputs { used, skipped }.exit();
        assert_eq!([exit(0, 0), exit(2, 0), exit(2, 1), exit(0, 1)], {
            [Exit::Clean, Exit::Clean, Exit::Skipped, Exit::Usage]
        });
    }

    #[test]
    fn precedence_is_two_one_four_three() {
        let order = [Exit::Clean, Exit::Skipped, Exit::Regressed, Exit::Failed, Exit::Usage];
        assert_eq!(order.map(Exit::code), [0, 3, 4, 1, 2]);
        for (low, a) in order.into_iter().enumerate() {
            for (high, b) in order.into_iter().enumerate() {
                assert_eq!(a.or_worse(b), order[low.max(high)]);
            }
        }
    }
}
