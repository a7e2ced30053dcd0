//! Wear rates on a mesh by both laws: local pressure times local slip, or the simplified rule (14).
//!
//! # Equations
//! In units of a₀, d₀ and N₀, with A the matrix of the [`mesh`](super::mesh), and Δ/Δ₀ = U/U(0):
//! ```text
//! exact        dw/dÑ = p·s·Δ/Δ₀,   p_j = (2/π) Σ D y A_·j / M_j,   A·s = ω
//! simplified   dg/dÑ = (ξ/ã)·η·ω·Δ/Δ₀  for x < ã,   η = d − g, signed       (14)
//! V = π Σ M w,   dV/dÑ = 2 Σ D y ω·Δ/Δ₀   (exact: to rounding)
//! ```
//! ã is the root of (13) with the present c and d. If every spring in contact slips, A·s = ω has
//! the closed solution s = (s₀ + w + const)/Δ. In a line contact the same holds with θ for Δ, 1 for Δ₀, and the slip of
//! the middle added to s.

mod worn;

use std::borrow::Cow;
use std::sync::Arc;

pub use self::worn::WornContact;
use super::plan::EXTENSION;
use super::rkc::Rates;
use super::springs::Aside;
use super::{Law, Mesh, MeshPlan, PriorWear, Springs, WearProblem};
use crate::contact::course::{Follower, Moment};
use crate::contact::{Contact, Geometry, Limit, Normal};
use crate::numeric::{Monotone, root};
use crate::solver::splits::WornCore;

/// Estimated number of multiplications to find ã, per piece of the shape: eight evaluations with
/// square roots and logarithms.
const SCAR_OPERATIONS: f64 = 400.0;

/// A contact and its wear rate.
#[derive(Debug, Clone)]
pub struct Wearing {
    /// The unworn contact.
    pub contact: Contact,
    pub(super) law: Law,
    /// The positions of the mesh nodes.
    pub(crate) plan: MeshPlan,
    /// The wear of earlier meshes.
    pub(crate) prior: Arc<PriorWear>,
    /// The springs in their present state.
    pub springs: Springs,
    /// Follows the course of the coefficients.
    pub(super) follower: Follower,
    /// The present wear coefficient, relative to that at cycle 0.
    wear_factor: f64,
    aside: Aside,
    /// Δ·s at the nodes before any wear on this mesh, if every spring slips.
    initial_slip: Vec<f64>,
    /// The slip s at the nodes.
    slip: Vec<f64>,
    /// 1/(2D) of the narrower cell next to each node. The product with s is an upper bound of the
    /// decay rate.
    stiffness: Vec<f64>,
    /// The present ã of the simplified rule.
    scar: f64,
    /// The largest ã of the simplified rule up to the start of the last step, and at the present time.
    widest: f64,
    /// The bound of the spectral radius at the last evaluation of the rates.
    radius: f64,
}

impl Wearing {
    /// Creates a contact with prior wear on a mesh.
    pub fn new(
        problem: WearProblem<'_>,
        (plan, prior): (MeshPlan, Arc<PriorWear>),
        cells: usize,
    ) -> Self {
        let WearProblem { contact, control, law } = problem;
        let mesh = Mesh::new(&contact.shape, &prior, plan.radii(cells));
        let level = match mesh.geometry {
            // If all of a line contact slips, θ is 1.
            Geometry::Line if mesh.is_whole => 0.0,
            _ => 1.0 - contact.threshold,
        };
        let rest: Vec<f64> = mesh.initial.iter().map(|g| g - level).collect();
        let initial_slip = mesh.solve(&rest);
        let slip = vec![0.0; cells + 1];
        let stiffness = (0..=cells)
            .map(|j| &mesh.widths[j.saturating_sub(1)..(j + 1).min(cells)])
            .map(|next| 0.5 / next.iter().copied().fold(f64::INFINITY, f64::min))
            .collect();
        let scar = contact.limit.radius;
        let springs = Springs::new(mesh, contact, control, &prior);
        let contact = contact.clone();
        let follower = Follower::new(contact.course.clone());
        let (widest, radius) = (0.0, 0.0);
        let aside = Aside::default();
        Self {
            contact,
            law,
            plan,
            prior,
            springs,
            follower,
            wear_factor: 1.0,
            aside,
            initial_slip,
            slip,
            stiffness,
            scar,
            widest,
            radius,
        }
    }

