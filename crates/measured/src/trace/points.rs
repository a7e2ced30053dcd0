//! The points of a trace: repeated positions are averaged, and drop-outs, straight lines and isolated spikes are left out.
//! Then a curve fills each gap.

#![expect(
    clippy::float_cmp,
    reason = "numbers of a file that an instrument repeats have equal digits"
)]

use std::ops::Range;

use super::surface::Points;
use crate::curve;

/// Minimum number of points.
pub const FEWEST: usize = 30;
/// A spike is at most this many points. They deviate from all lines through `PAIRS` pairs of neighbours by more than this
/// many times the median deviation, both of all points and of up to `AROUND` points on each side. For normal noise, that
/// is 6 standard deviations. They also deviate by more than `STEP` of the range of heights.
const SPIKE: (usize, f64) = (2, 17.0);
const PAIRS: usize = 3;
const AROUND: usize = 25;
const STEP: f64 = 0.01;
/// A height that an instrument writes where it measures nothing occurs at least this often.
const REPEATED: usize = 3;
/// Drop-outs deviate by this many times the noise.
const FAR: f64 = 6.0;
/// Points lie on one line if they deviate from it by no more than this share of the noise.
const STRAIGHT: f64 = 0.01;
/// How likely noise may make such a line in a trace.
const CHANCE: f64 = 1e-6;
/// A gap is longer than this many times the usual distance of up to `BESIDE` points on each side.
const GAP: f64 = 1.7;
const BESIDE: usize = 8;
/// Minimum number of points for the slope beside a gap.
const SLOPE: usize = 4;
/// The range of the instrument can have ended if the same height occurs this often in a row, and this many times as often
/// as any other height: heights with few digits repeat, too.
const EQUAL: usize = 3;
const OFTEN: usize = 2;

/// The heights alone.
pub fn heights(points: &[(f64, f64)]) -> Vec<f64> {
    points.iter().map(|point| point.1).collect()
}

/// The median.
pub fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The standard deviation of independent noise: from the deviation of each point from the line through its neighbours,
/// which neither a curved surface nor a scar changes much.
pub fn noise(points: &[(f64, f64)]) -> f64 {
    let deviations = points.windows(3).map(|near| {
        let [(x0, z0), (x1, z1), (x2, z2)] = [near[0], near[1], near[2]];
        let share = (x1 - x0) / (x2 - x0);
        let own = z1 - z0 - share * (z2 - z0);
        own.abs() / (1.0 + share * share + (1.0 - share) * (1.0 - share)).sqrt()
    });
    1.4826 * median(deviations.collect())
}

/// The rows in which both numbers are known.
pub fn known(x: &[Option<f64>], y: &[Option<f64>]) -> Result<Points, String> {
    let points: Points = x.iter().zip(y).filter_map(|(x, y)| Some(((*x)?, (*y)?))).collect();
    let few =
        || format!("needs {FEWEST} rows with both numbers, but the file has {}", points.len());
    if points.len() < FEWEST { Err(few()) } else { Ok(points) }
}

/// The points of a trace, from the lowest x to the highest one, and which of them fill a gap.
pub fn ascending(
    mut points: Points,
    is_half: bool,
    notes: &mut Vec<String>,
) -> Result<(Points, Vec<Range<usize>>), String> {
    if points.first() > points.last() {
        points.reverse();
        notes.push("x decreased, so the order of the points was reversed.".to_owned());
    }
    if let Some(at) = points.windows(2).position(|pair| pair[0].0 > pair[1].0) {
        return Err(format!(
            "is no trace: x turns back at its point {}. Sort the rows by x. For a friction loop, write \
             prepare=loop",
            at + 2
        ));
    }
    points = averaged(&points, notes);
    points = without_dropouts(points, notes);
    points = without_lines(points, notes);
    points = without_spikes(&points, notes);
    if is_half {
        points.retain(|(x, _)| *x >= 0.0);
        let mirrored = points.iter().rev().filter(|(x, _)| *x > 0.0).map(|(x, z)| (-x, *z));
        points = mirrored.chain(points.iter().copied()).collect();
        notes.push("The half with x above 0 was mirrored, so a tilt was not removed.".to_owned());
    }
    Ok(filled(&points))
}

/// The line through points: its height at a position, and its slope.
fn line(points: &[(f64, f64)], at: f64) -> (f64, f64) {
    let mean =
        |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let (x, z) = (mean(&|it| it.0), mean(&|it| it.1));
    let square = mean(&|it| (it.0 - x) * (it.0 - x));
    let slope = if square > 0.0 { mean(&|it| (it.0 - x) * (it.1 - z)) / square } else { 0.0 };
    (z + slope * (at - x), slope)
}

/// Of the lines through near and through more points, the flatter one, because an edge among them makes a line steep.
fn flattest(line: &dyn Fn(f64) -> (f64, f64)) -> (f64, f64) {
    let [near, far] = [0.25, 0.5].map(line);
    if near.1.abs() < far.1.abs() { near } else { far }
}

