//! The unworn surface of a trace: a plane, or a circle with its own tilt, by least squares.
//!
//! # Equations
//! ```text
//! z = a + b·u + c·u² + h(x − x₀)        h(v) = ±(R − √(R² − v²)) − c·v²,   R = 1/(2|c|)
//! ```
//! u is the distance from the middle of the trace. The parabola alone describes a plane that is slightly bent. h is what a
//! circle has beyond its parabola. If x₀ is the apex of the parabola, the surface is a circle. An instrument that subtracts a
//! line from the trace of a tilted ball shears the circle: then x₀ lies elsewhere, by as much as is usual or the trace shows.

use std::array::from_fn;

use super::points::resolution;

/// The columns of the fit: 1, u, u², the derivative of h by x₀, and a flaw of the surface. The heights are one more.
const COLUMNS: usize = 5;
const SHEAR: usize = 3;
const FLAW: usize = 4;
/// A shear or a wave that is smaller than this many standard deviations counts as noise.
const SURE: f64 = 4.0;
/// A step counts if it is this many times the scatter and its standard deviation.
const EDGE: f64 = 5.0;
/// A change of the slope counts beyond this many standard deviations.
const BENT: f64 = 2.5;
/// The standard deviation of the shear that is expected without knowledge, in rad.
const EXPECTED: f64 = 0.02;
/// Maximum number of repetitions of a fit that is not linear, and the relative change at which it ends.
const TRIES: usize = 30;
const STILL: f64 = 1e-8;
/// How much of the length of the trace makes the effect of a wave twice as large: one in this many.
const WAVES: f64 = 16.0;
/// A pivot below this share of its diagonal is rounding.
const SINGULAR: f64 = 1e-11;

type Matrix = [[f64; COLUMNS + 1]; COLUMNS + 1];

/// What a circle or a plane lacks.
#[derive(Debug, Clone, Copy)]
pub enum Flaw {
    /// The surface rises by a step between both positions.
    Step([f64; 2]),
    /// The slope changes at a position.
    Edge(f64),
}

/// The unworn surface.
#[derive(Debug, Clone, Copy, Default)]
pub struct Surface {
    /// The middle of the trace, and half of its length.
    middle: f64,
    half: f64,
    /// The standard deviation of rounded heights.
    rounding: f64,
    /// Whether the trace is a half that was mirrored at x = 0: then u is |u| in its tilt.
    pub is_half: bool,
    flaw: Option<Flaw>,
    coefficients: [f64; COLUMNS],
    /// The covariance of the coefficients in units of the variance of means.
    covariance: [[f64; COLUMNS]; COLUMNS],
    /// The apex of the circle, x₀.
    apex: f64,
    /// Whether it is a circle. Otherwise it is a plane within the scatter.
    pub is_round: bool,
    /// The root mean square of the unworn points.
    pub scatter: f64,
    /// The number of neighbouring points whose deviations go together.
    together: f64,
}

/// Sweeps the columns of normal equations whose last column is the right side: the last column becomes the solution, and the
/// others become the negative inverse. A column that is not used, or that the points do not determine, has the solution 0.
fn swept(mut matrix: Matrix) -> Matrix {
    let diagonal: [f64; COLUMNS] = from_fn(|at| matrix[at][at]);
    for at in 0..COLUMNS {
        let old = matrix;
        let factor = if old[at][at] > SINGULAR * diagonal[at] { 1.0 / old[at][at] } else { 0.0 };
        matrix = from_fn(|row| {
            from_fn(|column| match (row == at, column == at) {
                (true, true) => -factor,
                (false, false) => old[row][column] - factor * old[row][at] * old[at][column],
                _ => factor * old[row][column],
            })
        });
    }
    matrix
}

impl Surface {
    /// A surface over all points of a trace, perhaps with a flaw, before it is fitted.
    pub fn over(points: &[(f64, f64)], is_half: bool, flaw: Option<Flaw>) -> Self {
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
        let rounding = resolution(points) / 12_f64.sqrt();
        Self { middle, half, rounding, is_half, flaw, ..Self::default() }
    }

