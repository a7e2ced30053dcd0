//! The unworn surface of a trace: a plane, or a circle with its own tilt, by least squares.
//!
//! # Equations
//! ```text
//! z = a + b·u + c·u² + h(x − x₀)        h(v) = ±(R − √(R² − v²)) − c·v²,   R = 1/(2|c|)
//! ```
//! u is the distance from the middle of the trace. The parabola alone describes a plane that is slightly bent. h is what a
//! circle has beyond its parabola. If x₀ is the apex of the parabola, the surface is a circle. An instrument that subtracts a
//! line from the trace of a tilted ball shears the circle: then x₀ lies elsewhere. The shear is used if the trace
//! determines it. Errors contain it always.

/// The columns of the fit: 1, u, u², the derivative of h by x₀, and a step of the surface.
const COLUMNS: usize = 5;
/// The column of x₀, and that of a step.
const SHEAR: usize = 3;
const STEP: usize = 4;
/// A shear counts if it is this many standard deviations.
const SURE: f64 = 4.0;
/// The standard deviation of the shear that is expected without knowledge, in rad.
const EXPECTED: f64 = 0.05;
/// Maximum number of repetitions of a fit that is not linear, and the relative change at which it ends.
const TRIES: usize = 30;
const STILL: f64 = 1e-8;

/// How much of the length of the trace makes the effect of a wave twice as large: one in this many.
const WAVES: f64 = 16.0;

/// A pivot below this share of its diagonal is rounding.
const SINGULAR: f64 = 1e-11;

type Row = [f64; COLUMNS];

/// Points of a trace: x and z.
pub type Points = Vec<(f64, f64)>;

/// The unworn surface.
#[derive(Debug, Clone, Default)]
pub struct Surface {
    /// The middle of the trace, and half of its length.
    middle: f64,
    half: f64,
    /// The ends of a stretch in which the surface rises by a step.
    edge: Option<[f64; 2]>,
    /// Minimum of the scatter.
    least: f64,
    coefficients: Row,
    /// The covariance of the coefficients, with the shear.
    covariance: [Row; COLUMNS],
    /// The apex of the circle, x₀.
    apex: f64,
    /// Whether it is a circle. Otherwise it is a plane within the scatter.
    pub is_round: bool,
    /// Whether the circle is sheared.
    pub is_sheared: bool,
    /// The root mean square of the unworn points.
    pub scatter: f64,
    /// The number of neighbouring points whose deviations go together.
    pub together: f64,
}

/// The solution of normal equations, and the inverse matrix, by Gauss and Jordan. The matrix is positive definite, so no
/// rows are exchanged. A column that is not used, or that the points do not determine, has the solution 0.
fn solved(mut matrix: [Row; COLUMNS], right: Row) -> (Row, [Row; COLUMNS]) {
    let diagonal: Row = std::array::from_fn(|at| matrix[at][at]);
    let mut inverse: [Row; COLUMNS] =
        std::array::from_fn(|at| std::array::from_fn(|other| f64::from(u8::from(at == other))));
    for at in 0..COLUMNS {
        let pivot = matrix[at][at];
        let factor = if pivot > SINGULAR * diagonal[at] { 1.0 / pivot } else { 0.0 };
        matrix[at] = matrix[at].map(|it| it * factor);
        inverse[at] = inverse[at].map(|it| it * factor);
        let (own, own_inverse) = (matrix[at], inverse[at]);
        for row in (0..COLUMNS).filter(|row| *row != at) {
            let factor = matrix[row][at];
            for other in 0..COLUMNS {
                matrix[row][other] -= factor * own[other];
                inverse[row][other] -= factor * own_inverse[other];
            }
        }
    }
    let solution = inverse.map(|row| row.iter().zip(right).map(|(own, right)| own * right).sum());
    (solution, inverse)
}

