//! The parts of a trace where material was removed or added.
//!
//! A part counts if a moving mean of the heights exceeds four standard deviations somewhere. It extends to where the moving
//! mean falls below a quarter of that (a threshold with hysteresis). So single points of noise are no parts. The standard
//! deviation is that of moving means of the unworn surface, so that waves are no parts either.

use std::ops::Range;

use super::points::{median, noise};
use super::surface::Surface;

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
/// If the ends of the scar are known, the search starts with the points up to this many widths beside it.
pub const REACH: f64 = 1.0;
/// Maximum number of repetitions.
const TRIES: usize = 40;
/// Where the unworn surface is searched, a point is unworn within this many standard deviations.
const NEAR: f64 = 3.0;

/// A part above or below the unworn surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its points.
    pub range: Range<usize>,
    /// The area between the trace and the unworn surface, above 0 where the trace is above.
    pub area: f64,
}

/// The unworn surface of a trace, and the parts that deviate from it.
#[derive(Debug, Clone)]
pub struct Found {
    /// The unworn surface.
    pub surface: Surface,
    /// The heights above the unworn surface.
    pub heights: Vec<f64>,
    /// Whether each point is unworn.
    pub is_unworn: Vec<bool>,
    /// The parts, from the lowest x to the highest one.
    pub parts: Vec<Part>,
}

/// The length of the trace for which each point stands.
fn widths(points: &[(f64, f64)]) -> Vec<f64> {
    let last = points.len() - 1;
    let width = |at: usize| 0.5 * (points[(at + 1).min(last)].0 - points[at.saturating_sub(1)].0);
    (0..=last).map(width).collect()
}

/// The sums of the first numbers.
fn sums(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    let next = values.map(|value| {
        sum += value;
        sum
    });
    std::iter::once(0.0).chain(next).collect()
}

/// Finds the unworn surface. It starts with both ends of the trace, or with both sides of the scar if its ends in x are
/// known. `edge` is where the surface may rise by a step.
pub fn find(points: &[(f64, f64)], window: Option<[f64; 2]>, edge: Option<[f64; 2]>) -> Found {
    let count = points.len();
    let end = count / UNWORN;
    let half = (count / WINDOW).clamp(BOUNDS.0, BOUNDS.1) / 2;
    let noise = noise(points) / (2.0 * half as f64 + 1.0).sqrt();
    let widths = widths(points);
    let is_outside =
        |at: usize| window.is_none_or(|[from, to]| points[at].0 < from || points[at].0 > to);
    let is_near = |at: usize| match window {
        None => at < end || at >= count - end,
        Some([from, to]) => {
            let reach = REACH * (to - from);
            points[at].0 > from - reach && points[at].0 < to + reach
        }
    };
    let mut is_unworn: Vec<bool> = (0..count).map(|at| is_outside(at) && is_near(at)).collect();
    let smoothed = |heights: &[f64]| -> Vec<f64> {
        let sums = sums(heights.iter().copied());
        let mean = |at: usize| {
            let (from, after) = (at.saturating_sub(half), (at + half + 1).min(count));
            (sums[after] - sums[from]) / (after - from) as f64
        };
        (0..count).map(mean).collect()
    };
    let mut is_grown = false;
    for attempt in 0..TRIES {
        let surface = Surface::through(points, &is_unworn, edge);
        let heights: Vec<f64> = points.iter().map(|(x, z)| z - surface.at(*x)).collect();
        let mean = smoothed(&heights);
        let near = mean.iter().zip(&is_unworn).filter(|(_, is_unworn)| **is_unworn);
        let scale = (1.4826 * median(near.map(|(mean, _)| mean.abs()).collect())).max(noise);
        let largest = mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
        let limit = (SURE * scale).max(SHARE * largest);
        // First, the unworn points grow from the ends. Then they are all points but those of the parts.
        let next: Vec<bool>;
        let mut parts = Vec::new();
        if is_grown {
            parts = stretches(&mean, limit)
                .into_iter()
                .map(|range| part(&heights, &widths, range, half))
                .collect();
            let mut all: Vec<bool> = (0..count).map(is_outside).collect();
            for Part { range, .. } in &parts {
                let margin = half + range.len() / UNWORN;
                all[range.start.saturating_sub(margin)..(range.end + margin).min(count)]
                    .fill(false);
            }
            next = all;
        } else {
            next = (0..count).map(|at| is_outside(at) && mean[at].abs() <= NEAR * scale).collect();
        }
        let is_stable = next == is_unworn;
        let is_last = attempt + 1 == TRIES || is_grown && is_stable;
        // Too few points determine no surface.
        let is_empty = next.iter().filter(|is_unworn| **is_unworn).count() < 8;
        if is_last || is_empty {
            return Found { surface, heights, is_unworn, parts };
        }
        is_grown |= is_stable || attempt == TRIES / 2;
        is_unworn = next;
    }
    unreachable!("the last attempt returns")
}

/// Where the moving mean exceeds the limit, and as far as it is above `LOW` of it.
fn stretches(mean: &[f64], limit: f64) -> Vec<Range<usize>> {
    let class = |at: usize| if mean[at].abs() < LOW * limit { 0.0 } else { mean[at].signum() };
    let mut found = Vec::new();
    let mut begin = 0;
    while begin < mean.len() {
        let mut after = begin + 1;
        while after < mean.len() && class(after) == class(begin) {
            after += 1;
        }
        let is_sure = mean[begin..after].iter().any(|mean| mean.abs() > limit);
        if class(begin) != 0.0 && is_sure {
            found.push(begin..after);
        }
        begin = after;
    }
    found
}

/// A part whose ends are the extremes of the sum of the heights near the ends of the stretch: the least squares of where a
/// change begins.
fn part(heights: &[f64], widths: &[f64], stretch: Range<usize>, half: usize) -> Part {
    let sign: f64 = heights[stretch.clone()].iter().sum::<f64>().signum();
    let middle = stretch.start.midpoint(stretch.end);
    let from = stretch.start.saturating_sub(half);
    let after = (stretch.end + half).min(heights.len());
    let sums = sums(heights[from..after].iter().map(|height| sign * height));
    let near = |low: usize, high: usize| low.max(from) - from..=high.min(after) - from;
    let start = near(from, (stretch.start + half).min(middle));
    let start = start.min_by(|one, other| sums[*one].total_cmp(&sums[*other])).unwrap_or(0);
    let end = near((stretch.end.saturating_sub(half)).max(middle), after);
    let end = end.max_by(|one, other| sums[*one].total_cmp(&sums[*other])).unwrap_or(0);
    let range = from + start..from + end.max(start + 1);
    let area = range.clone().map(|at| heights[at] * widths[at]).sum();
    Part { range, area }
}
