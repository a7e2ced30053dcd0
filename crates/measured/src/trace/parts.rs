//! The parts of a trace where material was removed or added.
//!
//! A part counts if a moving mean of the depths exceeds four standard deviations somewhere. It extends to where the moving
//! mean falls below a quarter of that (a threshold with hysteresis). So single points of noise are no parts. The standard
//! deviation is that of moving means of the unworn surface, so that waves are no parts either.

use std::ops::Range;

use super::points::{Points, noise};
use super::surface::{Flaw, Surface};
use crate::curve::{median, smooth};

/// One of this many parts of the trace must be unworn at each end.
pub const UNWORN: usize = 10;
/// A part exceeds this many standard deviations, or this share of the largest depth.
const SURE: f64 = 4.0;
const SHARE: f64 = 0.01;
/// A part ends at this share of the limit.
const LOW: f64 = 0.25;
/// The moving mean has one in this many points, within bounds.
const WINDOW: usize = 100;
const BOUNDS: (usize, usize) = (3, 25);
/// Minimum number of points in a scar, and on each side of it. Fewer determine no surface.
pub const BESIDE: usize = 8;
/// Maximum number of repetitions.
const TRIES: usize = 40;
/// The search for it starts with so long sides, in widths of a known scar.
const SIDES: [f64; 2] = [0.5, 1.0];
/// Where the unworn surface is searched, a point is unworn within this many standard deviations.
const NEAR: f64 = 3.0;

/// A part above or below the unworn surface.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its points.
    pub range: Range<usize>,
    /// The area between the trace and the unworn surface, below 0 where the trace is above.
    pub area: f64,
}

/// The parameter that chooses a stretch.
pub fn named([from, to]: [f64; 2]) -> String {
    format!("scar={:.4}..{:.4}mm", 1e3 * from, 1e3 * to)
}

/// Minimum number of unworn points at each end.
pub fn fewest(count: usize) -> usize {
    BESIDE.min(count / UNWORN)
}

/// The largest of some parts.
pub fn largest<'a>(parts: impl IntoIterator<Item = &'a Part>) -> Option<&'a Part> {
    parts.into_iter().max_by(|one, other| one.area.abs().total_cmp(&other.area.abs()))
}

/// A trace with its unworn surface, and the parts that deviate from it.
pub struct PreparedTrace {
    /// Its points.
    pub points: Points,
    /// The unworn surface.
    pub surface: Surface,
    /// The depths below the unworn surface.
    pub depths: Vec<f64>,
    /// Whether each point is unworn.
    is_unworn: Vec<bool>,
    /// The parts, from the lowest x to the highest one.
    pub parts: Vec<Part>,
}

impl PreparedTrace {
    /// The unworn ones of some points.
    pub fn unworn(&self, range: Range<usize>) -> Points {
        range.filter(|at| self.is_unworn[*at]).map(|at| self.points[at]).collect()
    }

    /// The share of the points that are unworn.
    pub fn unworn_share(&self) -> f64 {
        self.is_unworn.iter().filter(|is_unworn| **is_unworn).count() as f64
            / self.points.len() as f64
    }

    /// The unworn surface from those of the points on each side of a stretch that are nearer to it than half of them are.
    pub fn nearer(&self, range: &Range<usize>) -> Surface {
        let [before, after] =
            [0..range.start, range.end..self.points.len()].map(|side| self.unworn(side));
        let near = [&before[before.len() / 2..], &after[..after.len().div_ceil(2)]].concat();
        self.surface.through(&near)
    }

    /// All points.
    pub fn all(&self) -> Range<usize> {
        0..self.points.len()
    }

    /// The first and the last position of some points.
    pub fn ends(&self, range: &Range<usize>) -> [f64; 2] {
        [self.points[range.start].0, self.points[range.end - 1].0]
    }

    /// The parameter that chooses some points.
    pub fn named(&self, range: &Range<usize>) -> String {
        named(self.ends(range))
    }

    /// The integral of a weight over the length for which a point stands, half of the way to both neighbours.
    pub fn share(&self, at: usize, weight: &dyn Fn(f64) -> f64) -> f64 {
        let x = self.points[at].0;
        let neighbours = [at.max(1) - 1, (at + 1).min(self.points.len() - 1)];
        let lengths = neighbours.map(|other| 0.5 * (self.points[other].0 - x));
        lengths.iter().map(|length| length.abs() * weight(x + 0.5 * length)).sum()
    }

    /// Some points as a part.
    pub fn part(&self, range: Range<usize>) -> Part {
        let area = range.clone().map(|at| self.depths[at] * self.share(at, &|_| 1.0)).sum();
        Part { range, area }
    }

    /// What of parts is in a range.
    pub fn inside(&self, parts: &[Part], range: &Range<usize>) -> Vec<Part> {
        let both = |it: &Part| it.range.start.max(range.start)..it.range.end.min(range.end);
        parts.iter().map(both).filter(|it| !it.is_empty()).map(|it| self.part(it)).collect()
    }

    /// Whether the area of a part is two standard deviations.
    pub fn is_sure(&self, part: &Part) -> bool {
        let weights = part.range.clone().map(|at| (self.points[at].0, self.share(at, &|_| 1.0)));
        let [scatter, surface] = self.surface.error(weights);
        part.area.abs() > 2.0 * libm::hypot(scatter, surface)
    }

