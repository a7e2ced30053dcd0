//! The points of a fit, in stages. Each point is a sequence of runs, and its row follows from them.
//!
//! | stage | points |
//! |---|---|
//! | starts | the least sum of squares from each start, comparable with those of the other starts |
//! | minimum | the least sum of squares from the best of them, with the noise estimated anew |
//! | derivatives and subsets | the derivatives of all predictions; the minimum without a test, or of some outputs |
//! | profiles, [`TRIALS`] times | on both sides of each parameter, the least sum of squares at one more value of it |
//!
//! The tasks of a stage do not depend on the rows before it.

use crate::plan::WantedRun;
use crate::stats::derivative::{Derivative, SearchPoint, derivatives};
use crate::stats::least_squares::{self, StopCriteria};
use crate::stats::measured::{Information, MeasuredNumbers, Noise};
use crate::{Lack, OrRun, Rows, Tried};

use super::model::{MeasuredQuantity, Parameter, Runs, Set};

/// Relative change of a parameter from which a search takes its differences. Numerical noise is much smaller.
const DIFFERENCE: f64 = 0.04;
/// When searches end: from the starts and in profiles, and elsewhere.
const COARSE: StopCriteria = StopCriteria { decrease: 1e-3, step: 1e-3, steps: 25 };
const FINE: StopCriteria = StopCriteria { decrease: 1e-5, step: 1e-4, steps: 20 };
/// The noise is computed anew at most this often, and until it changes by less than this share.
const ESTIMATES: usize = 30;
const SAME_NOISE: f64 = 0.01;
/// Maximum number of intervals in which a derivative is searched.
const ROUNDS: usize = 2;
/// A derivative whose error is a larger share of it is also taken from a difference.
const UNSURE: f64 = 0.3;
/// Number of values in the profile of a parameter on each side of the estimate.
const TRIALS: usize = 8;
/// With more tests than this, they are not left out one by one.
const MAX_LEAVES: usize = 24;

/// Numbers that are measured, and what they should say about parameters.
#[derive(Debug)]
pub struct Fit {
    pub parameters: Vec<Parameter>,
    pub sets: Vec<Set>,
    /// The set and the entry of all numbers.
    pub positions: Vec<(usize, usize)>,
    /// The outputs whose noise is estimated, for each kind of noise; `None` for stated noise.
    pub noises: Vec<Option<String>>,
    /// The numbers at all positions, without numerical errors.
    pub measured: MeasuredNumbers,
    /// The names of the tests.
    pub tests: Vec<String>,
    /// The parameter that is also estimated from volumes and from depths alone, if there are both.
    pub coefficient: Option<usize>,
    pub starts: Vec<Vec<f64>>,
    pub confidence: f64,
    /// The tasks of all points, with their stages.
    pub tasks: Vec<(usize, Task)>,
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

/// All tasks, for these numbers of starts, parameters and tests.
pub fn tasks(
    starts: u32,
    parameters: usize,
    tests: usize,
    has_subsets: bool,
) -> Vec<(usize, Task)> {
    let starts = (0..starts as usize).map(|start| (0, Task::Start(start)));
    let derivatives = (0..parameters).map(|parameter| (2, Task::Derivative(parameter)));
    let leaves = if (2..=MAX_LEAVES).contains(&tests) { tests } else { 0 };
    let leaves = (0..leaves).map(|test| (2, Task::Without(test)));
    let subsets = [false, true].into_iter().filter(|_| has_subsets);
    let subsets = subsets.map(|are_depths| (2, Task::Only { are_depths }));
    let sides = (0..parameters).flat_map(|it| [(it, false), (it, true)]);
    let sides = sides.map(|(parameter, is_high)| Task::Profile { parameter, is_high });
    let profiles = (3..3 + TRIALS).flat_map(|stage| sides.clone().map(move |side| (stage, side)));
    let first = starts.chain([(1, Task::Minimum)]).chain(derivatives).chain(leaves);
    first.chain(subsets).chain(profiles).collect()
}

/// A row. A missing number is NaN.
#[derive(Debug, Default)]
pub struct FitRow {
    pub theta: Vec<f64>,
    pub sum: f64,
    pub runs: f64,
    /// The error of a column of derivatives, as the root sum of squares of those of residuals. In the row of a start: how many
    /// times as large as those at its beginning the measured volumes are.
    pub error: f64,
    /// A number for each position: the numerical error of a prediction (from a start), a prediction (of the minimum), or
    /// a derivative of a prediction.
    pub numbers: Vec<f64>,
}

impl FitRow {
    /// A row without numbers.
    pub fn missing() -> Self {
        Self { sum: f64::NAN, error: f64::NAN, ..Self::default() }
    }
}

/// What the rows of the first stages say.
#[derive(Debug)]
pub struct Known {
    pub rows: Vec<FitRow>,
    /// The best start.
    pub start: usize,
    /// The numbers with the numerical errors of the runs of the best start.
    pub measured: MeasuredNumbers,
    /// The index of the minimum.
    pub minimum: usize,
    /// The noise and the distances of the measured numbers at the minimum.
    pub noise: Noise,
    pub distances: Vec<f64>,
    /// How many times as wide the loss makes an interval.
    pub spread: f64,
}

/// The predictions and the residuals of some of the measured numbers.
pub struct Search<'a> {
    pub fit: &'a Fit,
    pub tried: &'a [Tried],
    pub measured: &'a MeasuredNumbers,
    pub noise: &'a Noise,
}

