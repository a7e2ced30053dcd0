//! The points of a fit, in stages. Each point is a sequence of runs, and its row follows from them.
//!
//! | stage | points |
//! |---|---|
//! | starts | the least sum of squares from each start |
//! | minimum | the least sum of squares from the best of them, with the noise estimated anew |
//! | derivatives and subsets | the derivatives of all predictions; the minimum without a test, or of some outputs |
//! | ends | the ends of each interval, where the least sum of squares has risen by the allowed amount |
//!
//! The number of the points of a stage does not depend on the rows before it. A row has the parameters, the sum of
//! squares, the number of runs, the error of a column of derivatives, and a number for each position: a prediction, or
//! its derivative.

use crate::plan::Tried;
use crate::problem::{Lack, Problem};
use crate::rows::Rows;
use crate::stats::derivative::{Derivative, Place as At, Search};
use crate::stats::least_squares::{Function, Stop, minimum};
use crate::stats::measured::{Information, Measured};

use super::model::{Parameter, Position, Set, Source, Wanted, predicted};

/// Relative change of a parameter from which a search takes its differences. Numerical noise is much smaller.
const DIFFERENCE: f64 = 0.04;
/// When searches end: from the starts, and elsewhere.
const COARSE: Stop = Stop { decrease: 1e-3, step: 1e-3, steps: 25 };
const FINE: Stop = Stop { decrease: 1e-5, step: 1e-4, steps: 20 };
/// The noise is estimated at most this often, and until it changes by less than this share.
const ESTIMATES: usize = 6;
const SAME_NOISE: f64 = 0.01;
/// Maximum number of intervals in which a derivative is searched.
const ROUNDS: usize = 2;
/// Maximum number of trials for the end of an interval, and the accepted error of the square root of the rise.
const TRIALS: usize = 8;
const SAME_RISE: f64 = 0.02;
/// With more tests than this, they are not left out one by one.
const MAX_LEAVES: usize = 24;
/// A parameter whose coordinate is nearer to 0 or 1 than this is at a bound.
pub const AT_BOUND: f64 = 2e-3;

/// Numbers that are measured, and what they should say about parameters.
#[derive(Debug)]
pub struct Fit {
    pub parameters: Vec<Parameter>,
    pub sources: Vec<Source>,
    pub sets: Vec<Set>,
    pub positions: Vec<Position>,
    /// The outputs whose noise is estimated, for each kind of noise; `None` for stated noise.
    pub noises: Vec<Option<String>>,
    /// The measured numbers at all positions.
    pub measured: Measured,
    /// The names of the tests.
    pub tests: Vec<String>,
    /// The parameter that is also estimated from volumes and from depths alone, if there are both.
    pub coefficient: Option<usize>,
    pub starts: Vec<Vec<f64>>,
    pub confidence: f64,
    /// The relative numerical error of all predictions.
    pub accuracy: f64,
    /// Estimated processor time of a point.
    pub seconds: f64,
}

/// What a point computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Task {
    Start(usize),
    Minimum,
    Derivative(usize),
    Without(usize),
    Only { are_depths: bool },
    End { parameter: usize, is_high: bool },
}

/// The best parameters.
#[derive(Debug, Clone)]
pub struct Best {
    pub theta: Vec<f64>,
    pub sum: f64,
    pub predicted: Vec<f64>,
    pub factors: Vec<f64>,
}

