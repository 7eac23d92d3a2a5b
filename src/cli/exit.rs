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

#[cfg(test)]
mod tests {
    use super::*;

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
