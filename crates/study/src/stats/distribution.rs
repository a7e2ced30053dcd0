//! Distributions of a number that a study varies, as inverse functions: from a probability to the value.
//!
//! A design gives points of the unit cube. [`Distribution::quantile`] turns each coordinate u into the value
//! below which the share u of the distribution lies. So stratified coordinates give stratified values.
//!
//! # Units
//! Values have the unit of the number that varies; probabilities and factors have none.
//!
//! # Accuracy
//! The quantile of the normal distribution has a relative error of 1e-15. The other formulas only have rounding errors.
//! All processors give the same digits.
//!
//! # Examples
//! ```
//! use fretwork_study::stats::distribution::Distribution;
//! // 68 % of the wear coefficients lie within a factor of 2 of the median.
//! let wear = Distribution::lognormal(1e-14, 2.0).unwrap();
//! assert_eq!(wear.quantile(0.5), 1e-14);
//! assert!((wear.quantile(0.158_655_253_931_457_05) / 0.5e-14 - 1.0).abs() < 1e-14);
//! ```
//!
//! # Sources
//! M. J. Wichura, Algorithm AS 241: *The percentage points of the normal distribution*, Appl. Statist. 37 (1988)
//! 477: the normal quantile.

use std::sync::LazyLock;

use fretwork_engine::Fault;

/// The distribution of a number that varies. The constructors check the parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distribution(Family);

/// The families. The deviation of `Lognormal` is that of ln x, whose mean is ln `median`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Family {
    Uniform { low: f64, high: f64 },
    LogUniform { low: f64, high: f64 },
    Normal { mean: f64, deviation: f64 },
    Lognormal { median: f64, deviation: f64 },
    Triangular { low: f64, mode: f64, high: f64 },
}

impl Distribution {
    /// All values between `low` and `high` are equally probable.
    ///
    /// # Errors
    /// The fault at `/low` or `/high`.
    pub fn uniform(low: f64, high: f64) -> Result<Self, Fault> {
        finite("low", low)?;
        greater("high", high, "low", low)?;
        Ok(Self(Family::Uniform { low, high }))
    }

    /// ln x is uniform: equal factors between `low` and `high` are equally probable.
    ///
    /// # Errors
    /// The fault at `/low` or `/high`.
    pub fn log_uniform(low: f64, high: f64) -> Result<Self, Fault> {
        positive("low", low)?;
        greater("high", high, "low", low)?;
        Ok(Self(Family::LogUniform { low, high }))
    }

    /// The normal distribution. Its values have no bounds, so some may be negative.
    ///
    /// # Errors
    /// The fault at `/mean` or `/standard_deviation`.
    pub fn normal(mean: f64, standard_deviation: f64) -> Result<Self, Fault> {
        finite("mean", mean)?;
        positive("standard_deviation", standard_deviation)?;
        Ok(Self(Family::Normal { mean, deviation: standard_deviation }))
    }

    /// The lognormal distribution by its median and the factor exp σ, where σ is the standard deviation of ln x. 68 %
    /// of the values lie between `median`/`factor` and `median`·`factor`, 95 % between `median`/`factor`² and
    /// `median`·`factor`².
    ///
    /// # Errors
    /// The fault at `/median` or `/factor`.
    pub fn lognormal(median: f64, factor: f64) -> Result<Self, Fault> {
        positive("median", median)?;
        finite("factor", factor)?;
        if factor <= 1.0 {
            let detail = "must be greater than 1. With a factor of 2, 68 % of the values lie between half and twice the median";
            return Err(fault("factor", detail));
        }
        Ok(Self(Family::Lognormal { median, deviation: libm::log(factor) }))
    }

    /// The lognormal distribution by the mean and the standard deviation of its values (not of their logarithms).
    ///
    /// # Errors
    /// The fault at `/mean` or `/standard_deviation`.
    pub fn lognormal_with_mean(mean: f64, standard_deviation: f64) -> Result<Self, Fault> {
        positive("mean", mean)?;
        positive("standard_deviation", standard_deviation)?;
        let variation = standard_deviation / mean;
        let square = variation * variation;
        let (median, deviation) = (mean / (1.0 + square).sqrt(), libm::log1p(square).sqrt());
        Ok(Self(Family::Lognormal { median, deviation }))
    }

    /// The density rises in a straight line from `low` to `mode`, and falls in a straight line to `high`.
    ///
    /// # Errors
    /// The fault at `/low`, `/mode` or `/high`.
    pub fn triangular(low: f64, mode: f64, high: f64) -> Result<Self, Fault> {
        finite("low", low)?;
        finite("mode", mode)?;
        greater("high", high, "low", low)?;
        if mode < low || mode > high {
            let detail = "must lie between `low` and `high`. `mode` is the most probable value";
            return Err(fault("mode", detail));
        }
        Ok(Self(Family::Triangular { low, mode, high }))
    }

