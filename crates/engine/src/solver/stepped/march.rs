//! A run of a contact in time steps, with an error estimate and events.
//!
//! A second run with half as many cells accompanies each run, at little extra cost. The difference
//! between the two runs gives the error estimate of V. If the stick edge moves outwards into worn
//! material, a coarse run first finds its final position, and the mesh is refined there.
//!
//! # Accuracy
//! Second order in the number of cells. The default tolerance uses 52 cells. The command
//! `fretwork verify --random` measures the errors: 0.03 % of V and 0.05 % of the largest depth in the
//! median. The depth has first order at a tip or at the edge of a flat when gross slip begins, and for
//! blunt profiles (n ≥ 8) at the start of wear, when the ring is narrow. The mesh neglects a sticking
//! core smaller than the first cells (c below 1e-3).
//!
//! # Sources
//! The procedure: A. V. Dimaki et al., *Int. J. Solids Struct.* 51 (2014) 4215. The integrator:
//! B. P. Sommeijer, L. F. Shampine, J. G. Verwer, *J. Comput. Appl. Math.* 88 (1998) 315 (RKC).

use std::sync::Arc;

use super::edge::ContactEdge;
use super::plan::{FAR, REST_BLUR, is_far};
use super::run::{Outlook, Stop, moves};
use super::shares::BodyShares;
use super::{Law, MeshPlan, MeshRun, WearProblem, Wearing, WornContact};
use crate::contact::layers::Interface;
use crate::contact::{Contact, Control, DEEPEST, Final, Held, Limit, Normal, Regime, WIDEST};
use crate::numeric::root;
use crate::solver::errors::RunErrors;
use crate::solver::events::{CORE, Event, EventKind, LOST, SHAKEN, StopCondition, WornThrough};
use crate::solver::splits::SplitWatch;

/// Number of cells at the tolerance `COMMON_TOLERANCE`. The error decreases with the square of the
/// number of cells.
const COMMON_CELLS: f64 = 52.0;
/// Tolerance for `COMMON_CELLS` cells.
const COMMON_TOLERANCE: f64 = 3e-3;
/// Minimum and maximum number of cells.
const CELLS_RANGE: (f64, f64) = (24.0, 360.0);
/// Tolerance of the time steps, as a share of the tolerance of the run. Late in a run the contact loses little energy,
/// and the errors of all earlier steps would otherwise exceed the error of the mesh.
const STEPS: f64 = 0.5;
/// Maximum number of cells if the stick edge moves.
const MOST_CELLS: usize = 512;
/// The fine and the coarse run are compared at times that grow by this factor.
const CHECKS: f64 = 1.3;
/// At each comparison, the previous differences of the volume and of the depth are multiplied by these factors, and
/// kept if they are then still larger than the new ones. A new difference alone is not enough, because it can be 0 by
/// chance when it changes its sign.
const FORGET: (f64, f64) = (0.7, 0.5);
/// Error estimate divided by the difference of the two runs, for the volume and the depth. For a method of second
/// order, the error of the fine run is a third of the difference, so this estimate usually exceeds the error. A test
/// counts how often it does.
const SHARES: (f64, f64) = (0.95, 1.05);
/// Safety factor of both estimates in a thin ring, which has few cells, and the difference of the depths there above which it is
/// mostly the error of the coarse run.
const THIN_SAFETY: f64 = 1.5;
const THIN_COARSE: f64 = 0.15;
/// Relative difference of the depths above which the difference is mostly the error of the coarse run, which has few
/// cells in a narrow ring or at a tip. The first number applies in general, the second in later blocks.
const COARSE: (f64, f64) = (0.032, 0.05);
/// Minimum error estimates, in units of the tolerance of the time steps: in general, and for later blocks under a held
/// force.
const LEAST_ERRORS: (f64, f64) = (0.3, 0.6);
/// Number of cells and tolerance of the coarse run that finds the final position of the stick edge.
const SCOUT: (usize, f64) = (64, 1e-2);
/// The same for a run with blocks, in which each block has its own mesh.
const BLOCK_SCOUT: (usize, f64) = (44, 1e-2);
/// Maximum number of evaluations of the wear rate in a coarse run.
const MOST_LOOKS: usize = 100_000;
/// The scar certainly fits if its radius is at most this share of the radius of the indenter.
const ROOMY: f64 = 0.7;
/// A run with its error estimate and its events.
#[derive(Debug)]
pub struct March {
    fine: MeshRun,
    coarse: MeshRun,
    /// The edge of the contact, if the law is exact.
    edge: Option<ContactEdge>,
    /// `None` if the contact cannot split.
    splits: Option<SplitWatch>,
    /// The interfaces of layers that are not yet worn through.
    interfaces: Vec<Interface>,
    /// The condition that ends the run.
    pub(crate) until: StopCondition,
    /// How the bodies share the wear, if that is known.
    shares: Option<BodyShares>,
    /// The time of the next comparison.
    check: f64,
    /// The relative differences of the two runs so far.
    apart: RunErrors,
    /// The number of blocks whose end both runs have reached.
    left_blocks: usize,
    /// The largest error of V that remains from the stick edges of these blocks.
    old_edges: f64,
    /// V of the fine run at the last comparison.
    volume: f64,
    events: Vec<Event>,
    /// Events that have happened, and events that the run does not search for.
    known: Vec<EventKind>,
    /// The index of the block in the last step.
    block: usize,
    /// Whether the contact was in gross slip after the last step.
    slips: bool,
    /// The largest stick radius of the present block so far.
    core: f64,
    /// The expected outer radius of the last mesh.
    reach: f64,
}

