//! One run by one method, without a comparison.

use super::model_error::{model_error, warning};
use super::numerical_error;
use super::recording::{HistoryEntry, Recording};
use crate::case::{Case, EnergyOutputs, Method, Outputs, SEARCH_EVALUATIONS};
use crate::contact::{Decay, Held, WIDEST};
use crate::numeric::twelve_digits;
use crate::outcome::{
    Accuracy, BodyWear, ContactScales, History, Outcome, OutcomeEvent, Unworn, limit_state,
};
use crate::scenario::Warning;
use crate::solver::closed::energy;
use crate::solver::closed::events::{events, stop_time};
use crate::solver::closed::simplified::{Simplified, State, UnwornCurves};
use crate::solver::curves::{Curves, Grid, rim};
use crate::solver::events::{Event, EventKind, WornThrough};
use crate::solver::stepped::shares::shares;
use crate::solver::stepped::{March, MeshPlan};

/// Number of multiplications per step: about 30 ms.
const STEP_OPERATIONS: f64 = 3e7;
/// Maximum number of output cycles per step.
const STEP_INSTANTS: usize = 64;

/// A run by one method and its present state.
#[derive(Debug)]
pub(super) struct SingleRun {
    pub(super) case: Case,
    phase: RunPhase,
    events: Vec<Event>,
    pub(super) recording: Recording,
}

/// The work of the next step.
#[derive(Debug)]
enum RunPhase {
    /// Searches for the time of the stop condition. Then evaluates the closed form with this ξ.
    Searching(Box<Simplified>, f64),
    /// Evaluates the closed form with this ξ.
    Closed(Box<Simplified>, f64),
    /// Prepares the time integration.
    Planned,
    /// Records the unworn state, which is known in closed form.
    Unworn(Box<Marching>),
    /// Integrates in time.
    Marching(Box<Marching>),
}

/// A time integration and the output radii, in a₀.
#[derive(Debug)]
struct Marching {
    march: March,
    radii: Vec<f64>,
    /// The next output cycle, if the run has found it.
    found: Option<f64>,
}

impl Marching {
    /// The output cycle with this index. `None` if the run has to take more steps to find it. Infinite if the run ends
    /// before this output cycle.
    fn output_cycle(&mut self, case: &Case, index: usize) -> Option<f64> {
        let outputs = match &case.outputs {
            Outputs::Cycles(cycles) => return Some(cycles[index]),
            Outputs::Energies(outputs) => outputs,
        };
        if self.found.is_none() {
            let time = self.march.seek(outputs.energies[index], outputs.horizon)?;
            // Rounded to 12 digits, so that a scenario can contain the cycle. A run with this output cycle then gives
            // the same row.
            self.found = Some(twelve_digits(time * case.scales.cycles));
        }
        self.found
    }
}

impl SingleRun {
    /// Prepares the run of a case.
    pub(super) fn new(mut case: Case) -> Self {
        let mut recording = Recording::default();
        let mut events = Vec::new();
        let phase = match case.method {
            Method::Simplified { xi } if case.control.is_closed() => {
                events.extend(find_outputs(&mut case, xi));
                let solver = Box::new(Simplified::new(&case.contact, case.points));
                if case.profile_rows() > 0 {
                    let UnwornCurves { initial, limiting, .. } = solver.unworn();
                    let limiting = Some(limiting.clone());
                    recording.lay_out(&case, solver.radii(), initial.clone(), limiting);
                }
                RunPhase::Searching(solver, xi)
            }
            _ => RunPhase::Planned,
        };
        Self { case, phase, events, recording }
    }

