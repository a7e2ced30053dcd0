//! Stored results, and what requests read of them.

use std::io;

use axum::body::Bytes;
use axum::http::header;
use tokio::task;

use crate::http::access::caller::Caller;
use crate::http::app::App;
use crate::http::problem::{Problem, Result, kinds};
use crate::http::shares::{LargeDocument, longest_wait};
use crate::http::wire::instant;
use fretwork_job::Key;
use fretwork_store::{Body, Error, Reach, StoredResult};

/// A stored result.
pub enum Stored {
    /// The result, from memory or from the database.
    Small(Body),
    /// The result is large, and was not read. Its JSON has this many bytes.
    Large(usize),
}

/// The JSON of a large result, which is in memory as long as the permission to have it there.
struct Document {
    json: Bytes,
    _large: LargeDocument,
}

impl AsRef<[u8]> for Document {
    fn as_ref(&self) -> &[u8] {
        &self.json
    }
}

/// A result; `None` if it is not stored.
pub async fn stored(app: &App, key: &Key) -> Result<Option<Stored>> {
    if let Some(answer) = app.memory.get(&key.to_string()) {
        return Ok(Some(Stored::Small(Body::of(answer.body))));
    }
    Ok(match app.store.small_result(key).await? {
        Some(StoredResult::Whole(body)) => Some(Stored::Small(body)),
        Some(StoredResult::Large(size)) => Some(Stored::Large(size)),
        Some(StoredResult::Evicted { .. }) | None => None,
    })
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
        Some(Stored::Small(body)) => {
            app.store.was_read(key);
            return Ok(body.json().map_err(damaged)?);
        }
        Some(Stored::Large(_)) => {}
        None => return Err(missing(app, &caller.reach(), key).await),
    }
    let large = app.shares.large_document(longest_wait(), &caller.owner).await?;
    let Some(StoredResult::Whole(body)) = app.store.result(key).await? else {
        return Err(missing(app, &caller.reach(), key).await);
    };
    // The thread keeps the permission if the client disconnects.
    let read = move || Ok(Bytes::from_owner(Document { json: body.json()?, _large: large }));
    let json: io::Result<_> = task::spawn_blocking(read).await.map_err(Problem::bug)?;
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
