//! Comparison of two results or scenarios.

use std::fmt;

use deserr::Deserr;
use serde::Serialize;
use serde_json::{Map, Value, json};
use utoipa::ToSchema;

use super::library::read;
use crate::http::{App, Body, Caller, NoQuery, Problem, Result, blocking, kinds, schemas};
use fretwork_engine::{Faults, Given, QUANTITIES, Valid, scenario};
use fretwork_job::{Canonical, ENGINE, Key, Outline, Prepared, TaskKind};
use fretwork_json::both;
use fretwork_store::Known;

/// Maximum number of differing parameters that an answer lists.
const DIFFERENCES: usize = 200;

/// Two results or scenarios to be compared.
#[derive(Debug, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct DiffBody {
    /// Two keys: short for `a` and `b`.
    #[deserr(default)]
    keys: Given<Vec<String>>,
    /// The first side.
    #[deserr(default)]
    a: Given<SideBody>,
    /// The second side. Without it, the server takes the result whose scenario is nearest to `a`.
    #[deserr(default)]
    b: Given<SideBody>,
}

/// A result by its key, or a scenario. Give one of the two.
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

/// The differences of two results or scenarios.
#[derive(Debug, Serialize, ToSchema)]
pub struct Diff {
    /// The first side.
    a: SideAnswer,
    /// The second side.
    b: SideAnswer,
    /// Whether the scenarios are equal.
    same_scenario: bool,
    /// The parameters that differ.
    parameters: Vec<ParameterDifference>,
    /// How many more parameters differ but are not listed.
    omitted: usize,
    /// The regime of the unworn contact and the last entry of the history of both; null unless both results are known.
    outputs: Option<Vec<OutputDifference>>,
    /// The units of the outputs.
    #[schema(value_type = Object)]
    units: Map<String, Value>,
    /// Remarks for people.
    remarks: Vec<String>,
}

/// One side of the comparison.
#[derive(Debug, Serialize, ToSchema)]
struct SideAnswer {
    /// Its key.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// The `numerics` version of the engine that its key belongs to.
    numerics: u32,
    /// `held`, `dropped` (evicted or deleted: only scenario and summary are known) or `unknown`.
    #[schema(value_type = schemas::Standing)]
    result: &'static str,
    /// The path of the result.
    link: String,
}

/// A parameter that differs.
#[derive(Debug, PartialEq, Serialize, ToSchema)]
struct ParameterDifference {
    /// Its place in the canonical scenario: a JSON pointer (RFC 6901).
    #[schema(example = "/friction")]
    pointer: String,
    /// Its value in `a`, in SI; null if `a` does not have it.
    a: Value,
    /// Its value in `b`.
    b: Value,
    /// (b − a)/|a|; null if a value is not a number, or if a is 0.
    relative: Option<f64>,
}

/// An output of both results.
#[derive(Debug, Serialize, ToSchema)]
struct OutputDifference {
    /// Its name.
    #[schema(example = "wear_volume")]
    name: String,
    /// Its value in `a`, in SI.
    a: Value,
    /// Its value in `b`.
    b: Value,
    /// (b − a)/|a|; null if a value is not a number, or if a is 0.
    relative: Option<f64>,
}

fn relative(a: &Value, b: &Value) -> Option<f64> {
    let (a, b) = (a.as_f64()?, b.as_f64()?);
    let relative = (b - a) / a.abs();
    Some(relative).filter(|relative| relative.is_finite())
}

/// Collects the differences of two documents. Lists of different lengths count as one difference.
fn differences(a: &Value, b: &Value, pointer: &str, out: &mut Vec<ParameterDifference>) {
    let mut below = |token: &dyn fmt::Display, a, b| {
        differences(a, b, &format!("{pointer}/{token}"), out);
    };
    match (a, b) {
        (Value::Object(one), Value::Object(other)) => {
            // Member names of canonical scenarios need no escapes in a pointer.
            let new = other.keys().filter(|name| !one.contains_key(*name));
            for name in one.keys().chain(new) {
                // A member that is missing is null.
                below(name, &a[name], &b[name]);
            }
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            for (place, (a, b)) in one.iter().zip(other).enumerate() {
                below(&place, a, b);
            }
        }
        _ if a == b => {}
        _ => out.push(ParameterDifference {
            pointer: pointer.to_owned(),
            a: a.clone(),
            b: b.clone(),
            relative: relative(a, b),
        }),
    }
}