/// A row: the parameters, the sum of squares, the error of a column of derivatives, and the numbers of all positions.
#[derive(Debug, Default)]
struct Row {
    theta: Option<Vec<f64>>,
    sum: Option<f64>,
    error: Option<f64>,
    numbers: Option<Vec<f64>>,
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
    is_central: bool,
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
        let predicted = self.fit.predicted(theta, self.tried)?;
        let mut residuals = self.measured.residuals(&predicted, self.factors);
        let priors = self.fit.parameters.iter().zip(theta);
        residuals.extend(
            priors.filter_map(|(parameter, x)| parameter.prior_residual(*x)).map(|it| it.0),
        );
        Ok(residuals)
    }

    /// Finds the minimum near the present parameters.
    fn minimum(&self, stop: Stop) -> Result<Vec<f64>, Wanted> {
        let start: Vec<f64> = self
            .free
            .iter()
            .map(|place| self.fit.parameters[*place].coordinate(self.theta[*place]))
            .collect();
        if start.is_empty() {
            return Ok(self.theta.to_vec());
        }
        Ok(self.theta(&minimum(self, &start, stop)?))
    }

    /// The row of the minimum near the present parameters.
    fn row(&self, stop: Stop) -> Result<Row, Wanted> {
        let theta = self.minimum(stop)?;
        Ok(Row { sum: Some(self.sum(&theta)?), theta: Some(theta), ..Row::default() })
    }

    fn sum(&self, theta: &[f64]) -> Result<f64, Wanted> {
        Ok(self.at(theta)?.iter().map(|residual| residual * residual).sum())
    }
}

impl Function for Objective<'_> {
    type Unknown = Wanted;

    fn residuals(&self, u: &[f64]) -> Result<Vec<f64>, Wanted> {
        self.at(&self.theta(u))
    }

    fn derivatives(&self, u: &[f64]) -> Result<Vec<Vec<f64>>, Wanted> {
        let middle = self.residuals(u)?;
        let column = |place: usize| {
            let parameter = &self.fit.parameters[self.free[place]];
            let x = parameter.value(u[place]);
            // The coordinate and the residuals at another value of this parameter, if they exist.
            let beside = |distance: f64| {
                let mut other = u.to_vec();
                other[place] = parameter.coordinate(parameter.moved(x, distance));
                let is_other = (other[place] - u[place]).abs() > f64::EPSILON;
                let residuals = self.residuals(&other)?;
                let is_known = is_other && residuals.iter().all(|residual| residual.is_finite());
                Ok::<_, Wanted>(is_known.then_some((other[place], residuals)))
            };
            let above = beside(DIFFERENCE)?;
            let needs_below = self.is_central || above.is_none();
            let below = if needs_below { beside(-DIFFERENCE)? } else { None };
            let known = (u[place], middle.clone());
            let (high, low) = (above.unwrap_or(known.clone()), below.unwrap_or(known));
            let width = high.0 - low.0;
            let slopes = high.1.iter().zip(&low.1).map(|(high, low)| (high - low) / width);
            Ok(slopes.map(|slope| if slope.is_finite() { slope } else { 0.0 }).collect())
        };
        (0..u.len()).map(column).collect()
    }
}

impl Fit {
    /// Predictions for these parameters.
    pub fn predicted(&self, theta: &[f64], tried: &[Tried]) -> Result<Vec<f64>, Wanted> {
        predicted(&self.sources, &self.positions, theta, tried)
    }

    /// The set of a position.
    pub fn set(&self, place: usize) -> &Set {
        &self.sets[self.positions[place].set]
    }

    /// The numbers of the points with which the stages begin, and the number of all points.
    pub fn bounds(&self) -> [usize; 5] {
        let starts = self.starts.len();
        let ends = starts + 1 + self.parameters.len() + self.leaves() + self.subsets();
        [0, starts, starts + 1, ends, ends + 2 * self.parameters.len()]
    }

    /// The number of tests that are left out one by one.
    pub fn leaves(&self) -> usize {
        if (2..=MAX_LEAVES).contains(&self.tests.len()) { self.tests.len() } else { 0 }
    }

    /// The number of fits of volumes or depths alone.
    pub fn subsets(&self) -> usize {
        2 * usize::from(self.coefficient.is_some())
    }

    fn task(&self, number: usize) -> Task {
        let [_, minimum, checks, ends, _] = self.bounds();
        let (parameters, leaves) = (self.parameters.len(), self.leaves());
        if number < minimum {
            Task::Start(number)
        } else if number < checks {
            Task::Minimum
        } else if number < checks + parameters {
            Task::Derivative(number - checks)
        } else if number < checks + parameters + leaves {
            Task::Without(number - checks - parameters)
        } else if number < ends {
            Task::Only { are_depths: number + 1 == ends }
        } else {
            Task::End { parameter: (number - ends) / 2, is_high: (number - ends) % 2 == 1 }
        }
    }

