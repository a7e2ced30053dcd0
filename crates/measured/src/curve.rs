//! Curves of force over displacement: their noise, their reversals and the work along them.

/// The level at a reversal is the median of the middles of this many strokes on each side.
const REACH: usize = 12;
/// The slope of the drift is the median of the slopes between any two of at most this many strokes.
const PAIRS: usize = 100;
/// In few strokes, a drift by a smaller share of the range is not known.
const SMALL: f64 = 0.05;

/// The rows, if they are enough.
pub fn enough<T>(rows: Vec<T>, least: usize, what: &str) -> Result<Vec<T>, String> {
    match rows.len() {
        count if count < least => Err(format!("needs {least} {what}, but the file has {count}")),
        _ => Ok(rows),
    }
}

/// The smallest and the largest number.
pub fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let first = [f64::INFINITY, f64::NEG_INFINITY];
    values.fold(first, |[low, high], value| [low.min(value), high.max(value)])
}

/// The range of all but a few of the numbers, which are spikes or a part with other amplitudes.
pub fn spread(values: &[f64]) -> f64 {
    let (mut all, few) = (values.to_vec(), values.len() / 50);
    let high = *all.select_nth_unstable_by(values.len() - 1 - few, f64::total_cmp).1;
    high - *all.select_nth_unstable_by(few, f64::total_cmp).1
}

