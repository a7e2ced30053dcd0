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
//! Force, energy and the volume of the image have an error of 1e-9 (see [`SpringRow`]). The mesh has
//! a node at each output radius between c and ã, but at most 512 cells. With 256 radii, the error of
//! the wear is 3e-5 of d₀ up to Ñ = 5, with convergence of order 2. With 512 cells it is 1e-5. Later
//! a step forms at the stick edge. Next to the step the error grows to 1e-4 with order 3/2, and to
//! more for c below 0.05. In gross slip it is 6e-4 next to the edge of a flat, and up to 2e-2 just
//! above the gross-slip threshold. The pressure has order 3/2, and an error of 0.2 % away from the
//! edge. At the edge it is a mean over a ring that gives the load. At ξ = 0.8 the
//! *rule* itself differs from the exact method by −7…+4 % in volume and by up to 21 % in depth,
//! which is too small.
//!
//! # Sources
//! The rule: (14)–(16) of the paper. Closed form, energy and slip: derived here.

use std::f64::consts::{FRAC_2_PI, PI};
use std::sync::{Arc, OnceLock};

use crate::contact::hysteresis::{Backbone, ROW_POINTS};
use crate::contact::limit::{chord_and_angle, limiting_wear};
use crate::contact::transform::{Kernels, graded};
use crate::contact::{Contact, Decay, Geometry, SpringRow, Sums};
use crate::numeric::{Monotone, dot, integrate, integrate_pieces, largest, vertex};
use crate::solver::curves::{self, Curves, Grid};
use crate::solver::errors::RunErrors;
use crate::solver::pressures::{Rings, kernel};

/// If the image rises over the first cell by more than this share of Δ, the cell is integrated separately.
const UNRESOLVED: f64 = 0.01;
/// Maximum number of mesh cells. With more output radii, wear and pressure are interpolated between
/// the mesh nodes.
const MOST_CELLS: usize = 512;
/// A larger error of the load outside the stick edge is no error of the quadrature.
const SMALL_ERROR: f64 = 0.1;
/// Estimated number of multiplications per output radius, apart from the transforms.
const CURVE_OPERATIONS: f64 = 40.0;

/// The radii from c to ã: all mesh nodes, or all output radii of this range.
#[derive(Debug)]
pub(super) struct Ring {
    pub(super) radii: Vec<f64>,
    /// The unworn compressions y₀ = 1 − g₀.
    unworn: Vec<f64>,
    /// The compressions that are missing for stick, Δ − y₀, inside a₀.
    rest: Vec<f64>,
    /// The limiting wear inside a₀. It is computed when first needed, because few states need it.
    limiting: OnceLock<Vec<f64>>,
}

impl Ring {
    /// The ring of the given radii.
    fn new(contact: &Contact, radii: Vec<f64>) -> Self {
        let Contact { ref shape, stick: c, limit, .. } = *contact;
        let theta = (limit.radius - c) * (limit.radius + c);
        let cells = radii.len() - 1;
        let unworn = radii.iter().map(|x| 1.0 - shape.image(*x)).collect();
        let rest = graded(cells)
            .zip(&radii)
            .take_while(|(_, x)| **x < 1.0)
            .map(|(tau, x)| contact.rest(if c == 0.0 { *x } else { theta * tau / (x + c) }))
            .collect();
        Self { radii, unworn, rest, limiting: OnceLock::new() }
    }

    /// The limiting wear at a radius, and Δ·s of the unworn contact with the ω of the rule also outside a₀.
    fn limiting_and_slip(contact: &Contact, r: f64) -> (f64, f64) {
        let Contact { ref shape, stick: c, threshold, .. } = *contact;
        if c == 0.0 && r == 0.0 {
            // On the axis ψ is undefined. These values are the limits for r → 0.
            return (1.0, threshold - 1.0);
        }
        let (chord, psi) = chord_and_angle(c, r);
        let wear = limiting_wear(shape, c, 1.0, r, (chord, psi));
        // Δ − y₀ = Δ − (1 − g₀), so Δ·s₀ = Δ·(2/π)ψ − w∞.
        (wear, (threshold * FRAC_2_PI * psi - wear).max(0.0))
    }

    /// The number of cells.
    fn cells(&self) -> usize {
        self.radii.len() - 1
    }

    /// The number of radii inside a₀.
    fn inside(&self) -> usize {
        self.rest.len()
    }

