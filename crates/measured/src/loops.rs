//! Friction loops: force over displacement in many cycles, cut into cycles.
//!
//! A reversal counts if the displacement then returns by more than its noise. A cycle begins where the displacement passes the
//! middle between its reversals, or the displacement at which the record begins: wherever the amplitude within a cycle changes
//! least, and most cycles are whole. The middle follows the drift.
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

use super::curve::{aperture, changes, coarseness, ends, noise, turns, work};

/// A reversal counts if the displacement returns by this many standard deviations of its noise, and by a share of the
/// longest stroke between these.
const NOISE: f64 = 10.0;
const SHARES: [f64; 2] = [0.05, 0.12];
/// A record may begin and end this share of a stroke away from where a cycle does. A line then closes the cycle.
/// Otherwise at most this many steps from row to row.
const GAP: f64 = 0.06;
const STEPS: f64 = 1.7;
/// Rows are near a reversal within this share of a stroke.
const NEAR: f64 = 0.1;
/// The middle of a stroke is the mean of up to this many on each side.
const SMOOTH: usize = 5;
/// Changes of the amplitude within a cycle count beyond this share, each as this many whole cycles.
const CHANGE: (f64, f64) = (0.05, 4.0);
/// An amplitude is that of means over one in this many points of a cycle.
const MEANS: usize = 100;
/// Cycles with fewer points, or with larger relative errors of the energy, are noted.
const FEWEST: usize = 20;
const LARGEST: f64 = 0.01;
/// Minimum number of rows in a mean cycle, and in the file.
const SPARSE: f64 = 8.0;
const LEAST: usize = 10;

/// The names of the columns of a table of loops.
const COLUMNS: [&str; 7] = [
    "points",
    "energy",
    "energy_error",
    "displacement_amplitude",
    "force_amplitude",
    "aperture",
    "slope",
];

/// Where a cycle begins or ends: its first row, the displacement and the force there, and the energy until there. A line of the
/// length `open` along the displacement closes the cycle.
#[derive(Clone, Copy)]
struct Cut {
    row: f64,
    x: f64,
    force: f64,
    work: f64,
    open: f64,
}

/// What is cut at: the middle between the reversals, or the displacement at which the record begins.
#[derive(Clone, Copy, PartialEq)]
enum At {
    Middle,
    Begin,
}

/// A record, and its reversals with both ends.
struct Record<'a> {
    x: &'a [f64],
    force: &'a [f64],
    /// The energy until each row.
    work: Vec<f64>,
    turns: Vec<usize>,
    /// The middle of the displacement in each stroke, from reversal to reversal.
    middles: Vec<f64>,
}

impl<'a> Record<'a> {
    fn of(x: &'a [f64], force: &'a [f64]) -> Self {
        let [low, high] = ends(x.iter().copied());
        let scatter = NOISE * noise(x);
        let first = turns(x, scatter.min(SHARES[1] * (high - low)));
        let strokes = first.windows(2).map(|pair| (x[pair[1]] - x[pair[0]]).abs());
        let longest = strokes.fold(0.0, f64::max);
        let turns = turns(x, scatter.clamp(SHARES[0] * longest, SHARES[1] * longest));
        let mut own = Self { x, force, work: work(x, force), turns, middles: Vec::new() };
        own.middles = own.middles();
        own
    }

    /// The middle of the time near a reversal, in rows.
    fn time(&self, turn: usize) -> f64 {
        let Self { x, turns, .. } = self;
        let (at, before, after) = (turns[turn], turns[turn - 1], turns[turn + 1]);
        let reach = NEAR * (x[at] - x[before]).abs().min((x[at] - x[after]).abs());
        let far = |row: usize| (x[row] - x[at]).abs() - reach;
        // How far after a row, towards another one, the reach ends.
        let share = |row: usize, other: usize| far(other) / (far(other) - far(row));
        let first = (before..at).rev().find(|row| far(*row) > 0.0).unwrap_or(before);
        let last = (at..=after).find(|row| far(*row) > 0.0).unwrap_or(after);
        0.5 * (first as f64 + 1.0 - share(first, first + 1) + last as f64 - 1.0
            + share(last, last - 1))
    }

