//! Which parts of a trace are the scar, and where the heights point. What is doubtful is refused with the parameter that decides.

use std::ops::Range;

use super::parts::{self, Found, Part, REACH, UNWORN};
use super::points::{clipped, limits, median, noise};
use super::surface::{Points, Surface};
use super::wanted::{Prepare, Up, Wanted};

/// A removed part with this share of the area of the scar is another scar.
const OTHER: f64 = 0.1;
/// The sides of a ring are alike within this share, in width and in area, and wider than their gap by this factor.
const RING: f64 = 0.7;
const NEAR: f64 = 1.05;
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
/// A gap is longer than this many times the usual distance, and this share of the scar. A gap of more than the second share
/// is refused.
const GAP: f64 = 1.7;
const TOLD: f64 = 0.02;
const HIDDEN: f64 = 0.4;
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
    /// The removed parts of the scar.
    pub removed: Vec<Part>,
    /// The parts above the unworn surface.
    pub added: Vec<Part>,
    /// Gaps, and points beyond the range of the instrument.
    pub gaps: Vec<Gap>,
}

/// A stretch whose heights are not known, or of which some are clipped.
#[derive(Debug, Clone)]
pub struct Gap {
    /// The points from its first end to the last one.
    pub range: Range<usize>,
    /// The standard deviation of their mean height.
    pub error: f64,
}

const UM: f64 = 1e6;
/// How a user chooses a scar.
const CHOOSE: &str = "choose it with scar=FROM..TO, such as scar=0.4..1.6mm";

/// What helps if too little is unworn.
fn farther(wanted: &Wanted<'_>) -> &'static str {
    if wanted.prepare == Prepare::Half {
        return "Measure farther: the last tenth must be unworn. If the trace has a tilt, remove it before, because half of a \
                tilted surface looks like a cone";
    }
    "Measure farther: at each end, a tenth of the trace must be unworn. If the trace begins at the axis, give the axis x = 0 \
     and write prepare=half (on the page: “Trace from the axis”; `fretwork fit` reads whole traces only)"
}

/// The first and the last position of some points.
pub fn ends(points: &[(f64, f64)], range: &Range<usize>) -> [f64; 2] {
    [points[range.start].0, points[range.end - 1].0]
}

/// A stretch as the parameter that chooses it.
fn named([from, to]: [f64; 2]) -> String {
    format!("scar={:.4}..{:.4}mm", 1e3 * from, 1e3 * to)
}

/// The points from the first part to the last one.
fn all(parts: &[Part]) -> Range<usize> {
    parts[0].range.start..parts[parts.len() - 1].range.end
}

fn area(parts: &[Part]) -> f64 {
    parts.iter().fold(0.0, |sum, part| sum + part.area.abs())
}

fn largest<'a>(parts: impl IntoIterator<Item = &'a Part>) -> Option<&'a Part> {
    parts.into_iter().max_by(|one, other| one.area.abs().total_cmp(&other.area.abs()))
}

/// The sign of heights out of the material. Only the curvature of a surface may decide without a word of the user: a hump on
/// a hollow surface is a scar of a ball whose heights count into it.
fn outwards(found: &Found, points: &Points, wanted: &Wanted<'_>, notes: &mut Vec<String>) -> f64 {
    let part = largest(&found.parts);
    let heights = part.map_or(&[][..], |part| &found.heights[part.range.clone()]);
    let [from, to] = ends(points, &(0..points.len()));
    let bow = 0.25 * found.surface.bend() * (to - from) * (to - from);
    let is_higher = heights.iter().all(|height| height.abs() < bow) && bow > 0.0;
    let is_turned = found.surface.is_round && is_higher && part.is_none_or(|part| part.area > 0.0);
    if wanted.up.is_none() && is_turned {
        let note = "The surface is a ball or cylinder if its heights point into the material, so they were turned. If it \
                    is hollow, write up=out.";
        notes.push(note.to_owned());
    }
    if wanted.up == Some(Up::In) || wanted.up.is_none() && is_turned { -1.0 } else { 1.0 }
}