    /// The relative compressions y/(Δe) at the radii inside a₀, by (14).
    fn shares(&self, decay: Decay) -> impl Iterator<Item = f64> {
        self.unworn.iter().zip(&self.rest).map(move |(y, rest)| y / (y * decay.left + rest))
    }

    /// Limits the wear inside a₀ to the limiting wear. If the image has a step within a cell, the
    /// computed wear can exceed the limiting wear.
    fn bound(&self, contact: &Contact, wear: &mut [f64]) {
        let limiting = self.limiting.get_or_init(|| {
            let inside = self.radii[..self.inside()].iter();
            inside.map(|r| Self::limiting_and_slip(contact, *r).0).collect()
        });
        for (wear, limiting) in wear.iter_mut().zip(limiting) {
            *wear = wear.min(limiting.max(0.0));
        }
    }
}

/// A contact on its mesh. It can be evaluated at any number of cycles.
#[derive(Debug)]
pub struct Simplified {
    pub(super) contact: Contact,
    pub(crate) row: SpringRow,
    kernels: Arc<Kernels>,
    /// The range of x² that the mesh covers, Θ = ã² − c².
    theta: f64,
    /// The reciprocal 1/x at the mesh nodes; 0 on the axis.
    reciprocal: Vec<f64>,
    pub(super) mesh: Ring,
    grid: Grid,
    /// Computed when a curve is first needed. Most runs need no curves.
    unworn: OnceLock<Box<UnwornCurves>>,
}

/// The quantities of the unworn contact from which the curves over the output radii are computed.
#[derive(Debug)]
pub struct UnwornCurves {
    /// The number of radii inside the stick radius.
    core: usize,
    /// The output radii between c and ã, if they are not the mesh nodes.
    ring: Option<Ring>,
    /// Δ·s of the unworn contact in the ring, with the ω of the rule also outside a₀.
    slip: Vec<f64>,
    /// The error of the slip of the ring outside a₀, divided by e; 0 inside a₀.
    slip_excess: Vec<f64>,
    /// The pressure of the unworn contact in the ring inside a₀.
    pressure: Vec<f64>,
    /// The unworn image g₀ at every radius.
    images: Vec<f64>,
    /// The unworn profile f₀ at every radius.
    pub initial: Vec<f64>,
    /// The limiting profile f∞ at every radius.
    pub limiting: Vec<f64>,
    /// The rings around the output radii.
    rings: Rings,
    /// The loads of the rings in the core that follow from its image.
    core_loads: Vec<f64>,
    /// For each end of these rings inside c, and for c: the load outside that the sticking spring at c carries, and the weights of the
    /// slipping springs.
    inner: Vec<(f64, [f64; ROW_POINTS])>,
    /// For each radius outside ã: the slip with only the sticking core, and the amount by which
    /// each slipping spring reduces it.
    outside: Vec<(f64, [f64; ROW_POINTS])>,
}

impl UnwornCurves {
    fn new(contact: &Contact, row: &SpringRow, grid: &Grid, mesh_cells: usize) -> Self {
        let Contact { ref shape, stick: c, threshold, .. } = *contact;
        let Grid { ref radii, core, cells } = *grid;
        let nodes = &radii[core..=core + cells];
        let initial: Vec<f64> = radii.iter().map(|r| shape.profile(*r)).collect();
        let mut limiting = initial.clone();
        let mut slip = Vec::with_capacity(nodes.len());
        for (profile, r) in limiting[core..].iter_mut().zip(nodes) {
            let (wear, unworn) = Ring::limiting_and_slip(contact, *r);
            *profile += wear.max(0.0);
            slip.push(unworn);
        }
        let excess = |r: &f64| match *r {
            r if r > 1.0 => -limiting_wear(shape, 1.0, 1.0, r, chord_and_angle(1.0, r)),
            _ => 0.0,
        };
        let inside = nodes.iter().take_while(|r| **r < 1.0);
        let rings = Rings::around(Geometry::Round, radii);
        let core_loads = rings.loads(c, shape.kinks(), |r| shape.pressure_inside(r, c));
        let inner = rings.ends.iter().filter(|r| **r < c).chain([&c]);
        let inner = inner
            .map(|r| (threshold * kernel(Geometry::Round, *r, c), row.weights_inside(*r)))
            .collect();
        let outside = radii[core + cells + 1..]
            .iter()
            .map(|r| (1.0 - FRAC_2_PI * libm::asin(c / r), row.weights_outside(*r)));
        Self {
            core,
            ring: (cells != mesh_cells).then(|| Ring::new(contact, nodes.to_vec())),
            slip,
            slip_excess: nodes.iter().map(excess).collect(),
            pressure: inside.map(|r| shape.pressure_inside(*r, 1.0)).collect(),
            images: radii.iter().map(|x| shape.image(*x)).collect(),
            initial,
            limiting,
            rings,
            core_loads,
            inner,
            outside: outside.collect(),
        }
    }
}