    /// Whether the scar fills the mesh and the mesh cannot grow.
    pub(crate) fn outgrows(&self) -> bool {
        self.plan.reach >= self.contact.shape.extent() && self.is_full()
    }

    /// Whether the wear has almost reached the end of the mesh.
    pub(crate) fn is_full(&self) -> bool {
        let cells = self.springs.mesh.widths.len();
        match self.law {
            _ if self.plan.reach >= self.plan.farthest => false,
            Law::Exact => self.springs.compressions.len() + 3 >= cells,
            Law::Simplified(_) => {
                let MeshPlan { start, reach, .. } = self.plan;
                self.scar > start + 0.97 * (reach - start)
            }
        }
    }

    /// The same contact on a larger mesh, and the values on this mesh.
    pub(crate) fn extended(&self, values: &[f64]) -> (Self, Vec<f64>) {
        let MeshPlan { start, reach, farthest, .. } = self.plan;
        let reach =
            (start + EXTENSION * (reach - start)).min(farthest).min(self.contact.shape.extent());
        let plan = MeshPlan { reach, ..self.plan.clone() };
        if self.contact.layers.is_some() {
            return self.with_dose(plan, values);
        }
        let cells = self.springs.mesh.widths.len();
        let larger = self.on(plan, Arc::clone(&self.prior));
        let (from, to) = (&self.springs.mesh, &larger.springs.mesh);
        let middles = |mesh: &Mesh| -> Vec<f64> {
            mesh.radii.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect()
        };
        let carried = match self.law {
            Law::Exact => {
                // After long gross slip the worn profile is almost flat, but the wear is not. An
                // error of 0.1 % of this wear exceeds the compression of the springs. Therefore
                // interpolate the profile or the wear, whichever varies less.
                let places = &from.places;
                let worn: Vec<f64> =
                    from.radii.iter().zip(values).map(|(r, w)| self.profile(*r) + w).collect();
                let of_wear = Monotone::through(places.clone(), values.to_vec());
                let of_worn = Monotone::through(places.clone(), worn.clone());
                let mut wear: Vec<f64> = to
                    .places
                    .iter()
                    .zip(&to.radii)
                    .map(|(t, r)| {
                        let next = places.partition_point(|known| known <= t).max(1);
                        if next > cells {
                            return 0.0;
                        }
                        let varies = |curve: &[f64]| (curve[next] - curve[next - 1]).abs();
                        if varies(&worn) < varies(values) {
                            (of_worn.at(*t) - self.profile(*r)).max(0.0)
                        } else {
                            of_wear.at(*t).max(0.0)
                        }
                    })
                    .collect();
                if to.starts_on_axis() || !to.is_whole {
                    wear[0] = 0.0;
                }
                // A shift of the wear restores V and keeps the profile flat.
                let start = if to.is_whole { 0.0 } else { to.places[0] };
                let share: Vec<f64> = to
                    .places
                    .iter()
                    .zip(&wear)
                    .map(|(t, w)| if *w > 0.0 { 1.0 - start / t } else { 0.0 })
                    .collect();
                let area = to.volume(&share);
                if area > 0.0 {
                    let shift = (from.volume(values) - to.volume(&wear)) / area;
                    for (w, share) in wear.iter_mut().zip(&share) {
                        *w = (*w + shift * share).max(0.0);
                    }
                }
                if to.starts_on_axis() {
                    wear[0] = wear[1];
                }
                wear
            }
            Law::Simplified(_) => {
                let known = middles(from);
                let end = known[cells - 1];
                let curve = Monotone::through(known, values[1..].to_vec());
                let here = middles(to);
                let worn = here.iter().map(|x| if *x < end { curve.at(*x) } else { 0.0 });
                std::iter::once(0.0).chain(worn).collect()
            }
        };
        (larger, carried)
    }