    /// The surface through some points.
    pub fn through(&self, used: &[(f64, f64)]) -> Self {
        let mut found = Self { is_round: false, ..*self };
        found.fit(used);
        if found.coefficients[2].abs() <= 3.0 * found.scatter {
            return found;
        }
        let plane = found;
        (found.is_round, found.apex) = (true, found.vertex());
        for _ in 0..TRIES {
            let before = found;
            found.fit(used);
            let moved = (found.apex - before.apex).abs() / found.half;
            if moved < STILL && (found.bend() / before.bend() - 1.0).abs() < STILL {
                break;
            }
        }
        if found.scatter.is_finite() { found } else { plane }
    }

    /// Half of the second derivative at the apex.
    pub fn bend(&self) -> f64 {
        self.coefficients[2] / (self.half * self.half)
    }

    /// Whether the slope changes for sure.
    pub fn is_bent(&self) -> bool {
        self.coefficients[FLAW].abs() > BENT * self.deviation(FLAW)
    }

    /// The radius at the apex. None for a plane.
    pub fn radius(&self) -> Option<f64> {
        self.is_round.then(|| 0.5 / self.bend().abs())
    }

    /// The apex of a circle, as if it were not sheared, or the middle of a plane.
    pub fn apex(&self) -> f64 {
        if self.is_round { self.vertex() } else { self.middle }
    }

    /// The apex of the parabola.
    fn vertex(&self) -> f64 {
        let shift = 0.5 * self.half * self.coefficients[1] / self.coefficients[2];
        if self.is_half { self.middle } else { self.middle - shift }
    }

    /// The variance of means, in units of the number of points in each.
    pub fn variance(&self) -> f64 {
        self.scatter * self.scatter * self.together
    }

    /// The standard deviation of a coefficient.
    fn deviation(&self, of: usize) -> f64 {
        (self.variance() * self.covariance[of][of]).sqrt()
    }

    /// Whether the trace shows that the circle is sheared.
    pub fn is_sheared(&self) -> bool {
        self.is_round && (self.apex - self.vertex()).abs() > SURE * self.deviation(SHEAR)
    }

    /// The height of a step, if it is many times the scatter and its standard deviation.
    pub fn step(&self) -> Option<f64> {
        let height = self.coefficients[FLAW];
        let least = EDGE * self.scatter.max(self.deviation(FLAW));
        (height.abs() > least).then_some(height)
    }

    /// The columns at a position, and what the circle has beyond its parabola.
    fn row(&self, x: f64) -> ([f64; COLUMNS], f64) {
        let u = (x - self.middle) / self.half;
        let tilt = if self.is_half { u.abs() } else { u };
        let flaw = |flaw: Flaw| match flaw {
            Flaw::Step([from, to]) => ((x - from) / (to - from)).clamp(0.0, 1.0) - 0.5,
            Flaw::Edge(at) => (x - at).abs() / self.half,
        };
        let (bend, v) = (if self.is_round { self.bend() } else { 0.0 }, x - self.apex);
        let sine = 2.0 * bend * v;
        let cosine = (1.0 - sine * sine).max(1e-4).sqrt();
        let beyond = bend * v * v * (2.0 / (1.0 + cosine) - 1.0);
        let shear = sine * (1.0 - 1.0 / cosine);
        ([1.0, tilt, u * u, shear, self.flaw.map_or(0.0, flaw)], beyond)
    }

