//! What follows from the rows of a fit: estimates with intervals, what the data cannot tell, and whether one set of
//! parameters describes them.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use fretwork_engine::numeric::twelve_digits;
use serde_json::{Value, json};

use super::model::{Quantity, Set, Source};
use super::search::{AT_BOUND, Best, Fit};
use crate::member::Member;
use crate::plan::{Cells, Findings};
use crate::problem::Problem;
use crate::rows::Rows;
use crate::stats::fisher;
use crate::stats::measured::{Direction, Information};
use crate::stats::origin::Line;

/// A deviation with a smaller probability than this is told.
const IMPROBABLE: f64 = 0.01;
/// Estimated noise above this share of the numbers is told.
const WIDE_SCATTER: f64 = 0.3;
/// Exponents of a combination nearer to 1 than this count as 1.
const ABOUT_ONE: f64 = 0.15;
/// Denominator degrees of freedom that stand for known noise.
const MANY: f64 = 1e7;

/// The columns of numbers in `table`. Each row has numbers in its own SI unit, except the standardised residual.
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
    let Some(best) = fit.best(rows) else {
        let detail =
            "No start leads to numbers for all measured points. See `reason` in `searches`.";
        let notes = json!([{"kind": "no_minimum", "detail": detail}]);
        let tables = vec![("table", measured(fit))];
        return Findings { tables, others: vec![("notes", notes)], ..Findings::default() };
    };
    let [alone, information] = fit.information(rows, &best);
    let open = information.undetermined();
    let told = Told { fit, rows, best: &best, alone, information, open };
    let parameters: Vec<Value> = (0..fit.parameters.len()).map(|it| told.parameter(it)).collect();
    let others = vec![
        ("notes", told.notes(&parameters)),
        ("parameters", parameters.into()),
        ("combinations", told.open.iter().filter_map(|it| told.combination(it)).collect()),
        ("correlation", told.correlation()),
        ("quality", told.quality()),
        ("lines", told.lines()),
        ("estimated_scenario", told.scenario(problem)),
    ];
    let [_, minimum, checks, ends, _] = fit.bounds();
    let searches = |places: std::ops::Range<usize>| -> Table {
        let parameters = fit.parameters.iter().enumerate();
        let cells = |place: usize| Cells::Numbers(rows.numbers(place)[places.clone()].to_vec());
        parameters.map(|(place, parameter)| (parameter.column(), cells(place))).collect()
    };
    let mut starts = searches(0..minimum);
    let sums = rows.numbers(fit.parameters.len())[..minimum].to_vec();
    starts.push(("sum_of_squares".to_owned(), Cells::Numbers(sums)));
    let mut without = searches(checks + fit.parameters.len()..ends - fit.subsets());
    without.push(("test".to_owned(), Cells::Texts(fit.tests[..fit.leaves()].to_vec())));
    let tables = vec![("table", told.table()), ("starts", starts), ("without", without)];
    Findings { tables, others, ..Findings::default() }
}

/// A number as JSON.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(twelve_digits(x)) } else { Value::Null }
}

/// The measured numbers.
fn measured(fit: &Fit) -> Table {
    let texts = |of: &dyn Fn(&Set) -> String| {
        Cells::Texts((0..fit.positions.len()).map(|place| of(fit.set(place))).collect())
    };
    let x = fit.positions.iter().map(|position| Some(fit.sets[position.set].x[position.entry]));
    let y = fit.positions.iter().map(|position| fit.sets[position.set].y[position.entry]);
    let columns = [
        ("test", texts(&|set| fit.tests[set.test].clone())),
        ("output", texts(&|set| set.output.clone())),
        ("unit", texts(&|set| set.unit.to_owned())),
        ("over", texts(&|set| set.over().to_owned())),
        ("x", Cells::Numbers(x.collect())),
        ("measured", Cells::Numbers(y.collect())),
    ];
    columns.into_iter().map(|(name, cells)| (name.to_owned(), cells)).collect()
}

/// What is told about the best parameters.
struct Told<'a> {
    fit: &'a Fit,
    rows: &'a Rows,
    best: &'a Best,
    /// What the data say without the priors, and with them.
    alone: Information,
    information: Information,
    /// The directions that neither data nor priors determine.
    open: Vec<Direction>,
}

