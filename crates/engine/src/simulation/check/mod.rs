//! Judges a result that another program has computed: can it be the result of its scenario?
//!
//! What follows from the scenario without a run must agree with a new computation to all digits. The tables must agree
//! with each other, with the held quantities and with the energy balance. This takes a few milliseconds. A changed
//! digit within these bounds shows only in a new run.
//!
//! The bounds are narrow enough to find any column that is wrong by a factor of 7. About 1 in 500 correct results of the
//! simplified rule lies outside of them, for instance near full stick. So a flaw is a reason to compute the result anew.
//!
//! # Equations
//! ```text
//! dV/dN = (k_w/μ)·W                exact method; the simplified rule roughly
//! V = 2π ∫ w r dr,   W = ∮ Q du
//! W ≤ 4QU,   Q ≤ μF,   V ≤ V∞
//! ```

mod flaw;
mod tables;

use serde::Serialize;
use serde_json::{Value, to_value};

pub use flaw::Flaw;
pub use tables::check_tables;

use super::comparing::relative;
use super::model_error::{model_error, warning};
use super::numerical_error;
use crate::case::{Case, Method};
use crate::contact::control::{Normal, Tangential};
use crate::outcome::{BodyWear, Comparison, History, Outcome, Preview, Profiles};
use crate::scenario::Scenario;
use crate::solver::events::{EventKind, LOST, SHAKEN};
use flaw::{NEAR, SAME, both, require, same, within};
use tables::check_history;

/// Relative error of forces under a rough table, which is interpolated between the springs.
const ROUGH: f64 = 0.01;
/// Relative error of the area of a loop, which has few corners.
const LOOP_ERROR: f64 = 0.05;
/// The bounds of (k_w/μ)·ΣW/V by the simplified rule.
const RULE_BALANCE: (f64, f64) = (0.1, 3.0);
/// The energy per cycle between two output cycles, compared with the smaller and the larger one at these cycles.
const BETWEEN: (f64, f64) = (0.6, 1.5);
/// An integral, compared with the sums of the smaller and of the larger values at the edges of its intervals.
const RINGS: (f64, f64) = (0.5, 2.0);
/// The output radii resolve a scar with this share of the last wear volume.
const YOUNG: f64 = 0.01;

/// Judges the result of a scenario and of the case built from it.
///
/// # Errors
/// The first flaw.
pub fn check(scenario: &Scenario, case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let Preview { scales, unworn, regime, limit, .. } = Preview::of(case);
    agree("scales", &outcome.scales, &scales)?;
    agree("unworn", &outcome.unworn, &unworn)?;
    agree("regime", &outcome.regime, &regime)?;
    agree("limit", &outcome.limit, &limit)?;
    let Outcome { history, profiles, loops, .. } = outcome;
    check_tables(history, profiles.as_ref(), loops.as_ref())?;
    check_growth(history)?;
    check_balance(case, history)?;
    check_first_row(outcome)?;
    check_output_cycles(case, outcome)?;
    check_held(case, outcome)?;
    check_forces(case, outcome)?;
    check_energy(case, history)?;
    check_bodies(case, outcome)?;
    check_profiles(case, outcome)?;
    check_loops(case, outcome)?;
    check_accuracy(case, outcome)?;
    check_comparison(case, outcome)?;
    let of_run = BodyWear::warning(&outcome.bodies).into_iter();
    let errors = numerical_error::stated(&outcome.accuracy);
    let of_run = of_run.chain(numerical_error::warning(case, errors));
    let of_run = of_run.chain(warning(outcome.accuracy.model_error));
    let warnings: Vec<_> = scenario.warnings(case).into_iter().chain(of_run).collect();
    agree("warnings", &outcome.warnings, &warnings)
}

/// Compares a member of the result with what it must be.
fn agree(name: &str, found: &impl Serialize, expected: &impl Serialize) -> Result<(), Flaw> {
    let agrees = match (to_value(found), to_value(expected)) {
        (Ok(found), Ok(expected)) => equal(&found, &expected),
        _ => false,
    };
    require(agrees, || format!("`{name}` does not belong to the scenario"))
}