impl Search<'_> {
    /// The derivatives of all residuals with respect to the coordinates u of the free parameters, from differences:
    /// central ones if `is_fine`. At a bound, and where predictions are missing on one side, they are one-sided.
    pub fn slopes(
        &self,
        at: &dyn Fn(&[f64]) -> Vec<f64>,
        u: &[f64],
        free: &[usize],
        is_fine: bool,
    ) -> OrRun<Vec<Vec<f64>>> {
        let middle = &self.residuals(&at(u))?;
        let column = |place: usize| {
            let parameter = &self.fit.parameters[free[place]];
            let beside = |step: f64| {
                let mut other = u.to_vec();
                other[place] += step * parameter.step(parameter.value(u[place]));
                other[place] = other[place].clamp(0.0, 1.0);
                let found = self.residuals(&at(&other))?;
                let is_known = found.iter().all(|residual| residual.is_finite());
                let found = Some((other[place], found)).filter(|_| is_known);
                Ok::<_, WantedRun>(found.unwrap_or_else(|| (u[place], middle.clone())))
            };
            let (high, above) = beside(DIFFERENCE)?;
            let is_one_sided = !is_fine && high > u[place];
            let (low, below) = beside(if is_one_sided { 0.0 } else { -DIFFERENCE })?;
            let slopes = above.iter().zip(&below).map(|(one, other)| (one - other) / (high - low));
            Ok(slopes.map(|slope| if slope.is_finite() { slope } else { 0.0 }).collect())
        };
        (0..u.len()).map(column).collect()
    }

    pub fn residuals(&self, theta: &[f64]) -> OrRun<Vec<f64>> {
        let [predicted, _] = self.fit.predicted(theta, self.tried)?;
        Ok(self.measured.residuals(&predicted, self.noise))
    }

    fn sum(&self, theta: &[f64]) -> OrRun<f64> {
        Ok(self.residuals(theta)?.iter().map(|residual| residual * residual).sum())
    }

    /// The row of the minimum near these parameters, of which some are free.
    fn minimum(&self, theta: &[f64], free: &[usize], stop: StopCriteria) -> OrRun<FitRow> {
        let at = |u: &[f64]| {
            let mut theta = theta.to_vec();
            free.iter().zip(u).for_each(|(it, u)| theta[*it] = self.fit.parameters[*it].value(*u));
            theta
        };
        let residuals = |u: &[f64]| self.residuals(&at(u));
        let is_fine = stop.decrease <= FINE.decrease;
        let derivatives = |u: &[f64]| self.slopes(&at, u, free, is_fine);
        let coordinate = |it: &usize| self.fit.parameters[*it].coordinate(theta[*it]);
        let start: Vec<f64> = free.iter().map(coordinate).collect();
        let theta = match start.len() {
            0 => theta.to_vec(),
            _ => at(&least_squares::minimum(&residuals, &derivatives, &start, stop)?),
        };
        Ok(FitRow { sum: self.sum(&theta)?, theta, ..FitRow::default() })
    }

    /// The row of the minimum near these parameters with its noise, which is computed anew until it stays the same.
    fn settled(
        &self,
        theta: &[f64],
        stop: StopCriteria,
        noise: &dyn Fn(&[f64]) -> Noise,
    ) -> OrRun<(FitRow, Noise)> {
        let all: Vec<usize> = (0..theta.len()).collect();
        let (mut theta, mut held) = (theta.to_vec(), self.noise.clone());
        for _ in 0..ESTIMATES {
            theta = Search { noise: &held, ..*self }.minimum(&theta, &all, stop)?.theta;
            let new = noise(&self.fit.predicted(&theta, self.tried)?[0]);
            let ratio = |place: usize| new.deviations[place] / held.deviations[place];
            let mut own = self.measured.taking_part();
            let is_same = own.all(|(place, _)| (ratio(place) - 1.0).abs() < SAME_NOISE);
            held = new;
            if is_same {
                break;
            }
        }
        let sum = Search { noise: &held, ..*self }.sum(&theta)?;
        let [numbers, _] = self.fit.predicted(&theta, self.tried)?;
        Ok((FitRow { theta, sum, numbers, ..FitRow::missing() }, held))
    }
}

