//! Where the nodes of a mesh lie, and how far they must reach, by what is held.

use super::law::Law;
use crate::contact::control::{Control, Final, Normal, Tangential};
use crate::contact::limit::Limit;
use crate::contact::unworn::Contact;
use crate::numeric::{integrate_beyond, root};

/// How dense the nodes are where the stick edge moves inwards, in parts of the ring that wears.
const BLUR: f64 = 0.003;
/// How dense they are where it comes to rest in worn material.
pub const REST_BLUR: f64 = 0.001;
/// Cells at a stick edge that stays begin at most so many times as wide as c/n²: a far wider ring is graded
/// more and more steeply.
const COARSE_START: f64 = 1500.0;
/// How many times further than that of the unworn contact a scar reaches on whose last mesh the unworn
/// contact would lie in a few cells: the mesh begins small and grows.
pub const FAR: f64 = 2.0;
/// A smaller core under held forces, in parts of the first scar, is none.
const LEAST_CORE: f64 = 1e-4;
/// A core under a held depth gives way soon after it has shrunk to this part of the critical radius.
const GIVES_WAY: f64 = 0.8;

/// Where the nodes of a mesh lie: evenly spaced where the stick edge moves, and the further apart the
/// further away from there, r = edge ± ((u/2 + √blur)² − blur); or all evenly spaced.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshPlan {
    /// r₀: nothing wears inside.
    pub start: f64,
    /// The last node.
    pub reach: f64,
    /// Where the last node will have to be in the end; infinite where that is not known beforehand.
    pub farthest: f64,
    /// Where nodes are dense; none if they are even.
    pub focus: Option<Focus>,
    /// Radii at which there must be a node.
    pub kinks: Vec<f64>,
}

/// Where nodes are dense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Focus {
    /// The innermost radius at which the stick edge is expected,
    pub from: f64,
    /// and the outermost.
    pub to: f64,
    /// The smaller, the denser; 0 at a stick edge that stays at the start of the mesh.
    pub blur: f64,
}

impl Focus {
    /// At a stick edge that stays.
    fn at(radius: f64) -> Self {
        Self { from: radius, to: radius, blur: 0.0 }
    }
}

impl MeshPlan {
    /// The mesh for a contact under what is held, before anything is known of the run.
    ///
    /// `None` where the scar would outgrow the shape.
    #[must_use]
    pub fn first(contact: &Contact, control: &Control, cells: usize) -> Option<Self> {
        let shape = &contact.shape;
        let kinks = Vec::new();
        let least = control.least_stick(contact);
        let end = control.tends_to(contact);
        // Cells next to an edge that moves are wider than next to one that stays.
        let shrinks = matches!(control.tangential, Tangential::Force(_) | Tangential::Rig { .. })
            && control.normal == Normal::Depth;
        let last = match end {
            Some(end) => end.limit.radius,
            None => match Limit::solve(shape, least) {
                Some(limit) => limit.radius,
                // It may not come to that: the run ends at the indenter's rim if it does.
                None if control.normal == Normal::Force => shape.extent(),
                None => return None,
            },
        };
        let shrinks = shrinks && contact.stick - least > BLUR * last;
        // A core smaller than the first cells is none: wear that must vanish on it would swing. But one
        // that will bear all of a force says how far the scar reaches, however small it is.
        let smallest = match control.normal {
            Normal::Force if end.is_some() => LEAST_CORE * contact.limit.radius,
            _ if shrinks => 0.5 / cells as f64 * last,
            _ => 1.5 / (cells * cells) as f64 * last,
        };
        let start = if least < smallest { 0.0 } else { least };
        let outermost = |radius: f64| {
            let reach = start + (radius - start) * (1.0 + 0.6 / cells as f64);
            reach.min(shape.extent())
        };
        let (reach, farthest) = match (control.normal, end) {
            (Normal::Force, None) => (outermost(last), f64::INFINITY),
            (_, Some(end)) if is_far(contact, &end) => {
                (outermost(contact.limit.radius), outermost(end.limit.radius))
            }
            _ => (outermost(last), outermost(last)),
        };
        let ring = reach - start;
        let mut plan = Self { start, reach, farthest, focus: None, kinks };
        if start > 0.0 {
            plan.focus = Some(if shrinks {
                Focus { from: start, to: contact.stick, blur: BLUR * ring }
            } else {
                Focus::at(start)
            });
        } else if shrinks {
            let from = GIVES_WAY * control.critical_stick(shape);
            plan.focus =
                Some(Focus { from: from.min(contact.stick), to: contact.stick, blur: BLUR * ring });
        } else if contact.stick > 0.05 {
            plan.focus = Some(Focus { from: contact.stick, to: contact.stick, blur: 0.05 * ring });
        }
        if let Tangential::Blocks(blocks) = &control.tangential {
            plan.kinks.extend(
                blocks
                    .iter()
                    .filter(|block| block.threshold > 0.0 && block.threshold < 1.0)
                    .map(|block| shape.image_inverse(1.0 - block.threshold))
                    .filter(|c| *c > start),
            );
        }
        Some(plan)
    }