    /// Computes for a short time. Returns the completed share of the run.
    pub(super) fn step(&mut self) -> f64 {
        let mut progress = 0.0;
        self.phase = match std::mem::replace(&mut self.phase, RunPhase::Planned) {
            RunPhase::Searching(solver, xi) => {
                self.find_events(&solver, xi);
                progress = self.step_closed(&solver, xi);
                RunPhase::Closed(solver, xi)
            }
            RunPhase::Closed(solver, xi) => {
                progress = self.step_closed(&solver, xi);
                RunPhase::Closed(solver, xi)
            }
            RunPhase::Planned => RunPhase::Unworn(Box::new(self.begin_march())),
            RunPhase::Unworn(mut marching) => {
                self.record_unworn(&mut marching);
                RunPhase::Marching(marching)
            }
            RunPhase::Marching(mut marching) => {
                progress = self.step_march(&mut marching);
                RunPhase::Marching(marching)
            }
        };
        progress
    }

    pub(super) fn has_ended(&self) -> bool {
        let recorded = &self.recording.history.cycles;
        let unit = self.case.scales.cycles;
        // The closed form gives the time of the end before the rows up to the end are recorded.
        let is_reached = |end: &Event| recorded.last().is_some_and(|last| *last >= end.at * unit);
        recorded.len() == self.case.outputs.numbers().len()
            || self.events.iter().any(|event| event.ends && is_reached(event))
    }

    /// Finds the events of the closed form. The search for the stop condition fits into a step: it evaluates at most some
    /// 200 states.
    fn find_events(&mut self, solver: &Simplified, xi: f64) {
        let last = self.case.normalized_end();
        let stop = stop_time(solver, xi, self.case.until, last);
        let mut known = std::mem::take(&mut self.events);
        if stop.is_finite() {
            known.push(Event::new(stop, EventKind::UntilReached, true));
        }
        self.events = events(solver, xi, last, known);
    }

    /// Evaluates several output cycles together, because they use the same matrix rows.
    fn step_closed(&mut self, solver: &Simplified, xi: f64) -> f64 {
        let case = &self.case;
        let Outputs::Cycles(cycles) = &case.outputs else {
            unreachable!("the closed form has found the output cycles")
        };
        let (done, all) = (self.recording.history.cycles.len(), cycles.len());
        let per_instant = case.operations() / all as f64;
        let block = ((STEP_OPERATIONS / per_instant) as usize).clamp(1, STEP_INSTANTS);
        let end = self.events.iter().find(|event| event.ends);
        let end = end.map_or(f64::INFINITY, |event| event.at * case.scales.cycles);
        let until = (done + block).min(all);
        let mut wanted = Vec::new();
        for (n, shows) in cycles[done..until].iter().zip(&case.profiles[done..until]) {
            let n = n.min(end);
            // The row at the end has profiles if any output cycle was to have them.
            wanted.push((n, *shows || n >= end && case.profile_rows() > 0));
            if n >= end {
                break;
            }
        }
        let decays: Vec<_> = wanted
            .iter()
            .map(|(n, curves)| (solver.decay(xi, n / case.scales.cycles), *curves))
            .collect();
        let states = solver.states(&decays).into_iter().zip(&decays);
        for ((state, (decay, _)), (cycles, _)) in states.zip(wanted) {
            self.recording.record(case, closed_entry(case, solver, xi, (cycles, *decay), state));
        }
        until as f64 / all as f64
    }