impl Told<'_> {
    /// The measured and the predicted numbers, with bands.
    fn table(&self) -> Table {
        let (fit, best) = (self.fit, self.best);
        let factor = fit.measured.factor(fit.confidence);
        let derivatives = fit.derivatives(self.rows);
        let mut columns: [Vec<Option<f64>>; 7] = Default::default();
        for (place, y) in best.predicted.iter().enumerate() {
            let slopes: Vec<f64> = derivatives.iter().map(|column| column[place]).collect();
            let deviation = self.deviation(place);
            let confidence = factor * self.information.standard_error(&slopes);
            let prediction = libm::hypot(confidence, factor * deviation);
            let residual = (fit.measured.points[place].value - y) / deviation;
            let bands = [y - confidence, y + confidence, y - prediction, y + prediction];
            let cells = [*y, deviation, residual].into_iter().chain(bands);
            for (column, cell) in columns.iter_mut().zip(cells) {
                column.push(Some(cell).filter(|cell| cell.is_finite()));
            }
        }
        let names = COLUMNS[2..].iter().map(|(name, _)| (*name).to_owned());
        let columns = names.zip(columns.map(Cells::Numbers));
        measured(fit).into_iter().chain(columns).collect()
    }

    /// The standard deviation of a number. One that was not measured has the mean relative deviation of its set.
    fn deviation(&self, place: usize) -> f64 {
        let measured = &self.fit.measured;
        if measured.has(place) {
            return measured.deviation(place, &self.best.factors);
        }
        let set = self.fit.positions[place].set;
        let is_own = |other: &usize| self.fit.positions[*other].set == set && measured.has(*other);
        let own: Vec<usize> = (0..self.best.predicted.len()).filter(is_own).collect();
        let share = |other: &usize| {
            measured.deviation(*other, &self.best.factors) / self.best.predicted[*other].abs()
        };
        own.iter().map(share).sum::<f64>() / own.len() as f64 * self.best.predicted[place].abs()
    }

    fn is_open(&self, place: usize) -> bool {
        self.open.iter().any(|direction| direction[place] != 0.0)
    }

    fn parameter(&self, place: usize) -> Value {
        let parameter = &self.fit.parameters[place];
        let x = self.best.theta[place];
        let (cells, first) = (self.rows.numbers(place), self.fit.bounds()[3] + 2 * place);
        let error = self.information.standard_error(&self.fit.only(place)) * parameter.scale(x);
        let known = |value: f64| if self.is_open(place) { Value::Null } else { number(value) };
        let u = parameter.coordinate(x);
        let mut told = json!({
            "pointer": parameter.pointer, "unit": parameter.unit,
            "estimate": known(x), "standard_error": known(error),
            "interval": cells[first..first + 2],
            "at_bound": !(AT_BOUND..=1.0 - AT_BOUND).contains(&u),
        });
        if !parameter.only.is_empty() {
            told["for"] = json!(parameter.only);
        }
        told
    }

    fn correlation(&self) -> Value {
        let count = self.fit.parameters.len();
        let cell = |one: usize, other: usize| {
            let is_known = !self.is_open(one) && !self.is_open(other);
            if is_known { number(self.information.correlation(one, other)) } else { Value::Null }
        };
        (0..count).map(|one| (0..count).map(|other| cell(one, other)).collect::<Value>()).collect()
    }

    /// The product of powers of two parameters that the data determine, although they do not determine the two.
    fn combination(&self, direction: &Direction) -> Option<Value> {
        let exponents = exponents(direction)?;
        let own = self.best.theta.iter().zip(&exponents).filter(|(_, power)| **power != 0.0);
        let logarithm: f64 = own.map(|(x, power)| power * libm::log(*x)).sum();
        let factor = self.fit.measured.factor(self.fit.confidence);
        let half = factor * self.information.standard_error(&exponents);
        let at = |half: f64| number(libm::exp(logarithm + half));
        let (name, interval) = (self.product(&exponents), [at(-half), at(half)]);
        Some(json!({"combination": name, "estimate": at(0.0), "interval": interval}))
    }

    /// A product of powers of parameters, such as `wear.coefficient/friction`.
    fn product(&self, exponents: &[f64]) -> String {
        let mut text = String::new();
        let own = self.fit.parameters.iter().zip(exponents).filter(|(_, power)| **power != 0.0);
        for (parameter, power) in own {
            let sign = if *power < 0.0 { "/" } else { "·" };
            text += if text.is_empty() { "" } else { sign };
            text += &parameter.name();
            if (power.abs() - 1.0).abs() > f64::EPSILON {
                // Writing to a text cannot fail.
                let _ = write!(text, "^{:.2}", power.abs());
            }
        }
        text
    }

    /// What the data cannot tell.
    fn in_words(&self, direction: &Direction) -> String {
        if let Some(exponents) = exponents(direction) {
            return format!("These data determine only `{}`.", self.product(&exponents));
        }
        let places: Vec<usize> = (0..direction.len()).filter(|it| direction[*it] != 0.0).collect();
        let names = places.iter().map(|place| format!("`{}`", self.fit.parameters[*place].name()));
        let names = names.collect::<Vec<_>>().join(", ");
        if let [place] = places[..] {
            let rescales = |source: &Source| {
                source.rescaled.is_some_and(|member| source.parameters[member] == place)
            };
            let stopped = self.fit.sources.iter().any(rescales);
            let reason = if stopped { ": wear has stopped" } else { "" };
            return format!("{names} has almost no effect on these data{reason}.");
        }
        let parts = places.iter().map(|place| format!("{:.2}", direction[*place]));
        let parts = parts.collect::<Vec<_>>().join(" : ");
        format!(
            "Relative changes of {names} in the proportion {parts} have almost no effect together."
        )
    }

    /// Remarks, the most important one first.
    fn notes(&self, parameters: &[Value]) -> Value {
        let (fit, measured) = (self.fit, &self.fit.measured);
        let mut notes = Vec::new();
        let mut add = |kind: &str, detail: Option<String>| {
            notes.extend(detail.map(|detail| json!({"kind": kind, "detail": detail})));
        };
        add("discrepancy", self.discrepancy());
        for direction in &self.open {
            add("undetermined", Some(self.in_words(direction)));
        }
        for direction in self.alone.undetermined().iter().filter(|_| self.open.is_empty()) {
            add(
                "prior",
                Some(format!("{} The rest follows from priors.", self.in_words(direction))),
            );
        }
        for (parameter, told) in fit.parameters.iter().zip(parameters) {
            let is_cut =
                told["interval"].as_array().is_some_and(|ends| ends.contains(&Value::Null));
            let kind = match told["at_bound"] == true {
                true => "at_bound",
                false if is_cut => "open_interval",
                false => continue,
            };
            let (name, low, high) = (parameter.name(), parameter.low, parameter.high);
            let what = if is_cut { "The interval of" } else { "The estimate of" };
            let detail =
                format!("{what} `{name}` reaches an end of its range from {low:e} to {high:e}.");
            add(kind, told["estimate"].is_number().then_some(detail));
        }
        add("misfit", self.misfit());
        let lack = self.lack_of_fit().filter(|(_, probability)| *probability < IMPROBABLE);
        add("lack_of_fit", lack.map(|(statistic, probability)| {
            format!("The fit is worse than repeated tests allow (F = {statistic:.1}, probability {probability:.1e}).")
        }));
        let points = (0..fit.positions.len()).filter(|place| measured.has(*place)).count();
        let count = measured.count(None);
        if !measured.is_clustered {
            let detail = "There are not more specimens than parameters, so each point counts as independent. The \
                          intervals do not contain the scatter between specimens.";
            add("clusters", Some(detail.to_owned()));
        } else if count < points as f64 - 0.5 {
            add(
                "clusters",
                Some(format!(
                    "The points of one specimen or profile count as one: {points} points count as {count:.0}."
                )),
            );
        }
        let sums = self.rows.numbers(fit.parameters.len());
        let is_lower =
            sums[fit.bounds()[3]..].iter().flatten().any(|sum| *sum < self.best.sum - 1.0);
        let detail =
            "A search for an interval has found a smaller sum of squares. Enter more `starts`.";
        add("other_minimum", is_lower.then(|| detail.to_owned()));
        Value::Array(notes)
    }

    /// Whether the residuals are larger than the stated noise, or the estimated noise is large.
    fn misfit(&self) -> Option<String> {
        let measured = &self.fit.measured;
        let freedom = (measured.count(None) - self.fit.parameters.len() as f64).floor();
        if measured.freedom().is_none() && freedom >= 1.0 {
            let ratio = self.best.sum / freedom;
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
            let is_own =
                |place: &usize| measured.points[*place].set == noise && measured.has(*place);
            let squares = (0..self.fit.positions.len()).filter(is_own).map(|place| {
                let deviation = measured.deviation(place, &self.best.factors);
                (deviation * deviation, measured.points[place].value * measured.points[place].value)
            });
            let (noise, size) = squares.fold((0.0, 0.0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
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
        let (fit, measured) = (self.fit, &self.fit.measured);
        let points = (0..fit.positions.len()).filter(|place| measured.has(*place));
        let mut groups = BTreeMap::<String, Vec<(f64, f64)>>::new();
        for place in points.clone() {
            let (position, set) = (&fit.positions[place], fit.set(place));
            let source = &fit.sources[position.source];
            let mut base = source.problem.base.clone();
            base["cycles"] = json!([set.output, set.x[position.entry], source.parameters]);
            let deviation = measured.deviation(place, &self.best.factors);
            let group = groups.entry(base.to_string()).or_default();
            group.push((measured.points[place].value, deviation));
        }
        let spread = |group: &Vec<(f64, f64)>| {
            let mean = group.iter().map(|(y, _)| y).sum::<f64>() / group.len() as f64;
            group.iter().map(|(y, s)| (y - mean) * (y - mean) / (s * s)).sum::<f64>()
        };
        let pure: f64 = groups.values().map(spread).sum();
        let repeats = (points.count() - groups.len()) as f64;
        let freedom = groups.len() as f64 - fit.parameters.len() as f64;
        let is_clustered =
            (measured.count(None) - freedom - repeats - fit.parameters.len() as f64).abs() > 0.5;
        if is_clustered || freedom < 1.0 || repeats < 1.0 {
            return None;
        }
        let statistic = (self.best.sum - pure).max(0.0) / freedom / (pure / repeats);
        Some((statistic, fisher::above(statistic, (freedom, repeats))))
    }

    /// The coefficient from volumes alone and from depths alone, if their intervals do not overlap.
    fn discrepancy(&self) -> Option<String> {
        let (fit, measured) = (self.fit, &self.fit.measured);
        let place = fit.coefficient?;
        let column = &fit.derivatives(self.rows)[place];
        let slopes = measured.slopes(&self.best.factors);
        let (cells, first) = (self.rows.numbers(place), fit.bounds()[3] - fit.subsets());
        let interval = |are_depths: bool| {
            let own = (0..column.len()).filter(|it| fit.set(*it).are_depths() == Some(are_depths));
            let square: f64 = own.map(|it| column[it] * column[it] * slopes[it] * slopes[it]).sum();
            let half = measured.factor(fit.confidence) / square.sqrt();
            let x = cells[first + usize::from(are_depths)]?;
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
        let (fit, measured) = (self.fit, &self.fit.measured);
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
            "aicc": measured.aicc(&self.best.predicted, fit.parameters.len()).map(twelve_digits),
            "lack_of_fit": lack,
            "noise": noise.collect::<Value>(),
            "runs": self.rows.numbers(fit.parameters.len() + 1).iter().flatten().sum::<f64>(),
        })
    }

    /// Lines through the origin for wear volumes over measured energies, without and with weights.
    fn lines(&self) -> Value {
        let (fit, measured) = (self.fit, &self.fit.measured);
        let is_energy = |place: &usize| {
            let is_volume =
                matches!(fit.set(*place).quantity, Quantity::Column { column: "wear_volume", .. });
            is_volume && fit.set(*place).over() == "dissipated_energy" && measured.has(*place)
        };
        let own: Vec<usize> = (0..fit.positions.len()).filter(is_energy).collect();
        let line = |(weights, is_weighted): (&str, bool)| {
            let point = |place: &usize| {
                let deviation = measured.deviation(*place, &self.best.factors);
                let weight = if is_weighted { 1.0 / (deviation * deviation) } else { 1.0 };
                (
                    fit.set(*place).x[fit.positions[*place].entry],
                    measured.points[*place].value,
                    weight,
                )
            };
            let points: Vec<_> = own.iter().map(point).collect();
            let Line { slope, standard_error, interval, r_squared } =
                Line::through(&points, fit.confidence)?;
            Some(json!({
                "weights": weights, "energy_coefficient": number(slope), "standard_error": number(standard_error),
                "interval": interval.map(number), "r_squared": number(r_squared),
            }))
        };
        [("equal", false), ("noise", true)].into_iter().filter_map(line).collect()
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

/// The exponents of the product of two parameters that does not change along a direction. The first one is 1. `None` if
/// the direction does not change two parameters.
fn exponents(direction: &Direction) -> Option<Vec<f64>> {
    let places: Vec<usize> = (0..direction.len()).filter(|it| direction[*it] != 0.0).collect();
    let [one, other] = places[..] else { return None };
    let ratio = -direction[one] / direction[other];
    let mut exponents = vec![0.0; direction.len()];
    exponents[one] = 1.0;
    exponents[other] = if (ratio.abs() - 1.0).abs() < ABOUT_ONE { ratio.signum() } else { ratio };
    Some(exponents)
}
