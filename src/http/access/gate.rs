//! Decides which requests are accepted: finds the caller, and checks its role and its limits.

use std::net::{Ipv4Addr, Ipv6Addr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use data_encoding::BASE64;
use subtle::ConstantTimeEq as _;
use tokio::sync::OnceCell;

use super::caller::{Identity, LINK_HOLDER};
use super::keyring::{Keyring, MAX_AGE, Usage};
use super::limits::{Limits, OpenRequest};
use super::needs::{Needs, Quota, RouteNeeds};
use super::secret::Secret;
use super::session::{self, ENDED, ended, unauthorized};
use super::sign_on::{SIGN_ON, SignOn, Users};
use super::signed_link::{self, ADMIN, ANYONE, Signer};
use crate::http::problem::{Problem, Result, kinds};
use crate::http::wire::instant;
use fretwork_job::clock::now;
use fretwork_store::{AccessKey, Actor, Role, SignedIn, Store, digest};

/// Settings of access control.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// Every caller has all rights, whether there are keys or not.
    pub open: bool,
    /// An administrator's key from the settings, in addition to the keys in the database.
    pub admin_key: Option<Secret>,
    /// The limits of each key that has no limits of its own.
    pub limits: Limits,
    /// The proxy that signs users on.
    pub sign_on: Option<SignOn>,
}

/// Decides which requests are accepted.
pub struct Gate {
    store: Store,
    open: bool,
    admin: Option<AdminHolder>,
    sign_on: Option<Users>,
    keyring: Keyring,
    route_needs: RouteNeeds,
    signer: OnceCell<Signer>,
}

/// The digest of the administrator's key from the settings, and how much of its limits it has used.
struct AdminHolder {
    digest: [u8; 32],
    usage: Arc<Usage>,
}

/// How a request identifies its caller.
enum Presented {
    /// A sign-on proxy names its user.
    User(Identity, Arc<Usage>),
    /// A browser sends the token of its session. This is its digest.
    Session([u8; 32]),
    /// An access key.
    Key(SignedIn),
}

/// An accepted request.
#[derive(Default)]
struct Admitted {
    /// The caller; `None` on a route or a server that requires no key.
    identity: Option<Identity>,
    open_request: OpenRequest,
    /// For a signed link: the time until it expires.
    link: Option<Duration>,
}

/// Answers a request if its caller may send it, and refuses it otherwise. If the answer took longer than [`MAX_AGE`],
/// this checks the caller once more.
pub async fn check<A: Future<Output = Response>>(
    gate: &Gate,
    mut request: Request,
    answer: impl FnOnce(Request) -> A,
) -> Response {
    let started = Instant::now();
    let needs = gate.route_needs.of(request.method(), pattern(&request));
    let Admitted { identity, open_request, link } = match gate.accept(&mut request, needs).await {
        Ok(accepted) => accepted,
        Err(problem) => return problem.into_response(),
    };
    if let Some(identity) = &identity {
        request.extensions_mut().insert(identity.clone());
    }
    if let Some(standing) = open_request.standing {
        request.extensions_mut().insert(standing);
    }
    let mut response = answer(request).await;
    // The key may have been revoked while the request waited.
    if needs.role.is_some()
        && link.is_none()
        && started.elapsed() > MAX_AGE
        && let Some(problem) = gate.recheck(identity.as_ref()).await
    {
        response = problem.into_response();
    }
    if identity.is_some() || link.is_some() {
        restrict_caching(response.headers_mut(), link);
    }
    if identity.is_some() && link.is_none() {
        response.headers_mut().append(header::VARY, HeaderValue::from_static("Cookie"));
    }
    if let Some(identity) = identity {
        response.extensions_mut().insert(identity);
    }
    if let Some(standing) = open_request.standing {
        standing.tell(response.headers_mut());
    }
    response.map(|body| open_request.hold(body))
}

/// The pattern of the route of a request; empty for an unknown route.
fn pattern(request: &Request) -> &str {
    request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str)
}

