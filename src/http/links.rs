//! Signed links: a result shown to somebody who has no key, until some day.
//!
//! A link is the address of a result with `link=<expires>.<issuer>.<signature>`. Nothing is stored: the
//! signature says that this server made it. It opens this result and its parts, for reading.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use data_encoding::HEXLOWER;
use hmac::{Hmac, KeyInit as _, Mac as _};
use serde::Serialize;
use sha2::Sha256;
use utoipa::ToSchema;

use super::App;
use super::access::{ADMIN, ANYONE};
use super::caller::Caller;
use super::problem::{self, Problem};
use super::representation::find;
use super::results::read_key;
use super::wire::{Query, Segment, instant};
use crate::job::Key;

/// How long a link is good for unless told.
const USUAL: Duration = Duration::from_hours(7 * 24);
/// How long a link may be good for.
const LONGEST: Duration = Duration::from_hours(366 * 24);

/// The routes that a link opens.
pub const OPENED: [&str; 5] = [
    "/v1/results/{key}",
    "/v1/results/{key}/history",
    "/v1/results/{key}/profiles",
    "/v1/results/{key}/loops",
    "/v1/results/{key}/plot.svg",
];

/// Signs links, and knows those it signed.
#[derive(Clone)]
pub struct Signer {
    secret: Hmac<Sha256>,
    /// The digest of the key from the settings: with another key, its links end.
    admin: Option<[u8; 32]>,
}

/// A link that was signed here.
#[derive(Debug, PartialEq, Eq)]
pub struct Opened {
    /// Which key made it.
    pub issuer: String,
    /// For how long it is still good.
    pub left: Duration,
}

impl Signer {
    pub fn new(secret: &[u8; 32], admin: Option<[u8; 32]>) -> Option<Self> {
        Some(Self { secret: Hmac::new_from_slice(secret).ok()?, admin })
    }

    fn message(&self, key: &Key, expires: u64, issuer: &str) -> Hmac<Sha256> {
        let mut mac = self.secret.clone();
        mac.update(format!("fretwork link 1\n{key}\n{expires}\n{issuer}").as_bytes());
        if issuer == ADMIN {
            mac.update(&self.admin.unwrap_or_default());
        }
        mac
    }

    /// What makes an address of this result a link.
    fn sign(&self, key: &Key, expires: u64, issuer: &str) -> String {
        let signature = self.message(key, expires, issuer).finalize().into_bytes();
        format!("{expires}.{issuer}.{}", HEXLOWER.encode(&signature))
    }

    /// Whether a link opens this result now, and who made it.
    fn open(&self, key: &Key, token: &str, now: Duration) -> Result<Opened, Problem> {
        let not_ours = || {
            let detail = "This link was not made by this server for this result, or it has been \
                changed. Ask whoever sent it for a new one.";
            Problem::new(&problem::BAD_LINK, detail)
        };
        let mut parts = token.splitn(3, '.');
        let (expires, issuer, signature) = (parts.next(), parts.next(), parts.next());
        let (Some(text), Some(issuer), Some(signature)) = (expires, issuer, signature) else {
            return Err(not_ours());
        };
        let expires: u64 = text.parse().map_err(|_| not_ours())?;
        let signature = HEXLOWER.decode(signature.as_bytes()).map_err(|_| not_ours())?;
        let mac = self.message(key, expires, issuer);
        if expires.to_string() != text || mac.verify_slice(&signature).is_err() {
            return Err(not_ours());
        }
        let left = Duration::from_secs(expires).saturating_sub(now);
        if left.is_zero() {
            let at = instant(i64::try_from(expires.saturating_mul(1000)).unwrap_or(i64::MAX));
            let detail =
                format!("This link was good until {at}. Ask whoever sent it for a new one.");
            return Err(Problem::new(&problem::BAD_LINK, detail));
        }
        Ok(Opened { issuer: issuer.to_owned(), left })
    }
}

fn since_1970() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// The `link` of an address.
pub fn token(uri: &Uri) -> Option<&str> {
    uri.query()?.split('&').find_map(|pair| pair.strip_prefix("link="))
}

/// The same address without its `link`: handlers, caches and logs do not know of links.
pub fn without_token(uri: &Uri) -> Option<Uri> {
    let rest = uri.query()?.split('&').filter(|pair| !pair.starts_with("link="));
    let rest: Vec<&str> = rest.collect();
    let mark = if rest.is_empty() { "" } else { "?" };
    format!("{}{mark}{}", uri.path(), rest.join("&")).parse().ok()
}

