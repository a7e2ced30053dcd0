//! What happens on one connection, and when the server closes it.
//!
//! A client may be slow, but not for ever: an unfinished request, an unread answer and an idle connection
//! each occupy memory and one of the connections that the server can have.

use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes, HttpBody};
use axum::http::Version;
use http_body::{Frame, SizeHint};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::Notify;

use crate::http::shares::{Permit, holding};

/// Minimum number of bytes per second with which a client must read its answer and send its body.
pub const SLOWEST: u64 = 4 << 10;

/// Maximum number of seconds by which a client can be ahead of [`SLOWEST`].
const EARLIEST: f64 = 10.0;

/// The time between two checks of a connection.
const LOOK: Duration = Duration::from_secs(5);
/// Maximum time for the head of a request, from its first byte on. The first request of a connection must come
/// within this time.
const HEAD: Duration = Duration::from_secs(10);
/// Maximum time without a request. This is longer than the time for which reverse proxies keep an idle connection,
/// mostly a minute.
const IDLE: Duration = Duration::from_mins(2);
/// Maximum time by which a client can be behind [`SLOWEST`] while it reads an answer.
const SLOW: Duration = Duration::from_secs(20);
/// Maximum time without any byte during a request. This must be longer than the longest wait for a job.
const SILENT: Duration = Duration::from_mins(2);

/// The requests and the bytes of one connection. The socket counts the bytes, and each request counts itself.
#[derive(Debug)]
pub struct Activity {
    opened: Instant,
    /// Requests without a complete answer.
    open: AtomicUsize,
    /// Whether the connection has had a request.
    served: AtomicBool,
    /// Whether the connection is HTTP/2, which exchanges bytes between requests too.
    multiplexed: AtomicBool,
    /// Milliseconds from the start of the connection to the end of the last request.
    ended: AtomicU64,
    /// Number of bytes received, and how many of them arrived before the last request ended.
    received: AtomicU64,
    received_before: AtomicU64,
    sent: AtomicU64,
    /// Number of bytes of answers that are not sent yet.
    owed: AtomicU64,
    /// Whether the socket accepts no more bytes, because the client does not read.
    blocked: AtomicBool,
    displaced: Notify,
}

impl Activity {
    pub fn new() -> Self {
        Self {
            opened: Instant::now(),
            open: AtomicUsize::default(),
            served: AtomicBool::default(),
            multiplexed: AtomicBool::default(),
            ended: AtomicU64::default(),
            received: AtomicU64::default(),
            received_before: AtomicU64::default(),
            sent: AtomicU64::default(),
            owed: AtomicU64::default(),
            blocked: AtomicBool::default(),
            displaced: Notify::new(),
        }
    }

    /// Counts a request until the guard is dropped.
    pub fn begin(self: &Arc<Self>, version: Version) -> Arc<OpenRequest> {
        self.open.fetch_add(1, Relaxed);
        self.served.store(true, Relaxed);
        self.multiplexed.store(version >= Version::HTTP_2, Relaxed);
        Arc::new(OpenRequest(Arc::clone(self)))
    }

    fn owes(&self) -> bool {
        self.blocked.load(Relaxed) || self.owed.load(Relaxed) > 0
    }

    /// How long the connection has had no request; `None` if it has one.
    pub fn idle(&self) -> Option<Duration> {
        let ended = Duration::from_millis(self.ended.load(Relaxed));
        let is_idle = self.open.load(Relaxed) == 0 && !self.owes();
        is_idle.then(|| self.opened.elapsed().saturating_sub(ended))
    }

    /// Closes the connection, because another one needs its place.
    pub fn displace(&self) {
        self.displaced.notify_one();
    }

    /// Waits until the connection must be closed, and returns the reason.
    pub async fn overdue(&self) -> &'static str {
        let mut seen = Seen::default();
        loop {
            tokio::select! {
                () = self.displaced.notified() => return "another connection needs its place",
                () = tokio::time::sleep(LOOK) => {}
            }
            if let Some(reason) = seen.look(self) {
                return reason;
            }
        }
    }
}

/// A request without a complete answer.
pub struct OpenRequest(Arc<Activity>);

impl Drop for OpenRequest {
    fn drop(&mut self) {
        let Activity { opened, open, ended, received, received_before, .. } = &*self.0;
        ended.store(opened.elapsed().as_millis() as u64, Relaxed);
        received_before.store(received.load(Relaxed), Relaxed);
        open.fetch_sub(1, Relaxed);
    }
}

