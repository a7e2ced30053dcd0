//! A scenario, the numbers in it that a study varies, and the outputs that the study takes from each result.

use fretwork_engine::{Case, Fault, Faults, Method, Valid, scenario};
use serde_json::{Map, Value};

use super::vary;
use super::{CommonProfiles, Ended, Member, NoValue, Output, OutputName, Run, Varied};
use fretwork_json::{Distinct, typed};

/// The members of a study that take most of its memory. They are read without copying them.
const LARGE: [&str; 3] = ["scenario", "vary", "outputs"];
/// Maximum number of outputs.
const MAX_OUTPUTS: usize = 100;
/// Processor time to prepare a run, in seconds: a constant part, and a part for each value in the scenario. The
/// estimate of the engine does not contain it.
const PREPARATION: (f64, f64) = (15e-6, 0.3e-6);

/// Why a run has no curves.
const NO_PROFILES: &str = "profiles: the run ended exactly at an earlier output cycle";

/// Largest seed: the largest integer that every JSON parser reads exactly.
pub(super) const MAX_SEED: u64 = 1 << 53;

/// The small members of a study: all except [`LARGE`].
pub(super) fn small_members(study: &Value) -> Map<String, Value> {
    let members = study.as_object().into_iter().flatten();
    let small = members.filter(|(name, _)| !LARGE.contains(&name.as_str()));
    small.map(|(name, value)| (name.clone(), value.clone())).collect()
}

/// A scenario whose outputs depend on some of its numbers.
#[derive(Debug)]
pub struct Problem {
    /// The scenario. It has no profiles.
    pub base: Value,
    /// The numbers that vary.
    pub members: Vec<Member>,
    /// The scalars that are taken from each result.
    pub outputs: Vec<Output>,
    /// The curves that are taken from each result.
    pub profiles: Option<CommonProfiles>,
    /// Whether the relative numerical errors of the outputs follow the outputs of a run.
    pub has_errors: bool,
    /// The number of JSON values in the scenario.
    pub(super) size: usize,
}

/// The outputs and the curves of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The outputs, in the order of the problem; `None` where there is no value.
    pub outputs: Vec<Option<f64>>,
    /// The curves, in the order of the problem.
    pub profiles: Vec<Vec<Option<f64>>>,
    /// Why the point has no outputs, or not all of them.
    pub lack: Option<Lack>,
}

/// Why a point lacks outputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Lack {
    /// The scenario with the values of this point is not valid.
    Refused(String),
    /// An output has no value.
    Incomplete(String),
}

impl Problem {
    /// A problem of a valid scenario.
    pub fn new(base: Value, members: Vec<Member>, outputs: Vec<Output>) -> Self {
        let size = size_of_tree(&base);
        Self { base, members, outputs, profiles: None, has_errors: false, size }
    }

    /// Estimated processor time to prepare a run, in seconds.
    pub(super) fn preparation(&self) -> f64 {
        PREPARATION.0 + PREPARATION.1 * self.size as f64
    }

    /// Begins the run with these values of the members, in SI. If its scenario is not valid, returns a [`Found`]
    /// without outputs, which states the reason.
    pub(super) fn start(&self, values: &[f64]) -> Result<Run, Found> {
        let case = self.case(values).map_err(|reason| {
            let lack = Some(Lack::Refused(reason));
            Found { lack, ..self.no_run() }
        })?;
        Ok(self.run(case))
    }

    /// The run of a case.
    pub(super) fn run(&self, case: Case) -> Run {
        Run::new(case, self.needs_run(), Vec::new())
    }

    pub(super) fn needs_run(&self) -> bool {
        self.profiles.is_some() || self.outputs.iter().any(Output::needs_run)
    }

    /// Estimated processor time of a point, in seconds.
    pub fn seconds(&self, values: &[f64]) -> f64 {
        let run = self.case(values).ok().filter(|_| self.needs_run());
        self.preparation() + run.map_or(0.0, |case| case.seconds())
    }

