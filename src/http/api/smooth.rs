//! Histories of results with more points, for figures.

use axum::response::{IntoResponse as _, Response};

use crate::http::answer::representation::refused;
use crate::http::answer::stored::document;
use crate::http::api::parameters::ResultKey;
use crate::http::{App, Caller, FRESH_JSON, NoQuery, Problem, Result, Segment, blocking, read_key};
use fretwork_format::report::smooth::{Denser, Histories};
use fretwork_json as json;

/// Estimated size of the answer, in bytes.
const BYTES: usize = 1 << 15;

/// Returns the history of a run at about 60 output cycles, for smooth lines in figures.
///
/// The server computes the run again, and keeps nothing. The output cycles are evenly spaced on a logarithmic axis, from the
/// first stored one to the last. There are no such points if the result has as many output cycles, if the run would take longer
/// than an evaluation may, or if this server would compute another wear volume. The request counts as an evaluation. Links open
/// this address too.
#[utoipa::path(get, path = "/v1/results/{key}/history/smooth", operation_id = "get_smooth_history", tag = "results",
    params(ResultKey),
    responses(
        (status = 200, description = "The histories.", body = Histories),
        (status = 503, description = "Too many evaluations are computed at the same time; see `Retry-After`.",
            headers(("Retry-After" = u32, description = "Seconds."))),
    ),
)]
pub async fn smooth(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<Response> {
    let key = read_key(&key)?;
    let _turn = app.shares.evaluations.turn(&caller.owner).await;
    let stored = document(&app, &caller, &key).await?;
    let read = blocking(move || Denser::of(&stored));
    let denser = read.await?.map_err(|error| refused(&key, error))?;
    let histories = match denser {
        None => Histories::default(),
        Some(denser) => {
            let answer = app.service.recompute(&denser.run).await?;
            denser.histories(&answer.body).map_err(Problem::bug)?
        }
    };
    Ok((FRESH_JSON, json::write(&histories, BYTES)).into_response())
}
