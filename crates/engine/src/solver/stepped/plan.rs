//! Plans a mesh: the positions of the nodes and the outer radius. The plan depends on the held
//! quantities.

use super::law::{Law, WearProblem};
use crate::contact::control::critical_stick;
use crate::contact::course::Moment;
use crate::contact::{Contact, Control, Final, Geometry, Held, Limit, Normal};
use crate::numeric::{integrate_beyond, root};

/// Blur of the nodes if the stick edge moves inwards, in widths of the wearing ring.
const BLUR: f64 = 0.003;
/// A stick edge that moves inwards by less than this share of the last scar radius is taken as fixed.
const FIXED: f64 = 0.001;
/// Distance of the nodes where a stick edge comes to rest at the start of the mesh, as a share of their distance where it
/// begins to move. All that is lost late in a run is lost there.
const TIGHT: f64 = 0.3;
/// Blur of the nodes if the stick edge comes to rest in worn material.
pub(super) const REST_BLUR: f64 = 0.001;
/// Blur of the nodes at the stick edge of an earlier block, in widths of the mesh, and their share of all nodes.
const OLD_BLUR: f64 = 1e-3;
const OLD_SHARE: f64 = 0.2;
/// Blur of the nodes at a sharp tip or edge.
const SHARP_BLUR: f64 = 1e-4;
/// A ring is thin if it is narrower than this share of the mesh. In a thin ring, the distance of the nodes grows much
/// more slowly than outside, and the blur is at most a share of the width of the ring.
const THIN: f64 = 0.05;
const THIN_BLUR: f64 = 0.25;
/// Where the stick edge moves over many widths of the ring, all of its range needs cells.
const MOVES: f64 = 100.0;
/// Maximum width of the first cell at a fixed stick edge, in c/n². In a wide ring the nodes are
/// graded more steeply.
const COARSE_START: f64 = 1500.0;
/// If the ratio of the last to the first scar radius exceeds this number, the mesh starts small and
/// grows. Otherwise the unworn contact would lie in only a few cells of the last mesh.
pub const FAR: f64 = 2.0;
/// A mesh that is full grows by this factor.
pub(super) const EXTENSION: f64 = 1.25;
/// Minimum radius of a core at constant force, in first scar radii. The plan neglects a smaller
/// core.
const LEAST_CORE: f64 = 1e-4;
/// At constant depth, a core vanishes soon after it has shrunk to this share of the critical
/// radius.
const GIVES_WAY: f64 = 0.8;

/// The positions of the mesh nodes. Where the stick edge moves they are evenly spaced, or their
/// distance grows evenly from a place of rest at the start. Away from there their distances increase: r = edge ± ((u/2 + √blur)² − blur). Without a focus all nodes
/// are evenly spaced.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshPlan {
    /// The first node r₀. Nothing wears inside it.
    pub start: f64,
    /// The last node at the start of the run.
    pub reach: f64,
    /// The last node at the end of the run. It is infinite if it is not known.
    pub farthest: f64,
    /// The radii where nodes are dense. `None` if the nodes are evenly spaced.
    pub focus: Option<Focus>,
    /// The stick edge of an earlier block, where nodes are dense too.
    pub old_edge: Option<f64>,
    /// The width of the ring at the focus in which the unworn contact wears most. It is infinite if all of the mesh is
    /// in the ring.
    pub ring: f64,
}

/// The range of radii where nodes are dense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Focus {
    /// The innermost radius at which the stick edge is expected.
    pub from: f64,
    /// The outermost radius at which the stick edge is expected.
    pub to: f64,
    /// A smaller blur gives denser nodes. It is 0 for a stick edge that stays at the start of the
    /// mesh.
    pub blur: f64,
}

impl Focus {
    /// The focus at a fixed stick edge.
    fn at(radius: f64) -> Self {
        Self { from: radius, to: radius, blur: 0.0 }
    }
}

