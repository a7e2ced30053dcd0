//! Which parts of a trace are the scar, and where the heights point. What is doubtful is refused with the parameter that decides.

use std::ops::Range;

use super::parts::{self, Found, Part, REACH, UNWORN};
use super::points::{Beyond, beyond, noise, range};
use super::surface::{Points, Surface};
use super::{Up, Wanted};

/// A removed part with this share of the area of the scar is another scar.
const OTHER: f64 = 0.1;
/// A step counts if it is this many standard deviations, and this many times the scatter.
const SURE: f64 = 5.0;

/// A step is searched at this many places less one, on at most this many points. With it, this share more of the points are
/// unworn.
const STEPS: f64 = 16.0;
const THIN: usize = 500;
const GAIN: f64 = 0.04;
/// Without a scar, a surface is no circle if it scatters by this many times the noise and this share of its height.
const ROUGH: (f64, f64) = (10.0, 0.01);
/// Minimum number of points in a scar, and on each side of it.
const BESIDE: usize = 8;
/// Minimum and maximum number of neighbours at the ends of the scar that exceed this many times the scatter and this share
/// of the largest depth.
const RUN: (usize, usize) = (3, 8);
const SCATTER: f64 = 2.0;
const SHARE: f64 = 0.01;
/// The core of a scar is deeper than this share of the largest depth.
const CORE: f64 = 0.1;

/// The scar of a trace.
#[derive(Debug)]
pub struct Scar {
    /// The unworn surface, and all parts.
    pub found: Found,
    /// The sign of heights out of the material.
    pub outwards: f64,
    /// The points between the ends of the scar. Empty if there is none.
    pub range: Range<usize>,
    /// The removed parts of the scar, without their shallow ends.
    pub core: Vec<Part>,
    /// The removed parts of the scar.
    pub removed: Vec<Part>,
    /// The parts above the unworn surface.
    pub added: Vec<Part>,
    /// Points beyond the range of the instrument.
    pub beyond: Option<Beyond>,
}

const UM: f64 = 1e6;
const FARTHER: &str = "Measure farther: at each end, a tenth of the trace must be unworn. If the trace begins at the axis, \
                       write prepare=half";

/// The ends of a part in words.
fn place(points: &[(f64, f64)], range: &Range<usize>) -> String {
    format!(
        "from x = {:.4} mm to {:.4} mm",
        1e3 * points[range.start].0,
        1e3 * points[range.end - 1].0
    )
}

/// The parameter that chooses the points of a range.
fn choice(points: &[(f64, f64)], range: &Range<usize>) -> String {
    ends([points[range.start].0, points[range.end - 1].0])
}

/// The parameter that chooses the points between two ends.
fn ends([from, to]: [f64; 2]) -> String {
    format!("scar={:.4}..{:.4}mm", 1e3 * from, 1e3 * to)
}

/// The points from the first part to the last one.
fn all(parts: &[Part]) -> Range<usize> {
    parts[0].range.start..parts[parts.len() - 1].range.end
}

fn area(parts: &[Part]) -> f64 {
    parts.iter().map(|part| part.area.abs()).fold(0.0, |sum, area| sum + area)
}

/// The sign of heights out of the material. Only the curvature of a surface may decide without a word of the user: a hump on
/// a hollow surface is a scar of a ball whose heights count into it.
fn outwards(found: &Found, points: &Points, wanted: &Wanted<'_>, notes: &mut Vec<String>) -> f64 {
    let largest =
        found.parts.iter().max_by(|one, other| one.area.abs().total_cmp(&other.area.abs()));
    let height = largest.map_or(0.0, |part| {
        part.range.clone().fold(0.0, |most: f64, at| most.max(found.heights[at].abs()))
    });
    let half = 0.5 * (points[points.len() - 1].0 - points[0].0);
    let bow = found.surface.bend() * half * half;
    let is_turned =
        found.surface.is_round && bow > height && largest.is_none_or(|part| part.area > 0.0);
    match wanted.up {
        Some(Up::Out) => 1.0,
        Some(Up::In) => -1.0,
        None if is_turned => {
            notes.push(
                "The surface is a ball or cylinder if its heights point into the material, so they were turned. If it is \
                 hollow, write up=out."
                    .to_owned(),
            );
            -1.0
        }
        None => 1.0,
    }
}

