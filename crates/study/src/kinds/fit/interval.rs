//! The ends of the intervals of a fit, from the profiles of the sum of squares.

use super::model::Parameter;
use super::search::{Fit, FitRow, Known, Task};

/// The accepted error of the last value in a profile.
const SAME_RISE: f64 = 0.02;
/// The end of an interval is known if a visited value is within this share of it.
const NEAR_RISE: f64 = 0.1;
/// A parameter that has moved by this share of the distance to its bound is at the bound.
const AT_END: f64 = 0.999_999;

/// One side of the interval of a parameter.
pub struct Side<'a> {
    fit: &'a Fit,
    known: &'a Known,
    place: usize,
    is_high: bool,
    rise: f64,
    /// The row from which the search for the end goes on: that of the best parameters, until their own end is found. Then the
    /// farthest start beyond it that describes the data about as well.
    pub base: &'a FitRow,
    /// Whether this is a start at another minimum.
    pub is_other: bool,
    /// The visited values in the profile beyond it: the distance in coordinates, and the square root of the rise of S.
    visited: Vec<(f64, f64)>,
}

impl Fit {
    /// One side of the interval of a parameter.
    pub fn side<'a>(&'a self, known: &'a Known, place: usize, is_high: bool) -> Side<'a> {
        let (fit, best, rise) = (self, &known.rows[known.minimum], self.rise(known));
        let (is_other, visited) = (false, Vec::new());
        let mut side = Side { fit, known, place, is_high, rise, base: best, is_other, visited };
        side.visited = side.beyond(best);
        let (starts, start) = (&known.rows[..known.minimum], &known.rows[known.start]);
        // With estimated noise, S of the starts has another unit.
        let unit = known.measured.freedom().map_or(1.0, |_| best.sum / start.sum);
        let near = starts.iter().filter(|row| (row.sum - start.sum) * unit < rise * rise);
        // The best parameters can be beside the start that led to them, because only they know numerical errors.
        let distance = |row: &FitRow| side.distance(best, row).min(side.distance(start, row));
        let far = near.max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(start);
        let mut own = side.visited.clone();
        own.retain(|it| it.0 < distance(far));
        if end(&own, rise).is_some_and(|end| distance(far) > (1.0 + NEAR_RISE) * end) {
            (side.base, side.is_other, side.visited) = (far, true, side.beyond(far));
        }
        side
    }
}

