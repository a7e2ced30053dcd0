//! Small numerical tools: Gauss–Legendre quadrature, bracketed roots and maxima, dot products.
//!
//! All functions give the same digits on every processor. IEEE 754 defines square roots and the four
//! operations exactly, other functions come from `libm`, and sums have a fixed order.

use std::sync::OnceLock;

/// The number of Gauss points in [`integrate`].
pub const GAUSS_POINTS: usize = 32;

/// A Gauss–Legendre rule of `N` points on 0…1. It is exact for polynomials of degree 2N − 1.
#[derive(Debug, Clone)]
pub struct Gauss<const N: usize> {
    /// Abscissae in 0…1, ascending.
    pub nodes: [f64; N],
    /// Weights; they sum to 1.
    pub weights: [f64; N],
}

impl<const N: usize> Gauss<N> {
    /// Computes the rule by Newton's method on the Legendre polynomial.
    pub(crate) fn new() -> Self {
        let (mut nodes, mut weights) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let guess = (i as f64 + 0.75) / (N as f64 + 0.5) * std::f64::consts::PI;
            let mut z = -libm::cos(guess);
            let mut slope = 1.0;
            for _ in 0..100 {
                let (value, derivative) = legendre(N, z);
                slope = derivative;
                let step = value / derivative;
                z -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            nodes[i] = 0.5 * (1.0 + z);
            weights[i] = 1.0 / ((1.0 - z * z) * slope * slope);
        }
        Self { nodes, weights }
    }
}

/// The Legendre polynomial Pₙ(z) and its derivative.
fn legendre(n: usize, z: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, z);
    for k in 2..=n {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * z * value - (k - 1.0) * before) / k);
    }
    (value, n as f64 * (z * value - before) / (z * z - 1.0))
}

/// ∫ f over `from`…`to` by one Gauss rule, for functions that are smooth on the closed interval.
pub fn integrate(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    static RULE: OnceLock<Gauss<GAUSS_POINTS>> = OnceLock::new();
    let rule = RULE.get_or_init(Gauss::new);
    let width = to - from;
    let sum: f64 = rule.nodes.iter().zip(&rule.weights).map(|(x, w)| w * f(from + width * x)).sum();
    width * sum
}

/// ∫ f over `from`…`to`, split at the `kinks` in between. Elsewhere the function must be smooth. At a kink it can
/// rise like a square root.
pub(crate) fn integrate_pieces(from: f64, to: f64, kinks: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let piece = |from: f64, to: f64| {
        integrate(0.0, 1.0, |s| {
            // Roots at either end become smooth in s.
            let weight = 6.0 * s * (1.0 - s) * (to - from);
            weight * f(from + (to - from) * s * s * (3.0 - 2.0 * s))
        })
    };
    let inside = kinks.iter().copied().filter(|kink| (from..to).contains(kink));
    let (last, sum) =
        inside.fold((from, 0.0), |(before, sum), kink| (kink, sum + piece(before, kink)));
    sum + piece(last, to)
}

/// ∫ f over `from`…`to`, also if f has a kink just before `from`. In this case the function integrates from the kink to
/// `to` and subtracts the integral from the kink to `from`, because f is smooth beyond the kink. Without a kink nearby
/// the function is [`integrate`].
pub(crate) fn integrate_beyond(from: f64, to: f64, kinks: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let near = |kink: &&f64| **kink < to && from - **kink < to - from;
    match kinks.iter().find(near) {
        None => integrate(from, to, f),
        Some(kink) if *kink >= from => integrate_pieces(from, to, kinks, f),
        Some(kink) => {
            integrate_pieces(*kink, to, kinks, &f) - integrate_pieces(*kink, from, kinks, &f)
        }
    }
}

/// The root of `f` between `low` and `high` to the last bits. `f` must change sign there.
pub fn root(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    root_between(0.0, (low, f(low)), (high, f(high)), f)
}

