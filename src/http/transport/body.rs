//! The bodies of requests. The server reads a body within a time limit and within the caller's share of the memory. It
//! estimates the memory of the parsed body before it parses.

use std::sync::Arc;
use std::time::Duration;

use axum::body::HttpBody as _;
use axum::extract::{FromRequest, Request};
use axum::http::header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_TYPE};
use http_body_util::BodyExt as _;
use tokio::time::{Instant, timeout_at};

use super::connection::SLOWEST;
use crate::http::access::caller::owner_of;
use crate::http::problem::{Problem, Result, kinds};
use crate::http::shares::{Permit, SMALL, Shares};
use crate::http::wire::excerpt;
use crate::http::wire::weight::tree_bytes;

/// Largest body of a request, in bytes.
pub const BODY_LIMIT: usize = 4 << 20;
/// Time that every body may take. After it, the body must have arrived with at least [`SLOWEST`] bytes per second.
const PATIENCE: Duration = Duration::from_secs(10);

/// A request body with a JSON content type. It holds memory for its bytes and for its tree, which are the parsed
/// values.
pub struct Body(pub Counted);

/// Memory for each byte of a file of measured numbers, in bytes. Two bytes can become a number in a column, which takes 16,
/// and in the prepared table, which takes 32 but has only two columns.
const OF_FILE: usize = 12;

/// A body, and the permits for the memory of its bytes and of its tree.
pub struct Counted {
    pub bytes: Vec<u8>,
    _body: Permit,
    _tree: Permit,
}

impl<S: Sync> FromRequest<S> for Body {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &S) -> Result<Self> {
        let coding = request.headers().get(CONTENT_ENCODING);
        if coding.is_some_and(|coding| !coding.as_bytes().eq_ignore_ascii_case(b"identity")) {
            let detail = "The body has a Content-Encoding. Send it without compression, and without this header.";
            return Err(Problem::new(&kinds::UNSUPPORTED_CODING, detail)
                .with_header(ACCEPT_ENCODING, "identity"));
        }
        // A body without a type is refused too: browsers let web pages of any origin send one.
        let declared =
            request.headers().get(CONTENT_TYPE).map(|value| value.to_str().unwrap_or(""));
        if !declared.is_some_and(is_json) {
            let declared = declared.map_or_else(
                || "The body has no Content-Type".to_owned(),
                |declared| format!("The Content-Type of the body is \"{}\"", excerpt(declared)),
            );
            let detail = format!("{declared}. Send it with Content-Type: application/json.");
            return Err(Problem::new(&kinds::UNSUPPORTED_MEDIA_TYPE, detail));
        }
        read_counted(request, tree_bytes).await.map(Self)
    }
}

/// Reads a body of any content type. It holds memory for its bytes only: calls of UM-Bridge take turns, so only a few
/// trees exist at the same time.
pub async fn read_any(request: Request) -> Result<Counted> {
    read_counted(request, |bytes| tree_bytes(bytes).map(|_| 0)).await
}

/// Reads a body with a file of measured numbers, of any content type. It holds memory for its bytes and for the columns.
pub async fn read_file(request: Request) -> Result<Counted> {
    read_counted(request, |bytes| Ok(OF_FILE * bytes.len())).await
}

/// Reads a body. Reserves memory for its bytes, and for what they become.
#[expect(clippy::expect_used, reason = "the layer around all routes adds the shares")]
async fn read_counted(request: Request, tree: fn(&[u8]) -> Result<usize>) -> Result<Counted> {
    let caller = owner_of(request.extensions());
    let shares = request.extensions().get::<Arc<Shares>>().expect("each request has them").clone();
    let (bytes, body) = read(request, &shares, &caller).await?;
    let tree = shares.trees.hold(&caller, tree(&bytes)?).await?;
    Ok(Counted { bytes, _body: body, _tree: tree })
}

fn is_json(media_type: &str) -> bool {
    let essence = media_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    essence == "application/json"
        || (essence.starts_with("application/") && essence.ends_with("+json"))
}

/// Reads a body up to [`BODY_LIMIT`], if it arrives in time.
async fn read(request: Request, shares: &Shares, caller: &str) -> Result<(Vec<u8>, Permit)> {
    let too_large = || {
        let advice = "Remove rows from long tables in it.";
        let detail = format!("The body has more than {BODY_LIMIT} bytes. {advice}");
        Problem::new(&kinds::BODY_TOO_LARGE, detail)
    };
    let started = Instant::now();
    let mut body = request.into_body();
    let declared = usize::try_from(body.size_hint().lower()).unwrap_or(usize::MAX);
    if declared > BODY_LIMIT {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    let mut permit = Permit::default();
    let mut room = SMALL;
    loop {
        let time = PATIENCE + Duration::from_secs(bytes.len() as u64 / SLOWEST);
        let frame = timeout_at(started + time, body.frame()).await.map_err(|_| {
            let detail = format!(
                "Only {} bytes of the body have arrived in {} seconds. Send at least {SLOWEST} bytes per second.",
                bytes.len(),
                time.as_secs()
            );
            Problem::new(&kinds::SLOW_BODY, detail)
        })?;
        let Some(frame) = frame else { break };
        let frame = frame.map_err(|_| {
            let detail = "The connection ended before the end of the body. Send it again.";
            Problem::new(&kinds::INVALID_JSON, detail)
        })?;
        let Ok(data) = frame.into_data() else { continue };
        let length = bytes.len() + data.len();
        if length > BODY_LIMIT {
            return Err(too_large());
        }
        if length > room {
            // A body of unknown length gets memory for the longest possible body.
            room = if declared > 0 { declared } else { BODY_LIMIT };
            permit = shares.bodies.hold(caller, room).await?;
            bytes.reserve_exact(room - bytes.len());
        }
        bytes.extend_from_slice(&data);
    }
    bytes.shrink_to_fit();
    permit.shrink(bytes.len());
    Ok((bytes, permit))
}
