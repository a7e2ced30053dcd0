//! Evaluates a scenario without keeping anything.

use std::sync::Arc;

use axum::Extension;
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::scenarios::{Checked, checked, parse};
use crate::http::api::documents;
use crate::http::shares::{Permit, SMALL};
use crate::http::{App, Body, Caller, FRESH_JSON, NoQuery, Problem, Result, blocking, kinds};
use crate::service::{LARGEST_EVALUATION, NotEvaluated};
use fretwork_job::Prepared;
use fretwork_json as json;
use fretwork_study::{Evaluated, Evaluation};

/// The address of evaluations.
pub const PATH: &str = "/v1/evaluate";

impl From<NotEvaluated> for Problem {
    fn from(refusal: NotEvaluated) -> Self {
        match refusal {
            NotEvaluated::TooLong(_) | NotEvaluated::TooLarge(_) | NotEvaluated::Stopped => {
                let job = "Submit a job instead: POST /v1/jobs with the same scenario.";
                Self::new(&kinds::TOO_EXPENSIVE, format!("{refusal} {job}"))
            }
            NotEvaluated::Busy => {
                Self::new(&kinds::EVALUATIONS_FULL, refusal.to_string()).retry_after(1)
            }
            NotEvaluated::Panicked => Self::bug(refusal),
        }
    }
}

/// Computes outputs of a scenario at once, and keeps nothing.
///
/// For sliders, optimisers and samplers. The run may take an estimated 150 ms; for a longer one, submit a job. The
/// numbers are those of the result that a job has. Without `profiles` and `loops` in `parts`, none are computed.
/// `check` alone needs no run, so the scenario may be of any length. Evaluations have a rate limit of their own.
#[utoipa::path(post, path = "/v1/evaluate", operation_id = "evaluate", tag = "scenarios",
    request_body(content = documents::EvaluateBody, description = "The scenario, and what to \
        return.",
        examples(
            ("ball" = (summary = "Ball on a flat", value = json!({
                "scenario": {
                    "profile": {"shape": "paraboloid", "radius": "10 mm"},
                    "moduli": {"normal": "113 GPa", "tangential": "93 GPa"}, "friction": 0.7,
                    "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
                    "load": {"normal_force": "100 N", "held": "force"},
                    "motion": {"amplitude": "2 um"}, "cycles": [1000, 10000]},
                "outputs": ["wear_volume", "wear_depth@1000", "unworn.stick_radius"]}))),
            ("coated-cylinder" = (summary = "Coated cylinder on a flat, whose friction changes", value = json!({
                "scenario": {
                    "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"},
                    "moduli": {"normal": "113 GPa"},
                    "friction": {"over": "cycles", "at": [0, 500, 5000], "values": [0.2, 0.6, 0.8]},
                    "wear": {"bodies": [
                        {"layers": [{"thickness": "1 um", "coefficient": "4e-15 1/Pa"}], "coefficient": "2e-14 1/Pa"},
                        {"coefficient": "4e-15 1/Pa"}]},
                    "load": {"normal_force": "18.5 N/mm"},
                    "motion": {"sliding_amplitude": "25 um"}, "cycles": [1000, 10000]},
                "outputs": ["contact_radius", "events.layer_worn_through"], "parts": ["profiles"]}))),
        )),
    responses(
        (status = 200, description = "The outputs.", body = documents::Evaluated),
        (status = 422, description = "The body has faults, which `errors` lists; or the run would take too long for \
            an evaluation."),
        (status = 503, description = "Too many evaluations are computed at the same time, or the memory for large \
            answers is in use; see `Retry-After`.",
            headers(("Retry-After" = u32, description = "Seconds."))),
    ),
)]
pub async fn evaluate(app: App, caller: Caller, _: NoQuery, body: Body) -> Result<Response> {
    let mut evaluation = parse(body, Evaluation::parse).await?;
    let asked = evaluation.checked.take().map(|run| Prepared::of_run(*run));
    let canonical = asked.as_ref().map_or(0, |prepared| prepared.stored.len());
    let bytes = evaluation.answer_bytes() + canonical;
    // An evaluation that waits for its turn holds no memory.
    let turn = app.shares.evaluations.turn(&caller.owner).await;
    let most = bytes.min(LARGEST_EVALUATION);
    let permit = app.shares.answers(most).hold(&caller.owner, most).await?;
    let evaluated = app.service.evaluate(evaluation).await?;
    drop(turn);
    let check = match asked {
        Some(prepared) => Some(checked(&app, prepared).await?),
        None => None,
    };
    fresh(permit, bytes, Answer { evaluated, check }).await
}

/// The answer to an evaluation.
#[derive(Serialize)]
struct Answer {
    #[serde(flatten)]
    evaluated: Evaluated,
    #[serde(skip_serializing_if = "Option::is_none")]
    check: Option<Checked>,
}

/// An answer of about `bytes` bytes that no cache may keep, and the memory that it uses.
pub(super) async fn fresh(
    mut permit: Permit,
    bytes: usize,
    answer: impl Serialize + Send + 'static,
) -> Result<Response> {
    let answer = if bytes <= SMALL {
        json::write(&answer, bytes)
    } else {
        blocking(move || json::write(&answer, bytes)).await?
    };
    permit.shrink(answer.len());
    let permit = permit.is_held().then(|| Extension(Arc::new(permit)));
    Ok((permit, FRESH_JSON, answer).into_response())
}