/// Forbids shared caches to keep an answer that required a key, and all caches to keep an answer longer than
/// its link is valid.
fn restrict_caching(headers: &mut HeaderMap, link: Option<Duration>) {
    let Some(caching) = headers.get(header::CACHE_CONTROL).and_then(|value| value.to_str().ok())
    else {
        return;
    };
    if caching.contains("no-store") {
        return;
    }
    let private = match link {
        Some(left) => format!("private, max-age={}", left.as_secs()),
        None => format!("private, {caching}"),
    };
    if let Ok(private) = HeaderValue::try_from(private) {
        headers.insert(header::CACHE_CONTROL, private);
    }
}

impl Gate {
    pub fn new(store: &Store, access: &Access, route_needs: RouteNeeds) -> Self {
        let admin = access.admin_key.as_ref().map(|Secret(key)| AdminHolder {
            digest: digest(key),
            usage: Usage::new(access.limits, None),
        });
        Self {
            store: store.clone(),
            open: access.open,
            sign_on: access.sign_on.clone().map(|proxy| Users::new(proxy, access.limits)),
            admin,
            keyring: Keyring::new(store, access.limits),
            route_needs,
            signer: OnceCell::new(),
        }
    }

    /// The signer of links. The first call reads its secret from the store.
    pub async fn signer(&self) -> Result<&Signer> {
        self.signer
            .get_or_try_init(|| async {
                let admin = self.admin.as_ref().map(|admin| admin.digest);
                Ok(Signer::new(&self.store.link_secret().await?, admin))
            })
            .await
    }

    async fn accept(&self, request: &mut Request, needs: Needs) -> Result<Admitted> {
        let Some(required) = needs.role else { return Ok(Admitted::default()) };
        if signed_link::token(request.uri()).is_some() {
            return self.accept_link(request, needs, required).await;
        }
        if !self.requires_key().await? {
            if !self.open && !has_local_host(request) {
                let detail = "A server without keys answers only requests to localhost or an IP address. \
                    To use the server under another name, make an access key (`fretwork keys add`) or start the \
                    server with --no-auth.";
                return Err(Problem::new(&kinds::UNKNOWN_HOST, detail));
            }
            return Ok(Admitted::default());
        }
        let presented = self.presented(request)?;
        let (identity, usage) = self.identify(presented, request.headers()).await?;
        let open_request = usage.account.take(needs.quota)?;
        if identity.role < required {
            let detail = format!(
                "The request requires an access key with the role {required}, which an administrator makes. This key ({}, {}) has the role {}.",
                identity.owner, identity.key, identity.role
            );
            let problem = Problem::new(&kinds::FORBIDDEN, detail);
            return Err(match open_request.standing {
                Some(standing) => standing.tell_in(problem),
                None => problem,
            });
        }
        Ok(Admitted { identity: Some(identity), open_request, link: None })
    }

    /// Accepts a request with a signed link, and removes the link from its address.
    async fn accept_link(
        &self,
        request: &mut Request,
        needs: Needs,
        required: Role,
    ) -> Result<Admitted> {
        let link = signed_link::open(self.signer().await?, request.uri(), pattern(request))?;
        if required > Role::Read {
            let detail = "A link to a result allows only reading. Send an access key instead.";
            return Err(Problem::new(&kinds::BAD_LINK, detail));
        }
        let open_request = self.count_link(&link.issuer, needs.quota).await?.untold();
        *request.uri_mut() = link.address;
        // No key can have this name, so the caller owns no jobs.
        let owner = LINK_HOLDER.to_owned();
        let (role, key) = (Role::Read, link.issuer);
        let private = false;
        let identity = Identity { owner, role, key, private, credential: None, session: None };
        Ok(Admitted { identity: Some(identity), open_request, link: Some(link.left) })
    }

    /// Whether the server requires a key.
    pub async fn requires_key(&self) -> Result<bool> {
        let is_asked = self.admin.is_some() || self.sign_on.is_some();
        Ok(!self.open && (is_asked || !self.keyring.holders().await?.is_empty()))
    }

    /// The limits of a key; none for callers without a key.
    pub async fn limits_of(&self, key: Option<&str>) -> Result<Limits> {
        let Some(key) = key else { return Ok(Limits::default()) };
        if [ADMIN, SIGN_ON].contains(&key) {
            return Ok(self.keyring.default_limits);
        }
        let holders = self.keyring.holders().await?;
        Ok(holders.get(key).map_or_else(Limits::default, |holder| holder.usage.account.limits))
    }

