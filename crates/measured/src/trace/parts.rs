//! The parts of a trace where material was removed or added.
//!
//! A part counts if a moving mean of the heights exceeds four standard deviations somewhere. It extends to where the moving
//! mean falls below a quarter of that (a threshold with hysteresis). So single points of noise are no parts. The standard
//! deviation is that of moving means of the unworn surface, so that waves are no parts either.

use std::ops::Range;

use super::points::{noise, resolution};
use super::surface::{Points, Surface};
use crate::curve::{median, smooth};

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

/// The points of a part above or below the unworn surface.
pub type Part = Range<usize>;

/// The parameter that chooses a stretch.
pub fn named([from, to]: [f64; 2]) -> String {
    format!("scar={:.4}..{:.4}mm", 1e3 * from, 1e3 * to)
}

/// The unworn surface of a trace, and the parts that deviate from it.
#[derive(Debug, Default)]
pub struct Found {
    /// The trace.
    pub points: Points,
    /// The unworn surface.
    pub surface: Surface,
    /// The heights above the unworn surface.
    pub heights: Vec<f64>,
    /// Whether each point is unworn.
    pub is_unworn: Vec<bool>,
    /// The parts, from the lowest x to the highest one.
    pub parts: Vec<Part>,
}

impl Found {
    /// The number of unworn points.
    pub fn unworn(&self) -> usize {
        self.is_unworn.iter().filter(|is_unworn| **is_unworn).count()
    }

    /// The first and the last position of some points.
    pub fn ends(&self, range: &Range<usize>) -> [f64; 2] {
        [self.points[range.start].0, self.points[range.end - 1].0]
    }

    /// The unworn surface from those of the points on each side of a stretch that are nearer to it than half of them are.
    pub fn nearer(&self, range: &Range<usize>, edge: Option<[f64; 2]>) -> Surface {
        let mut is_near = vec![false; self.points.len()];
        let unworn = |at: &usize| self.is_unworn[*at];
        let before: Vec<usize> = (0..range.start).rev().filter(unworn).collect();
        let after: Vec<usize> = (range.end..self.points.len()).filter(unworn).collect();
        for side in [before, after] {
            side.iter().take(side.len().div_ceil(2)).for_each(|at| is_near[*at] = true);
        }
        Surface::through(&self.points, self.surface.is_half, &is_near, edge, 0.0)
    }

    /// The integral of a weight over the length for which a point stands, half of the way to both neighbours.
    pub fn share(&self, at: usize, weight: &dyn Fn(f64) -> f64) -> f64 {
        let x = self.points[at].0;
        let neighbours = [at.max(1) - 1, (at + 1).min(self.points.len() - 1)];
        let lengths = neighbours.map(|other| 0.5 * (self.points[other].0 - x));
        lengths.iter().map(|length| length.abs() * weight(x + 0.5 * length)).sum()
    }

    /// The area between the trace and the unworn surface, above 0 where the trace is above.
    pub fn area<'a>(&self, parts: impl IntoIterator<Item = &'a Part>) -> f64 {
        let points = parts.into_iter().cloned().flatten();
        points.map(|at| self.heights[at] * self.share(at, &|_| 1.0)).sum()
    }

    /// The part with the largest area.
    pub fn largest<'a>(&self, parts: impl IntoIterator<Item = &'a Part>) -> Option<Part> {
        let area = |part: &Part| self.area([part]).abs();
        parts.into_iter().max_by(|one, other| area(one).total_cmp(&area(other))).cloned()
    }

    /// The depths of points.
    pub fn depths(&self, range: &Range<usize>) -> Vec<f64> {
        self.heights[range.clone()].iter().map(|it| -it).collect()
    }

    /// The parameter that chooses a stretch.
    pub fn named(&self, range: &Range<usize>) -> String {
        named(self.ends(range))
    }

    /// Whether the area of a stretch is two standard deviations.
    pub fn is_sure(&self, range: &Part) -> bool {
        let weights = range.clone().map(|at| (self.points[at].0, self.share(at, &|_| 1.0)));
        let [scatter, surface] = self.surface.error(weights);
        self.area([range]).abs() > 2.0 * libm::hypot(scatter, surface)
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
    points: Points,
    is_half: bool,
    window: Option<[f64; 2]>,
    edge: Option<[f64; 2]>,
) -> Found {
    let count = points.len();
    let half = (count / WINDOW).clamp(BOUNDS.0, BOUNDS.1) / 2;
    let noise = noise(&points) / (2.0 * half as f64 + 1.0).sqrt();
    let rounding = resolution(&points) / 12_f64.sqrt();
    // If the ends of the scar are known, the search starts with the points up to its width beside it.
    let is_first = |at: usize| match window {
        Some([from, to]) => {
            let x = points[at].0;
            x < from && x > 2.0 * from - to || x > to && x < 2.0 * to - from
        }
        None => at.min(count - 1 - at) < count / UNWORN,
    };
    let is_unworn: Vec<bool> = (0..count).map(is_first).collect();
    let mut found = Found { points, is_unworn, ..Found::default() };
    let mut is_grown = false;
    for attempt in 1..=TRIES {
        let before = found.is_unworn;
        found.surface = Surface::through(&found.points, is_half, &before, edge, rounding);
        let heights = found.points.iter().map(|(x, z)| z - found.surface.at(*x));
        found.heights = heights.collect();
        let mean = smooth(&found.heights, 2 * half + 1);
        let near = mean.iter().zip(&before).filter(|(_, is_unworn)| **is_unworn);
        let scale = (1.4826 * median(near.map(|(mean, _)| mean.abs()))).max(noise);
        let largest = mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
        // First, the unworn points grow from the ends. Then they are all points but those of the parts.
        let is_near = |((x, _), mean): (&(f64, f64), &f64)| {
            let is_outside = window.is_none_or(|[from, to]| *x < from || *x > to);
            is_outside && (is_grown || mean.abs() <= NEAR * scale)
        };
        found.is_unworn = found.points.iter().zip(&mean).map(is_near).collect();
        found.parts.clear();
        for stretch in stretches(&mean, (SURE * scale).max(SHARE * largest)).filter(|_| is_grown) {
            let part = found.exact(stretch, half);
            // Beside a wide part, two thirds of a side stay.
            let margin = |side: usize| half + (part.len() / UNWORN).min(side / 3);
            let from = part.start.saturating_sub(margin(part.start));
            let after = part.end + margin(count - part.end);
            found.is_unworn[from..after.min(count)].fill(false);
            found.parts.push(part);
        }
        let is_stable = found.is_unworn == before;
        if is_grown && is_stable || found.unworn() < FEWEST {
            break;
        }
        is_grown |= is_stable || attempt == TRIES / 2;
    }
    found
}

/// What of parts is in a range.
pub fn inside(parts: &[Part], range: &Range<usize>) -> Vec<Part> {
    let both = |it: &Part| it.start.max(range.start)..it.end.min(range.end);
    parts.iter().map(both).filter(|it| !it.is_empty()).collect()
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