impl Fit {
    /// Predictions at all positions for these parameters, from known runs, and their relative numerical errors.
    ///
    /// # Errors
    /// A run is not known.
    fn predicted(&self, theta: &[f64], tried: &[Tried]) -> OrRun<[Vec<f64>; 2]> {
        let run = |(place, set): (usize, &Set)| {
            let values = set.runs.as_ref().and_then(|runs| runs.values(theta));
            let Some(mut values) = values else { return Ok(None) };
            values.insert(0, place as f64);
            tried.iter().find(|tried| tried.values == values).map(Some).ok_or(values)
        };
        let runs: Vec<_> = self.sets.iter().enumerate().map(run).collect::<Result<_, _>>()?;
        let number = |(set, entry): &(usize, usize)| {
            let run = runs[*set].map(|tried| (&tried.values[1..], &tried.found));
            self.sets[*set].predicted(*entry, theta, run).unwrap_or((f64::NAN, f64::NAN))
        };
        let (values, errors) = self.positions.iter().map(number).unzip();
        Ok([values, errors])
    }

    /// The runs of all sets.
    pub fn runs(&self) -> impl Iterator<Item = &Runs> {
        self.sets.iter().filter_map(|set| set.runs.as_ref())
    }

    /// The set of a position.
    pub fn set(&self, position: usize) -> &Set {
        &self.sets[self.positions[position].0]
    }

    /// The place x of a position.
    pub fn x(&self, position: usize) -> f64 {
        self.set(position).x[self.positions[position].1]
    }

    /// What the first rows say, those before the stage of a point. `None` if no start has led to numbers for all measured points.
    pub fn known(&self, rows: &Rows, before: usize) -> Option<Known> {
        let count = self.tasks.iter().filter(|(stage, _)| *stage < before).count();
        let all = self.parameters.len() + 3 + self.positions.len();
        // Who computes a point again has the rows of later stages, too.
        let column = |column| rows.numbers(column).into_iter().take(count).collect();
        self.known_from(&(0..all).map(column).collect::<Vec<_>>())
    }