    /// The mean and the standard deviation of a normal distribution; those of the logarithm, and true, for a lognormal
    /// one; `None` for others.
    pub fn normal_parts(&self) -> Option<(f64, f64, bool)> {
        match self.0 {
            Family::Normal { mean, deviation } => Some((mean, deviation, false)),
            Family::Lognormal { median, deviation } => Some((libm::log(median), deviation, true)),
            _ => None,
        }
    }

    /// The value below which the share `u` of the distribution lies, for 0 < u < 1.
    pub fn quantile(&self, u: f64) -> f64 {
        match self.0 {
            // The rounded sum can lie beyond `high`.
            Family::Uniform { low, high } => (low + (high - low) * u).min(high),
            Family::LogUniform { low, high } => (low * libm::pow(high / low, u)).clamp(low, high),
            Family::Normal { mean, deviation } => mean + deviation * normal_quantile(u),
            Family::Lognormal { median, deviation } => {
                median * libm::exp(deviation * normal_quantile(u))
            }
            Family::Triangular { low, mode, high } => {
                let (rise, fall, width) = (mode - low, high - mode, high - low);
                if u * width < rise {
                    low + (u * width * rise).sqrt()
                } else {
                    high - ((1.0 - u) * width * fall).sqrt()
                }
            }
        }
    }
}

fn fault(member: &str, detail: &str) -> Fault {
    Fault { pointer: format!("/{member}"), detail: detail.to_owned() }
}

fn finite(member: &str, value: f64) -> Result<(), Fault> {
    if value.is_finite() { Ok(()) } else { Err(fault(member, "must be a finite number")) }
}

fn positive(member: &str, value: f64) -> Result<(), Fault> {
    finite(member, value)?;
    if value > 0.0 { Ok(()) } else { Err(fault(member, "must be greater than 0")) }
}

/// Checks that `value` is greater than another member, and that their distance and ratio are finite.
fn greater(member: &str, value: f64, other: &str, than: f64) -> Result<(), Fault> {
    finite(member, value)?;
    if value <= than {
        let detail = format!(
            "must be greater than `{other}`. Exchange the two values. If they are equal because the number does not \
             vary, remove it from `vary`"
        );
        return Err(fault(member, &detail));
    }
    if !(value - than).is_finite() || (than > 0.0 && !(value / than).is_finite()) {
        return Err(fault(member, &format!("is too far from `{other}`. Enter a narrower range")));
    }
    Ok(())
}

/// The value below which the share `u` of the standard normal distribution lies, for 0 < u < 1.
///
/// Rational approximations of M. J. Wichura, AS 241, routine PPND16; relative error about 1e-16.
pub(super) fn normal_quantile(u: f64) -> f64 {
    let from_centre = u - 0.5;
    if from_centre.abs() <= 0.425 {
        return from_centre * ratio(0, 0.180_625 - from_centre * from_centre);
    }
    let from_end = if from_centre < 0.0 { u } else { 1.0 - u };
    let r = (-libm::log(from_end)).sqrt();
    let size = if r <= 5.0 { ratio(1, r - 1.6) } else { ratio(2, r - 5.0) };
    size.copysign(from_centre)
}

/// The coefficients of AS 241: for the centre, the middle and the tail a line of those above and a line of those below.
#[expect(clippy::expect_used, reason = "the file is part of the program, and all tests read it")]
static COEFFICIENTS: LazyLock<Vec<Vec<f64>>> = LazyLock::new(|| {
    let numbers = |line: &str| line.split(' ').map(|c| c.parse().expect("a number")).collect();
    include_str!("as241.txt").lines().map(numbers).collect()
});

