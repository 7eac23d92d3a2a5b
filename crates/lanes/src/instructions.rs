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
        if !all[0].is_portable() {
            all.push(Self(Arch::Scalar));
        }
        all
    }

    /// Whether it is that of every machine, which has no vectors of its own here.
    #[must_use]
    pub fn is_portable(self) -> bool {
        matches!(self.0, Arch::Scalar)
    }

    /// A name for logs, such as `V4` for AVX-512.
    #[must_use]
    pub fn name(self) -> String {
        match self.0 {
            Arch::Scalar => "portable".to_owned(),
            arch => format!("{arch:?}").split('(').next().unwrap_or_default().to_owned(),
        }
    }

    /// Numbers of 32 bits in a vector.
    #[must_use]
    pub fn lanes(self) -> usize {
        struct Lanes;
        impl WithSimd for Lanes {
            type Output = usize;
            fn with_simd<S: Simd>(self, _: S) -> usize {
                S::F32_LANES
            }
        }
        self.run(Lanes)
    }

    /// Runs a kernel; the portable set takes eight numbers at a time, which the compiler turns into whatever vectors the
    /// target has.
    #[inline(always)]
    pub fn run<K: WithSimd>(self, kernel: K) -> K::Output {
        match self.0 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_portable_set_is_the_last_one_of_every_machine() {
        let all = Instructions::all();
        assert!(all.last().is_some_and(|last| last.is_portable()));
        assert_eq!(all.iter().filter(|set| set.is_portable()).count(), 1);
        assert!(all.iter().all(|set| [4, 8, 16].contains(&set.lanes())), "{all:?}");
        let names: Vec<String> = all.iter().map(|set| set.name()).collect();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    }
}