    /// A part whose ends are the extremes of the sum of the depths near the ends of the stretch: the least squares of where a
    /// change begins.
    fn exact(&self, stretch: &Range<usize>, half: usize) -> Part {
        let sign = self.depths[stretch.clone()].iter().sum::<f64>().signum();
        let from = stretch.start.saturating_sub(half);
        let to = (stretch.end + half).min(self.depths.len());
        let mut sums = vec![0.0];
        for depth in &self.depths[from..to] {
            sums.push(sums[sums.len() - 1] + sign * depth);
        }
        // The ends may move by half of the window, but not beyond the middle.
        let most = (2 * half).min(sums.len() / 2);
        let order = |one: &usize, other: &usize| sums[*one].total_cmp(&sums[*other]);
        let start = (0..=most).min_by(order).unwrap_or(0);
        let end = (sums.len() - 1 - most..sums.len()).max_by(order).unwrap_or(0);
        self.part(from + start..from + end.max(start + 1))
    }
}

/// Finds the unworn surface. The search starts with both ends of the trace. If the ends of the scar in x are known, it also starts
/// with shorter and longer sides of the scar, as the trace may reach over the edge of a sample: the right surface has many unworn
/// points with little scatter. The surface may have a flaw.
pub fn find(
    points: &Points,
    is_half: bool,
    window: Option<[f64; 2]>,
    flaw: Option<Flaw>,
) -> PreparedTrace {
    let from = |side: Option<f64>| search(points.clone(), is_half, window, side, flaw);
    let noise = noise(points);
    let fit = |found: &PreparedTrace| found.unworn_share() / found.surface.scatter.max(noise);
    let sides = SIDES.into_iter().filter(|_| window.is_some()).map(Some);
    let more = |best, other| if fit(&other) > fit(&best) { other } else { best };
    sides.map(from).fold(from(None), more)
}

/// Finds the unworn surface. The search starts at both ends of the trace, or beside a known scar: `side` is the length of each start,
/// in widths of the scar.
fn search(
    points: Points,
    is_half: bool,
    window: Option<[f64; 2]>,
    side: Option<f64>,
    flaw: Option<Flaw>,
) -> PreparedTrace {
    let count = points.len();
    let half = (count / WINDOW).clamp(BOUNDS.0, BOUNDS.1) / 2;
    let noise = noise(&points) / (2.0 * half as f64 + 1.0).sqrt();
    let is_first = |at: usize| {
        let x = points[at].0;
        if let Some(([from, to], side)) = window.zip(side) {
            let reach = side * (to - from);
            let [start, end] = [from, to].map(|end| points.partition_point(|it| it.0 < end));
            let is_next = at + BESIDE >= start && at < end + BESIDE;
            (at < start || at >= end) && (is_next || x > from - reach && x < to + reach)
        } else {
            let [first, last] = [points[0].0, points[count - 1].0];
            let is_inside = window.is_some_and(|[from, to]| from <= x && x < to);
            let is_next = at.min(count - 1 - at) < fewest(count);
            let is_near = (x - first).min(last - x) * (UNWORN as f64) < last - first;
            !is_inside && (is_next || is_near)
        }
    };
    let is_unworn: Vec<bool> = (0..count).map(is_first).collect();
    let surface = Surface::over(&points, is_half, flaw);
    let mut found =
        PreparedTrace { points, surface, depths: Vec::new(), is_unworn, parts: Vec::new() };
    let mut is_grown = false;
    for attempt in 1..=TRIES {
        found.surface = found.surface.through(&found.unworn(0..count));
        found.depths = found.points.iter().map(|(x, z)| found.surface.at(*x) - z).collect();
        let mean = smooth(&found.depths, 2 * half + 1);
        let near = mean.iter().zip(&found.is_unworn).filter(|(_, is_unworn)| **is_unworn);
        let scale = (1.4826 * median(near.map(|(mean, _)| mean.abs()))).max(noise);
        // First, the unworn points grow from the ends. Then they are all points but those of the parts.
        let is_near = |((x, _), mean): (&(f64, f64), &f64)| {
            let is_outside = window.is_none_or(|[from, to]| *x < from || *x > to);
            is_outside && (is_grown || mean.abs() <= NEAR * scale)
        };
        let mut is_unworn: Vec<bool> = found.points.iter().zip(&mean).map(is_near).collect();
        if is_grown {
            let largest = mean.iter().fold(0.0, |most: f64, mean| most.max(mean.abs()));
            let stretches = stretches(&mean, (SURE * scale).max(SHARE * largest));
            found.parts = stretches.iter().map(|stretch| found.exact(stretch, half)).collect();
        }
        for Part { range, .. } in &found.parts {
            // Beside a wide part, two thirds of a side stay.
            let margin = |side: usize| half + (range.len() / UNWORN).min(side / 3);
            let after = range.end + margin(count - range.end);
            is_unworn[range.start.saturating_sub(margin(range.start))..after.min(count)]
                .fill(false);
        }
        let is_stable = found.is_unworn == is_unworn;
        found.is_unworn = is_unworn;
        if is_grown && is_stable || found.unworn(0..count).len() < BESIDE {
            break;
        }
        is_grown |= is_stable || attempt == TRIES / 2;
    }
    found
}

/// Where the moving mean exceeds the limit, and as far as it is above `LOW` of it.
fn stretches(mean: &[f64], limit: f64) -> Vec<Range<usize>> {
    let side = |mean: &f64| (mean.abs() > LOW * limit).then_some(*mean > 0.0);
    let mut end = 0;
    let runs = mean.chunk_by(|one, next| side(one) == side(next)).filter_map(|run| {
        end += run.len();
        run.iter().any(|mean| mean.abs() > limit).then(|| end - run.len()..end)
    });
    runs.collect()
}