    /// Prepares the time integration. If the stick edge moves, a coarse run comes first.
    #[expect(clippy::expect_used, reason = "`Scenario::case` has refused such a scenario")]
    fn begin_march(&mut self) -> Marching {
        let Case { contact, control, tends_to, points, .. } = &self.case;
        let (shape, problem) = (&contact.shape, self.case.problem());
        let last = self.case.normalized_end();
        let mut march = March::new(problem, self.case.tolerance(), last)
            .expect("a scenario whose scar outgrows its indenter has no case");
        march.until = self.case.until;
        let Case { share, contact, scales, .. } = &self.case;
        if share.is_some() || contact.layers.is_some() {
            march.share(share.unwrap_or_default(), scales.slip() / scales.contact_radius);
        }
        let (start, reach) = tends_to.as_ref().map_or_else(
            || {
                let stick = control.least_stick(contact);
                let scar = control.scar_of_blocks(shape, stick).unwrap_or_default();
                (stick, scar.min(WIDEST).max(march.reach()))
            },
            |end| (end.stick, rim(end.stick, end.limit.radius).min(WIDEST)),
        );
        let outermost = MeshPlan::outermost(problem, last).unwrap_or(reach);
        // Some output radii must lie outside the scar.
        let most = shape.extent() - 1e-3 * (shape.extent() - start);
        let reach = reach.max(outermost).min(most);
        let radii = Grid::new(start, reach, *points, shape.extent()).radii;
        let initial = radii.iter().map(|r| shape.profile(*r)).collect();
        let limiting = tends_to.map(|end| radii.iter().map(|r| end.profile(shape, *r)).collect());
        self.recording.lay_out(&self.case, &radii, initial, limiting);
        Marching { march, radii, found: None }
    }

    fn record_unworn(&mut self, marching: &mut Marching) {
        let Marching { march, radii, .. } = marching;
        let first = march.at(0.0);
        let case = &self.case;
        let unworn = case.unworn();
        let curves = case.profiles[0].then(|| {
            let mut curves = Curves::unworn(&case.contact, case.unworn_middle(), radii);
            if case.control.has_record() {
                let surface = march.wearing().surface();
                curves.slip = Curves::of(&case.contact.shape, surface, &first.worn, radii).slip;
            }
            let found = match *case.control.held() {
                Held::Aperture(aperture) => unworn.backbone.wind_to(aperture),
                _ => unworn.backbone.wind(),
            };
            (curves, found)
        });
        let entry = HistoryEntry {
            contact_radius: 1.0,
            stick: case.contact.stick,
            depth: case.unworn_depth(),
            threshold: case.contact.threshold,
            stroke: case.unworn_stroke(),
            gross_slip: case.unworn_gross_slip(),
            normal: unworn.normal,
            tangential: unworn.tangential,
            loss: unworn.loss,
            friction: 1.0,
            bodies: first.worn.bodies,
            depths: first.depths,
            curves,
            ..HistoryEntry::default()
        };
        self.recording.record(case, entry);
    }

    /// Takes some time steps and records the output cycles that they reach.
    fn step_march(&mut self, marching: &mut Marching) -> f64 {
        let case = &self.case;
        let (done, all) = (self.recording.history.cycles.len(), case.outputs.numbers().len());
        let (before, mut recorded) = (marching.march.spent(), 0.0);
        let (mut next, mut over) = (done, false);
        while next < all && marching.march.spent() - before + recorded < STEP_OPERATIONS {
            let Some(due) = marching.output_cycle(case, next) else { continue };
            let now = due / case.scales.cycles;
            let Marching { march, radii, found } = &mut *marching;
            if march.advance(now) {
                continue;
            }
            if found.take().is_some() {
                recorded += SEARCH_EVALUATIONS as f64 * march.wearing().operations();
            }
            let ended = march.ended().filter(|end| *end <= now);
            let at = ended.unwrap_or(now);
            let cycles = ended.map_or(due, |end| end * case.scales.cycles);
            // If the run ends at an output cycle that is already recorded, this row is the last
            // one.
            let known = self.recording.history.cycles.last();
            if ended.is_none() || known.is_none_or(|known| *known < cycles) {
                let shows = case.profiles[next] || ended.is_some() && case.profile_rows() > 0;
                recorded += march.state_operations();
                if shows {
                    // Inside the sticking core and outside the mesh, each value of a curve is a sum over all cells.
                    recorded += (radii.len() * march.cells()) as f64;
                }
                for edge in march.block_edges() {
                    self.recording.slide(&case.scales, edge);
                }
                let entry = marched_entry(case, march, radii, (cycles, at), shows);
                self.recording.record(case, entry);
            }
            next += 1;
            if ended.is_some() {
                over = true;
                break;
            }
        }
        let march = &marching.march;
        let end = case.normalized_end();
        let progress = if end > 0.0 { march.reached() / end } else { 1.0 };
        self.events = march.events().to_vec();
        // Events after the last output cycle are not reported. The end is reported after its row is
        // recorded.
        let last = self.recording.history.normalized_cycles.last().filter(|_| next == all);
        let is_past = |event: &Event| last.is_some_and(|last| event.at > *last);
        self.events.retain(|event| if event.ends { over } else { !is_past(event) });
        progress.clamp(next as f64 / all as f64 * 1e-3, 0.999)
    }