    /// The same contact of bodies with layers on another mesh, and the dose there.
    pub(super) fn with_dose(&self, plan: MeshPlan, dose: &[f64]) -> (Self, Vec<f64>) {
        let next = self.on(plan, Arc::clone(&self.prior));
        let (from, to) = (&self.springs.mesh, &next.springs.mesh);
        let of_dose = Monotone::through(from.places.clone(), dose.to_vec());
        let end = from.places[from.places.len() - 1];
        let at = |place: &f64| if *place < end { of_dose.at(*place) } else { 0.0 };
        let dose = to.places.iter().map(at).collect();
        (next, dose)
    }

    /// The wear of all meshes, from the wear at the nodes of this one and the outer radius of the scar.
    pub(super) fn total(&self, wear: &[f64], radius: f64) -> PriorWear {
        let Mesh { geometry, places, .. } = &self.springs.mesh;
        let profile = |t: f64| self.contact.shape.profile(geometry.radius(t));
        self.prior.with(*geometry, places, wear, radius, profile)
    }

    /// The mesh, and the wear on which it starts.
    pub fn surface(&self) -> (&Mesh, &PriorWear) {
        (&self.springs.mesh, &self.prior)
    }

    /// The profile before any wear on this mesh.
    fn profile(&self, r: f64) -> f64 {
        self.contact.shape.profile(r) + self.prior.at(self.springs.mesh.geometry.place(r))
    }

    /// The wear of all meshes so far, for the values of this one.
    pub(super) fn worn(&self, values: &[f64]) -> PriorWear {
        let wear = self.wear(values);
        let (_, radius) = self.radii(&wear, &self.springs.images);
        let total = self.total(&wear, radius);
        total.with_edge(self.springs.stick()).thinned(self.springs.mesh.widths.len())
    }

    /// The same contact on another mesh, which starts on the surface `worn`.
    pub(super) fn on(&self, plan: MeshPlan, worn: Arc<PriorWear>) -> Self {
        let (contact, control) = (&self.contact, &self.springs.control);
        let problem = WearProblem { contact, control, law: self.law };
        let mut next = Self::new(problem, (plan, worn), self.springs.mesh.widths.len());
        next.springs.resume(&self.springs);
        (next.scar, next.widest) = (self.scar, self.widest);
        next.follower = self.follower.clone();
        next
    }

    /// Sets the coefficients of friction and wear to those of a time.
    pub(super) fn set_time(&mut self, time: f64) {
        let Moment { friction, wear } = self.follower.at(time);
        (self.springs.friction, self.wear_factor) = (friction, wear);
    }

    /// The radius inside which all springs stick at the present amplitude, on the surface `worn`. It is 0
    /// in gross slip, and if the mesh cannot resolve it.
    pub(super) fn stick_edge(&mut self, values: &[f64], worn: &PriorWear) -> f64 {
        self.press(values);
        let Springs { depth, threshold, mesh, compressions, .. } = &self.springs;
        let surplus = |x: f64| depth - self.contact.shape.image(x) - worn.image(x) - threshold;
        let first = compressions.iter().position(|y| y < threshold).unwrap_or(compressions.len());
        let end = mesh.radii[mesh.radii.len() - 1];
        let (low, high) = (
            mesh.radii[first.saturating_sub(1)],
            mesh.radii[(first + 1).min(mesh.radii.len() - 1)],
        );
        let low = if first < 2 || surplus(low) <= 0.0 { 0.0 } else { low };
        let high = if surplus(high) >= 0.0 { end } else { high };
        if surplus(low) <= 0.0 || surplus(high) >= 0.0 {
            return 0.0;
        }
        let stick = root(low, high, surplus);
        let cells = mesh.widths.len();
        if stick < MeshPlan::smallest_core(end, cells) { 0.0 } else { stick }
    }