/// The root of `f` between two points whose values have different signs. The search ends when the distance of the points
/// is at most `digits`, relatively, or when the root is known to the last bits.
///
/// The method is false position with the Anderson–Björck correction, and bisection every fourth round.
pub(crate) fn root_between(
    digits: f64,
    (mut low, mut at_low): (f64, f64),
    (mut high, mut at_high): (f64, f64),
    mut f: impl FnMut(f64) -> f64,
) -> f64 {
    const ROUNDS: usize = 200;
    for round in 0..ROUNDS {
        let (width, size) = ((high - low).abs(), high.abs().max(low.abs()));
        let close = width <= 2.0 * f64::EPSILON * size || width / size <= digits;
        if at_low == 0.0 || at_high == 0.0 || close {
            break;
        }
        let secant = high - at_high * (high - low) / (at_high - at_low);
        let inside = secant > low.min(high) && secant < low.max(high);
        let middle = if inside && round % 4 != 3 { secant } else { 0.5 * (low + high) };
        let at_middle = f(middle);
        if at_middle.is_sign_negative() == at_high.is_sign_negative() && at_middle != 0.0 {
            let shrink = 1.0 - at_middle / at_high;
            at_low *= if shrink > 0.0 { shrink } else { 0.5 };
        } else {
            (low, at_low) = (high, at_high);
        }
        (high, at_high) = (middle, at_middle);
    }
    if at_low == 0.0 { low } else { high }
}

/// The maximum of `f` between `low` and `high`, where `f` rises and then falls. Golden section narrows the
/// interval to 1e-4 of its width, then a parabola gives the vertex. The error is about 1e-8 of the interval.
pub fn maximum(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (first, last) = (low, high);
    let mut left = high - GOLDEN * (high - low);
    let mut right = low + GOLDEN * (high - low);
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..18 {
        if at_left > at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - GOLDEN * (high - low);
            at_left = f(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + GOLDEN * (high - low);
            at_right = f(right);
        }
    }
    let step = high - low;
    // Keep the parabola inside the interval, because `f` may be undefined outside.
    let middle = (0.5 * (low + high)).clamp(first + step, last - step);
    let (before, here, after) = (f(middle - step), f(middle), f(middle + step));
    let curvature = before - 2.0 * here + after;
    if curvature >= 0.0 {
        return middle;
    }
    (middle + 0.5 * step * (before - after) / curvature).clamp(first, last)
}

/// Number of partial sums, or maxima, that are computed side by side. With a single sum, each addition would have to
/// wait for the addition before it.
const LANES: usize = 8;

/// Σ aᵢbᵢ over the shorter length, in a fixed order that the compiler can vectorise.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    weighted(a, b, |b| b)
}

/// Σ aᵢ·f(bᵢ) over the shorter length, in a fixed order that the compiler can vectorise.
pub(crate) fn weighted(a: &[f64], b: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let length = a.len().min(b.len());
    let (a, b) = (&a[..length], &b[..length]);
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 =
        a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(x, y)| x * f(*y)).sum();
    let mut lanes = [0.0; LANES];
    for (x, y) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            lanes[lane] += x[lane] * f(y[lane]);
        }
    }
    ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6]))
        + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]))
        + rest
}

/// ∫ max(0, y) dx over a…b, for y that is linear between its values at a and b.
pub(crate) fn positive_area([a, b]: [f64; 2], [left, right]: [f64; 2]) -> f64 {
    let (low, high) = (left.min(right), left.max(right));
    if high <= 0.0 {
        0.0
    } else if low >= 0.0 {
        0.5 * (b - a) * (low + high)
    } else {
        0.5 * (b - a) * high * high / (high - low)
    }
}

/// The index of the first largest value; 0 without values.
pub fn largest(values: &[f64]) -> usize {
    let mut lanes = [f64::NEG_INFINITY; LANES];
    let chunks = values.chunks_exact(LANES);
    let mut most = chunks.remainder().iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for chunk in chunks {
        for lane in 0..LANES {
            lanes[lane] = if chunk[lane] > lanes[lane] { chunk[lane] } else { lanes[lane] };
        }
    }
    most = lanes.into_iter().fold(most, f64::max);
    values.iter().position(|value| *value >= most).unwrap_or(0)
}

/// The value at `at` on the straight lines between points with ascending x; none beyond them.
pub fn linear(x: &[f64], y: &[f64], at: f64) -> Option<f64> {
    let i = x.windows(2).position(|pair| (pair[0]..=pair[1]).contains(&at))?;
    Some(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i]))
}

