//! Vectors of numbers.
//!
//! Kernels are written once against [`Lanes`] and compiled for AVX-512, AVX2, NEON (all through `pulp`) and for plain
//! arrays; [`Instructions`] says which of them runs.

use pulp::{Simd, WithSimd};
use rprae_lanes::{Instructions, exponential};

/// Operations on [`Lanes::LANES`] numbers at a time.
pub trait Lanes<T>: Copy {
    /// A vector of numbers.
    type V: Copy;
    /// Numbers in a vector.
    const LANES: usize;
    /// Vectors that fit into registers.
    const REGISTERS: usize;
    /// A slice as vectors; a remainder is left out.
    fn vectors(numbers: &[T]) -> &[Self::V];
    /// A mutable slice as vectors; a remainder is left out.
    fn vectors_mut(numbers: &mut [T]) -> &mut [Self::V];
    fn splat(self, number: T) -> Self::V;
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`, rounded once where the machine can.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `1 / (1 + exp(-a))`.
    fn sigmoid(self, a: Self::V) -> Self::V;
    fn tanh(self, a: Self::V) -> Self::V;
    /// Numbers nearer to zero than [`Number::LEAST`] as zeros.
    fn without_least(self, a: Self::V) -> Self::V;
}

/// Code that runs with some set of instructions.
pub trait Kernel<T> {
    fn run<S: Lanes<T>>(self, lanes: S);
}

/// A number the kernels work on: `f32`, or `f64` (portable instructions only, for checks of gradients).
pub trait Number:
    Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + std::fmt::Debug
    + std::ops::AddAssign
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
    + bytemuck::Pod
{
    const ONE: Self;
    /// The least gradient that counts. Gradients vanish exponentially on their way back through a long sequence, and a
    /// processor takes over a hundred times as long for numbers that are too small for their usual form.
    const LEAST: Self;
    /// Numbers in a vector of this set of instructions.
    fn lanes(instructions: Instructions) -> usize;
    /// Runs a kernel with this set of instructions.
    fn run<K: Kernel<Self>>(instructions: Instructions, kernel: K);
    fn tanh(self) -> Self;
}

struct Dispatch<K>(K);

impl<K: Kernel<f32>> WithSimd for Dispatch<K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.run(Wide(simd));
    }
}

impl Number for f32 {
    const ONE: Self = 1.0;
    const LEAST: Self = 1e-30;

    fn lanes(instructions: Instructions) -> usize {
        struct Count<'a>(&'a mut usize);
        impl Kernel<f32> for Count<'_> {
            fn run<S: Lanes<f32>>(self, _: S) {
                *self.0 = S::LANES;
            }
        }
        let mut lanes = 0;
        Self::run(instructions, Count(&mut lanes));
        lanes
    }

    #[inline(always)]
    fn run<K: Kernel<Self>>(instructions: Instructions, kernel: K) {
        if instructions.is_portable() {
            kernel.run(Portable);
        } else {
            instructions.run(Dispatch(kernel));
        }
    }

    fn tanh(self) -> Self {
        f32::tanh(self)
    }
}

impl Number for f64 {
    const ONE: Self = 1.0;
    const LEAST: Self = 1e-300;

    fn lanes(_: Instructions) -> usize {
        <Portable as Lanes<Self>>::LANES
    }

    fn run<K: Kernel<Self>>(_: Instructions, kernel: K) {
        kernel.run(Portable);
    }

    fn tanh(self) -> Self {
        f64::tanh(self)
    }
}

/// Vectors of `f32` in registers of `pulp`.
#[derive(Clone, Copy)]
struct Wide<S>(S);

impl<S: Simd> Lanes<f32> for Wide<S> {
    type V = S::f32s;
    const LANES: usize = S::F32_LANES;
    const REGISTERS: usize = S::REGISTER_COUNT;

    #[inline(always)]
    fn vectors(numbers: &[f32]) -> &[Self::V] {
        S::as_simd_f32s(numbers).0
    }

    #[inline(always)]
    fn vectors_mut(numbers: &mut [f32]) -> &mut [Self::V] {
        S::as_mut_simd_f32s(numbers).0
    }

    #[inline(always)]
    fn splat(self, number: f32) -> Self::V {
        self.0.splat_f32s(number)
    }

    #[inline(always)]
    fn add(self, a: Self::V, b: Self::V) -> Self::V {
        self.0.add_f32s(a, b)
    }

    #[inline(always)]
    fn sub(self, a: Self::V, b: Self::V) -> Self::V {
        self.0.sub_f32s(a, b)
    }

    #[inline(always)]
    fn mul(self, a: Self::V, b: Self::V) -> Self::V {
        self.0.mul_f32s(a, b)
    }

    #[inline(always)]
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
        self.0.mul_add_f32s(a, b, c)
    }

    #[inline(always)]
    fn sigmoid(self, a: Self::V) -> Self::V {
        let s = self.0;
        let one = s.splat_f32s(1.0);
        // A comparison with NaN yields the second operand, so that NaN stays NaN.
        let a = s.max_f32s(s.splat_f32s(-80.0), s.min_f32s(s.splat_f32s(80.0), a));
        let (scale, p) = exponential(s, s.sub_f32s(s.splat_f32s(0.0), a));
        s.div_f32s(one, s.add_f32s(one, s.mul_add_f32s(scale, p, scale)))
    }

    #[inline(always)]
    fn tanh(self, a: Self::V) -> Self::V {
        let s = self.0;
        // exp(2a) - 1 over exp(2a) + 1; the polynomial has no constant term, so nothing cancels near zero.
        let a = s.max_f32s(s.splat_f32s(-20.0), s.min_f32s(s.splat_f32s(20.0), a));
        let (scale, p) = exponential(s, s.add_f32s(a, a));
        let e = s.mul_add_f32s(scale, p, s.sub_f32s(scale, s.splat_f32s(1.0)));
        s.div_f32s(e, s.add_f32s(e, s.splat_f32s(2.0)))
    }

    #[inline(always)]
    fn without_least(self, a: Self::V) -> Self::V {
        let s = self.0;
        // The greater of a number and its opposite: its magnitude, without instructions that AVX-512 has in an extension only.
        let magnitude = s.max_f32s(a, s.sub_f32s(s.splat_f32s(0.0), a));
        let is_least = s.less_than_f32s(magnitude, s.splat_f32s(f32::LEAST));
        s.select_f32s(is_least, s.splat_f32s(0.0), a)
    }
}

/// Vectors as plain arrays, for machines without an instruction set of their own here and for `f64`.
#[derive(Clone, Copy)]
struct Portable;

macro_rules! portable {
    ($number:ty) => {
        impl Lanes<$number> for Portable {
            type V = [$number; 4];
            const LANES: usize = 4;
            const REGISTERS: usize = 16;

            #[inline(always)]
            fn vectors(numbers: &[$number]) -> &[Self::V] {
                numbers.as_chunks().0
            }

            #[inline(always)]
            fn vectors_mut(numbers: &mut [$number]) -> &mut [Self::V] {
                numbers.as_chunks_mut().0
            }

            #[inline(always)]
            fn splat(self, number: $number) -> Self::V {
                [number; 4]
            }

            #[inline(always)]
            fn add(self, a: Self::V, b: Self::V) -> Self::V {
                std::array::from_fn(|lane| a[lane] + b[lane])
            }

            #[inline(always)]
            fn sub(self, a: Self::V, b: Self::V) -> Self::V {
                std::array::from_fn(|lane| a[lane] - b[lane])
            }

            #[inline(always)]
            fn mul(self, a: Self::V, b: Self::V) -> Self::V {
                std::array::from_fn(|lane| a[lane] * b[lane])
            }

            #[inline(always)]
            fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
                std::array::from_fn(|lane| a[lane] * b[lane] + c[lane])
            }

            #[inline(always)]
            fn sigmoid(self, a: Self::V) -> Self::V {
                a.map(|number| 1.0 / (1.0 + (-number).exp()))
            }

            #[inline(always)]
            fn tanh(self, a: Self::V) -> Self::V {
                a.map(<$number>::tanh)
            }

            #[inline(always)]
            fn without_least(self, a: Self::V) -> Self::V {
                a.map(|number| if number.abs() < <$number>::LEAST { 0.0 } else { number })
            }
        }
    };
}

portable!(f32);
portable!(f64);

#[cfg(test)]
mod tests {
    use super::*;

    /// Applies sigmoid and tanh to a slice whose length is a multiple of every vector's.
    struct Both<'a>(&'a [f32], &'a mut [f32], &'a mut [f32]);

    impl Kernel<f32> for Both<'_> {
        fn run<S: Lanes<f32>>(self, s: S) {
            let outputs = S::vectors_mut(self.1).iter_mut().zip(S::vectors_mut(self.2));
            for (&x, (sigmoid, tanh)) in S::vectors(self.0).iter().zip(outputs) {
                *sigmoid = s.sigmoid(x);
                *tanh = s.tanh(x);
            }
        }
    }

    fn both(instructions: Instructions, inputs: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let (mut sigmoid, mut tanh) = (vec![0.0; inputs.len()], vec![0.0; inputs.len()]);
        f32::run(instructions, Both(inputs, &mut sigmoid, &mut tanh));
        (sigmoid, tanh)
    }

    #[test]
    fn activations_are_within_four_ulps_of_the_truth() {
        // Evenly over [-30, 30], then evenly over the exponents down to 2^-30.
        let mut inputs: Vec<f32> = (0..1 << 17).map(|i| (i as f32 / 65536.0 - 1.0) * 30.0).collect();
        inputs.extend((0..1 << 16).map(|i| {
            let magnitude = (-(i as f32) / 65536.0 * 30.0).exp2() * 4.0;
            if i % 2 == 0 { magnitude } else { -magnitude }
        }));
        for instructions in Instructions::all() {
            let (sigmoid, tanh) = both(instructions, &inputs);
            for ((x, s), t) in inputs.iter().zip(sigmoid).zip(tanh) {
                let x = f64::from(*x);
                for (name, got, want) in [("sigmoid", s, 1.0 / (1.0 + (-x).exp())), ("tanh", t, x.tanh())] {
                    let error = (f64::from(got) - want).abs() / want.abs().max(f64::from(f32::MIN_POSITIVE));
                    assert!(
                        error <= 4.0 * f64::from(f32::EPSILON) / 2.0,
                        "{name}({x}) is {got}, off by {error:e} with {}",
                        instructions.name()
                    );
                }
            }
        }
    }

    struct WithoutLeast<'a>(&'a mut [f32]);

    impl Kernel<f32> for WithoutLeast<'_> {
        fn run<S: Lanes<f32>>(self, s: S) {
            for x in S::vectors_mut(self.0) {
                *x = s.without_least(*x);
            }
        }
    }

    #[test]
    fn what_is_too_small_for_the_usual_form_becomes_zero() {
        for instructions in Instructions::all() {
            let mut numbers = [0.0_f32; 16];
            numbers[..7].copy_from_slice(&[1e-31, -1e-40, 1.1e-30, -2e-30, 3.0, f32::INFINITY, f32::NAN]);
            f32::run(instructions, WithoutLeast(&mut numbers));
            assert_eq!(numbers[..6], [0.0, 0.0, 1.1e-30, -2e-30, 3.0, f32::INFINITY]);
            assert!(numbers[6].is_nan(), "{}: what is no number must be seen", instructions.name());
        }
    }

    #[test]
    fn activations_survive_the_extremes() {
        let mut inputs = vec![0.0; 16];
        inputs[..6].copy_from_slice(&[f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, f32::NAN, -0.0]);
        for instructions in Instructions::all() {
            let (sigmoid, tanh) = both(instructions, &inputs);
            assert_eq!([sigmoid[0], sigmoid[2], tanh[0], tanh[2]], [1.0; 4]);
            assert!(sigmoid[1] < 1e-34 && sigmoid[3] < 1e-34);
            assert_eq!([tanh[1], tanh[3]], [-1.0; 2]);
            assert!(sigmoid[4].is_nan() && tanh[4].is_nan(), "{}: not a number", instructions.name());
            assert_eq!((sigmoid[5], tanh[5]), (0.5, 0.0));
        }
    }
}