/// The worn contact at one time, and the error of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct MarchState {
    /// The worn contact.
    pub worn: WornContact,
    /// The estimated errors.
    pub errors: RunErrors,
    /// (k_w/μ)·ΣW, summed separately. For the exact law this number should equal V.
    pub worn_by_energy: f64,
    /// (k_w/μ)·ΣW with the coefficients at cycle 0.
    pub dissipated: f64,
    /// The wear depth of each body, if the run shares it.
    pub depths: Option<[f64; 2]>,
}

/// The number of cells for a tolerance.
fn cells(tolerance: f64) -> usize {
    let cells = COMMON_CELLS * (COMMON_TOLERANCE / tolerance).sqrt();
    cells.clamp(CELLS_RANGE.0, CELLS_RANGE.1).round() as usize
}

/// The number of blocks that need a mesh of their own after the first. Successive blocks in gross slip share a mesh.
fn further_meshes(control: &Control) -> usize {
    let pairs = control.blocks.windows(2);
    pairs.filter(|pair| pair.iter().any(|block| block.threshold < 1.0)).count()
}

/// Number of cells and step tolerance of a run with this tolerance.
fn effort(problem: WearProblem<'_>, tolerance: f64) -> (usize, f64) {
    let WearProblem { contact, control, law } = problem;
    let cells = cells(tolerance);
    let far = control.tends_to(contact).is_some_and(|end| is_far(contact, &end));
    let steps = match law {
        Law::Exact => STEPS * tolerance,
        Law::Simplified(_) => tolerance,
    };
    if control.varies() {
        // More cells are needed at the stick edges that earlier blocks have left, and where the present stick edge
        // moves.
        let more = if control.drifts(contact) { 5 * cells / 3 } else { 3 * cells / 2 };
        return (more.min(MOST_CELLS), steps);
    }
    if !moves(control, contact) && !far {
        return (cells, steps);
    }
    let gives_way = control.normal == Normal::Depth
        && matches!(control.held(), Held::Force(_))
        && control.tends_to(contact).is_none();
    let (cells, finer) = match law {
        // The time at which the core vanishes is ill-conditioned: its relative error is about ten
        // times that of V.
        Law::Exact if gives_way => (5 * cells, 0.5),
        Law::Simplified(_) if gives_way => (5 * cells / 2, 1.0),
        _ => (2 * cells, 1.0),
    };
    (cells.min(MOST_CELLS), finer * steps)
}

/// The mesh plan of the first block (or of the whole run without blocks), and the [`Outlook`] of each block, if there
/// is one.
type Plans = (MeshPlan, Arc<[Option<Outlook>]>);