/// The height of the parabola through the largest value and its neighbours.
pub fn vertex(x: &[f64], y: &[f64], at: usize) -> f64 {
    if at == 0 || at + 1 == y.len() {
        return y[at].max(0.0);
    }
    let (left, right) = (x[at] - x[at - 1], x[at + 1] - x[at]);
    let slope_left = (y[at] - y[at - 1]) / left;
    let slope_right = (y[at + 1] - y[at]) / right;
    let curvature = (slope_right - slope_left) / (left + right);
    if curvature >= 0.0 {
        return y[at].max(0.0);
    }
    let slope = (slope_left * right + slope_right * left) / (left + right);
    (y[at] - slope * slope / (4.0 * curvature)).max(0.0)
}

/// A piecewise cubic curve through points. It is monotone between points, and so does not overshoot them.
///
/// F. N. Fritsch, J. Butland, *SIAM J. Sci. Stat. Comput.* 5 (1984) 300.
#[derive(Debug, Clone)]
pub struct Monotone {
    x: Vec<f64>,
    y: Vec<f64>,
    slopes: Vec<f64>,
}

impl Monotone {
    /// The curve through at least one point, in ascending order of `x`.
    pub(crate) fn through(x: Vec<f64>, y: Vec<f64>) -> Self {
        let secants: Vec<f64> =
            x.windows(2).zip(y.windows(2)).map(|(x, y)| (y[1] - y[0]) / (x[1] - x[0])).collect();
        let mut slopes = Vec::with_capacity(x.len());
        slopes.push(secants.first().copied().unwrap_or(0.0));
        for (pair, x) in secants.windows(2).zip(x.windows(3)) {
            let (left, right) = (x[1] - x[0], x[2] - x[1]);
            let (w1, w2) = (2.0 * right + left, right + 2.0 * left);
            let same_sign = pair[0] * pair[1] > 0.0;
            let slope = (w1 + w2) / (w1 / pair[0] + w2 / pair[1]);
            slopes.push(if same_sign { slope } else { 0.0 });
        }
        if x.len() > 1 {
            slopes.extend(secants.last());
        }
        Self { x, y, slopes }
    }

    /// The value at `x`. Outside the points it is the first or the last value.
    pub(crate) fn at(&self, x: f64) -> f64 {
        value(self.piece(self.x.partition_point(|knot| *knot <= x)), x)
    }

    /// A function that gives the values at ascending `x`. It searches each interval from the last one on, not from the
    /// start.
    pub fn along(&self) -> impl FnMut(f64) -> f64 {
        let mut right = 0;
        let mut piece = self.piece(0);
        move |x| {
            let ahead = self.x[right..].iter().take_while(|knot| **knot <= x).count();
            if ahead > 0 {
                right += ahead;
                piece = self.piece(right);
            }
            value(piece, x)
        }
    }

    /// The cubic that ends at the point `right`: the abscissa of its start, and its coefficients in powers of the
    /// distance from there.
    fn piece(&self, right: usize) -> (f64, [f64; 4]) {
        if right == 0 || right == self.x.len() {
            return (0.0, [self.y[right.saturating_sub(1)], 0.0, 0.0, 0.0]);
        }
        let left = right - 1;
        let per_width = 1.0 / (self.x[right] - self.x[left]);
        let secant = per_width * (self.y[right] - self.y[left]);
        let (start, end) = (self.slopes[left], self.slopes[right]);
        let square = per_width * (3.0 * secant - 2.0 * start - end);
        let cube = per_width * per_width * (start + end - 2.0 * secant);
        (self.x[left], [self.y[left], start, square, cube])
    }
}

/// Evaluates a cubic that [`Monotone::piece`] has returned.
fn value((from, [value, slope, square, cube]): (f64, [f64; 4]), x: f64) -> f64 {
    let x = x - from;
    value + x * (slope + x * (square + x * cube))
}

/// xⁿ for a whole n ≥ 0 by repeated multiplication (`f64::powi` may differ between platforms).
pub(crate) fn whole_power(x: f64, n: u32) -> f64 {
    let (mut base, mut left, mut product) = (x, n, 1.0);
    while left > 0 {
        if left & 1 == 1 {
            product *= base;
        }
        base *= base;
        left >>= 1;
    }
    product
}