    /// The best parameters, if a start has led to them.
    pub fn best(&self, rows: &Rows) -> Option<Best> {
        let row = self.bounds()[1];
        let count = self.parameters.len();
        let number = |column: usize| rows.numbers(column)[row];
        let theta: Vec<f64> = (0..count).map(number).collect::<Option<_>>()?;
        let predicted: Vec<f64> = (0..self.positions.len())
            .map(|place| number(count + 3 + place).unwrap_or(f64::NAN))
            .collect();
        let factors = self.measured.factors(&predicted);
        Some(Best { theta, sum: number(count)?, predicted, factors })
    }

    /// What the data say about the parameters near the best ones: without and with their priors. The parameters are in
    /// units of their [scales](Parameter::scale).
    pub fn information(&self, rows: &Rows, best: &Best) -> [Information; 2] {
        let (count, first) = (self.parameters.len(), self.bounds()[2]);
        let mut columns = self.derivatives(rows);
        let slopes = self.measured.slopes(&best.factors);
        for column in &mut columns {
            column.iter_mut().zip(&slopes).for_each(|(derivative, slope)| *derivative *= slope);
        }
        let errors = rows.numbers(count + 2);
        let errors: Vec<f64> = (0..count).map(|it| errors[first + it].unwrap_or(0.0)).collect();
        let alone = Information::of(&columns, &errors);
        for (place, parameter) in self.parameters.iter().enumerate() {
            let x = best.theta[place];
            if let Some((_, slope)) = parameter.prior_residual(x) {
                for (other, column) in columns.iter_mut().enumerate() {
                    column.push(if other == place { slope * parameter.scale(x) } else { 0.0 });
                }
            }
        }
        [alone, Information::of(&columns, &errors)]
    }

    /// The derivatives of all predictions with respect to each parameter, in units of its scale. A missing one is 0.
    pub fn derivatives(&self, rows: &Rows) -> Vec<Vec<f64>> {
        let (count, first) = (self.parameters.len(), self.bounds()[2]);
        let mut columns = vec![Vec::with_capacity(self.positions.len()); count];
        for position in 0..self.positions.len() {
            let cells = rows.numbers(count + 3 + position);
            for (place, column) in columns.iter_mut().enumerate() {
                column.push(cells[first + place].unwrap_or(0.0));
            }
        }
        columns
    }

    /// The row of a point from its runs, or the run that it needs next.
    fn computed(&self, number: usize, earlier: &Rows, tried: &[Tried]) -> Result<Row, Wanted> {
        let task = self.task(number);
        if let Task::Start(place) = task {
            return self.at_start(&self.starts[place], tried);
        }
        if task == Task::Minimum {
            let sums = earlier.numbers(self.parameters.len());
            let known = sums[..self.starts.len()].iter().enumerate();
            let known = known.filter_map(|(place, sum)| Some((place, (*sum)?)));
            let Some((start, _)) = known.min_by(|a, b| a.1.total_cmp(&b.1)) else {
                let lack = "no start leads to numbers for all measured points: see their reasons";
                return Ok(Row { lack: Some(lack.to_owned()), ..Row::default() });
            };
            let theta = (0..self.parameters.len()).filter_map(|it| earlier.numbers(it)[start]);
            return self.at_minimum(&theta.collect::<Vec<_>>(), tried);
        }
        let Some(best) = self.best(earlier) else { return Ok(Row::default()) };
        match task {
            Task::Start(_) | Task::Minimum => Ok(Row::default()),
            Task::Derivative(parameter) => self.derivative(parameter, &best, tried),
            Task::Without(test) => {
                let rest = self.measured.without(|place| self.set(place).test == test);
                let all: Vec<usize> = (0..self.parameters.len()).collect();
                self.of_part(&rest, &all, &best, tried)
            }
            Task::Only { are_depths } => {
                let is_other = |place| self.set(place).are_depths() != Some(are_depths);
                let free: Vec<usize> = self.coefficient.into_iter().collect();
                self.of_part(&self.measured.without(is_other), &free, &best, tried)
            }
            Task::End { parameter, is_high } => {
                let [_, information] = self.information(earlier, &best);
                self.end(parameter, is_high, &best, &information, tried)
            }
        }
    }

