//! What a job computes: read from its body, done step by step, and left behind as an answer.

use std::time::Duration;

use bytes::Bytes;
use deserr::{Deserr, IntoValue, Sequence, ValuePointerRef};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::RawValue;

use super::{Key, Outline};
use fretwork_engine::outcome::{Outcome, ResultUnits};
use fretwork_engine::request::fault::Faults;
use fretwork_engine::request::fields::Given;
use fretwork_engine::scenario::{self, Scenario, Warning};
use fretwork_engine::simulation::{self, Simulation};

/// Something a worker can compute, in steps of at most about 50 ms, so that it can be stopped.
pub trait Work: Send {
    /// Does a little more.
    fn step(&mut self) -> Step;
}

/// What a step of [`Work`] came to.
#[derive(Debug)]
pub enum Step {
    /// There is more to do; `progress` is in 0…1.
    Working {
        /// The share of the work done so far.
        progress: f64,
    },
    /// The work is done.
    Done(Answer),
}

/// What a finished piece of work leaves behind.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The result document as it is served: JSON, a pure function of the key.
    pub body: Bytes,
    /// The short form that the job answer carries: the last history entry and the regime.
    pub summary: Value,
    /// The words and numbers by which users search for the result.
    pub outline: Box<Outline>,
}

/// What it cost to compute something.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cost {
    /// By the clock.
    pub wall: Duration,
    /// Of a processor; none where the system does not say.
    pub cpu: Option<Duration>,
}

/// The short form of a result: its regime and the last entry of each column of its history.
#[must_use]
pub fn summary(regime: &Value, history: &serde_json::Map<String, Value>) -> Value {
    let mut summary = serde_json::Map::from_iter([("regime".to_owned(), regime.clone())]);
    for (name, column) in history {
        let last = column.as_array().and_then(|column| column.last()).cloned();
        summary.insert(name.clone(), last.unwrap_or_default());
    }
    Value::Object(summary)
}

/// What a processor does in a second, in the terms of [`Case::operations`].
///
/// [`Case::operations`]: fretwork_engine::case::Case::operations
const OPERATIONS_PER_SECOND: f64 = 1e9;

/// What a job computes.
#[derive(Debug, Clone, PartialEq)]
pub enum Task {
    /// One simulation.
    Run(Scenario),
}

/// A parsed job body: `{"scenario": {…}, "label"?, "tags"?}`.
#[derive(Debug, Clone)]
pub struct Submission {
    /// What to compute.
    pub task: Task,
    /// A line for people.
    pub label: Option<String>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// What the physics says the user should know.
    pub warnings: Vec<Warning>,
}

/// Longest label in characters.
pub const MAX_LABEL: usize = 200;
/// Most tags of a job.
pub const MAX_TAGS: usize = 20;
/// Longest tag in characters.
pub const MAX_TAG: usize = 50;

/// A job body as JSON; the scenario is judged by the engine.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Body {
    scenario: Value,
    #[deserr(default)]
    label: Given<Text<MAX_LABEL>>,
    #[deserr(default)]
    tags: Given<Tags>,
}

/// A text of 1 to `N` characters, none of them a control character.
struct Text<const N: usize>(String);

impl<const N: usize> Deserr<Faults> for Text<N> {
    fn deserialize_from_value<V: IntoValue>(
        value: deserr::Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        let text: String = String::deserialize_from_value(value, location)?;
        let length = text.chars().count();
        if length == 0 || length > N {
            let detail = format!("must have 1 to {N} characters, not {length}");
            return Err(Faults::at(location, detail));
        }
        if text.chars().any(char::is_control) {
            return Err(Faults::at(location, "must not contain control characters"));
        }
        Ok(Self(text))
    }
}

struct Tags(Vec<String>);