/// Rounds `x` to 12 significant decimal digits, the precision of scenarios and results. The result is the float64
/// nearest to the decimal number. −0 becomes 0.
pub fn twelve_digits(x: f64) -> f64 {
    /// The powers of ten that float64 holds exactly.
    const TENS: [f64; 23] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
        1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
    ];
    let decimal = Decimal::of(x).and_then(|decimal| {
        // The code divides two exact numbers, so the result is rounded only once.
        let ten = TENS.get(usize::from(decimal.places))?;
        Some((decimal.digits as f64 / ten).copysign(x))
    });
    decimal.unwrap_or_else(|| printed_with_twelve_digits(x))
}

/// A positive decimal number: `digits`·10^−`places`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decimal {
    /// All digits, at most 10¹².
    pub digits: u64,
    /// The number of decimal places, 0…27.
    pub places: u8,
}

impl Decimal {
    /// |x| rounded to 12 significant digits; a tie is rounded to the even digit. `None` outside of 10⁻¹⁵…10¹², where the
    /// arithmetic is not exact.
    pub fn of(x: f64) -> Option<Self> {
        /// The powers of five that fit into 64 bits.
        const FIVES: [u64; 28] = {
            let mut fives = [1; 28];
            let mut k = 1;
            while k < fives.len() {
                fives[k] = 5 * fives[k - 1];
                k += 1;
            }
            fives
        };
        const MOST: u64 = 1_000_000_000_000;
        if !(1e-15..1e12).contains(&x.abs()) {
            return None;
        }
        // |x| = significand·2^−shift, and 78913/2¹⁸ is log 2. So the estimated power may be one too small.
        let bits = x.abs().to_bits();
        let exponent = (bits >> 52) as i32 - 1023;
        let (significand, shift) = (bits & ((1 << 52) - 1) | 1 << 52, 52 - exponent);
        let power = (exponent * 78_913) >> 18;
        let places = 11 - power;
        let rounded = |places: i32| {
            // The exact value of significand·10^places/2^shift.
            let product = u128::from(significand) * u128::from(FIVES[places as usize]);
            let shift = (shift - places) as u32;
            let digits = (product >> shift) as u64;
            let (rest, half) = (product & ((1 << shift) - 1), 1 << (shift - 1));
            digits + u64::from(rest > half || rest == half && digits % 2 == 1)
        };
        let digits = rounded(places);
        let (digits, places) =
            if digits <= MOST { (digits, places) } else { (rounded(places - 1), places - 1) };
        Some(Self { digits, places: places as u8 })
    }
}

