//! What follows from the rows of a fit: estimates with intervals, what the data cannot tell, and whether one set of
//! parameters describes them.

use fretwork_engine::numeric::twelve_digits;
use serde_json::{Map, Value, json};

use super::model::Place;
use super::search::{AT_BOUND, Best, Fit};
use crate::member::Member;
use crate::plan::{Cells, Column, Findings};
use crate::problem::Problem;
use crate::rows::Rows;
use crate::stats::fisher;
use crate::stats::measured::{Direction, Information};
use crate::stats::origin::Line;

/// A difference between stated noise and scatter, or between tests and a model, with a smaller probability than this is
/// told.
const IMPROBABLE: f64 = 0.01;
/// Estimated noise above this share of the numbers is told.
const WIDE_SCATTER: f64 = 0.3;
/// Exponents of a combination nearer to 1 than this count as 1.
const ABOUT_ONE: f64 = 0.15;
/// Denominator degrees of freedom that stand for known noise.
const MANY: f64 = 1e7;

/// A set of measured numbers.
#[derive(Debug)]
pub struct Set {
    /// The name of its test.
    pub name: String,
    pub output: String,
    /// What x is, and the unit of the numbers.
    pub over: &'static str,
    pub unit: &'static str,
    pub x: Vec<f64>,
    pub is_estimated: bool,
}

impl Set {
    /// The name of the column of a number among the searches. `first` is the index of the first number of the set.
    pub fn column(&self, first: usize, place: usize) -> String {
        format!("{}.{}@{} #{}", self.name, self.output, self.x[place], first + place + 1)
    }
}

/// The columns of numbers in the tables that are not parameters.
pub fn columns() -> Vec<Column> {
    vec![Column::new("residual", "1")]
}

/// The findings. If no start led to a minimum, there are only notes.
pub fn findings(fit: &Fit, problem: &Problem, rows: &Rows) -> Findings {
    let Some(best) = fit.best(rows) else {
        let detail = "No start leads to numbers for all measured points. The column `reason` of `searches` says why.";
        let notes = json!([{"kind": "no_minimum", "detail": detail}]);
        let table = table(fit, None, None);
        return Findings {
            tables: vec![("table", table)],
            others: vec![("notes", notes)],
            ..Findings::default()
        };
    };
    let [alone, information] = fit.information(rows, &best);
    let told = Told { fit, rows, best: &best, alone: &alone, information: &information };
    let (parameters, combinations) = (told.parameters(), told.combinations());
    let notes = told.notes(&parameters);
    let mut others = vec![
        ("parameters", Value::Array(parameters)),
        ("combinations", combinations),
        ("correlation", told.correlation()),
        ("quality", told.quality()),
        ("notes", notes),
        ("estimated_scenario", told.scenario(problem)),
    ];
    if let Some(lines) = told.lines() {
        others.push(("lines", lines));
    }
    let mut tables = vec![("table", table(fit, Some(&best), Some((&information, rows))))];
    let [_, _, checks, ends, _] = fit.bounds();
    let leaves = checks + fit.parameters.len()..ends - fit.subsets.len();
    if !leaves.is_empty() {
        tables.push(("without", told.without(leaves)));
    }
    Findings { tables, others, ..Findings::default() }
}

/// A number as JSON.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(twelve_digits(x)) } else { Value::Null }
}

