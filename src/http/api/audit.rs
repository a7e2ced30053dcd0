//! The audit log.

use axum::http::Uri;
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::wire::paging::{limit, next_page};
use crate::http::{App, Fresh, Query, Result, instant, schemas};
use fretwork_store::{Act, AuditEntry as Stored};

/// Equal acts of one day (UTC).
#[derive(Debug, Serialize, ToSchema)]
pub struct AuditEntry {
    /// When the first of these acts was: RFC 3339, UTC.
    #[schema(format = "date-time")]
    first: String,
    /// When the last of these acts was.
    #[schema(format = "date-time")]
    last: String,
    /// The number of these acts. Uses of a key within one minute count once.
    #[schema(example = 1)]
    times: u64,
    /// What was done.
    #[schema(value_type = schemas::Act)]
    act: Act,
    /// Who did it: the name of a key, the address of a client on a server without keys, or the user of a command of
    /// the program, such as `uid 1000`.
    #[schema(example = "anna")]
    actor: String,
    /// The id of the key that the actor sent; null without a key.
    #[schema(example = "0a1b2c3d")]
    key: Option<String>,
    /// The id of the key or of the job, or the key of the result. Null for jobs of the actor, which share an entry, and for the
    /// names and notes of one owner, which do so, too.
    subject: Option<String>,
    /// Whose key, job or result it is; null if unknown.
    #[schema(example = "ben")]
    owner: Option<String>,
}

impl From<Stored> for AuditEntry {
    fn from(entry: Stored) -> Self {
        let Stored { first, last, times, act, actor, subject, owner, .. } = entry;
        let known = |text: String| Some(text).filter(|text| !text.is_empty());
        Self {
            first: instant(first),
            last: instant(last),
            times,
            act,
            actor: actor.name,
            key: known(actor.key),
            subject: known(subject),
            owner: known(owner),
        }
    }
}

/// A page of the audit log, the newest entries first.
#[derive(Debug, Serialize, ToSchema)]
pub struct AuditLog {
    /// The entries.
    entries: Vec<AuditEntry>,
    /// The address of the next page; null on the last page.
    #[schema(example = "/v1/audit?cursor=42")]
    next: Option<String>,
}

/// Returns the audit log: who made, revoked and used which key, and who canceled and deleted whose jobs and results.
///
/// The newest entries come first, in the order of their first act. The server keeps the last 100 000 entries.
#[utoipa::path(get, path = "/v1/audit", operation_id = "audit", tag = "system",
    params(
        ("limit" = Option<u32>, Query, description = "Largest number of entries on the page.", minimum = 1,
            maximum = 1000, example = 100),
        ("cursor" = Option<i64>, Query, description = "Continues after a page. The server puts it into `next` of that \
            page."),
    ),
    responses((status = 200, description = "A page of the log.", body = AuditLog)),
)]
pub async fn audit(app: App, uri: Uri, mut query: Query) -> Result<Response> {
    let limit = limit(&mut query, 1000).unwrap_or(100);
    let cursor = query.value("cursor", "the cursor of a page", |text| text.parse().ok());
    query.finish()?;
    // The store returns one entry more than the page has if there is a next page.
    let mut found = app.store.audit(cursor, limit + 1).await?;
    let more = found.len() as u64 > u64::from(limit);
    found.truncate(limit as usize);
    let (next, link) = next_page(&uri, found.last().filter(|_| more).map(|entry| entry.id));
    let entries = found.into_iter().map(AuditEntry::from).collect();
    Ok((link, Fresh(AuditLog { entries, next })).into_response())
}