/// The middle number, the smaller one of two, or 0 without numbers.
pub fn median(all: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = all.collect();
    let middle = all.len().saturating_sub(1) / 2;
    if all.is_empty() { 0.0 } else { *all.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Whether a row is far off its neighbours, more than a limit and than the steps near it.
pub fn is_spike(v: &[f64], row: usize, reach: usize, least: f64) -> bool {
    let near = |reach: usize| &v[row.saturating_sub(reach)..(row + reach + 1).min(v.len())];
    let off = (v[row] - median(near(reach).iter().copied())).abs();
    let steps = || near(2 * reach).windows(2).map(|pair| (pair[1] - pair[0]).abs());
    off > least && off > 5.0 * median(steps())
}

/// Means over an odd number of rows, over fewer rows at both ends.
pub fn smooth(values: &[f64], width: usize) -> Vec<f64> {
    if width < 2 {
        return values.to_vec();
    }
    let mut sums = vec![0.0];
    for value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    let mean = |row: usize| {
        let (from, to) = (row.saturating_sub(width / 2), (row + width / 2 + 1).min(values.len()));
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..values.len()).map(mean).collect()
}

/// The period in rows, from the strokes that are longer than half of the spread, without a steady drift.
pub fn period(x: &[f64]) -> f64 {
    let (first, last) = x.split_at(x.len() / 2);
    let [first, last] = [first, last].map(|half| median(half.iter().copied()));
    let drift = (last - first) / (x.len() / 2) as f64;
    let level: Vec<f64> = x.iter().zip(0..).map(|(x, row)| x - drift * f64::from(row)).collect();
    let turns = turns(&level, 0.5 * spread(&level));
    let inner = turns.get(1..turns.len().saturating_sub(1)).unwrap_or(&[]);
    let length = |strokes: usize| {
        median(inner.windows(strokes + 1).map(|near| (near[strokes] - near[0]) as f64))
    };
    let lengths = [length(2), 2.0 * length(1)];
    lengths.into_iter().find(|length| *length > 0.0).unwrap_or(x.len() as f64)
}

/// How far the displacement has drifted in each row: along a line, and with the medians of a few
/// strokes about it.
pub fn drift(x: &[f64], turns: &[usize]) -> Vec<f64> {
    let inner = turns.get(1..turns.len().saturating_sub(1)).unwrap_or(&[]);
    let middle = |ends: &[usize]| (ends[0] as f64, 0.5 * (x[ends[0]] + x[ends[1]]));
    let middles: Vec<_> = inner.windows(2).map(middle).collect();
    let [low, high] = ends(x.iter().copied());
    if middles.is_empty() {
        return vec![0.5 * (low + high); x.len()];
    }
    let few: Vec<_> = middles.iter().step_by(1 + middles.len() / PAIRS * 2).collect();
    let slopes = (1..few.len()).flat_map(|step| {
        few.windows(step + 1).map(move |it| (it[step].1 - it[0].1) / (it[step].0 - it[0].0))
    });
    let slope = median(slopes);
    let is_small = (slope * x.len() as f64).abs() < SMALL * (high - low);
    let slope = if few.len() < 3 || few.len() < 8 && is_small { 0.0 } else { slope };
    let levels = (0..turns.len()).map(|turn| {
        let from = turn.saturating_sub(1 + REACH).min(middles.len().saturating_sub(2 * REACH));
        median(middles[from..].iter().take(2 * REACH).map(|it| it.1 - slope * it.0))
    });
    let levels: Vec<f64> = levels.collect();
    let of = |row: usize| {
        let after = turns.partition_point(|turn| *turn <= row).clamp(1, turns.len() - 1);
        let [from, to] = [turns[after - 1], turns[after]].map(|row| row as f64);
        let share = ((row as f64 - from) / (to - from)).clamp(0.0, 1.0);
        slope * row as f64 + levels[after - 1] + share * (levels[after] - levels[after - 1])
    };
    (0..x.len()).map(of).collect()
}

/// Reversals without those inside a stroke: strokes that are shorter than both neighbours become one with them, if all three
/// last less than `longest`.
pub fn merged(x: &[f64], turns: &[usize], longest: f64) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    for turn in turns {
        kept.push(*turn);
        while let [.., a, b, c, d] = kept[..] {
            let [before, own, after] =
                [(a, b), (b, c), (c, d)].map(|(from, to)| (x[from] - x[to]).abs());
            if own > before.min(after) || (d - a) as f64 >= longest {
                break;
            }
            kept.truncate(kept.len() - 3);
            kept.push(d);
        }
    }
    kept
}

/// A slope with a larger relative error is not known.
const MOST: f64 = 0.5;

/// The slope of y over x where both have noise, and its standard error, from sums of squares and products. Neither noise
/// changes it in the mean (Deming regression).
pub fn slope([count, xx, xy, yy]: [f64; 4], [of_x, of_y]: [f64; 2]) -> [f64; 2] {
    let (b, a) = (of_x * of_x, (of_y * of_y).max(1e-12 * yy / count));
    let q = a * xx - b * yy;
    let root = (q * q + 4.0 * a * b * xy * xy).sqrt();
    let slope = if q < 0.0 { (root - q) / (2.0 * b * xy) } else { 2.0 * a * xy / (q + root) };
    let rest = (yy - 2.0 * slope * xy + slope * slope * xx).max(0.0);
    let error = (rest / (count - 2.0) * (slope / xy).abs()).sqrt();
    if error < MOST * slope.abs() { [slope, error] } else { [f64::NAN; 2] }
}

/// The standard deviation of the noise, from fourth differences, and at least that of rounding to the smallest step.
pub fn noise(values: &[f64]) -> f64 {
    let fourth = |v: &[f64]| (v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).abs();
    let scatter = median(values.windows(5).map(fourth)) / (0.6745 * 70f64.sqrt());
    let least = 1e-9 * ends(values.iter().map(|it| it.abs()))[1];
    let steps = || values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = ends(steps().filter(|step| *step > least))[0];
    let is_whole = |change: f64| (change / step - (change / step).round()).abs() < 0.01;
    if step.is_finite() && steps().all(is_whole) {
        scatter.max(step / 12f64.sqrt())
    } else {
        scatter
    }
}

/// The rows where the displacement turns back by more than `least`, and both ends.
pub fn turns(x: &[f64], least: f64) -> Vec<usize> {
    let (mut turns, mut low, mut high, mut rises) = (Vec::new(), 0, 0, None);
    for (row, now) in x.iter().enumerate() {
        low = if *now < x[low] { row } else { low };
        high = if *now > x[high] { row } else { high };
        if rises != Some(true) && now - x[low] > least {
            turns.push(low);
            (rises, high) = (Some(true), row);
        } else if rises != Some(false) && x[high] - now > least {
            turns.push(high);
            (rises, low) = (Some(false), row);
        }
    }
    turns.extend(rises.map(|rises| if rises { high } else { low }));
    turns
}

/// The energy until each row, along cubic curves whose tangents are parallel to the chords between the neighbours.
pub fn work(x: &[f64], force: &[f64]) -> Vec<f64> {
    let last = x.len() - 1;
    let tangent = |v: &[f64], row: usize| {
        let (from, to) = (row.saturating_sub(1), (row + 1).min(last));
        (v[to] - v[from]) / (to - from) as f64
    };
    let mut sum = 0.0;
    let after = (0..last).map(|row| {
        let [(dx, u, u1), (df, f, f1)] =
            [x, force].map(|v| (v[row + 1] - v[row], tangent(v, row), tangent(v, row + 1)));
        sum += 0.5 * dx * (force[row] + force[row + 1]) + (dx * (f - f1) - df * (u - u1)) / 12.0
            - ((f - df) * (u1 - dx) - (f1 - df) * (u - dx)) / 60.0;
        sum
    });
    std::iter::once(0.0).chain(after).collect()
}

/// The sum of the squares of half of the differences between both neighbours.
pub fn changes(values: &[f64]) -> f64 {
    let changes = values.windows(3).map(|near| 0.5 * (near[2] - near[0]));
    changes.map(|change| change * change).sum()
}

/// Half of the distance between the displacements at which the force falls through its middle and rises. Where noise lets it
/// pass several times, all but one of these cancel.
pub fn aperture(x: &[f64], force: &[f64], middle: f64) -> f64 {
    let passes = (0..x.len()).map(|row| {
        let next = (row + 1) % x.len();
        let (f, f1) = (force[row] - middle, force[next] - middle);
        let place = x[row] + (x[next] - x[row]) * f / (f - f1);
        if (f < 0.0) == (f1 < 0.0) {
            0.0
        } else if f < 0.0 {
            -place
        } else {
            place
        }
    });
    0.5 * passes.sum::<f64>().abs()
}
