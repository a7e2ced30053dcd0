//! Events of the simplified rule, from its closed form.

use super::energy::dissipated;
use super::simplified::Simplified;
use crate::contact::{Normal, Regime};
use crate::numeric::{root, root_between};
use crate::solver::events::{Event, EventKind, LOST, SHAKEN, StopCondition};
use crate::solver::splits::{SplitWatch, WornCore};

/// Relative accuracy of the time at which the stop condition is met.
const STOP_DIGITS: f64 = 1e-12;

/// The time in N₀ at which the stop condition is met. Infinite if it is not met before the time `last`.
pub(crate) fn stop_time(solver: &Simplified, xi: f64, condition: StopCondition, last: f64) -> f64 {
    let missing = |time: f64| {
        let state = solver.states(&[(solver.decay(xi, time), false)]).swap_remove(0);
        condition.missing(state.depth, state.volume, dissipated(&solver.contact, xi, &state.sums))
    };
    if condition == StopCondition::default() {
        return f64::INFINITY;
    }
    let end = missing(last);
    if end > 0.0 {
        return f64::INFINITY;
    }
    let start = condition.missing(0.0, 0.0, 0.0);
    root_between(STOP_DIGITS, (0.0, start), (last, end), missing)
}

/// All events up to the time `last`: the given `events`, and those that this function finds.
pub(crate) fn events(
    solver: &Simplified,
    xi: f64,
    last: f64,
    mut events: Vec<Event>,
) -> Vec<Event> {
    use EventKind::{ContactLost, ContactSplits, Shakedown};
    let row = &solver.row;
    let unworn = row.sums(solver.decay(xi, 0.0));
    let sums = |time: f64| row.sums(solver.decay(xi, time));
    let mut look = |kind, ends, signal: &dyn Fn(f64) -> f64| {
        // The logarithm of a decaying quantity is almost linear, so the search for its root is
        // short.
        if signal(last) <= 0.0 {
            events.push(Event::new(root(0.0, last, signal), kind, ends));
        }
    };
    if solver.contact.regime == Regime::GrossSlip {
        look(ContactLost, false, &|time| libm::log(sums(time).normal / (LOST * unworn.normal)));
    } else {
        look(Shakedown, false, &|time| libm::log(sums(time).energy / (SHAKEN * unworn.energy)));
    }
    if let Some(splits) = SplitWatch::new(&solver.contact, Normal::Depth) {
        look(ContactSplits, true, &|time| {
            let decay = solver.decay(xi, time);
            // In the closed form, the contact radius stays a₀.
            let core = WornCore { depth: 1.0, normal: sums(time).normal, edge: 1.0 };
            splits.signal(&core, || (solver.mesh.radii.clone(), solver.wear(decay)))
        });
    }
    events.sort_by(|a, b| a.at.total_cmp(&b.at));
    let end = events.iter().position(|event| event.ends);
    events.truncate(end.map_or(events.len(), |end| end + 1));
    events
}
