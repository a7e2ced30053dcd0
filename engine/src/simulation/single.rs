//! One run by one method.

use crate::case::{Case, Method};
use crate::contact::hysteresis::{Backbone, Loop};
use crate::contact::limit::WIDEST;
use crate::contact::unworn::Regime;
use crate::numeric::{Bracket, root};
use crate::outcome::{
    self, Accuracy, BodyWear, History, Loops, Outcome, Profiles, Scales, Unworn, limit_state,
};
use crate::solver::closed::simplified::Simplified;
use crate::solver::curves::{Curves, Grid};
use crate::solver::events::{Event, EventKind, LOST, SHAKEN, Until};
use crate::solver::stepped::march::March;
use crate::solver::stepped::plan::Plan;

/// Multiplications of a step, about: 30 ms.
const STEP_OPERATIONS: f64 = 3e7;
/// The instant at which the wear asked for is reached is found to this share of it.
const SOUGHT: f64 = 1e-12;
/// Most instants in a step.
const STEP_INSTANTS: usize = 64;

/// A run under way.
#[derive(Debug)]
pub(super) struct SingleRun {
    case: Case,
    solver: Solver,
    /// Where the curves of time steps are wanted.
    radii: Vec<f64>,
    /// f₀ at the radii.
    initial: Vec<f64>,
    history: History,
    profiles: Profiles,
    loops: Loops,
    events: Vec<Event>,
    /// The search for the instant at which the wear asked for is reached, by the closed form.
    seeking: Option<Bracket>,
    mismatch: Option<f64>,
    volume_error: Option<f64>,
    /// What has been reported so far: wear does not heal.
    worn: Worn,
}

/// The largest values reported so far, in dimensionless units.
#[derive(Debug, Default)]
struct Worn {
    volume: f64,
    deepest: f64,
    scar: f64,
    wear: Vec<f64>,
}

/// What computes.
#[derive(Debug)]
enum Solver {
    /// The closed form of the simplified rule.
    Closed(Box<Simplified>),
    /// Steps in time, from the first on.
    March(Option<Box<March>>),
}

/// One row of the history, in dimensionless units, whichever method it comes from.
struct Entry {
    /// N.
    cycles: f64,
    volume: f64,
    deepest: f64,
    scar: f64,
    contact_radius: f64,
    stick: f64,
    /// d and Δ.
    depth: f64,
    threshold: f64,
    /// ∫ y, ∫ min(Δ, y) and ∫ y ω over half of the row.
    normal: f64,
    tangential: f64,
    loss: f64,
    /// (k_w/μ)·ΣW.
    worn_by_energy: f64,
    volume_error: f64,
    /// With profiles.
    curves: Option<(Curves, Loop)>,
}

impl SingleRun {
    /// Prepares the run of a case.
    pub(super) fn new(case: Case) -> Self {
        let closed = matches!(case.method, Method::Simplified { .. }) && case.control.is_closed();
        let solver = if closed {
            Solver::Closed(Box::new(Simplified::new(&case.contact, case.points)))
        } else {
            Solver::March(None)
        };
        let history = History::with_capacity(case.cycles.len());
        let mut simulation = Self {
            case,
            solver,
            radii: Vec::new(),
            initial: Vec::new(),
            history,
            profiles: Profiles::default(),
            loops: Loops::default(),
            events: Vec::new(),
            seeking: None,
            mismatch: None,
            volume_error: None,
            worn: Worn::default(),
        };
        simulation.lay_out();
        simulation
    }

    /// Computes some more; the share done so far.
    pub(super) fn step(&mut self) -> f64 {
        match (&self.solver, self.case.method) {
            (Solver::Closed(_), Method::Simplified { xi }) => self.step_closed(xi),
            _ if matches!(self.solver, Solver::March(None)) => self.begin_march(),
            _ if self.radii.is_empty() => self.lay_out(),
            // The unworn state is known in closed form.
            _ if self.history.cycles.is_empty() => self.step_unworn(),
            _ => self.step_march(),
        }
    }

    pub(super) fn has_ended(&self) -> bool {
        self.history.cycles.len() == self.case.cycles.len()
            || self.events.iter().any(|event| event.ends)
    }