/// The expected outer radius of the last mesh.
fn farthest(contact: &Contact, control: &Control, (plan, outlooks): &Plans) -> f64 {
    if control.varies() && !control.drifts(contact) {
        let limit = Limit::solve(&contact.shape, control.least_stick(contact));
        return limit.map_or(contact.shape.extent(), |limit| limit.radius);
    }
    outlooks.iter().flatten().map(|outlook| outlook.reach).fold(plan.reach, f64::max)
}

impl March {
    /// Starts with the unworn contact. `tolerance` is the target relative error. `last` is the time
    /// at which the run will end.
    ///
    /// `None` if the scar would become larger than the shape.
    pub fn new(problem: WearProblem<'_>, tolerance: f64, last: f64) -> Option<Self> {
        let (cells, tolerance) = effort(problem, tolerance);
        Self::with_cells(problem, cells, tolerance, last)
    }

    /// Whether the indenter is large enough for the scar up to the time `last`.
    pub(crate) fn fits(problem: WearProblem<'_>, end: Option<&Final>, last: f64) -> bool {
        let WearProblem { contact, control, .. } = problem;
        let shape = &contact.shape;
        if let Some(outermost) = MeshPlan::outermost(problem, last) {
            let most = if end.is_some() { shape.extent() } else { 0.9 * shape.extent() };
            return outermost < most.min(WIDEST) && shape.profile(outermost) < DEEPEST;
        }
        if end.is_some() || shape.extent().is_infinite() {
            return true;
        }
        let stick = control.least_stick(contact);
        if !control.drifts(contact) {
            return Limit::solve(shape, stick).is_some();
        }
        // The scar is largest if the core never grows.
        let depth = control.depth_on_core(shape, stick);
        let widest = Limit::at_depth(shape, stick, depth);
        widest.is_some_and(|limit| limit.radius < ROOMY * shape.extent())
            || Self::scouted(problem, last).is_some()
    }

    /// Estimated number of multiplications of a run up to a time in N₀. For a paraboloid, a run up
    /// to 16 N₀ needs five evaluations of the wear rate per cell. For longer runs the number grows
    /// with the power 0.4 of the time. Each further mesh needs 25 evaluations.
    pub(crate) fn operations(problem: WearProblem<'_>, tolerance: f64, until: f64) -> f64 {
        let (cells, tolerance) = effort(problem, tolerance);
        let (cells, longer) = (cells as f64, libm::pow((until / 16.0).max(1.0), 0.4));
        let one_mesh = match problem.law {
            Law::Exact => 5.0 * cells * cells * cells * longer,
            // An evaluation needs a few operations per cell. An output state needs two matrix rows
            // per cell.
            Law::Simplified(_) => 20.0 * cells * longer / tolerance.sqrt() + 50.0 * cells * cells,
        };
        one_mesh + 25.0 * further_meshes(problem.control) as f64 * cells * cells
    }

    /// The number of cells of a run with this tolerance.
    pub(crate) fn cells_for(problem: WearProblem<'_>, tolerance: f64) -> usize {
        effort(problem, tolerance).0
    }

    /// Starts with the unworn contact on `cells` cells.
    pub fn with_cells(
        problem: WearProblem<'_>,
        cells: usize,
        tolerance: f64,
        last: f64,
    ) -> Option<Self> {
        let WearProblem { contact, control, law } = problem;
        let grows = control.drifts(contact) && moves(control, contact);
        let scouted = if grows { Self::scouted(problem, last) } else { None };
        let plans = match scouted {
            Some(plans) => plans,
            None => (MeshPlan::first(contact, control, cells)?, Arc::default()),
        };
        let reach = farthest(contact, control, &plans);
        let mut fine = MeshRun::new(problem, plans.clone(), (cells, tolerance));
        fine.accounts = true;
        let coarse = MeshRun::new(problem, plans, (cells / 2, 4.0 * tolerance));
        let edge = (law == Law::Exact).then(|| ContactEdge::new(&fine));
        let splits = SplitWatch::new(contact, control.normal);
        let check = 0.01 * fine.rkc.scale;
        let until = StopCondition::default();
        // The initial regime is not an event.
        let mut known = Vec::new();
        if contact.regime == Regime::GrossSlip {
            known.push(EventKind::GrossSlip);
        }
        if fine.loss[0] <= SHAKEN * fine.unworn_loss {
            // The mesh does not resolve this narrow ring, so the small loss is not shakedown.
            known.push(EventKind::Shakedown);
        }
        let mut events = Vec::new();
        if fine.wearing.springs.slides {
            // The contact is so close to gross slip that friction cannot carry the tangential force on this mesh.
            events.push(Event::new(0.0, EventKind::GrossSlip, true));
        }
        Some(Self {
            fine,
            coarse,
            edge,
            splits,
            interfaces: contact.layers.as_ref().map_or_else(Vec::new, |it| it.interfaces()),
            until,
            shares: None,
            check,
            left_blocks: 0,
            old_edges: 0.0,
            apart: RunErrors::default(),
            volume: 0.0,
            events,
            known,
            block: 0,
            slips: contact.regime == Regime::GrossSlip,
            core: 0.0,
            reach,
        })
    }