/// Fills each gap with the cubic curve that continues the lines through the points on a part of its length on both sides.
fn filled(points: &[(f64, f64)]) -> (Points, Vec<Range<usize>>) {
    let count = points.len();
    let length = points.last().zip(points.first()).map_or(0.0, |(last, first)| last.0 - first.0);
    let paces: Vec<f64> = points.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let (mut all, mut gaps) = (points[..count.min(1)].to_vec(), Vec::new());
    for (at, width) in paces.iter().enumerate() {
        let near = &paces[at.saturating_sub(BESIDE)..(at + BESIDE + 1).min(paces.len())];
        // At most two points are added for each measured one.
        let pace = median(near.to_vec()).max(0.5 * length / count as f64);
        if *width > GAP * pace {
            let (from, to) = (points[at].0, points[at + 1].0);
            let [(z0, slope0), (z1, slope1)] = [
                flattest(&|reach| {
                    let first = points.partition_point(|it| it.0 < from - reach * width);
                    line(&points[first.min((at + 1).saturating_sub(SLOPE))..=at], from)
                }),
                flattest(&|reach| {
                    let last = points.partition_point(|it| it.0 <= to + reach * width);
                    line(&points[at + 1..last.max((at + 1 + SLOPE).min(count))], to)
                }),
            ];
            let pieces = (width / pace).round();
            let start = all.len();
            all.extend((1..pieces as usize).map(|piece| {
                let (u, v) = (piece as f64 / pieces, 1.0 - piece as f64 / pieces);
                let ends = v * v * (1.0 + 2.0 * u) * z0 + u * u * (1.0 + 2.0 * v) * z1;
                (from + u * width, ends + u * v * width * (v * slope0 - u * slope1))
            }));
            gaps.push(start..all.len());
        }
        all.push(points[at + 1]);
    }
    (all, gaps)
}

/// The smallest difference of heights.
pub fn resolution(heights: &[f64]) -> f64 {
    let mut sorted = heights.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let least = 1e-9 * (sorted[sorted.len() - 1] - sorted[0]);
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > least);
    steps.reduce(f64::min).unwrap_or(0.0)
}

/// The noise of heights, if it exceeds their resolution, and a deviation from a line that the resolution explains.
fn noise_beyond_rounding(heights: &[f64]) -> Option<(f64, f64)> {
    let (noise, step) = (curve::noise(heights), resolution(heights));
    (noise > step).then_some((noise, step.max(STRAIGHT * noise)))
}

/// The points without straight lines, if the others have noise: an instrument held a height, or a program drew a line across
/// a gap. Heights at an end of the range are kept.
fn without_lines(points: Points, notes: &mut Vec<String>) -> Points {
    let all = heights(&points);
    let Some((noise, straight)) = noise_beyond_rounding(&all) else { return points };
    let [low, high] = range(&all);
    let is_straight = |at: usize| {
        let Some([one, own, next]) = at.checked_sub(1).and_then(|at| points.get(at..at + 3)) else {
            return false;
        };
        let z = one.1 + (next.1 - one.1) * (own.0 - one.0) / (next.0 - one.0);
        (own.1 - z).abs() <= straight && own.1 > low && own.1 < high
    };
    let likely = libm::log(CHANCE / points.len() as f64) / libm::log(straight / noise);
    let straight: Vec<bool> = (0..points.len()).map(is_straight).collect();
    let mut is_kept = vec![true; points.len()];
    let mut end = 0;
    for run in straight.chunk_by(PartialEq::eq) {
        end += run.len();
        if run[0] && run.len() as f64 > likely {
            let (first, last) = (end - run.len() - 1, end);
            // A gap has two sides. At an end, such a line is the unworn surface.
            if first == 0 || last + 1 == points.len() {
                continue;
            }
            is_kept[first..=last].fill(false);
            let [from, to] = [points[first].0, points[last].0].map(|x| 1e6 * x);
            notes.push(format!(
                "{} points from x = {from:.3} um to {to:.3} um lie on one line, although the others have noise: a height was \
                 held, or a line was drawn across a gap. They were left out.",
                last + 1 - first
            ));
        }
    }
    points.into_iter().zip(is_kept).filter(|(_, is_kept)| *is_kept).map(|it| it.0).collect()
}

/// The smallest and the largest number.
pub fn range(values: &[f64]) -> [f64; 2] {
    [f64::min, f64::max].map(|end| values.iter().copied().fold(values[0], end))
}

