//! Whether the law of a fit describes its data.

use axum::response::{IntoResponse as _, Response};

use crate::http::answer::representation::refused;
use crate::http::answer::stored::document;
use crate::http::api::parameters::ResultKey;
use crate::http::{
    App, Caller, Fresh, NoQuery, Problem, Result, Segment, blocking, kinds, read_key,
};
use fretwork_format::Verdict;

/// Returns whether the law of a fit describes its data, in words.
///
/// Beside the size of the residuals, this looks for a trend: from five points of a set on, an arc or a slope of the residuals
/// that independent errors have with a probability below 5 % says that the law has another shape than the data. The server
/// computes the verdict from the stored fit, which does not contain it.
#[utoipa::path(get, path = "/v1/results/{key}/verdict", operation_id = "get_verdict", tag = "results",
    params(ResultKey),
    responses((status = 200, description = "The verdict.", body = Verdict)),
)]
pub async fn verdict(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<Response> {
    let key = read_key(&key)?;
    let _turn = app.shares.heavy.turn(&caller.owner).await;
    let stored = document(&app, &caller, &key).await?;
    let read = blocking(move || Verdict::read(&stored));
    let read = read.await?.map_err(|error| refused(&key, error))?;
    let Some(verdict) = read else {
        let detail = "Only a fit has a verdict, and this result is not a fit.";
        return Err(Problem::new(&kinds::NO_SUCH_PART, detail));
    };
    Ok(Fresh(verdict).into_response())
}
