//! Reads the rest of a request body that the handler did not read.
//!
//! Many refusals do not need the body. If the server closed the connection while the client still sends
//! its body, the client would often lose the answer. So the rest of the body is read and discarded. The
//! answer does not wait for that, and the connection stays usable for the next request.

use std::mem;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::http::{Version, header};
use http_body::{Frame, SizeHint};
use http_body_util::BodyExt as _;
use tokio::runtime::Handle;
use tokio::time::timeout;

use super::body::BODY_LIMIT;
use super::connection::OpenRequest;

/// Maximum number of bytes that are read and discarded.
const MAX_DRAINED: u64 = 16 * BODY_LIMIT as u64;
/// Maximum time to drain an unread body.
const MAX_TIME: Duration = Duration::from_secs(30);

/// Wraps the body of a request, so that its rest is drained when the handler drops it.
///
/// True if the connection must be closed after an error: the client will send too many bytes, or it waits
/// for `100 Continue` and need not send any.
pub fn drain_body(request: &mut Request) -> bool {
    if request.body().is_end_stream() {
        return false;
    }
    let waits = request.headers().contains_key(header::EXPECT);
    let body = mem::take(request.body_mut());
    let too_large = body.size_hint().lower() > MAX_DRAINED;
    let open = request.extensions().get().cloned();
    *request.body_mut() = Body::new(Drained { body, drain: !waits, open });
    request.version() <= Version::HTTP_11 && (waits || too_large)
}

/// A body that is drained when it is dropped.
struct Drained {
    body: Body,
    /// Whether the client sends the body now. A client that sent `Expect: 100-continue` begins when the server reads
    /// the body.
    drain: bool,
    /// The request is open until its body has been drained.
    open: Option<Arc<OpenRequest>>,
}

impl HttpBody for Drained {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.drain = true;
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        self.drain = matches!(frame, Some(Ok(_)));
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Drained {
    fn drop(&mut self) {
        // Without a runtime, the server has stopped, and its connections are closed anyway.
        if self.drain
            && !self.body.is_end_stream()
            && let Ok(runtime) = Handle::try_current()
        {
            let (body, open) = (mem::take(&mut self.body), self.open.take());
            runtime.spawn(async move {
                let _open = open;
                timeout(MAX_TIME, drain(body)).await
            });
        }
    }
}

async fn drain(mut body: Body) {
    let mut length = 0;
    while length <= MAX_DRAINED
        && let Some(Ok(frame)) = body.frame().await
    {
        length += frame.data_ref().map_or(0, Bytes::len) as u64;
    }
}
