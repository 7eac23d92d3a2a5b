//! Hyperbolic tangents.

use crate::lanes::{Kernel, Lanes, Number};

/// Every number, of whole vectors, becomes its tanh.
pub(crate) struct Tanh<'a, T>(pub(crate) &'a mut [T]);

impl<T: Number> Kernel<T> for Tanh<'_, T> {
    #[inline(always)]
    fn run<S: Lanes<T>>(self, s: S) {
        for numbers in S::vectors_mut(self.0) {
            *numbers = s.tanh(*numbers);
        }
    }
}
