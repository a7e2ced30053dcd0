//! Friction loops: force over displacement in many cycles, cut into cycles.
//!
//! The longest strokes give the period. Then the displacement, smoothed over a small part of that, gives the reversals: those
//! that return within a part of the period are inside a stroke. The middles of the strokes give the drift of displacement and
//! force, which is removed. A cycle begins in the middle of a stroke, or at the displacement at which the record begins or ends:
//! wherever the amplitude within a cycle changes least, and most cycles are whole. A line closes it.
//!
//! # Equations
//! ```text
//! W = ∮ F dx over cubic curves through the points, without the drift of x and F
//! ```
//!
//! # Accuracy
//! Ellipses with 20 points in a cycle have 0.02 % less energy than the curve. Loops with sharp corners have errors of up to 2 %
//! with 20 points, and 1 % with 30. `energy_error` is half of what the curves add to the energy along straight lines, with the
//! noise and with the steps of a coarse sensor.

use serde_json::{Map, Value, json};

use super::curve::{enough, is_spike, median, noise, period, spread};
use super::record::{Cycle, NOISE, Record};
use crate::notes::{Notes, counted};

/// A spike is off its neighbours by this share of the spread.
const SPIKE: f64 = 0.2;
/// A spike lasts at most this part of a period, and at most this many rows.
const SPIKES: (f64, f64) = (20.0, 6.0);
/// A cycle with so few points, in parts of those of its neighbours, lacks rows.
const LACKS: f64 = 0.92;
/// Cycles with fewer points, or with larger relative errors of the energy, are noted.
const FEWEST: usize = 20;
const LARGEST: f64 = 0.01;
/// Minimum number of rows in a mean cycle, and in the file.
const SPARSE: f64 = 8.0;
const LEAST: usize = 10;

/// The names of the columns of a table of loops.
const COLUMNS: &str =
    "points energy energy_error displacement_amplitude force_amplitude aperture slope slope_error";

const HELD: &str = "The force keeps one value over several rows and then jumps, so it was read more slowly than the displacement. \
                    Energy, aperture and slope are wrong: export both with the same rate, or keep only the rows with a new force.";

/// What is wrong with a cycle.
const FAULTS: [&str; 3] = [
    "with fewer rows than their neighbours",
    "in which the displacement jumps, as between two recordings (read each of them alone)",
    "that do not end at the force at which they begin, as from rest",
];
/// Maximum number of places in a note.
const MOST: usize = 5;

/// Why a cycle gives wrong numbers.
fn fault(record: &Record, jumps: &[usize], cycles: &[Cycle], at: usize) -> Option<&'static str> {
    let length = |it: &Cycle| it.2.row - it.1.row;
    let near = (at.saturating_sub(2)..(at + 3).min(cycles.len())).filter(|other| *other != at);
    let usual = median(near.map(|other| length(&cycles[other])));
    let (_, begin, end) = &cycles[at];
    let is_short = length(&cycles[at]) < (LACKS * usual).min(usual - 2.0);
    let is_jump = jumps.iter().any(|row| (begin.row..end.row).contains(&(*row as f64)));
    let faults = [is_short, is_jump, !record.closes(begin, end)];
    faults.into_iter().zip(FAULTS).find(|it| it.0).map(|it| it.1)
}

/// Leaves out spikes: rows that are far off their neighbours.
fn without_spikes(rows: Vec<(f64, f64)>, notes: &mut Notes) -> (Vec<f64>, Vec<f64>) {
    let (x, force): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
    let reach = (period(&x) / SPIKES.0).clamp(2.0, SPIKES.1) as usize;
    let limits = [&x, &force].map(|all| (all, (SPIKE * spread(all)).max(NOISE * noise(all))));
    let is_spike = |row: &usize| limits.iter().any(|it| is_spike(it.0, *row, reach, it.1));
    let (spikes, rows): (Vec<_>, Vec<_>) = (0..x.len()).partition(is_spike);
    let first = spikes.first().map_or(0, |row| row + 1);
    let told = format!("row(s) with spikes were left out, the first is row {first}.");
    counted(notes, spikes.len(), told);
    rows.iter().map(|row| (x[*row], force[*row])).unzip()
}