    pub(super) fn case(&self) -> &Case {
        &self.case
    }

    pub(super) fn history(&self) -> &History {
        &self.history
    }

    /// Ñ of an instant.
    fn normalized(&self, index: usize) -> f64 {
        self.case.cycles[index] / self.case.scales.cycles
    }

    /// Chooses the output radii: from the stick edge to the scar's rim and a little beyond.
    fn lay_out(&mut self) -> f64 {
        let Case { contact, control, tends_to, points, .. } = &self.case;
        let shape = &contact.shape;
        let last = self.case.normalized_end();
        let limiting = match &self.solver {
            Solver::Closed(simplified) => {
                self.initial = simplified.initial().to_vec();
                self.profiles.radius = simplified.radii().to_vec();
                Some(simplified.limiting().to_vec())
            }
            Solver::March(march) => {
                let (start, reach) = match (tends_to, march) {
                    (Some(end), _) => (end.stick, end.limit.radius.min(WIDEST)),
                    (None, Some(march)) => (control.least_stick(contact), march.reach()),
                    (None, None) => return 0.0,
                };
                let outermost =
                    Plan::outermost(contact, control, self.case.law(), last).unwrap_or(reach);
                // Room is left for some radii outside.
                let most = shape.extent() - 1e-3 * (shape.extent() - start);
                let reach = reach.max(outermost).min(most);
                let grid = Grid::new(start, reach, *points, shape.extent());
                self.radii = grid.radii;
                self.profiles.radius.clone_from(&self.radii);
                self.initial = self.radii.iter().map(|r| shape.profile(*r)).collect();
                let radii = self.radii.iter();
                tends_to.map(|end| radii.map(|r| end.profile(shape, *r)).collect())
            }
        };
        let (length, height) =
            (self.case.scales.contact_radius, self.case.scales.indentation_depth);
        self.profiles.radius = scaled(std::mem::take(&mut self.profiles.radius), length);
        self.profiles.initial = scaled(self.initial.clone(), height);
        self.profiles.limiting = limiting.map(|limiting| scaled(limiting, height));
        0.0
    }

    /// Some more instants at once, since they share the rows of the matrices.
    fn step_closed(&mut self, xi: f64) -> f64 {
        let Solver::Closed(simplified) = &self.solver else { return 0.0 };
        let (done, all) = (self.history.cycles.len(), self.case.cycles.len());
        let per_instant = self.case.operations() / all as f64;
        let block = ((STEP_OPERATIONS / per_instant) as usize).clamp(1, STEP_INSTANTS);
        if done == 0 {
            let Some(reached) = seek(&self.case, simplified, xi, &mut self.seeking) else {
                return 0.0;
            };
            self.events = closed_events(&self.case, simplified, xi, reached);
        }
        let end = self.events.iter().find(|event| event.ends);
        let end = end.map_or(f64::INFINITY, |event| event.at * self.case.scales.cycles);
        let until = (done + block).min(all);
        let mut wanted = Vec::new();
        for i in done..until {
            let n = self.case.cycles[i].min(end);
            wanted.push((n, self.case.profiles[i] || self.case.shows_end(n, end)));
            if n >= end {
                break;
            }
        }
        let decays: Vec<_> = wanted
            .iter()
            .map(|(n, curves)| (simplified.decay(xi, n / self.case.scales.cycles), *curves))
            .collect();
        let contact = &self.case.contact;
        let entries: Vec<Entry> = simplified
            .states(&decays)
            .into_iter()
            .zip(wanted)
            .map(|(state, (cycles, _))| {
                let sums = state.sums;
                let error = if sums.volume > 0.0 {
                    (state.mesh_volume / sums.volume - 1.0).abs()
                } else {
                    0.0
                };
                Entry {
                    cycles,
                    volume: state.volume,
                    deepest: state.depth,
                    scar: state.scar,
                    contact_radius: 1.0,
                    stick: contact.stick,
                    depth: 1.0,
                    threshold: contact.threshold,
                    normal: sums.normal,
                    tangential: sums.tangential,
                    loss: sums.energy / contact.threshold,
                    // Σ W = μã(F₀ − F)/(ξ k_w E*).
                    worn_by_energy: contact.limit.radius * 2.0 * sums.unloaded / xi,
                    volume_error: error,
                    curves: state.curves.zip(state.backbone.map(|backbone| backbone.wind())),
                }
            })
            .collect();
        for entry in entries {
            self.record(entry);
        }
        until as f64 / all as f64
    }

