//! What makes two results, or scenarios, differ.

use axum::extract::State;
use deserr::Deserr;
use serde::Serialize;
use serde_json::{Map, Value, json};
use tokio::task;
use utoipa::ToSchema;

use super::App;
use super::library::read;
use super::problem::{self, Problem};
use super::wire::{Body, NoQuery};
use crate::job::{ENGINE, Key, Task};
use crate::store::{Known, Outline};
use fretwork_engine::outcome::UNITS;
use fretwork_engine::request::fault::{Fault, Faults};
use fretwork_engine::request::fields::Given;
use fretwork_engine::scenario;

/// So many differences of parameters are listed.
const DIFFERENCES: usize = 200;

/// Two results, or scenarios, to be compared.
#[derive(Debug, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct DiffBody {
    /// The keys of both: short for `a` and `b`.
    #[deserr(default)]
    keys: Given<Vec<String>>,
    /// The first of them.
    #[deserr(default)]
    a: Given<SideBody>,
    /// The second of them; without it, the result whose scenario is nearest to the first.
    #[deserr(default)]
    b: Given<SideBody>,
}

/// A result by its key, or a scenario: one of them.
#[derive(Debug, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct SideBody {
    /// The key of a result.
    #[deserr(default)]
    key: Given<String>,
    /// A scenario, as in a job body.
    #[deserr(default)]
    scenario: Given<Value>,
}

/// How two results, or scenarios, differ.
#[derive(Debug, Serialize, ToSchema)]
pub struct Diff {
    /// The first.
    a: SideAnswer,
    /// The second.
    b: SideAnswer,
    /// Whether the scenarios are the same.
    same_scenario: bool,
    /// The parameters that differ.
    parameters: Vec<ParameterDifference>,
    /// How many more differ, which are not listed.
    omitted: usize,
    /// The regime and the last entry of the history of both; null unless both are known.
    outputs: Option<Vec<OutputDifference>>,
    /// The units of the outputs.
    #[schema(value_type = Object)]
    units: Map<String, Value>,
    /// What else there is to know.
    remarks: Vec<String>,
}

/// One of two that are compared.
#[derive(Debug, Serialize, ToSchema)]
struct SideAnswer {
    /// Its key.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// The version of the digits under which it has this key.
    numerics: u32,
    /// `held`, `dropped` (its scenario and summary are known) or `unknown`.
    #[schema(value_type = super::openapi::Standing)]
    result: &'static str,
    /// The address of the result.
    link: String,
}

/// A parameter that differs.
#[derive(Debug, PartialEq, Serialize, ToSchema)]
struct ParameterDifference {
    /// Where it stands in the canonical scenario: a JSON pointer (RFC 6901).
    #[schema(example = "/friction")]
    pointer: String,
    /// What it is in the first, in SI; null if it is not there.
    a: Value,
    /// What it is in the second.
    b: Value,
    /// (b − a)/|a|; null for what are not numbers, or where a is 0.
    relative: Option<f64>,
}

/// An output of both.
#[derive(Debug, Serialize, ToSchema)]
struct OutputDifference {
    /// What it is called.
    #[schema(example = "wear_volume")]
    name: String,
    /// What it is in the first, in SI.
    a: Value,
    /// What it is in the second.
    b: Value,
    /// (b − a)/|a|; null for what are not numbers, or where a is 0.
    relative: Option<f64>,
}

fn relative(a: &Value, b: &Value) -> Option<f64> {
    let (a, b) = (a.as_f64()?, b.as_f64()?);
    let relative = (b - a) / a.abs();
    Some(relative).filter(|relative| relative.is_finite())
}

/// Where two documents differ. Lists of different lengths differ as a whole.
fn differences(a: &Value, b: &Value, pointer: &mut String, out: &mut Vec<ParameterDifference>) {
    let below = |token: &str, pointer: &mut String, a: &Value, b: &Value, out: &mut Vec<_>| {
        let length = pointer.len();
        pointer.push('/');
        pointer.push_str(token);
        differences(a, b, pointer, out);
        pointer.truncate(length);
    };
    match (a, b) {
        (Value::Object(one), Value::Object(other)) => {
            // Names of canonical scenarios need no escapes.
            for (name, a) in one {
                below(name, pointer, a, other.get(name).unwrap_or(&Value::Null), out);
            }
            for (name, b) in other.iter().filter(|(name, _)| !one.contains_key(*name)) {
                below(name, pointer, &Value::Null, b, out);
            }
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            for (place, (a, b)) in one.iter().zip(other).enumerate() {
                below(&place.to_string(), pointer, a, b, out);
            }
        }
        _ if a == b => {}
        _ => out.push(ParameterDifference {
            pointer: pointer.clone(),
            a: a.clone(),
            b: b.clone(),
            relative: relative(a, b),
        }),
    }
}

