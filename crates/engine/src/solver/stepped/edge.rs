//! The contact radius over time, for the exact law.
//!
//! The edge of the contact lies somewhere within a spring of finite width. Its position is known
//! best at the time when the next spring comes into contact. So the radius is computed at these
//! times, and interpolated between them. During a rest it is constant.
//!
//! # Equations
//! ```text
//! Σ D y over the two springs around the edge = s_in·l_in²/2 − s_out·l_out²/2
//! ```
//! Here y = d − g is signed, and y is linear on each side of the edge, with the slopes s of the next
//! springs. l are the distances of the edge from the outer ends of the two springs. Late in a run
//! the springs inside the edge carry almost no load, and the radius follows from the wear.
//!
//! # Accuracy
//! VERIFICATION.md compares random runs with fine ones.

use super::{MeshRun, Wearing};
use crate::numeric::{Monotone, root};

/// The radius is the mean of an estimate from the springs and an estimate from the wear. Both estimates have the same
/// weight if the slope of y inside the edge is this share of the slope in the unworn contact.
const FLAT: f64 = 0.2;
/// Below this weight of the estimate from the springs, the radius is taken from the wear only.
const WORN: f64 = 0.5;
/// The radius that follows from the wear is recorded again when the time has grown by this factor.
const PAUSE: f64 = 1.15;
/// At first the contact radius grows about like this power of the time.
const GROWTH: f64 = 0.75;

/// The radius at the times when springs came into contact.
#[derive(Debug, Default)]
pub(super) struct ContactEdge {
    /// Pairs of time and radius, both ascending.
    known: Vec<(f64, f64)>,
    /// The outer radius of the outermost spring that has been in contact.
    reached: f64,
}

impl ContactEdge {
    pub(super) fn new(run: &MeshRun) -> Self {
        let mesh = &run.wearing.springs.mesh;
        let reached = mesh.radii[run.wearing.springs.compressions.len()];
        Self { known: vec![(0.0, 1.0)], reached }
    }

    /// Records the radius if springs came into contact in the last step.
    pub(super) fn follow(&mut self, run: &mut MeshRun) {
        if run.rests {
            // Nothing wears until the next block, so the radius is constant.
            let least = self.known.last().map_or(1.0, |(_, radius)| *radius);
            let radius = run.wearing.worn_radius(&run.wearing.wear(&run.rkc.values)).max(least);
            self.learn(run.rkc.began(), radius);
            self.learn(run.rkc.time, radius);
            return;
        }
        let springs = &run.wearing.springs;
        let loaded = springs.compressions.len();
        let radii = &springs.mesh.radii;
        if radii[loaded] > self.reached {
            // The mesh of a later block can begin outside this radius.
            let first = radii.partition_point(|r| *r <= self.reached).saturating_sub(1);
            self.reached = radii[loaded];
            for spring in first..loaded {
                self.touch(run, spring);
            }
        }
        let (wearing, time) = (&run.wearing, run.rkc.time);
        let wear = &wearing.wear(&run.rkc.values);
        let last = self.known.last().map_or(0.0, |(last, _)| *last);
        let worn = self.present(wearing, wear).is_none_or(|edge| edge.share < WORN);
        if worn && time > PAUSE * last {
            self.learn(time, wearing.worn_radius(wear));
        }
    }

    /// Records the radius at the time in the last step at which a spring came into contact.
    fn touch(&mut self, run: &mut MeshRun, spring: usize) {
        let (began, time) = (run.rkc.began(), run.rkc.time);
        let mut at =
            |time| run.under(time, |wearing, values| gap(wearing, &wearing.wear(values), spring));
        let (before, after) = (at(began), at(time));
        if after <= 0.0 {
            // The spring is not in contact: only springs further out are.
            return;
        }
        let share = if before < 0.0 { before / (before - after) } else { 0.0 };
        let then = began + share * (time - began);
        let found = run.under(then, |wearing, values| {
            let wear = &wearing.wear(values);
            let edge = Edge::around(wearing, wear, spring).filter(|edge| edge.share >= WORN)?;
            Some(edge.radius(wearing.worn_radius(wear)))
        });
        if let Some(radius) = found {
            self.learn(then, radius);
        }
    }

