//! Signed links: they open a result for clients without a key, until they expire.
//!
//! A link is the address of a result with `link=<expires>.<issuer>.<signature>`. The server does not store
//! links: it verifies the signature. A link allows its holder to read one result and its parts.

use std::time::Duration;

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
use crate::job::{Key, clock};

/// Default lifetime of a link.
const DEFAULT_LIFETIME: Duration = Duration::from_hours(7 * 24);
/// Maximum lifetime of a link.
const MAX_LIFETIME: Duration = Duration::from_hours(366 * 24);

/// The routes that a link opens.
pub const OPENED: [&str; 5] = [
    "/v1/results/{key}",
    "/v1/results/{key}/history",
    "/v1/results/{key}/profiles",
    "/v1/results/{key}/loops",
    "/v1/results/{key}/plot.svg",
];

/// Signs and verifies links.
#[derive(Clone)]
pub struct Signer {
    secret: Hmac<Sha256>,
    /// The digest of the admin key from the settings. With another admin key, its links become invalid.
    admin: Option<[u8; 32]>,
}

/// A valid link.
#[derive(Debug, PartialEq, Eq)]
pub struct Opened {
    /// The key that made it.
    pub issuer: String,
    /// Time until it expires.
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

    /// The value of `link` for a result.
    fn sign(&self, key: &Key, expires: u64, issuer: &str) -> String {
        let signature = self.message(key, expires, issuer).finalize().into_bytes();
        format!("{expires}.{issuer}.{}", HEXLOWER.encode(&signature))
    }

    /// Verifies a link to a result.
    fn open(&self, key: &Key, token: &str, now: Duration) -> Result<Opened, Problem> {
        let not_ours = || {
            let detail = "This server did not make this link for this result, or the link was changed. \
                Ask its sender for a new link.";
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
            let detail = format!("This link was good until {at}. Ask its sender for a new link.");
            return Err(Problem::new(&problem::BAD_LINK, detail));
        }
        Ok(Opened { issuer: issuer.to_owned(), left })
    }
}

fn since_1970() -> Duration {
    Duration::from_millis(clock::now().unsigned_abs())
}

/// The value of `link` in an address.
pub fn token(uri: &Uri) -> Option<&str> {
    uri.query()?.split('&').find_map(|pair| pair.strip_prefix("link="))
}

/// The address without its `link`, which handlers, caches and logs must not see.
pub fn without_token(uri: &Uri) -> Option<Uri> {
    let rest = uri.query()?.split('&').filter(|pair| !pair.starts_with("link="));
    let rest: Vec<&str> = rest.collect();
    let mark = if rest.is_empty() { "" } else { "?" };
    format!("{}{mark}{}", uri.path(), rest.join("&")).parse().ok()
}

/// Verifies the link of a request.
pub fn open(signer: &Signer, uri: &Uri, route: &str, token: &str) -> Result<Opened, Problem> {
    if !OPENED.contains(&route) {
        let detail = "A link opens only one result and its parts.";
        return Err(Problem::new(&problem::BAD_LINK, detail));
    }
    let key = uri.path().split('/').nth(3).unwrap_or_default();
    signer.open(&read_key(key)?, token, since_1970())
}

/// A link to a result.
#[derive(Debug, Serialize, ToSchema)]
pub struct SharedLink {
    /// An address on this server that anyone may open. Add `/history`, `/profiles`, `/loops` or
    /// `/plot.svg` before its `?`, and more parameters at its end.
    #[schema(example = "/v1/results/…?link=1790000000.0a1b2c3d.…")]
    url: String,
    /// When it expires: RFC 3339, UTC.
    #[schema(format = "date-time", example = "2026-02-07T12:00:00.000Z")]
    expires: String,
}

/// Makes a link to a result, for readers without a key.
///
/// It opens this result and its parts until it expires. A single link cannot be revoked; revoking the
/// key that made it revokes all its links.
#[utoipa::path(post, path = "/v1/results/{key}/links", operation_id = "share_result", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a result."),
        ("expires_in" = Option<String>, Query, description = "Lifetime of the link, for example \
            `12h`, `7d` (the default) or `6months`; at most `366d`.", example = "7d"),
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
    let accepted = "a time from 1s to 366d, for example 12h, 7d or 6months";
    let time = query.value("expires_in", accepted, |text| {
        let time = humantime::parse_duration(text).ok()?;
        (Duration::from_secs(1)..=MAX_LIFETIME).contains(&time).then_some(time)
    });
    query.finish()?;
    let key = read_key(&key)?;
    if !app.store.has_result(&key).await? {
        find(&app, caller.reach(), &key).await?;
    }
    let expires = (since_1970() + time.unwrap_or(DEFAULT_LIFETIME)).as_secs();
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
    fn a_link_opens_only_its_result_and_only_until_it_expires() {
        let signer = Signer::new(&[7; 32], None).unwrap();
        let (key, other) = (Key::from_bytes([1; 32]), Key::from_bytes([2; 32]));
        let token = signer.sign(&key, 1_000_060, "0a1b2c3d");
        let opened = signer.open(&key, &token, NOW).unwrap();
        assert_eq!(opened, Opened { issuer: "0a1b2c3d".into(), left: Duration::from_mins(1) });
        assert!(signer.open(&other, &token, NOW).is_err());
        assert!(signer.open(&key, &token, Duration::from_secs(1_000_060)).is_err());
        assert!(Signer::new(&[8; 32], None).unwrap().open(&key, &token, NOW).is_err());
        // A link made with the admin key becomes invalid with another admin key.
        let admin = |digest| Signer::new(&[7; 32], Some(digest)).unwrap();
        let link = admin([1; 32]).sign(&key, 1_000_060, ADMIN);
        assert!(admin([1; 32]).open(&key, &link, NOW).is_ok());
        assert!(admin([2; 32]).open(&key, &link, NOW).is_err());
        // Changing any character makes the link invalid.
        for place in 0..token.len() {
            for new in ["0", "1", ".", "g"] {
                let changed = format!("{}{new}{}", &token[..place], &token[place + 1..]);
                assert_eq!(signer.open(&key, &changed, NOW).is_ok(), changed == token, "{changed}");
            }
        }
    }

    #[test]
    fn removing_the_link_keeps_the_other_parameters() {
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
