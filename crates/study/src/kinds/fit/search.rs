//! The points of a fit, in stages. Each point is a sequence of runs, and its row follows from them.
//!
//! | stage | points |
//! |---|---|
//! | starts | the least sum of squares from each start |
//! | minimum | the least sum of squares from the best of them, with the noise estimated anew |
//! | derivatives and subsets | the derivatives of all predictions; the minimum without a test, or of some outputs |
//! | profiles, [`TRIALS`] times | on both sides of each parameter, the least sum of squares at one more value of it |
//!
//! The tasks of a stage do not depend on the rows before it. A row has the parameters, the sum of squares, the number of
//! runs, the error of a column of derivatives, and a number for each position: the numerical error of a prediction (from
//! a start), a prediction (of the minimum), or its derivative.

use crate::plan::Tried;
use crate::problem::{Lack, Problem};
use crate::rows::Rows;
use crate::stats::derivative::{Derivative, Place as At, Search};
use crate::stats::least_squares::{self, Stop};
use crate::stats::measured::{Information, Measured};

use super::model::{Parameter, Position, Set};
use super::source::Source;

/// Relative change of a parameter from which a search takes its differences. Numerical noise is much smaller.
const DIFFERENCE: f64 = 0.04;
/// When searches end: from the starts and in profiles, and elsewhere.
const COARSE: Stop = Stop { decrease: 1e-3, step: 1e-3, steps: 25 };
const FINE: Stop = Stop { decrease: 1e-5, step: 1e-4, steps: 20 };
/// The noise is estimated at most this often, and until it changes by less than this share.
const ESTIMATES: usize = 6;
const SAME_NOISE: f64 = 0.01;
/// Maximum number of intervals in which a derivative is searched.
const ROUNDS: usize = 2;
/// Number of values in the profile of a parameter on each side of the estimate, and the accepted error of the last one.
const TRIALS: usize = 5;
const SAME_RISE: f64 = 0.02;
/// With more tests than this, they are not left out one by one.
const MAX_LEAVES: usize = 24;

/// Numbers that are measured, and what they should say about parameters.
#[derive(Debug)]
pub struct Fit {
    pub parameters: Vec<Parameter>,
    pub sources: Vec<Source>,
    pub sets: Vec<Set>,
    pub positions: Vec<Position>,
    /// The outputs whose noise is estimated, for each kind of noise; `None` for stated noise.
    pub noises: Vec<Option<String>>,
    /// The measured numbers at all positions, without numerical errors.
    pub measured: Measured,
    /// The names of the tests.
    pub tests: Vec<String>,
    /// The parameter that is also estimated from volumes and from depths alone, if there are both.
    pub coefficient: Option<usize>,
    pub starts: Vec<Vec<f64>>,
    pub confidence: f64,
    /// Estimated processor time of a point.
    pub seconds: f64,
    /// The tasks of all points, and the index of the first one of each stage.
    pub tasks: Vec<Task>,
    pub first: Vec<usize>,
}

/// What a point computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Task {
    Start(usize),
    Minimum,
    Derivative(usize),
    Without(usize),
    Only { are_depths: bool },
    Profile { parameter: usize, is_high: bool },
}

/// The tasks of each stage, for these numbers of starts, parameters and tests.
pub fn tasks(starts: u32, parameters: usize, tests: usize, has_subsets: bool) -> Vec<Vec<Task>> {
    let leaves = if (2..=MAX_LEAVES).contains(&tests) { tests } else { 0 };
    let subsets = [false, true].map(|are_depths| Task::Only { are_depths });
    let all = (0..parameters).map(Task::Derivative).chain((0..leaves).map(Task::Without));
    let sides = (0..parameters)
        .flat_map(|parameter| [false, true].map(|is_high| Task::Profile { parameter, is_high }));
    let mut stages = vec![(0..starts as usize).map(Task::Start).collect(), vec![Task::Minimum]];
    stages.push(all.chain(subsets.into_iter().filter(|_| has_subsets)).collect());
    stages.extend(vec![sides.collect(); TRIALS]);
    stages
}

