//! The caller, as the server sees it.

use serde::Serialize;
use utoipa::ToSchema;

use crate::http::{App, Caller, Fresh, NoQuery, Result, schemas};

/// The caller, with its limits and their use.
#[derive(Debug, Serialize, ToSchema)]
pub struct Me {
    /// The owner of the caller's jobs: the name of the key, or the address of the client on a server
    /// without keys.
    #[schema(example = "anna")]
    name: String,
    /// `read`, `submit` or `admin`.
    #[schema(value_type = schemas::Role, example = "submit")]
    role: &'static str,
    /// The id of the key; null on a server without keys.
    #[schema(example = "0a1b2c3d")]
    key: Option<String>,
    /// Whether the names that the caller gives are private.
    private: bool,
    /// The limits of the key.
    limits: CallerLimits,
    /// The use of the limits, and the unfinished jobs.
    usage: CallerUsage,
}

/// The limits of a key; null is no limit.
#[derive(Debug, Serialize, ToSchema)]
struct CallerLimits {
    /// Requests per minute.
    #[schema(example = 60_000)]
    requests_per_minute: Option<u32>,
    /// Evaluations per minute. They do not count as requests.
    #[schema(example = 60_000)]
    evaluations_per_minute: Option<u32>,
    /// Concurrent requests.
    #[schema(example = 256)]
    requests_at_once: Option<u32>,
}

/// The use of the limits, and the unfinished jobs of the caller.
#[derive(Debug, Serialize, ToSchema)]
struct CallerUsage {
    /// Requests that may be sent now; null without a limit.
    #[schema(example = 59_999)]
    requests_left: Option<u32>,
    /// Queued jobs of the caller.
    #[schema(example = 0)]
    jobs_queued: u64,
    /// Running jobs of the caller.
    #[schema(example = 0)]
    jobs_running: u64,
}

/// Returns the name, role, limits and usage of the caller.
///
/// On a server without keys every caller is an administrator, named after its address. The request counts
/// against the limits.
#[utoipa::path(get, path = "/v1/me", operation_id = "me", tag = "system", responses(
    (status = 200, description = "The caller.", body = Me),
))]
pub async fn me(app: App, caller: Caller, _: NoQuery) -> Result<Fresh<Me>> {
    let (jobs_queued, jobs_running) = app.store.unfinished(&caller.owner).await?;
    let limits = app.gate.limits_of(caller.key.as_deref()).await?;
    let me = Me {
        name: caller.owner,
        role: caller.role.as_str(),
        key: caller.key,
        private: caller.private,
        limits: CallerLimits {
            requests_per_minute: limits.per_minute.map(Into::into),
            evaluations_per_minute: limits.evaluations.map(Into::into),
            requests_at_once: limits.at_once.map(Into::into),
        },
        usage: CallerUsage {
            requests_left: caller.standing.map(|standing| standing.left),
            jobs_queued,
            jobs_running,
        },
    };
    Ok(Fresh(me))
}
