//! Histories of results with more points, for figures.

use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use serde_json::value::RawValue;
use tokio::task;
use utoipa::ToSchema;

use crate::http::answer::representation::refused;
use crate::http::answer::stored::document;
use crate::http::api::documents;
use crate::http::api::parameters::ResultKey;
use crate::http::{App, Caller, FRESH_JSON, NoQuery, Problem, Result, Segment, read_key};
use fretwork_format::report::smooth::{Denser, Histories};
use fretwork_json as json;

/// Estimated size of the answer, in bytes.
const BYTES: usize = 1 << 15;

/// The histories of a run at more output cycles, in SI. Both are null if the stored points are the best there are.
#[derive(Debug, Serialize, ToSchema)]
pub struct SmoothHistories {
    /// The history.
    #[schema(value_type = Option<documents::Columns>)]
    history: Option<Box<RawValue>>,
    /// The history by the simplified rule; null if the result has no comparison.
    #[schema(value_type = Option<documents::Columns>)]
    simplified: Option<Box<RawValue>>,
}

/// Returns the history of a run at about 60 output cycles, for smooth lines in figures.
///
/// The server computes the run again, and keeps nothing. The output cycles are evenly spaced on a logarithmic axis, from the
/// first stored one to the last. There are no such points if the result has as many output cycles, if the run would take longer
/// than an evaluation may, or if this server would compute another wear volume. The request counts as an evaluation. Links open
/// this address too.
#[utoipa::path(get, path = "/v1/results/{key}/history/smooth", operation_id = "get_smooth_history", tag = "results",
    params(ResultKey),
    responses(
        (status = 200, description = "The histories.", body = SmoothHistories),
        (status = 503, description = "Too many evaluations are computed at the same time; see `Retry-After`.",
            headers(("Retry-After" = u32, description = "Seconds."))),
    ),
)]
pub async fn smooth(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<Response> {
    let key = read_key(&key)?;
    let _turn = app.shares.evaluations.turn(&caller.owner).await;
    let stored = document(&app, &caller, &key).await?;
    let read = task::spawn_blocking(move || Denser::of(&stored));
    let denser = read.await.map_err(Problem::bug)?.map_err(|error| refused(&key, error))?;
    let Histories { history, simplified } = match denser {
        None => Histories::default(),
        Some(denser) => {
            let answer = app.service.recompute(&denser.run).await?;
            denser.histories(&answer.body).map_err(Problem::bug)?
        }
    };
    let answer = SmoothHistories { history, simplified };
    Ok((FRESH_JSON, json::write(&answer, BYTES)).into_response())
}