    /// Shares the wear depth between the bodies. `share` is that of the body with the profile, unless the bodies have layers,
    /// and `unit` the unit of the slip in a₀.
    pub(crate) fn share(&mut self, share: f64, unit: f64) {
        self.shares = Some(BodyShares::new(share, unit, &self.fine.wearing));
    }

    /// Finds the mesh plans by coarse runs, for a stick edge that comes to rest in worn material: the plan of the first
    /// block (or of the whole run without blocks), and the [`Outlook`] of each block. `None` if the scar would become
    /// larger than the shape.
    fn scouted(problem: WearProblem<'_>, last: f64) -> Option<Plans> {
        let WearProblem { contact, control, .. } = problem;
        let first = MeshPlan::first(contact, control, SCOUT.0)?;
        let (mut plan, mut outlooks) = (first.clone(), Arc::<[Option<Outlook>]>::default());
        let scouts = if control.varies() { BLOCK_SCOUT } else { SCOUT };
        for blur in [4.0 * REST_BLUR, REST_BLUR] {
            let plans = (plan.clone(), Arc::clone(&outlooks));
            let mut scout = MeshRun::new(problem, plans, scouts);
            let mut found: Vec<(f64, Outlook)> = Vec::new();
            while scout.rkc.evaluations < MOST_LOOKS && scout.advance(last) {
                let reach = scout.wearing.plan.reach;
                if found.len() <= scout.block {
                    found.push((reach, Outlook { reach, focus: 0.0, blur }));
                }
                if let Some((_, outlook)) = found.last_mut() {
                    outlook.reach = reach;
                    outlook.focus = outlook.focus.max(scout.wearing.springs.stick());
                }
            }
            if scout.wearing.outgrows() {
                return None;
            }
            // If the mesh of a block grows much during the block, its final size is not used from the start, because
            // its cells would be too wide.
            let known = |block: usize| outlooks.get(block).is_none_or(Option::is_some);
            let near = |began: f64, outlook: &Outlook| outlook.reach <= FAR * began;
            let found = found.into_iter().enumerate();
            outlooks = found
                .map(|(block, (began, outlook))| {
                    (known(block) && near(began, &outlook)).then_some(outlook)
                })
                .collect();
            plan = first.clone();
            if let Some(Some(outlook)) = outlooks.first() {
                outlook.refine(&mut plan);
            }
        }
        Some((plan, outlooks))
    }

    /// Takes one step towards a time in N₀. Returns false if this time is reached or the run has
    /// ended.
    pub fn advance(&mut self, until: f64) -> bool {
        // The fine run takes its steps first, because it can end early. The coarse run then follows to the same time,
        // so that the two runs can be compared at every time that the caller may ask for.
        let last = until.min(self.ended().unwrap_or(f64::INFINITY));
        let block = self.fine.control().blocks.get(self.left_blocks);
        let check = self.check.min(block.map_or(f64::INFINITY, |block| block.end));
        let next = last.min(check);
        if self.ended().is_none() {
            if self.fine.advance(next) {
                if let Some(edge) = &mut self.edge {
                    edge.follow(&mut self.fine);
                }
                if let Some(shares) = &mut self.shares {
                    shares.follow(&self.fine);
                }
                self.watch();
                return true;
            }
            if self.fine.stopped == Some(Stop::Outgrown) {
                let at = self.fine.rkc.time;
                self.events.push(Event::new(at, EventKind::RimReached, true));
                return true;
            }
        }
        if self.coarse.advance(next) {
            return true;
        }
        if check > last {
            return false;
        }
        if check < self.check {
            self.leave_block();
            return true;
        }
        let volume = self.fine.volume_and_depth(check).0;
        // Where the stick edge moves, later wear does not correct an earlier error of the volume.
        let share = if self.fine.keeps_errors() { self.volume / volume } else { 0.0 };
        let known = RunErrors {
            volume: share.max(FORGET.0) * self.apart.volume,
            depth: FORGET.1 * self.apart.depth,
        };
        self.volume = volume;
        self.apart = self.distance(check).or(known);
        self.check *= CHECKS;
        true
    }

