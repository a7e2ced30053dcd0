//! A record of a friction loop: its reversals, and the places where it is cut into cycles.

use std::ops::Range;

use super::curve::{
    aperture, changes, drift, ends, merged, noise, period, slope, smooth, spread, turns, work,
};

/// A reversal counts if the displacement returns by this many standard deviations of its noise, but by no more than a share
/// of the spread.
pub const NOISE: f64 = 8.0;
const SHARE: f64 = 0.5;
/// Three strokes that last less than this part of a period are one.
const STROKES: f64 = 0.8;
/// Displacement and force are smoothed until their noise is this share of their range, but at most over such a part of a period.
const SMOOTH: f64 = 0.004;
const PART: f64 = 40.0;
/// The slope is that of changes of the force up to this share of its range.
const FLANK: f64 = 1.0 / 3.0;
/// A cycle whose force changes by this share of its range between its ends begins from rest.
const REST: f64 = 0.15;
/// A cycle that ends further from its begin says nothing about rest.
const OPEN: f64 = 0.01;
/// A record may begin and end this share of an amplitude away from where a cycle does, or this many steps from row to row.
const GAP: (f64, f64) = (0.12, 1.2);
/// Changes of the amplitude within a cycle count beyond this share of the range, each as this many whole cycles.
const CHANGE: (f64, f64) = (0.05, 6.0);
/// A cut away from the middle must give this many more cycles than one in the middle, because amplitudes change its place.
const ASIDE: f64 = 0.5;

/// The displacement jumps between two rows if it changes by more than this many times the usual largest change: all but this share
/// of the rows change by less. Spikes of up to six rows may be missing.
const JUMP: (f64, f64) = (8.0, 0.02);
/// A held force keeps its value over this many rows and then jumps by such a share of its range, in more than the last share of its
/// changes. A full jump is friction without elasticity.
const HELD: (usize, Range<f64>, f64) = (3, 0.05..0.95, 0.5);
/// A displacement that keeps its value over this share of its rows has the steps of its sensor. The energy is uncertain by that of
/// such a part of a step at the range of the force: the largest error of 1 500 stick-slip loops.
const STEPS: (f64, f64) = (0.3, 0.3);
/// The displacement moves if it changes by this share of its range and more than its noise.
const MOVES: f64 = 0.005;

/// Where a cycle begins or ends: its row, the displacement and the force there, and the energy until there.
#[derive(Clone, Copy)]
pub struct Cut {
    pub row: f64,
    x: f64,
    force: f64,
    work: f64,
}

/// Its first stroke, begin and end. A line closes it.
pub type Cycle = (usize, Cut, Cut);

/// A record without drift, and its reversals with both ends.
pub struct Record {
    x: Vec<f64>,
    force: Vec<f64>,
    /// Whether the force was read more slowly than the displacement.
    pub is_held: bool,
    /// The steps of the sensor of the displacement, if they are coarse.
    step: f64,
    /// The noise of both.
    scatter: [f64; 2],
    /// The ranges of both.
    ranges: [f64; 2],
    /// Both, smoothed.
    smooth: [Vec<f64>; 2],
    /// The energy until each row.
    work: Vec<f64>,
    turns: Vec<usize>,
}

/// Whether the force was read more slowly than the displacement: then it jumps between values that it keeps while the
/// displacement moves. A rounded force changes by single levels.
fn is_held(x: &[f64], force: &[f64], ranges: [f64; 2], scatter: f64) -> bool {
    let (rows, jump, most) = HELD;
    let moves = MOVES * ranges[0] + NOISE * scatter;
    let mut at = 0;
    let runs = force.chunk_by(|one, next| one.total_cmp(next).is_eq()).map(|run| {
        let last = at + run.len() - 1;
        let is_long = run.len() >= rows && (x[last] - x[at]).abs() > moves;
        at = last + 1;
        (run[0], is_long)
    });
    let runs: Vec<_> = runs.collect();
    let changes = runs.windows(2).map(|pair| {
        let change = (pair[1].0 - pair[0].0).abs();
        (change, pair[0].1 && pair[1].1 && jump.contains(&(change / ranges[1])))
    });
    let level = changes.clone().map(|it| it.0).fold(f64::INFINITY, f64::min);
    let held = changes.clone().filter(|it| it.1 && it.0 > 1.5 * level).map(|it| it.0);
    held.sum::<f64>() > most * changes.map(|it| it.0).sum::<f64>()
}

/// The steps of a displacement that keeps its value over many rows, or 0.
fn sensor_step(x: &[f64]) -> f64 {
    let steps = || x.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let moves = steps().filter(|step| *step > 0.0);
    let still = x.len() - moves.clone().count();
    if still as f64 > STEPS.0 * x.len() as f64 { moves.fold(f64::INFINITY, f64::min) } else { 0.0 }
}