/// The springs at the mesh nodes after some cycles.
struct SpringStates {
    /// (g − g₀ − apex)/x at the nodes; empty without wear. The inverse transform gives the wear
    /// minus `apex`.
    worn: Vec<f64>,
    /// The changes of R′ at the nodes inside a₀, see [`Simplified::pressures`]; empty for R = 0. Only for curves.
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
    /// The errors of volume and depth.
    pub errors: RunErrors,
    /// The curves, if requested.
    pub curves: Option<Curves>,
    /// The backbone of the friction loop, if the curves are requested.
    pub backbone: Option<Backbone>,
}

impl Simplified {
    /// Prepares `points` ≥ 16 output radii.
    pub fn new(contact: &Contact, points: usize) -> Self {
        let Contact { ref shape, stick: c, limit, .. } = *contact;
        let grid = Grid::new(c, limit.radius, points, shape.extent());
        // Simpson's rule needs an even number of cells.
        let cells = (points - points / 32 - 2).min(MOST_CELLS) & !1;
        let mesh = Ring::new(contact, curves::ring(c, limit.radius, cells));
        let reciprocal = mesh.radii.iter().map(|x| if *x > 0.0 { 1.0 / x } else { 0.0 }).collect();
        Self {
            contact: contact.clone(),
            row: SpringRow::new(contact),
            kernels: Kernels::with_cells(mesh.cells()),
            theta: (limit.radius - c) * (limit.radius + c),
            reciprocal,
            mesh,
            grid,
            unworn: OnceLock::new(),
        }
    }

    /// The output radii: the core, then the ring from c to ã, then some radii outside.
    pub fn radii(&self) -> &[f64] {
        &self.grid.radii
    }

    /// The mesh nodes from c to ã.
    pub fn mesh(&self) -> &[f64] {
        &self.mesh.radii
    }

    /// The curves of the unworn contact. They are computed when they are first needed.
    pub(crate) fn unworn(&self) -> &UnwornCurves {
        let Self { contact, row, grid, mesh, .. } = self;
        self.unworn.get_or_init(|| Box::new(UnwornCurves::new(contact, row, grid, mesh.cells())))
    }

    /// Estimated number of multiplications of `states` states, some of them with curves.
    pub(crate) fn operations(points: usize, states: usize, curves: usize) -> f64 {
        let cells = points.min(MOST_CELLS) as f64;
        0.5 * cells * cells * (states + curves) as f64 + CURVE_OPERATIONS * (points * curves) as f64
    }

    /// The output radii between c and ã.
    fn ring(&self) -> &Ring {
        self.unworn().ring.as_ref().unwrap_or(&self.mesh)
    }

    /// Δ·s at a radius outside the contact: the amplitude of the local slip.
    pub(crate) fn slip_outside(&self, r: f64, decay: Decay) -> f64 {
        let Contact { stick, threshold, .. } = self.contact;
        let (_, compressions) = self.row.sums_and_compressions(decay);
        let unstuck = 1.0 - FRAC_2_PI * libm::asin(stick / r);
        threshold * unstuck - dot(&self.row.weights_outside(r), &compressions)
    }

    /// The decay factor e = exp(−ξÑ/ã).
    pub fn decay(&self, xi: f64, normalized_cycles: f64) -> Decay {
        Decay::after(xi * normalized_cycles / self.contact.limit.radius)
    }