/// Finds the scar.
///
/// # Errors
/// There is none, there are several, or the unworn surface is not one plane or circle.
pub fn scar(points: &Points, wanted: &Wanted<'_>, notes: &mut Vec<String>) -> Result<Scar, String> {
    let (count, window) = (points.len(), wanted.scar);
    let [first, after] = window.map_or([0, count], |window| {
        window.map(|end| points.partition_point(|point| point.0 < end))
    });
    if let Some([from, to]) = window.filter(|window| !is_inside(points, *window)) {
        return Err(format!(
            "has too few points in or beside scar={:.4}..{:.4}mm: x is {}. Write other ends",
            1e3 * from,
            1e3 * to,
            place(points, &(0..count))
        ));
    }
    let mut found = parts::find(points, window, None);
    if window.is_some() {
        let stepped = parts::find(points, window, window);
        if is_step(&stepped.surface) {
            found = stepped;
            let height = found.surface.step().0;
            notes.push(format!(
                "The right side of the scar is {:.4} um higher than the left one. A line between both is the unworn \
                 surface, and half of the difference is in the errors: depth and volume are uncertain.",
                UM * height
            ));
        }
        found.parts.retain(|part| part.range.start < after && part.range.end > first);
        for Part { range, .. } in &mut found.parts {
            *range = range.start.max(first)..range.end.min(after);
        }
    }
    let outwards = outwards(&found, points, wanted, notes);
    let (added, removed): (Vec<_>, Vec<_>) =
        found.parts.iter().cloned().partition(|part| part.area * outwards > 0.0);
    let beyond = beyond(points);
    if let Some(Beyond { count, height, .. }) = &beyond {
        let end = if *height < 0.0 { "lowest" } else { "highest" };
        notes.push(format!(
            "{count} points have the {end} height, several of them in a row: they are clipped, because the range of the \
             instrument ends there. Depth and volume are lower limits."
        ));
    }
    let mut scar = Scar { found, outwards, range: 0..0, core: Vec::new(), removed, added, beyond };
    if scar.removed.is_empty() && scar.added.is_empty() {
        let surface = &scar.found.surface;
        let [low, high] = range(&points.iter().map(|point| point.1).collect::<Vec<_>>());
        let is_one = surface.scatter < (ROUGH.0 * noise(points)).max(ROUGH.1 * (high - low));
        return Err(match window {
            None if surface.is_round && is_one => return Ok(scar),
            None if surface.is_round => format!("has no circle outside of a scar. {FARTHER}"),
            None => "has no scar: the whole surface is plane within its scatter".to_owned(),
            Some(_) => "has no scar between the ends of scar=, where nothing stands out of the scatter. Write other ends".into(),
        });
    }
    scar.check_sign(points, wanted)?;
    scar.choose_one(points, window, notes)?;
    Ok(scar)
}

/// Whether there are enough points between the ends of a scar, and beside them.
fn is_inside(points: &[(f64, f64)], [from, to]: [f64; 2]) -> bool {
    let count = |low: f64, high: f64| {
        points.iter().filter(|point| low <= point.0 && point.0 <= high).count()
    };
    let width = REACH * (to - from);
    [count(from, to), count(from - width, from), count(to, to + width)]
        .iter()
        .all(|it| *it >= BESIDE)
}

/// Whether a surface has a step that is many times the scatter.
fn is_step(surface: &Surface) -> bool {
    let (height, error) = surface.step();
    height.abs() > SURE * error && height.abs() > SURE * surface.scatter
}

/// A step of the unworn surface.
struct Step {
    x: f64,
    height: f64,
    /// The ends of the scar if the surface has this step.
    scar: [f64; 2],
}

