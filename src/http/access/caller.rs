//! The caller of a request, and the ids of the request.

use std::convert::Infallible;
use std::fmt;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{Extensions, HeaderMap, HeaderName};
use uuid::Uuid;

use super::limits::Standing;
use super::signed_link::ADMIN;
use fretwork_store::{Actor, Reach, Role, Seen, SignedIn};

/// The client of a request: the name of its network, which owns the jobs of a client without a key.
#[derive(Debug, Clone)]
pub struct Peer(Arc<str>);

impl From<IpAddr> for Peer {
    fn from(address: IpAddr) -> Self {
        Self(match network(address) {
            IpAddr::V4(address) => address.to_string().into(),
            IpAddr::V6(network) => format!("{network}/64").into(),
        })
    }
}

impl Peer {
    /// Whether the client has a loopback address.
    pub fn is_this_machine(&self) -> bool {
        // The network of `::1` is `::/64`.
        self.0.starts_with("127.") || &*self.0 == "::/64"
    }
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// The caller, as identified by its key.
#[derive(Debug, Clone)]
pub struct Identity {
    /// The owner of the caller's jobs: the name of the key.
    pub owner: String,
    pub role: Role,
    /// The public id of the key.
    pub key: String,
    /// Whether the names that the caller gives are private.
    pub private: bool,
    /// The key with which a browser can sign in; `None` for a link or a user of a sign-on proxy.
    pub credential: Option<SignedIn>,
    /// The digest of the token of the session, if the request has a cookie in place of the key.
    pub session: Option<[u8; 32]>,
}

/// The caller in the log.
impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.owner, self.key)
    }
}

/// Marks a request that a trusted proxy has forwarded.
#[derive(Debug, Clone, Copy)]
pub struct ViaProxy;

/// The ids of a request. The server writes them to the answer, to the log, and to the log of the job that the request
/// submits.
#[derive(Debug, Clone)]
pub struct Trace {
    /// The request id.
    pub id: Arc<str>,
    /// The `traceparent` header of the client (W3C Trace Context).
    pub parent: Option<Arc<str>>,
}

pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
const TRACEPARENT: HeaderName = HeaderName::from_static("traceparent");

impl Trace {
    /// Reads the ids from the headers. An invalid request id is replaced by a new one.
    pub fn read(headers: &HeaderMap) -> Self {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let id = text(REQUEST_ID).filter(|id| is_valid_id(id));
        let own =
            || Arc::from(&*Uuid::now_v7().hyphenated().encode_lower(&mut Uuid::encode_buffer()));
        Self {
            id: id.map_or_else(own, Arc::from),
            parent: text(TRACEPARENT).filter(|text| is_traceparent(text)).map(Arc::from),
        }
    }
}

impl fmt::Display for Trace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.id)?;
        self.parent.iter().try_for_each(|parent| write!(f, " {parent}"))
    }
}

/// Whether a request id of a client is short and has only harmless characters. The server writes it to the log and to
/// the answer.
fn is_valid_id(id: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.:/+=".contains(&byte);
    (1..=128).contains(&id.len()) && id.bytes().all(plain)
}

/// Whether a text is a valid `traceparent`: version, trace id, parent id and flags in lower-case hexadecimal. Neither
/// id may be zero.
fn is_traceparent(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let hex = |part: &&str| part.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
    let lengths: Vec<usize> = parts.iter().map(|part| part.len()).collect();
    parts.iter().all(hex)
        && lengths == [2, 32, 16, 2]
        && parts[0] != "ff"
        && parts[1..3].iter().all(|id| id.bytes().any(|b| b != b'0'))
}

/// The owner of the requests with a signed link. No key can have this name.
pub const LINK_HOLDER: &str = "a link";

/// In filters by owner, this word means the caller. No key can have this name.
pub const ME: &str = "me";

/// Whether the owner of a key can have this name. It must differ from addresses, ids of keys and reserved names.
pub fn is_owner_name(text: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._@+-".contains(&byte);
    let is_id = text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    (1..=64).contains(&text.len())
        && text.bytes().all(plain)
        && text.parse::<IpAddr>().is_err()
        && !is_id
        && ![ADMIN, ME].contains(&text)
}

/// The client that sent a request.
#[derive(Debug, Clone)]
pub struct Caller {
    /// The owner of the caller's jobs: the name of the key, or the client's address on a server without keys.
    pub owner: String,
    /// What the caller may do.
    pub role: Role,
    /// The public id of the key; `None` on a server without keys.
    pub key: Option<String>,
    /// Whether the names that the caller gives are private.
    pub private: bool,
    /// The remaining requests, if the key has a limit.
    pub standing: Option<Standing>,
    /// The ids of the request. A job stores them as text: the request id, a blank, the `traceparent`.
    pub trace: Option<Trace>,
}

impl Caller {
    /// What the caller sees. The holder of a link sees no names. On a server without keys every caller sees and changes all
    /// jobs.
    pub fn reach(&self) -> Reach {
        let jobs = match self.role {
            Role::Admin => Seen::All,
            _ if self.owner == LINK_HOLDER => Seen::Own,
            _ => Seen::Shared,
        };
        Reach { owner: self.owner.clone(), jobs }
    }

    /// The caller, as the audit log names it.
    pub fn actor(&self) -> Actor {
        Actor { name: self.owner.clone(), key: self.key.clone().unwrap_or_default() }
    }

    /// The owner with this name, or the caller for `me`; `None` if the name is empty.
    pub fn owner_named(&self, name: &str) -> Option<String> {
        let owner = if name == ME { &self.owner } else { name };
        (!owner.is_empty()).then(|| owner.to_owned())
    }
}

/// The network of a client: the address itself for IPv4, its /64 network for IPv6. An IPv6 client can use any of the
/// 2⁶⁴ addresses of its network.
pub fn network(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V4(_) => address,
        IpAddr::V6(v6) => IpAddr::V6(Ipv6Addr::from_bits(v6.to_bits() >> 64 << 64)),
    }
}

/// The owner of a request: the name of its key, or the network of its client.
pub fn owner_of(extensions: &Extensions) -> String {
    match (extensions.get::<Identity>(), extensions.get::<Peer>()) {
        (Some(identity), _) => identity.owner.clone(),
        (None, Some(Peer(network))) => String::from(&**network),
        (None, None) => "unknown".to_owned(),
    }
}

impl<S: Sync> FromRequestParts<S> for Caller {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        let owner = owner_of(&parts.extensions);
        let (role, key, private) = match parts.extensions.get::<Identity>() {
            Some(Identity { role, key, private, .. }) => (*role, Some(key.clone()), *private),
            None => (Role::Admin, None, false),
        };
        let standing = parts.extensions.get::<Standing>().copied();
        let trace = parts.extensions.get::<Trace>().cloned();
        Ok(Self { owner, role, key, private, standing, trace })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invalid_traceparent_is_ignored() {
        let valid = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        assert!(is_traceparent(valid));
        for bad in [
            "",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7",
            "00-00000000000000000000000000000000-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
            "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
            "00 4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
        ] {
            assert!(!is_traceparent(bad), "{bad}");
        }
    }
}