fn equal(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            a.as_f64().zip(b.as_f64()).is_some_and(|(a, b)| same(a, b))
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal(a, b))
        }
        (Value::Object(a), Value::Object(b)) => {
            let mut members = a.iter().zip(b);
            a.len() == b.len() && members.all(|((a, x), (b, y))| a == b && equal(x, y))
        }
        _ => a == b,
    }
}

/// Wear begins at 0 and does not heal.
fn check_growth(history: &History) -> Result<(), Flaw> {
    let names = ["wear_volume", "wear_depth", "scar_radius", "dissipated_energy"];
    for (name, column) in history.columns().into_iter().filter(|(name, _)| names.contains(name)) {
        require(column[0] == 0.0, || format!("history: `{name}` does not begin at 0"))?;
        require(column.is_sorted_by(|a, b| *a <= b * (1.0 + SAME)), || {
            format!("history: `{name}` decreases")
        })?;
    }
    Ok(())
}

/// The wear volume is k_w/μ times the dissipated energy. The exact method satisfies this at each time, but for the
/// error of its time steps. The simplified rule satisfies it roughly, and not at all if its stick radius changes much.
fn check_balance(case: &Case, history: &History) -> Result<(), Flaw> {
    let (least, most, error) = match (case.method, &case.control.tangential) {
        (Method::Exact { tolerance, .. }, _) => {
            let error = 3.0 * tolerance;
            let limit = case.contact.limit.volume * case.scales.volume();
            (1.0 - error, 1.0 + error, 0.01 * error * limit)
        }
        (Method::Simplified { .. }, Tangential::Blocks(_)) => return Ok(()),
        (Method::Simplified { .. }, _) => (RULE_BALANCE.0, RULE_BALANCE.1, 0.0),
    };
    let per_energy = case.scales.wear_coefficient / case.scales.friction;
    let rows = history.wear_volume.iter().zip(&history.dissipated_energy);
    for (row, (volume, energy)) in rows.enumerate() {
        let worn = per_energy * energy;
        require((least * volume - error..=most * volume + error).contains(&worn), || {
            format!(
                "row {row} of the history violates the energy balance: the wear volume is {volume:e} m^3, but k_w/μ \
                 times the dissipated energy is {worn:e} m^3"
            )
        })?;
    }
    Ok(())
}

/// The first row is the unworn state. All times have the same unit.
fn check_first_row(outcome: &Outcome) -> Result<(), Flaw> {
    let Outcome { scales, unworn, history, .. } = outcome;
    let first = [
        ("contact_radius", history.contact_radius[0], scales.contact_radius),
        ("stick_radius", history.stick_radius[0], unworn.stick_radius),
        ("normal_force", history.normal_force[0], scales.normal_force),
        ("indentation_depth", history.indentation_depth[0], scales.indentation_depth),
        ("amplitude", history.amplitude[0], unworn.amplitude),
        ("tangential_force", history.tangential_force[0], unworn.tangential_force),
        ("energy_per_cycle", history.energy_per_cycle[0], unworn.energy_per_cycle),
    ];
    for (name, found, expected) in first {
        require(within(found, expected, ROUGH), || {
            format!(
                "history: `{name}` begins with {found:e}, but the unworn contact has {expected:e}"
            )
        })?;
    }
    let mut times = history.cycles.iter().zip(&history.normalized_cycles);
    require(times.all(|(cycles, time)| same(cycles / scales.cycles, *time)), || {
        "history: `normalized_cycles` is not `cycles` divided by N₀".to_owned()
    })
}

/// The output cycles are those of the scenario, unless the run has ended early.
fn check_output_cycles(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let history = &outcome.history;
    let last = history.cycles.len() - 1;
    let end = history.cycles[last] * (1.0 + SAME);
    require(outcome.events.iter().all(|event| (0.0..=end).contains(&event.cycles)), || {
        "an event is outside the history".to_owned()
    })?;
    let is_expected = |row: usize| history.has_reached(case, row);
    let is_complete = last + 1 == case.outputs.count() && is_expected(last);
    require((0..last).all(is_expected) && (is_complete || has_ended_early(outcome)), || {
        "the output cycles are not those of the scenario".to_owned()
    })
}