/// The measured and the predicted numbers, with bands.
fn table(
    fit: &Fit,
    best: Option<&Best>,
    information: Option<(&Information, &Rows)>,
) -> Vec<(String, Cells)> {
    let all = || fit.sets.iter().flat_map(|set| (0..set.x.len()).map(move |place| (set, place)));
    let texts = |of: &dyn Fn(&Set) -> &str| {
        Cells::Texts(all().map(|(set, _)| of(set).to_owned()).collect())
    };
    let points = &fit.measured.points;
    let mut columns = vec![
        ("test".to_owned(), texts(&|set| &set.name)),
        ("output".to_owned(), texts(&|set| &set.output)),
        ("unit".to_owned(), texts(&|set| set.unit)),
        ("over".to_owned(), texts(&|set| set.over)),
    ];
    let mut add = |name: &str, of: &dyn Fn(usize) -> f64| {
        let cells = (0..points.len()).map(|place| Some(of(place)).filter(|it| it.is_finite()));
        columns.push((name.to_owned(), Cells::Numbers(cells.collect())));
    };
    let x: Vec<f64> = all().map(|(set, place)| set.x[place]).collect();
    add("x", &|place| x[place]);
    add("measured", &|place| points[place].value);
    let Some((best, (information, rows))) = best.zip(information) else { return columns };
    let predicted = |place: usize| best.predicted[place];
    let deviation = |place: usize| {
        if fit.measured.has(place) {
            return fit.measured.deviation(place, &best.factors);
        }
        // A number that was not measured has the mean relative noise of its set.
        let set = points[place].set;
        let own = (0..points.len()).filter(|it| points[*it].set == set && fit.measured.has(*it));
        let shares =
            own.map(|it| fit.measured.deviation(it, &best.factors) / best.predicted[it].abs());
        let (sum, count) =
            shares.fold((0.0, 0.0), |(sum, count), share| (sum + share, count + 1.0));
        sum / count * predicted(place).abs()
    };
    add("deviation", &deviation);
    add("predicted", &predicted);
    add("residual", &|place| (points[place].value - predicted(place)) / deviation(place));
    let derivatives = fit.derivatives(rows);
    let factor = fit.measured.factor(fit.confidence);
    let error = |place: usize| {
        let slopes: Vec<f64> = derivatives.iter().map(|column| column[place]).collect();
        information.standard_error(&slopes)
    };
    for (name, sign, is_single) in [
        ("confidence_low", -1.0, false),
        ("confidence_high", 1.0, false),
        ("prediction_low", -1.0, true),
        ("prediction_high", 1.0, true),
    ] {
        add(name, &|place| {
            let own = if is_single { deviation(place) } else { 0.0 };
            predicted(place) + sign * factor * libm::hypot(error(place), own)
        });
    }
    columns
}

/// What is told about the best parameters.
struct Told<'a> {
    fit: &'a Fit,
    rows: &'a Rows,
    best: &'a Best,
    alone: &'a Information,
    information: &'a Information,
}