    /// The present edge. `None` if the springs do not determine it, or if the outermost springs have
    /// lost contact again, because they carry almost no load then.
    fn present<'a>(&self, wearing: &'a Wearing, wear: &[f64]) -> Option<Edge<'a>> {
        let springs = &wearing.springs;
        let next = springs.compressions.len();
        let receded = springs.mesh.radii[next] < self.reached;
        if receded { None } else { Edge::around(wearing, wear, next) }
    }

    fn learn(&mut self, time: f64, radius: f64) {
        if self.known.last().is_some_and(|(last, least)| time > *last && radius >= *least) {
            self.known.push((time, radius));
        }
    }

    /// The radius at each of the given times, which are not later than the present time of the run.
    pub(super) fn radii(&mut self, run: &mut MeshRun, times: &[f64]) -> Vec<f64> {
        let now = times.last().map_or(0.0, |last| run.within(*last));
        let last = run.under(now, |wearing, values| {
            let wear = &wearing.wear(values);
            let worn = wearing.worn_radius(wear);
            self.present(wearing, wear).map_or(worn, |edge| edge.radius(worn))
        });
        self.learn(now, last);
        let (knots, values) =
            self.known.iter().map(|(time, radius)| (libm::pow(*time, GROWTH), *radius)).unzip();
        let curve = Monotone::through(knots, values);
        let end = self.known.last().map_or(0.0, |(time, _)| *time);
        times.iter().map(|time| curve.at(libm::pow(time.min(end), GROWTH))).collect()
    }
}

/// The signed mean compression d − g of a spring.
fn gap(wearing: &Wearing, wear: &[f64], spring: usize) -> f64 {
    let springs = &wearing.springs;
    let mesh = &springs.mesh;
    let known = springs.images.get(spring).copied();
    springs.depth - known.unwrap_or_else(|| mesh.initial[spring] + mesh.image(spring, wear))
}

/// The four springs around the edge of the contact. y is positive in the innermost and negative in
/// the outermost.
struct Edge<'a> {
    radii: &'a [f64],
    /// The first spring outside the contact.
    next: usize,
    /// The compressions d − g of the springs from `next` − 2 to `next` + 1.
    gaps: [f64; 4],
    /// The weight, from 0 to 1, of the radius that follows from the springs. The radius that follows from the wear has
    /// the rest of the weight.
    share: f64,
}

impl<'a> Edge<'a> {
    /// `None` if the springs do not determine the edge.
    fn around(wearing: &'a Wearing, wear: &[f64], next: usize) -> Option<Self> {
        let radii = &wearing.springs.mesh.radii;
        if next < 2 || next + 2 >= radii.len() {
            return None;
        }
        let gaps: [f64; 4] = std::array::from_fn(|i| gap(wearing, wear, next + i - 2));
        let [inside, .., outside] = gaps;
        if inside <= 0.0 || outside >= 0.0 {
            return None;
        }
        let slope = inside / (radii[next] - radii[next - 2]);
        let share = slope / (slope + FLAT * wearing.contact.shape.image_slope(1.0));
        Some(Self { radii, next, gaps, share })
    }

    /// The radius at which y = 0, weighted with the radius `worn` that follows from the wear.
    fn radius(&self, worn: f64) -> f64 {
        let Self { radii, next, gaps: [inside, y_low, y_high, outside], share } = *self;
        let middle = |spring: usize| 0.5 * (radii[spring] + radii[spring + 1]);
        let (low, high) = (radii[next - 1], radii[next + 1]);
        let sum = (radii[next] - low) * y_low + (high - radii[next]) * y_high;
        let excess = |a: f64| {
            let (within, beyond) = (a - low, high - a);
            0.5 * inside * within * within / (a - middle(next - 2))
                + 0.5 * outside * beyond * beyond / (middle(next + 1) - a)
                - sum
        };
        if excess(low) >= 0.0 || excess(high) <= 0.0 {
            return worn;
        }
        share * root(low, high, excess) + (1.0 - share) * worn
    }
}