impl Record {
    pub fn of(mut x: Vec<f64>, mut force: Vec<f64>) -> Self {
        let most = period(&x) / PART;
        let (scatter, ranges) = ([noise(&x), noise(&force)], [&x, &force].map(|own| spread(own)));
        // The mean of this many rows has little noise.
        let mean = |own: &[f64], at: usize| {
            let needed = scatter[at] / (SMOOTH * ranges[at]);
            smooth(own, (needed * needed).min(most) as usize | 1)
        };
        let mut smooth = [mean(&x, 0), mean(&force, 1)];
        let turns = turns(&smooth[0], (NOISE * noise(&smooth[0])).min(SHARE * ranges[0]));
        let turns = merged(&smooth[0], &turns, STROKES * most * PART);
        let is_held = is_held(&x, &force, ranges, scatter[0]);
        let step = sensor_step(&x);
        for (at, own) in [&mut x, &mut force].into_iter().enumerate() {
            for (row, drift) in drift(&smooth[at], &turns).into_iter().enumerate() {
                own[row] -= drift;
                smooth[at][row] -= drift;
            }
        }
        let work = work(&x, &force);
        Self { x, force, is_held, step, scatter, ranges, smooth, work, turns }
    }

    /// Both ends of a stroke. The first and the last one begin or end with the record, so the next to them stands for them.
    fn stroke(&self, stroke: usize) -> [f64; 2] {
        let last = self.turns.len() - 1;
        let whole = stroke.min(last.saturating_sub(2)).max(1).min(last - 1);
        [whole, whole + 1].map(|turn| self.smooth[0][self.turns[turn]])
    }

    fn amplitude(&self, stroke: usize) -> f64 {
        let [one, other] = self.stroke(stroke);
        0.5 * (one - other).abs()
    }

    /// Where a stroke passes the place of a cut. `None` if it does not.
    fn cut(&self, stroke: usize, share: f64) -> Option<Cut> {
        let Self { x: raw, force, smooth: [x, mean], work, turns, .. } = self;
        let (from, last) = (*turns.get(stroke)?, turns.len() - 1);
        let to = turns.get(stroke + 1).copied().unwrap_or(from);
        let first = (x[turns[1]] - x[turns[0]]).signum();
        let towards = if stroke.is_multiple_of(2) { first } else { -first };
        // A stroke after the end of the record begins at a reversal, or the record does not end with the cycle.
        if stroke == last && share * towards > GAP.0 - 1.0 {
            return None;
        }
        let amplitude = self.amplitude(stroke);
        let ahead = |row: usize| towards * (share * amplitude - x[row]);
        let row = (from..=to).find(|row| ahead(*row) <= 0.0).unwrap_or(to);
        if row > from && ahead(row) <= 0.0 {
            let part = ahead(row - 1) / (ahead(row - 1) - ahead(row));
            let own = mean[row - 1] + part * (mean[row] - mean[row - 1]);
            let x = share * amplitude;
            let work = work[row - 1] + 0.5 * (force[row - 1] + own) * (x - raw[row - 1]);
            return Some(Cut { row: (row - 1) as f64 + part, x, force: own, work });
        }
        let step = x[row] - x[if row == to { row - 1 } else { row + 1 }];
        let is_near = ahead(row).abs() <= (GAP.0 * amplitude).max(GAP.1 * step.abs());
        let after = if ahead(row) > 0.0 { 1.0 } else { 0.0 };
        let own = Cut { row: row as f64 + after, x: raw[row], force: mean[row], work: work[row] };
        is_near.then_some(own)
    }

    /// Whether the force ends where it begins, if the cycle does.
    pub fn closes(&self, begin: &Cut, end: &Cut) -> bool {
        let most = REST * self.ranges[1] + NOISE * self.scatter[1];
        let is_open = (end.x - begin.x).abs() > OPEN * self.ranges[0];
        is_open || (end.force - begin.force).abs() <= most
    }

    /// The whole cycles, cut in the middle of the strokes, or where the record begins or ends: where they are best.
    pub fn cycles(&self) -> Vec<Cycle> {
        let Self { smooth: [x, _], turns, .. } = self;
        let [first, .., last] = turns[..] else { return Vec::new() };
        let at = |row: usize, stroke: usize| (x[row] / self.amplitude(stroke), stroke % 2);
        let places = [(0.0, 0), (0.0, 1), at(first, 0), at(last, turns.len() - 2)];
        let tried = places.map(|at| self.cuts(at)).into_iter().rev();
        let tried = tried.filter(|(score, cycles)| score.is_finite() && !cycles.is_empty());
        tried.max_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or_default().1
    }