    /// The wear at the nodes that corresponds to the wear of the images. The rule does not wear the profile
    /// outside ã.
    fn inverse(&self, images: &[f64]) -> Vec<f64> {
        let mesh = &self.springs.mesh;
        let mut wear = mesh.inverse(images);
        let scar = self.widest;
        for (wear, r) in wear.iter_mut().zip(&mesh.radii) {
            *wear = if *r > scar { 0.0 } else { *wear };
        }
        wear
    }

    /// The present contact.
    pub(super) fn core(&self) -> WornCore {
        let Springs { depth, mesh, compressions, .. } = &self.springs;
        let edge = mesh.radii[compressions.len()];
        WornCore { depth: *depth, normal: self.springs.normal(), edge }
    }

    /// The nodes of all meshes so far, and the wear there for the given values.
    pub(super) fn wear_of(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (places, wear) = self.total(&self.wear(values), self.prior.radius).into_lists();
        let geometry = self.springs.mesh.geometry;
        (places.iter().map(|t| geometry.radius(*t)).collect(), wear)
    }

    /// Estimated number of multiplications of one evaluation of the wear rate.
    pub(crate) fn operations(&self) -> f64 {
        let cells = self.springs.mesh.widths.len() as f64;
        let scar = if self.law == Law::Exact || self.keeps_scar() { 0.0 } else { SCAR_OPERATIONS };
        cells * cells + scar * self.contact.shape.pieces() as f64
    }

    /// The stick radius c in the present state of the springs.
    fn stick(&self) -> f64 {
        if self.springs.control.keeps_stick(&self.contact) {
            self.contact.stick
        } else {
            self.springs.stick()
        }
    }

    /// Whether ã is constant.
    fn keeps_scar(&self) -> bool {
        let control = &self.springs.control;
        control.keeps_stick(&self.contact) && control.normal == Normal::Depth
    }

    /// ã in the present state of the springs.
    fn scar_radius(&self) -> f64 {
        if self.keeps_scar() {
            return self.contact.limit.radius;
        }
        Limit::scar(&self.contact.shape, self.stick(), self.springs.depth, self.scar)
    }

    /// Takes note of the present ã of the simplified rule.
    pub(super) fn widen(&mut self) {
        if self.law != Law::Exact && self.springs.threshold > 0.0 {
            self.widest = self.widest.max(self.scar_radius());
        }
    }

    /// Computes the state of the springs for the given values.
    pub fn press(&mut self, values: &[f64]) {
        match self.law {
            Law::Exact => self.springs.press_wear(&self.wear(values)),
            Law::Simplified(_) => {
                self.springs.press_images(&values[1..]);
                self.widen();
            }
        }
    }

    /// Evaluates `what` in the state of `values`, and then restores the present state `now`.
    pub fn under<T>(
        &mut self,
        (time, values): (f64, &[f64]),
        now: &[f64],
        what: impl FnOnce(&mut Self, &[f64]) -> T,
    ) -> T {
        let mut aside = std::mem::take(&mut self.aside);
        self.springs.set_aside(&mut aside);
        let (scar, widest, radius) = (self.scar, self.widest, self.radius);
        let wear_factor = self.wear_factor;
        self.set_time(time);
        self.press(values);
        let result = what(self, values);
        (self.scar, self.radius, self.wear_factor) = (scar, radius, wear_factor);
        self.springs.put_back(&mut aside);
        self.aside = aside;
        if self.law != Law::Exact {
            // The simplified rule uses the present ã, so compute the state again.
            self.press(now);
        }
        self.widest = widest;
        result
    }