/// One side of the comparison, and what the store has about it.
struct Side {
    key: Key,
    asked: Canonical,
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

    async fn of(app: &App, asked: Requested) -> Result<Self> {
        match asked {
            Requested::Key(key) => {
                let known = app.store.known(&key).await?.ok_or_else(|| {
                    let detail = format!(
                        "No result has the key {key}. Enter the `scenario` instead of the `key`."
                    );
                    Problem::new(&kinds::UNKNOWN_RESULT, detail)
                })?;
                let asked = known.asked.clone();
                Ok(Self { key, asked, numerics: known.numerics, known: Some(known) })
            }
            Requested::Scenario(prepared) => {
                let (key, asked) = (prepared.key, prepared.asked());
                let known = app.store.known(&key).await?;
                Ok(Self { key, asked, numerics: ENGINE.numerics, known })
            }
        }
    }

    /// The outline of the scenario, from its unworn contact alone.
    async fn outline(&self) -> Result<Outline> {
        if self.asked.kind != TaskKind::Run {
            let detail = "is missing. `a` is a study, and only runs have a nearest result. Enter another study as `b`";
            return Err(Problem::from(Faults::one("/b", detail)));
        }
        let scenario = self.asked.value.clone();
        blocking(move || {
            let last = scenario["cycles"].as_array().and_then(|cycles| cycles.last());
            let mut document = json!({ "kind": TaskKind::Run.word(), "scenario": scenario, "summary": { "cycles": last } });
            // A scenario of another engine version may be invalid here. Then its scales are unknown.
            let sound = scenario::check(&scenario, "").ok();
            if let Some(preview) = sound.and_then(|(scenario, _)| scenario.preview().ok()) {
                document["scales"] = json!(preview.scales);
                document["unworn"] = json!(preview.unworn);
            }
            Outline::of(&document)
        })
        .await
    }
}

/// One side of a request.
enum Requested {
    Key(Key),
    Scenario(Box<Prepared>),
}

/// Parses both sides and collects all faults. The second side is `None` if the client wants a comparison with the
/// nearest result.
fn asked(body: DiffBody) -> Valid<(Requested, Option<Requested>)> {
    let key = |text: &str, pointer: &str| match text.parse() {
        Ok(key) => Ok(Requested::Key(key)),
        Err(bad) => Err(Faults::one(pointer, format!("must be the key of a result: {bad}"))),
    };
    let side = |side: SideBody, pointer: &str| match (side.key.0, side.scenario.0) {
        (Some(text), None) => key(&text, &format!("{pointer}/key")),
        (None, Some(scenario)) => Prepared::from_scenario(scenario, &format!("{pointer}/scenario"))
            .map(|prepared| Requested::Scenario(Box::new(prepared))),
        _ => Err(Faults::one(pointer, "must have either `key` or `scenario`")),
    };
    let (a, b) = match (body.keys.0, body.a.0, body.b.0) {
        (Some(keys), None, None) => match keys.as_slice() {
            [a, b] => (key(a, "/keys/0"), key(b, "/keys/1")),
            _ => return Err(Faults::one("/keys", "must be the keys of two results")),
        },
        (None, Some(a), Some(b)) => (side(a, "/a"), side(b, "/b")),
        (None, Some(a), None) => return Ok((side(a, "/a")?, None)),
        _ => return Err(Faults::one("", "must have either `keys`, or `a` and optionally `b`")),
    };
    both(a, b).map(|(a, b)| (a, Some(b)))
}