    /// As [`known`](Self::known), from the columns of the rows.
    pub fn known_from(&self, columns: &[Vec<Option<f64>>]) -> Option<Known> {
        let count = self.parameters.len();
        let row = |row: usize| {
            let mut cells = columns.iter().map(|column| column[row].unwrap_or(f64::NAN));
            let theta = cells.by_ref().take(count).collect();
            let [sum, runs, error] = [(); 3].map(|()| cells.next().unwrap_or(f64::NAN));
            FitRow { theta, sum, runs, error, numbers: cells.collect() }
        };
        let rows: Vec<FitRow> = (0..columns[0].len()).map(row).collect();
        let minimum = self.starts.len();
        let finite = (0..minimum).filter(|start| rows[*start].sum.is_finite());
        let start = finite.min_by(|a, b| rows[*a].sum.total_cmp(&rows[*b].sum))?;
        let mut measured = self.measured.clone();
        for (place, (set, entry)) in self.positions.iter().enumerate() {
            let error = self.sets[*set].size(*entry) * rows[start].numbers[place];
            measured.points[place].numerical = if error.is_finite() { error } else { 0.0 };
        }
        let (mut noise, mut distances, mut spread) = (Noise::default(), Vec::new(), 1.0);
        if let Some(row) = rows.get(minimum) {
            noise = measured.noise(&row.numbers);
            distances = measured.distances(&row.numbers, &noise);
            spread = measured.spread(&noise, &distances);
        }
        Some(Known { rows, start, measured, minimum, noise, distances, spread })
    }

    /// The size of an interval, in standard errors of the sum of squares.
    pub fn rise(&self, known: &Known) -> f64 {
        known.measured.factor(self.confidence) * known.spread
    }

    /// What the data say about the parameters near the best ones: with or without their priors. The parameters are in
    /// units of their [scales](Parameter::scale).
    pub fn information(&self, known: &Known, has_priors: bool) -> Information {
        let is_prior = |place| matches!(self.set(place).quantity, MeasuredQuantity::Prior { .. });
        let measured = known.measured.without(|place| !has_priors && is_prior(place));
        let (derivatives, slopes) = (self.derivatives(known), measured.slopes(&known.noise));
        let columns: Vec<Vec<f64>> = derivatives
            .iter()
            .map(|row| {
                let cells = row.numbers.iter().zip(&slopes);
                let cells = cells.map(|(change, slope)| change * slope);
                cells.map(|cell| if cell.is_finite() { cell } else { 0.0 }).collect()
            })
            .collect();
        let errors: Vec<f64> = derivatives.iter().map(|row| row.error).collect();
        Information::of(&columns, &errors)
    }

