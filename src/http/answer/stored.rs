//! The JSON of results, in memory or stored, and the memory that a request reserves before it makes an answer from it.

use std::mem;

use axum::body::Bytes;
use axum::http::header;
use tokio::sync::OwnedSemaphorePermit;
use tokio::task;
use tokio::time::{Instant, timeout_at};

use crate::http::access::caller::Caller;
use crate::http::app::App;
use crate::http::memory::{Encoded, Lookup};
use crate::http::problem::{Problem, Result, kinds};
use crate::http::shares::{self, Permit, SMALL, longest_wait};
use crate::http::wire::coding::Coding;
use crate::http::wire::instant;
use fretwork_job::Key;
use fretwork_store::{self as store, Body, Error, StoredResult};

/// Checks that a result is stored. Otherwise, returns the problem. The problem links to the job that computes the
/// result, if there is one that the caller may see.
pub async fn require(app: &App, reach: Option<&str>, key: &Key) -> Result<()> {
    match app.store.small_result(key).await? {
        Some(StoredResult::Whole(_) | StoredResult::Large(_)) => Ok(()),
        other => Err(missing(app, reach, key, other).await),
    }
}

/// The memory and the permission that a request must reserve before it may make an answer.
#[derive(Clone, Copy)]
pub struct Need {
    /// Bytes of memory.
    pub bytes: usize,
    /// Whether it needs the permission to make an answer from a large result.
    pub maker: bool,
}

impl Need {
    /// Memory for the compressed body of a result and its JSON, which has `size` bytes. The body is smaller.
    pub fn to_unpack(size: usize) -> Self {
        Self { bytes: 2 * size, maker: false }
    }
}

/// The memory and the permission that a request has reserved. The request waits for this before it takes the
/// single-flight lock of its answer. So a caller that has used up its share of the memory does not delay other callers
/// that request the same answer.
pub struct Reserved {
    /// When the request gives up. All its waits together end at this time.
    pub end: Instant,
    bytes: usize,
    /// Memory for the answer.
    pub permit: Permit,
    /// The permission to make an answer from a large result.
    pub maker: Option<OwnedSemaphorePermit>,
    /// Bytes of memory that the request needs beside the answer, to send it. Both are reserved together: a request that
    /// held its answer and waited for these could wait for a request that waits for its answer.
    beside: usize,
    /// This memory; `None` if it is not reserved yet.
    own: Option<Permit>,
}

impl Reserved {
    /// Nothing is reserved yet. The request gives up at `end`.
    pub fn nothing_until(end: Instant) -> Self {
        let permit = Permit::default();
        Self { end, bytes: 0, permit, maker: None, beside: 0, own: None }
    }

    /// Nothing is reserved yet. The request also needs this many bytes beside the answer.
    pub fn beside(self, beside: usize) -> Self {
        Self { beside, ..self }
    }

    /// Takes out what is reserved for the answer.
    pub fn take(&mut self) -> Self {
        let own = self.own.take();
        let rest = Self { own, ..Self::nothing_until(self.end).beside(self.beside) };
        mem::replace(self, rest)
    }

    /// Takes out the memory for the answer.
    pub fn take_permit(&mut self) -> Permit {
        self.bytes = 0;
        mem::take(&mut self.permit)
    }

    /// Takes out the memory beside the answer.
    pub fn take_own(&mut self) -> Permit {
        self.own.take().unwrap_or_default()
    }

    fn is_own_missing(&self) -> bool {
        self.beside > 0 && self.own.is_none()
    }

    /// Reserves the memory beside the answer alone.
    async fn hold_own(&mut self, app: &App, caller: &str) -> Result<()> {
        self.own = Some(app.shares.answers.hold_until(self.end, caller, self.beside).await?);
        Ok(())
    }

    /// Whether the request has reserved all that `need` names.
    pub fn suffices(&self, need: Need) -> bool {
        self.bytes >= need.bytes && (self.maker.is_some() || !need.maker)
    }

    /// Waits until the request has reserved what it needs, or until another request has made the answer with this name.
    pub async fn wait(&mut self, app: &App, caller: &str, name: &str, need: Need) -> Result<()> {
        let (end, beside) = (self.end, self.beside);
        // The request must not wait for memory that it holds itself.
        drop((self.take(), self.own.take()));
        let reserve = async {
            let bytes = need.bytes + beside;
            let mut permit = app.shares.answers.hold_until(end, caller, bytes).await?;
            let own = (beside > 0).then(|| {
                // The answer gets the rest, which is smaller than it if the share of the caller is.
                let rest = permit.split(beside);
                mem::replace(&mut permit, rest)
            });
            let maker = if need.maker {
                timeout_at(end, app.memory.maker()).await.map_err(|_| makers_busy())?
            } else {
                None
            };
            Ok::<_, Problem>(Self { end, bytes: need.bytes, permit, maker, beside, own })
        };
        tokio::select! {
            biased;
            () = app.memory.made(name) => {}
            reserved = reserve => *self = reserved?,
        }
        Ok(())
    }
}