impl Step {
    /// Finds a step: with it, many more points lie on the unworn surface.
    fn find(points: &[(f64, f64)], found: &Found, outwards: f64) -> Option<Self> {
        let thin = points.len().div_ceil(THIN);
        let thinned: Points = points.iter().step_by(thin).copied().collect();
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let count = |found: &Found| found.is_unworn.iter().filter(|is_unworn| **is_unworn).count();
        let before = count(found) as f64 / thin as f64;
        let width = (last - first) / STEPS;
        let tried = (1..STEPS as usize).map(|at| {
            let x = first + at as f64 * width;
            (x, parts::find(&thinned, None, Some([x - 1e-3 * width, x + 1e-3 * width])))
        });
        let (x, best) = tried.max_by_key(|(_, found)| count(found))?;
        let is_better = count(&best) as f64 > before + GAIN * thinned.len() as f64;
        if !is_better || !is_step(&best.surface) {
            return None;
        }
        let removed = best.parts.iter().filter(|part| part.area * outwards < 0.0);
        let largest = removed.max_by(|one, other| one.area.abs().total_cmp(&other.area.abs()))?;
        let Range { start, end } = largest.range;
        let scar = [thinned[start].0, thinned[end - 1].0];
        Some(Self { x, height: best.surface.step().0, scar })
    }
}

impl Scar {
    /// The ends of the scar in x.
    pub fn ends(&self, points: &[(f64, f64)]) -> Option<[f64; 2]> {
        let Range { start, end } = self.range;
        (start < end).then(|| [points[start].0, points[end - 1].0])
    }

    /// The points of a part of the trace between the first and the last of several neighbours that all exceed a depth.
    fn deeper(&self, range: &Range<usize>, depth: f64) -> Range<usize> {
        let run = (self.found.heights.len() / 50).clamp(RUN.0, RUN.1);
        let is_deep = |near: &[f64]| near.iter().all(|height| -self.outwards * height > depth);
        let windows = || self.found.heights[range.clone()].windows(run);
        match (windows().position(is_deep), windows().rposition(is_deep)) {
            (Some(first), Some(last)) => range.start + first..range.start + last + run,
            _ => range.clone(),
        }
    }

    /// Where the scar is deeper than a share of its largest depth, which noise at shallow ends moves little.
    pub fn middle(&self, points: &[(f64, f64)]) -> [f64; 2] {
        let Range { start, end } = self.deeper(&self.range, CORE * self.largest(&self.range));
        [points[start].0, points[end - 1].0]
    }

    fn largest(&self, range: &Range<usize>) -> f64 {
        range.clone().map(|at| -self.outwards * self.found.heights[at]).fold(0.0, f64::max)
    }

    /// Refuses more added than removed material.
    fn check_sign(&self, points: &[(f64, f64)], wanted: &Wanted<'_>) -> Result<(), String> {
        let Self { removed, added, .. } = self;
        if area(added) <= area(removed) {
            return Ok(());
        }
        let most = |parts: &[Part]| {
            let largest =
                parts.iter().max_by(|one, other| one.area.abs().total_cmp(&other.area.abs()));
            largest.map_or(String::new(), |part| format!(", most {}", place(points, &part.range)))
        };
        let other = if self.outwards > 0.0 { "in" } else { "out" };
        let mut more = String::new();
        if wanted.scar.is_none() {
            let choose = "If the scar is another part, choose it with scar=FROM..TO, such as scar=0.4..1.6mm";
            more = format!(". {choose}{}", self.farther(points));
        }
        Err(format!(
            "has more added than removed material: {:.4} um^2 lie above the unworn surface{}, and {:.4} um^2 below it{}. \
             If the heights count the other way, write up={other}{more}",
            UM * UM * area(added),
            most(added),
            UM * UM * area(removed),
            most(removed)
        ))
    }

    /// What to do if a part reaches to an end of the trace.
    fn farther(&self, points: &[(f64, f64)]) -> String {
        let end = points.len() / UNWORN;
        let parts = &self.found.parts;
        let largest = parts.iter().map(|part| part.area.abs()).fold(0.0, f64::max);
        let is_cut = |part: &Part| {
            let Range { start, end: after } = part.range;
            part.area.abs() > OTHER * largest && (start < end || after > points.len() - end)
        };
        if parts.iter().any(is_cut) { format!(". {FARTHER}") } else { String::new() }
    }

