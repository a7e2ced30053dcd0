//! A job as it goes on: server-sent events.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use axum::extract::State;
use axum::http::header::CACHE_CONTROL;
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, Stream};
use serde::Serialize;
use tokio::time::sleep;

use super::app::App;
use super::caller::Caller;
use super::jobs::{JobAnswer, visible};
use super::problem::Problem;
use super::wire::{NoQuery, Segment, instant};
use crate::job::{Job, JobId, JobState};
use crate::store::Changes;

/// So often something is sent even if nothing happens: proxies cut what is silent.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// So often a listener's key is looked at, beside whenever there is something to send.
const KEY_LOOKED_AT: Duration = Duration::from_secs(1);

/// A change of state, as it is sent.
#[derive(Serialize)]
struct Changed {
    state: JobState,
    attempt: u32,
    at: String,
    /// The whole job, with the last change.
    #[serde(skip_serializing_if = "Option::is_none")]
    job: Option<JobAnswer>,
}

#[derive(Serialize)]
struct Progress {
    progress: f64,
    attempt: u32,
}

/// Follows a job: server-sent events until it is finished.
///
/// First comes a `snapshot`, the job as it stands. Then every change of state since the job was
/// submitted, as `state` events with `id` 1, 2, …; the last one carries the whole `job`. Between
/// them `progress` events. A client that comes back with `Last-Event-ID` gets the states after that
/// one: each exactly once. When all have been seen the answer is 204, which tells a browser's
/// `EventSource` to stop. The stream also ends with the key that opened it. Where a proxy holds back
/// events, poll with `GET /v1/jobs/{id}?wait=`.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", operation_id = "follow_job", tag = "jobs",
    params(
        ("id" = uuid::Uuid, Path, description = "The `id` of a job."),
        ("Last-Event-ID" = Option<String>, Header,
            description = "The `id` of the last event that was seen."),
    ),
    responses(
        (status = 200, description = "The events: `snapshot`, `state` and `progress`, each with JSON \
            as its data.", body = super::schemas::JobEvent, content_type = "text/event-stream"),
        (status = 204, description = "The job is finished, and all its states have been seen."),
        (status = 404, description = "No job has this id."),
    ),
)]
pub async fn follow(
    State(app): State<App>,
    caller: Caller,
    Segment(id): Segment,
    headers: HeaderMap,
    _: NoQuery,
) -> Result<Response, Problem> {
    let job = visible(&app, &caller, &id).await?;
    let id = job.id;
    // An id that is none of ours is as good as none: everything is sent.
    let seen: Option<usize> =
        headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok());
    let seen = seen.filter(|seen| *seen <= job.changes.len()).unwrap_or(0);
    if job.state.is_finished() && seen == job.changes.len() {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let changes = app.service.watch(&job);
    let Caller { key, .. } = caller;
    let ready = VecDeque::new();
    let following = Following { app, id, key, changes, seen, progress: -1.0, ready };
    let events =
        Sse::new(following.into_stream()).keep_alive(KeepAlive::new().interval(KEEP_ALIVE));
    let buffering = HeaderName::from_static("x-accel-buffering");
    Ok(([(CACHE_CONTROL, "no-store"), (buffering, "no")], events).into_response())
}

/// One listener and what it has heard.
struct Following {
    app: App,
    id: JobId,
    /// What the stream was opened with; none where there are no keys.
    key: Option<String>,
    changes: Changes,
    /// So many changes of state have been sent.
    seen: usize,
    progress: f64,
    ready: VecDeque<Event>,
}

impl Following {
    fn into_stream(self) -> impl Stream<Item = Result<Event, Infallible>> {
        stream::unfold((self, Step::First), |(mut this, mut step)| async move {
            loop {
                if let Some(event) = this.ready.pop_front() {
                    return Some((Ok(event), (this, step)));
                }
                step = this.advance(step).await?;
            }
        })
    }

    /// Prepares what there is to tell, if need be after waiting for it; none at the end.
    async fn advance(&mut self, step: Step) -> Option<Step> {
        match step {
            Step::First => {}
            Step::Next => {
                let mut changed = false;
                while !changed {
                    changed = tokio::select! {
                        () = self.changes.changed() => true,
                        () = sleep(KEY_LOOKED_AT) => false,
                        // The client comes back to the next server, which knows where it stood.
                        () = self.app.service.drained() => return None,
                    };
                    // The client comes back, and is told why it may not.
                    if self.app.gate.recheck(self.key.as_deref()).await.is_some() {
                        return None;
                    }
                }
            }
            Step::Last => return None,
        }
        // An error ends the stream: the client comes back, and is told what is wrong.
        let job = self.app.service.job(None, self.id).await.ok().flatten()?;
        let finished = job.state.is_finished();
        self.tell(job, matches!(step, Step::First));
        Some(if finished { Step::Last } else { Step::Next })
    }

    fn tell(&mut self, job: Job, first: bool) {
        let Job { state, attempt, progress, .. } = job;
        let new = job.changes[self.seen.min(job.changes.len())..].to_vec();
        let answer = JobAnswer::from(job);
        if first {
            self.ready.extend(Event::default().event("snapshot").json_data(&answer));
        }
        let mut answer = Some(answer);
        for change in new {
            self.seen += 1;
            let job = if change.state.is_finished() { answer.take() } else { None };
            let at = instant(change.at);
            let changed = Changed { state: change.state, attempt: change.attempt, at, job };
            let event = Event::default().event("state").id(self.seen.to_string());
            self.ready.extend(event.json_data(&changed));
        }
        let moved = progress.to_bits() != self.progress.to_bits();
        if state == JobState::Running && moved {
            self.progress = progress;
            let progress = Progress { progress, attempt };
            self.ready.extend(Event::default().event("progress").json_data(&progress));
        }
    }
}

/// Where a listener stands.
enum Step {
    First,
    Next,
    Last,
}