    /// A few time steps, and the instants they pass.
    fn step_march(&mut self) -> f64 {
        let (done, all) = (self.history.cycles.len(), self.case.cycles.len());
        let last = self.case.normalized_end();
        let Solver::March(begun) = &mut self.solver else { return 0.0 };
        let Some(mut march) = begun.take() else { return 0.0 };
        let (before, mut told) = (march.spent(), 0.0);
        let (mut next, mut over) = (done, false);
        while next < all && march.spent() - before + told < STEP_OPERATIONS {
            let now = self.normalized(next);
            if march.advance(now) {
                continue;
            }
            let ended = march.ended().filter(|end| *end <= now);
            let at = ended.unwrap_or(now);
            let cycles = match ended {
                Some(end) => end * self.case.scales.cycles,
                None => self.case.cycles[next],
            };
            // A run that ends at an instant already recorded has its last entry there.
            if self.history.cycles.last().is_none_or(|known| *known < cycles) {
                let shows =
                    self.case.profiles[next] || ended.is_some() && self.case.profile_rows() > 0;
                told += march.telling();
                if shows {
                    // A curve sums over all cells at some of the radii.
                    told += (self.radii.len() * march.cells()) as f64;
                }
                let entry = self.marched(&mut march, cycles, at, shows);
                self.record(entry);
            }
            next += 1;
            if ended.is_some() {
                over = true;
                break;
            }
        }
        let progress = (march.reached() / last).clamp(next as f64 / all as f64 * 1e-3, 0.999);
        self.events = march.events().to_vec();
        // An event after the last instant has not happened, and the end only once it is recorded.
        self.events.retain(|event| event.at <= last && (over || !event.ends));
        self.solver = Solver::March(Some(march));
        progress
    }

    fn marched(&self, march: &mut March, cycles: f64, at: f64, shows: bool) -> Entry {
        let instant = march.at(at);
        let worn = instant.worn;
        let mesh = march.wearing().springs().mesh();
        let curves = shows.then(|| {
            let curves = Curves::of(&self.case.contact.shape, mesh, &worn, &self.radii);
            let start = mesh.radii()[0];
            let loss = (!self.case.control.has_record()).then_some(worn.loss);
            let backbone =
                Backbone::of_cells(start, worn.threshold, &worn.loads, mesh.widths(), loss);
            (curves, backbone.wind())
        });
        Entry {
            cycles,
            volume: worn.volume,
            deepest: worn.deepest,
            scar: worn.scar,
            contact_radius: worn.contact_radius,
            stick: worn.stick,
            depth: worn.depth,
            threshold: worn.threshold,
            normal: worn.normal,
            tangential: worn.tangential,
            loss: worn.loss,
            worn_by_energy: instant.worn_by_energy,
            volume_error: instant.volume_error,
            curves,
        }
    }

    /// Prepares the time steps: where the stick edge moves, a coarse run looks ahead.
    fn begin_march(&mut self) -> f64 {
        let case = &self.case;
        let last = case.normalized_end();
        let march = March::new(&case.contact, &case.control, case.law(), case.tolerance(), last);
        // A scenario whose first scar outgrows its indenter was refused before it came here.
        let Some(mut march) = march else {
            self.events.push(Event { at: 0.0, kind: EventKind::ContactLost, ends: true });
            return 0.0;
        };
        march.end_at(case.until);
        self.solver = Solver::March(Some(Box::new(march)));
        0.0
    }

