//! Functions that the vector units do not have, for any number of lanes.

use super::Real;

/// Sine and cosine, |x| ≤ 2^20: Cody-Waite reduction by π/2 in three parts, then the Taylor series on
/// [−π/4, π/4] to rounding. Without branches and comparisons, so that it is the same text for every width;
/// within 2 ulp of the scalar functions (tested).
#[inline(always)]
pub(super) fn sin_cos<L: Real>(angle: L) -> (L, L) {
    // π/2 = P1 + P2 + P3, each with enough trailing zeros that k·P is exact for |k| < 2^20 (fdlibm).
    const P1: f64 = 1.570_796_326_734_125_6;
    const P2: f64 = 6.077_100_506_303_966e-11;
    const P3: f64 = 2.022_266_248_795_951e-21;
    // The nearest multiple of π/2, so that |x| ≤ π/4 but for rounding: the reduction needs no comparison.
    let k = rounded(angle * std::f64::consts::FRAC_2_PI);
    // From the largest part to the smallest: the first difference is exact, and what it cancels the next two
    // restore.
    let x = angle - k * P1 - k * P2 - k * P3;
    let (s, c) = sin_cos_kernel(x);
    // q = k mod 4 in {−2, −1, 0, 1, 2}; sin and cos of q·π/2 are polynomials in it, exact on these five
    let q = k - rounded(k * 0.25) * 4.0;
    let q2 = q * q;
    // Lagrange polynomials through the five points: a table look-up would need lanes to take different
    // branches.
    let sin_q = q * (q2 * -1.0 + 4.0) * (1.0 / 3.0);
    let cos_q = q2 * (q2 - L::from(7.0)) * (1.0 / 6.0) + 1.0;
    (s * cos_q + c * sin_q, c * cos_q - s * sin_q)
}

/// The nearest integer, |x| < 2^51: adding and subtracting 1.5·2^52 leaves no room for a fraction.
#[inline(always)]
pub(crate) fn rounded<L: Real>(x: L) -> L {
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // The compiler may not simplify this: floating-point addition is not associative in Rust.
    (x + ROUND) - L::from(ROUND)
}

/// sin and cos by Taylor series, exact to rounding for |x| ≤ π/4.
#[inline(always)]
fn sin_cos_kernel<L: Real>(x: L) -> (L, L) {
    let (sinc, cos) = sinc_cos_of_square(x * x);
    (x * sinc, cos)
}

/// (sin x / x, cos x) as functions of x², exact to rounding for |x| ≤ π/4.
#[inline(always)]
pub(super) fn sinc_cos_of_square<L: Real>(x2: L) -> (L, L) {
    // (−1)^k/(2k + 1)! and below (−1)^k/(2k)!: at π/4 the first terms left out are 1e-19 and 3e-21.
    const SINC: [f64; 9] = [
        1.0 / 355_687_428_096_000.0,
        -1.0 / 1_307_674_368_000.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 39_916_800.0,
        1.0 / 362_880.0,
        -1.0 / 5040.0,
        1.0 / 120.0,
        -1.0 / 6.0,
        1.0,
    ];
    const COS: [f64; 10] = [
        -1.0 / 6_402_373_705_728_000.0,
        1.0 / 20_922_789_888_000.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 479_001_600.0,
        -1.0 / 3_628_800.0,
        1.0 / 40_320.0,
        -1.0 / 720.0,
        1.0 / 24.0,
        -0.5,
        1.0,
    ];
    (horner(&SINC, x2), horner(&COS, x2))
}

/// The polynomial with the given coefficients, highest power first.
#[inline(always)]
fn horner<L: Real, const N: usize>(coefficients: &[f64; N], x: L) -> L {
    let mut sum = L::from(coefficients[0]);
    for i in 1..N {
        sum = sum.mul_add(x, L::from(coefficients[i]));
    }
    sum
}