impl MeshPlan {
    /// Plans the mesh before the run, from the quantities that are held constant.
    ///
    /// `None` if the scar would become larger than the shape.
    pub fn first(contact: &Contact, control: &Control, cells: usize) -> Option<Self> {
        let shape = &contact.shape;
        // Each block has a mesh of its own.
        let least = if control.varies() && !contact.changes_friction() {
            contact.stick
        } else {
            control.least_stick(contact)
        };
        let end = control.tends_to(contact);
        // Cells next to a moving stick edge are wider than cells next to a fixed one.
        let shrinks = matches!(control.held(), Held::Force(_) | Held::Rig { .. })
            && control.normal == Normal::Depth;
        let last = match end {
            Some(end) => end.limit.radius,
            None if least.total_cmp(&contact.stick).is_eq() => contact.limit.radius,
            None => match Limit::solve(shape, least) {
                Some(limit) => limit.radius,
                // The limiting scar is larger than the indenter, but the scar may stay smaller during
                // the run. Otherwise the run ends when the scar reaches the edge of the indenter.
                // A line contact without a core has no limiting scar.
                None if control.drifts(contact) && shape.extent().is_infinite() => {
                    contact.limit.radius
                }
                None if control.drifts(contact) => shape.extent(),
                None => return None,
            },
        };
        let shrinks = shrinks && contact.stick - least > FIXED * last;
        // The plan neglects a core that is smaller than the first cells, because the wear next to
        // it would oscillate. A core that will carry the whole force is kept, because it determines
        // the radius of the scar.
        let smallest = match control.normal {
            Normal::Force if end.is_some() => LEAST_CORE * contact.limit.radius,
            _ if shrinks => 0.5 / cells as f64 * last,
            _ => Self::smallest_core(last, cells),
        };
        let start = if least < smallest { 0.0 } else { least };
        let outermost = |radius: f64| {
            let reach = start + (radius - start) * (1.0 + 0.6 / cells as f64);
            reach.min(shape.extent())
        };
        let (reach, farthest) = match (control.drifts(contact), end) {
            (true, None) => (outermost(last), f64::INFINITY),
            (_, Some(end)) if is_far(contact, &end) => {
                (outermost(contact.limit.radius), outermost(end.limit.radius))
            }
            _ => (outermost(last), outermost(last)),
        };
        let ring = reach - start;
        let slipping = if contact.stick > start { 1.0 - contact.stick } else { f64::INFINITY };
        let focus = if shrinks {
            let lowest = || (GIVES_WAY * critical_stick(shape)).min(contact.stick);
            let from = if start > 0.0 { start } else { lowest() };
            Some(Focus { from, to: contact.stick, blur: BLUR * ring })
        } else if start > 0.0 {
            Some(Focus::at(start))
        } else {
            (contact.stick > 0.05).then(|| Focus { blur: 0.05 * ring, ..Focus::at(contact.stick) })
        };
        Some(Self { start, reach, farthest, focus, old_edge: None, ring: slipping })
    }

    /// The mesh while a sharp tip or edge wears, with dense nodes there. `None` if the shape is smooth.
    pub(super) fn while_sharp(&self, contact: &Contact) -> Option<Self> {
        let sharp = contact.shape.sharp_radius()?;
        let focus = Focus { blur: SHARP_BLUR * self.reach, ..Focus::at(sharp) };
        let ring = if sharp > 0.0 { 1.0 - sharp } else { f64::INFINITY };
        Some(Self { focus: Some(focus), ring, ..self.clone() })
    }

    /// Whether the unworn contact wears most in a ring that is much narrower than the mesh, and than the range in which the
    /// stick edge moves.
    pub(super) fn is_thin(&self) -> bool {
        let moves = self.focus.as_ref().map_or(0.0, |focus| focus.to - focus.from);
        moves < MOVES * self.ring && self.ring < THIN * (self.reach - self.start)
    }

    /// The smallest core that the first cells resolve, for a scar of this radius.
    pub(super) fn smallest_core(scar: f64, cells: usize) -> f64 {
        1.5 / (cells * cells) as f64 * scar
    }

