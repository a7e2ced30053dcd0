//! Fits: the numbers of a scenario that agree best with measured volumes, depths, energies and profiles.
//!
//! The files of this room: [`data`] and [`sets`] read what was measured, [`model`] predicts it, [`search`] computes the points of
//! the fit in stages, [`interval`] seeks the ends of intervals, [`told`] judges the best parameters, [`notes`] says it in words,
//! [`findings`] lists what follows, and [`likelihood`] continues from there for samplers.

mod data;
mod findings;
mod interval;
mod likelihood;
mod model;
mod notes;
mod search;
mod sets;
mod told;

use deserr::Deserr;
use fretwork_engine::{Faults, Given, List, Valid};
use serde_json::{Value, json};

use self::data::GivenTest;
pub use self::likelihood::{Likelihood, LikelihoodCall};
use self::model::{Runs, Set};
use self::search::{Fit, FitRow};
use crate::plan::StudyFigure::{Bands, Energy, Profile, Residuals};
use crate::plan::{Column, Findings, GoesOn, Hints, Kind, OrRun, Plan, Read, Tried};
use crate::problem::{Found, Lack, Problem, small_members};
use crate::rows::{NUMBER, Rows};
use fretwork_json::{Whole, typed};

/// The kind of fits.
pub const KIND: Kind = Kind {
    name: "fit",
    title: "Fit",
    rows: "searches",
    keeps_profiles: false,
    axes: &[],
    design: "",
    designs: &[("", Hints::of(&[Bands, Residuals, Energy, Profile]))],
    offers: &[],
    read,
};

/// Defaults of `confidence` and `starts`.
const CONFIDENCE: f64 = 0.95;
const STARTS: u64 = 8;
/// Maximum number of starts.
const MAX_STARTS: u64 = 64;
/// Maximum number of parameters, and of tests.
const MAX_PARAMETERS: usize = 20;
const MAX_TESTS: usize = 200;
/// Estimated number of runs of a set in a search, and more for each parameter.
const RUNS: (f64, f64) = (4.0, 6.0);
/// Maximum bytes of a number, a name or a note in the findings.
const TEXT: usize = 400;

/// The body of a fit.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct FitBody {
    #[deserr(default, rename = "version")]
    _version: Given<Whole<1, 1>>,
    scenario: Value,
    parameters: List<Value, 1, MAX_PARAMETERS>,
    tests: List<GivenTest, 1, MAX_TESTS>,
    #[deserr(default)]
    confidence: Given<f64>,
    #[deserr(default)]
    starts: Given<Whole<1, MAX_STARTS>>,
    #[deserr(default)]
    loss: Given<Loss>,
    #[deserr(default)]
    without: Given<Vec<String>>,
}

/// What is summed over the residuals.
#[derive(Deserr, PartialEq)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Loss {
    Squares,
    Huber,
}

/// Reads a fit.
///
/// # Errors
/// All faults, with pointers relative to the fit.
fn read(fit: Value) -> Valid<Read> {
    let mut complete = small_members(&fit);
    let (problem, fit) = parsed(fit)?;
    complete.insert("confidence".to_owned(), json!(fit.confidence));
    complete.insert("starts".to_owned(), json!(fit.starts.len()));
    Ok(Read::new(complete, problem, fit))
}

fn parsed(fit: Value) -> Valid<(Problem, Fit)> {
    let FitBody { scenario, parameters, tests, confidence, starts, loss, without, .. } =
        typed(fit)?;
    let confidence = confidence.0.unwrap_or(CONFIDENCE);
    if !(0.5..=0.9999).contains(&confidence) {
        return Err(Faults::one("/confidence", "must be from 0.5 to 0.9999, such as 0.95"));
    }
    let settings = (confidence, starts.0.map_or(STARTS, |starts| starts.0) as u32);
    let without = without.0.unwrap_or_default();
    let mut fit = data::fit(&scenario, parameters.0, tests.0, settings, &without)?;
    fit.measured.is_robust = loss.0 == Some(Loss::Huber);
    Ok((Problem::new(scenario, Vec::new(), Vec::new()), fit))
}

impl Plan for Fit {
    fn points(&self) -> usize {
        self.tasks.len()
    }

    fn stages(&self) -> Vec<usize> {
        let stage = |number: usize| self.tasks[number].0;
        let begins = |number: &usize| *number == 0 || stage(*number) > stage(*number - 1);
        (0..self.tasks.len()).filter(begins).collect()
    }

    fn point(&self, _: usize) -> Vec<f64> {
        Vec::new()
    }

    fn row(&self, problem: &Problem, number: usize, rows: &Rows, tried: &[Tried]) -> OrRun<Tried> {
        let (row, lack) = match self.computed(number, rows, tried)? {
            Ok(row) => (row, None),
            Err(lack) => (FitRow::missing(), Some(Lack::Incomplete(lack))),
        };
        let FitRow { mut theta, sum, error, mut numbers, .. } = row;
        theta.resize(self.parameters.len(), f64::NAN);
        numbers.resize(self.positions.len(), f64::NAN);
        let cells = theta.into_iter().chain([sum, tried.len() as f64, error]).chain(numbers);
        let outputs = cells.map(|it| Some(it).filter(|it| it.is_finite())).collect();
        Ok(Tried { values: Vec::new(), found: Found { outputs, lack, ..problem.no_run() } })
    }

    fn asked<'a>(&'a self, problem: &'a Problem, values: &'a [f64]) -> (&'a Problem, &'a [f64]) {
        let runs = self.sets[values[0] as usize].runs.as_ref();
        (runs.map_or(problem, |runs| &runs.problem), &values[1..])
    }

    fn seconds(&self, _: &Problem, _: &[f64]) -> f64 {
        let searches = |runs: &Runs| RUNS.0 + RUNS.1 * runs.parameters.len() as f64;
        self.runs().map(|runs| searches(runs) * runs.seconds(&self.starts[0])).sum()
    }

    fn columns(&self) -> Vec<Column> {
        let parameters = self.parameters.iter();
        let parameters = parameters.map(|it| Column { name: it.column(), unit: Some(it.unit) });
        let counts =
            ["sum_of_squares", "runs", "derivative_error"].map(|name| Column::new(name, "1"));
        let numbers = self.positions.iter().enumerate().map(|(place, (set, entry))| {
            let Set { test, output, unit, x, .. } = &self.sets[*set];
            let name = format!("{}.{output}@{} #{}", self.tests[*test], x[*entry], place + 1);
            Column { name, unit: Some(*unit) }
        });
        parameters.chain(counts).chain(numbers).collect()
    }

    fn found_columns(&self) -> Vec<Column> {
        findings::COLUMNS.map(|(name, unit)| Column::new(name, unit)).to_vec()
    }

    fn findings(&self, problem: &Problem, rows: &Rows, _: GoesOn<'_>) -> Option<Findings> {
        Some(findings::findings(self, problem, rows))
    }

    fn findings_bytes(&self, problem: &Problem) -> usize {
        let names = self.positions.len() * (NUMBER * 11 + TEXT);
        let parameters = self.parameters.len();
        let words = TEXT * (30 + self.points() + parameters * (parameters + 4));
        names + words + problem.base.to_string().len()
    }

    fn memory(&self) -> usize {
        let runs = self.runs().map(|runs| 150 * runs.problem.size).sum::<usize>();
        runs + 400 * self.positions.len()
    }
}