/// The values of a run that is not known: the index of its source, and the values of its members.
type Wanted = Vec<f64>;

/// The best parameters, and the measured numbers with numerical errors.
#[derive(Debug)]
pub struct Best {
    pub theta: Vec<f64>,
    pub sum: f64,
    pub predicted: Vec<f64>,
    pub factors: Vec<f64>,
    pub measured: Measured,
}

/// A row. Missing parameters and missing numbers are an empty list.
#[derive(Debug, Default)]
struct Row {
    theta: Vec<f64>,
    sum: Option<f64>,
    error: Option<f64>,
    numbers: Vec<f64>,
    lack: Option<String>,
}

/// The residuals of some of the measured numbers, as a function of the coordinates of some parameters.
struct Objective<'a> {
    fit: &'a Fit,
    tried: &'a [Tried],
    measured: &'a Measured,
    factors: &'a [f64],
    theta: &'a [f64],
    free: &'a [usize],
}

impl Objective<'_> {
    fn theta(&self, u: &[f64]) -> Vec<f64> {
        let mut theta = self.theta.to_vec();
        for (place, u) in self.free.iter().zip(u) {
            theta[*place] = self.fit.parameters[*place].value(*u);
        }
        theta
    }

    fn at(&self, theta: &[f64]) -> Result<Vec<f64>, Wanted> {
        let [predicted, _] = self.fit.predicted(theta, self.tried)?;
        let mut residuals = self.measured.residuals(&predicted, self.factors);
        let priors = self.fit.parameters.iter().zip(theta);
        residuals.extend(priors.filter_map(|(it, x)| Some(it.prior_residual(*x)?.0)));
        Ok(residuals)
    }

    fn sum(&self, theta: &[f64]) -> Result<f64, Wanted> {
        Ok(self.at(theta)?.iter().map(|residual| residual * residual).sum())
    }

    /// The derivatives of the residuals with respect to a coordinate, from central differences. At a bound, and where
    /// predictions are missing on one side, they are differences to the other side.
    fn slopes(&self, u: &[f64], place: usize, middle: &[f64]) -> Result<Vec<f64>, Wanted> {
        let parameter = &self.fit.parameters[self.free[place]];
        let step = DIFFERENCE * parameter.step(parameter.value(u[place]));
        let beside = |step: f64| {
            let mut other = u.to_vec();
            other[place] = (u[place] + step).clamp(0.0, 1.0);
            let residuals = self.at(&self.theta(&other))?;
            let is_known = residuals.iter().all(|residual| residual.is_finite());
            let known =
                if is_known { (other[place], residuals) } else { (u[place], middle.to_vec()) };
            Ok::<_, Wanted>(known)
        };
        let (high, low) = (beside(step)?, beside(-step)?);
        let slopes = high.1.iter().zip(&low.1).map(|(one, other)| (one - other) / (high.0 - low.0));
        Ok(slopes.map(|slope| if slope.is_finite() { slope } else { 0.0 }).collect())
    }

    /// The parameters of the minimum near the present ones.
    fn minimum(&self, stop: Stop) -> Result<Vec<f64>, Wanted> {
        let coordinate = |place: &usize| self.fit.parameters[*place].coordinate(self.theta[*place]);
        let start: Vec<f64> = self.free.iter().map(coordinate).collect();
        if start.is_empty() {
            return Ok(self.theta.to_vec());
        }
        let residuals = |u: &[f64]| self.at(&self.theta(u));
        let derivatives = |u: &[f64]| {
            let middle = residuals(u)?;
            (0..u.len()).map(|place| self.slopes(u, place, &middle)).collect()
        };
        Ok(self.theta(&least_squares::minimum(&residuals, &derivatives, &start, stop)?))
    }

    /// The row of the minimum near the present parameters.
    fn row(&self, stop: Stop) -> Result<Row, Wanted> {
        let theta = self.minimum(stop)?;
        Ok(Row { sum: Some(self.sum(&theta)?), theta, ..Row::default() })
    }
}