    /// Records the error of the volume that remains from a block.
    fn leave_block(&mut self) {
        self.left_blocks += 1;
        if self.fine.keeps_errors() {
            let worn = self.fine.wearing.at(&self.fine.rkc.values);
            let error = self.fine.edge_error(&worn) * worn.volume;
            self.old_edges = self.old_edges.max(error);
        }
    }

    /// The contact radius at ascending times up to the present time, smoothed in time. `None` for
    /// the simplified rule.
    pub fn contact_radii(&mut self, times: &[f64]) -> Option<Vec<f64>> {
        self.edge.as_mut().map(|edge| edge.radii(&mut self.fine, times))
    }

    /// Takes one step towards the time at which (k_w/μ)·ΣW reaches `energy`, and returns this time as soon as it is
    /// known. If the run ends before it reaches the energy, at the time `last` at the latest, the returned time is
    /// infinite.
    pub(crate) fn seek(&mut self, energy: f64, last: f64) -> Option<f64> {
        if self.fine.energy() >= energy {
            let time = self.fine.time_of(energy);
            if time <= last {
                return Some(time);
            }
        } else if self.fine.stopped.is_none() && self.ended().is_none() && self.advance(last) {
            return None;
        }
        if self.ended().is_none() {
            let at = self.fine.within(last);
            self.events.push(Event::new(at, EventKind::EnergyNotReached, true));
        }
        Some(f64::INFINITY)
    }

    /// Estimates the time at which (k_w/μ)·ΣW reaches `energy`, by a coarse run. The time is at most `last`. It is
    /// earlier if wear practically stops.
    pub(crate) fn time_of(problem: WearProblem<'_>, energy: f64, last: f64) -> f64 {
        let WearProblem { contact, control, .. } = problem;
        let Some(plan) = MeshPlan::first(contact, control, SCOUT.0) else { return last };
        let mut scout = MeshRun::new(problem, (plan, Arc::default()), SCOUT);
        while scout.energy() < energy && scout.rkc.evaluations < MOST_LOOKS && scout.advance(last) {
        }
        let reached = scout.energy() >= energy;
        last.min(if reached { scout.time_of(energy) } else { scout.rkc.time })
    }

    /// Scar radius and slip amplitude Δ·s at the edge of the scar, for each block that has ended since the last call.
    pub(crate) fn block_edges(&mut self) -> Vec<(f64, f64)> {
        std::mem::take(&mut self.fine.block_edges)
    }

    /// The time at which the run ended early, if it did.
    pub fn ended(&self) -> Option<f64> {
        self.events.iter().find(|event| event.ends).map(|event| event.at)
    }

