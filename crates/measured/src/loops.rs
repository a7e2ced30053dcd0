//! Friction loops: force over displacement in many cycles, cut into cycles.
//!
//! The longest strokes give the period. Then the displacement, smoothed over a small part of that, gives the reversals: those
//! that return within a part of the period are inside a stroke. A cycle begins where the displacement passes the middle between
//! its reversals, or the displacement at which the record begins or ends: wherever the amplitude within a cycle changes least,
//! and most cycles are whole. The middle follows the drift.
//!
//! # Equations
//! ```text
//! W = ∮ F dx over cubic curves through the points, minus F̄ · (drift of x in the cycle)
//! ```
//!
//! # Accuracy
//! Ellipses with 20 points in a cycle have 0.02 % less energy than the curve. Loops with sharp corners have errors of up to 2 %
//! with 20 points, and 1 % with 30. `energy_error` is the larger difference from every second point, with the noise.

use serde_json::{Map, Value, json};

use super::curve::{ends, is_spike, noise, spread};
use super::record::{Cycle, NOISE, Record};

/// A spike is off its neighbours by this share of the spread.
const SPIKE: f64 = 0.2;
/// A cycle with so few points, in parts of those of its neighbours, lacks rows.
const LACKS: f64 = 0.92;
/// Away from the middle, a place must give so many more cycles: there, amplitudes matter.
const ASIDE: f64 = 0.5;
/// Cycles with fewer points, or with larger relative errors of the energy, are noted.
const FEWEST: usize = 20;
const LARGEST: f64 = 0.01;
/// Minimum number of rows in a mean cycle, and in the file.
const SPARSE: f64 = 8.0;
const LEAST: usize = 10;

/// The names of the columns of a table of loops.
const COLUMNS: [&str; 8] = [
    "points",
    "energy",
    "energy_error",
    "displacement_amplitude",
    "force_amplitude",
    "aperture",
    "slope",
    "slope_error",
];

/// Why a cycle gives wrong numbers.
const FAULTS: [&str; 2] = [
    "with fewer rows than their neighbours",
    "that do not end at the force at which they begin, as from rest",
];
/// Maximum number of places in a note.
const MOST: usize = 5;

