//! The gate before all routes: who asks, whether they may, and how much.
//!
//! Keys count from the moment that there is one. Until then whoever reaches the server may do
//! everything, which is why it then listens on this machine only.

use std::collections::HashMap;
use std::fmt;
use std::net::{Ipv4Addr, Ipv6Addr};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};

use axum::Json;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use data_encoding::BASE64;
use serde::Serialize;
use subtle::ConstantTimeEq as _;
use tokio::sync::{Mutex, OnceCell};
use utoipa::ToSchema;

use super::App;
use super::caller::Caller;
use super::limits::{Account, Limits, Place};
use super::links::{self, Signer};
use super::problem::{self, Problem};
use super::wire::{NoQuery, instant};
use crate::job::clock::now;
use crate::store::{AccessKey, Error, Role, Store, digest};

/// So long a key that was taken back may still open.
const FRESH: Duration = Duration::from_secs(1);
/// That a key was used is written down so often at most, in milliseconds.
const NOTED: i64 = 60_000;

/// How callers are told apart.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// Whoever reaches the server may do everything, whether there are keys or not.
    pub open: bool,
    /// A key that may do everything, beside those in the tables.
    pub admin_key: Option<AdminKey>,
    /// What one key may ask for, unless it has limits of its own.
    pub limits: Limits,
}

/// A secret from the settings. It is not shown.
#[derive(Clone, PartialEq, Eq)]
pub struct AdminKey(pub String);

impl fmt::Debug for AdminKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("AdminKey(…)")
    }
}

/// Who asks, once a key has said so.
#[derive(Debug, Clone)]
pub struct Identity {
    /// Whom jobs belong to.
    pub owner: String,
    pub role: Role,
    /// The key, by the name that may be shown.
    pub key: String,
}

/// Lets requests in.
pub struct Gate {
    store: Store,
    open: bool,
    master: Option<Master>,
    limits: Limits,
    ring: RwLock<Option<Ring>>,
    /// One reads the keys, the others wait for it.
    reading: Mutex<()>,
    signer: OnceCell<Signer>,
}

impl fmt::Debug for Gate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gate").finish_non_exhaustive()
    }
}

/// The key from the settings.
struct Master {
    digest: [u8; 32],
    account: Account,
    links: Account,
}

/// The keys as they were a moment ago.
#[derive(Clone)]
struct Ring {
    read: Instant,
    holders: Arc<HashMap<String, Arc<Holder>>>,
}

/// One key, and what it has taken of its limits.
struct Holder {
    key: AccessKey,
    account: Account,
    /// What those have taken who come by its links: as much as the key itself may.
    links: Account,
    /// When it was last written down that it was used.
    noted: AtomicI64,
}

/// What a request has passed the gate with.
struct Pass {
    identity: Option<Identity>,
    place: Place,
    /// By a link: for how long it is still good.
    link: Option<Duration>,
}

/// What a route needs, declared where the route is defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// The least role; none where everyone may call.
    pub role: Option<Role>,
    /// Whether a call counts against the limits of its caller.
    pub counted: bool,
}

impl Needs {
    /// Open to everyone: it shows no data.
    pub const NOTHING: Self = Self { role: None, counted: false };
    /// To read.
    pub const READ: Self = Self { role: Some(Role::Read), counted: true };
    /// To submit and to change.
    pub const SUBMIT: Self = Self { role: Some(Role::Submit), counted: true };
    /// To stop work: it relieves the server, so a caller beyond its limits may do it too.
    pub const STOP: Self = Self { role: Some(Role::Submit), counted: false };
    /// To administrate.
    pub const ADMIN: Self = Self { role: Some(Role::Admin), counted: true };
}

/// What a route needs; an unknown route is not open.
pub fn needs(method: &Method, route: &str) -> Needs {
    let safe = matches!(*method, Method::GET | Method::HEAD);
    let declared = super::NEEDS.get(route).and_then(|declared| {
        let method = if safe { "GET" } else { method.as_str() };
        declared.iter().find(|(name, _)| *name == method)
    });
    match declared {
        Some((_, needs)) => *needs,
        None if safe => Needs::READ,
        None => Needs::SUBMIT,
    }
}