    /// The events so far, in order of time.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Searches for events within the last step.
    fn watch(&mut self) {
        use EventKind::{
            ContactLost, ContactSplits, CoreSlips, EnergyNotReached, GrossSlip, LayerWornThrough,
            RimReached, Shakedown, UntilReached,
        };
        let new_block = self.fine.block != self.block;
        if new_block {
            // At another amplitude the contact can stick or wear again, so these events can occur a second time. A
            // block with little wear from its start on is no shakedown, because the mesh may not resolve its narrow
            // ring.
            self.block = self.fine.block;
            self.known.retain(|known| !matches!(known, GrossSlip | Shakedown));
            self.core = 0.0;
            let began = self.fine.rkc.began();
            if self.slips && self.signal(GrossSlip, began) <= 0.0 {
                self.known.push(GrossSlip);
            }
            if self.signal(Shakedown, began) <= 0.0 {
                self.known.push(Shakedown);
            }
        }
        self.slips = self.signal(GrossSlip, self.fine.rkc.time) <= 0.0;
        let mut found = Vec::new();
        for kind in [GrossSlip, Shakedown, ContactLost, ContactSplits, UntilReached, CoreSlips] {
            if self.known.contains(&kind) {
                continue;
            }
            let (began, time) = (self.fine.rkc.began(), self.fine.rkc.time);
            let after = self.signal(kind, time) <= 0.0;
            // The change of the amplitude can cause the event. The contact may stick again within the first step, so
            // gross slip is checked at the start of the block too.
            let looks = after || new_block && kind == GrossSlip;
            let at_once = looks && self.signal(kind, began) <= 0.0;
            if !after && !at_once {
                continue;
            }
            let (mut low, mut high) = (began, if at_once { began } else { time });
            while high - low > 1e-9 * (time - began) {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                if self.signal(kind, middle) > 0.0 { low = middle } else { high = middle }
            }
            let held = self.fine.control().holds_force(&self.fine.wearing.contact);
            let ends = match kind {
                GrossSlip => held,
                Shakedown | ContactLost => false,
                ContactSplits | UntilReached | RimReached | EnergyNotReached | CoreSlips => true,
                LayerWornThrough => unreachable!("`worn_through` finds these events"),
            };
            found.push(Event::new(high, kind, ends));
        }
        self.core = self.core.max(self.fine.wearing.springs.stick());
        found.extend(self.worn_through());
        found.sort_by(|a, b| a.at.total_cmp(&b.at));
        let last = found.iter().position(|event| event.ends);
        found.truncate(last.map_or(found.len(), |last| last + 1));
        self.known.extend(found.iter().map(|event| event.kind));
        self.events.extend(found);
    }

    /// The layers that the last step has worn through.
    fn worn_through(&mut self) -> Vec<Event> {
        let run = &mut self.fine;
        let reached = run.deepest_dose(run.rkc.time).0;
        let count = self.interfaces.iter().take_while(|it| it.dose <= reached).count();
        let events = self.interfaces.drain(..count).map(|Interface { dose, body, layer }| {
            let (began, time) = (run.rkc.began(), run.rkc.time);
            let at = root(began, time, |time| run.deepest_dose(time).0 - dose);
            let radius = run.deepest_dose(at).1;
            let layer = Some(WornThrough { body, layer, radius });
            Event { layer, ..Event::new(at, EventKind::LayerWornThrough, false) }
        });
        events.collect()
    }

    /// A number that is positive before the event, and 0 or negative after it.
    fn signal(&mut self, kind: EventKind, time: f64) -> f64 {
        let until = self.until;
        let run = &mut self.fine;
        match kind {
            EventKind::RimReached | EventKind::EnergyNotReached | EventKind::LayerWornThrough => {
                1.0
            }
            EventKind::ContactSplits => {
                let Some(splits) = &self.splits else { return 1.0 };
                run.under(time, |wearing, values| {
                    splits.signal(&wearing.core(), || wearing.wear_of(values))
                })
            }
            EventKind::CoreSlips if !run.control().holds_aperture() || self.core == 0.0 => 1.0,
            EventKind::CoreSlips => {
                run.under(time, |wearing, _| wearing.springs.stick() - CORE * self.core)
            }
            EventKind::UntilReached if until == StopCondition::default() => 1.0,
            EventKind::UntilReached => {
                let [_, energy] = run.energies_until(time);
                run.under(time, |wearing, values| {
                    let worn = wearing.at(values);
                    until.missing(worn.deepest, worn.volume, energy)
                })
            }
            // At constant depth and amplitude the core sticks for ever, even if the mesh neglects it.
            EventKind::GrossSlip if run.keeps_core() => 1.0,
            EventKind::GrossSlip => run.under(time, |wearing, _| wearing.springs.margin()),
            EventKind::ContactLost => run.under(time, |wearing, _| wearing.springs.share() - LOST),
            EventKind::Shakedown => {
                let (least, keeps_core) = (SHAKEN * run.unworn_loss, run.keeps_core());
                run.under(time, |wearing, _| {
                    let springs = &wearing.springs;
                    // A contact at rest or in gross slip is not in shakedown.
                    if springs.threshold == 0.0 || !keeps_core && springs.stick() == 0.0 {
                        1.0
                    } else {
                        wearing.power() - least * (springs.friction * springs.friction)
                    }
                })
            }
        }
    }

