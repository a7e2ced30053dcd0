//! A record of a friction loop: its reversals, and the places where it is cut into cycles.

use super::curve::{
    aperture, changes, coarseness, ends, merged, noise, period, slope, smooth, spread, turns, work,
};

/// A reversal counts if the displacement returns by this many standard deviations of its noise, but by no more than a share
/// of the spread.
pub const NOISE: f64 = 8.0;
const SHARE: f64 = 0.5;
/// Three strokes that last less than this part of a period are one.
const STROKES: f64 = 0.8;
/// Displacement and force are smoothed until their noise is this share of their range, but at most over such a part of a period
/// for cuts, and for amplitudes.
const SMOOTH: f64 = 0.004;
const PARTS: (f64, f64) = (40.0, 30.0);
/// The slope is that of changes of the force between these shares of its range.
const FLANK: (f64, f64) = (0.05, 1.0 / 3.0);
/// A cycle whose force changes by this share of its range between its ends begins from rest.
const REST: f64 = 0.15;
/// A cycle that ends further from its begin says nothing about rest.
const OPEN: f64 = 0.01;
/// A record may begin and end this share of a stroke away from where a cycle does. A line then closes the cycle.
/// Otherwise at most this many steps from row to row.
const GAP: f64 = 0.06;
const STEPS: f64 = 1.7;
/// Rows are near a reversal within this share of a stroke.
const NEAR: f64 = 0.1;
/// The middle of a stroke is the mean of up to this many on each side.
const MIDDLES: usize = 5;
/// Changes of the amplitude within a cycle count beyond this share, each as this many whole cycles.
const CHANGE: (f64, f64) = (0.05, 4.0);

/// Over how many rows a mean has little noise: an odd number, at most about `most`.
fn width(noise: f64, range: f64, most: f64) -> usize {
    let needed = noise / (SMOOTH * range);
    (needed * needed).min(most) as usize | 1
}

/// Where a cycle begins or ends: its first row, the displacement and the force there, and the energy until there. A line of the
/// length `open` along the displacement closes the cycle.
#[derive(Clone, Copy)]
pub struct Cut {
    pub row: f64,
    pub x: f64,
    pub force: f64,
    pub work: f64,
    pub open: f64,
}

/// Its first stroke, begin and end.
pub type Cycle = (usize, Cut, Cut);

/// What is cut at: the displacement from the middle, in parts of the amplitude, in every other stroke from the first or second.
type At = (f64, usize);

/// A record, and its reversals with both ends.
pub struct Record<'a> {
    x: &'a [f64],
    force: &'a [f64],
    /// The noise of both.
    scatter: [f64; 2],
    /// The largest changes of both between the ends of a cycle that does not begin from rest.
    rest: [f64; 2],
    /// Both, smoothed.
    smooth: [Vec<f64>; 2],
    /// The energy until each row.
    work: Vec<f64>,
    turns: Vec<usize>,
    /// The middle of the displacement in each stroke, from reversal to reversal, and the amplitude above it in parts of that
    /// below.
    middles: Vec<f64>,
    asymmetry: f64,
}

impl<'a> Record<'a> {
    pub fn of(x: &'a [f64], force: &'a [f64]) -> Self {
        let (period, scatter) = (period(x), [x, force].map(noise));
        let smooth = [(x, scatter[0]), (force, scatter[1])]
            .map(|(all, noise)| smooth(all, width(noise, spread(all), period / PARTS.0)));
        let least = NOISE * noise(&smooth[0]);
        let turns = turns(&smooth[0], least.min(SHARE * spread(x)));
        let turns = merged(&smooth[0], &turns, STROKES * period);
        let work = work(x, force);
        let rest = [OPEN * spread(x), REST * spread(force) + NOISE * scatter[1]];
        let mut own = Self {
            x,
            force,
            scatter,
            rest,
            smooth,
            work,
            turns,
            middles: Vec::new(),
            asymmetry: 1.0,
        };
        own.middles = own.middles();
        own.asymmetry = own.asymmetry();
        own
    }

    /// The middle of the time near a reversal, in rows.
    fn time(&self, turn: usize) -> f64 {
        let Self { smooth: [x, _], turns, .. } = self;
        let (at, before, after) = (turns[turn], turns[turn - 1], turns[turn + 1]);
        let reach = NEAR * (x[at] - x[before]).abs().min((x[at] - x[after]).abs());
        let far = |row: usize| (x[row] - x[at]).abs() - reach;
        // How far after a row, towards another one, the reach ends.
        let share = |row: usize, other: usize| far(other) / (far(other) - far(row));
        // A stroke can have several reversals of almost the same height.
        let first = (before + 1..=at).find(|row| far(*row) <= 0.0).unwrap_or(at) - 1;
        let last = (at..after).rfind(|row| far(*row) <= 0.0).unwrap_or(at) + 1;
        0.5 * (first as f64 + 1.0 - share(first, first + 1) + last as f64 - 1.0
            + share(last, last - 1))
    }

