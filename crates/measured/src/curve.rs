//! Curves of force over displacement: their noise, their reversals and the work along them.

/// The smallest and the largest number.
pub fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let first = [f64::INFINITY, f64::NEG_INFINITY];
    values.fold(first, |[low, high], value| [low.min(value), high.max(value)])
}

/// The standard deviation of the noise, from fourth differences.
pub fn noise(values: &[f64]) -> f64 {
    let fourth = |v: &[f64]| (v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).abs();
    let mut differences: Vec<f64> = values.windows(5).map(fourth).collect();
    let middle = differences.len() / 2;
    *differences.select_nth_unstable_by(middle, f64::total_cmp).1 / (0.6745 * 70f64.sqrt())
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
    let mut sum = 0.0;
    let after = (0..last).map(|row| {
        let ends = |v: &[f64]| {
            let middle = |at: usize| 0.5 * (v[at + 1] - v[at - 1]);
            let tangent = |at: usize| match at {
                0 => 2.0 * (v[1] - v[0]) - middle(1),
                _ if at == last => 2.0 * (v[last] - v[last - 1]) - middle(last - 1),
                _ => middle(at),
            };
            (v[row + 1] - v[row], tangent(row), tangent(row + 1))
        };
        let ((dx, u, u1), (df, f, f1)) = (ends(x), ends(force));
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

/// How much the area inside the points changes if every second point is left out.
pub fn coarseness(x: &[f64], force: &[f64]) -> f64 {
    let area = |first: usize, step: usize| {
        let around = |all: &[f64]| -> Vec<f64> {
            let own: Vec<f64> = all.iter().skip(first).step_by(step).copied().collect();
            own.iter().cycle().take(own.len() + 3).copied().collect()
        };
        let work = work(&around(x), &around(force));
        work[work.len() - 2] - work[1]
    };
    let all = area(0, 1);
    (area(0, 2) - all).abs().max((area(1, 2) - all).abs())
}

/// Half of the distance between the displacements at which the force falls through its middle and rises. Where noise lets it
/// pass several times, all but one of these cancel.
pub fn aperture(x: &[f64], force: &[f64], middle: f64) -> f64 {
    let passes = (0..x.len()).map(|row| {
        let next = (row + 1) % x.len();
        let (f, f1) = (force[row] - middle, force[next] - middle);
        let place = x[row] + (x[next] - x[row]) * f / (f - f1);
        if (f < 0.0) == (f1 < 0.0) { 0.0 } else { place * f1.signum() }
    });
    0.5 * passes.sum::<f64>().abs()
}
