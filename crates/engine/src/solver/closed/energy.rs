//! The dissipated energy of the simplified rule, from its closed form.
//!
//! # Equations
//! In units of a₀, d₀ and N₀, with the decay e = exp(−ξÑ/ã):
//! ```text
//! (k_w/μ)·ΣW = (ã/ξ)(F̃₀ − F̃),   its rate is 2 ∫ y ω dx
//! ```

use crate::contact::{Contact, Decay, SpringRow, Sums};
use crate::numeric::root;

/// Wear has practically stopped if the energy would grow, at the present rate, by less than this share over the
/// duration of the run so far. The time integration uses the same condition.
const STOPPED: f64 = 1e-6;

/// The dissipated energy as (k_w/μ)·ΣW, in units of a₀²d₀.
pub(crate) fn dissipated(contact: &Contact, xi: f64, sums: &Sums) -> f64 {
    2.0 * contact.limit.radius * sums.unloaded / xi
}

/// The times in N₀ at which (k_w/μ)·ΣW reaches `energies`, in ascending order. If wear practically stops or
/// `horizon` passes before the last of them, the list is shorter, and the second value is this time.
pub(crate) fn times(
    contact: &Contact,
    xi: f64,
    energies: &[f64],
    horizon: f64,
) -> (Vec<f64>, Option<f64>) {
    let row = SpringRow::new(contact);
    let scale = contact.limit.radius / xi;
    let sums = |time: f64| row.sums(Decay::after(time / scale));
    let reached = |time: f64| dissipated(contact, xi, &sums(time));
    // The logarithm is almost linear in time, so the search for its root is short.
    let goes_on = |time: f64| {
        let sums = sums(time);
        let rate = 2.0 * sums.energy / contact.threshold;
        libm::log(rate * time / (STOPPED * dissipated(contact, xi, &sums)))
    };
    let stop = if goes_on(horizon) > 0.0 {
        horizon
    } else {
        root(1e-3 * scale.min(horizon), horizon, goes_on)
    };
    let most = reached(stop);
    let times: Vec<f64> = energies
        .iter()
        .take_while(|energy| **energy <= most)
        .map(|energy| root(0.0, stop, |time| reached(time) - energy))
        .collect();
    let stops = times.len() < energies.len();
    (times, stops.then_some(stop))
}