/// A ratio of two polynomials with ascending coefficients.
fn ratio(part: usize, x: f64) -> f64 {
    let value = |line: usize| COEFFICIENTS[line].iter().rev().fold(0.0, |sum, c| sum * x + c);
    value(2 * part) / value(2 * part + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `mpmath.ncdf` inverted with 40 digits (mpmath 1.4.1).
    #[test]
    fn the_normal_quantile_has_fifteen_digits() {
        for (u, expected) in [
            (1e-300, -37.047_096_299_361_2),
            (f64::EPSILON / 2.0, -8.209_536_151_601_387),
            (1e-9, -5.997_807_015_007_687),
            (1e-5, -4.264_890_793_922_825),
            (0.001, -3.090_232_306_167_813_5),
            (0.07, -1.475_791_028_179_170_7),
            (0.075, -1.439_531_470_938_456),
            (0.3, -0.524_400_512_708_040_8),
            (0.5, 0.0),
            (0.75, 0.674_489_750_196_081_7),
            (0.925, 1.439_531_470_938_456_2),
            (0.926, 1.446_632_067_158_979),
            (0.999, 3.090_232_306_167_813),
            (1.0 - f64::EPSILON * 4096.0, 7.047_700_256_664_409),
        ] {
            let error = (normal_quantile(u) - expected).abs();
            assert!(error <= 1e-15 * expected.abs(), "{u}: error {error:e}");
        }
    }

    /// `ppf` of the distributions in `scipy.stats`, SciPy 1.17.1.
    #[test]
    fn the_quantiles_agree_with_scipy() {
        for (distribution, expected) in [
            (Distribution::uniform(2.0, 5.0), [2.003, 2.6, 3.5, 4.7, 4.9997]),
            (
                Distribution::log_uniform(1e-3, 10.0),
                [
                    0.001_009_252_886_076_684_9,
                    0.006_309_573_444_801_936,
                    0.1,
                    3.981_071_705_534_978,
                    9.990_793_899_844_626,
                ],
            ),
            (
                Distribution::normal(0.7, 0.05),
                [
                    0.545_488_384_691_609_3,
                    0.657_918_938_321_354_3,
                    0.7,
                    0.764_077_578_277_23,
                    0.885_950_824_272_785_4,
                ],
            ),
            (
                Distribution::lognormal(1e-14, 2.0),
                [
                    1.174_214_346_522_680_8e-15,
                    5.580_161_439_828_439e-15,
                    1e-14,
                    2.431_002_817_689_711_4e-14,
                    1.316_847_599_776_196_5e-13,
                ],
            ),
            (
                Distribution::lognormal_with_mean(0.7, 0.2),
                [
                    0.283_208_784_008_936_3,
                    0.531_701_890_455_579_5,
                    0.673_066_763_348_576_2,
                    0.963_760_499_387_627,
                    1.907_682_893_954_125_7,
                ],
            ),
            (
                Distribution::triangular(1.0, 2.0, 5.0),
                [
                    1.063_245_553_203_367_6,
                    1.894_427_190_999_915_7,
                    2.550_510_257_216_822,
                    3.904_554_884_989_668,
                    4.965_358_983_848_624,
                ],
            ),
        ] {
            let distribution = distribution.unwrap();
            for (u, expected) in [0.001, 0.2, 0.5, 0.9, 0.9999].into_iter().zip(expected) {
                let error = (distribution.quantile(u) / expected - 1.0).abs();
                assert!(error < 3e-15, "{distribution:?} at {u}: error {error:e}");
            }
        }
    }

    #[test]
    fn a_triangle_may_have_its_mode_at_an_end() {
        let falling = Distribution::triangular(0.0, 0.0, 1.0).unwrap();
        let rising = Distribution::triangular(0.0, 1.0, 1.0).unwrap();
        assert!((falling.quantile(0.75) - 0.5).abs() < 1e-16);
        assert!((rising.quantile(0.25) - 0.5).abs() < 1e-16);
    }

    #[test]
    fn values_stay_between_the_bounds() {
        let (low, high) = (0.1, 0.3);
        let (least, most) = (f64::MIN_POSITIVE, 1.0 - f64::EPSILON / 2.0);
        for distribution in [
            Distribution::uniform(low, high),
            Distribution::log_uniform(low, high),
            Distribution::triangular(low, 0.2, high),
        ] {
            let distribution = distribution.unwrap();
            for u in [least, 0.1, 0.5, 0.9, most] {
                assert!(
                    (low..=high).contains(&distribution.quantile(u)),
                    "{distribution:?} at {u}"
                );
            }
        }
    }

    #[test]
    fn the_fault_of_a_wrong_parameter_names_it() {
        let inf = f64::INFINITY;
        for (result, pointer, words) in [
            (Distribution::uniform(f64::NAN, 1.0), "/low", "finite"),
            (Distribution::uniform(2.0, 1.0), "/high", "greater than `low`"),
            (Distribution::uniform(-f64::MAX, f64::MAX), "/high", "narrower"),
            (Distribution::log_uniform(0.0, 1.0), "/low", "greater than 0"),
            (Distribution::log_uniform(1e-300, 1e300), "/high", "narrower"),
            (Distribution::normal(inf, 1.0), "/mean", "finite"),
            (Distribution::normal(1.0, 0.0), "/standard_deviation", "greater than 0"),
            (Distribution::lognormal(-1.0, 2.0), "/median", "greater than 0"),
            (Distribution::lognormal(1.0, 0.5), "/factor", "greater than 1"),
            (Distribution::lognormal_with_mean(0.0, 1.0), "/mean", "greater than 0"),
            (Distribution::lognormal_with_mean(1.0, inf), "/standard_deviation", "finite"),
            (Distribution::triangular(0.0, 2.0, 1.0), "/mode", "between"),
            (Distribution::triangular(1.0, 1.0, 1.0), "/high", "greater than `low`"),
        ] {
            let fault = result.unwrap_err();
            assert_eq!(fault.pointer, pointer, "{}", fault.detail);
            assert!(fault.detail.contains(words), "{}", fault.detail);
        }
    }
}