/// The same result as [`twelve_digits`], for any number, by printing and parsing.
#[expect(clippy::expect_used, reason = "a formatted number always parses")]
fn printed_with_twelve_digits(x: f64) -> f64 {
    format!("{x:.11e}").parse::<f64>().expect("a formatted number parses") + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gauss_integrates_polynomials_exactly() {
        let rule = Gauss::<8>::new();
        for degree in 0..16 {
            let sum: f64 = rule
                .nodes
                .iter()
                .zip(&rule.weights)
                .map(|(x, w)| w * whole_power(*x, degree))
                .sum();
            assert!(
                (sum - 1.0 / (f64::from(degree) + 1.0)).abs() < 1e-15,
                "degree {degree}: {sum}"
            );
        }
    }

    #[test]
    fn integrals_with_square_roots_at_a_kink_are_accurate() {
        let rooted = |x: f64| (x - 0.3_f64).abs().sqrt();
        let exact = (0.3 * 0.3_f64.sqrt() + 0.7 * 0.7_f64.sqrt()) / 1.5;
        assert!((integrate_pieces(0.0, 1.0, &[0.3], rooted) - exact).abs() < 1e-14);
        assert!(
            (integrate_pieces(0.3, 1.0, &[0.3], rooted) - 0.7 * 0.7_f64.sqrt() / 1.5).abs() < 1e-14
        );
    }

    #[test]
    fn roots_and_maxima_are_accurate() {
        assert!((root(0.0, 2.0, |x| x * x - 2.0) - std::f64::consts::SQRT_2).abs() < 1e-15);
        assert!((root(0.0, 1.0, |x| libm::pow(x, 9.0) - 1e-9) - 0.1).abs() < 1e-15);
        assert!((maximum(0.0, 3.0, |x| x * (2.0 - x)) - 1.0).abs() < 1e-7);
        // These functions are undefined (NaN) outside the interval. The maximum is at one of its ends.
        assert!(maximum(0.0, 1.0, |x| 1.0 - x * x.sqrt()) < 1e-3);
        assert!(maximum(0.0, 1.0, |x| 1.0 - (1.0 - x) * (1.0 - x).sqrt()) > 0.999);
    }

    #[test]
    fn dot_is_the_sum_of_products_for_any_length() {
        let a: Vec<f64> = (0..37).map(f64::from).collect();
        for length in 0..a.len() {
            let expected: f64 = a[..length].iter().map(|x| x * x).sum();
            assert!((dot(&a[..length], &a) - expected).abs() < 1e-12 * expected.max(1.0));
        }
    }

    #[test]
    fn largest_finds_the_largest_value_at_any_position() {
        for length in 1..40 {
            for at in 0..length {
                let values: Vec<f64> = (0..length).map(|i| f64::from(u8::from(i == at))).collect();
                assert_eq!(largest(&values), at, "{values:?}");
            }
        }
        assert_eq!(largest(&[]), 0);
        assert_eq!(largest(&[-2.0, -1.0, -1.0]), 1);
    }

    #[test]
    fn a_monotone_curve_passes_through_its_points_without_overshoot() {
        let x: Vec<f64> = vec![0.0, 0.1, 0.5, 0.6, 2.0];
        let y = vec![0.0, 0.0, 1.0, 1.0, 3.0];
        let curve = Monotone::through(x.clone(), y.clone());
        for (x, y) in x.iter().zip(&y) {
            assert!((curve.at(*x) - y).abs() < 1e-15);
        }
        let mut before = 0.0;
        for i in 0..=2000 {
            let value = curve.at(f64::from(i) * 1e-3);
            assert!(value >= before - 1e-15 && value <= 3.0);
            before = value;
        }
        let parabola = |n: u32| {
            let x: Vec<f64> = (0..=n).map(|i| 1.0 + f64::from(i) / f64::from(n)).collect();
            let y = x.iter().map(|x| x * x).collect();
            (Monotone::through(x, y).at(1.523) - 1.523 * 1.523).abs()
        };
        assert!(parabola(40) < 1e-4 && parabola(80) < 0.3 * parabola(40));
    }

    #[test]
    fn twelve_digits_are_kept_and_rounding_is_idempotent() {
        let same = |a: f64, b: f64| assert_eq!(a.to_bits(), b.to_bits(), "{a} {b}");
        same(twelve_digits(0.1 + 0.2), 0.3);
        same(twelve_digits(-0.0), 0.0);
        let third = twelve_digits(1.0 / 3.0);
        same(third, 0.333_333_333_333);
        same(twelve_digits(third), third);
    }

    #[test]
    fn rounding_to_twelve_digits_agrees_with_printing() {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = || {
            seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            seed >> 11
        };
        let two = |power: i64| f64::from_bits(((1023 + power) as u64) << 52);
        let check = |x: f64| {
            let (fast, printed) = (twelve_digits(x), printed_with_twelve_digits(x));
            assert_eq!(fast.to_bits(), printed.to_bits(), "{x:e}: {fast:e}, {printed:e}");
            assert_eq!(twelve_digits(fast).to_bits(), fast.to_bits(), "{x:e}");
        };
        for _ in 0..200_000 {
            let significand = 1.0 + random() as f64 * two(-53);
            check(significand * two((random() % 100).cast_signed() - 50));
            // Ties and their neighbours: 13 digits, the last of which is 5.
            let thirteen = 10 * (random() % 1_000_000_000_000) + 5;
            check(thirteen as f64 * two(-(random() % 40).cast_signed()));
        }
        for power in -14..15 {
            let ten: f64 = format!("1e{power}").parse().unwrap();
            for x in [ten, ten.next_down(), ten.next_up(), ten * (1.0 - 5e-13), -3.0 * ten] {
                check(x);
            }
        }
        for x in [0.0, -0.0, f64::MIN_POSITIVE, 5e-324, 1e300] {
            check(x);
        }
        assert!(twelve_digits(f64::INFINITY).is_infinite() && twelve_digits(f64::NAN).is_nan());
    }
}
