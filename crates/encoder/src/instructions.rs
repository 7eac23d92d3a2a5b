//! The choice of instructions at run time.

use pulp::{Arch, Scalar256b, Simd, WithSimd};

/// The set of machine instructions the kernels use.
///
/// Results of different sets differ in the last bits, since sums are rounded in another order.
#[derive(Debug, Clone, Copy)]
pub struct Instructions(Arch);

impl Instructions {
    /// The best set this machine has.
    #[must_use]
    pub fn best() -> Self {
        Self(Arch::new())
    }

    /// All sets this machine has, the best one first and the portable one last.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::best()];
        #[cfg(target_arch = "x86_64")]
        if let (Arch::V4(_), Some(v3)) = (all[0].0, pulp::x86::V3::try_new()) {
            all.push(Self(Arch::V3(v3)));
        }
        if !matches!(all[0].0, Arch::Scalar) {
            all.push(Self(Arch::Scalar));
        }
        all
    }

    /// A name for logs, such as `V4` for AVX-512.
    #[must_use]
    pub fn name(self) -> String {
        match self.0 {
            Arch::Scalar => "portable".to_owned(),
            arch => format!("{arch:?}").split('(').next().unwrap_or_default().to_owned(),
        }
    }

    /// Numbers in a vector.
    pub(crate) fn lanes(self) -> usize {
        struct Lanes;
        impl WithSimd for Lanes {
            type Output = usize;
            fn with_simd<S: Simd>(self, _: S) -> usize {
                S::F32_LANES
            }
        }
        self.run(Lanes)
    }

    #[inline(always)]
    pub(crate) fn run<K: WithSimd>(self, kernel: K) -> K::Output {
        match self.0 {
            // Eight at a time, which the compiler turns into whatever vectors the target has.
            Arch::Scalar => kernel.with_simd(Scalar256b),
            arch => arch.dispatch(kernel),
        }
    }
}

impl Default for Instructions {
    fn default() -> Self {
        Self::best()
    }
}