    /// Plans the mesh of a later block, whose springs stick inside the radius `stick` when it begins. The
    /// scar reaches the radius `reach` at least.
    pub(super) fn of_block(
        contact: &Contact,
        control: &Control,
        (stick, reach): (f64, f64),
        cells: usize,
    ) -> Self {
        let extent = contact.shape.extent();
        let reach = (stick + (reach - stick) * (1.0 + 0.6 / cells as f64)).min(extent);
        let farthest = if control.drifts(contact) { f64::INFINITY } else { reach };
        let focus = (stick > 0.0).then(|| Focus::at(stick));
        Self { start: stick, reach, farthest, focus, old_edge: None, ring: f64::INFINITY }
    }

    /// Whether a mesh by another plan serves as well, because both have even nodes and almost the same size. The errors
    /// of many meshes would add up.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let is_even =
            |plan: &Self| plan.start == 0.0 && plan.focus.is_none() && plan.old_edge.is_none();
        let largest =
            if other.farthest > other.reach { EXTENSION * other.reach } else { other.reach };
        is_even(self) && is_even(other) && self.reach <= largest
    }

    /// Upper bound of the scar radius up to the time `last`, for a constant force. It applies in
    /// gross slip, and if the tangential force is constant too. The bound uses three facts: V grows
    /// by at most F̃Δ/Δ₀, Δ is at most d, and the worn surface is never more concave than a flat.
    pub(crate) fn outermost(problem: WearProblem<'_>, last: f64) -> Option<f64> {
        let WearProblem { contact, control, law } = problem;
        let end = control.tends_to(contact);
        if !control.drifts(contact) || end.is_none() && control.least_stick(contact) > 0.0 {
            return None;
        }
        let shape = &contact.shape;
        // The simplified rule satisfies the energy balance less accurately.
        let share = if law == Law::Exact { 1.0 } else { 1.6 };
        let Moment { friction, wear } = contact.largest_coefficients();
        let fastest = friction
            * wear
            * match shape.geometry() {
                Geometry::Round => {
                    let quickest = control.largest_threshold() / contact.threshold;
                    2.0 * share * shape.half_force() * quickest
                }
                // The slip of the middle is at most the stroke, and the springs add y(θ − y) ≤ ¼.
                Geometry::Line => control.largest_stroke() + 0.5,
            };
        let cut = |radius: f64| {
            let depth = shape.profile(radius);
            let of_ring = |r: f64| match shape.geometry() {
                Geometry::Round => r * (depth - shape.profile(r)),
                Geometry::Line => (depth - shape.profile(r)) / std::f64::consts::PI,
            };
            2.0 * std::f64::consts::PI * integrate_beyond(0.0, radius, shape.kinks(), of_ring)
        };
        let most = shape.extent().min(end.map_or(1e6, |end| end.limit.radius));
        let mut reach = contact.limit.radius;
        let (mut time, mut before) = (-contact.limit.volume / fastest, 0.0);
        loop {
            let volume = cut(reach);
            let quickens = match end {
                Some(_) => ((1.0 + shape.profile(reach)) / contact.threshold).max(1.0),
                None => 1.0,
            };
            time += (volume - before) / (fastest * quickens);
            if time >= last || reach >= most {
                return Some(reach.min(most));
            }
            before = volume;
            reach *= 1.05;
        }
    }

    /// The nodes of a mesh with `cells` cells.
    pub(crate) fn radii(&self, cells: usize) -> Vec<f64> {
        let radii = self.without_old_edge(cells);
        match self.old_edge {
            Some(edge) => denser(&radii, edge),
            None => radii,
        }
    }

    fn without_old_edge(&self, cells: usize) -> Vec<f64> {
        let Self { start, reach, .. } = *self;
        let share = |i: usize| i as f64 / cells as f64;
        let mut radii: Vec<f64> = match self.focus {
            None => (0..=cells).map(|i| start + (reach - start) * share(i)).collect(),
            // Quadratic spacing at a fixed stick edge, because slip starts there like a square
            // root. The nodes are also dense at the outer end, because the edge of the scar should
            // not lie in a wide cell.
            Some(Focus { to, blur: 0.0, .. }) => {
                let ring = reach - to;
                let steepness = steepness(2.0 * ring / (COARSE_START * to));
                (0..=cells)
                    .map(|i| stretched(share(i), steepness))
                    .map(|u| to + ring * u * u * (2.0 - u))
                    .collect()
            }
            Some(Focus { from, to, blur }) => {
                let is_thin = self.is_thin();
                let blur = if is_thin { blur.min(THIN_BLUR * self.ring) } else { blur };
                let root = blur.sqrt();
                // Outside of a thin ring, the distance of the nodes grows like that from the ring.
                let scale = 2.0 * self.ring.sqrt();
                let narrowed = |u: f64| if is_thin { scale * libm::asinh(u / scale) } else { u };
                let widened = |u: f64| if is_thin { scale * libm::sinh(u / scale) } else { u };
                let u = |distance: f64| narrowed(2.0 * ((distance + blur).sqrt() - root));
                let r = |u: f64| {
                    let u = 0.5 * widened(u) + root;
                    u * u - blur
                };
                let (inside, outside) = (u(from - start), u(reach - to));
                // In front of a place of rest at the start, the distance of the nodes grows evenly.
                let rate = (inside == 0.0 && to > from).then(|| (1.0 - TIGHT) * root / (to - from));
                let between = rate.map_or((to - from) / root, |rate| -libm::log(TIGHT) / rate);
                let along = |u: f64| match rate {
                    Some(rate) => TIGHT * root / rate * libm::expm1(rate * u),
                    None => root * u,
                };
                let all = inside + between + outside;
                (0..=cells)
                    .map(|i| match all * share(i) {
                        u if u < inside => from - r(inside - u),
                        u if u < inside + between => from + along(u - inside),
                        u => to + r(u - inside - between),
                    })
                    .collect()
            }
        };
        (radii[0], radii[cells]) = (start, reach);
        radii
    }
}