    /// The outputs and the curves of a run that has ended.
    pub(super) fn found(&self, run: &Ended) -> Found {
        let found = self.outputs_of(run);
        let asked = self.profiles.as_ref().zip(run.outcome());
        let no_profiles = || Some(Lack::Incomplete(NO_PROFILES.to_owned()));
        match asked.map(|(profiles, outcome)| profiles.of(outcome)) {
            None => found,
            Some(Some(profiles)) => Found { profiles, ..found },
            Some(None) => Found { lack: found.lack.or_else(no_profiles), ..found },
        }
    }

    fn no_profiles(&self) -> Vec<Vec<Option<f64>>> {
        self.profiles.as_ref().map(CommonProfiles::missing).unwrap_or_default()
    }

    fn outputs_of(&self, run: &Ended) -> Found {
        let mut lack = None;
        let outputs = self.outputs.iter().map(|output| match run.value(output) {
            Ok(number) => Some(number),
            // An event that did not happen is a valid answer, so the point is not incomplete.
            Err(NoValue::NoEvent) => None,
            Err(why) => {
                lack.get_or_insert_with(|| Lack::Incomplete(format!("{}: {why}", output.name())));
                None
            }
        });
        let error = |output: &Output| Some(output.accuracy(run.case, run.outcome()));
        let errors = self.outputs.iter().filter(|_| self.has_errors).map(error);
        Found { outputs: outputs.chain(errors).collect(), profiles: self.no_profiles(), lack }
    }

    /// A [`Found`] without values, for a point without a run.
    pub(super) fn no_run(&self) -> Found {
        let outputs = vec![None; self.outputs.len()];
        Found { outputs, profiles: self.no_profiles(), lack: None }
    }

    /// The case of a point, or the first reason why its scenario is not valid.
    pub(super) fn case(&self, values: &[f64]) -> Result<Case, String> {
        self.prepare(values).map_err(|faults| {
            let first = faults.0.into_iter().next();
            first.map_or_else(String::new, |Fault { pointer, detail }| {
                format!("{pointer}: {detail}")
            })
        })
    }

    /// The case of a point.
    ///
    /// # Errors
    /// The scenario of this point has faults. Their pointers are relative to the scenario.
    pub(super) fn prepare(&self, values: &[f64]) -> Valid<Case> {
        let mut scenario = self.base.clone();
        for (member, value) in self.members.iter().zip(values) {
            member.put(&mut scenario, *value);
        }
        let (_, mut case, _) = scenario::prepare(scenario, "")?;
        if let Method::Exact { compare, .. } = &mut case.method {
            *compare = None;
        }
        case.profiles.fill(false);
        if let Some(last) = case.profiles.last_mut() {
            *last = self.profiles.is_some();
        }
        Ok(case)
    }
}

/// The number of JSON values in a document: numbers, texts, lists, objects and so on.
fn size_of_tree(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(size_of_tree).sum(),
        Value::Object(members) => members.values().map(size_of_tree).sum(),
        _ => 0,
    }
}

/// Checks a scenario, and reads which of its numbers a study varies and which outputs the study has.
///
/// # Errors
/// All faults, with pointers relative to the study.
pub(super) fn varied_and_outputs(
    scenario: &Value,
    vary: &[Value],
    outputs: Value,
) -> Valid<(Vec<Varied>, Vec<Output>)> {
    let mut faults = Faults::default();
    faults.keep("", scenario::prepare(scenario.clone(), "/scenario"));
    let varied = faults.keep("/vary", vary::list(vary, scenario)).unwrap_or_default();
    let outputs = faults.keep("/outputs", outputs_of(outputs, scenario)).unwrap_or_default();
    faults.or((varied, outputs))
}

/// The outputs of a scenario with these names. Faults have pointers such as `/0`.
///
/// # Errors
/// `names` is not a list of names, or the scenario does not have these outputs. If `cycles` of the scenario has faults,
/// the list is empty: the check of the scenario reports them.
pub fn outputs_of(names: Value, scenario: &Value) -> Valid<Vec<Output>> {
    let Distinct(names) = typed::<Distinct<OutputName, MAX_OUTPUTS>>(names)?;
    if names.is_empty() {
        return Err(Faults::one("", "must list at least one output, such as \"wear_volume\""));
    }
    OutputName::all_among(names, scenario)
}
