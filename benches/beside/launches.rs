//! Kernels launched on a GPU.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use cubecl::logging::{LaunchObservation, LaunchObserver};

#[derive(Default)]
struct Count(AtomicUsize);

impl LaunchObserver for Count {
    fn launched(&self, _: &'static str) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// Some work and how many kernels were launched meanwhile, by whatever thread.
pub fn launches<R>(work: impl FnOnce() -> R) -> (R, usize) {
    let count = Arc::new(Count::default());
    let observation = LaunchObservation::new(count.clone());
    let result = work();
    drop(observation);
    (result, count.0.load(Ordering::Relaxed))
}