/// What the last checks of a connection have found.
#[derive(Debug, Default)]
struct Seen {
    sent: u64,
    received: u64,
    owed: bool,
    /// By how many seconds the client is behind [`SLOWEST`]. A negative number means that the client is ahead: sockets
    /// accept bytes in bursts.
    late: f64,
    /// How long no byte was sent or received.
    silent: Duration,
    /// How long the head of a request has been incomplete.
    unfinished: Duration,
}

impl Seen {
    /// Checks a connection. Returns the reason if the connection must be closed.
    fn look(&mut self, activity: &Activity) -> Option<&'static str> {
        let passed = |is: bool, before: Duration| {
            if is { before + LOOK } else { Duration::ZERO }
        };
        let (sent, received) = (activity.sent.load(Relaxed), activity.received.load(Relaxed));
        let owes = activity.owes();
        let taken = (sent - self.sent) as f64 / SLOWEST as f64;
        let late = (self.late + LOOK.as_secs_f64() - taken).max(-EARLIEST);
        let is_silent = (sent, received) == (self.sent, self.received);
        let idle = activity.idle();
        let is_partial = received > activity.received_before.load(Relaxed)
            && !activity.multiplexed.load(Relaxed);
        let is_unfinished = idle.is_some() && (!activity.served.load(Relaxed) || is_partial);
        *self = Self {
            sent,
            received,
            owed: owes,
            late: if owes && self.owed { late } else { 0.0 },
            silent: passed(is_silent && idle.is_none(), self.silent),
            unfinished: passed(is_unfinished, self.unfinished),
        };
        if self.late >= SLOW.as_secs_f64() {
            Some("the client takes its answer too slowly")
        } else if self.unfinished >= HEAD {
            Some("the head of the request is late")
        } else if self.silent >= SILENT {
            Some("the connection is silent")
        } else if idle.is_some_and(|idle| idle >= IDLE) {
            Some("the connection is idle")
        } else {
            None
        }
    }
}

/// A socket that counts its bytes.
pub struct Watched<T> {
    pub socket: T,
    pub activity: Arc<Activity>,
}

impl<T> Watched<T> {
    fn wrote(&self, written: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        self.activity.blocked.store(written.is_pending(), Relaxed);
        if let Poll::Ready(Ok(bytes)) = written {
            self.activity.sent.fetch_add(bytes as u64, Relaxed);
        }
        written
    }
}

impl<T: AsyncRead + Unpin> AsyncRead for Watched<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let done = ready!(Pin::new(&mut self.socket).poll_read(context, buffer));
        self.activity.received.fetch_add((buffer.filled().len() - before) as u64, Relaxed);
        Poll::Ready(done)
    }
}

impl<T: AsyncWrite + Unpin> AsyncWrite for Watched<T> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.socket).poll_write(context, bytes);
        self.wrote(written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.socket).poll_write_vectored(context, bytes);
        self.wrote(written)
    }

    fn is_write_vectored(&self) -> bool {
        self.socket.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_shutdown(context)
    }
}

/// The body of an answer, which hyper receives in pieces. When the last piece was sent or dropped, the request ends and
/// the memory of the answer is free.
pub struct AnswerBody {
    body: Body,
    /// The part of the present frame that is not in a piece yet.
    rest: Bytes,
    /// What is not in a piece yet. It has 0 bytes for an event stream, because its length is not known.
    owed: Owed,
}

/// The request and the memory that an answer occupies until all of its bytes were sent.
struct Guard {
    request: Arc<OpenRequest>,
    _permit: Option<Arc<Permit>>,
}

/// A number of bytes of an answer that are not sent yet.
struct Owed {
    bytes: u64,
    guard: Arc<Guard>,
}

impl Drop for Owed {
    fn drop(&mut self) {
        self.guard.request.0.owed.fetch_sub(self.bytes, Relaxed);
    }
}

impl AnswerBody {
    /// A body of this many bytes, if their number is known.
    pub fn new(
        body: Body,
        length: Option<u64>,
        request: Arc<OpenRequest>,
        permit: Option<Arc<Permit>>,
    ) -> Self {
        let bytes = length.unwrap_or(0);
        request.0.owed.fetch_add(bytes, Relaxed);
        let guard = Arc::new(Guard { request, _permit: permit });
        Self { body, rest: Bytes::new(), owed: Owed { bytes, guard } }
    }