    /// The displacement in the middle of the time between reversals, smoothed over the strokes.
    fn middles(&self) -> Vec<f64> {
        let Self { x, turns, .. } = self;
        let strokes = turns.len().saturating_sub(1);
        if strokes < 3 {
            let sum: f64 = turns.iter().take(2).map(|row| x[*row]).sum();
            return vec![0.5 * sum; strokes];
        }
        let middle = |stroke: usize| {
            let time = 0.5 * (self.time(stroke) + self.time(stroke + 1));
            let (row, share) = (time as usize, time.fract());
            let own = x[row] + share * (x[row + 1] - x[row]);
            let [low, high] = ends([x[turns[stroke]], x[turns[stroke + 1]]].into_iter());
            own.clamp(low + NEAR * (high - low), high - NEAR * (high - low))
        };
        let all: Vec<f64> = (1..strokes - 1).map(middle).collect();
        let last = all.len() - 1;
        let far = SMOOTH.min(last);
        // How far the middle drifts in a stroke near both ends.
        let drifts =
            [all[far] - all[0], all[last] - all[last - far]].map(|it| it / far.max(1) as f64);
        let mean = |at: usize| {
            let reach = at.min(last - at).min(SMOOTH);
            all[at - reach..=at + reach].iter().sum::<f64>() / (2 * reach + 1) as f64
        };
        let inner = (0..=last).map(mean);
        let ends = [all[0] - drifts[0], all[last] + drifts[1]];
        std::iter::once(ends[0]).chain(inner).chain([ends[1]]).collect()
    }

    /// Where the stroke after a reversal passes the place of a cut. `None` if it does not.
    fn cut(&self, stroke: usize, at: At) -> Option<Cut> {
        let Self { x, force, work, turns, middles } = self;
        let (from, last) = (*turns.get(stroke)?, turns.len() - 1);
        let (middle, begin) = (middles[stroke.min(last - 1)], x[turns[0]] - middles[0]);
        // The end of the record can be where the next stroke begins.
        let to = turns.get(stroke + 1).copied().unwrap_or(turns[last - 1]);
        let towards = (x[to] - x[from]).signum();
        // The record begins as far from the next reversal as from the one before, in parts of the amplitude.
        let next = if stroke + 1 >= last { turns[stroke.max(1) - 1] } else { to };
        let (like, first) = if begin * towards > 0.0 { (next, 1) } else { (from, 2) };
        let level = match at {
            At::Begin if stroke == 0 => x[from],
            At::Begin => middle + begin * (x[like] - middle) / (x[*turns.get(first)?] - middles[0]),
            At::Middle => middle,
        };
        let ahead = |row: usize| towards * (level - x[row]);
        let near = |row: usize, next: usize, after: f64| {
            let stroke = 2.0 * (x[to] - middle).abs().max((x[from] - middle).abs());
            let is_near = ahead(row).abs() <= (GAP * stroke).max(STEPS * (x[row] - x[next]).abs());
            let open = level - x[row];
            is_near.then(|| Cut {
                row: row as f64 + after,
                x: level,
                force: force[row],
                work: work[row],
                open,
            })
        };
        // The record can end at a reversal.
        let is_turn = || (x[from] - x[turns[last - 2]]).abs() <= GAP * (x[from] - x[to]).abs();
        if stroke == last && (last < 2 || !is_turn()) {
            return None;
        }
        if ahead(from) <= 0.0 || stroke == last {
            return near(from, if stroke == 0 { from + 1 } else { from - 1 }, 0.0);
        }
        let Some(after) = (from..=to).find(|row| ahead(*row) <= 0.0) else {
            return if stroke + 1 == last { near(to, to - 1, 1.0) } else { None };
        };
        let before = after - 1;
        let share = (level - x[before]) / (x[after] - x[before]);
        let own = force[before] + share * (force[after] - force[before]);
        let work = work[before] + 0.5 * (force[before] + own) * (level - x[before]);
        Some(Cut { row: before as f64 + share, x: level, force: own, work, open: 0.0 })
    }