    /// The result of the run, without the comparison and the warnings.
    pub(super) fn outcome(self) -> Outcome {
        let Self { case, mut phase, events, mut recording } = self;
        let shows = case.profile_rows() > 0;
        let mut march = match &mut phase {
            RunPhase::Unworn(marching) | RunPhase::Marching(marching) => Some(&mut marching.march),
            RunPhase::Searching(..) | RunPhase::Closed(..) | RunPhase::Planned => None,
        };
        if let Some(march) = &mut march {
            let times = &recording.history.normalized_cycles;
            if let Some(radii) = march.contact_radii(times) {
                recording.set_contact_radii(&radii, &case.scales);
            }
        }
        let march = march.as_deref();
        let work = march.map(March::work);
        let in_metres = |worn: WornThrough| WornThrough {
            radius: worn.radius * case.scales.contact_radius,
            ..worn
        };
        let with_cycles = |event: &Event| {
            let (cycles, kind) = (event.at * case.scales.cycles, event.kind);
            OutcomeEvent { cycles, kind, layer: event.layer.map(in_metres) }
        };
        let unworn = case.unworn();
        let model_error = match case.method {
            Method::Exact { .. } => Some(0.0),
            Method::Simplified { .. } => model_error(&case, unworn.loss, &recording.history),
        };
        let history = &recording.history;
        let bodies = BodyWear::of(case.share, history, &recording.parts, &recording.half_lengths);
        let warnings = BodyWear::warnings(&bodies, history, case.scales.indentation_depth)
            .into_iter()
            .chain(reference_reached(&case, history))
            .chain(numerical_error::warning(&case, recording.errors))
            .chain(warning(model_error));
        Outcome {
            scales: ContactScales::of(&case),
            unworn: Unworn::of(&case, &unworn),
            regime: case.contact.regime,
            limit: limit_state(&case),
            bodies,
            history: recording.history,
            profiles: shows.then_some(recording.profiles),
            loops: shows.then_some(recording.loops),
            events: events.iter().map(with_cycles).collect(),
            accuracy: Accuracy {
                energy_mismatch: recording.mismatch,
                numerical_error: recording.errors.map(|errors| errors.volume),
                wear_depth_error: recording.errors.map(|errors| errors.depth),
                model_error,
                cells: march.map(March::cells),
                steps: work.map(|(steps, _)| steps),
                evaluations: work.map(|(_, evaluations)| evaluations),
            },
            comparison: None,
            warnings: warnings.collect(),
        }
    }
}

/// A warning if a line contact has grown to the points that its stroke is measured against.
fn reference_reached(case: &Case, history: &History) -> Option<Warning> {
    let distance = case.contact.reference?.reach * case.scales.contact_radius;
    let reached = history.contact_radius.iter().position(|radius| *radius >= distance)?;
    let detail = format!(
        "At cycle {:.4e} the contact reaches the points at `reference_distance` ({distance:.4e} m), so the stroke has no \
         meaning any more. Enter a distance that is larger than the scar, or use the results before this cycle.",
        history.cycles[reached]
    );
    Some(Warning { kind: "reference_reached".into(), detail })
}

