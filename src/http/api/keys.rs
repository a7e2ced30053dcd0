//! The access keys: administrators make, list and revoke them, by the rules of the command `fretwork keys`.

use std::time::Duration;

use axum::http::StatusCode;
use deserr::Deserr;
use serde::Serialize;
use utoipa::ToSchema;

use super::library::read;
use crate::http::access::caller::{Caller, is_owner_name};
use crate::http::{App, Body, Fresh, NoQuery, Problem, Result, Segment, instant, kinds, schemas};
use fretwork_engine::{Faults, Valid};
use fretwork_job::clock::now;
use fretwork_json::Whole;
use fretwork_store::{AccessKey as Stored, Actor, NewKey, Role};

/// The names that the owner of a key can have.
pub const KEY_NAMES: &str = "up to 64 letters, digits and . _ @ + -; the name must not be a network address, the id of \
    a key, \"admin\" or \"me\"";
/// The roles of keys.
pub const KEY_ROLES: &str = "read, submit or admin";
/// The lifetimes that a key can have.
pub const KEY_LIFETIMES: &str = "a time from 1s to 100years, for example 90d";
/// Longest lifetime of a key with an end.
const LONGEST: Duration = Duration::from_hours(100 * 366 * 24);

/// Reads the lifetime of a key; `None` if no key can have it.
pub fn key_lifetime(text: &str) -> Option<Duration> {
    let time = humantime::parse_duration(text).ok()?;
    (Duration::from_secs(1)..=LONGEST).contains(&time).then_some(time)
}

/// An access key, without its secret.
#[derive(Debug, Serialize, ToSchema)]
pub struct AccessKey {
    /// The public id.
    #[schema(example = "0a1b2c3d")]
    id: String,
    /// The owner of the jobs that are submitted with it. Several keys may have the same name.
    #[schema(example = "anna")]
    name: String,
    /// `read`, `submit` or `admin`.
    #[schema(value_type = schemas::Role, example = "submit")]
    role: &'static str,
    /// Requests per minute; null is no limit.
    #[schema(example = 60_000)]
    requests_per_minute: Option<u32>,
    /// Whether the names that its holder gives are private.
    private: bool,
    /// When it was made: RFC 3339, UTC.
    #[schema(format = "date-time")]
    created: String,
    /// When it expires; null is never.
    #[schema(format = "date-time")]
    expires: Option<String>,
    /// When it was revoked; null if it was not.
    #[schema(format = "date-time")]
    revoked: Option<String>,
    /// When it was last used, to the minute; null if it was never used.
    #[schema(format = "date-time")]
    last_used: Option<String>,
}

impl AccessKey {
    fn of(app: &App, key: Stored) -> Self {
        Self {
            requests_per_minute: app.gate.per_minute(&key),
            role: key.role.as_str(),
            private: key.private,
            created: instant(key.created),
            expires: key.expires.map(instant),
            revoked: key.revoked.map(instant),
            last_used: key.last_used.map(instant),
            id: key.id,
            name: key.name,
        }
    }
}

/// The access keys.
#[derive(Debug, Serialize, ToSchema)]
pub struct AccessKeys {
    /// All keys, the oldest first.
    keys: Vec<AccessKey>,
}

/// A new access key.
#[derive(Debug, Serialize, ToSchema)]
pub struct CreatedKey {
    /// Its public id.
    #[schema(example = "0a1b2c3d")]
    id: String,
    /// The key itself. The server cannot show it again.
    #[schema(example = "fretwork_0a1b2c3d_…")]
    access_key: String,
}

/// An access key to be made.
#[derive(Debug, Deserr, ToSchema)]
#[deserr(error = Faults, deny_unknown_fields)]
#[serde(deny_unknown_fields)]
pub struct KeyBody {
    /// The owner of the jobs that are submitted with it. Keys with the same name own the same jobs.
    #[schema(pattern = "^[A-Za-z0-9._@+-]{1,64}$")]
    name: String,
    #[schema(value_type = schemas::Role)]
    role: String,
    /// Time until it expires, for example `90d`; never by default.
    #[schema(nullable = false)]
    #[deserr(default)]
    expires_in: Option<String>,
    /// Requests per minute; 0 means no limit. The limit of the server by default.
    #[schema(value_type = u32, required = false, maximum = 4_294_967_295_u32)]
    #[deserr(default)]
    requests_per_minute: Option<Whole<0, { u32::MAX as u64 }>>,
    /// Whether only the owner and administrators see the jobs that are submitted with it, and only the owner sees the notes. A
    /// submission can say otherwise.
    #[schema(required = false)]
    #[deserr(default)]
    private: bool,
}