    /// Chooses the removed parts of one scar. Parts with a gap of at most half of the shorter one are one scar.
    fn choose_one(
        &mut self,
        points: &[(f64, f64)],
        window: Option<[f64; 2]>,
        notes: &mut Vec<String>,
    ) -> Result<(), String> {
        let mut groups: Vec<Vec<Part>> = Vec::new();
        for part in std::mem::take(&mut self.removed) {
            let is_near = groups.last().is_some_and(|group| {
                let gap = part.range.start.saturating_sub(all(group).end);
                window.is_some() || 2 * gap <= all(group).len().min(part.range.len())
            });
            match groups.last_mut().filter(|_| is_near) {
                Some(group) => group.push(part),
                None => groups.push(vec![part]),
            }
        }
        groups.sort_by(|one, other| area(other).total_cmp(&area(one)));
        let scar = all(&groups[0]);
        for group in &groups[1..] {
            let other = all(group);
            if area(group) > OTHER * area(&groups[0]) {
                let both = scar.start.min(other.start)..scar.end.max(other.end);
                return Err(format!(
                    "has two scars or more: {}, and {}. Choose one with {} or {}. If they are one ring, write {}{}",
                    place(points, &scar),
                    place(points, &other),
                    choice(points, &scar),
                    choice(points, &other),
                    choice(points, &both),
                    self.farther(points)
                ));
            }
            notes.push(format!(
                "Below the unworn surface, a part {} is not of the scar and was left out.",
                place(points, &other)
            ));
        }
        if window.is_none() {
            self.check_sides(points, &scar)?;
        }
        let depth = (SCATTER * self.found.surface.scatter).max(SHARE * self.largest(&scar));
        self.range = self.deeper(&scar, depth);
        self.removed = groups.swap_remove(0);
        self.core = self.removed.clone();
        for Part { range, .. } in &mut self.core {
            *range = range.start.max(self.range.start)..range.end.min(self.range.end);
        }
        self.core.retain(|part| !part.range.is_empty());
        Ok(())
    }

    /// Refuses a scar whose sides are not one plane or circle, or are not measured.
    fn check_sides(&self, points: &[(f64, f64)], scar: &Range<usize>) -> Result<(), String> {
        let (count, end) = (points.len(), points.len() / UNWORN);
        let [from, to] = [points[scar.start].0, points[scar.end - 1].0];
        let surface = Surface::through(points, &self.found.is_unworn, Some([from, to]));
        let own = Step { x: 0.5 * (from + to), height: surface.step().0, scar: [from, to] };
        let step = is_step(&surface).then_some(own);
        let step = step.or_else(|| Step::find(points, &self.found, self.outwards));
        let rises = step.map(|step| {
            format!(
                "an unworn surface that rises by {:.4} um near x = {:.4} mm. If the scar is there, this makes its depth \
                 uncertain. Choose the scar with scar=FROM..TO, such as {}",
                UM * step.height,
                1e3 * step.x,
                ends(step.scar)
            )
        });
        if scar.start < end || scar.end > count - end {
            let rises = rises.map_or(String::new(), |rises| format!(". Or it has {rises}"));
            return Err(format!(
                "has a scar that reaches to an end, {}. {FARTHER}{rises}",
                place(points, scar)
            ));
        }
        let area = self.found.parts.iter().filter(|part| scar.contains(&part.range.start));
        let area: f64 = area.map(|part| part.area.abs()).sum();
        let is_end = |part: &&Part| {
            part.area.abs() > OTHER * area && (part.range.start == 0 || part.range.end == count)
        };
        let at_end = self.found.parts.iter().find(is_end).map(|part| {
            format!(
                "an end that is not on the unworn surface, {}. Choose the scar with scar=FROM..TO, such as {}",
                place(points, &part.range),
                ends([from, to])
            )
        });
        rises.or(at_end).map_or(Ok(()), |told| Err(format!("has {told}")))
    }
}
