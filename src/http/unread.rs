//! What nobody read of a request: an answer that comes before the body does not cost the connection.
//!
//! Many refusals need no body. But a client that is cut off while it sends may never see the answer,
//! and one that goes on with the same connection would find it closed. So what is left is taken off
//! the line behind the answer, which does not wait for that.

use std::mem;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::http::{Version, header};
use http_body::{Frame, SizeHint};
use http_body_util::BodyExt as _;
use tokio::time::timeout;

use super::wire::BODY_LIMIT;

/// So many bytes are taken off the line.
const MOST: u64 = 16 * BODY_LIMIT as u64;
/// So long a slow sender is listened to.
const LONGEST: Duration = Duration::from_secs(30);

/// The body of a request whose answer may come first.
pub struct Unread {
    left: Arc<Mutex<Option<Left>>>,
    /// The connection has one request at a time, and can end with its answer.
    alone: bool,
    /// The client sends its body once it is told to (`Expect: 100-continue`).
    asks_first: bool,
}

/// What is left of a body.
struct Left {
    body: Body,
    /// Something of it was read.
    begun: bool,
}

impl Unread {
    /// Keeps an eye on the body of a request, if it has one.
    pub fn watch(request: &mut Request) -> Option<Self> {
        if request.body().is_end_stream() {
            return None;
        }
        let left = Arc::default();
        let body = mem::take(request.body_mut());
        let watched = Watched { body, begun: false, ended: false, left: Arc::clone(&left) };
        *request.body_mut() = Body::new(watched);
        let alone = request.version() <= Version::HTTP_11;
        let asks_first = alone && request.headers().contains_key(header::EXPECT);
        Some(Self { left, alone, asks_first })
    }

    /// Has taken off the line what nobody has read, now that the answer is there. True if the connection
    /// ends with the answer: there is too much, or it is better not sent at all.
    #[expect(clippy::disallowed_methods, reason = "nobody waits for it, and it ends by itself")]
    pub fn settle(self) -> bool {
        let left = self.left.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(Left { body, begun }) = left else {
            return false;
        };
        if self.asks_first && !begun {
            return true;
        }
        let too_much = body.size_hint().lower() > MOST;
        // So that the answer gets through, also what is too much is listened to for a while.
        tokio::spawn(timeout(LONGEST, take_off(body)));
        self.alone && too_much
    }
}

async fn take_off(mut body: Body) {
    let mut length = 0;
    while length <= MOST
        && let Some(Ok(frame)) = body.frame().await
    {
        length += frame.data_ref().map_or(0, Bytes::len) as u64;
    }
}

/// A body that leaves behind what nobody has read of it.
struct Watched {
    body: Body,
    begun: bool,
    ended: bool,
    left: Arc<Mutex<Option<Left>>>,
}

impl HttpBody for Watched {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.begun = true;
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        self.ended |= !matches!(frame, Some(Ok(_)));
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        if self.ended || self.body.is_end_stream() {
            return;
        }
        let left = Left { body: mem::take(&mut self.body), begun: self.begun };
        *self.left.lock().unwrap_or_else(PoisonError::into_inner) = Some(left);
    }
}
