//! Makes signed links to results.

use std::time::Duration;

use axum::http::StatusCode;
use axum::http::header::{self, HeaderName};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::access::sign_on::SIGN_ON;
use crate::http::access::signed_link;
use crate::http::answer::stored::require;
use crate::http::api::parameters::ResultKey;
use crate::http::{App, Caller, Fresh, Problem, Query, Result, Segment, kinds, read_key};

/// Default lifetime of a link.
const DEFAULT_LIFETIME: Duration = Duration::from_hours(7 * 24);
/// Maximum lifetime of a link.
const MAX_LIFETIME: Duration = Duration::from_hours(366 * 24);

/// A link to a result.
#[derive(Debug, Serialize, ToSchema)]
pub struct SharedLink {
    /// An address on this server that anyone may open. Add `/history`, `/profiles`, `/loops`,
    /// `/plot.svg`, `/report` or `/warnings` before its `?`, and more parameters at its end.
    #[schema(example = "/v1/results/…?link=1790000000.0a1b2c3d.…")]
    url: String,
    /// When it expires: RFC 3339, UTC.
    #[schema(format = "date-time", example = "2026-02-07T12:00:00.000Z")]
    expires: String,
}

/// Makes a link to a result, for readers without a key.
///
/// It opens this result, its parts and its warnings until it expires. A single link cannot be revoked; revoking the
/// key that made it revokes all its links.
#[utoipa::path(post, path = "/v1/results/{key}/links", operation_id = "share_result", tag = "results",
    params(
        ResultKey,
        ("expires_in" = Option<String>, Query, description = "Lifetime of the link, for example \
            `12h`, `7d` (the default) or `6months`; at most `366d`.", example = "7d"),
    ),
    responses(
        (status = 201, description = "The link.", body = SharedLink,
            headers(("Location" = String, description = "`url`."))),
    ),
)]
pub async fn share(
    app: App,
    caller: Caller,
    key: Segment,
    mut query: Query,
) -> Result<(StatusCode, [(HeaderName, String); 1], Fresh<SharedLink>)> {
    let accepted = "a time from 1s to 366d, for example 12h, 7d or 6months";
    let time = query.value("expires_in", accepted, |text| {
        let time = humantime::parse_duration(text).ok()?;
        (Duration::from_secs(1)..=MAX_LIFETIME).contains(&time).then_some(time)
    });
    query.finish()?;
    let key = read_key(&key)?;
    if !app.store.has_result(&key).await? {
        require(&app, &caller.reach(), &key).await?;
    }
    let expires = (signed_link::since_1970() + time.unwrap_or(DEFAULT_LIFETIME)).as_secs();
    if caller.key.as_deref() == Some(SIGN_ON) {
        let detail = "A link needs the access key of its maker. Send a key instead of signing on through the proxy.";
        return Err(Problem::new(&kinds::FORBIDDEN, detail));
    }
    let issuer = caller.key.as_deref().unwrap_or(signed_link::ANYONE);
    let token = app.gate.signer().await?.sign(&key, expires, issuer);
    let link = SharedLink {
        url: format!("/v1/results/{key}?link={token}"),
        expires: signed_link::expiry(expires),
    };
    Ok((StatusCode::CREATED, [(header::LOCATION, link.url.clone())], Fresh(link)))
}