    /// The cuts of the cycles that begin in every other stroke from the first one or the next one, at a share of the
    /// amplitude, and how many are good.
    fn cuts(&self, (share, first): (f64, usize)) -> (f64, Vec<Cycle>) {
        let starts = (first..self.turns.len()).step_by(2);
        let cycles = starts.filter_map(|stroke| {
            let (begin, end) = (self.cut(stroke, share)?, self.cut(stroke + 2, share)?);
            Some((stroke, begin, end))
        });
        let cycles: Vec<_> = cycles.collect();
        let whole = cycles.iter().filter(|it| self.closes(&it.1, &it.2));
        // The middle of a stroke is 0, unless the amplitude changes there.
        let change = |it: &Cycle| self.stroke(it.0 + 1).iter().sum::<f64>().abs() / self.ranges[0];
        let open = |it: &Cycle| (it.2.x - it.1.x).abs() / self.ranges[0];
        let score = whole.map(|it| 1.0 - open(it) - CHANGE.1 * (change(it) - CHANGE.0).max(0.0));
        (score.sum::<f64>() - if share == 0.0 { 0.0 } else { ASIDE }, cycles)
    }

    /// The rows after which the displacement jumps, as where one recording ends and another begins.
    pub fn jumps(&self) -> Vec<usize> {
        let steps: Vec<f64> = self.x.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let mut sorted = steps.clone();
        let usual = ((1.0 - JUMP.1) * steps.len() as f64) as usize;
        let most = JUMP.0 * *sorted.select_nth_unstable_by(usual, f64::total_cmp).1;
        (0..steps.len()).filter(|row| steps[*row] > most).collect()
    }

    /// The numbers of a cycle: those of a table of loops.
    pub fn cycle(&self, (stroke, begin, end): Cycle) -> [f64; 8] {
        let Self { scatter, smooth, .. } = self;
        let rows = begin.row.ceil() as usize..(end.row.ceil() as usize).min(self.x.len());
        let (x, force) = (&self.x[rows.clone()], &self.force[rows.clone()]);
        let line = 0.5 * (begin.force + end.force) * (begin.x - end.x);
        let energy = end.work - begin.work + line;
        let [of_x, of_force] = scatter.map(|scatter| scatter * scatter);
        let noise = (of_x * changes(force) + of_force * changes(x)).sqrt();
        let [[left, right], [low, high]] =
            [0, 1].map(|at| ends(smooth[at][rows.clone()].iter().copied()));
        let error = 0.5 * self.coarseness(begin.row as usize, end.row as usize)
            + 2.5 * noise
            + STEPS.1 * self.step * (high - low);
        let flanks = [1, 2].map(|next| self.flank(stroke + next, high - low));
        let [slope, slope_error] =
            slope(std::array::from_fn(|at| flanks[0][at] + flanks[1][at]), *scatter);
        let aperture = aperture(x, force, 0.5 * (low + high));
        let [of_x, of_force] = [0.5 * (right - left), 0.5 * (high - low)];
        [x.len() as f64, energy, error, of_x, of_force, aperture, slope, slope_error]
    }

    /// How far the work between two rows is from that along straight lines, in each step.
    fn coarseness(&self, from: usize, to: usize) -> f64 {
        let Self { x, force, work, .. } = self;
        let rows = from.saturating_sub(1)..(to + 2).min(x.len() - 1);
        let straight = |row: usize| 0.5 * (x[row + 1] - x[row]) * (force[row] + force[row + 1]);
        rows.map(|row| (work[row + 1] - work[row] - straight(row)).abs()).sum()
    }

    /// The number, squares and products of displacement and force after a reversal, until the force has changed by a third of
    /// its range.
    fn flank(&self, turn: usize, range: f64) -> [f64; 4] {
        let Self { x, force, smooth: [_, mean], turns, .. } = self;
        let change = |row: &usize| (mean[*row] - mean[turns[turn]]).abs() / range;
        // A record that ends at a reversal has no flank after it.
        let Some(next) = turns.get(turn + 1) else { return [0.0; 4] };
        let near: Vec<usize> =
            (turns[turn]..*next).take_while(|row| change(row) <= FLANK).collect();
        if near.len() < 3 {
            return [f64::NAN; 4];
        }
        let count = near.len() as f64;
        let from = |of: &[f64]| near.iter().map(|row| of[*row]).sum::<f64>() / count;
        let (x0, force0) = (from(x), from(force));
        near.iter().fold([count, 0.0, 0.0, 0.0], |[count, xx, xf, ff], row| {
            let (x, force) = (x[*row] - x0, force[*row] - force0);
            [count, xx + x * x, xf + x * force, ff + force * force]
        })
    }
}