    /// The next piece of the present frame. hyper drops it after it has sent it.
    fn piece(&mut self) -> Bytes {
        /// Size of a piece, in bytes. Most results fit into one piece.
        const SIZE: usize = 256 << 10;
        let bytes = self.rest.split_to(self.rest.len().min(SIZE));
        let owed = (bytes.len() as u64).min(self.owed.bytes);
        self.owed.bytes -= owed;
        holding(bytes, Owed { bytes: owed, guard: Arc::clone(&self.owed.guard) })
    }
}

impl HttpBody for AnswerBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if self.rest.is_empty() {
            match ready!(Pin::new(&mut self.body).poll_frame(context)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                end => return Poll::Ready(end),
            }
        }
        Poll::Ready(Some(Ok(Frame::data(self.piece()))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.rest.len() as u64) + self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use http_body_util::BodyExt as _;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, duplex};

    use super::*;

    /// The number of checks after which a connection is closed, and the reason. `each` is called before each check.
    fn closed(activity: &Activity, mut each: impl FnMut()) -> Option<(usize, &'static str)> {
        let mut seen = Seen::default();
        (1..=30).find_map(|looks| {
            each();
            seen.look(activity).map(|reason| (looks, reason))
        })
    }

    #[test]
    fn the_head_of_a_request_must_arrive_in_time() {
        let activity = Arc::new(Activity::new());
        let late = Some((2, "the head of the request is late"));
        assert_eq!(closed(&activity, || ()), late);
        // More bytes do not extend the time if they do not complete the head.
        let trickle = || {
            activity.received.fetch_add(1, Relaxed);
        };
        assert_eq!(closed(&activity, trickle), late);
        drop(activity.begin(Version::HTTP_11));
        assert_eq!(closed(&activity, || ()), None, "a connection may be idle for a while");
        assert_eq!(closed(&activity, trickle), late);
        drop(activity.begin(Version::HTTP_2));
        assert_eq!(closed(&activity, trickle), None, "HTTP/2 has bytes between requests");
    }

    #[test]
    fn a_client_must_read_its_answer_in_time_but_the_server_may_compute_for_long() {
        let activity = Arc::new(Activity::new());
        let request = activity.begin(Version::HTTP_11);
        let alive = || {
            activity.sent.fetch_add(1, Relaxed);
        };
        assert_eq!(closed(&activity, alive), None, "the server computes");
        let mut body = AnswerBody::new(Body::from(vec![0; 1 << 20]), Some(1 << 20), request, None);
        let slow = "the client takes its answer too slowly";
        assert_eq!(closed(&activity, alive), Some((6, slow)));
        let steady = || {
            activity.sent.fetch_add(SLOWEST * LOOK.as_secs(), Relaxed);
        };
        assert_eq!(closed(&activity, steady), None);
        // The number of unsent bytes of an event stream is not known, but a client that does not read blocks its
        // socket.
        let (mut taken, mut pieces) = (0, Vec::new());
        while let Some(Some(frame)) = futures_util::FutureExt::now_or_never(body.frame())
            .map(|frame| frame.transpose().unwrap())
        {
            let data = frame.into_data().unwrap();
            taken += data.len();
            pieces.push(data);
        }
        drop(body);
        assert_eq!((taken, activity.owes()), (1 << 20, true));
        assert!(activity.idle().is_none(), "the request ends when its last piece was sent");
        drop(pieces);
        assert!(activity.idle().is_some() && !activity.owes());
        activity.blocked.store(true, Relaxed);
        assert_eq!(closed(&activity, alive), Some((6, slow)));
    }

    #[test]
    fn a_connection_without_any_bytes_during_a_request_is_closed() {
        let activity = Arc::new(Activity::new());
        let _request = activity.begin(Version::HTTP_2);
        assert_eq!(closed(&activity, || ()), Some((24, "the connection is silent")));
    }

    #[tokio::test]
    async fn a_socket_counts_its_bytes_and_tells_when_it_is_blocked() {
        let (mut client, socket) = duplex(16);
        let activity = Arc::new(Activity::new());
        let mut server = Watched { socket, activity: Arc::clone(&activity) };
        client.write_all(b"four").await.unwrap();
        server.read_exact(&mut [0; 4]).await.unwrap();
        assert_eq!(activity.received.load(Relaxed), 4);
        let written = futures_util::FutureExt::now_or_never(server.write_all(&[0; 64]));
        assert!(written.is_none() && activity.owes());
        assert_eq!(activity.sent.load(Relaxed), 16);
        client.read_exact(&mut [0; 16]).await.unwrap();
        server.write_all(b"more").await.unwrap();
        assert!(!activity.owes());
    }
}
