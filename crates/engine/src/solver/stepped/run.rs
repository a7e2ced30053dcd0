//! One contact on one mesh, integrated in time.

use std::sync::Arc;

use super::plan::Focus;
use super::rkc::Rkc;
use super::{Law, MeshPlan, PriorWear, WearProblem, Wearing, WornContact};
use crate::contact::row::unworn_integrals;
use crate::contact::{Block, Contact, Control, Geometry, Held, Limit, Normal, Over, Regime};
use crate::numeric::{largest, root_between};

/// The estimated error of V if a stick edge lies at the border of two cells. The unit is the change
/// of V when the stick edge moves by one cell.
/// The expected position error is half a cell.
const EDGE_SHARE: f64 = 0.75;
/// A run has settled if the wear, at the present rate, would grow by less than this share of the
/// tolerance over the duration of the run so far.
const SETTLED: f64 = 1e-3;
/// A contact that carries less than this share of its initial force has settled.
const VANISHED: f64 = 1e-6;
/// The energy rate within a step should lie between its values at the two ends. If the interpolated
/// rate is outside by more than this factor, the interpolation is noise. Noise occurs late in a
/// run, when a core carries almost the whole load.
const NOISY: f64 = 1.1;
/// Maximum Δ at which a contact in gross slip at constant force can start to stick again.
const REGAINS: f64 = 1.5;

/// A tip or an edge is blunt if it is worn as deep as the unworn profile is at this distance from it.
const BLUNT: f64 = 0.35;
/// The relative error of the depth at the edge of a flat, and at a tip, if the profile is much higher in one cell than the
/// wear is deep.
const EDGE_AND_TIP: (f64, f64) = (0.3, 1.2);
/// What remains of this error after the tip has become blunt.
const BLUNTED: f64 = 5e-4;
/// If the profile is lower in one cell than this share of the wear, the error decreases with the square.
const RESOLVED: f64 = 0.15;
/// If a coefficient changes: the maximum difference of the two volumes of a step, in units of the tolerance of the steps,
/// as a share of the volume of the step and of the volume so far. The same holds for the extrapolated energy.
const AGREEMENT: (f64, f64) = (1.0, 1e-4);
/// Relative accuracy of the time at which an energy is reached.
const TIME_DIGITS: f64 = 1e-13;

/// What a coarse run has found about a block, or about the whole run without blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outlook {
    /// The last node at the end of the block.
    pub(super) reach: f64,
    /// The outermost position of the stick edge, where nodes are dense.
    pub(super) focus: f64,
    /// The blur of the nodes there, in widths of the wearing ring.
    pub(super) blur: f64,
}

impl Outlook {
    /// Applies it to the plan of the mesh.
    pub(super) fn refine(&self, plan: &mut MeshPlan) {
        plan.reach = self.reach;
        if self.focus > plan.start {
            let blur = self.blur * (plan.reach - plan.start);
            plan.focus = Some(Focus { from: self.focus, to: self.focus, blur });
        }
    }
}

/// Why a run goes no further.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stop {
    /// Wear has practically stopped.
    Settled,
    /// The scar has reached the rim of the shape.
    Outgrown,
}

