//! The points of a trace: repeated positions are averaged, and drop-outs, straight lines and isolated spikes are left out.

#![expect(
    clippy::float_cmp,
    reason = "numbers of a file that an instrument repeats have equal digits"
)]

use std::ops::Range;

use crate::curve::{self, enough, is_spike, median, spread};
use crate::notes::{Notes, counted};

/// Minimum number of points.
pub const FEWEST: usize = 30;
/// A height that an instrument writes where it measures nothing, or where its range ends, occurs at least this often.
const REPEATED: usize = 3;
/// Drop-outs and spikes deviate by this many times the noise, and by this share of the range of heights.
const FAR: (f64, f64) = (6.0, 0.01);
/// Points lie on one line if they deviate from it by no more than this share of the noise.
const STRAIGHT: f64 = 0.01;
/// How likely noise may make such a line in a trace.
const CHANCE: f64 = 1e-6;
/// The range of the instrument ends at a height that occurs this many times as often as any other: heights with few digits
/// repeat, too.
const OFTEN: usize = 2;

/// Heights jump by this many times the noise, and this many times as steeply as near there. Of 1000 random traces without joined
/// images (`trace_kinds`), 14 have such a jump, mostly at narrow ridges and steep sides with few points.
const JUMP: (f64, f64) = (10.0, 6.0);
/// The number of neighbours on each side that are near.
const NEAR: usize = 5;

/// Points of a trace: x and z.
pub type Points = Vec<(f64, f64)>;

/// The heights alone.
pub fn heights(points: &[(f64, f64)]) -> Vec<f64> {
    points.iter().map(|point| point.1).collect()
}

/// The lowest and the highest of the points.
pub fn limits(points: &[(f64, f64)]) -> [f64; 2] {
    curve::ends(points.iter().map(|point| point.1))
}

/// The deviation of each point from the line through its neighbours, divided by what independent noise makes of it.
fn bends(points: &[(f64, f64)]) -> Vec<f64> {
    let bend = |near: &[(f64, f64)]| {
        let share = (near[1].0 - near[0].0) / (near[2].0 - near[0].0);
        let own = near[1].1 - near[0].1 - share * (near[2].1 - near[0].1);
        own.abs() / (1.0 + share * share + (1.0 - share) * (1.0 - share)).sqrt()
    };
    points.windows(3).map(bend).collect()
}

/// The standard deviation of independent noise, which neither a curved surface nor a scar changes much.
pub fn noise(points: &[(f64, f64)]) -> f64 {
    1.4826 * median(bends(points).into_iter())
}

/// The smallest difference of heights.
pub fn resolution(points: &[(f64, f64)]) -> f64 {
    let mut sorted = heights(points);
    sorted.sort_unstable_by(f64::total_cmp);
    let least = 1e-9 * (sorted[sorted.len() - 1] - sorted[0]);
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > least);
    steps.reduce(f64::min).unwrap_or(0.0)
}

/// The noise of heights, and their resolution if the noise exceeds it.
fn noise_beyond_rounding(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let (noise, step) = (curve::noise(&heights(points)), resolution(points));
    (noise > step).then_some((noise, step))
}

/// The points after which the heights jump by more than `least` and the noise, as where two images were joined.
pub fn jumps(points: &[(f64, f64)], least: f64) -> Vec<usize> {
    let steps =
        points.windows(2).map(|pair| [pair[1].0 - pair[0].0, (pair[1].1 - pair[0].1).abs()]);
    let steps: Vec<[f64; 2]> = steps.collect();
    let least = least.max(JUMP.0 * noise(points));
    let slopes: Vec<f64> = steps.iter().map(|[length, height]| height / length).collect();
    let is_jump = |at: &usize| {
        let near = &slopes[at.saturating_sub(NEAR)..(at + NEAR + 1).min(slopes.len())];
        steps[*at][1] > least && slopes[*at] > JUMP.1 * median(near.iter().copied())
    };
    (0..steps.len()).filter(is_jump).collect()
}

/// The points of a trace, from the lowest x to the highest one.
pub fn ascending(rows: Points, is_half: bool, notes: &mut Notes) -> Result<Points, String> {
    let mut points = enough(rows, FEWEST, "rows with both numbers")?;
    if points.first() > points.last() {
        points.reverse();
        notes.push("x decreased, so the order of the points was reversed.".to_owned());
    }
    if let Some(at) = points.windows(2).position(|pair| pair[0].0 > pair[1].0) {
        return Err(format!(
            "is no trace: x turns back at its point {}. Sort the rows by x. For a friction loop, write prepare=loop",
            at + 2
        ));
    }
    for cleaned in [averaged, without_dropouts, without_lines, without_spikes] {
        points =
            enough(cleaned(&points, notes), FEWEST, "points at different x that are no drop-outs")?;
    }
    if is_half {
        points.retain(|(x, _)| *x >= 0.0);
        let mirrored = points.iter().rev().filter(|(x, _)| *x > 0.0).map(|(x, z)| (-x, *z));
        points = mirrored.chain(points.iter().copied()).collect();
        notes.push(
            "The half with x above 0 was mirrored, and the tilt of both sides removed.".to_owned(),
        );
        if points.len() < FEWEST {
            return Err("has too few points with x above 0. The axis must be at x = 0".to_owned());
        }
    }
    Ok(points)
}