/// A side as it is compared.
struct Side {
    key: Key,
    scenario: Value,
    numerics: u32,
    known: Option<Known>,
}

impl Side {
    fn answer(&self) -> SideAnswer {
        let Self { key, numerics, ref known, .. } = *self;
        let result = match known {
            Some(Known { held: true, .. }) => "held",
            Some(_) => "dropped",
            None => "unknown",
        };
        SideAnswer { key, numerics, result, link: format!("/v1/results/{key}") }
    }

    async fn of_key(app: &App, key: Key) -> Result<Self, Problem> {
        let known = app.store.known(&key).await?.ok_or_else(|| {
            let detail = format!("No result has the key {key}; compare its scenario instead.");
            Problem::new(&problem::UNKNOWN_RESULT, detail)
        })?;
        let (scenario, numerics) = (known.scenario.clone(), known.numerics);
        Ok(Self { key, scenario, numerics, known: Some(known) })
    }

    async fn of_scenario(app: &App, scenario: scenario::Scenario) -> Result<Self, Problem> {
        let task = Task::Run(scenario);
        let key = task.key();
        let Task::Run(scenario) = task;
        let scenario = serde_json::to_value(scenario).map_err(|_| Problem::internal())?;
        let known = app.store.known(&key).await?;
        Ok(Self { key, scenario, numerics: ENGINE.numerics, known })
    }

    /// What results are looked for by that are like this one.
    async fn outline(&self) -> Result<Outline, Problem> {
        let given = self.scenario.clone();
        let outlined = task::spawn_blocking(move || {
            let mut document = json!({ "scenario": given });
            let mut summary = json!({});
            if let Some(last) = given["cycles"].as_array().and_then(|cycles| cycles.last()) {
                summary["cycles"] = last.clone();
            }
            // One of another version may not be sound in this one: then less is known of it.
            let sound = scenario::check(&given, "").ok();
            if let Some(preview) = sound.and_then(|(scenario, _)| scenario.preview().ok())
                && let Ok(Value::Object(preview)) = serde_json::to_value(preview)
            {
                document["scales"] = preview.get("scales").cloned().unwrap_or_default();
                document["unworn"] = preview.get("unworn").cloned().unwrap_or_default();
            }
            Outline::of(document, summary)
        });
        outlined.await.map_err(|_| Problem::internal())
    }
}

/// What is asked for: a key or a scenario, or nothing.
enum Asked {
    Key(Key),
    Scenario(Box<scenario::Scenario>),
    Nearest,
}

/// Both sides, with all faults of the body.
fn asked(body: DiffBody) -> Result<[Asked; 2], Vec<Fault>> {
    let fault = |pointer: &str, detail: &str| {
        vec![Fault { pointer: pointer.to_owned(), detail: detail.to_owned() }]
    };
    let key = |text: &str, pointer: &str| {
        text.parse().map(Asked::Key).map_err(|bad| fault(pointer, &format!("{bad}")))
    };
    let side = |side: SideBody, pointer: &str| match (side.key.0, side.scenario.0) {
        (Some(text), None) => key(&text, &format!("{pointer}/key")),
        (None, Some(scenario)) => scenario::check(&scenario, &format!("{pointer}/scenario"))
            .map(|(scenario, _)| Asked::Scenario(Box::new(scenario)))
            .map_err(|faults| faults.0),
        _ => Err(fault(pointer, "must have either `key` or `scenario`")),
    };
    let (a, b) = match (body.keys.0, body.a.0, body.b.0) {
        (Some(keys), None, None) => match keys.as_slice() {
            [a, b] => (key(a, "/keys/0"), key(b, "/keys/1")),
            _ => return Err(fault("/keys", "must be two keys")),
        },
        (None, Some(a), Some(b)) => (side(a, "/a"), side(b, "/b")),
        (None, Some(a), None) => (side(a, "/a"), Ok(Asked::Nearest)),
        _ => return Err(fault("", "must have either `keys`, or `a` and, if wanted, `b`")),
    };
    match (a, b) {
        (Ok(a), Ok(b)) => Ok([a, b]),
        (Err(a), Err(b)) => Err([a, b].concat()),
        (Err(faults), _) | (_, Err(faults)) => Err(faults),
    }
}