    /// The states at several decays. The flag of each decay requests curves.
    pub fn states(&self, wanted: &[(Decay, bool)]) -> Vec<State> {
        let (mut worn, mut changes) = (Vec::new(), Vec::new());
        let (mut found, mut more) = (Vec::new(), Vec::new());
        for (decay, curves) in wanted {
            let springs = self.springs(*decay, *curves);
            let (sums, compressions) = self.row.sums_and_compressions(*decay);
            worn.push(springs.worn);
            found.push((springs.apex, springs.unresolved, sums));
            if *curves {
                changes.push(springs.slope_changes);
                more.push((*decay, compressions));
            }
        }
        let mut wear = vec![vec![0.0; self.mesh.radii.len()]; wanted.len()];
        self.kernels.inverse(&worn, &mut wear);
        let mut more = more.iter().zip(self.pressures(&changes));
        wear.into_iter()
            .zip(found)
            .zip(wanted)
            .map(|((mut wear, (apex, unresolved, sums)), (decay, curves))| {
                self.finish(&mut wear, apex, unresolved);
                let deepest = largest(&wear);
                let mut state = self.measure(&wear, deepest, sums);
                state.errors = self.errors(&wear, deepest, &state, (*decay, apex));
                if let Some(((decay, compressions), pressure)) =
                    curves.then(|| more.next()).flatten()
                {
                    let ring = self.ring();
                    let mut wear = self.spread(wear, ring.radii.len());
                    if unresolved {
                        ring.bound(&self.contact, &mut wear);
                    }
                    state.backbone = Some(self.row.backbone(&sums, compressions));
                    state.curves = Some(self.curves(&wear, pressure, *decay, compressions));
                }
                state
            })
            .collect()
    }

    /// Converts the result of the inverse transform to the wear at the mesh nodes.
    fn finish(&self, wear: &mut [f64], apex: f64, unresolved: bool) {
        let scale = self.theta.sqrt() / PI;
        for wear in &mut *wear {
            *wear = apex + scale * *wear;
        }
        if unresolved {
            self.mesh.bound(&self.contact, wear);
        }
    }

    /// The wear at the mesh nodes. Near the edge of the scar it can be negative.
    pub(crate) fn wear(&self, decay: Decay) -> Vec<f64> {
        let SpringStates { worn, apex, unresolved, .. } = self.springs(decay, false);
        let mut wear = [vec![0.0; self.mesh.radii.len()]];
        self.kernels.inverse(&[worn], &mut wear);
        let [mut wear] = wear;
        self.finish(&mut wear, apex, unresolved);
        wear
    }

    /// The closed form of (14) at every mesh node, as in [`Contact::compression`] and
    /// [`Contact::worn`], but with one division for both. Curves need the changes of slope.
    fn springs(&self, decay: Decay, curves: bool) -> SpringStates {
        let Contact { threshold, stick, .. } = self.contact;
        let (left, gone) = (decay.left, decay.gone);
        if gone == 0.0 {
            let (worn, slope_changes) = (Vec::new(), Vec::new());
            return SpringStates { worn, slope_changes, apex: 0.0, unresolved: false };
        }
        let mesh = &self.mesh;
        let (inside, outside) = mesh.unworn.split_at(mesh.inside());
        let mut rest: Vec<f64> = Vec::with_capacity(mesh.inside() + 1);
        rest.extend(mesh.shares(decay));
        let mut worn: Vec<f64> = Vec::with_capacity(mesh.radii.len());
        worn.extend(rest.iter().zip(&mesh.rest).map(|(share, rest)| gone * rest * share));
        worn.extend(outside.iter().map(|y| gone * y));
        if stick > 0.0 {
            // The node at the stick edge neither slips nor wears: set the exact values, without rounding errors.
            worn[0] = 0.0;
        }
        if curves {
            for (rest, unworn) in rest.iter_mut().zip(inside) {
                *rest = *rest * (threshold * left) - left * unworn;
            }
            if stick > 0.0 {
                rest[0] = inside[0] - left * inside[0];
            }
            // R is 0 from a₀ outwards. One more node lets the curve of R end at 0.
            rest.push(0.0);
            self.kernels.slope_changes(&mut rest);
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
        SpringStates { worn, slope_changes: rest, apex, unresolved }
    }

    /// The value at the first node that makes the inverse transform of the first cell exact, even with a thin step
    /// inside. The interpolation there is linear, with `second` at the second node.
    fn first_value(&self, decay: Decay, apex: f64, second: f64) -> f64 {
        let integral = self.integral(self.mesh.radii[1], decay, apex);
        let root = self.kernels.tau()[1].sqrt();
        3.0 * integral / (self.theta.sqrt() * root) - 2.0 * second
    }

    /// ∫ (g − g₀ − apex)/√(r²−x²) dx over c…r, by a quadrature that resolves a thin step at c.
    fn integral(&self, r: f64, decay: Decay, apex: f64) -> f64 {
        let (_, angle) = chord_and_angle(self.contact.stick, r);
        let (sine, cosine) = libm::sincos(angle);
        // ψ = ψ₁(1 − s⁴): x = r cos ψ is c at s = 0, and x − c = 2r sin((ψ₁−ψ)/2) sin((ψ₁+ψ)/2).
        integrate(0.0, 1.0, |s| {
            let half = libm::sin(0.5 * angle * s * s * s * s);
            let other = sine * (1.0 - half * half).sqrt() - cosine * half;
            let delta = 2.0 * r * half * other;
            4.0 * angle * s * s * s * (self.contact.worn(delta, decay) - apex)
        })
    }

    /// The estimated errors of a state with wear. The volume is compared with the volume of the image, and the depth
    /// with a quadrature at the deepest node.
    fn errors(
        &self,
        wear: &[f64],
        deepest: usize,
        state: &State,
        (decay, apex): (Decay, f64),
    ) -> RunErrors {
        if state.volume == 0.0 {
            return RunErrors::default();
        }
        let mesh_volume = PI * self.theta * self.kernels.area(wear);
        let exact = match self.mesh.radii[deepest] {
            r if r > self.contact.stick => apex + FRAC_2_PI * self.integral(r, decay, apex),
            _ => wear[deepest],
        };
        RunErrors::between([mesh_volume, state.sums.volume], [wear[deepest], exact])
    }

    /// The width of the step of the image at the stick edge.
    fn step_width(&self, decay: Decay) -> f64 {
        let Contact { ref shape, stick, threshold, .. } = self.contact;
        decay.left * threshold / shape.image_slope(stick)
    }

    fn measure(&self, wear: &[f64], deepest: usize, sums: Sums) -> State {
        let (mesh, tau) = (&self.mesh.radii, self.kernels.tau());
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
            errors: RunErrors::default(),
            sums,
            curves: None,
            backbone: None,
        }
    }

