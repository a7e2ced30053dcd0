//! What follows from the rows of a fit: estimates with intervals, what the data cannot tell, and whether one set of
//! parameters describes them.

use std::collections::BTreeMap;

use fretwork_engine::numeric::twelve_digits;
use serde_json::{Value, json};

use super::model::Set;
use super::search::{Best, Fit, Task, end};
use crate::member::Member;
use crate::plan::{Cells, Findings};
use crate::problem::Problem;
use crate::rows::Rows;
use crate::stats::fisher;
use crate::stats::measured::{Direction, Information, Point};
use crate::stats::origin::Line;

/// A deviation with a smaller probability than this is told.
const IMPROBABLE: f64 = 0.01;
/// Estimated noise above this share of the numbers is told.
const WIDE_SCATTER: f64 = 0.3;
/// Exponents of a combination nearer to 1 than this count as 1.
const ABOUT_ONE: f64 = 0.15;
/// Denominator degrees of freedom that stand for known noise.
const MANY: f64 = 1e7;
/// A parameter whose coordinate is nearer to 0 or 1 than this is at a bound.
const AT_BOUND: f64 = 2e-3;

/// The columns of numbers in the tables of measured numbers and bands, and their units.
pub const COLUMNS: [(&str, &str); 9] = [
    ("x", "SI"),
    ("measured", "SI"),
    ("predicted", "SI"),
    ("deviation", "SI"),
    ("residual", "1"),
    ("confidence_low", "SI"),
    ("confidence_high", "SI"),
    ("prediction_low", "SI"),
    ("prediction_high", "SI"),
];

/// A table of named columns.
type Table = Vec<(String, Cells)>;

/// The findings. If no start led to a minimum, they are only a note and the measured numbers.
pub fn findings(fit: &Fit, problem: &Problem, rows: &Rows) -> Findings {
    let [measured, grid] = [false, true].map(|is_grid| {
        let is_own = |place: &usize| {
            let position = fit.positions[*place];
            is_grid == (position.entry >= fit.sets[position.set].noise.len())
        };
        (0..fit.positions.len()).filter(is_own).collect::<Vec<_>>()
    });
    let Some(best) = fit.best(rows) else {
        let detail =
            "No start leads to numbers for all measured points. See `reason` in `searches`.";
        let notes = json!([{"kind": "no_minimum", "detail": detail}]);
        let tables = vec![("table", table(fit, &measured, |_| [None; 7]))];
        return Findings { tables, others: vec![("notes", notes)], ..Findings::default() };
    };
    let [alone, information] = fit.information(rows, &best);
    let told = Told { fit, rows, best: &best, alone, information };
    let parameters: Vec<Value> = (0..fit.parameters.len()).map(|it| told.parameter(it)).collect();
    let others = vec![
        ("notes", told.notes(&parameters)),
        ("parameters", parameters.into()),
        ("correlation", told.correlation()),
        ("quality", told.quality()),
        ("lines", told.lines()),
        ("estimated_scenario", told.scenario(problem)),
    ];
    let bands = told.bands();
    let [starts, without, profiles] = [
        told.searches("start", |task| match task {
            Task::Start(start) => Some(start.to_string()),
            _ => None,
        }),
        told.searches("test", |task| match task {
            Task::Without(test) => Some(fit.tests[test].clone()),
            _ => None,
        }),
        told.searches("parameter", |task| match task {
            Task::Minimum => Some("minimum".to_owned()),
            Task::Profile { parameter, .. } => Some(fit.parameters[parameter].column()),
            _ => None,
        }),
    ];
    let tables = vec![
        ("table", table(fit, &measured, |place| bands[place])),
        ("bands", table(fit, &grid, |place| bands[place])),
        ("starts", starts),
        ("without", without),
        ("profiles_of_sum", profiles),
    ];
    Findings { tables, others, ..Findings::default() }
}

/// A number as JSON.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(twelve_digits(x)) } else { Value::Null }
}