impl Deserr<Faults> for Tags {
    fn deserialize_from_value<V: IntoValue>(
        value: deserr::Value<V>,
        location: ValuePointerRef<'_>,
    ) -> Result<Self, Faults> {
        if let deserr::Value::Sequence(list) = &value
            && list.len() > MAX_TAGS
        {
            let detail = format!("must list at most {MAX_TAGS} tags, not {}", list.len());
            return Err(Faults::at(location, detail));
        }
        let tags = Vec::<Text<MAX_TAG>>::deserialize_from_value(value, location)?;
        let tags: Vec<String> = tags.into_iter().map(|tag| tag.0).collect();
        match (1..tags.len()).find(|i| tags[..*i].contains(&tags[*i])) {
            Some(twice) => Err(Faults::at(location.push_index(twice), "is listed twice")),
            None => Ok(Self(tags)),
        }
    }
}

impl Submission {
    /// Reads a job body.
    ///
    /// # Errors
    /// Every fault of the body and of its scenario, with JSON pointers.
    pub fn parse(body: &Value) -> Result<Self, Faults> {
        let parsed: Result<Body, Faults> =
            Body::deserialize_from_value(body.clone().into_value(), ValuePointerRef::Origin);
        match (parsed, body.get("scenario")) {
            (Ok(parsed), _) => {
                let (scenario, warnings) = scenario::check(&parsed.scenario, "/scenario")?;
                Ok(Self {
                    task: Task::Run(scenario),
                    label: parsed.label.0.map(|label| label.0),
                    tags: parsed.tags.0.map_or_else(Vec::new, |tags| tags.0),
                    warnings,
                })
            }
            (Err(mut faults), Some(given)) => {
                if let Err(more) = scenario::check(given, "/scenario") {
                    faults.0.extend(more.0);
                }
                Err(faults)
            }
            (Err(faults), None) => Err(faults),
        }
    }
}

impl Task {
    /// The address of this task's result.
    #[must_use]
    pub fn key(&self) -> Key {
        let Self::Run(scenario) = self;
        Key::of(ENGINE.numerics, scenario)
    }

    /// The form in which a task is stored: the job body in canonical terms.
    #[must_use]
    pub fn to_json(&self) -> String {
        let Self::Run(scenario) = self;
        serde_json::json!({ "scenario": scenario }).to_string()
    }

    /// The scenario of a stored task, as it stands there: canonical, and so of the same key when it is
    /// submitted again. None where the text is no task.
    #[must_use]
    pub fn scenario(stored: &str) -> Option<&RawValue> {
        #[derive(Deserialize)]
        struct Stored<'a> {
            #[serde(borrow)]
            scenario: &'a RawValue,
        }
        let Stored { scenario } = serde_json::from_str(stored).ok()?;
        Some(scenario)
    }

    /// About how long a processor takes for it.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let Self::Run(scenario) = self;
        scenario.case().map_or(0.0, |case| case.operations() / OPERATIONS_PER_SECOND)
    }

    /// Begins the work of a stored task, whose answer will carry `key`.
    ///
    /// # Errors
    /// A sentence, where the stored text is not a task that this version can compute, or not the
    /// one of this key.
    pub fn start(key: &Key, stored: &str) -> Result<Box<dyn Work>, String> {
        let body: Value = serde_json::from_str(stored).map_err(|error| error.to_string())?;
        let submission = Submission::parse(&body).map_err(|faults| {
            let faults: Vec<_> = faults
                .0
                .iter()
                .map(|fault| format!("{}: {}", fault.pointer, fault.detail))
                .collect();
            faults.join("; ")
        })?;
        // After a change of `numerics` this version would leave other digits under the old key.
        if submission.task.key() != *key {
            return Err("it was stored for another version of the engine".to_owned());
        }
        let Self::Run(scenario) = submission.task;
        let simulation = Simulation::of(&scenario).map_err(|fault| fault.detail)?;
        Ok(Box::new(Run { key: *key, scenario, simulation }))
    }
}

/// Name and `numerics` version of the engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Engine {
    /// Its name.
    pub name: &'static str,
    /// Rises when digits change.
    pub numerics: u32,
}

/// The engine of this program.
pub const ENGINE: Engine = Engine { name: "fretwork", numerics: scenario::NUMERICS };

/// One simulation under way.
struct Run {
    key: Key,
    scenario: Scenario,
    simulation: Simulation,
}