/// Compares two results, or a scenario with a result: why was this a miss?
///
/// `a` and `b` are each `{"key": …}` or `{"scenario": …}`; `{"keys": [a, b]}` is short for two keys.
/// Without `b`, the result that is held and whose scenario is nearest to `a` takes its place. Parameters
/// are compared in the canonical scenarios, so units and defaults make no difference. It works on
/// results that were dropped, too.
#[utoipa::path(post, path = "/v1/results/diff", operation_id = "diff_results", tag = "results",
    request_body(content = ref("#/components/schemas/DiffBody"), description = "What to compare.",
        example = json!({"a": {"scenario": {
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "113 GPa", "tangential": "93 GPa"}, "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"}, "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "2 um"}, "cycles": [1000, 10000]}}})),
    responses(
        (status = 200, description = "How they differ, in SI.", body = Diff),
        (status = 404, description = "No result has one of the keys, or none is held that could be \
            compared with."),
        (status = 507, description = "The disk is full."),
    ),
)]
pub async fn diff(
    State(app): State<App>,
    _: NoQuery,
    body: Body,
) -> Result<axum::Json<Diff>, Problem> {
    // A table may have 10 000 rows: reading it takes a while.
    let sides = task::spawn_blocking(move || asked(read(&body)?).map_err(Problem::faults));
    let [a, b] = sides.await.map_err(|_| Problem::internal())??;
    let is_key = matches!(a, Asked::Key(_));
    let a = match a {
        Asked::Scenario(scenario) => Side::of_scenario(&app, *scenario).await?,
        Asked::Key(key) => Side::of_key(&app, key).await?,
        Asked::Nearest => return Err(Problem::internal()),
    };
    let mut remarks = Vec::new();
    let b = match b {
        Asked::Scenario(scenario) => Side::of_scenario(&app, *scenario).await?,
        Asked::Key(key) => Side::of_key(&app, key).await?,
        Asked::Nearest => {
            let except = Some(a.key).filter(|_| is_key);
            let nearest = app.store.nearest(&a.outline().await?, except).await?;
            let key = nearest.ok_or_else(|| {
                let detail = "No result is held that this could be compared with.";
                Problem::new(&problem::UNKNOWN_RESULT, detail)
            })?;
            remarks.push("`b` is the result whose scenario is nearest to that of `a`.".to_owned());
            Side::of_key(&app, key).await?
        }
    };
    let mut parameters = Vec::new();
    differences(&a.scenario, &b.scenario, &mut String::new(), &mut parameters);
    let same_scenario = parameters.is_empty();
    let omitted = parameters.len().saturating_sub(DIFFERENCES);
    parameters.truncate(DIFFERENCES);
    if a.numerics != b.numerics {
        remarks.push(format!(
            "The digits are those of different versions (numerics {} and {}): equal scenarios have \
             different keys, and outputs may differ in their digits.",
            a.numerics, b.numerics
        ));
    }
    let outputs = match (&a.known, &b.known) {
        (Some(a), Some(b)) => Some(outputs(&a.summary, &b.summary)),
        _ => None,
    };
    let units = UNITS
        .iter()
        .filter(|(name, _)| outputs.iter().flatten().any(|output| output.name == *name));
    let units = units.map(|(name, unit)| ((*name).to_owned(), json!(unit))).collect();
    let (a, b) = (a.answer(), b.answer());
    Ok(axum::Json(Diff { a, b, same_scenario, parameters, omitted, outputs, units, remarks }))
}

fn outputs(a: &Value, b: &Value) -> Vec<OutputDifference> {
    let members = a.as_object().into_iter().flatten();
    members
        .filter_map(|(name, a)| {
            let (a, b) = (a.clone(), b.get(name)?.clone());
            let relative = relative(&a, &b);
            Some(OutputDifference { name: name.clone(), a, b, relative })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_pointers_and_relative_sizes() {
        let a = json!({"friction": 0.5, "list": [1, 2], "load": {"held": "depth"}, "table": [1]});
        let b = json!({"friction": 0.6, "list": [1, 3], "load": {"held": "force"}, "table": [1, 2],
            "until": {"wear_depth": 1e-6}});
        let mut found = Vec::new();
        differences(&a, &b, &mut String::new(), &mut found);
        let pointers: Vec<_> = found.iter().map(|found| found.pointer.as_str()).collect();
        assert_eq!(pointers, ["/friction", "/list/1", "/load/held", "/table", "/until"]);
        assert!((found[0].relative.unwrap() - 0.2).abs() < 1e-12);
        assert_eq!((&found[3].a, found[3].relative), (&json!([1]), None));
        assert_eq!(found[4].a, Value::Null);
    }
}
