//! Whether the law of a fit describes its data.

use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use tokio::task;
use utoipa::ToSchema;

use crate::http::answer::representation::refused;
use crate::http::answer::stored::document;
use crate::http::api::parameters::ResultKey;
use crate::http::{App, Caller, Fresh, NoQuery, Problem, Result, Segment, kinds, read_key};
use fretwork_format::Verdict;

/// Whether the law of a fit describes its data.
#[derive(Debug, Serialize, ToSchema)]
pub struct VerdictAnswer {
    /// `holds`, perhaps but for numbers that the verdict names; `fails`: the residuals are too large; `trend`: they follow a
    /// curve; or `untested`.
    outcome: String,
    /// A sentence that names the law.
    verdict: String,
    /// Why. Names of numbers stand between grave accents, and numbers are in SI.
    reason: String,
    /// What to say beside each interval; null if the law may hold and no number disagrees.
    intervals: Option<&'static str>,
}

/// Returns whether the law of a fit describes its data, in words.
///
/// Beside the size of the residuals, this looks for a trend: from five points of a set on, an arc or a slope of the residuals
/// that independent errors have with a probability below 5 % says that the law has another shape than the data. The server
/// computes the verdict from the stored fit, which does not contain it.
#[utoipa::path(get, path = "/v1/results/{key}/verdict", operation_id = "get_verdict", tag = "results",
    params(ResultKey),
    responses((status = 200, description = "The verdict.", body = VerdictAnswer)),
)]
pub async fn verdict(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<Response> {
    let key = read_key(&key)?;
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    let stored = document(&app, &caller, &key).await?;
    let read = task::spawn_blocking(move || Verdict::read(&stored));
    let read = read.await.map_err(Problem::bug)?.map_err(|error| refused(&key, error))?;
    let Some(Verdict { outcome, verdict, reason, intervals }) = read else {
        let detail = "Only a fit has a verdict, and this result is not a fit.";
        return Err(Problem::new(&kinds::NO_SUCH_PART, detail));
    };
    let outcome = outcome.to_owned();
    Ok(Fresh(VerdictAnswer { outcome, verdict, reason, intervals }).into_response())
}