impl Work for Run {
    fn step(&mut self) -> Step {
        match self.simulation.step() {
            simulation::Advance::Working(progress) => Step::Working { progress },
            simulation::Advance::Done(outcome) => Step::Done(self.answer(&outcome)),
        }
    }
}

impl Run {
    fn answer(&self, outcome: &Outcome) -> Answer {
        #[derive(Serialize)]
        struct Document<'a> {
            key: Key,
            engine: Engine,
            scenario: &'a Scenario,
            units: ResultUnits,
            #[serde(flatten)]
            outcome: &'a Outcome,
        }
        let document = Document {
            key: self.key,
            engine: ENGINE,
            scenario: &self.scenario,
            units: ResultUnits,
            outcome,
        };
        let history = match serde_json::to_value(&outcome.history) {
            Ok(Value::Object(columns)) => columns,
            _ => serde_json::Map::new(),
        };
        let summary = summary(&serde_json::json!(outcome.regime), &history);
        let outline = Outline::of(&serde_json::json!({
            "scenario": self.scenario,
            "scales": outcome.scales,
            "unworn": outcome.unworn,
            "summary": summary,
        }));
        // Columns of numbers always serialise.
        let mut body = serde_json::to_vec(&document).unwrap_or_default();
        // It may stay in memory for long.
        body.shrink_to_fit();
        Answer { body: body.into(), summary, outline: Box::new(outline) }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn body(scenario: &Value) -> Value {
        json!({"scenario": scenario})
    }

