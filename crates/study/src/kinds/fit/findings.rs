//! What follows from the rows of a fit: estimates with intervals, what the data cannot tell, and whether one set of
//! parameters describes them.

use std::collections::BTreeMap;

use fretwork_engine::numeric::twelve_digits;
use serde_json::{Value, json};

use super::model::{Parameter, Quantity, Set};
use super::search::{Fit, Known, Row, Task, end};
use crate::member::Member;
use crate::plan::{Cells, Findings};
use crate::problem::Problem;
use crate::rows::Rows;
use crate::stats::fisher;
use crate::stats::measured::{Direction, Information, Point};
use crate::stats::origin::Line;
use crate::stats::outliers::outliers;

/// A deviation with a smaller probability than this is told.
const IMPROBABLE: f64 = 0.01;
/// Residuals are told if they are this many times as large as the stated noise, however few the points are.
const LARGE: f64 = 3.0;
/// Estimated noise above this share of the numbers is told.
const WIDE_SCATTER: f64 = 0.3;
/// Exponents of a combination nearer to 1 than this count as 1.
const ABOUT_ONE: f64 = 0.15;
/// Denominator degrees of freedom that stand for known noise.
const MANY: f64 = 1e7;
/// Numbers of a start count as outside of an interval beyond this share of its end.
const COARSE: f64 = 0.05;
/// Numbers that are this many powers of ten off can have another unit: the unit, its SI unit, and the power of ten between them.
const OTHER_UNIT: f64 = 4.5;
const UNITS: [(&str, &str, f64); 5] = [
    ("cm^3", "m^3", 6.0),
    ("mm^3", "m^3", 9.0),
    ("um^3", "m^3", 18.0),
    ("mg", "kg", 6.0),
    ("ug", "kg", 9.0),
];
/// Differences up to this share of the numbers can be numerical errors.
const NUMERICAL: f64 = 1e-3;
/// A parameter whose change by its own value changes predictions by less than this share has almost no effect.
const LITTLE: f64 = 0.05;
/// A parameter whose coordinate is nearer to 0 or 1 than this is at a bound.
const AT_BOUND: f64 = 2e-3;