impl KeyBody {
    fn checked(self) -> Valid<NewKey> {
        let mut faults = Faults::default();
        if !is_owner_name(&self.name) {
            faults.add("/name", format!("must have {KEY_NAMES}"));
        }
        let role = self.role.parse::<Role>().ok();
        if role.is_none() {
            faults.add("/role", format!("must be {KEY_ROLES}"));
        }
        let time = self.expires_in.as_deref().map(key_lifetime);
        if time == Some(None) {
            faults.add("/expires_in", format!("must be {KEY_LIFETIMES}"));
        }
        let role = faults.or(role)?.unwrap_or(Role::Read);
        let expires = time.flatten().map(|time| now() + time.as_millis() as i64);
        let per_minute = self.requests_per_minute.map(|Whole(rate)| rate as u32);
        Ok(NewKey { name: self.name, role, per_minute, expires, private: self.private })
    }
}

/// Who changes a key. On a server without keys everyone is an administrator. A key that such a caller made would stay valid
/// when the operator requires keys, so the first key comes from the command.
fn changer(caller: &Caller) -> Result<Actor> {
    let detail = "Only a signed-in administrator can make and revoke keys. Make the first key with `fretwork keys add \
        NAME --role admin`.";
    caller.key.as_ref().ok_or_else(|| Problem::new(&kinds::FORBIDDEN, detail))?;
    Ok(caller.actor())
}

/// Lists the access keys, without their secrets.
///
/// Expired and revoked keys stay in the list. The administrator's key from the settings of the server is not in it.
#[utoipa::path(get, path = "/v1/keys", operation_id = "list_keys", tag = "system", responses(
    (status = 200, description = "The keys.", body = AccessKeys),
))]
pub async fn list(app: App, _: NoQuery) -> Result<Fresh<AccessKeys>> {
    let keys = app.store.access_keys().await?;
    Ok(Fresh(AccessKeys { keys: keys.into_iter().map(|key| AccessKey::of(&app, key)).collect() }))
}

/// Makes an access key.
///
/// The answer has the key, which the server cannot show again. On a server without keys, make the first one with `fretwork
/// keys add`.
#[utoipa::path(post, path = "/v1/keys", operation_id = "make_key", tag = "system",
    request_body(content = KeyBody, description = "The key.",
        example = json!({"name": "anna", "role": "submit", "expires_in": "90d"})),
    responses(
        (status = 201, description = "The key.", body = CreatedKey),
    ),
)]
pub async fn make(
    app: App,
    caller: Caller,
    _: NoQuery,
    body: Body,
) -> Result<(StatusCode, Fresh<CreatedKey>)> {
    let by = changer(&caller)?;
    let new = read::<KeyBody>(&body)?.checked()?;
    let (id, access_key) = app.store.add_key(new, by).await?;
    Ok((StatusCode::CREATED, Fresh(CreatedKey { id, access_key })))
}

/// Revokes an access key.
///
/// Within a second, the server refuses the key, its sessions and its links. A revoked key cannot be made valid again.
#[utoipa::path(delete, path = "/v1/keys/{id}", operation_id = "revoke_key", tag = "system",
    params(("id" = String, Path, description = "The `id` of a key.", example = "0a1b2c3d")),
    responses(
        (status = 204, description = "The key is revoked."),
        (status = 404, description = "No valid key has this id."),
    ),
)]
pub async fn revoke(app: App, caller: Caller, id: Segment, _: NoQuery) -> Result<StatusCode> {
    let by = changer(&caller)?;
    // The store would take a name too, which can have many keys.
    let is_id = id.len() == 8 && id.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    if is_id && app.store.revoke_key(&id, by).await? {
        return Ok(StatusCode::NO_CONTENT);
    }
    Err(Problem::new(&kinds::NOT_FOUND, "No valid key has this id. GET /v1/keys lists all keys."))
}
