//! Users whom a sign-on proxy has identified.
//!
//! The proxy names the user in a header, and proves with a secret that it is the proxy. A request with the header from any
//! other client is refused.

use std::collections::HashMap;
use std::sync::Arc;

use axum::extract::Request;
use axum::http::HeaderName;
use parking_lot::Mutex;
use subtle::ConstantTimeEq as _;

use super::caller::{Identity, ViaProxy, is_owner_name};
use super::keyring::Usage;
use super::limits::Limits;
use super::secret::Secret;
use super::session::{Site, only, unauthorized};
use crate::http::problem::{Problem, Result, kinds};
use fretwork_store::{Role, digest};

/// The header with the secret of the proxy.
const SECRET: HeaderName = HeaderName::from_static("x-fretwork-proxy-secret");
/// In place of the id of a key.
pub const SIGN_ON: &str = "sign-on";

/// Settings of a sign-on proxy.
#[derive(Debug, Clone)]
pub struct SignOn {
    /// The header with the name of the user.
    pub header: HeaderName,
    /// What the proxy sends in `X-Fretwork-Proxy-Secret`.
    pub secret: Secret,
    /// The role of all users.
    pub role: Role,
}

/// The users of the proxy, and how much of its limits each has used.
pub struct Users {
    settings: SignOn,
    secret: [u8; 32],
    limits: Limits,
    usage: Mutex<HashMap<String, Arc<Usage>>>,
}

impl Users {
    pub fn new(settings: SignOn, limits: Limits) -> Self {
        let secret = digest(&settings.secret.0);
        Self { settings, secret, limits, usage: Mutex::default() }
    }

    /// The user that the proxy names; `None` if the request has no such header.
    pub fn identify(&self, request: &Request) -> Result<Option<(Identity, Arc<Usage>)>> {
        let (headers, name) = (request.headers(), &self.settings.header);
        if !headers.contains_key(name) {
            return Ok(None);
        }
        let refused = |detail: String| Err(unauthorized(headers, "", &detail));
        let secret = only(headers, &SECRET).map(digest);
        let is_proxy = request.extensions().get::<ViaProxy>().is_some()
            && secret.is_some_and(|secret| secret.ct_eq(&self.secret).into());
        if !is_proxy {
            return refused(format!("Only the sign-on proxy may send the header {name}."));
        }
        let Some(owner) = only(headers, name).filter(|owner| is_owner_name(owner)) else {
            return refused(format!(
                "The header {name} must occur once, with a name of up to 64 letters, digits and . _ @ + -."
            ));
        };
        // The browser of a user who has signed in to the proxy sends requests of all web pages through it.
        if !request.method().is_safe() && Site::of(request) == Site::Other {
            let detail = "A web page of another origin sent this request.";
            return Err(Problem::new(&kinds::CROSS_SITE, detail));
        }
        let usage = || Usage::new(self.limits, None);
        let usage = Arc::clone(self.usage.lock().entry(owner.to_owned()).or_insert_with(usage));
        let (owner, key) = (owner.to_owned(), SIGN_ON.to_owned());
        let (role, private) = (self.settings.role, false);
        let identity = Identity { owner, role, key, private, credential: None, session: None };
        Ok(Some((identity, usage)))
    }
}