/// The points without spikes.
fn without_spikes(points: &[(f64, f64)], notes: &mut Vec<String>) -> Points {
    if points.len() < FEWEST {
        return points.to_vec();
    }
    let last = points.len() - 1;
    let expected = |at: usize| {
        let middle = at.clamp(PAIRS, last - PAIRS);
        let pairs = (1..=PAIRS).map(|step| (middle - step, middle + step));
        let pairs = pairs.filter(|pair| pair.0 != at && pair.1 != at);
        let lines = pairs.map(|(one, other)| {
            let ((x, z), (x1, z1)) = (points[one], points[other]);
            z + (z1 - z) * (points[at].0 - x) / (x1 - x)
        });
        let far = |line: &f64| (points[at].1 - line).abs();
        lines.min_by(|one, other| far(one).total_cmp(&far(other))).unwrap_or(points[at].1)
    };
    let lines: Vec<f64> = (0..=last).map(expected).collect();
    let deviations: Vec<f64> =
        points.iter().zip(&lines).map(|(point, line)| (point.1 - line).abs()).collect();
    let [low, high] = range(&lines);
    let least = (SPIKE.1 * median(deviations.clone())).max(STEP * (high - low));
    let is_far = |at: usize| {
        let near = &deviations[at.saturating_sub(AROUND)..=(at + AROUND).min(last)];
        deviations[at] > least && deviations[at] > SPIKE.1 * median(near.to_vec())
    };
    let judged: Vec<_> = (0..=last).map(|at| (points[at], is_far(at))).collect();
    let runs = judged.chunk_by(|one, next| one.1 == next.1);
    let kept = runs.filter(|run| !run[0].1 || run.len() > SPIKE.0).flatten();
    let kept: Points = kept.map(|(point, _)| *point).collect();
    let dropped = points.len() - kept.len();
    if dropped > 0 {
        notes.push(format!("{dropped} isolated spike point(s) were dropped."));
    }
    kept
}

/// The points with one for each position.
fn averaged(points: &[(f64, f64)], notes: &mut Vec<String>) -> Points {
    let chunks = points.chunk_by(|one, next| one.0 == next.0);
    let mean = |equal: &[(f64, f64)]| heights(equal).iter().sum::<f64>() / equal.len() as f64;
    let kept: Points = chunks.map(|equal| (equal[0].0, mean(equal))).collect();
    let more = points.len() - kept.len();
    if more > 0 {
        notes
            .push(format!("{more} points have the x of the point before them, and were averaged."));
    }
    kept
}

/// The points without those that an instrument wrote where it measured nothing: zeros, or the lowest or highest number,
/// if most of them are far from the line through the nearest other points.
fn without_dropouts(mut points: Points, notes: &mut Vec<String>) -> Points {
    for which in 0..3 {
        let [low, high] = range(&heights(&points));
        let value = [low, high, 0.0][which];
        let (equal, others): (Points, Points) = points.iter().partition(|point| point.1 == value);
        if equal.len() < REPEATED || others.len() < FEWEST {
            continue;
        }
        let [low, high] = range(&heights(&others));
        let is_beyond = value < 2.0 * low - high || value > 2.0 * high - low;
        if noise_beyond_rounding(&heights(&others)).is_none() && !(is_beyond && low < high) {
            continue;
        }
        let least = FAR * noise(&others).max(1e-3 * (high - low));
        let is_far = |(x, z): &&(f64, f64)| {
            let after = others.partition_point(|other| other.0 < *x).clamp(1, others.len() - 1);
            let ((x0, z0), (x1, z1)) = (others[after - 1], others[after]);
            let share = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
            (z - z0 - share * (z1 - z0)).abs() > least
        };
        if 2 * equal.iter().filter(is_far).count() > equal.len() {
            let (count, value) = (equal.len(), 1e6 * value);
            notes.push(format!(
                "{count} points with the height {value:.6} um are drop-outs and were left out."
            ));
            points = others;
        }
    }
    points
}

/// Points beyond the range of an instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct Beyond {
    /// The points from the first to the last one.
    pub range: Range<usize>,
    /// Their number.
    pub count: usize,
    /// Which end of the range it is.
    pub end: &'static str,
    /// The mean height that is missing if a parabola continues the slopes of both sides; below 0 at the lower end.
    pub height: f64,
}

/// Finds points at an end of the range of the instrument: several equal heights in a row, although other points have noise.
pub fn beyond(points: &[(f64, f64)]) -> Option<Beyond> {
    let heights = heights(points);
    let mut sorted = heights.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let [low, high] = range(&heights);
    let sides = [(low, -1.0, "lowest"), (high, 1.0, "highest")];
    sides.into_iter().filter(|_| noise(points) > 0.0).find_map(|(limit, sign, end)| {
        let others = sorted.chunk_by(|one, next| one == next).filter(|it| it[0] != limit);
        let most = others.map(<[f64]>::len).max()?;
        let runs = heights.chunk_by(|one, next| one == next).filter(|it| it[0] == limit);
        let (longest, count) =
            runs.fold((0, 0), |(most, count), run| (run.len().max(most), count + run.len()));
        let first = heights.iter().position(|height| *height == limit)?;
        let last = heights.iter().rposition(|height| *height == limit)?;
        let step = ((last - first) / 4).max(3);
        let (before, after) = (first.checked_sub(step)?, points.get(last + step)?);
        let (ends, before) = ([points[first].0, points[last].0], points[before]);
        // With the mean slope s at both ends of the width w, a parabola is s·w/4 deep, and s·w/6 in the mean.
        let slope = |point: (f64, f64), x: f64| 0.5 * ((point.1 - limit) / (point.0 - x)).abs();
        let slope = slope(before, ends[0]) + slope(*after, ends[1]);
        let height = sign * slope * (ends[1] - ends[0]) / 6.0;
        let is_clipped = longest >= EQUAL && count >= OFTEN * most;
        is_clipped.then_some(Beyond { range: first..last + 1, count, end, height })
    })
}