    fn ball() -> Value {
        json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "bodies": [
                {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3},
                {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}
            ],
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N", "held": "depth"},
            "motion": {"amplitude": "2.256 um"},
            "cycles": [1000, 3000, 10000, 30000],
        })
    }

    fn key(scenario: &Value) -> Key {
        Submission::parse(&body(scenario)).unwrap_or_else(|faults| panic!("{faults:?}")).task.key()
    }

    #[test]
    fn what_means_the_same_has_the_same_key() {
        let expected = key(&ball());
        let same = |change: &dyn Fn(&mut Value)| {
            let mut scenario = ball();
            change(&mut scenario);
            assert_eq!(key(&scenario), expected, "{scenario}");
        };
        same(&|s| s["profile"]["radius"] = json!(0.01));
        same(&|s| s["profile"]["radius"] = json!("1 cm"));
        same(&|s| s["load"]["normal_force"] = json!("0.1 kN"));
        same(&|s| s["motion"] = json!({"amplitude": "2256 nm", "held": "amplitude"}));
        same(&|s| s["wear"] = json!({"coefficient": 3.03e-14}));
        same(&|s| s["wear"] = json!({"coefficient": 3.03e-5, "hardness": 1e9}));
        same(&|s| s["wear"] = json!({"energy_coefficient": 3.03e-14 / 0.7}));
        same(&|s| s["cycles"] = json!([0, 1000, 3000, 10000, 30000]));
        same(&|s| s["profiles_at"] = json!("all"));
        same(&|s| s["profiles_at"] = json!([1000, 3000, 10000, 30000]));
        same(&|s| s["model"] = json!({"points": 256, "xi": 0.8, "method": "simplified"}));
        // E* = E/(2(1−ν²)), G* = E/((1+ν)(2−ν)): to 15 digits.
        same(&|s| {
            s.as_object_mut().expect("an object").remove("bodies");
            s["moduli"] =
                json!({"normal": 112_637_362_637.363, "tangential": 92_760_180_995.475_1});
        });
        // The depth that 100 N press in.
        let canonical = serde_json::to_value(ball_task()).expect("a document");
        same(&|s| s["load"] = json!({"indentation_depth": canonical["load"]["indentation_depth"]}));
        same(&|s| *s = canonical.clone());
    }

    fn ball_task() -> Scenario {
        let Task::Run(scenario) = Submission::parse(&body(&ball())).expect("valid").task;
        scenario
    }

    #[test]
    fn what_means_something_else_has_another_key() {
        let expected = key(&ball());
        for (pointer, value) in [
            ("/friction", json!(0.700_000_000_01)),
            ("/profile/shape", json!("sphere")),
            ("/cycles/0", json!(1001)),
            ("/motion/amplitude", json!("2.257 um")),
        ] {
            let mut scenario = ball();
            *scenario.pointer_mut(pointer).expect(pointer) = value;
            assert_ne!(key(&scenario), expected, "{pointer}");
        }
        let mut scenario = ball();
        scenario["model"] = json!({"points": 255});
        assert_ne!(key(&scenario), expected);
    }

    /// The forgotten bump of `NUMERICS`: these digests change with any digit of the result.
    #[test]
    fn the_digits_of_numerics_1_are_these() {
        assert_eq!(ENGINE.numerics, 1, "new digits: compute the digests below anew");
        let digest = |task: &Task| {
            let key = task.key();
            let mut work = Task::start(&key, &task.to_json()).expect("a task");
            let answer = loop {
                if let Step::Done(answer) = work.step() {
                    break answer;
                }
            };
            format!("{} {}", key, Key::digest(&answer.body))
        };
        let mut exact = ball();
        exact["model"] = json!({"method": "exact"});
        let ball = digest(&Task::Run(ball_task()));
        let mut cone = ball_json_cone();
        cone["cycles"] = json!({"normalized": [0.5, 4, 16]});
        let cone = digest(&Submission::parse(&body(&cone)).expect("valid").task);
        let exact = digest(&Submission::parse(&body(&exact)).expect("valid").task);
        assert_eq!(
            [ball.as_str(), cone.as_str(), exact.as_str()],
            [
                "7262301ee85039ba4e113b17570ed2e12a9a7b34bc20bf05a1cbfc9b16860c41 \
                 6ea82167d6594c4026c1e32c1365d9cd62ced461cd9e644e09b9adf23b88eddc",
                "46018b326003fb9232ee611ac34f690d304295894ade59b3f1c2af72169fdbf6 \
                 971c3d150b487307242b9d6f1f2baafaba2675c7f6d55fd61c0109c63e458775",
                "5c89ceb8cf9aeaff9e820494bc3736e7bac0978b004ba17e3c2154bd41338b08 \
                 a293a6f1e4c940afc2bbd8f44df35cf837b9e6f71fadae2a0a000c30c9e1ee6e",
            ]
        );
    }

    fn ball_json_cone() -> Value {
        let mut scenario = ball();
        scenario["profile"] = json!({"shape": "power", "exponent": 2.5, "height": "1 um",
                                     "at_radius": "0.1 mm"});
        scenario["motion"] = json!({"stick_ratio": 0.3});
        scenario
    }

    #[test]
    fn every_fault_is_listed_with_its_pointer() {
        let mut scenario = ball();
        scenario["bodies"][0]["poisson_ratio"] = json!(0.7);
        scenario["profile"]["radius"] = json!("-10 mm");
        scenario["frction"] = json!(0.7);
        scenario["wear"]["coefficient"] = json!("3 mm^3/(N parsec)");
        let mut body = body(&scenario);
        body["label"] = json!("");
        let faults = Submission::parse(&body).expect_err("five faults");
        let mut pointers: Vec<_> = faults.0.iter().map(|fault| fault.pointer.as_str()).collect();
        pointers.sort_unstable();
        assert_eq!(
            pointers,
            [
                "/label",
                "/scenario/bodies/0/poisson_ratio",
                "/scenario/frction",
                "/scenario/profile/radius",
                "/scenario/wear/coefficient",
            ]
        );
        let of = |pointer: &str| {
            &faults.0.iter().find(|fault| fault.pointer == pointer).expect(pointer).detail
        };
        assert!(of("/scenario/frction").contains("Did you mean `friction`?"));
        assert!(of("/scenario/wear/coefficient").contains("mm^3/(N m)"));
    }

    #[test]
    fn a_task_is_computed_under_its_own_key_only() {
        let stored = Task::Run(ball_task()).to_json();
        assert!(Task::start(&key(&ball()), &stored).is_ok());
        // As the key of an engine with other digits would be.
        let other = Key::digest(b"numerics 0");
        let refused = Task::start(&other, &stored).map(drop);
        assert_eq!(refused, Err("it was stored for another version of the engine".to_owned()));
    }
}
