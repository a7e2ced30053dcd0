//! What follows from the rows of a fit: tables, estimates with intervals, and the quality of the fit.

use fretwork_engine::twelve_digits;
use serde_json::{Value, json};

use super::model::Set;
use super::search::{Fit, Known, Task};
use super::told::Told;
use crate::plan::number_cells;
use crate::stats::origin::Line;
use crate::{Findings, Member, Problem, Rows};

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

/// The findings. If no start led to a minimum, they are only a note and the measured numbers.
pub fn findings(fit: &Fit, problem: &Problem, rows: &Rows) -> Findings {
    let all: Vec<usize> = (0..fit.positions.len()).collect();
    let is_measured = |it: &usize| fit.positions[*it].1 < fit.set(*it).noise.len();
    let (measured, grid): (Vec<_>, Vec<_>) = all.into_iter().partition(is_measured);
    let Some(known) = fit.known(rows, usize::MAX) else {
        let detail =
            "No start leads to numbers for all measured points. See `reason` in `searches`.";
        let notes = json!([{"kind": "no_minimum", "detail": detail}]);
        let members = vec![("table", table(fit, &measured, &[])), ("notes", notes)];
        return Findings { members, ..Findings::default() };
    };
    let told = Told::new(fit, &known);
    let parameters: Vec<Value> = (0..fit.parameters.len()).map(|it| told.parameter(it)).collect();
    // Their rows in the table of the measured numbers, and how far they are from the fit of the others.
    let outlier = |place: &usize| {
        let pointer = &fit.set(*place).pointers[fit.positions[*place].1];
        json!({"row": measured.partition_point(|it| it < place), "pointer": pointer,
            "studentized": number(told.studentized[place])})
    };
    let bands = told.bands();
    let members = vec![
        ("table", table(fit, &measured, &bands)),
        ("bands", table(fit, &grid, &bands)),
        ("notes", told.notes()),
        ("parameters", parameters.into()),
        ("correlation", told.correlation()),
        ("quality", told.quality()),
        ("outliers", told.outliers.iter().map(outlier).collect()),
        ("lines", told.lines()),
        ("estimated_scenario", told.scenario(problem)),
    ];
    let tasks: Vec<String> =
        fit.tasks.iter().map(|(_, task)| json!(task_name(fit, *task)).to_string()).collect();
    Findings { members, beside: vec![("task", tasks.join(","))] }
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

/// A number as JSON; null if it is not finite.
fn number(x: f64) -> Value {
    json!(twelve_digits(x))
}

/// The numbers at these positions, and their columns from the prediction on, if they are known.
fn table(fit: &Fit, places: &[usize], bands: &[[f64; 8]]) -> Value {
    let texts = |of: &dyn Fn(&Set) -> String| {
        places.iter().map(|place| of(fit.set(*place))).collect::<Value>()
    };
    let texts = [
        ("test", texts(&|set| fit.tests[set.test].clone())),
        ("output", texts(&|set| set.output.clone())),
        ("unit", texts(&|set| set.unit.to_owned())),
        ("over", texts(&|set| set.over.to_owned())),
    ];
    let columns = COLUMNS.iter().take(if bands.is_empty() { 2 } else { COLUMNS.len() });
    let numbers = columns.enumerate().map(|(column, (name, _))| {
        let cell = |place: &usize| match column {
            0 => Some(fit.x(*place)),
            1 => fit.set(*place).y[fit.positions[*place].1],
            _ => Some(bands[*place][column - 2]).filter(|it| it.is_finite()),
        };
        (*name, number_cells(places.iter().map(cell)))
    });
    texts.into_iter().chain(numbers).collect()
}

impl Told<'_> {
    fn parameter(&self, place: usize) -> Value {
        let (parameter, x) = (&self.fit.parameters[place], self.best.theta[place]);
        let error = self.information.covariance[place][place].sqrt();
        let error = self.known.spread * error * parameter.scale(x);
        let is_open = self.information.is_open(place);
        let known = |value: f64, is_open| if is_open { Value::Null } else { number(value) };
        let interval = self.sides[place].each_ref().map(|it| it.end().map(twelve_digits));
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
        let covariance = &self.information.covariance;
        let error = |it: usize| covariance[it][it].sqrt();
        let cell = |i: usize, j: usize| number(covariance[i][j] / (error(i) * error(j)));
        (0..count).map(|i| (0..count).map(|j| cell(i, j)).collect::<Value>()).collect()
    }

    fn quality(&self) -> Value {
        let (fit, Known { measured, noise, rows, .. }) = (self.fit, self.known);
        let noise = fit.noises.iter().zip(&noise.factors).filter_map(|(output, factor)| {
            Some(json!({"output": output.as_ref()?, "factor": number(*factor)}))
        });
        let rise = fit.rise(self.known);
        let lack = self.repeats().map(
            |it| json!({"statistic": number(it.statistic), "probability": number(it.probability)}),
        );
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
        let weight = |place| 1.0 / (self.deviation(place) * self.deviation(place));
        let weighted = own.map(|(place, it)| (self.fit.x(place), it.value, weight(place)));
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