    /// How a request identifies its caller.
    fn presented(&self, request: &Request) -> Result<Presented> {
        if let Some(users) = &self.sign_on
            && let Some((identity, usage)) = users.identify(request)?
        {
            return Ok(Presented::User(identity, usage));
        }
        if !request.headers().contains_key(header::AUTHORIZATION)
            && let Some(token) = session::token(request)?
        {
            session::check_site(request)?;
            return Ok(Presented::Session(digest(&token)));
        }
        let key = presented_key(request.headers())?;
        let id = AccessKey::id_in(&key).unwrap_or_default().to_owned();
        Ok(Presented::Key(SignedIn { key: id, key_digest: digest(&key) }))
    }

    /// Identifies the caller by its key, its session or its sign-on proxy. Records the use of the key.
    async fn identify(
        &self,
        presented: Presented,
        headers: &HeaderMap,
    ) -> Result<(Identity, Arc<Usage>)> {
        let (credential, session) = match presented {
            Presented::User(identity, usage) => return Ok((identity, usage)),
            Presented::Key(credential) => (credential, None),
            Presented::Session(session) => {
                let credential = self.store.session(&session).await?;
                (credential.ok_or_else(|| ended(headers, ENDED))?, Some(session))
            }
        };
        let refused = |reason: &str| refused(headers, session.is_some(), reason);
        let (now, SignedIn { key: known, key_digest }) = (now(), credential);
        let admin = self.admin.as_ref().filter(|admin| key_digest.ct_eq(&admin.digest).into());
        let (owner, role, key, private, usage) = if let Some(admin) = admin {
            (ADMIN.to_owned(), Role::Admin, ADMIN.to_owned(), false, Arc::clone(&admin.usage))
        } else {
            let unknown = || {
                refused(
                    "This server does not know the key. An administrator of the server makes keys.",
                )
            };
            if known.is_empty() {
                return Err(unknown());
            }
            let holder = self.keyring.holder_of(&known, &key_digest).await?.ok_or_else(unknown)?;
            if let Some(reason) = invalid(&holder.key, now) {
                return Err(refused(&reason));
            }
            let AccessKey { id, name, role, private, .. } = &holder.key;
            (name.clone(), *role, id.clone(), *private, Arc::clone(&holder.usage))
        };
        let actor = || Actor { name: owner.clone(), key: key.clone() };
        self.keyring.record_use(&usage, now, actor);
        let credential = Some(SignedIn { key: key.clone(), key_digest });
        Ok((Identity { owner, role, key, private, credential, session }, usage))
    }

    /// Checks an accepted request once more. Returns the problem if the server would now refuse a request of this caller
    /// (or without a key, for `None`). If the database does not answer, running requests continue.
    pub async fn recheck(&self, identity: Option<&Identity>) -> Option<Problem> {
        let headers = &HeaderMap::new();
        let Some(Identity { key, session, .. }) = identity else {
            let required = self.requires_key().await.unwrap_or_else(|problem| {
                tracing::error!(error = problem.cause(), "cannot read the access keys");
                false
            });
            let reason = "The server requires a key since this request began.";
            return required.then(|| unauthorized(headers, "", reason));
        };
        if let Some(session) = session
            && let Ok(None) = self.store.session(session).await
        {
            return Some(ended(headers, ENDED));
        }
        let reason = invalid(&self.keyring.holders().await.ok()?.get(key)?.key, now())?;
        Some(refused(headers, session.is_some(), &reason))
    }

    /// The requests per minute that a key allows; `None` for no limit.
    pub fn per_minute(&self, key: &AccessKey) -> Option<u32> {
        self.keyring.limits(key).per_minute.map(Into::into)
    }

    /// Counts a request with a link against the key that signed the link. Refuses the request if that key is no longer
    /// valid.
    async fn count_link(&self, issuer: &str, quota: Option<Quota>) -> Result<OpenRequest> {
        let holders = self.keyring.holders().await?;
        let usage = match (holders.get(issuer), &self.admin) {
            (Some(holder), _) if self.open || invalid(&holder.key, now()).is_none() => {
                Some(&holder.usage)
            }
            // The signature covers the digest of the admin key, so the link is of the present admin key.
            (None, Some(admin)) if issuer == ADMIN => Some(&admin.usage),
            (None, _) if issuer == ANYONE && !self.requires_key().await? => None,
            _ => {
                let detail = "The access key that made this link is no longer valid, so the link is not valid either. \
                    Ask its sender for a new link.";
                return Err(Problem::new(&kinds::BAD_LINK, detail));
            }
        };
        usage.map_or_else(|| Ok(OpenRequest::default()), |usage| usage.links.take(quota))
    }
}