/// Says which of the cycles lack rows, or end at another force than they begin with. These give wrong numbers.
fn faults(record: &Record<'_>, cycles: &[Cycle]) -> Vec<Option<&'static str>> {
    let lengths: Vec<f64> = cycles.iter().map(|it| it.2.row - it.1.row).collect();
    let fault = |at: usize| {
        let near = at.saturating_sub(2)..(at + 3).min(lengths.len());
        let least = ends(near.filter(|other| *other != at).map(|other| lengths[other]))[0];
        let (_, begin, end) = &cycles[at];
        if least.is_finite() && lengths[at] < (LACKS * least).min(least - 2.0) {
            Some(FAULTS[0])
        } else {
            (!record.closes(begin, end)).then_some(FAULTS[1])
        }
    };
    (0..cycles.len()).map(fault).collect()
}

/// Cuts a record into cycles.
///
/// # Errors
/// The record has no whole cycle.
pub fn loops(
    x: &[Option<f64>],
    force: &[Option<f64>],
    notes: &mut Vec<String>,
) -> Result<Value, String> {
    let rows = x.iter().zip(force).filter_map(|(x, y)| Some(((*x)?, (*y)?)));
    let (mut x, mut force): (Vec<f64>, Vec<f64>) = rows.unzip();
    if x.len() < LEAST {
        return Err(format!("needs {LEAST} rows with both numbers, but the file has {}", x.len()));
    }
    let least = [&x, &force].map(|all| (SPIKE * spread(all)).max(NOISE * noise(all)));
    let is_spike = |row: &usize| is_spike(&x, *row, least[0]) || is_spike(&force, *row, least[1]);
    let (spikes, rows): (Vec<_>, Vec<_>) = (0..x.len()).partition(is_spike);
    if let Some(first) = spikes.first() {
        notes.push(format!(
            "{} row(s) with spikes were left out, the first is row {}.",
            spikes.len(),
            first + 1
        ));
        (x, force) = rows.iter().map(|row| (x[*row], force[*row])).unzip();
    }
    let record = Record::of(&x, &force);
    let mut best = (0.0, Vec::new());
    for place in record.places() {
        let mut found = record.cuts(place);
        found.0 -= if place.0.abs() > 0.0 { ASIDE } else { 0.0 };
        if !found.1.is_empty() && (best.1.is_empty() || found.0 > best.0) {
            best = found;
        }
    }
    let (Some(first), Some(last)) = (best.1.first(), best.1.last()) else {
        return Err("is no loop: it does not end where it begins. Keep the rows of one or more whole cycles. For a \
                    profile, write prepare=trace".into());
    };
    let mean = (last.2.row - first.1.row) / best.1.len() as f64;
    if mean < SPARSE {
        return Err(format!(
            "has only {mean:.1} rows in a cycle. Sample the test faster: {FEWEST} are enough"
        ));
    }
    let (before, after) =
        (first.1.row.ceil() as usize, x.len().saturating_sub(last.2.row.ceil() as usize));
    let faults = faults(&record, &best.1);
    let is_any = faults.iter().any(Option::is_none);
    let rows = |(_, begin, end): &Cycle| format!("{:.0} to {:.0}", begin.row + 1.0, end.row + 1.0);
    for kind in FAULTS {
        let own = faults.iter().zip(&best.1).filter(|(fault, _)| **fault == Some(kind));
        let own: Vec<String> = own.map(|(_, cycle)| rows(cycle)).collect();
        let told =
            if is_any { "left out" } else { "kept, as there is no other: record more cycles" };
        if !own.is_empty() {
            let count = own.len();
            let places = own[..count.min(MOST)].join(", ");
            notes.push(format!("{count} cycle(s) {kind}, in rows {places}. They were {told}."));
        }
    }
    let whole = best.1.iter().zip(&faults).filter(|(_, fault)| fault.is_none() || !is_any);
    let mut cycles: Vec<_> = whole.map(|(cycle, _)| record.cycle(*cycle)).collect();
    let sign = cycles.iter().map(|it| it[1]).sum::<f64>().signum();
    for cycle in &mut cycles {
        cycle[1] *= sign;
        cycle[6] *= sign;
    }
    if sign < 0.0 {
        notes.push("The force points against the displacement, so its sign was turned.".to_owned());
    }
    tell(&cycles, [before, after], notes);
    let (mut table, mut means) = (Map::new(), Map::new());
    for (place, name) in COLUMNS.into_iter().enumerate() {
        let column = cycles.iter().map(|it| it[place]);
        let known: Vec<f64> = column.clone().filter(|it| it.is_finite()).collect();
        means.insert(name.to_owned(), (known.iter().sum::<f64>() / known.len() as f64).into());
        table.insert(name.to_owned(), column.collect());
    }
    let energy = means["energy"].clone();
    Ok(json!({"energy_per_cycle": energy, "cycles": cycles.len(), "loops": table, "mean": means}))
}

/// Says which rows are whole cycles, and what limits their energies.
fn tell(cycles: &[[f64; 8]], [before, after]: [usize; 2], notes: &mut Vec<String>) {
    let count = cycles.len();
    notes.push(format!(
        "The rows are {count} cycle(s), each of which a line closes. The energy is their mean. The table has each of them."
    ));
    if before > 1 || after > 1 {
        notes.push(format!(
            "{before} row(s) before the first whole cycle and {after} row(s) after the last one were left out."
        ));
    }
    let few = cycles.iter().filter(|it| it[0] < FEWEST as f64).count();
    let shares = cycles.iter().map(|it| it[2] / it[1].abs()).enumerate();
    let large = shares.clone().filter(|it| it.1 > LARGEST).count();
    let (worst, most) = shares.max_by(|one, other| one.1.total_cmp(&other.1)).unwrap_or_default();
    if few + large > 0 {
        notes.push(format!(
            "{few} of {count} cycle(s) have fewer than {FEWEST} points. Few points or noise make the energy uncertain by more \
             than 1 % in {large} cycle(s): by {:.2} % in cycle {}. `energy_error` has the error of each.",
            100.0 * most, worst + 1
        ));
    }
}
