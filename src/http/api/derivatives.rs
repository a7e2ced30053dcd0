//! The derivatives of a result with respect to the numbers of its scenario.

use std::sync::Arc;

use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::library::unknown;
use crate::http::api::parameters::ResultKey;
use crate::http::{
    App, Caller, Complaint, FRESH_JSON, Problem, Query, Result, Segment, kinds, read_key, schemas,
};
use crate::service::Unable;
use fretwork_engine::{Faults, Valid};
use fretwork_job::{ENGINE, Key, TaskKind};
use fretwork_json as json;
use fretwork_study::{Entry, Jacobian, Member, Model, OutputName};

/// Estimated size of one derivative in the answer, in bytes.
const ENTRY_BYTES: usize = 160;

/// The derivatives of a result.
#[derive(Debug, Serialize, ToSchema)]
pub struct DerivativeList {
    /// The key of the result.
    #[schema(value_type = String, pattern = "^[0-9a-f]{64}$")]
    key: Key,
    /// The `numerics` version of the engine that computed the derivatives.
    numerics: u32,
    /// One entry for each output and each number.
    derivatives: Vec<Derivative>,
}

/// The derivative of an output with respect to a number of the scenario.
#[derive(Debug, Serialize, ToSchema)]
struct Derivative {
    /// The name of the output.
    #[schema(example = "wear_volume")]
    output: String,
    /// The number, as a JSON pointer (RFC 6901) into the canonical scenario. All others stay the same.
    #[schema(example = "/friction")]
    parameter: String,
    /// The derivative in SI; null if there is none.
    value: Option<f64>,
    /// The largest error of `value` that is to be expected.
    error: Option<f64>,
    /// The unit of `value`, such as `m^3/(1/Pa)`.
    #[schema(example = "m^3")]
    unit: String,
    /// `closed`: the output has a closed form, and the derivative at least 5 digits unless `error` says otherwise.
    /// `numerical`: the output is computed on a mesh or in time steps.
    #[schema(value_type = schemas::DerivativeMethod)]
    method: &'static str,
    /// Why there is no derivative.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
}

impl Derivative {
    fn of(entry: Entry, model: &Model) -> Self {
        let (output, member) = (&model.outputs()[entry.output], &model.members()[entry.member]);
        let unit = match (output.unit(), member.dimension.si()) {
            (above, "") => above.to_owned(),
            (above, below) if below.contains('/') => format!("{above}/({below})"),
            (above, below) => format!("{above}/{below}"),
        };
        let found = entry.derivative.as_ref().ok();
        Self {
            output: output.name().to_owned(),
            parameter: member.pointer.clone(),
            value: found.map(|found| found.value),
            error: found.map(|found| found.error),
            unit,
            method: if entry.is_closed { "closed" } else { "numerical" },
            reason: entry.derivative.err(),
        }
    }
}

/// The parameters and the outputs that a query names; `None` means all.
struct WantedEntries {
    parameters: Option<Vec<String>>,
    outputs: Option<Vec<OutputName>>,
}

impl WantedEntries {
    fn read(mut query: Query) -> Result<Self> {
        let list = |text: String| -> Vec<String> {
            text.split(',').map(|item| item.trim().to_owned()).collect()
        };
        let parameters = query.text("parameters").map(list);
        let names = query.text("outputs").map(list);
        let mut parsed = |name: &String| {
            name.parse().map_err(|detail: String| query.complain("outputs", detail)).ok()
        };
        let outputs = names.map(|names| names.iter().filter_map(&mut parsed).collect());
        query.finish()?;
        Ok(Self { parameters, outputs })
    }

    /// The model of a canonical scenario, and the search for all its derivatives.
    fn start(self, scenario: Value) -> Valid<(Arc<Model>, Jacobian)> {
        let parameters = self.parameters.unwrap_or_else(|| {
            let mut all = Member::outside_lists(&scenario);
            // The settings of the method are no physical quantities, except ξ.
            all.retain(|pointer| !pointer.starts_with("/model/") || pointer == "/model/xi");
            all
        });
        let all = || {
            // The derivative of an estimated error has no meaning.
            let names = OutputName::all().filter(|name| !name.ends_with("_error"));
            names.filter_map(|name| name.parse().ok()).collect()
        };
        let model = Arc::new(Model::new(scenario, &parameters, self.outputs.unwrap_or_else(all))?);
        let search = Jacobian::new(&model, &model.origin(), (0..parameters.len()).collect())?;
        Ok((model, search))
    }
}

