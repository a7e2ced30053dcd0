//! What follows from the rows of a fit: estimates with intervals, what the data cannot tell, and whether one set of
//! parameters describes them.

use std::collections::BTreeMap;

use fretwork_engine::numeric::twelve_digits;
use serde_json::{Value, json};

use super::model::Set;
use super::search::{Fit, Known, Row, Task, end};
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
    let all: Vec<usize> = (0..fit.positions.len()).collect();
    let is_measured = |it: &usize| fit.positions[*it].1 < fit.set(*it).noise.len();
    let (measured, grid): (Vec<_>, Vec<_>) = all.into_iter().partition(is_measured);
    let Some(known) = fit.known(rows) else {
        let detail =
            "No start leads to numbers for all measured points. See `reason` in `searches`.";
        let tables = vec![("table", table(fit, &measured, &[]))];
        let others = vec![("notes", json!([{"kind": "no_minimum", "detail": detail}]))];
        return Findings { tables, others, ..Findings::default() };
    };
    let [alone, information] = [false, true].map(|priors| fit.information(&known, priors));
    let best = &known.rows[known.minimum];
    let told = Told { fit, known: &known, best, alone, information };
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
    let tasks: Vec<String> =
        fit.tasks.iter().map(|(_, task)| json!(task_name(fit, *task)).to_string()).collect();
    let beside = vec![("task", tasks.join(","))];
    let tables =
        vec![("table", table(fit, &measured, &bands)), ("bands", table(fit, &grid, &bands))];
    Findings { tables, others, beside, notes: None }
}

/// What a row of `searches` is.
fn task_name(fit: &Fit, task: Task) -> String {
    match task {
        Task::Start(_) => "start".to_owned(),
        Task::Minimum => "minimum".to_owned(),
        Task::Derivative(parameter) => format!("derivative {}", fit.parameters[parameter].column()),
        Task::Without(test) => format!("without {}", fit.tests[test]),
        Task::Only { are_depths: true } => "only depths".to_owned(),
        Task::Only { are_depths: false } => "only volumes".to_owned(),
        Task::Profile { parameter, .. } => {
            format!("profile {}", fit.parameters[parameter].column())
        }
    }
}

/// A number as JSON.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(twelve_digits(x)) } else { Value::Null }
}

/// The numbers at these positions, and their columns from the prediction on, if they are known.
fn table(fit: &Fit, places: &[usize], bands: &[[f64; 7]]) -> Table {
    let texts = |of: &dyn Fn(&Set) -> String| {
        Cells::Texts(places.iter().map(|place| of(fit.set(*place))).collect())
    };
    let mut table = vec![
        ("test", texts(&|set| fit.tests[set.test].clone())),
        ("output", texts(&|set| set.output.clone())),
        ("unit", texts(&|set| set.unit.to_owned())),
        ("over", texts(&|set| set.over.to_owned())),
    ];
    let columns = COLUMNS.iter().take(if bands.is_empty() { 2 } else { COLUMNS.len() });
    table.extend(columns.enumerate().map(|(column, (name, _))| {
        let cell = |place: &usize| match column {
            0 => Some(fit.set(*place).x[fit.positions[*place].1]),
            1 => fit.set(*place).y[fit.positions[*place].1],
            _ => Some(bands[*place][column - 2]).filter(|it| it.is_finite()),
        };
        (*name, Cells::Numbers(places.iter().map(cell).collect()))
    }));
    table.into_iter().map(|(name, cells)| (name.to_owned(), cells)).collect()
}

/// What is told about the best parameters.
struct Told<'a> {
    fit: &'a Fit,
    known: &'a Known,
    best: &'a Row,
    /// What the data say without the priors, and with them.
    alone: Information,
    information: Information,
}