/// Stands before all routes, and behind those that took long.
pub async fn pass(State(gate): State<Arc<Gate>>, mut request: Request, next: Next) -> Response {
    let came = Instant::now();
    let route = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    let needed = needs(request.method(), route).role.is_some();
    let Pass { identity, place, link } = match gate.admit(&mut request).await {
        Ok(pass) => pass,
        Err(problem) => return problem.into_response(),
    };
    let keyed = identity.is_some();
    if let Some(identity) = &identity {
        request.extensions_mut().insert(identity.clone());
    }
    if let Some(standing) = place.standing {
        request.extensions_mut().insert(standing);
    }
    let mut response = next.run(request).await;
    // What a wait has found is not for a key that was taken back meanwhile.
    if needed
        && link.is_none()
        && came.elapsed() > FRESH
        && let Some(why) = gate.ousted(identity.as_ref().map(|identity| &*identity.key)).await
    {
        response = why.into_response();
    }
    if let Some(identity) = identity {
        response.extensions_mut().insert(identity);
    }
    if let Some(standing) = place.standing {
        standing.tell(response.headers_mut());
    }
    if keyed || link.is_some() {
        keep_private(response.headers_mut(), link);
    }
    response.map(|body| place.hold(body))
}

/// What only some may read is not for caches that many share, nor for longer than the link is good.
fn keep_private(headers: &mut HeaderMap, link: Option<Duration>) {
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
    pub fn new(store: &Store, access: &Access) -> Self {
        let master = access.admin_key.as_ref().map(|AdminKey(key)| {
            let digest = digest(key);
            let accounts = [Account::new(access.limits), Account::new(access.limits)];
            let [account, links] = accounts;
            Master { digest, account, links }
        });
        Self {
            store: store.clone(),
            open: access.open,
            master,
            limits: access.limits,
            ring: RwLock::default(),
            reading: Mutex::default(),
            signer: OnceCell::new(),
        }
    }

    /// What signs links.
    pub async fn signer(&self) -> Result<&Signer, Problem> {
        self.signer
            .get_or_try_init(|| async {
                let admin = self.master.as_ref().map(|master| master.digest);
                Signer::new(&self.store.link_secret().await?, admin).ok_or_else(Problem::internal)
            })
            .await
    }

    async fn admit(&self, request: &mut Request) -> Result<Pass, Problem> {
        let matched = request.extensions().get::<MatchedPath>().cloned();
        let route = matched.as_ref().map_or("", MatchedPath::as_str);
        let Needs { role, counted } = needs(request.method(), route);
        let Some(needed) = role else {
            return Ok(Pass { identity: None, place: Place::default(), link: None });
        };
        if let Some(token) = links::token(request.uri()) {
            let link = links::open(self.signer().await?, request.uri(), route, token)?;
            if needed > Role::Read {
                return Err(Problem::new(&problem::BAD_LINK, "A link is for reading only."));
            }
            let place = self.charge(&link.issuer).await?.untold();
            *request.uri_mut() =
                links::without_token(request.uri()).ok_or_else(Problem::internal)?;
            // No key has such a name, so nothing is theirs.
            let (owner, key) = ("a link".to_owned(), link.issuer);
            let identity = Some(Identity { owner, role: Role::Read, key });
            return Ok(Pass { identity, place, link: Some(link.left) });
        }
        if !self.asks_for_keys().await? {
            if !self.open && !is_own_name(request) {
                let detail = "Without keys this server is for the machine it runs on, and answers to \
                    localhost and to addresses only. To be asked by a name it must have keys \
                    (`fretwork keys add`) or be told --no-auth.";
                return Err(Problem::new(&problem::UNKNOWN_HOST, detail));
            }
            return Ok(Pass { identity: None, place: Place::default(), link: None });
        }
        let (identity, holder) = self.identify(request.headers()).await?;
        let place = match (&holder, &self.master) {
            _ if !counted => Place::default(),
            (Some(holder), _) => holder.account.take()?,
            (None, Some(master)) => master.account.take()?,
            (None, None) => Place::default(),
        };
        if identity.role < needed {
            let detail = format!(
                "This needs a key of role {needed}, and this one ({}, {}) has role {}.",
                identity.owner, identity.key, identity.role
            );
            let problem = Problem::new(&problem::FORBIDDEN, detail);
            return Err(match place.standing {
                Some(standing) => standing.tell_in(problem),
                None => problem,
            });
        }
        Ok(Pass { identity: Some(identity), place, link: None })
    }

    /// Whether callers have to have a key.
    pub async fn asks_for_keys(&self) -> Result<bool, Problem> {
        Ok(!self.open && (self.master.is_some() || !self.holders(FRESH).await?.is_empty()))
    }

    /// Who presents the key of a request. Without a holder it is the one from the settings.
    async fn identify(
        &self,
        headers: &HeaderMap,
    ) -> Result<(Identity, Option<Arc<Holder>>), Problem> {
        let presented = credential(headers)?;
        if let Some(master) = &self.master
            && bool::from(digest(&presented).ct_eq(&master.digest))
        {
            let (owner, key) = (ADMIN.to_owned(), ADMIN.to_owned());
            return Ok((Identity { owner, role: Role::Admin, key }, None));
        }
        let unknown = || refused(headers, "This server does not know the key.");
        let id = AccessKey::id_in(&presented).ok_or_else(unknown)?;
        let mut holder = self.holders(FRESH).await?.get(id).cloned();
        if holder.is_none() {
            // It may have been made this moment.
            holder = self.holders(Duration::ZERO).await?.get(id).cloned();
        }
        let holder = holder.filter(|holder| holder.key.is(&presented)).ok_or_else(unknown)?;
        let now = now();
        if let Some(ended) = ended(&holder.key, now) {
            return Err(refused(headers, &ended));
        }
        self.note(&holder, now);
        let AccessKey { id, name, role, .. } = &holder.key;
        let identity = Identity { owner: name.clone(), role: *role, key: id.clone() };
        Ok((identity, Some(holder)))
    }

    /// Why who was let in by this key, or without one, would not be let in now. What goes on for long
    /// asks again and again; a database that does not answer throws nobody out.
    pub async fn ousted(&self, key: Option<&str>) -> Option<Problem> {
        let why = match key {
            None => {
                let keys = self.asks_for_keys().await.unwrap_or(false);
                keys.then(|| "Since this was asked, keys were made.".to_owned())?
            }
            Some(id) => ended(&self.holders(FRESH).await.ok()?.get(id)?.key, now())?,
        };
        Some(refused(&HeaderMap::new(), &why))
    }

    /// Takes a request by a link from what its maker may, if the maker is still good.
    async fn charge(&self, issuer: &str) -> Result<Place, Problem> {
        let holders = self.holders(FRESH).await?;
        let holder = holders.get(issuer);
        match (holder, &self.master) {
            (Some(holder), _) if self.open || ended(&holder.key, now()).is_none() => {
                return holder.links.take();
            }
            // Only who has the key of the settings can have signed it.
            (None, Some(master)) if issuer == ADMIN => return master.links.take(),
            // Before there were keys, everyone could make one.
            (None, _) if issuer == ANYONE && !self.asks_for_keys().await? => {
                return Ok(Place::default());
            }
            _ => {}
        }
        let detail = "The key that made this link is not good any more, and so is the link. Ask \
            whoever sent it for a new one.";
        Err(Problem::new(&problem::BAD_LINK, detail))
    }

    /// The keys as they were so long ago at most.
    async fn holders(&self, age: Duration) -> Result<Arc<HashMap<String, Arc<Holder>>>, Error> {
        let asked = Instant::now();
        let fresh = |ring: &Option<Ring>| {
            let ring = ring.as_ref().filter(|ring| ring.read + age >= asked)?;
            Some(Arc::clone(&ring.holders))
        };
        let known = || fresh(&self.ring.read().unwrap_or_else(PoisonError::into_inner));
        if let Some(holders) = known() {
            return Ok(holders);
        }
        let _reading = self.reading.lock().await;
        if let Some(holders) = known() {
            return Ok(holders);
        }
        let read = Instant::now();
        let keys = self.store.access_keys().await?;
        let mut ring = self.ring.write().unwrap_or_else(PoisonError::into_inner);
        let before = ring.as_ref().map(|ring| Arc::clone(&ring.holders)).unwrap_or_default();
        let holders = keys.into_iter().map(|key| {
            // Who is the same as before keeps what it has taken.
            let same = before.get(&key.id).filter(|holder| holder.key.is_like(&key));
            let holder = same.map_or_else(|| Arc::new(self.holder(key.clone())), Arc::clone);
            (key.id, holder)
        });
        let holders = Arc::new(holders.collect());
        *ring = Some(Ring { read, holders: Arc::clone(&holders) });
        Ok(holders)
    }

    fn holder(&self, key: AccessKey) -> Holder {
        let per_minute = match key.per_minute {
            None => self.limits.per_minute,
            Some(own) => std::num::NonZeroU32::new(own),
        };
        let limits = Limits { per_minute, ..self.limits };
        let (account, links) = (Account::new(limits), Account::new(limits));
        Holder { account, links, noted: AtomicI64::new(key.last_used.unwrap_or(0)), key }
    }

    /// Has it written down that a key was used.
    #[expect(clippy::disallowed_methods, reason = "nobody waits for it, and it ends by itself")]
    fn note(&self, holder: &Holder, now: i64) {
        let noted = holder.noted.load(Ordering::Relaxed);
        let first = now - noted > NOTED
            && holder
                .noted
                .compare_exchange(noted, now, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok();
        if first {
            let (store, id) = (self.store.clone(), holder.key.id.clone());
            tokio::spawn(async move {
                // It is a hint for people; on a full disk it is missed by nobody.
                let _ = store.key_was_used(&id).await;
            });
        }
    }
}

/// Whether a request asks for this server by a name that cannot be another's: a page of a foreign name
/// that leads here (DNS rebinding) is refused.
fn is_own_name(request: &Request) -> bool {
    let host = request.headers().get(header::HOST).map(|host| host.to_str().unwrap_or_default());
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
    let last = name.rsplit('.').next().unwrap_or_default();
    name.parse::<Ipv4Addr>().is_ok()
        || (last.eq_ignore_ascii_case("localhost") && name.bytes().all(plain))
}

/// The name under which the key from the settings acts and signs.
pub const ADMIN: &str = "admin";
/// Who makes links where there are no keys.
pub const ANYONE: &str = "anyone";

/// Why a key is not good any more.
fn ended(key: &AccessKey, now: i64) -> Option<String> {
    if let Some(at) = key.revoked {
        return Some(format!("The key {} was taken back on {}.", key.id, instant(at)));
    }
    let at = key.expires.filter(|at| *at <= now)?;
    Some(format!("The key {} was good until {}.", key.id, instant(at)))
}

/// The key that a request presents: as a bearer token, or as the name or the password of Basic
/// authentication, which is what clients that know only addresses can send.
fn credential(headers: &HeaderMap) -> Result<String, Problem> {
    let malformed = || refused(headers, "The Authorization header cannot be read.");
    let Some(value) = headers.get(header::AUTHORIZATION) else {
        return Err(refused(headers, "This server asks for a key."));
    };
    let text = value.to_str().map_err(|_| malformed())?;
    let (scheme, rest) = text.split_once(' ').ok_or_else(malformed)?;
    if scheme.eq_ignore_ascii_case("bearer") {
        return Ok(rest.trim().to_owned());
    }
    if scheme.eq_ignore_ascii_case("basic") {
        let decoded = BASE64.decode(rest.trim().as_bytes()).map_err(|_| malformed())?;
        let decoded = String::from_utf8(decoded).map_err(|_| malformed())?;
        let (name, password) = decoded.split_once(':').ok_or_else(malformed)?;
        let key =
            if AccessKey::id_in(name).is_some() || password.is_empty() { name } else { password };
        return Ok(key.to_owned());
    }
    Err(malformed())
}

/// Asks for a key, in the way that the client can answer.
fn refused(headers: &HeaderMap, why: &str) -> Problem {
    let detail = format!("{why} Send one as `Authorization: Bearer fretwork_…`.");
    let problem = Problem::new(&problem::UNAUTHORIZED, detail)
        .with_header(header::WWW_AUTHENTICATE, "Bearer realm=\"fretwork\"");
    let accepts = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    if accepts.is_some_and(|accepts| accepts.contains("text/html")) {
        // A browser then asks its user.
        return problem.with_header(header::WWW_AUTHENTICATE, "Basic realm=\"fretwork\"");
    }
    problem
}

/// Who the caller is to this server.
#[derive(Debug, Serialize, ToSchema)]
pub struct Me {
    /// Whom jobs belong to: the name of the key, or the address of the client where there are no
    /// keys.
    #[schema(example = "anna")]
    name: String,
    /// `read`, `submit` or `admin`.
    #[schema(value_type = super::openapi::Role, example = "submit")]
    role: &'static str,
    /// The id of the key; null where there are no keys.
    #[schema(example = "0a1b2c3d")]
    key: Option<String>,
    /// What may be asked for.
    limits: CallerLimits,
    /// What is asked for.
    usage: CallerUsage,
}

/// What the caller may ask for; null is no limit.
#[derive(Debug, Serialize, ToSchema)]
struct CallerLimits {
    /// Requests a minute.
    #[schema(example = 60_000)]
    requests_per_minute: Option<u32>,
    /// Requests at work at the same time.
    #[schema(example = 256)]
    requests_at_once: Option<u32>,
}

/// What the caller asks for.
#[derive(Debug, Serialize, ToSchema)]
struct CallerUsage {
    /// Requests that may come at once before the limit is met; null without one.
    #[schema(example = 59_999)]
    requests_left: Option<u32>,
    /// Own jobs that wait.
    #[schema(example = 0)]
    jobs_queued: u64,
    /// Own jobs that are computed just now.
    #[schema(example = 0)]
    jobs_running: u64,
}

/// Says who the caller is: name, role, limits and usage.
///
/// Without keys every caller is an administrator by the name of its address. Asking counts as a request.
#[utoipa::path(get, path = "/v1/me", operation_id = "me", tag = "system", responses(
    (status = 200, description = "The caller.", body = Me),
))]
pub async fn me(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
) -> Result<impl IntoResponse, Problem> {
    let (jobs_queued, jobs_running) = app.store.unfinished(&caller.owner).await?;
    let limits = match (&caller.key, &app.gate.master) {
        (None, _) => Limits::default(),
        (Some(key), Some(master)) if key == ADMIN => master.account.limits,
        (Some(key), _) => {
            let holders = app.gate.holders(FRESH).await?;
            holders.get(key).map_or(app.gate.limits, |holder| holder.account.limits)
        }
    };
    let me = Me {
        name: caller.owner,
        role: caller.role.as_str(),
        key: caller.key,
        limits: CallerLimits {
            requests_per_minute: limits.per_minute.map(Into::into),
            requests_at_once: limits.at_once.map(Into::into),
        },
        usage: CallerUsage {
            requests_left: caller.standing.map(|standing| standing.left),
            jobs_queued,
            jobs_running,
        },
    };
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(me)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn presented(authorization: &str) -> Option<String> {
        let mut headers = HeaderMap::new();
        headers.insert(header::AUTHORIZATION, HeaderValue::from_str(authorization).unwrap());
        credential(&headers).ok()
    }

    #[test]
    fn a_key_comes_as_a_token_as_a_name_or_as_a_password() {
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

    #[test]
    fn a_route_needs_the_role_it_declares() {
        for (method, route, needed) in [
            (Method::GET, "/healthz", Needs::NOTHING),
            (Method::HEAD, "/assets/{*name}", Needs::NOTHING),
            (Method::GET, "/v1/jobs", Needs::READ),
            (Method::POST, "/v1/scenarios", Needs::READ),
            (Method::POST, "/v1/jobs", Needs::SUBMIT),
            (Method::PUT, "/v1/results/{key}/pin", Needs::SUBMIT),
            (Method::POST, "/v1/jobs/{id}/cancel", Needs::STOP),
            (Method::DELETE, "/v1/results/{key}", Needs::ADMIN),
            // An unknown route is not open.
            (Method::PATCH, "", Needs::SUBMIT),
            (Method::GET, "", Needs::READ),
        ] {
            assert_eq!(needs(&method, route), needed, "{method} {route}");
        }
    }
}