/// Cuts a record into cycles.
///
/// # Errors
/// The record has no whole cycle.
pub fn loops(rows: Vec<(f64, f64)>, notes: &mut Notes) -> Result<Value, String> {
    let (x, force) = without_spikes(enough(rows, LEAST, "rows with both numbers")?, notes);
    let count = x.len();
    let record = Record::of(x, force);
    if record.is_held {
        notes.push(HELD.to_owned());
    }
    let cycles = record.cycles();
    let (Some(first), Some(last)) = (cycles.first(), cycles.last()) else {
        return Err("is no loop: the displacement does not end where it begins. Keep the rows of one or more whole cycles, or \
                    choose the column of the displacement as x. For a profile, write prepare=trace".into());
    };
    let mean = (last.2.row - first.1.row) / cycles.len() as f64;
    if mean < SPARSE {
        return Err(format!(
            "has only {mean:.1} rows in a cycle. Sample the test faster: {FEWEST} are enough"
        ));
    }
    let outer = [first.1.row.ceil() as usize, count.saturating_sub(last.2.row.ceil() as usize)];
    // The motion itself can jump.
    let jumps = Some(record.jumps()).filter(|jumps| jumps.len() < cycles.len()).unwrap_or_default();
    let faults = (0..cycles.len()).map(|at| fault(&record, &jumps, &cycles, at)).zip(&cycles);
    let faults: Vec<_> = faults.collect();
    let is_any = faults.iter().any(|it| it.0.is_none());
    let told = if is_any { "left out" } else { "kept, as there is no other: record more cycles" };
    for kind in FAULTS {
        let own: Vec<_> = faults.iter().filter(|it| it.0 == Some(kind)).collect();
        let rows = own
            .iter()
            .take(MOST)
            .map(|(_, (_, begin, end))| format!("{:.0} to {:.0}", begin.row + 1.0, end.row + 1.0));
        let rows = rows.collect::<Vec<_>>().join(", ");
        counted(notes, own.len(), format!("cycle(s) {kind}, in rows {rows}. They were {told}."));
    }
    let whole = faults.iter().filter(|it| it.0.is_none() || !is_any);
    let mut cycles: Vec<_> = whole.map(|it| record.cycle(*it.1)).collect();
    if cycles.iter().map(|it| it[1]).sum::<f64>() < 0.0 {
        for cycle in &mut cycles {
            (cycle[1], cycle[6]) = (-cycle[1], -cycle[6]);
        }
        notes.push("The force points against the displacement, so its sign was turned.".to_owned());
    }
    tell(&cycles, outer, notes);
    let (mut table, mut means) = (Map::new(), Map::new());
    for (place, name) in COLUMNS.split(' ').enumerate() {
        let column = cycles.iter().map(|it| it[place]);
        let known: Vec<f64> = column.clone().filter(|it| it.is_finite()).collect();
        means.insert(name.to_owned(), (known.iter().sum::<f64>() / known.len() as f64).into());
        table.insert(name.to_owned(), column.collect());
    }
    let energy = means["energy"].clone();
    Ok(json!({"energy_per_cycle": energy, "cycles": cycles.len(), "loops": table, "mean": means}))
}

/// Says which rows are whole cycles, and what limits their energies.
fn tell(cycles: &[[f64; 8]], [before, after]: [usize; 2], notes: &mut Notes) {
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
        let most =
            if most < 1.0 { format!("by {:.2} %", 100.0 * most) } else { "all of it".into() };
        notes.push(format!(
            "{few} of {count} cycle(s) have fewer than {FEWEST} points. Few points, noise, or coarse steps of the displacement \
             make the energy uncertain by more than 1 % in {large} cycle(s): {most} in cycle {}. `energy_error` has the error of each.",
            worst + 1
        ));
    }
}
