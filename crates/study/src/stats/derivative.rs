//! Derivatives of computed functions, with an estimated error. Tests check that it covers the true error.
//!
//! The values of a function in an interval around the point are fitted by polynomials of rising degree, by least
//! squares. The derivative of a fit has two errors: noise in the values, which the scatter around the fit
//! shows, and the terms of higher degree that are left out. The degree with the least sum of both is taken.
//! So a smooth function gets a high degree and many digits, and a noisy one a low degree and an honest error.
//!
//! Narrower intervals are tried as long as the function is not resolved: higher degrees still reduce the
//! residual much, or the scatter exceeds the accuracy of the values. A kink or a jump may then lie near the point.
//! Noise is no reason for a narrower interval, because its effect on the derivative grows as the interval shrinks. The
//! errors of two intervals must overlap. If they do not, the stated error contains both.
//!
//! The left and the right half of an interval are also fitted alone. If their derivatives differ by more than their
//! errors, the stated error contains both.
//!
//! At an end of the domain the whole interval lies on one side. Points without a value are left out of the fit.
//!
//! # Equations
//! ```text
//! f(x) ≈ Σ cₖ pₖ(x),  k = 0 … n,   cₖ = ⟨f, pₖ⟩,   ⟨pⱼ, pₖ⟩ = δⱼₖ  on the m points
//! f′(x₀) ≈ Σ cₖ pₖ′(x₀)
//! s² = (Σ f² − Σ cₖ²) / (m − n − 1)
//! error = 2 (t s √(Σ pₖ′(x₀)²) + |cₙ₊₁ pₙ₊₁′(x₀)| + |cₙ₊₂ pₙ₊₂′(x₀)| + a |f(x₀)|/scale)
//! ```
//! t is Student's t for 99 %, and a is the accuracy of the values. The factor 2 allows for the choice among the
//! degrees, and for noise that is correlated from point to point.
//!
//! # Units
//! A derivative has the unit of the output divided by the unit of x.
//!
//! # Accuracy
//! The tests of this module use nine kinds of smooth functions. In units of the slope |f|/x or |f′|, whichever is
//! larger:
//!
//! - Values with random errors of 1e-12: the stated error is at most 1e-8, and 2e-8 at an end of the domain.
//! - Values with random errors, random steps, sawtooth waves, sine waves or broken lines of 1e-3 to 1e-6, and
//!   accuracies of twice that: 3592 of 3600 stated errors cover the true error. Half of them are below 45 times
//!   the relative size of the noise.
//!
//! An error of the values that changes slowly, such as that of a mesh, looks like the function itself. No search
//! detects such an error. So the stated error of the derivative also contains the slope of an error that grows from 0
//! to the accuracy of the values over half of the scale of the number.
//!
//! # Examples
//! ```
//! use fretwork_study::stats::derivative::{MAX_ROUNDS, SearchPoint, derivatives};
//! let place = SearchPoint { x: 2.0, scale: 2.0, low: 0.0, high: f64::INFINITY };
//! let f = |x: f64| Ok::<_, ()>(vec![Some(x * x), Some(1.0 / x)]);
//! let found = derivatives(place, &[1e-12, 1e-12], MAX_ROUNDS, f).unwrap();
//! let [square, inverse] = [found[0].unwrap(), found[1].unwrap()];
//! assert!((square.value - 4.0).abs() <= square.error && square.error < 1e-10);
//! assert!((inverse.value + 0.25).abs() <= inverse.error && inverse.error < 1e-8);
//! ```
//!
//! # Sources
//! - G. E. Forsythe, J. Soc. Ind. Appl. Math. 5 (1957) 74: orthogonal polynomials on given points.
//! - C. J. F. Ridders, Adv. Eng. Softw. 4 (1982) 75: the search for the order and the interval of the least error.

/// The number of points in an interval: the ends and the extremes of a Chebyshev polynomial.
const POINTS: usize = 17;

/// The highest degree of a polynomial.
const MAX_DEGREE: usize = 12;

/// The scatter around a polynomial has at least this many degrees of freedom.
const MIN_FREEDOM: usize = 3;

/// Half the width of the first interval, relative to the scale of the number.
const HALF_WIDTH: f64 = 0.1;

