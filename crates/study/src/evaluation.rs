//! An evaluation: a run that is computed for some outputs. Its result is not stored.

use deserr::Deserr;
use fretwork_engine::{
    Accuracy, Case, Faults, Given, History, Loops, Method, OutcomeEvent, Pointer, Profiles,
    QUANTITIES, Scenario, Valid, Warning, scenario,
};
use serde::Serialize;
use serde_json::{Map, Value};

use super::{Output, OutputName, Run};
use fretwork_json::{self as json, BadBody, Distinct, both, typed};

/// Longest estimated time of an evaluation, in milliseconds.
pub const LONGEST_EVALUATION: u64 = 150;
/// Maximum number of outputs of an evaluation.
const MAX_OUTPUTS: usize = 100;
/// Estimated bytes of an output in the answer: its name, value and unit, and perhaps the reason why it has no value.
const OUTPUT_BYTES: usize = 200;

/// A part of a result, or the answer to a check of the scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum EvaluationPart {
    History,
    Profiles,
    Loops,
    Events,
    Accuracy,
    Check,
}

/// A valid body `{"scenario": {…}, "outputs"?: […], "parts"?: […]}`, ready to be computed.
#[derive(Debug)]
pub struct Evaluation {
    case: Case,
    outputs: Vec<Output>,
    parts: Vec<EvaluationPart>,
    warnings: Vec<Warning>,
    run: Option<Run>,
    /// What a job of the scenario would compute, and the warnings about the two bodies. Only if the check is requested.
    pub checked: Option<Box<(Scenario, Case, Vec<Warning>)>>,
    /// Size of the body, in bytes.
    pub body_bytes: usize,
}

/// What an evaluation has found. Its JSON is the answer to the client.
#[derive(Debug, Default, Serialize)]
pub struct Evaluated {
    /// Values by the names of the outputs.
    outputs: Map<String, Value>,
    units: Map<String, Value>,
    /// The reasons of outputs without a value, by the names of the outputs.
    #[serde(skip_serializing_if = "Map::is_empty")]
    reasons: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    history: Option<History>,
    #[serde(skip_serializing_if = "Option::is_none")]
    profiles: Option<Profiles>,
    #[serde(skip_serializing_if = "Option::is_none")]
    loops: Option<Loops>,
    #[serde(skip_serializing_if = "Option::is_none")]
    events: Option<Vec<OutcomeEvent>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    accuracy: Option<Accuracy>,
    warnings: Vec<Warning>,
}

impl Evaluation {
    /// Parses a body. The faults of the scenario, of the outputs and of the parts are in one list.
    ///
    /// # Errors
    /// The text is not JSON, or it has faults.
    pub fn parse(text: &[u8]) -> Result<Self, BadBody> {
        let evaluation = json::read_body(text, Self::read)?;
        Ok(Self { body_bytes: text.len(), ..evaluation })
    }

    fn read(mut body: Value) -> Valid<Self> {
        let scenario = body.get_mut("scenario").map(Value::take);
        let envelope = typed::<Envelope>(body);
        // The faults of the envelope say that the member `scenario` is missing.
        let Some(scenario) = scenario else {
            return Err(envelope.err().unwrap_or_else(|| Faults::one("", "must be an object")));
        };
        let asked = envelope.and_then(|envelope| envelope.resolve(&scenario));
        let ((outputs, parts), prepared) = both(asked, scenario::prepare(scenario, "/scenario"))?;
        let checked = parts.contains(&EvaluationPart::Check).then(|| Box::new(prepared.clone()));
        let (scenario, mut case, mut warnings) = prepared;
        warnings.extend(scenario.warnings(&case));
        if !parts
            .iter()
            .any(|part| matches!(part, EvaluationPart::Profiles | EvaluationPart::Loops))
        {
            case.profiles.fill(false);
        }
        if let Method::Exact { compare, .. } = &mut case.method {
            *compare = None;
        }
        Ok(Self { case, outputs, parts, warnings, run: None, checked, body_bytes: 0 })
    }