/// One integration. Each block has a mesh of its own.
#[derive(Debug)]
pub(super) struct MeshRun {
    pub(super) wearing: Wearing,
    pub(super) rkc: Rkc,
    /// Why it goes no further, if it does not.
    pub(super) stopped: Option<Stop>,
    /// The index of the present block.
    pub(super) block: usize,
    /// What is known about each block. It may be shorter than the list of blocks.
    outlooks: Arc<[Option<Outlook>]>,
    /// The smallest stick radius so far.
    least_stick: f64,
    /// The mesh after the tip has become blunt. `None` if it is blunt already.
    blunt: Option<MeshPlan>,
    /// The time at which the present block started.
    block_began: f64,
    /// The width of the cell in which the mesh before had the present stick edge. It is 0 without wear there.
    edge_width: f64,
    /// Scar radius and slip amplitude Δ·s at its edge, at the end of each block so far.
    pub(super) block_edges: Vec<(f64, f64)>,
    /// Whether the last step skipped the rest of a block after shakedown.
    pub(super) rests: bool,
    /// ∫ (k_w/μ) dW = 2 ∫ ∫ y ω dx dÑ at the start and at the end of the last step.
    worn_by_energy: [f64; 2],
    /// (k_w/μ)·ΣW with the coefficients at cycle 0, at the start and at the end of the last step.
    dissipated: [f64; 2],
    /// 2 ∫ y ω dx at the start and at the end of the last step.
    pub(super) loss: [f64; 2],
    /// The power, (k_w/μ)·W with the coefficients at cycle 0, at the start and at the end of the last step.
    power: [f64; 2],
    /// 2 ∫ y ω dx·Δ/Δ₀ of the unworn contact at the present amplitude.
    pub(super) unworn_loss: f64,
    /// Whether the result reports the energy of this run, so that the energy must be accurate.
    pub(super) accounts: bool,
}

/// Whether the stick edge moves and more cells are needed. At a constant depth it stays where it is
/// during a block. Just above the gross-slip threshold, a contact at constant force starts to stick
/// again.
pub(super) fn moves(control: &Control, contact: &Contact) -> bool {
    let slips = contact.regime == Regime::GrossSlip;
    let stays = !control.drifts(contact) && control.varies();
    contact.changes_friction()
        || !control.keeps_stick(contact)
            && !stays
            && (!slips || control.drifts(contact) && contact.threshold < REGAINS)
}

/// The wear at which the amplitude of a contact on a rig doubles at constant d. As the tangential
/// force decreases, the rig deforms less and the contact moves more.
fn quickens(contact: &Contact, control: &Control) -> f64 {
    match *control.held() {
        Held::Rig { compliance, .. } if control.normal == Normal::Depth => {
            0.5 * contact.threshold / compliance
        }
        _ => f64::INFINITY,
    }
}

/// The mesh for the beginning, and the mesh after a sharp tip or edge has become blunt. Only in gross slip
/// (`slips`) the tip wears.
fn with_sharp_tip(plan: MeshPlan, contact: &Contact, slips: bool) -> (MeshPlan, Option<MeshPlan>) {
    match plan.while_sharp(contact).filter(|_| slips) {
        Some(sharp) => (sharp, Some(plan)),
        None => (plan, None),
    }
}

/// Whether wear of this depth has made the shape blunt.
fn is_blunt(contact: &Contact, depth: f64) -> bool {
    let sharp = contact.shape.sharp_radius();
    sharp.is_none_or(|radius| depth >= contact.shape.profile(radius + BLUNT))
}

/// 2 ∫ y ω dx·Δ/Δ₀ of the unworn contact at the amplitude `threshold`.
fn unworn_loss(contact: &Contact, threshold: f64) -> f64 {
    let shape = &contact.shape;
    let (_, energy) = unworn_integrals(shape, shape.stick_radius(threshold), threshold);
    contact.shape.geometry().energy_factor() * energy / contact.reference_threshold()
}

/// The time scale is one sixth of the time in which the initial wear rate would produce the limiting
/// volume. The size is that of the expected wear.
fn time_and_size(limit: &Limit, rate: f64, most: f64) -> (f64, f64) {
    (limit.volume / (6.0 * rate), limit.depth.min(most))
}

