//! The exponential of a vector, in two factors.

use pulp::Simd;

/// Coefficients of `(exp(r) - 1 - r) / r^2` for `|r| <= ln(2) / 2`, highest power first: 1/7!, 1/6!, ... 1/2!.
const COEFFICIENTS: [f32; 6] = [1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5];
/// ln(2) in two parts, the first short enough for exact products with whole numbers below 2^10.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
/// Adding it rounds a number below 2^22 to a whole one, which then stands in the low bits.
const ROUND: f32 = 12_582_912.0;

/// `2^n` and `exp(r) - 1` with `exp(a) = 2^n exp(r)` and `|r| <= ln(2) / 2`, for `|a| <= 87`.
///
/// `exp(a)` is `2^n p + 2^n`, to two units in the last place; `exp(a) - 1` is `2^n p + (2^n - 1)`, in which nothing cancels.
#[inline(always)]
pub fn exponential<S: Simd>(s: S, a: S::f32s) -> (S::f32s, S::f32s) {
    let rounded = s.mul_add_e_f32s(a, s.splat_f32s(std::f32::consts::LOG2_E), s.splat_f32s(ROUND));
    let n = s.sub_f32s(rounded, s.splat_f32s(ROUND));
    let r = s.mul_add_e_f32s(n, s.splat_f32s(-LN_2[0]), a);
    let r = s.mul_add_e_f32s(n, s.splat_f32s(-LN_2[1]), r);
    let mut p = s.splat_f32s(COEFFICIENTS[0]);
    for &c in &COEFFICIENTS[1..] {
        p = s.mul_add_e_f32s(p, r, s.splat_f32s(c));
    }
    let p = s.mul_add_e_f32s(s.mul_f32s(r, r), p, r);
    // The low nine bits of `rounded` are n; moved to the exponent and offset by that of 1.0 they are 2^n.
    let bits = s.wrapping_dyn_shl_u32s(s.transmute_u32s_f32s(rounded), s.splat_u32s(23));
    let scale = s.transmute_f32s_u32s(s.add_u32s(bits, s.splat_u32s(127 << 23)));
    (scale, p)
}

#[cfg(test)]
mod tests {
    use pulp::WithSimd;

    use super::*;
    use crate::Instructions;

    struct Exp<'a>(&'a mut [f32]);

    impl WithSimd for Exp<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, s: S) {
            for a in S::as_mut_simd_f32s(self.0).0 {
                let (scale, p) = exponential(s, *a);
                *a = s.mul_add_e_f32s(scale, p, scale);
            }
        }
    }

    #[test]
    fn it_is_within_two_units_in_the_last_place() {
        let inputs: Vec<f32> = (0..1 << 17).map(|i| (i as f32 / 65536.0 - 1.0) * 87.0).collect();
        for instructions in Instructions::all() {
            let mut outputs = inputs.clone();
            instructions.run(Exp(&mut outputs));
            for (&a, &got) in inputs.iter().zip(&outputs) {
                let want = f64::from(a).exp();
                let error = (f64::from(got) - want).abs() / want;
                assert!(
                    error <= 2.0 * f64::from(f32::EPSILON),
                    "exp({a}) is {got}, off by {error:e} with {}",
                    instructions.name()
                );
            }
        }
    }
}