    fn needs_run(&self) -> bool {
        self.parts.iter().any(|part| *part != EvaluationPart::Check)
            || self.outputs.iter().any(Output::needs_run)
    }

    /// Estimated processor time, in seconds.
    pub fn seconds(&self) -> f64 {
        if self.needs_run() { self.case.seconds() } else { 0.0 }
    }

    /// Estimated size of the answer, in bytes.
    pub fn answer_bytes(&self) -> usize {
        let tables = if self.needs_run() { self.case.answer_bytes() } else { 0 };
        tables + OUTPUT_BYTES * (self.outputs.len() + self.warnings.len())
    }

    /// Computes for at most about 30 ms. Returns the outputs and the requested parts of the result, once.
    ///
    /// # Panics
    /// An earlier call has returned them.
    pub fn step(&mut self) -> Option<Evaluated> {
        let needs_run = self.needs_run();
        let Self { case, outputs, parts, warnings, run, .. } = self;
        let run = run.get_or_insert_with(|| Run::new(case.clone(), needs_run, warnings.clone()));
        let ended = run.step()?;
        let mut found = Evaluated::default();
        for output in outputs.iter() {
            let name = || output.name().to_owned();
            let value = ended.value(output);
            found.outputs.insert(name(), value.ok().into());
            found.units.insert(name(), output.unit().into());
            if let Err(reason) = value {
                found.reasons.insert(name(), reason.to_string().into());
            }
        }
        let Ok(outcome) = ended.found else {
            return Some(Evaluated { warnings: std::mem::take(warnings), ..found });
        };
        if !parts.is_empty() {
            let others = QUANTITIES
                .iter()
                .filter(|quantity| outputs.iter().all(|output| output.name() != quantity.name));
            found.units.extend(others.map(|it| (it.name.to_owned(), it.unit.into())));
        }
        let asked = |part| parts.contains(&part);
        found.history = asked(EvaluationPart::History).then_some(outcome.history);
        found.profiles = outcome.profiles.filter(|_| asked(EvaluationPart::Profiles));
        found.loops = outcome.loops.filter(|_| asked(EvaluationPart::Loops));
        found.events = asked(EvaluationPart::Events).then_some(outcome.events);
        found.accuracy = asked(EvaluationPart::Accuracy).then_some(outcome.accuracy);
        found.warnings = outcome.warnings;
        Some(found)
    }
}

/// The members of a body other than the scenario.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields, validate = Envelope::validate -> Faults)]
struct Envelope {
    #[deserr(rename = "scenario")]
    _scenario: Value,
    #[deserr(default)]
    outputs: Given<Distinct<OutputName, MAX_OUTPUTS>>,
    #[deserr(default)]
    parts: Given<Distinct<EvaluationPart, 6>>,
}

impl Envelope {
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        let names = self.outputs.0.as_ref().map_or(0, |outputs| outputs.0.len());
        let parts = self.parts.0.as_ref().map_or(0, |parts| parts.0.len());
        if names + parts == 0 {
            let detail = "is missing. Enter `outputs`, such as [\"wear_volume\"], or `parts`, such as [\"history\"]";
            return Err(Faults::at(location.push_key("outputs"), detail));
        }
        Ok(self)
    }

    /// The outputs of the scenario with the requested names, and the requested parts.
    fn resolve(self, scenario: &Value) -> Valid<(Vec<Output>, Vec<EvaluationPart>)> {
        let names = self.outputs.0.map_or_else(Vec::new, |outputs| outputs.0);
        let outputs =
            OutputName::all_among(names, scenario).map_err(|faults| faults.below("/outputs"))?;
        Ok((outputs, self.parts.0.map_or_else(Vec::new, |parts| parts.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_evaluation_is_computed_in_steps() {
        let body = br#"{"scenario": {
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "113 GPa", "tangential": "93 GPa"}, "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"}, "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "2 um"}, "cycles": [1000]}, "outputs": ["wear_volume"]}"#;
        let mut evaluation = Evaluation::parse(body).unwrap();
        assert!(evaluation.step().is_none());
        assert!((0..100).any(|_| evaluation.step().is_some()));
    }
}