impl MeshRun {
    pub(super) fn new(
        problem: WearProblem<'_>,
        (plan, outlooks): (MeshPlan, Arc<[Option<Outlook>]>),
        (cells, tolerance): (usize, f64),
    ) -> Self {
        let WearProblem { contact, control, law } = problem;
        let least_stick = plan.start;
        let slips = contact.stick == 0.0 && law == Law::Exact;
        let (plan, blunt) = with_sharp_tip(plan, contact, slips);
        let mut wearing = Wearing::new(problem, (plan, Arc::default()), cells);
        let unworn = vec![0.0; cells + 1];
        wearing.press(&unworn);
        let rate = wearing.energy_rate();
        wearing.follower.record((0.0, 0.0), 0.0, [rate; 2]);
        let scales = time_and_size(&contact.limit, rate, quickens(contact, control));
        let rkc = Rkc::new(&mut wearing, unworn, tolerance, scales);
        Self {
            wearing,
            rkc,
            stopped: None,
            block: 0,
            outlooks,
            least_stick,
            blunt,
            block_began: 0.0,
            edge_width: 0.0,
            block_edges: Vec::new(),
            rests: false,
            worn_by_energy: [0.0; 2],
            dissipated: [0.0; 2],
            loss: [rate; 2],
            power: [rate; 2],
            unworn_loss: rate,
            accounts: false,
        }
    }

    pub(super) fn advance(&mut self, until: f64) -> bool {
        if self.stopped.is_some() || self.rkc.time >= until || self.wearing.springs.slides {
            return false;
        }
        let end = self.begin_block();
        if self.wearing.is_full() {
            if self.wearing.outgrows() {
                self.stopped = Some(Stop::Outgrown);
                return false;
            }
            let (wearing, values) = self.wearing.extended(&self.rkc.values);
            self.wearing = wearing;
            self.restart(Some(values));
        }
        self.leave_the_tip();
        if self.wearing.follower.enter(self.rkc.time, self.dissipated[1]) {
            self.restart(None);
            self.rkc.hurry(self.wearing.pace());
        }
        if end.is_finite() && self.has_arrived(end) {
            // The contact does not change until the next block starts.
            self.rkc.rest_until(end);
            self.worn_by_energy[0] = self.worn_by_energy[1];
            self.dissipated[0] = self.dissipated[1];
            self.rests = true;
            return true;
        }
        self.rests = false;
        self.wearing.widen();
        let next = self.rkc.time * (1.0 + 4.0 * f64::EPSILON);
        let until = end.min(self.wearing.follower.step_end().max(next));
        loop {
            self.rkc.advance(&mut self.wearing, until);
            if self.account() {
                break;
            }
            self.rkc.retreat(&mut self.wearing);
        }
        if end.is_infinite() && self.has_arrived(end) {
            self.stopped = Some(Stop::Settled);
        }
        true
    }

    /// Continues with a changed right-hand side, or from other values.
    fn restart(&mut self, values: Option<Vec<f64>>) {
        self.rkc.restart(&mut self.wearing, values);
        self.renew_rates();
    }

    /// Takes note of the rates after a change of the contact.
    fn renew_rates(&mut self) {
        self.loss = [self.wearing.energy_rate(); 2];
        self.power = [self.wearing.power(); 2];
        let now = (self.rkc.time, self.rkc.time);
        self.wearing.follower.record(now, self.dissipated[1], self.power);
    }

    /// Adds the energy of the last step. Returns false if the step is too long for a friction that changes.
    fn account(&mut self) -> bool {
        let (began, time) = (self.rkc.began(), self.rkc.time);
        let kept = (self.loss, self.power);
        self.loss = [self.loss[1], self.wearing.energy_rate()];
        self.power = [self.power[1], self.wearing.power()];
        let changes = self.wearing.follower.is_changing();
        let [worn, dissipated] = if self.accounts || changes {
            self.energies_since(began, time, [self.loss[1], self.power[1]])
        } else {
            [self.loss, self.power].map(|ends| 0.5 * (time - began) * (ends[0] + ends[1]))
        };
        if changes && !self.agrees(worn, dissipated) {
            (self.loss, self.power) = kept;
            return false;
        }
        self.worn_by_energy = [self.worn_by_energy[1], self.worn_by_energy[1] + worn];
        self.dissipated = [self.dissipated[1], self.dissipated[1] + dissipated];
        self.wearing.follower.record((began, time), self.dissipated[1], self.power);
        true
    }