/// Finds the scar.
///
/// # Errors
/// There is none, there are several, or the unworn surface is not one plane or circle.
pub fn scar(points: &Points, wanted: &Wanted<'_>, notes: &mut Vec<String>) -> Result<Scar, String> {
    let window = wanted.scar;
    let at = |end: f64| points.partition_point(|point| point.0 < end);
    if let Some([from, to]) = window {
        let width = REACH * (to - from);
        let counts = [from - width, from, to, to + width].map(at);
        if counts.windows(2).any(|pair| pair[1] < pair[0] + BESIDE) {
            let [first, last] = ends(points, &(0..points.len())).map(|end| 1e3 * end);
            return Err(format!(
                "has fewer than {BESIDE} points in or beside {}: x is from {first:.4} mm to {last:.4} mm. Write other ends",
                named([from, to])
            ));
        }
    }
    let mut found = parts::find(points, window, None);
    if let Some(window) = window {
        let stepped = parts::find(points, Some(window), Some(window));
        if is_step(&stepped.surface) {
            found = stepped;
            notes.push(format!(
                "The right side of the scar is {:.4} um higher than the left one. A line between both is the unworn \
                 surface. Half of the difference is in the errors: depth and volume are uncertain.",
                UM * found.surface.step().0
            ));
        }
        let [first, after] = window.map(at);
        found.parts = found.parts.iter().filter_map(|part| part.inside(&(first..after))).collect();
        let inside: usize = found.parts.iter().map(|part| part.range.len()).sum();
        // The user sees a scar that hardly stands out of the noise.
        if 2 * inside < after - first {
            found.parts = parts::whole(points, &found, first..after).into_iter().collect();
        }
    }
    let outwards = outwards(&found, points, wanted, notes);
    let is_added = |part: &Part| part.area * outwards > 0.0;
    let (added, removed): (Vec<_>, Vec<_>) = found.parts.iter().cloned().partition(is_added);
    let mut scar = Scar { found, outwards, range: 0..0, removed, added, gaps: Vec::new() };
    if scar.found.parts.is_empty() {
        let surface = &scar.found.surface;
        let [low, high] = limits(points);
        let is_one = surface.scatter < (ROUGH.0 * noise(points)).max(ROUGH.1 * (high - low));
        return match window {
            None if surface.is_round && is_one => Ok(scar),
            None if surface.is_round => {
                Err(format!("has no circle outside of a scar. {}", farther(wanted)))
            }
            None => Err(format!(
                "has no scar: the whole surface is plane within its scatter of {:.4} um. If you know where the scar is, {CHOOSE}",
                UM * surface.scatter
            )),
            Some(window) => Err(format!("has no scar in {}. Write other ends", named(window))),
        };
    }
    scar.check_sign(points, wanted)?;
    scar.choose_one(points, wanted, notes)?;
    scar.check_gaps(points, notes)?;
    Ok(scar)
}

/// Whether two parts are the sides of one ring: alike, and not further apart than their width.
fn is_ring(one: &[Part], other: &Part, gap: usize) -> bool {
    let (width, own) = (other.range.len() as f64, all(one).len() as f64);
    let is_alike = |one: f64, other: f64| one.min(other) > RING * one.max(other);
    NEAR * gap as f64 <= width.min(own)
        && is_alike(width, own)
        && is_alike(area(one), other.area.abs())
}

/// Whether a surface has a step that is many times the scatter.
fn is_step(surface: &Surface) -> bool {
    let (height, error) = surface.step();
    height.abs() > SURE * error && height.abs() > SURE * surface.scatter
}

impl Scar {
    /// The ends of the scar in x.
    pub fn ends(&self, points: &[(f64, f64)]) -> Option<[f64; 2]> {
        (!self.range.is_empty()).then(|| ends(points, &self.range))
    }

    /// The points between the first and the last of several neighbours that all exceed a depth, or a share of the largest.
    pub fn deeper(&self, range: &Range<usize>, depth: f64, share: f64) -> Range<usize> {
        let depths: Vec<f64> =
            self.found.heights[range.clone()].iter().map(|it| -self.outwards * it).collect();
        let limit = depths.iter().fold(depth, |most, depth| most.max(share * depth));
        let run = (self.found.heights.len() / 50).clamp(RUN.0, RUN.1);
        let is_deep = |near: &[f64]| near.iter().all(|depth| *depth > limit);
        let first = depths.windows(run).position(is_deep);
        let last = depths.windows(run).rposition(is_deep);
        let both = first.zip(last).map(|(first, last)| first..last + run);
        both.map_or(range.clone(), |own| range.start + own.start..range.start + own.end)
    }