impl Told<'_> {
    fn only(&self, place: usize) -> Vec<f64> {
        (0..self.fit.parameters.len()).map(|other| f64::from(other == place)).collect()
    }

    /// The standard error of a parameter, in units of its scale.
    fn error(&self, place: usize) -> f64 {
        self.information.standard_error(&self.only(place))
    }

    fn is_undetermined(&self, place: usize) -> bool {
        self.information.undetermined().iter().any(|direction| direction[place] != 0.0)
    }

    fn parameters(&self) -> Vec<Value> {
        let ends = self.fit.bounds()[3];
        let of = |(place, parameter): (usize, &super::model::Parameter)| {
            let x = self.best.theta[place];
            let cells = self.rows.numbers(place);
            let end = |is_high: usize| cells[ends + 2 * place + is_high];
            let u = parameter.coordinate(x);
            let mut told = Map::new();
            told.insert("pointer".to_owned(), json!(parameter.pointer));
            if !parameter.only.is_empty() {
                told.insert("for".to_owned(), json!(parameter.only));
            }
            let is_undetermined = self.is_undetermined(place);
            let known = |value: f64| if is_undetermined { Value::Null } else { number(value) };
            told.insert("unit".to_owned(), json!(parameter.unit));
            told.insert("estimate".to_owned(), known(x));
            told.insert("standard_error".to_owned(), known(parameter.scale(x) * self.error(place)));
            told.insert("interval".to_owned(), json!([end(0), end(1)]));
            told.insert("at_bound".to_owned(), json!(!(AT_BOUND..=1.0 - AT_BOUND).contains(&u)));
            Value::Object(told)
        };
        self.fit.parameters.iter().enumerate().map(of).collect()
    }

    fn correlation(&self) -> Value {
        let count = self.fit.parameters.len();
        let cell = |one: usize, other: usize| {
            let is_known = !self.is_undetermined(one) && !self.is_undetermined(other);
            if is_known { number(self.information.correlation(one, other)) } else { Value::Null }
        };
        (0..count).map(|one| (0..count).map(|other| cell(one, other)).collect::<Value>()).collect()
    }

    /// Products of powers of parameters that the data determine, although they do not determine the parameters.
    fn combinations(&self) -> Value {
        let factor = self.fit.measured.factor(self.fit.confidence);
        let of = |direction: &Direction| {
            let exponents = exponents(direction)?;
            let own = self.best.theta.iter().zip(&exponents).filter(|(_, power)| **power != 0.0);
            let logarithm: f64 = own.map(|(x, power)| power * libm::log(*x)).sum();
            let error = self.information.standard_error(&exponents);
            let at = |sign: f64| number(libm::exp(logarithm + sign * factor * error));
            Some(json!({
                "combination": self.product(&exponents),
                "estimate": at(0.0),
                "interval": [at(-1.0), at(1.0)],
            }))
        };
        self.information.undetermined().iter().filter_map(of).collect()
    }

    /// A product of powers of parameters, such as `wear.coefficient/friction`.
    fn product(&self, exponents: &[f64]) -> String {
        let mut text = String::new();
        let own = self.fit.parameters.iter().zip(exponents).filter(|(_, power)| **power != 0.0);
        for (parameter, power) in own {
            let name = parameter.name();
            let sign = if text.is_empty() {
                ""
            } else if *power < 0.0 {
                "/"
            } else {
                "·"
            };
            text.push_str(sign);
            text.push_str(&name);
            if (power.abs() - 1.0).abs() > 1e-9 {
                text.push_str(&format!("^{:.2}", power.abs()));
            }
        }
        text
    }

    fn undetermined_in_words(&self, direction: &Direction) -> String {
        let names = || {
            let own = self.fit.parameters.iter().zip(direction).filter(|(_, part)| **part != 0.0);
            own.map(|(parameter, _)| format!("`{}`", parameter.name())).collect::<Vec<_>>()
        };
        if let Some(exponents) = exponents(direction) {
            return format!("These data determine only `{}`.", self.product(&exponents));
        }
        let names = names();
        if let [name] = &names[..] {
            let place = direction.iter().position(|part| *part != 0.0);
            let sources = self.fit.sources.iter();
            let mut rescaled = sources.map(|source| Some(source.parameters[source.rescaled?]));
            let stopped = if rescaled.any(|it| it.is_some() && it == place) {
                ": wear has stopped"
            } else {
                ""
            };
            return format!(
                "{name} has almost no effect on these data{stopped}. They do not determine it."
            );
        }
        let parts = direction.iter().filter(|part| **part != 0.0).map(|part| format!("{part:.2}"));
        format!(
            "These data do not determine {} apart: relative changes of {} have almost no effect together.",
            names.join(", "),
            parts.collect::<Vec<_>>().join(" : ")
        )
    }

    fn notes(&self, parameters: &[Value]) -> Value {
        let mut notes = Vec::new();
        let mut add =
            |kind: &str, detail: String| notes.push(json!({"kind": kind, "detail": detail}));
        if let Some(detail) = self.discrepancy() {
            add("discrepancy", detail);
        }
        let unresolved = self.information.undetermined();
        for direction in &unresolved {
            add("undetermined", self.undetermined_in_words(direction));
        }
        if unresolved.is_empty() {
            for direction in self.alone.undetermined() {
                let words = self.undetermined_in_words(&direction);
                add("prior", format!("{words} The rest follows from the priors."));
            }
        }
        for (parameter, told) in self.fit.parameters.iter().zip(parameters) {
            let name = parameter.name();
            if told["at_bound"] == true {
                add(
                    "at_bound",
                    format!(
                        "`{name}` is at a bound of its range. Enter a wider range, if it makes sense."
                    ),
                );
            } else if told["estimate"].is_number()
                && told["interval"].as_array().is_some_and(|ends| ends.contains(&Value::Null))
            {
                add(
                    "open_interval",
                    format!(
                        "The interval of `{name}` reaches beyond its range from {} to {}.",
                        parameter.low, parameter.high
                    ),
                );
            }
        }
        if let Some(detail) = self.misfit() {
            add("misfit", detail);
        }
        if let Some((statistic, probability)) =
            self.lack_of_fit().filter(|(_, it)| *it < IMPROBABLE)
        {
            add(
                "lack_of_fit",
                format!(
                    "Repeated tests scatter less than the fit leaves over (F = {statistic:.1}, probability {probability:.2e}): the model does not describe these tests."
                ),
            );
        }
        let points =
            (0..self.fit.positions.len()).filter(|place| self.fit.measured.has(*place)).count();
        let count = self.fit.measured.count(None);
        if !self.fit.measured.is_clustered {
            add("clusters", "There are not more specimens than parameters, so each point counts as independent. The intervals do not contain the scatter between specimens.".to_owned());
        } else if count < points as f64 - 0.5 {
            add(
                "clusters",
                format!(
                    "The points of a specimen or of a profile count as one: {points} points count as {count:.0}."
                ),
            );
        }
        let lower = self.rows.numbers(self.fit.parameters.len());
        let ends = &lower[self.fit.bounds()[3]..];
        if ends.iter().flatten().any(|sum| *sum < self.best.sum - 1.0) {
            add(
                "other_minimum",
                "A search for an interval has found a smaller sum of squares. Enter more `starts`."
                    .to_owned(),
            );
        }
        Value::Array(notes)
    }

    /// Whether the sum of squares is too large for the stated noise, or the estimated noise is large.
    fn misfit(&self) -> Option<String> {
        let measured = &self.fit.measured;
        if measured.freedom().is_none() {
            let freedom = (measured.count(None) - self.fit.parameters.len() as f64).floor();
            let probability = (freedom >= 1.0)
                .then(|| fisher::above(self.best.sum / freedom, (freedom, MANY)))?;
            return (probability < IMPROBABLE).then(|| {
                format!(
                    "One set of parameters does not describe these tests within their stated errors: the residuals are {:.1} times as large (probability {probability:.1e}).",
                    (self.best.sum / freedom).sqrt()
                )
            });
        }
        let share = |(set, first): (&Set, &usize)| {
            let own = (*first..first + set.x.len()).filter(|place| measured.has(*place));
            let squares = own.map(|place| {
                let (s, y) =
                    (measured.deviation(place, &self.best.factors), measured.points[place].value);
                (s * s, y * y)
            });
            let (noise, size) = squares.fold((0.0, 0.0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
            (noise / size).sqrt()
        };
        let mut estimated =
            self.fit.sets.iter().zip(&self.fit.first).filter(|(set, _)| set.is_estimated);
        let wide = estimated
            .find_map(|it| Some((it.0, share(it))).filter(|(_, share)| *share > WIDE_SCATTER));
        let (set, mean) = wide?;
        Some(format!(
            "The points of `{}` in the test {} scatter by {:.0} % around the fit. One set of parameters may not describe these tests.",
            set.output,
            set.name,
            100.0 * mean
        ))
    }

    /// The test of lack of fit, if tests were repeated with other specimens: F and its probability.
    fn lack_of_fit(&self) -> Option<(f64, f64)> {
        let (measured, fit) = (&self.fit.measured, self.fit);
        let places: Vec<usize> = (0..fit.positions.len()).filter(|it| measured.has(*it)).collect();
        if (measured.count(None) - places.len() as f64).abs() > 1e-9 {
            return None;
        }
        let is_same = |one: usize, other: usize| {
            let (one, other) = (&fit.positions[one], &fit.positions[other]);
            let of = |position: &super::model::Position| match position.place {
                Place::History { column, x } => {
                    (fit.sources[position.source].columns[column].clone(), x)
                }
                Place::Profile { .. } => (String::new(), 0.0),
            };
            of(one) == of(other)
                && of(one).1 > 0.0
                && fit.sources[one.source].problem.base == fit.sources[other.source].problem.base
                && fit.sources[one.source].parameters == fit.sources[other.source].parameters
        };
        let (mut groups, mut pure) = (Vec::<Vec<usize>>::new(), 0.0);
        for place in places {
            match groups.iter_mut().find(|group| is_same(group[0], place)) {
                Some(group) => group.push(place),
                None => groups.push(vec![place]),
            }
        }
        let repeats: usize = groups.iter().map(|group| group.len() - 1).sum();
        for group in &groups {
            let mean = group.iter().map(|place| measured.points[*place].value).sum::<f64>()
                / group.len() as f64;
            for place in group {
                let distance = (measured.points[*place].value - mean)
                    / measured.deviation(*place, &self.best.factors);
                pure += distance * distance;
            }
        }
        let freedom = groups.len().checked_sub(fit.parameters.len()).filter(|it| *it > 0)?;
        let (freedom, repeats) = (freedom as f64, repeats as f64);
        let statistic = ((self.best.sum - pure).max(0.0) / freedom) / (pure / repeats);
        statistic.is_finite().then(|| (statistic, fisher::above(statistic, (freedom, repeats))))
    }

    /// The coefficient from volumes alone and from depths alone, if their intervals do not overlap.
    fn discrepancy(&self) -> Option<String> {
        let fit = self.fit;
        let (place, factor) = (fit.coefficient?, fit.measured.factor(fit.confidence));
        let first = fit.bounds()[3] - fit.subsets.len();
        let column = &fit.derivatives(self.rows)[place];
        let slopes = fit.measured.slopes(&self.best.factors);
        let cells = self.rows.numbers(place);
        let intervals = fit.subsets.iter().enumerate().map(|(index, subset)| {
            let x = cells[first + index]?;
            let own = column.iter().zip(&slopes).zip(subset).filter(|(_, takes_part)| **takes_part);
            let square: f64 = own
                .map(|((derivative, slope), _)| (derivative * slope) * (derivative * slope))
                .sum();
            let half = factor / square.sqrt();
            half.is_finite().then(|| (x, x * libm::exp(-half), x * libm::exp(half)))
        });
        let intervals: Vec<(f64, f64, f64)> = intervals.collect::<Option<_>>()?;
        let [volumes, depths] = intervals[..] else { return None };
        (volumes.1 > depths.2 || depths.1 > volumes.2).then(|| {
            format!(
                "One coefficient does not describe these tests: `{}` is {:.3e} from volumes alone ({:.3e} to {:.3e}), and {:.3e} from depths alone ({:.3e} to {:.3e}).",
                fit.parameters[place].name(), volumes.0, volumes.1, volumes.2, depths.0, depths.1, depths.2
            )
        })
    }

    fn quality(&self) -> Value {
        let measured = &self.fit.measured;
        let runs = self.rows.numbers(self.fit.parameters.len() + 1);
        let noise =
            self.fit.sets.iter().zip(&self.best.factors).filter(|(set, _)| set.is_estimated);
        let noise = noise.map(|(set, factor)| json!({"test": set.name, "output": set.output, "factor": number(*factor)}));
        json!({
            "sum_of_squares": number(self.best.sum),
            "effective_points": number(measured.count(None)),
            "degrees_of_freedom": measured.freedom(),
            "aicc": measured.aicc(&self.best.predicted, self.fit.parameters.len()).map(twelve_digits),
            "lack_of_fit": self.lack_of_fit().map(|(statistic, probability)| json!({"statistic": number(statistic), "probability": number(probability)})),
            "estimated_noise": noise.collect::<Vec<_>>(),
            "runs": runs.iter().flatten().sum::<f64>(),
        })
    }

    /// The parameters without each of the tests.
    fn without(&self, points: std::ops::Range<usize>) -> Vec<(String, Cells)> {
        let parameters = self.fit.parameters.iter().enumerate();
        let parameters = parameters.map(|(place, parameter)| {
            (parameter.column(), Cells::Numbers(self.rows.numbers(place)[points.clone()].to_vec()))
        });
        let tests = ("test".to_owned(), Cells::Texts(self.fit.tests.clone()));
        [tests].into_iter().chain(parameters).collect()
    }

    /// Lines through the origin for wear volumes over measured energies: α without and with weights.
    fn lines(&self) -> Option<Value> {
        let (fit, measured) = (self.fit, &self.fit.measured);
        let mut points = Vec::new();
        for (set, first) in fit.sets.iter().zip(&fit.first) {
            if set.output == "wear_volume" && set.over == "dissipated_energy" {
                let own = (0..set.x.len()).filter(|place| measured.has(first + place));
                points.extend(own.map(|place| {
                    (
                        set.x[place],
                        measured.points[first + place].value,
                        measured.deviation(first + place, &self.best.factors),
                    )
                }));
            }
        }
        let line = |weights: &str, weight: fn(f64) -> f64| {
            let points: Vec<_> = points.iter().map(|(x, y, s)| (*x, *y, weight(*s))).collect();
            let Line { slope, standard_error, interval, r_squared } =
                Line::through(&points, fit.confidence)?;
            Some(json!({
                "weights": weights, "energy_coefficient": number(slope), "standard_error": number(standard_error),
                "interval": interval.map(number), "r_squared": number(r_squared),
            }))
        };
        let lines: Vec<Value> = [line("equal", |_| 1.0), line("noise", |s| 1.0 / (s * s))]
            .into_iter()
            .flatten()
            .collect();
        (!lines.is_empty()).then_some(Value::Array(lines))
    }

    /// The scenario of the fit with the estimates of the parameters that belong to all tests.
    fn scenario(&self, problem: &Problem) -> Value {
        let mut scenario = problem.base.clone();
        if let Some(members) = scenario.as_object_mut() {
            members.remove("profiles_at");
        }
        for (parameter, x) in self.fit.parameters.iter().zip(&self.best.theta) {
            if parameter.only.is_empty()
                && let Ok(member) = Member::find(&problem.base, &parameter.pointer)
            {
                member.put(&mut scenario, twelve_digits(*x));
            }
        }
        scenario
    }
}

/// The exponents of the product of two parameters that does not change along a direction. `None` if the direction does
/// not change two parameters.
fn exponents(direction: &Direction) -> Option<Vec<f64>> {
    let places: Vec<usize> =
        (0..direction.len()).filter(|place| direction[*place] != 0.0).collect();
    let [one, other] = places[..] else { return None };
    // The first exponent is positive.
    let ratio = -direction[one] / direction[other];
    let rounded = if (ratio.abs() - 1.0).abs() < ABOUT_ONE { ratio.signum() } else { ratio };
    let mut exponents = vec![0.0; direction.len()];
    exponents[one] = 1.0;
    exponents[other] = rounded;
    Some(exponents)
}