/// Whether a link opens what a request asks for.
pub fn open(signer: &Signer, uri: &Uri, route: &str, token: &str) -> Result<Opened, Problem> {
    if !OPENED.contains(&route) {
        let detail = "A link opens one result and its parts, nothing else.";
        return Err(Problem::new(&problem::BAD_LINK, detail));
    }
    let key = uri.path().split('/').nth(3).unwrap_or_default();
    signer.open(&read_key(key)?, token, since_1970())
}

/// A link to a result.
#[derive(Debug, Serialize, ToSchema)]
pub struct SharedLink {
    /// The address that anyone may open, on this server. `/history`, `/profiles` and `/loops` can be
    /// put before its `?`, and further parameters behind it.
    #[schema(example = "/v1/results/…?link=1790000000.0a1b2c3d.…")]
    url: String,
    /// Until when it opens: RFC 3339, UTC.
    #[schema(format = "date-time", example = "2026-02-07T12:00:00.000Z")]
    expires: String,
}

/// Makes a link to a result, for somebody who has no key.
///
/// It opens this result and its parts for reading, until it expires. It cannot be taken back by itself:
/// it ends with the key that made it.
#[utoipa::path(post, path = "/v1/results/{key}/links", operation_id = "share_result", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a result."),
        ("expires_in" = Option<String>, Query, description = "For how long, such as `12h`, `7d` (the \
            default) or `6months`; a year at most.", example = "7d"),
    ),
    responses(
        (status = 201, description = "The link.", body = SharedLink),
    ),
)]
pub async fn share(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    mut query: Query,
) -> Result<Response, Problem> {
    let accepted = "a time from 1s to 366d, such as 12h, 7d or 6months";
    let time = query.value("expires_in", accepted, |text| {
        let time = humantime::parse_duration(text).ok()?;
        (Duration::from_secs(1)..=LONGEST).contains(&time).then_some(time)
    });
    query.finish()?;
    let key = read_key(&key)?;
    if !app.store.has_result(&key).await? {
        find(&app, caller.reach(), &key).await?;
    }
    let expires = (since_1970() + time.unwrap_or(USUAL)).as_secs();
    let issuer = caller.key.as_deref().unwrap_or(ANYONE);
    let token = app.gate.signer().await?.sign(&key, expires, issuer);
    let link = SharedLink {
        url: format!("/v1/results/{key}?link={token}"),
        expires: instant(i64::try_from(expires * 1000).unwrap_or(i64::MAX)),
    };
    let private = [(header::CACHE_CONTROL, "no-store")];
    Ok((StatusCode::CREATED, private, Json(link)).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_secs(1_000_000);

    #[test]
    fn only_what_was_signed_opens_and_only_in_its_time() {
        let signer = Signer::new(&[7; 32], None).unwrap();
        let (key, other) = (Key::from_bytes([1; 32]), Key::from_bytes([2; 32]));
        let token = signer.sign(&key, 1_000_060, "0a1b2c3d");
        let opened = signer.open(&key, &token, NOW).unwrap();
        assert_eq!(opened, Opened { issuer: "0a1b2c3d".into(), left: Duration::from_mins(1) });
        assert!(signer.open(&other, &token, NOW).is_err());
        assert!(signer.open(&key, &token, Duration::from_secs(1_000_060)).is_err());
        assert!(Signer::new(&[8; 32], None).unwrap().open(&key, &token, NOW).is_err());
        // A link of the key from the settings ends with that key.
        let admin = |digest| Signer::new(&[7; 32], Some(digest)).unwrap();
        let link = admin([1; 32]).sign(&key, 1_000_060, ADMIN);
        assert!(admin([1; 32]).open(&key, &link, NOW).is_ok());
        assert!(admin([2; 32]).open(&key, &link, NOW).is_err());
        // Every single character counts.
        for place in 0..token.len() {
            for new in ["0", "1", ".", "g"] {
                let changed = format!("{}{new}{}", &token[..place], &token[place + 1..]);
                assert_eq!(signer.open(&key, &changed, NOW).is_ok(), changed == token, "{changed}");
            }
        }
    }

    #[test]
    fn an_address_without_its_link_is_the_plain_one() {
        for (with, plain) in [
            ("/v1/results/ab?link=1.a.b", "/v1/results/ab"),
            ("/r?digits=7&link=1.a.b&format=csv", "/r?digits=7&format=csv"),
            ("/r?link=1.a.b&x=%2F", "/r?x=%2F"),
        ] {
            let uri: Uri = with.parse().unwrap();
            assert_eq!(token(&uri), Some("1.a.b"));
            assert_eq!(without_token(&uri).unwrap().to_string(), plain);
        }
        assert_eq!(token(&"/r?blink=1".parse().unwrap()), None);
    }
}
