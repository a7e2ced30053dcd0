//! Stored results, and what requests read of them.

use axum::body::Bytes;
use axum::http::header;

use crate::http::access::caller::Caller;
use crate::http::app::App;
use crate::http::problem::{Problem, Result, blocking, kinds};
use crate::http::shares::{holding, longest_wait};
use crate::http::wire::instant;
use fretwork_job::Key;
use fretwork_store::{Body, Error, Reach, StoredResult};

/// A result, from memory or from the database. The body of a large result is not read.
pub async fn stored(app: &App, key: &Key) -> Result<Option<StoredResult>> {
    if let Some(answer) = app.memory.get(&key.to_string()) {
        return Ok(Some(StoredResult::Whole(Body::of(answer.body))));
    }
    Ok(app.store.small_result(key).await?)
}

/// Checks that a result is stored. Otherwise, returns the problem. The problem links to the job that computes the
/// result, if there is one that the caller may see.
pub async fn require(app: &App, reach: &Reach, key: &Key) -> Result<()> {
    match app.store.small_result(key).await? {
        Some(StoredResult::Whole(_) | StoredResult::Large(_)) => Ok(()),
        Some(StoredResult::Evicted { .. }) | None => Err(missing(app, reach, key).await),
    }
}

/// Reads the JSON of a result. Of large results, the server has one at a time in memory as JSON: other requests wait until
/// these bytes are dropped.
pub async fn document(app: &App, caller: &Caller, key: &Key) -> Result<Bytes> {
    let damaged = |_| Error::DamagedResult(*key);
    match stored(app, key).await? {
        Some(StoredResult::Whole(body)) => {
            app.store.was_read(key);
            return Ok(body.json().map_err(damaged)?);
        }
        Some(StoredResult::Large(_)) => {}
        _ => return Err(missing(app, &caller.reach(), key).await),
    }
    let large = app.shares.large_document(longest_wait(), &caller.owner).await?;
    let Some(StoredResult::Whole(body)) = app.store.result(key).await? else {
        return Err(missing(app, &caller.reach(), key).await);
    };
    // The thread keeps the permission if the client disconnects.
    let json = blocking(move || body.json().map(|json| holding(json, large))).await?;
    Ok(json.map_err(damaged)?)
}

/// The problem for a result that is not stored.
pub async fn missing(app: &App, reach: &Reach, key: &Key) -> Problem {
    let asked =
        async { Ok((app.store.small_result(key).await?, app.store.live_job(key, reach).await?)) };
    let (found, live) = match asked.await {
        Ok(both) => both,
        Err(error) => return Error::into(error),
    };
    let problem = if let Some(StoredResult::Evicted { at, deleted_by, asked }) = found {
        let next = if let Some(job) = live {
            format!(
                "The server computes the result again. Wait for it: GET /v1/jobs/{job}?wait=10."
            )
        } else {
            let member = asked.as_ref().map_or("scenario", |asked| asked.kind.member());
            format!(
                "To compute it again, submit {{\"{member}\": …}} with the `{member}` of this answer to POST \
                 /v1/jobs."
            )
        };
        let gone = match deleted_by {
            Some(who) => format!("deleted by {who} on {}", instant(at)),
            None => format!("evicted on {} to free disk space", instant(at)),
        };
        let detail = format!("The result was {gone}. {next}");
        Problem::new(&kinds::EVICTED, detail).with_asked(asked)
    } else {
        let detail = live.map_or_else(
            || "No result has this key. Submit its scenario to POST /v1/jobs.".to_owned(),
            |job| format!("The result is being computed. Wait for it: GET /v1/jobs/{job}?wait=10."),
        );
        Problem::new(&kinds::UNKNOWN_RESULT, detail)
    };
    match live {
        Some(job) => {
            problem.with_header(header::LINK, format!("</v1/jobs/{job}>; rel=\"related\""))
        }
        None => problem,
    }
}