/// An interval is this many times narrower than the one before.
const NARROWING: f64 = 4.0;

/// The usual largest number of intervals. The narrowest one reaches 4e-4 of the scale to both sides.
pub const MAX_ROUNDS: usize = 5;

/// The search ends when the error is less than this part of the slope |f|/scale or |f′|.
const GOAL: f64 = 5e-9;

/// A function is resolved if the scatter is at least this part of the last coefficients. The coefficients of a
/// function that is not yet resolved fall faster, and those of noise do not fall.
const RESOLVED: f64 = 0.1;

/// See the equation of the error.
const SAFETY: f64 = 2.0;

/// Student's t for 99 % and 1, 2, … 16 degrees of freedom (`scipy.stats.t.ppf(0.995, n)`, SciPy 1.17.1).
const STUDENT: [f64; POINTS - 1] = [
    63.66, 9.92, 5.84, 4.60, 4.03, 3.71, 3.50, 3.36, 3.25, 3.17, 3.11, 3.05, 3.01, 2.98, 2.95, 2.92,
];

/// Where a derivative is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchPoint {
    /// The point x₀.
    pub x: f64,
    /// The size of the number, for example |x₀|. The first interval reaches a tenth of it to both sides.
    pub scale: f64,
    /// The lowest number that the function accepts.
    pub low: f64,
    /// The highest number that the function accepts.
    pub high: f64,
}

/// A derivative with its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Derivative {
    /// The estimate of f′(x₀).
    pub value: f64,
    /// The largest difference to f′(x₀) that is to be expected.
    pub error: f64,
}

/// The derivatives of all outputs of `f`, which gives the values of the outputs at a point: at x₀, and then at the
/// [`neighbours`] of each interval, in their order. An output without a value is `None`, or not finite. `rounds` is the
/// largest number of intervals.
///
/// `accuracies` has the relative error that the values of each output can have: 1e-11 for closed forms with 12
/// digits, for example, and the stated error for a numerical method. Scatter of this size is taken for noise, and
/// also a kink that changes the values by less than this. Larger noise would be followed into narrow intervals, and
/// the stated error of the derivative would be too small.
///
/// An output has no derivative if it has no value at the point or at too many points around it.
///
/// # Errors
/// The first one of `f`, whose values may be unknown. The caller begins again when it knows one more.
///
/// # Panics
/// If the point lies outside of the domain.
pub fn derivatives<E>(
    place: SearchPoint,
    accuracies: &[f64],
    rounds: usize,
    mut f: impl FnMut(f64) -> Result<Vec<Option<f64>>, E>,
) -> Result<Vec<Option<Derivative>>, E> {
    assert!((place.low..=place.high).contains(&place.x), "the point lies in the domain");
    let output = |(at_point, accuracy): (Option<f64>, &f64)| {
        let at_point = at_point.filter(|y| y.is_finite());
        OutputSearch { accuracy: *accuracy, at_point, best: None, done: at_point.is_none() }
    };
    let mut outputs: Vec<_> = f(place.x)?.into_iter().zip(accuracies).map(output).collect();
    for round in 0..rounds {
        if outputs.iter().all(|output| output.done) {
            break;
        }
        let points = neighbours(place, round);
        let values: Vec<_> = points.iter().map(|x| f(*x)).collect::<Result<_, _>>()?;
        for (number, output) in outputs.iter_mut().enumerate().filter(|(_, output)| !output.done) {
            let others = points.iter().zip(&values);
            let others = others.filter_map(|(x, values)| Some((x - place.x, values[number]?)));
            output.fit(others, place.scale);
        }
    }
    Ok(outputs.iter().map(|output| output.found(place.scale)).collect())
}

/// The points of an interval, without x₀.
pub fn neighbours(SearchPoint { x, scale, low, high }: SearchPoint, round: usize) -> Vec<f64> {
    let half = (0..round).fold(HALF_WIDTH * scale, |half, _| half / NARROWING);
    let from = (x - half).min(high - 2.0 * half).max(low);
    let width = (from + 2.0 * half).min(high) - from;
    let point = |place: usize| {
        let angle = std::f64::consts::PI * place as f64 / (POINTS - 1) as f64;
        from + width * (0.5 - 0.5 * libm::cos(angle))
    };
    (0..POINTS).map(point).filter(|p| (p - x).abs() > 1e-3 * width).collect()
}