    fn step_unworn(&mut self) -> f64 {
        let Solver::March(Some(march)) = &mut self.solver else { return 0.0 };
        let first = march.at(0.0);
        let case = &self.case;
        let shows = case.profiles[0];
        let unworn = case.unworn();
        let (stick, threshold) = (case.contact.stick, case.contact.threshold);
        let curves = shows.then(|| {
            let mut curves = Curves::unworn(&case.contact, &self.radii);
            if case.control.has_record() {
                let mesh = march.wearing().springs().mesh();
                curves.slip = Curves::of(&case.contact.shape, mesh, &first.worn, &self.radii).slip;
            }
            (curves, unworn.backbone.wind())
        });
        self.record(Entry {
            cycles: 0.0,
            volume: 0.0,
            deepest: 0.0,
            scar: 0.0,
            contact_radius: 1.0,
            stick,
            depth: 1.0,
            threshold,
            normal: unworn.normal,
            tangential: unworn.tangential,
            loss: unworn.loss,
            worn_by_energy: 0.0,
            volume_error: 0.0,
            curves,
        });
        0.0
    }

    /// Multiplies the units back in and appends a row.
    fn record(&mut self, mut entry: Entry) {
        self.worn.hold(&mut entry);
        let Case { scales, contact, .. } = &self.case;
        let (length, height) = (scales.contact_radius, scales.indentation_depth);
        let history = &mut self.history;
        let n = entry.cycles;
        if entry.volume > 0.0 {
            self.mismatch = Some(entry.worn_by_energy / entry.volume - 1.0);
            let error = entry.volume_error;
            self.volume_error = Some(self.volume_error.map_or(error, |known| known.max(error)));
        }
        let amplitude = scales.amplitude * (entry.threshold / contact.threshold);
        history.cycles.push(n);
        history.normalized_cycles.push(n / scales.cycles);
        history.wear_volume.push(entry.volume * scales.volume());
        history.wear_depth.push(entry.deepest * height);
        history.scar_radius.push(entry.scar * length);
        history.contact_radius.push(entry.contact_radius * length);
        history.stick_radius.push(entry.stick * length);
        history.normal_force.push(2.0 * entry.normal * scales.force());
        history.indentation_depth.push(entry.depth * height);
        history.amplitude.push(amplitude);
        history.tangential_force.push(scales.tangential(entry.tangential));
        history.energy_per_cycle.push(scales.energy(entry.loss * entry.threshold));
        let per_wear = scales.friction / scales.wear_coefficient;
        history.dissipated_energy.push(entry.worn_by_energy * scales.volume() * per_wear);
        let Some((curves, found)) = entry.curves else { return };
        let profiles = &mut self.profiles;
        profiles.cycles.push(n);
        let worn = self.initial.iter().zip(&curves.wear);
        profiles.worn.push(worn.map(|(initial, wear)| (initial + wear) * height).collect());
        profiles.wear.push(scaled(curves.wear, height));
        profiles.image.push(scaled(curves.image, height));
        profiles.pressure.push(scaled(curves.pressure, scales.pressure()));
        profiles.slip.push(scaled(curves.slip, amplitude));
        let loops = &mut self.loops;
        loops.cycles.push(n);
        loops.displacement.push(scaled(found.displacement, scales.gross_slip_amplitude()));
        loops.tangential_force.push(scaled(found.force, scales.tangential(1.0)));
        loops.energy_ratio.push(found.energy_ratio);
        loops.slip_ratio.push(found.slip_ratio);
        loops.free_ratio.push(found.free_ratio);
    }

    pub(super) fn outcome(&mut self) -> Outcome {
        let shows = self.case.profile_rows() > 0;
        let profiles = std::mem::take(&mut self.profiles);
        let loops = std::mem::take(&mut self.loops);
        let history = std::mem::take(&mut self.history);
        let march = match &self.solver {
            Solver::March(march) => march.as_deref(),
            Solver::Closed(_) => None,
        };
        let work = march.map(March::work);
        let cycles = self.case.scales.cycles;
        Outcome {
            scales: Scales::of(&self.case),
            unworn: Unworn::of(&self.case),
            regime: self.case.regime(),
            limit: limit_state(&self.case),
            bodies: self.case.share.map(|share| BodyWear::of(share, &history)),
            history,
            profiles: shows.then_some(profiles),
            loops: shows.then_some(loops),
            events: self.events.iter().map(|event| outcome::Event::of(event, cycles)).collect(),
            accuracy: Accuracy {
                energy_mismatch: self.mismatch,
                volume_error: self.volume_error,
                cells: march.map(March::cells),
                steps: work.map(|(steps, _)| steps),
                evaluations: work.map(|(_, evaluations)| evaluations),
            },
            comparison: None,
            warnings: Vec::new(),
        }
    }
}