    /// Whether the last step was short enough for coefficients that change. `worn` is the volume by its energy, and
    /// `dissipated` the energy.
    ///
    /// If the friction changes, the slip around the stick zone changes with it, even when the wear is too small for
    /// the error of a step to show it. Coefficients over the energy were taken at an extrapolated energy.
    fn agrees(&self, worn: f64, dissipated: f64) -> bool {
        let Self { wearing, rkc, .. } = self;
        let mesh = &wearing.springs.mesh;
        let step = mesh.volume(&rkc.values) - mesh.volume(rkc.values_before());
        let energy = self.dissipated[1] + dissipated;
        let agree = |difference: f64, part: f64, before: f64| {
            difference.abs() <= rkc.tolerance * (AGREEMENT.0 * part + AGREEMENT.1 * before)
        };
        let extrapolated = wearing.follower.energy(rkc.time);
        agree(step - worn, worn, self.worn_by_energy[1])
            && agree(extrapolated - energy, dissipated, self.dissipated[1])
            || rkc.is_shortest()
    }

    /// The held quantities.
    pub(super) fn control(&self) -> &Control {
        &self.wearing.springs.control
    }

    /// Whether a core sticks during the whole run.
    pub(super) fn keeps_core(&self) -> bool {
        self.control().keeps_stick(&self.wearing.contact) && self.wearing.contact.stick > 0.0
    }

    /// Whether the wear so far decides where the stick edge comes to rest.
    pub(super) fn keeps_errors(&self) -> bool {
        let control = self.control();
        control.drifts(&self.wearing.contact) && moves(control, &self.wearing.contact)
    }

    /// (k_w/μ)·ΣW with the coefficients at cycle 0, at the end of the last step.
    pub(super) fn energy(&self) -> f64 {
        self.dissipated[1]
    }

    /// The time within the last step at which (k_w/μ)·ΣW reaches `energy`.
    pub(super) fn time_of(&mut self, energy: f64) -> f64 {
        let (began, time) = (self.rkc.began(), self.rkc.time);
        let [before, after] = self.dissipated;
        if energy <= before {
            return began;
        }
        let missing = |time: f64| self.energies_until(time)[1] - energy;
        root_between(TIME_DIGITS, (began, before - energy), (time, after - energy), missing)
    }

    /// Whether wear has practically stopped at the present amplitude, which is constant until
    /// `end`.
    fn has_arrived(&self, end: f64) -> bool {
        let follower = &self.wearing.follower;
        if self.wearing.springs.share() < VANISHED {
            return true;
        }
        if follower.changes_over(Over::Time) {
            // Another coefficient of friction can start the wear again.
            return false;
        }
        // So can a coefficient over the energy, unless there is hardly any energy to come.
        let (rate, sum) = if follower.changes_over(Over::Energy) {
            (self.power[1], self.dissipated[1])
        } else {
            (self.wearing.energy_rate(), self.worn_by_energy[1])
        };
        let time = self.rkc.time;
        let lasted = time - self.block_began;
        let negligible = SETTLED * self.rkc.tolerance * sum;
        // The rate is conclusive only after the block has lasted at least the time scale.
        let tells = lasted * self.wearing.pace() >= self.rkc.scale;
        lasted > 0.0
            && (rate == 0.0
                || tells && rate * lasted <= negligible
                || rate * (end - time) <= negligible)
    }

