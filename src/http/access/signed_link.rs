//! Signed links: they open a result for clients without a key, until they expire.
//!
//! A link is the address of a result with `link=<expires>.<issuer>.<signature>`. The server does not store
//! links: it verifies the signature. A link allows its holder to read one result, its parts, and its warnings.

use std::time::Duration;

use axum::http::Uri;
use data_encoding::HEXLOWER;
use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;

use crate::http::problem::{Problem, Result, kinds};
use crate::http::wire::{instant, read_key};
use fretwork_job::{Key, clock};

/// The issuer of links that were made with the admin key from the settings. It is also the name of the owner of the
/// jobs of that key.
pub const ADMIN: &str = "admin";
/// The issuer of links on a server without keys.
pub const ANYONE: &str = "anyone";

/// The routes that a link opens.
pub const OPENED: [&str; 12] = [
    "/v1/results/{key}",
    "/v1/results/{key}/history",
    "/v1/results/{key}/history/smooth",
    "/v1/results/{key}/profiles",
    "/v1/results/{key}/loops",
    "/v1/results/{key}/table",
    "/v1/results/{key}/statistics",
    "/v1/results/{key}/histogram",
    "/v1/results/{key}/verdict",
    "/v1/results/{key}/plot.svg",
    "/v1/results/{key}/report",
    "/v1/results/{key}/warnings",
];

/// Signs and verifies links.
#[derive(Clone)]
pub struct Signer {
    secret: Hmac<Sha256>,
    /// The digest of the admin key from the settings. If the operator changes the key, the links that were made with it
    /// become invalid.
    admin: Option<[u8; 32]>,
}

/// A valid link of a request.
pub struct Opened {
    /// The id of the key that made the link.
    pub issuer: String,
    /// Time until the link expires.
    pub left: Duration,
    /// The address without its `link`, which handlers, caches and logs must not see.
    pub address: Uri,
}

impl Signer {
    #[expect(clippy::expect_used, reason = "HMAC accepts keys of any length")]
    pub fn new(secret: &[u8; 32], admin: Option<[u8; 32]>) -> Self {
        let secret = Hmac::new_from_slice(secret).expect("a key of 32 bytes");
        Self { secret, admin }
    }

    fn message(&self, key: &Key, expires: u64, issuer: &str) -> Hmac<Sha256> {
        let mut mac = self.secret.clone();
        mac.update(format!("fretwork link 1\n{key}\n{expires}\n{issuer}").as_bytes());
        if issuer == ADMIN {
            // Without an admin key, the server signs no link for this issuer. So the empty digest does not verify any.
            mac.update(self.admin.as_ref().map_or(&[], |digest| &digest[..]));
        }
        mac
    }

    /// The value of `link` for a result.
    pub fn sign(&self, key: &Key, expires: u64, issuer: &str) -> String {
        let signature = self.message(key, expires, issuer).finalize().into_bytes();
        format!("{expires}.{issuer}.{}", HEXLOWER.encode(&signature))
    }

    /// Verifies a link to a result. Returns its issuer, and the time until it expires.
    fn verify(&self, key: &Key, token: &str, now: Duration) -> Result<(String, Duration)> {
        let not_ours = || {
            let detail = "This server did not make this link for this result, or the link was changed. \
                Ask its sender for a new link.";
            Problem::new(&kinds::BAD_LINK, detail)
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
            let at = expiry(expires);
            let detail = format!("This link expired on {at}. Ask its sender for a new link.");
            return Err(Problem::new(&kinds::BAD_LINK, detail));
        }
        Ok((issuer.to_owned(), left))
    }
}

/// The time since 1970.
pub fn since_1970() -> Duration {
    Duration::from_millis(clock::now().unsigned_abs())
}

/// The value of `link` in an address.
pub fn token(uri: &Uri) -> Option<&str> {
    uri.query()?.split('&').find_map(|pair| pair.strip_prefix("link="))
}

fn without_token(uri: &Uri) -> Result<Uri> {
    let pairs = uri.query().into_iter().flat_map(|query| query.split('&'));
    let rest: Vec<&str> = pairs.filter(|pair| !pair.starts_with("link=")).collect();
    let mark = if rest.is_empty() { "" } else { "?" };
    let address = format!("{}{mark}{}", uri.path(), rest.join("&")).parse();
    address.map_err(Problem::bug)
}

/// Verifies the link of a request.
pub fn open(signer: &Signer, uri: &Uri, route: &str) -> Result<Opened> {
    if !OPENED.contains(&route) {
        let detail =
            "A link opens only one result and its parts. Send an access key for this address.";
        return Err(Problem::new(&kinds::BAD_LINK, detail));
    }
    let (key, token) = (uri.path().split('/').nth(3).unwrap_or(""), token(uri).unwrap_or(""));
    let (issuer, left) = signer.verify(&read_key(key)?, token, since_1970())?;
    Ok(Opened { issuer, left, address: without_token(uri)? })
}

/// An expiry time, as text for people.
pub fn expiry(seconds: u64) -> String {
    // The largest time stands for a number that is too large.
    instant(i64::try_from(seconds.saturating_mul(1000)).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_secs(1_000_000);

    #[test]
    fn a_signed_link_is_valid_only_for_its_result_until_it_expires() {
        let signer = Signer::new(&[7; 32], None);
        let (key, other) = (Key::from_bytes([1; 32]), Key::from_bytes([2; 32]));
        let token = signer.sign(&key, 1_000_060, "0a1b2c3d");
        let opened = signer.verify(&key, &token, NOW).unwrap();
        assert_eq!(opened, ("0a1b2c3d".to_owned(), Duration::from_mins(1)));
        assert!(signer.verify(&other, &token, NOW).is_err());
        assert!(signer.verify(&key, &token, Duration::from_secs(1_000_060)).is_err());
        assert!(Signer::new(&[8; 32], None).verify(&key, &token, NOW).is_err());
        // A link made with the admin key becomes invalid with another admin key.
        let admin = |digest| Signer::new(&[7; 32], Some(digest));
        let link = admin([1; 32]).sign(&key, 1_000_060, ADMIN);
        assert!(admin([1; 32]).verify(&key, &link, NOW).is_ok());
        assert!(admin([2; 32]).verify(&key, &link, NOW).is_err());
        // Changing any character makes the link invalid.
        for place in 0..token.len() {
            for new in ["0", "1", ".", "g"] {
                let changed = format!("{}{new}{}", &token[..place], &token[place + 1..]);
                assert_eq!(
                    signer.verify(&key, &changed, NOW).is_ok(),
                    changed == token,
                    "{changed}"
                );
            }
        }
    }

    #[test]
    fn removing_the_link_token_keeps_the_other_query_parameters() {
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