    /// Where the scar is deeper than a share of its largest depth, which noise at shallow ends moves little.
    pub fn middle(&self, points: &[(f64, f64)]) -> [f64; 2] {
        ends(points, &self.deeper(&self.range, 0.0, CORE))
    }

    /// Refuses more added than removed material.
    fn check_sign(&self, points: &[(f64, f64)], wanted: &Wanted<'_>) -> Result<(), String> {
        if area(&self.added) <= area(&self.removed) {
            return Ok(());
        }
        let said = |parts: &[Part]| {
            let most = largest(parts).map(|part| ends(points, &part.range).map(|end| 1e3 * end));
            let most =
                most.map(|[from, to]| format!(", most from x = {from:.4} mm to {to:.4} mm,"));
            format!("{:.4} um^2{}", UM * UM * area(parts), most.unwrap_or_default())
        };
        let (above, below) = (said(&self.added), said(&self.removed));
        let other = if self.outwards > 0.0 { "in" } else { "out" };
        Err(format!(
            "has more added than removed material: {above} above the unworn surface, and {below} below it. If the heights \
             count the other way, write up={other}. If only a part is the scar, {CHOOSE}. If it \
             reaches to an end: {}",
            farther(wanted)
        ))
    }

    /// Chooses the removed parts of one scar. Parts with a gap of at most half of the shorter one are one
    /// scar, and so are the sides of a ring, whose middle sticks and does not wear.
    fn choose_one(
        &mut self,
        points: &[(f64, f64)],
        wanted: &Wanted<'_>,
        notes: &mut Vec<String>,
    ) -> Result<(), String> {
        let mut groups: Vec<Vec<Part>> = Vec::new();
        for part in std::mem::take(&mut self.removed) {
            let near = groups.last_mut().filter(|group| {
                let gap = part.range.start.saturating_sub(all(group).end);
                let (own, other) = (all(group).len(), part.range.len());
                let ends_of = |range: &Range<usize>| ends(points, range);
                // A half was mirrored.
                let [from, to] = [ends_of(&all(group))[0], ends_of(&part.range)[1]];
                let is_mirrored = wanted.prepare == Prepare::Half && (from + to).abs() < 0.05 * to;
                let is_one = wanted.scar.is_some() || is_mirrored || 2 * gap <= own.min(other);
                let is_ring = !is_one && is_ring(group, &part, gap);
                if is_ring {
                    let [one, other] = [all(group), part.range.clone()].map(|it| named(ends_of(&it)));
                    notes.push(format!(
                        "Two alike grooves near each other were taken as one ring. If they are two scars, choose one with {one} \
                         or {other}."
                    ));
                }
                is_one || is_ring
            });
            match near {
                Some(group) => group.push(part),
                None => groups.push(vec![part]),
            }
        }
        groups.sort_by(|one, other| area(other).total_cmp(&area(one)));
        let scar = all(&groups[0]);
        for group in &groups[1..] {
            let other = all(group);
            let [own, second] = [&scar, &other].map(|range| named(ends(points, range)));
            if area(group) > OTHER * area(&groups[0]) {
                let both = scar.start.min(other.start)..scar.end.max(other.end);
                return Err(format!(
                    "has two scars or more. Choose one with {own} or {second}. If they are one ring, write {}. If \
                     one reaches to an end: {}",
                    named(ends(points, &both)),
                    farther(wanted)
                ));
            }
            notes.push(format!("A smaller scar was left out. Write {second} for it."));
        }
        if wanted.scar.is_none() {
            self.check_sides(points, &scar, wanted)?;
        }
        self.range = self.deeper(&scar, SCATTER * self.found.surface.scatter, SHARE);
        self.removed = groups.swap_remove(0);
        Ok(())
    }