/// Compares two results or scenarios, for example to find out why a job was not answered from the cache.
///
/// `a` and `b` are each `{"key": …}` or `{"scenario": …}`; `{"keys": [a, b]}` is short for two keys.
/// Without `b`, the server takes the stored result whose scenario is nearest to `a`. It compares canonical
/// scenarios, so units and defaults make no difference. Evicted and deleted results can be compared too.
#[utoipa::path(post, path = "/v1/results/diff", operation_id = "diff_results", tag = "results",
    request_body(content = ref("#/components/schemas/DiffBody"), description = "What to compare.",
        example = json!({"a": {"scenario": {
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "113 GPa", "tangential": "93 GPa"}, "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"}, "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "2 um"}, "cycles": [1000, 10000]}}})),
    responses(
        (status = 200, description = "The differences, in SI.", body = Diff),
        (status = 404, description = "A key is unknown, or there is no result to compare with."),
    ),
)]
pub async fn diff(app: App, caller: Caller, _: NoQuery, body: Body) -> Result<axum::Json<Diff>> {
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    // Parsing a table of 10 000 rows would block the async thread.
    let (a, b) = blocking(move || asked(read(&body)?).map_err(Problem::from)).await??;
    let except = if let Requested::Key(key) = a { Some(key) } else { None };
    let a = Side::of(&app, a).await?;
    let mut remarks = Vec::new();
    let b = if let Some(b) = b {
        Side::of(&app, b).await?
    } else {
        remarks.push("`b` is the result whose scenario is nearest to that of `a`.".to_owned());
        let nearest = app.store.nearest(&a.outline().await?, except).await?;
        let key = nearest.ok_or_else(|| {
            let detail = "The server has no other result to compare with `a`. Enter `b`.";
            Problem::new(&kinds::UNKNOWN_RESULT, detail)
        })?;
        Side::of(&app, Requested::Key(key)).await?
    };
    if a.asked.kind != b.asked.kind {
        let [a, b] = [&a, &b].map(|side| side.asked.kind.word());
        let detail =
            format!("must have two results of the same kind, but `a` is a {a} and `b` is a {b}");
        return Err(Problem::from(Faults::one("", detail)));
    }
    if a.numerics != b.numerics {
        remarks.push(format!(
            "The engines differ (numerics {} and {}): equal scenarios have different keys, and outputs \
             may differ in their last digits.",
            a.numerics, b.numerics
        ));
    }
    Ok(axum::Json(Diff::of(&a, &b, remarks)))
}

impl Diff {
    fn of(a: &Side, b: &Side, remarks: Vec<String>) -> Self {
        let mut parameters = Vec::new();
        differences(&a.asked.value, &b.asked.value, "", &mut parameters);
        let same_scenario = parameters.is_empty();
        let omitted = parameters.len().saturating_sub(DIFFERENCES);
        parameters.truncate(DIFFERENCES);
        let outputs = match (&a.known, &b.known) {
            (Some(a), Some(b)) => Some(outputs(&a.summary, &b.summary)),
            _ => None,
        };
        let is_output = |name: &str| {
            outputs.iter().flatten().any(|output: &OutputDifference| output.name == name)
        };
        let units = QUANTITIES.iter().filter(|quantity| is_output(quantity.name));
        let units = units.map(|quantity| (quantity.name.to_owned(), json!(quantity.unit)));
        let units = units.collect();
        let (a, b) = (a.answer(), b.answer());
        Self { a, b, same_scenario, parameters, omitted, outputs, units, remarks }
    }
}

/// Pairs the members that both summaries have.
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
    fn each_difference_has_a_pointer_and_a_relative_change() {
        let a = json!({"friction": 0.5, "list": [1, 2], "load": {"held": "depth"}, "table": [1]});
        let b = json!({"friction": 0.6, "list": [1, 3], "load": {"held": "force"}, "table": [1, 2],
            "until": {"wear_depth": 1e-6}});
        let mut found = Vec::new();
        differences(&a, &b, "", &mut found);
        let pointers: Vec<_> = found.iter().map(|found| found.pointer.as_str()).collect();
        assert_eq!(pointers, ["/friction", "/list/1", "/load/held", "/table", "/until"]);
        assert!((found[0].relative.unwrap() - 0.2).abs() < 1e-12);
        assert_eq!((&found[3].a, found[3].relative), (&json!([1]), None));
        assert_eq!(found[4].a, Value::Null);
    }
}