    /// The displacement in the middle of the time between reversals, smoothed over the strokes.
    fn middles(&self) -> Vec<f64> {
        let Self { smooth: [x, _], turns, .. } = self;
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
        let own: Vec<f64> = (1..strokes - 1).map(middle).collect();
        let last = own.len() - 1;
        // Ways up and down can have other middles.
        let both = |at: usize| {
            let [before, after] =
                if at == 0 { [1, 1] } else { [at - 1, if at == last { at - 1 } else { at + 1 }] };
            if last > 1 { 0.5 * own[at] + 0.25 * (own[before] + own[after]) } else { own[at] }
        };
        let all: Vec<f64> = (0..=last).map(both).collect();
        let far = MIDDLES.min(last);
        // How far the middle drifts in a stroke near both ends.
        let drifts =
            [all[far] - all[0], all[last] - all[last - far]].map(|it| it / far.max(1) as f64);
        let mean = |at: usize| {
            let reach = at.min(last - at).min(MIDDLES);
            all[at - reach..=at + reach].iter().sum::<f64>() / (2 * reach + 1) as f64
        };
        let inner = (0..=last).map(mean);
        let ends = [all[0] - drifts[0], all[last] + drifts[1]];
        std::iter::once(ends[0]).chain(inner).chain([ends[1]]).collect()
    }