/// The measured numbers at these positions, and the columns from the prediction on.
fn table(fit: &Fit, places: &[usize], of: impl Fn(usize) -> [Option<f64>; 7]) -> Table {
    let texts = |of: &dyn Fn(&Set) -> String| {
        Cells::Texts(places.iter().map(|place| of(fit.set(*place))).collect())
    };
    let numbers = |column: usize| {
        let cell = |place: &usize| {
            let (set, entry) = (fit.set(*place), fit.positions[*place].entry);
            [Some(set.x[entry]), set.y[entry]].into_iter().chain(of(*place)).nth(column).flatten()
        };
        Cells::Numbers(places.iter().map(cell).collect())
    };
    let texts = [
        ("test", texts(&|set| fit.tests[set.test].clone())),
        ("output", texts(&|set| set.output.clone())),
        ("unit", texts(&|set| set.unit.to_owned())),
        ("over", texts(&|set| set.over().to_owned())),
    ];
    let numbers = COLUMNS.iter().enumerate().map(|(place, (name, _))| (*name, numbers(place)));
    texts.into_iter().chain(numbers).map(|(name, cells)| (name.to_owned(), cells)).collect()
}

/// What is told about the best parameters.
struct Told<'a> {
    fit: &'a Fit,
    rows: &'a Rows,
    best: &'a Best,
    /// What the data say without the priors, and with them.
    alone: Information,
    information: Information,
}