    /// Interpolates values at the first mesh nodes to the first `radii` radii of the ring, by
    /// monotone cubics in u = τ^⅓. Both are evenly spaced in u.
    fn spread(&self, nodes: Vec<f64>, radii: usize) -> Vec<f64> {
        let (cells, intervals) = (self.mesh.cells(), self.grid.cells);
        if cells == intervals {
            return nodes;
        }
        let knots = (0..nodes.len()).map(|i| i as f64).collect();
        let curve = Monotone::through(knots, nodes);
        let per_interval = cells as f64 / intervals as f64;
        (0..radii).map(|i| i as f64 * per_interval).map(curve.along()).collect()
    }

    /// The curves from the wear and the sums of the pressure in the ring.
    fn curves(
        &self,
        wear: &[f64],
        pressure: Vec<f64>,
        decay: Decay,
        compressions: &[f64; ROW_POINTS],
    ) -> Curves {
        let mut curve = Vec::with_capacity(self.grid.radii.len());
        curve.resize(self.grid.core, 0.0);
        curve.extend(wear.iter().map(|wear| wear.max(0.0)));
        curve.resize(self.grid.radii.len(), 0.0);
        Curves {
            wear: curve,
            image: self.image(decay),
            pressure: self.pressure(pressure, decay, compressions),
            slip: self.slip(wear, decay, compressions),
        }
    }

    /// The image at every radius.
    fn image(&self, decay: Decay) -> Vec<f64> {
        let (unworn, ring) = (self.unworn(), self.ring());
        let mut image = unworn.images.clone();
        if decay.gone == 0.0 {
            return image;
        }
        let carried = self.contact.threshold * decay.left;
        let (inside, outside) = image[unworn.core..].split_at_mut(ring.inside());
        let edge = inside[0];
        for (image, share) in inside.iter_mut().zip(ring.shares(decay)) {
            *image = 1.0 - carried * share;
        }
        if unworn.core > 0 {
            // The stick edge does not wear: set the exact value, without rounding errors.
            inside[0] = edge;
        }
        for (image, unworn) in outside.iter_mut().zip(&ring.unworn[ring.inside()..]) {
            *image = 1.0 - decay.left * unworn;
        }
        image
    }

    /// The slip at every radius, from the wear in the ring.
    fn slip(&self, wear: &[f64], decay: Decay, compressions: &[f64]) -> Vec<f64> {
        let unworn = self.unworn();
        let per_threshold = 1.0 / self.contact.threshold;
        let mut slip = Vec::with_capacity(self.grid.radii.len());
        slip.resize(unworn.core, 0.0);
        slip.extend(wear.iter().zip(&unworn.slip).zip(&unworn.slip_excess).map(
            |((wear, unworn), excess)| {
                ((unworn + wear - decay.left * excess) * per_threshold).max(0.0)
            },
        ));
        slip.extend(
            unworn
                .outside
                .iter()
                .map(|(unstuck, weights)| unstuck - dot(weights, compressions) * per_threshold),
        );
        slip
    }