/// Whether an event has ended the run at its last row.
fn has_ended_early(outcome: &Outcome) -> bool {
    let end = outcome.history.cycles[outcome.history.cycles.len() - 1];
    outcome.events.iter().any(|event| {
        !matches!(event.kind, EventKind::ContactLost | EventKind::Shakedown)
            && same(event.cycles, end)
    })
}

/// The held quantities are constant.
fn check_held(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let History { normal_force, indentation_depth, tangential_force, amplitude, .. } =
        &outcome.history;
    let constant = |name: &str, column: &[f64]| {
        require(column.iter().all(|value| within(*value, column[0], NEAR)), || {
            format!("history: `{name}` is held, but it changes")
        })
    };
    match case.control.normal {
        Normal::Depth => constant("indentation_depth", indentation_depth)?,
        Normal::Force => constant("normal_force", normal_force)?,
    }
    match case.control.tangential {
        Tangential::Amplitude => constant("amplitude", amplitude),
        Tangential::Force(_) => {
            // In gross slip the last row differs from its bound by the error of the mesh.
            let slips = outcome.events.iter().any(|event| event.kind == EventKind::GrossSlip);
            let end = tangential_force.len() - usize::from(slips);
            constant("tangential_force", &tangential_force[..end.max(1)])
        }
        Tangential::Rig { .. } | Tangential::Blocks(_) | Tangential::Record(_) => Ok(()),
    }
}

/// Friction bounds the tangential force, the indentation depth bounds the wear depth, and the limiting state bounds the
/// wear volume.
fn check_forces(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let History { wear_volume, wear_depth, normal_force, indentation_depth, .. } = &outcome.history;
    let most = 1.02 + outcome.accuracy.numerical_error.unwrap_or(0.0);
    for (row, force) in outcome.history.tangential_force.iter().enumerate() {
        require(*force <= 1.01 * case.scales.friction * normal_force[row], || {
            format!("row {row} of the history: the tangential force exceeds friction")
        })?;
        let depth = indentation_depth[row].max(indentation_depth[0]);
        require(wear_depth[row] <= most * depth, || {
            format!("row {row} of the history: the wear depth exceeds the indentation depth")
        })?;
    }
    let volume = wear_volume[wear_volume.len() - 1];
    require(outcome.limit.is_none_or(|limit| volume <= most * limit.wear_volume), || {
        "history: the wear volume exceeds that of the limiting state".to_owned()
    })
}

/// Between two output cycles the energy per cycle lies between its values there. If the amplitude changes, only friction
/// bounds it.
fn check_energy(case: &Case, history: &History) -> Result<(), Flaw> {
    let History { cycles, normal_force, amplitude, energy_per_cycle, dissipated_energy, .. } =
        history;
    let blocks = case.largest_amplitude() * case.scales.amplitude;
    let has_blocks = matches!(case.control.tangential, Tangential::Blocks(_));
    let is_steady =
        matches!(case.control.tangential, Tangential::Amplitude | Tangential::Record(_));
    for row in 1..cycles.len() {
        let larger = |column: &[f64]| column[row - 1].max(column[row]);
        let least = energy_per_cycle[row - 1].min(energy_per_cycle[row]);
        let most = if is_steady {
            larger(energy_per_cycle)
        } else {
            4.0 * case.scales.friction * larger(normal_force) * larger(amplitude).max(blocks)
        };
        // A run does not resolve the decay after shakedown or loss of contact.
        let has_settled = least <= 2.0 * SHAKEN * energy_per_cycle[0]
            || normal_force[row] <= 2.0 * LOST * normal_force[0];
        let least = if has_settled || has_blocks { 0.0 } else { least };
        let span = cycles[row] - cycles[row - 1];
        let energy = dissipated_energy[row] - dissipated_energy[row - 1];
        let rounding = SAME * dissipated_energy[row];
        let bounds = BETWEEN.0 * least * span - rounding..=BETWEEN.1 * most * span + rounding;
        require(bounds.contains(&energy), || {
            format!(
                "row {row} of the history: {span} cycles have dissipated {energy:e} J, but the energy per cycle is \
                 {least:e} to {most:e} J"
            )
        })?;
    }
    Ok(())
}