impl Fit {
    /// Predictions at all positions for these parameters, from known runs, and their relative numerical errors. A
    /// missing one is not a number.
    ///
    /// # Errors
    /// A run is not known.
    fn predicted(&self, theta: &[f64], tried: &[Tried]) -> Result<[Vec<f64>; 2], Wanted> {
        let run = |(place, source): (usize, &Source)| {
            let Some(mut values) = source.values(theta) else { return Ok(None) };
            values.insert(0, place as f64);
            tried.iter().find(|tried| tried.values == values).map(Some).ok_or(values)
        };
        let runs: Vec<_> = self.sources.iter().enumerate().map(run).collect::<Result<_, _>>()?;
        let number = |it: &Position| {
            let run = runs[it.source].map(|tried| (&tried.values[1..], &tried.found));
            let found = self.sources[it.source].predicted(&self.sets[it.set], it.entry, theta, run);
            found.unwrap_or((f64::NAN, f64::NAN))
        };
        let (values, errors) = self.positions.iter().map(number).unzip();
        Ok([values, errors])
    }

    /// The set of a position.
    pub fn set(&self, place: usize) -> &Set {
        &self.sets[self.positions[place].set]
    }

    /// The indices of the points with these tasks.
    pub fn points_of(&self, is_own: impl Fn(Task) -> bool) -> Vec<usize> {
        (0..self.tasks.len()).filter(|point| is_own(self.tasks[*point])).collect()
    }

    /// The best start: its parameters, and the measured numbers with the numerical errors of its runs.
    fn best_start(&self, rows: &Rows) -> Option<(Vec<f64>, Measured)> {
        let sums = rows.numbers(self.parameters.len());
        let known = sums[..self.starts.len()].iter().enumerate();
        let known = known.filter_map(|(place, sum)| Some((place, (*sum)?)));
        let (start, _) = known.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut measured = self.measured.clone();
        for ((place, point), it) in measured.points.iter_mut().enumerate().zip(&self.positions) {
            let set = &self.sets[it.set];
            let size = if set.over() == "radius" { set.largest() } else { point.value.abs() };
            point.numerical = size * self.numbers(rows, start, place).unwrap_or(0.0);
        }
        let theta = (0..self.parameters.len()).filter_map(|it| rows.numbers(it)[start]);
        Some((theta.collect(), measured))
    }

    /// The number of a position in a row.
    fn numbers(&self, rows: &Rows, row: usize, position: usize) -> Option<f64> {
        rows.numbers(self.parameters.len() + 3 + position)[row]
    }

    /// The best parameters, if a start has led to them.
    pub fn best(&self, rows: &Rows) -> Option<Best> {
        let (row, count) = (self.first[1], self.parameters.len());
        let (_, measured) = self.best_start(rows)?;
        let theta = (0..count).map(|it| rows.numbers(it)[row]).collect::<Option<_>>()?;
        let predicted = (0..self.positions.len()).map(|it| self.numbers(rows, row, it));
        let predicted: Vec<f64> = predicted.map(|it| it.unwrap_or(f64::NAN)).collect();
        let (sum, factors) = (rows.numbers(count)[row]?, measured.factors(&predicted));
        Some(Best { theta, sum, predicted, factors, measured })
    }

    /// What the data say about the parameters near the best ones: without and with their priors. The parameters are in
    /// units of their [scales](Parameter::scale).
    pub fn information(&self, rows: &Rows, best: &Best) -> [Information; 2] {
        let count = self.parameters.len();
        let mut columns = self.derivatives(rows);
        for column in &mut columns {
            let points = column.iter_mut().zip(&best.measured.points);
            points.for_each(|(derivative, point)| *derivative *= point.slope(&best.factors));
        }
        let errors = &rows.numbers(count + 2)[self.first[2]..];
        let errors: Vec<f64> = errors.iter().take(count).map(|it| it.unwrap_or(0.0)).collect();
        let alone = Information::of(&columns, &errors);
        for (place, parameter) in self.parameters.iter().enumerate() {
            let x = best.theta[place];
            let slope = parameter.prior_residual(x).map_or(0.0, |(_, slope)| slope);
            for (other, column) in columns.iter_mut().enumerate() {
                column.push(if other == place { slope * parameter.scale(x) } else { 0.0 });
            }
        }
        [alone, Information::of(&columns, &errors)]
    }