    /// Where the stroke after a reversal passes the place of a cut. `None` if it does not.
    fn cut(&self, stroke: usize, share: f64) -> Option<Cut> {
        let Self { x: raw, force, smooth: [x, mean], work, turns, middles, .. } = self;
        let (from, last) = (*turns.get(stroke)?, turns.len() - 1);
        let middle = middles[stroke.min(last - 1)];
        // The end of the record can be where the next stroke begins.
        let to = turns.get(stroke + 1).copied().unwrap_or(turns[last - 1]);
        let towards = (x[to] - x[from]).signum();
        // Neither end of the record is a reversal.
        let next = if stroke + 1 >= last { turns[stroke.max(1) - 1] } else { to };
        let before = if stroke == 0 { *turns.get(2)? } else { from };
        let like = if share * towards > 0.0 { next } else { before };
        let level = middle + share * (x[like] - middle).abs();
        let ahead = |row: usize| towards * (level - x[row]);
        let near = |row: usize, next: usize, after: f64| {
            let stroke = 2.0 * (x[to] - middle).abs().max((x[from] - middle).abs());
            let is_near = ahead(row).abs() <= (GAP * stroke).max(STEPS * (x[row] - x[next]).abs());
            let open = level - raw[row];
            is_near.then(|| Cut {
                row: row as f64 + after,
                x: level,
                force: mean[row],
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
        let part = (level - x[before]) / (x[after] - x[before]);
        let own = mean[before] + part * (mean[after] - mean[before]);
        let work = work[before] + 0.5 * (force[before] + own) * (level - raw[before]);
        Some(Cut { row: before as f64 + part, x: level, force: own, work, open: 0.0 })
    }

    /// Where cycles can be cut.
    pub fn places(&self) -> Vec<At> {
        let Self { smooth: [x, _], turns, middles, .. } = self;
        let mut all = vec![(0.0, 0), (0.0, 1)];
        if let ([first, next, other, ..], [.., far, near, last]) = (&turns[..], &turns[..]) {
            let share = |end: usize, near: usize, far: usize, middle: f64| {
                let like = if (x[end] - middle) * (x[near] - x[end]) > 0.0 { near } else { far };
                (x[end] - middle) / (x[like] - middle).abs()
            };
            let stroke = middles.len() - 1;
            all.push((share(*first, *next, *other, middles[0]), 0));
            all.push((share(*last, *near, *far, middles[stroke]), stroke % 2));
        }
        all
    }

    /// Whether the force ends where it begins, if the cycle does.
    pub fn closes(&self, begin: &Cut, end: &Cut) -> bool {
        let open = begin.open.abs().max(end.open.abs());
        open > self.rest[0] || (end.force - begin.force).abs() <= self.rest[1]
    }

    /// The amplitudes above and below the middle in a stroke.
    fn amplitudes(&self, stroke: usize) -> [f64; 2] {
        let ends = ends(self.turns[stroke..stroke + 2].iter().map(|row| self.smooth[0][*row]));
        [ends[1] - self.middles[stroke], self.middles[stroke] - ends[0]]
    }

    /// The amplitude above the middle in parts of that below, unless it changes as amplitudes do.
    fn asymmetry(&self) -> f64 {
        let inner = 1..self.middles.len().saturating_sub(1);
        let ratios = inner.map(|stroke| self.amplitudes(stroke)).map(|[up, down]| up / down);
        let mut ratios: Vec<f64> = ratios.collect();
        ratios.sort_by(f64::total_cmp);
        let (few, last) = (ratios.len() / 4, ratios.len().saturating_sub(1));
        if ratios.is_empty() { 1.0 } else { 1f64.clamp(ratios[few], ratios[last - few]) }
    }

    /// How much the amplitude changes in a stroke, in parts of the larger one.
    fn change(&self, stroke: usize) -> f64 {
        let [up, down] = self.amplitudes(stroke);
        (up - down * self.asymmetry).abs() / up.max(down * self.asymmetry)
    }

    /// The cuts of the whole cycles that begin in every other stroke from the first one or the next one, and how good they are.
    pub fn cuts(&self, (share, first): At) -> (f64, Vec<Cycle>) {
        let starts = (first..self.turns.len()).step_by(2);
        let cycles = starts.filter_map(|stroke| {
            let (begin, end) = (self.cut(stroke, share)?, self.cut(stroke + 2, share)?);
            Some((stroke, begin, end))
        });
        let cycles: Vec<_> = cycles.collect();
        let whole = cycles.iter().filter(|it| self.closes(&it.1, &it.2));
        let score = whole.map(|it| 1.0 - CHANGE.1 * (self.change(it.0 + 1) - CHANGE.0).max(0.0));
        (score.sum(), cycles)
    }

    /// The numbers of a cycle: those of a table of loops.
    pub fn cycle(&self, (stroke, begin, end): Cycle) -> [f64; 8] {
        let scatter = self.scatter;
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
        let error = 0.6 * coarseness(&x, force)
            + 2.5 * noise
            + self.corner(stroke, &begin)
            + self.corner(stroke + 2, &end);
        let [[left, right], [low, high]] =
            [(&x[..], scatter[0]), (force, scatter[1])].map(|(all, noise)| {
                let [low, high] = ends(all.iter().copied());
                let width = width(noise, high - low, count as f64 / PARTS.1);
                ends(all.windows(width).map(|near| near.iter().sum::<f64>() / width as f64))
            });
        let flanks = [1, 2].map(|next| self.flank(stroke + next, high - low));
        let [slope, slope_error] =
            slope(std::array::from_fn(|at| flanks[0][at] + flanks[1][at]), scatter);
        let aperture = aperture(&x, force, 0.5 * (low + high));
        [
            count as f64,
            energy,
            error,
            0.5 * (right - left),
            0.5 * (high - low),
            aperture,
            slope,
            slope_error,
        ]
    }

    /// How far the curve of the work near a cut is from straight lines: there the amplitude can change.
    fn corner(&self, stroke: usize, cut: &Cut) -> f64 {
        let Self { x, force, work, .. } = self;
        let row = cut.row as usize;
        let rows = row.saturating_sub(1)..(row + 2).min(x.len() - 1);
        let straight = |row: usize| 0.5 * (x[row + 1] - x[row]) * (force[row] + force[row + 1]);
        let off = rows.map(|row| (work[row + 1] - work[row] - straight(row)).abs()).sum::<f64>();
        if stroke < self.middles.len() { self.change(stroke).min(1.0) * off } else { 0.0 }
    }

    /// The number, squares and products of displacement and force after a reversal, until the force has changed by a third of
    /// its range.
    fn flank(&self, turn: usize, range: f64) -> [f64; 4] {
        let Self { x, force, smooth: [_, mean], turns, .. } = self;
        let change = |row: &usize| (mean[*row] - mean[turns[turn]]).abs() / range;
        // A record that ends at a reversal has no flank after it.
        let Some(next) = turns.get(turn + 1) else { return [0.0; 4] };
        let rows: Vec<usize> =
            (turns[turn]..*next).take_while(|row| change(row) <= FLANK.1).collect();
        // The reversal is uncertain if there is noise.
        let first = rows.iter().position(|row| change(row) >= FLANK.0).unwrap_or(0);
        let near = &rows[if rows.len() - first < 3 { 0 } else { first }..];
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
