//! Wear by the simplified rule (14), directly on the one-dimensional image.
//!
//! While depth and amplitude are held, springs do not affect each other. For each spring, (14) summed over
//! cycles is a logistic equation with an exact solution, so that no time steps are needed. One inverse
//! transform (4) per output cycle then gives the profile.
//!
//! # Equations
//! With e = exp(−ξÑ/ã) and the unworn compression y₀ = 1 − g₀ (signed outside the contact):
//! ```text
//! c < x < a₀     y = Δ y₀ e / (y₀ e + Δ − y₀)
//! a₀ < x < ã     η = y₀ e
//! x ≤ c, x > ã   unchanged
//! slip           s = (2/π) ∫ ω/√(r²−x²) dx = (s₀ + w)/Δ  for r ≤ a₀
//! dissipated     Σ W = μ ã (F₀ − F) / (ξ k_w E*)
//! ```
//! Outside the contact the rule gives negative wear. If the inverse transform gives f < f₀ near ã,
//! the reported wear is 0. The reported volume, depth and scar radius belong to this clipped curve.
//!
//! # Accuracy
//! Force, energy and the volume of the image have an error of 1e-9 (see [`SpringRow`]). With 256
//! radii the error of the wear is 3e-5 of d₀ up to Ñ = 5, with convergence of order 2. Later a step
//! forms at the stick edge. Next to the step the error grows to 1e-4 with order 3/2, and to more
//! for c below 0.05. The pressure has order 3/2, and an error of 0.2 % away from the edge. At the
//! edge the pressure grows without bound. When the step is thinner than the first cell, the
//! reported pressure at the edge is infinite, and the curve no longer integrates to F. For 1 < n <
//! 2 the pressure on the axis is too small just above the gross-slip threshold. At ξ = 0.8 the
//! *rule* itself differs from the exact method by −7…+4 % in volume and by up to 21 % in depth,
//! which is too small.
//!
//! # Sources
//! The rule: (14)–(16) of the paper. Closed form, energy and slip: derived here.

use std::f64::consts::{FRAC_2_PI, PI};
use std::sync::Arc;

use crate::contact::hysteresis::{Backbone, ROW_POINTS};
use crate::contact::limit::{chord_and_angle, limiting_wear};
use crate::contact::row::{SpringRow, Sums};
use crate::contact::transform::Kernels;
use crate::contact::unworn::{Contact, Decay, Regime};
use crate::numeric::{dot, integrate, largest, vertex};
use crate::solver::closed::energy::dissipated;
use crate::solver::curves::{Curves, Grid};

/// If the image rises over the first cell by more than this share of Δ, the cell is integrated separately.
const UNRESOLVED: f64 = 0.01;

/// A contact on its output radii. It can be evaluated at any number of cycles.
#[derive(Debug)]
pub struct Simplified {
    contact: Contact,
    pub(crate) row: SpringRow,
    kernels: Arc<Kernels>,
    /// Θ = ã² − c².
    theta: f64,
    /// The output radii: the core, then the mesh nodes from c to ã, then some radii outside.
    pub radii: Vec<f64>,
    /// The number of radii before the first mesh node.
    core: usize,
    /// The number of mesh nodes.
    nodes: usize,
    /// The number of nodes inside a₀.
    inside: usize,
    /// g₀ at every radius.
    images: Vec<f64>,
    /// Signed y₀ at the nodes.
    unworn: Vec<f64>,
    /// Δ − y₀ at the nodes inside a₀.
    rest: Vec<f64>,
    /// 1/x at the nodes; 0 on the axis.
    reciprocal: Vec<f64>,
    /// Δ·s of the unworn contact at the nodes, with the ω of the rule also outside a₀.
    slip: Vec<f64>,
    /// The error of `slip` outside a₀, divided by e; 0 inside a₀.
    slip_excess: Vec<f64>,
    /// The unworn profile f₀ at every radius.
    pub(crate) initial: Vec<f64>,
    /// The limiting profile f∞ at every radius.
    pub(crate) limiting: Vec<f64>,
    /// The pressure of the unworn contact at the nodes inside a₀.
    unworn_pressure: Vec<f64>,
    /// For each radius of the core: the pressure if y had a step at the stick edge, and the amount
    /// by which each slipping spring reduces it.
    inner: Vec<(f64, [f64; ROW_POINTS])>,
    /// For each radius outside ã: the slip with only the sticking core, and the amount by which
    /// each slipping spring reduces it.
    outside: Vec<(f64, [f64; ROW_POINTS])>,
}

