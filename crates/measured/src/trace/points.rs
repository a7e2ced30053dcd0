//! The points of a trace: repeated positions are averaged, and drop-outs and isolated spikes are left out.

use std::ops::Range;

use super::surface::Points;

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
/// The range of the instrument can have ended if the same height occurs this often in a row, and this many times as often
/// as any other height: heights with few digits repeat, too.
const EQUAL: usize = 3;
const OFTEN: usize = 2;

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

/// The points of a trace, from the lowest x to the highest one.
pub fn ascending(
    mut points: Points,
    is_half: bool,
    notes: &mut Vec<String>,
) -> Result<Points, String> {
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
    points = without_spikes(&points, notes);
    if is_half {
        points.retain(|(x, _)| *x >= 0.0);
        let mirrored = points.iter().rev().filter(|(x, _)| *x > 0.0).map(|(x, z)| (-x, *z));
        points = mirrored.chain(points.iter().copied()).collect();
        notes.push("The half with x above 0 was mirrored, so a tilt was not removed.".to_owned());
    }
    Ok(points)
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
    let mean = |chunk: &[(f64, f64)]| {
        (chunk[0].0, chunk.iter().map(|point| point.1).sum::<f64>() / chunk.len() as f64)
    };
    let kept: Points = chunks.map(mean).collect();
    if kept.len() < points.len() {
        notes.push(format!(
            "{} points have the x of the point before them. The heights at equal x were averaged.",
            points.len() - kept.len()
        ));
    }
    kept
}

/// The points without those that an instrument wrote where it measured nothing: zeros, or the lowest or highest number,
/// if most of them are far from the line through the nearest other points.
fn without_dropouts(mut points: Points, notes: &mut Vec<String>) -> Points {
    for which in 0..3 {
        if points.len() < FEWEST {
            break;
        }
        let heights: Vec<f64> = points.iter().map(|point| point.1).collect();
        let [low, high] = range(&heights);
        let value = [low, high, 0.0][which];
        let (equal, others): (Points, Points) = points.iter().partition(|point| point.1 == value);
        if equal.len() < REPEATED || others.len() < FEWEST {
            continue;
        }
        let least = FAR * noise(&others).max(1e-3 * (range_of(&others)));
        let is_far = |(x, z): &&(f64, f64)| {
            let after = others.partition_point(|other| other.0 < *x).clamp(1, others.len() - 1);
            let ((x0, z0), (x1, z1)) = (others[after - 1], others[after]);
            let share = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
            (z - z0 - share * (z1 - z0)).abs() > least
        };
        if 2 * equal.iter().filter(is_far).count() > equal.len() {
            let count = equal.len();
            notes.push(format!(
                "{count} points with the height {:.6} um are drop-outs and were left out.",
                value * 1e6
            ));
            points = others;
        }
    }
    points
}

/// The difference of the highest and the lowest point.
fn range_of(points: &[(f64, f64)]) -> f64 {
    let [low, high] = range(&points.iter().map(|point| point.1).collect::<Vec<_>>());
    high - low
}

/// Points beyond the range of an instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct Beyond {
    /// From the first to the last of them.
    pub range: Range<usize>,
    /// Their number.
    pub count: usize,
    /// The mean height that is missing if a parabola continues the slopes of both sides; below 0 at the lower end.
    pub height: f64,
}

impl Beyond {
    /// The first and the last position.
    pub fn ends(&self, points: &[(f64, f64)]) -> [f64; 2] {
        [points[self.range.start].0, points[self.range.end - 1].0]
    }
}

/// Finds points at an end of the range of the instrument: several equal heights in a row, although other points have noise.
pub fn beyond(points: &[(f64, f64)]) -> Option<Beyond> {
    let heights: Vec<f64> = points.iter().map(|point| point.1).collect();
    let has_noise = noise(points) > 0.0;
    let mut sorted = heights.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let most = |end: f64| {
        let others = sorted.chunk_by(|one, next| one == next).filter(|equal| equal[0] != end);
        others.map(<[f64]>::len).max().unwrap_or(0)
    };
    let [low, high] = range(&heights);
    [(low, -1.0), (high, 1.0)].into_iter().filter(|_| has_noise).find_map(|(end, sign)| {
        let runs = heights.chunk_by(|one, next| (*one == end) == (*next == end));
        let longest = runs.filter(|run| run[0] == end).map(<[f64]>::len).max()?;
        let ends = |at: usize| heights[at] == end;
        let (from, to) =
            ((0..heights.len()).find(|at| ends(*at))?, (0..heights.len()).rfind(|at| ends(*at))?);
        let step = ((to - from) / 4).max(3);
        let (before, after) = (points.get(from.checked_sub(step)?)?, points.get(to + step)?);
        let slope = |(x, z): &(f64, f64), at: usize| ((z - end) / (x - points[at].0)).abs();
        // With the mean slope s at both ends of the width w, a parabola is s·w/4 deep, and s·w/6 in the mean.
        let mean =
            0.5 * (slope(before, from) + slope(after, to)) * (points[to].0 - points[from].0) / 6.0;
        let count = heights.iter().filter(|height| **height == end).count();
        let is_often = count >= OFTEN * most(end);
        (longest >= EQUAL && is_often).then_some(Beyond {
            range: from..to + 1,
            count,
            height: sign * mean,
        })
    })
}
