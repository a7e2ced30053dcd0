//! The parts of a trace where material was removed or added.
//!
//! A part counts if a moving mean of the heights exceeds four standard deviations somewhere. It extends to where the moving
//! mean falls below a quarter of that (a threshold with hysteresis). So single points of noise are no parts. The standard
//! deviation is that of moving means of the unworn surface, so that waves are no parts either.

use std::fmt::{self, Display, Formatter};
use std::ops::Range;

use super::points::{median, noise, resolution};
use super::surface::Surface;
use crate::curve::smooth;

/// One in this many points at each end must be unworn.
pub const UNWORN: usize = 10;
/// A part exceeds this many standard deviations, or this share of the largest height.
const SURE: f64 = 4.0;
const SHARE: f64 = 0.01;
/// A part ends at this share of the limit.
const LOW: f64 = 0.25;
/// The moving mean has one in this many points, within bounds.
const WINDOW: usize = 100;
const BOUNDS: (usize, usize) = (3, 25);
/// Fewer points determine no surface.
const FEWEST: usize = 8;
/// Maximum number of repetitions.
const TRIES: usize = 40;
/// Where the unworn surface is searched, a point is unworn within this many standard deviations.
const NEAR: f64 = 3.0;

/// A part above or below the unworn surface, or several of one sign with what is between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its points.
    pub range: Range<usize>,
    /// Its ends in x.
    pub ends: [f64; 2],
    /// The area between the trace and the unworn surface, above 0 where the trace is above.
    pub area: f64,
}

impl Part {
    /// This part and another one.
    pub fn with(&self, other: &Self) -> Self {
        let [from, to] = [self.ends[0].min(other.ends[0]), self.ends[1].max(other.ends[1])];
        let range = self.range.start.min(other.range.start)..self.range.end.max(other.range.end);
        Self { range, ends: [from, to], area: self.area + other.area }
    }
}

/// As the parameter that chooses it.
impl Display for Part {
    fn fmt(&self, to: &mut Formatter<'_>) -> fmt::Result {
        write!(to, "{}", named(self.ends))
    }
}

/// The parameter that chooses a stretch.
pub fn named([from, to]: [f64; 2]) -> String {
    format!("scar={:.4}..{:.4}mm", 1e3 * from, 1e3 * to)
}

/// The unworn surface of a trace, and the parts that deviate from it.
#[derive(Debug, Clone)]
pub struct Found<'a> {
    /// The trace.
    pub points: &'a [(f64, f64)],
    /// The unworn surface.
    pub surface: Surface,
    /// The heights above the unworn surface.
    pub heights: Vec<f64>,
    /// Whether each point is unworn.
    pub is_unworn: Vec<bool>,
    /// The parts, from the lowest x to the highest one.
    pub parts: Vec<Part>,
}

impl Found<'_> {
    /// The number of unworn points.
    pub fn unworn(&self) -> usize {
        self.is_unworn.iter().filter(|is_unworn| **is_unworn).count()
    }

    /// The first and the last position of some points.
    pub fn ends(&self, range: &Range<usize>) -> [f64; 2] {
        [self.points[range.start].0, self.points[range.end - 1].0]
    }

    /// The integral of a weight over the length for which a point stands, half of the way to both neighbours.
    pub fn share(&self, at: usize, weight: &dyn Fn(f64) -> f64) -> f64 {
        let x = self.points[at].0;
        let neighbours = [at.max(1) - 1, (at + 1).min(self.points.len() - 1)];
        let lengths = neighbours.map(|other| 0.5 * (self.points[other].0 - x));
        lengths.iter().map(|length| length.abs() * weight(x + 0.5 * length)).sum()
    }

    /// A stretch as a part.
    pub fn part(&self, range: Range<usize>) -> Part {
        let area = range.clone().map(|at| self.heights[at] * self.share(at, &|_| 1.0)).sum();
        Part { ends: self.ends(&range), range, area }
    }

    /// What of parts is in a range.
    pub fn inside(&self, parts: &[Part], range: &Range<usize>) -> Vec<Part> {
        let both = |it: &Part| it.range.start.max(range.start)..it.range.end.min(range.end);
        parts.iter().map(both).filter(|it| !it.is_empty()).map(|it| self.part(it)).collect()
    }

    /// A stretch as a part, if its area is two standard deviations.
    pub fn whole(&self, range: Range<usize>) -> Option<Part> {
        let part = self.part(range);
        let weights = part.range.clone().map(|at| (self.points[at].0, self.share(at, &|_| 1.0)));
        let [scatter, surface] = self.surface.error(weights);
        (part.area.abs() > 2.0 * libm::hypot(scatter, surface)).then_some(part)
    }

    /// A part whose ends are the extremes of the sum of the heights near the ends of the stretch: the least squares of where a
    /// change begins.
    fn exact(&self, stretch: Range<usize>, half: usize) -> Range<usize> {
        let sign = self.heights[stretch.clone()].iter().sum::<f64>().signum();
        let from = stretch.start.saturating_sub(half);
        let near = self.heights[from..].iter().take(stretch.end + half - from);
        let mut sum = 0.0;
        let mut sums = vec![0.0];
        sums.extend(near.map(|height| {
            sum += sign * height;
            sum
        }));
        // The ends may move by half of the window, but not beyond the middle.
        let most = (2 * half).min(sums.len() / 2);
        let order = |one: &usize, other: &usize| sums[*one].total_cmp(&sums[*other]);
        let start = (0..=most).min_by(order).unwrap_or(0);
        let end = (sums.len() - 1 - most..sums.len()).max_by(order).unwrap_or(0);
        from + start..from + end.max(start + 1)
    }
}