    /// Sets the next amplitude if a block has ended, and returns the end of the present block.
    fn begin_block(&mut self) -> f64 {
        let blocks = Arc::clone(&self.control().blocks);
        let Some(present) = blocks.get(self.block) else { return f64::INFINITY };
        if self.rkc.time < present.end {
            return present.end;
        }
        self.block += 1;
        let Some(next) = blocks.get(self.block) else { return f64::INFINITY };
        if self.accounts {
            let worn = self.wearing.at(&self.rkc.values);
            let slip = worn.friction * worn.edge_slip(&self.wearing.springs.mesh);
            self.block_edges.push((worn.scar, slip));
        }
        self.block_began = self.rkc.time;
        self.change_amplitude(next);
        self.renew_rates();
        next.end
    }

    /// Changes the mesh when the tip or the edge of the shape has become blunt.
    fn leave_the_tip(&mut self) {
        if self.blunt.is_none() {
            return;
        }
        let Wearing { contact, prior, .. } = &self.wearing;
        let most = self.rkc.values.iter().copied().fold(0.0, f64::max);
        // Where a layer is worn through, the tip is as sharp as it was.
        let depth = contact.layers.as_ref().map_or(most, |layers| layers.beyond(most));
        if !is_blunt(contact, depth + prior.at(0.0)) {
            return;
        }
        if let Some(mut plan) = self.blunt.take() {
            plan.reach = plan.reach.max(self.wearing.plan.reach);
            if self.wearing.contact.layers.is_some() {
                // The dose goes on, because the layers count it from the surface.
                let (wearing, dose) = self.wearing.with_dose(plan, &self.rkc.values);
                self.wearing = wearing;
                self.restart(Some(dose));
                return;
            }
            self.change_mesh(plan, self.wearing.worn(&self.rkc.values));
        }
    }

    /// Continues on another mesh, which starts on the surface `worn`.
    fn change_mesh(&mut self, plan: MeshPlan, worn: PriorWear) {
        self.wearing = self.wearing.on(plan, Arc::new(worn));
        let nodes = self.wearing.springs.mesh.radii.len();
        self.rkc.restart(&mut self.wearing, Some(vec![0.0; nodes]));
    }

    /// Starts a block on a mesh of its own.
    fn change_amplitude(&mut self, block: &Block) {
        self.wearing.springs.block.clone_from(block);
        self.unworn_loss = unworn_loss(&self.wearing.contact, block.threshold);
        if block.threshold == 0.0 || self.wearing.springs.share() < VANISHED {
            // Nothing wears. On another mesh, a lost contact would touch again by the error of the mesh.
            self.rkc.restart(&mut self.wearing, None);
            return;
        }
        let Self { wearing, rkc, .. } = self;
        let cells = wearing.springs.mesh.widths.len();
        let worn = wearing.worn(&rkc.values);
        // If friction falls during the block, or an aperture is held, the edge moves inwards.
        let moves_in = matches!(block.held, Held::Aperture(_));
        let stick = if moves_in || wearing.contact.changes_friction() {
            0.0
        } else {
            wearing.stick_edge(&rkc.values, &worn)
        };
        let mesh = &wearing.springs.mesh;
        let is_worn = stick > mesh.radii[0] && worn.at(mesh.geometry.place(stick)) > 0.0;
        self.edge_width = if is_worn { mesh.width_at(stick) } else { 0.0 };
        let grows = stick < self.least_stick;
        self.least_stick = self.least_stick.min(stick);
        let shape = &wearing.contact.shape;
        let limit = Limit::at_depth(shape, self.least_stick, wearing.springs.depth);
        // A line contact that slips as a whole has no limiting scar.
        let unlimited = match shape.geometry() {
            Geometry::Round => shape.extent(),
            Geometry::Line => wearing.contact.limit.radius.min(shape.extent()),
        };
        let reach = limit.map_or(unlimited, |limit| limit.radius).max(worn.radius);
        let control = &wearing.springs.control;
        let mut plan = MeshPlan::of_block(&wearing.contact, control, (stick, reach), cells);
        if let Some(outlook) = self.outlooks.get(self.block).copied().flatten() {
            outlook.refine(&mut plan);
        }
        plan.old_edge = worn.edge_between(stick, plan.reach);
        if self.blunt.is_none() && plan.is_like(&wearing.plan) {
            self.rkc.restart(&mut self.wearing, None);
            self.rkc.hurry(self.wearing.pace());
            return;
        }
        let contact = &wearing.contact;
        let slips = stick == 0.0 && wearing.law == Law::Exact;
        let (plan, blunt) =
            with_sharp_tip(plan, contact, slips && !is_blunt(contact, worn.at(0.0)));
        self.blunt = blunt;
        self.change_mesh(plan, worn);
        if let Some(limit) = limit.filter(|_| grows) {
            let rate = self.wearing.energy_rate();
            let scales = time_and_size(&limit, rate, f64::INFINITY);
            (self.rkc.scale, self.rkc.size) = scales;
        }
        self.rkc.hurry(self.wearing.pace());
    }

