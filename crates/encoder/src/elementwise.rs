//! What happens to single numbers and rows: GELU, softmax, layer normalisation.

use pulp::{Simd, WithSimd};
use rprae_lanes::exponential;

/// Below it the exponential is taken for this number's, which is the least of usual form.
const LEAST_EXPONENT: f32 = -87.0;

/// `exp(a)` for `a` of at most 80, to some units in the last place.
#[inline(always)]
fn exp<S: Simd>(s: S, a: S::f32s) -> S::f32s {
    // A comparison with NaN yields the second operand, so that NaN stays NaN.
    let a = s.max_f32s(s.splat_f32s(LEAST_EXPONENT), a);
    let (scale, p) = exponential(s, a);
    s.mul_add_e_f32s(scale, p, scale)
}

/// `erfc(z) = t (a_1 + a_2 t + ... + a_5 t^4) exp(-z^2)` with `t = 1 / (1 + p z)` for z >= 0, to 1.5e-7
/// (Abramowitz and Stegun 1964, 7.1.26); highest power first.
const ERFC: [f32; 5] = [1.061_405_4, -1.453_152, 1.421_413_7, -0.284_496_74, 0.254_829_6];
const ERFC_P: f32 = 0.327_591_1;

/// `x Phi(x)` with the normal distribution function, to 1e-6 for |x| of a few: `max(x, 0) - |x| erfc(|x| / sqrt 2) / 2`.
#[inline(always)]
pub(crate) fn gelu<S: Simd>(s: S, x: S::f32s) -> S::f32s {
    let one = s.splat_f32s(1.0);
    let zero = s.splat_f32s(0.0);
    // The greater of a number and its opposite: its magnitude, without instructions that AVX-512 has in an extension only.
    let magnitude = s.max_f32s(x, s.sub_f32s(zero, x));
    let z = s.mul_f32s(magnitude, s.splat_f32s(std::f32::consts::FRAC_1_SQRT_2));
    let t = s.div_f32s(one, s.mul_add_e_f32s(z, s.splat_f32s(ERFC_P), one));
    let mut tail = s.splat_f32s(ERFC[0]);
    for &a in &ERFC[1..] {
        tail = s.mul_add_e_f32s(tail, t, s.splat_f32s(a));
    }
    let falling = exp(s, s.mul_f32s(s.sub_f32s(zero, z), z));
    let tail = s.mul_f32s(s.mul_f32s(tail, t), falling);
    let half = s.mul_f32s(magnitude, s.splat_f32s(0.5));
    // NaN stays NaN by way of the product.
    s.sub_f32s(s.max_f32s(x, zero), s.mul_f32s(half, tail))
}

/// Softmax over the first `length` numbers of each row after a product with `scale`.
///
/// A row is some whole vectors; what lies beyond `length` becomes nearly zero.
pub(crate) struct Softmax<'a> {
    pub(crate) rows: &'a mut [f32],
    /// Numbers in a row.
    pub(crate) stride: usize,
    pub(crate) length: usize,
    pub(crate) scale: f32,
}

impl WithSimd for Softmax<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let scale = s.splat_f32s(self.scale);
        for row in self.rows.chunks_exact_mut(self.stride) {
            row[self.length..].fill(-f32::MAX);
            let row = S::as_mut_simd_f32s(row).0;
            let most = row.iter().fold(s.splat_f32s(-f32::MAX), |most, &x| s.max_f32s(most, x));
            let most = s.splat_f32s(s.reduce_max_f32s(most));
            let mut sum = s.splat_f32s(0.0);
            for x in row.iter_mut() {
                *x = exp(s, s.mul_f32s(s.sub_f32s(*x, most), scale));
                sum = s.add_f32s(sum, *x);
            }
            let share = s.splat_f32s(1.0 / s.reduce_sum_f32s(sum));
            for x in row {
                *x = s.mul_f32s(*x, share);
            }
        }
    }
}

/// Each row to mean 0 and variance 1, then scaled and shifted.
pub(crate) struct Normalise<'a> {
    /// `[row, width]`.
    pub(crate) rows: &'a mut [f32],
    /// `[width]`.
    pub(crate) scale: &'a [f32],
    /// `[width]`.
    pub(crate) shift: &'a [f32],
    pub(crate) epsilon: f32,
}

/// The sum of `f` over a row; the numbers beyond the last whole vector come one by one.
#[inline(always)]
fn sum<S: Simd>(s: S, row: &[f32], vectors: impl Fn(S::f32s) -> S::f32s, one: impl Fn(f32) -> f32) -> f32 {
    let (whole, rest) = S::as_simd_f32s(row);
    let sum = whole.iter().fold(s.splat_f32s(0.0), |sum, &x| s.add_f32s(sum, vectors(x)));
    s.reduce_sum_f32s(sum) + rest.iter().map(|&x| one(x)).sum::<f32>()
}