/// The springs after some cycles.
struct SpringStates {
    /// g at every radius.
    image: Vec<f64>,
    /// (g − g₀ − apex)/x at the nodes; empty without wear. The inverse transform gives the wear
    /// minus `apex`.
    worn: Vec<f64>,
    /// The changes of R′ at the nodes inside a₀, see [`Simplified::pressures`]; empty for R = 0.
    slope_changes: Vec<f64>,
    /// g − g₀ at the first node; 0 except in gross slip.
    apex: f64,
    /// Whether the image has a step in the first cell.
    unresolved: bool,
}

/// The contact after some cycles, in units of a₀, d₀, E*d₀/a₀ and a₀²d₀.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Force, friction and energy integrals.
    pub sums: Sums,
    /// Volume of the reported wear.
    pub volume: f64,
    /// Largest wear on the curve.
    pub depth: f64,
    /// Largest radius with wear.
    pub scar: f64,
    /// Volume of the unclipped wear by Simpson's rule on the mesh. `sums.volume` is the same volume from the image.
    pub mesh_volume: f64,
    /// The curves, if requested.
    pub curves: Option<Curves>,
    /// The backbone of the friction loop, if the curves are requested.
    pub backbone: Option<Backbone>,
}

impl Simplified {
    /// Prepares `points` ≥ 16 output radii.
    #[must_use]
    pub fn new(contact: &Contact, points: usize) -> Self {
        let Contact { ref shape, stick: c, threshold, limit, .. } = *contact;
        let Grid { radii, core, cells } = Grid::new(c, limit.radius, points, shape.extent());
        let nodes = cells + 1;
        let kernels = Kernels::with_cells(cells);
        let theta = (limit.radius - c) * (limit.radius + c);
        let mesh = &radii[core..core + nodes];
        let inside = mesh.iter().take_while(|r| **r < 1.0).count();
        let images: Vec<f64> = radii.iter().map(|x| shape.image(*x)).collect();
        let unworn = images[core..core + nodes].iter().map(|g| 1.0 - g).collect();
        let rest: Vec<f64> = kernels
            .tau()
            .iter()
            .zip(mesh)
            .take(inside)
            .map(|(tau, x)| contact.rest(if c == 0.0 { *x } else { theta * tau / (x + c) }))
            .collect();
        let reciprocal = mesh.iter().map(|x| if *x > 0.0 { 1.0 / x } else { 0.0 }).collect();
        let initial: Vec<f64> = radii.iter().map(|r| shape.profile(*r)).collect();
        let mut limiting = initial.clone();
        let (mut slip, mut slip_excess) = (vec![0.0; nodes], vec![0.0; nodes]);
        for (i, r) in mesh.iter().enumerate() {
            let (chord, psi) = chord_and_angle(c, *r);
            let wear = limiting_wear(shape, c, 1.0, *r, (chord, psi));
            limiting[core + i] += wear.max(0.0);
            // Δ − y₀ = Δ − (1 − g₀), so Δ·s₀ = Δ·(2/π)ψ − w∞.
            slip[i] = (threshold * FRAC_2_PI * psi - wear).max(0.0);
            if *r > 1.0 {
                slip_excess[i] = -limiting_wear(shape, 1.0, 1.0, *r, chord_and_angle(1.0, *r));
            }
        }
        if c == 0.0 {
            // On the axis ψ is undefined. The following values are the limits for r → 0.
            limiting[0] = 1.0;
            slip[0] = threshold - 1.0;
        }
        let row = SpringRow::new(contact);
        let unworn_pressure =
            radii[core..core + inside].iter().map(|r| shape.pressure_inside(*r, 1.0)).collect();
        let inner = radii[..core]
            .iter()
            .map(|r| {
                let step = threshold / (PI * ((c - r) * (c + r)).sqrt());
                (shape.pressure_inside(*r, c) + step, row.weights_inside(*r))
            })
            .collect();
        let outside = radii[core + nodes..]
            .iter()
            .map(|r| (1.0 - FRAC_2_PI * libm::asin(c / r), row.weights_outside(*r)))
            .collect();
        Self {
            contact: contact.clone(),
            row,
            kernels,
            theta,
            radii,
            core,
            nodes,
            inside,
            images,
            unworn,
            rest,
            reciprocal,
            slip,
            slip_excess,
            initial,
            limiting,
            unworn_pressure,
            inner,
            outside,
        }
    }