impl Told<'_> {
    /// The points that take part, and their indices.
    fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.known.measured.taking_part()
    }

    fn deviation(&self, point: &Point) -> f64 {
        point.deviation(&self.known.factors)
    }

    /// The root mean square deviation of the numbers of a set, relative to that of their predictions.
    fn share(&self, set: usize) -> f64 {
        let own = self.points().filter(|(place, _)| self.fit.positions[*place].0 == set);
        let own = own.map(|(place, point)| (self.deviation(point), self.best.numbers[place]));
        let (noise, size) = own.fold((0.0, 0.0), |sum, (s, y)| (sum.0 + s * s, sum.1 + y * y));
        (noise / size).sqrt()
    }

    /// For each position: the prediction, its deviation, the residual, and the bands. A number that was not measured has
    /// the mean relative deviation of its set.
    fn bands(&self) -> Vec<[f64; 7]> {
        let (fit, measured) = (self.fit, &self.known.measured);
        let shares: Vec<f64> = (0..fit.sets.len()).map(|set| self.share(set)).collect();
        let factor = measured.factor(fit.confidence);
        let derivatives = fit.derivatives(self.known);
        let band = |(place, y): (usize, &f64)| {
            let slopes: Vec<f64> = derivatives.iter().map(|row| row.numbers[place]).collect();
            let point = &measured.points[place];
            let relative = shares[fit.positions[place].0] * y.abs();
            let deviation = if point.weight > 0.0 { self.deviation(point) } else { relative };
            let confidence = factor * self.information.standard_error(&slopes);
            let prediction = libm::hypot(confidence, factor * deviation);
            let [low, high] = [y - confidence, y + confidence];
            [
                *y,
                deviation,
                (point.value - y) / deviation,
                low,
                high,
                y - prediction,
                y + prediction,
            ]
        };
        self.best.numbers.iter().enumerate().map(band).collect()
    }

    fn parameter(&self, place: usize) -> Value {
        let (parameter, x) = (&self.fit.parameters[place], self.best.theta[place]);
        let error = self.information.standard_error(&self.fit.only(place)) * parameter.scale(x);
        let is_open = self.information.is_open(place);
        let known = |value: f64| if is_open { Value::Null } else { number(value) };
        let (u, rise) = (parameter.coordinate(x), self.known.measured.factor(self.fit.confidence));
        let interval = [(false, -1.0), (true, 1.0)].map(|(is_high, sign)| {
            let task = Task::Profile { parameter: place, is_high };
            let u = end(&self.fit.profile(self.known, task), rise).map(|end| u + sign * end);
            u.filter(|u| (0.0..=1.0).contains(u)).map(|u| twelve_digits(parameter.value(u)))
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
        let cell = |one, other| number(self.information.correlation(one, other));
        (0..count).map(|one| (0..count).map(|other| cell(one, other)).collect::<Value>()).collect()
    }

    /// What the data cannot tell.
    fn in_words(&self, direction: &Direction) -> String {
        let parts = self.fit.parameters.iter().zip(direction).filter(|(_, part)| **part != 0.0);
        let parts: Vec<(String, f64)> = parts.map(|(it, part)| (it.name(), *part)).collect();
        match &parts[..] {
            [(name, _)] => {
                let place = direction.iter().take_while(|part| **part == 0.0).count();
                let mut runs = self.fit.sets.iter().filter_map(|set| set.runs.as_ref());
                let has_stopped = runs.any(|runs| runs.is_rescaled_by(place));
                let reason = if has_stopped { ": wear has stopped" } else { "" };
                format!("`{name}` has almost no effect on these data{reason}.")
            }
            [(one, first), (other, second)] => {
                // The product of powers that does not change along the direction.
                let power = -first / second;
                let sign = if power < 0.0 { "/" } else { "·" };
                let is_one = (power.abs() - 1.0).abs() < ABOUT_ONE;
                let power = if is_one { String::new() } else { format!("^{:.2}", power.abs()) };
                let kept = format!("`{one}{sign}{other}{power}`");
                if self.alone.undetermined.len() == 1 {
                    return format!("These data determine only {kept}.");
                }
                format!("Changes of `{one}` and `{other}` that keep {kept} have almost no effect.")
            }
            _ => {
                let names: Vec<_> = parts.iter().map(|(name, _)| format!("`{name}`")).collect();
                let shares: Vec<_> = parts.iter().map(|(_, part)| format!("{part:.2}")).collect();
                let (names, shares) = (names.join(", "), shares.join(" : "));
                format!(
                    "Relative changes of {names} in the proportion {shares} have almost no effect together."
                )
            }
        }
    }

    /// Remarks, the most important one first.
    fn notes(&self, parameters: &[Value]) -> Value {
        let Known { measured, minimum, rows, .. } = self.known;
        let mut notes: Vec<(&str, String)> = Vec::new();
        notes.extend(self.discrepancy().map(|detail| ("discrepancy", detail)));
        let open = &self.information.undetermined;
        notes.extend(open.iter().map(|it| ("undetermined", self.in_words(it))));
        if open.is_empty() {
            let told = |it| format!("{} The rest follows from priors.", self.in_words(it));
            notes.extend(self.alone.undetermined.iter().map(|it| ("prior", told(it))));
        }
        for (parameter, told) in self.fit.parameters.iter().zip(parameters) {
            let (name, low, high) = (parameter.name(), parameter.low, parameter.high);
            let is_cut = told["interval"][0].is_null() || told["interval"][1].is_null();
            let is_at_bound = told["at_bound"] == true;
            if told["estimate"].is_number() && (is_cut || is_at_bound) {
                let what = if is_cut { "interval" } else { "estimate" };
                let kind = if is_at_bound { "at_bound" } else { "open_interval" };
                let detail = format!(
                    "The {what} of `{name}` reaches an end of its range from {low:e} to {high:e}."
                );
                notes.push((kind, detail));
            }
        }
        notes.extend(self.misfit().map(|detail| ("misfit", detail)));
        let lack = self.lack_of_fit().filter(|(_, probability)| *probability < IMPROBABLE);
        notes.extend(lack.map(|(statistic, probability)| {
            ("lack_of_fit", format!("The fit is worse than repeated tests allow (F = {statistic:.1}, probability {probability:.1e})."))
        }));
        let (points, count) = (self.points().count(), measured.count(None));
        if !measured.is_clustered {
            let detail = "There are not more specimens than parameters, so each point counts as independent. The \
                          intervals do not contain the scatter between specimens.";
            notes.push(("clusters", detail.to_owned()));
        } else if count < points as f64 - 0.5 {
            let detail = "The points of one specimen or profile count as one";
            notes.push(("clusters", format!("{detail}: {points} points count as {count:.0}.")));
        }
        let tasks = self.fit.tasks.iter().zip(rows).filter(|((stage, _), _)| *stage > 2);
        if tasks.map(|(_, row)| row.sum).any(|sum| sum < rows[*minimum].sum - 1.0) {
            let detail =
                "A search for an interval has found a smaller sum of squares. Enter more `starts`.";
            notes.push(("other_minimum", detail.to_owned()));
        }
        notes.iter().map(|(kind, detail)| json!({"kind": kind, "detail": detail})).collect()
    }

    /// Whether the residuals are larger than the stated noise, or the estimated noise is large.
    fn misfit(&self) -> Option<String> {
        let (fit, measured) = (self.fit, &self.known.measured);
        let freedom = (measured.count(None) - fit.parameters.len() as f64).floor();
        if measured.freedom().is_none() && freedom >= 1.0 {
            let ratio = self.best.sum / freedom;
            let probability = fisher::above(ratio, (freedom, MANY));
            let told = format!(
                "One set of parameters does not describe these tests within their stated errors: the residuals are \
                 {:.1} times as large (probability {probability:.1e}).",
                ratio.sqrt()
            );
            return Some(told).filter(|_| probability < IMPROBABLE);
        }
        let estimated = (0..fit.sets.len()).filter(|set| fit.sets[*set].is_estimated);
        let (set, share) =
            estimated.map(|set| (set, self.share(set))).find(|it| it.1 > WIDE_SCATTER)?;
        let output = &fit.sets[set].output;
        Some(format!(
            "`{output}` scatters by {:.0} % around the fit. One set of parameters may not describe these tests.",
            100.0 * share
        ))
    }

    /// The test of lack of fit, if points were repeated: F and its probability. Repeated points have equal predictions.
    fn lack_of_fit(&self) -> Option<(f64, f64)> {
        let mut groups = BTreeMap::<(&str, u64), Vec<(f64, f64)>>::new();
        for (place, point) in self.points() {
            let key = (self.fit.set(place).output.as_str(), self.best.numbers[place].to_bits());
            groups.entry(key).or_default().push((point.value, self.deviation(point)));
        }
        let spread = |group: &Vec<(f64, f64)>| {
            let mean = group.iter().map(|(y, _)| y).sum::<f64>() / group.len() as f64;
            group.iter().map(|(y, s)| (y - mean) * (y - mean) / (s * s)).sum::<f64>()
        };
        let pure: f64 = groups.values().map(spread).sum();
        let (points, count) = (self.points().count(), groups.len());
        let (repeats, freedom) =
            ((points - count) as f64, count as f64 - self.fit.parameters.len() as f64);
        let is_clustered = (self.known.measured.count(None) - points as f64).abs() > 0.5;
        if is_clustered || freedom < 1.0 || repeats < 1.0 {
            return None;
        }
        let statistic = (self.best.sum - pure).max(0.0) / freedom / (pure / repeats);
        Some((statistic, fisher::above(statistic, (freedom, repeats))))
    }

    /// The coefficient from volumes alone and from depths alone, if their intervals do not overlap.
    fn discrepancy(&self) -> Option<String> {
        let place = self.fit.coefficient?;
        let slopes = &self.fit.derivatives(self.known)[place].numbers;
        let interval = |are_depths: bool| {
            let own =
                self.points().filter(|it| self.fit.set(it.0).are_depths() == Some(are_depths));
            let effects = own.map(|(it, point)| slopes[it] * point.slope(&self.known.factors));
            let square: f64 = effects.map(|effect| effect * effect).sum();
            let half = self.known.measured.factor(self.fit.confidence) / square.sqrt();
            let only = Task::Only { are_depths };
            let row = self.fit.tasks.iter().position(|(_, task)| *task == only)?;
            let x = Some(self.known.rows[row].theta[place]).filter(|x| x.is_finite())?;
            Some([0.0, -half, half].map(|half| x * libm::exp(half)))
        };
        let ([v, v_low, v_high], [d, d_low, d_high]) = (interval(false)?, interval(true)?);
        let told = format!(
            "One coefficient does not describe these tests: `{}` is {v:.2e} ({v_low:.2e} to {v_high:.2e}) from volumes \
             alone, and {d:.2e} ({d_low:.2e} to {d_high:.2e}) from depths alone.",
            self.fit.parameters[place].name()
        );
        Some(told).filter(|_| v_low > d_high || d_low > v_high)
    }

    fn quality(&self) -> Value {
        let (fit, Known { measured, factors, rows, .. }) = (self.fit, self.known);
        let noise = fit.noises.iter().zip(factors).filter_map(|(output, factor)| {
            Some(json!({"output": output.as_ref()?, "factor": number(*factor)}))
        });
        let rise = measured.factor(fit.confidence);
        let lack = self.lack_of_fit().map(|(statistic, probability)| {
            json!({"statistic": number(statistic), "probability": number(probability)})
        });
        json!({
            "sum_of_squares": number(self.best.sum),
            "allowed_rise": number(rise * rise),
            "effective_points": number(measured.count(None)),
            "degrees_of_freedom": measured.freedom(),
            "aicc": measured.aicc(&self.best.numbers, fit.parameters.len()).map(twelve_digits),
            "lack_of_fit": lack,
            "noise": noise.collect::<Value>(),
            "runs": rows.iter().map(|row| row.runs).sum::<f64>(),
        })
    }

    /// Lines through the origin for wear volumes over measured energies, without and with weights.
    fn lines(&self) -> Value {
        let own = self.points().filter(|(place, _)| self.fit.set(*place).is_over_energy());
        let weighted = own.map(|(place, point)| {
            let x = self.fit.set(place).x[self.fit.positions[place].1];
            (x, point.value, 1.0 / (self.deviation(point) * self.deviation(point)))
        });
        let weighted: Vec<_> = weighted.collect();
        let equal = weighted.iter().map(|(x, y, _)| (*x, *y, 1.0)).collect();
        let line = |(weights, points): (&str, Vec<_>)| {
            let Line { slope, standard_error, interval, r_squared } =
                Line::through(&points, self.fit.confidence)?;
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
        scenario.as_object_mut().and_then(|members| members.remove("profiles_at"));
        let estimates = self.fit.parameters.iter().zip(&self.best.theta);
        for (parameter, x) in estimates.filter(|(parameter, _)| parameter.only.is_empty()) {
            if let Ok(member) = Member::find(&problem.base, &parameter.pointer) {
                member.put(&mut scenario, twelve_digits(*x));
            }
        }
        scenario
    }
}