    /// The derivatives of all predictions with respect to each parameter, in units of its scale. A missing one is 0.
    pub fn derivatives(&self, rows: &Rows) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::with_capacity(self.positions.len()); self.parameters.len()];
        for position in 0..self.positions.len() {
            let cells = rows.numbers(self.parameters.len() + 3 + position);
            let own = columns.iter_mut().zip(&cells[self.first[2]..]);
            own.for_each(|(column, cell)| column.push(cell.unwrap_or(0.0)));
        }
        columns
    }

    /// The visited values in the profile of a parameter on one side: the distances from the estimate in coordinates,
    /// ascending from 0, and the square roots of the rise of S. A missing S is infinite.
    pub fn profile(&self, rows: &Rows, best: &Best, own: Task) -> Vec<(f64, f64)> {
        let Task::Profile { parameter: place, .. } = own else { return Vec::new() };
        let (sums, cells) = (rows.numbers(self.parameters.len()), rows.numbers(place));
        let coordinate = |x: f64| self.parameters[place].coordinate(x);
        let visited = self.points_of(|task| task == own).into_iter().filter_map(|row| {
            let distance = coordinate((*cells.get(row)?)?) - coordinate(best.theta[place]);
            let rise = sums[row].map_or(f64::INFINITY, |sum| (sum - best.sum).max(0.0).sqrt());
            Some((distance.abs(), rise))
        });
        let mut visited: Vec<_> = [(0.0, 0.0)].into_iter().chain(visited).collect();
        visited.sort_by(|a, b| a.0.total_cmp(&b.0));
        visited
    }

    /// The row of a point from its runs, or the run that it needs next.
    fn computed(&self, number: usize, earlier: &Rows, tried: &[Tried]) -> Result<Row, Wanted> {
        let all: Vec<usize> = (0..self.parameters.len()).collect();
        match self.tasks[number] {
            Task::Start(place) => return self.at_start(&self.starts[place], &all, tried),
            Task::Minimum => {
                let Some((theta, measured)) = self.best_start(earlier) else {
                    let lack =
                        "no start leads to numbers for all measured points: see their reasons";
                    return Ok(Row { lack: Some(lack.to_owned()), ..Row::default() });
                };
                return self.at_minimum(theta, &measured, &all, tried);
            }
            _ => {}
        }
        let Some(best) = self.best(earlier) else { return Ok(Row::default()) };
        let of_part = |part: Measured, free: &[usize]| {
            if free.is_empty() || part.count(None) + 1e-9 < free.len() as f64 {
                return Ok(Row::default());
            }
            let (theta, factors) = (&best.theta, &best.factors);
            Objective { fit: self, tried, measured: &part, factors, theta, free }.row(FINE)
        };
        match self.tasks[number] {
            Task::Derivative(parameter) => self.derivative(parameter, &best, tried),
            Task::Without(test) => {
                of_part(best.measured.without(|place| self.set(place).test == test), &all)
            }
            Task::Only { are_depths } => {
                let is_other = |place| self.set(place).are_depths() != Some(are_depths);
                of_part(best.measured.without(is_other), self.coefficient.as_slice())
            }
            task => self.beside(task, earlier, &best, tried),
        }
    }

    fn at_start(&self, start: &[f64], free: &[usize], tried: &[Tried]) -> Result<Row, Wanted> {
        let (measured, factors) = (&self.measured, &vec![1.0; self.noises.len()]);
        let objective = Objective { fit: self, tried, measured, factors, theta: start, free };
        if !objective.sum(start)?.is_finite() {
            let lacks = tried.iter().filter_map(|tried| tried.found.lack.as_ref());
            let reason = lacks.map(|(Lack::Refused(why) | Lack::Incomplete(why))| why).next();
            let lack = reason.cloned().unwrap_or_else(|| "a number is missing".to_owned());
            return Ok(Row { lack: Some(lack), ..Row::default() });
        }
        let row = objective.row(COARSE)?;
        let [_, numbers] = self.predicted(&row.theta, tried)?;
        Ok(Row { numbers, ..row })
    }

    fn at_minimum(
        &self,
        mut theta: Vec<f64>,
        measured: &Measured,
        free: &[usize],
        tried: &[Tried],
    ) -> Result<Row, Wanted> {
        let mut factors = measured.factors(&self.predicted(&theta, tried)?[0]);
        for _ in 0..ESTIMATES {
            let near =
                Objective { fit: self, tried, measured, factors: &factors, theta: &theta, free };
            let found = near.minimum(FINE)?;
            let new = measured.factors(&self.predicted(&found, tried)?[0]);
            let change = |(new, old): (&f64, &f64)| (new / old - 1.0).abs();
            let is_same = new.iter().zip(&factors).map(change).all(|change| change < SAME_NOISE);
            (theta, factors) = (found, new);
            if is_same {
                break;
            }
        }
        let near = Objective { fit: self, tried, measured, factors: &factors, theta: &theta, free };
        let (sum, [numbers, _]) = (near.sum(&theta)?, self.predicted(&theta, tried)?);
        Ok(Row { theta, sum: Some(sum), numbers, ..Row::default() })
    }

    /// The derivatives of all predictions.
    fn derivative(&self, place: usize, best: &Best, tried: &[Tried]) -> Result<Row, Wanted> {
        let Parameter { low, high, .. } = self.parameters[place];
        let x = best.theta[place];
        let scale = self.parameters[place].scale(x);
        let sizes = best.predicted.iter().zip(&best.measured.points);
        let accuracies = sizes.map(|(y, point)| point.numerical / y.abs().max(f64::MIN_POSITIVE));
        let accuracies: Vec<f64> = accuracies.map(|it| if it < 1.0 { it } else { 0.0 }).collect();
        let mut search = Search::new(At { x, scale, low, high }, &accuracies);
        for _ in 0..ROUNDS {
            let Some(points) = search.points() else { break };
            let values = points.iter().map(|x| {
                let mut theta = best.theta.clone();
                theta[place] = *x;
                let [found, _] = self.predicted(&theta, tried)?;
                Ok(found.into_iter().map(|it| Some(it).filter(|it| it.is_finite())).collect())
            });
            search.take(values.collect::<Result<_, Wanted>>()?);
        }
        let found = search.found();
        let errors = found.iter().zip(&best.measured.points).filter_map(|(found, point)| {
            Some(found.as_ref()?.error * scale * point.slope(&best.factors))
        });
        let number =
            |found: &Option<Derivative>| found.map_or(f64::NAN, |found| found.value * scale);
        Ok(Row {
            theta: best.theta.clone(),
            error: Some(errors.map(|error| error * error).sum::<f64>().sqrt()),
            numbers: found.iter().map(number).collect(),
            ..Row::default()
        })
    }

    /// The next value in the profile of a parameter: the least sum of squares there. It has no row if the data do not
    /// determine the parameter, or if the end of the interval is known.
    fn beside(
        &self,
        task: Task,
        earlier: &Rows,
        best: &Best,
        tried: &[Tried],
    ) -> Result<Row, Wanted> {
        let Task::Profile { parameter: place, is_high } = task else { return Ok(Row::default()) };
        let [_, information] = self.information(earlier, best);
        let only = self.only(place);
        let error = information.standard_error(&only);
        if information.is_open(place) || !error.is_finite() || error == 0.0 {
            return Ok(Row::default());
        }
        let (rise, visited) =
            (best.measured.factor(self.confidence), self.profile(earlier, best, task));
        let step = |it: usize| self.parameters[it].step(best.theta[it]);
        let coordinate = |it: usize| self.parameters[it].coordinate(best.theta[it]);
        let sign = if is_high { 1.0 } else { -1.0 };
        let Some(distance) = next_distance(&visited, rise, rise * error * step(place)) else {
            return Ok(Row::default());
        };
        let last = visited.last().map_or(0.0, |last| last.0);
        let is_at_bound = !(0.0..=1.0).contains(&(coordinate(place) + sign * last * (1.0 + 1e-9)));
        if is_at_bound && distance > last {
            return Ok(Row::default());
        }
        let at = |other: usize| {
            let along = information.covariance(other, &only) / (error * error);
            let moved = sign * distance * along * step(other) / step(place);
            self.parameters[other].value((coordinate(other) + moved).clamp(0.0, 1.0))
        };
        let theta: Vec<f64> = (0..self.parameters.len()).map(at).collect();
        let free: Vec<usize> = (0..theta.len()).filter(|other| *other != place).collect();
        let (measured, factors) = (&best.measured, &best.factors);
        Objective { fit: self, tried, measured, factors, theta: &theta, free: &free }.row(COARSE)
    }

    /// The slopes of a parameter as a function of all parameters.
    pub fn only(&self, place: usize) -> Vec<f64> {
        (0..self.parameters.len()).map(|other| f64::from(other == place)).collect()
    }

    /// The row of a point, or the values of the run that it needs next.
    pub fn row_or_run(
        &self,
        problem: &Problem,
        number: usize,
        earlier: &Rows,
        tried: &[Tried],
    ) -> Result<Tried, Wanted> {
        let Row { mut theta, sum, error, mut numbers, lack } =
            self.computed(number, earlier, tried)?;
        theta.resize(self.parameters.len(), f64::NAN);
        numbers.resize(self.positions.len(), f64::NAN);
        let mut found = problem.no_run();
        let counts = [sum, Some(tried.len() as f64), error];
        let cells = theta.into_iter().map(Some).chain(counts).chain(numbers.into_iter().map(Some));
        found.outputs = cells.map(|it| it.filter(|it| it.is_finite())).collect();
        found.lack = lack.map(Lack::Incomplete);
        Ok(Tried { values: Vec::new(), found })
    }
}

