//! Serves the API on a socket.

use std::convert::Infallible;
use std::io::{self, Write as _};
use std::net::{IpAddr, SocketAddr};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::http::HeaderMap;
use axum::response::Response;
use futures_util::FutureExt as _;
use hyper::body::Incoming;
use hyper::service::service_fn;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::time::sleep;
use tower::ServiceExt as _;

use super::admission::{Admission, OpenConnection};
use super::connection::{Activity, AnswerBody, Watched};
use crate::http::access::caller::{Peer, ViaProxy};
use crate::http::shares::Permit;
use crate::http::wire::length_of;

/// Size of the buffers of one connection in each direction, in bytes.
const BUFFER: usize = 64 << 10;
/// Maximum number of concurrent requests of one HTTP/2 connection.
const STREAMS: u32 = 16;
/// How long the server waits after it could not accept a connection, for example because it has too many open files.
const PAUSE: Duration = Duration::from_millis(200);
/// The answer on a connection that the server does not accept.
const REFUSAL: &[u8] =
    b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nConnection: close\r\n\
    Content-Type: text/plain\r\nContent-Length: 75\r\n\r\n\
    The server has too many connections. Close some of yours, or try it later.\n";

/// Listens on an address.
///
/// # Errors
/// The address is in use, or not of this machine.
pub fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    /// Maximum number of connections that wait until the server accepts them. The system of a client beyond this number
    /// tries again after a second.
    const BACKLOG: u32 = 4096;
    let socket = match address {
        SocketAddr::V4(_) => TcpSocket::new_v4()?,
        SocketAddr::V6(_) => TcpSocket::new_v6()?,
    };
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// Serves the router on all connections of a listener. When `closing` ends, accepts no more connections, and returns
/// when all of them are closed.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    admission: Arc<Admission>,
    closing: impl Future<Output = ()>,
) {
    let (builder, graceful) = (builder(), GracefulShutdown::new());
    let mut closing = pin!(closing);
    loop {
        let (socket, address) = tokio::select! {
            accepted = accept(&listener) => accepted,
            () = &mut closing => break,
        };
        let Some(open) = admission.admit(address) else {
            // If the socket does not take these bytes at once, the client learns only that it is closed.
            let _ = socket.into_std().and_then(|mut socket| socket.write(REFUSAL));
            continue;
        };
        // The socket then sends small answers at once. If this call fails, they are only delayed.
        let _ = socket.set_nodelay(true);
        let activity = Arc::clone(&open.activity);
        let is_proxy = admission.is_proxy(address);
        let (router, requests) = (router.clone(), Arc::clone(&activity));
        let client = Peer::from(address);
        let service = service_fn(move |request: hyper::Request<Incoming>| {
            let mut request = request;
            if is_proxy {
                request.extensions_mut().insert(ViaProxy);
            }
            let peer = if is_proxy { forwarded(request.headers()).map(Peer::from) } else { None };
            answer(&router, request, peer.unwrap_or_else(|| client.clone()), &requests)
        });
        let io = TokioIo::new(Watched { socket, activity });
        let connection = graceful.watch(builder.serve_connection(io, service).into_owned());
        #[expect(clippy::disallowed_methods, reason = "the task ends with its connection")]
        tokio::spawn(watch(connection, open));
    }
    drop(listener);
    graceful.shutdown().await;
}

fn builder() -> Builder<TokioExecutor> {
    let mut builder = Builder::new(TokioExecutor::new());
    // `Activity` limits the time for the head of a request. The limit of hyper would close idle connections too early.
    builder.http1().timer(TokioTimer::new()).header_read_timeout(None).max_buf_size(BUFFER);
    let mut http2 = builder.http2();
    http2.max_concurrent_streams(STREAMS);
    http2.timer(TokioTimer::new()).max_send_buf_size(BUFFER).max_header_list_size(BUFFER as u32);
    http2
        .initial_stream_window_size(BUFFER as u32)
        .initial_connection_window_size(2 * BUFFER as u32);
    builder
}

/// The next connection and the address of its client.
async fn accept(listener: &TcpListener) -> (TcpStream, IpAddr) {
    loop {
        match listener.accept().await {
            Ok((socket, address)) => return (socket, address.ip().to_canonical()),
            Err(error) if is_of_client(&error) => {}
            Err(error) => {
                tracing::error!(%error, "cannot accept a connection");
                sleep(PAUSE).await;
            }
        }
    }
}

/// Whether the client closed its connection before it was accepted.
fn is_of_client(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

/// Serves a connection until its end, or until the server closes it.
async fn watch<E: std::fmt::Debug>(
    connection: impl Future<Output = Result<(), E>>,
    open: OpenConnection,
) {
    tokio::select! {
        ended = connection => {
            if let Err(error) = ended {
                tracing::debug!(?error, "a connection failed");
            }
        }
        reason = open.activity.overdue() => tracing::debug!(reason, "closed a connection"),
    }
}

fn answer(
    router: &Router,
    request: hyper::Request<Incoming>,
    peer: Peer,
    activity: &Arc<Activity>,
) -> impl Future<Output = Result<Response<AnswerBody>, Infallible>> + use<> {
    let open = activity.begin(request.version());
    let mut request: Request = request.map(Body::new);
    request.extensions_mut().insert(peer);
    request.extensions_mut().insert(Arc::clone(&open));
    router.clone().oneshot(request).map(|answer| {
        answer.map(|mut answer| {
            let permit = answer.extensions_mut().remove::<Arc<Permit>>();
            let length = length_of(&answer);
            answer.map(|body| AnswerBody::new(body, length, open, permit))
        })
    })
}

/// The address of a client of a reverse proxy: the last address in `X-Forwarded-For`. The addresses before it may come
/// from the client itself.
fn forwarded(headers: &HeaderMap) -> Option<IpAddr> {
    let last = headers.get_all("x-forwarded-for").iter().next_back()?.to_str().ok()?;
    let last = last.rsplit(',').next()?.trim();
    let with_port = || last.parse::<SocketAddr>().ok();
    let address: Option<IpAddr> = last.parse().ok().or_else(|| Some(with_port()?.ip()));
    address.map(|address| address.to_canonical())
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    #[test]
    fn the_refusal_has_the_stated_length() {
        let text = std::str::from_utf8(REFUSAL).unwrap();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        assert!(head.contains(&format!("Content-Length: {}", body.len())), "{}", body.len());
    }

    #[test]
    fn the_last_forwarded_address_is_the_client() {
        let read = |values: &[&'static str]| {
            let mut headers = HeaderMap::new();
            for value in values {
                headers.append("x-forwarded-for", HeaderValue::from_static(value));
            }
            forwarded(&headers).map(|address| address.to_string())
        };
        assert_eq!(read(&["198.51.100.7"]).as_deref(), Some("198.51.100.7"));
        assert_eq!(read(&["10.0.0.1, 198.51.100.7"]).as_deref(), Some("198.51.100.7"));
        assert_eq!(read(&["198.51.100.7:4711"]).as_deref(), Some("198.51.100.7"));
        assert_eq!(read(&["[fd00::1]:80"]).as_deref(), Some("fd00::1"));
        assert_eq!(read(&["unknown"]), None);
        assert_eq!(read(&[]), None);
    }
}