/// The state of the search for one output.
struct OutputSearch {
    accuracy: f64,
    at_point: Option<f64>,
    best: Option<Derivative>,
    done: bool,
}

impl OutputSearch {
    /// Takes the values of an interval, with their distances from x₀.
    fn fit(&mut self, others: impl Iterator<Item = (f64, f64)>, scale: f64) {
        let Some(at_point) = self.at_point else { return };
        let sample = std::iter::once((0.0, at_point)).chain(others);
        let sample: Vec<_> = sample.filter(|(_, y)| y.is_finite()).collect();
        let Some(fit) = IntervalFit::new(&sample, self.accuracy) else { return };
        let best = self.best.map_or(fit.derivative, |best| best.or(fit.derivative));
        let slope = (at_point / scale).abs().max(best.value.abs());
        self.best = Some(best);
        self.done = best.error <= GOAL * slope || fit.resolved;
    }

    fn found(&self, scale: f64) -> Option<Derivative> {
        let Derivative { value, error } = self.best?;
        let slow = SAFETY * self.accuracy * self.at_point?.abs() / scale;
        Some(Derivative { value, error: error + slow })
    }
}

impl Derivative {
    /// The better of two estimates. `narrow` is from a narrower interval.
    fn or(self, narrow: Self) -> Self {
        let gap = (narrow.value - self.value).abs();
        if gap > self.error + narrow.error {
            Self { error: gap + narrow.error, ..self }
        } else if narrow.error < self.error {
            narrow
        } else {
            self
        }
    }
}

/// The best derivative in one interval.
struct IntervalFit {
    derivative: Derivative,
    /// Whether the scatter around the polynomials looks like noise and is not larger than the accuracy of the values.
    resolved: bool,
}

impl IntervalFit {
    /// The derivative at 0 of a function with these points and values, if there are enough of them.
    ///
    /// If the points left and right of x₀ have different derivatives, x₀ is close to a kink or a jump. The error then
    /// contains both derivatives.
    fn new(sample: &[(f64, f64)], accuracy: f64) -> Option<Self> {
        let mut fit = Self::of_all(sample, accuracy)?;
        let side = |on_side: fn(f64) -> bool| {
            let side: Vec<_> = sample.iter().copied().filter(|(x, _)| on_side(*x)).collect();
            Self::of_all(&side, accuracy).map(|fit| fit.derivative)
        };
        if let (Some(left), Some(right)) = (side(|x| x <= 0.0), side(|x| x >= 0.0))
            && (left.value - right.value).abs() > left.error + right.error
        {
            let Derivative { value, error } = fit.derivative;
            let reach = |side: Derivative| (value - side.value).abs() + side.error;
            fit.derivative.error = error.max(reach(left)).max(reach(right));
        }
        Some(fit)
    }

