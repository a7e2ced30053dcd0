//! Which parts of a trace are the scar, and where the heights point. What is doubtful is refused with the parameter that decides.

use std::ops::Range;

use super::parts::{BESIDE, Part, PreparedTrace, UNWORN, fewest, find, largest, named};
use super::points::{Points, clipped, jumps, limits, noise};
use super::surface::{Flaw, Surface};
use super::wanted::{Prepare, Up, Wanted};
use crate::curve::median;
use crate::notes::Notes;

/// A removed part with this share of the area of the scar is another scar.
const OTHER: f64 = 0.1;
/// The areas of both sides of a ring are alike within this share, and each side is wider than their gap by this factor.
const RING: f64 = 0.7;
const NEAR: f64 = 1.05;
/// A step is searched at this many places less one, on at most this many points. With one beside the scar, this share more of the
/// points are unworn than with one in the scar.
const STEPS: f64 = 16.0;
const THIN: usize = 500;
const GAIN: f64 = 0.04;
/// Without a scar, a surface is no circle if it scatters by this many times the noise and this share of its height.
const ROUGH: (f64, f64) = (10.0, 0.01);
/// A surface with an edge counts if it scatters by no more than this many times what the surface without it does, and so large a share
/// of the points is unworn.
const ALSO: (f64, f64) = (1.25, 0.75);
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
/// A note names jumps of the heights by more than this share of the largest depth, at most at this many places.
const JUMP: f64 = 0.05;
const MOST: usize = 4;
/// The core of a scar is deeper than this share of the largest depth.
const CORE: f64 = 0.1;

const UM: f64 = 1e6;
/// How a user chooses a scar.
pub const CHOOSE: &str = "choose it with scar=FROM..TO, such as scar=0.4..1.6mm";

/// The scar of a trace whose heights point out of the material.
pub struct Scar {
    /// The trace, and all its parts.
    pub trace: PreparedTrace,
    /// Other unworn surfaces that the points allow: from the nearer half of them, which a long wave makes another one, and with an
    /// edge in the middle of the scar, if there may be one.
    others: Vec<Surface>,
    /// The points between the ends of the scar. Empty if there is none.
    pub range: Range<usize>,
    /// The removed parts of the scar.
    pub removed: Vec<Part>,
    /// The parts above the unworn surface.
    pub added: Vec<Part>,
    /// Gaps in the scar, and where its depth is clipped.
    pub gaps: Vec<Gap>,
}

/// A stretch whose heights are not known, or of which some are clipped.
pub struct Gap {
    /// The points from its first end to the last one.
    pub range: Range<usize>,
    /// The standard deviation of their mean height.
    pub error: f64,
}