/// Finds an answer in memory, or returns the permission to make it. Requests that read the same answer at the same time
/// share one permit for its memory.
pub async fn find(app: &App, caller: &str, name: &str, reserved: &mut Reserved) -> Result<Lookup> {
    loop {
        if let Some(answer) = app.memory.get(name).filter(|answer| answer.body.len() <= SMALL) {
            return Ok(Lookup::Found(answer));
        }
        let making = match app.memory.lookup(name).await {
            Lookup::Missing(making) => making,
            Lookup::Found(answer) if reserved.is_own_missing() => {
                drop(answer);
                reserved.hold_own(app, caller).await?;
                continue;
            }
            found @ Lookup::Found(_) => return Ok(found),
        };
        let Some(Encoded { body, coding, .. }) = app.memory.get(name) else {
            return Ok(Lookup::Missing(making));
        };
        let need = Need { bytes: body.len(), maker: false };
        let permit = if reserved.suffices(need) {
            reserved.take_permit()
        } else if !reserved.is_own_missing()
            && let Ok(permit) = app.shares.answers.try_hold(caller, need.bytes)
        {
            permit
        } else {
            drop(making);
            reserved.wait(app, caller, name, need).await?;
            continue;
        };
        let answer = Encoded::of(body, coding, Some(permit));
        return Ok(Lookup::Found(app.memory.finish(making, answer, false)));
    }
}

/// The JSON of a result, or `None` if it is not stored. It is read once for all concurrent requests, and kept in
/// memory.
pub async fn json(app: &App, caller: &str, key: &Key) -> Result<Option<Encoded>> {
    let name = key.to_string();
    let mut reserved = Reserved::nothing_until(longest_wait());
    loop {
        let making = match find(app, caller, &name, &mut reserved).await? {
            Lookup::Found(answer) => {
                app.store.was_read(key);
                return Ok(Some(answer));
            }
            Lookup::Missing(making) => making,
        };
        match stored(app, key, &reserved).await? {
            Some(StoredResult::Whole(body)) => {
                let json = unpacked(key, body).await?;
                let answer = Encoded::of(json, Coding::Identity, Some(reserved.permit));
                return Ok(Some(app.memory.finish(making, answer, true)));
            }
            Some(StoredResult::Large(size)) => {
                drop(making);
                reserved.wait(app, caller, &name, Need::to_unpack(size)).await?;
            }
            _ => return Ok(None),
        }
    }
}

/// As [`json`], or the problem for a result that is not stored.
pub async fn json_of(app: &App, caller: &Caller, key: &Key) -> Result<Encoded> {
    if let Some(result) = json(app, &caller.owner, key).await? {
        return Ok(result);
    }
    require(app, caller.reach(), key).await?;
    Err(Problem::damaged_result(key))
}

/// The JSON of a large result. The request must have reserved the memory for it.
pub async fn large_json(app: &App, key: &Key) -> Result<Option<Bytes>> {
    if let Some(answer) = app.memory.get(&key.to_string()) {
        return Ok(Some(answer.body));
    }
    // This name differs from the name of the answer with this JSON, because the bytes under it have no permit.
    let making = match app.memory.lookup(&format!("{key} source")).await {
        Lookup::Found(answer) => return Ok(Some(answer.body)),
        Lookup::Missing(making) => making,
    };
    let Some(StoredResult::Whole(body)) = app.store.result(key).await? else { return Ok(None) };
    let json = Encoded::plain(unpacked(key, body).await?);
    Ok(Some(app.memory.finish(making, json, false).body))
}

/// A result as it is stored. A large result is read only if the request has reserved enough memory for it.
pub async fn stored(
    app: &App,
    key: &Key,
    reserved: &Reserved,
) -> Result<Option<StoredResult>, Error> {
    match app.store.small_result(key).await? {
        Some(StoredResult::Large(size)) if reserved.suffices(Need::to_unpack(size)) => {
            app.store.result(key).await
        }
        found => Ok(found),
    }
}

/// The JSON of a body. A large body is decompressed on a blocking thread.
pub async fn unpacked(key: &Key, body: Body) -> Result<Bytes> {
    let json = if !body.is_compressed() || body.size().is_none_or(|size| size <= store::LARGE) {
        body.json()
    } else {
        task::spawn_blocking(move || body.json()).await.map_err(Problem::bug)?
    };
    Ok(json.map_err(|_| Error::DamagedResult(*key))?)
}

/// The problem for a result that is not stored.
pub async fn missing(
    app: &App,
    reach: Option<&str>,
    key: &Key,
    found: Option<StoredResult>,
) -> Problem {
    let live = match app.store.live_job(key, reach).await {
        Ok(live) => live,
        Err(error) => return error.into(),
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

/// The problem while the server makes as many large answers as it can at the same time.
pub fn makers_busy() -> Problem {
    shares::full("The server is making other large answers. Try again in a moment.".to_owned())
}