/// The next distance in a profile, or `None` if the end of the interval is known. The first trial is at half of the
/// expected distance. The next ones are where the visited values let expect the rise.
fn next_distance(visited: &[(f64, f64)], rise: f64, expected: f64) -> Option<f64> {
    let [below, above] = around(visited, rise);
    if visited.iter().any(|(_, own)| (own / rise - 1.0).abs() < SAME_RISE) {
        return None;
    }
    Some(match (below?, above) {
        (below, Some(above)) => {
            let share = ((rise - below.1) / (above.1.min(10.0 * rise) - below.1)).clamp(0.1, 0.9);
            below.0 + share * (above.0 - below.0)
        }
        ((0.0, _), None) => 0.5 * expected,
        (below, None) => below.0 * (rise / below.1).clamp(1.05, 3.0),
    })
}

/// The visited values next to a rise.
fn around(visited: &[(f64, f64)], rise: f64) -> [Option<(f64, f64)>; 2] {
    let below = visited.iter().take_while(|(_, own)| *own < rise).last();
    [below, visited.iter().find(|(_, own)| *own >= rise)].map(|it| it.copied())
}

/// The distance at which S has risen by the square of `rise`: between the visited values, or near the last one. `None`
/// if S does not rise so much.
pub fn end(visited: &[(f64, f64)], rise: f64) -> Option<f64> {
    match around(visited, rise) {
        [Some(below), Some(above)] if above.1.is_finite() => {
            Some(below.0 + (rise - below.1) / (above.1 - below.1) * (above.0 - below.0))
        }
        [Some(below), _] => {
            (below.1 > (1.0 - SAME_RISE) * rise).then_some(below.0 * rise / below.1)
        }
        _ => None,
    }
}