/// The wear of the bodies is their share. The scar of the counterbody is at least as long as the other one.
fn check_bodies(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let History { wear_depth, wear_volume, scar_radius, .. } = &outcome.history;
    let [first, second] = &outcome.bodies;
    let shares = [case.share, case.share.map(|share| 1.0 - share)];
    for (body, share) in [first, second].into_iter().zip(shares) {
        let is_share = |part: &Option<Vec<f64>>, whole: &[f64]| match (part, share) {
            (Some(part), Some(share)) => {
                let mut rows = part.iter().zip(whole);
                part.len() == whole.len() && rows.all(|(part, of)| same(*part, share * of))
            }
            (part, share) => part.is_none() && share.is_none(),
        };
        let is_shared = both(body.share, share, SAME)
            && is_share(&body.wear_depth, wear_depth)
            && is_share(&body.wear_volume, wear_volume);
        require(is_shared, || {
            "bodies: wear depth and volume are not the share of the body".to_owned()
        })?;
        let lengths = &body.scar_half_length;
        require(lengths.len() == scar_radius.len() && lengths.is_sorted(), || {
            "bodies: `scar_half_length` decreases, or has not as many entries as the history"
                .to_owned()
        })?;
    }
    let lengths = first.scar_half_length.iter().zip(&second.scar_half_length);
    let mut lengths = lengths.zip(scar_radius);
    let slack = 1.0 + SAME;
    require(lengths.all(|((a, b), scar)| *scar <= a * slack && *a <= b * slack), || {
        "bodies: a scar is shorter than the contact".to_owned()
    })
}

/// Profiles exist for the output cycles of the scenario. They begin with its shape, and contain the wear of the history.
fn check_profiles(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let Outcome { history, profiles, .. } = outcome;
    let Some(profiles) = profiles else {
        return require(case.profile_rows() == 0, || "it has no profiles".to_owned());
    };
    let last = history.cycles.len() - 1;
    let shows_end = case.profile_rows() > 0 && has_ended_early(outcome);
    let is_shown =
        |row: &usize| case.profiles.get(*row) == Some(&true) || *row == last && shows_end;
    let shown: Vec<usize> = (0..=last).filter(is_shown).collect();
    let cycles: Vec<f64> = shown.iter().map(|row| history.cycles[*row]).collect();
    require(profiles.cycles == cycles, || {
        "profiles: the output cycles are not those of the scenario".to_owned()
    })?;
    require(profiles.radius.len() == case.points, || {
        format!("profiles: there are {} radii instead of {}", profiles.radius.len(), case.points)
    })?;
    let (length, height) = (case.scales.contact_radius, case.scales.indentation_depth);
    let extent = case.contact.shape.extent() * length * (1.0 + SAME);
    require(profiles.radius.iter().all(|radius| *radius <= extent), || {
        "profiles: a radius lies outside of the indenter".to_owned()
    })?;
    let is_profile = |row: &[f64], profile: &dyn Fn(f64) -> f64| {
        row.iter().zip(&profiles.radius).all(|(found, radius)| {
            let expected = height * profile(radius / length);
            (found - expected).abs() <= NEAR * (height + expected)
        })
    };
    let shape = &case.contact.shape;
    let limiting = match (&profiles.limiting, &case.tends_to) {
        (Some(row), Some(end)) => is_profile(row, &|r| end.profile(shape, r)),
        (row, end) => row.is_none() && end.is_none(),
    };
    require(limiting && is_profile(&profiles.initial, &|r| shape.profile(r)), || {
        "profiles: `initial` or `limiting` does not belong to the scenario".to_owned()
    })?;
    for (place, row) in shown.into_iter().enumerate() {
        let (worn, wear) = (&profiles.worn[place], &profiles.wear[place]);
        let mut points = worn.iter().zip(&profiles.initial).zip(wear);
        let is_sum = points.all(|((worn, initial), wear)| {
            (worn - initial - wear).abs() <= SAME * worn.abs().max(initial.abs())
        });
        require(is_sum, || format!("profiles: `worn` of row {row} is not `initial` + `wear`"))?;
        check_scar(history, row, &profiles.radius, wear)?;
        check_load(case, history, profiles, (place, row))?;
    }
    Ok(())
}