    /// The regime of the unworn contact.
    pub(crate) fn regime(&self) -> Regime {
        self.contact.regime
    }

    /// (k_w/μ)·ΣW in units of a₀²d₀.
    pub(crate) fn dissipated(&self, xi: f64, sums: &Sums) -> f64 {
        dissipated(&self.contact, xi, sums)
    }

    /// Δ·s at a radius outside the contact: the amplitude of the local slip.
    pub(crate) fn slip_outside(&self, r: f64, decay: Decay) -> f64 {
        let Contact { stick, threshold, .. } = self.contact;
        let (_, compressions) = self.row.sums_and_compressions(decay);
        let unstuck = 1.0 - FRAC_2_PI * libm::asin(stick / r);
        threshold * unstuck - dot(&self.row.weights_outside(r), &compressions)
    }

    /// e = exp(−ξÑ/ã).
    #[must_use]
    pub fn decay(&self, xi: f64, normalized_cycles: f64) -> Decay {
        Decay::after(xi * normalized_cycles / self.contact.limit.radius)
    }

    /// The state at a decay, without curves.
    pub(crate) fn state(&self, decay: Decay) -> State {
        self.states(&[(decay, false)]).swap_remove(0)
    }

    /// The states at several decays. The flag requests curves.
    #[must_use]
    pub fn states(&self, wanted: &[(Decay, bool)]) -> Vec<State> {
        let (mut images, mut worn, mut first) = (Vec::new(), Vec::new(), Vec::new());
        let (mut changes, mut decays) = (Vec::new(), Vec::new());
        let (mut sums, mut compressions) = (Vec::new(), Vec::new());
        for (decay, curves) in wanted {
            let springs = self.springs(*decay);
            let (summed, compressed) = self.row.sums_and_compressions(*decay);
            sums.push(summed);
            worn.push(springs.worn);
            first.push((springs.apex, springs.unresolved));
            if *curves {
                images.push(springs.image);
                changes.push(springs.slope_changes);
                decays.push(*decay);
                compressions.push(compressed);
            }
        }
        let mut wear = vec![vec![0.0; self.radii.len()]; wanted.len()];
        self.kernels.inverse(&worn, &mut wear, self.core);
        let mut more = images
            .into_iter()
            .zip(self.pressures(&decays, &changes, &compressions))
            .zip(&compressions);
        let scale = self.theta.sqrt() / PI;
        wear.into_iter()
            .zip(first)
            .zip(sums)
            .zip(wanted)
            .map(|(((mut wear, (apex, unresolved)), sums), (decay, curves))| {
                let mesh = &mut wear[self.core..self.core + self.nodes];
                for wear in &mut *mesh {
                    *wear = apex + scale * *wear;
                }
                if unresolved {
                    self.bound(mesh);
                }
                let mut state = self.measure(mesh, sums);
                if let Some(((image, pressure), compressions)) =
                    curves.then(|| more.next()).flatten()
                {
                    let slip = self.slip(mesh, *decay, compressions);
                    for wear in mesh {
                        *wear = wear.max(0.0);
                    }
                    state.backbone = Some(self.row.backbone(&sums, compressions));
                    state.curves = Some(Curves { wear, image, pressure, slip });
                }
                state
            })
            .collect()
    }

