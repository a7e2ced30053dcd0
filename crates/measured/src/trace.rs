//! Profilometer traces and friction loops.
//!
//! The unworn surface is a circle or a plane with a tilt, fitted by least squares to the points outside of the scar. The
//! scar is where several neighbouring points deviate from it to the same side by more than twice their scatter. Both are
//! repeated until the limits of the scar stay. Across a ball or cylinder, a tilt and a shift of the apex look alike. So
//! the axis is the centroid of the scar, and the tilt is the slope of the unworn surface there.
//!
//! # Accuracy
//! The tests measure it with traces of 1000 points and scars of the engine.

use std::ops::Range;

use serde_json::{Value, json};

use super::{Prepare, Wanted};

/// Minimum number of points.
const FEWEST: usize = 30;
/// The share of the trace at each end that must be unworn.
const UNWORN: usize = 10;
/// The scar ends where points deviate by less than this many times the scatter, and than this share of the largest
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
/// A difference of the two sides above this share of the depth is called large.
const UNEQUAL: f64 = 0.2;

type Points = Vec<(f64, f64)>;

fn known(x: &[Option<f64>], y: &[Option<f64>]) -> Result<Points, String> {
    let points: Points = x.iter().zip(y).filter_map(|(x, y)| Some(((*x)?, (*y)?))).collect();
    if points.len() >= FEWEST {
        return Ok(points);
    }
    Err(format!("needs {FEWEST} points with both numbers, but the file has {}", points.len()))
}

/// The parabola z = level + slope·u + curvature·(u² − skew·u − square), whose three terms are orthogonal on the points.
struct Parabola {
    middle: f64,
    level: f64,
    slope: f64,
    curvature: f64,
    skew: f64,
    square: f64,
    /// Scatter of the points, and standard error of the curvature.
    scatter: f64,
    error: f64,
}

impl Parabola {
    fn through(points: &[(f64, f64)]) -> Self {
        let sum =
            |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|(x, z)| of(*x, *z)).sum::<f64>();
        let count = points.len() as f64;
        let (middle, level) = (sum(&|x, _| x) / count, sum(&|_, z| z) / count);
        let second = sum(&|x, _| (x - middle) * (x - middle));
        let skew = sum(&|x, _| (x - middle) * (x - middle) * (x - middle)) / second;
        let square = second / count;
        let third = |x: f64| (x - middle) * (x - middle - skew) - square;
        let slope = sum(&|x, z| (x - middle) * (z - level)) / second;
        let norm = sum(&|x, _| third(x) * third(x));
        let curvature = sum(&|x, z| third(x) * (z - level)) / norm;
        let mut found =
            Self { middle, level, slope, curvature, skew, square, scatter: 0.0, error: 0.0 };
        let squares = sum(&|x, z| (z - found.at(x)) * (z - found.at(x)));
        found.scatter = (squares / (count - 3.0)).sqrt();
        found.error = found.scatter / norm.sqrt();
        found
    }

    fn at(&self, x: f64) -> f64 {
        let u = x - self.middle;
        self.level + self.slope * u + self.curvature * (u * (u - self.skew) - self.square)
    }

    fn slope_at(&self, x: f64) -> f64 {
        self.slope + self.curvature * (2.0 * (x - self.middle) - self.skew)
    }

    fn apex(&self) -> f64 {
        self.middle + 0.5 * (self.skew - self.slope / self.curvature)
    }

    fn radius(&self) -> f64 {
        0.5 / self.curvature.abs()
    }

    /// The height of the circle with the same apex and curvature above the parabola.
    fn roundness(&self, x: f64) -> f64 {
        let (u, radius) = (x - self.apex(), self.radius());
        let height = radius - (radius * radius - u * u).max(0.0).sqrt();
        height.copysign(self.curvature) - self.curvature * u * u
    }
}