    /// The rows with the derivatives of all predictions with respect to each parameter, in units of its scale.
    pub fn derivatives<'a>(&self, known: &'a Known) -> &'a [FitRow] {
        &known.rows[known.minimum + 1..][..self.parameters.len()]
    }

    /// The row of a point from its runs, or the run that it needs next. The inner error says why the row has no numbers.
    pub fn computed(
        &self,
        number: usize,
        earlier: &Rows,
        tried: &[Tried],
    ) -> OrRun<Result<FitRow, String>> {
        let (all, task) = ((0..self.parameters.len()).collect::<Vec<_>>(), self.tasks[number].1);
        if let Task::Start(place) = task {
            // Before a minimum is known, no number counts less.
            let mut measured = self.measured.clone();
            measured.is_robust = false;
            let (measured, noise) = (&measured, &measured.first_noise());
            let search = Search { fit: self, tried, measured, noise };
            if !search.sum(&self.starts[place])?.is_finite() {
                let lacks = tried.iter().filter_map(|tried| tried.found.lack.as_ref());
                let reason = lacks.map(|(Lack::Refused(why) | Lack::Incomplete(why))| why).next();
                return Ok(Err(reason.map_or("a number is missing", String::as_str).to_owned()));
            }
            let of = |predicted: &[f64]| measured.noise_at(predicted);
            let (row, noise) = search.settled(&self.starts[place], COARSE, &of)?;
            let [_, numbers] = self.predicted(&row.theta, tried)?;
            let error = self.times(&self.predicted(&self.starts[place], tried)?[0]);
            let sum = row.sum * measured.likeness(&noise);
            return Ok(Ok(FitRow { sum, error, numbers, ..row }));
        }
        let Some(known) = self.known(earlier, self.tasks[number].0) else {
            return Ok(Err("no start leads to numbers for all measured points".to_owned()));
        };
        let Known { measured, noise, .. } = &known;
        let search = Search { fit: self, tried, measured, noise };
        let of_part = |part: MeasuredNumbers, free: &[usize]| {
            if free.is_empty() || part.count(None) + 1e-9 < free.len() as f64 {
                return Ok(FitRow::missing());
            }
            let best = &known.rows[known.minimum].theta;
            Search { measured: &part, ..search }.minimum(best, free, FINE)
        };
        let row = match task {
            Task::Start(_) | Task::Minimum => {
                let (theta, of) = (&known.rows[known.start].theta, |it: &[f64]| measured.noise(it));
                let noise = &of(&self.predicted(theta, tried)?[0]);
                Search { noise, ..search }.settled(theta, FINE, &of).map(|(row, _)| row)
            }
            Task::Derivative(parameter) => self.derivative(parameter, &known, tried),
            Task::Without(test) => of_part(measured.without(|it| self.set(it).test == test), &all),
            Task::Only { are_depths } => {
                let is_other = |place| self.set(place).are_depths() != Some(are_depths);
                of_part(measured.without(is_other), self.coefficient.as_slice())
            }
            Task::Profile { parameter, is_high } => {
                let next = self.side(&known, parameter, is_high).next();
                let free: Vec<_> = all.into_iter().filter(|it| *it != parameter).collect();
                let of = |theta: Vec<f64>| search.minimum(&theta, &free, COARSE);
                next.map_or_else(|| Ok(FitRow::missing()), of)
            }
        };
        row.map(Ok)
    }

    /// How many times as large as these predictions the measured volumes and masses are: the median.
    fn times(&self, predicted: &[f64]) -> f64 {
        let own = self.measured.taking_part();
        let own = own.filter(|(place, _)| self.set(*place).are_depths() == Some(false));
        let mut times: Vec<f64> = own.map(|(place, it)| it.value / predicted[place]).collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// The derivatives of all predictions.
    fn derivative(&self, place: usize, known: &Known, tried: &[Tried]) -> OrRun<FitRow> {
        let (parameter, best) = (&self.parameters[place], &known.rows[known.minimum]);
        let x = best.theta[place];
        let scale = parameter.scale(x);
        let errors = known.rows[known.start].numbers.iter();
        let errors: Vec<f64> = errors.map(|it| if *it < 1.0 { *it } else { 0.0 }).collect();
        let at = SearchPoint { x, scale, low: parameter.low, high: parameter.high };
        let predicted = |x: f64| {
            let mut theta = best.theta.clone();
            theta[place] = x;
            self.predicted(&theta, tried).map(|[values, _]| values)
        };
        let values = |x: f64| Ok::<_, WantedRun>(predicted(x)?.into_iter().map(Some).collect());
        let mut found = derivatives(at, &errors, ROUNDS, values)?;
        let slopes = known.measured.slopes(&known.noise);
        let size = |found: &[Option<Derivative>], part: fn(&Derivative) -> f64| {
            let parts = found.iter().zip(&slopes);
            let parts =
                parts.filter_map(|(found, slope)| Some(part(found.as_ref()?) * scale * slope));
            parts.map(|part| part * part).sum::<f64>().sqrt()
        };
        if size(&found, |it| it.error) > UNSURE * size(&found, |it| it.value) {
            // Near a kink, such as the onset of gross slip, the slope over some percent tells more.
            let [low, high] = [-DIFFERENCE, DIFFERENCE]
                .map(|step| (x + step * scale).clamp(parameter.low, parameter.high));
            let (below, above) = (predicted(low)?, predicted(high)?);
            for (place, found) in found.iter_mut().enumerate() {
                let value = (above[place] - below[place]) / (high - low);
                let error = 2.0 * errors[place] * above[place].abs() / (high - low);
                if value.is_finite() && found.is_none_or(|it| it.error > error) {
                    *found = Some(Derivative { value, error });
                }
            }
        }
        let error = size(&found, |it| it.error);
        let numbers = found.iter().map(|it| it.map_or(f64::NAN, |it| it.value * scale)).collect();
        Ok(FitRow { theta: best.theta.clone(), error, numbers, ..FitRow::missing() })
    }
}