/// What helps if too little is unworn.
fn farther(wanted: &Wanted<'_>) -> &'static str {
    if wanted.prepare == Prepare::Half {
        return "Measure farther: the last tenth must be unworn";
    }
    "Measure farther: at each end, a tenth of the trace must be unworn. If the trace begins at the axis, give the axis x = 0 \
     and write prepare=half (on the page: “Trace from the axis”; `fretwork fit` reads whole traces only)"
}

/// The unworn surface on both sides of a stretch, and the parts in it.
fn between(points: &Points, is_half: bool, ends: [f64; 2]) -> Result<PreparedTrace, String> {
    let [from, to] = ends;
    let at = |end: f64| points.partition_point(|point| point.0 < end);
    let [before, first, after, last] = [2.0 * from - to, from, to, 2.0 * to - from].map(at);
    if (first - before).min(after - first).min(last - after) < BESIDE {
        let [first, last] = [points[0].0, points[points.len() - 1].0].map(|end| 1e3 * end);
        return Err(format!(
            "has fewer than {BESIDE} points in or beside {}: x is from {first:.4} mm to {last:.4} mm. Write other ends",
            named(ends)
        ));
    }
    let mut trace = find(points, is_half, Some(ends), Some(Flaw::Step(ends)));
    trace.parts = trace.inside(&trace.parts, &(first..after));
    // The user sees a scar that hardly stands out of the noise.
    if 2 * trace.parts.iter().map(|part| part.range.len()).sum::<usize>() < after - first {
        let whole = Some(trace.part(first..after));
        trace.parts = whole.filter(|part| trace.is_sure(part)).into_iter().collect();
    }
    if trace.parts.is_empty() {
        return Err(format!("has no scar in {}. Write other ends", named(ends)));
    }
    Ok(trace)
}

/// Refuses a surface without a scar that is no circle.
fn check_round(trace: &PreparedTrace, wanted: &Wanted<'_>) -> Result<(), String> {
    let ([low, high], scatter) = (limits(&trace.points), trace.surface.scatter);
    if !trace.surface.is_round {
        return Err(format!(
            "has no scar: the whole surface is plane within its scatter of {:.4} um. If you know where the scar is, {CHOOSE}",
            UM * scatter
        ));
    }
    if scatter > (ROUGH.0 * noise(&trace.points)).max(ROUGH.1 * (high - low)) {
        return Err(format!("has no circle outside of a scar. {}", farther(wanted)));
    }
    Ok(())
}

/// Finds the scar.
///
/// # Errors
/// There is none, there are several, or the unworn surface is not one plane or circle.
pub fn scar(mut points: Points, wanted: &Wanted<'_>, notes: &mut Notes) -> Result<Scar, String> {
    if wanted.up == Some(Up::In) {
        points = points.into_iter().map(|(x, z)| (x, -z)).collect();
    }
    let is_half = wanted.prepare == Prepare::Half;
    let trace = match wanted.scar {
        Some(ends) => between(&points, is_half, ends)?,
        None => find(&points, is_half, None, None),
    };
    // Only the curvature of a surface may decide without a word of the user: a hump on a hollow surface is a scar of a ball
    // whose heights count into it.
    let is_hump = largest(&trace.parts).is_none_or(|part| part.area < 0.0);
    if wanted.up.is_none() && trace.surface.is_round && trace.surface.bend() > 0.0 && is_hump {
        let note = "The surface is a ball or cylinder if its heights point into the material, so they were turned. If it \
                    is hollow, write up=out.";
        notes.push(note.to_owned());
        return scar(trace.points, &Wanted { up: Some(Up::In), ..*wanted }, notes);
    }
    if let Some(step) = trace.surface.step() {
        notes.push(format!(
            "The right side of the scar is {:.4} um {} than the left one. A line between both is the unworn surface. Half of \
             the difference is in the errors: depth and volume are uncertain.",
            UM * step.abs(),
            if step > 0.0 { "higher" } else { "lower" }
        ));
    }
    let (added, removed) = trace.parts.iter().cloned().partition(|part| part.area < 0.0);
    let (range, others, gaps) = (0..0, Vec::new(), Vec::new());
    let mut scar = Scar { trace, others, range, removed, added, gaps };
    if scar.trace.parts.is_empty() {
        check_round(&scar.trace, wanted)?;
        return Ok(scar);
    }
    scar.check_sign(wanted)?;
    scar.choose(wanted, notes)?;
    scar.check_gaps(notes)?;
    scar.tell_jumps(notes);
    Ok(scar)
}

/// The points from the first part to the last one.
fn whole(parts: &[Part]) -> Range<usize> {
    parts[0].range.start..parts[parts.len() - 1].range.end
}

/// The area of parts.
fn area(parts: &[Part]) -> f64 {
    parts.iter().map(|part| part.area).sum()
}

impl Scar {
    /// The ends of the scar in x.
    pub fn ends(&self) -> Option<[f64; 2]> {
        (!self.range.is_empty()).then(|| self.trace.ends(&self.range))
    }

    /// The standard deviation of a sum of heights, each with its weight: from the scatter, and from the unworn surface.
    pub fn error(&self, weights: &(impl Iterator<Item = (f64, f64)> + Clone)) -> [f64; 2] {
        let surface = &self.trace.surface;
        let shift = |other: &Surface| {
            weights.clone().map(|(x, own)| own * (other.at(x) - surface.at(x))).sum()
        };
        let shift = self.others.iter().map(shift).fold(0.0, libm::hypot);
        let [scatter, fitted] = surface.error(weights.clone());
        [scatter, libm::hypot(fitted, shift)]
    }

    /// The points between the first and the last of several neighbours that are all deeper than a limit.
    fn deeper(&self, range: &Range<usize>, limit: f64) -> Range<usize> {
        let run = (self.trace.points.len() / 50).clamp(RUN.0, RUN.1);
        let mut near = self.trace.depths[range.clone()].windows(run);
        let is_deep = |near: &[f64]| near.iter().all(|depth| *depth > limit);
        let Some(first) = near.clone().position(is_deep) else { return range.clone() };
        let last = near.rposition(is_deep).unwrap_or(first);
        range.start + first..range.start + last + run
    }

    /// The largest depth of a single point.
    fn deepest(&self, range: &Range<usize>) -> f64 {
        self.trace.depths[range.clone()].iter().copied().fold(0.0, f64::max)
    }

    /// Where the scar is deeper than a share of its largest depth, which noise at shallow ends moves little.
    pub fn middle(&self) -> [f64; 2] {
        self.trace.ends(&self.deeper(&self.range, CORE * self.deepest(&self.range)))
    }

    /// Refuses more added than removed material.
    fn check_sign(&self, wanted: &Wanted<'_>) -> Result<(), String> {
        let [above, below] = [&self.added, &self.removed].map(|it| UM * UM * area(it).abs());
        let Some(most) = largest(&self.added).filter(|_| above > below) else { return Ok(()) };
        let (most, farther) = (self.trace.named(&most.range), farther(wanted));
        let other = if wanted.up == Some(Up::In) { "out" } else { "in" };
        Err(format!(
            "has more added than removed material: {above:.4} um^2 above the unworn surface, most in {most}, and {below:.4} \
             um^2 below it. If the heights count the other way, write up={other}. If only a part is the scar, {CHOOSE}. If \
             it reaches to an end: {farther}"
        ))
    }

    /// Whether two neighbouring parts are one scar: their gap is at most half of the shorter one, or they are the sides of a
    /// ring, whose middle sticks and does not wear.
    fn is_one(&self, last: &Part, part: &Part, wanted: &Wanted<'_>, notes: &mut Notes) -> bool {
        let (one, other) = (&last.range, &part.range);
        let gap = other.start.saturating_sub(one.end) as f64 / one.len().min(other.len()) as f64;
        let [from, to] = self.trace.ends(&(one.start..other.end));
        // A half was mirrored.
        let is_mirrored = wanted.prepare == Prepare::Half && (from + to).abs() < 0.05 * to;
        if wanted.scar.is_some() || is_mirrored {
            return true;
        }
        let are_alike = (last.area / part.area).min(part.area / last.area) > RING;
        if gap <= 0.5 && !are_alike {
            return true;
        }
        let is_ring = NEAR * gap <= 1.0 && are_alike;
        if is_ring {
            let [one, other] = [one, other].map(|range| self.trace.named(range));
            notes.push(format!(
                "Two alike grooves near each other were taken as one ring. If they are two scars, choose one with {one} or {other}."
            ));
        }
        is_ring
    }

    /// Chooses the removed parts of one scar.
    fn choose(&mut self, wanted: &Wanted<'_>, notes: &mut Notes) -> Result<(), String> {
        let mut scars: Vec<&[Part]> =
            self.removed.chunk_by(|last, part| self.is_one(last, part, wanted, notes)).collect();
        scars.sort_by(|one, other| area(other).total_cmp(&area(one)));
        let Some((own, others)) = scars.split_first() else { return Ok(()) };
        let all = whole(own);
        for other in others {
            let two = whole(other);
            let both = all.start.min(two.start)..all.end.max(two.end);
            let [one, two, both] = [&all, &two, &both].map(|range| self.trace.named(range));
            if area(other) > OTHER * area(own) {
                return Err(format!(
                    "has two scars or more. Choose one with {one} or {two}. If they are one ring, write {both}. If one reaches \
                     to an end: {}",
                    farther(wanted)
                ));
            }
            notes.push(format!("A smaller scar was left out. Write {two} for it."));
        }
        let least = (SCATTER * self.trace.surface.scatter).max(SHARE * self.deepest(&all));
        (self.range, self.removed) = (self.deeper(&all, least), own.to_vec());
        let [from, to] = self.trace.ends(&all);
        let bent = self.again(wanted.scar, Flaw::Edge(0.5 * (from + to)));
        let is_other = bent.surface.is_bent()
            && bent.surface.scatter < ALSO.0 * self.trace.surface.scatter
            && bent.unworn_share() > ALSO.1 * self.trace.unworn_share();
        let nearer = self.trace.nearer(&all);
        self.others = is_other.then_some(bent.surface).into_iter().chain([nearer]).collect();
        if wanted.scar.is_none() {
            return self.check_sides(wanted);
        }
        self.tell_ends(wanted, notes);
        Ok(())
    }

    /// Says where the scar goes on beyond an end that the user chose.
    fn tell_ends(&self, wanted: &Wanted<'_>, notes: &mut Notes) {
        let least = CORE * self.deepest(&self.range);
        // A half was mirrored.
        let first = self.range.start.checked_sub(1).filter(|_| wanted.prepare != Prepare::Half);
        for at in first.into_iter().chain([self.range.end]) {
            if let Some(depth) = self.trace.depths.get(at).filter(|depth| **depth > least) {
                let (x, depth) = (UM * self.trace.points[at].0, UM * depth);
                notes.push(format!(
                    "At x = {x:.3} um, an end of scar=FROM..TO, the surface is {depth:.4} um below the unworn one. If the scar \
                     goes on there, area and volume are too small: write ends outside of it."
                ));
            }
        }
    }

    /// Finds gaps in the scar and where its depth is clipped, and refuses a gap that hides too much. A line fills a gap. It may
    /// hide any height between those of its ends, and structures that are as deep as the gap is wide.
    fn check_gaps(&mut self, notes: &mut Notes) -> Result<(), String> {
        let PreparedTrace { points, depths, .. } = &self.trace;
        let ([first, last], deepest) = (self.trace.ends(&self.range), self.deepest(&self.range));
        let width = |at: &usize| points[at + 1].0 - points[*at].0;
        let all = self.range.start.saturating_sub(1)..self.range.end.min(points.len() - 1);
        let pace = median(all.clone().map(|at| width(&at)));
        let mut told = Vec::new();
        for at in all.filter(|at| width(at) > (GAP * pace).max(TOLD * (last - first))) {
            let [from, to] = [points[at].0, points[at + 1].0];
            let share = (to - from) / (to.max(last) - from.min(first));
            let place = format!("x = {:.3} um to {:.3} um", UM * from, UM * to);
            if share > HIDDEN {
                return Err(format!(
                    "has no measured heights from {place}, {:.0} % of the scar. Measure the trace again, with settings at which \
                     the instrument sees that part, or along another line",
                    100.0 * share
                ));
            }
            told.push(place);
            let error = libm::hypot(depths[at + 1] - depths[at], share * deepest) / 12_f64.sqrt();
            self.gaps.push(Gap { range: at..at + 2, error });
        }
        if !told.is_empty() {
            notes.push(format!(
                "The scar has gaps without measured heights: from {}. Lines fill them. The errors of depth, area and volume \
                 contain what they can hide.",
                told.join(", ")
            ));
        }
        if let Some((range, count, end)) = clipped(points) {
            notes.push(format!(
                "{count} points have the {end} height, several of them in a row: they are clipped, because the range of the \
                 instrument ends there. Depth and volume are lower limits."
            ));
            let [from, to] = self.trace.ends(&range);
            self.gaps.push(Gap { range, error: 0.5 * (to - from) / (last - first) * deepest });
        }
        Ok(())
    }

    /// Says where the heights jump.
    fn tell_jumps(&self, notes: &mut Notes) {
        let points = &self.trace.points;
        let jumps = jumps(points, JUMP * self.deepest(&self.range));
        let place = |at: &usize| format!("{:.3} um", UM * points[*at].0);
        let places: Vec<String> = jumps.iter().take(MOST).map(place).collect();
        if !places.is_empty() {
            notes.push(format!(
                "The heights jump near x = {}. If the instrument joined images there, depth, area and volume are wrong: measure \
                 the scar and both sides in one image. If the indenter has an edge there, the numbers are right.",
                places.join(", ")
            ));
        }
    }

    /// Refuses a scar whose sides are not one plane or circle, or are not measured.
    fn check_sides(&self, wanted: &Wanted<'_>) -> Result<(), String> {
        let ([from, to], [first, last]) =
            (self.trace.ends(&self.range), self.trace.ends(&self.trace.all()));
        let (step, count) = (self.step(), self.trace.points.len());
        let is_short = (from - first).min(last - to) < (last - first) / UNWORN as f64;
        if is_short || self.range.start.min(count - self.range.end) < fewest(count) {
            let (own, farther) = (self.trace.named(&self.range), farther(wanted));
            let step = step.map_or_else(String::new, |step| format!(". Or it has {step}"));
            return Err(format!(
                "has a scar that reaches to an end: {own}. If it is narrower, {CHOOSE}. {farther}{step}"
            ));
        }
        step.map_or(Ok(()), |step| Err(format!("has {step}")))
    }

    /// The trace with fewer points, if its unworn surface may have a flaw.
    fn again(&self, window: Option<[f64; 2]>, flaw: Flaw) -> PreparedTrace {
        let PreparedTrace { points, surface, .. } = &self.trace;
        let thin = points.len().div_ceil(THIN);
        let points = points.iter().step_by(thin).copied().collect();
        find(&points, surface.is_half, window, Some(flaw))
    }

    /// A step of the unworn surface, and the scar that the surface then has. It is where most of the points are unworn.
    fn step(&self) -> Option<String> {
        let [first, last] = self.trace.ends(&self.trace.all());
        let width = (last - first) / STEPS;
        let places = (1..STEPS as usize).map(|at| first + at as f64 * width);
        let beside = places.map(|x| ([x - 1e-3 * width, x + 1e-3 * width], GAIN));
        let tried = beside.chain(self.ends().map(|own| (own, 0.0))).map(|(edge, gain)| {
            let trace = self.again(None, Flaw::Step(edge));
            (trace.unworn_share() - gain, edge, trace)
        });
        let (_, [from, to], best) = tried.max_by(|one, other| one.0.total_cmp(&other.0))?;
        let scar = largest(best.parts.iter().filter(|part| part.area > 0.0))?;
        Some(format!(
            "an unworn surface that rises by {:.4} um near x = {:.4} mm. If the scar is there, its depth is uncertain. \
             Choose the scar with scar=FROM..TO, such as {}",
            UM * best.surface.step()?,
            0.5e3 * (from + to),
            best.named(&scar.range)
        ))
    }
}
