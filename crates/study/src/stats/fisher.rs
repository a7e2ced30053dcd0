//! The distributions of Fisher and Student, for tests and intervals.
//!
//! # Equations
//! ```text
//! P(F ≤ x) = I_z(a/2, b/2),   z = a x / (a x + b)
//! t² has the distribution of F with 1 and ν degrees of freedom
//! ```
//! I is the regularised incomplete beta function, computed from its continued fraction.
//!
//! # Accuracy
//! The tests compare ten digits with SciPy, and six for the limit of 10⁷ degrees of freedom, χ².
//!
//! # Sources
//! M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions (1964), 26.5.8 and 26.6.2.

use fretwork_engine::numeric::root;

/// The continued fraction ends when a factor differs from 1 by less than this, or after [`TERMS`] factors.
const LAST_FACTOR: f64 = 1e-15;
const TERMS: u32 = 20_000;
/// Replaces a denominator of 0 in the continued fraction.
const TINY: f64 = 1e-300;

/// The probability that an F-distributed number with these degrees of freedom exceeds `x`.
pub fn above(x: f64, (of_numerator, of_denominator): (f64, f64)) -> f64 {
    let product = of_numerator * x;
    beta(0.5 * of_denominator, 0.5 * of_numerator, of_denominator / (product + of_denominator))
}

/// The factor of the standard error: an interval of ± this many standard errors has this confidence. `freedom` is the
/// number of degrees of freedom from which the noise was estimated; `None` if the noise is known.
pub fn factor(confidence: f64, freedom: Option<usize>) -> f64 {
    let Some(freedom) = freedom else {
        return super::distribution::normal_quantile(0.5 + 0.5 * confidence);
    };
    // With s = ln t, the interval of the search covers all confidences from 1e-6 to 1 − 1e-9.
    let excess = |s: f64| {
        let t = libm::exp(s);
        1.0 - confidence - above(t * t, (1.0, freedom as f64))
    };
    libm::exp(root(-15.0, 25.0, excess))
}

/// The regularised incomplete beta function I_x(a, b).
fn beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    // The fraction converges fast on this side of the mean.
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta(b, a, 1.0 - x);
    }
    let size = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let front = libm::exp(size + a * libm::log(x) + b * libm::log1p(-x)) / a;
    // The method of Lentz: c and d are ratios of consecutive numerators and denominators.
    let bounded = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut d = 1.0 / bounded(1.0 - (a + b) * x / (a + 1.0));
    let (mut c, mut fraction) = (1.0, d);
    for m in 1..TERMS {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut last = 1.0;
        for term in [even, odd] {
            d = 1.0 / bounded(1.0 + term * d);
            c = bounded(1.0 + term / c);
            last = c * d;
            fraction *= last;
        }
        if (last - 1.0).abs() < LAST_FACTOR {
            break;
        }
    }
    front * fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantiles_of_student_agree_with_scipy() {
        // scipy.stats.t.ppf, SciPy 1.17.1.
        for (freedom, confidence, known) in [
            (1, 0.9, 6.313_751_514_675_037),
            (1, 0.99, 63.656_741_162_871_526),
            (2, 0.95, 4.302_652_729_749_462),
            (3, 0.95, 3.182_446_305_283_708),
            (10, 0.95, 2.228_138_851_986_274),
            (10, 0.99, 3.169_272_672_616_95),
            (2000, 0.95, 1.961_150_826_099_438),
        ] {
            let found = factor(confidence, Some(freedom));
            assert!((found / known - 1.0).abs() < 1e-10, "{freedom} {confidence}: {found}");
        }
        assert!((factor(0.95, None) - 1.959_963_984_540_054).abs() < 1e-12);
    }

    #[test]
    fn the_probabilities_of_fisher_agree_with_scipy() {
        // 1 − scipy.stats.f.cdf, SciPy 1.17.1. The last one is χ²/2 with 2 degrees of freedom, exp(−3).
        for (a, b, x, below) in [
            (1.0, 2.0, 18.5, 0.949_967_907_031_729_1),
            (3.0, 7.0, 4.3, 0.948_821_938_393_429_7),
            (5.0, 40.0, 2.2, 0.926_717_750_127_836_2),
            (2.0, 1e7, 3.0, 0.950_212_931_6),
        ] {
            let found = above(x, (a, b));
            let error = if b > 1e6 { 1e-6 } else { 1e-11 };
            assert!((found - (1.0 - below)).abs() < error, "{a} {b}: {found}");
        }
        assert!((above(0.0, (3.0, 4.0)) - 1.0).abs() < 1e-15);
    }
}