/// The unworn surface, and the scar.
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
        let mut found = Self {
            unworn: Parabola::through(points),
            heights: Vec::new(),
            is_round: false,
            scar: end..count - end,
        };
        for attempt in 0..TRIES {
            let roundness = |x: f64| if found.is_round { found.unworn.roundness(x) } else { 0.0 };
            let flat: Vec<_> = points.iter().map(|(x, z)| (*x, z - roundness(*x))).collect();
            // The edges of a scar are shallow, so a margin beside it does not count as unworn either.
            let margin = if attempt == 0 { 0 } else { found.scar.len() / UNWORN };
            let begin = found.scar.start.saturating_sub(margin).max(end / 2);
            let after = (found.scar.end + margin).min(count - end / 2);
            let outside = if found.scar.is_empty() {
                flat.clone()
            } else {
                [&flat[..begin], &flat[after..]].concat()
            };
            let unworn = Parabola::through(&outside);
            let heights: Vec<f64> = flat.iter().map(|(x, z)| z - unworn.at(*x)).collect();
            let largest =
                heights.iter().fold(0.0, |largest: f64, height| largest.max(height.abs()));
            let limit = (SCATTER * unworn.scatter).max(SHARE * largest);
            let deviates = |near: &[f64]| {
                near.iter().all(|height| *height > limit)
                    || near.iter().all(|height| *height < -limit)
            };
            let first = heights.windows(run).position(deviates);
            let last = heights.windows(run).rposition(deviates);
            let scar = first.zip(last).map_or(0..0, |(first, last)| first..last + run);
            let is_stable = attempt > 2 && scar == found.scar;
            let is_round = unworn.curvature.abs() * half * half > 3.0 * unworn.scatter;
            found = Self { unworn, heights, is_round, scar };
            if is_stable {
                break;
            }
        }
        if !found.scar.is_empty() && (found.scar.start < end || found.scar.end > count - end) {
            return Err("has a scar that reaches to an end. Measure farther: at each end, a tenth of the trace must be \
                        unworn. If the trace begins at the axis, write prepare=half".to_owned());
        }
        Ok(found)
    }

    /// The centroid of the scar. Without a scar, the apex or the middle.
    fn axis(&self, points: &[(f64, f64)]) -> f64 {
        if self.scar.is_empty() {
            return if self.is_round { self.unworn.apex() } else { self.unworn.middle };
        }
        let own = self.scar.clone().map(|at| {
            let weight = self.heights[at] * (points[at + 1].0 - points[at - 1].0);
            (weight, weight * points[at].0)
        });
        let (weight, moment) = own.fold((0.0, 0.0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
        moment / weight
    }
}

/// The sums over the points of one side near a radius.
#[derive(Clone, Copy, Default)]
struct Bin {
    count: f64,
    radius: f64,
    depth: f64,
    height: f64,
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
    let mut points = known(x, z)?;
    if points.first() > points.last() {
        points.reverse();
        notes.push("x decreased, so the order of the points was reversed.".to_owned());
    }
    if let Some(at) = points.windows(2).position(|pair| pair[0].0 >= pair[1].0) {
        let detail = "is no trace: x turns back or stays at its point";
        return Err(format!(
            "{detail} {}. Sort the rows by x. For a friction loop, write prepare=loop",
            at + 2
        ));
    }
    if wanted.prepare == Prepare::Half {
        if points[0].0 < 0.0 {
            return Err(
                "is not half of a trace, because x is negative. Write prepare=trace".to_owned()
            );
        }
        let mirrored = points.iter().rev().filter(|(x, _)| *x > 0.0).map(|(x, z)| (-x, *z));
        points = mirrored.chain(points.iter().copied()).collect();
        notes.push(
            "The trace begins at the axis, so it was mirrored. Its tilt cannot be known."
                .to_owned(),
        );
    }
    let surface = Surface::find(&points)?;
    let (unworn, scar) = (&surface.unworn, surface.scar.clone());
    let axis = if wanted.centre { surface.axis(&points) } else { 0.0 };
    let tilt = if wanted.level { unworn.slope_at(axis) } else { 0.0 };
    // Heights count away from the material, whose side follows from the curvature, or from the scar.
    let sum: f64 = surface.heights[scar.clone()].iter().sum();
    let outwards = if surface.is_round { -unworn.curvature } else { -sum }.signum();
    let half =
        if scar.is_empty() { 0.0 } else { 0.5 * (points[scar.end - 1].0 - points[scar.start].0) };
    let reach = (axis - points[0].0).min(points[points.len() - 1].0 - axis);
    if reach <= half {
        return Err(
            "is shorter on one side of the axis than the scar. Remove centre=false".to_owned()
        );
    }
    let spacing = 2.0 * (points[points.len() - 1].0 - points[0].0) / points.len() as f64;
    let width = (half / RADII).max(reach / MOST_RADII).max(spacing);
    let mut bins = vec![[Bin::default(); 2]; (reach / width) as usize + 1];
    for ((x, z), height) in points.iter().zip(&surface.heights) {
        let r = (x - axis).abs();
        if let Some(sides) = bins.get_mut((r / width).round() as usize) {
            let Bin { count, radius, depth, height: sum } = &mut sides[usize::from(*x < axis)];
            *count += 1.0;
            *radius += r;
            *depth -= outwards * height;
            *sum += outwards * (unworn.at(axis) + tilt * (x - axis) - z);
        }
    }
    bins.retain(|[right, left]| right.count + left.count > 0.0);
    let mean = |of: fn(&Bin) -> f64| {
        let mean = |[right, left]: &[Bin; 2]| (of(right) + of(left)) / (right.count + left.count);
        bins.iter().map(mean).collect::<Vec<f64>>()
    };
    let (mut radius, mut depth, height) =
        (mean(|bin| bin.radius), mean(|bin| bin.depth), mean(|bin| bin.height));
    radius[0] = 0.0;
    let height: Vec<f64> = height.iter().map(|it| it - height[0]).collect();
    let deepest = depth.iter().copied().fold(0.0, f64::max);
    let beyond = radius.partition_point(|radius| half == 0.0 || *radius <= BEYOND * half);
    let both = bins[..beyond].iter().filter(|[right, left]| right.count > 0.0 && left.count > 0.0);
    let squares =
        both.clone().map(|[right, left]| right.depth / right.count - left.depth / left.count);
    let difference = (squares.map(|it| it * it).sum::<f64>() / both.count() as f64).sqrt();
    let shown = json!({
        "radius": surface.is_round.then(|| unworn.radius()),
        "radius_error": surface.is_round.then(|| unworn.radius() * unworn.error / unworn.curvature.abs()),
        "tilt": unworn.slope_at(axis), "centre": axis, "scatter": unworn.scatter, "difference": difference,
        "scar": (half > 0.0).then(|| [points[scar.start].0, points[scar.end - 1].0]),
    });
    tell(&shown, deepest, wanted, notes);
    let indenter = json!({"shape": "table", "radius": radius, "height": height});
    radius.truncate(beyond);
    depth.truncate(beyond);
    let data =
        json!({"profile": "wear", "radius": radius, "depth": depth, "sigma": unworn.scatter});
    Ok(json!({"data": data, "indenter": surface.is_round.then_some(indenter), "trace": shown}))
}

/// Says in words what was done with a trace.
fn tell(shown: &Value, deepest: f64, wanted: &Wanted<'_>, notes: &mut Vec<String>) {
    let um = |x: &Value| format!("{:.4} um", x.as_f64().unwrap_or(0.0) * 1e6);
    notes.push(match shown["radius"].as_f64() {
        Some(radius) => {
            let error = shown["radius_error"].as_f64().unwrap_or(0.0);
            format!(
                "Outside of the scar, the radius is {:.5} ± {:.5} mm.",
                radius * 1e3,
                error * 1e3
            )
        }
        None => "Outside of the scar, the surface is plane within its scatter.".to_owned(),
    });
    let scatter = um(&shown["scatter"]);
    notes.push(format!(
        "Points outside of the scar scatter by {scatter} (root mean square), which is `sigma`."
    ));
    let tilt = shown["tilt"].as_f64().unwrap_or(0.0) * 1e3;
    let done = if wanted.level { "was removed" } else { "was not removed" };
    notes.push(format!("The tilt of {tilt:.4} um/mm at the axis {done}."));
    let centre = if wanted.centre { "the centroid of the depth" } else { "as you wish" };
    let axis = um(&shown["centre"]);
    let Some(scar) = shown["scar"].as_array() else {
        notes.push(format!("No scar was found. The axis is at x = {axis}."));
        return;
    };
    let (first, last) = (um(&scar[0]), um(&scar[1]));
    notes.push(format!(
        "The scar is from x = {first} to {last}. The axis is at x = {axis}, {centre}."
    ));
    let difference = shown["difference"].as_f64().unwrap_or(0.0) / deepest;
    let large = if difference > UNEQUAL { ". This is much: look at the trace" } else { "" };
    let (deepest, percent) = (um(&json!(deepest)), 100.0 * difference);
    notes.push(format!("Left and right were averaged. They differ by {percent:.1} % of the depth, {deepest}{large}."));
}

/// The energy of a friction loop: the area inside the points.
///
/// # Errors
/// The points are no loop.
pub fn energy(
    x: &[Option<f64>],
    force: &[Option<f64>],
    notes: &mut Vec<String>,
) -> Result<Value, String> {
    let points = known(x, force)?;
    let turns = points.windows(3).filter(|near| (near[1].0 > near[0].0) != (near[2].0 > near[1].0));
    let ends =
        points.iter().fold((f64::MAX, f64::MIN), |ends, (x, _)| (ends.0.min(*x), ends.1.max(*x)));
    let (middle, quarter) = (0.5 * (ends.0 + ends.1), 0.25 * (ends.1 - ends.0));
    // A cycle changes twice between the outer quarters of the stroke.
    let far = points.iter().map(|(x, _)| x - middle).filter(|x| x.abs() > quarter);
    let mut sides: Vec<bool> = far.map(|x| x > 0.0).collect();
    sides.dedup();
    let cycles = sides.len() / 2;
    if turns.count() == 0 || cycles == 0 {
        return Err(
            "is no loop: x does not turn back. Write prepare=trace for a profile".to_owned()
        );
    }
    let pairs = points.iter().zip(points.iter().cycle().skip(1));
    let area: f64 = pairs.map(|((x0, q0), (x1, q1))| 0.5 * (q0 + q1) * (x1 - x0)).sum();
    let energy = area.abs() / cycles as f64;
    notes.push(format!("The energy of a cycle is the area of {cycles} cycle(s), closed by a line from the last point to the first."));
    Ok(json!({"energy_per_cycle": energy, "cycles": cycles}))
}