    /// The sums of the pressure in the ring inside a₀, for several R at once.
    ///
    /// In the ring y = e·y₀ + R. The pressure of e·y₀ is e times the pressure of the unworn contact,
    /// known in closed form. The rest R = y − e·y₀ has a double root at a₀, so that no kink lies
    /// inside a cell.
    fn pressures(&self, changes: &[Vec<f64>]) -> Vec<Vec<f64>> {
        // The sum is 0 at the first node outside a₀.
        let mut sums = vec![vec![0.0; self.mesh.inside() + 1]; changes.len()];
        self.kernels.pressure(changes, self.mesh.inside(), &mut sums);
        sums
    }

    /// The load ∫ p dr² outside r in gross slip. Springs near the axis can be much more compressed than their neighbours.
    fn load_outside(&self, r: f64, decay: Decay) -> f64 {
        let Contact { shape, threshold, .. } = &self.contact;
        let end = (1.0 - r).max(0.0) * (1.0 + r);
        let step = shape.image_inverse((decay.left + (threshold - 1.0)).min(1.0));
        let steps = [0.7, 0.9, 1.1, 1.4].map(|share| share * step);
        let kinks = steps.iter().chain(shape.kinks()).filter(|x| **x > r && **x < 1.0);
        // x² = r² + end·s⁸
        let mut kinks: Vec<f64> =
            kinks.map(|x| ((x - r) * (x + r) / end).sqrt().sqrt().sqrt()).collect();
        kinks.sort_by(f64::total_cmp);
        let load = integrate_pieces(0.0, 1.0, &kinks, |s| {
            let cube = s * s * s;
            let x = (r * r + end * (cube * s) * (cube * s)).sqrt();
            4.0 * cube * self.contact.compression(x, decay).max(0.0)
        });
        FRAC_2_PI * end.sqrt() * load
    }

    /// The pressure at every radius, from the sums of [`pressures`](Self::pressures).
    fn pressure(
        &self,
        mut sums: Vec<f64>,
        decay: Decay,
        compressions: &[f64; ROW_POINTS],
    ) -> Vec<f64> {
        let unworn = self.unworn();
        if unworn.core == 0 {
            let loads: Vec<f64> =
                unworn.rings.ends.iter().map(|r| self.load_outside(*r, decay)).collect();
            let mut pressure = unworn.rings.means(&Rings::between(&loads));
            unworn.rings.end_before(self.ring().inside(), &mut pressure);
            return pressure;
        }
        let unresolved = self.step_width(decay) < self.mesh.radii[1] - self.mesh.radii[0];
        if unresolved {
            // The sum at the stick edge contains the step. The sums outside do not.
            sums[0] = sums[1];
        }
        let scale = FRAC_2_PI / self.theta.sqrt();
        let sums = self.spread(sums, self.ring().inside());
        let ring = unworn.pressure.iter().zip(&sums);
        let ring = ring.map(|(unworn, sum)| (decay.left * unworn + scale * sum).max(0.0));
        let mut ring: Vec<f64> = ring.collect();
        let load = |(stuck, weights): &(f64, [f64; ROW_POINTS])| stuck + dot(weights, compressions);
        let mut outside: Vec<f64> = unworn.inner.iter().map(load).collect();
        // The last of these ends is the stick edge. Outside of it, the rings carry the load of the slipping springs. If
        // they do not resolve it, the ring around the edge carries the rest.
        let (core, c) = (unworn.core, self.contact.stick);
        let first = (unworn.rings.ends[core + 1] - c) * (unworn.rings.ends[core + 1] + c) * ring[0];
        let others = ring.iter().enumerate().skip(1).map(|(i, p)| p * unworn.rings.area(core + i));
        let mut others: f64 = others.sum();
        let share = outside[core + 1] / (first + others);
        if (share - 1.0).abs() < SMALL_ERROR {
            for p in &mut ring {
                *p *= share;
            }
            others *= share;
        }
        outside[core + 1] = others;
        let loads = Rings::between(&outside);
        let loads = loads.iter().zip(&unworn.core_loads).map(|(springs, core)| springs + core);
        let mut curve = unworn.rings.means(&loads.collect::<Vec<_>>());
        curve.extend(&ring[1..]);
        curve.resize(self.grid.radii.len(), 0.0);
        curve
    }
}