impl Side<'_> {
    /// The coordinate of the parameter, which grows to 1 on this side.
    fn coordinate(&self, row: &FitRow) -> f64 {
        let u = self.fit.parameters[self.place].coordinate(row.theta[self.place]);
        if self.is_high { u } else { 1.0 - u }
    }

    /// How far the parameter of a row is beyond that of another one, in coordinates.
    fn distance(&self, from: &FitRow, to: &FitRow) -> f64 {
        self.coordinate(to) - self.coordinate(from)
    }

    /// The visited values beyond a row.
    fn beyond(&self, base: &FitRow) -> Vec<(f64, f64)> {
        let own = Task::Profile { parameter: self.place, is_high: self.is_high };
        let least = self.known.rows[self.known.minimum].sum;
        let rows = self.known.rows.iter().zip(&self.fit.tasks).filter(|it| it.1.1 == own);
        // If predictions are missing there, the rise is infinite.
        let rise = |sum: f64| if sum.is_nan() { f64::INFINITY } else { (sum - least).max(0.0) };
        let visited = rows.map(|(row, _)| (self.distance(base, row), rise(row.sum).sqrt()));
        visited.filter(|(distance, _)| *distance >= 0.0).collect()
    }

    /// The end of the interval; `None` if it is not known.
    pub fn end(&self) -> Option<f64> {
        let u = self.coordinate(self.base) + end(&self.visited, self.rise)?;
        let value = self.fit.parameters[self.place].value(if self.is_high { u } else { 1.0 - u });
        (u <= 1.0).then_some(value)
    }

    /// Whether the interval reaches the bound of the parameter.
    pub fn reaches_bound(&self) -> bool {
        let last = AT_END * (1.0 - self.coordinate(self.base));
        let is_inside = |(distance, own): &(f64, f64)| *distance > last && *own < self.rise;
        last <= 0.0 || self.visited.iter().any(is_inside)
    }

    /// The next value in the profile, with a guess of the other parameters. The first one is at half of the expected end of
    /// the interval. The next ones are where a straight line lets expect the end. `None` if the data do not determine the
    /// parameter, or if the end or a bound is reached.
    pub fn next(&self) -> Option<Vec<f64>> {
        let (fit, place, rise, visited) = (self.fit, self.place, self.rise, &self.visited);
        let information = fit.information(self.known, true);
        let covariance = &information.covariance[place];
        let error = covariance[place].sqrt();
        let is_found = visited.iter().any(|(_, own)| (own / rise - 1.0).abs() < SAME_RISE);
        if is_found || information.is_open(place) || !error.is_finite() || error == 0.0 {
            return None;
        }
        let step = |it: usize| fit.parameters[it].step(self.base.theta[it]);
        let room = 1.0 - self.coordinate(self.base);
        let distance = match around(visited, rise) {
            _ if visited.is_empty() => 0.5 * rise * error * step(place),
            ((last, _), None) if last > AT_END * room => return None,
            // At another minimum, the size of the first step is a guess.
            ((last, _), None) if self.is_other => 3.0 * last,
            ((last, own), None) => last * (rise / own).clamp(1.5, 3.0),
            ((below, own), Some((above, other))) => {
                // A straight line through a strongly curved profile is slow: it stays on one side of the end.
                let stays = visited.chunk_by(|a, b| (a.1 < rise) == (b.1 < rise)).next_back();
                let is_slow = stays.is_some_and(|stays| stays.len() > 1);
                let share = match other.is_infinite() {
                    // Here predictions end, perhaps near the estimate.
                    true if below == 0.0 => 0.25,
                    _ if is_slow || other.is_infinite() => 0.5,
                    _ => (rise - own) / (other - own),
                };
                below + share.clamp(0.1, 0.9) * (above - below)
            }
        };
        let distance = if self.is_high { distance.min(room) } else { -distance.min(room) };
        let at = |(other, parameter): (usize, &Parameter)| {
            let along = covariance[other] / covariance[place];
            let moved = distance * along * step(other) / step(place);
            parameter.value(parameter.coordinate(self.base.theta[other]) + moved)
        };
        Some(fit.parameters.iter().enumerate().map(at).collect())
    }
}

/// The visited values around the end of an interval: the last one below it, or the estimate, and the first one above it.
fn around(visited: &[(f64, f64)], rise: f64) -> ((f64, f64), Option<(f64, f64)>) {
    let by_distance = |a: &&(f64, f64), b: &&(f64, f64)| a.0.total_cmp(&b.0);
    let above = visited.iter().filter(|(_, own)| *own >= rise).min_by(by_distance).copied();
    let inside = |it: &&(f64, f64)| above.is_none_or(|above| it.0 < above.0);
    let below = visited.iter().filter(inside).max_by(by_distance).copied();
    (below.unwrap_or((0.0, 0.0)), above)
}

/// The distance at which S has risen by the square of `rise`. `None` if no visited value is near it.
fn end(visited: &[(f64, f64)], rise: f64) -> Option<f64> {
    let is_near = |own: f64| (own / rise - 1.0).abs() < NEAR_RISE;
    let ((below, own), above) = around(visited, rise);
    let Some((above, other)) = above else { return is_near(own).then(|| below * rise / own) };
    let is_known = is_near(own) || is_near(other) || above - below < NEAR_RISE * above;
    is_known.then(|| below + (rise - own) / (other - own) * (above - below))
}