    /// The closed form of (14) at every node, as in [`Contact::compression`] and [`Contact::worn`],
    /// but with one division for both.
    fn springs(&self, decay: Decay) -> SpringStates {
        let Contact { threshold, stick, .. } = self.contact;
        let (left, gone) = (decay.left, decay.gone);
        let mesh = self.core..self.core + self.nodes;
        if gone == 0.0 {
            return SpringStates {
                image: self.images.clone(),
                worn: Vec::new(),
                slope_changes: Vec::new(),
                apex: 0.0,
                unresolved: false,
            };
        }
        let mut image = Vec::with_capacity(self.radii.len());
        image.extend_from_slice(&self.images[..mesh.start]);
        let (inside, outside) = self.unworn.split_at(self.inside);
        // The same vector holds a share of the compression, then η, then g.
        image.extend(inside.iter().zip(&self.rest).map(|(y, rest)| y / (y * left + rest)));
        let shares = &mut image[mesh.start..];
        let mut worn: Vec<f64> = Vec::with_capacity(self.nodes);
        worn.extend(shares.iter().zip(&self.rest).map(|(share, rest)| gone * rest * share));
        worn.extend(outside.iter().map(|y| gone * y));
        for share in &mut *shares {
            *share *= threshold * left;
        }
        if stick > 0.0 {
            // The node at the stick edge neither slips nor wears: set the exact values, without rounding errors.
            (shares[0], worn[0]) = (self.unworn[0], 0.0);
        }
        let apex = worn[0];
        let first_step = worn[1] - apex;
        for (worn, reciprocal) in worn.iter_mut().zip(&self.reciprocal) {
            *worn = (*worn - apex) * reciprocal;
        }
        let unresolved = stick == 0.0 || first_step.abs() > UNRESOLVED * threshold;
        if unresolved {
            worn[0] = self.first_value(decay, apex, worn[1]);
        }
        let mut rest: Vec<f64> = Vec::with_capacity(self.inside + 1);
        rest.extend(shares.iter().zip(inside).map(|(y, unworn)| y - left * unworn));
        // R is 0 at a₀ and outside it. One more node lets the curve end at 0.
        rest.push(0.0);
        self.kernels.slope_changes(&mut rest);
        for compression in shares {
            *compression = 1.0 - *compression;
        }
        image.extend(outside.iter().map(|y| 1.0 - left * y));
        image.extend_from_slice(&self.images[mesh.end..]);
        SpringStates { image, worn, slope_changes: rest, apex, unresolved }
    }

    /// The value at the first node that makes the inverse transform of the first cell exact, even with a thin step
    /// inside. The interpolation there is linear, with `second` at the second node.
    fn first_value(&self, decay: Decay, apex: f64, second: f64) -> f64 {
        let (c, r) = (self.contact.stick, self.radii[self.core + 1]);
        let (_, angle) = chord_and_angle(c, r);
        // ψ = ψ₁(1 − s⁴): x = r cos ψ is c at s = 0, and x − c = 2r sin((ψ₁−ψ)/2) sin((ψ₁+ψ)/2).
        let integral = integrate(0.0, 1.0, |s| {
            let below = angle * s * s * s * s;
            let delta = 2.0 * r * libm::sin(0.5 * below) * libm::sin(angle - 0.5 * below);
            4.0 * angle * s * s * s * (self.contact.worn(delta, decay) - apex)
        });
        let root = self.kernels.tau()[1].sqrt();
        3.0 * integral / (self.theta.sqrt() * root) - 2.0 * second
    }

    /// Limits the wear inside a₀ to the limiting wear. If the image has a step within a cell, the computed
    /// wear can exceed the limiting wear.
    fn bound(&self, wear: &mut [f64]) {
        let nodes = self.core..self.core + self.inside;
        let limit = self.limiting[nodes.clone()].iter().zip(&self.initial[nodes]);
        for (wear, (limiting, initial)) in wear.iter_mut().zip(limit) {
            *wear = wear.min(limiting - initial);
        }
    }