    /// The volume by energy and the energy between the start of the last step and a later time within the step, by
    /// Simpson's rule. `last` are their rates at this time.
    fn energies_since(&mut self, began: f64, time: f64, last: [f64; 2]) -> [f64; 2] {
        if self.rests {
            return [0.0; 2];
        }
        let middle = self.under(0.5 * (began + time), |wearing, _| wearing.energy_rates());
        let first = [self.loss[0], self.power[0]];
        std::array::from_fn(|i| (time - began) / 6.0 * (first[i] + 4.0 * middle[i] + last[i]))
    }

    /// ∫ (k_w/μ) dW, and (k_w/μ)·ΣW with the coefficients at cycle 0, at a time within the last step.
    pub(super) fn energies_until(&mut self, time: f64) -> [f64; 2] {
        let last = self.under(time, |wearing, _| wearing.energy_rates());
        let [worn, dissipated] = self.energies_since(self.rkc.began(), time, last);
        [self.worn_by_energy[0] + worn, self.dissipated[0] + dissipated]
    }

    /// Evaluates `what` in the state at a time within the last step.
    pub(super) fn under<T>(
        &mut self,
        time: f64,
        what: impl FnOnce(&mut Wearing, &[f64]) -> T,
    ) -> T {
        if time >= self.rkc.time {
            // The springs already have this state.
            return what(&mut self.wearing, &self.rkc.values);
        }
        let (rkc, [first, last]) = (&self.rkc, self.loss);
        let noise = |rate: f64| rate > NOISY * first.max(last) || rate < first.min(last) / NOISY;
        let mut more = 0;
        let found = self.wearing.under((time, &rkc.at(time)), &rkc.values, |wearing, values| {
            if !noise(wearing.energy_rate()) {
                return what(wearing, values);
            }
            let (values, evaluations) = rkc.again(wearing, time);
            more = evaluations;
            wearing.press(&values);
            what(wearing, &values)
        });
        self.rkc.evaluations += more;
        found
    }

    /// The error of V that occurs because a resting stick edge lies at the border of two cells.
    pub(super) fn edge_error(&self, worn: &WornContact) -> f64 {
        let (contact, control) = (&self.wearing.contact, self.control());
        let rests = !control.drifts(contact) || !moves(control, contact);
        // With a coefficient of friction that changes, an edge that has not appeared may never appear.
        let has_none = worn.stick == 0.0 && contact.changes_friction();
        if rests || has_none || worn.threshold == 0.0 || worn.stick >= 1.0 {
            return 0.0;
        }
        // The edge is not known better than the surface on which the block has started.
        let width = self.wearing.springs.mesh.width_at(worn.stick).max(self.edge_width);
        // In the limiting state the core carries the whole load.
        let last = |stick: f64| {
            let depth = control.depth_on_core(&contact.shape, stick);
            Limit::at_depth(&contact.shape, stick, depth).map(|limit| limit.volume)
        };
        let (Some(here), Some(there)) = (last(worn.stick), last(worn.stick + width)) else {
            return 0.0;
        };
        let share = (worn.volume / here).min(1.0);
        // The edges of earlier blocks are at the starts of their meshes.
        let here_worn = 1.0 - self.wearing.prior.volume() / worn.volume;
        EDGE_SHARE * (1.0 - there / here).abs() * share * share * here_worn
    }