/// As many nodes in the same range, of which a part is dense at a radius inside.
fn denser(radii: &[f64], edge: f64) -> Vec<f64> {
    let (cells, start, end) = (radii.len() - 1, radii[0], radii[radii.len() - 1]);
    let blur = OLD_BLUR * (end - start);
    // The distance from the edge in the coordinate in which the dense nodes are even.
    let near = |r: f64| (((r - edge).abs() + blur).sqrt() - blur.sqrt()).copysign(r - edge);
    let weight = OLD_SHARE * cells as f64 / (near(end) - near(start));
    // The number of new nodes inside a radius, with the share of old cells inside it.
    let number =
        |inside: f64, r: f64| (1.0 - OLD_SHARE) * inside + weight * (near(r) - near(start));
    let mut cell = 0;
    let inner = (1..cells).map(|node| {
        let wanted = node as f64;
        while number(cell as f64 + 1.0, radii[cell + 1]) < wanted {
            cell += 1;
        }
        let (low, high) = (radii[cell], radii[cell + 1]);
        let inside = |r: f64| cell as f64 + (r - low) / (high - low);
        let slope = (1.0 - OLD_SHARE) / (high - low);
        // In √(|r − edge| + blur), the number is a quadratic on each side of the edge.
        let beyond = wanted - number(inside(edge), edge);
        let sum = beyond.abs() + slope * blur + weight * blur.sqrt();
        let root = 2.0 * sum / (weight + (weight * weight + 4.0 * slope * sum).sqrt());
        edge + (root * root - blur).copysign(beyond)
    });
    std::iter::once(start).chain(inner).chain([end]).collect()
}

/// κ with (sinh κ/κ)² = `ratio`. The result is 0 if `ratio` is less than 1.
fn steepness(ratio: f64) -> f64 {
    let excess = |kappa: f64| libm::sinh(kappa) / kappa - ratio.sqrt();
    if excess(1e-3) > 0.0 { 0.0 } else { root(1e-3, 50.0, excess) }
}

/// sinh κu / sinh κ. For small u it is proportional to u; for large u it grows exponentially.
fn stretched(u: f64, kappa: f64) -> f64 {
    if kappa == 0.0 { u } else { libm::sinh(kappa * u) / libm::sinh(kappa) }
}

/// Whether the final scar is much larger than the scar at the depth of the unworn contact.
pub(crate) fn is_far(contact: &Contact, end: &Final) -> bool {
    end.limit.radius > FAR * contact.limit.radius
}