    /// Finds gaps in the scar and where its depth is clipped, and refuses a gap that hides too much. A line fills a gap. It may
    /// hide any height between those of its ends, and structures that are as deep as the gap is wide.
    fn check_gaps(&mut self, points: &[(f64, f64)], notes: &mut Vec<String>) -> Result<(), String> {
        let Range { start, end } = self.range;
        let [first, last] = ends(points, &self.range);
        let heights = &self.found.heights;
        let deepest = heights[start..end].iter().fold(0.0, |most: f64, it| most.max(it.abs()));
        let share = |range: &Range<usize>| {
            let [from, to] = ends(points, range);
            (to - from) / (to.max(last) - from.min(first))
        };
        let width = |at: &usize| points[at + 1].0 - points[*at].0;
        let all = start.saturating_sub(1)..end.min(points.len() - 1);
        let pace = median(all.clone().map(|at| width(&at)).collect());
        let ranges = all.filter(|at| width(at) > GAP * pace).map(|at| at..at + 2);
        let ranges: Vec<_> = ranges.filter(|range| share(range) > TOLD).collect();
        let said = |range: &Range<usize>| {
            let [from, to] = ends(points, range).map(|x| UM * x);
            format!("x = {from:.3} um to {to:.3} um")
        };
        if let Some(range) = ranges.iter().find(|range| share(range) > HIDDEN) {
            return Err(format!(
                "has no measured heights from {}, {:.0} % of the scar. Measure the trace again, with settings at which the \
                 instrument sees that part, or along another line",
                said(range),
                100.0 * share(range)
            ));
        }
        if !ranges.is_empty() {
            let said: Vec<String> = ranges.iter().map(said).collect();
            notes.push(format!(
                "The scar has gaps without measured heights: from {}. Lines fill them. The errors of depth, area and volume \
                 contain what they can hide.",
                said.join(", ")
            ));
        }
        let error = |range: &Range<usize>| {
            let hidden = share(range) * deepest;
            libm::hypot(heights[range.start] - heights[range.end - 1], hidden) / 12_f64.sqrt()
        };
        self.gaps = ranges.into_iter().map(|range| Gap { error: error(&range), range }).collect();
        if let Some((range, count, end)) = clipped(points) {
            notes.push(format!(
                "{count} points have the {end} height, several of them in a row: they are clipped, because the range of the \
                 instrument ends there. Depth and volume are lower limits."
            ));
            self.gaps.push(Gap { error: share(&range) * deepest, range });
        }
        Ok(())
    }

    /// Refuses a scar whose sides are not one plane or circle, or are not measured.
    fn check_sides(
        &self,
        points: &[(f64, f64)],
        scar: &Range<usize>,
        wanted: &Wanted<'_>,
    ) -> Result<(), String> {
        let (count, end, own) = (points.len(), points.len() / UNWORN, ends(points, scar));
        let surface = Surface::through(points, &self.found.is_unworn, Some(own), 0.0);
        let step = is_step(&surface).then(|| (surface.step().0, 0.5 * (own[0] + own[1]), own));
        let told = step.or_else(|| self.step(points)).map(|(height, x, scar)| {
            format!(
                "an unworn surface that rises by {:.4} um near x = {:.4} mm. If the scar is there, its depth is uncertain. \
                 Choose the scar with scar=FROM..TO, such as {}",
                UM * height,
                1e3 * x,
                named(scar)
            )
        });
        if scar.start < end || scar.end > count - end {
            let told = told.map_or_else(String::new, |told| format!(". Or it has {told}"));
            return Err(format!(
                "has a scar that reaches to an end: {}. If it is narrower, {CHOOSE}. {}{told}",
                named(own),
                farther(wanted)
            ));
        }
        told.map_or(Ok(()), |told| Err(format!("has {told}")))
    }

    /// The height and the place of a step of the unworn surface, and the ends of the scar that the surface then has: with the
    /// step, many more points are unworn.
    fn step(&self, points: &[(f64, f64)]) -> Option<(f64, f64, [f64; 2])> {
        let thin = points.len().div_ceil(THIN);
        let thinned: Points = points.iter().step_by(thin).copied().collect();
        let [first, last] = ends(points, &(0..points.len()));
        let width = (last - first) / STEPS;
        let tried = (1..STEPS as usize).map(|at| {
            let x = first + at as f64 * width;
            (x, parts::find(&thinned, None, Some([x - 1e-3 * width, x + 1e-3 * width])))
        });
        let (x, best) = tried.max_by_key(|(_, found)| found.unworn())?;
        let more = best.unworn() as f64 - self.found.unworn() as f64 / thin as f64;
        let is_better = more > GAIN * thinned.len() as f64 && is_step(&best.surface);
        let removed = best.parts.iter().filter(|part| part.area * self.outwards < 0.0);
        let scar = largest(removed).filter(|_| is_better)?;
        Some((best.surface.step().0, x, ends(&thinned, &scar.range)))
    }
}