impl Worn {
    /// Holds an entry to what has been reported: wear that falls by the noise of a step, or where the
    /// simplified rule's ã passes, stays.
    fn hold(&mut self, entry: &mut Entry) {
        let hold = |known: &mut f64, value: &mut f64| {
            // Not by `f64::max`, which looks out for what is no number.
            *value = if *value < *known { *known } else { *value };
            *known = *value;
        };
        hold(&mut self.volume, &mut entry.volume);
        hold(&mut self.deepest, &mut entry.deepest);
        hold(&mut self.scar, &mut entry.scar);
        if let Some((curves, _)) = &mut entry.curves {
            self.wear.resize(curves.wear.len(), 0.0);
            for (known, wear) in self.wear.iter_mut().zip(&mut curves.wear) {
                hold(known, wear);
            }
        }
    }
}

/// Looks for the instant at which the wear that was asked for is reached, some states at a time: none
/// while there is more to look at, infinite if it is never reached.
fn seek(
    case: &Case,
    simplified: &Simplified,
    xi: f64,
    seeking: &mut Option<Bracket>,
) -> Option<f64> {
    let last = case.normalized_end();
    let missing = |time: f64| {
        let states = simplified.states(&[(simplified.decay(xi, time), false)]);
        states.first().map_or(1.0, |state| case.until.missing(state.depth, state.volume))
    };
    let Some(bracket) = seeking else {
        if case.until == Until::default() {
            return Some(f64::INFINITY);
        }
        let end = missing(last);
        if end > 0.0 {
            return Some(f64::INFINITY);
        }
        *seeking = Some(Bracket::new((0.0, case.until.missing(0.0, 0.0)), (last, end)));
        return None;
    };
    // Rows that are made anew cost more than their products.
    let per_state = (2 * case.points * case.points) as f64;
    for _ in 0..((STEP_OPERATIONS / per_state) as usize).max(1) {
        match bracket.next().filter(|_| bracket.width() > SOUGHT) {
            Some(time) => bracket.narrow(time, missing(time)),
            None => return Some(bracket.found()),
        }
    }
    None
}

/// What happens up to the last instant, from the closed form of the simplified rule, and when the wear
/// that was asked for is `reached`.
fn closed_events(case: &Case, simplified: &Simplified, xi: f64, reached: f64) -> Vec<Event> {
    use EventKind::{ContactLost, Shakedown, UntilReached};
    let last = case.normalized_end();
    let row = simplified.row();
    let unworn = row.sums(simplified.decay(xi, 0.0));
    let sums = |time: f64| row.sums(simplified.decay(xi, time));
    let mut events = Vec::new();
    let mut look = |kind, ends, signal: &dyn Fn(f64) -> f64| {
        // As logarithms, what decays is all but straight, and its root soon found.
        if signal(last) <= 0.0 {
            events.push(Event { at: root(0.0, last, signal), kind, ends });
        }
    };
    if case.regime() == Regime::GrossSlip {
        look(ContactLost, true, &|time| libm::log(sums(time).normal / (LOST * unworn.normal)));
    } else {
        look(Shakedown, false, &|time| libm::log(sums(time).energy / (SHAKEN * unworn.energy)));
    }
    if reached.is_finite() {
        events.push(Event { at: reached, kind: UntilReached, ends: true });
    }
    events.sort_by(|a, b| a.at.total_cmp(&b.at));
    let end = events.iter().position(|event| event.ends);
    events.truncate(end.map_or(events.len(), |end| end + 1));
    events
}

fn scaled(mut values: Vec<f64>, scale: f64) -> Vec<f64> {
    for value in &mut values {
        *value *= scale;
    }
    values
}