impl WithSimd for Normalise<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, s: S) {
        let width = self.scale.len();
        let (scale, scale_rest) = S::as_simd_f32s(self.scale);
        let (shift, shift_rest) = S::as_simd_f32s(self.shift);
        for row in self.rows.chunks_exact_mut(width) {
            let mean = sum(s, row, |x| x, |x| x) / width as f32;
            let means = s.splat_f32s(mean);
            let square = |x| {
                let x = s.sub_f32s(x, means);
                s.mul_f32s(x, x)
            };
            let variance = sum(s, row, square, |x| (x - mean) * (x - mean)) / width as f32;
            let inverse = 1.0 / (variance + self.epsilon).sqrt();
            let inverses = s.splat_f32s(inverse);
            let (whole, rest) = S::as_mut_simd_f32s(row);
            for (x, (&scale, &shift)) in whole.iter_mut().zip(scale.iter().zip(shift)) {
                let unit = s.mul_f32s(s.sub_f32s(*x, means), inverses);
                *x = s.mul_add_e_f32s(unit, scale, shift);
            }
            for (x, (scale, shift)) in rest.iter_mut().zip(scale_rest.iter().zip(shift_rest)) {
                *x = (*x - mean) * inverse * scale + shift;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rprae_lanes::Instructions;

    struct Gelu<'a>(&'a mut [f32]);

    impl WithSimd for Gelu<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, s: S) {
            for x in S::as_mut_simd_f32s(self.0).0 {
                *x = gelu(s, *x);
            }
        }
    }

    /// The complementary error function for z >= 0: its series, and where that cancels its continued fraction.
    fn erfc(z: f64) -> f64 {
        let scale = 1.0 / std::f64::consts::PI.sqrt();
        if z < 2.5 {
            let (mut term, mut sum) = (z, z);
            for n in 1..80 {
                term *= -z * z / f64::from(n);
                sum += term / f64::from(2 * n + 1);
            }
            return 1.0 - 2.0 * scale * sum;
        }
        let fraction = (1..80).rev().fold(z, |fraction, n| z + 0.5 * f64::from(n) / fraction);
        scale * (-z * z).exp() / fraction
    }

    #[test]
    fn gelu_is_within_a_millionth_of_the_truth() {
        let inputs: Vec<f32> = (0..1 << 16).map(|i| (i as f32 / 32768.0 - 1.0) * 12.0).collect();
        for instructions in Instructions::all() {
            let mut outputs = inputs.clone();
            instructions.run(Gelu(&mut outputs));
            for (&x, &got) in inputs.iter().zip(&outputs) {
                let x = f64::from(x);
                let tail = 0.5 * x.abs() * erfc(x.abs() / 2.0_f64.sqrt());
                let error = (f64::from(got) - (x.max(0.0) - tail)).abs();
                assert!(error < 1e-6, "gelu({x}) is {got}, off by {error:e} with {}", instructions.name());
            }
        }
    }

    #[test]
    fn gelu_survives_the_extremes() {
        for instructions in Instructions::all() {
            let mut numbers = [0.0; 16];
            numbers[..5].copy_from_slice(&[1e30, -1e30, f32::NAN, -0.0, -30.0]);
            instructions.run(Gelu(&mut numbers));
            assert_eq!(numbers[0], 1e30);
            assert!(numbers[1].abs() < 1e-6 && numbers[4].abs() < 1e-6, "{numbers:?}");
            assert!(numbers[2].is_nan(), "what is no number must be seen");
            assert_eq!(numbers[3], 0.0);
        }
    }

    #[test]
    fn shares_are_those_of_exponentials() {
        for instructions in Instructions::all() {
            let mut rows = vec![9.0; 64];
            rows[..3].copy_from_slice(&[2.0, 4.0, -400.0]);
            rows[32..35].copy_from_slice(&[1000.0; 3]);
            instructions.run(Softmax { rows: &mut rows, stride: 32, length: 3, scale: 0.5 });
            let larger = 1.0 / (1.0 + (-1.0_f32).exp());
            let wanted = [1.0 - larger, larger, 0.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0];
            for (got, want) in rows[..3].iter().chain(&rows[32..35]).zip(wanted) {
                assert!((got - want).abs() < 1e-6, "{got} {want}");
            }
            assert!(rows[3..32].iter().all(|&beyond| beyond < 1e-30));
        }
    }

    #[test]
    fn rows_are_normalised_whatever_their_width() {
        for instructions in Instructions::all() {
            for width in [1, 7, 24, 35] {
                let row: Vec<f32> = (0..width).map(|i| (i * i % 11) as f32 + 100.0).collect();
                let (scale, shift) = (vec![2.0; width], vec![-1.0; width]);
                let mut got = row.clone();
                let (scale, shift) = (&scale[..], &shift[..]);
                instructions.run(Normalise { rows: &mut got, scale, shift, epsilon: 1e-5 });
                let mean = row.iter().map(|&x| f64::from(x)).sum::<f64>() / width as f64;
                let variance = row.iter().map(|&x| (f64::from(x) - mean).powi(2)).sum::<f64>() / width as f64;
                for (x, got) in row.iter().zip(got) {
                    let want = (f64::from(*x) - mean) / (variance + 1e-5).sqrt() * 2.0 - 1.0;
                    assert!((f64::from(got) - want).abs() < 1e-4, "{width}: {got} {want}");
                }
            }
        }
    }
}