    fn objective<'a>(
        &'a self,
        theta: &'a [f64],
        factors: &'a [f64],
        free: &'a [usize],
        tried: &'a [Tried],
    ) -> Objective<'a> {
        Objective {
            fit: self,
            tried,
            measured: &self.measured,
            factors,
            theta,
            free,
            is_central: false,
        }
    }

    fn at_start(&self, start: &[f64], tried: &[Tried]) -> Result<Row, Wanted> {
        let factors = vec![1.0; self.noises.len()];
        let free: Vec<usize> = (0..self.parameters.len()).collect();
        let objective = self.objective(start, &factors, &free, tried);
        if !objective.sum(start)?.is_finite() {
            let lacks = tried.iter().filter_map(|tried| tried.found.lack.as_ref());
            let reason = lacks.map(|(Lack::Refused(why) | Lack::Incomplete(why))| why).next();
            let lack = reason.cloned().unwrap_or_else(|| "a number is missing".to_owned());
            return Ok(Row { lack: Some(lack), ..Row::default() });
        }
        objective.row(COARSE)
    }

    fn at_minimum(&self, start: &[f64], tried: &[Tried]) -> Result<Row, Wanted> {
        let free: Vec<usize> = (0..self.parameters.len()).collect();
        let mut theta = start.to_vec();
        let mut factors = self.measured.factors(&self.predicted(&theta, tried)?);
        for _ in 0..ESTIMATES {
            let objective =
                Objective { is_central: true, ..self.objective(&theta, &factors, &free, tried) };
            let found = objective.minimum(FINE)?;
            let new = self.measured.factors(&self.predicted(&found, tried)?);
            theta = found;
            let change = |(new, old): (&f64, &f64)| (new / old - 1.0).abs();
            let is_same = new.iter().zip(&factors).map(change).all(|change| change < SAME_NOISE);
            factors = new;
            if is_same {
                break;
            }
        }
        let sum = self.objective(&theta, &factors, &free, tried).sum(&theta)?;
        let numbers = Some(self.predicted(&theta, tried)?);
        Ok(Row { theta: Some(theta), sum: Some(sum), numbers, ..Row::default() })
    }

    /// The derivatives of all predictions.
    fn derivative(&self, place: usize, best: &Best, tried: &[Tried]) -> Result<Row, Wanted> {
        let parameter = &self.parameters[place];
        let x = best.theta[place];
        let scale = parameter.scale(x);
        let at = At { x, scale, low: parameter.low, high: parameter.high };
        let mut search = Search::new(at, &vec![self.accuracy; self.positions.len()]);
        for _ in 0..ROUNDS {
            let Some(points) = search.points() else { break };
            let values = points.iter().map(|x| {
                let mut theta = best.theta.clone();
                theta[place] = *x;
                let found = self.predicted(&theta, tried)?;
                Ok(found.into_iter().map(|it| Some(it).filter(|it| it.is_finite())).collect())
            });
            search.take(values.collect::<Result<_, Wanted>>()?);
        }
        let found = search.found();
        let slopes = self.measured.slopes(&best.factors);
        let errors = found.iter().zip(slopes);
        let errors =
            errors.filter_map(|(found, slope)| Some(found.as_ref()?.error * scale * slope));
        let number =
            |found: &Option<Derivative>| found.map_or(f64::NAN, |found| found.value * scale);
        Ok(Row {
            theta: Some(best.theta.clone()),
            error: Some(errors.map(|error| error * error).sum::<f64>().sqrt()),
            numbers: Some(found.iter().map(number).collect()),
            ..Row::default()
        })
    }

    /// The minimum of a part of the measured numbers.
    fn of_part(
        &self,
        part: &Measured,
        free: &[usize],
        best: &Best,
        tried: &[Tried],
    ) -> Result<Row, Wanted> {
        if free.is_empty() || part.count(None) + 1e-9 < free.len() as f64 {
            return Ok(Row::default());
        }
        let all = self.objective(&best.theta, &best.factors, free, tried);
        Objective { measured: part, ..all }.row(FINE)
    }

    /// The slopes of a parameter as a function of all parameters.
    pub fn only(&self, place: usize) -> Vec<f64> {
        (0..self.parameters.len()).map(|other| f64::from(other == place)).collect()
    }

    /// The end of the interval of a parameter. It has no row if the data do not determine the parameter, or if the sum
    /// of squares does not rise enough up to the bound.
    fn end(
        &self,
        place: usize,
        is_high: bool,
        best: &Best,
        information: &Information,
        tried: &[Tried],
    ) -> Result<Row, Wanted> {
        let only = self.only(place);
        let is_open = information.undetermined().iter().any(|direction| direction[place] != 0.0);
        let error = information.standard_error(&only);
        if is_open || !error.is_finite() || error == 0.0 {
            return Ok(Row::default());
        }
        let parameter = &self.parameters[place];
        let rise = self.measured.factor(self.confidence);
        let sign = if is_high { 1.0 } else { -1.0 };
        let bound = if is_high { parameter.high } else { parameter.low };
        let free: Vec<usize> = (0..self.parameters.len()).filter(|other| *other != place).collect();
        let (mut below, mut above) = ((0.0, 0.0), None::<(f64, f64)>);
        let mut distance = rise * error;
        for trial in 0..TRIALS {
            let mut theta = best.theta.clone();
            theta[place] = parameter.moved(best.theta[place], sign * distance);
            for other in &free {
                let along = information.covariance(&self.only(*other), &only) / (error * error);
                let step = sign * distance * along;
                theta[*other] = self.parameters[*other].moved(best.theta[*other], step);
            }
            let objective = self.objective(&theta, &best.factors, &free, tried);
            let row = objective.row(COARSE)?;
            let sum = row.sum.unwrap_or(f64::NAN);
            let risen = (sum - best.sum).max(0.0).sqrt();
            let is_near = (risen / rise - 1.0).abs() < SAME_RISE;
            if is_near || trial + 1 == TRIALS {
                return Ok(row);
            }
            // If predictions are missing there, the sum is not a number: the end is nearer.
            if risen < rise && sum.is_finite() {
                if (theta[place] - bound).abs() <= f64::EPSILON * bound.abs() {
                    return Ok(Row::default());
                }
                below = (distance, risen);
            } else {
                above = Some((distance, risen.min(10.0 * rise)));
            }
            distance = match above {
                Some(above) => {
                    let share = ((rise - below.1) / (above.1 - below.1)).clamp(0.1, 0.9);
                    below.0 + share * (above.0 - below.0)
                }
                None => distance * (rise / risen.max(0.3 * rise)).clamp(1.05, 3.0),
            };
        }
        Ok(Row::default())
    }

    /// The values of the run that a point needs next.
    pub fn wanted(&self, number: usize, earlier: &Rows, tried: &[Tried]) -> Option<Vec<f64>> {
        self.computed(number, earlier, tried).err()
    }

    /// The row of a point.
    pub fn row_of(
        &self,
        problem: &Problem,
        number: usize,
        earlier: &Rows,
        tried: &[Tried],
    ) -> Tried {
        let Row { theta, sum, error, numbers, lack } =
            self.computed(number, earlier, tried).unwrap_or_default();
        let known = |numbers: Option<Vec<f64>>, count: usize| {
            let known = numbers.map(|numbers| numbers.into_iter().map(Some).collect());
            known.unwrap_or_else(|| vec![None; count])
        };
        let mut outputs: Vec<Option<f64>> = known(theta, self.parameters.len());
        outputs.extend([sum, Some(tried.len() as f64), error]);
        outputs.extend(known(numbers, self.positions.len()));
        let finite = outputs.into_iter().map(|it| it.filter(|it| it.is_finite()));
        let mut found = problem.no_run();
        found.outputs = finite.collect();
        found.lack = lack.map(Lack::Incomplete);
        Tried { values: Vec::new(), found }
    }
}