    /// The width of the step of the image at the stick edge.
    fn step_width(&self, decay: Decay) -> f64 {
        let Contact { ref shape, stick, threshold, .. } = self.contact;
        decay.left * threshold / shape.image_slope(stick)
    }

    fn measure(&self, wear: &[f64], sums: Sums) -> State {
        let mesh = &self.radii[self.core..self.core + self.nodes];
        let tau = self.kernels.tau();
        let deepest = largest(wear);
        let mut scar = 0.0;
        let mut cut_off = 0.0;
        if wear[deepest] > 0.0 {
            let mut last = wear.len() - 1;
            while wear[last] <= 0.0 {
                last -= 1;
            }
            scar = mesh[last];
            if last + 1 < wear.len() {
                let share = wear[last] / (wear[last] - wear[last + 1]);
                scar += share * (mesh[last + 1] - mesh[last]);
                cut_off = 0.5 * (1.0 - share) * (tau[last + 1] - tau[last]) * wear[last + 1];
                for i in last + 1..wear.len() - 1 {
                    cut_off += 0.5 * (tau[i + 1] - tau[i]) * (wear[i] + wear[i + 1]);
                }
            }
        }
        State {
            volume: sums.volume - PI * self.theta * cut_off,
            // A parabola overshoots at a step. The limiting depth bounds every state.
            depth: vertex(mesh, wear, deepest).min(self.contact.limit.depth),
            scar,
            mesh_volume: PI * self.theta * self.kernels.area(wear),
            sums,
            curves: None,
            backbone: None,
        }
    }

    fn slip(&self, wear: &[f64], decay: Decay, compressions: &[f64]) -> Vec<f64> {
        let per_threshold = 1.0 / self.contact.threshold;
        let mut slip = Vec::with_capacity(self.radii.len());
        slip.resize(self.core, 0.0);
        slip.extend(wear.iter().zip(&self.slip).zip(&self.slip_excess).map(
            |((wear, unworn), excess)| {
                ((unworn + wear - decay.left * excess) * per_threshold).max(0.0)
            },
        ));
        slip.extend(
            self.outside
                .iter()
                .map(|(unstuck, weights)| unstuck - dot(weights, compressions) * per_threshold),
        );
        slip
    }

    /// The pressure at every radius.
    ///
    /// In the ring y = e·y₀ + R. The pressure of e·y₀ is e times the pressure of the unworn contact, known in closed
    /// form. The rest R = y − e·y₀ has a double root at a₀, so that no kink lies inside a cell.
    fn pressures(
        &self,
        decays: &[Decay],
        changes: &[Vec<f64>],
        compressions: &[[f64; ROW_POINTS]],
    ) -> Vec<Vec<f64>> {
        let mut curves = vec![vec![0.0; self.radii.len()]; decays.len()];
        self.kernels.pressure(changes, self.inside, &mut curves, self.core);
        let scale = FRAC_2_PI / self.theta.sqrt();
        let first_cell = self.radii[self.core + 1] - self.radii[self.core];
        for ((curve, decay), compressions) in curves.iter_mut().zip(decays).zip(compressions) {
            for (pressure, (step, weights)) in curve.iter_mut().zip(&self.inner) {
                let found = step - dot(weights, compressions);
                // If the core is too small for these sums, it acts like a point: the pressure is infinite.
                *pressure = if found >= 0.0 { found } else { f64::INFINITY };
            }
            let ring = &mut curve[self.core..];
            for (pressure, unworn) in ring.iter_mut().zip(&self.unworn_pressure) {
                *pressure = (decay.left * unworn + scale * *pressure).max(0.0);
            }
            // At the apex of a cone in gross slip the pressure is always infinite.
            let apex = self.unworn_pressure[0].is_infinite();
            if apex || self.core > 0 && self.step_width(*decay) < first_cell {
                ring[0] = f64::INFINITY;
            }
        }
        curves
    }
}