    /// The relative differences of the two runs.
    fn distance(&mut self, time: f64) -> RunErrors {
        let (fine, coarse) = (self.fine.volume_and_depth(time), self.coarse.volume_and_depth(time));
        RunErrors::between([coarse.0, fine.0], [coarse.1, fine.1])
    }

    /// The outer radius of the mesh in a₀. With blocks it is the largest of all meshes.
    pub fn reach(&self) -> f64 {
        self.fine.wearing.plan.reach.max(self.reach)
    }

    /// The present time in N₀.
    pub(crate) fn reached(&self) -> f64 {
        self.fine.rkc.time
    }

    /// The number of mesh cells.
    pub fn cells(&self) -> usize {
        self.fine.wearing.springs.mesh.widths.len()
    }

    /// The number of steps and of evaluations so far, for both runs together.
    pub fn work(&self) -> (usize, usize) {
        let (fine, coarse) = (&self.fine.rkc, &self.coarse.rkc);
        (fine.accepted + coarse.accepted, fine.evaluations + coarse.evaluations)
    }

    /// Estimated number of multiplications of all evaluations so far.
    pub(crate) fn spent(&self) -> f64 {
        let of = |run: &MeshRun| run.rkc.evaluations as f64 * run.wearing.operations();
        of(&self.fine) + of(&self.coarse)
    }

    /// Estimated number of multiplications of one call of [`March::at`]: the volumes of both runs,
    /// and the limiting states for the error of V.
    pub(crate) fn state_operations(&self) -> f64 {
        const LIMITS: f64 = 5000.0;
        let shape = &self.fine.wearing.contact.shape;
        4.0 * self.fine.wearing.operations() + LIMITS * shape.pieces() as f64
    }

    /// The contact of the fine run.
    pub fn wearing(&self) -> &Wearing {
        &self.fine.wearing
    }

    /// The state at a time within the last step.
    pub fn at(&mut self, normalized_cycles: f64) -> MarchState {
        let time = self.fine.within(normalized_cycles);
        let [worn_by_energy, dissipated] = self.fine.energies_until(time);
        let shares = self.shares.as_ref();
        let (worn, depths) = self.fine.under(time, |wearing, values| {
            let depths = shares.map(|shares| shares.at(wearing, values));
            (wearing.at(values), depths)
        });
        if worn.volume == 0.0 {
            let errors = RunErrors::default();
            return MarchState { worn, errors, worn_by_energy, dissipated, depths };
        }
        let apart = self.distance(normalized_cycles).or(self.apart);
        let Wearing { springs, plan, .. } = &self.fine.wearing;
        let safety = if plan.is_thin() { THIN_SAFETY } else { springs.error_safety_factor() };
        let RunErrors { volume, depth } = apart.times(safety);
        let later = self.fine.block > 0 && self.fine.keeps_errors();
        let least = (if later { LEAST_ERRORS.1 } else { LEAST_ERRORS.0 } * self.fine.rkc.tolerance)
            .max(self.fine.edge_error(&worn))
            .max(self.old_edges / worn.volume)
            .max(self.fine.core_error(&worn))
            .max(match self.fine.wearing.law {
                Law::Exact => (worn_by_energy / worn.dosed - 1.0).abs(),
                Law::Simplified(_) => 0.0,
            });
        let coarse = match plan.is_thin() {
            true => THIN_COARSE,
            false if self.fine.block > 0 => COARSE.1,
            false => COARSE.0,
        };
        let depth = SHARES.1 * depth / (1.0 + depth / coarse) + self.fine.tip_error(&worn);
        let errors = RunErrors { volume: (SHARES.0 * volume).max(least), depth: depth.max(least) };
        MarchState { worn, errors, worn_by_energy, dissipated, depths }
    }
}