    /// The cuts of the whole cycles that begin in every other stroke from the first one or the next one, and how good they are.
    fn cuts(&self, (at, first): (At, usize)) -> (f64, Vec<(usize, Cut, Cut)>) {
        let starts = (first..self.turns.len()).step_by(2);
        let cycles = starts.filter_map(|stroke| {
            let (begin, end) = (self.cut(stroke, at)?, self.cut(stroke + 2, at)?);
            Some((stroke, begin, end))
        });
        let cycles: Vec<_> = cycles.collect();
        let score = cycles.iter().map(|(stroke, ..)| {
            let from = |turn: usize| (self.x[self.turns[turn]] - self.middles[stroke + 1]).abs();
            let (one, other) = (from(stroke + 1), from(stroke + 2));
            1.0 - CHANGE.1 * ((one - other).abs() / one.max(other) - CHANGE.0).max(0.0)
        });
        (score.sum(), cycles)
    }

    /// The numbers of a cycle: those of [`COLUMNS`].
    fn cycle(&self, (stroke, begin, end): (usize, Cut, Cut), scatter: [f64; 2]) -> [f64; 7] {
        let rows = begin.row.ceil() as usize..(end.row.ceil() as usize).min(self.x.len());
        let drift = (end.x - begin.x) / (end.row - begin.row);
        let straight = |row: usize| self.x[row] - drift * (row as f64 - begin.row);
        let x: Vec<f64> = rows.clone().map(straight).collect();
        let force = &self.force[rows.clone()];
        let count = x.len();
        let mean = force.iter().sum::<f64>() / count as f64;
        let line = 0.5 * (begin.force + end.force) * (end.open - begin.open);
        let energy = end.work - begin.work + line - mean * (end.x - begin.x);
        let start = begin.force - mean;
        let noise =
            [scatter[0] * (changes(force) + start * start).sqrt(), scatter[1] * changes(&x).sqrt()];
        let noise = (noise[0] * noise[0] + noise[1] * noise[1]).sqrt();
        let error = 0.6 * coarseness(&x, force) + 2.5 * noise;
        let width = count / MEANS + 1;
        let [[left, right], [low, high]] = [&x[..], force].map(|all| {
            ends(all.windows(width).map(|near| near.iter().sum::<f64>() / width as f64))
        });
        let turns = self.turns[stroke + 1..stroke + 3].iter();
        let flanks = turns.map(|turn| self.flank(*turn, (high - low) / 3.0));
        let [xx, xf] = flanks.fold([0.0; 2], |sums, own| [sums[0] + own[0], sums[1] + own[1]]);
        let aperture = aperture(&x, force, 0.5 * (low + high));
        [count as f64, energy, error, 0.5 * (right - left), 0.5 * (high - low), aperture, xf / xx]
    }

    /// The sums of squares and of products of displacement and force after a reversal, until the force has changed by `most`.
    fn flank(&self, turn: usize, most: f64) -> [f64; 2] {
        let Self { x, force, .. } = self;
        let rows = turn..x.len();
        let near = rows.take_while(|row| (force[*row] - force[turn]).abs() <= most);
        let near: Vec<usize> = near.collect();
        if near.len() < 3 {
            return [f64::NAN; 2];
        }
        let mean = near.iter().map(|row| x[*row]).sum::<f64>() / near.len() as f64;
        [x, force].map(|of| near.iter().map(|row| (x[*row] - mean) * of[*row]).sum())
    }
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
    let (x, force): (Vec<f64>, Vec<f64>) = rows.unzip();
    if x.len() < LEAST {
        return Err(format!("needs {LEAST} rows with both numbers, but the file has {}", x.len()));
    }
    let record = Record::of(&x, &force);
    let mut best = (0.0, Vec::new());
    for kind in [(At::Middle, 0), (At::Middle, 1), (At::Begin, 0)] {
        let found = record.cuts(kind);
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
    let scatter = [&x, &force].map(|own| noise(own));
    let mut cycles: Vec<_> = best.1.iter().map(|cycle| record.cycle(*cycle, scatter)).collect();
    let sign = cycles.iter().map(|it| it[1]).sum::<f64>().signum();
    for cycle in &mut cycles {
        cycle[1] *= sign;
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
fn tell(cycles: &[[f64; 7]], [before, after]: [usize; 2], notes: &mut Vec<String>) {
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