impl Surface {
    /// The surface through the points that are used, perhaps with a step in a stretch.
    /// The scatter is at least the given one, that of rounded heights.
    pub fn through(
        points: &[(f64, f64)],
        is_used: &[bool],
        edge: Option<[f64; 2]>,
        least: f64,
    ) -> Self {
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
        let used: Points =
            points.iter().zip(is_used).filter(|(_, is_used)| **is_used).map(|it| *it.0).collect();
        let mut found = Self { middle, half, edge, least, together: 1.0, ..Self::default() };
        found.step_towards(&used);
        found.judge(&used);
        found.is_round = found.bend().abs() * half * half > 3.0 * found.scatter;
        if found.is_round {
            found.apex = found.vertex();
            found.fit(&used);
            found.judge(&used);
            let mut sheared = Self { is_sheared: true, ..found.clone() };
            sheared.fit(&used);
            sheared.judge(&used);
            let moved = (sheared.apex - sheared.vertex()).abs();
            let sure = SURE * sheared.scatter * sheared.together.sqrt();
            let is_finite = sheared.covariance.as_flattened().iter().all(|it| it.is_finite());
            if is_finite && moved > sure * sheared.covariance[SHEAR][SHEAR].sqrt() {
                found = sheared;
            } else if is_finite {
                found.covariance = sheared.covariance;
            }
        }
        let factor = found.scatter * found.scatter * found.together;
        found.covariance = found.covariance.map(|row| row.map(|it| it * factor));
        found
    }

    /// Repeats the fit until apex and curvature stay.
    fn fit(&mut self, used: &[(f64, f64)]) {
        for _ in 0..TRIES {
            let before = (self.apex, self.bend());
            self.step_towards(used);
            let reach = 0.5 / self.bend().abs();
            if !reach.is_finite() {
                break;
            }
            // A circle that is tilted by more than a right angle has no apex.
            let apex =
                if self.is_sheared { self.apex + self.coefficients[SHEAR] } else { self.vertex() };
            self.apex = apex.clamp(self.middle - reach, self.middle + reach);
            self.coefficients[SHEAR] = 0.0;
            let moved = (self.apex - before.0).abs() / self.half;
            if moved < STILL && (self.bend() / before.1 - 1.0).abs() < STILL {
                break;
            }
        }
    }

    /// Half of the second derivative at the apex.
    pub fn bend(&self) -> f64 {
        self.coefficients[2] / (self.half * self.half)
    }

    /// The radius at the apex. None for a plane.
    pub fn radius(&self) -> Option<f64> {
        self.is_round.then(|| 0.5 / self.bend().abs())
    }

    /// The apex of the parabola.
    pub fn vertex(&self) -> f64 {
        self.middle - 0.5 * self.half * self.coefficients[1] / self.coefficients[2]
    }

    /// The height of a step, and its standard deviation.
    pub fn step(&self) -> (f64, f64) {
        (self.coefficients[STEP], self.covariance[STEP][STEP].sqrt())
    }

    /// What the circle has beyond its parabola, and the derivative by its apex.
    fn roundness(&self, x: f64) -> (f64, f64) {
        if !self.is_round {
            return (0.0, 0.0);
        }
        let (bend, v) = (self.bend(), x - self.apex);
        let radius = 0.5 / bend.abs();
        let root = (radius * radius - v * v).max(1e-4 * radius * radius).sqrt();
        let beyond = (radius - root).copysign(bend) - bend * v * v;
        (beyond, 2.0 * bend * v - (v / root).copysign(bend * v))
    }

    /// The columns at a position, and what the circle has beyond its parabola.
    fn row(&self, x: f64) -> (Row, f64) {
        let (beyond, shear) = self.roundness(x);
        let u = (x - self.middle) / self.half;
        let rise = |[from, to]: [f64; 2]| ((x - 0.5 * (from + to)) / (to - from)).clamp(-0.5, 0.5);
        let step = self.edge.map_or(0.0, rise);
        ([1.0, u, u * u, shear, step], beyond)
    }