/// Replaces the energies by the output cycles at which the closed form reaches them. Returns the event of the end if
/// the run cannot reach all energies.
fn find_outputs(case: &mut Case, xi: f64) -> Option<Event> {
    let Outputs::Energies(EnergyOutputs { energies, horizon, .. }) = &case.outputs else {
        return None;
    };
    let (times, stop) = energy::times(&case.contact, xi, energies, *horizon);
    let unit = case.scales.cycles;
    let found = times.iter().map(|time| twelve_digits(time * unit));
    let cycles: Vec<f64> = found.chain(stop.map(|stop| stop * unit)).collect();
    let shows = case.profile_rows() > 0;
    case.profiles.truncate(cycles.len());
    if let Some(last) = case.profiles.last_mut() {
        // The row at the end has profiles if any output cycle was to have them.
        *last |= shows;
    }
    case.outputs = Outputs::Cycles(cycles);
    stop.map(|at| Event::new(at, EventKind::EnergyNotReached, true))
}

/// A row of the history from the closed form.
fn closed_entry(
    case: &Case,
    solver: &Simplified,
    xi: f64,
    (cycles, decay): (f64, Decay),
    state: State,
) -> HistoryEntry {
    let (contact, scales, sums, scar) = (&case.contact, &case.scales, state.sums, state.scar);
    let edge_slip = if scar > 0.0 { solver.slip_outside(scar.max(1.0), decay) } else { 0.0 };
    // The lengths that are swept in the limit, so that what is worn stays worn.
    let limit = contact.limit.radius.min(WIDEST);
    let slip = solver.slip_outside(limit, Decay::after(f64::INFINITY));
    let lengths = [limit, limit + slip * scales.slip() / scales.contact_radius];
    let dissipated = energy::dissipated(contact, xi, &sums);
    let plain = |share: f64| [share * state.depth, (1.0 - share) * state.depth];
    HistoryEntry {
        cycles,
        volume: state.volume,
        deepest: state.depth,
        scar,
        edge_slip,
        depths: case
            .share
            .map(|share| shares(plain(share), lengths).map(|part| part * state.depth)),
        contact_radius: 1.0,
        stick: contact.stick,
        depth: 1.0,
        threshold: contact.threshold,
        gross_slip: [if contact.stick > 0.0 { 1.0 } else { contact.compression(0.0, decay) }; 2],
        normal: sums.normal,
        tangential: sums.tangential,
        loss: sums.energy / contact.threshold,
        worn_by_energy: dissipated,
        dosed: state.volume,
        dissipated,
        friction: 1.0,
        errors: state.errors,
        curves: state.curves.zip(state.backbone.map(|backbone| backbone.wind())),
        // The contact radius of the rule does not change later, so the slope at the edge of the scar is not needed.
        ..HistoryEntry::default()
    }
}

/// A row of the history from the time integration. `cycles` and `at` are the same time, in cycles
/// and in N₀.
fn marched_entry(
    case: &Case,
    march: &mut March,
    radii: &[f64],
    (cycles, at): (f64, f64),
    shows: bool,
) -> HistoryEntry {
    let state = march.at(at);
    let worn = state.worn;
    let mesh = &march.wearing().springs.mesh;
    let curves = shows.then(|| {
        let surface = march.wearing().surface();
        let curves = Curves::of(&case.contact.shape, surface, &worn, radii);
        (curves, march.wearing().backbone(&worn).wind())
    });
    HistoryEntry {
        cycles,
        volume: worn.volume,
        deepest: worn.deepest,
        scar: worn.scar,
        edge_slip: worn.edge_slip(mesh),
        edge_slope: worn.edge_slope(mesh),
        contact_radius: worn.contact_radius,
        stick: worn.stick,
        depth: worn.approach,
        threshold: worn.threshold,
        stroke: worn.stroke,
        gross_slip: worn.gross_slip,
        normal: worn.normal,
        tangential: worn.tangential,
        loss: worn.loss,
        worn_by_energy: state.worn_by_energy,
        dosed: worn.dosed,
        bodies: worn.bodies,
        depths: state.depths,
        dissipated: state.dissipated,
        friction: worn.friction,
        errors: state.errors,
        curves,
    }
}