/// The columns of numbers in the tables of measured numbers and bands, and their units.
pub const COLUMNS: [(&str, &str); 10] = [
    ("x", "SI"),
    ("measured", "SI"),
    ("predicted", "SI"),
    ("deviation", "SI"),
    ("residual", "1"),
    ("studentized", "1"),
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
    let mut told = Told {
        fit,
        known: &known,
        best,
        alone,
        information,
        studentized: BTreeMap::new(),
        outliers: Vec::new(),
    };
    told.seek_outliers();
    let told = told;
    let parameters: Vec<Value> = (0..fit.parameters.len()).map(|it| told.parameter(it)).collect();
    let others = vec![
        ("notes", told.notes(problem, &parameters)),
        ("parameters", parameters.into()),
        ("correlation", told.correlation()),
        ("quality", told.quality()),
        ("outliers", told.outliers.iter().map(|it| told.outlier(&measured, *it)).collect()),
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

/// A probability in a text.
fn in_words(probability: f64) -> String {
    if probability < 1e-6 { "below 1e-6".to_owned() } else { format!("{probability:.1e}") }
}

/// A number as JSON.
fn number(x: f64) -> Value {
    if x.is_finite() { json!(twelve_digits(x)) } else { Value::Null }
}

/// The numbers at these positions, and their columns from the prediction on, if they are known.
fn table(fit: &Fit, places: &[usize], bands: &[[f64; 8]]) -> Table {
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
    /// The studentised residuals by position, and the positions of the outliers.
    studentized: BTreeMap<usize, f64>,
    outliers: Vec<usize>,
}

impl Told<'_> {
    /// Seeks outliers among the points that take part. Neighbours in a profile are not independent, and a prior is no measurement.
    fn seek_outliers(&mut self) {
        let is_single = |it: &usize| matches!(self.fit.set(*it).quantity, Quantity::Column { .. });
        let places: Vec<usize> = self.points().map(|it| it.0).filter(is_single).collect();
        let distances: Vec<f64> = places.iter().map(|it| self.residual(*it)).collect();
        let column =
            |row: &Row| places.iter().map(|it| row.numbers[*it] / self.deviation(*it)).collect();
        let slopes: Vec<Vec<f64>> = self.fit.derivatives(self.known).iter().map(column).collect();
        let differs = |it: &usize| {
            let (measured, predicted) =
                (self.known.measured.points[*it].value, self.best.numbers[*it]);
            (measured - predicted).abs() > NUMERICAL * predicted.abs()
        };
        let is_known = slopes.iter().flatten().chain(&distances).all(|it| it.is_finite());
        if !is_known || !places.iter().any(differs) {
            return;
        }
        let found = outliers(&distances, &slopes, self.known.measured.freedom().is_some());
        self.outliers = found.places.iter().map(|it| places[*it]).collect();
        self.studentized = places.into_iter().zip(found.studentized).collect();
    }

    /// The pointer of a measured number in the fit.
    fn pointer(&self, place: usize) -> &str {
        let (set, entry) = self.fit.positions[place];
        &self.fit.sets[set].pointers[entry]
    }

    /// An outlier: its row in the table of the measured numbers, its pointer, and how far it is from the fit of the others.
    fn outlier(&self, measured: &[usize], place: usize) -> Value {
        let (row, size) = (measured.partition_point(|it| *it < place), self.studentized[&place]);
        json!({"row": row, "pointer": self.pointer(place), "studentized": number(size)})
    }

    /// What is said of the outliers.
    fn disagreement(&self) -> Option<String> {
        let word = |place: &usize| {
            let (set, size) = (self.fit.set(*place), self.studentized[place].abs());
            let (x, test) = (set.x[self.fit.positions[*place].1], &self.fit.tests[set.test]);
            format!("{} of {test} at {x} ({size:.1} standard deviations)", set.output)
        };
        let words = self.outliers.iter().map(word).collect::<Vec<_>>().join("; ");
        let told =
            format!("These numbers disagree with the fit of all others: {words}. Check them.");
        Some(told).filter(|_| !words.is_empty())
    }

    /// The points that take part, and their indices.
    fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.known.measured.taking_part()
    }

    fn deviation(&self, place: usize) -> f64 {
        self.known.noise.deviations[place]
    }

    /// The residual of a point without its weight.
    fn residual(&self, place: usize) -> f64 {
        -self.known.distances[place]
    }

    /// The root mean square deviation of the numbers of a set, relative to that of their predictions.
    fn share(&self, set: usize) -> f64 {
        let own = self.points().filter(|(place, _)| self.fit.positions[*place].0 == set);
        let own = own.map(|(place, _)| (self.deviation(place), self.best.numbers[place]));
        let (noise, size) = own.fold((0.0, 0.0), |sum, (s, y)| (sum.0 + s * s, sum.1 + y * y));
        (noise / size).sqrt()
    }

    /// For each position: the prediction, its deviation, the residual, and the bands. A number that was not measured has
    /// the mean relative deviation of its set.
    fn bands(&self) -> Vec<[f64; 8]> {
        let (fit, measured) = (self.fit, &self.known.measured);
        let shares: Vec<f64> = (0..fit.sets.len()).map(|set| self.share(set)).collect();
        let factor = measured.factor(fit.confidence);
        let derivatives = fit.derivatives(self.known);
        let band = |(place, y): (usize, &f64)| {
            let slopes: Vec<f64> = derivatives.iter().map(|row| row.numbers[place]).collect();
            let point = &measured.points[place];
            let relative = shares[fit.positions[place].0] * y.abs();
            let deviation = if point.weight > 0.0 { self.deviation(place) } else { relative };
            let confidence = fit.rise(self.known) * self.information.standard_error(&slopes);
            let prediction = libm::hypot(confidence, factor * deviation);
            let is_log = fit.set(place).is_log;
            let end = |by: f64| if is_log { y * libm::exp(by / y) } else { y + by };
            let [low, high] = [-confidence, confidence].map(end);
            let [least, most] = [-prediction, prediction].map(end);
            let studentized = self.studentized.get(&place).copied().unwrap_or(f64::NAN);
            [*y, deviation, self.residual(place), studentized, low, high, least, most]
        };
        self.best.numbers.iter().enumerate().map(band).collect()
    }

    fn parameter(&self, place: usize) -> Value {
        let (parameter, x) = (&self.fit.parameters[place], self.best.theta[place]);
        let error = self.information.standard_error(&self.fit.only(place));
        let error = self.known.spread * error * parameter.scale(x);
        let is_open = self.information.is_open(place);
        let known = |value: f64, is_open| if is_open { Value::Null } else { number(value) };
        let (u, rise) = (parameter.coordinate(x), self.fit.rise(self.known));
        let interval = [(false, -1.0), (true, 1.0)].map(|(is_high, sign)| {
            let task = Task::Profile { parameter: place, is_high };
            let u = end(&self.fit.profile(self.known, task), rise).map(|end| u + sign * end);
            u.filter(|u| (0.0..=1.0).contains(u)).map(|u| twelve_digits(parameter.value(u)))
        });
        let mut told = json!({
            "pointer": parameter.pointer, "unit": parameter.unit,
            "estimate": known(x, is_open && !self.is_at_bound(place)),
            "standard_error": known(error, is_open), "interval": interval,
            "at_bound": self.is_at_bound(place),
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

    fn is_at_bound(&self, place: usize) -> bool {
        let parameter = &self.fit.parameters[place];
        let u = parameter.coordinate(self.best.theta[place]);
        !(AT_BOUND..=1.0 - AT_BOUND).contains(&u)
    }

    /// That the best value of a parameter is at an end of its range.
    fn at_bound(&self, place: usize) -> String {
        let Parameter { low, high, .. } = self.fit.parameters[place];
        let name = self.fit.parameters[place].name();
        let is_high = self.fit.parameters[place].coordinate(self.best.theta[place]) > 0.5;
        let (end, side) = if is_high { (high, "high") } else { (low, "low") };
        format!(
            "The best value of `{name}` is at the {side} end {end:e} of its range. Widen the range."
        )
    }

    /// Whether a large change of a parameter changes a prediction by more than a little.
    fn has_effect(&self, place: usize) -> bool {
        let changes = &self.fit.derivatives(self.known)[place].numbers;
        self.points().any(|(it, _)| changes[it].abs() > LITTLE * self.best.numbers[it].abs())
    }

    /// What the data cannot tell.
    fn in_words(&self, direction: &Direction) -> String {
        let parts = self.fit.parameters.iter().zip(direction).filter(|(_, part)| **part != 0.0);
        let parts: Vec<(String, f64)> = parts.map(|(it, part)| (it.name(), *part)).collect();
        match &parts[..] {
            [(name, _)] => {
                let place = direction.iter().take_while(|part| **part == 0.0).count();
                if self.has_effect(place) {
                    return format!(
                        "The errors of these data are too large to determine `{name}`."
                    );
                }
                let mut worn = self.fit.sets.iter().filter(|set| set.are_depths().is_some());
                let has_stopped =
                    worn.any(|set| set.runs.as_ref().is_some_and(|it| it.is_rescaled_by(place)));
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
    fn notes(&self, problem: &Problem, parameters: &[Value]) -> Value {
        let Known { measured, minimum, rows, .. } = self.known;
        let mut notes: Vec<(&str, String)> = Vec::new();
        notes.extend(self.magnitude(problem).map(|detail| ("magnitude", detail)));
        let lack = self.lack_of_fit();
        notes.extend(self.misfit(lack));
        notes.extend(self.disagreement().map(|detail| ("outliers", detail)));
        notes.extend(self.discrepancy().map(|detail| ("discrepancy", detail)));
        notes.extend(self.other_start(parameters).map(|detail| ("other_minimum", detail)));
        let open = &self.information.undetermined;
        // A parameter at an end of its range is told below.
        let is_at_end = |it: &&Direction| {
            let mut parts = (0..it.len()).filter(|place| it[*place] != 0.0);
            parts.next().is_some_and(|place| self.is_at_bound(place)) && parts.next().is_none()
        };
        let told = open.iter().filter(|it| !is_at_end(it));
        notes.extend(told.map(|it| ("undetermined", self.in_words(it))));
        if open.is_empty() {
            let told = |it| format!("{} The rest follows from priors.", self.in_words(it));
            notes.extend(self.alone.undetermined.iter().map(|it| ("prior", told(it))));
        }
        for (place, (parameter, told)) in self.fit.parameters.iter().zip(parameters).enumerate() {
            let (name, low, high) = (parameter.name(), parameter.low, parameter.high);
            let is_cut = told["interval"][0].is_null() || told["interval"][1].is_null();
            let is_lost = [false, true].into_iter().enumerate().any(|(end, is_high)| {
                let task = Task::Profile { parameter: place, is_high };
                told["interval"][end].is_null() && !self.fit.reaches_bound(self.known, task)
            });
            let is_at_bound = told["at_bound"] == true;
            if told["estimate"].is_number() && (is_cut || is_at_bound) {
                let kind = if is_at_bound { "at_bound" } else { "open_interval" };
                let detail = if is_at_bound {
                    self.at_bound(place)
                } else if is_lost {
                    format!(
                        "An end of the interval of `{name}` was not found. Enter a narrower range than {low:e} to {high:e}."
                    )
                } else {
                    format!(
                        "The interval of `{name}` reaches an end of its range from {low:e} to {high:e}."
                    )
                };
                notes.push((kind, detail));
            }
        }
        let lack = lack.filter(|(_, probability)| *probability < IMPROBABLE);
        notes.extend(lack.map(|(statistic, probability)| {
            let probability = in_words(probability);
            ("lack_of_fit", format!("The fit is worse than repeated tests allow (F = {statistic:.1}, probability {probability})."))
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

    /// The unit that the volumes or masses seem to have, if they need another wear coefficient by many powers of ten.
    fn magnitude(&self, problem: &Problem) -> Option<String> {
        let place = self.fit.parameters.iter().position(|it| it.pointer.starts_with("/wear/"))?;
        let own = Member::find(&problem.base, &self.fit.parameters[place].pointer).ok()?.value;
        let is_volume = |it: &usize| self.fit.set(*it).are_depths() == Some(false);
        let places: Vec<usize> = self.points().map(|it| it.0).filter(is_volume).collect();
        let set = self.fit.set(*places.first()?);
        let ratio =
            |place: &usize| self.known.measured.points[*place].value / self.best.numbers[*place];
        let mut ratios: Vec<f64> = places.iter().map(ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let size = libm::log10(ratios[ratios.len() / 2] * self.best.theta[place] / own);
        let units = UNITS.into_iter().filter(|(_, si, _)| *si == set.unit);
        let distance = |power: f64| (size.abs() - power).abs();
        let (unit, si, power) = units.min_by(|a, b| distance(a.2).total_cmp(&distance(b.2)))?;
        let likely = if size > 0.0 { unit } else { si };
        Some(format!(
            "The measured numbers are about 1e{size:.0} times those that the wear coefficient of the scenario, {own:e}, gives. \
             Are they in {likely}? Enter their unit."
        ))
        .filter(|_| size.abs() > OTHER_UNIT && distance(power) < 3.0)
    }

    /// A start whose sum of squares is in the allowed rise, but whose parameters are outside of the intervals.
    fn other_start(&self, parameters: &[Value]) -> Option<String> {
        let (fit, Known { measured, rows, .. }) = (self.fit, self.known);
        let rise = fit.rise(self.known);
        let starts = &rows[..fit.starts.len()];
        let least = starts.iter().map(|row| row.sum).fold(f64::INFINITY, f64::min);
        // With estimated noise, S of the starts has another unit.
        let unit = measured.freedom().map_or(1.0, |_| self.best.sum / least);
        let near = starts.iter().filter(|row| (row.sum - least) * unit < rise * rise);
        let is_outside = |(told, x): (&Value, &f64)| {
            let [low, high] = [0, 1].map(|end| told["interval"][end].as_f64());
            // The searches from the starts are coarse.
            low.is_some_and(|low| *x < low - COARSE * low.abs())
                || high.is_some_and(|high| *x > high + COARSE * high.abs())
        };
        // The noise of the best start is not yet that of the minimum, so its parameters are not, either.
        let start = &rows[self.known.start].theta;
        let is_other = |row: &&Row| {
            let differs = |(x, best): (&f64, &f64)| (x - best).abs() > COARSE * best.abs();
            row.theta.iter().zip(start).any(differs)
                && parameters.iter().zip(&row.theta).any(is_outside)
        };
        let names = fit.parameters.iter().map(Parameter::name);
        let other = near.into_iter().find(is_other)?;
        let values = names.zip(&other.theta).map(|(name, x)| format!("`{name}` = {x:.3e}"));
        let values = values.collect::<Vec<_>>().join(", ");
        Some(format!(
            "Other numbers describe the data almost as well: {values}. The intervals do not contain them. Enter a range \
             around those that you expect, or more data."
        ))
    }

    /// How much larger the residuals are than the stated noise, if they are larger than chance allows, with the probability.
    /// Without degrees of freedom, there is none.
    fn excess(&self) -> Option<(f64, Option<f64>)> {
        let measured = &self.known.measured;
        let squares = self.points().map(|(place, _)| self.residual(place) * self.residual(place));
        let size = (squares.sum::<f64>() / self.points().count() as f64).sqrt();
        let freedom = measured.count(None) - self.fit.parameters.len() as f64;
        let ratio = (freedom >= 1.0).then(|| self.best.sum / freedom);
        let probability = ratio.map(|ratio| fisher::above(ratio, (freedom, MANY)));
        let is_told = size >= LARGE || probability.is_some_and(|it| it < IMPROBABLE);
        Some((ratio.map_or(size, |ratio| ratio.sqrt().max(size)), probability))
            .filter(|_| is_told && measured.freedom().is_none())
    }

    /// Whether the residuals are larger than the noise, and whether the law is the reason. It is not if repeated tests scatter
    /// as much.
    fn misfit(&self, lack: Option<(f64, f64)>) -> Option<(&'static str, String)> {
        let are_repeats_as_far = lack.is_some_and(|(_, probability)| probability >= IMPROBABLE);
        if let Some((size, probability)) = self.excess() {
            if are_repeats_as_far {
                let told = format!(
                    "Repeated tests scatter more than their stated errors allow. State errors that are {size:.1} times as large."
                );
                return Some(("scatter", told));
            }
            let probability = probability.map(|it| format!(" (probability {})", in_words(it)));
            let told = format!(
                "One set of parameters does not describe these tests within their stated errors: the residuals are \
                 {size:.1} times as large{}.",
                probability.unwrap_or_default()
            );
            return Some(("misfit", told));
        }
        let estimated = (0..self.fit.sets.len()).filter(|set| self.fit.sets[*set].is_estimated);
        let (set, share) =
            estimated.map(|set| (set, self.share(set))).find(|it| it.1 > WIDE_SCATTER)?;
        let told = format!(
            "`{}` scatters by {:.0} % around the fit. Repeated tests would tell whether the law is the reason.",
            self.fit.sets[set].output,
            100.0 * share
        );
        let is_at_bound = (0..self.fit.parameters.len()).any(|place| self.is_at_bound(place));
        Some(("scatter", told)).filter(|_| lack.is_none() && !is_at_bound)
    }

    /// The test of lack of fit, if points were repeated: F and its probability. Repeated points have equal predictions. In
    /// profiles they have not: all points beside the scar have the prediction 0.
    fn lack_of_fit(&self) -> Option<(f64, f64)> {
        let mut groups = BTreeMap::<(Option<usize>, &str, u64), Vec<(f64, f64)>>::new();
        for (place, _) in self.points() {
            let predicted = self.best.numbers[place].to_bits();
            let is_profile = self.fit.set(place).over == "radius";
            let key = (is_profile.then_some(place), self.fit.set(place).output.as_str(), predicted);
            groups.entry(key).or_default().push((self.residual(place), self.deviation(place)));
        }
        let spread = |group: &Vec<(f64, f64)>| {
            let weights: f64 = group.iter().map(|(_, s)| 1.0 / (s * s)).sum();
            let mean = group.iter().map(|(residual, s)| residual / s).sum::<f64>() / weights;
            group
                .iter()
                .map(|(residual, s)| (residual - mean / s) * (residual - mean / s))
                .sum::<f64>()
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
            let effects =
                own.map(|(it, point)| slopes[it] * point.weight.sqrt() / self.deviation(it));
            let square: f64 = effects.map(|effect| effect * effect).sum();
            let half = self.fit.rise(self.known) / square.sqrt();
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
        let (fit, Known { measured, noise, rows, .. }) = (self.fit, self.known);
        let noise = fit.noises.iter().zip(&noise.factors).filter_map(|(output, factor)| {
            Some(json!({"output": output.as_ref()?, "factor": number(*factor)}))
        });
        let rise = fit.rise(self.known);
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
            (x, point.value, 1.0 / (self.deviation(place) * self.deviation(place)))
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
