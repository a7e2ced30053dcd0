//! Server-sent events with the progress of a job.

use std::convert::Infallible;
use std::time::Duration;

use axum::Extension;
use axum::http::header::CACHE_CONTROL;
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, StreamExt as _, stream};
use serde_json::json;
use tokio::time::sleep;

use super::jobs::{JobAnswer, visible};
use crate::http::access::Identity;
use crate::http::api::documents;
use crate::http::{App, Caller, NoQuery, Result, Segment, instant};
use fretwork_job::{Job, JobId, JobState};
use fretwork_store::{Changes, Reach};

/// The server sends a comment after this time without events, because proxies close silent connections.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// A stream checks at this interval whether its session and its key are still valid. It also checks before each event.
const CHECK_INTERVAL: Duration = Duration::from_secs(1);

/// Follows a job with server-sent events until it is finished.
///
/// The first event is a `snapshot` of the job. A `state` event with `id` 1, 2, … follows for each change of
/// state since the job was submitted; the last one contains the `job`. `progress` events come between
/// them. A client that reconnects with `Last-Event-ID` gets the later states, each exactly once. After the
/// last state the answer is 204, and the `EventSource` of a browser stops. The stream ends within
/// seconds if its session ends or its key is revoked. If a proxy delays events, use `GET /v1/jobs/{id}?wait=` instead.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", operation_id = "follow_job", tag = "jobs",
    params(
        ("id" = uuid::Uuid, Path, description = "The `id` of a job."),
        ("Last-Event-ID" = Option<String>, Header,
            description = "The `id` of the last received event."),
    ),
    responses(
        (status = 200, description = "`snapshot`, `state` and `progress` events. Their data \
            are JSON.", body = documents::JobEvent, content_type = "text/event-stream"),
        (status = 204, description = "The job is finished, and the client has all its states."),
        (status = 404, description = "No job has this id."),
    ),
)]
pub async fn follow(
    app: App,
    caller: Caller,
    identity: Option<Extension<Identity>>,
    id: Segment,
    headers: HeaderMap,
    _: NoQuery,
) -> Result<Response> {
    let job = visible(&app, &caller, &id).await?;
    let id = job.id;
    // If the client sends an unknown id, the stream begins with the first state.
    let seen: Option<usize> =
        headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok());
    let seen = seen.filter(|seen| *seen <= job.changes.len()).unwrap_or(0);
    if job.state.is_finished() && seen == job.changes.len() {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let changes = app.store.watch(&job.key);
    let identity = identity.map(|Extension(identity)| identity);
    let reach = caller.reach();
    let follower = Follower { app, id, reach, identity, changes, seen, progress: -1.0 };
    let events = Sse::new(follower.into_events()).keep_alive(KeepAlive::new().interval(KEEP_ALIVE));
    let buffering = HeaderName::from_static("x-accel-buffering");
    Ok(([(CACHE_CONTROL, "no-store"), (buffering, "no")], events).into_response())
}

/// A stream of events.
struct Follower {
    app: App,
    id: JobId,
    reach: Reach,
    /// The caller; `None` on a server without keys.
    identity: Option<Identity>,
    changes: Changes,
    /// The number of sent changes of state.
    seen: usize,
    progress: f64,
}

impl Follower {
    /// The present state of the job, and then its changes until it is finished.
    fn into_events(self) -> impl Stream<Item = Result<Event, Infallible>> {
        let batches = stream::unfold(Some((self, true)), |state| async move {
            let (mut this, is_first) = state?;
            if !is_first {
                this.change().await?;
            }
            // An error ends the stream. The client then reconnects and receives the problem.
            let job = this.app.store.job(this.id).await.ok().flatten();
            let job = job.filter(|job| this.reach.sees(&job.owner, job.private))?;
            let is_finished = job.state.is_finished();
            let events = this.events(job, is_first);
            Some((stream::iter(events).map(Ok), (!is_finished).then_some((this, false))))
        });
        batches.flatten()
    }

    /// Waits for the next change. `None` if the stream must end.
    async fn change(&mut self) -> Option<()> {
        let mut changed = false;
        while !changed {
            changed = tokio::select! {
                () = self.changes.changed() => true,
                () = sleep(CHECK_INTERVAL) => false,
                // The server stops. The client reconnects after the restart and continues with `Last-Event-ID`.
                () = self.app.service.drained() => return None,
            };
            // The session or the key is no longer valid. The client reconnects and receives the problem.
            if self.app.gate.recheck(self.identity.as_ref()).await.is_some() {
                return None;
            }
        }
        Some(())
    }

    /// The events for what has changed since the last call.
    fn events(&mut self, job: Job, is_first: bool) -> Vec<Event> {
        let mut events = Vec::new();
        let Job { state, attempt, progress, .. } = job;
        let new = job.changes[self.seen.min(job.changes.len())..].to_vec();
        let answer = JobAnswer::from(job);
        if is_first {
            events.extend(Event::default().event("snapshot").json_data(&answer));
        }
        for change in new {
            self.seen += 1;
            let at = instant(change.at);
            let mut changed = json!({"state": change.state, "attempt": change.attempt, "at": at});
            // Only the last change ends the job.
            if change.state.is_finished() {
                changed["job"] = json!(answer);
            }
            let event = Event::default().event("state").id(self.seen.to_string());
            events.extend(event.json_data(&changed));
        }
        let moved = progress.to_bits() != self.progress.to_bits();
        if state == JobState::Running && moved {
            self.progress = progress;
            let progress = json!({"progress": progress, "attempt": attempt});
            events.extend(Event::default().event("progress").json_data(&progress));
        }
        events
    }
}