/// Whether the `Host` of a request is an IP address or localhost. A web page can point its own name at this
/// machine (DNS rebinding); this refuses such requests.
fn has_local_host(request: &Request) -> bool {
    // A host that is not text is not local.
    let host = request.headers().get(header::HOST).map(|host| host.to_str().unwrap_or(""));
    let Some(host) = request.uri().host().or(host) else {
        return true;
    };
    if let Some(rest) = host.strip_prefix('[') {
        return rest.split_once(']').is_some_and(|(address, port)| {
            address.parse::<Ipv6Addr>().is_ok() && (port.is_empty() || port.starts_with(':'))
        });
    }
    let name = host.split_once(':').map_or(host, |(name, _)| name);
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let last = name.rsplit_once('.').map_or(name, |(_, last)| last);
    name.parse::<Ipv4Addr>().is_ok()
        || (last.eq_ignore_ascii_case("localhost") && name.bytes().all(plain))
}

/// The problem for a request whose key is not valid. A browser with a session has sent no key itself.
fn refused(headers: &HeaderMap, has_session: bool, reason: &str) -> Problem {
    if has_session {
        return ended(headers, &format!("{reason} Sign in with another key."));
    }
    unauthorized(headers, ", error=\"invalid_token\"", reason)
}

/// Why a key is not valid; `None` if it is.
fn invalid(key: &AccessKey, now: i64) -> Option<String> {
    if let Some(at) = key.revoked {
        return Some(format!("The key {} was revoked on {}.", key.id, instant(at)));
    }
    let at = key.expires.filter(|at| *at <= now)?;
    Some(format!("The key {} expired on {}.", key.id, instant(at)))
}

/// The key that a request presents.
fn presented_key(headers: &HeaderMap) -> Result<String> {
    let Some(value) = headers.get(header::AUTHORIZATION) else {
        return Err(unauthorized(headers, "", "This server requires an access key."));
    };
    let key = value.to_str().ok().and_then(key_in);
    key.ok_or_else(|| {
        unauthorized(
            headers,
            "",
            "The Authorization header has no access key after the word Bearer.",
        )
    })
}

/// The key in an `Authorization` header: a bearer token, or the name or the password of Basic
/// authentication, for clients that support only `http://name:password@host`.
fn key_in(authorization: &str) -> Option<String> {
    let (scheme, rest) = authorization.split_once(' ')?;
    if scheme.eq_ignore_ascii_case("bearer") {
        return Some(rest.trim().to_owned());
    }
    if !scheme.eq_ignore_ascii_case("basic") {
        return None;
    }
    let decoded = String::from_utf8(BASE64.decode(rest.trim().as_bytes()).ok()?).ok()?;
    let (name, password) = decoded.split_once(':')?;
    let is_name = AccessKey::id_in(name).is_some() || password.is_empty();
    Some(if is_name { name } else { password }.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn presented(authorization: &str) -> Option<String> {
        let mut headers = HeaderMap::new();
        headers.insert(header::AUTHORIZATION, HeaderValue::from_str(authorization).unwrap());
        presented_key(&headers).ok()
    }

    #[test]
    fn a_key_is_accepted_as_bearer_token_user_name_or_password() {
        let key = format!("fretwork_0a1b2c3d_{}", "0".repeat(40));
        let basic = |text: String| format!("Basic {}", BASE64.encode(text.as_bytes()));
        for sound in [
            format!("Bearer {key}"),
            format!("bearer  {key}"),
            basic(format!("{key}:")),
            basic(format!("{key}:x")),
            basic(format!("anna:{key}")),
            basic(format!(":{key}")),
        ] {
            assert_eq!(presented(&sound).as_deref(), Some(key.as_str()), "{sound}");
        }
        for bad in ["Bearer", "Digest x", "Basic !", "Basic YQ=="] {
            assert_eq!(presented(bad), None, "{bad}");
        }
    }
}