/// Compares the wear at the output radii with a row of the history.
fn check_scar(history: &History, row: usize, radius: &[f64], wear: &[f64]) -> Result<(), Flaw> {
    let deepest = wear.iter().copied().fold(0.0, f64::max);
    let (depth, volume) = (history.wear_depth[row], history.wear_volume[row]);
    require(deepest <= depth * (1.0 + 1e-3), || {
        format!(
            "profiles: the wear of row {row} is {deepest:e} m deep, but its wear depth is {depth:e} m"
        )
    })?;
    let (least, most) = bounds_of_integral(radius, wear, ring);
    // A scar can grow beyond the output radii, and a young one can lie between two of them.
    let is_covered = history.scar_radius[row] < radius[radius.len() - 1];
    let young = YOUNG * history.wear_volume[history.wear_volume.len() - 1];
    let most = if is_covered { RINGS.1 * most + young } else { f64::INFINITY };
    require((RINGS.0 * least..=most).contains(&volume), || {
        format!("profiles: the wear of row {row} does not have the wear volume of the history")
    })
}

/// The springs below the image carry the normal force. Pressure may be infinite, so it is bounded only from below. The
/// slip is about the amplitude at most.
fn check_load(
    case: &Case,
    history: &History,
    profiles: &Profiles,
    (place, row): (usize, usize),
) -> Result<(), Flaw> {
    let (depth, force) = (history.indentation_depth[row], history.normal_force[row]);
    let springs: Vec<f64> = profiles.image[place].iter().map(|g| (depth - g).max(0.0)).collect();
    let spring = |from: f64, to: f64| 2.0 * case.scales.normal_modulus * (to - from);
    let (least, most) = bounds_of_integral(&profiles.radius, &springs, spring);
    let error = YOUNG * history.normal_force[0];
    require((RINGS.0 * least - error..=RINGS.1 * most + error).contains(&force), || {
        format!("profiles: `image` of row {row} does not carry the normal force")
    })?;
    let (_, most) = bounds_of_integral(&profiles.radius, &profiles.pressure[place], ring);
    require(force <= RINGS.1 * most + error, || {
        format!("profiles: `pressure` of row {row} does not carry the normal force")
    })?;
    let most = 2.0 * history.amplitude[row] * case.loops_per_cycle();
    require(profiles.slip[place].iter().all(|slip| *slip <= most), || {
        format!("profiles: `slip` of row {row} exceeds the amplitude")
    })
}

/// The area between two radii.
fn ring(from: f64, to: f64) -> f64 {
    std::f64::consts::PI * (to * to - from * from)
}

/// The sums of the smaller and of the larger values at the edges of all intervals, weighted by `measure` of the interval.
fn bounds_of_integral(
    radius: &[f64],
    values: &[f64],
    measure: impl Fn(f64, f64) -> f64,
) -> (f64, f64) {
    let intervals = radius.windows(2).zip(values.windows(2));
    intervals.fold((0.0, 0.0), |(least, most), (r, value)| {
        let weight = measure(r[0], r[1]);
        (least + weight * value[0].min(value[1]), most + weight * value[0].max(value[1]))
    })
}

/// The loops reach the amplitude and the tangential force, and enclose the energy per cycle. Of a displacement record
/// only the largest loop is known.
fn check_loops(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let (history, Some(loops)) = (&outcome.history, &outcome.loops) else { return Ok(()) };
    let mut rows = 0..history.cycles.len();
    for (place, cycles) in loops.cycles.iter().enumerate() {
        let Some(row) = rows.find(|row| same(history.cycles[*row], *cycles)) else { continue };
        let (u, q) = (&loops.displacement[place], &loops.tangential_force[place]);
        let most = |column: &[f64]| column.iter().copied().fold(0.0, f64::max);
        let (amplitude, force) = (history.amplitude[row], history.tangential_force[row]);
        require(within(most(u), amplitude, NEAR) && within(most(q), force, ROUGH), || {
            format!("loops: row {row} does not reach amplitude and tangential force of the history")
        })?;
        let sides = u.windows(2).zip(q.windows(2));
        let area: f64 = sides.map(|(u, q)| 0.5 * (u[1] - u[0]) * (q[0] + q[1])).sum();
        let energy = history.energy_per_cycle[row];
        let error = LOOP_ERROR * energy + NEAR * amplitude * force;
        let least = if case.control.has_record() { 0.0 } else { energy };
        require((least - error..=energy + error).contains(&area), || {
            format!(
                "loops: row {row} encloses {area:e} J, but the energy per cycle is {energy:e} J"
            )
        })?;
    }
    Ok(())
}