    /// How far the scar can grow up to an instant under a held force, where all slips or the tangential force
    /// is held too: V grows by at most F̃Δ/Δ₀, Δ is at most d, and the worn surface is not more hollow
    /// than a flat one.
    #[must_use]
    pub fn outermost(contact: &Contact, control: &Control, law: Law, last: f64) -> Option<f64> {
        let end = control.tends_to(contact);
        if control.normal == Normal::Depth || end.is_none() && control.least_stick(contact) > 0.0 {
            return None;
        }
        let shape = &contact.shape;
        // The simplified rule keeps the energy balance less well.
        let share = if law == Law::Exact { 1.0 } else { 1.6 };
        let fastest = 2.0 * share * shape.half_force();
        let cut = |radius: f64| {
            let depth = shape.profile(radius);
            2.0 * std::f64::consts::PI
                * integrate_beyond(0.0, radius, shape.kinks(), |r| r * (depth - shape.profile(r)))
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

    /// The nodes of so many cells.
    #[must_use]
    pub fn radii(&self, cells: usize) -> Vec<f64> {
        let Self { start, reach, .. } = *self;
        let share = |i: usize| i as f64 / cells as f64;
        let mut radii: Vec<f64> = match self.focus {
            None => (0..=cells).map(|i| start + (reach - start) * share(i)).collect(),
            // Nodes begin quadratically at a stick edge that stays, and end as densely as they can:
            // slip begins there like a root, and the scar's rim should not lie in a wide cell.
            Some(Focus { to, blur: 0.0, .. }) => {
                let ring = reach - to;
                let steepness = steepness(2.0 * ring / (COARSE_START * to));
                (0..=cells)
                    .map(|i| stretched(share(i), steepness))
                    .map(|u| to + ring * u * u * (2.0 - u))
                    .collect()
            }
            Some(Focus { from, to, blur }) => {
                let root = blur.sqrt();
                let u = |distance: f64| 2.0 * ((distance + blur).sqrt() - root);
                let r = |u: f64| (0.5 * u + root) * (0.5 * u + root) - blur;
                let (inside, outside) = (u(from - start), u(reach - to));
                let between = if to > from { (to - from) / root } else { 0.0 };
                let all = inside + between + outside;
                (0..=cells)
                    .map(|i| match all * share(i) {
                        u if u < inside => from - r(inside - u),
                        u if u < inside + between => from + root * (u - inside),
                        u => to + r(u - inside - between),
                    })
                    .collect()
            }
        };
        (radii[0], radii[cells]) = (start, reach);
        for kink in &self.kinks {
            let near = radii.partition_point(|r| r < kink);
            if near == 0 || near > cells {
                continue;
            }
            let at = if radii[near] - kink < kink - radii[near - 1] { near } else { near - 1 };
            if at > 0 && at < cells {
                radii[at] = *kink;
            }
        }
        radii
    }
}

/// κ with (sinh κ/κ)² = `ratio`; 0 if that is less than 1.
fn steepness(ratio: f64) -> f64 {
    let excess = |kappa: f64| libm::sinh(kappa) / kappa - ratio.sqrt();
    if excess(1e-3) > 0.0 { 0.0 } else { root(1e-3, 50.0, excess) }
}

/// sinh κu / sinh κ: as u while it is small, then like a geometric series.
fn stretched(u: f64, kappa: f64) -> f64 {
    if kappa == 0.0 { u } else { libm::sinh(kappa * u) / libm::sinh(kappa) }
}

/// Whether the scar will reach far beyond that of the unworn contact.
#[must_use]
pub fn is_far(contact: &Contact, end: &Final) -> bool {
    end.limit.radius > FAR * contact.limit.radius
}