/// The problem for the faults of a model. A fault of `parameters` or `outputs` becomes a fault of that query parameter.
fn refused(faults: Faults) -> Problem {
    let complaints: Option<Vec<Complaint>> = faults
        .0
        .iter()
        .map(|fault| {
            let name = ["parameters", "outputs"].into_iter();
            let mut name = name.filter(|name| fault.pointer.starts_with(&format!("/{name}")));
            Some(Complaint::parameter(name.next()?, fault.detail.clone()))
        })
        .collect();
    complaints.map_or_else(|| Problem::from(faults), Problem::parameters)
}

impl From<Unable> for Problem {
    fn from(unable: Unable) -> Self {
        let advice = "Name fewer `parameters`, or submit a scenario with a larger `tolerance` or fewer output cycles.";
        match unable {
            Unable::Panicked => Self::bug(unable),
            unable => Self::new(&kinds::TOO_EXPENSIVE, format!("{unable} {advice}")),
        }
    }
}

/// Returns the derivatives of the outputs of a result with respect to the numbers of its scenario.
///
/// Each derivative has an error that was checked: it follows from polynomials through 17 or more runs around the
/// scenario, and contains the error of the values: the stated error of the wear volume or of the wear depth, 3 times that
/// of the volume for forces and the indentation depth and 5 times for the energy per cycle, both relative to the unworn
/// contact, and half a cell of the mesh for the contact radius and the scar radius. The server computes these runs for each
/// request, and keeps nothing. It refuses more than an estimated 30 s. The request counts as an evaluation. Near a kink, as at
/// the threshold of gross slip, the error contains the derivatives of both sides.
#[utoipa::path(get, path = "/v1/results/{key}/derivatives", operation_id = "get_derivatives", tag = "results",
    params(
        ResultKey,
        ("outputs" = Option<Vec<String>>, Query, style = Form, explode = false,
            description = "Names of outputs as in `POST /v1/evaluate`, separated by commas. By default, all that have a \
            value, except estimated errors such as `wear_volume_error`.",
            example = json!(["wear_volume", "wear_depth"])),
        ("parameters" = Option<Vec<String>>, Query, style = Form, explode = false,
            description = "JSON pointers to numbers of the canonical scenario, separated by commas. By default, all \
            except numbers in lists and the settings of the method.",
            example = json!(["/friction"])),
    ),
    responses(
        (status = 200, description = "The derivatives.", body = DerivativeList),
        (status = 422, description = "A parameter has faults, or the runs would take too long."),
    ),
)]
pub async fn derivatives(app: App, caller: Caller, key: Segment, query: Query) -> Result<Response> {
    let wanted = WantedEntries::read(query)?;
    let key = read_key(&key)?;
    let known = app.store.known(&key).await?.ok_or_else(unknown)?;
    if known.asked.kind != TaskKind::Run {
        let detail = format!(
            "The result of a study has no derivatives, but a table. The whole result is at /v1/results/{key}."
        );
        return Err(Problem::new(&kinds::NO_SUCH_PART, detail));
    }
    let _turn = app.shares.evaluations.turn(&caller.owner).await;
    let all_outputs = wanted.outputs.is_none();
    let mut start = Some((wanted, known.asked.value));
    // This takes about 1 ms, which is too long for the async thread.
    let started = app.service.compute_in_turns(1e-3, move || {
        let (wanted, scenario) = start.take()?;
        Some(wanted.start(scenario))
    });
    let (model, mut search) = started.await?.map_err(refused)?;
    let found = app.service.compute_in_turns(search.seconds(), move || search.step()).await?;
    let shown = found.into_iter().filter(|entry| !all_outputs || entry.has_value);
    let derivatives: Vec<_> = shown.map(|entry| Derivative::of(entry, &model)).collect();
    let bytes = ENTRY_BYTES * derivatives.len();
    let answer = DerivativeList { key, numerics: ENGINE.numerics, derivatives };
    Ok((FRESH_JSON, json::write(&answer, bytes)).into_response())
}