    /// Least squares with the apex and the curvature of before. The covariance is in units of the variance of the points.
    fn step_towards(&mut self, used: &[(f64, f64)]) {
        let (mut matrix, mut right) = ([[0.0; COLUMNS]; COLUMNS], [0.0; COLUMNS]);
        for (x, z) in used {
            let (mut row, beyond) = self.row(*x);
            row[SHEAR] *= f64::from(u8::from(self.is_sheared));
            for at in 0..COLUMNS {
                right[at] += row[at] * (z - beyond);
                (0..COLUMNS).for_each(|other| matrix[at][other] += row[at] * row[other]);
            }
        }
        if self.is_sheared {
            // Without knowledge, the apex is that of the parabola.
            let expected = 0.5 * EXPECTED / self.bend();
            let weight = self.scatter * self.scatter * self.together / (expected * expected);
            matrix[SHEAR][SHEAR] += weight;
            right[SHEAR] += weight * (self.vertex() - self.apex);
        }
        (self.coefficients, self.covariance) = solved(matrix, right);
    }

    /// The height of the surface. Where it rises by a step, a line joins both sides.
    pub fn at(&self, x: f64) -> f64 {
        let (row, beyond) = self.row(x);
        (0..COLUMNS).map(|at| self.coefficients[at] * row[at]).sum::<f64>() + beyond
    }

    /// The slope of the surface.
    pub fn slope(&self, x: f64) -> f64 {
        let step = 1e-4 * self.half;
        (self.at(x + step) - self.at(x - step)) / (2.0 * step)
    }

    /// The standard deviation of a sum of heights of the surface, each with its weight. Half of a step is uncertain.
    pub fn error(&self, weights: impl Iterator<Item = (f64, f64)>) -> f64 {
        let (mut sum, mut all) = ([0.0; COLUMNS], 0.0);
        for (x, weight) in weights {
            all += weight.abs();
            sum.iter_mut().zip(self.row(x).0).for_each(|(sum, own)| *sum += weight * own);
        }
        let product = |row: &Row| row.iter().zip(sum).map(|(own, sum)| own * sum).sum::<f64>();
        let square: f64 =
            self.covariance.iter().zip(sum).map(|(row, sum)| sum * product(row)).sum();
        let step = 0.5 * all * self.coefficients[STEP];
        (square.max(0.0) + step * step).sqrt()
    }

    /// Computes the scatter, and counts the neighbours that go together: the variance of means of several points, in units
    /// of that of independent points (batch means).
    fn judge(&mut self, used: &[(f64, f64)]) {
        let deviations: Vec<f64> = used.iter().map(|(x, z)| z - self.at(*x)).collect();
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|it| it * it).sum::<f64>();
        let sum = square(&mut deviations.iter().copied());
        let columns = 3 + usize::from(self.is_sheared) + usize::from(self.edge.is_some());
        let scatter = (sum / deviations.len().saturating_sub(columns).max(1) as f64).sqrt();
        self.scatter = scatter.max(self.least);
        let variance = sum / deviations.len() as f64;
        let sizes = (1..).map(|power| 2_usize.pow(power));
        let sizes = sizes.take_while(|size| size * 5 <= deviations.len());
        let ratio = |size: usize| {
            let chunks = deviations.chunks_exact(size);
            // The fit follows as many of the means as it has columns.
            let count = (chunks.len() - columns) as f64;
            let mut means = chunks.map(|chunk| chunk.iter().sum::<f64>() / size as f64);
            let ratio = size as f64 * square(&mut means) / (count * variance);
            // Few means show a wave that is hardly shorter than the trace, so its effect is enlarged.
            let is_sure = ratio > 1.0 + SURE * (2.0 / count).sqrt();
            ratio * if is_sure { 1.0 + WAVES * size as f64 / deviations.len() as f64 } else { 1.0 }
        };
        self.together = sizes.map(ratio).filter(|it| it.is_finite()).fold(1.0, f64::max);
    }
}