/// The estimates of the error follow from the history.
fn check_accuracy(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let Outcome { history, accuracy, .. } = outcome;
    let last = history.cycles.len() - 1;
    let volume = history.wear_volume[last] / case.scales.volume();
    let worn = case.scales.worn_by(history.dissipated_energy[last]);
    let mismatch = (volume > 0.0).then(|| worn / volume - 1.0);
    let error = NEAR * (1.0 + mismatch.unwrap_or(0.0).abs());
    require(both(accuracy.energy_mismatch, mismatch, error), || {
        "accuracy: `energy_mismatch` does not follow from the history".to_owned()
    })?;
    let expected = match case.method {
        Method::Exact { .. } => Some(0.0),
        Method::Simplified { .. } => model_error(case, case.unworn().loss, history),
    };
    let error = NEAR * (1.0 + expected.unwrap_or(0.0));
    require(both(accuracy.model_error, expected, error), || {
        "accuracy: `model_error` does not follow from the history".to_owned()
    })?;
    let largest = |column: &[f64]| mismatch.map(|_| column.iter().copied().fold(0.0, f64::max));
    for (name, error, column) in [
        ("numerical_error", accuracy.numerical_error, &history.wear_volume_error),
        ("wear_depth_error", accuracy.wear_depth_error, &history.wear_depth_error),
    ] {
        require(both(error, largest(column), SAME), || {
            format!("accuracy: `{name}` is not the largest error of the history")
        })?;
    }
    Ok(())
}

/// A comparison has the errors of its two histories.
fn check_comparison(case: &Case, outcome: &Outcome) -> Result<(), Flaw> {
    let xi = match case.method {
        Method::Exact { compare, .. } => compare,
        Method::Simplified { .. } => None,
    };
    let (xi, comparison) = match (xi, &outcome.comparison) {
        (Some(xi), Some(comparison)) => (xi, comparison),
        (xi, comparison) => {
            return require(xi.is_none() && comparison.is_none(), || {
                "`comparison` does not belong to the scenario".to_owned()
            });
        }
    };
    let Comparison { history: rule, errors, best_xi, best_error, .. } = comparison;
    check_history(rule)?;
    check_growth(rule)?;
    check_balance(&case.rule(xi), rule)?;
    let exact = &outcome.history;
    // If the rule ended early, its last row is different.
    let both_cycles = rule.cycles.iter().zip(&exact.cycles);
    let shared = both_cycles.take_while(|(rule, exact)| same(**rule, **exact)).count();
    let columns = [
        (&errors.wear_volume, &rule.wear_volume, &exact.wear_volume),
        (&errors.wear_depth, &rule.wear_depth, &exact.wear_depth),
        (&errors.normal_force, &rule.normal_force, &exact.normal_force),
        (&errors.indentation_depth, &rule.indentation_depth, &exact.indentation_depth),
        (&errors.dissipated_energy, &rule.dissipated_energy, &exact.dissipated_energy),
    ];
    let follows = |(errors, rule, exact): (&Vec<f64>, &Vec<f64>, &Vec<f64>)| {
        let expected = relative(&rule[..shared], exact);
        let mut rows = errors.iter().zip(&expected);
        errors.len() == shared
            && rows
                .all(|(found, expected)| (found - expected).abs() <= NEAR * (1.0 + expected.abs()))
    };
    require(same(comparison.xi, xi) && columns.into_iter().all(follows), || {
        "comparison: the errors do not follow from the histories".to_owned()
    })?;
    let best = best_xi.is_none_or(|xi| (0.1..=10.0).contains(&xi))
        && best_error.is_none_or(|error| error >= 0.0);
    require(best && best_xi.is_some() == best_error.is_some(), || {
        "comparison: `best_xi` or `best_error` is out of range".to_owned()
    })
}