/// Finds the unworn surface. It starts with both ends of the trace, or with both sides of the scar if its ends in x are
/// known. `edge` is where the surface may rise by a step.
pub fn find(
    points: &[(f64, f64)],
    is_half: bool,
    window: Option<[f64; 2]>,
    edge: Option<[f64; 2]>,
) -> Found<'_> {
    let count = points.len();
    let half = (count / WINDOW).clamp(BOUNDS.0, BOUNDS.1) / 2;
    let noise = noise(points) / (2.0 * half as f64 + 1.0).sqrt();
    let rounding = resolution(points) / 12_f64.sqrt();
    // If the ends of the scar are known, the search starts with the points up to its width beside it.
    let is_beside = |at: usize, [from, to]: [f64; 2]| {
        let x = points[at].0;
        x < from && x > 2.0 * from - to || x > to && x < 2.0 * to - from
    };
    let is_end = |at: usize| at.min(count - 1 - at) < count / UNWORN;
    let is_first = |at: usize| window.map_or_else(|| is_end(at), |ends| is_beside(at, ends));
    let is_outside =
        |at: usize| window.is_none_or(|[from, to]| points[at].0 < from || points[at].0 > to);
    let mut is_unworn: Vec<bool> = (0..count).map(is_first).collect();
    let (mut is_grown, mut attempt) = (false, 0);
    loop {
        let surface = Surface::through(points, is_half, &is_unworn, edge, rounding);
        let heights: Vec<f64> = points.iter().map(|(x, z)| z - surface.at(*x)).collect();
        let mean = smooth(&heights, 2 * half + 1);
        let near = mean.iter().zip(&is_unworn).filter(|(_, is_unworn)| **is_unworn);
        let scale = (1.4826 * median(near.map(|(mean, _)| mean.abs()).collect())).max(noise);
        let largest = mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
        // First, the unworn points grow from the ends. Then they are all points but those of the parts.
        let is_near = |at: usize| is_outside(at) && (is_grown || mean[at].abs() <= NEAR * scale);
        let is_unworn_now: Vec<bool> = (0..count).map(is_near).collect();
        let mut found = Found { points, surface, heights, is_unworn: is_unworn_now, parts: vec![] };
        for stretch in stretches(&mean, (SURE * scale).max(SHARE * largest)).filter(|_| is_grown) {
            let part = found.part(found.exact(stretch, half));
            let Range { start, end } = part.range;
            // Beside a wide part, two thirds of a side stay.
            let margin = |side: usize| half + (part.range.len() / UNWORN).min(side / 3);
            let (from, after) = (start.saturating_sub(margin(start)), end + margin(count - end));
            found.is_unworn[from..after.min(count)].fill(false);
            found.parts.push(part);
        }
        attempt += 1;
        let is_stable = found.is_unworn == is_unworn;
        if attempt == TRIES || is_grown && is_stable || found.unworn() < FEWEST {
            return found;
        }
        is_grown |= is_stable || attempt == TRIES / 2;
        is_unworn = found.is_unworn;
    }
}

/// Where the moving mean exceeds the limit, and as far as it is above `LOW` of it.
fn stretches(mean: &[f64], limit: f64) -> impl Iterator<Item = Range<usize>> {
    let side = move |mean: &f64| (mean.abs() > LOW * limit).then_some(*mean > 0.0);
    let mut end = 0;
    mean.chunk_by(move |one, next| side(one) == side(next)).filter_map(move |run| {
        end += run.len();
        run.iter().any(|mean| mean.abs() > limit).then(|| end - run.len()..end)
    })
}