    /// Fits polynomials to the whole sample.
    fn of_all(sample: &[(f64, f64)], accuracy: f64) -> Option<Self> {
        let highest = sample.len().checked_sub(MIN_FREEDOM + 1)?.min(MAX_DEGREE);
        // Points and values are scaled, so that squares neither overflow nor underflow.
        let width = sample.iter().map(|(x, _)| x.abs()).fold(0.0, f64::max);
        let size = sample.iter().map(|(_, y)| y.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let (x, y): (Vec<_>, Vec<_>) = sample.iter().map(|(x, y)| (x / width, y / size)).unzip();
        let terms = expand(&x, y, highest + 2);
        let freedom = |degree: usize| sample.len() - degree - 1;
        let scatter = |degree: usize| (terms[degree].rest / freedom(degree) as f64).sqrt();

        let (mut value, mut squares) = (0.0, 0.0);
        let fits = (1..=highest).map(|degree| {
            value += terms[degree].slope();
            squares += terms[degree].slope_of_polynomial * terms[degree].slope_of_polynomial;
            let noise = STUDENT[freedom(degree) - 1] * scatter(degree).max(f64::EPSILON);
            let omitted = terms[degree + 1].slope().abs() + terms[degree + 2].slope().abs();
            let error = SAFETY * (noise * squares.sqrt() + omitted);
            Derivative { value: value * size / width, error: error * size / width }
        });
        let derivative = fits.min_by(|a, b| a.error.total_cmp(&b.error))?;

        let last = terms[highest.saturating_sub(3).max(1)..=highest].iter();
        let last = last.map(|term| term.coefficient.abs()).fold(0.0, f64::max);
        let rest = scatter(highest);
        Some(Self { derivative, resolved: rest >= RESOLVED * last && rest <= accuracy })
    }
}

/// One term of the expansion in orthogonal polynomials.
struct Term {
    coefficient: f64,
    /// p′(0).
    slope_of_polynomial: f64,
    /// The sum of the squares of the residual after this term.
    rest: f64,
}

impl Term {
    /// The contribution of this term to the derivative at 0.
    fn slope(&self) -> f64 {
        self.coefficient * self.slope_of_polynomial
    }
}

/// A polynomial by its values at the points, and its value and slope at 0.
struct Polynomial {
    values: Vec<f64>,
    value: f64,
    slope: f64,
}

/// Expands the values `y` at the points `x` in orthonormal polynomials of degree 0 to `highest`, by the three-term
/// recurrence of Forsythe.
fn expand(x: &[f64], y: Vec<f64>, highest: usize) -> Vec<Term> {
    let count = x.len();
    let mut rest = y;
    let one = 1.0 / (count as f64).sqrt();
    let mut before = Polynomial { values: vec![0.0; count], value: 0.0, slope: 0.0 };
    let mut now = Polynomial { values: vec![one; count], value: one, slope: 0.0 };
    let mut norm = 0.0;
    let mut terms = Vec::with_capacity(highest + 1);
    for _ in 0..=highest {
        let coefficient = dot(&rest, &now.values);
        for (rest, p) in rest.iter_mut().zip(&now.values) {
            *rest -= coefficient * p;
        }
        let slope_of_polynomial = now.slope;
        terms.push(Term { coefficient, slope_of_polynomial, rest: dot(&rest, &rest) });

        let raised: Vec<f64> = x.iter().zip(&now.values).map(|(x, p)| x * p).collect();
        let centre = dot(&raised, &now.values);
        let values = raised.iter().zip(&now.values).zip(&before.values);
        let values: Vec<f64> =
            values.map(|((raised, p), before)| raised - centre * p - norm * before).collect();
        let value = -centre * now.value - norm * before.value;
        let slope = now.value - centre * now.slope - norm * before.slope;
        norm = dot(&values, &values).sqrt();
        let values = values.iter().map(|p| p / norm).collect();
        before = std::mem::replace(
            &mut now,
            Polynomial { values, value: value / norm, slope: slope / norm },
        );
    }
    terms
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use fretwork_random::{Random, Stream};

    fn searched(
        place: SearchPoint,
        accuracies: &[f64],
        mut f: impl FnMut(f64) -> Vec<Option<f64>>,
    ) -> Vec<Option<Derivative>> {
        let Ok(found) = derivatives(place, accuracies, MAX_ROUNDS, |x| Ok::<_, Infallible>(f(x)));
        found
    }

    /// A function of x and a parameter from 0 to 1, with its derivative.
    type Smooth = fn(f64, f64) -> (f64, f64);

    /// Power laws, exponentials, waves and saturating curves on 0.3 … 1.5.
    const SMOOTH: [Smooth; 9] = [
        |x, a| (libm::pow(x, 6.0 * a - 3.0), (6.0 * a - 3.0) * libm::pow(x, 6.0 * a - 4.0)),
        |x, a| (libm::exp((5.0 * a - 2.5) * x), (5.0 * a - 2.5) * libm::exp((5.0 * a - 2.5) * x)),
        |x, a| {
            let k = 1.0 + 19.0 * a;
            (2.0 + libm::sin(k * x), k * libm::cos(k * x))
        },
        |x, a| (x * x / (x + a), (x * x + 2.0 * a * x) / ((x + a) * (x + a))),
        |x, a| (3.0 + libm::log(x + a), 1.0 / (x + a)),
        |x, a| {
            let k = 3.0 + 7.0 * a;
            let t = libm::tanh(k * (x - 0.8));
            (1.5 + t, k * (1.0 - t * t))
        },
        // The tangential force of Cattaneo and Mindlin.
        |x, a| {
            let k = 0.06 + 0.3 * a;
            let root = libm::cbrt(1.0 - k * x);
            (1.0 - root * root, 2.0 / 3.0 * k / root)
        },
        |x, a| (1.0 + x * (a + x * (2.0 - x)), a + x * (4.0 - 3.0 * x)),
        |x, a| {
            let k = 0.2 + 4.0 * a;
            (1.0 - libm::exp(-k * x), k * libm::exp(-k * x))
        },
    ];

    fn unit(bits: u64) -> f64 {
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Noise between about −1 and 1, as a function of x in units of its width.
    type Noise = fn(f64, Stream) -> f64;

    fn random(x: f64, bits: Stream) -> f64 {
        2.0 * unit(bits.at(x.to_bits())) - 1.0
    }

    /// Errors like those of adaptive solvers: random, constant, linear or curved between jumps, or wavy.
    const NOISE: [(&str, Noise); 5] = [
        ("random errors", random),
        ("random steps", |x, bits| 2.0 * unit(bits.at(x.floor() as u64)) - 1.0),
        ("sawtooth waves", |x, bits| 2.0 * (x + unit(bits.at(0))).fract() - 1.0),
        ("sine waves", |x, bits| libm::sin(std::f64::consts::TAU * (x + unit(bits.at(0))))),
        ("broken lines", |x, bits| {
            let piece = 2 * x.floor() as u64;
            1.4 * (unit(bits.at(piece)) - 0.5 + x.fract() * (unit(bits.at(piece + 1)) - 0.5))
        }),
    ];

    fn place(x: f64, low: f64) -> SearchPoint {
        SearchPoint { x, scale: x, low, high: 10.0 }
    }

    /// Runs each smooth function with each noise level at random points. Returns the number of stated errors that
    /// cover the true error, and the stated errors in units of `level`·|f|/x, sorted.
    fn count_covered(noise: Noise, levels: &[f64], cases: u64, at_end: bool) -> (usize, Vec<f64>) {
        let mut points = Random::new(1);
        let (mut covered, mut stated) = (0, Vec::new());
        for (case, (f, level)) in (0..cases)
            .flat_map(|_| SMOOTH.iter().flat_map(|f| levels.iter().map(move |level| (f, *level))))
            .enumerate()
        {
            let (a, x) = (points.between(0.0, 1.0), points.between(0.3, 1.5));
            let width = x * points.log_between(1e-4, 0.05);
            let bits = Stream::new(case as u64);
            let value = |x: f64| {
                let error = level * noise(x / width, bits) + 1e-12 * random(x, bits.child(0));
                vec![Some(f(x, a).0 * (1.0 + error))]
            };
            let low = if at_end { x } else { 0.0 };
            let found = searched(place(x, low), &[2.0 * level.max(1e-12)], value)[0].unwrap();
            let (value, slope) = f(x, a);
            covered += usize::from((found.value - slope).abs() <= found.error);
            let scale = if level > 0.0 {
                level * value.abs() / x
            } else {
                slope.abs().max(value.abs() / x)
            };
            stated.push(found.error / scale);
        }
        stated.sort_by(f64::total_cmp);
        (covered, stated)
    }

    #[test]
    fn derivatives_of_smooth_functions_have_eight_digits() {
        let (covered, stated) = count_covered(|_, _| 0.0, &[0.0], 100, false);
        assert!(covered >= 899, "{covered} of 900");
        assert!(stated[899] < 1e-8, "stated: {:e}", stated[899]);
        let (covered, stated) = count_covered(|_, _| 0.0, &[0.0], 100, true);
        assert!(covered >= 895, "{covered} of 900 at an end");
        assert!(stated[899] < 2e-8, "stated at an end: {:e}", stated[899]);
    }

    /// The documentation of this module quotes the number and the median.
    #[test]
    fn stated_errors_cover_the_effect_of_noise() {
        let levels = [1e-3, 1e-4, 1e-5, 1e-6];
        let (mut all, mut stated) = (0, Vec::new());
        for (name, noise) in NOISE {
            let (covered, errors) = count_covered(noise, &levels, 20, false);
            assert!(covered >= 684, "{name}: {covered} of 720");
            let (at_end, _) = count_covered(noise, &levels, 20, true);
            assert!(at_end >= 684, "{name} at an end: {at_end} of 720");
            all += covered;
            stated.extend(errors);
        }
        stated.sort_by(f64::total_cmp);
        assert_eq!((all, stated[1800].round() as usize), (3592, 45), "of 3600");
    }

    /// The function has a jump or a kink at a distance of at most a fifth of x, much larger than the stated accuracy.
    #[test]
    fn stated_errors_cover_the_effect_of_a_kink_or_a_jump_near_the_point() {
        let mut points = Random::new(2);
        for kind in ["kink", "jump"] {
            let mut covered = 0;
            let mut close = 0;
            for _ in 0..500 {
                let x = points.between(0.3, 1.5);
                let distance = points.log_between(1e-3, 0.2) * points.one_of(&[-1.0, 1.0]);
                let at = x * (1.0 + distance);
                let value = |y: f64| {
                    let beyond = (y - at).max(0.0);
                    let part = if kind == "kink" { 0.3 * beyond } else { f64::from(y > at) * 0.01 };
                    vec![Some(libm::sqrt(y) + part)]
                };
                let found = searched(place(x, 0.0), &[1e-11], value)[0].unwrap();
                let own = if kind == "kink" && x > at { 0.3 } else { 0.0 };
                let error = (found.value - 0.5 / x.sqrt() - own).abs();
                covered += usize::from(error <= found.error);
                close += usize::from(found.error < 1e-5);
            }
            assert!(covered >= 475, "{kind}: {covered} of 500");
            assert!(close >= 400, "{kind}: {close} of 500 are resolved");
        }
    }

    #[test]
    fn outputs_are_searched_independently() {
        let found = searched(place(1.0, 0.0), &[1e-11, 0.0, 1e-11, 1e-11, 1e-11], |x| {
            let positive = (x > 1.01).then_some(x);
            vec![Some(x * x * x), Some(4.0), positive, (x <= 1.0).then_some(2.0 * x), None]
        });
        let [cube, constant, missing, left, never] = found[..] else { panic!("five outputs") };
        let cube = cube.unwrap();
        assert!((cube.value - 3.0).abs() <= cube.error && cube.error < 1e-10);
        let constant = constant.unwrap();
        assert!(constant.value.abs() <= constant.error && constant.error < 1e-12);
        assert_eq!((missing, never), (None, None));
        let tiny =
            searched(place(1.0, 0.0), &[1e-11], |x| vec![Some(1e-250 * libm::exp(x))])[0].unwrap();
        assert!((tiny.value / 1e-250 - libm::exp(1.0)).abs() <= tiny.error / 1e-250);
        assert!(tiny.error > 0.0 && tiny.error < 1e-258);
        // Points on one side suffice.
        let left = left.unwrap();
        assert!((left.value - 2.0).abs() <= left.error && left.error < 1e-10);
    }

    #[test]
    fn points_stay_in_the_domain_and_one_interval_suffices_for_a_smooth_function() {
        for (x, low, high) in [(1.0, 0.0, 2.0), (1.0, 1.0, 2.0), (1.0, 0.0, 1.0), (1.0, 0.97, 1.01)]
        {
            let place = SearchPoint { x, scale: 1.0, low, high };
            let mut points = Vec::new();
            let found = searched(place, &[1e-11], |x| {
                points.push(x);
                vec![Some(libm::exp(x))]
            });
            assert!(points.iter().all(|x| (low..=high).contains(x)));
            assert!((POINTS..=POINTS + 1).contains(&points.len()));
            let found = found[0].unwrap();
            assert!((found.value - libm::exp(1.0)).abs() <= found.error && found.error < 1e-7);
        }
    }

    #[test]
    fn a_domain_without_width_has_no_derivative() {
        let place = SearchPoint { x: 1.0, scale: 1.0, low: 1.0, high: 1.0 };
        assert_eq!(searched(place, &[1e-11], |x| vec![Some(x)]), [None]);
    }
}