    /// The error of the largest depth while the cells at a sharp tip or edge are too wide for the wear there.
    pub(super) fn tip_error(&self, worn: &WornContact) -> f64 {
        let Wearing { contact, springs, .. } = &self.wearing;
        let shape = &contact.shape;
        // If friction falls, the tip wears on a mesh that was not made for it, until the contact sticks again.
        let had_edge = contact.changes_friction() && contact.stick > 0.0;
        let wears = had_edge || springs.stick() == 0.0;
        let Some(sharp) = shape.sharp_radius().filter(|_| wears) else { return 0.0 };
        if self.blunt.is_none() && !had_edge {
            return BLUNTED;
        }
        let mesh = &springs.mesh;
        // In gross slip, the wear is deepest at the tip or the edge.
        let here = if springs.stick() == 0.0 {
            worn.deepest
        } else {
            let place = mesh.geometry.place(sharp);
            let next = worn.places.partition_point(|known| *known <= place);
            worn.wear[next.saturating_sub(1)]
        };
        if here <= 0.0 {
            return 0.0;
        }
        // Where a layer is worn through, the wear below it counts.
        let here = here - contact.layers.as_ref().map_or(0.0, |layers| layers.passed(here));
        let height = |r: f64| shape.profile(r) - shape.profile(sharp);
        // The height of the profile in one cell, relative to the wear.
        let ratio = height(sharp + mesh.width_at(sharp)) / here;
        let share = if sharp > 0.0 { EDGE_AND_TIP.0 } else { EDGE_AND_TIP.1 };
        let error = share * ratio * ratio / ((ratio + RESOLVED) * (1.0 + ratio));
        ((1.0 + error) * here / worn.deepest - 1.0).clamp(0.0, error)
    }

    /// The error of V that occurs because the mesh neglects a core smaller than the cells, at
    /// constant d.
    pub(super) fn core_error(&self, worn: &WornContact) -> f64 {
        let (contact, control) = (&self.wearing.contact, self.control());
        let least = control.least_stick(contact);
        let resolved = least == 0.0 || self.wearing.plan.start > 0.0;
        if control.drifts(contact) || resolved || self.block > 0 {
            return 0.0;
        }
        let last = |stick: f64| Limit::solve(&contact.shape, stick).map(|limit| limit.volume);
        let (Some(without), Some(with)) = (last(0.0), last(least)) else {
            return 0.0;
        };
        (without / with - 1.0) * (worn.volume / with).min(1.0)
    }

    /// The largest dose at a time within the last step, and its radius.
    pub(super) fn deepest_dose(&self, time: f64) -> (f64, f64) {
        let values = self.rkc.at(time);
        let most = largest(&values);
        (values[most], self.wearing.springs.mesh.radii[most])
    }

    /// The wear volume and the largest wear depth.
    pub(super) fn volume_and_depth(&mut self, time: f64) -> (f64, f64) {
        let time = self.within(time);
        if self.wearing.law != Law::Exact {
            return self.under(time, |wearing, values| {
                wearing.widen();
                wearing.volume_and_depth(values)
            });
        }
        if time >= self.rkc.time {
            return self.wearing.volume_and_depth(&self.rkc.values);
        }
        self.wearing.volume_and_depth(&self.rkc.at(time))
    }

    /// `time`, but at most the time of the last step if the run has settled or ended. Afterwards
    /// the state is constant.
    pub(super) fn within(&self, time: f64) -> f64 {
        if self.stopped.is_some() || self.wearing.springs.slides {
            time.min(self.rkc.time)
        } else {
            time
        }
    }
}