    /// The wear at the nodes of this mesh. For bodies with layers, the values are the dose.
    pub(super) fn wear<'a>(&self, values: &'a [f64]) -> Cow<'a, [f64]> {
        match (self.law, &self.contact.layers) {
            (Law::Exact, None) => Cow::Borrowed(values),
            (Law::Exact, Some(layers)) => values.iter().map(|dose| layers.both(*dose)).collect(),
            (Law::Simplified(_), _) => Cow::Owned(self.inverse(&values[1..])),
        }
    }

    /// dV/dÑ from the dissipated energy: κ ∫ y ω dx·Δ/Δ₀.
    pub(crate) fn energy_rate(&self) -> f64 {
        self.springs.mesh.geometry.energy_factor() * self.springs.loss() * self.pace()
    }

    /// The dissipated energy per Ñ, as (k_w/μ)·W with the coefficients at cycle 0.
    pub(crate) fn power(&self) -> f64 {
        self.energy_rate() * (self.springs.friction / self.wear_factor)
    }

    /// The rates of the volume by energy and of the energy.
    pub(crate) fn energy_rates(&self) -> [f64; 2] {
        [self.energy_rate(), self.power()]
    }

    /// The present amplitude in m, relative to that of N₀, times the present wear coefficient: k·m·Δ/Δ₀.
    pub(crate) fn pace(&self) -> f64 {
        self.springs.threshold / self.contact.reference_threshold()
            * (self.springs.friction * self.wear_factor)
    }

    /// Computes the slip s at the nodes in contact.
    fn solve_slip(&mut self, wear: &[f64]) {
        let springs = &self.springs;
        let live = springs.compressions.len();
        let threshold = springs.threshold;
        if threshold == 0.0 {
            self.slip.fill(0.0);
            return;
        }
        let harmonic = !springs.control.has_record();
        let closed = harmonic
            && if springs.mesh.is_whole {
                springs.compressions.iter().all(|y| *y < threshold)
            } else {
                springs.control.keeps_stick(&self.contact)
            };
        if closed {
            // The change of Δ − d since the unworn contact. It is 0 except in gross slip, where Δ and d
            // may have changed.
            let rise = match springs.mesh.geometry {
                _ if !springs.mesh.is_whole => 0.0,
                Geometry::Round => (threshold - self.contact.threshold) - (springs.depth - 1.0),
                Geometry::Line => springs.middle - wear[0],
            };
            self.slip[0] = springs.middle / threshold;
            let per_threshold = 1.0 / threshold;
            let nodes = self.slip[1..=live].iter_mut().zip(&self.initial_slip[1..]).zip(&wear[1..]);
            for ((slip, initial), wear) in nodes {
                *slip = (initial + wear + rise).max(0.0) * per_threshold;
            }
            return;
        }
        springs.mesh.solve_into(&springs.slips[..live], &mut self.slip);
        let middle = springs.middle / threshold;
        for slip in &mut self.slip[..=live] {
            *slip = (*slip + middle).max(0.0);
        }
    }

    fn exact_rates(&mut self, values: &[f64], rates: &mut [f64]) {
        let wear = self.wear(values);
        self.springs.press_wear(&wear);
        self.solve_slip(&wear);
        let (springs, pace) = (&self.springs, self.pace());
        let mesh = &springs.mesh;
        mesh.pressure(&springs.compressions, rates);
        let live = springs.compressions.len();
        for (rate, slip) in rates[..=live].iter_mut().zip(&self.slip) {
            *rate *= slip * pace;
        }
        // This comparison is faster than `f64::max`, which also handles NaN.
        let bounds = self.slip[1..=live].iter().zip(&self.stiffness[1..]).map(|(s, k)| s * k);
        let steepest = self.contact.layers.as_ref().map_or(1.0, |layers| layers.steepest());
        self.radius = steepest
            * pace
            * bounds.fold(0.0, |most, bound| if bound > most { bound } else { most });
        rates[live + 1..].fill(0.0);
        if mesh.starts_on_axis() {
            rates[0] = rates[1];
        }
    }

    fn simplified_rates(&mut self, xi: f64, values: &[f64], rates: &mut [f64]) {
        self.springs.press_images(&values[1..]);
        if self.springs.threshold == 0.0 {
            rates.fill(0.0);
            return;
        }
        self.scar = self.scar_radius();
        let springs = &self.springs;
        let rate = xi / self.scar * self.pace();
        let radii = &springs.mesh.radii;
        rates[0] = 0.0;
        for (q, ((image, slip), ends)) in
            springs.images.iter().zip(&springs.slips).zip(radii.windows(2)).enumerate()
        {
            let inside = ((self.scar - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
            rates[q + 1] = rate * inside * (springs.depth - image) * slip;
        }
        self.radius = 2.0 * rate * springs.free_slip();
    }
}

impl Rates for Wearing {
    fn rates(&mut self, time: f64, values: &[f64], rates: &mut [f64]) {
        self.set_time(time);
        match self.law {
            Law::Exact => self.exact_rates(values, rates),
            Law::Simplified(xi) => self.simplified_rates(xi, values, rates),
        }
    }

    fn radius(&self) -> f64 {
        self.radius
    }

    fn most(&self) -> f64 {
        match (self.law, self.springs.control.drifts(&self.contact)) {
            // The compression of the springs, which determines the pressure, is much smaller than a
            // deep wear. Late in a run a core carries the load, and the springs outside carry ever
            // less.
            (Law::Exact, true) => {
                let even = self.springs.normal() / self.plan.reach;
                self.springs.compressions.iter().copied().fold(even, f64::max)
            }
            _ => f64::INFINITY,
        }
    }

    fn live(&self) -> usize {
        match self.law {
            Law::Exact => self.springs.compressions.len(),
            Law::Simplified(_) => self.springs.images.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::control::{Control, Held};
    use crate::contact::profile::Shape;
    use crate::contact::record::DisplacementRecord;
    use crate::contact::reference::Series;
    use crate::contact::row::UnwornSums;
    use crate::solver::stepped::rkc::Rkc;

    #[test]
    fn the_wear_rate_equals_the_dissipation_rate_for_every_control_and_shape() {
        let record =
            Arc::new(DisplacementRecord::new(&[1.0, -1.0, 0.6, -0.4, 0.8]).expect("motion"));
        let mut problems = Vec::new();
        for (shape, threshold) in [
            (Shape::power(2.0), 0.75),
            (Shape::power(1.0), 0.79),
            (Shape::sphere(2.0), 0.3),
            (Shape::power(2.0), 1.8),
        ] {
            let contact = Contact::new(shape, threshold).expect("a limit");
            let force = UnwornSums::of(&contact, None).tangential;
            for (normal, held) in [
                (Normal::Depth, Held::Threshold),
                (Normal::Force, Held::Threshold),
                (Normal::Depth, Held::Force(force)),
                (Normal::Force, Held::Force(force)),
                (Normal::Force, Held::Rig { amplitude: threshold + force, compliance: 0.5 }),
                (Normal::Depth, Held::Record(Arc::clone(&record))),
            ] {
                if threshold < 1.0 || !matches!(held, Held::Force(_)) {
                    problems.push((contact.clone(), Control::constant(normal, held, threshold)));
                }
            }
        }
        for shape in [Shape::line_power(2.0), Shape::line_power(1.0), Shape::punch(0.4)] {
            for (threshold, held) in [
                (0.75, Held::Threshold),
                (0.75, Held::Stroke(2.0)),
                (1.0, Held::Stroke(9.0)),
                (1.0, Held::Sliding(30.0)),
            ] {
                let reference = Some(Series { reach: 20.0, compliance: 0.1 });
                let contact = Contact::new(shape.clone(), threshold).expect("a limit");
                let control = Control::constant(Normal::Depth, held, threshold);
                problems.push((Contact { reference, ..contact }, control));
            }
        }
        for (contact, control) in problems {
            let plan = MeshPlan::first(&contact, &control, 64).expect("a scar that fits");
            let problem = WearProblem { contact: &contact, control: &control, law: Law::Exact };
            let mut wearing = Wearing::new(problem, (plan, Arc::default()), 64);
            let mut rkc = Rkc::new(&mut wearing, vec![0.0; 65], 3e-3, (1.0, 0.3));
            for _ in 0..40 {
                // dV/dÑ = κ ∫ y ω dx·Δ/Δ₀. The two sides are sums of different terms.
                let rate = wearing.energy_rate();
                let growth = wearing.springs.mesh.volume(&rkc.rates);
                assert!((growth - rate).abs() <= 1e-12 * rate, "{growth} {rate} {control:?}");
                if wearing.springs.slides {
                    break;
                }
                rkc.advance(&mut wearing, f64::INFINITY);
            }
        }
    }
}