impl Told<'_> {
    /// For each position: the prediction, its deviation, the residual, and the bands.
    fn bands(&self) -> Vec<[Option<f64>; 7]> {
        let Best { predicted, measured, .. } = self.best;
        let factor = measured.factor(self.fit.confidence);
        let derivatives = self.fit.derivatives(self.rows);
        let bands = predicted.iter().enumerate().map(|(place, y)| {
            let slopes: Vec<f64> = derivatives.iter().map(|column| column[place]).collect();
            let deviation = self.deviation(place);
            let confidence = factor * self.information.standard_error(&slopes);
            let prediction = libm::hypot(confidence, factor * deviation);
            let residual = (measured.points[place].value - y) / deviation;
            let bands = [y - confidence, y + confidence, y - prediction, y + prediction];
            let [a, b, c, d] = bands;
            [*y, deviation, residual, a, b, c, d].map(|it| Some(it).filter(|it| it.is_finite()))
        });
        bands.collect()
    }

    /// The standard deviation of a number. One that was not measured has the mean relative deviation of its set.
    fn deviation(&self, place: usize) -> f64 {
        let Best { predicted, factors, measured, .. } = self.best;
        if measured.points[place].weight > 0.0 {
            return measured.points[place].deviation(factors);
        }
        let own = |it: usize| self.fit.positions[it].set == self.fit.positions[place].set;
        let share = |(it, point): (usize, &Point)| point.deviation(factors) / predicted[it].abs();
        let shares: Vec<f64> = measured.taking_part().filter(|it| own(it.0)).map(share).collect();
        shares.iter().sum::<f64>() / shares.len() as f64 * predicted[place].abs()
    }

    /// The parameters and the sum of squares of all points that have a name and a row.
    fn searches(&self, title: &str, name: impl Fn(Task) -> Option<String>) -> Table {
        let (fit, count) = (self.fit, self.fit.parameters.len());
        let sums = self.rows.numbers(count);
        let mut own = fit.points_of(|task| name(task).is_some());
        own.retain(|row| sums[*row].is_some());
        let cells = |place: usize| {
            let cells = self.rows.numbers(place);
            Cells::Numbers(own.iter().map(|row| cells[*row]).collect())
        };
        let names = own.iter().filter_map(|row| name(fit.tasks[*row])).collect();
        let names = (title.to_owned(), Cells::Texts(names));
        let parameters = fit.parameters.iter().enumerate();
        let parameters = parameters.map(|(place, it)| (it.column(), cells(place)));
        [names]
            .into_iter()
            .chain(parameters)
            .chain([("sum_of_squares".to_owned(), cells(count))])
            .collect()
    }

    fn parameter(&self, place: usize) -> Value {
        let (parameter, x) = (&self.fit.parameters[place], self.best.theta[place]);
        let error = self.information.standard_error(&self.fit.only(place)) * parameter.scale(x);
        let is_open = self.information.is_open(place);
        let known = |value: f64| if is_open { Value::Null } else { number(value) };
        let (u, rise) = (parameter.coordinate(x), self.best.measured.factor(self.fit.confidence));
        let interval = [(false, -1.0), (true, 1.0)].map(|(is_high, sign)| {
            let task = Task::Profile { parameter: place, is_high };
            let distance = end(&self.fit.profile(self.rows, self.best, task), rise);
            let at = distance.map(|distance| u + sign * distance);
            at.filter(|u| (0.0..=1.0).contains(u)).map(|u| twelve_digits(parameter.value(u)))
        });
        let mut told = json!({
            "pointer": parameter.pointer, "unit": parameter.unit,
            "estimate": known(x), "standard_error": known(error), "interval": interval,
            "at_bound": !(AT_BOUND..=1.0 - AT_BOUND).contains(&u),
        });
        if !parameter.only.is_empty() {
            told["for"] = json!(parameter.only);
        }
        told
    }

    fn correlation(&self) -> Value {
        let count = self.fit.parameters.len();
        let cell = |one: usize, other: usize| match self.information.is_open(one)
            || self.information.is_open(other)
        {
            true => Value::Null,
            false => number(self.information.correlation(one, other)),
        };
        (0..count).map(|one| (0..count).map(|other| cell(one, other)).collect::<Value>()).collect()
    }

    /// What the data cannot tell.
    fn in_words(&self, direction: &Direction) -> String {
        let parts = self.fit.parameters.iter().zip(direction).filter(|(_, part)| **part != 0.0);
        let parts: Vec<(String, f64)> = parts.map(|(it, part)| (it.name(), *part)).collect();
        match &parts[..] {
            [(name, _)] => {
                let place = direction.iter().take_while(|part| **part == 0.0).count();
                let stopped = self.fit.sources.iter().any(|source| source.is_rescaled_by(place));
                let reason = if stopped { ": wear has stopped" } else { "" };
                format!("`{name}` has almost no effect on these data{reason}.")
            }
            [(one, first), (other, second)] => {
                // The product of powers that does not change along the direction.
                let power = -first / second;
                let sign = if power < 0.0 { "/" } else { "·" };
                let is_one = (power.abs() - 1.0).abs() < ABOUT_ONE;
                let power = if is_one { String::new() } else { format!("^{:.2}", power.abs()) };
                format!("These data determine only `{one}{sign}{other}{power}`.")
            }
            _ => {
                let names: Vec<_> = parts.iter().map(|(name, _)| format!("`{name}`")).collect();
                let shares: Vec<_> = parts.iter().map(|(_, part)| format!("{part:.2}")).collect();
                format!(
                    "Relative changes of {} in the proportion {} have almost no effect together.",
                    names.join(", "),
                    shares.join(" : ")
                )
            }
        }
    }

    /// Remarks, the most important one first.
    fn notes(&self, parameters: &[Value]) -> Value {
        let Best { measured, sum, .. } = self.best;
        let mut notes: Vec<(&str, String)> = Vec::new();
        notes.extend(self.discrepancy().map(|detail| ("discrepancy", detail)));
        let open = &self.information.undetermined;
        notes.extend(open.iter().map(|it| ("undetermined", self.in_words(it))));
        let known = self.alone.undetermined.iter().filter(|_| open.is_empty());
        let prior = |it| ("prior", format!("{} The rest follows from priors.", self.in_words(it)));
        notes.extend(known.map(prior));
        for (parameter, told) in self.fit.parameters.iter().zip(parameters) {
            let (name, low, high) = (parameter.name(), parameter.low, parameter.high);
            let (kind, what) = match (&told["interval"][0], &told["interval"][1]) {
                _ if told["estimate"].is_null() => continue,
                (Value::Null, _) | (_, Value::Null) => ("open_interval", "The interval of"),
                _ if told["at_bound"] == true => ("at_bound", "The estimate of"),
                _ => continue,
            };
            let kind = if told["at_bound"] == true { "at_bound" } else { kind };
            notes.push((
                kind,
                format!("{what} `{name}` reaches an end of its range from {low:e} to {high:e}."),
            ));
        }
        notes.extend(self.misfit().map(|detail| ("misfit", detail)));
        let lack = self.lack_of_fit().filter(|(_, probability)| *probability < IMPROBABLE);
        notes.extend(lack.map(|(statistic, probability)| ("lack_of_fit", format!(
            "The fit is worse than repeated tests allow (F = {statistic:.1}, probability {probability:.1e})."
        ))));
        let (points, count) = (measured.taking_part().count(), measured.count(None));
        if !measured.is_clustered {
            let detail = "There are not more specimens than parameters, so each point counts as independent. The \
                          intervals do not contain the scatter between specimens.";
            notes.push(("clusters", detail.to_owned()));
        } else if count < points as f64 - 0.5 {
            let detail = "The points of one specimen or profile count as one";
            notes.push(("clusters", format!("{detail}: {points} points count as {count:.0}.")));
        }
        let sums = self.rows.numbers(self.fit.parameters.len());
        if sums[self.fit.first[3]..].iter().flatten().any(|other| *other < sum - 1.0) {
            let detail =
                "A search for an interval has found a smaller sum of squares. Enter more `starts`.";
            notes.push(("other_minimum", detail.to_owned()));
        }
        notes.iter().map(|(kind, detail)| json!({"kind": kind, "detail": detail})).collect()
    }

    /// Whether the residuals are larger than the stated noise, or the estimated noise is large.
    fn misfit(&self) -> Option<String> {
        let Best { measured, sum, factors, .. } = self.best;
        let freedom = (measured.count(None) - self.fit.parameters.len() as f64).floor();
        if measured.freedom().is_none() && freedom >= 1.0 {
            let ratio = sum / freedom;
            let probability = fisher::above(ratio, (freedom, MANY));
            return (probability < IMPROBABLE).then(|| {
                format!(
                    "One set of parameters does not describe these tests within their stated errors: the residuals are \
                     {:.1} times as large (probability {probability:.1e}).",
                    ratio.sqrt()
                )
            });
        }
        let share = |noise: usize| {
            let own = measured.taking_part().filter(|(_, point)| point.set == noise);
            let add = |sum: (f64, f64), (_, point): (usize, &Point)| {
                let deviation = point.deviation(factors);
                (sum.0 + deviation * deviation, sum.1 + point.value * point.value)
            };
            let (noise, size) = own.fold((0.0, 0.0), add);
            (noise / size).sqrt()
        };
        let noises = self.fit.noises.iter().enumerate();
        let mut shares =
            noises.filter_map(|(place, output)| Some((output.as_ref()?, share(place))));
        let (output, share) = shares.find(|(_, share)| *share > WIDE_SCATTER)?;
        Some(format!(
            "`{output}` scatters by {:.0} % around the fit. One set of parameters may not describe these tests.",
            100.0 * share
        ))
    }

    /// The test of lack of fit, if points were repeated: F and its probability.
    fn lack_of_fit(&self) -> Option<(f64, f64)> {
        let (fit, Best { measured, sum, factors, .. }) = (self.fit, self.best);
        let mut groups = BTreeMap::<String, Vec<(f64, f64)>>::new();
        for (place, point) in measured.taking_part() {
            let (position, set) = (&fit.positions[place], fit.set(place));
            let source = &fit.sources[position.source];
            let mut base = source.problem.base.clone();
            base["cycles"] = json!([set.output, set.x[position.entry], source.parameters]);
            let group = groups.entry(base.to_string()).or_default();
            group.push((point.value, point.deviation(factors)));
        }
        let spread = |group: &Vec<(f64, f64)>| {
            let mean = group.iter().map(|(y, _)| y).sum::<f64>() / group.len() as f64;
            group.iter().map(|(y, s)| (y - mean) * (y - mean) / (s * s)).sum::<f64>()
        };
        let pure: f64 = groups.values().map(spread).sum();
        let points = measured.taking_part().count();
        let repeats = (points - groups.len()) as f64;
        let freedom = groups.len() as f64 - fit.parameters.len() as f64;
        let is_clustered = (measured.count(None) - points as f64).abs() > 0.5;
        if is_clustered || freedom < 1.0 || repeats < 1.0 {
            return None;
        }
        let statistic = (sum - pure).max(0.0) / freedom / (pure / repeats);
        Some((statistic, fisher::above(statistic, (freedom, repeats))))
    }

    /// The coefficient from volumes alone and from depths alone, if their intervals do not overlap.
    fn discrepancy(&self) -> Option<String> {
        let (fit, Best { measured, factors, .. }) = (self.fit, self.best);
        let place = fit.coefficient?;
        let (column, cells) = (&fit.derivatives(self.rows)[place], self.rows.numbers(place));
        let interval = |are_depths: bool| {
            let own = measured.taking_part();
            let own = own.filter(|(it, _)| fit.set(*it).are_depths() == Some(are_depths));
            let effect = own.map(|(it, point)| column[it] * point.slope(factors));
            let square: f64 = effect.map(|effect| effect * effect).sum();
            let half = measured.factor(fit.confidence) / square.sqrt();
            let row = fit.points_of(|task| task == Task::Only { are_depths });
            let x = cells[*row.first()?]?;
            Some([0.0, -half, half].map(|half| x * libm::exp(half)))
        };
        let ([v, v_low, v_high], [d, d_low, d_high]) = (interval(false)?, interval(true)?);
        (v_low > d_high || d_low > v_high).then(|| {
            format!(
                "One coefficient does not describe these tests: `{}` is {v:.2e} ({v_low:.2e} to {v_high:.2e}) from \
                 volumes alone, and {d:.2e} ({d_low:.2e} to {d_high:.2e}) from depths alone.",
                fit.parameters[place].name()
            )
        })
    }

    fn quality(&self) -> Value {
        let (fit, Best { measured, predicted, .. }) = (self.fit, self.best);
        let noise = fit.noises.iter().zip(&self.best.factors);
        let noise = noise.filter_map(|(output, factor)| {
            Some(json!({"output": output.as_ref()?, "factor": number(*factor)}))
        });
        let lack = self.lack_of_fit().map(|(statistic, probability)| {
            json!({"statistic": number(statistic), "probability": number(probability)})
        });
        json!({
            "sum_of_squares": number(self.best.sum),
            "effective_points": number(measured.count(None)),
            "degrees_of_freedom": measured.freedom(),
            "aicc": measured.aicc(predicted, fit.parameters.len()).map(twelve_digits),
            "lack_of_fit": lack,
            "noise": noise.collect::<Value>(),
            "runs": self.rows.numbers(fit.parameters.len() + 1).iter().flatten().sum::<f64>(),
        })
    }

    /// Lines through the origin for wear volumes over measured energies, without and with weights.
    fn lines(&self) -> Value {
        let (fit, Best { measured, factors, .. }) = (self.fit, self.best);
        let own = measured.taking_part().filter(|(place, _)| fit.set(*place).is_over_energy());
        let point = |(place, point): (usize, &Point)| {
            let deviation = point.deviation(factors);
            (
                fit.set(place).x[fit.positions[place].entry],
                point.value,
                1.0 / (deviation * deviation),
            )
        };
        let weighted: Vec<_> = own.map(point).collect();
        let equal = weighted.iter().map(|(x, y, _)| (*x, *y, 1.0)).collect();
        let line = |(weights, points): (&str, Vec<_>)| {
            let Line { slope, standard_error, interval, r_squared } =
                Line::through(&points, fit.confidence)?;
            Some(json!({
                "weights": weights, "energy_coefficient": number(slope), "standard_error": number(standard_error),
                "interval": interval.map(number), "r_squared": number(r_squared),
            }))
        };
        [("equal", equal), ("noise", weighted)].into_iter().filter_map(line).collect()
    }

    /// The scenario of the fit with the estimates of the parameters that belong to all tests.
    fn scenario(&self, problem: &Problem) -> Value {
        let mut scenario = problem.base.clone();
        if let Some(members) = scenario.as_object_mut() {
            members.remove("profiles_at");
        }
        let estimates = self.fit.parameters.iter().zip(&self.best.theta);
        for (parameter, x) in estimates.filter(|(parameter, _)| parameter.only.is_empty()) {
            if let Ok(member) = Member::find(&problem.base, &parameter.pointer) {
                member.put(&mut scenario, twelve_digits(*x));
            }
        }
        scenario
    }
}