/// The points with one for each position.
fn averaged(points: &[(f64, f64)], notes: &mut Notes) -> Points {
    let chunks = points.chunk_by(|one, next| one.0 == next.0);
    let mean = |equal: &[(f64, f64)]| heights(equal).iter().sum::<f64>() / equal.len() as f64;
    let kept: Points = chunks.map(|equal| (equal[0].0, mean(equal))).collect();
    let told = "points have the x of the point before them, and were averaged.";
    counted(notes, points.len() - kept.len(), told);
    kept
}

/// The points without those that an instrument wrote where it measured nothing: zeros, or the lowest or highest number,
/// if most of them are far from the nearest other points.
fn without_dropouts(points: &[(f64, f64)], notes: &mut Notes) -> Points {
    let (mut points, [low, high]) = (points.to_vec(), limits(points));
    for value in [low, high, 0.0] {
        let (equal, others): (Points, Points) = points.iter().partition(|point| point.1 == value);
        if equal.len() < REPEATED || others.len() < FEWEST {
            continue;
        }
        let [low, high] = limits(&others);
        let is_beyond = low < high && (value - 0.5 * (low + high)).abs() > 1.5 * (high - low);
        if noise_beyond_rounding(&others).is_none() && !is_beyond {
            continue;
        }
        let least = (FAR.0 * noise(&others)).max(FAR.1 * (high - low));
        let is_far = |(x, _): &&(f64, f64)| {
            let after = others.partition_point(|other| other.0 < *x).clamp(1, others.len() - 1);
            let [low, high] = limits(&others[after - 1..=after]);
            value < low - least || value > high + least
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

/// The points without straight lines, if the others have noise: an instrument held a height, or a program drew a line across
/// a gap. Heights at an end of the range are kept, and so are lines at an end of the trace, which are the unworn surface.
fn without_lines(points: &[(f64, f64)], notes: &mut Notes) -> Points {
    let Some((noise, step)) = noise_beyond_rounding(points) else { return points.to_vec() };
    let most = step.max(STRAIGHT * noise);
    let likely = libm::log(CHANCE / points.len() as f64) / libm::log(most / noise);
    let [low, high] = limits(points);
    let bends = bends(points);
    let is_straight =
        |at: usize| bends[at] <= most && points[at + 1].1 > low && points[at + 1].1 < high;
    let straight: Vec<bool> = (0..bends.len()).map(is_straight).collect();
    let (mut is_kept, mut first) = (vec![true; points.len()], 0);
    for run in straight.chunk_by(PartialEq::eq) {
        let last = first + run.len() + 1;
        if run[0] && run.len() as f64 > likely && first > 0 && last + 1 < points.len() {
            is_kept[first..=last].fill(false);
            let (count, [from, to]) =
                (last + 1 - first, [first, last].map(|at| 1e6 * points[at].0));
            notes.push(format!(
                "{count} points from x = {from:.3} um to {to:.3} um lie on one line, although the others have noise: a height was \
                 held, or a line was drawn across a gap. They were left out."
            ));
        }
        first += run.len();
    }
    points.iter().zip(is_kept).filter(|(_, is_kept)| *is_kept).map(|it| *it.0).collect()
}

/// The points without spikes.
fn without_spikes(points: &[(f64, f64)], notes: &mut Notes) -> Points {
    let heights = heights(points);
    let least = (FAR.0 * noise(points)).max(FAR.1 * spread(&heights));
    let rows = (0..points.len()).filter(|row| !is_spike(&heights, *row, 2, least));
    let kept: Points = rows.map(|row| points[row]).collect();
    counted(notes, points.len() - kept.len(), "isolated spike point(s) were dropped.");
    kept
}

/// The points at an end of the range of the instrument, their number and which end it is: several equal heights in a row,
/// although other points have noise.
pub fn clipped(points: &[(f64, f64)]) -> Option<(Range<usize>, usize, &'static str)> {
    let mut sorted = heights(points);
    sorted.sort_unstable_by(f64::total_cmp);
    let sides = limits(points).into_iter().zip(["lowest", "highest"]);
    sides.filter(|_| noise(points) > 0.0).find_map(|(limit, end)| {
        let others = sorted.chunk_by(PartialEq::eq).filter(|equal| equal[0] != limit);
        let most = others.map(<[f64]>::len).max()?;
        let all: Vec<usize> = (0..points.len()).filter(|at| points[*at].1 == limit).collect();
        let is_run = all.windows(REPEATED).any(|near| near[REPEATED - 1] - near[0] < REPEATED);
        let range = all[0]..all[all.len() - 1] + 1;
        (is_run && all.len() >= OFTEN * most).then_some((range, all.len(), end))
    })
}