    /// Least squares with the curvature of before, the next apex, and the scatter, which is at least that of rounded heights.
    fn fit(&mut self, used: &[(f64, f64)]) {
        let mut matrix = Matrix::default();
        for (x, z) in used {
            let ([a, b, c, d, e], beyond) = self.row(*x);
            let row = [a, b, c, d, e, z - beyond];
            for (own, sums) in row.iter().zip(&mut matrix) {
                sums.iter_mut().zip(row).for_each(|(sum, other)| *sum += own * other);
            }
        }
        if self.is_round {
            // Without knowledge, the apex is that of the parabola.
            let expected = 0.5 * EXPECTED / self.bend();
            let weight = self.variance() / (expected * expected);
            matrix[SHEAR][SHEAR] += weight;
            matrix[SHEAR][COLUMNS] += weight * (self.vertex() - self.apex);
            matrix[COLUMNS][SHEAR] = matrix[SHEAR][COLUMNS];
        }
        let matrix = swept(matrix);
        self.coefficients = from_fn(|at| matrix[at][COLUMNS]);
        self.covariance = from_fn(|at| from_fn(|other| -matrix[at][other]));
        // A circle that is tilted by more than a right angle has no apex.
        let (apex, reach) = (self.apex + self.coefficients[SHEAR], 0.5 / self.bend().abs());
        self.apex = apex.max(self.middle - reach).min(self.middle + reach);
        self.coefficients[SHEAR] = 0.0;
        let deviations: Vec<f64> = used.iter().map(|(x, z)| z - self.at(*x)).collect();
        let columns = 3 + usize::from(self.is_round) + usize::from(self.flaw.is_some());
        let free = used.len().saturating_sub(columns).max(1) as f64;
        let sum: f64 = deviations.iter().map(|it| it * it).sum();
        self.scatter = (sum / free).sqrt().max(self.rounding);
        self.together = together(&deviations, columns);
    }

    /// The height of the surface. Where it rises by a step, a line joins both sides.
    pub fn at(&self, x: f64) -> f64 {
        let (row, beyond) = self.row(x);
        row.iter().zip(self.coefficients).map(|(own, factor)| own * factor).sum::<f64>() + beyond
    }

    /// The slope of the surface.
    pub fn slope(&self, x: f64) -> f64 {
        let step = 1e-4 * self.half;
        (self.at(x + step) - self.at(x - step)) / (2.0 * step)
    }

    /// The standard deviation of a sum of heights, each with its weight: from the scatter, and from the surface. Half of a step is
    /// uncertain.
    pub fn error(&self, weights: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
        let (mut sum, mut all, mut squares) = ([0.0; COLUMNS], 0.0, 0.0);
        for (x, weight) in weights {
            all += weight.abs();
            squares += weight * weight;
            sum.iter_mut().zip(self.row(x).0).for_each(|(sum, own)| *sum += weight * own);
        }
        let dot = |row: &[f64; COLUMNS]| row.iter().zip(sum).map(|(own, sum)| own * sum).sum();
        let square: f64 = dot(&self.covariance.map(|row| dot(&row)));
        let [scatter, surface] = [squares, square.max(0.0)].map(|of| (self.variance() * of).sqrt());
        [scatter, libm::hypot(surface, 0.5 * all * self.coefficients[FLAW])]
    }
}

/// Counts the neighbours that go together: the variance of means of several points, in units of that of independent points
/// (batch means).
fn together(deviations: &[f64], columns: usize) -> f64 {
    let count = deviations.len();
    let sum: f64 = deviations.iter().map(|it| it * it).sum();
    let sizes = (1..).map(|power| 2_usize.pow(power)).take_while(|size| size * 5 <= count);
    let ratio = |size: usize| {
        let means = deviations.chunks_exact(size).map(|it| it.iter().sum::<f64>());
        // The fit follows as many of the means as it has columns.
        let free = (count / size - columns) as f64;
        let square: f64 = means.map(|it| it * it).sum();
        let ratio = square * count as f64 / (size as f64 * free * sum);
        // Few means show a wave that is hardly shorter than the trace, so its effect is enlarged.
        let is_sure = ratio > 1.0 + SURE * (2.0 / free).sqrt();
        ratio * if is_sure { 1.0 + WAVES * size as f64 / count as f64 } else { 1.0 }
    };
    sizes.map(ratio).filter(|it| it.is_finite()).fold(1.0, f64::max)
}
