//! A scenario as a function of some of its numbers, whose values are some of its outputs.

use std::collections::HashSet;

use deserr::Deserr;
use fretwork_engine::{Faults, Given, Valid, scenario};
use serde_json::Value;

use super::totals;
use super::{Ended, Member, NoValue, Output, OutputName, Problem, Run};
use fretwork_json::{Distinct, typed};

/// Maximum number of parameters of a model, and of its outputs.
const MOST: usize = 100;
/// Approximate memory of a value of a scenario with its name, in bytes.
const VALUE_BYTES: usize = 150;
/// The example job whose scenario is the default: a steel ball, computed by the simplified rule.
const DEFAULT: &str = include_str!("../../../examples/steel-ball-simplified.json");

/// A function from numbers of a scenario to outputs of its result.
#[derive(Debug)]
pub struct Model(Problem);

/// The values of the outputs at a point.
#[derive(Debug)]
pub struct PointValues {
    /// Each value, or why there is none.
    pub values: Vec<Result<f64, NoValue>>,
    /// The relative error that each value can have.
    pub accuracies: Vec<f64>,
    /// Whether each value has a closed form.
    pub closed: Vec<bool>,
}

#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Config {
    #[deserr(default)]
    scenario: Given<Value>,
    #[deserr(default)]
    parameters: Given<Distinct<String, MOST>>,
    #[deserr(default)]
    outputs: Given<Distinct<OutputName, MOST>>,
}

impl Model {
    /// Reads `{"scenario"?: {…}, "parameters"?: ["/friction", …], "outputs"?: ["wear_volume", …]}`. The defaults are
    /// the example `steel-ball-simplified`, `/friction` and `wear_volume`.
    ///
    /// # Errors
    /// All faults, with pointers relative to this object.
    pub fn read(config: Value) -> Valid<Self> {
        let config: Config = typed(config)?;
        let parameters =
            config.parameters.0.map_or_else(|| vec!["/friction".to_owned()], |it| it.0);
        let wear_volume = || "wear_volume".parse().into_iter().collect();
        let outputs = config.outputs.0.map_or_else(wear_volume, |outputs| outputs.0);
        Self::new(config.scenario.0.unwrap_or_else(default_scenario), &parameters, outputs)
    }

    /// A model with the scenario `base`.
    ///
    /// # Errors
    /// All faults, with pointers such as `/scenario/friction`, `/parameters/0` and `/outputs/0`.
    pub fn new(mut base: Value, parameters: &[String], outputs: Vec<OutputName>) -> Valid<Self> {
        let mut faults = Faults::default();
        for (list, length, example) in [
            ("parameters", parameters.len(), "/friction"),
            ("outputs", outputs.len(), "wear_volume"),
        ] {
            if length == 0 {
                let detail = format!("must have at least one entry, such as \"{example}\"");
                faults.add(format!("/{list}"), detail);
            }
            if length > MOST {
                let detail = format!("must have at most {MOST} entries, not {length}");
                faults.add(format!("/{list}"), detail);
            }
        }
        let mut distinct = HashSet::new();
        if let Some(twice) = parameters.iter().position(|pointer| !distinct.insert(pointer)) {
            faults.add(format!("/parameters/{twice}"), "is listed twice");
        }
        faults.or(())?;
        totals::of_model(&mut base, parameters)?;
        let mut faults = Faults::default();
        faults.keep("", scenario::prepare(base.clone(), "/scenario"));
        let members = Faults::list(parameters.iter().map(|pointer| Member::find(&base, pointer)));
        let members = faults.keep("/parameters", members).unwrap_or_default();
        let outputs = OutputName::all_among(outputs, &base);
        let outputs = faults.keep("/outputs", outputs).unwrap_or_default();
        faults.or(())?;
        Ok(Self(Problem::new(base, members, outputs)))
    }

    /// The numbers that vary.
    pub fn members(&self) -> &[Member] {
        &self.0.members
    }

    /// The outputs.
    pub fn outputs(&self) -> &[Output] {
        &self.0.outputs
    }

    /// Approximate memory, in bytes.
    pub fn bytes(&self) -> usize {
        VALUE_BYTES * self.0.size
    }

    /// The values of the numbers in the scenario, in SI.
    pub fn origin(&self) -> Vec<f64> {
        self.members().iter().map(|member| member.value).collect()
    }

    /// Prepares the run at a point: a value in SI for each number.
    ///
    /// # Errors
    /// The scenario of this point has faults. Their pointers are relative to the scenario.
    pub fn run(&self, point: &[f64]) -> Valid<Run> {
        Ok(self.0.run(self.0.prepare(point)?))
    }

    /// The values that a run has found.
    pub fn values(&self, run: &Ended) -> PointValues {
        let outputs = || self.outputs().iter();
        PointValues {
            values: outputs().map(|output| run.value(output)).collect(),
            accuracies: outputs().map(|output| output.accuracy(run.case, run.outcome())).collect(),
            closed: outputs().map(|output| output.is_closed(run.case)).collect(),
        }
    }
}

#[expect(clippy::expect_used, reason = "the example is part of the program, and a test reads it")]
fn default_scenario() -> Value {
    let mut job: Value = serde_json::from_str(DEFAULT).expect("an example");
    job["scenario"].take()
}

#[cfg(test)]
mod tests {
    use fretwork_engine::simulation::Simulation;
    use serde_json::json;

    use super::*;

    #[test]
    fn all_faults_of_a_config_are_listed_with_their_pointers() {
        let mut scenario = default_scenario();
        scenario["wear"]["coefficient"] = json!("1 mm");
        let config = json!({"scenario": scenario, "parameters": ["/friction", "/frction"],
            "outputs": ["wear_volume@1001"]});
        let faults = Model::read(config).unwrap_err().0;
        let pointers: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
        assert_eq!(pointers, ["/scenario/wear/coefficient", "/parameters/1", "/outputs/0"]);
        let faults = Model::read(json!({"parameters": [], "outputs": []})).unwrap_err().0;
        let pointers: Vec<&str> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
        assert_eq!(pointers, ["/parameters", "/outputs"]);
    }

    #[test]
    fn the_default_model_is_the_example() {
        let model = Model::read(json!({})).unwrap();
        assert_eq!(model.origin(), [0.7]);
        let found = model.values(&model.run(&[0.7]).unwrap().step().unwrap());
        let (_, case, _) = scenario::prepare(default_scenario(), "").unwrap();
        let outcome = Simulation::new(case, Vec::new()).run();
        assert_eq!(found.values, [Ok(outcome.history.wear_volume[5])]);
    }
}
